//! Bounding boxes of triangles, and the bounding volume hierarchy (BVH) that searches them.
//!
//! In: axis-aligned bounding boxes. Out: a BVH over them, and the boxes that meet a given one.
//!
//! Method: `obvhs` builds the tree by parallel locally-ordered clustering (Meister and Bittner
//! 2018, "Parallel locally-ordered clustering for bounding volume hierarchy construction"). It
//! joins each box with its nearest neighbour in a window, which takes quadratic time where many
//! boxes are equal. A texture that is tiled over a mesh gives thousands of triangles the same `vt`
//! and so the same box. Here each box therefore enters the tree once, and its leaf lists all
//! copies.
//!
//! Cost: about 0.1 µs a triangle to build, the logarithm of their number to search. Not promised:
//! exact answers. Boxes are rounded outward to `f32`, so the caller checks every candidate.

use std::collections::{HashMap, HashSet};
use std::time::Duration;

use glam::{DVec2, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

use crate::ids::index32;

/// Boxes that are sampled to find out whether there are many copies. If a hundredth of all boxes
/// are copies of one, two of them are in the sample nearly always. Fewer copies cost little. A
/// larger sample costs time on every mesh, a smaller one overlooks copies that make the builder
/// slow.
const SAMPLE_SIZE: usize = 256;

/// The bounding box of points in `f32`, rounded outward, since the BVH knows no `f64`.
pub(super) fn outer_box(points: impl Iterator<Item = DVec2> + Clone) -> Aabb {
    let low = points.clone().fold(DVec2::INFINITY, DVec2::min);
    let high = points.fold(DVec2::NEG_INFINITY, DVec2::max);
    // The cast rounds to nearest, by half a step at most. One step outward therefore always covers
    // the point; without it, points on a box's side would be missed.
    #[expect(clippy::cast_possible_truncation, reason = "rounded outward right after")]
    let (low, high) = (
        low.to_array().map(|x| (x as f32).next_down()),
        high.to_array().map(|x| (x as f32).next_up()),
    );
    Aabb::new(Vec3A::new(low[0], low[1], 0.0), Vec3A::new(high[0], high[1], 0.0))
}

/// Builds the tree over boxes, of which there is at least one.
pub(super) fn tree(boxes: &[Aabb]) -> Bvh2 {
    let mut seen = HashSet::new();
    let mut sample = boxes.iter().step_by(boxes.len().div_ceil(SAMPLE_SIZE));
    if sample.all(|sampled| seen.insert(bits(sampled))) {
        return build(boxes);
    }
    // Each different box, and the numbers of all its copies.
    let mut numbers = HashMap::new();
    let mut different: Vec<Aabb> = Vec::new();
    let mut copies: Vec<Vec<u32>> = Vec::new();
    for (number, one) in (0..).zip(boxes) {
        let at = *numbers.entry(bits(one)).or_insert_with(|| {
            different.push(*one);
            copies.push(Vec::new());
            copies.len() - 1
        });
        copies[at].push(number);
    }
    let mut tree = build(&different);
    // A leaf of the tree over different boxes becomes a leaf over all their copies.
    let mut all = Vec::with_capacity(boxes.len());
    for node in tree.nodes.iter_mut().filter(|node| node.prim_count > 0) {
        let first = index32(all.len());
        for slot in node.first_index..node.first_index + node.prim_count {
            all.extend(&copies[tree.primitive_indices[slot as usize] as usize]);
        }
        (node.first_index, node.prim_count) = (first, index32(all.len()) - first);
    }
    tree.primitive_indices = all;
    tree
}

fn build(boxes: &[Aabb]) -> Bvh2 {
    let mut build_time = Duration::ZERO;
    build_bvh2(boxes, BvhBuildParams::fastest_build(), &mut build_time)
}

/// A box as a key of a hash table.
fn bits(aabb: &Aabb) -> [u32; 4] {
    [aabb.min.x, aabb.min.y, aabb.max.x, aabb.max.y].map(f32::to_bits)
}

/// Calls `visit` for every triangle whose box meets `around`, and for some whose boxes only come
/// near.
pub(super) fn visit_boxes(bvh: &Bvh2, around: Aabb, mut visit: impl FnMut(u32)) {
    bvh.aabb_traverse(around, |bvh, node| {
        let node = &bvh.nodes[node as usize];
        for slot in node.first_index..node.first_index + node.prim_count {
            visit(bvh.primitive_indices[slot as usize]);
        }
        true
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copies_of_a_box_are_all_found_and_soon() {
        let square = |x: f64| outer_box([DVec2::new(x, 0.0), DVec2::new(x + 0.5, 1.0)].into_iter());
        // Half a million of two boxes: joined one by one they would take hours.
        let boxes: Vec<Aabb> =
            (0..500_000).map(|number| square(f64::from(number % 2))).chain([square(7.0)]).collect();
        let tree = tree(&boxes);
        let found = |x: f64| {
            let mut found = Vec::new();
            visit_boxes(&tree, outer_box([DVec2::new(x, 0.5)].into_iter()), |number| {
                found.push(number);
            });
            found.sort_unstable();
            found
        };
        assert!(found(0.2).into_iter().eq((0..500_000).step_by(2)));
        assert!(found(1.2).into_iter().eq((1..500_000).step_by(2)));
        assert_eq!((found(7.2), found(3.0)), (vec![500_000], vec![]));
    }
}
