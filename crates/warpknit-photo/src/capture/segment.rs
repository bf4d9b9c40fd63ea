//! Steps 3 and 5: a segment of yarn as a curved cylinder, and the cell that some of them make.
//!
//! In: [`Segment`]s on a [`Lattice`]. Out: how light each place of the cell is. 'Dark is deep':
//! heights are in units of lightness, until somebody says how thick the cloth is. Source: the
//! cylinder of Irawan and Marschner 2012, bent down at its ends (level between, where it lies over
//! several others), with a tilt for yarns that come up at one end and go down at the other; in the
//! cloth's plane its axis is a cubic, as legs of loops are.

use glam::DVec2;

use super::lattice::Lattice;
use super::steps;
use crate::plane::double;

/// A stretch of yarn that is seen from above. Pixels, y down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Its middle.
    pub centre: DVec2,
    /// Its direction, radians from x towards y; a half turn makes no difference.
    pub angle: f64,
    /// Across it, from edge to edge.
    pub width: f64,
    /// Along it, from where it comes up to where it goes down.
    pub length: f64,
    /// How much lighter its middle is than the deepest ground.
    pub top: f64,
    /// How much darker its edges are.
    pub round: f64,
    /// How much darker its ends are.
    pub sag: f64,
    /// How much lighter one end is than the middle, and darker the other.
    pub tilt: f64,
    /// How far its middle lies aside of the line between its ends, to the right of its direction as
    /// it is seen.
    pub bow: f64,
    /// How far it lies to one side of that line in its first half, and to the other in its second,
    /// as an S does.
    pub sway: f64,
}

/// How fast a yarn goes down beyond its end, lightness a width.
const DIVES: f64 = 6.0;
/// How far from its ends a yarn begins to go down, widths: what lies over several others is level
/// between.
const FALLS: f64 = 0.75;
/// Edges are blurred by so many pixels to either side.
const BLUR: f64 = 0.5;
/// Places along a segment that are looked at.
pub(super) const STEPS: usize = 60;
/// Segments that may be one: how far apart their ends are at most, widths; how sharply one turns
/// there, radians; and how much wider one is.
const GAP: f64 = 1.5;
const SHARPEST: f64 = 1.2;
const ALIKE: f64 = 1.8;
/// Where on its way from the middle to an end an S lies farthest aside.
const CREST: f64 = 0.577_350_269_189_625_8;
/// The cubic `t^3 - t` by this is as far from 0 as 1 at its crests.
const S_CURVE: f64 = 1.5 / CREST;

impl Segment {
    /// Numbers that a fit may change.
    pub(super) const NUMBERS: usize = 11;
    /// Those of them that are pixels.
    pub(super) const PIXELS: [usize; 6] = [0, 1, 3, 4, 9, 10];

    /// A straight one that lies as high at both ends, as much darker at edges and ends as yarns
    /// mostly are.
    #[must_use]
    pub const fn straight(centre: DVec2, angle: f64, width: f64, length: f64, top: f64) -> Self {
        Self {
            centre,
            angle,
            width,
            length,
            top,
            round: 0.5 * top,
            sag: 0.3 * top,
            tilt: 0.0,
            bow: 0.0,
            sway: 0.0,
        }
    }

    /// The same in pixels of another size.
    pub(super) fn scaled(&self, scale: f64) -> Self {
        let [width, length, bow, sway] =
            [self.width, self.length, self.bow, self.sway].map(|length| length * scale);
        Self { centre: self.centre * scale, width, length, bow, sway, ..*self }
    }

    /// Where its axis is, so far along from its middle, and its direction there.
    #[must_use]
    pub fn axis(&self, along: f64) -> (DVec2, f64) {
        let (aside, slope) = self.aside(along);
        (
            self.centre + DVec2::from_angle(self.angle).rotate(DVec2::new(along, aside)),
            self.angle + slope.atan(),
        )
    }

    /// Where it is so far along its axis, and so far beside it.
    pub(super) fn beside(&self, along: f64, across: f64) -> DVec2 {
        let (place, angle) = self.axis(along);
        place + DVec2::from_angle(angle).perp() * across
    }

