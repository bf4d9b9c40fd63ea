//! Mesh topology of a flat panel: its triangles' neighbours, and whether it overlaps itself.
//!
//! In: positions of vertices and triangles. Out: [`Topology`]: the triangle across each edge, and
//! whether the panel is embedded in its plane, that is, covers no point twice. On an embedded panel
//! "inside this triangle" means "inside no other", so a walk over neighbours may replace a search.
//!
//! Method: [`Topology::embedded`] is set only if all these conditions hold:
//! - All triangles are counter-clockwise and connected by edges.
//! - Every edge joins two of them at most.
//! - The triangles around each inner vertex wind around it once, those around each border vertex
//!   less than once.
//! - No two border edges touch except at a common vertex.
//!
//! Such a panel is an immersed surface whose border consists of simple curves. The turning numbers
//! of these curves add up to its Euler characteristic. That leaves one outer curve and holes, so
//! the panel covers each point once at most.
//!
//! Cost: linear in triangles, plus a sweep over border edges. Not promised: that every embedded
//! panel is recognised. Two parts that meet in a point, for example, are left to the search.

use glam::DVec2;

use super::orient2d::cross;
use crate::ids::index32;

/// No neighbour: the edge is on the border.
pub(super) const BORDER: u32 = u32::MAX;

/// Neighbours of a panel's triangles.
#[derive(Clone, Debug)]
pub(super) struct Topology {
    /// Triangle across edge i (corner i to corner i + 1), or [`BORDER`].
    pub(super) neighbours: Vec<[u32; 3]>,
    /// Whether the panel is certain to cover no point twice.
    pub(super) embedded: bool,
}

impl Topology {
    /// Cost: about 60 ns a triangle if neighbouring triangles lie near each other in memory.
    pub(super) fn new(uv: &[DVec2], triangles: &[[u32; 3]]) -> Self {
        let (neighbours, manifold) = neighbours(uv.len(), triangles);
        let embedded = manifold
            && all_face_up(uv, triangles)
            && is_connected(&neighbours)
            && winds_once(uv, triangles, &neighbours)
            && border_is_simple(uv, triangles, &neighbours);
        Self { neighbours, embedded }
    }
}

/// The vertices of edge `i` of a triangle.
#[inline]
pub(super) fn edge(triangle: [u32; 3], i: usize) -> (u32, u32) {
    (triangle[i], triangle[(i + 1) % 3])
}

/// One triangle's side of an edge.
#[derive(Clone, Copy, Default)]
struct HalfEdge {
    /// The higher of the edge's two vertices.
    high: u32,
    triangle: u32,
    /// The number of the edge in its triangle, 0 to 2.
    edge: u8,
    /// Whether the triangle runs along it from the higher to the lower vertex.
    down: bool,
}

/// Joins triangles along edges through which exactly two of them run, in opposite directions. The
/// flag tells whether the mesh is manifold: no edge has more than two.
///
/// Method: a bucket sort of half-edges by the lower vertex of their edge, some three a bucket. Each
/// half-edge then finds its partner among a few that lie next to it in memory. A hash table of
/// edges takes four times as long.
fn neighbours(vertices: usize, triangles: &[[u32; 3]]) -> (Vec<[u32; 3]>, bool) {
    // The size of each bucket, then by a running sum its end. Filling from the back turns each end
    // into the bucket's start, so no second array is needed.
    let mut buckets = vec![0_u32; vertices + 1];
    for corners in triangles {
        for i in 0..3 {
            let (a, b) = edge(*corners, i);
            buckets[a.min(b) as usize] += 1;
        }
    }
    let mut end = 0;
    for bucket in &mut buckets {
        end += *bucket;
        *bucket = end;
    }
    let mut half_edges = vec![HalfEdge::default(); 3 * triangles.len()];
    for (triangle, corners) in triangles.iter().enumerate() {
        for i in 0..3_u8 {
            let (a, b) = edge(*corners, i.into());
            let slot = &mut buckets[a.min(b) as usize];
            *slot -= 1;
            half_edges[*slot as usize] =
                HalfEdge { high: a.max(b), triangle: index32(triangle), edge: i, down: a > b };
        }
    }
    let mut across = vec![[BORDER; 3]; triangles.len()];
    let mut manifold = true;
    for bucket in buckets.windows(2) {
        let bucket = &mut half_edges[bucket[0] as usize..bucket[1] as usize];
        if bucket.len() <= MAX_UNSORTED {
            manifold &= join(bucket, &mut across);
        } else {
            // The hub of a fan may have thousands of half-edges: comparing all pairs of them would
            // take the square of their number.
            bucket.sort_unstable_by_key(|half_edge| half_edge.high);
            bucket
                .chunk_by(|one, next| one.high == next.high)
                .for_each(|edge| manifold &= join(edge, &mut across));
        }
    }
    (across, manifold)
}

