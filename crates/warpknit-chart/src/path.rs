//! The path of one yarn on point paper: from its chain to a smooth line around the needles' dots.
//!
//! In: a chain, and the [`Lane`] that keeps the bar's path apart from those of other bars. Out:
//! waypoints in px ([`waypoints`]), clipped at the sheet's sides ([`clipped`]), with rounded
//! corners ([`rounded`]). x grows to the right as seen from the technical back, so gap 0 of a
//! right-hand drive is the rightmost one; y grows with the courses. Cost: six waypoints a course.
//!
//! ```text
//!        ___          the overlap: up through the entry gap, over the dot, down through
//!       /   \
//!      |  o  |   |    a closed lap goes on below the dot, across its own entry, and up in
//!      |   __|__/     the gap beside it (drawn here); an open one turns up in the gap in
//!       \_/  |        which it came down
//!            |        the underlap: a line in the band between two rows of dots, so that
//!                     it touches none of them
//! ```

use glam::DVec2;

use warpknit_core::fabric::lapping::Chain;

/// Distance of the band of underlaps from the rows of dots above and below it, over the row pitch.
const BAND: f64 = 0.36;
/// How far an open lap reaches below its dot, over the row pitch.
const OPEN_FOOT: f64 = 0.06;
/// How far a closed lap reaches below its dot at least, over the row pitch.
const CLOSED_FOOT: f64 = 0.21;

/// Spacings of the point paper, px.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pitch {
    /// From needle to needle.
    pub(super) across: f64,
    /// From course to course.
    pub(super) along: f64,
}

/// The offsets that keep a bar's path apart from those of other bars, px.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lane {
    /// Distance of the legs of an overlap from their needle.
    pub(super) leg: f64,
    /// Distance from the middle of a gap and of a band.
    pub(super) aside: f64,
}

/// A segment of a path. It begins where the last one ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PathSegment {
    /// Begins a new line there.
    Move(DVec2),
    /// A straight line.
    Line(DVec2),
    /// A cubic Bézier curve: two controls and its end.
    Curve(DVec2, DVec2, DVec2),
}

impl PathSegment {
    /// Where it ends.
    #[must_use]
    pub fn end(self) -> DVec2 {
        match self {
            Self::Move(end) | Self::Line(end) | Self::Curve(_, _, end) => end,
        }
    }
}

/// The corners of the yarn of `guide` in courses `0..courses`.
pub(super) fn waypoints(
    chain: &Chain,
    guide: i64,
    courses: i64,
    pitch: Pitch,
    lane: Lane,
) -> Vec<DVec2> {
    (0..courses).flat_map(|course| lap(chain, guide, course, pitch, lane)).collect()
}

/// The corners of one lap, from below its dot to the band above it.
fn lap(chain: &Chain, guide: i64, course: i64, pitch: Pitch, lane: Lane) -> Vec<DVec2> {
    let lap = chain.lap(course);
    let (overlap, underlap) = (lap.overlap(), chain.underlap(course));
    #[expect(clippy::cast_precision_loss, reason = "guides and courses are counted in thousands")]
    let (guide, row) = (guide as f64, course as f64 * pitch.along);
    let x = |gap: f64| -(guide + gap) * pitch.across;
    let point = |x: f64, above: f64| DVec2::new(x, row + above);
    let (from, to) = (f64::from(lap.from), f64::from(lap.to));
    let (below, above) = (-BAND * pitch.along + lane.aside, BAND * pitch.along + lane.aside);
    // An inlay or a miss-lap has no overlap: the yarn goes straight up in its gap.
    if overlap == 0 {
        let x = x(from) + lane.aside;
        return vec![point(x, below), point(x, above)];
    }
    let o = f64::from(overlap);
    let entry = x(from + o / 2.0) + o * lane.leg;
    let exit = x(to - o / 2.0) - o * lane.leg;
    // In a closed lap the underlap goes against the overlap: it passes back below the needles of
    // its own overlap and crosses its own entry. It reaches as far down as the overlap reaches up,
    // so that the loop looks round. In an open lap the yarn turns up in the gap it came down in.
    let (channel, foot) = if chain.is_closed(course) {
        let width = (lap.to - lap.from).abs().min(underlap.abs());
        (to + f64::from(underlap.signum() * width), lane.leg.max(CLOSED_FOOT * pitch.along))
    } else {
        (to, OPEN_FOOT * pitch.along)
    };
    let channel = x(channel) + lane.aside;
    let foot = lane.aside / 2.0 - foot;
    let path = [
        (entry, below),
        (entry, lane.leg),
        (exit, lane.leg),
        (exit, foot),
        (channel, foot),
        (channel, above),
    ];
    path.map(|(x, above)| point(x, above)).to_vec()
}

