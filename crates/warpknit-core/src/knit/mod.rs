//! From lapping to data points: the yarns of a fabric on a flat panel.
//!
//! In: a [`Fabric`] and the place of its [`StructureMesh`]. Out: [`Knitted`] data points, step
//! after step, eight a loop, in panel axes (x across the wales, y along them, z towards the
//! technical face), mm. Nothing here knows of garments.
//!
//! All computation is done on one repeat (`making`). Laying a yarn on a panel then takes one addition
//! a point (about 5 ns).
//!
//! Source: Liu, Kyosev and Jiang 2022, "Yarn-level modelling and geometric simulation of
//! warp-knitted clothing elements", section 2; formulas and constants in `docs/method.md`. Not
//! promised: that yarns fit into the densities given; [`Relaxation`] and [`clearance`] tell. Repeats
//! over [`MAX_RELAXED_LAPS`] laps have straight wales and are not relaxed.

mod cell_list;
mod chain;
pub mod clearance;
mod cover;
mod lattice;
pub mod links;
mod loops;
mod making;
pub mod mesh;
pub mod numbers;
mod points;
mod relax;
mod repeat;
pub mod run_in;
pub mod spread;
mod stitch;
pub mod strain;
pub mod upright;
pub mod weft;

use std::ops::Range;

use glam::DVec2;

#[cfg(doc)]
use crate::fabric::Fabric;
use crate::ids::index32;
pub use cover::visible_shares;
use mesh::StructureMesh;
pub use points::{Bed, Knitted, PointKind, Tag};
pub use relax::Relaxation;
use repeat::Repeat;

/// The largest repeat that is relaxed, laps: one or two minutes' work.
pub const MAX_RELAXED_LAPS: usize = 50_000;

/// Gets the share of a work that is done, from 0 to 1.
pub type Progress<'a> = &'a mut dyn FnMut(f64);

/// One bar's repeat.
#[derive(Clone, Debug)]
struct BarPattern {
    /// Whether its yarns run across the wales and not along them.
    runs_across: bool,
    /// For each guide of the repeat (for a weft: each course), the index in [`Repeat::yarns`] of
    /// its yarn, if it has one.
    yarns: Vec<Option<usize>>,
    /// Bounding box of its yarns, relative to gap 0 of their guide and to the course of their step,
    /// mm.
    bounds: (DVec2, DVec2),
}

/// The repeat of a fabric as data points.
///
/// A bar's yarns are numbered by their guides and take a step a course. Wefts are numbered by their
/// courses and take a step a wale.
#[derive(Clone, Debug)]
pub struct Pattern {
    repeat: Repeat,
    bars: Vec<BarPattern>,
    /// W and C, mm.
    spacing: DVec2,
    /// Wales and courses of the repeat.
    size: [usize; 2],
    /// How the relaxation ended, if there was one.
    relaxation: Option<Relaxation>,
    /// The data point at which it left two yarns nearest.
    tightest: Option<usize>,
}

/// A yarn of the cloth as a copy of one of the repeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct YarnCopy {
    /// The yarn of the repeat.
    pub(crate) yarn: usize,
    /// Whether it runs across the wales.
    pub(crate) runs_across: bool,
    /// Cells from that yarn to this copy, across the way it runs.
    pub(crate) beside: i64,
    /// Index of its first data point, counted along the endless yarn from the one in cell 0.
    pub(crate) first: i64,
}

impl Pattern {
    /// Where two yarns are nearest: the bar, counted from 0, and the place in the repeat.
    #[must_use]
    pub fn tightest(&self) -> Option<(usize, Tag)> {
        let point = self.tightest?;
        let yarn =
            self.repeat.yarns.iter().find(|yarn| self.repeat.points_of(yarn).contains(&point))?;
        Some((yarn.bar, self.repeat.tags[point]))
    }

    /// How the relaxation of the yarns ended; `None` where the repeat is too large for it.
    #[must_use]
    pub fn relaxation(&self) -> Option<Relaxation> {
        self.relaxation
    }

