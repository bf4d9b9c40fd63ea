//! Step 3, layout: the yarn segments of a cell.
//!
//! In: the mean cell. Out: a [`Layout`]. Layouts that a weave may have ([`woven`]) and layouts that
//! merely cover the cell ([`greedy_cover`]) are refined on a coarse cell; what they leave unexplained, how
//! many segments they take and how much these overlap say which is best. Where a weave is clear
//! covers are not looked at; of each of them segments are joined, dropped and added while that
//! helps. The best one is refined on a finer cell, and if it can't be believed then, the next one.
//! Cost: half a second to two where a weave is clear, else three to fifteen on two cores.

use rayon::prelude::*;

use super::cell::Cell;
use super::error::CaptureError;
use super::fit::{Fit, Hypothesis};
use super::lattice::Lattice;
use super::segment::{Segment, drawn, places, shares};
use super::target::Target;
use super::visibility::{LEAST, LEAST_GAP, trimmed};
use super::{greedy_cover, woven};
use crate::plane::double;

/// Places of a cell each way while layouts compete, and for the last refinement.
const COARSE: f64 = 26.0;
const FINE: f64 = 52.0;
/// Places each way on which shares of the cell are counted.
const COUNTED: usize = 128;
/// Where a weave costs less no cover is looked at, if it is believable in the end: drawn weaves
/// cost up to .05 and photographed ones .11; satin .13, and loops taken for weaves .18 and more.
const CLEAR: f64 = 0.12;
/// What a weave's segments leave at most without those that aren't seen: drawn and photographed
/// weaves leave up to .28, and the likeliest of loops taken for one .52.
const TOLD: f64 = 0.4;
/// Changes of a layout after its fit.
const MOVES: usize = 12;
/// Copies of segments that touch a cell, in a person's layout; those of 64 floats over ten cells
/// are fewer, and more only cost time.
const MOST_COPIES: f64 = 10_000.0;
/// What a segment more must at least explain of the cell.
const EXPLAINS: f64 = 0.01;
/// A share of the cell under two segments as they are given from which on they bury each other.
const BURIED: f64 = 0.9;
/// What a layout pays for each segment, as a share of its error, and for overlaps above a share of
/// the cell.
const SEGMENT_COST: f64 = 0.08;
const OVERLAP_COST: (f64, f64) = (0.35, 0.08);
/// What it pays for what only its hidden segments explain, beyond what the ends of seen ones do
/// below others; and for breaking the rule of overlaps.
const UNSEEN_COST: (f64, f64) = (0.05, 0.2);
const INVALID_COST: f64 = 0.1;

/// The yarns of a cell.
#[derive(Clone, Debug)]
pub struct Layout {
    /// One of each copy, as far as they go below others; of weaves without those of which nothing
    /// is seen.
    pub segments: Vec<Segment>,
    /// The same as far as they are seen, one that passes under another in several parts; without
    /// those that aren't.
    pub seen: Vec<Segment>,
    /// Which of the segments each of these is.
    pub numbers: Vec<usize>,
    /// How light the deepest ground is.
    pub ground: f64,
    /// Share of the mean cell's variance that the segments leave.
    pub error: f64,
    /// Share that those parts of them leave which are seen: the cloth is made of these.
    pub seen_error: f64,
    /// What they were sought as.
    pub hypothesis: Hypothesis,
    /// Share of the cell that lies under two segments.
    pub overlap: f64,
    /// Share of the cell that lies under none.
    pub blank: f64,
}

impl Layout {
    /// The same in pixels of another size.
    pub(super) fn scaled(&self, scale: f64) -> Self {
        let of =
            |segments: &[Segment]| segments.iter().map(|segment| segment.scaled(scale)).collect();
        Self {
            segments: of(&self.segments),
            seen: of(&self.seen),
            numbers: self.numbers.clone(),
            ..*self
        }
    }

    /// The paper's rule: little overlap and little blank. So much of the cell may be either in a
    /// layout that a person gives.
    pub const MOST_OVERLAP: f64 = 0.35;
    /// The same for what lies under no yarn; nets are mostly that.
    pub const MOST_BLANK: f64 = 0.75;

    fn of(Fit { segments, hypothesis, ground, error }: Fit, target: &Target) -> Self {
        let (numbers, seen): (Vec<_>, Vec<_>) =
            trimmed(&segments, &target.lattice, LEAST_GAP).into_iter().unzip();
        let [overlap, blank] = counted(&seen, &target.lattice);
        let seen_error = target.error(&seen, ground);
        Self { segments, seen, numbers, ground, error, seen_error, hypothesis, overlap, blank }
    }

