//! The data points of one yarn, before its path is made.
//!
//! In: a range of a strand's points in a scene. Out: [`PointRun`], the same in `f64`, which tells
//! how many spans a single straight piece can stand for.

use std::ops::Range;

use glam::{DVec3, Vec3A};

use crate::oval::Press;
use crate::scene::{Scene, SceneStrand, Shape};
use warpknit_core::yarn::curve;

/// Limit by which a merged piece is widened to cover the area of its spans. A bend that would need
/// more is not merged: the wide piece would cover its neighbours.
pub(super) const MAX_WIDENING: f64 = 1.5;
/// Tolerance of the mean distance between merged spans and their piece, pixels. With 0.2, loops
/// become so flat that a fabric of a million stitches is 2 % brighter. With 0.1 it is less than 1 %
/// brighter. Lower values merge fewer spans.
const MAX_BULGE: f64 = 0.1;

/// A run of drawable points in `f64`, relative to the centre. Its memory is reused for one strand
/// after another.
#[derive(Default)]
pub(super) struct PointRun {
    pub(super) points: Vec<DVec3>,
    /// The fabric's normals, for ribbons.
    pub(super) normals: Vec<Vec3A>,
    /// How the yarn is pressed, for tubes. Empty where all yarns are round.
    pub(super) presses: Vec<Press>,
    /// Factors on the yarn's radius.
    pub(super) thickness: Vec<f32>,
    /// Points at which stitches begin or end, including both ends of the run.
    pub(super) stitches: Vec<usize>,
}

impl PointRun {
    /// Takes the points `range` of a strand.
    pub(super) fn fill(
        &mut self,
        scene: &Scene,
        strand: &SceneStrand,
        range: Range<u32>,
        centre: DVec3,
    ) {
        let (start, end) = (range.start as usize, range.end as usize);
        self.points.clear();
        self.points
            .extend(scene.positions[start..end].iter().map(|point| point.as_dvec3() - centre));
        self.normals.clear();
        if scene.shape == Shape::Ribbon {
            self.normals.extend(
                scene.normals[start..end].iter().map(|normal| Vec3A::from(normal.unpack())),
            );
        }
        self.presses.clear();
        self.presses.extend(range.clone().map_while(|point| scene.press(point)));
        self.thickness.clear();
        self.thickness.extend(range.map(|point| scene.thickness(strand, point)));
        // A single point gets a copy, so that it is a piece of length 0: a ball.
        if let [only] = self.points[..] {
            self.points.push(only);
            self.normals.extend_from_within(..);
            self.presses.extend_from_within(..);
            self.thickness.extend_from_within(..);
        }
        let last = self.points.len() - 1;
        let starts = &scene.stitches[strand.stitches.start as usize..strand.stitches.end as usize];
        self.stitches.clear();
        self.stitches.push(0);
        let within = starts
            .iter()
            .map(|&point| (point as usize).saturating_sub(start))
            .filter(|&point| 0 < point && point < last);
        self.stitches.extend(within);
        self.stitches.push(last);
    }

    /// Merges spans from point `index` on until the chord is a pixel long, or until they bend too
    /// much for a single piece.
    pub(super) fn merge_spans(&self, index: usize, pixel: f64) -> MergedSpans {
        let start = self.points[index];
        let (mut found, mut arc, mut moment) = (MergedSpans::default(), 0.0, DVec3::ZERO);
        for spans in 1..self.points.len() - index {
            let end = self.points[index + spans];
            let length = start.distance(end);
            if spans == 1 && length >= pixel {
                break;
            }
            let span = curve::span(&self.points, index + spans - 1);
            let span_length = span.length();
            arc += span_length;
            moment += span.mean() * span_length;
            // Mean position of the curve, by arc length, minus the midpoint of the chord.
            let bulge = moment / arc.max(f64::MIN_POSITIVE) - start.midpoint(end);
            if spans > 1 && (arc > MAX_WIDENING * length || bulge.length() > MAX_BULGE * pixel) {
                break;
            }
            found = MergedSpans { spans, length, arc, bulge, tangent: span.tangent(1.0) };
            if length >= pixel {
                break;
            }
        }
        found
    }
}

/// A straight piece that replaces whole spans.
#[derive(Default)]
pub(super) struct MergedSpans {
    /// Number of spans. 0 where the first span is long enough to be subdivided itself.
    pub(super) spans: usize,
    /// Length of the chord, mm.
    pub(super) length: f64,
    /// Length of the curve, mm.
    pub(super) arc: f64,
    /// Vector from the chord's midpoint to the curve's mean position.
    pub(super) bulge: DVec3,
    /// Derivative of the curve at the end.
    pub(super) tangent: DVec3,
}