    /// Wale and course of a data point as those of the repeat, from 0.
    pub(crate) fn in_repeat(&self, tag: Tag) -> [usize; 2] {
        let [wales, courses] = self.size;
        [wrap(i64::from(tag.wale), wales), wrap(i64::from(tag.course), courses)]
    }

    /// Data points of one yarn of a bar in one repeat.
    ///
    /// # Panics
    /// If `bar` is not one of the fabric's.
    #[must_use]
    pub fn points_per_repeat(&self, bar: usize) -> usize {
        let yarn = self.bars[bar].yarns.iter().flatten().next();
        yarn.map_or(0, |&yarn| self.repeat.points_of(&self.repeat.yarns[yarn]).len())
    }

    /// Wale and course spacing, mm.
    #[must_use]
    pub fn spacing(&self) -> DVec2 {
        self.spacing
    }

    /// Lowest and highest data point of the repeat, mm from the middle of the cloth.
    #[must_use]
    pub fn depths(&self) -> [f64; 2] {
        let depths = self.repeat.points.iter().map(|point| point.z);
        depths.fold([0.0, 0.0], |[low, high], z| [z.min(low), z.max(high)])
    }

    /// Width and height of the repeat, mm.
    pub(crate) fn repeat_size(&self) -> DVec2 {
        self.spacing * as_vec(self.size[0], self.size[1])
    }

    /// Data points on a mm² of flat cloth, on average, were every guide threaded.
    pub(crate) fn points_per_area(&self) -> f64 {
        let points = self.bars.iter().filter_map(|bar| {
            let yarn = &self.repeat.yarns[*bar.yarns.iter().flatten().next()?];
            let [points, steps] = [self.repeat.points_of(yarn).len(), yarn.steps.len() - 1]
                .map(|count| f64::from(index32(count)));
            Some(points / steps)
        });
        points.sum::<f64>() / self.spacing.element_product()
    }

    /// Whether a bar's yarns run across the wales, as wefts and feeders' yarns do. All others run
    /// along them.
    #[must_use]
    pub fn runs_across(&self, bar: usize) -> bool {
        self.bars[bar].runs_across
    }

    /// A bar's yarn of that number as a copy of one of the repeat, from one of its steps on. Nothing
    /// where the bar has no such yarn.
    pub(crate) fn copy(&self, bar: usize, number: i64, step: i64) -> Option<YarnCopy> {
        let pattern = &self.bars[bar];
        let yarn = pattern.yarn(number)?;
        let own = &self.repeat.yarns[yarn];
        let [wales, courses] = self.size.map(as_i64);
        let cells = if pattern.runs_across { courses } else { wales };
        let steps = as_i64(own.steps.len() - 1);
        let place = usize::try_from(step.rem_euclid(steps)).expect("a remainder is not negative");
        let points = self.repeat.points_of(own);
        let first = self.repeat.points_of_steps(own, place..place + 1).start - points.start;
        Some(YarnCopy {
            yarn,
            runs_across: pattern.runs_across,
            beside: (number - as_i64(own.guide)).div_euclid(cells),
            first: step.div_euclid(steps) * as_i64(points.len()) + as_i64(first),
        })
    }

    /// Whether a bar has a yarn of that number: whether that guide is threaded, or that course gets
    /// a yarn.
    ///
    /// # Panics
    /// If `bar` is not one of the fabric's.
    #[must_use]
    pub fn has_yarn(&self, bar: usize, number: i64) -> bool {
        self.bars[bar].yarn(number).is_some()
    }

    /// Numbers of a bar's yarns that may touch a range of x (for wefts: of y), mm from gap 0 of
    /// guide 0, course 0.
    pub fn yarns_over(&self, bar: usize, range: Range<f64>) -> impl Iterator<Item = i64> {
        let bar = &self.bars[bar];
        let numbers = steps(range, bar.extent(0), self.spacing[bar.axis(0)]);
        numbers.filter(|&number| bar.yarn(number).is_some())
    }