    /// The numbers of segments of which nothing is seen.
    pub(super) fn hidden(&self) -> Vec<usize> {
        (0..self.segments.len()).filter(|number| !self.numbers.contains(number)).collect()
    }

    /// Whether it tells of the cell at all, after its last fit: floats may sink then, and what
    /// covers a cell by what nobody sees leaves more than nothing would.
    fn is_believable(&self) -> bool {
        let most = if self.hypothesis == Hypothesis::Woven { TOLD } else { 1.0 };
        !self.seen.is_empty() && self.error < most && self.seen_error < 1.0
    }

    /// Whether it keeps the rule.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        !self.seen.is_empty()
            && self.overlap <= Self::MOST_OVERLAP
            && self.blank <= Self::MOST_BLANK
    }
}

/// Finds the layout of a cell; nothing where none can be believed.
pub(super) fn find(cell: &Cell) -> Option<Layout> {
    let (coarse, fine) = (Target::new(cell, COARSE), Target::new(cell, FINE));
    let (ground, top) = (coarse.quantile(0.04), coarse.quantile(0.9));
    let costed = |fit: Fit| {
        let fit = pruned(&coarse, fit);
        (cost(&coarse, &fit), fit)
    };
    let refined = |(_, fit): &(f64, Fit)| {
        let layout = Layout::of(told(fit.with(&fine, &fit.segments, 40), &fine), &fine);
        layout.is_believable().then_some(layout)
    };
    let mut fits: Vec<(f64, Fit)> = woven::fits(&coarse, ground, top).map(costed).collect();
    fits.retain(|(_, fit)| told(fit.clone(), &coarse).error < TOLD);
    fits.sort_by(|p, q| p.0.total_cmp(&q.0));
    let unclear = fits.split_off(fits.partition_point(|(cost, _)| *cost < CLEAR));
    fits.iter().find_map(refined).or_else(|| {
        let mut fits = unclear;
        fits.par_extend(
            greedy_cover::fits(&coarse, ground, top)
                .map(costed)
                .map(|(cost, fit)| settled(&coarse, fit, cost, top)),
        );
        fits.sort_by(|p, q| p.0.total_cmp(&q.0));
        fits.iter().find_map(refined)
    })
}

/// A fit with its segments in the cell; of a weave without what nobody sees, as yarns below are
/// where cloth is dense.
fn told(mut fit: Fit, target: &Target) -> Fit {
    let lattice = &target.lattice;
    if fit.hypothesis == Hypothesis::Woven {
        let seen = trimmed(&fit.segments, lattice, LEAST_GAP);
        fit.segments =
            seen.chunk_by(|p, q| p.0 == q.0).map(|parts| fit.segments[parts[0].0]).collect();
    }
    fit.segments.iter_mut().for_each(|segment| segment.centre = lattice.home(segment.centre));
    fit.error = target.error(&fit.segments, fit.ground);
    fit
}

/// A person's layout on a cell. Segments that bury each other are counted as they are given, since
/// little of them is seen.
pub(super) fn given(
    cell: &Cell,
    segments: Vec<Segment>,
    ground: f64,
) -> Result<Layout, CaptureError> {
    let copies = segments.iter().map(|segment| segment.crowd(&cell.lattice)).sum::<f64>();
    if copies > MOST_COPIES {
        return Err(CaptureError::Crowded { copies, most: MOST_COPIES });
    }
    let [overlap, blank] = counted(&segments, &cell.lattice);
    let target = Target::new(cell, FINE);
    let error = target.error(&segments, ground);
    let layout =
        Layout::of(Fit { segments, hypothesis: Hypothesis::Given, ground, error }, &target);
    let is_buried = overlap > BURIED || 2 * layout.hidden().len() > layout.segments.len();
    let layout = if is_buried { Layout { overlap, blank, ..layout } } else { layout };
    if layout.is_valid() {
        return Ok(layout);
    }
    let (most_overlap, most_blank) = (Layout::MOST_OVERLAP, Layout::MOST_BLANK);
    // The shares say nothing of segments that are as dark as the ground, or too short to be told.
    let is_dark = drawn(&layout.segments, 0.0, &target.lattice, &target.places)
        .iter()
        .all(|light| *light <= 0.0);
    if is_dark || layout.overlap <= most_overlap && layout.blank <= most_blank {
        return Err(CaptureError::Unseen);
    }
    Err(CaptureError::Invalid {
        overlap: layout.overlap,
        blank: layout.blank,
        most_overlap,
        most_blank,
    })
}

/// Shares of a cell that lie under two segments, and under none.
fn counted(segments: &[Segment], lattice: &Lattice) -> [f64; 2] {
    shares(segments, lattice, &places(lattice, [COUNTED; 2]))
}

