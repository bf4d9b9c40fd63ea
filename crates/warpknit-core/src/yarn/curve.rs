//! The path of a yarn: a centripetal Catmull-Rom curve through its data points.
//!
//! In: an ordered list of points, mm. Out: [`Span`]s, one cubic between each two neighbours.
//!
//! Method: Catmull and Rom, A class of local interpolating splines, 1974, in the non-uniform form
//! of Barry and Goldman, A recursive evaluation algorithm for a class of Catmull-Rom splines, 1988.
//! Knot intervals are square roots of chord lengths (alpha = 1/2). This spacing has no cusps and no
//! self-intersections within a span (Yuksel, Schaefer and Keyser, Parameterization and applications
//! of Catmull-Rom curves, 2011). three.js draws the same curve by default for a `CatmullRomCurve3`,
//! and the tubes of the source paper follow it. At both ends a phantom point mirrors the first
//! inner one.
//!
//! Cost: constant for each span. A span depends on four points, so a moved point changes four
//! spans.
//!
//! Not promised: continuous curvature. Spans join with a common tangent direction only (G1).

use glam::DVec3;

/// Shortest chord, mm: coincident points count as one nanometre apart. With a length of 0 the
/// slopes would divide by zero.
pub(super) const MIN_CHORD: f32 = 1e-6;

/// Below this squared sine of the angle between two segments they count as parallel. It lies some
/// twenty times above the rounding of `a e - b²` in 64-bit floats. A smaller limit would divide
/// rounding by rounding; a larger one would call crossing segments parallel.
const PARALLEL: f64 = 1e-14;

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

    /// The derivative at `t`. It points along the yarn and is not normalised.
    #[must_use]
    pub fn tangent(&self, t: f64) -> DVec3 {
        (self.a * (3.0 * t) + self.b * 2.0) * t + self.c
    }

    /// The coefficients of the cubic, from that of `t³` to the constant.
    pub(crate) fn cubic(&self) -> [DVec3; 4] {
        [self.a, self.b, self.c, self.d]
    }

    /// The Bézier control points of the same cubic.
    #[must_use]
    pub fn bezier(&self) -> [DVec3; 4] {
        let [first, second] = [self.d, self.d + self.c / 3.0];
        [first, second, second + (self.c + self.b) / 3.0, self.a + self.b + self.c + self.d]
    }

    /// The mean position over the parameter `t`: the integral of the cubic over 0..1.
    #[must_use]
    pub fn mean(&self) -> DVec3 {
        self.a / 4.0 + self.b / 3.0 + self.c / 2.0 + self.d
    }

    /// The arc length, by Simpson's rule with three evaluations. The error is below 1 % for the
    /// bends of yarns.
    #[inline]
    #[must_use]
    pub fn length(&self) -> f64 {
        self.length_to(1.0)
    }

    /// The arc length from the start to `t`, by the same rule.
    #[inline]
    #[must_use]
    pub fn length_to(&self, t: f64) -> f64 {
        let [start, middle, end] = [0.0, 0.5 * t, t].map(|t| self.tangent(t).length());
        (start + 4.0 * middle + end) * t / 6.0
    }

    /// The arc length, by Gauss and Legendre's rule with five evaluations. On a stitch's bends the
    /// error is below 1e-6: masses that users compare with a mill's need that.
    #[must_use]
    pub fn precise_length(&self) -> f64 {
        // Nodes and weights of the five-point rule on 0..1.
        const NODES: [(f64, f64); 5] = [
            (0.046_910_077_030_668, 0.118_463_442_528_094_5),
            (0.230_765_344_947_158_5, 0.239_314_335_249_683_2),
            (0.5, 0.284_444_444_444_444_4),
            (0.769_234_655_052_841_5, 0.239_314_335_249_683_2),
            (0.953_089_922_969_332, 0.118_463_442_528_094_5),
        ];
        NODES.iter().map(|(t, weight)| weight * self.tangent(*t).length()).sum()
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
    let control = control(points, index);
    span_with(&control, knot_intervals(&control))
}

