//! What a ray meets, by a compressed wide BVH (obvhs) over groups of neighbouring segments.
//!
//! In: [`Segments`]. Out: the nearest segment along a ray, or any one within reach. Beside the tree
//! a group takes 4 bytes.

use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::ploc::PlocBuilder;
use obvhs::ray::{Ray, RayHit};
use rayon::prelude::*;

use super::ray::{Hit, SceneRay};
use super::segments::Segments;
use crate::ids::index32;

/// Segments that share a box in the build_bvh: two halve the memory of building it, for boxes that
/// are hardly looser. More of them, where there are so many that building takes longer than
/// tracing, and more again, where memory runs short.
const GROUP_SIZES: [(usize, u32); 3] = [(0, 2), (LARGE_SCENE, 4), (8 * LARGE_SCENE, 8)];
const LARGE_SCENE: usize = 3_000_000;
/// Links a leaf of the build_bvh may hold. 3, the group_size that a compressed node can say, traced 3 %
/// slower.
const MAX_LEAF: u32 = 1;

/// The build_bvh over all segments.
pub(super) struct SegmentBvh<'a> {
    pub(super) segments: Segments<'a>,
    /// First points of the groups, in the order of the leaves: one look-up less for each that is
    /// met.
    groups: Vec<u32>,
    /// Most segments in a group.
    group_size: u32,
    bvh: CwBvh,
}

impl<'a> SegmentBvh<'a> {
    pub(super) fn new(segments: Segments<'a>) -> Self {
        let count = segments.paths.points.len();
        let group_size = GROUP_SIZES
            .iter()
            .rev()
            .find(|(least, _)| count >= *least)
            .map_or(1, |(_, group_size)| *group_size);
        let groups = groups(&segments, group_size);
        let mut bvh = build_bvh(&segments, &groups, group_size);
        let groups = bvh.primitive_indices.iter().map(|&index| groups[index as usize]).collect();
        bvh.primitive_indices = Vec::new();
        Self { segments, groups, group_size, bvh }
    }

    /// The nearest segment along `ray`.
    pub(super) fn nearest(&self, ray: &SceneRay) -> Option<Hit> {
        let mut nearest = Hit { start: 0, distance: ray.reach };
        self.bvh.ray_traverse(ray.to_obvhs(), &mut RayHit::none(), |_, index| {
            for start in group_segments(&self.segments, self.groups[index], self.group_size) {
                let distance = self.segments.distance(start, ray, nearest.distance);
                // Of two at one distance, the first along the yarn, in whatever order the build_bvh
                // brings them.
                if distance < nearest.distance
                    || (distance == nearest.distance && start < nearest.start)
                {
                    nearest = Hit { start, distance };
                }
            }
            nearest.distance
        });
        (nearest.distance < ray.reach).then_some(nearest)
    }

    /// The first point of some segment within reach, those of segment `own` and its neighbours on
    /// the yarn left out.
    ///
    /// A bend's own pieces overlap at the joints, where the curve they stand for has no edge to
    /// cast a shadow.
    pub(super) fn occluder(&self, ray: &SceneRay, own: u32) -> Option<u32> {
        let mut occluder = None;
        self.bvh.ray_traverse_miss(ray.to_obvhs(), |traversal, index| {
            let group = group_segments(&self.segments, self.groups[index], self.group_size)
                .filter(|start| start.abs_diff(own) > 1);
            occluder = group
                .into_iter()
                .find(|&start| self.segments.distance(start, ray, traversal.tmax) < traversal.tmax);
            if occluder.is_some() { 0.0 } else { f32::INFINITY }
        });
        occluder
    }
}

impl SceneRay {
    fn to_obvhs(&self) -> Ray {
        Ray::new(self.origin.into(), self.direction.into(), 0.0, self.reach)
    }
}

/// The build_bvh over the groups' boxes, by obvhs' own recipe, but with each stage's memory given
/// back before the next.
fn build_bvh(segments: &Segments, groups: &[u32], group_size: u32) -> CwBvh {
    let around = |group| {
        group_segments(segments, group, group_size)
            .fold(Aabb::empty(), |around, start| around.union(&segments.bounding_box(start)))
    };
    let boxes: Vec<Aabb> = groups.par_iter().map(|&group| around(group)).collect();
    // Measured on 26 000 stitches, 1600x1200: the longer build traces 12 % faster in all. A million
    // stitches want less time for each.
    let is_large = segments.paths.points.len() > LARGE_SCENE;
    let params =
        if is_large { BvhBuildParams::very_fast_build() } else { BvhBuildParams::medium_build() };
    let indices = (0..index32(boxes.len())).collect();
    let mut binary = PlocBuilder::with_capacity(boxes.len()).build(
        params.ploc_search_distance,
        &boxes,
        indices,
        params.sort_precision,
        params.search_depth_threshold,
    );
    drop(boxes);
    ReinsertionOptimizer::default().run(&mut binary, params.reinsertion_batch_ratio, None);
    let mut wide = bvh2_to_cwbvh(&binary, MAX_LEAF, true, false);
    wide.nodes.shrink_to_fit();
    wide
}

/// Every `group_size`th segment of a strand, counted from its start.
fn groups(segments: &Segments, group_size: u32) -> Vec<u32> {
    let count = index32(segments.paths.points.len());
    let mut groups = Vec::with_capacity(segments.paths.points.len() / group_size as usize + 1);
    let mut in_row = 0;
    for point in 0..count {
        if segments.starts_at(point) {
            if in_row % group_size == 0 {
                groups.push(point);
            }
            in_row += 1;
        } else {
            in_row = 0;
        }
    }
    groups
}

/// The segments of a group.
fn group_segments(segments: &Segments, group: u32, group_size: u32) -> impl Iterator<Item = u32> {
    (group..group + group_size).take_while(|&start| segments.starts_at(start))
}
