//! A yarn as its fibres: helices around its axis.
//!
//! In: the control points of a yarn and a [`Bundle`]. Out: polylines, one a fibre. Source: the
//! simplified model of Schröder, Zhao and Zinke 2012, whose fibres are spread evenly over the
//! yarn's section, wind around its axis and wander in and out as they do, with all parameters but
//! the twist fixed. Cost: a sine and a cosine a point. The same seed gives the same fibres,
//! whatever of the yarn is asked for.
//!
//! Not promised: fibres that never cut each other; hairs that stand off.

use std::f64::consts::TAU;
use std::ops::Range;

use glam::{DVec3, Vec3, Vec3A};

use super::{curve, frame};
use crate::number::double;

/// Slope of plies and fibres against the yarn's axis where no twist is known: tan 24 degrees, a
/// middling twist.
pub const MIDDLING_SLOPE: f32 = 0.445;
/// Radius of a fibre, mm: the paper's, that of fine cotton.
pub const FIBRE_RADIUS: f64 = 0.0045;
/// The most fibres of a yarn.
pub const MOST_FIBRES: u32 = 4_000;
/// Points of a fibre for each turn around the yarn, and how far apart they are at the most, radii
/// of the yarn.
const POINTS_A_TURN: f64 = 12.0;
const FARTHEST: f64 = 1.0;
/// How far in a fibre wanders, as a share of its distance from the axis, and after how many turns
/// it is out again.
const WANDERS: f64 = 0.3;
const WANDERING_TURNS: f64 = 3.3;

/// What a yarn's fibres are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bundle {
    /// Radius of the yarn, mm.
    pub radius: f64,
    /// Radius of a fibre, mm.
    pub fibre: f64,
    /// How many there are.
    pub count: u32,
    /// Slope of the outermost fibres against the axis; over 0 is S, under 0 is Z.
    pub slope: f64,
}

impl Bundle {
    /// The fibres that fill a share `packing` of a yarn's section.
    ///
    /// For a section of half width w/2 and semi-axis a that is `.3 a w / r²` of them at the paper's
    /// packing of .6.
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
        // Fewer than would fill it are as much thicker.
        let fibre = fibre.max(radius * (packing / f64::from(count)).sqrt()).min(radius);
        Self { radius, fibre, count, slope }
    }

    /// Points of one fibre over a mm of yarn.
    #[must_use]
    pub fn points_per_mm(&self) -> f64 {
        (POINTS_A_TURN * self.slope.abs() / (TAU * self.radius)).max(1.0 / (FARTHEST * self.radius))
    }
}

/// The axis of a yarn with its frame, sampled.
#[derive(Clone, Debug, Default)]
pub struct Axis {
    points: Vec<DVec3>,
    normals: Vec<Vec3A>,
    binormals: Vec<Vec3A>,
    /// From the first point, mm.
    lengths: Vec<f64>,
    /// The first sample of each span, and the last sample.
    spans: Vec<usize>,
}

