//! Triangles, tested eight at a time.
//!
//! In: a ray and a leaf of triangles in plain arrays. Out: the distances at which the ray meets them.
//!
//! Corners are projected along the ray. A ray meets the triangles around it whose corners turn about
//! it all to one side (Woop, Benthin and Wald 2013, 'Watertight ray/triangle intersection'), from
//! the front or from the back. The side of an edge is computed from its two corners alone, and with
//! the opposite sign from the triangle on its other side. So no ray passes between triangles that
//! share an edge. Triangles that it sees edge-on are left out ([`EDGE_ON`]).

use glam::{Vec3, Vec3A};

use super::build::Box3;
use super::lanes::{Eight, LANES, LaneRay, Lanes, Lanes3};
use super::tree::{Leaf, Shapes, Tree};

/// A triangle is seen edge-on if twice its area across the ray is at most this share of the area
/// around the ray that holds it. The sides of its edges are off by roundings, up to 1e-7 of that area
/// each. With a smaller share, a ray could lie far beside a triangle that it meets. A larger one would
/// open holes along folds.
const EDGE_ON: f32 = 1e-5;

/// Up to eight triangles. Those of absent lanes have no area, and are never met.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct TriangleLeaf {
    /// Of each corner the coordinates.
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
    let boxes: Vec<Box3> = triangles.iter().map(bounding_box).collect();
    Tree::of_shapes(&boxes, |numbers| TriangleLeaf::new(triangles, numbers))
}

fn bounding_box(corners: &[Vec3; 3]) -> Box3 {
    let points = corners.map(|corner| Box3::of_point(Vec3A::from(corner)));
    points.into_iter().fold(Box3::EMPTY, Box3::union)
}

impl TriangleLeaf {
    /// A leaf of the triangles with these numbers, at most eight.
    fn new(triangles: &[[Vec3; 3]], numbers: &[u32]) -> Self {
        let mut leaf = Self { corners: [[[0.0; LANES]; 3]; 3], numbers: [u32::MAX; LANES] };
        for (lane, &number) in numbers.iter().enumerate() {
            for (corner, place) in leaf.corners.iter_mut().zip(triangles[number as usize]) {
                (0..3).for_each(|axis| corner[axis][lane] = place[axis]);
            }
            leaf.numbers[lane] = number;
        }
        leaf
    }

    /// The coordinates of a corner of all triangles.
    #[inline(always)]
    fn corner<S: Eight>(&self, simd: S, corner: usize) -> [Lanes<S>; 3] {
        let [x, y, z] = self.corners[corner];
        [Lanes::new(simd, x), Lanes::new(simd, y), Lanes::new(simd, z)]
    }
}

/// Triangles along a ray, beyond a distance.
pub(crate) struct TrianglesBeyond {
    least: f32,
    across: Across,
}

impl TrianglesBeyond {
    /// Those at least this far along a ray in the unit direction `toward`.
    pub(crate) fn new(least: f32, toward: Vec3) -> Self {
        Self { least, across: Across::new(toward) }
    }
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
        let projection = Projection::new(ray, self.across);
        let a = projection.corner(leaf.corner(simd, 0));
        let b = projection.corner(leaf.corner(simd, 1));
        let c = projection.corner(leaf.corner(simd, 2));
        let distance = Crossing::new(simd, [a, b, c]).distance;
        let is_within = simd.and_m32s(
            Lanes::all(simd, self.least).at_most(distance),
            distance.at_most(Lanes::all(simd, limit)),
        );
        (simd.bits(is_within), distance.array())
    }
}

/// Directions across a ray, which span the plane that corners are projected on.
#[derive(Clone, Copy)]
pub(crate) struct Across([Vec3; 2]);

impl Across {
    /// Those of a ray in this unit direction.
    pub(crate) fn new(direction: Vec3) -> Self {
        let (right, up) = direction.any_orthonormal_pair();
        Self([right, up])
    }
}

/// The projection along a ray.
#[derive(Clone, Copy)]
pub(crate) struct Projection<S> {
    ray: LaneRay<S>,
    right: Lanes3<S>,
    up: Lanes3<S>,
}

impl<S: Eight> Projection<S> {
    #[inline(always)]
    pub(crate) fn new(ray: &LaneRay<S>, Across([right, up]): Across) -> Self {
        let right = Lanes3::all(ray.simd, right.to_array());
        Self { ray: *ray, right, up: Lanes3::all(ray.simd, up.to_array()) }
    }

    /// Corners of eight triangles with these coordinates.
    #[inline(always)]
    pub(crate) fn corner(self, [x, y, z]: [Lanes<S>; 3]) -> Corner<S> {
        let from = Lanes3 { x, y, z } - self.ray.origin;
        Corner {
            x: from.dot(self.right),
            y: from.dot(self.up),
            distance: from.dot(self.ray.direction),
        }
    }
}

/// Corners of eight triangles, projected along the ray.
#[derive(Clone, Copy)]
pub(crate) struct Corner<S> {
    x: Lanes<S>,
    y: Lanes<S>,
    /// Along the ray.
    distance: Lanes<S>,
}

