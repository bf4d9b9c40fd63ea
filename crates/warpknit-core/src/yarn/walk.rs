//! The path of a yarn, walked from end to end: [`super::curve`]'s Catmull-Rom curve for whoever
//! takes all of its spans in a row, as tubes do.
//!
//! A span shares its chord, its knots and the direction at its start with the one before it, and
//! within a span everything is small, so `f32` in four lanes loses nothing: places are offsets from
//! the span's first point. Tubes of five edges take 18 ns a vertex so, 21 with
//! [`super::curve::span`].

use glam::{DVec3, Vec3A};

use super::curve::LEAST_CHORD;

/// One span: offsets from its first point, `((a t + b) t + c) t`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Span {
    a: Vec3A,
    b: Vec3A,
    c: Vec3A,
}

impl Span {
    /// The place at `t`, from the span's first point.
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

/// From a point to the next: their difference, and its knot interval.
#[derive(Clone, Copy, Debug)]
struct Chord {
    way: Vec3A,
    interval: f32,
}

impl Chord {
    #[inline]
    fn between(p: DVec3, q: DVec3) -> Self {
        let way = (q - p).as_vec3a();
        Self { way, interval: way.length().max(LEAST_CHORD).sqrt() }
    }

    /// The derivative by the knots' parameter where this chord ends and the next begins.
    #[inline]
    fn slope(&self, next: &Self) -> Vec3A {
        let (own, other) = (1.0 / self.interval, 1.0 / next.interval);
        self.way * own + next.way * other
            - (self.way + next.way) * (1.0 / (self.interval + next.interval))
    }
}

/// Walks along points, span by span.
#[derive(Debug)]
pub(super) struct Walk<'a> {
    points: &'a [DVec3],
    /// The span ahead, and the slope at its start.
    index: usize,
    ahead: Chord,
    slope: Vec3A,
}

impl<'a> Walk<'a> {
    /// At the first of two points or more.
    pub(super) fn new(points: &'a [DVec3]) -> Self {
        let ahead = Chord::between(points[0], points[1]);
        // The phantom point mirrors the second one: as far behind, the same way.
        Self { points, index: 0, ahead, slope: ahead.slope(&ahead) }
    }

    /// The next span, with its chord.
    #[inline]
    pub(super) fn next(&mut self) -> (Span, Vec3A) {
        let Chord { way, interval } = self.ahead;
        self.index += 1;
        let next = match self.points.get(self.index + 1) {
            Some(&point) => Chord::between(self.points[self.index], point),
            None => self.ahead,
        };
        let (m1, slope) = (self.slope * interval, self.ahead.slope(&next));
        let m2 = slope * interval;
        (self.ahead, self.slope) = (next, slope);
        (Span { a: m1 + m2 - 2.0 * way, b: 3.0 * way - 2.0 * m1 - m2, c: m1 }, way)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::yarn::curve;

    #[test]
    fn a_walk_goes_along_the_curve() {
        let points: Vec<_> = (0..12)
            .map(f64::from)
            .map(|i| DVec3::new(800.0 + i.sin(), 0.3 * i * i, (1.7 * i).cos()))
            .collect();
        let mut walk = Walk::new(&points);
        for index in 0..points.len() - 1 {
            let ((own, way), span) = (walk.next(), curve::span(&points, index));
            assert_eq!(way, (points[index + 1] - points[index]).as_vec3a());
            for t in [0.0, 0.25, 0.6, 1.0_f32] {
                let expected = span.at(f64::from(t)) - points[index];
                assert!(own.at(t).as_dvec3().distance(expected) < 1e-5 * f64::from(way.length()));
                assert!(
                    own.tangent(t).as_dvec3().distance(span.tangent(f64::from(t)))
                        < 1e-5 * f64::from(way.length())
                );
            }
        }
    }
}
