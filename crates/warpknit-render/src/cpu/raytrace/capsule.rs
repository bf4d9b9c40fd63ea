//! Ray-capsule intersection. A capsule is a sphere swept along a straight axis; yarns are chains of
//! them.
//!
//! In: a ray and a capsule. Out: the distance at which the ray enters it. The test solves the
//! quadratic of the infinite cylinder, then the sphere at the nearer end if the cylinder is entered
//! beyond an end (Ericson 2005, 'Real-Time Collision Detection', section 5.3.7).
//!
//! Yarns are hundredths of a millimetre thick and the eye stands metres away. In `f32`, the
//! quadratic of such a ray would cancel all digits of the radius. So the ray's origin is first
//! moved beside the capsule. Rays that start inside a capsule do not meet it.

use glam::Vec3A;

/// Distance along a ray of unit direction to its entry into the capsule from `a` to `b`; infinite
/// where it misses.
pub(super) fn capsule(origin: Vec3A, direction: Vec3A, a: Vec3A, b: Vec3A, radius: f32) -> f32 {
    // Move the origin beside the capsule. With an origin at 4000 mm, |o|^2 - r^2 would have no
    // digit left for a radius of 0.03 mm (Haines et al. 2019, 'Precision Improvements for
    // Ray/Sphere Intersection').
    let beside = (a.midpoint(b) - origin).dot(direction);
    let from_a = (origin - a) + direction * beside;

    let ab = b - a;
    // Early out: most capsules in a leaf of the hierarchy are missed. The distance between the
    // ray's line and the axis' line is |missed| / |normal|. Comparing its square needs neither a
    // root nor a division. The factor 1.0001 covers rounding; below 1 + 1e-6 it would reject
    // grazing hits, and a larger one would only reject fewer misses early.
    let normal = direction.cross(ab);
    let missed = from_a.dot(normal);
    if missed * missed > radius * radius * 1.000_1 * normal.length_squared() {
        return f32::INFINITY;
    }
    let length = ab.length();
    let axis = if length > 0.0 { ab / length } else { Vec3A::ZERO };
    let (slope, height) = (direction.dot(axis), from_a.dot(axis));
    // Components across the axis, in which the cylinder is a circle: |apart + t across| = radius.
    let (across, apart) = (direction - axis * slope, from_a - axis * height);
    // The quadratic qa t^2 + 2 qb t + qc = 0, with half of the usual linear coefficient.
    let (qa, qb, qc) =
        (across.length_squared(), across.dot(apart), apart.length_squared() - radius * radius);
    let discriminant = qb * qb - qa * qc;
    if discriminant < 0.0 {
        return f32::INFINITY;
    }
    // A ray parallel to the axis (qa near 0) can only enter through the end that it meets first.
    let mut end = if slope > 0.0 { from_a } else { from_a - ab };
    // `qa` is the squared sine of the angle to the axis. Below about 1e-7, rounding makes the root
    // meaningless; the end's sphere gives the same entry then.
    if qa > 1e-7 {
        let t = (-qb - discriminant.sqrt()) / qa;
        let entry = height + t * slope;
        if entry >= 0.0 && entry <= length {
            return ahead(beside + t);
        }
        // The cylinder is entered beyond an end, so only the sphere there can be met.
        end = if entry < 0.0 { from_a } else { from_a - ab };
    }
    ball(end, direction, radius).map_or(f32::INFINITY, |t| ahead(beside + t))
}

/// Distance to a ball's surface, for a ray whose origin is relative to the ball's centre.
fn ball(origin: Vec3A, direction: Vec3A, radius: f32) -> Option<f32> {
    let closest = -origin.dot(direction);
    // The squared distance of the line from the centre, computed from the closest point and not as
    // b^2 - c, which cancels.
    let missed2 = (origin + direction * closest).length_squared();
    let half2 = radius * radius - missed2;
    (half2 >= 0.0).then(|| closest - half2.sqrt())
}

/// The distance if it lies ahead of the origin, else infinity.
fn ahead(distance: f32) -> f32 {
    if distance >= 0.0 { distance } else { f32::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// The same by sphere tracing in f64: steps by the distance to the capsule.
    fn by_steps(origin: DVec3, direction: DVec3, a: DVec3, b: DVec3, radius: f64) -> f64 {
        let gap = |p: DVec3| {
            let s = ((p - a).dot(b - a) / (b - a).length_squared().max(1e-30)).clamp(0.0, 1.0);
            p.distance(a + (b - a) * s) - radius
        };
        let mut t = 0.0;
        for _ in 0..2000 {
            let step = gap(origin + direction * t);
            if step < 1e-9 {
                return t;
            }
            t += step;
        }
        f64::INFINITY
    }

    #[test]
    fn capsules_agree_with_steps_in_f64_from_everywhere() {
        let ends = [
            (DVec3::ZERO, DVec3::X),
            (DVec3::new(0.3, 0.2, -0.1), DVec3::new(0.3, 0.2, -0.1)),
            (DVec3::Z, DVec3::new(0.1, -0.4, 0.2)),
        ];
        for (a, b) in ends {
            for step in 0_u8..200 {
                let angle = f64::from(step) * 0.71;
                let origin = DVec3::new(
                    angle.cos() * 3.0,
                    (angle * 1.3).sin() * 2.0 + 1.5,
                    angle.sin() * 3.0,
                );
                let aim = a.lerp(b, f64::from(step % 7) / 5.0 - 0.1)
                    + DVec3::new(0.0, f64::from(step % 5) * 0.04, 0.0);
                let direction = (aim - origin).normalize();
                let expected = by_steps(origin, direction, a, b, 0.1);
                let [o, d, p, q] = [origin, direction, a, b].map(|v| Vec3A::from(v.as_vec3()));
                let found = f64::from(capsule(o, d, p, q, 0.1));
                let grazing = expected.is_infinite() != found.is_infinite();
                assert!(
                    !grazing && (found == expected || (found - expected).abs() < 1e-5),
                    "{step}: {found} {expected}"
                );
            }
        }
    }

    #[test]
    fn rays_along_the_axis_meet_the_end() {
        let t = capsule(Vec3A::NEG_X, Vec3A::X, Vec3A::ZERO, Vec3A::X, 0.1);
        assert!((t - 0.9).abs() < 1e-6);
        let back = capsule(Vec3A::X * 3.0, Vec3A::NEG_X, Vec3A::ZERO, Vec3A::X, 0.1);
        assert!((back - 1.9).abs() < 1e-6);
    }

    #[test]
    fn a_thin_yarn_is_hit_exactly_from_metres_away() {
        for offset in [0.0_f32, 0.01, 0.025, 0.0299] {
            let t =
                capsule(Vec3A::new(0.2, offset, 4000.0), Vec3A::NEG_Z, Vec3A::ZERO, Vec3A::X, 0.03);
            let expected = 4000.0 - (0.03_f64.powi(2) - f64::from(offset).powi(2)).sqrt();
            assert!(
                (f64::from(t) - expected).abs() < 3e-4,
                "half a unit in the last place of 4000 is 1.2e-4: {t}"
            );
        }
        assert!(
            capsule(Vec3A::new(0.2, 0.0301, 4000.0), Vec3A::NEG_Z, Vec3A::ZERO, Vec3A::X, 0.03)
                .is_infinite()
        );
    }
}
