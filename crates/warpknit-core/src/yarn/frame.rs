//! Frames along a yarn: which way is "up" on its surface.
//!
//! In: positions and tangents along a curve. Out: unit normals that turn as little as possible, by
//! double reflection (Wang, Jüttler, Zheng, Liu 2008, Computation of rotation minimizing frames,
//! algorithm 1). A frame depends on the points before it on its own yarn and on nothing else, so
//! the result is the same however yarns are shared out among threads.
//!
//! Directions are `f32`, four lanes at a time: a ring turns by a rounding of 1e-7, which adds up to
//! nothing that is seen.

use glam::Vec3A;

/// The component of `v` across the unit tangent, of unit length; any direction across it where `v`
/// runs along it.
#[inline]
#[must_use]
pub fn across(v: Vec3A, tangent: Vec3A) -> Vec3A {
    (v - tangent * v.dot(tangent))
        .try_normalize()
        .unwrap_or_else(|| tangent.any_orthonormal_vector())
}

/// Carries a normal over a chord of the curve, from where the tangent is `from` to where it is
/// `to`.
///
/// `normal` and both tangents are of unit length; the result is too, and lies across `to`.
///
/// ```
/// use glam::Vec3A;
/// use warpknit_core::yarn::frame::carry;
/// // Along a straight line nothing turns.
/// assert_eq!(carry(Vec3A::Z, Vec3A::X, Vec3A::X, Vec3A::X), Vec3A::Z);
/// ```
#[inline]
#[must_use]
pub fn carry(normal: Vec3A, chord: Vec3A, from: Vec3A, to: Vec3A) -> Vec3A {
    let (normal, tangent) = match chord.length_squared() {
        0.0 => (normal, from),
        squared => {
            let twice = chord * (2.0 / squared);
            (normal - twice * chord.dot(normal), from - twice * chord.dot(from))
        }
    };
    let mirror = to - tangent;
    let normal = match mirror.length_squared() {
        0.0 => normal,
        squared => normal - mirror * (2.0 / squared * mirror.dot(normal)),
    };
    // Reflections keep lengths and angles: only rounding is to be mended, for which a step of
    // Newton's takes the place of a root and a division.
    let upright = normal - to * normal.dot(to);
    let squared = upright.length_squared();
    // A mirror of rounding alone, where the chord lies across equal tangents, is none: there the
    // normal is set up anew.
    if (0.8..1.25).contains(&squared) {
        upright * (1.5 - 0.5 * squared)
    } else {
        across(normal, to)
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
            normal = carry(normal, chord, from, to);
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
            normal = carry(
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
