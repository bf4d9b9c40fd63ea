//! Distances of straight segments in single precision, many at a time.
//!
//! In: one segment and N others. Out: the squares of their least distances. Cost: some 4 ns a pair
//! with SSE2. Not promised: more than six digits, so places should count from nearby.

use glam::Vec3;

/// Squared lengths below this count as 0, mm².
const TINY: f32 = 1e-24;

/// Squares of the least distances of one segment to N others, each by its start and its step to the
/// other end (Ericson, Real-Time Collision Detection, 2005, section 5.1.9).
///
/// Unlike [`curve::nearest_of_segments`](crate::yarn::curve::nearest_of_segments) there is no
/// branch, so N lanes go through it at a time. The place on the first segment is found again for
/// the place on the second, which changes it only where that was clamped.
// Always, so that what depends on the others alone is computed once for all segments of an arc.
#[inline(always)]
pub(super) fn squared_distances<const N: usize>(
    start: Vec3,
    step: Vec3,
    starts: [[f32; N]; 3],
    steps: [[f32; N]; 3],
) -> [f32; N] {
    // Structure of arrays: every loop runs over the segments of one quantity, which the compiler
    // vectorises. Vector by vector it would not.
    let step = step.to_array();
    let a = at_least(TINY, step.iter().map(|x| x * x).sum());
    let (mut between, mut e, mut f, mut b, mut c) =
        ([[0.0; N]; 3], [0.0; N], [0.0; N], [0.0; N], [0.0; N]);
    for axis in 0..3 {
        for k in 0..N {
            between[axis][k] = start[axis] - starts[axis][k];
            e[k] += steps[axis][k] * steps[axis][k];
            f[k] += steps[axis][k] * between[axis][k];
            b[k] += step[axis] * steps[axis][k];
            c[k] += step[axis] * between[axis][k];
        }
    }
    let over_a = 1.0 / a;
    let (mut s, mut t, mut squared) = ([0.0; N], [0.0; N], [0.0; N]);
    for k in 0..N {
        let e = at_least(TINY, e[k]);
        // a e times the squared sine of the angle between them. For parallel segments any place is
        // right, so what rounding leaves of it does no harm.
        let sine = at_least(TINY, a * e - b[k] * b[k]);
        let first = ((b[k] * f[k] - c[k] * e) / sine).clamp(0.0, 1.0);
        t[k] = ((b[k] * first + f[k]) * (1.0 / e)).clamp(0.0, 1.0);
        s[k] = ((b[k] * t[k] - c[k]) * over_a).clamp(0.0, 1.0);
    }
    for axis in 0..3 {
        for k in 0..N {
            let apart = between[axis][k] + step[axis] * s[k] - steps[axis][k] * t[k];
            squared[k] += apart * apart;
        }
    }
    squared
}

/// The larger of two numbers, neither of which is undefined: one instruction, where `f32::max` takes
/// four.
#[inline]
fn at_least(least: f32, value: f32) -> f32 {
    if value > least { value } else { least }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::yarn::curve::nearest_of_segments;

    #[test]
    fn distances_are_those_of_double_precision() {
        // Places without order, from a sequence of low discrepancy. Every tenth segment is a point,
        // and every seventh parallel to the one before.
        let place = |n: u16| {
            ((Vec3::new(0.754_877_7, 0.569_840_3, 0.430_159_7) * f32::from(n)).fract() - 0.5) * 2.0
        };
        let segments: Vec<_> = (0..300)
            .map(|n| match n {
                n if n % 10 == 0 => (place(n), Vec3::ZERO),
                n if n % 7 == 0 => (place(n), place(1009 + n - 1) * -0.5),
                n => (place(n), place(1009 + n)),
            })
            .collect();
        for pair in segments.windows(3) {
            let [(p, d), (q, e)] = [pair[0], pair[2]];
            let [found] =
                squared_distances(p, d, q.to_array().map(|x| [x]), e.to_array().map(|x| [x]));
            let ends = |start: Vec3, step: Vec3| [start, start + step].map(Vec3::as_dvec3);
            let (s, t) = nearest_of_segments(ends(p, d), ends(q, e));
            let expected =
                (p.as_dvec3() + d.as_dvec3() * s).distance(q.as_dvec3() + e.as_dvec3() * t);
            assert!((f64::from(found).sqrt() - expected).abs() < 1e-5, "{found} {expected}");
        }
    }
}