/// All spans of a path, in order: the same as of [`span`], bit by bit.
///
/// Cost: one square root of a distance and a few dozen multiplications a span. The other two knot
/// intervals are those of the span before.
pub fn spans(points: &[DVec3]) -> impl Iterator<Item = Span> + '_ {
    let mut last: Option<[f64; 3]> = None;
    (0..points.len().saturating_sub(1)).map(move |index| {
        let control = control(points, index);
        let intervals = match last {
            Some([_, d0, d1]) => [d0, d1, knot_interval(control[2], control[3])],
            None => knot_intervals(&control),
        };
        last = Some(intervals);
        span_with(&control, intervals)
    })
}

/// The four points of a span. A phantom point mirrors the inner neighbour, so that the end spans
/// have four points as well and leave the end along the first chord.
#[inline]
fn control(points: &[DVec3], index: usize) -> [DVec3; 4] {
    let (p1, p2) = (points[index], points[index + 1]);
    let p0 = if index == 0 { 2.0 * p1 - p2 } else { points[index - 1] };
    let p3 = points.get(index + 2).copied().unwrap_or(2.0 * p2 - p1);
    [p0, p1, p2, p3]
}

/// The span between the second and the third of four points with these knot intervals.
#[inline]
fn span_with(&[p0, p1, p2, p3]: &[DVec3; 4], [d0, d1, d2]: [f64; 3]) -> Span {
    // The slopes at p1 and p2 are those of Barry and Goldman's non-uniform Catmull-Rom spline,
    // scaled by d1 so that t runs over 0..1 instead of over the knot interval.
    // Each division is done once for all three coordinates, since divisions cost most here.
    let (into, out) = (d1 / (d0 + d1), d1 / (d1 + d2));
    let chord = p2 - p1;
    let m1 = (p1 - p0) * (d1 / d0) - (p2 - p0) * into + chord;
    let m2 = chord - (p3 - p1) * out + (p3 - p2) * (d1 / d2);
    // The cubic Hermite form of p1, p2, m1 and m2, sorted by powers of t.
    Span { a: m1 + m2 - 2.0 * chord, b: 3.0 * chord - 2.0 * m1 - m2, c: m1, d: p1 }
}

/// Centripetal knot intervals: square roots of the chord lengths.
#[inline]
fn knot_intervals(p: &[DVec3; 4]) -> [f64; 3] {
    std::array::from_fn(|i| knot_interval(p[i], p[i + 1]))
}

#[inline]
fn knot_interval(from: DVec3, to: DVec3) -> f64 {
    from.distance(to).max(f64::from(MIN_CHORD)).sqrt()
}

/// A span as weights of its four points. A solver uses it to move the points so that a place of the
/// path moves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weights {
    /// Weights of the points in the derivative at the start of the span.
    m1: [f64; 4],
    /// Weights of the points in the derivative at its end.
    m2: [f64; 4],
}

impl Weights {
    /// Weights of the four points in the position at `t`. They add up to 1. The knots are taken as
    /// constant.
    pub(crate) fn at(&self, t: f64) -> [f64; 4] {
        let (t2, t3) = (t * t, t * t * t);
        // h1 and h2 are the Hermite basis functions of the two slopes. Those of the two end points
        // are added below.
        let (h1, h2) = (t3 - 2.0 * t2 + t, t3 - t2);
        let mut weights = std::array::from_fn(|k| h1 * self.m1[k] + h2 * self.m2[k]);
        weights[1] += 2.0 * t3 - 3.0 * t2 + 1.0;
        weights[2] += 3.0 * t2 - 2.0 * t3;
        weights
    }

