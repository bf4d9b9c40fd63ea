//! Building of the hierarchy from the top down.
//!
//! In: the boxes of items, which are leaves, or shapes to be put into leaves. Out: [`Node`]s with
//! up to eight children each, and the order of the items in them. A node is split in two along the
//! plane of least cost by the surface area heuristic with bins (Wald 2007, 'On fast construction of
//! SAH-based bounding volume hierarchies'), then the largest part again, until there are eight.
//!
//! Large parts are built in parallel. Each part depends on its own items alone, so the nodes are
//! the same for any number of threads. Cost: n log n for n items.

use glam::Vec3A;
use rayon::prelude::*;

use super::lanes::LANES;
use warpknit_core::ids::index32;

/// Marks a child that is a leaf; the other bits are the place of its first item in the order.
pub(crate) const LEAF: u32 = 1 << 31;
/// Bins along each axis. More find better planes and take longer. Other numbers were not measured.
const BINS: usize = 16;
/// Parts of at least as many items are built as tasks of their own.
const ITEMS_PER_TASK: usize = 4096;
/// Levels after which parts are halved by number, so that none is deeper than [`MAX_DEPTH`].
const LEVELS_BY_COST: u32 = 12;
/// Most levels: those by cost, and the eight-fold divisions that 2^31 leaves need.
const MAX_DEPTH: usize = LEVELS_BY_COST as usize + 11;
/// Most nodes and leaves that wait while one is visited: seven siblings a level.
pub(crate) const MAX_WAITING: usize = MAX_DEPTH * (LANES - 1) + 1;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Box3 {
    pub(crate) min: Vec3A,
    pub(crate) max: Vec3A,
}

impl Box3 {
    /// The box that holds nothing.
    pub(crate) const EMPTY: Self =
        Self { min: Vec3A::splat(f32::INFINITY), max: Vec3A::splat(f32::NEG_INFINITY) };

    pub(crate) const fn of_point(point: Vec3A) -> Self {
        Self { min: point, max: point }
    }

    /// The box with this much more on each side.
    pub(crate) fn grown(self, by: Vec3A) -> Self {
        Self { min: self.min - by, max: self.max + by }
    }

    pub(crate) fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Half of the surface, and 0 for an empty box.
    pub(crate) fn half_area(&self) -> f32 {
        let side = (self.max - self.min).max(Vec3A::ZERO);
        side.x * side.y + side.y * side.z + side.z * side.x
    }

    /// Twice the centre.
    fn double_centre(&self) -> Vec3A {
        self.min + self.max
    }
}

/// Up to eight boxes with what is in them.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Node {
    /// For each axis the lower and the upper faces of the eight boxes. Boxes of absent children lie
    /// at infinity, the wrong way round.
    pub(crate) faces: [[[f32; LANES]; 2]; 3],
    /// Numbers of nodes, or of leaves with the bit [`LEAF`].
    pub(crate) children: [u32; LANES],
}

impl Node {
    const EMPTY: Self = Self {
        faces: [[[f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]]; 3],
        children: [0; LANES],
    };

    fn set(&mut self, lane: usize, around: &Box3, child: u32) {
        for axis in 0..3 {
            self.faces[axis][0][lane] = around.min[axis];
            self.faces[axis][1][lane] = around.max[axis];
        }
        self.children[lane] = child;
    }
}

/// An item while the tree is built.
#[derive(Clone, Copy, Debug)]
struct Item {
    around: Box3,
    number: u32,
}

/// Builds the nodes over items with these boxes; the first node is the root. Leaves have up to
/// `most` of them, one or eight. Also the items' numbers in the order in which the nodes count
/// them.
pub(crate) fn build(boxes: &[Box3], most: usize) -> (Vec<Node>, Vec<u32>) {
    debug_assert!(most == 1 || most == LANES, "leaves have as many items as lanes, or one");
    let mut items: Vec<Item> =
        (0..).zip(boxes).map(|(number, &around)| Item { around, number }).collect();
    let mut nodes = Vec::new();
    subtree(&mut items, (0, most), 0, &mut nodes);
    nodes.shrink_to_fit();
    (nodes, items.iter().map(|item| item.number).collect())
}

/// Numbers the leaves of nodes over `items` items in their order, and gives the places at which
/// they begin, and the end of the last one.
pub(crate) fn number_leaves(nodes: &mut [Node], items: usize) -> Vec<u32> {
    // An absent child is node 0, and no leaf.
    let children = nodes.iter().flat_map(|node| node.children);
    let leaves = children.filter(|child| child & LEAF != 0);
    let mut starts: Vec<u32> = leaves.map(|child| child & !LEAF).collect();
    starts.sort_unstable();
    let mut numbers = vec![0; items];
    starts.iter().zip(0..).for_each(|(&start, number)| numbers[start as usize] = number);
    let children = nodes.iter_mut().flat_map(|node| &mut node.children);
    children
        .filter(|child| **child & LEAF != 0)
        .for_each(|child| *child = LEAF | numbers[(*child & !LEAF) as usize]);
    starts.push(index32(items));
    starts
}

