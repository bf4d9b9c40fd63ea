//! Steps 3 and 5: a segment of yarn as a curved cylinder, and the cell that several of them draw.
//!
//! In: [`Segment`]s on a [`Lattice`]. Out: the lightness of each sample point of the cell. The
//! model is "dark is deep": heights are in units of lightness until a thickness in mm is known.
//!
//! Method: the curved cylinder of Irawan and Marschner 2012, *Specular reflection from woven
//! cloth*. Its ends bend down, and it is level between them where it lies over several other yarns.
//! A tilt describes yarns that come up at one end and go down at the other. In the plane of the
//! cloth the axis is a cubic, because legs of loops are bent like a bow or an S.
//!
//! Cost: sample points times copies of the segment that touch the cell; a bounding circle and a
//! bounding strip reject most of them.
//!
//! Not promised: true arc lengths. Positions along a segment are measured on the chord between its
//! ends.

use glam::DVec2;

use super::lattice::Lattice;
use super::steps;
use crate::plane::double;

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

/// How steeply the lightness falls beyond an end, per width. A tenth of it would let ends stick out
/// over their neighbours; an infinite slope would leave Levenberg-Marquardt without a derivative
/// for the length.
const END_SLOPE: f64 = 6.0;
/// Distance from an end, in widths, where a yarn begins to go down. A yarn that lies over several
/// others is level between its two ramps.
const END_RAMP: f64 = 0.75;
/// Edges are blurred by this many pixels to either side: a pixel integrates over its area.
const EDGE_BLUR: f64 = 0.5;
/// Intervals between sample points along an axis. Visibility is decided at these points, so a
/// covered piece shorter than a sixtieth of the segment can be missed.
pub(super) const AXIS_SAMPLES: usize = 60;
/// Where the cubic `t^3 - t` has its extrema: at `1 / sqrt(3)` of the way to either end.
pub(super) const S_EXTREMUM: f64 = 0.577_350_269_189_625_8;
/// Scale that makes the extrema of `t^3 - t` equal to 1 and -1.
const S_SCALE: f64 = 1.5 / S_EXTREMUM;

