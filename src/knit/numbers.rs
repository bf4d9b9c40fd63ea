//! What a fabric takes and weighs: run-in, yarn length, mass.
//!
//! In: a [`Fabric`]. Out: [`Numbers`] of its repeat, from the length of the laid-out yarn path and the yarn's count; never from the drawn
//! radius. Source: the specification's knit page. Not promised: loops are laid out, not relaxed, so a mill's run-in may differ by some percent.

use super::Pattern;
use super::repeat::{Repeat, Yarn};
use crate::fabric::{BarKind, Fabric};
use crate::ids::index32;
use crate::yarn::curve::{self, Span};

/// Courses of a rack, by the trade's custom.
const RACK: f64 = 480.0;

/// A fabric in numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbers {
    /// mm of yarn for 480 courses, a bar each, front first; none for wefts, which no guide leads along the wales.
    pub run_in: Vec<Option<f64>>,
    /// g/m² of flat cloth.
    pub mass: f64,
    /// m of yarn in a m² of flat cloth.
    pub yarn_length: f64,
}

/// Measures a repeat of the fabric.
///
/// ```
/// use warpknit::{fabric::Fabric, knit::{Pattern, numbers}};
/// // A locknit of 44 dtex at 15 x 22 per cm weighs 80 to 110 g/m², mills say.
/// let locknit = Fabric::named("locknit").unwrap().at_densities(15.0, 22.0).unwrap();
/// assert!((80.0..110.0).contains(&numbers::measure(&locknit, &Pattern::new(&locknit)).mass));
/// ```
#[must_use]
pub fn measure(fabric: &Fabric, pattern: &Pattern) -> Numbers {
    let mut numbers = Numbers { run_in: Vec::new(), mass: 0.0, yarn_length: 0.0 };
    for (at, bar) in fabric.bars.iter().enumerate() {
        let per_step = pattern.lengths_per_step(at);
        let sum: f64 = per_step.iter().flatten().sum();
        let threaded = f64::from(index32(per_step.iter().flatten().count()));
        // mm of yarn on a mm² is also km on a m²; tex is g a km.
        let kilometres = sum / f64::from(index32(per_step.len())) / (fabric.wale_spacing() * fabric.course_spacing());
        numbers.run_in.push((bar.kind == BarKind::Guide).then(|| RACK * sum / threaded));
        numbers.yarn_length += 1000.0 * kilometres;
        numbers.mass += bar.yarn.count.tex() * kilometres;
    }
    numbers
}

impl Pattern {
    /// mm of yarn a step, for each guide of a bar in the repeat (each course, for wefts) that has a yarn.
    fn lengths_per_step(&self, bar: usize) -> Vec<Option<f64>> {
        let length = |&yarn: &usize| {
            let yarn = &self.repeat.yarns[yarn];
            self.repeat.length(yarn) / f64::from(index32(yarn.steps.len() - 1))
        };
        self.bars[bar].yarns.iter().map(|yarn| yarn.as_ref().map(length)).collect()
    }
}

impl Repeat {
    /// mm of a yarn in one repeat.
    fn length(&self, yarn: &Yarn) -> f64 {
        let points = self.unrolled(yarn);
        (1..points.len() - 2).map(|at| length(&curve::span(&points, at))).sum()
    }
}

/// Length of a span, mm: Gauss-Legendre with five points, good to 1e-6 of it on a stitch's bends.
fn length(span: &Span) -> f64 {
    const NODES: [(f64, f64); 5] = [
        (0.046_910_077_030_668, 0.118_463_442_528_094_5),
        (0.230_765_344_947_158_5, 0.239_314_335_249_683_2),
        (0.5, 0.284_444_444_444_444_4),
        (0.769_234_655_052_841_5, 0.239_314_335_249_683_2),
        (0.953_089_922_969_332, 0.118_463_442_528_094_5),
    ];
    NODES.iter().map(|(t, weight)| weight * span.tangent(*t).length()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_inlay_is_as_long_as_the_cloth() {
        let text = Fabric::named("tricot").unwrap().to_string().replace("1-2/1-0//", "0-0//");
        let fabric = Fabric::parse(&text).unwrap();
        let numbers = measure(&fabric, &Pattern::straight(&fabric));
        assert!((numbers.run_in[0].unwrap() - 480.0 * fabric.course_spacing()).abs() < 1e-6);
    }

    #[test]
    fn the_longer_underlap_takes_more_yarn() {
        let fabric = Fabric::named("locknit").unwrap();
        let run_in = measure(&fabric, &Pattern::new(&fabric)).run_in;
        let ratio = run_in[0].unwrap() / run_in[1].unwrap();
        assert!((1.2..1.4).contains(&ratio), "mills run 1.24 to 1.35 : 1, here {ratio}");
    }
}