/// Appends the nodes over `items`, the first of which is number `first` in their order. Leaves have
/// up to `most`. Items are put in that order.
fn subtree(items: &mut [Item], (first, most): (u32, usize), depth: u32, nodes: &mut Vec<Node>) {
    let parts = parts(items, most, depth);
    let own = nodes.len();
    nodes.push(Node::EMPTY);
    let mut rest = items;
    let mut place = first;
    let mut large = Vec::new();
    for (lane, part) in parts.iter().enumerate() {
        let (part_items, after) = rest.split_at_mut(part.count);
        rest = after;
        let child = if part.count <= most {
            LEAF | place
        } else if part.count < ITEMS_PER_TASK {
            let child = index32(nodes.len());
            subtree(part_items, (place, most), depth + 1, nodes);
            child
        } else {
            large.push((lane, part_items, place));
            0
        };
        nodes[own].set(lane, &part.around, child);
        place += index32(part.count);
    }
    let built: Vec<(usize, Vec<Node>)> = large
        .into_par_iter()
        .map(|(lane, items, place)| {
            let mut nodes = Vec::new();
            subtree(items, (place, most), depth + 1, &mut nodes);
            (lane, nodes)
        })
        .collect();
    for (lane, part) in built {
        let shift = index32(nodes.len());
        nodes[own].children[lane] = shift;
        nodes.extend(part.into_iter().map(|mut node| {
            let used = node.children.iter_mut().zip(&node.faces[0][0]);
            for (child, _) in used.filter(|(child, face)| face.is_finite() && **child & LEAF == 0) {
                *child += shift;
            }
            node
        }));
    }
}

/// Consecutive items of a node.
#[derive(Clone, Copy, Debug)]
struct NodeItems {
    start: usize,
    count: usize,
    around: Box3,
}

/// Divides items into at most eight parts, one for each child. They are put in the parts' order.
fn parts(items: &mut [Item], most: usize, depth: u32) -> Vec<NodeItems> {
    let around = bounds(items);
    let mut parts = Vec::with_capacity(LANES);
    if items.len() <= LANES {
        let leaves = items.chunks(most).zip((0..).step_by(most));
        parts.extend(leaves.map(|(items, start)| NodeItems {
            start,
            count: items.len(),
            around: bounds(items),
        }));
        return parts;
    }
    parts.push(NodeItems { start: 0, count: items.len(), around });
    while parts.len() < LANES {
        // The part that most rays enter, as long as one node cannot hold it.
        let by_number = depth >= LEVELS_BY_COST;
        let size =
            |part: &NodeItems| if by_number { part.count as f32 } else { part.around.half_area() };
        let divisible = (0..parts.len()).filter(|&part| parts[part].count > LANES);
        let largest = divisible.max_by(|&a, &b| size(&parts[a]).total_cmp(&size(&parts[b])));
        let Some(index) = largest else { break };
        let part = parts[index];
        let own = &mut items[part.start..part.start + part.count];
        let count = if by_number { halve(own) } else { divide(own) };
        let (lower, upper) = own.split_at(count);
        let (lower, upper) = (bounds(lower), bounds(upper));
        parts[index] = NodeItems { count, around: lower, ..part };
        let after =
            NodeItems { start: part.start + count, count: part.count - count, around: upper };
        parts.insert(index + 1, after);
    }
    parts
}

fn bounds(items: &[Item]) -> Box3 {
    items.iter().fold(Box3::EMPTY, |around, item| around.union(item.around))
}

/// What falls into a bin.
#[derive(Clone, Copy)]
struct Bin {
    around: Box3,
    count: usize,
}

impl Bin {
    const EMPTY: Self = Self { around: Box3::EMPTY, count: 0 };

    fn union(self, other: Self) -> Self {
        Self { around: self.around.union(other.around), count: self.count + other.count }
    }

    /// Cost of tests in this bin: the rays that enter it, times its items.
    fn cost(&self) -> f32 {
        self.around.half_area() * self.count as f32
    }
}