impl Segment {
    /// Number of parameters that a fit may change.
    pub(super) const PARAMETERS: usize = 11;
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
        let (offset, slope) = self.lateral_offset(along);
        (
            self.centre + DVec2::from_angle(self.angle).rotate(DVec2::new(along, offset)),
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
        let [start, middle, end] =
            [first, 0.5 * (first + last), last].map(|along| self.axis_lightness(along));
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

    /// Lateral offset of its axis from the chord, and the slope of the axis there. The axis goes
    /// straight on beyond its ends.
    fn lateral_offset(&self, along: f64) -> (f64, f64) {
        let half = 0.5 * self.length;
        let t = (along / half).clamp(-1.0, 1.0);
        // A parabola for the bow plus a cubic for the S. Both vanish at t = -1 and t = 1, so that
        // neither moves the ends.
        let slope = (S_SCALE * self.sway * (3.0 * t * t - 1.0) - 2.0 * self.bow * t) / half;
        (
            self.bow * (1.0 - t * t)
                + S_SCALE * self.sway * (t * t * t - t)
                + slope * (along - t * half),
            slope,
        )
    }

    /// How far it has descended at a position along it: 0 where it is level, 1 at its ends.
    pub(super) fn descent(&self, along: f64) -> f64 {
        let half = 0.5 * self.length;
        let ramp = half.min(END_RAMP * self.width);
        ((along.abs() - half + ramp) / ramp).clamp(0.0, 1.0).powi(2)
    }

    /// Lightness of its axis relative to the ground.
    fn axis_lightness(&self, along: f64) -> f64 {
        self.top - self.sag * self.descent(along)
            + self.tilt * (along / (0.5 * self.length)).clamp(-1.0, 1.0)
    }

    /// Coordinates along and across it for an offset from its middle; `direction` is the unit
    /// vector of its angle.
    pub(super) fn local(&self, offset: DVec2, direction: DVec2) -> DVec2 {
        let along = direction.dot(offset);
        let (lateral, slope) = self.lateral_offset(along);
        // First-order distance to a slanted curve: the offset across the chord times the cosine of
        // the slope. Without it bent segments would come out too wide where they are steep.
        DVec2::new(along, (direction.perp_dot(offset) - lateral) / (1.0 + slope * slope).sqrt())
    }

    /// Lightness at an offset from its middle relative to the ground; below 0 outside of it.
    pub(super) fn height(&self, offset: DVec2, direction: DVec2) -> f64 {
        let at = self.local(offset, direction);
        // Coverage of a pixel by a straight edge, as a linear ramp: antialiasing of the model, so
        // that its derivative by the width does not vanish between pixels.
        let edge = 0.5 + (0.5 * self.width - at.y.abs()) / (2.0 * EDGE_BLUR);
        if edge <= 0.0 {
            return -1.0;
        }
        let across = (at.y / (0.5 * self.width)).clamp(-1.0, 1.0);
        let beyond = (at.x.abs() - 0.5 * self.length).max(0.0) / self.width;
        // The section is half an ellipse: `round` is its semi-axis upward.
        let lightness = self.axis_lightness(at.x)
            - END_SLOPE * beyond
            - self.round * (1.0 - (1.0 - across * across).sqrt());
        // A pixel that is half yarn has half its luminance. Lightness (CIE L*) is about the cube
        // root of luminance.
        if edge < 1.0 { lightness * edge.cbrt() } else { lightness }
    }

    /// Whether it lies over a point at an offset from its middle.
    pub(super) fn covers(&self, offset: DVec2) -> bool {
        let at = self.local(offset, DVec2::from_angle(self.angle));
        at.y.abs() <= 0.5 * self.width && at.x.abs() <= 0.5 * self.length
    }

    /// Radius of a bounding circle around its middle.
    pub(super) fn bounding_radius(&self) -> f64 {
        // At 0.4 widths beyond an end, END_SLOPE has taken off a lightness of 2.4. That is more
        // than any end of a yarn stands out of the ground: lightness 1 is the photo's contrast.
        0.5 * (self.length + 0.8 * self.width).hypot(self.width) + self.bow.abs() + self.sway.abs()
    }

    /// Half width of a bounding strip along its chord, valid within [`Segment::bounding_radius`].
    fn bounding_half_width(&self) -> f64 {
        let steepest =
            (2.0 * S_SCALE * self.sway.abs() + 2.0 * self.bow.abs()) / (0.5 * self.length);
        let beyond = self.bounding_radius() + 0.5 - 0.5 * self.length;
        // sqrt(1 + s^2) <= 1 + s bounds the width of a slanted edge across the chord.
        (0.5 * self.width + EDGE_BLUR) * (1.0 + steepest)
            + self.bow.abs()
            + self.sway.abs()
            + steepest * beyond
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

/// Points of a regular grid over a cell, pixels.
pub(super) fn sample_points(lattice: &Lattice, [columns, rows]: [usize; 2]) -> Vec<DVec2> {
    (0..columns * rows)
        .map(|at| {
            lattice.a * (double(at % columns) / double(columns))
                + lattice.b * (double(at / columns) / double(rows))
        })
        .collect()
}

/// How much lighter than the ground a segment and its copies make each point.
pub(super) fn heights(segment: &Segment, lattice: &Lattice, points: &[DVec2]) -> Vec<f64> {
    let mut heights = vec![0.0_f64; points.len()];
    let (radius, half_width) = (segment.bounding_radius() + 0.5, segment.bounding_half_width());
    let radius_squared = radius * radius;
    let direction = DVec2::from_angle(segment.angle);
    for copy in segment.copies(lattice) {
        for (height, point) in heights.iter_mut().zip(points) {
            let offset = *point - copy;
            // Two cheap bounds before the square roots. Every point that they reject is outside, so
            // the result is the same as without them; a test checks it.
            if offset.length_squared() < radius_squared
                && direction.perp_dot(offset).abs() < half_width
            {
                *height = height.max(segment.height(offset, direction));
            }
        }
    }
    heights
}

/// Lightness of each point: the ground, and over it the lightest segment. Since dark is deep, the
/// maximum is the upper envelope of the heights, and no depth sort is needed.
pub(super) fn rendered(
    segments: &[Segment],
    ground: f64,
    lattice: &Lattice,
    points: &[DVec2],
) -> Vec<f64> {
    let mut light = vec![0.0_f64; points.len()];
    segments.iter().for_each(|segment| max_into(&mut light, &heights(segment, lattice, points)));
    light.iter_mut().for_each(|light| *light += ground);
    light
}

/// The maximum of two layers at each point.
pub(super) fn max_into(light: &mut [f64], heights: &[f64]) {
    light.iter_mut().zip(heights).for_each(|(light, height)| *light = light.max(*height));
}

/// Shares of the points that lie under two segments or more, and under none.
pub(super) fn covered_shares(
    segments: &[Segment],
    lattice: &Lattice,
    points: &[DVec2],
) -> [f64; 2] {
    let mut counts = vec![0u8; points.len()];
    for segment in segments {
        for copy in segment.copies(lattice) {
            for (count, point) in counts.iter_mut().zip(points) {
                *count = count.saturating_add(u8::from(segment.covers(*point - copy)));
            }
        }
    }
    let overlapped = counts.iter().filter(|&&count| count > 1).count();
    let blank = counts.iter().filter(|&&count| count == 0).count();
    [overlapped, blank].map(|part| double(part) / double(counts.len()))
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
    fn a_segment_is_lightest_in_its_middle_and_is_periodic() {
        let places = sample_points(&LATTICE, [20, 10]);
        let rendered = rendered(&[segment(0.0, 5.0, 0.0)], 0.2, &LATTICE, &places);
        let at = |x: usize, y: usize| rendered[20 * y + x];
        assert!(
            (at(0, 5) - 1.2).abs() < 1e-12 && at(1, 5) > at(19, 5),
            "lifted towards +x: {} {}",
            at(1, 5),
            at(19, 5)
        );
        assert!(at(16, 5) > 0.2 && at(10, 5) == 0.2 && at(0, 8) == 0.2 && at(0, 6) < at(0, 5));
    }

    #[test]
    fn all_that_a_segment_renders_lies_in_its_bounds() {
        let around: Vec<DVec2> =
            (0..300 * 300).map(|at| DVec2::new(double(at % 300), double(at / 300)) * 0.1).collect();
        let bounding_half_width = Lattice { a: DVec2::X * 60.0, b: DVec2::Y * 60.0 };
        for (bow, sway) in [(0.0, 0.0), (2.0, 0.0), (-1.5, 2.5), (1.0, -3.0)] {
            let bent = Segment { bow, sway, ..segment(15.0, 15.0, 0.3) };
            let way = DVec2::from_angle(0.3);
            let reaches = |off: DVec2| off.length() < bent.bounding_radius() + 0.5;
            let height = |place: &DVec2| {
                Some(*place - bent.centre)
                    .filter(|off| reaches(*off))
                    .map(|off| bent.height(off, way))
            };
            let expected: Vec<f64> =
                around.iter().map(|place| height(place).unwrap_or(0.0).max(0.0)).collect();
            assert!(heights(&bent, &bounding_half_width, &around) == expected, "{bow} {sway}");
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
                (part.axis_lightness(share * part.length) - whole.axis_lightness(light)).abs()
                    < 1e-12,
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
        // An S bends most where it has gone 0.577 of its way to an end.
        assert!(
            (bent.axis(-6.0 * S_EXTREMUM).0.y - 5.0 - (1.0 - S_EXTREMUM * S_EXTREMUM) - 0.5).abs()
                < 1e-12
        );
        for along in [-4.0, -2.0, 0.0, 2.0, 5.0] {
            let (place, angle) = bent.axis(along);
            let lateral_offset = DVec2::from_angle(angle).perp();
            assert!(
                bent.covers(place + lateral_offset * 1.8 - bent.centre)
                    && !bent.covers(place + lateral_offset * 2.4 - bent.centre),
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

    #[test]
    fn shares_of_a_cell() {
        let places = sample_points(&LATTICE, [200, 100]);
        let [overlap, blank] = covered_shares(&[segment(10.0, 5.0, 0.0)], &LATTICE, &places);
        assert!(overlap == 0.0 && (blank - 0.76).abs() < 0.01, "{blank}");
        let [overlap, _] =
            covered_shares(&[segment(10.0, 5.0, 0.0), segment(16.0, 5.0, 0.0)], &LATTICE, &places);
        assert!((overlap - 0.12).abs() < 0.01, "{overlap}");
    }
}
