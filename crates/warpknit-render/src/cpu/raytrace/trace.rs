//! Bounding volume hierarchy over the segments of yarns.
//!
//! In: [`Segments`]. Out: the nearest segment along a ray, or any segment that occludes it. The
//! hierarchy is a compressed wide BVH (Ylitie, Karras and Laine 2017, 'Efficient incoherent ray
//! traversal on GPUs through compressed wide BVHs') from the crate `obvhs`. Its leaves are short
//! groups of consecutive segments.
//!
//! Memory beside the tree: 4 bytes a group. Results do not depend on the order of traversal.

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
use warpknit_core::ids::index32;

/// Segments per leaf box, by the number of points from which a size is used. Two halve the memory
/// of the build, and the box around two consecutive segments is hardly looser than two boxes. More
/// suit scenes where the build takes longer than tracing, and even more suit those that run short
/// of memory. One wastes memory. Beyond eight, a group winds around a whole loop and its box is
/// mostly empty.
const GROUP_SIZES: [(usize, u32); 3] = [(0, 2), (LARGE_SCENE, 4), (8 * LARGE_SCENE, 8)];
/// Points from which the build takes longer than tracing.
const LARGE_SCENE: usize = 3_000_000;
/// Groups per leaf of the tree. A compressed node can hold up to 3, but that traced 3 % slower.
const MAX_LEAF: u32 = 1;

/// The hierarchy over all segments.
pub(super) struct SegmentBvh<'a> {
    pub(super) segments: Segments<'a>,
    /// First points of the groups in the order of the leaves, which saves a lookup for each leaf
    /// that is met.
    groups: Vec<u32>,
    /// Largest number of segments in a group.
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
        self.bvh.ray_traverse(ray.as_obvhs_ray(), &mut RayHit::none(), |_, index| {
            for start in group_segments(&self.segments, self.groups[index], self.group_size) {
                let distance = self.segments.distance(start, ray, nearest.distance);
                // Ties go to the first segment along the yarn. Otherwise the order of traversal
                // would decide at joints, and with it the picture.
                if distance < nearest.distance
                    || (distance == nearest.distance && start < nearest.start)
                {
                    nearest = Hit { start, distance };
                }
            }
            // The new upper bound: the traversal skips boxes beyond it.
            nearest.distance
        });
        (nearest.distance < ray.reach).then_some(nearest)
    }

    /// The first point of any segment that blocks the ray within its reach. Segment `own`, where
    /// the ray starts, and its two neighbours on the yarn do not count.
    ///
    /// Segments of one bend overlap at their joints. The smooth curve that they approximate has no
    /// edge there that could cast a shadow.
    pub(super) fn occluder(&self, ray: &SceneRay, own: u32) -> Option<u32> {
        let mut occluder = None;
        self.bvh.ray_traverse_miss(ray.as_obvhs_ray(), |traversal, index| {
            let group = group_segments(&self.segments, self.groups[index], self.group_size)
                .filter(|start| start.abs_diff(own) > 1);
            occluder = group
                .into_iter()
                .find(|&start| self.segments.distance(start, ray, traversal.tmax) < traversal.tmax);
            // The return value is the ray's new reach: 0 ends the traversal at the first occluder.
            if occluder.is_some() { 0.0 } else { f32::INFINITY }
        });
        occluder
    }
}

impl SceneRay {
    /// The ray in the form that the hierarchy takes.
    fn as_obvhs_ray(&self) -> Ray {
        Ray::new(self.origin.into(), self.direction.into(), 0.0, self.reach)
    }
}

/// Builds the hierarchy over the groups' boxes: PLOC (Meister and Bittner 2018, 'Parallel
/// locally-ordered clustering for bounding volume hierarchy construction'), then reinsertion of
/// badly placed nodes, then conversion into wide nodes. These are the stages of obvhs' own build.
/// Here each stage frees its input before the next one allocates.
fn build_bvh(segments: &Segments, groups: &[u32], group_size: u32) -> CwBvh {
    let boxes: Vec<Aabb> =
        groups.par_iter().map(|&group| group_box(segments, group, group_size)).collect();
    // A slower build gives a better tree: with 26 000 stitches at 1600 x 1200 pixels, building and
    // tracing together are 12 % faster. With a million stitches the build dominates, and the fast
    // one wins.
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

/// The bounding box of a group.
fn group_box(segments: &Segments, group: u32, group_size: u32) -> Aabb {
    group_segments(segments, group, group_size)
        .fold(Aabb::empty(), |around, start| around.union(&segments.bounding_box(start)))
}

/// First points of the groups: every `group_size`th segment of a strand, counted from the strand's
/// start. A group never spans two strands.
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

/// The segments of the group that starts at point `group`.
fn group_segments(segments: &Segments, group: u32, group_size: u32) -> impl Iterator<Item = u32> {
    (group..group + group_size).take_while(|&start| segments.starts_at(start))
}
