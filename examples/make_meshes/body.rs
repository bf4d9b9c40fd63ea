//! The body under the garment as a signed distance field.
//!
//! In: round cones (two spheres and their convex hull), blended into one another, and optionally a
//! table top. Out: at any point the distance in cm (negative inside), the outward unit normal, and
//! the displacement of the surface in the last step, which friction needs. Also rings: closed
//! curves around the body at a given height and of a given girth, around which a panel is wrapped
//! before the simulation starts.
//!
//! Method: the nearest sphere of a round cone in closed form (derived below), and the polynomial
//! smooth minimum of Quilez 2013, "Smooth minimum", whose gradient is the same blend of the two
//! gradients. Cost: linear in the number of round cones.
//!
//! Not promised: the distance is exact only where one round cone is clearly nearest. In a blend it
//! is a little short, so that the body is a little fuller there.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

/// The convex hull of a sphere at `a` and one at `b`. `drift_*` is the displacement of each centre
/// in the last step.
#[derive(Clone, Copy)]
pub(crate) struct RoundCone {
    a: DVec3,
    b: DVec3,
    radius_a: f64,
    radius_b: f64,
    drift_a: DVec3,
    drift_b: DVec3,
}

/// The body near a point: signed distance, normal, and displacement in the last step.
#[derive(Clone, Copy)]
pub(crate) struct Touch {
    pub(crate) distance: f64,
    pub(crate) normal: DVec3,
    pub(crate) drift: DVec3,
}

impl RoundCone {
    pub(crate) fn new(a: DVec3, radius_a: f64, b: DVec3, radius_b: f64) -> Self {
        Self { a, b, radius_a, radius_b, drift_a: DVec3::ZERO, drift_b: DVec3::ZERO }
    }

    /// The round cone mirrored at the plane x = 0.
    pub(crate) fn mirrored(self) -> Self {
        let flip = DVec3::new(-1.0, 1.0, 1.0);
        Self::new(self.a * flip, self.radius_a, self.b * flip, self.radius_b)
    }

    /// The round cone near a point. The hull is the union of spheres centred at a + t (b - a) with
    /// radii between the two. The distance to the sphere t is convex in t. Its minimum satisfies
    /// `y - t l = x tan(alpha)`, where (x, y) is the point across and along the axis, l the length
    /// of the axis, and `sin(alpha) = (radius_a - radius_b) / l`. Clamping t gives the end spheres.
    fn touch(&self, point: DVec3) -> Touch {
        let axis = self.b - self.a;
        let length = axis.length();
        let direction = axis / length;
        let offset = point - self.a;
        let along = offset.dot(direction);
        let across = (offset - along * direction).length();
        let sine = (self.radius_a - self.radius_b) / length;
        let tangent = sine / (1.0 - sine * sine).sqrt();
        let t = ((along - across * tangent) / length).clamp(0.0, 1.0);
        let from_centre = point - (self.a + t * axis);
        let radius = self.radius_a + t * (self.radius_b - self.radius_a);
        Touch {
            distance: from_centre.length() - radius,
            normal: from_centre.normalize_or(DVec3::Y),
            drift: self.drift_a.lerp(self.drift_b, t),
        }
    }
}

/// Round cones blended over `blend` cm, and a table top at the height `table` if there is one.
#[derive(Clone, Default)]
pub(crate) struct Body {
    pub(crate) shapes: Vec<RoundCone>,
    pub(crate) blend: f64,
    pub(crate) table: Option<f64>,
}

impl Body {
    /// The body near a point.
    pub(crate) fn touch(&self, point: DVec3) -> Touch {
        let far = Touch { distance: f64::INFINITY, normal: DVec3::Y, drift: DVec3::ZERO };
        let table = self.table.map_or(far, |height| Touch { distance: point.y - height, ..far });
        self.shapes.iter().map(|shape| shape.touch(point)).fold(table, |a, b| self.union(a, b))
    }

    /// The smooth union of two shapes.
    fn union(&self, a: Touch, b: Touch) -> Touch {
        let (near, other) = if a.distance <= b.distance { (a, b) } else { (b, a) };
        let gap = other.distance - near.distance;
        if gap >= self.blend {
            return near;
        }
        // Quilez's quadratic polynomial: mix(d2, d1, h) - k h (1 - h) with h from 1/2, at equal
        // distances, to 1.
        let weight = 0.5 + 0.5 * gap / self.blend;
        let distance = near.distance + (1.0 - weight) * gap - self.blend * weight * (1.0 - weight);
        let normal =
            (near.normal * weight + other.normal * (1.0 - weight)).normalize_or(near.normal);
        Touch { distance, normal, drift: near.drift }
    }

    /// Sets the displacement of each round cone since `earlier`, the same body one step before.
    pub(crate) fn moved_from(mut self, earlier: &Self) -> Self {
        for (now, before) in self.shapes.iter_mut().zip(&earlier.shapes) {
            now.drift_a = now.a - before.a;
            now.drift_b = now.b - before.b;
        }
        self
    }

