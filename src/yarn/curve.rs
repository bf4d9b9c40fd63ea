//! The path of a yarn: a centripetal Catmull-Rom curve through its data points.
//!
//! In: an ordered list of points, mm. Out: [`Span`]s, one cubic between each two neighbours. It is the curve that three.js draws
//! by default for a `CatmullRomCurve3` (alpha = 1/2), which the source paper's tubes follow; at both ends a phantom point mirrors
//! the first inner one. Centripetal spacing has no cusps and no loops within a span (Yuksel et al. 2011).

use glam::DVec3;

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
/// let span = warpknit::yarn::curve::span(&points, 1);
/// assert_eq!(span.at(0.0), points[1]);
/// assert!(span.at(1.0).distance(points[2]) < 1e-12);
/// ```
#[must_use]
pub fn span(points: &[DVec3], index: usize) -> Span {
    let (p1, p2) = (points[index], points[index + 1]);
    let p0 = if index == 0 { 2.0 * p1 - p2 } else { points[index - 1] };
    let p3 = points.get(index + 2).copied().unwrap_or(2.0 * p2 - p1);
    // Knot intervals: square roots of the chords. Coincident points would divide by zero, so they count as one micrometre apart.
    let interval = |p: DVec3, q: DVec3| p.distance(q).max(1e-6).sqrt();
    let (d0, d1, d2) = (interval(p0, p1), interval(p1, p2), interval(p2, p3));
    let m1 = d1 * ((p1 - p0) / d0 - (p2 - p0) / (d0 + d1) + (p2 - p1) / d1);
    let m2 = d1 * ((p2 - p1) / d1 - (p3 - p1) / (d1 + d2) + (p3 - p2) / d2);
    Span { a: 2.0 * (p1 - p2) + m1 + m2, b: 3.0 * (p2 - p1) - 2.0 * m1 - m2, c: m1, d: p1 }
}
