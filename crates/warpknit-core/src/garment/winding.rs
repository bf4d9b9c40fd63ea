//! Winding mended: faces wound against the others of their piece.
//!
//! In: [`Pairs`] with their [`Vertices`]. Out: the polygons to be reversed, in both meshes.
//!
//! Modelling tools leave meshes whose faces are wound both ways. Half of them then look flipped in
//! the flat pattern, and would take no stitches, although nothing is wrong with the cloth.
//!
//! Method: two neighbours agree where they run along their common edge in opposite directions.
//! Orientation spreads over such edges by union-find:
//! each polygon is two numbers, as it is and reversed, and an edge joins those that agree. Then each
//! connected piece has two classes, and the smaller one, by draped area, is reversed. Where both are
//! as large, the pattern shall be counter-clockwise; where that says nothing either, the first face
//! stays.
//!
//! An edge of more than two triangles spreads nothing, since its sheets have no common side. On a
//! Möbius strip whose pattern is cut nothing disagrees; on any other the last edge that would
//! contradict the rest is passed over.
//!
//! Cost: linear for meshes in which all agree, which is found without union-find. The edges of
//! others are sorted.

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::pair::Pairs;
use super::panel::faces_down;
use super::sets::Sets;
use super::vertices::Vertices;
use crate::ids::index32;

/// Relative difference up to which the two classes of a piece are taken for equally large, and a
/// pattern's signed area for 0. Sums of a million areas are more exact.
const TIE: f64 = 1e-9;

/// The polygons that are wound against the others of their piece, in ascending order.
pub(super) fn reversed(pairs: &Pairs, vertices: &Vertices) -> Vec<u32> {
    if all_agree(vertices) {
        return Vec::new();
    }
    let ranges: Vec<_> = pairs.polygon_ranges().collect();
    let mut sets = spread(vertices, &ranges);
    let mut classes = vec![Classes::default(); ranges.len()];
    let sides: Vec<_> = (0..index32(ranges.len()))
        .map(|node| {
            // The smallest member of a set belongs to the piece's first polygon.
            let root = sets.root(2 * node);
            (root / 2, root % 2 == 1)
        })
        .collect();
    for (range, &(piece, against)) in ranges.iter().zip(&sides) {
        classes[piece as usize].add(pairs, range.clone(), against);
    }
    let is_reversed = |&(piece, against): &(u32, bool)| {
        let classes = &classes[piece as usize];
        classes.both() && against == classes.first_stays()
    };
    let nodes = ranges.into_iter().zip(&sides).filter(|(_, side)| is_reversed(side));
    nodes.map(|(range, _)| pairs.polygons[range.start]).collect()
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
fn all_agree(vertices: &Vertices) -> bool {
    // Directed edges are sorted by their start, by counting. After this pass the place of each
    // vertex is where its edges begin, after the next where they end.
    let mut places = vec![0_u32; vertices.count];
    vertices.triangles.as_flattened().iter().for_each(|&vertex| places[vertex as usize] += 1);
    let mut begin = 0;
    for place in &mut places {
        (*place, begin) = (begin, begin + *place);
    }
    let mut ends = vec![0_u32; 3 * vertices.triangles.len()];
    for [start, end] in vertices.triangles.iter().flat_map(|&triangle| edges(triangle)) {
        let place = &mut places[start as usize];
        ends[*place as usize] = end;
        *place += 1;
    }
    // The last vertex with an edge to each vertex. A second edge to the same one disagrees.
    let mut last = vec![u32::MAX; vertices.count];
    let mut begin = 0;
    places.iter().zip(0..).all(|(&end, start)| {
        let mut own = ends[begin as usize..end as usize].iter();
        begin = end;
        // An edge of length 0, of a triangle without area, has no direction.
        own.all(|&end| end == start || std::mem::replace(&mut last[end as usize], start) != start)
    })
}

/// Joins the polygons that agree. Polygon `i` is the number `2 i` as it is, and `2 i + 1` reversed.
fn spread(vertices: &Vertices, ranges: &[Range<usize>]) -> Sets {
    // (edge, lower vertex first; polygon; whether it runs from the lower vertex to the higher)
    let mut all: Vec<([u32; 2], u32, bool)> = Vec::with_capacity(3 * vertices.triangles.len());
    for (range, node) in ranges.iter().zip(0..) {
        for [a, b] in vertices.triangles[range.clone()].iter().flat_map(|&corners| edges(corners)) {
            all.push(([a.min(b), a.max(b)], node, a < b));
        }
    }
    all.par_sort_unstable();
    let mut sets = Sets::new(2 * ranges.len());
    for edge in all.chunk_by(|a, b| a.0 == b.0) {
        let &[(ends, a, upward), (_, b, other_upward)] = edge else { continue };
        if ends[0] == ends[1] || a == b {
            continue;
        }
        let against = u32::from(upward == other_upward);
        let contradicts = sets.root(2 * a) == sets.root(2 * b + 1 - against);
        if !contradicts {
            sets.join(2 * a, 2 * b + against);
            sets.join(2 * a + 1, 2 * b + 1 - against);
        }
    }
    sets
}

/// The two classes of a connected piece: its polygons wound as the first one, and the others.
#[derive(Clone, Copy, Debug, Default)]
struct Classes {
    /// Draped area of each.
    draped: [f64; 2],
    /// Number of polygons of each.
    polygons: [u32; 2],
    /// Sum of the flat area vectors, the others' reversed, and of their lengths.
    flat: DVec3,
    flat_length: f64,
}

impl Classes {
    fn add(&mut self, pairs: &Pairs, polygon: Range<usize>, against: bool) {
        let class = usize::from(against);
        self.polygons[class] += 1;
        for i in polygon.map(index32) {
            self.draped[class] += pairs.draped_area(i).length();
            let flat = pairs.flat_area(i);
            self.flat += if against { -flat } else { flat };
            self.flat_length += flat.length();
        }
    }

    /// Whether there are polygons of both classes.
    fn both(&self) -> bool {
        self.polygons.iter().all(|&count| count > 0)
    }

    /// Whether the first polygon's class keeps its winding.
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

    fn vertices(triangles: &[[u32; 3]]) -> Vertices {
        let count = triangles.as_flattened().iter().max().map_or(0, |&last| last as usize + 1);
        Vertices { triangles: Arc::new(triangles.to_vec()), count }
    }

    #[test]
    fn neighbours_agree_where_they_run_along_their_edge_in_opposite_directions() {
        assert!(all_agree(&vertices(&[[0, 1, 2], [2, 1, 3]])));
        assert!(!all_agree(&vertices(&[[0, 1, 2], [1, 2, 3]])));
        assert!(all_agree(&vertices(&[[0, 1, 1], [0, 2, 2]])), "edges without length");
        assert!(!all_agree(&vertices(&[[0, 1, 2], [2, 1, 3], [2, 1, 4]])), "three sheets");
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
