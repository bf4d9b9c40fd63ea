//! Boxes around triangles, and the tree that finds those in the way of another.
//!
//! In: boxes. Out: a BVH over them, each box once: a builder that joins neighbours by how near they
//! are takes the square of a box's copies, and where a picture's `vt` are tiled over a mesh,
//! thousands of triangles have the same one.

use std::collections::{HashMap, HashSet};
use std::time::Duration;

use glam::{DVec2, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

use crate::ids::index32;

/// Boxes that are looked at to see whether there are many copies. Of a hundredth of all boxes or
/// more two are among them nearly always; fewer copies cost little.
const SAMPLED: usize = 256;

/// A box in `f32` that holds all of the points: rounded outward, since the BVH knows no `f64`.
pub(super) fn outer_box(points: impl Iterator<Item = DVec2> + Clone) -> Aabb {
    #[expect(clippy::cast_possible_truncation, reason = "rounded outward right after")]
    let (down, up) = (|x: f64| (x as f32).next_down(), |x: f64| (x as f32).next_up());
    let low = points.clone().fold(DVec2::INFINITY, DVec2::min);
    let high = points.fold(DVec2::NEG_INFINITY, DVec2::max);
    Aabb::new(Vec3A::new(down(low.x), down(low.y), 0.0), Vec3A::new(up(high.x), up(high.y), 0.0))
}

/// The tree over boxes, of which there is at least one.
pub(super) fn tree(boxes: &[Aabb]) -> Bvh2 {
    let mut seen = HashSet::new();
    let mut sample = boxes.iter().step_by(boxes.len().div_ceil(SAMPLED));
    if sample.all(|sampled| seen.insert(bits(sampled))) {
        return build(boxes);
    }
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

/// A box as what can be looked up.
fn bits(of: &Aabb) -> [u32; 4] {
    [of.min.x, of.min.y, of.max.x, of.max.y].map(f32::to_bits)
}

/// Calls `visit` for every triangle whose box meets another, and for some whose box only comes
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
