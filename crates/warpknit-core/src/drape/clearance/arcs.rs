//! Arcs: short parts of a draped yarn, as the search for near yarns wants them.
//!
//! In: the points of a strand, draped and flat. Out: [`Arc`]s of four straight segments.
//!
//! Method: the drawn curve is cut span by span into arcs of at most three radii. Four segments are
//! compared with four others at once, so they lie side by side in single precision. Their places
//! are taken from a data point, which is in double precision. So distances have seven digits
//! wherever on the garment the arc lies.
//!
//! Cost: 0.1 µs an arc. Not promised: the curve itself. In a bend of one radius segments leave it
//! by 2 % of the radius.

use std::array::from_fn;
use std::ops::Range;

use glam::{DVec3, Vec3};

use crate::spatial_hash::Sphere;
use crate::yarn::curve::{self, Span};

/// Segments of an arc: as many as one instruction of SSE2 compares.
pub(super) const SEGMENTS: usize = 4;
/// Length of an arc in radii of its yarn, at most. A segment counts as near as a whole, so shares
/// grow with its length: by a twentieth of themselves with arcs of 3.6. With arcs of 2.4 the search
/// takes a fifth longer.
const ARC_RADII: f64 = 3.0;
/// The most arcs of a span. Only spans of over ten wales, or torn ones, have more.
const MAX_ARCS: u8 = 32;

/// Part of a yarn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arc {
    /// The data point before it, mm.
    pub(super) start: DVec3,
    /// The ends of its segments by coordinate, from `start`, mm.
    pub(super) ends: [[f32; SEGMENTS + 1]; 3],
    /// Yarn length from the start of the strand to the middle of each segment, mm.
    pub(super) along: [f32; SEGMENTS],
    /// How far the ends lie from the straight line between the first and the last, at most, mm.
    pub(super) bulge: f32,
    /// Drawn radius of the yarn, mm.
    pub(super) radius: f32,
    /// Its yarn. Arcs of one number are parts of one strand.
    pub(super) strand: u32,
    /// Whether it is to be measured. Others are only there to be near those.
    pub(super) measured: bool,
    /// Its middle on the flat panel, mm from a place nearby.
    pub(super) flat: Vec3,
    /// Length of each segment on the flat panel, mm.
    pub(super) lengths: [f32; SEGMENTS],
}

impl Arc {
    /// The end of a segment, from the arc's start.
    #[inline]
    pub(super) fn end(&self, at: usize) -> Vec3 {
        Vec3::new(self.ends[0][at], self.ends[1][at], self.ends[2][at])
    }

    /// From its first end to its last.
    #[inline]
    pub(super) fn chord(&self) -> Vec3 {
        self.end(SEGMENTS) - self.end(0)
    }

    /// The sphere around it and its share of the cutoff. `near` is a place nearby.
    pub(super) fn sphere(&self, near: DVec3, cutoff: f32) -> Sphere {
        let middle = (self.start - near).as_vec3() + self.end(0).midpoint(self.end(SEGMENTS));
        Sphere { middle, reach: self.chord().length() / 2.0 + self.bulge + cutoff * self.radius }
    }
}

/// A span that becomes arcs: its cubic from its start, in single precision.
struct ArcSpan {
    start: DVec3,
    cubic: [[f32; 3]; 3],
    /// The parameter from one end of a segment to the next.
    step: f32,
    /// Where the last arc ended, from the span's start.
    last: [f32; 3],
}

impl ArcSpan {
    /// A span in `count` arcs.
    fn new(span: &Span, count: u8) -> Self {
        let [a, b, c, start] = span.cubic();
        let cubic = [a, b, c].map(|coefficient| coefficient.as_vec3().to_array());
        let step = 1.0 / (SEGMENTS as f32 * f32::from(count));
        let mut span = Self { start, cubic, step, last: [0.0; 3] };
        span.last = span.ends([0.0]).map(|[x]| x);
        span
    }

    /// The ends of segments, by coordinate.
    ///
    /// A chord lies on the inner side of its bend, by two thirds of its sagitta on average. That is
    /// the square of its length times the curvature over 12. Ends are moved outwards by as much, so
    /// that chords lie on the curve on average. So segments may be half as long again.
    #[inline]
    fn ends<const N: usize>(&self, t: [f32; N]) -> [[f32; N]; 3] {
        let outwards = self.step * self.step / 12.0;
        from_fn(|axis| {
            let [a, b, c] = [0, 1, 2].map(|power| self.cubic[power][axis]);
            t.map(|t| ((a * t + b) * t + c) * t - (6.0 * a * t + 2.0 * b) * outwards)
        })
    }

    /// The next arc's ends, the first one included, and the lengths of its segments.
    #[inline]
    fn next(&mut self, arc: u8) -> ([[f32; SEGMENTS + 1]; 3], [f32; SEGMENTS]) {
        let first = SEGMENTS as f32 * f32::from(arc) + 1.0;
        let new = self.ends::<SEGMENTS>(from_fn(|k| (first + k as f32) * self.step));
        let ends: [[f32; SEGMENTS + 1]; 3] =
            from_fn(|axis| from_fn(|k| if k == 0 { self.last[axis] } else { new[axis][k - 1] }));
        self.last = new.map(|ends| ends[SEGMENTS - 1]);
        let mut squared = [0.0; SEGMENTS];
        for ends in &ends {
            for k in 0..SEGMENTS {
                squared[k] += (ends[k + 1] - ends[k]) * (ends[k + 1] - ends[k]);
            }
        }
        (ends, squared.map(f32::sqrt))
    }
}

