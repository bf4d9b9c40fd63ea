//! Step 3: visibility of segments that lie over each other.
//!
//! In: [`Segment`]s on a [`Lattice`]. Out: the visible parts of each, that is the stretches of its
//! axis that no other segment lies over. Each part is a segment, and comes with the index of the
//! one that it is a part of.
//!
//! Method: a depth test at sample points along each axis, against the upper envelope of all
//! segments. Cost: one rendering of all segments at 61 points a segment.
//!
//! Not promised: visibility across a segment. One whose axis is covered while its edges show counts
//! as hidden there.

use glam::DVec2;

use super::lattice::Lattice;
use super::relief::{Relief, Samples, rendered};
use super::segment::{AXIS_SAMPLES, Segment};
use crate::plane::double;

/// The shortest visible part that counts at an end of a segment, in widths. Shorter ones are
/// slivers by which a fit makes up for its errors.
pub(super) const MIN_VISIBLE: f64 = 0.5;
/// The shortest visible part between two segments that lie over it, in widths, for a yarn that has
/// no longer visible part. Gaps of loose weaves show such parts of the yarn below.
pub(super) const MIN_VISIBLE_GAP: f64 = 0.25;

/// Visibility of a segment at a point of its axis.
#[derive(Clone, Copy, PartialEq)]
enum Visibility {
    /// It has gone down below the ground.
    Ended,
    /// Others lie over it.
    Covered,
    /// It is the topmost.
    Visible,
}

/// The visible parts of segments, each with the index of its segment; at most [`AXIS_SAMPLES`] / 3
/// parts a segment. Parts shorter than [`MIN_VISIBLE`] widths are left out. Between two segments
/// that cover it, a part of `gap` widths counts too, unless the segment has a longer part.
pub(super) fn visible_parts(
    segments: &[Segment],
    lattice: &Lattice,
    gap: f64,
) -> Vec<(usize, Segment)> {
    let mut parts = Vec::new();
    for (number, intervals) in visible_intervals(segments, lattice, gap).into_iter().enumerate() {
        for (first, last) in intervals {
            parts.push((number, segments[number].part(first, last)));
        }
    }
    parts
}

/// The position along a segment of one of its sample points. They go 0.4 widths beyond its ends,
/// because a yarn that goes down is still visible there.
fn sample_position(segment: &Segment, step: usize) -> f64 {
    (segment.length + 0.8 * segment.width) * (double(step) / double(AXIS_SAMPLES) - 0.5)
}

/// The intervals of each segment's axis that nothing else lies over.
fn visible_intervals(segments: &[Segment], lattice: &Lattice, gap: f64) -> Vec<Vec<(f64, f64)>> {
    let points: Vec<DVec2> = segments
        .iter()
        .flat_map(|segment| {
            (0..=AXIS_SAMPLES).map(|step| segment.axis(sample_position(segment, step)).0)
        })
        .collect();
    // Only copies that touch the cell at the origin are rendered, so that points are wrapped into
    // that cell first.
    let wrapped = Samples::new(points.iter().map(|place| lattice.wrap_to_cell(*place)).collect());
    let highest = rendered(segments, 0.0, lattice, &wrapped);
    segments
        .iter()
        .zip(points.chunks_exact(AXIS_SAMPLES + 1))
        .zip(highest.chunks_exact(AXIS_SAMPLES + 1))
        .map(|((segment, points), highest)| {
            let visibility = depth_test(segment, points, highest);
            without_slivers(segment, long_runs(segment, &visibility, gap), lattice)
        })
        .collect()
}

/// The visibility of a segment at its sample points, where the upper envelope is `highest`.
fn depth_test(segment: &Segment, points: &[DVec2], highest: &[f64]) -> Vec<Visibility> {
    let relief = Relief::new(segment);
    points
        .iter()
        .zip(highest)
        .map(|(place, highest)| match relief.height(*place - segment.centre) {
            own if own <= 0.0 => Visibility::Ended,
            // The envelope holds the segment's own height, computed at the wrapped point: rounding
            // differs, and without a tolerance a segment would cover itself.
            own if own >= highest - 1e-9 => Visibility::Visible,
            _ => Visibility::Covered,
        })
        .collect()
}

