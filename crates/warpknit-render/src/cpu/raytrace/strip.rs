//! Ray-ribbon intersection, eight strips at a time. A ribbon is a chain of strips, flat pieces
//! between two points of the yarn's axis.
//!
//! In: the edges of ribbons, and a ray. Out: the points where it crosses eight consecutive strips. A
//! strip shares its corners with the strips before and after it, and two triangles fill it:
//!
//! ```text
//!   u = 0   a0 ────── b0     v = 0 at a, 1 at b, along the yarn;
//!            │   ╱    │      u from edge to edge, along tangent x normal
//!   u = 1   a1 ────── b1
//! ```
//!
//! No light leaks between strips, as between any triangles that share an edge (`bvh/triangles.rs`).

use glam::Vec3A;
use rayon::prelude::*;

use crate::bvh::lanes::{Eight, LANES, LaneRay, Lanes};
use crate::bvh::triangles::{Across, Crossing, Projection};
use crate::paths::YarnPaths;

/// Both ends of ribbons' widths, at all points of yarns. An array for each coordinate, so that lanes
/// take eight strips as they lie.
#[derive(Debug, Default)]
pub(super) struct RibbonEdges {
    /// At u = 0 and at u = 1.
    sides: [[Vec<f32>; 3]; 2],
}

/// Where a ray crosses eight strips. Infinite distances where it doesn't.
#[derive(Clone, Copy)]
pub(super) struct StripCrossings<S> {
    /// Along the ray, whose direction has unit length.
    pub(super) distance: Lanes<S>,
    pub(super) u: Lanes<S>,
    pub(super) v: Lanes<S>,
}

impl RibbonEdges {
    /// The edges of ribbons that lie in the plane of the cloth. Each piece of yarn has the radius of its
    /// first point.
    pub(super) fn new(paths: &YarnPaths) -> Self {
        // Lanes also load what lies behind the last strips.
        let mut sides: [[Vec<f32>; 3]; 2] = Default::default();
        sides.as_flattened_mut().iter_mut().for_each(|coordinates| {
            coordinates.resize(paths.points.len() + LANES, 0.0);
        });
        let [[x0, y0, z0], [x1, y1, z1]] = &mut sides;
        let coordinates = x0.par_iter_mut().zip(y0).zip(z0).zip(x1).zip(y1).zip(z1);
        (paths.points.par_iter().enumerate()).zip(coordinates).for_each(
            |((point, axis), (((((x0, y0), z0), x1), y1), z1))| {
                // The last point of a strand has no radius of its own.
                let before = paths.points[point.saturating_sub(1)];
                let radius = if axis.w > 0.0 { axis.w } else { before.w };
                let (tangent, normal) =
                    (paths.tangents[point].unpack(), paths.across[point].unpack());
                let aside = tangent.cross(normal).normalize_or_zero() * radius;
                [*x0, *y0, *z0] = (axis.truncate() - aside).to_array();
                [*x1, *y1, *z1] = (axis.truncate() + aside).to_array();
            },
        );
        Self { sides }
    }

    /// The corners of the strip that starts at point `start`.
    pub(super) fn strip(&self, start: u32) -> [Vec3A; 4] {
        let from = start as usize;
        [(0, from), (1, from), (0, from + 1), (1, from + 1)].map(|(side, point)| {
            let [x, y, z] = &self.sides[side];
            Vec3A::new(x[point], y[point], z[point])
        })
    }

    /// Coordinates of one end of the width at eight consecutive points.
    #[inline(always)]
    fn coordinates<S: Eight>(&self, side: usize, first: u32, simd: S) -> [Lanes<S>; 3] {
        let [x, y, z] = &self.sides[side];
        [eight(simd, x, first), eight(simd, y, first), eight(simd, z, first)]
    }

    /// Where a ray crosses the eight strips that start at the points from `first` on. Some of them may
    /// be none: those from a yarn's last point on.
    #[inline(always)]
    pub(super) fn crossings<S: Eight>(
        &self,
        first: u32,
        ray: &LaneRay<S>,
        across: Across,
    ) -> StripCrossings<S> {
        let simd = ray.simd;
        let projection = Projection::new(ray, across);
        let (a0, b0) = (
            projection.corner(self.coordinates(0, first, simd)),
            projection.corner(self.coordinates(0, first + 1, simd)),
        );
        let (a1, b1) = (
            projection.corner(self.coordinates(1, first, simd)),
            projection.corner(self.coordinates(1, first + 1, simd)),
        );
        let one = Crossing::new(simd, [a0, a1, b0]);
        let other = Crossing::new(simd, [b1, b0, a1]);
        // A strip whose ends are twisted against each other is not planar, so both triangles may be
        // crossed. The nearer crossing is visible.
        let is_other = other.distance.less_than(one.distance);
        let whole = Lanes::all(simd, 1.0);
        StripCrossings {
            distance: other.distance.where_set(is_other, one.distance),
            u: (whole - other.shares[0]).where_set(is_other, one.shares[0]),
            v: (whole - other.shares[1]).where_set(is_other, one.shares[1]),
        }
    }
}

