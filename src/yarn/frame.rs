//! Frames along a yarn: which way is "up" on its surface.
//!
//! In: positions and tangents along a curve. Out: unit normals that turn as little as possible, by double reflection (Wang, Jüttler,
//! Zheng, Liu 2008, Computation of rotation minimizing frames, algorithm 1). A frame depends on the points before it on its own yarn and on
//! nothing else, so the result is the same however yarns are shared out among threads.

use glam::DVec3;

/// The component of `v` across the unit tangent, of unit length; any direction across it where `v` runs along it.
#[must_use]
pub fn across(v: DVec3, tangent: DVec3) -> DVec3 {
    (v - tangent * v.dot(tangent)).try_normalize().unwrap_or_else(|| tangent.any_orthonormal_vector())
}

/// Carries a normal from one point of the curve to the next.
///
/// `normal` and both tangents are of unit length; the result is too, and lies across `tangent_to`.
///
/// ```
/// use glam::DVec3;
/// use warpknit::yarn::frame::carry;
/// // Along a straight line nothing turns.
/// assert_eq!(carry(DVec3::Z, DVec3::ZERO, DVec3::X, DVec3::X, DVec3::X), DVec3::Z);
/// ```
#[must_use]
pub fn carry(normal: DVec3, from: DVec3, tangent_from: DVec3, to: DVec3, tangent_to: DVec3) -> DVec3 {
    let chord = to - from;
    let (normal, tangent) = match chord.length_squared() {
        0.0 => (normal, tangent_from),
        squared => {
            let reflect = |v: DVec3| v - chord * (2.0 / squared * chord.dot(v));
            (reflect(normal), reflect(tangent_from))
        }
    };
    let mirror = tangent_to - tangent;
    let normal = match mirror.length_squared() {
        0.0 => normal,
        squared => normal - mirror * (2.0 / squared * mirror.dot(normal)),
    };
    across(normal, tangent_to)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// On a helix the rotation-minimising frame turns against the Frenet frame by the torsion's integral.
    #[test]
    fn turns_by_the_torsion_on_a_helix() {
        let (radius, rise) = (2.0, 0.7);
        let speed = f64::hypot(radius, rise);
        let at = |s: f64| DVec3::new(radius * (s / speed).cos(), radius * (s / speed).sin(), rise * s / speed);
        let tangent = |s: f64| DVec3::new(-radius * (s / speed).sin(), radius * (s / speed).cos(), rise) / speed;
        let inward = |s: f64| DVec3::new(-(s / speed).cos(), -(s / speed).sin(), 0.0);
        let (length, steps) = (speed * TAU, 2000);
        let mut normal = inward(0.0);
        let s = |step: i32| length * f64::from(step) / f64::from(steps);
        for step in 0..steps {
            let (from, to) = (s(step), s(step + 1));
            normal = carry(normal, at(from), tangent(from), at(to), tangent(to));
        }
        let torsion = rise / (speed * speed) * length;
        let binormal = tangent(length).cross(inward(length));
        let turned = f64::atan2(normal.dot(binormal), normal.dot(inward(length)));
        assert!((turned + torsion).rem_euclid(TAU).min((-turned - torsion).rem_euclid(TAU)) < 1e-4);
    }
}
