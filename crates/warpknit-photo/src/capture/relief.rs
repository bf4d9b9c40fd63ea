//! Steps 3 and 5: the heights of curved cylinders, and the cell that several of them draw.
//!
//! In: [`Segment`]s on a [`Lattice`], and [`Samples`]. Out: the lightness of each sample.
//!
//! Method: the curved cylinder of Irawan and Marschner 2012, *Specular reflection from woven
//! cloth*. Its ends bend down, and it is level between them where it lies over several other yarns.
//! A tilt describes yarns that come up at one end and go down at the other. In the plane of the
//! cloth the axis is a cubic, because legs of loops are bent like a bow or an S.
//!
//! Cost: two square roots for each sample that a copy of a segment may touch. A bounding circle and
//! a bounding strip reject most others a run at a time. Fits spend their time here, so what doesn't
//! depend on the place is worked out once a segment, a run is worked out in wide registers, and
//! segments that differ in their light alone share their geometry.

use std::array;

use glam::DVec2;
use pulp::Arch;

use super::lattice::Lattice;
use super::segment::{S_SCALE, Segment};
use crate::plane::double;

/// How steeply the lightness falls beyond an end, per width. A tenth of it would let ends stick out
/// over their neighbours; an infinite slope would leave Levenberg-Marquardt without a derivative
/// for the length.
const END_SLOPE: f64 = 6.0;
/// Distance from an end, in widths, where a yarn begins to go down. A yarn that lies over several
/// others is level between its two ramps.
const END_RAMP: f64 = 0.75;
/// Edges are blurred by this many pixels to either side: a pixel integrates over its area.
const EDGE_BLUR: f64 = 0.5;
/// Samples that are rejected together, and worked out together. Fewer cost a test each, more are
/// seldom all outside.
const RUN: usize = 8;

/// A segment, ready to be asked for heights.
pub(super) struct Relief {
    segment: Segment,
    /// The unit vector of its angle.
    pub(super) direction: DVec2,
    half: f64,
    half_width: f64,
    /// Reciprocals: of half the length, of the width, of half the width, and of the ramp at an end.
    per_half: f64,
    per_width: f64,
    per_half_width: f64,
    per_ramp: f64,
    ramp: f64,
    /// Factors of the S and of the bow's slope.
    s: f64,
    two_bow: f64,
}

impl Relief {
    pub(super) fn new(segment: &Segment) -> Self {
        let Segment { angle, width, length, bow, sway, .. } = *segment;
        let half = 0.5 * length;
        let ramp = half.min(END_RAMP * width);
        Self {
            segment: *segment,
            direction: DVec2::from_angle(angle),
            half,
            half_width: 0.5 * width,
            per_half: half.recip(),
            per_width: width.recip(),
            per_half_width: 2.0 / width,
            per_ramp: ramp.recip(),
            ramp,
            s: S_SCALE * sway,
            two_bow: 2.0 * bow,
        }
    }

    /// Lateral offset of the axis from the chord, and the slope of the axis there. The axis goes
    /// straight on beyond its ends.
    #[inline(always)]
    pub(super) fn lateral_offset(&self, along: f64) -> (f64, f64) {
        let t = self.position(along);
        let square = t * t;
        // A parabola for the bow plus a cubic for the S. Both vanish at t = -1 and t = 1, so that
        // neither moves the ends.
        let slope = (self.s * (3.0 * square - 1.0) - self.two_bow * t) * self.per_half;
        let bend = (self.segment.bow - self.s * t) * (1.0 - square);
        (bend + slope * (along - t * self.half), slope)
    }

    /// Position along the axis, from -1 at one end to 1 at the other, and no farther.
    #[inline(always)]
    fn position(&self, along: f64) -> f64 {
        (along * self.per_half).clamp(-1.0, 1.0)
    }

    /// How far the axis has descended at a position along it: 0 where it is level, 1 at its ends.
    #[inline(always)]
    pub(super) fn descent(&self, along: f64) -> f64 {
        let down = ((along.abs() - self.half + self.ramp) * self.per_ramp).clamp(0.0, 1.0);
        down * down
    }

    /// Lightness of the axis relative to the ground.
    pub(super) fn axis_lightness(&self, along: f64) -> f64 {
        SegmentLight::of(&self.segment).along_axis(self.position(along), self.descent(along))
    }

