//! Step 3, layout: the yarn segments of a cell.
//!
//! In: the mean cell. Out: a [`Layout`], or nothing where no layout is plausible.
//!
//! Method: competing hypotheses, as in Wu et al.. Layouts of a weave ([`woven`]) and layouts
//! that merely cover the cell ([`greedy_cover`]) are refined on a coarse grid and ranked by a cost:
//! the variance that they leave unexplained, with penalties for the number of segments, for
//! overlaps, and for what only hidden parts explain. Where a weave is clear, covers are skipped.
//! Covers go through a local search, which joins, drops and adds segments while the cost falls. The
//! best layout is refined on a finer grid. If it is not plausible then, the next one is tried. Who
//! has a better explanation asks for the weave alone.
//!
//! Cost: 0.5 to 2 s where a weave is clear, else 2 to 8 s on two cores.
//!
//! Not promised: the best layout of all. Two layouts of a knit may cost nearly the same, and a
//! slightly different photo may then give the other one.

use rayon::prelude::*;

use super::cell::Cell;
use super::error::CaptureError;
use super::fit::{Hypothesis, LayoutFit};
use super::lattice::Lattice;
use super::relief::{Samples, covered_shares, rendered};
use super::segment::Segment;
use super::target::FitTarget;
use super::visibility::{MIN_VISIBLE, MIN_VISIBLE_GAP, visible_parts};
use super::{greedy_cover, woven};
use crate::plane::double;

/// Sample points of a cell each way while layouts compete.
const COARSE: f64 = 26.0;
/// Sample points of a cell each way for the last refinement.
const FINE: f64 = 52.0;
/// Points each way on which shares of the cell are counted.
const COVERAGE_SIDE: usize = 128;
/// A weave that costs less than this is clear, and no cover is looked at if it stays plausible.
/// Drawn weaves cost up to 0.05 and photographed ones 0.11; satin costs 0.13, and loops taken for
/// weaves 0.18 and more. Lower, photographed weaves would cost seconds of covers; higher, satin
/// would pass for a clear weave.
const CLEAR_WEAVE_COST: f64 = 0.12;
/// The largest error of a weave without its hidden segments. Drawn and photographed weaves leave up
/// to 0.28, and the likeliest of loops taken for a weave 0.52.
const MAX_WEAVE_ERROR: f64 = 0.4;
/// Changes of a layout in the local search, at most.
const MAX_MOVES: usize = 12;
/// Copies of segments that may touch a cell in a person's layout. Those of 64 floats over ten cells
/// are fewer; more only cost time.
const MAX_COPIES: f64 = 10_000.0;
/// Share of the variance that each segment must explain, or it is pruned.
const MIN_EXPLAINED: f64 = 0.01;
/// Given segments that overlap on more than this share of the cell bury each other: little of them
/// is visible, and their visible parts would say that nothing overlaps.
const BURIED_OVERLAP: f64 = 0.9;
/// Cost of each segment, as a share of the error. At 0, noise would be covered by small segments;
/// at a few times as much, both legs of a loop would become one wide segment.
const SEGMENT_COST: f64 = 0.08;
/// Cost of overlaps beyond a share of the cell, and that share.
const OVERLAP_COST: f64 = 0.35;
const FREE_OVERLAP: f64 = 0.08;
/// Cost of what only hidden parts explain, beyond a share that the ends of visible segments under
/// other segments explain anyway, and that share.
const HIDDEN_COST: f64 = 0.05;
const FREE_HIDDEN: f64 = 0.2;
/// Cost of more overlap than a valid layout has.
const INVALID_COST: f64 = 0.1;
/// Iterations of the refinements: after pruning, after a move, and on the fine grid.
const PRUNE_ITERATIONS: usize = 8;
const MOVE_ITERATIONS: usize = 12;
const FINE_ITERATIONS: usize = 40;

/// The yarns of a cell.
#[derive(Clone, Debug)]
pub struct Layout {
    /// One of each copy, including what goes on below others. Those of a weave are without segments
    /// that are hidden entirely.
    pub segments: Vec<Segment>,
    /// Their visible parts. A segment that passes under another has several; a hidden one has none.
    pub visible: Vec<Segment>,
    /// The index in `segments` of each visible part.
    pub sources: Vec<usize>,
    /// Lightness of the deepest ground.
    pub ground: f64,
    /// Share of the mean cell's variance that the segments leave unexplained.
    pub error: f64,
    /// The same for the visible parts, which the cloth is made of.
    pub visible_error: f64,
    /// The hypothesis behind the layout.
    pub hypothesis: Hypothesis,
    /// Share of the cell that lies under two segments.
    pub overlap: f64,
    /// Share of the cell that lies under none.
    pub blank: f64,
}

