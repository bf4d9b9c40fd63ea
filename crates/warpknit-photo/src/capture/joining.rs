//! Step 3: two segments that are one yarn, joined into one segment.
//!
//! In: two [`Segment`]s on a [`Lattice`]. Out: one segment that bends through both, or nothing
//! where neither goes on from the other. The local search over layouts tries such joins.
//!
//! Not promised: the exact path. A segment's axis is a cubic, which interpolates the two axes at
//! five places.

use glam::DVec2;

use super::lattice::Lattice;
use super::segment::{AXIS_SAMPLES, Segment};
use crate::plane::double;

/// Largest distance between ends that may meet, in mean widths. Larger gaps would join yarns that
/// merely lie in a row; at 0 no noisy fit would ever meet.
const MAX_GAP: f64 = 1.5;
/// Largest turn from one segment to the other, radians: about 70 degrees, since a leg and the head
/// of a loop meet at a steep angle. Near a right angle warp and weft would be joined.
const MAX_TURN: f64 = 1.2;
/// Largest ratio of their widths.
const MAX_WIDTH_RATIO: f64 = 1.8;

impl Segment {
    /// This segment and one that goes on where it ends, as one that bends through both; `None`
    /// where none goes on.
    pub(super) fn joined(&self, other: &Self, lattice: &Lattice) -> Option<Self> {
        if self.width.max(other.width) > MAX_WIDTH_RATIO * self.width.min(other.width) {
            return None;
        }
        let Meeting { own_end, other_end, shift, .. } = self.meeting(other, lattice)?;
        // A polyline along the first segment towards the meeting ends, and on along the second.
        let share = |step: usize| double(step) / double(AXIS_SAMPLES) - 0.5;
        let first = (0..=AXIS_SAMPLES).map(|n| self.axis(own_end * share(n) * self.length).0);
        let second =
            (0..=AXIS_SAMPLES).map(|n| other.axis(-other_end * share(n) * other.length).0 + shift);
        let path: Vec<DVec2> = first.chain(second).collect();
        let shaded = Self {
            width: 0.5 * (self.width + other.width),
            top: self.top.max(other.top),
            round: 0.5 * (self.round + other.round),
            sag: 0.5 * (self.sag + other.sag),
            tilt: 0.5 * (other.top - self.top),
            ..*self
        };
        // A join that is no longer than either of both has folded back on itself.
        Some(shaded.fitted_through(|t| point_along_chord(&path, t)))
            .filter(|joined| joined.length > self.length.max(other.length))
    }

    /// The nearest pair of ends of two segments that may meet.
    fn meeting(&self, other: &Self, lattice: &Lattice) -> Option<Meeting> {
        let ends = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
        ends.into_iter()
            .filter_map(|(own_end, other_end)| self.meeting_at(other, own_end, other_end, lattice))
            .min_by(|p, q| p.gap.total_cmp(&q.gap))
    }

    /// The meeting of one given end of each, if these are near and in line.
    fn meeting_at(
        &self,
        other: &Self,
        own_end: f64,
        other_end: f64,
        lattice: &Lattice,
    ) -> Option<Meeting> {
        let (place, angle) = self.axis(0.5 * own_end * self.length);
        let (next, next_angle) = other.axis(0.5 * other_end * other.length);
        let turn = (own_end * DVec2::from_angle(angle))
            .angle_to(-other_end * DVec2::from_angle(next_angle))
            .abs();
        // The cell repeats, so that the nearest copy of the other segment counts.
        let gap = lattice.nearest(next - place);
        let is_near = turn < MAX_TURN && gap.length() < MAX_GAP * 0.5 * (self.width + other.width);
        let shift = gap - (next - place);
        is_near.then_some(Meeting { gap: gap.length(), own_end, other_end, shift })
    }
}

/// Two ends that meet.
struct Meeting {
    /// Distance between both.
    gap: f64,
    /// Which end of the first segment meets: 1 is ahead, -1 behind.
    own_end: f64,
    /// The same of the second segment.
    other_end: f64,
    /// Offset to the copy of the second segment that is meant.
    shift: DVec2,
}

/// The first point of a path that has come a share of the chord between its ends: -1 is its start
/// and 1 its end.
fn point_along_chord(path: &[DVec2], t: f64) -> DVec2 {
    let (start, end) = (path[0], path[path.len() - 1]);
    if t <= -1.0 {
        return start;
    }
    if t >= 1.0 {
        return end;
    }
    let chord = end - start;
    path.iter()
        .find(|place| chord.dot(**place - start) >= (0.5 + 0.5 * t) * chord.length_squared())
        .copied()
        .unwrap_or(end)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::super::segment::tests::{LATTICE, segment};
    use super::*;

    #[test]
    fn two_that_go_on_straight_ahead_are_one() {
        let whole = Segment { bow: 1.5, sway: 0.5, length: 16.0, ..segment(10.0, 5.0, 0.2) };
        // The second is given backwards, and in the cell offset_point.
        let (first, second) = (whole.part(-8.0, -1.0), whole.part(0.0, 8.0));
        let second = Segment {
            centre: second.centre + LATTICE.b,
            angle: second.angle + PI,
            sway: second.sway,
            bow: -second.bow,
            ..second
        };
        let joined = first.joined(&second, &LATTICE).unwrap();
        assert!(
            (joined.length - 16.0).abs() < 0.1 && between(joined.angle, 0.2) < 0.02,
            "{joined:?}"
        );
        assert!(
            (joined.bow - 1.5).abs() < 0.2
                && (joined.sway - 0.5).abs() < 0.2
                && joined.width == 4.0,
            "{joined:?}"
        );
        let across = Segment { angle: 1.8, ..second };
        assert_eq!(first.joined(&across, &LATTICE), None);
        assert_eq!(first.joined(&Segment { width: 8.0, ..second }, &LATTICE), None);
    }

    fn between(p: f64, q: f64) -> f64 {
        let turn = (p - q).rem_euclid(PI);
        turn.min(PI - turn)
    }
}