    /// Coordinates along and across the segment for an offset from its middle.
    #[inline(always)]
    pub(super) fn local(&self, offset: DVec2) -> DVec2 {
        let along = self.direction.dot(offset);
        let (lateral, slope) = self.lateral_offset(along);
        // First-order distance to a slanted curve: the offset across the chord times the cosine of
        // the slope. Without it bent segments would come out too wide where they are steep.
        let across = (self.direction.perp_dot(offset) - lateral) / (1.0 + slope * slope).sqrt();
        DVec2::new(along, across)
    }

    /// The place on the segment of each offset from its middle.
    #[inline(always)]
    fn places<const N: usize>(&self, offsets: [DVec2; N]) -> SegmentPlaces<N> {
        let mut places = SegmentPlaces::<N>::default();
        for (lane, offset) in offsets.into_iter().enumerate() {
            let at = self.local(offset);
            // Coverage of a pixel by a straight edge, as a linear ramp: antialiasing of the model,
            // so that its derivative by the width does not vanish between pixels. A pixel that is
            // half yarn has half its luminance, and lightness (CIE L*) is about the cube root of
            // luminance.
            let edge = 0.5 + (self.half_width - at.y.abs()) / (2.0 * EDGE_BLUR);
            let across = (at.y * self.per_half_width).clamp(-1.0, 1.0);
            places.coverage[lane] = cube_root_of_share(edge);
            places.position[lane] = self.position(at.x);
            places.descent[lane] = self.descent(at.x);
            places.beyond[lane] = (at.x.abs() - self.half).max(0.0) * self.per_width;
            // The section is half an ellipse, with `round` as its semi-axis upward.
            places.fall[lane] = 1.0 - (1.0 - across * across).sqrt();
        }
        places
    }

    /// Lightness at an offset from the segment's middle relative to the ground; 0 and less outside.
    pub(super) fn height(&self, offset: DVec2) -> f64 {
        SegmentLight::of(&self.segment).at(&self.places([offset]), 0)
    }

    /// Whether the segment lies over a point at an offset from its middle.
    pub(super) fn covers(&self, offset: DVec2) -> bool {
        let at = self.local(offset);
        at.y.abs() <= self.half_width && at.x.abs() <= self.half
    }

    /// Half width of a bounding strip along the chord, valid within
    /// [`Segment::bounding_radius`].
    fn bounding_half_width(&self) -> f64 {
        let steepest = (2.0 * self.s.abs() + self.two_bow.abs()) * self.per_half;
        let beyond = self.segment.bounding_radius() + 0.5 - self.half;
        // sqrt(1 + s^2) <= 1 + s bounds the width of a slanted edge across the chord.
        (self.half_width + EDGE_BLUR) * (1.0 + steepest)
            + self.segment.bow.abs()
            + self.segment.sway.abs()
            + steepest * beyond
    }
}

/// How light a segment is.
#[derive(Clone, Copy)]
struct SegmentLight {
    top: f64,
    round: f64,
    sag: f64,
    tilt: f64,
}

impl SegmentLight {
    fn of(segment: &Segment) -> Self {
        let Segment { top, round, sag, tilt, .. } = *segment;
        Self { top, round, sag, tilt }
    }

    /// Lightness of the axis relative to the ground.
    #[inline(always)]
    fn along_axis(self, position: f64, descent: f64) -> f64 {
        self.top - self.sag * descent + self.tilt * position
    }

    /// Lightness of a place relative to the ground.
    #[inline(always)]
    fn at<const N: usize>(self, places: &SegmentPlaces<N>, lane: usize) -> f64 {
        let lightness = self.along_axis(places.position[lane], places.descent[lane])
            - END_SLOPE * places.beyond[lane]
            - self.round * places.fall[lane];
        lightness * places.coverage[lane]
    }
}

/// Places on a segment: all that their lightness depends on but the segment's light.
struct SegmentPlaces<const N: usize> {
    /// Along the axis, from -1 to 1.
    position: [f64; N],
    /// How far the axis has descended there.
    descent: [f64; N],
    /// How far beyond an end, in widths.
    beyond: [f64; N],
    /// How far the section has fallen there, as a share of its height.
    fall: [f64; N],
    /// The lightness of so much of the pixel as is yarn: 0 outside, 1 inside.
    coverage: [f64; N],
}