impl Layout {
    /// The largest overlap of a valid layout. The rule of Wu et al. is little overlap and
    /// little blank; this is how much a person's layout may have.
    pub const MOST_OVERLAP: f64 = 0.35;
    /// The largest share of a valid layout that lies under no yarn. Nets are mostly blank.
    pub const MOST_BLANK: f64 = 0.75;

    /// The same in pixels of another size.
    pub(super) fn scaled(&self, scale: f64) -> Self {
        Self {
            segments: scaled(&self.segments, scale),
            visible: scaled(&self.visible, scale),
            sources: self.sources.clone(),
            ..*self
        }
    }

    fn from_fit(fit: LayoutFit, target: &FitTarget) -> Self {
        let LayoutFit { segments, hypothesis, ground, error } = fit;
        let (sources, visible): (Vec<_>, Vec<_>) =
            visible_parts(&segments, &target.lattice, MIN_VISIBLE_GAP).into_iter().unzip();
        let [overlap, blank] = coverage(&visible, &target.lattice);
        let visible_error = target.error(&visible, ground);
        Self {
            segments,
            visible,
            sources,
            ground,
            error,
            visible_error,
            hypothesis,
            overlap,
            blank,
        }
    }

    /// Indices of segments without a visible part.
    pub(super) fn hidden(&self) -> Vec<usize> {
        (0..self.segments.len()).filter(|number| !self.sources.contains(number)).collect()
    }

    /// Whether it explains the cell at all after its last refinement. Floats may have sunk below
    /// others then. A cover that works by hidden segments leaves more than an empty layout would.
    fn is_plausible(&self) -> bool {
        let most = if self.hypothesis == Hypothesis::Woven { MAX_WEAVE_ERROR } else { 1.0 };
        !self.visible.is_empty() && self.error < most && self.visible_error < 1.0
    }

    /// Whether its overlap and its blank are within the limits.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        !self.visible.is_empty()
            && self.overlap <= Self::MOST_OVERLAP
            && self.blank <= Self::MOST_BLANK
    }
}

fn scaled(segments: &[Segment], scale: f64) -> Vec<Segment> {
    segments.iter().map(|segment| segment.scaled(scale)).collect()
}

/// What layouts of a cell are sought with.
pub(super) struct Targets {
    coarse: FitTarget,
    fine: FitTarget,
    /// Lightness of the deepest ground and of the tops of yarns: quantiles instead of extrema,
    /// which lint and specks would set.
    ground: f64,
    top: f64,
}

impl Targets {
    pub(super) fn new(cell: &Cell) -> Self {
        let (coarse, fine) = (FitTarget::new(cell, COARSE), FitTarget::new(cell, FINE));
        let (ground, top) = (coarse.quantile(0.04), coarse.quantile(0.9));
        Self { coarse, fine, ground, top }
    }

    /// The weave that costs least of those that are plausible, and its cost.
    pub(super) fn weave(&self) -> Option<(f64, Layout)> {
        let coarse = &self.coarse;
        let mut weaves: Vec<(f64, LayoutFit)> = woven::fits(coarse, self.ground, self.top)
            .map(|fit| pruned_with_cost(coarse, fit))
            .collect();
        weaves.retain(|(_, fit)| without_hidden(fit.clone(), coarse).error < MAX_WEAVE_ERROR);
        weaves.sort_by(|p, q| p.0.total_cmp(&q.0));
        weaves.iter().find_map(|(cost, fit)| Some((*cost, plausible_layout(fit, &self.fine)?)))
    }

    /// The layout of the cell, given its weave: that, unless it isn't clear and a cover costs less.
    /// `None` where none is plausible.
    pub(super) fn layout(&self, weave: Option<(f64, Layout)>) -> Option<Layout> {
        let coarse = &self.coarse;
        let least = weave.as_ref().map_or(f64::INFINITY, |(cost, _)| *cost);
        if is_clear(least) {
            return weave.map(|(_, layout)| layout);
        }
        let mut covers: Vec<(f64, LayoutFit)> = greedy_cover::fits(coarse, self.ground, self.top)
            .map(|fit| {
                let (cost, fit) = pruned_with_cost(coarse, fit);
                local_search(coarse, fit, cost, self.top)
            })
            .filter(|(cost, _)| *cost < least)
            .collect();
        covers.sort_by(|p, q| p.0.total_cmp(&q.0));
        covers
            .iter()
            .find_map(|(_, fit)| plausible_layout(fit, &self.fine))
            .or_else(|| weave.map(|(_, layout)| layout))
    }
}