/// Half-edges of a bucket up to which all pairs are compared. Larger buckets are sorted first. Far
/// lower values sort buckets for which comparing is faster; far higher ones make hubs slow.
const MAX_UNSORTED: usize = 32;

/// Joins the triangles of half-edges that share both vertices. Returns false if an edge has more
/// than two, or two that run in the same direction.
fn join(half_edges: &[HalfEdge], across: &mut [[u32; 3]]) -> bool {
    let mut manifold = true;
    for (at, half_edge) in half_edges.iter().enumerate() {
        // All in the bucket share the lower vertex, so an equal higher one means the same edge.
        let mut others = half_edges
            .iter()
            .enumerate()
            .filter(|&(other, there)| other != at && there.high == half_edge.high);
        match (others.next(), others.next()) {
            (None, _) => {}
            (Some((_, other)), None) if other.down != half_edge.down => {
                across[half_edge.triangle as usize][usize::from(half_edge.edge)] = other.triangle;
            }
            _ => manifold = false,
        }
    }
    manifold
}

/// Whether every triangle is counter-clockwise, by the exact orientation predicate. The count of
/// windings around a vertex relies on it.
fn all_face_up(uv: &[DVec2], triangles: &[[u32; 3]]) -> bool {
    triangles
        .iter()
        .map(|corners| corners.map(|v| uv[v as usize]))
        .all(|[a, b, c]| cross(a, b, c) > 0.0)
}

/// Whether every triangle can be reached from the first. False if there is none.
fn is_connected(neighbours: &[[u32; 3]]) -> bool {
    let mut reached = vec![false; neighbours.len()];
    let mut open = vec![0];
    let mut count = 0;
    while let Some(triangle) = open.pop() {
        if let Some(reached) = reached.get_mut(triangle as usize)
            && !std::mem::replace(reached, true)
        {
            count += 1;
            open.extend(neighbours[triangle as usize].iter().filter(|&&next| next != BORDER));
        }
    }
    count > 0 && count == neighbours.len()
}

/// Whether the triangles around each inner vertex wind around it once, and those around each border
/// vertex less than once.
///
/// Method: the winding number of an inner vertex is the number of its triangles that cross the
/// horizontal ray to its right. A triangle crosses it if it runs from below the vertex to its
/// height or above, so comparisons of coordinates count it exactly. At the border, where there are
/// few triangles, angles are added up. Wrong sums differ from a right one by far more than floating
/// point rounds.
fn winds_once(uv: &[DVec2], triangles: &[[u32; 3]], neighbours: &[[u32; 3]]) -> bool {
    let mut passes = vec![0_u32; uv.len()];
    let mut border_edges = vec![0_u32; uv.len()];
    for (corners, across) in triangles.iter().zip(neighbours) {
        // Crossings of the ray: the edge opposite to the vertex passes from below it to its height
        // or above. "Below" excludes the height and "above" includes it, so an edge that ends on
        // the ray counts for one of the two triangles that share the end.
        let heights = corners.map(|v| uv[v as usize].y);
        for i in 0..3 {
            let [own, next, last] = [0, 1, 2].map(|k| heights[(i + k) % 3]);
            passes[corners[i] as usize] += u32::from(next < own && last >= own);
            if across[i] == BORDER {
                let (a, b) = edge(*corners, i);
                border_edges[a as usize] += 1;
                border_edges[b as usize] += 1;
            }
        }
    }
    let mut angles = vec![0.0; uv.len()];
    for corners in triangles {
        for i in (0..3).filter(|&i| border_edges[corners[i] as usize] > 0) {
            let [p, q, r] = [0, 1, 2].map(|k| uv[corners[(i + k) % 3] as usize]);
            angles[corners[i] as usize] += (q - p).angle_to(r - p).abs();
        }
    }
    passes.iter().zip(&angles).zip(&border_edges).all(|((&passes, &angle), &edges)| match edges {
        // An inner vertex; none of its triangles crosses the ray if no triangle uses it.
        0 => passes <= 1,
        2 => angle < std::f64::consts::TAU - 1e-9,
        // Two pieces that meet in a point are rare enough to leave them to the search.
        _ => false,
    })
}