impl<const N: usize> Default for SegmentPlaces<N> {
    #[inline(always)]
    fn default() -> Self {
        let none = [0.0; N];
        Self { position: none, descent: none, beyond: none, fall: none, coverage: none }
    }
}

/// The cube root of a number from 0 to 1, to 1e-14, and of the nearer of both beyond: a guess from
/// the exponent, and two of Halley's steps. The library's is rounded exactly, and was 4 % of a
/// capture's time.
#[inline(always)]
fn cube_root_of_share(number: f64) -> f64 {
    /// Two thirds of the exponent's offset, less what keeps the guess within 5 %.
    const GUESS: u32 = 0x2a51_37a0;
    // A guess needs no more than single precision, whose bits registers divide together.
    #[expect(clippy::cast_possible_truncation, reason = "a guess")]
    let guess = f32::from_bits((number.max(0.0) as f32).to_bits() / 3 + GUESS);
    let mut root = f64::from(guess);
    for _ in 0..2 {
        let cube = root * root * root;
        root *= (cube + 2.0 * number) / (2.0 * cube + number);
    }
    if number <= 0.0 {
        0.0
    } else if number < 1.0 {
        root
    } else {
        1.0
    }
}

/// Samples that are worked out together, and a circle about them.
#[derive(Clone, Debug)]
struct SampleRun {
    points: [DVec2; RUN],
    centre: DVec2,
    radius: f64,
}

impl SampleRun {
    /// Up to [`RUN`] points. The last one fills the places of those that lack.
    fn new(points: &[DVec2]) -> Self {
        let low = points.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let high = points.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
        let centre = low.midpoint(high);
        let radius = points.iter().map(|point| point.distance(centre)).fold(0.0, f64::max);
        Self { points: array::from_fn(|lane| points[lane.min(points.len() - 1)]), centre, radius }
    }
}

/// Places where heights are asked for, pixels.
#[derive(Clone, Debug)]
pub(super) struct Samples {
    pub(super) points: Vec<DVec2>,
    runs: Vec<SampleRun>,
}

impl Samples {
    pub(super) fn new(points: Vec<DVec2>) -> Self {
        let runs = points.chunks(RUN).map(SampleRun::new).collect();
        Self { points, runs }
    }

    /// Points of a regular grid over a cell.
    pub(super) fn grid(lattice: &Lattice, [columns, rows]: [usize; 2]) -> Self {
        let point = |at: usize| {
            lattice.a * (double(at % columns) / double(columns))
                + lattice.b * (double(at / columns) / double(rows))
        };
        Self::new((0..columns * rows).map(point).collect())
    }
}

/// How much lighter than the ground a segment and its copies make each sample.
pub(super) fn heights(segment: &Segment, lattice: &Lattice, samples: &Samples) -> Vec<f64> {
    heights_in_lights(&[*segment], lattice, samples).swap_remove(0)
}

/// The same for each of some segments that differ in nothing but their light.
pub(super) fn heights_in_lights(
    segments: &[Segment],
    lattice: &Lattice,
    samples: &Samples,
) -> Vec<Vec<f64>> {
    let mut heights = vec![vec![0.0_f64; samples.points.len()]; segments.len()];
    let lights: Vec<SegmentLight> = segments.iter().map(SegmentLight::of).collect();
    let relief = Relief::new(&segments[0]);
    let (radius, half_width) = (segments[0].bounding_radius() + 0.5, relief.bounding_half_width());
    let copies = segments[0].copies(lattice);
    // Compiled once for each set of instructions that a processor may have. Without those for wide
    // registers the same operations give the same bits.
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for copy in copies {
                for (number, run) in samples.runs.iter().enumerate() {
                    let middle = run.centre - copy;
                    // Two cheap bounds before the square roots. All that the strip rejects is
                    // outside; a test checks it.
                    if middle.length_squared() >= (radius + run.radius) * (radius + run.radius)
                        || relief.direction.perp_dot(middle).abs() >= half_width + run.radius
                    {
                        continue;
                    }
                    let offsets = run.points.map(|point| point - copy);
                    let mut places = relief.places(offsets);
                    for (coverage, offset) in places.coverage.iter_mut().zip(offsets) {
                        let is_near = offset.length_squared() < radius * radius;
                        *coverage = if is_near { *coverage } else { 0.0 };
                    }
                    for (heights, light) in heights.iter_mut().zip(&lights) {
                        let own: [f64; RUN] = array::from_fn(|lane| light.at(&places, lane));
                        let heights = heights[number * RUN..].iter_mut();
                        heights.zip(own).for_each(|(height, own)| *height = height.max(own));
                    }
                }
            }
        },
    );
    heights
}