    /// The stretch from one place along it to another: as light at its ends and in its middle as it
    /// was, and as far aside there and at its crests.
    pub(super) fn part(&self, first: f64, last: f64) -> Self {
        let on_axis = |t: f64| self.axis(first + (0.5 + 0.5 * t) * (last - first)).0;
        let [start, middle, end] =
            [first, 0.5 * (first + last), last].map(|along| self.light(along));
        let light = Self {
            top: middle,
            sag: middle - 0.5 * (start + end),
            tilt: 0.5 * (end - start),
            ..*self
        };
        light.through(on_axis(-1.0), on_axis(1.0), on_axis)
    }

    /// This segment and one that goes on where it ends, as one that bends through both; nothing
    /// where none goes on.
    pub(super) fn joined(&self, other: &Self, lattice: &Lattice) -> Option<Self> {
        if self.width.max(other.width) > ALIKE * self.width.min(other.width) {
            return None;
        }
        let (from, to, shift) = self.meeting(other, lattice)?;
        // Through the first towards where they meet, and on through the second.
        let along = |step: usize| double(step) / double(STEPS) - 0.5;
        let first = (0..=STEPS).map(|step| self.axis(from * along(step) * self.length).0);
        let second = (0..=STEPS).map(|step| other.axis(-to * along(step) * other.length).0 + shift);
        let path: Vec<DVec2> = first.chain(second).collect();
        let (start, end) = (path[0], path[path.len() - 1]);
        let on_path = |t: f64| {
            let way = end - start;
            let is_beyond =
                |place: &&DVec2| way.dot(**place - start) >= (0.5 + 0.5 * t) * way.length_squared();
            path.iter().find(is_beyond).copied().unwrap_or(end)
        };
        let mean = |p: f64, q: f64| 0.5 * (p + q);
        let light = Self {
            width: mean(self.width, other.width),
            top: self.top.max(other.top),
            round: mean(self.round, other.round),
            sag: mean(self.sag, other.sag),
            tilt: 0.5 * (other.top - self.top),
            ..*self
        };
        Some(light.through(start, end, on_path))
            .filter(|joined| joined.length > self.length.max(other.length))
    }

    /// Which ends of two segments meet (1 is ahead, -1 behind), and how far the second one's copy
    /// is that is meant.
    fn meeting(&self, other: &Self, lattice: &Lattice) -> Option<(f64, f64, DVec2)> {
        let meeting = |(from, to): (f64, f64)| {
            let ((place, out), (next, back)) =
                (self.axis(0.5 * from * self.length), other.axis(0.5 * to * other.length));
            let turn =
                (from * DVec2::from_angle(out)).angle_to(-to * DVec2::from_angle(back)).abs();
            let gap = lattice.nearest(next - place);
            let is_near = turn < SHARPEST && gap.length() < GAP * 0.5 * (self.width + other.width);
            is_near.then_some((gap.length(), (from, to, gap - (next - place))))
        };
        let ends = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
        ends.into_iter()
            .filter_map(meeting)
            .min_by(|p, q| p.0.total_cmp(&q.0))
            .map(|(_, meeting)| meeting)
    }

    /// The same between two other ends, as far aside in its middle and at the crests of an S as
    /// some path there (-1 and 1 are its ends).
    fn through(&self, start: DVec2, end: DVec2, path: impl Fn(f64) -> DVec2) -> Self {
        let way = (end - start).normalize_or(DVec2::X);
        let [before, middle, after] = [-CREST, 0.0, CREST].map(|t| way.perp_dot(path(t) - start));
        Self {
            centre: start.midpoint(end),
            angle: way.to_angle(),
            length: start.distance(end),
            bow: middle,
            sway: 0.5 * (before - after),
            ..*self
        }
    }

    /// How far its axis lies aside of the line between its ends, and how steeply it leaves it, so
    /// far along. It goes straight on beyond its ends.
    fn aside(&self, along: f64) -> (f64, f64) {
        let half = 0.5 * self.length;
        let t = (along / half).clamp(-1.0, 1.0);
        let slope = (S_CURVE * self.sway * (3.0 * t * t - 1.0) - 2.0 * self.bow * t) / half;
        (
            self.bow * (1.0 - t * t)
                + S_CURVE * self.sway * (t * t * t - t)
                + slope * (along - t * half),
            slope,
        )
    }

