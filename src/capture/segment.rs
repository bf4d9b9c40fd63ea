//! Steps 3 and 5: a segment of yarn as a curved cylinder, and the cell that some of them make.
//!
//! In: [`Segment`]s on a [`Lattice`]. Out: how light each place of the cell is, and which segments are seen there. 'Dark is deep': heights are in units of lightness,
//! until somebody says how thick the cloth is. Source: the cylinder of Irawan and Marschner 2012, bent to a parabola along its axis, with a tilt for yarns that
//! come up at one end and go down at the other.

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
}

/// How fast a yarn goes down beyond its end, lightness a width.
const DIVES: f64 = 6.0;

impl Segment {
    /// Numbers that a fit may change.
    pub(super) const NUMBERS: usize = 9;

    /// The same in pixels of another size.
    pub(super) fn scaled(&self, scale: f64) -> Self {
        Self { centre: self.centre * scale, width: self.width * scale, length: self.length * scale, ..*self }
    }

    /// The stretch from one place along it to another, as light there as it was.
    fn part(&self, first: f64, last: f64) -> Self {
        let (half, middle, length) = (0.5 * self.length, 0.5 * (first + last), last - first);
        let (at, shrunk) = (middle / half, 0.5 * length / half);
        Self {
            centre: self.centre + DVec2::from_angle(self.angle) * middle,
            length,
            top: self.top - self.sag * at * at + self.tilt * at,
            sag: self.sag * shrunk * shrunk,
            tilt: (self.tilt - 2.0 * self.sag * at) * shrunk,
            ..*self
        }
    }

    /// Along and across a segment whose middle is at the origin; `way` is its direction.
    fn local(off: DVec2, way: DVec2) -> DVec2 {
        DVec2::new(way.dot(off), way.perp_dot(off))
    }

    /// How light it is at a place relative to the ground; below 0 where it isn't.
    fn height(&self, off: DVec2, way: DVec2) -> f64 {
        let at = Self::local(off, way);
        let across = at.y / (0.5 * self.width);
        if across.abs() >= 1.0 {
            return -1.0;
        }
        let half = 0.5 * self.length;
        let along = (at.x / half).clamp(-1.0, 1.0);
        let beyond = (at.x.abs() - half).max(0.0) / self.width;
        self.top - self.round * (1.0 - (1.0 - across * across).sqrt()) - self.sag * along * along + self.tilt * along
            - DIVES * beyond
    }

    /// Whether it lies over a place, relative to its middle.
    fn covers(&self, off: DVec2) -> bool {
        let at = Self::local(off, DVec2::from_angle(self.angle));
        at.y.abs() <= 0.5 * self.width && at.x.abs() <= 0.5 * self.length
    }

    /// How far from its middle it reaches.
    fn reach(&self) -> f64 {
        0.5 * (self.length + 0.8 * self.width).hypot(self.width)
    }

    /// Places of its copies that may touch the cell.
    pub(super) fn copies(&self, lattice: &Lattice) -> Vec<DVec2> {
        let inverse = lattice.matrix().inverse();
        let count = inverse * self.centre;
        let reach = self.reach();
        let margin = DVec2::new(lattice.b.length(), lattice.a.length()) * reach / lattice.area();
        let (low, high) = ((-margin - count).ceil(), (DVec2::ONE + margin - count).floor());
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
        [self.centre.x, self.centre.y, self.angle, self.width, self.length, self.top, self.round, self.sag, self.tilt]
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
        }
    }
}

/// Places of a grid over a cell, pixels.
pub(super) fn places(lattice: &Lattice, [columns, rows]: [usize; 2]) -> Vec<DVec2> {
    let place =
        |at: usize| lattice.a * (double(at % columns) / double(columns)) + lattice.b * (double(at / columns) / double(rows));
    (0..columns * rows).map(place).collect()
}

/// How much lighter than the ground a segment and its copies make each place.
pub(super) fn heights(segment: &Segment, lattice: &Lattice, places: &[DVec2]) -> Vec<f64> {
    let mut heights = vec![0.0_f64; places.len()];
    let reach = segment.reach() + 0.5;
    let reach = reach * reach;
    let way = DVec2::from_angle(segment.angle);
    for copy in segment.copies(lattice) {
        for (height, place) in heights.iter_mut().zip(places) {
            let off = *place - copy;
            if off.length_squared() < reach {
                *height = height.max(segment.height(off, way));
            }
        }
    }
    heights
}

/// How light each place of a cell is.
pub(super) fn drawn(segments: &[Segment], ground: f64, lattice: &Lattice, places: &[DVec2]) -> Vec<f64> {
    let mut light = vec![0.0_f64; places.len()];
    for segment in segments {
        light.iter_mut().zip(heights(segment, lattice, places)).for_each(|(light, height)| *light = light.max(height));
    }
    light.iter_mut().for_each(|light| *light += ground);
    light
}

/// Places along a segment that are looked at.
const STEPS: usize = 60;

/// Segments as long as they are seen, each with its number: those parts left out that others lie over. Those that are hardly seen are gone.
pub(super) fn trimmed(segments: &[Segment], lattice: &Lattice) -> Vec<(usize, Segment)> {
    (0..segments.len()).filter_map(|number| seen_part(segments, number, lattice).map(|seen| (number, seen))).collect()
}

