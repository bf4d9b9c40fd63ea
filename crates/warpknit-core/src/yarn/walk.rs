//! The path of a yarn, span after span: the curve of [`super::curve`] for callers that need all of
//! its spans in order, as tubes do.
//!
//! In: the points of a strand, mm. Out: [`LocalSpan`]s, each relative to its first point.
//!
//! A span shares its chord, its knot interval and its start slope with the span before it, so these
//! are computed once. Within a span all coordinates are small, so `f32` in four SIMD lanes is exact
//! enough. Cost: tubes of five edges take 18 ns a vertex this way, and 21 ns with
//! [`super::curve::span`].

use glam::{DVec3, Vec3A};

use super::curve::MIN_CHORD;

/// One span relative to its first point: `((a t + b) t + c) t`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LocalSpan {
    a: Vec3A,
    b: Vec3A,
    c: Vec3A,
}

impl LocalSpan {
    /// The position at `t`, relative to the first point.
    #[inline]
    pub(super) fn at(&self, t: f32) -> Vec3A {
        ((self.a * t + self.b) * t + self.c) * t
    }

    /// The derivative at `t`.
    #[inline]
    pub(super) fn tangent(&self, t: f32) -> Vec3A {
        (self.a * (3.0 * t) + self.b * 2.0) * t + self.c
    }
}

/// The vector from one point to the next, with its knot interval.
#[derive(Clone, Copy, Debug)]
struct Chord {
    vector: Vec3A,
    interval: f32,
}

impl Chord {
    #[inline]
    fn between(p: DVec3, q: DVec3) -> Self {
        // The difference is taken in 64 bits, before rounding: a garment's coordinates are some
        // thousand mm, where the resolution of `f32` is 0.0001 mm.
        let vector = (q - p).as_vec3a();
        Self { vector, interval: vector.length().max(MIN_CHORD).sqrt() }
    }

    /// The curve's derivative by its knot parameter at the point where this chord ends and `next`
    /// begins (non-uniform Catmull-Rom spline, Barry and Goldman 1988).
    #[inline]
    fn slope(&self, next: &Self) -> Vec3A {
        let (own, other) = (1.0 / self.interval, 1.0 / next.interval);
        self.vector * own + next.vector * other
            - (self.vector + next.vector) * (1.0 / (self.interval + next.interval))
    }
}

/// Gives the spans of a curve one after the other.
#[derive(Debug)]
pub(super) struct SpanCursor<'a> {
    points: &'a [DVec3],
    /// Index of the next span.
    index: usize,
    /// Chord of the next span.
    chord: Chord,
    /// Slope at its start.
    slope: Vec3A,
}

impl<'a> SpanCursor<'a> {
    /// Starts at the first of two points or more.
    pub(super) fn new(points: &'a [DVec3]) -> Self {
        let chord = Chord::between(points[0], points[1]);
        // The phantom point mirrors the second point, so the chord before the first one equals it.
        Self { points, index: 0, chord, slope: chord.slope(&chord) }
    }

    /// The next span, with its chord.
    #[inline]
    pub(super) fn next(&mut self) -> (LocalSpan, Vec3A) {
        let Chord { vector: chord, interval } = self.chord;
        self.index += 1;
        // Behind the last point the phantom point continues the last chord.
        let next = match self.points.get(self.index + 1) {
            Some(&point) => Chord::between(self.points[self.index], point),
            None => self.chord,
        };
        // Slopes are by the knot parameter. Times the interval they are by t in 0..1, as the
        // Hermite form below needs them.
        let (m1, slope) = (self.slope * interval, self.chord.slope(&next));
        let m2 = slope * interval;
        (self.chord, self.slope) = (next, slope);
        let span = LocalSpan { a: m1 + m2 - 2.0 * chord, b: 3.0 * chord - 2.0 * m1 - m2, c: m1 };
        (span, chord)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::yarn::curve;

    #[test]
    fn the_cursor_follows_the_curve() {
        let points: Vec<_> = (0..12)
            .map(f64::from)
            .map(|i| DVec3::new(800.0 + i.sin(), 0.3 * i * i, (1.7 * i).cos()))
            .collect();
        let mut cursor = SpanCursor::new(&points);
        for index in 0..points.len() - 1 {
            let ((own, chord), span) = (cursor.next(), curve::span(&points, index));
            assert_eq!(chord, (points[index + 1] - points[index]).as_vec3a());
            for t in [0.0, 0.25, 0.6, 1.0_f32] {
                let expected = span.at(f64::from(t)) - points[index];
                assert!(own.at(t).as_dvec3().distance(expected) < 1e-5 * f64::from(chord.length()));
                assert!(
                    own.tangent(t).as_dvec3().distance(span.tangent(f64::from(t)))
                        < 1e-5 * f64::from(chord.length())
                );
            }
        }
    }
}
