//! Winding: faces wound against the others of their piece, which are mended, and panels wound
//! against those that they are sewn to, which are only found.
//!
//! In: [`Pairs`] with their [`Vertices`]. Out: the polygons to be reversed, in both meshes, or the
//! panels.
//!
//! Modelling tools leave meshes whose faces are wound both ways. Half of them then look flipped in
//! the flat pattern, and would take no stitches, although nothing is wrong with the cloth. A whole
//! panel wound against its neighbours may be meant: a collar that folds over shows its technical
//! face on their back, and CLO's designers wind it so.
//!
//! Method: two neighbours agree where they run along their common edge in opposite directions.
//! Orientation spreads over such edges by union-find: each node is two numbers, as it is and
//! reversed, and an edge joins those that agree. Connected nodes have two classes, and the smaller
//! one, by draped area, is the one to be reversed. Where both are as large, the pattern shall be
//! counter-clockwise; where that says nothing either, the first face stays. For faces the nodes are
//! polygons, and the edges those of the pattern. For panels the edges are those that the draped
//! mesh has in common, longest seams first.
//!
//! An edge of more than two triangles spreads nothing, since its sheets have no common side. On a
//! Möbius strip whose pattern is cut nothing disagrees; on any other the last edge that would
//! contradict the rest is passed over. Panels that are sewn with a twist have no common side, and
//! none of them is found: two of which one seam agrees and another doesn't, or a ring of which a
//! seam contradicts the others.
//!
//! Cost: linear for meshes in which all agree, which is found without union-find. The edges of
//! others are sorted.
//!
//! Not promised: seams whose sides have vertices of their own in the draped mesh.

use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::pair::Pairs;
use super::panel::faces_down;
use super::pieces::Piece;
use super::sets::Sets;
use super::vertices::Vertices;
use crate::ids::index32;

/// Relative difference up to which the two classes of a piece are taken for equally large, and a
/// pattern's signed area for 0. Sums of a million areas are more exact.
const TIE: f64 = 1e-9;

/// Share of a seam's length up to which a contradiction is a fault of the mesh and not a twist.
const TWIST: f64 = 0.1;

/// The polygons that are wound against the others of their piece, in ascending order.
pub(super) fn reversed(pairs: &Pairs, vertices: &Vertices) -> Vec<u32> {
    if all_agree(&vertices.triangles, vertices.count) {
        return Vec::new();
    }
    let polygons: Vec<_> = pairs.polygon_ranges().collect();
    let mut node_of = vec![0; pairs.len()];
    for (polygon, node) in polygons.iter().zip(0..) {
        node_of[polygon.clone()].fill(node);
    }
    let edges = common_edges(&vertices.triangles, &node_of);
    let edges = edges.into_iter().map(|Common { nodes, against, .. }| (nodes, against));
    let nodes = smaller_classes(pairs, &node_of, spread(polygons.len(), edges));
    nodes.into_iter().map(|node| pairs.polygons[polygons[node].start]).collect()
}

/// The panels that are wound against those that they are sewn to, in ascending order.
pub(super) fn against_seams(pairs: &Pairs, panels: &[Piece]) -> Vec<usize> {
    // What is no panel is a node of its own, of which nothing is asked.
    let mut panel_of = vec![index32(panels.len()); pairs.len()];
    for (panel, number) in panels.iter().zip(0..) {
        for &i in panel.triangles.iter().chain(&panel.degenerate) {
            panel_of[i as usize] = number;
        }
    }
    // Lengths along which two panels agree and don't.
    let mut lengths: BTreeMap<[u32; 2], [f64; 2]> = BTreeMap::new();
    for Common { ends, nodes, against } in common_edges(&pairs.draped_triangles, &panel_of) {
        let [start, end] = ends.map(|vertex| pairs.draped[vertex as usize]);
        lengths.entry(nodes).or_default()[usize::from(against)] += start.distance(end);
    }
    let mut seams: Vec<_> = lengths
        .into_iter()
        .filter(|([_, last], [along, against])| {
            (*last as usize) < panels.len() && along.min(*against) <= TWIST * along.max(*against)
        })
        .collect();
    let length = |[along, against]: [f64; 2]| along.max(against);
    seams.sort_by(|a, b| length(b.1).total_cmp(&length(a.1)));
    let seams: Vec<_> =
        seams.into_iter().map(|(nodes, [along, against])| (nodes, against > along)).collect();
    let mut sets = spread(panels.len() + 1, seams.iter().copied());
    let mut twisted = HashSet::new();
    for ([a, b], against) in seams {
        if sets.root(2 * a) != sets.root(2 * b + u32::from(against)) {
            twisted.insert(sets.root(2 * a) / 2);
        }
    }
    let is_twisted: Vec<_> = (0..index32(panels.len()))
        .map(|panel| twisted.contains(&(sets.root(2 * panel) / 2)))
        .collect();
    let mut found = smaller_classes(pairs, &panel_of, sets);
    found.retain(|&panel| !is_twisted[panel]);
    found
}

