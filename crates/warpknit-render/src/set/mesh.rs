//! Triangles that rays are tested against.
//!
//! In: vertices with normals, and triangles. Out: [`Mesh`], with a tree of leaves of eight triangles
//! (`bvh`). No ray passes along the edge that two triangles share.

use std::collections::HashSet;

use glam::Vec3;
use rayon::prelude::*;

use super::SKIN;
use crate::bvh::tree::{Hit, Ray, Tree, Waiting};
use crate::bvh::triangles::{self, TriangleLeaf, TrianglesBeyond};
use crate::scene::Bounds;

/// Cosine between ray and triangle from which on yarns are no deeper in its skin along the ray.
const FLATTEST: f32 = 0.3;

/// Fraction of the light that counts as none: less than a step of a pixel's value.
const DARK: f32 = 0.01;

/// A surface of triangles, mm.
#[derive(Debug)]
pub struct Mesh {
    /// The corners of each triangle.
    corners: Vec<[u32; 3]>,
    /// Unit normals of the triangles.
    faces: Vec<Vec3>,
    positions: Vec<Vec3>,
    /// Unit normals of the vertices.
    normals: Vec<Vec3>,
    tree: Tree<TriangleLeaf>,
    bounds: Bounds,
}

/// Where a ray meets a mesh.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MeshHit {
    pub(crate) distance: f32,
    pub(crate) triangle: usize,
    /// Weights of the corners.
    pub(crate) weights: [f32; 3],
}

/// The surface of a mesh where a ray meets it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MeshSurface {
    /// A place on the rounded surface that the triangles stand for, from which rays may start.
    pub(crate) place: Vec3,
    /// Unit normal of the rounded surface, not away from there.
    pub(crate) normal: Vec3,
}

impl Mesh {
    /// A mesh of the triangles that have an area. `None` without any.
    ///
    /// ```
    /// use glam::Vec3;
    /// use warpknit_render::set::Mesh;
    /// let places = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    /// assert!(Mesh::new(places.clone(), vec![Vec3::Z; 3], &[[0, 1, 2]]).is_some());
    /// assert!(Mesh::new(places, vec![Vec3::Z; 3], &[[0, 1, 1]]).is_none());
    /// ```
    #[must_use]
    pub fn new(positions: Vec<Vec3>, normals: Vec<Vec3>, triangles: &[[u32; 3]]) -> Option<Self> {
        let mut known = HashSet::new();
        let corner = |vertex: u32| positions[vertex as usize];
        let is_surface = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(corner);
            let size = (b - a).cross(c - a).length_squared();
            size > 0.0 && size.is_finite()
        };
        // Copies of a triangle would make the builder slow, and add nothing.
        let is_first = |corners: &[u32; 3]| {
            let mut sorted = corners.map(|vertex| corner(vertex).to_array().map(f32::to_bits));
            sorted.sort_unstable();
            known.insert(sorted)
        };
        let corners: Vec<[u32; 3]> =
            triangles.iter().copied().filter(is_surface).filter(is_first).collect();
        let triangles: Vec<[Vec3; 3]> = corners.iter().map(|corners| corners.map(corner)).collect();
        let bounds = Bounds::around(triangles.as_flattened())?;
        let face = |[a, b, c]: &[Vec3; 3]| (*b - *a).cross(*c - *a).normalize_or_zero();
        let faces = triangles.iter().map(face).collect();
        let tree = triangles::tree(&triangles);
        Some(Self { corners, faces, positions, normals, tree, bounds })
    }

    /// The box around it.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Its vertices, with their unit normals.
    pub(crate) fn vertices(&self) -> (&[Vec3], &[Vec3]) {
        (&self.positions, &self.normals)
    }

    /// The corners of each triangle, as numbers of vertices.
    pub(crate) fn triangles(&self) -> &[[u32; 3]] {
        &self.corners
    }

    /// The corners' places of each triangle.
    pub(crate) fn corners(&self) -> impl ParallelIterator<Item = [Vec3; 3]> {
        (0..self.corners.len()).into_par_iter().map(|triangle| self.places(triangle))
    }

    /// The nearest triangle along a ray from `from` in the unit direction `toward`.
    pub(crate) fn nearest(&self, from: Vec3, toward: Vec3) -> Option<MeshHit> {
        let ray = Ray { origin: from, direction: toward, reach: f32::INFINITY };
        let shapes = TrianglesBeyond::new(0.0, toward);
        let Hit { shape, distance } = self.tree.nearest(&ray, &shapes, &mut Waiting::new())?;
        let triangle = shape as usize;
        let weights = barycentric(self.places(triangle), from + toward * distance);
        Some(MeshHit { distance, triangle, weights })
    }

    /// The surface at a hit of a ray from `from` in the unit direction `toward`.
    ///
    /// The sun's shadow on a lit side would end along the triangles' edges. So rays start from a
    /// place above the triangle, on planes across the normals of its corners (Hanika 2021, 'Hacking
    /// the shadow terminator').
    pub(crate) fn surface(&self, hit: &MeshHit, from: Vec3, toward: Vec3) -> MeshSurface {
        let face = self.faces[hit.triangle];
        let face = if face.dot(toward) > 0.0 { -face } else { face };
        let outward = |vertex: usize| {
            let normal = self.normals[vertex];
            if normal.dot(face) < 0.0 { -normal } else { normal }
        };
        let normal = self.interpolate(hit, outward).normalize_or(face);
        // At the outline of a coarse mesh the rounded surface would face away.
        let normal = (normal - toward * normal.dot(toward).max(0.0)).normalize_or(face);
        let at = from + toward * hit.distance;
        let place = self.interpolate(hit, |vertex| {
            let below = (at - self.positions[vertex]).dot(outward(vertex)).min(0.0);
            at - outward(vertex) * below
        });
        MeshSurface { place, normal }
    }

    /// Whether a ray in this direction meets a triangle's front, around which its corners run
    /// counter-clockwise.
    pub(crate) fn is_front(&self, hit: &MeshHit, toward: Vec3) -> bool {
        self.faces[hit.triangle].dot(toward) < 0.0
    }

    /// Distance along a ray up to which yarns before the mesh, or in its skin, are seen. `None`
    /// where the ray misses the mesh.
    pub(crate) fn reach_through_skin(&self, from: Vec3, toward: Vec3) -> Option<f32> {
        self.nearest(from, toward).map(|hit| self.skin_reach(&hit, toward))
    }

    /// The same for a hit of the ray.
    pub(crate) fn skin_reach(&self, hit: &MeshHit, toward: Vec3) -> f32 {
        hit.distance + SKIN / self.faces[hit.triangle].dot(toward).abs().max(FLATTEST)
    }

    /// Whether any triangle lies within these distances along a ray.
    pub(crate) fn blocks(&self, from: Vec3, toward: Vec3, within: [f32; 2]) -> bool {
        let [least, reach] = within;
        let ray = Ray { origin: from, direction: toward, reach };
        let mut is_clear = true;
        self.tree.visit(&ray, &TrianglesBeyond::new(least, toward), &mut Waiting::new(), |_| {
            is_clear = false;
            false
        });
        !is_clear
    }

    /// The fraction of light along a ray that passes all triangles beyond a distance. `passed` is
    /// that of one triangle, given its number and the cosine between ray and normal. Below [`DARK`]
    /// the rest is left out.
    pub(crate) fn passes(
        &self,
        from: Vec3,
        toward: Vec3,
        least: f32,
        passed: impl Fn(usize, f32) -> f32,
    ) -> f32 {
        let ray = Ray { origin: from, direction: toward, reach: f32::INFINITY };
        let mut light = 1.0;
        self.tree.visit(
            &ray,
            &TrianglesBeyond::new(least, toward),
            &mut Waiting::new(),
            |triangle| {
                let triangle = triangle as usize;
                light *= passed(triangle, self.faces[triangle].dot(toward).abs());
                light >= DARK
            },
        );
        light
    }

    /// What the corners of a hit triangle have, weighted.
    pub(crate) fn interpolate(&self, hit: &MeshHit, of: impl Fn(usize) -> Vec3) -> Vec3 {
        let corners = self.corners[hit.triangle].iter().zip(hit.weights);
        corners.map(|(vertex, weight)| of(*vertex as usize) * weight).sum()
    }

    /// The corners' places of a triangle.
    fn places(&self, triangle: usize) -> [Vec3; 3] {
        self.corners[triangle].map(|vertex| self.positions[vertex as usize])
    }
}