impl Axis {
    /// The axis through control points, with so many samples a mm and two a span at least.
    #[must_use]
    pub fn through(controls: &[DVec3], per_mm: f64) -> Self {
        let mut axis = Self::default();
        let (mut length, mut before): (f64, Option<(DVec3, Vec3A, Vec3A)>) = (0.0, None);
        for index in 0..controls.len().saturating_sub(1) {
            let span = curve::span(controls, index);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
            let samples = (span.length() * per_mm).ceil().clamp(2.0, 64.0) as usize;
            axis.spans.push(axis.points.len());
            let is_last = index + 2 == controls.len();
            for sample in 0..samples + usize::from(is_last) {
                let share = double(sample) / double(samples);
                let (point, tangent) = (
                    span.at(share),
                    Vec3A::from(span.tangent(share).as_vec3()).normalize_or(Vec3A::X),
                );
                let normal = before.map_or_else(
                    || frame::across(Vec3A::Z, tangent),
                    |(last, from, normal)| {
                        frame::carry(normal, Vec3A::from((point - last).as_vec3()), from, tangent)
                    },
                );
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

    /// Samples over some of the spans, the end of the last one included.
    fn samples(&self, spans: Range<usize>) -> std::ops::RangeInclusive<usize> {
        self.spans[spans.start]..=self.spans[spans.end]
    }

    /// How many samples those are.
    #[must_use]
    pub fn count(&self, spans: Range<usize>) -> usize {
        self.samples(spans).count()
    }

    /// The span in which each of the samples over some spans begins.
    pub fn spans_of(&self, spans: Range<usize>) -> impl Iterator<Item = usize> {
        let last = spans.end - 1;
        self.samples(spans).map(move |sample| {
            self.spans.partition_point(|&first| first <= sample).saturating_sub(1).min(last)
        })
    }
}

/// Hands over the fibres of a yarn over some of its spans, each as its points, mm.
///
/// # Panics
/// If the axis has no such spans.
pub fn spin(
    bundle: &Bundle,
    axis: &Axis,
    spans: Range<usize>,
    seed: u64,
    take: &mut impl FnMut(&[Vec3]),
) {
    let samples = axis.samples(spans);
    let turning = bundle.slope / bundle.radius;
    let wandering = turning.abs().max(0.1 / bundle.radius) / WANDERING_TURNS;
    let mut points = Vec::with_capacity(samples.clone().count());
    for fibre in 0..bundle.count {
        let mut random = Random::of(seed, fibre);
        // Evenly over the section, and within the yarn.
        let reach = (bundle.radius - bundle.fibre)
            * ((f64::from(fibre) + random.share()) / f64::from(bundle.count)).sqrt();
        let (start, phase) = (TAU * random.share(), TAU * random.share());
        points.clear();
        points.extend(samples.clone().map(|at| {
            let along = axis.lengths[at];
            let (sin, cos) = (start - turning * along).sin_cos();
            let out = reach * (1.0 - WANDERS * 0.5 * (1.0 - (wandering * along + phase).cos()));
            let off = axis.normals[at] * crate::number::narrow(out * cos)
                + axis.binormals[at] * crate::number::narrow(out * sin);
            (axis.points[at] + off.as_dvec3()).as_vec3()
        }));
        take(&points);
    }
}

/// Numbers that a seed tells (Steele, Lea and Flood's splitmix64).
struct Random(u64);

impl Random {
    fn of(seed: u64, fibre: u32) -> Self {
        Self(
            seed.wrapping_mul(0x9E37_79B9_7F4A_7C15)
                ^ u64::from(fibre).wrapping_mul(0xD1B5_4A32_D192_ED03),
        )
    }

    /// Evenly in 0..1.
    fn share(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut bits = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        #[expect(clippy::cast_precision_loss, reason = "32 bits are enough to spread fibres")]
        let share = ((bits ^ (bits >> 31)) >> 32) as f64 / f64::from(u32::MAX);
        share
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
            let bundle = Bundle { radius: 0.1, fibre: 0.005, count: 200, slope };
            let axis = Axis::through(&straight(), bundle.points_per_mm());
            let (mut fibres, mut outer) = (0, Vec::new());
            spin(&bundle, &axis, 0..5, 7, &mut |points| {
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
        spin(&bundle, &axis, 0..5, 1, &mut |points| whole.push(points.to_vec()));
        spin(&bundle, &axis, 2..4, 1, &mut |points| part.push(points.to_vec()));
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
        spin(&bundle, &axis, 0..1, 3, &mut |points| {
            inner += usize::from(points[0].x.hypot(points[0].z) < 0.1);
            all += 1;
        });
        // Half the radius is a quarter of the section, and wandering brings some more in.
        assert!((0.25..0.45).contains(&(double(inner) / double(all))), "{inner} of {all}");
    }
}