/// The number of arcs for a span of some length.
fn arcs_for(length: f64, radius: f64) -> u8 {
    // The cast saturates. A span that a broken drape has torn to any length gets the most.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "see above")]
    let count = (length / (ARC_RADII * radius)).ceil() as u8;
    count.clamp(1, MAX_ARCS)
}

/// How far the inner ends lie from the straight line between the outer ones, at most.
fn bulge(ends: &[[f32; SEGMENTS + 1]; 3]) -> f32 {
    let (mut along, mut squared) = ([0.0; SEGMENTS], [0.0; SEGMENTS]);
    let chord = ends.map(|ends| ends[SEGMENTS] - ends[0]);
    // A chord of length 0 makes the share 0 and not undefined.
    let over_squared = 1.0 / chord.iter().map(|x| x * x).sum::<f32>().max(f32::MIN_POSITIVE);
    for (ends, chord) in ends.iter().zip(chord) {
        for k in 0..SEGMENTS {
            along[k] += (ends[k] - ends[0]) * chord * over_squared;
        }
    }
    for (ends, chord) in ends.iter().zip(chord) {
        for k in 0..SEGMENTS {
            let apart = ends[k] - ends[0] - chord * along[k].clamp(0.0, 1.0);
            squared[k] += apart * apart;
        }
    }
    squared.into_iter().fold(0.0, f32::max).sqrt()
}

/// A strand that becomes arcs.
pub(super) struct StrandPoints<'a> {
    /// Its points on the body, mm.
    pub(super) draped: &'a [DVec3],
    /// The same points on the flat panel, mm.
    pub(super) flat: &'a [DVec3],
    /// Number and drawn radius, mm.
    pub(super) number: u32,
    pub(super) radius: f64,
}

impl StrandPoints<'_> {
    /// Gives the arcs of some spans, each on the body and, `with_flat`, the same one flat.
    ///
    /// `wanted` tells for the two ends of a span, flat, whether its arcs matter. `near` is a place
    /// on the flat panel nearby.
    pub(super) fn arcs(
        &self,
        spans: Range<usize>,
        near: DVec3,
        with_flat: bool,
        wanted: impl Fn([DVec3; 2]) -> bool,
        mut add: impl FnMut(Arc, Option<Arc>),
    ) {
        // Yarn length so far, on the body and flat.
        let mut along = [0.0; 2];
        for at in spans {
            let points = [self.draped, self.flat];
            if !wanted([self.flat[at], self.flat[at + 1]]) {
                // The chord stands for the span's length, which is a little more. Lengths along the
                // strand are compared only within a few radii, so an error far away cancels.
                along = from_fn(|k| along[k] + points[k][at].distance(points[k][at + 1]));
                continue;
            }
            let spans = points.map(|points| curve::span(points, at));
            let lengths = spans.each_ref().map(Span::length);
            let count = arcs_for(lengths[0].max(lengths[1]), self.radius);
            // A span is stretched alike in all its parts, but for some hundredths.
            let flat_share = single(lengths[1] / lengths[0].max(1e-9));
            let mut parts = spans.each_ref().map(|span| ArcSpan::new(span, count));
            for arc in 0..count {
                let middle = spans[1].at((f64::from(arc) + 0.5) / f64::from(count));
                let flat = (middle - near).as_vec3();
                let [draped_part, flat_part] = &mut parts;
                let draped = self.arc(draped_part.next(arc), &mut along[0]);
                let lengths = draped.lengths.map(|length| length * flat_share);
                let same = with_flat.then(|| {
                    let arc = self.arc(flat_part.next(arc), &mut along[1]);
                    Arc { start: flat_part.start, flat, ..arc }
                });
                add(Arc { start: draped_part.start, flat, lengths, ..draped }, same);
            }
        }
    }

    /// The arc of some ends and lengths, without a place. `along` is the yarn length so far.
    #[inline]
    fn arc(
        &self,
        (ends, lengths): ([[f32; SEGMENTS + 1]; 3], [f32; SEGMENTS]),
        along: &mut f64,
    ) -> Arc {
        let mut before = single(*along);
        *along += f64::from(lengths.iter().sum::<f32>());
        Arc {
            start: DVec3::ZERO,
            ends,
            along: lengths.map(|length| {
                before += length;
                before - length / 2.0
            }),
            bulge: bulge(&ends),
            radius: single(self.radius),
            strand: self.number,
            measured: false,
            flat: Vec3::ZERO,
            lengths,
        }
    }
}

/// A length in single precision.
#[expect(clippy::cast_possible_truncation, reason = "seven digits are enough here")]
pub(super) fn single(length: f64) -> f32 {
    length as f32
}