/// Whether a weave of such a cost is clear.
pub(super) fn is_clear(cost: f64) -> bool {
    cost < CLEAR_WEAVE_COST
}

fn pruned_with_cost(target: &FitTarget, fit: LayoutFit) -> (f64, LayoutFit) {
    let fit = pruned(target, fit);
    (cost(target, &fit), fit)
}

/// The layout that a fit becomes on the fine grid, if it is plausible there.
fn plausible_layout(fit: &LayoutFit, fine: &FitTarget) -> Option<Layout> {
    let refined = fit.refit(fine, &fit.segments, FINE_ITERATIONS);
    let layout = Layout::from_fit(without_hidden(refined, fine), fine);
    layout.is_plausible().then_some(layout)
}

/// A fit with its segments in the cell at the origin. Those of a weave without entirely hidden
/// segments: where cloth is dense, the yarn below is not visible and its parameters are arbitrary.
fn without_hidden(mut fit: LayoutFit, target: &FitTarget) -> LayoutFit {
    let lattice = &target.lattice;
    if fit.hypothesis == Hypothesis::Woven {
        let visible = visible_parts(&fit.segments, lattice, MIN_VISIBLE_GAP);
        fit.segments =
            visible.chunk_by(|p, q| p.0 == q.0).map(|parts| fit.segments[parts[0].0]).collect();
    }
    fit.segments.iter_mut().for_each(|segment| {
        segment.centre = lattice.wrap_to_cell(segment.centre);
    });
    fit.error = target.error(&fit.segments, fit.ground);
    fit
}

/// A person's layout on a cell, as it was given. The overlap and the blank of segments that bury
/// each other are counted on the whole segments, since little of them is visible.
pub(super) fn given(
    cell: &Cell,
    segments: Vec<Segment>,
    ground: f64,
) -> Result<Layout, CaptureError> {
    let copies = segments.iter().map(|segment| segment.copy_count(&cell.lattice)).sum::<f64>();
    if copies > MAX_COPIES {
        return Err(CaptureError::Crowded { copies, most: MAX_COPIES });
    }
    let [overlap, blank] = coverage(&segments, &cell.lattice);
    let target = FitTarget::new(cell, FINE);
    let error = target.error(&segments, ground);
    let layout = Layout::from_fit(
        LayoutFit { segments, hypothesis: Hypothesis::Given, ground, error },
        &target,
    );
    let is_buried = overlap > BURIED_OVERLAP || 2 * layout.hidden().len() > layout.segments.len();
    let layout = if is_buried { Layout { overlap, blank, ..layout } } else { layout };
    if layout.is_valid() {
        return Ok(layout);
    }
    let (most_overlap, most_blank) = (Layout::MOST_OVERLAP, Layout::MOST_BLANK);
    // The shares explain nothing about segments that are as dark as the ground, or too short to
    // count as visible. Those get an error of their own.
    let is_dark = rendered(&layout.segments, 0.0, &target.lattice, &target.samples)
        .iter()
        .all(|light| *light <= 0.0);
    if is_dark || layout.overlap <= most_overlap && layout.blank <= most_blank {
        return Err(CaptureError::NothingVisible);
    }
    Err(CaptureError::Invalid {
        overlap: layout.overlap,
        blank: layout.blank,
        most_overlap,
        most_blank,
    })
}

/// Shares of a cell that lie under two segments, and under none.
fn coverage(segments: &[Segment], lattice: &Lattice) -> [f64; 2] {
    covered_shares(segments, lattice, &Samples::grid(lattice, [COVERAGE_SIDE; 2]))
}

/// The cost by which layouts compete: the unexplained share of the variance, with penalties.
fn cost(target: &FitTarget, fit: &LayoutFit) -> f64 {
    // Gaps of a weave show yarns that are known to run there. A part that a cover shows in a gap is
    // no evidence of a segment.
    let gap = if fit.hypothesis == Hypothesis::Woven { MIN_VISIBLE_GAP } else { MIN_VISIBLE };
    let visible: Vec<Segment> = visible_parts(&fit.segments, &target.lattice, gap)
        .into_iter()
        .map(|(_, segment)| segment)
        .collect();
    let [overlap, _] = covered_shares(&visible, &target.lattice, &target.samples);
    // The cloth will be made of the visible parts. A wrong layout can make up for its error by
    // slivers of hidden segments, and pays for those here.
    let visible_error = target.error(&visible, fit.ground);
    let error = fit.error + HIDDEN_COST * (visible_error - fit.error - FREE_HIDDEN).max(0.0);
    let error = error + if overlap > Layout::MOST_OVERLAP { INVALID_COST } else { 0.0 };
    // A criterion like Akaike's: a segment has to earn its eleven parameters.
    error * (1.0 + SEGMENT_COST * double(fit.segments.len()))
        + OVERLAP_COST * (overlap - FREE_OVERLAP).max(0.0)
}

