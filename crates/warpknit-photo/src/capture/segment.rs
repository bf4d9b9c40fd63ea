//! Steps 3 and 5: a segment of yarn as a curved cylinder.
//!
//! In: parameters of a fit. Out: a [`Segment`], its axis, its parts and its copies on a
//! [`Lattice`]. `relief` draws it. The model is "dark is deep": heights are in units of lightness
//! until a thickness in mm is known.
//!
//! Method: the curved cylinder of Irawan and Marschner 2012, *Specular reflection from woven
//! cloth*. Its ends bend down, and it is level between them where it lies over several other yarns.
//! A tilt describes yarns that come up at one end and go down at the other. In the plane of the
//! cloth the axis is a cubic, because legs of loops are bent like a bow or an S.
//!
//! Not promised: true arc lengths. Positions along a segment are measured on the chord between its
//! ends.

use std::ops::Range;

use glam::DVec2;

use super::lattice::Lattice;
use super::relief::Relief;
use super::steps;

/// A stretch of yarn that is visible from above. Lengths are pixels, y down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// The middle of the chord between its ends.
    pub centre: DVec2,
    /// Its direction, radians from x towards y. A half turn makes no difference.
    pub angle: f64,
    /// Across it, from edge to edge.
    pub width: f64,
    /// Along it, from the end where it comes up to the end where it goes down.
    pub length: f64,
    /// How much lighter its middle is than the deepest ground.
    pub top: f64,
    /// How much darker its edges are than its middle.
    pub round: f64,
    /// How much darker its ends are than its middle.
    pub sag: f64,
    /// How much lighter one end is than the middle, and how much darker the other end is.
    pub tilt: f64,
    /// Lateral offset of its middle from the chord between its ends, to the right of its direction
    /// as one looks at the photo.
    pub bow: f64,
    /// Lateral offset of an S: to one side of the chord in the first half, to the other side in the
    /// second half.
    pub sway: f64,
}

/// Intervals between sample points along an axis. Visibility is decided at these points, so a
/// covered piece shorter than a sixtieth of the segment can be missed.
pub(super) const AXIS_SAMPLES: usize = 60;
/// Where the cubic `t^3 - t` has its extrema: at `1 / sqrt(3)` of the way to either end.
pub(super) const S_EXTREMUM: f64 = 0.577_350_269_189_625_8;
/// Scale that makes the extrema of `t^3 - t` equal to 1 and -1.
pub(super) const S_SCALE: f64 = 1.5 / S_EXTREMUM;

impl Segment {
    /// Number of parameters that a fit may change.
    pub(super) const PARAMETERS: usize = 11;
    /// Indices of the parameters of its light: they change neither its place nor its shape.
    pub(super) const LIGHT_PARAMETERS: Range<usize> = 5..9;
    /// Indices of the parameters that are measured in pixels.
    pub(super) const PIXEL_PARAMETERS: [usize; 6] = [0, 1, 3, 4, 9, 10];

    /// A straight segment with level ends. Its edges and ends are as much darker as those of most
    /// yarns.
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

    /// The same segment in pixels of another size.
    pub(super) fn scaled(&self, scale: f64) -> Self {
        let [width, length, bow, sway] =
            [self.width, self.length, self.bow, self.sway].map(|length| length * scale);
        Self { centre: self.centre * scale, width, length, bow, sway, ..*self }
    }

    /// The point of its axis at a distance along the chord from its middle, and the direction of
    /// the axis there.
    #[must_use]
    pub fn axis(&self, along: f64) -> (DVec2, f64) {
        let relief = Relief::new(self);
        let (offset, slope) = relief.lateral_offset(along);
        (
            self.centre + relief.direction.rotate(DVec2::new(along, offset)),
            self.angle + slope.atan(),
        )
    }

    /// Its direction in degrees from 0.0 to 359.9, with one decimal.
    #[must_use]
    pub fn degrees_text(&self) -> String {
        let text = format!("{:.1}", self.angle.to_degrees().rem_euclid(360.0));
        // Just below a whole turn the decimal rounds up.
        if text == "360.0" { "0.0".to_owned() } else { text }
    }

    /// The point at a distance along its axis and a distance across it.
    pub(super) fn offset_point(&self, along: f64, across: f64) -> DVec2 {
        let (place, angle) = self.axis(along);
        place + DVec2::from_angle(angle).perp() * across
    }

    /// The part between two positions along it. Lightness is kept at the part's ends and middle,
    /// and the shape of the axis is kept at its ends, middle and extrema.
    pub(super) fn part(&self, first: f64, last: f64) -> Self {
        let relief = Relief::new(self);
        let [start, middle, end] =
            [first, 0.5 * (first + last), last].map(|along| relief.axis_lightness(along));
        let shaded = Self {
            top: middle,
            sag: middle - 0.5 * (start + end),
            tilt: 0.5 * (end - start),
            ..*self
        };
        shaded.fitted_through(|t: f64| self.axis(first + (0.5 + 0.5 * t) * (last - first)).0)
    }

    /// This segment laid through a path whose parameter runs from -1 to 1: its ends are the path's
    /// ends, and `bow` and `sway` interpolate the path at the middle and at the extrema of the S.
    pub(super) fn fitted_through(&self, path: impl Fn(f64) -> DVec2) -> Self {
        let (start, end) = (path(-1.0), path(1.0));
        let direction = (end - start).normalize_or(DVec2::X);
        let [before, middle, after] =
            [-S_EXTREMUM, 0.0, S_EXTREMUM].map(|t| direction.perp_dot(path(t) - start));
        Self {
            centre: start.midpoint(end),
            angle: direction.to_angle(),
            length: start.distance(end),
            bow: middle,
            // The bow is even in t and the S is odd, so their difference isolates the S.
            sway: 0.5 * (before - after),
            ..*self
        }
    }