    /// Weights of the four points in the first and in the second derivative at `t`.
    pub(crate) fn derivatives(&self, t: f64) -> [[f64; 4]; 2] {
        let [h1, h2] = [3.0 * t * t - 4.0 * t + 1.0, 3.0 * t * t - 2.0 * t];
        let mut first = std::array::from_fn(|k| h1 * self.m1[k] + h2 * self.m2[k]);
        first[1] += 6.0 * t * (t - 1.0);
        first[2] -= 6.0 * t * (t - 1.0);
        let [h1, h2] = [6.0 * t - 4.0, 6.0 * t - 2.0];
        let mut second = std::array::from_fn(|k| h1 * self.m1[k] + h2 * self.m2[k]);
        second[1] += 12.0 * t - 6.0;
        second[2] -= 12.0 * t - 6.0;
        [first, second]
    }
}

/// The weights of four points in the span between the second and the third.
pub(crate) fn weights(points: &[DVec3; 4]) -> Weights {
    // The formulas of `span` for m1 and m2, with the factors of each point collected.
    let [d0, d1, d2] = knot_intervals(points);
    let (into, out) = (d1 / (d0 + d1), d1 / (d1 + d2));
    Weights {
        m1: [into - d1 / d0, d1 / d0 - 1.0, 1.0 - into, 0.0],
        m2: [0.0, out - 1.0, 1.0 - d1 / d2, d1 / d2 - out],
    }
}

/// The closest points of two segments, as parameters in 0..1 along each (Ericson, Real-Time
/// Collision Detection, 2005, section 5.1.9).
///
/// For parallel segments it is one of many closest pairs.
///
/// ```
/// use glam::DVec3;
/// let x = [DVec3::ZERO, DVec3::X];
/// let y = [DVec3::new(0.25, -1.0, 1.0), DVec3::new(0.25, 1.0, 1.0)];
/// assert_eq!(warpknit_core::yarn::curve::nearest_of_segments(x, y), (0.25, 0.5));
/// ```
#[inline]
#[must_use]
pub fn nearest_of_segments([p, q]: [DVec3; 2], [u, v]: [DVec3; 2]) -> (f64, f64) {
    // Ericson's names: d1 and d2 are the segments' directions, r joins their starts.
    let (d1, d2, r) = (q - p, v - u, p - u);
    let (a, e, f) = (d1.length_squared(), d2.length_squared(), d2.dot(r));
    // A segment of length 0 is a point, and the general case would divide by its length.
    if a == 0.0 {
        return (0.0, nearest_on_segment(u, d2, p));
    }
    if e == 0.0 {
        return (nearest_on_segment(p, d1, u), 0.0);
    }
    let (b, c) = (d1.dot(d2), d1.dot(r));
    // a e - b² is a e times the squared sine of the angle between the segments.
    let denominator = a * e - b * b;
    let s = if denominator > PARALLEL * a * e {
        ((b * f - c * e) / denominator).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let t = (b * s + f) / e;
    // Where t leaves its segment it is clamped, and s is found anew for the clamped t. Without that
    // the pair would not be the closest one.
    if t < 0.0 {
        ((-c / a).clamp(0.0, 1.0), 0.0)
    } else if t > 1.0 {
        (((b - c) / a).clamp(0.0, 1.0), 1.0)
    } else {
        (s, t)
    }
}

/// The parameter, in 0..1, of the point nearest to `point` on the segment from `start` along
/// `direction`.
pub(crate) fn nearest_on_segment(start: DVec3, direction: DVec3, point: DVec3) -> f64 {
    if direction == DVec3::ZERO {
        return 0.0;
    }
    ((point - start).dot(direction) / direction.length_squared()).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_spans_of_a_path_are_those_one_by_one() {
        for count in [0, 1, 2, 3, 9] {
            let place = |at: f64| DVec3::new(at, (3.7 * at).sin(), 0.1 * at * at);
            let mut points: Vec<_> = (0..count).map(|at| place(f64::from(at))).collect();
            // Two points in one place.
            points.extend(points.last().copied());
            let all: Vec<_> = spans(&points).map(|span| span.cubic()).collect();
            let each = (0..points.len().saturating_sub(1)).map(|at| span(&points, at).cubic());
            assert_eq!(all, each.collect::<Vec<_>>());
        }
    }

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
