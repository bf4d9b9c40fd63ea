//! A fabric's numbers for its designer: run-in, yarn length, mass, thickness, cover factor and
//! porosity.
//!
//! In: a [`Fabric`] and its [`Pattern`]. Out: [`Numbers`] of its repeat. Lengths and masses come
//! from the relaxed yarn path and the yarn's count (tex, grams a kilometre) over its draft, never
//! from the drawn radius. Thickness and cover factor come from the yarns as they are laid out, at
//! [`Fabric::radius`]. `docs/method.md` has the formulas. Cost: some 20 ms, most of it the
//! cover factor. Not promised: the figures of a mill, whose cloth is stretched and heat-set. This
//! cloth lies at the densities that its file gives.

use super::repeat::{Repeat, RepeatYarn};
use super::{Pattern, cover};
use crate::fabric::{Fabric, RACK, Structure};
use crate::ids::index32;
use crate::yarn::curve;

/// A fabric in numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbers {
    /// mm of yarn for 480 courses, a bar each, front first. Wefts have none, since no guide leads
    /// them along the wales.
    pub run_in: Vec<Option<f64>>,
    /// The same of the relaxed yarn, run-in over draft. Only yarns with a draft have one.
    pub relaxed_run_in: Vec<Option<f64>>,
    /// Mean distance of the two legs of a loop at half of its height, mm, for each bar or feeder.
    /// Those that make no loops have none.
    pub loop_width: Vec<Option<f64>>,
    /// g of each bar's yarns in a m² of flat cloth, front first.
    pub bar_mass: Vec<f64>,
    /// g/m² of flat cloth.
    pub mass: f64,
    /// m of yarn in a m² of flat cloth.
    pub yarn_length: f64,
    /// From the lowest to the highest yarn surface, mm.
    pub thickness: f64,
    /// Cover factor: share of the flat area that yarns hide, seen from the front, to 0.005.
    pub cover: f64,
    /// Share of the cloth's volume, area times thickness, that no fibre fills. There is none where
    /// yarns are drawn thinner than they are, since the thickness is then too small.
    pub porosity: Option<f64>,
}

/// Measures a repeat of the fabric.
///
/// ```
/// use warpknit_core::{fabric::Fabric, knit::{Pattern, numbers}};
/// // Mills state 80 to 110 g/m² for a locknit of 44 dtex at 15 x 22 per cm.
/// let locknit = Fabric::named("locknit").unwrap().at_densities(15.0, 22.0).unwrap();
/// assert!((80.0..110.0).contains(&numbers::measure(&locknit, &Pattern::new(&locknit)).mass));
/// ```
#[must_use]
pub fn measure(fabric: &Fabric, pattern: &Pattern) -> Numbers {
    let body = cover::measure(fabric, pattern);
    let (mut run_in, mut relaxed_run_in, mut bar_mass) = (Vec::new(), Vec::new(), Vec::new());
    let (mut yarn_length, mut fibre) = (0.0, 0.0);
    for (at, yarn) in fabric.yarns().enumerate() {
        let per_step = pattern.lengths_per_step(at);
        let sum: f64 = per_step.iter().flatten().sum();
        // mm of yarn on a mm² is the same number as km on a m², and tex is g a km.
        let kilometres = sum
            / f64::from(index32(per_step.len()))
            / (fabric.wale_spacing() * fabric.course_spacing());
        let mass = yarn.tex_in_cloth() * kilometres;
        let fed = self::run_in(&per_step).filter(|_| is_lapped(fabric, at));
        run_in.push(fed);
        relaxed_run_in.push(fed.zip(yarn.draft).map(|(fed, draft)| fed / draft));
        bar_mass.push(mass);
        yarn_length += 1000.0 * kilometres;
        // g/m² divided by g/cm³ is the thickness of the solid fibre in micrometres.
        fibre += mass / yarn.density / 1000.0;
    }
    let mass = bar_mass.iter().sum();
    let is_thinned = fabric.radius() < fabric.true_radius() * fabric.enlargement;
    let porosity = (body.thickness > 0.0 && !is_thinned).then(|| 1.0 - fibre / body.thickness);
    Numbers {
        run_in,
        relaxed_run_in,
        loop_width: pattern.loop_widths(fabric),
        bar_mass,
        mass,
        yarn_length,
        thickness: body.thickness,
        cover: body.cover,
        porosity,
    }
}

