//! Step 3: what is seen of segments that lie over each other.
//!
//! In: [`Segment`]s on a [`Lattice`]. Out: their stretches that nothing else lies over, each a
//! segment with the number of its own. Cost: one drawing of all segments at the places along each.

use glam::DVec2;

use super::lattice::Lattice;
use super::segment::{STEPS, Segment, drawn};
use crate::plane::double;

/// What is seen over fewer widths of a segment at one of its ends is not told.
pub(super) const LEAST: f64 = 0.5;
/// The same between two others that lie over it, of a yarn that is seen nowhere else for longer.
pub(super) const LEAST_GAP: f64 = 0.25;

/// What a segment shows at a place of its axis.
#[derive(Clone, Copy, PartialEq)]
enum Shows {
    /// Nothing: it has gone down.
    Ended,
    /// Nothing: others lie over it.
    Below,
    /// Itself.
    Seen,
}

/// Segments as long as they are seen, each with its number, in [`STEPS`] / 3 parts at most: those
/// parts left out that others lie over. Those that are hardly seen are gone, and so is what is seen
/// between two others over fewer widths than `gap`, or than [`LEAST`] where more is seen of the
/// segment elsewhere.
pub(super) fn trimmed(segments: &[Segment], lattice: &Lattice, gap: f64) -> Vec<(usize, Segment)> {
    let parts = |(number, stretches): (usize, Vec<(f64, f64)>)| {
        let part = move |(first, last)| (number, segments[number].part(first, last));
        stretches.into_iter().map(part)
    };
    stretches(segments, lattice, gap).into_iter().enumerate().flat_map(parts).collect()
}

/// Where along each segment nothing else lies over its axis.
fn stretches(segments: &[Segment], lattice: &Lattice, gap: f64) -> Vec<Vec<(f64, f64)>> {
    // A yarn goes down beyond its ends, and is still seen there.
    let along = |segment: &Segment, step: usize| {
        (segment.length + 0.8 * segment.width) * (double(step) / double(STEPS) - 0.5)
    };
    let axis = |segment: &Segment| {
        (0..=STEPS).map(|step| segment.axis(along(segment, step)).0).collect::<Vec<_>>()
    };
    let places = segments.iter().flat_map(axis).collect::<Vec<_>>();
    let homes: Vec<DVec2> = places.iter().map(|place| lattice.home(*place)).collect();
    let highest = drawn(segments, 0.0, lattice, &homes);
    let axes = places.chunks_exact(STEPS + 1).zip(highest.chunks_exact(STEPS + 1));
    let seen = |(segment, (places, highest)): (&Segment, (&[DVec2], &[f64]))| {
        let way = DVec2::from_angle(segment.angle);
        let shows =
            |(place, highest): (&DVec2, &f64)| match segment.height(*place - segment.centre, way) {
                own if own <= 0.0 => Shows::Ended,
                own if own >= highest - 1e-9 => Shows::Seen,
                _ => Shows::Below,
            };
        let shown: Vec<Shows> = places.iter().zip(highest).map(shows).collect();
        let runs: Vec<&[Shows]> = shown.chunk_by(|a, b| a == b).collect();
        let starts = runs.iter().scan(0, |start, run| {
            *start += run.len();
            Some(*start - run.len())
        });
        let long = starts
            .enumerate()
            .filter(|(number, _)| runs[*number][0] == Shows::Seen)
            .filter_map(|(number, start)| {
                let is_below = |number: Option<usize>| {
                    number.and_then(|n| runs.get(n)).is_some_and(|run| run[0] == Shows::Below)
                };
                let is_gap = is_below(number.checked_sub(1)) && is_below(Some(number + 1));
                let (first, last) =
                    (along(segment, start), along(segment, start + runs[number].len() - 1));
                (last - first > if is_gap { gap } else { LEAST } * segment.width)
                    .then_some((first, last))
            });
        let mut kept: Vec<(f64, f64)> = Vec::new();
        for (first, last) in long {
            // What is longer than a cell passes under the same yarn once a cell: its stretches are
            // copies of each other.
            let middle = |(first, last): (f64, f64)| segment.axis(0.5 * (first + last)).0;
            let same = |other: &(f64, f64)| {
                lattice.nearest(middle((first, last)) - middle(*other)).length()
                    < 0.5 * segment.width
            };
            if !kept.iter().any(same) {
                kept.push((first, last));
            }
        }
        // Gaps that show a little tell of yarns that are seen nowhere else.
        let is_long = |(first, last): &(f64, f64)| last - first > LEAST * segment.width;
        if kept.iter().any(is_long) {
            kept.retain(is_long);
        }
        kept
    };
    segments.iter().zip(axes).map(seen).collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use glam::DVec2;

    use super::*;

    const LATTICE: Lattice = Lattice { a: DVec2::new(20.0, 0.0), b: DVec2::new(0.0, 10.0) };

    fn segment(x: f64, y: f64, angle: f64) -> Segment {
        let centre = DVec2::new(x, y);
        Segment { sag: 0.4, tilt: 0.1, ..Segment::straight(centre, angle, 4.0, 12.0, 1.0) }
    }

    #[test]
    fn what_lies_below_another_is_not_seen() {
        let (over, under) = (
            segment(10.0, 5.0, 0.0),
            Segment { top: 0.9, length: 9.0, ..segment(10.0, 5.0, FRAC_PI_2) },
        );
        let seen = trimmed(&[over, under], &LATTICE, LEAST_GAP);
        let [(0, over), (1, first), (1, second)] = seen[..] else { panic!("{seen:?}") };
        assert!(over.length > 12.0 && first.length < 4.0 && second.length < 4.0, "{seen:?}");
        assert!(first.centre.y < 3.5 && second.centre.y > 6.5, "{seen:?}");
        assert_eq!(trimmed(&[over, Segment { top: 0.2, ..over }], &LATTICE, LEAST_GAP).len(), 1);
    }

    #[test]
    fn slivers_are_told_of_a_yarn_that_is_seen_nowhere_else() {
        // Of the lower one a gap of some .35 widths is seen between two others; and, where it is
        // longer, its end.
        let across = |x: f64| Segment { top: 2.0, sag: 0.2, ..segment(x, 5.0, FRAC_PI_2) };
        let over = [across(7.0), across(13.0)];
        let seen = |length: f64, gap: f64| {
            let below = Segment { length, tilt: 0.0, ..segment(10.0, 5.0, 0.0) };
            let trimmed = trimmed(&[over[0], over[1], below], &LATTICE, gap);
            trimmed
                .iter()
                .filter(|(number, _)| *number == 2)
                .map(|(_, part)| part.length / part.width)
                .collect::<Vec<_>>()
        };
        let [sliver] = seen(6.0, LEAST_GAP)[..] else { panic!("{:?}", seen(6.0, LEAST_GAP)) };
        assert!(sliver > LEAST_GAP && sliver < LEAST && seen(6.0, LEAST).is_empty(), "{sliver}");
        let long = seen(17.0, LEAST_GAP);
        assert!(!long.is_empty() && long.iter().all(|length| *length > LEAST), "{long:?}");
    }

    #[test]
    fn what_is_longer_than_a_cell_is_seen_once() {
        let long = Segment { length: 50.0, ..segment(10.0, 5.0, 0.0) };
        let over = Segment { top: 2.0, length: 9.0, ..segment(10.0, 5.0, FRAC_PI_2) };
        let seen = trimmed(&[long, over], &LATTICE, LEAST_GAP);
        assert_eq!(seen.iter().filter(|(number, _)| *number == 0).count(), 1, "{seen:?}");
    }
}