fn cost(target: &Target, fit: &Fit) -> f64 {
    // Gaps of a weave show yarns that are known to run there; those of covers are no reason to
    // believe in a segment.
    let gap = if fit.hypothesis == Hypothesis::Woven { LEAST_GAP } else { LEAST };
    let seen: Vec<Segment> = trimmed(&fit.segments, &target.lattice, gap)
        .into_iter()
        .map(|(_, segment)| segment)
        .collect();
    let [overlap, _] = shares(&seen, &target.lattice, &target.places);
    // What is told in the end is what is seen: slivers that make up for a wrong layout are not.
    let told = target.error(&seen, fit.ground);
    let error = fit.error + UNSEEN_COST.0 * (told - fit.error - UNSEEN_COST.1).max(0.0);
    let error = error + if overlap > Layout::MOST_OVERLAP { INVALID_COST } else { 0.0 };
    error * (1.0 + SEGMENT_COST * double(fit.segments.len()))
        + OVERLAP_COST.0 * (overlap - OVERLAP_COST.1).max(0.0)
}

/// With segments joined that are one yarn, without needless ones, and with those added that are
/// lacking then, as long as the layout costs less than `least` so.
fn settled(target: &Target, mut fit: Fit, mut least: f64, top: f64) -> (f64, Fit) {
    for _ in 0..MOVES {
        let fewer = fewer(&fit.segments, &target.lattice)
            .into_par_iter()
            .map(|segments| fit.with(target, &segments, 12));
        let costed = |fit: Fit| (cost(target, &fit), fit);
        let best =
            fewer.map(costed).min_by(|p, q| p.0.total_cmp(&q.0)).filter(|(less, _)| *less < least);
        let best = best.or_else(|| {
            Some(costed(greedy_cover::grown(target, fit.clone(), top)))
                .filter(|(less, _)| *less < least)
        });
        let Some(better) = best else { break };
        (least, fit) = better;
    }
    (least, fit)
}

/// All layouts with a segment less: without it, or joined with another.
fn fewer(segments: &[Segment], lattice: &Lattice) -> Vec<Vec<Segment>> {
    let without = |gone: [usize; 2]| -> Vec<Segment> {
        segments
            .iter()
            .enumerate()
            .filter(|(number, _)| !gone.contains(number))
            .map(|(_, segment)| *segment)
            .collect()
    };
    let mut layouts = Vec::new();
    for p in 0..segments.len() {
        layouts.push(without([p, p]));
        for q in p + 1..segments.len() {
            layouts.extend(
                segments[p]
                    .joined(&segments[q], lattice)
                    .map(|joined| [without([p, q]), vec![joined]].concat()),
            );
        }
    }
    layouts.retain(|layout| !layout.is_empty());
    layouts
}

/// Without segments that explain next to nothing.
fn pruned(target: &Target, mut fit: Fit) -> Fit {
    while fit.segments.len() > 1 {
        let without = |number: usize| {
            let mut rest = fit.segments.clone();
            rest.remove(number);
            (target.error(&rest, fit.ground), number)
        };
        let least = (0..fit.segments.len()).map(without).min_by(|p, q| p.0.total_cmp(&q.0));
        let Some((_, number)) = least.filter(|(error, _)| *error <= fit.error + EXPLAINS) else {
            break;
        };
        fit.segments.remove(number);
        fit = fit.with(target, &fit.segments, 8);
    }
    fit
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    #[test]
    fn what_explains_less_than_nothing_would_is_not_believed() {
        let segments = vec![Segment::straight(DVec2::ZERO, 0.0, 4.0, 9.0, 1.0)];
        let (seen, numbers, ground) = (segments.clone(), vec![0], -1.0);
        let layout = |hypothesis, error, seen_error| {
            let (segments, seen, numbers) = (segments.clone(), seen.clone(), numbers.clone());
            Layout {
                segments,
                seen,
                numbers,
                ground,
                error,
                seen_error,
                hypothesis,
                overlap: 0.0,
                blank: 0.5,
            }
        };
        assert!(
            layout(Hypothesis::Woven, 0.05, 0.3).is_believable()
                && layout(Hypothesis::Cover, 0.5, 0.9).is_believable()
        );
        assert!(!layout(Hypothesis::Woven, 0.45, 0.5).is_believable(), "its floats have sunk");
        assert!(
            !layout(Hypothesis::Cover, 0.05, 1.1).is_believable(),
            "what is hidden explains it"
        );
        assert!(
            !Layout { seen: Vec::new(), ..layout(Hypothesis::Woven, 0.05, 0.3) }.is_believable()
        );
    }
}
