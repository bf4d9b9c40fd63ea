//! The path of a yarn: a centripetal Catmull-Rom curve through its data points.
//!
//! In: an ordered list of points, mm. Out: [`Span`]s, one cubic between each two neighbours. It is
//! the curve that three.js draws by default for a `CatmullRomCurve3` (alpha = 1/2), which the
//! source paper's tubes follow; at both ends a phantom point mirrors the first inner one.
//! Centripetal spacing has no cusps and no loops within a span (Yuksel et al. 2011).

use glam::DVec3;

/// Coincident points would divide by zero, so they count as one nanometre apart, mm.
pub(super) const LEAST_CHORD: f32 = 1e-6;

/// One cubic of the path: `p(t) = ((a t + b) t + c) t + d`, t in 0..1 between two data points.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    a: DVec3,
    b: DVec3,
    c: DVec3,
    d: DVec3,
}

impl Span {
    /// The position at `t`.
    #[must_use]
    pub fn at(&self, t: f64) -> DVec3 {
        ((self.a * t + self.b) * t + self.c) * t + self.d
    }

    /// The derivative at `t`: along the yarn, not of unit length.
    #[must_use]
    pub fn tangent(&self, t: f64) -> DVec3 {
        (self.a * (3.0 * t) + self.b * 2.0) * t + self.c
    }

    /// Its Bézier control points.
    #[must_use]
    pub fn bezier(&self) -> [DVec3; 4] {
        let [first, second] = [self.d, self.d + self.c / 3.0];
        [first, second, second + (self.c + self.b) / 3.0, self.a + self.b + self.c + self.d]
    }

    /// The mean of its positions by `t`.
    #[must_use]
    pub fn mean(&self) -> DVec3 {
        self.a / 4.0 + self.b / 3.0 + self.c / 2.0 + self.d
    }

    /// Its length, by Simpson's rule: within a hundredth for the bends of yarns.
    #[must_use]
    pub fn length(&self) -> f64 {
        (self.tangent(0.0).length() + 4.0 * self.tangent(0.5).length() + self.tangent(1.0).length())
            / 6.0
    }
}

/// The span from `points[index]` to `points[index + 1]`.
///
/// Cost: three square roots of distances and a few dozen multiplications.
///
/// # Panics
/// If `index + 1` is not a point.
///
/// ```
/// use glam::DVec3;
/// let points = [DVec3::ZERO, DVec3::X, DVec3::new(2.0, 1.0, 0.0)];
/// let span = warpknit_core::yarn::curve::span(&points, 1);
/// assert_eq!(span.at(0.0), points[1]);
/// assert!(span.at(1.0).distance(points[2]) < 1e-12);
/// ```
#[inline]
#[must_use]
pub fn span(points: &[DVec3], index: usize) -> Span {
    let (p1, p2) = (points[index], points[index + 1]);
    let p0 = if index == 0 { 2.0 * p1 - p2 } else { points[index - 1] };
    let p3 = points.get(index + 2).copied().unwrap_or(2.0 * p2 - p1);
    let [d0, d1, d2] = intervals(&[p0, p1, p2, p3]);
    // Divisions are dear: one a number, and a product for each coordinate.
    let (into, out) = (d1 / (d0 + d1), d1 / (d1 + d2));
    let chord = p2 - p1;
    let m1 = (p1 - p0) * (d1 / d0) - (p2 - p0) * into + chord;
    let m2 = chord - (p3 - p1) * out + (p3 - p2) * (d1 / d2);
    Span { a: m1 + m2 - 2.0 * chord, b: 3.0 * chord - 2.0 * m1 - m2, c: m1, d: p1 }
}

/// Knot intervals: square roots of the chords.
fn intervals(p: &[DVec3; 4]) -> [f64; 3] {
    std::array::from_fn(|i| p[i].distance(p[i + 1]).max(f64::from(LEAST_CHORD)).sqrt())
}

/// The same span as shares of its four points, for whoever wants to move the points so that the
/// path moves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weights {
    /// Shares of the points in the derivatives at both ends.
    m1: [f64; 4],
    m2: [f64; 4],
}