    /// An upper bound of the displacement of all points of the surface in the last step.
    pub(crate) fn farthest_drift(&self) -> f64 {
        self.shapes
            .iter()
            .map(|shape| shape.drift_a.length().max(shape.drift_b.length()))
            .fold(0.0, f64::max)
    }

    /// The closed curve of length `girth` around the body at a height: a contour of the distance,
    /// whose clearance is found by bisection.
    pub(crate) fn ring(&self, height: f64, girth: f64) -> Ring {
        let (mut low, mut high) = (-10.0, 60.0);
        for _ in 0..40 {
            let clearance = 0.5 * (low + high);
            if Ring::around(self, height, clearance).girth() < girth {
                low = clearance;
            } else {
                high = clearance;
            }
        }
        Ring::around(self, height, 0.5 * (low + high))
    }
}

/// A closed horizontal curve around the y axis. It starts in front (+z) and runs past the wearer's
/// left (+x) to the back.
pub(crate) struct Ring {
    points: Vec<DVec2>,
    /// Arc length up to each point; one longer than `points`.
    lengths: Vec<f64>,
}

impl Ring {
    const STEPS: u32 = 360;

    /// Finds the contour by sphere tracing inwards along rays in the plane (Hart 1996, "Sphere
    /// tracing"), until the body is `clearance` away.
    fn around(body: &Body, height: f64, clearance: f64) -> Self {
        let ray = |step: u32| {
            let (x, z) = (TAU * f64::from(step) / f64::from(Self::STEPS)).sin_cos();
            let mut radius = 100.0;
            for _ in 0..60 {
                radius -=
                    body.touch(DVec3::new(radius * x, height, radius * z)).distance - clearance;
            }
            DVec2::new(x, z) * radius.max(0.1)
        };
        Self::through((0..Self::STEPS).map(ray).collect())
    }

    /// A circle about the y axis.
    pub(crate) fn circle(girth: f64) -> Self {
        let point = |step| {
            DVec2::from(f64::sin_cos(TAU * f64::from(step) / f64::from(Self::STEPS))) * girth / TAU
        };
        Self::through((0..Self::STEPS).map(point).collect())
    }

    /// The curve through points.
    fn through(points: Vec<DVec2>) -> Self {
        let mut lengths = vec![0.0];
        for (index, point) in points.iter().enumerate() {
            let next = points[(index + 1) % points.len()];
            lengths.push(lengths[index] + point.distance(next));
        }
        Self { points, lengths }
    }

    /// The length of the curve.
    pub(crate) fn girth(&self) -> f64 {
        self.lengths[self.points.len()]
    }

    /// The point (x, z) at `turn` of the curve's length; whole turns make no difference.
    pub(crate) fn at(&self, turn: f64) -> DVec2 {
        let arc = turn.rem_euclid(1.0) * self.girth();
        let step =
            self.lengths.partition_point(|&length| length <= arc).clamp(1, self.points.len()) - 1;
        let part = (arc - self.lengths[step]) / (self.lengths[step + 1] - self.lengths[step]);
        self.points[step].lerp(self.points[(step + 1) % self.points.len()], part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body() -> Body {
        let cone = RoundCone::new(DVec3::new(3.0, 0.0, 0.0), 9.0, DVec3::new(5.0, -20.0, 0.0), 6.0);
        Body { shapes: vec![cone, cone.mirrored()], blend: 3.0, table: None }
    }

    #[test]
    fn a_round_cones_distance_grows_by_one_a_unit_along_the_normal() {
        let cone = body().shapes[0];
        for index in 0..200 {
            let turn = f64::from(index);
            let point =
                DVec3::new(17.0 * turn.sin(), 0.25 * turn - 40.0, 19.0 * (1.7 * turn).cos());
            let here = cone.touch(point);
            let there = cone.touch(point + 0.5 * here.normal);
            assert!((there.distance - here.distance - 0.5).abs() < 1e-9, "at {point}");
            let side = here.normal.any_orthonormal_vector();
            let slope =
                cone.touch(point + 1e-5 * side).distance - cone.touch(point - 1e-5 * side).distance;
            assert!(slope.abs() < 1e-9, "at {point}");
        }
    }

    #[test]
    fn a_sphere_end_is_at_its_radius() {
        let cone = RoundCone::new(DVec3::ZERO, 2.0, DVec3::new(0.0, 10.0, 0.0), 1.0);
        assert!((cone.touch(DVec3::new(0.0, -5.0, 0.0)).distance - 3.0).abs() < 1e-12);
        assert!((cone.touch(DVec3::new(0.0, 14.0, 0.0)).distance - 3.0).abs() < 1e-12);
    }

    #[test]
    fn a_ring_has_the_girth_asked_for_and_starts_in_front() {
        let ring = body().ring(-10.0, 80.0);
        assert!((ring.girth() - 80.0).abs() < 1e-6);
        assert!(ring.at(0.0).x.abs() < 1e-9 && ring.at(0.0).y > 5.0);
        assert!(ring.at(0.25).x > 5.0 && ring.at(1.25).distance(ring.at(0.25)) < 1e-9);
    }
}