/// mm a rack of yarns with these lengths a step; `None` where no guide is threaded.
pub(super) fn run_in(per_step: &[Option<f64>]) -> Option<f64> {
    let threaded = per_step.iter().flatten().count();
    let sum: f64 = per_step.iter().flatten().sum();
    (threaded > 0).then(|| RACK * sum / f64::from(index32(threaded)))
}

/// Whether guides lap a system's yarns along the wales, so that they have a run-in.
fn is_lapped(fabric: &Fabric, system: usize) -> bool {
    match &fabric.structure {
        Structure::Warp(knit) => knit.bars[system].chain().is_some(),
        Structure::Weft(_) | Structure::Laid(_) => false,
    }
}

impl Pattern {
    /// mm of yarn a step, for each guide of a bar in the repeat (each course, for wefts) that has a
    /// yarn.
    pub(super) fn lengths_per_step(&self, bar: usize) -> Vec<Option<f64>> {
        let yarns = self.bars[bar].yarns.iter();
        yarns
            .map(|yarn| {
                yarn.map(|yarn| {
                    let yarn = &self.repeat.yarns[yarn];
                    self.repeat.length(yarn) / f64::from(index32(yarn.steps.len() - 1))
                })
            })
            .collect()
    }
}

impl Repeat {
    /// mm of a yarn in one repeat.
    fn length(&self, yarn: &RepeatYarn) -> f64 {
        let points = self.unrolled(yarn);
        (1..points.len() - 2).map(|at| curve::span(&points, at).precise_length()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_inlay_is_as_long_as_the_cloth() {
        let fabric =
            Fabric::named("tricot").unwrap().with_chains(&["0-0//".to_owned()], &[]).unwrap();
        let numbers = measure(&fabric, &Pattern::new(&fabric));
        assert!((numbers.run_in[0].unwrap() - 480.0 * fabric.course_spacing()).abs() < 1e-6);
    }

    #[test]
    fn yarns_that_are_drawn_thinner_than_they_are_have_no_porosity() {
        let thick = Fabric::named("locknit").unwrap().to_string().replace("44 dtex", "5000 tex");
        let fabric = Fabric::parse(&thick).unwrap();
        assert_eq!(measure(&fabric, &Pattern::new(&fabric)).porosity, None);
    }

    #[test]
    fn porosity_of_parallel_yarns_in_closed_form() {
        let fabric =
            Fabric::named("tricot").unwrap().with_chains(&["0-0//".to_owned()], &[]).unwrap();
        let numbers = measure(&fabric, &Pattern::new(&fabric));
        // A round yarn fills pi/4 of the square around it, its fibres `packing` of that, and beside
        // it is air.
        let yarn = fabric.yarn(0);
        let filled =
            std::f64::consts::FRAC_PI_4 * yarn.packing * yarn.diameter() / fabric.wale_spacing();
        let porosity = numbers.porosity.unwrap();
        assert!((porosity - (1.0 - filled)).abs() < 1e-3, "{porosity} {filled}");
        assert!((numbers.mass - numbers.bar_mass[0]).abs() < 1e-12);
    }

    #[test]
    fn a_draft_divides_mass_and_relaxed_length() {
        let mut fabric =
            Fabric::named("tricot").unwrap().with_chains(&["0-0//".to_owned()], &[]).unwrap();
        let mut measured = |draft| {
            fabric.structure.yarns_mut().next().unwrap().draft = draft;
            (measure(&fabric, &Pattern::new(&fabric)), fabric.clone())
        };
        let (plain, _) = measured(None);
        let (drafted, fabric) = measured(Some(2.5));
        // The inlay is straight, one in a wale: 1 / W mm of yarn on a mm² of cloth.
        let mass = fabric.yarn(0).count.tex() / fabric.wale_spacing();
        assert!((plain.bar_mass[0] - mass).abs() < 1e-9);
        assert!((drafted.bar_mass[0] - mass / 2.5).abs() < 1e-9);
        let relaxed = 480.0 * fabric.course_spacing() / 2.5;
        assert!((drafted.relaxed_run_in[0].unwrap() - relaxed).abs() < 1e-6);
        assert_eq!(plain.relaxed_run_in, [None]);
    }

    #[test]
    fn the_longer_underlap_takes_more_yarn() {
        let fabric = Fabric::named("locknit").unwrap();
        let run_in = measure(&fabric, &Pattern::new(&fabric)).run_in;
        let ratio = run_in[0].unwrap() / run_in[1].unwrap();
        assert!((1.2..1.4).contains(&ratio), "mills run 1.24 to 1.35 : 1, here {ratio}");
    }
}