/// Lightness of each sample: the ground, and over it the lightest segment. Since dark is deep, the
/// maximum is the upper envelope of the heights, and no depth sort is needed.
pub(super) fn rendered(
    segments: &[Segment],
    ground: f64,
    lattice: &Lattice,
    samples: &Samples,
) -> Vec<f64> {
    let mut light = vec![0.0_f64; samples.points.len()];
    segments.iter().for_each(|segment| max_into(&mut light, &heights(segment, lattice, samples)));
    light.iter_mut().for_each(|light| *light += ground);
    light
}

/// The maximum of two layers at each sample.
pub(super) fn max_into(light: &mut [f64], heights: &[f64]) {
    light.iter_mut().zip(heights).for_each(|(light, height)| *light = light.max(*height));
}

/// Shares of the samples that lie under two segments or more, and under none.
pub(super) fn covered_shares(
    segments: &[Segment],
    lattice: &Lattice,
    samples: &Samples,
) -> [f64; 2] {
    let mut counts = vec![0u8; samples.points.len()];
    for segment in segments {
        let relief = Relief::new(segment);
        for copy in segment.copies(lattice) {
            for (count, point) in counts.iter_mut().zip(&samples.points) {
                *count = count.saturating_add(u8::from(relief.covers(*point - copy)));
            }
        }
    }
    let overlapped = counts.iter().filter(|&&count| count > 1).count();
    let blank = counts.iter().filter(|&&count| count == 0).count();
    [overlapped, blank].map(|part| double(part) / double(counts.len()))
}

#[cfg(test)]
mod tests {
    use super::super::segment::tests::{LATTICE, segment};
    use super::*;

    #[test]
    fn cube_roots_of_coverages() {
        for step in 1..=1000 {
            let number = double(step) / 1000.0;
            let root = cube_root_of_share(number);
            assert!((root / number.cbrt() - 1.0).abs() < 1e-14, "{number}");
        }
        assert_eq!([-1.0, 0.0, 1.0, 2.0].map(cube_root_of_share), [0.0, 0.0, 1.0, 1.0]);
    }

    #[test]
    fn a_segment_is_lightest_in_its_middle_and_is_periodic() {
        let samples = Samples::grid(&LATTICE, [20, 10]);
        let rendered = rendered(&[segment(0.0, 5.0, 0.0)], 0.2, &LATTICE, &samples);
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
        let around =
            (0..300 * 300).map(|at| DVec2::new(double(at % 300), double(at / 300)) * 0.1).collect();
        let around = Samples::new(around);
        let wide = Lattice { a: DVec2::X * 60.0, b: DVec2::Y * 60.0 };
        for (bow, sway) in [(0.0, 0.0), (2.0, 0.0), (-1.5, 2.5), (1.0, -3.0)] {
            let bent = Segment { bow, sway, ..segment(15.0, 15.0, 0.3) };
            let relief = Relief::new(&bent);
            let height = |place: &DVec2| {
                let offset = *place - bent.centre;
                if offset.length() < bent.bounding_radius() + 0.5 {
                    relief.height(offset).max(0.0)
                } else {
                    0.0
                }
            };
            let expected: Vec<f64> = around.points.iter().map(height).collect();
            assert!(heights(&bent, &wide, &around) == expected, "{bow} {sway}");
        }
    }

    #[test]
    fn shares_of_a_cell() {
        let samples = Samples::grid(&LATTICE, [200, 100]);
        let [overlap, blank] = covered_shares(&[segment(10.0, 5.0, 0.0)], &LATTICE, &samples);
        assert!(overlap == 0.0 && (blank - 0.76).abs() < 0.01, "{blank}");
        let [overlap, _] =
            covered_shares(&[segment(10.0, 5.0, 0.0), segment(16.0, 5.0, 0.0)], &LATTICE, &samples);
        assert!((overlap - 0.12).abs() < 0.01, "{overlap}");
    }
}