/// The runs of visible sample points that are long enough to count.
fn long_runs(segment: &Segment, visibility: &[Visibility], gap: f64) -> Vec<(f64, f64)> {
    let runs: Vec<&[Visibility]> = visibility.chunk_by(|a, b| a == b).collect();
    let mut long = Vec::new();
    let mut start = 0;
    for (number, run) in runs.iter().enumerate() {
        let (from, to) = (start, start + run.len() - 1);
        start += run.len();
        if run[0] != Visibility::Visible {
            continue;
        }
        // A gap has a covering segment on both sides. At an end of the yarn a sliver is no proof of
        // a yarn, and has to be longer.
        let is_gap = number > 0
            && runs[number - 1][0] == Visibility::Covered
            && runs.get(number + 1).is_some_and(|run| run[0] == Visibility::Covered);
        let (first, last) = (sample_position(segment, from), sample_position(segment, to));
        if last - first > if is_gap { gap } else { MIN_VISIBLE } * segment.width {
            long.push((first, last));
        }
    }
    long
}

/// Intervals without copies of each other, and without slivers where there is a longer one.
fn without_slivers(
    segment: &Segment,
    intervals: Vec<(f64, f64)>,
    lattice: &Lattice,
) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = Vec::new();
    for interval in intervals {
        // A segment longer than a cell passes under the same yarn once a cell, and its parts there
        // are copies of each other. Kept twice, the cloth would have the yarn twice.
        let is_copy = kept.iter().any(|other| {
            let offset = interval_middle(segment, interval) - interval_middle(segment, *other);
            lattice.nearest(offset).length() < 0.5 * segment.width
        });
        if !is_copy {
            kept.push(interval);
        }
    }
    // Slivers in gaps matter only for yarns that are visible nowhere else.
    let long: Vec<(f64, f64)> = kept
        .iter()
        .copied()
        .filter(|(first, last)| last - first > MIN_VISIBLE * segment.width)
        .collect();
    if long.is_empty() { kept } else { long }
}

/// The point of a segment's axis in the middle of an interval.
fn interval_middle(segment: &Segment, (first, last): (f64, f64)) -> DVec2 {
    segment.axis(0.5 * (first + last)).0
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::super::segment::tests::{LATTICE, segment};
    use super::*;

    #[test]
    fn what_lies_below_another_is_not_visible() {
        let (over, under) = (
            segment(10.0, 5.0, 0.0),
            Segment { top: 0.9, length: 9.0, ..segment(10.0, 5.0, FRAC_PI_2) },
        );
        let seen = visible_parts(&[over, under], &LATTICE, MIN_VISIBLE_GAP);
        let [(0, over), (1, first), (1, second)] = seen[..] else { panic!("{seen:?}") };
        assert!(over.length > 12.0 && first.length < 4.0 && second.length < 4.0, "{seen:?}");
        assert!(first.centre.y < 3.5 && second.centre.y > 6.5, "{seen:?}");
        assert_eq!(
            visible_parts(&[over, Segment { top: 0.2, ..over }], &LATTICE, MIN_VISIBLE_GAP).len(),
            1
        );
    }

    #[test]
    fn slivers_count_only_for_a_yarn_without_a_longer_visible_part() {
        // A gap of about 0.35 widths shows the lower yarn between two others. Where it is longer,
        // its end is visible too.
        let across = |x: f64| Segment { top: 2.0, sag: 0.2, ..segment(x, 5.0, FRAC_PI_2) };
        let over = [across(7.0), across(13.0)];
        let seen = |length: f64, gap: f64| {
            let below = Segment { length, tilt: 0.0, ..segment(10.0, 5.0, 0.0) };
            let visible_parts = visible_parts(&[over[0], over[1], below], &LATTICE, gap);
            visible_parts
                .iter()
                .filter(|(number, _)| *number == 2)
                .map(|(_, part)| part.length / part.width)
                .collect::<Vec<_>>()
        };
        let [sliver] = seen(6.0, MIN_VISIBLE_GAP)[..] else {
            panic!("{:?}", seen(6.0, MIN_VISIBLE_GAP))
        };
        assert!(
            sliver > MIN_VISIBLE_GAP && sliver < MIN_VISIBLE && seen(6.0, MIN_VISIBLE).is_empty(),
            "{sliver}"
        );
        let long = seen(17.0, MIN_VISIBLE_GAP);
        assert!(!long.is_empty() && long.iter().all(|length| *length > MIN_VISIBLE), "{long:?}");
    }

    #[test]
    fn what_is_longer_than_a_cell_is_visible_once() {
        let long = Segment { length: 50.0, ..segment(10.0, 5.0, 0.0) };
        let over = Segment { top: 2.0, length: 9.0, ..segment(10.0, 5.0, FRAC_PI_2) };
        let seen = visible_parts(&[long, over], &LATTICE, MIN_VISIBLE_GAP);
        assert_eq!(seen.iter().filter(|(number, _)| *number == 0).count(), 1, "{seen:?}");
    }
}