    /// The range of x (for a weft: of y) that a yarn covers, mm from gap 0 of guide 0, course 0.
    #[must_use]
    pub fn strip(&self, bar: usize, number: i64) -> Range<f64> {
        let bar = &self.bars[bar];
        #[expect(
            clippy::cast_precision_loss,
            reason = "guides and courses are counted in thousands"
        )]
        let at = number as f64 * self.spacing[bar.axis(0)];
        let extent = bar.extent(0);
        at + extent.start..at + extent.end
    }

    /// The steps of a bar's yarns whose points may touch a range of y (for wefts: of x), mm from
    /// gap 0 of guide 0, course 0.
    #[must_use]
    pub fn steps_along(&self, bar: usize, range: Range<f64>) -> Range<i64> {
        let bar = &self.bars[bar];
        steps(range, bar.extent(1), self.spacing[bar.axis(1)])
    }

    /// Lays one yarn: appends its data points over `steps` to `knitted`. A number without a yarn
    /// adds nothing.
    ///
    /// # Panics
    /// If `bar` is not one of the fabric's.
    pub fn lay(
        &self,
        bar: usize,
        number: i64,
        steps: Range<i64>,
        mesh: &StructureMesh,
        knitted: &mut Knitted,
    ) {
        let bar = &self.bars[bar];
        let Some(yarn) = bar.yarn(number).map(|yarn| &self.repeat.yarns[yarn]) else { return };
        let repeat = i64::from(index32(yarn.steps.len() - 1));
        let number = number - i64::from(index32(yarn.guide));
        let gap_0 = mesh.vertex(0, 0) - DVec2::new(self.spacing.x / 2.0, 0.0);
        for step in steps {
            // A step of the endless yarn is a step of the repeat and an image shift, in whole wales
            // and courses. Points are computed once a repeat, so all its copies are equal but for
            // the rounding of this one addition.
            let place = step.rem_euclid(repeat);
            let shift =
                if bar.runs_across { [step - place, number] } else { [number, step - place] };
            let [wales, courses] = shift.map(|count| {
                i32::try_from(count).expect("a panel has fewer wales and courses than 2^31")
            });
            let offset = (gap_0 + self.spacing * DVec2::new(f64::from(wales), f64::from(courses)))
                .extend(0.0);
            let place = usize::try_from(place).expect("a remainder is not negative");
            let points = self.repeat.points_of_steps(yarn, place..place + 1);
            let start = index32(knitted.points.len());
            let stitches =
                &self.repeat.stitches[yarn.steps[place] as usize..yarn.steps[place + 1] as usize];
            knitted
                .stitches
                .extend(stitches.iter().map(|stitch| start + stitch - index32(points.start)));
            knitted
                .points
                .extend(self.repeat.points[points.clone()].iter().map(|&point| point + offset));
            knitted.origins.extend(index32(points.start)..index32(points.end));
            let tags = &self.repeat.tags[points];
            knitted.tags.extend(tags.iter().map(|tag| Tag {
                course: tag.course + courses,
                wale: tag.wale + wales,
                ..*tag
            }));
        }
    }
}

impl BarPattern {
    /// A bar of these yarns; its bounding box is measured later.
    fn new(runs_across: bool, yarns: Vec<Option<usize>>) -> Self {
        Self { runs_across, yarns, bounds: (DVec2::ZERO, DVec2::ZERO) }
    }

    /// Index in the repeat of the yarn with that number.
    fn yarn(&self, number: i64) -> Option<usize> {
        let repeat = i64::from(index32(self.yarns.len()));
        self.yarns[usize::try_from(number.rem_euclid(repeat)).expect("a remainder is not negative")]
    }

    /// The axis (0 x, 1 y) across which the yarns are numbered (0) and along which they run (1).
    fn axis(&self, which: usize) -> usize {
        if self.runs_across { 1 - which } else { which }
    }