/// Weights of a triangle's corners at a place in its plane.
fn barycentric([a, b, c]: [Vec3; 3], place: Vec3) -> [f32; 3] {
    let (one, other) = (b - a, c - a);
    let (normal, from) = (one.cross(other), place - a);
    let scale = normal.length_squared().recip();
    let (u, v) = (from.cross(other).dot(normal) * scale, one.cross(from).dot(normal) * scale);
    [1.0 - u - v, u, v]
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;
    use warpknit_core::ids::index32;

    /// Triangles with three corners each.
    pub(crate) fn soup(places: &[[f32; 3]]) -> Option<Mesh> {
        let positions: Vec<Vec3> = places.iter().copied().map(Vec3::from).collect();
        let triangles: Vec<[u32; 3]> =
            (0..index32(positions.len()) / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let normals = vec![Vec3::Z; positions.len()];
        Mesh::new(positions, normals, &triangles)
    }

    proptest! {
        #[test]
        fn the_tree_finds_what_all_triangles_have(
            places in prop::collection::vec(prop::array::uniform3(-10.0..10.0_f32), 3..120),
            from in prop::array::uniform3(-20.0..20.0_f32),
            aim in prop::array::uniform3(-5.0..5.0_f32),
        ) {
            let Some(mesh) = soup(&places) else { return Ok(()) };
            let from = Vec3::from(from);
            let toward = (Vec3::from(aim) - from).normalize_or(Vec3::X);
            let ray = Ray { origin: from, direction: toward, reach: f32::INFINITY };
            let alone = |triangle: usize| {
                let tree = triangles::tree(&[mesh.places(triangle)]);
                tree.nearest(&ray, &TrianglesBeyond::new(0.0, toward), &mut Waiting::new())
            };
            let distances: Vec<f32> =
                (0..mesh.corners.len()).filter_map(alone).map(|hit| hit.distance).collect();
            let nearest = distances.iter().copied().fold(f32::INFINITY, f32::min);
            let hit = mesh.nearest(from, toward);
            prop_assert_eq!(hit.map_or(f32::INFINITY, |hit| hit.distance), nearest);
            if let Some(hit) = hit {
                let place = mesh.interpolate(&hit, |vertex| mesh.positions[vertex]);
                prop_assert!(place.distance(from + toward * hit.distance) < 1e-2);
            }
            prop_assert_eq!(mesh.blocks(from, toward, [0.0, f32::INFINITY]), !distances.is_empty());
            let passed = mesh.passes(from, toward, 0.0, |_, _| 0.9);
            let all = (0..distances.len()).fold(1.0, |passed, _| passed * 0.9);
            prop_assert!(passed == all || (passed < DARK && all < DARK));
        }
    }

    #[test]
    fn many_copies_of_a_triangle_are_one() {
        let one = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let places: Vec<[f32; 3]> = one.iter().copied().cycle().take(600_000).collect();
        assert_eq!(soup(&places).unwrap().corners.len(), 1);
    }
}