/// The parts of a polyline with `low <= x <= high` (Liang and Barsky 1984, "A new concept and
/// method for line clipping", for one axis).
pub(super) fn clipped(points: &[DVec2], low: f64, high: f64) -> Vec<Vec<DVec2>> {
    let mut parts: Vec<Vec<DVec2>> = Vec::new();
    let mut inside = false;
    for pair in points.windows(2) {
        let (start, step) = (pair[0], pair[1] - pair[0]);
        // Parameters at which the line enters and leaves the strip.
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        if step.x == 0.0 {
            if !(low..=high).contains(&start.x) {
                inside = false;
                continue;
            }
        } else {
            let (a, b) = ((low - start.x) / step.x, (high - start.x) / step.x);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        if enter >= leave {
            inside = false;
            continue;
        }
        // A part continues only where the last line ended inside.
        if !inside || enter > 0.0 {
            parts.push(vec![start + enter * step]);
        }
        parts.last_mut().expect("a part was begun").push(start + leave * step);
        inside = leave >= 1.0;
    }
    parts
}

/// A polyline with rounded corners. Each corner takes `reach` px of its two sides, or half of the
/// shorter side where that is less, so that neighbouring corners don't overlap.
pub(super) fn rounded(points: &[DVec2], reach: f64) -> Vec<PathSegment> {
    // Repeated points have no direction, so they are dropped first.
    let mut corners: Vec<DVec2> = Vec::new();
    for &point in points {
        if corners.last().is_none_or(|last| last.distance_squared(point) > 1e-12) {
            corners.push(point);
        }
    }
    let mut segments: Vec<_> =
        corners.first().map(|&start| PathSegment::Move(start)).into_iter().collect();
    for corner in corners.windows(3) {
        let [before, at, after] = [corner[0], corner[1], corner[2]];
        let reach = reach.min(at.distance(before) / 2.0).min(at.distance(after) / 2.0);
        let (start, end) =
            (at + (before - at).normalize() * reach, at + (after - at).normalize() * reach);
        let turn = (at - before).angle_to(after - at).abs();
        if turn < 1e-6 {
            segments.push(PathSegment::Line(at));
            continue;
        }
        // The cubic Bézier curve that approximates a circular arc of angle θ has controls at
        // 4/3 tan(θ/4) radii from its ends. The corner is tan(θ/2) radii away, so this is the share
        // of the way to the corner.
        let round = 4.0 / 3.0 * (turn / 4.0).tan() / (turn / 2.0).tan();
        if segments.last().is_some_and(|segment| segment.end().distance_squared(start) > 1e-12) {
            segments.push(PathSegment::Line(start));
        }
        segments.push(PathSegment::Curve(start.lerp(at, round), end.lerp(at, round), end));
    }
    if corners.len() > 1 {
        segments.push(PathSegment::Line(corners[corners.len() - 1]));
    }
    segments
}

#[cfg(test)]
mod tests {
    use super::*;
    use warpknit_core::fabric::lapping::Numbering;

    const PITCH: Pitch = Pitch { across: 40.0, along: 50.0 };
    const LANE: Lane = Lane { leg: 10.0, aside: 0.0 };

    fn corners(chain: &str, courses: i64) -> Vec<DVec2> {
        waypoints(&Chain::parse(chain, Numbering::Tricot).unwrap(), 0, courses, PITCH, LANE)
    }

    /// Proper crossings of a polyline with itself.
    fn crossings(points: &[DVec2]) -> usize {
        let side = |a: DVec2, b: DVec2, p: DVec2| (b - a).perp_dot(p - a);
        let cross = |a: &[DVec2], b: &[DVec2]| {
            side(a[0], a[1], b[0]) * side(a[0], a[1], b[1]) < 0.0
                && side(b[0], b[1], a[0]) * side(b[0], b[1], a[1]) < 0.0
        };
        let lines: Vec<_> = points.windows(2).collect();
        (0..lines.len())
            .map(|at| lines[at + 1..].iter().filter(|line| cross(lines[at], line)).count())
            .sum()
    }

    #[test]
    fn a_lap_goes_over_its_own_dot() {
        // The needle of 1-0 lies half a pitch to the left of gap 0.
        for (chain, entry, exit) in [("1-0", -30.0, -10.0), ("0-1", -10.0, -30.0)] {
            let path = corners(chain, 1);
            assert_eq!(
                (path[1], path[2]),
                (DVec2::new(entry, 10.0), DVec2::new(exit, 10.0)),
                "{chain}"
            );
        }
        let two = corners("0-2/2-0", 1);
        assert_eq!((two[1].x, two[2].x), (-10.0, -70.0));
    }

    #[test]
    fn closed_laps_cross_themselves_once_and_open_ones_never() {
        for (chain, courses, expected) in [
            ("1-0/1-0", 4, 4),
            ("1-0/0-1", 4, 0),
            ("1-0/1-2", 4, 4),
            ("0-1/2-1", 4, 0),
            ("2-3/1-0", 4, 4),
            ("1-0/4-5", 4, 4),
            ("1-0/1-2/2-3/2-1", 4, 2),
            ("0-2/2-0", 4, 0),
            ("0-2/0-2", 4, 4),
            ("0-2/1-0", 2, 1),
            ("0-0/3-3", 4, 0),
        ] {
            assert_eq!(crossings(&corners(chain, courses)), expected, "{chain}");
        }
    }

    #[test]
    fn a_cut_path_keeps_what_lies_inside() {
        let path = [
            DVec2::new(-10.0, 0.0),
            DVec2::new(30.0, 40.0),
            DVec2::new(30.0, 50.0),
            DVec2::new(5.0, 50.0),
        ];
        let parts = clipped(&path, 0.0, 20.0);
        assert_eq!(
            parts,
            [
                [DVec2::new(0.0, 10.0), DVec2::new(20.0, 30.0)],
                [DVec2::new(20.0, 50.0), DVec2::new(5.0, 50.0)]
            ]
        );
        assert_eq!(clipped(&path, -100.0, 100.0), [path.to_vec()]);
        assert!(clipped(&path, 100.0, 200.0).is_empty());
    }

    #[test]
    fn rounding_keeps_the_ends_and_straight_lines() {
        let path = corners("1-0/1-2", 3);
        let segments = rounded(&path, 15.0);
        assert_eq!(
            (segments[0], segments[segments.len() - 1].end()),
            (PathSegment::Move(path[0]), path[path.len() - 1])
        );
        assert_eq!(
            rounded(&[DVec2::ZERO, DVec2::ZERO, DVec2::X], 15.0),
            [PathSegment::Move(DVec2::ZERO), PathSegment::Line(DVec2::X)]
        );
        assert!(rounded(&[], 15.0).is_empty());
    }
}