    /// Radius of a bounding circle around its middle.
    pub(super) fn bounding_radius(&self) -> f64 {
        // At 0.4 widths beyond an end, END_SLOPE has taken off a lightness of 2.4. That is more
        // than any end of a yarn stands out of the ground: lightness 1 is the photo's contrast.
        0.5 * (self.length + 0.8 * self.width).hypot(self.width) + self.bow.abs() + self.sway.abs()
    }

    /// Lowest and highest cell coordinates of its copies that may touch the cell.
    fn copy_range(&self, lattice: &Lattice) -> (DVec2, DVec2) {
        let count = lattice.matrix().inverse() * self.centre;
        // A circle's extent in cell coordinates: its radius over the height of the cell on each of
        // its sides, which is the area over the other vector's length.
        let margin = DVec2::new(lattice.b.length(), lattice.a.length()) * self.bounding_radius()
            / lattice.area();
        ((-margin - count).ceil(), (DVec2::ONE + margin - count).floor())
    }

    /// Number of copies that may touch the cell.
    pub(super) fn copy_count(&self, lattice: &Lattice) -> f64 {
        let (low, high) = self.copy_range(lattice);
        (high - low + 1.0).element_product()
    }

    /// Centres of its copies that may touch the cell.
    pub(super) fn copies(&self, lattice: &Lattice) -> Vec<DVec2> {
        let (low, high) = self.copy_range(lattice);
        let mut copies = Vec::new();
        for j in steps(low.y)..=steps(high.y) {
            for i in steps(low.x)..=steps(high.x) {
                copies.push(self.centre + lattice.a * f64::from(i) + lattice.b * f64::from(j));
            }
        }
        copies
    }

    /// The parameters that a fit may change.
    pub(super) fn parameters(&self) -> [f64; Self::PARAMETERS] {
        let Self { centre, angle, width, length, top, round, sag, tilt, bow, sway } = *self;
        [centre.x, centre.y, angle, width, length, top, round, sag, tilt, bow, sway]
    }

    /// The segment that has these [`Segment::parameters`].
    pub(super) fn from_parameters(p: &[f64]) -> Self {
        Self {
            centre: DVec2::new(p[0], p[1]),
            angle: p[2],
            width: p[3],
            length: p[4],
            top: p[5],
            round: p[6],
            sag: p[7],
            tilt: p[8],
            bow: p[9],
            sway: p[10],
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in super::super) const LATTICE: Lattice =
        Lattice { a: DVec2::new(20.0, 0.0), b: DVec2::new(0.0, 10.0) };

    /// A segment of 12 by 4 pixels about a place, in pixels, at an angle in radians.
    pub(in super::super) fn segment(x: f64, y: f64, angle: f64) -> Segment {
        let centre = DVec2::new(x, y);
        Segment { sag: 0.4, tilt: 0.1, ..Segment::straight(centre, angle, 4.0, 12.0, 1.0) }
    }

    #[test]
    fn a_part_lies_where_the_whole_did_and_is_as_light() {
        let whole = Segment { bow: 1.0, sway: -0.6, ..segment(10.0, 5.0, 0.3) };
        let (first, last) = (-4.0, 3.0);
        let part = whole.part(first, last);
        let way = DVec2::from_angle(0.3);
        for (share, light) in [(-0.5, first), (0.0, 0.5 * (first + last)), (0.5, last)] {
            let [own, whole] = [(&part, share * part.length), (&whole, light)]
                .map(|(segment, along)| Relief::new(segment).axis_lightness(along));
            assert!((own - whole).abs() < 1e-12, "{share}");
        }
        for along in [-3.9, -2.0, 0.0, 2.9] {
            // Its frame is turned a little.
            let (place, _) = whole.axis(along);
            let off = Relief::new(&part).local(place - part.centre);
            assert!(off.y.abs() < 0.02 && off.x.abs() < 0.5 * part.length, "{along}: {off}");
        }
        assert!((part.length - 7.0).abs() < 0.2 && !Relief::new(&part).covers(way * 3.8));
    }

    #[test]
    fn a_bent_segment_is_as_wide_as_a_straight_one_and_keeps_its_ends() {
        let bent = Segment { bow: 1.0, sway: 0.5, ..segment(10.0, 5.0, 0.0) };
        let end = |side: f64| bent.axis(side * 6.0).0;
        assert!(
            end(1.0).distance(DVec2::new(16.0, 5.0)) < 1e-12
                && end(-1.0).distance(DVec2::new(4.0, 5.0)) < 1e-12
        );
        // An S bends most where it has gone 0.577 of its way to an end.
        assert!(
            (bent.axis(-6.0 * S_EXTREMUM).0.y - 5.0 - (1.0 - S_EXTREMUM * S_EXTREMUM) - 0.5).abs()
                < 1e-12
        );
        let relief = Relief::new(&bent);
        for along in [-4.0, -2.0, 0.0, 2.0, 5.0] {
            let (place, angle) = bent.axis(along);
            let lateral_offset = DVec2::from_angle(angle).perp();
            assert!(
                relief.covers(place + lateral_offset * 1.8 - bent.centre)
                    && !relief.covers(place + lateral_offset * 2.4 - bent.centre),
                "{along}"
            );
        }
    }

    #[test]
    fn a_direction_just_below_a_whole_turn_is_0_degrees() {
        let text = |degrees: f64| segment(0.0, 0.0, degrees.to_radians()).degrees_text();
        assert_eq!(
            [-0.01, 359.97, -1e-18, 359.94, -45.0, 400.0].map(text),
            ["0.0", "0.0", "0.0", "359.9", "315.0", "40.0"]
        );
    }
}