    fn extent(&self, which: usize) -> Range<f64> {
        let axis = self.axis(which);
        self.bounds.0[axis]..self.bounds.1[axis]
    }
}

/// The steps of length `spacing` whose `extent` may touch `range`.
fn steps(range: Range<f64>, extent: Range<f64>, spacing: f64) -> Range<i64> {
    // Panels measure metres and spacings over a micrometre, so the numbers fit.
    let first = ((range.start - extent.end) / spacing).floor();
    let last = ((range.end - extent.start) / spacing).ceil();
    #[expect(clippy::cast_possible_truncation, reason = "rounded before, and `as` saturates")]
    let steps = first as i64..last as i64 + 1;
    steps
}

/// A wale or course of the endless fabric as one of the repeat, which has `size` of them.
fn wrap(at: i64, size: usize) -> usize {
    usize::try_from(at.rem_euclid(as_i64(size))).expect("a remainder is not negative")
}

fn as_i64(count: usize) -> i64 {
    i64::from(index32(count))
}

fn as_vec(x: usize, y: usize) -> DVec2 {
    DVec2::new(f64::from(index32(x)), f64::from(index32(y)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fabric::Fabric;

    fn tricot_yarn(guide: i64) -> Knitted {
        let fabric = Fabric::named("tricot").unwrap();
        let mesh = StructureMesh::anchored_at(&fabric, DVec2::ZERO);
        let mut knitted = Knitted::default();
        Pattern::unrelaxed(&fabric).lay(1, guide, 0..4, &mesh, &mut knitted);
        knitted
    }

    #[test]
    fn loops_stand_on_the_structure_mesh() {
        let fabric = Fabric::named("tricot").unwrap();
        let mesh = StructureMesh::anchored_at(&fabric, DVec2::ZERO);
        let knitted = tricot_yarn(3);
        assert_eq!(knitted.stitches, [0, 12, 24, 36]);
        for (course, &first) in (0..).zip(&knitted.stitches) {
            let first = first as usize;
            let tag = knitted.tags[first];
            assert_eq!(
                (tag.wale, tag.course),
                (3 + course % 2, course),
                "1-0/1-2 laps needles 0 and 1 in turn"
            );
            let head = (knitted.points[first + 3] + knitted.points[first + 4]) / 2.0;
            assert!((head.x - mesh.vertex(tag.wale, tag.course).x).abs() < 1e-12);
        }
    }

    #[test]
    fn bounds_hold_every_point() {
        let fabric = Fabric::named("locknit").unwrap();
        let pattern = Pattern::new(&fabric);
        let mesh = StructureMesh::anchored_at(&fabric, DVec2::ZERO);
        for bar in 0..2 {
            let mut knitted = Knitted::default();
            pattern.lay(bar, 5, 7..9, &mesh, &mut knitted);
            let strip = pattern.strip(bar, 5);
            for point in &knitted.points {
                assert!(strip.start - 1e-12 <= point.x && point.x <= strip.end + 1e-12);
                assert!(pattern.yarns_over(bar, point.x..point.x).any(|guide| guide == 5));
                assert!(pattern.steps_along(bar, point.y..point.y).start <= 8);
                assert!(pattern.steps_along(bar, point.y..point.y).end > 7);
            }
        }
    }

    #[test]
    fn every_point_of_a_very_long_inlay_has_its_tag() {
        let text = Fabric::named("tricot")
            .unwrap()
            .to_string()
            .replace("\"1-2/1-0//\"", "\"0-0/4096-4096//\"");
        let fabric = Fabric::parse(&text).unwrap();
        let mesh = StructureMesh::anchored_at(&fabric, DVec2::ZERO);
        let mut knitted = Knitted::default();
        Pattern::new(&fabric).lay(0, 0, 0..2, &mesh, &mut knitted);
        assert_eq!(knitted.points.len(), 2 * 4098);
        assert_eq!(knitted.tags.len(), knitted.points.len());
        assert_eq!(knitted.tags[4097].point, 4098);
    }
}
