//! Frames along a yarn: the direction that counts as "up" on its surface.
//!
//! In: positions and unit tangents along a curve. Out: unit normals of a rotation-minimising frame.
//!
//! Method: double reflection (Wang, Jüttler, Zheng and Liu, Computation of rotation minimizing
//! frames, 2008, algorithm 1). Its error over a whole curve falls with the fourth power of the
//! step. A Frenet frame would not do: it is undefined on straight parts and flips at inflections.
//!
//! A frame depends on the points before it on its own yarn and on nothing else. So the result is
//! the same for any number of threads. Directions are `f32` in four SIMD lanes: each ring turns by
//! a rounding error of 1e-7 rad, which does not add up to anything visible.
//!
//! Cost: two reflections a ring, without a square root. Not promised: closed curves whose first and
//! last frame agree.

use glam::Vec3A;

/// The component of `v` perpendicular to the unit tangent, normalised. Where `v` is parallel to the
/// tangent it is any perpendicular direction.
#[inline]
#[must_use]
pub fn perpendicular_unit(v: Vec3A, tangent: Vec3A) -> Vec3A {
    (v - tangent * v.dot(tangent))
        .try_normalize()
        .unwrap_or_else(|| tangent.any_orthonormal_vector())
}

/// Carries a normal along one chord of the curve with the least rotation. `from` and `to` are the
/// tangents at the start and the end of the chord.
///
/// `normal` and both tangents are of unit length. The result is of unit length and perpendicular to
/// `to`.
///
/// ```
/// use glam::Vec3A;
/// use warpknit_core::yarn::frame::double_reflection;
/// // Along a straight line nothing turns.
/// assert_eq!(double_reflection(Vec3A::Z, Vec3A::X, Vec3A::X, Vec3A::X), Vec3A::Z);
/// ```
#[inline]
#[must_use]
pub fn double_reflection(normal: Vec3A, chord: Vec3A, from: Vec3A, to: Vec3A) -> Vec3A {
    // First reflection (Wang et al. 2008, algorithm 1, steps 1 to 3): in the plane that bisects the
    // chord. It brings the frame to the end of the chord. Coincident points need none.
    let (normal, tangent) = match chord.length_squared() {
        0.0 => (normal, from),
        squared => {
            let twice = chord * (2.0 / squared);
            (normal - twice * chord.dot(normal), from - twice * chord.dot(from))
        }
    };
    // Second reflection (steps 4 to 6): in the plane that maps the reflected tangent to the true
    // one. Two reflections make a rotation.
    let mirror = to - tangent;
    let normal = match mirror.length_squared() {
        0.0 => normal,
        squared => normal - mirror * (2.0 / squared * mirror.dot(normal)),
    };
    // Reflections keep lengths and angles, so only rounding has to be corrected. Without this step
    // the errors would add up over the thousands of rings of a yarn. One Newton step for the
    // inverse square root, x (1.5 - 0.5 |x|²), replaces a root and a division.
    let upright = normal - to * normal.dot(to);
    let squared = upright.length_squared();
    // Where the chord is perpendicular to two equal tangents, `mirror` consists of rounding errors
    // and the second reflection points anywhere. There the squared length is far from 1, and the
    // normal is normalised in full. From 0.8 to 1.25 the Newton step leaves an error of about 2 %;
    // a wider range would keep bad lengths, a narrower one would only take the slow way more often.
    if (0.8..1.25).contains(&squared) {
        upright * (1.5 - 0.5 * squared)
    } else {
        perpendicular_unit(normal, to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use std::f64::consts::TAU;

    #[test]
    fn a_normal_stays_of_unit_length_and_upright_however_long_the_yarn_and_wherever_chords_point() {
        let mut normal = Vec3A::Z;
        let mut worst = 0.0_f32;
        let mut from = Vec3A::X;
        for step in 0..100_000_u32 {
            let angle = |k: u32| (k % 977) as f32 * 0.37;
            // Now and then a chord straight across two equal tangents.
            let to = if step % 5 == 0 {
                from
            } else {
                Vec3A::new(angle(step).cos(), angle(step).sin(), 0.3).normalize()
            };
            let chord =
                if step % 5 == 0 { from.any_orthonormal_vector() * 0.7 } else { (from + to) * 0.1 };
            normal = double_reflection(normal, chord, from, to);
            worst = worst.max((normal.length() - 1.0).abs()).max(normal.dot(to).abs());
            from = to;
        }
        assert!(worst < 0.02, "{worst}");
    }

    /// On a helix the rotation-minimising frame turns against the Frenet frame by the torsion's
    /// integral.
    #[test]
    fn turns_by_the_torsion_on_a_helix() {
        let (radius, rise) = (2.0, 0.7);
        let speed = f64::hypot(radius, rise);
        let at = |s: f64| {
            DVec3::new(radius * (s / speed).cos(), radius * (s / speed).sin(), rise * s / speed)
        };
        let tangent = |s: f64| {
            DVec3::new(-radius * (s / speed).sin(), radius * (s / speed).cos(), rise) / speed
        };
        let inward = |s: f64| DVec3::new(-(s / speed).cos(), -(s / speed).sin(), 0.0);
        let (length, steps) = (speed * TAU, 2000);
        let mut normal = inward(0.0).as_vec3a();
        let s = |step: i32| length * f64::from(step) / f64::from(steps);
        for step in 0..steps {
            let (from, to) = (s(step), s(step + 1));
            normal = double_reflection(
                normal,
                (at(to) - at(from)).as_vec3a(),
                tangent(from).as_vec3a(),
                tangent(to).as_vec3a(),
            );
        }
        let normal = normal.as_dvec3();
        let torsion = rise / (speed * speed) * length;
        let binormal = tangent(length).cross(inward(length));
        let turned = f64::atan2(normal.dot(binormal), normal.dot(inward(length)));
        assert!((turned + torsion).rem_euclid(TAU).min((-turned - torsion).rem_euclid(TAU)) < 1e-4);
    }
}
