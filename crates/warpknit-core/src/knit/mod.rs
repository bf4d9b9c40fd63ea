//! From lapping to data points: the yarns of a fabric on a flat panel.
//!
//! In: a [`Fabric`] and the place of its [`StructureMesh`]. Out: [`Knitted`] data points, step
//! after step, eight a loop, in panel axes (x across the wales, y along them, z towards the
//! technical face), mm. Nothing here knows of garments.
//!
//! All computation is done on one repeat ([`Pattern::new`]), in three steps. Underlaps pull at the
//! wales and bend them (`lattice`). Laps become points on the bent wales (`stitch`, `repeat`).
//! Yarns that would cut each other are pushed apart (`relax`). Laying a yarn on a panel then
//! takes one addition a point (about 5 ns).
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
pub mod mesh;
pub mod numbers;
mod points;
mod relax;
mod repeat;
pub mod run_in;
mod stitch;
pub mod strain;
pub mod upright;
pub mod weft;

use std::ops::Range;

use glam::{DVec2, DVec3};

use crate::fabric::{
    Bar, Fabric, LaidCloth, Lay, RACK, StrandDirection, Structure, WarpKnit, WeftKnit,
};
use crate::ids::index32;
use chain::ControlChain;
pub use cover::visible_shares;
use lattice::WaleLattice;
use mesh::StructureMesh;
pub use points::{Bed, Knitted, PointKind, Tag};
pub use relax::Relaxation;
use relax::YarnLength;
use repeat::{Repeat, RepeatYarn};
use stitch::StitchLayout;
use weft::Loops;

/// The largest repeat that is relaxed, laps: one or two minutes' work.
pub const MAX_RELAXED_LAPS: usize = 50_000;

/// Gets the share of a work that is done, from 0 to 1.
pub type Progress<'a> = &'a mut dyn FnMut(f64);

/// Share of the yarns' radius for which loops are laid out at most, before they grow. Thinner
/// layouts take longer to grow; thicker ones make thicker cloth.
const LAYOUT_RADIUS: f64 = 0.5;
/// Share of the yarns' radius at which the layout gives the yarns' shape and length. Real cloth is
/// pressed together: laid out at 1, a locknit would be a fifth heavier than mills make it.
const SHAPE_RADIUS: f64 = 0.4;

/// Share of the yarns' radius for which drafts are laid out: between the two, since their yarns are
/// drawn with the full radius and nothing makes room for them.
const DRAFT_RADIUS: f64 = 0.7;