    /// How far it has gone down so far along: 0 where it is level, 1 at its ends.
    pub(super) fn fallen(&self, along: f64) -> f64 {
        let half = 0.5 * self.length;
        let falls = half.min(FALLS * self.width);
        ((along.abs() - half + falls) / falls).clamp(0.0, 1.0).powi(2)
    }

    /// How light its axis is relative to the ground, so far along.
    fn light(&self, along: f64) -> f64 {
        self.top - self.sag * self.fallen(along)
            + self.tilt * (along / (0.5 * self.length)).clamp(-1.0, 1.0)
    }

    /// Along and across a segment whose middle is at the origin; `way` is its direction.
    fn local(&self, off: DVec2, way: DVec2) -> DVec2 {
        let along = way.dot(off);
        let (aside, slope) = self.aside(along);
        DVec2::new(along, (way.perp_dot(off) - aside) / (1.0 + slope * slope).sqrt())
    }

    /// How light it is at a place relative to the ground; below 0 where it isn't.
    pub(super) fn height(&self, off: DVec2, way: DVec2) -> f64 {
        let at = self.local(off, way);
        let edge = 0.5 + (0.5 * self.width - at.y.abs()) / (2.0 * BLUR);
        if edge <= 0.0 {
            return -1.0;
        }
        let across = (at.y / (0.5 * self.width)).clamp(-1.0, 1.0);
        let beyond = (at.x.abs() - 0.5 * self.length).max(0.0) / self.width;
        let lit =
            self.light(at.x) - DIVES * beyond - self.round * (1.0 - (1.0 - across * across).sqrt());
        // A pixel that is half yarn has half its luminance, of which lightness is about the cube
        // root.
        if edge < 1.0 { lit * edge.cbrt() } else { lit }
    }

    /// Whether it lies over a place, relative to its middle.
    fn covers(&self, off: DVec2) -> bool {
        let at = self.local(off, DVec2::from_angle(self.angle));
        at.y.abs() <= 0.5 * self.width && at.x.abs() <= 0.5 * self.length
    }

    /// How far from its middle it reaches.
    pub(super) fn reach(&self) -> f64 {
        0.5 * (self.length + 0.8 * self.width).hypot(self.width) + self.bow.abs() + self.sway.abs()
    }

    /// How far from the line through its middle it reaches at most, as far along as
    /// [`Segment::reach`].
    fn wide(&self) -> f64 {
        let steepest =
            (2.0 * S_CURVE * self.sway.abs() + 2.0 * self.bow.abs()) / (0.5 * self.length);
        let beyond = self.reach() + 0.5 - 0.5 * self.length;
        // An edge seen at a slant is farther from its axis by less than its slope has it.
        (0.5 * self.width + BLUR) * (1.0 + steepest)
            + self.bow.abs()
            + self.sway.abs()
            + steepest * beyond
    }

    /// Counts of both vectors, lowest and highest, to its copies that may touch the cell.
    fn counts(&self, lattice: &Lattice) -> (DVec2, DVec2) {
        let count = lattice.matrix().inverse() * self.centre;
        let margin =
            DVec2::new(lattice.b.length(), lattice.a.length()) * self.reach() / lattice.area();
        ((-margin - count).ceil(), (DVec2::ONE + margin - count).floor())
    }

    /// How many copies may touch the cell.
    pub(super) fn crowd(&self, lattice: &Lattice) -> f64 {
        let (low, high) = self.counts(lattice);
        (high - low + 1.0).element_product()
    }

    /// Places of its copies that may touch the cell.
    pub(super) fn copies(&self, lattice: &Lattice) -> Vec<DVec2> {
        let (low, high) = self.counts(lattice);
        let mut copies = Vec::new();
        for j in steps(low.y)..=steps(high.y) {
            for i in steps(low.x)..=steps(high.x) {
                copies.push(self.centre + lattice.a * f64::from(i) + lattice.b * f64::from(j));
            }
        }
        copies
    }

