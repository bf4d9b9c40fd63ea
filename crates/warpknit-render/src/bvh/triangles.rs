//! Triangles, tested eight at a time.
//!
//! In: a ray and a leaf of triangles in plain arrays. Out: the distances at which the ray meets
//! them, by Möller and Trumbore (1997, 'Fast, minimum storage ray-triangle intersection'), as
//! arranged by Perard-Gayot (2021, 'An introduction to BVHs').
//!
//! Not promised: that no ray passes along the edge between two triangles.

use glam::{Vec3, Vec3A};

use super::build::Box3;
use super::lanes::{Eight, LANES, LaneRay, Lanes, Lanes3};
use super::tree::{Leaf, Shapes, Tree};

/// Up to eight triangles. Those of absent lanes have no area, and are never met.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct TriangleLeaf {
    /// The first corners, then the way from the second to the first, and that from the first to the
    /// third. Of each the coordinates.
    corners: [[[f32; LANES]; 3]; 3],
    numbers: [u32; LANES],
}

impl Leaf for TriangleLeaf {
    #[inline(always)]
    fn shape(&self, lane: usize) -> u32 {
        self.numbers[lane]
    }
}

/// The tree over triangles.
pub(crate) fn tree(triangles: &[[Vec3; 3]]) -> Tree<TriangleLeaf> {
    let around = |corners: &[Vec3; 3]| {
        let points = corners.map(|corner| Box3::of_point(Vec3A::from(corner)));
        points.into_iter().fold(Box3::EMPTY, Box3::union)
    };
    let boxes: Vec<Box3> = triangles.iter().map(around).collect();
    Tree::of_shapes(&boxes, |numbers| TriangleLeaf::new(triangles, numbers))
}

impl TriangleLeaf {
    /// A leaf of the triangles with these numbers, at most eight.
    fn new(triangles: &[[Vec3; 3]], numbers: &[u32]) -> Self {
        let mut leaf = Self { corners: [[[0.0; LANES]; 3]; 3], numbers: [u32::MAX; LANES] };
        for (lane, &number) in numbers.iter().enumerate() {
            let [a, b, c] = triangles[number as usize];
            for (vector, value) in leaf.corners.iter_mut().zip([a, a - b, c - a]) {
                (0..3).for_each(|axis| vector[axis][lane] = value[axis]);
            }
            leaf.numbers[lane] = number;
        }
        leaf
    }
}

/// Triangles beyond a distance.
pub(crate) struct TrianglesBeyond {
    pub(crate) least: f32,
}

impl Shapes for TrianglesBeyond {
    type Leaf = TriangleLeaf;

    #[inline(always)]
    fn distances<S: Eight>(
        &self,
        leaf: &TriangleLeaf,
        ray: &LaneRay<S>,
        limit: f32,
    ) -> (u32, [f32; LANES]) {
        let simd = ray.simd;
        let [corner, back, side] = &leaf.corners;
        let vector = |[x, y, z]: &[[f32; LANES]; 3]| Lanes3 {
            x: Lanes::new(simd, *x),
            y: Lanes::new(simd, *y),
            z: Lanes::new(simd, *z),
        };
        let (back, side) = (vector(back), vector(side));
        let normal = back.cross(side);
        let toward = vector(corner) - ray.origin;
        let across = ray.direction.cross(toward);
        let (zero, one) = (Lanes::all(simd, 0.0), Lanes::all(simd, 1.0));
        // In the plane of a triangle this is infinite or no number, and so are the weights, which
        // fail the tests below.
        let scale = one / normal.dot(ray.direction);
        let (u, v) = (across.dot(side) * scale, across.dot(back) * scale);
        let distance = normal.dot(toward) * scale;
        let is_inside =
            simd.and_m32s(zero.at_most(u), simd.and_m32s(zero.at_most(v), (u + v).at_most(one)));
        let is_within = simd.and_m32s(
            Lanes::all(simd, self.least).at_most(distance),
            distance.at_most(Lanes::all(simd, limit)),
        );
        (simd.bits(simd.and_m32s(is_inside, is_within)), distance.array())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::lanes::{Instructions, Kernel};
    use crate::bvh::tree::{Ray, Waiting};
    use glam::{DMat3, DVec3};
    use proptest::prelude::*;

    /// A coordinate that is often the same in two points.
    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![Just(0.0_f32), Just(1.0), -2.0..2.0_f32]
    }

    fn point() -> impl Strategy<Value = Vec3> {
        [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from)
    }

    /// Distance to a triangle, and the least weight of its corners there, in `f64`. `None` for rays
    /// along its plane.
    fn solved(ray: &Ray, corners: [Vec3; 3]) -> Option<(f64, f64)> {
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        let matrix = DMat3::from_cols(b - a, c - a, -ray.direction.as_dvec3());
        let is_solved = matrix.determinant().abs() > 1e-3;
        is_solved.then(|| {
            let DVec3 { x, y, z } = matrix.inverse() * (ray.origin.as_dvec3() - a);
            (z, x.min(y).min(1.0 - x - y))
        })
    }

    struct OneLeaf<'a>(&'a TriangleLeaf, Ray);

    impl Kernel for OneLeaf<'_> {
        type Output = (u32, [u32; LANES]);

        #[inline(always)]
        fn run<S: Eight>(self, simd: S) -> (u32, [u32; LANES]) {
            let ray = LaneRay::new(simd, self.1.origin, self.1.direction);
            let (met, distances) = TrianglesBeyond { least: 0.0 }.distances(self.0, &ray, f32::MAX);
            let of = |lane: usize| if met >> lane & 1 == 1 { distances[lane].to_bits() } else { 0 };
            (met, std::array::from_fn(of))
        }
    }

    proptest! {
        #[test]
        fn a_ray_meets_a_triangle_where_its_plane_is_within_the_corners(
            corners in [point(), point(), point()], origin in point(), aim in point(),
        ) {
            let direction = (aim - origin).normalize_or(Vec3::X);
            let ray = Ray { origin, direction, reach: f32::INFINITY };
            let found = tree(&[corners]).nearest(&ray, &TrianglesBeyond { least: 0.0 }, &mut Waiting::new());
            let Some((distance, weight)) = solved(&ray, corners) else { return Ok(()) };
            // On an edge, and at the ray's start, roundings decide.
            if weight.abs() > 1e-3 && distance.abs() > 1e-3 {
                prop_assert_eq!(found.is_some(), weight > 0.0 && distance > 0.0);
            }
            if let Some(found) = found {
                prop_assert!((f64::from(found.distance) - distance).abs() < 1e-3);
            }
        }

        #[test]
        fn both_sets_of_instructions_give_the_same_bits(
            triangles in prop::collection::vec([point(), point(), point()], 1..=8),
            origin in point(), aim in point(),
        ) {
            let direction = (aim - origin).normalize_or(Vec3::X);
            let ray = Ray { origin, direction, reach: f32::INFINITY };
            let leaf = TriangleLeaf::new(&triangles, &[0, 1, 2, 3, 4, 5, 6, 7][..triangles.len()]);
            let [best, plain] =
                [Instructions::best(), Instructions::plain()].map(|set| set.run(OneLeaf(&leaf, ray)));
            prop_assert_eq!(best, plain);
            prop_assert!(best.0 >> triangles.len() == 0, "absent triangles are never met");
        }
    }
}