/// Local search: joins or drops a segment while the cost falls below `least`, and adds some where
/// neither helps. Gives the cost and the fit at the local minimum.
fn local_search(
    target: &FitTarget,
    mut fit: LayoutFit,
    mut least: f64,
    top: f64,
) -> (f64, LayoutFit) {
    for _ in 0..MAX_MOVES {
        // Fewer segments first. Adding is tried at a local minimum only, because each addition
        // takes many renderings.
        let best = with_one_fewer(&fit.segments, &target.lattice)
            .into_par_iter()
            .map(|segments| {
                let fit = fit.refit(target, &segments, MOVE_ITERATIONS);
                (cost(target, &fit), fit)
            })
            .min_by(|p, q| p.0.total_cmp(&q.0))
            .filter(|(less, _)| *less < least)
            .or_else(|| {
                let more = greedy_cover::extended(target, fit.clone(), top);
                Some((cost(target, &more), more)).filter(|(less, _)| *less < least)
            });
        let Some(better) = best else { break };
        (least, fit) = better;
    }
    (least, fit)
}

/// All layouts with one segment less: without it, or joined with another one.
fn with_one_fewer(segments: &[Segment], lattice: &Lattice) -> Vec<Vec<Segment>> {
    let mut layouts = Vec::new();
    for p in 0..segments.len() {
        layouts.push(without(segments, [p, p]));
        for q in p + 1..segments.len() {
            layouts.extend(
                segments[p]
                    .joined(&segments[q], lattice)
                    .map(|joined| [without(segments, [p, q]), vec![joined]].concat()),
            );
        }
    }
    layouts.retain(|layout| !layout.is_empty());
    layouts
}

/// All segments but those at two indices.
fn without(segments: &[Segment], dropped: [usize; 2]) -> Vec<Segment> {
    segments
        .iter()
        .enumerate()
        .filter(|(number, _)| !dropped.contains(number))
        .map(|(_, segment)| *segment)
        .collect()
}

/// A fit without segments that explain less than [`MIN_EXPLAINED`], the least useful one dropped
/// first.
fn pruned(target: &FitTarget, mut fit: LayoutFit) -> LayoutFit {
    while fit.segments.len() > 1 {
        let least = (0..fit.segments.len())
            .map(|number| {
                let mut rest = fit.segments.clone();
                rest.remove(number);
                (target.error(&rest, fit.ground), number)
            })
            .min_by(|p, q| p.0.total_cmp(&q.0));
        let Some((_, number)) = least.filter(|(error, _)| *error <= fit.error + MIN_EXPLAINED)
        else {
            break;
        };
        fit.segments.remove(number);
        // The others move into the space that is free now.
        fit = fit.refit(target, &fit.segments, PRUNE_ITERATIONS);
    }
    fit
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    #[test]
    fn a_layout_that_explains_too_little_is_not_plausible() {
        let segments = vec![Segment::straight(DVec2::ZERO, 0.0, 4.0, 9.0, 1.0)];
        let (visible, sources, ground) = (segments.clone(), vec![0], -1.0);
        let layout = |hypothesis, error, visible_error| {
            let (segments, visible, sources) = (segments.clone(), visible.clone(), sources.clone());
            Layout {
                segments,
                visible,
                sources,
                ground,
                error,
                visible_error,
                hypothesis,
                overlap: 0.0,
                blank: 0.5,
            }
        };
        assert!(
            layout(Hypothesis::Woven, 0.05, 0.3).is_plausible()
                && layout(Hypothesis::Cover, 0.5, 0.9).is_plausible()
        );
        assert!(!layout(Hypothesis::Woven, 0.45, 0.5).is_plausible(), "its floats have sunk");
        assert!(!layout(Hypothesis::Cover, 0.05, 1.1).is_plausible(), "what is hidden explains it");
        assert!(
            !Layout { visible: Vec::new(), ..layout(Hypothesis::Woven, 0.05, 0.3) }.is_plausible()
        );
    }
}