    /// What a fit may change.
    pub(super) fn numbers(&self) -> [f64; Self::NUMBERS] {
        let Self { centre, angle, width, length, top, round, sag, tilt, bow, sway } = *self;
        [centre.x, centre.y, angle, width, length, top, round, sag, tilt, bow, sway]
    }

    /// The segment of [`Segment::numbers`].
    pub(super) fn of_numbers(n: &[f64]) -> Self {
        Self {
            centre: DVec2::new(n[0], n[1]),
            angle: n[2],
            width: n[3],
            length: n[4],
            top: n[5],
            round: n[6],
            sag: n[7],
            tilt: n[8],
            bow: n[9],
            sway: n[10],
        }
    }
}

/// Places of a grid over a cell, pixels.
pub(super) fn places(lattice: &Lattice, [columns, rows]: [usize; 2]) -> Vec<DVec2> {
    let place = |at: usize| {
        lattice.a * (double(at % columns) / double(columns))
            + lattice.b * (double(at / columns) / double(rows))
    };
    (0..columns * rows).map(place).collect()
}

/// How much lighter than the ground a segment and its copies make each place.
pub(super) fn heights(segment: &Segment, lattice: &Lattice, places: &[DVec2]) -> Vec<f64> {
    let mut heights = vec![0.0_f64; places.len()];
    let (reach, wide) = (segment.reach() + 0.5, segment.wide());
    let reach = reach * reach;
    let way = DVec2::from_angle(segment.angle);
    for copy in segment.copies(lattice) {
        for (height, place) in heights.iter_mut().zip(places) {
            let off = *place - copy;
            if off.length_squared() < reach && way.perp_dot(off).abs() < wide {
                *height = height.max(segment.height(off, way));
            }
        }
    }
    heights
}

/// How light each place of a cell is.
pub(super) fn drawn(
    segments: &[Segment],
    ground: f64,
    lattice: &Lattice,
    places: &[DVec2],
) -> Vec<f64> {
    let mut light = vec![0.0_f64; places.len()];
    segments.iter().for_each(|segment| over(&mut light, &heights(segment, lattice, places)));
    light.iter_mut().for_each(|light| *light += ground);
    light
}

/// The lighter ones of two layers' places.
pub(super) fn over(light: &mut [f64], heights: &[f64]) {
    light.iter_mut().zip(heights).for_each(|(light, height)| *light = light.max(*height));
}