/// Eight consecutive numbers.
#[inline(always)]
pub(super) fn eight<S: Eight>(simd: S, numbers: &[f32], first: u32) -> Lanes<S> {
    let first = first as usize;
    let mut lanes = [0.0; LANES];
    lanes.copy_from_slice(&numbers[first..first + LANES]);
    Lanes::new(simd, lanes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::lanes::{Instructions, Kernel};
    use glam::Vec3;

    /// The edges of a ribbon, and a ray at it.
    struct RayAtRibbon<'a>(&'a RibbonEdges, Vec3, Vec3);

    impl Kernel for RayAtRibbon<'_> {
        type Output = [[f32; LANES]; 3];

        #[inline(always)]
        fn run<S: Eight>(self, simd: S) -> [[f32; LANES]; 3] {
            let Self(edges, origin, direction) = self;
            let ray = LaneRay::new(simd, origin, direction);
            let StripCrossings { distance, u, v } =
                edges.crossings(0, &ray, Across::new(direction));
            [distance.array(), u.array(), v.array()]
        }
    }

    /// The strips between pairs of edges.
    fn ribbon(pairs: &[[Vec3; 2]]) -> RibbonEdges {
        let padded = |side: usize, axis: usize| {
            pairs.iter().map(|pair| pair[side][axis]).chain([0.0; LANES]).collect()
        };
        RibbonEdges { sides: [0, 1].map(|side| [0, 1, 2].map(|axis| padded(side, axis))) }
    }

    /// From x = 0 to 4, 2 wide, its far end turned by a quarter.
    fn strip() -> RibbonEdges {
        ribbon(&[[Vec3::Y, Vec3::NEG_Y], [Vec3::new(4.0, 0.7, 0.7), Vec3::new(4.0, -0.7, -0.7)]])
    }

    /// Distance, u and v of the first strip's crossing.
    fn crossing(edges: &RibbonEdges, origin: Vec3, direction: Vec3) -> Option<[f32; 3]> {
        let crossed =
            Instructions::best().run(RayAtRibbon(edges, origin, direction)).map(|all| all[0]);
        crossed[0].is_finite().then_some(crossed)
    }

    #[test]
    fn corners_and_the_middle_are_found_from_both_sides() {
        for (z, direction) in [(5.0, Vec3::NEG_Z), (-5.0, Vec3::Z)] {
            let [_, u, v] = crossing(&strip(), Vec3::new(1e-3, 0.98, z), direction).unwrap();
            assert!(u < 0.02 && v < 0.02, "{u} {v}");
            let [distance, u, v] =
                crossing(&strip(), Vec3::new(3.99, -0.69, z), direction).unwrap();
            assert!(u > 0.98 && v > 0.98, "{u} {v}");
            assert!((distance - (5.0 + 0.7 * z.signum())).abs() < 0.05, "{distance}");
            let [distance, u, v] = crossing(&strip(), Vec3::new(2.0, 0.0, z), direction).unwrap();
            assert!((u - 0.5).abs() < 0.2 && (v - 0.5).abs() < 0.2, "{u} {v}");
            assert!((distance - 5.0).abs() < 0.4, "{distance}");
            assert_eq!(crossing(&strip(), Vec3::new(2.0, 1.2, z), direction), None);
        }
        assert_eq!(crossing(&strip(), Vec3::new(2.0, 0.0, 5.0), Vec3::Z), None, "it is behind");
    }

    #[test]
    fn no_ray_slips_between_the_triangles_or_through_a_joint() {
        let turned = |x: u8| {
            let (sin, cos) = (f32::from(x) * 0.1).sin_cos();
            [1.0, -1.0].map(|side| Vec3::new(f32::from(x), side * cos, side * sin) * 0.05)
        };
        let edges = ribbon(&(0..=8).map(turned).collect::<Vec<_>>());
        for step in 0_u16..4000 {
            let (x, y) = (f32::from(step) * 1.9e-3 + 0.1, f32::from(step % 17) / 40.0 - 0.2);
            for (x, lean) in
                [(x, Vec3::ZERO), (x.round(), Vec3::ZERO), (x, Vec3::new(0.31, -0.17, 0.0))]
            {
                let direction = (lean - Vec3::Z).normalize();
                let origin = Vec3::new(x * 0.05, y * 0.05, 0.0) - direction * 900.0;
                let [distances, ..] =
                    Instructions::best().run(RayAtRibbon(&edges, origin, direction));
                assert!(distances.iter().any(|distance| distance.is_finite()), "a hole at {x} {y}");
            }
        }
    }

    #[test]
    fn all_instructions_give_the_same_bits() {
        for x in [0.3, 1.7, 3.9] {
            let ray = || (Vec3::new(x, 0.1, 5.0), Vec3::new(0.1, 0.05, -1.0).normalize());
            let with = |instructions: Instructions| {
                let (origin, direction) = ray();
                let [distance, u, v] = instructions.run(RayAtRibbon(&strip(), origin, direction));
                [distance[0], u[0], v[0]].map(f32::to_bits)
            };
            assert_eq!(with(Instructions::best()), with(Instructions::plain()));
        }
    }
}
