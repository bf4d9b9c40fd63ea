//! SplatPieces of tube: capsules, spheres swept along straight axes.
//!
//! In: a ray and a capsule. Out: where the ray enters it. Yarns are hundredths of a millimetre
//! thick and eyes metres away, so a ray is moved beside the capsule before the quadratic is solved.
//! Rays that start inside a capsule don't see it.

use glam::Vec3A;

/// Distance along a ray of unit direction to where it enters the capsule from `a` to `b`; infinite
/// where it doesn't.
pub(super) fn capsule(origin: Vec3A, direction: Vec3A, a: Vec3A, b: Vec3A, radius: f32) -> f32 {
    // Start beside the capsule: what is left of the origin's distance would eat the radius' digits.
    let beside = (a.midpoint(b) - origin).dot(direction);
    let from_a = (origin - a) + direction * beside;

    let ab = b - a;
    // Most capsules of a box that is met are missed, and a line that passes the axis too far away
    // tells it without a root.
    let normal = direction.cross(ab);
    let missed = from_a.dot(normal);
    if missed * missed > radius * radius * 1.000_1 * normal.length_squared() {
        return f32::INFINITY;
    }
    let length = ab.length();
    let axis = if length > 0.0 { ab / length } else { Vec3A::ZERO };
    let (slope, height) = (direction.dot(axis), from_a.dot(axis));
    let (across, apart) = (direction - axis * slope, from_a - axis * height);
    // The infinite cylinder: |apart + t across| = radius.
    let (qa, qb, qc) =
        (across.length_squared(), across.dot(apart), apart.length_squared() - radius * radius);
    let discriminant = qb * qb - qa * qc;
    if discriminant < 0.0 {
        return f32::INFINITY;
    }
    let mut end = if slope > 0.0 { from_a } else { from_a - ab };
    if qa > 1e-7 {
        let t = (-qb - discriminant.sqrt()) / qa;
        let entry = height + t * slope;
        if entry >= 0.0 && entry <= length {
            return ahead(beside + t);
        }
        end = if entry < 0.0 { from_a } else { from_a - ab };
    }
    ball(end, direction, radius).map_or(f32::INFINITY, |t| ahead(beside + t))
}

/// Where a ray from `origin`, relative to the ball's middle, enters the ball.
fn ball(origin: Vec3A, direction: Vec3A, radius: f32) -> Option<f32> {
    let closest = -origin.dot(direction);
    let missed2 = (origin + direction * closest).length_squared();
    let half2 = radius * radius - missed2;
    (half2 >= 0.0).then(|| closest - half2.sqrt())
}

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