/// Shares of a cell that lie under two segments, and under none.
pub(super) fn shares(segments: &[Segment], lattice: &Lattice, places: &[DVec2]) -> [f64; 2] {
    let mut counts = vec![0u8; places.len()];
    for segment in segments {
        for copy in segment.copies(lattice) {
            for (count, place) in counts.iter_mut().zip(places) {
                *count = count.saturating_add(u8::from(segment.covers(*place - copy)));
            }
        }
    }
    let share = |which: &dyn Fn(u8) -> bool| {
        double(counts.iter().filter(|count| which(**count)).count()) / double(counts.len())
    };
    [share(&|count| count > 1), share(&|count| count == 0)]
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    const LATTICE: Lattice = Lattice { a: DVec2::new(20.0, 0.0), b: DVec2::new(0.0, 10.0) };

    fn segment(x: f64, y: f64, angle: f64) -> Segment {
        let centre = DVec2::new(x, y);
        Segment { sag: 0.4, tilt: 0.1, ..Segment::straight(centre, angle, 4.0, 12.0, 1.0) }
    }

    #[test]
    fn a_segment_is_lightest_in_its_middle_and_comes_in_again_on_the_other_side() {
        let places = places(&LATTICE, [20, 10]);
        let drawn = drawn(&[segment(0.0, 5.0, 0.0)], 0.2, &LATTICE, &places);
        let at = |x: usize, y: usize| drawn[20 * y + x];
        assert!(
            (at(0, 5) - 1.2).abs() < 1e-12 && at(1, 5) > at(19, 5),
            "lifted towards +x: {} {}",
            at(1, 5),
            at(19, 5)
        );
        assert!(at(16, 5) > 0.2 && at(10, 5) == 0.2 && at(0, 8) == 0.2 && at(0, 6) < at(0, 5));
    }

    #[test]
    fn all_that_a_segment_draws_lies_in_its_strip() {
        let around: Vec<DVec2> =
            (0..300 * 300).map(|at| DVec2::new(double(at % 300), double(at / 300)) * 0.1).collect();
        let wide = Lattice { a: DVec2::X * 60.0, b: DVec2::Y * 60.0 };
        for (bow, sway) in [(0.0, 0.0), (2.0, 0.0), (-1.5, 2.5), (1.0, -3.0)] {
            let bent = Segment { bow, sway, ..segment(15.0, 15.0, 0.3) };
            let way = DVec2::from_angle(0.3);
            let reaches = |off: DVec2| off.length() < bent.reach() + 0.5;
            let height = |place: &DVec2| {
                Some(*place - bent.centre)
                    .filter(|off| reaches(*off))
                    .map(|off| bent.height(off, way))
            };
            let expected: Vec<f64> =
                around.iter().map(|place| height(place).unwrap_or(0.0).max(0.0)).collect();
            assert!(heights(&bent, &wide, &around) == expected, "{bow} {sway}");
        }
    }

    #[test]
    fn a_part_lies_where_the_whole_did_and_is_as_light() {
        let whole = Segment { bow: 1.0, sway: -0.6, ..segment(10.0, 5.0, 0.3) };
        let (first, last) = (-4.0, 3.0);
        let part = whole.part(first, last);
        let way = DVec2::from_angle(0.3);
        for (share, light) in [(-0.5, first), (0.0, 0.5 * (first + last)), (0.5, last)] {
            assert!(
                (part.light(share * part.length) - whole.light(light)).abs() < 1e-12,
                "{share}"
            );
        }
        for along in [-3.9, -2.0, 0.0, 2.9] {
            // Its frame is turned a little.
            let (place, _) = whole.axis(along);
            let off = part.local(place - part.centre, DVec2::from_angle(part.angle));
            assert!(off.y.abs() < 0.02 && off.x.abs() < 0.5 * part.length, "{along}: {off}");
        }
        assert!((part.length - 7.0).abs() < 0.2 && !part.covers(way * 3.8));
    }

    #[test]
    fn a_bent_segment_is_as_wide_as_a_straight_one_and_keeps_its_ends() {
        let bent = Segment { bow: 1.0, sway: 0.5, ..segment(10.0, 5.0, 0.0) };
        let end = |side: f64| bent.axis(side * 6.0).0;
        assert!(
            end(1.0).distance(DVec2::new(16.0, 5.0)) < 1e-12
                && end(-1.0).distance(DVec2::new(4.0, 5.0)) < 1e-12
        );
        // An S bends most where it has gone .577 of its way to an end.
        assert!((bent.axis(-6.0 * CREST).0.y - 5.0 - (1.0 - CREST * CREST) - 0.5).abs() < 1e-12);
        for along in [-4.0, -2.0, 0.0, 2.0, 5.0] {
            let (place, angle) = bent.axis(along);
            let aside = DVec2::from_angle(angle).perp();
            assert!(
                bent.covers(place + aside * 1.8 - bent.centre)
                    && !bent.covers(place + aside * 2.4 - bent.centre),
                "{along}"
            );
        }
    }

    #[test]
    fn two_that_go_on_straight_ahead_are_one() {
        let whole = Segment { bow: 1.5, sway: 0.5, length: 16.0, ..segment(10.0, 5.0, 0.2) };
        // The second is given backwards, and in the cell beside.
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

    #[test]
    fn shares_of_a_cell() {
        let places = places(&LATTICE, [200, 100]);
        let [overlap, blank] = shares(&[segment(10.0, 5.0, 0.0)], &LATTICE, &places);
        assert!(overlap == 0.0 && (blank - 0.76).abs() < 0.01, "{blank}");
        let [overlap, _] =
            shares(&[segment(10.0, 5.0, 0.0), segment(16.0, 5.0, 0.0)], &LATTICE, &places);
        assert!((overlap - 0.12).abs() < 0.01, "{overlap}");
    }
}
