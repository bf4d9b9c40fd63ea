//! What a fabric takes and weighs: run-in, yarn length, mass.
//!
//! In: a [`Fabric`]. Out: [`Numbers`] of its repeat, from the length of the laid-out yarn path and the yarn's count; never from the drawn
//! radius. Source: the specification's knit page. Not promised: loops are laid out, not relaxed, so a mill's run-in may differ by some percent.

use glam::DVec2;

use super::mesh::StructureMesh;
use super::{KnitError, Knitted, Pattern};
use crate::fabric::Fabric;
use crate::yarn::curve::{self, Span};

/// Courses of a rack, by the trade's custom.
const RACK: f64 = 480.0;

/// A fabric in numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbers {
    /// mm of yarn for 480 courses, a bar each, front first.
    pub run_in: Vec<f64>,
    /// g/m² of flat cloth.
    pub mass: f64,
    /// m of yarn in a m² of flat cloth.
    pub yarn_length: f64,
}

/// Measures a repeat of the fabric.
///
/// # Errors
/// Laps that can't be knitted.
///
/// ```
/// use warpknit::{fabric::Fabric, knit::numbers};
/// // A locknit of 44 dtex at 15 x 22 per cm weighs 80 to 110 g/m², mills say.
/// let locknit = Fabric::named("locknit").unwrap().at_densities(15.0, 22.0).unwrap();
/// assert!((80.0..110.0).contains(&numbers::measure(&locknit).unwrap().mass));
/// ```
pub fn measure(fabric: &Fabric) -> Result<Numbers, KnitError> {
    let pattern = Pattern::new(fabric)?;
    let mesh = StructureMesh::anchored_at(fabric, DVec2::ZERO);
    let mut numbers = Numbers { run_in: Vec::new(), mass: 0.0, yarn_length: 0.0 };
    for (at, bar) in fabric.bars.iter().enumerate() {
        let per_course = length_per_course(&pattern, at, &mesh);
        let threaded = (0i64..).take(bar.threading.repeat()).filter(|&guide| bar.threading.carries(guide)).count();
        #[expect(clippy::cast_precision_loss, reason = "a threading has few marks")]
        let share = threaded as f64 / bar.threading.repeat() as f64;
        // mm of yarn on a mm² is also km on a m²; tex is g a km.
        let kilometres = share * per_course / (fabric.wale_spacing() * fabric.course_spacing());
        numbers.run_in.push(RACK * per_course);
        numbers.yarn_length += 1000.0 * kilometres;
        numbers.mass += bar.yarn.count.tex() * kilometres;
    }
    Ok(numbers)
}

/// mm of yarn a course, over one repeat of the chain with a repeat on both sides.
fn length_per_course(pattern: &Pattern, bar: usize, mesh: &StructureMesh) -> f64 {
    let courses = i64::try_from(pattern.bars[bar].laps.len()).expect("a chain is far shorter than 2^63");
    let mut knitted = Knitted::default();
    pattern.lay(bar, 0, -courses..2 * courses, mesh, &mut knitted);
    let points = pattern.points_per_repeat(bar);
    let length: f64 = (points..2 * points).map(|i| length(&curve::span(&knitted.points, i))).sum();
    #[expect(clippy::cast_precision_loss, reason = "repeats are limited to 10 000 courses")]
    let courses = courses as f64;
    length / courses
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
        let numbers = measure(&fabric).unwrap();
        assert!((numbers.run_in[0] - 480.0 * fabric.course_spacing()).abs() < 1e-6);
    }

    #[test]
    fn the_longer_underlap_takes_more_yarn() {
        let locknit = measure(&Fabric::named("locknit").unwrap()).unwrap();
        let ratio = locknit.run_in[0] / locknit.run_in[1];
        assert!((1.2..1.4).contains(&ratio), "mills run 1.24 to 1.35 : 1, here {ratio}");
    }
}
