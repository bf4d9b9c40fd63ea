//! A yarn as its fibres: helices around its axis.
//!
//! In: the control points of a yarn and a [`Bundle`]. Out: polylines, one for each fibre.
//!
//! Method: the procedural yarn model of Schröder, Zhao and Zinke, Recent advances in
//! physically-based appearance modeling of cloth, 2012, simplified: all parameters are constant
//! except the twist. Fibres are spread evenly over the yarn's section and wind around its axis.
//! Fibre migration moves each of them towards the axis and back as it winds.
//!
//! Cost: a sine and a cosine for the angle and a cosine for the migration at each point. The same
//! seed gives the same fibres, whichever part of the yarn is asked for.
//!
//! Not promised: fibres that never intersect. Those that stand off the yarn are in [`super::hairs`].

use std::f64::consts::TAU;
use std::ops::Range;

use glam::{DVec3, Vec3, Vec3A};

use super::hairs::Hairs;
use super::random::SplitMix64;
use super::{curve, frame};
use crate::number::double;

/// Slope of plies and fibres against the yarn's axis where no twist is known: tan 24 degrees, a
/// middling twist.
pub const MIDDLING_SLOPE: f32 = 0.445;
/// Radius of a fibre, mm: that of fine cotton, as in the paper.
pub const FIBRE_RADIUS: f64 = 0.0045;
/// The largest number of fibres in a yarn. A thicker yarn gets thicker fibres instead.
pub const MOST_FIBRES: u32 = 4_000;
/// Points of a fibre for each turn around the yarn. At 12 a chord deviates from the helix by 3.4 %
/// of the fibre's distance from the axis. With much fewer the section becomes a visible polygon;
/// more only cost memory.
const POINTS_PER_TURN: f64 = 12.0;
/// The largest distance between a fibre's points, in radii of the yarn. It applies to yarns with
/// little or no twist: with a larger distance their fibres would cut the corners of bends.
const MAX_STEP: f64 = 1.0;
/// Depth of the fibre migration, as a share of the fibre's largest distance from the axis. At 0
/// every fibre keeps its distance, as in an ideal helix; at 1 each would pass through the axis.
const MIGRATION_DEPTH: f64 = 0.3;
/// Period of the fibre migration, in turns around the yarn. It is no whole number, so the depth
/// differs from turn to turn and no regular pattern shows.
const MIGRATION_TURNS: f64 = 3.3;

/// The parameters of a yarn's fibres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bundle {
    /// Radius of the yarn, mm.
    pub radius: f64,
    /// Radius of a fibre, mm.
    pub fibre: f64,
    /// Number of fibres.
    pub count: u32,
    /// Slope of the outermost fibres against the axis. A positive slope is S twist, a negative one
    /// Z twist.
    pub slope: f64,
    /// Fibres that stand off the yarn.
    pub hairs: Option<Hairs>,
}

impl Bundle {
    /// The fibres that fill the share `packing` of a yarn's section, without hairs.
    ///
    /// For a section of width w and semi-axis a = w/2 this is `0.3 a w / r²` fibres of radius r at
    /// the paper's packing of 0.6.
    ///
    /// ```
    /// use warpknit_core::yarn::fibres::Bundle;
    /// assert_eq!(Bundle::filling(0.1, 0.6, 0.0045, 0.3).count, 296);
    /// ```
    #[must_use]
    pub fn filling(radius: f64, packing: f64, fibre: f64, slope: f64) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "`as` saturates, and the limit follows"
        )]
        let count = (packing * (radius / fibre).powi(2)).round() as u32;
        let count = count.clamp(1, MOST_FIBRES);
        // Where the limit cut the number, thicker fibres keep the packing.
        let fibre = fibre.max(radius * (packing / f64::from(count)).sqrt()).min(radius);
        Self { radius, fibre, count, slope, hairs: None }
    }

    /// Points of one fibre for each mm of yarn.
    #[must_use]
    pub fn points_per_mm(&self) -> f64 {
        // The slope is the tangent of the helix angle, so one turn takes 2 pi r / slope mm of yarn.
        (POINTS_PER_TURN * self.slope.abs() / (TAU * self.radius))
            .max(1.0 / (MAX_STEP * self.radius))
    }
}

