//! Ray-ribbon intersection. A ribbon is a chain of strips, flat pieces between two points of the
//! yarn's axis.
//!
//! In: the ends of a strip, each from edge to edge across the yarn. Out: the point where a ray
//! crosses it. A strip shares its corners with the strips before and after it, and two triangles
//! fill it. So no light leaks between strips:
//!
//! ```text
//!   u = 0   a0 ────── b0     v = 0 at a, 1 at b, along the yarn;
//!            │   ╱    │      u from edge to edge, along tangent x normal
//!   u = 1   a1 ────── b1
//! ```
//!
//! Triangles are met from both sides (Möller and Trumbore 1997, 'Fast, minimum storage ray/triangle
//! intersection').

use glam::Vec3A;

/// Tolerance of the barycentric coordinates: triangles extend this fraction of their sides beyond
/// their edges. With 0, rounding opens cracks along shared edges. Much larger ones let triangles
/// stick out at a ribbon's outer edges.
const EDGE_TOLERANCE: f32 = 1e-5;

/// A strip, by its corners.
#[derive(Clone, Copy, Debug)]
pub(super) struct RibbonStrip {
    /// The start, at u = 0 and u = 1.
    pub(super) a: [Vec3A; 2],
    /// The end, likewise.
    pub(super) b: [Vec3A; 2],
}

/// The point where a ray crosses a strip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crossing {
    /// Distance along the ray, whose direction has unit length.
    pub(super) distance: f32,
    pub(super) u: f32,
    pub(super) v: f32,
}

impl RibbonStrip {
    /// The nearest crossing of the ray with the strip, from either side.
    pub(super) fn crossing(&self, origin: Vec3A, direction: Vec3A) -> Option<Crossing> {
        let ([a0, a1], [b0, b1]) = (self.a, self.b);
        let first = triangle(origin, direction, a0, a1 - a0, b0 - a0)
            .map(|(distance, u, v)| Crossing { distance, u, v });
        let second = triangle(origin, direction, b1, b0 - b1, a1 - b1)
            .map(|(distance, s, t)| Crossing { distance, u: 1.0 - s, v: 1.0 - t });
        // A strip whose ends are twisted against each other is not planar, so both triangles may be
        // crossed. The nearer crossing is visible.
        match (first, second) {
            (Some(one), Some(other)) => {
                Some(if other.distance < one.distance { other } else { one })
            }
            (one, other) => one.or(other),
        }
    }
}

/// Distance to a triangle, and the barycentric coordinates along its sides `one` and `other`
/// (Möller and Trumbore 1997).
fn triangle(
    origin: Vec3A,
    direction: Vec3A,
    corner: Vec3A,
    one: Vec3A,
    other: Vec3A,
) -> Option<(f32, f32, f32)> {
    // Move the origin beside the corner. The products below would otherwise lose the strip's width,
    // a tenth of a millimetre, against the eye's distance of metres.
    let beside = (corner - origin).dot(direction);
    let from = (origin - corner) + direction * beside;
    let p = direction.cross(other);
    // The triple product: zero for a ray in the triangle's plane and for a degenerate triangle.
    let volume = one.dot(p);
    if volume == 0.0 {
        return None;
    }
    let s = from.dot(p) / volume;
    let q = from.cross(one);
    let t = direction.dot(q) / volume;
    // Both barycentric coordinates and their sum in 0..1, up to the tolerance.
    let inside = s >= -EDGE_TOLERANCE && t >= -EDGE_TOLERANCE && s + t <= 1.0 + EDGE_TOLERANCE;
    let distance = beside + other.dot(q) / volume;
    (inside && distance >= 0.0).then_some((distance, s, t))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From x = 0 to 4, 2 wide, its far end turned by a quarter.
    fn strip() -> RibbonStrip {
        RibbonStrip {
            a: [Vec3A::Y, Vec3A::NEG_Y],
            b: [Vec3A::new(4.0, 0.7, 0.7), Vec3A::new(4.0, -0.7, -0.7)],
        }
    }

    #[test]
    fn corners_and_the_middle_are_found_from_both_sides() {
        for (z, direction) in [(5.0, Vec3A::NEG_Z), (-5.0, Vec3A::Z)] {
            let near = strip().crossing(Vec3A::new(1e-3, 0.98, z), direction).unwrap();
            assert!(near.u < 0.02 && near.v < 0.02, "{near:?}");
            let far = strip().crossing(Vec3A::new(3.99, -0.69, z), direction).unwrap();
            assert!(
                far.u > 0.98
                    && far.v > 0.98
                    && (far.distance - (5.0 + 0.7 * z.signum())).abs() < 0.05,
                "{far:?}"
            );
            let middle = strip().crossing(Vec3A::new(2.0, 0.0, z), direction).unwrap();
            assert!(
                (middle.u - 0.5).abs() < 0.2
                    && (middle.v - 0.5).abs() < 0.2
                    && (middle.distance - 5.0).abs() < 0.4
            );
            assert!(strip().crossing(Vec3A::new(2.0, 1.2, z), direction).is_none());
        }
        assert_eq!(strip().crossing(Vec3A::new(2.0, 0.0, 5.0), Vec3A::Z), None, "it is behind");
    }

    #[test]
    fn no_ray_slips_between_the_triangles_or_through_a_joint() {
        let turned = |x: f32| {
            let (sin, cos) = (x * 0.1).sin_cos();
            [Vec3A::new(x, cos, sin), Vec3A::new(x, -cos, -sin)].map(|point| point * 0.05)
        };
        let strips: Vec<_> = (0_u8..6)
            .map(|i| RibbonStrip { a: turned(f32::from(i)), b: turned(f32::from(i) + 1.0) })
            .collect();
        for step in 0_u16..4000 {
            let (x, y) = (f32::from(step) * 1.4e-3 + 0.1, f32::from(step % 17) / 40.0 - 0.2);
            let origin = Vec3A::new(x * 0.05, y * 0.05, 900.0);
            assert!(
                strips.iter().any(|strip| strip.crossing(origin, Vec3A::NEG_Z).is_some()),
                "a hole at {x} {y}"
            );
        }
    }
}
