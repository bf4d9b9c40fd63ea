//! The chains of data points whose curves the solvers move: yarns of a repeat, periodic along
//! themselves.
//!
//! In: which data points a yarn of the repeat has, and its period. Out: the control points of each
//! span of its curve, as images beside the span, and whether two parts of the yarn are one strand.
//! Cost: constant for each span. Nothing here knows how yarns are moved: `relax` lays out flat cloth,
//! `strain` strains it.

use std::array::from_fn;
use std::ops::Range;

use glam::{DVec2, DVec3};

use crate::ids::index32;

/// Limits of the segments as which one span is sampled. Under four, a loop's head becomes a polygon.
/// The upper limit bounds the work for very thin yarns, whose radii would ask for many more.
const MIN_SEGMENTS: f64 = 4.0;
const MAX_SEGMENTS: f64 = 12.0;
/// Parts of one strand that are nearer than this along it, in radii, are no contacts. In the
/// tightest bend, a half circle of one radius, parts that are 3.1 radii apart along the yarn lie
/// two radii from each other. Smaller values would open such bends as if they were contacts; values
/// beyond some ten radii would let the two legs of a narrow loop cut each other.
const SAME_STRAND_RADII: f64 = 6.0;

/// A yarn of the repeat: a chain that continues in the next repeat.
#[derive(Clone, Debug)]
pub(crate) struct ControlChain {
    /// Its data points.
    pub(crate) points: Range<usize>,
    /// From a point to the same point in the next repeat, mm: along the wales, for a weft across.
    pub(crate) period: DVec3,
    /// mm.
    pub(crate) radius: f64,
}

/// The four control points of a span: the data point at which it starts is the second.
#[derive(Clone, Copy, Debug)]
pub(super) struct SpanControl {
    /// Data points of the repeat.
    pub(super) points: [u32; 4],
    /// How many periods lie from each of them to its image beside the span.
    shifts: [f64; 4],
}

impl ControlChain {
    /// Whether the yarn runs across the wales.
    pub(crate) fn runs_across(&self) -> bool {
        self.period.x != 0.0
    }

    /// The control points of the span that starts at a data point.
    pub(super) fn control(&self, start: usize) -> SpanControl {
        let count = i64::from(index32(self.points.len()));
        let at = i64::from(index32(start - self.points.start));
        // Counted along the endless yarn. Beyond the chain's ends they are images of points of this
        // repeat, some whole periods away.
        let indices = [at - 1, at, at + 1, at + 2];
        let points = indices.map(|i| {
            let wrapped = usize::try_from(i.rem_euclid(count));
            index32(self.points.start + wrapped.expect("a remainder is not negative"))
        });
        #[expect(clippy::cast_precision_loss, reason = "a repeat or two")]
        let shifts = indices.map(|i| i.div_euclid(count) as f64);
        SpanControl { points, shifts }
    }

    /// As how many segments a span with this chord is sampled, if a segment is to have this length
    /// in radii.
    pub(super) fn segments(&self, chord: f64, segment_radii: f64) -> u32 {
        let segments = (chord / (segment_radii * self.radius)).ceil();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to some segments"
        )]
        let segments = segments.clamp(MIN_SEGMENTS, MAX_SEGMENTS) as u32;
        segments
    }

    /// Whether two parts of the yarn are parts of one strand that lie close along it. `along` is the
    /// way along the repeat's yarn from the first to the second, `shift` the cells from the second
    /// to its image beside the first, and `length` the yarn's length in a repeat.
    pub(super) fn is_same_strand(&self, along: f64, shift: DVec2, length: f64) -> bool {
        let (beside, cells) = if self.runs_across() { (shift.y, shift.x) } else { shift.into() };
        // An image shifted beside the yarn is another strand. One shifted along it is the same
        // strand, whole lengths of the repeat further on.
        beside == 0.0 && (along + cells * length).abs() <= SAME_STRAND_RADII * self.radius
    }
}

impl SpanControl {
    /// The places of the control points beside the span.
    #[inline]
    pub(super) fn places(&self, points: &[DVec3], period: DVec3) -> [DVec3; 4] {
        let control = self.points.map(|point| points[point as usize]);
        // Spans within the repeat, nearly all of them, need no image.
        if self.shifts == [0.0; 4] {
            return control;
        }
        from_fn(|k| control[k] + period * self.shifts[k])
    }
}

/// The weighted sum of four control points.
pub(super) fn blend(control: &[DVec3; 4], weights: &[f64; 4]) -> DVec3 {
    control[0] * weights[0]
        + control[1] * weights[1]
        + control[2] * weights[2]
        + control[3] * weights[3]
}
