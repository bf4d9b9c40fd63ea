//! The repeat of a fabric, laid out and relaxed.
//!
//! In: a [`Fabric`]. Out: its [`Pattern`].
//!
//! Method: underlaps pull at the wales and bend them (`lattice`). Laps become points on the bent wales
//! (`stitch`, `repeat`). Yarns that would cut each other are pushed apart (`relax`).
//!
//! Cost: some milliseconds for a common repeat, most of it the relaxation. Repeats over
//! [`MAX_RELAXED_LAPS`] laps have straight wales and are not relaxed.

use glam::{DVec2, DVec3};

use super::chain::ControlChain;
use super::lattice::WaleLattice;
use super::relax::{self, YarnLength};
use super::repeat::{Repeat, RepeatYarn};
use super::stitch::StitchLayout;
use super::weft::Loops;
use super::{BarPattern, MAX_RELAXED_LAPS, Pattern, Progress, as_vec};
use crate::fabric::{
    Bar, Fabric, LaidCloth, Lay, RACK, StrandDirection, Structure, WarpKnit, WeftKnit,
};
use crate::ids::index32;

/// Share of the yarns' radius for which loops are laid out at most, before they grow. Thinner
/// layouts take longer to grow; thicker ones make thicker cloth.
const LAYOUT_RADIUS: f64 = 0.5;
/// Share of the yarns' radius at which the layout gives the yarns' shape and length. Real cloth is
/// pressed together: laid out at 1, a locknit would be a fifth heavier than mills make it.
const SHAPE_RADIUS: f64 = 0.4;

/// Share of the yarns' radius for which drafts are laid out: between the two, since their yarns are
/// drawn with the full radius and nothing makes room for them.
pub(super) const DRAFT_RADIUS: f64 = 0.7;

/// Share of the yarns' radius for which laid yarns are relaxed. Woven yarns are squeezed flat where
/// they cross. Round yarns on square crossings have no room once they are thicker than 0.577 of
/// their pitch (Peirce 1937, "The geometry of cloth structure"), and in dense cloth they are far
/// thicker. At 1 such cloth would never converge; much lower values let yarns cut each other.
const SQUEEZED_RADIUS: f64 = 0.6;

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
    pub(super) fn straight(fabric: &Fabric, knit: &WarpKnit) -> Self {
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
    pub(super) fn laid_out(
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

    /// Sets each bar's bounding box. The relaxation moves points out of their steps' cells, so it
    /// is measured, not derived from the lapping.
    pub(super) fn measure_bounds(&mut self) {
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
}

/// What sets the length of a yarn: a given run-in, the tension of an inlay, or its shape.
pub(super) fn yarn_length(fabric: &Fabric, yarn: &RepeatYarn) -> YarnLength {
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

/// Whether a guide of a bar (for a weft: a course) is threaded.
fn has_yarn(bar: &Bar, guide: usize) -> bool {
    bar.threading.carries(i64::from(index32(guide)))
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Pattern {
        /// A warp knit on straight wales, laid out for its full radius and not relaxed.
        pub(in crate::knit) fn unrelaxed(fabric: &Fabric) -> Self {
            let knit = fabric.warp_knit().unwrap();
            let layout = StitchLayout::new(fabric, knit, DRAFT_RADIUS * fabric.radius());
            let lattice = WaleLattice::straight(fabric, fabric.threading_repeat(), fabric.repeat());
            Self::laid_out(fabric, knit, &layout, &lattice)
        }
    }
}