/// The sampled axis of a yarn with its rotation-minimising frame.
#[derive(Clone, Debug, Default)]
pub struct Axis {
    points: Vec<DVec3>,
    normals: Vec<Vec3A>,
    binormals: Vec<Vec3A>,
    /// Length from the first point to each sample, mm.
    lengths: Vec<f64>,
    /// The first sample of each span, and after them the last sample.
    spans: Vec<usize>,
}

impl Axis {
    /// Samples the curve through the control points, `per_mm` samples a mm and at least two a span.
    #[must_use]
    pub fn through(controls: &[DVec3], per_mm: f64) -> Self {
        let mut axis = Self::default();
        let (mut length, mut before): (f64, Option<(DVec3, Vec3A, Vec3A)>) = (0.0, None);
        for index in 0..controls.len().saturating_sub(1) {
            let span = curve::span(controls, index);
            // At most 64: a stray point may make a span of metres, which must not take all memory.
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
            let samples = (span.length() * per_mm).ceil().clamp(2.0, 64.0) as usize;
            axis.spans.push(axis.points.len());
            // The end of a span is the first sample of the next one. Only the last span has its
            // end.
            let is_last = index + 2 == controls.len();
            for sample in 0..samples + usize::from(is_last) {
                let t = double(sample) / double(samples);
                let point = span.at(t);
                let tangent = Vec3A::from(span.tangent(t).as_vec3()).normalize_or(Vec3A::X);
                let normal = match before {
                    None => frame::perpendicular_unit(Vec3A::Z, tangent),
                    Some((last, from, normal)) => {
                        let chord = Vec3A::from((point - last).as_vec3());
                        frame::double_reflection(normal, chord, from, tangent)
                    }
                };
                length += before.map_or(0.0, |(last, ..)| point.distance(last));
                before = Some((point, tangent, normal));
                axis.points.push(point);
                axis.normals.push(normal);
                axis.binormals.push(tangent.cross(normal));
                axis.lengths.push(length);
            }
        }
        axis.spans.push(axis.points.len().saturating_sub(1));
        axis
    }

    /// Samples over a range of spans, including the end of the last one.
    fn samples(&self, spans: Range<usize>) -> std::ops::RangeInclusive<usize> {
        self.spans[spans.start]..=self.spans[spans.end]
    }

    /// The number of samples over a range of spans.
    #[must_use]
    pub fn count(&self, spans: Range<usize>) -> usize {
        self.samples(spans).count()
    }

    /// For each sample over a range of spans, the span that begins at or before it.
    pub fn spans_of(&self, spans: Range<usize>) -> impl Iterator<Item = usize> {
        let last = spans.end - 1;
        self.samples(spans).map(move |sample| {
            self.spans.partition_point(|&first| first <= sample).saturating_sub(1).min(last)
        })
    }
}