/// Share of the yarns' radius for which laid yarns are relaxed. Woven yarns are squeezed flat where
/// they cross. Round yarns on square crossings have no room once they are thicker than 0.577 of
/// their pitch (Peirce 1937, "The geometry of cloth structure"), and in dense cloth they are far
/// thicker. At 1 such cloth would never converge; much lower values let yarns cut each other.
const SQUEEZED_RADIUS: f64 = 0.6;

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
    /// Computes the repeat of a fabric. Cost: some milliseconds for a common one, most of it the
    /// relaxation of its yarns.
    ///
    /// ```
    /// use warpknit_core::{fabric::Fabric, knit::Pattern};
    /// let pattern = Pattern::new(&Fabric::named("tricot").unwrap());
    /// // Two loops of eight points, two underlaps of four.
    /// assert_eq!(pattern.points_per_repeat(0), 24);
    /// ```
    #[must_use]
    pub fn new(fabric: &Fabric) -> Self {
        Self::with_progress(fabric, &mut |_done| ())
    }

    /// The same, for repeats that take long: `progress` gets the share that is done, from 0 to 1.
    #[must_use]
    pub fn with_progress(fabric: &Fabric, progress: Progress<'_>) -> Self {
        match &fabric.structure {
            Structure::Warp(knit) => Self::warp_knit(fabric, knit, progress),
            Structure::Weft(knit) => Self::weft_knit(fabric, knit, progress),
            Structure::Laid(cloth) => Self::laid(fabric, cloth, progress),
        }
    }

    /// The repeat of a warp knit as laid out on its bent wales, its yarns not relaxed: they may cut
    /// each other. It is good for a first look at many lappings. Other fabrics, and repeats that
    /// are never relaxed, are as [`Self::new`] makes them. Cost: a tenth of that or less.
    ///
    /// ```
    /// use warpknit_core::{fabric::Fabric, knit::Pattern};
    /// let draft = Pattern::draft(&Fabric::named("tricot").unwrap());
    /// assert!(draft.relaxation().is_none());
    /// ```
    #[must_use]
    pub fn draft(fabric: &Fabric) -> Self {
        match &fabric.structure {
            Structure::Warp(knit)
                if fabric.threading_repeat() * fabric.repeat() * knit.bars.len()
                    <= MAX_RELAXED_LAPS =>
            {
                let lattice = WaleLattice::relaxed(fabric, knit);
                let layout = StitchLayout::new(fabric, knit, DRAFT_RADIUS * fabric.radius());
                let mut pattern = Self::laid_out(fabric, knit, &layout, &lattice);
                pattern.measure_bounds();
                pattern
            }
            Structure::Warp(_) | Structure::Weft(_) | Structure::Laid(_) => Self::new(fabric),
        }
    }

    /// Loops of guide bars on relaxed wales: laid out thin, so that they interlock, and grown.
    fn warp_knit(fabric: &Fabric, knit: &WarpKnit, progress: Progress<'_>) -> Self {
        if fabric.threading_repeat() * fabric.repeat() * knit.bars.len() > MAX_RELAXED_LAPS {
            return Self::straight(fabric, knit);
        }
        let lattice = WaleLattice::relaxed(fabric, knit);
        let radius = fabric.radius();
        let thin = StitchLayout::thin(fabric, knit, LAYOUT_RADIUS * radius);
        let mut pattern = Self::laid_out(fabric, knit, &thin, &lattice);
        let full = StitchLayout::new(fabric, knit, SHAPE_RADIUS * radius);
        let shape = Self::laid_out(fabric, knit, &full, &lattice).repeat.points;
        pattern.relax(fabric, &shape, 1.0, progress);
        pattern.measure_bounds();
        pattern
    }

    /// Loops on straight wales, nothing relaxed. One yarn of each bar stands for all of its yarns.
    fn straight(fabric: &Fabric, knit: &WarpKnit) -> Self {
        let lattice = WaleLattice::straight(fabric, 1, 1);
        let layout = StitchLayout::of_any_repeat(fabric, knit, SHAPE_RADIUS * fabric.radius());
        let mut pattern = Self::empty(fabric);
        for (number, bar) in knit.bars.iter().enumerate() {
            let steps = bar.chain().map_or(1, |chain| chain.laps().len());
            pattern.repeat.add_yarn(bar, number, &layout, &lattice, [0, steps]);
            let guides = 0..bar.threading.repeat();
            let yarns = guides.map(|guide| has_yarn(bar, guide).then_some(number)).collect();
            pattern.bars.push(BarPattern::new(bar.chain().is_none(), yarns));
        }
        pattern.measure_bounds();
        pattern
    }

    /// The yarns of all bars as laid out, not relaxed.
    fn laid_out(
        fabric: &Fabric,
        knit: &WarpKnit,
        layout: &StitchLayout<'_>,
        lattice: &WaleLattice,
    ) -> Self {
        let mut pattern = Self::empty(fabric);
        let [wales, courses] = pattern.size;
        for (number, bar) in knit.bars.iter().enumerate() {
            let (guides, steps) = match bar.lay {
                Lay::Lapping(_) => (wales, courses),
                Lay::Weft => (courses, wales),
            };
            let yarns = (0..guides).map(|guide| {
                has_yarn(bar, guide).then(|| {
                    pattern.repeat.add_yarn(bar, number, layout, lattice, [guide, steps]);
                    pattern.repeat.yarns.len() - 1
                })
            });
            let yarns = yarns.collect();
            pattern.bars.push(BarPattern::new(bar.chain().is_none(), yarns));
        }
        pattern
    }

    /// The repeat of a weft knit: courses of loops as its motif shows them.
    fn weft_knit(fabric: &Fabric, knit: &WeftKnit, progress: Progress<'_>) -> Self {
        let (wales, courses) = (fabric.threading_repeat(), fabric.repeat());
        let mut pattern = Self::empty(fabric);
        let loops = Loops { spacing: pattern.spacing, radius: fabric.radius() };
        for (number, feeder) in knit.feeders.iter().enumerate() {
            let yarns = (0..courses).map(|course| {
                feeder.courses.carries(i64::from(index32(course))).then(|| {
                    pattern.repeat.add_course(number, &knit.motif, &loops, course, wales);
                    pattern.repeat.yarns.len() - 1
                })
            });
            let yarns = yarns.collect();
            pattern.bars.push(BarPattern::new(true, yarns));
        }
        if wales * courses <= MAX_RELAXED_LAPS {
            let shape = pattern.repeat.points.clone();
            pattern.relax(fabric, &shape, 1.0, progress);
        }
        pattern.measure_bounds();
        pattern
    }

    /// The repeat of laid cloth: its yarns follow given paths, scaled to the fabric's densities.
    fn laid(fabric: &Fabric, cloth: &LaidCloth, progress: Progress<'_>) -> Self {
        let mut pattern = Self::empty(fabric);
        let cell = pattern.spacing.extend(fabric.enlargement);
        for (number, strand) in cloth.strands.iter().enumerate() {
            pattern.repeat.add_path(
                number,
                strand.path.iter().map(|&point| point * cell),
                strand.direction.step() * cell,
            );
            let runs_across = strand.direction == StrandDirection::Across;
            pattern.bars.push(BarPattern::new(runs_across, vec![Some(number)]));
        }
        let shape = pattern.repeat.points.clone();
        pattern.relax(fabric, &shape, SQUEEZED_RADIUS, progress);
        pattern.measure_bounds();
        pattern
    }

    fn empty(fabric: &Fabric) -> Self {
        let spacing = DVec2::new(fabric.wale_spacing(), fabric.course_spacing());
        let size = [fabric.threading_repeat(), fabric.repeat()];
        Self {
            repeat: Repeat::default(),
            bars: Vec::new(),
            spacing,
            size,
            relaxation: None,
            tightest: None,
        }
    }

    /// Grows yarns to a `share` of their radius and keeps them apart. `shape` are their points as
    /// they would lie with room enough.
    fn relax(&mut self, fabric: &Fabric, shape: &[DVec3], share: f64, progress: Progress<'_>) {
        let thickness = fabric.thickness();
        let chains = self.repeat.yarns.iter().map(|yarn| relax::YarnChain {
            chain: ControlChain {
                points: self.repeat.points_of(yarn),
                period: yarn.period,
                radius: share * thickness[yarn.bar] * fabric.radius(),
            },
            length: yarn_length(fabric, yarn),
        });
        let cloth = relax::RelaxedCloth {
            yarns: &chains.collect::<Vec<_>>(),
            cell: self.repeat_size(),
            press: fabric.finish.thickness,
        };
        let (relaxation, tightest) = relax::relax(&mut self.repeat.points, shape, &cloth, progress);
        self.relaxation = Some(relaxation);
        self.tightest = tightest;
    }

    /// Where two yarns are nearest: the bar, counted from 0, and the place in the repeat.
    #[must_use]
    pub fn tightest(&self) -> Option<(usize, Tag)> {
        let point = self.tightest?;
        let yarn =
            self.repeat.yarns.iter().find(|yarn| self.repeat.points_of(yarn).contains(&point))?;
        Some((yarn.bar, self.repeat.tags[point]))
    }

    /// Sets each bar's bounding box. The relaxation moves points out of their steps' cells, so it
    /// is measured, not derived from the lapping.
    fn measure_bounds(&mut self) {
        for yarn in &self.repeat.yarns {
            let bar = &mut self.bars[yarn.bar];
            for step in 0..yarn.steps.len() - 1 {
                let home = self.spacing
                    * if bar.runs_across {
                        as_vec(step, yarn.guide)
                    } else {
                        as_vec(yarn.guide, step)
                    };
                for point in &self.repeat.points[self.repeat.points_of_steps(yarn, step..step + 1)]
                {
                    let place = point.truncate() - home;
                    bar.bounds = (bar.bounds.0.min(place), bar.bounds.1.max(place));
                }
            }
        }
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

/// What sets the length of a yarn: a given run-in, the tension of an inlay, or its shape.
fn yarn_length(fabric: &Fabric, yarn: &RepeatYarn) -> YarnLength {
    let Structure::Warp(knit) = &fabric.structure else { return YarnLength::Shape };
    let bar = &knit.bars[yarn.bar];
    let steps = f64::from(index32(yarn.steps.len() - 1));
    match (bar.run_in, bar.slack) {
        (Some(run_in), _) => YarnLength::Fed(run_in / RACK * steps),
        (None, Some(slack)) => YarnLength::Slack(slack),
        (None, None) if bar.is_pulled_straight() => YarnLength::Drafted,
        (None, None) if bar.is_inlay() => YarnLength::Taut,
        (None, None) => YarnLength::Shape,
    }
}

/// A wale or course of the endless fabric as one of the repeat, which has `size` of them.
fn wrap(at: i64, size: usize) -> usize {
    usize::try_from(at.rem_euclid(as_i64(size))).expect("a remainder is not negative")
}

fn as_i64(count: usize) -> i64 {
    i64::from(index32(count))
}

/// Whether a guide of a bar (for a weft: a course) is threaded.
fn has_yarn(bar: &Bar, guide: usize) -> bool {
    bar.threading.carries(i64::from(index32(guide)))
}

fn as_vec(x: usize, y: usize) -> DVec2 {
    DVec2::new(f64::from(index32(x)), f64::from(index32(y)))
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Pattern {
        /// A warp knit on straight wales, laid out for its full radius and not relaxed.
        pub(super) fn unrelaxed(fabric: &Fabric) -> Self {
            let knit = fabric.warp_knit().unwrap();
            let layout = StitchLayout::new(fabric, knit, DRAFT_RADIUS * fabric.radius());
            let lattice = WaleLattice::straight(fabric, fabric.threading_repeat(), fabric.repeat());
            Self::laid_out(fabric, knit, &layout, &lattice)
        }
    }

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