/// The nodes that are in the smaller class of those connected with them, in ascending order.
/// `node_of` is the node of each triangle.
fn smaller_classes(pairs: &Pairs, node_of: &[u32], mut sets: Sets) -> Vec<usize> {
    // The smallest member of a set belongs to its first node.
    let sides: Vec<_> = (0..sets.count() / 2)
        .map(|node| sets.root(2 * node))
        .map(|root| (root as usize / 2, root % 2 == 1))
        .collect();
    let mut classes = vec![Classes::default(); sides.len()];
    for (&node, i) in node_of.iter().zip(0..) {
        let (first, against) = sides[node as usize];
        classes[first].add(pairs, i, against);
    }
    let is_smaller = |&node: &usize| {
        let (first, against) = sides[node];
        classes[first].both() && against == classes[first].first_stays()
    };
    (0..sides.len()).filter(is_smaller).collect()
}

/// Reverses polygons in both meshes and in their vertices. The corners are listed backwards, and
/// the fan is made anew from the first of them, as a file would have it that was wound that way.
/// `polygons` is in ascending order.
pub(super) fn reverse(pairs: &mut Pairs, vertices: Option<&mut Vertices>, polygons: &[u32]) {
    if polygons.is_empty() {
        return;
    }
    let ranges: Vec<_> = pairs
        .polygon_ranges()
        .filter(|range| polygons.binary_search(&pairs.polygons[range.start]).is_ok())
        .collect();
    let meshes = [&mut pairs.flat_triangles, &mut pairs.draped_triangles];
    for triangles in meshes.into_iter().chain(vertices.map(|vertices| &mut vertices.triangles)) {
        let triangles = Arc::make_mut(triangles);
        ranges.iter().for_each(|range| reverse_fan(&mut triangles[range.clone()]));
    }
}

/// Reverses the polygon of a fan.
fn reverse_fan(fan: &mut [[u32; 3]]) {
    let mut corners = vec![fan[0][0], fan[0][1]];
    corners.extend(fan.iter().map(|triangle| triangle[2]));
    corners.reverse();
    for (triangle, edge) in fan.iter_mut().zip(corners[1..].windows(2)) {
        *triangle = [corners[0], edge[0], edge[1]];
    }
}