impl<S: Eight> Corner<S> {
    /// On which side of the edge from this corner to another one the ray lies, by its sign. Exactly the
    /// opposite with the corners exchanged.
    #[inline(always)]
    fn side(self, other: Self) -> Lanes<S> {
        self.x * other.y - self.y * other.x
    }
}

/// Where a ray crosses eight triangles.
#[derive(Clone, Copy)]
pub(crate) struct Crossing<S> {
    /// Infinite where it doesn't.
    pub(crate) distance: Lanes<S>,
    /// Barycentric coordinates of the second and of the third corner.
    pub(crate) shares: [Lanes<S>; 2],
}

impl<S: Eight> Crossing<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, [a, b, c]: [Corner<S>; 3]) -> Self {
        let zero = Lanes::all(simd, 0.0);
        let (of_a, of_b, of_c) = (b.side(c), c.side(a), a.side(b));
        let sum = of_a + of_b + of_c;
        let (least, most) = (of_a.min(of_b).min(of_c), of_a.max(of_b).max(of_c));
        let is_around = simd.or_m32s(zero.at_most(least), most.at_most(zero));
        let most_x2 = (a.x * a.x).max(b.x * b.x).max(c.x * c.x);
        let most_y2 = (a.y * a.y).max(b.y * b.y).max(c.y * c.y);
        let edge_on = most_x2 * most_y2 * Lanes::all(simd, EDGE_ON * EDGE_ON);
        // A triangle without area, or one in whose plane the ray lies, is not met.
        let is_met = simd.and_m32s(is_around, edge_on.less_than(sum * sum));
        let scale = Lanes::all(simd, 1.0) / sum;
        let distance = (of_a * a.distance + of_b * b.distance + of_c * c.distance) * scale;
        let is_ahead = simd.and_m32s(is_met, zero.at_most(distance));
        Self {
            distance: distance.where_set(is_ahead, Lanes::all(simd, f32::INFINITY)),
            shares: [of_b * scale, of_c * scale],
        }
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
            let (met, distances) =
                TrianglesBeyond::new(0.0, self.1.direction).distances(self.0, &ray, f32::MAX);
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
            let shapes = TrianglesBeyond::new(0.0, direction);
            let found = tree(&[corners]).nearest(&ray, &shapes, &mut Waiting::new());
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

    /// A wavy sheet of 2 x 12 x 12 triangles over the unit square, around z = 0.
    fn sheet() -> Vec<[Vec3; 3]> {
        let corner = |x: u8, y: u8| {
            let [x, y] = [x, y].map(|place| f32::from(place) / 12.0);
            Vec3::new(x, y, 0.1 * (7.0 * x).sin() * (5.0 * y).cos())
        };
        let cells = (0..12).flat_map(|y| (0..12).map(move |x| (x, y)));
        let halves = |(x, y)| {
            let [a, b, c, d] =
                [corner(x, y), corner(x + 1, y), corner(x, y + 1), corner(x + 1, y + 1)];
            [[a, b, d], [a, d, c]]
        };
        cells.flat_map(halves).collect()
    }

    #[test]
    fn rays_along_triangles_meet_none_beside_them() {
        for corners in sheet() {
            let corners = corners.map(|corner| Vec3::new(corner.x, corner.y, 0.5));
            // One in fifty of a triangle's side.
            let around = bounding_box(&corners).grown(Vec3A::splat(2e-3));
            let leaf = TriangleLeaf::new(&[corners], &[0]);
            for turn in 0..100_u8 {
                let (sin, cos) = (f32::from(turn) * 0.1).sin_cos();
                let tilt = [0.0, 1e-7, 1e-6, 1e-5][usize::from(turn % 4)];
                let direction = Vec3::new(cos, sin, tilt).normalize();
                let origin = Vec3::new(0.3, 0.7, 0.5) - direction * f32::from(turn % 7) * 0.1;
                let ray = Ray { origin, direction, reach: f32::INFINITY };
                let (met, distances) = Instructions::best().run(OneLeaf(&leaf, ray));
                let place = Vec3A::from(origin + direction * f32::from_bits(distances[0]));
                let is_inside = place.cmpge(around.min) & place.cmple(around.max);
                assert!(met == 0 || is_inside.all(), "{ray:?}");
            }
        }
    }

    #[test]
    fn no_ray_passes_along_an_edge() {
        let tree = tree(&sheet());
        for corners in sheet() {
            for (end, share) in [(0, 0.0_f32), (0, 0.31), (1, 0.5), (2, 0.77)] {
                let at = corners[end].lerp(corners[(end + 1) % 3], share);
                if at.truncate().cmple(glam::Vec2::splat(1e-3)).any()
                    || at.truncate().cmpge(glam::Vec2::splat(1.0 - 1e-3)).any()
                {
                    continue;
                }
                for lean in [Vec3::ZERO, Vec3::new(0.31, -0.17, 0.0), Vec3::new(-0.2, 0.45, 0.0)] {
                    let direction = (lean - Vec3::Z).normalize();
                    let origin = at - direction * 900.0;
                    let ray = Ray { origin, direction, reach: f32::INFINITY };
                    let shapes = TrianglesBeyond::new(0.0, direction);
                    let found = tree.nearest(&ray, &shapes, &mut Waiting::new());
                    assert!(found.is_some(), "a hole at {at} along {direction}");
                }
            }
        }
    }
}