/// Whether no two border edges touch, except where they share a vertex.
///
/// Method: a sweep along x over edges sorted by their left ends (Shamos and Hoey 1976, "Geometric
/// intersection problems"), with a plain list of open edges. That list is short on real panels; if
/// all edges overlap in x, the cost is the square of their number.
fn border_is_simple(uv: &[DVec2], triangles: &[[u32; 3]], neighbours: &[[u32; 3]]) -> bool {
    let border = triangles.iter().zip(neighbours).flat_map(|(&corners, across)| {
        (0..3).filter(|&i| across[i] == BORDER).map(move |i| edge(corners, i))
    });
    let mut edges: Vec<_> = border.map(|(a, b)| (a, b, uv[a as usize], uv[b as usize])).collect();
    edges.sort_by(|(_, _, p, q), (_, _, r, s)| p.x.min(q.x).total_cmp(&r.x.min(s.x)));
    let mut open: Vec<(u32, u32, DVec2, DVec2)> = Vec::new();
    for &(a, b, p, q) in &edges {
        // Edges that end to the left of this one can touch neither it nor any later one.
        open.retain(|(_, _, r, s)| r.x.max(s.x) >= p.x.min(q.x));
        let touches = open.iter().any(|&(c, d, r, s)| {
            let shares_vertex = a == c || a == d || b == c || b == d;
            !shares_vertex && segments_touch(p, q, r, s)
        });
        if touches {
            return false;
        }
        open.push((a, b, p, q));
    }
    true
}

/// Whether two segments have a point in common, ends included. Exact, by orientation predicates.
fn segments_touch(p: DVec2, q: DVec2, r: DVec2, s: DVec2) -> bool {
    // The predicates cannot tell segments on one line apart; their bounding boxes can.
    let boxes_apart = p.max(q).cmplt(r.min(s)).any() || r.max(s).cmplt(p.min(q)).any();
    !boxes_apart
        && !same_sign(cross(p, q, r), cross(p, q, s))
        && !same_sign(cross(r, s, p), cross(r, s, q))
}

/// Whether both are positive or both negative.
fn same_sign(a: f64, b: f64) -> bool {
    (a > 0.0 && b > 0.0) || (a < 0.0 && b < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_embedded(uv: &[(f64, f64)], triangles: &[[u32; 3]]) -> bool {
        let uv: Vec<_> = uv.iter().map(|&(x, y)| DVec2::new(x, y)).collect();
        Topology::new(&uv, triangles).embedded
    }

    #[test]
    fn a_square_is_embedded_and_its_halves_are_neighbours() {
        let uv = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        assert!(is_embedded(&uv, &[[0, 1, 2], [0, 2, 3]]));
        let uv: Vec<_> = uv.iter().map(|&(x, y)| DVec2::new(x, y)).collect();
        assert_eq!(
            Topology::new(&uv, &[[0, 1, 2], [0, 2, 3]]).neighbours,
            [[BORDER, BORDER, 1], [0, BORDER, BORDER]]
        );
    }

    #[test]
    fn overlaps_are_seen() {
        // Two triangles over each other, joined by a third: no edge has three faces, but the border
        // crosses itself.
        let uv = [(0.0, 0.0), (4.0, 0.0), (2.0, 3.0), (4.0, 3.0), (0.0, 2.0)];
        assert!(!is_embedded(&uv, &[[0, 1, 2], [1, 3, 2], [2, 3, 4]]));
        // Three faces on one edge.
        let fan = [(0.0, 0.0), (1.0, 0.0), (0.5, 1.0), (0.5, -1.0), (0.6, 1.0)];
        assert!(!is_embedded(&fan, &[[0, 1, 2], [1, 0, 3], [0, 1, 4]]));
    }

    #[test]
    fn a_hub_of_many_triangles_is_joined_too() {
        let count = 1000_u32;
        let around =
            |k: u32| DVec2::from_angle(std::f64::consts::TAU * f64::from(k) / f64::from(count));
        let uv: Vec<_> = std::iter::once(DVec2::ZERO).chain((0..count).map(around)).collect();
        let triangles: Vec<_> = (0..count).map(|k| [0, 1 + k, 1 + (k + 1) % count]).collect();
        let Topology { neighbours, embedded } = Topology::new(&uv, &triangles);
        assert!(embedded);
        assert!(
            (0..count)
                .all(|k| neighbours[k as usize]
                    == [(k + count - 1) % count, BORDER, (k + 1) % count])
        );
    }

    #[test]
    fn a_double_cone_is_not_embedded() {
        // Eight triangles that go round their middle twice.
        let ring = |k: u32| (f64::from(k) * std::f64::consts::FRAC_PI_2).sin_cos();
        let mut uv = vec![(0.0, 0.0)];
        uv.extend((0..8).map(ring).map(|(sin, cos)| (cos, sin)));
        let triangles: Vec<_> = (0..8).map(|k| [0, 1 + k, 1 + (k + 1) % 8]).collect();
        assert!(!is_embedded(&uv, &triangles));
    }
}