/// Divides items by the plane of least cost; the number of those below it. Neither side is empty.
fn divide(items: &mut [Item]) -> usize {
    let centres = items.iter().fold(Box3::EMPTY, |around, item| {
        let centre = item.around.double_centre();
        Box3 { min: around.min.min(centre), max: around.max.max(centre) }
    });
    let extent = centres.max - centres.min;
    // Just below the number of bins, so that the last centre falls into the last bin.
    let scale = Vec3A::select(
        extent.cmpgt(Vec3A::ZERO),
        Vec3A::splat(BINS as f32 * 0.999_99) / extent,
        Vec3A::ZERO,
    );
    let bin_of = |item: &Item, axis: usize| {
        to_bin((item.around.double_centre()[axis] - centres.min[axis]) * scale[axis])
    };
    let mut bins = [[Bin::EMPTY; BINS]; 3];
    for item in items.iter() {
        for (axis, bins) in bins.iter_mut().enumerate() {
            let bin = &mut bins[bin_of(item, axis)];
            bin.around = bin.around.union(item.around);
            bin.count += 1;
        }
    }
    let mut best = (f32::INFINITY, 0, 0);
    for (axis, bins) in bins.iter().enumerate() {
        // Costs of what lies above each plane, then those below it are added.
        let mut above = [0.0; BINS];
        let mut sum = Bin::EMPTY;
        for plane in (1..BINS).rev() {
            sum = sum.union(bins[plane]);
            above[plane] = sum.cost();
        }
        let mut sum = Bin::EMPTY;
        for plane in 1..BINS {
            sum = sum.union(bins[plane - 1]);
            let cost = sum.cost() + above[plane];
            if cost < best.0 && sum.count > 0 && sum.count < items.len() {
                best = (cost, axis, plane);
            }
        }
    }
    let (cost, axis, plane) = best;
    // All centres in one place, or a box that is not finite.
    if cost == f32::INFINITY {
        return halve(items);
    }
    let mut below = 0;
    for index in 0..items.len() {
        if bin_of(&items[index], axis) < plane {
            items.swap(index, below);
            below += 1;
        }
    }
    below
}

/// The bin at this place.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rounding is meant")]
fn to_bin(place: f32) -> usize {
    (place as usize).min(BINS - 1)
}

/// Divides items into two halves along the longest axis; the number of the first half.
fn halve(items: &mut [Item]) -> usize {
    let around = bounds(items);
    let axis = (around.max - around.min).max_position();
    let half = items.len() / 2;
    items.select_nth_unstable_by(half, |a, b| {
        let (one, other) = (a.around.double_centre()[axis], b.around.double_centre()[axis]);
        one.total_cmp(&other).then(a.number.cmp(&b.number))
    });
    half
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Boxes along a helix, some of them in one place.
    fn boxes(count: u32) -> Vec<Box3> {
        (0..count)
            .map(|i| {
                let turn = (i - i % 3) as f32 * 0.01;
                Box3::of_point(Vec3A::new(turn.cos(), turn.sin(), turn * 0.1))
                    .grown(Vec3A::splat(0.02))
            })
            .collect()
    }

    /// Leaves below a node, with the depth of the deepest.
    fn leaves(nodes: &[Node], node: u32, depth: usize, found: &mut Vec<u32>) -> usize {
        let node = &nodes[node as usize];
        let lanes = (0..LANES).filter(|&lane| node.faces[0][0][lane].is_finite());
        let depths = lanes.map(|lane| match node.children[lane] {
            leaf if leaf & LEAF != 0 => {
                found.push(leaf & !LEAF);
                depth
            }
            child => leaves(nodes, child, depth + 1, found),
        });
        depths.max().unwrap_or(depth)
    }

    #[test]
    fn each_leaf_is_in_the_tree_once_and_no_branch_is_too_deep() {
        for count in [0, 1, 7, 9, 300, 20_000] {
            let (nodes, mut order) = build(&boxes(count), 1);
            let mut found = Vec::new();
            assert!(leaves(&nodes, 0, 1, &mut found) <= MAX_DEPTH);
            assert!(found.iter().copied().eq(0..count), "leaves lie in the order of the nodes");
            order.sort_unstable();
            assert!(order.into_iter().eq(0..count));
        }
    }

    #[test]
    fn leaves_of_eight_hold_each_item_once() {
        for count in [0, 1, 7, 8, 9, 65, 300, 20_000] {
            let (mut nodes, order) = build(&boxes(count), LANES);
            let starts = number_leaves(&mut nodes, order.len());
            let mut found = Vec::new();
            assert!(leaves(&nodes, 0, 1, &mut found) <= MAX_DEPTH);
            assert!(found.iter().copied().eq(0..index32(starts.len()) - 1));
            let sizes = starts.windows(2).map(|ends| ends[1] - ends[0]);
            assert!(sizes.clone().all(|size| (1..=8).contains(&size)), "{count}");
            assert_eq!(sizes.sum::<u32>(), count);
        }
    }

    #[test]
    fn boxes_in_one_place_and_growing_ones_stay_shallow() {
        let same = vec![Box3::of_point(Vec3A::ONE); 5000];
        let growing: Vec<Box3> =
            (0_u8..120).map(|i| Box3::of_point(Vec3A::splat(2.0_f32.powi(i32::from(i))))).collect();
        for boxes in [same, growing] {
            let (nodes, _) = build(&boxes, 1);
            assert!(leaves(&nodes, 0, 1, &mut Vec::new()) <= MAX_DEPTH);
        }
    }

    #[test]
    fn the_tree_is_the_same_for_any_number_of_threads() {
        let boxes = boxes(40_000);
        let by = |threads, most| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let (nodes, order) = pool.install(|| build(&boxes, most));
            let bits = |node: &Node| {
                (node.faces.map(|pair| pair.map(|f| f.map(f32::to_bits))), node.children)
            };
            (nodes.iter().map(bits).collect::<Vec<_>>(), order)
        };
        assert!(by(1, 1) == by(3, 1));
        assert!(by(1, LANES) == by(3, LANES));
    }
}
