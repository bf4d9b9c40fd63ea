//! What a ray meets, by a compressed wide BVH (obvhs) over links of neighbouring segments.
//!
//! In: [`Segments`]. Out: the nearest segment along a ray, or any one within reach. Beside the tree
//! a link takes 4 bytes.

use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::ploc::PlocBuilder;
use obvhs::ray::{Ray, RayHit};
use rayon::prelude::*;

use super::ray::{Hit, Path};
use super::segments::Segments;
use warpknit_core::ids::index32;

/// Segments that share a box in the hierarchy: two halve the memory of building it, for boxes that
/// are hardly looser. More of them, where there are so many that building takes longer than
/// tracing, and more again, where memory runs short.
const LINKS: [(usize, u32); 3] = [(0, 2), (LARGE, 4), (8 * LARGE, 8)];
const LARGE: usize = 3_000_000;
/// Links a leaf of the hierarchy may hold. 3, the most that a compressed node can say, traced 3 %
/// slower.
const MAX_LEAF: u32 = 1;

/// The hierarchy over all segments.
pub(super) struct Tracer<'a> {
    pub(super) segments: Segments<'a>,
    /// First points of the links, in the order of the leaves: one look-up less for each that is
    /// met.
    links: Vec<u32>,
    /// Most segments in a link.
    most: u32,
    bvh: CwBvh,
}

impl<'a> Tracer<'a> {
    pub(super) fn new(segments: Segments<'a>) -> Self {
        let count = segments.paths.points.len();
        let most =
            LINKS.iter().rev().find(|(least, _)| count >= *least).map_or(1, |(_, most)| *most);
        let links = links(&segments, most);
        let mut bvh = hierarchy(&segments, &links, most);
        let links = bvh.primitive_indices.iter().map(|&index| links[index as usize]).collect();
        bvh.primitive_indices = Vec::new();
        Self { segments, links, most, bvh }
    }

    /// The nearest segment along `path`.
    pub(super) fn nearest(&self, path: &Path) -> Option<Hit> {
        let mut nearest = Hit { start: 0, distance: path.reach };
        self.bvh.ray_traverse(path.ray(), &mut RayHit::none(), |_, index| {
            for start in of_link(&self.segments, self.links[index], self.most) {
                let distance = self.segments.distance(start, path, nearest.distance);
                // Of two at one distance, the first along the yarn, in whatever order the hierarchy
                // brings them.
                if distance < nearest.distance
                    || (distance == nearest.distance && start < nearest.start)
                {
                    nearest = Hit { start, distance };
                }
            }
            nearest.distance
        });
        (nearest.distance < path.reach).then_some(nearest)
    }

    /// The first point of some segment within reach, those of segment `own` and its neighbours on
    /// the yarn left out.
    ///
    /// A bend's own pieces overlap at the joints, where the curve they stand for has no edge to
    /// cast a shadow.
    pub(super) fn occluder(&self, path: &Path, own: u32) -> Option<u32> {
        let mut occluder = None;
        self.bvh.ray_traverse_miss(path.ray(), |ray, index| {
            let link = of_link(&self.segments, self.links[index], self.most)
                .filter(|start| start.abs_diff(own) > 1);
            occluder = link
                .into_iter()
                .find(|&start| self.segments.distance(start, path, ray.tmax) < ray.tmax);
            if occluder.is_some() { 0.0 } else { f32::INFINITY }
        });
        occluder
    }
}

impl Path {
    fn ray(&self) -> Ray {
        Ray::new(self.origin.into(), self.direction.into(), 0.0, self.reach)
    }
}

/// The hierarchy over the links' boxes, by obvhs' own recipe, but with each stage's memory given
/// back before the next.
fn hierarchy(segments: &Segments, links: &[u32], most: u32) -> CwBvh {
    let around = |link| {
        of_link(segments, link, most)
            .fold(Aabb::empty(), |around, start| around.union(&segments.boxed(start)))
    };
    let boxes: Vec<Aabb> = links.par_iter().map(|&link| around(link)).collect();
    // Measured on 26 000 stitches, 1600x1200: the longer build traces 12 % faster in all. A million
    // stitches want less time for each.
    let is_large = segments.paths.points.len() > LARGE;
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

/// Every `most`th segment of a strand, counted from its start.
fn links(segments: &Segments, most: u32) -> Vec<u32> {
    let count = index32(segments.paths.points.len());
    let mut links = Vec::with_capacity(segments.paths.points.len() / most as usize + 1);
    let mut in_row = 0;
    for point in 0..count {
        if segments.starts_at(point) {
            if in_row % most == 0 {
                links.push(point);
            }
            in_row += 1;
        } else {
            in_row = 0;
        }
    }
    links
}

/// The segments of a link.
fn of_link(segments: &Segments, link: u32, most: u32) -> impl Iterator<Item = u32> {
    (link..link + most).take_while(|&start| segments.starts_at(start))
}