impl Weights {
    /// Shares of the four points in the position at `t`, with the knots as they were; they add up
    /// to 1.
    pub(crate) fn at(&self, t: f64) -> [f64; 4] {
        let (t2, t3) = (t * t, t * t * t);
        let (h1, h2) = (t3 - 2.0 * t2 + t, t3 - t2);
        let mut shares = std::array::from_fn(|k| h1 * self.m1[k] + h2 * self.m2[k]);
        shares[1] += 2.0 * t3 - 3.0 * t2 + 1.0;
        shares[2] += 3.0 * t2 - 2.0 * t3;
        shares
    }
}

/// The shares of four points in the span between the second and the third.
pub(crate) fn weights(points: &[DVec3; 4]) -> Weights {
    let [d0, d1, d2] = intervals(points);
    let (into, out) = (d1 / (d0 + d1), d1 / (d1 + d2));
    Weights {
        m1: [into - d1 / d0, d1 / d0 - 1.0, 1.0 - into, 0.0],
        m2: [0.0, out - 1.0, 1.0 - d1 / d2, d1 / d2 - out],
    }
}

/// Where two segments come nearest: the share of the way along each (Ericson 2005, Real-Time
/// Collision Detection, 5.1.9).
///
/// ```
/// use glam::DVec3;
/// let (x, y) = ([DVec3::ZERO, DVec3::X], [DVec3::new(0.25, -1.0, 1.0), DVec3::new(0.25, 1.0, 1.0)]);
/// assert_eq!(warpknit_core::yarn::curve::nearest_of_segments(x, y), (0.25, 0.5));
/// ```
#[must_use]
pub fn nearest_of_segments([p, q]: [DVec3; 2], [u, v]: [DVec3; 2]) -> (f64, f64) {
    let (d1, d2, r) = (q - p, v - u, p - u);
    let (a, e, f) = (d1.length_squared(), d2.length_squared(), d2.dot(r));
    if a == 0.0 || e == 0.0 {
        // A segment without length: the other one's nearest point to it.
        let share = |from: DVec3, along: DVec3, point: DVec3| {
            if along == DVec3::ZERO {
                0.0
            } else {
                ((point - from).dot(along) / along.length_squared()).clamp(0.0, 1.0)
            }
        };
        return if a == 0.0 { (0.0, share(u, d2, p)) } else { (share(p, d1, u), 0.0) };
    }
    let (b, c) = (d1.dot(d2), d1.dot(r));
    let denominator = a * e - b * b;
    let s = if denominator > 1e-14 * a * e {
        ((b * f - c * e) / denominator).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let t = (b * s + f) / e;
    if t < 0.0 {
        ((-c / a).clamp(0.0, 1.0), 0.0)
    } else if t > 1.0 {
        (((b - c) / a).clamp(0.0, 1.0), 1.0)
    } else {
        (s, t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bezier_points_give_the_span() {
        let points = [
            DVec3::ZERO,
            DVec3::new(1.0, 0.2, -0.1),
            DVec3::new(1.5, 1.3, 0.4),
            DVec3::new(0.2, 2.0, 0.0),
        ];
        let span = span(&points, 1);
        let [p, q, r, s] = span.bezier();
        for t in [0.0, 0.3, 0.8, 1.0] {
            let u = 1.0 - t;
            let at =
                p * (u * u * u) + q * (3.0 * u * u * t) + r * (3.0 * u * t * t) + s * (t * t * t);
            assert!(at.distance(span.at(t)) < 1e-12);
        }
    }

    #[test]
    fn weights_give_the_span() {
        let points = [
            DVec3::ZERO,
            DVec3::new(1.0, 0.2, -0.1),
            DVec3::new(1.5, 1.3, 0.4),
            DVec3::new(0.2, 2.0, 0.0),
        ];
        let (span, weights) = (span(&points, 1), weights(&points));
        for step in 0..=10 {
            let t = f64::from(step) / 10.0;
            let shares = weights.at(t);
            let blend: DVec3 = points.iter().zip(shares).map(|(point, share)| *point * share).sum();
            assert!(blend.distance(span.at(t)) < 1e-12);
            assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}