/// The longest stretch of a segment's axis over which nothing else lies.
fn seen_part(segments: &[Segment], number: usize, lattice: &Lattice) -> Option<Segment> {
    let segment = &segments[number];
    let way = DVec2::from_angle(segment.angle);
    // A yarn goes down beyond its ends, and is still seen there.
    let along = |step: usize| (segment.length + 0.8 * segment.width) * (double(step) / double(STEPS) - 0.5);
    let is_seen = |step: usize| {
        let off = way * along(step);
        let own = segment.height(off, way);
        let others = segments.iter().map(|other| highest(other, segment.centre + off, lattice)).fold(0.0, f64::max);
        own > 0.0 && own >= others - 1e-9
    };
    let seen: Vec<bool> = (0..=STEPS).map(is_seen).collect();
    let runs = seen.chunk_by(|a, b| a == b).scan(0, |start, run| {
        *start += run.len();
        Some((run[0], *start - run.len(), *start - 1))
    });
    let (_, first, last) = runs.filter(|run| run.0).max_by_key(|(_, first, last)| last - first)?;
    let (first, last) = (along(first), along(last));
    (last - first > 0.5 * segment.width).then(|| segment.part(first, last))
}

/// How light a segment or one of its copies makes a place, relative to the ground.
fn highest(segment: &Segment, place: DVec2, lattice: &Lattice) -> f64 {
    let way = DVec2::from_angle(segment.angle);
    let near = lattice.nearest(place - segment.centre);
    let reach = 2 + steps(segment.length / lattice.shorter());
    let counts = (-reach..=reach).flat_map(|j| (-reach..=reach).map(move |i| DVec2::new(f64::from(i), f64::from(j))));
    counts.map(|count| segment.height(near + lattice.matrix() * count, way)).fold(0.0, f64::max)
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
    let share = |which: &dyn Fn(u8) -> bool| double(counts.iter().filter(|count| which(**count)).count()) / double(counts.len());
    [share(&|count| count > 1), share(&|count| count == 0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const LATTICE: Lattice = Lattice { a: DVec2::new(20.0, 0.0), b: DVec2::new(0.0, 10.0) };

    fn segment(x: f64, y: f64, angle: f64) -> Segment {
        let centre = DVec2::new(x, y);
        Segment { centre, angle, width: 4.0, length: 12.0, top: 1.0, round: 0.5, sag: 0.4, tilt: 0.1 }
    }

    #[test]
    fn a_segment_is_lightest_in_its_middle_and_comes_in_again_on_the_other_side() {
        let places = places(&LATTICE, [20, 10]);
        let drawn = drawn(&[segment(0.0, 5.0, 0.0)], 0.2, &LATTICE, &places);
        let at = |x: usize, y: usize| drawn[20 * y + x];
        assert!((at(0, 5) - 1.2).abs() < 1e-12 && at(1, 5) > at(19, 5), "lifted towards +x: {} {}", at(1, 5), at(19, 5));
        assert!(at(16, 5) > 0.2 && at(10, 5) == 0.2 && at(0, 8) == 0.2 && at(0, 6) < at(0, 5));
    }

    #[test]
    fn what_lies_below_another_is_not_seen() {
        let (over, under) =
            (segment(10.0, 5.0, 0.0), Segment { top: 0.9, length: 9.0, ..segment(10.0, 5.0, std::f64::consts::FRAC_PI_2) });
        let seen = trimmed(&[over, under], &LATTICE);
        assert_eq!(seen.len(), 2, "{seen:?}");
        let [(first, over), (second, under)] = seen[..] else { panic!("{seen:?}") };
        assert!((first, second) == (0, 1) && over.length > 12.0 && under.length < 4.0 && under.centre.y != 5.0, "{seen:?}");
        assert_eq!(trimmed(&[over, Segment { top: 0.2, ..over }], &LATTICE).len(), 1);
    }

    #[test]
    fn a_part_is_as_light_as_the_whole_was_there() {
        let whole = segment(10.0, 5.0, 0.3);
        let part = whole.part(-4.0, 2.0);
        let way = DVec2::from_angle(0.3);
        for along in [-3.9, -1.0, 0.0, 1.9] {
            let place = whole.centre + way * along + way.perp() * 0.7;
            let light = |segment: &Segment| segment.height(place - segment.centre, way);
            assert!((light(&part) - light(&whole)).abs() < 1e-12, "{along}");
        }
        assert!((part.length - 6.0).abs() < 1e-12 && !part.covers(way * 3.5));
    }

    #[test]
    fn shares_of_a_cell() {
        let places = places(&LATTICE, [200, 100]);
        let [overlap, blank] = shares(&[segment(10.0, 5.0, 0.0)], &LATTICE, &places);
        assert!(overlap == 0.0 && (blank - 0.76).abs() < 0.01, "{blank}");
        let [overlap, _] = shares(&[segment(10.0, 5.0, 0.0), segment(16.0, 5.0, 0.0)], &LATTICE, &places);
        assert!((overlap - 0.12).abs() < 0.01, "{overlap}");
    }
}