/// Calls `take` with each fibre of a yarn over a range of its spans, as points in mm.
///
/// # Panics
/// If the axis has no such spans.
pub fn for_each_fibre(
    bundle: &Bundle,
    axis: &Axis,
    spans: Range<usize>,
    seed: u64,
    take: &mut impl FnMut(&[Vec3]),
) {
    let samples = axis.samples(spans);
    // Angular frequencies by yarn length, rad/mm. The outermost fibre has the slope of the twist;
    // all others turn by the same angle, so theirs is smaller.
    let turning = bundle.slope / bundle.radius;
    // An untwisted yarn would have no migration at all; it gets that of a slope of 0.1.
    let migration = turning.abs().max(0.1 / bundle.radius) / MIGRATION_TURNS;
    let mut points = Vec::with_capacity(samples.clone().count());
    for fibre in 0..bundle.count {
        let mut random = SplitMix64::new(seed, fibre.into());
        // Stratified over the section: fibre k of n lies in the k-th of n rings of equal area,
        // hence the square root. Purely random distances would leave gaps and bunches. The fibre's
        // own radius is subtracted, so that its surface stays within the yarn.
        let reach = (bundle.radius - bundle.fibre)
            * ((f64::from(fibre) + random.next_unit()) / f64::from(bundle.count)).sqrt();
        let (start, phase) = (TAU * random.next_unit(), TAU * random.next_unit());
        points.clear();
        points.extend(samples.clone().map(|at| {
            let along = axis.lengths[at];
            let (sin, cos) = (start - turning * along).sin_cos();
            // The distance from the axis swings between `reach` and 0.7 `reach`.
            let distance =
                reach * (1.0 - MIGRATION_DEPTH * 0.5 * (1.0 - (migration * along + phase).cos()));
            let offset = axis.normals[at] * crate::number::narrow(distance * cos)
                + axis.binormals[at] * crate::number::narrow(distance * sin);
            (axis.points[at] + offset.as_dvec3()).as_vec3()
        }));
        take(&points);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn straight() -> Vec<DVec3> {
        (0..6).map(|at| DVec3::new(0.0, f64::from(at) * 0.5, 0.0)).collect()
    }

    #[test]
    fn fibres_wind_at_the_slope_of_the_twist_and_stay_within() {
        for slope in [0.4, -0.3] {
            let bundle = Bundle { radius: 0.1, fibre: 0.005, count: 200, slope, hairs: None };
            let axis = Axis::through(&straight(), bundle.points_per_mm());
            let (mut fibres, mut outer) = (0, Vec::new());
            for_each_fibre(&bundle, &axis, 0..5, 7, &mut |points| {
                fibres += 1;
                for (p, q) in points.iter().zip(&points[1..]) {
                    let reach = p.x.hypot(p.z);
                    assert!(reach <= 0.0951 && q.y > p.y, "{p}");
                    // Seen from +z with the yarn upright, S runs from the upper left to the lower
                    // right: up and to the left.
                    if reach > 0.09 && p.z > 0.08 {
                        outer.push(f64::from(p.x - q.x) / f64::from(q.y - p.y));
                    }
                }
            });
            assert_eq!(fibres, 200);
            let mean = outer.iter().sum::<f64>() / double(outer.len());
            assert!((mean / slope - 0.88).abs() < 0.12, "{mean} for {slope}");
        }
    }

    #[test]
    fn a_part_is_what_the_whole_is_there() {
        let bundle = Bundle::filling(0.1, 0.6, 0.01, 0.3);
        let axis = Axis::through(&straight(), bundle.points_per_mm());
        let (mut whole, mut part) = (Vec::new(), Vec::new());
        for_each_fibre(&bundle, &axis, 0..5, 1, &mut |points| whole.push(points.to_vec()));
        for_each_fibre(&bundle, &axis, 2..4, 1, &mut |points| part.push(points.to_vec()));
        let before = axis.count(0..2) - 1;
        for (whole, part) in whole.iter().zip(&part) {
            assert_eq!(&whole[before..before + part.len()], part.as_slice());
        }
        assert_eq!(axis.spans_of(2..4).collect::<Vec<_>>().first(), Some(&2));
    }

    #[test]
    fn fibres_fill_their_share_evenly() {
        let bundle = Bundle::filling(0.2, 0.6, 0.0045, 0.2);
        // The paper's number, for a round yarn whose semi-axis is half its width.
        assert_eq!(f64::from(bundle.count), (0.3 * 0.2 * 0.4 / 0.0045_f64.powi(2)).round());
        let few = Bundle::filling(2.0, 0.6, 0.0045, 0.2);
        assert!(
            few.count == MOST_FIBRES
                && (f64::from(few.count) * (few.fibre / 2.0).powi(2) - 0.6).abs() < 1e-9
        );
        let axis = Axis::through(&straight(), 10.0);
        let (mut inner, mut all) = (0, 0);
        for_each_fibre(&bundle, &axis, 0..1, 3, &mut |points| {
            inner += usize::from(points[0].x.hypot(points[0].z) < 0.1);
            all += 1;
        });
        // Half the radius is a quarter of the section, and wandering brings some more in.
        assert!((0.25..0.45).contains(&(double(inner) / double(all))), "{inner} of {all}");
    }
}