/// The edges of a triangle, in its direction.
fn edges([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// Whether no two triangles run along an edge in the same direction.
pub(super) fn all_agree(triangles: &[[u32; 3]], vertices: usize) -> bool {
    // Directed edges are sorted by their start, by counting. After this pass the place of each
    // vertex is where its edges begin, after the next where they end.
    let mut places = vec![0_u32; vertices];
    triangles.as_flattened().iter().for_each(|&vertex| places[vertex as usize] += 1);
    let mut begin = 0;
    for place in &mut places {
        (*place, begin) = (begin, begin + *place);
    }
    let mut ends = vec![0_u32; 3 * triangles.len()];
    for [start, end] in triangles.iter().flat_map(|&triangle| edges(triangle)) {
        let place = &mut places[start as usize];
        ends[*place as usize] = end;
        *place += 1;
    }
    // The last vertex with an edge to each vertex. A second edge to the same one disagrees.
    let mut last = vec![u32::MAX; vertices];
    let mut begin = 0;
    places.iter().zip(0..).all(|(&end, start)| {
        let mut own = ends[begin as usize..end as usize].iter();
        begin = end;
        // An edge of length 0, of a triangle without area, has no direction.
        own.all(|&end| end == start || std::mem::replace(&mut last[end as usize], start) != start)
    })
}

/// An edge that two nodes have in common, and no other triangle.
struct Common {
    /// Its vertices, the lower one first.
    ends: [u32; 2],
    nodes: [u32; 2],
    /// Whether both run along it in the same direction, so that they disagree.
    against: bool,
}

/// The edges that two nodes have in common, in order of their vertices. `node_of` is the node of
/// each triangle. Of two nodes the smaller comes first.
fn common_edges(triangles: &[[u32; 3]], node_of: &[u32]) -> Vec<Common> {
    // (edge, lower vertex first; node; whether it runs from the lower vertex to the higher)
    let mut all: Vec<([u32; 2], u32, bool)> = Vec::with_capacity(3 * triangles.len());
    for (&corners, &node) in triangles.iter().zip(node_of) {
        for [a, b] in edges(corners) {
            all.push(([a.min(b), a.max(b)], node, a < b));
        }
    }
    all.par_sort_unstable();
    let common = all.chunk_by(|a, b| a.0 == b.0).filter_map(|edge| {
        let &[(ends, a, upward), (_, b, other_upward)] = edge else { return None };
        let against = upward == other_upward;
        (ends[0] != ends[1] && a != b).then_some(Common { ends, nodes: [a, b], against })
    });
    common.collect()
}

/// Joins nodes that agree. Node `i` is the number `2 i` as it is, and `2 i + 1` reversed. `edges`
/// are two nodes each, and whether they disagree.
fn spread(nodes: usize, edges: impl Iterator<Item = ([u32; 2], bool)>) -> Sets {
    let mut sets = Sets::new(2 * nodes);
    for ([a, b], against) in edges {
        let against = u32::from(against);
        let contradicts = sets.root(2 * a) == sets.root(2 * b + 1 - against);
        if !contradicts {
            sets.join(2 * a, 2 * b + against);
            sets.join(2 * a + 1, 2 * b + 1 - against);
        }
    }
    sets
}

/// The two classes of connected nodes: those wound as the first one, and the others.
#[derive(Clone, Copy, Debug, Default)]
struct Classes {
    /// Draped area of each.
    draped: [f64; 2],
    /// Number of triangles of each.
    triangles: [u32; 2],
    /// Sum of the flat area vectors, the others' reversed, and of their lengths.
    flat: DVec3,
    flat_length: f64,
}

impl Classes {
    fn add(&mut self, pairs: &Pairs, i: u32, against: bool) {
        let class = usize::from(against);
        self.triangles[class] += 1;
        self.draped[class] += pairs.draped_area(i).length();
        let flat = pairs.flat_area(i);
        self.flat += if against { -flat } else { flat };
        self.flat_length += flat.length();
    }

    /// Whether there are triangles of both classes.
    fn both(&self) -> bool {
        self.triangles.iter().all(|&count| count > 0)
    }

    /// Whether the first node's class keeps its winding.
    fn first_stays(&self) -> bool {
        let [first, others] = self.draped;
        if (first - others).abs() > TIE * (first + others) {
            return first > others;
        }
        self.flat.length() <= TIE * self.flat_length || !faces_down(self.flat)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn agree(triangles: &[[u32; 3]]) -> bool {
        let vertices = triangles.as_flattened().iter().max().map_or(0, |&last| last as usize + 1);
        all_agree(triangles, vertices)
    }

    #[test]
    fn neighbours_agree_where_they_run_along_their_edge_in_opposite_directions() {
        assert!(agree(&[[0, 1, 2], [2, 1, 3]]));
        assert!(!agree(&[[0, 1, 2], [1, 2, 3]]));
        assert!(agree(&[[0, 1, 1], [0, 2, 2]]), "edges without length");
        assert!(!agree(&[[0, 1, 2], [2, 1, 3], [2, 1, 4]]), "three sheets");
    }

    #[test]
    fn a_fan_reversed_twice_is_the_same_fan() {
        let mut fan = [[4, 7, 1], [4, 1, 9], [4, 9, 3]];
        reverse_fan(&mut fan);
        assert_eq!(fan, [[3, 9, 1], [3, 1, 7], [3, 7, 4]]);
        reverse_fan(&mut fan);
        assert_eq!(fan, [[4, 7, 1], [4, 1, 9], [4, 9, 3]]);
    }
}
