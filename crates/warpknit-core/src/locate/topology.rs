//! Which triangles of a panel are neighbours, and whether the panel lies flat without overlapping
//! itself.
//!
//! Only on a panel that doesn't overlap does "inside this triangle" mean "inside no other", which
//! is what lets a walk over neighbours stand in for a search. [`Topology::embedded`] says so only
//! when it is certain: all triangles are counter-clockwise and hang together by edges, every edge
//! joins at most two of them, the triangles around each inner vertex go round once, those around
//! each border vertex less than once, and no two border edges touch except at a common vertex. Such
//! a panel is an immersed surface whose border is simple curves; the sum of the curves' turning
//! numbers is its Euler characteristic, which leaves one outer curve and holes, so it covers each
//! point at most once. Cost: linear in triangles, plus a sweep over border edges.

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
    /// Cost: about 60 ns a triangle where triangles lie in memory as they do on the panel.
    pub(super) fn new(uv: &[DVec2], triangles: &[[u32; 3]]) -> Self {
        let (neighbours, manifold) = neighbours(uv.len(), triangles);
        let embedded = manifold
            && all_face_up(uv, triangles)
            && is_connected(&neighbours)
            && goes_round_once(uv, triangles, &neighbours)
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
struct Side {
    /// The higher of the edge's two vertices.
    high: u32,
    triangle: u32,
    /// Which edge of the triangle it is, and whether the triangle runs along it from the higher to
    /// the lower vertex.
    edge: u8,
    down: bool,
}

/// Joins triangles along edges that exactly two of them run through, in opposite directions. The
/// flag tells whether no edge has more.
///
/// Sides are put in drawers by the lower vertex of their edge, some three a drawer, so that each
/// finds its partner by looking at a few that lie next to it; a drawer of a hub with more is sorted
/// first. A hash table of edges takes four times as long.
fn neighbours(vertices: usize, triangles: &[[u32; 3]]) -> (Vec<[u32; 3]>, bool) {
    let low = |corners: &[u32; 3], i| {
        let (a, b) = edge(*corners, i);
        a.min(b) as usize
    };
    // Ends of the drawers, of which each becomes its start as it is filled from the back.
    let mut drawers = vec![0_u32; vertices + 1];
    for corners in triangles {
        (0..3).for_each(|i| drawers[low(corners, i)] += 1);
    }
    let mut end = 0;
    for drawer in &mut drawers {
        end += *drawer;
        *drawer = end;
    }
    let mut sides = vec![Side::default(); 3 * triangles.len()];
    for (triangle, corners) in triangles.iter().enumerate() {
        for i in 0..3_u8 {
            let (a, b) = edge(*corners, i.into());
            let slot = &mut drawers[a.min(b) as usize];
            *slot -= 1;
            sides[*slot as usize] =
                Side { high: a.max(b), triangle: index32(triangle), edge: i, down: a > b };
        }
    }
    let mut across = vec![[BORDER; 3]; triangles.len()];
    let mut manifold = true;
    for drawer in drawers.windows(2) {
        let drawer = &mut sides[drawer[0] as usize..drawer[1] as usize];
        if drawer.len() <= FEW {
            manifold &= join(drawer, &mut across);
        } else {
            drawer.sort_unstable_by_key(|side| side.high);
            drawer
                .chunk_by(|one, next| one.high == next.high)
                .for_each(|edge| manifold &= join(edge, &mut across));
        }
    }
    (across, manifold)
}

/// Sides that are looked through in turn; of more, those of one edge are brought together first.
const FEW: usize = 32;

/// Joins the triangles of sides that share both vertices; false where an edge has more than two, or
/// two that run the same way.
fn join(sides: &[Side], across: &mut [[u32; 3]]) -> bool {
    let mut manifold = true;
    for (at, side) in sides.iter().enumerate() {
        let mut others = sides
            .iter()
            .enumerate()
            .filter(|&(other, there)| other != at && there.high == side.high);
        match (others.next(), others.next()) {
            (None, _) => {}
            (Some((_, other)), None) if other.down != side.down => {
                across[side.triangle as usize][usize::from(side.edge)] = other.triangle;
            }
            _ => manifold = false,
        }
    }
    manifold
}

/// Whether every triangle is counter-clockwise, by exact signs: what goes round a vertex is counted
/// on that ground.
fn all_face_up(uv: &[DVec2], triangles: &[[u32; 3]]) -> bool {
    triangles
        .iter()
        .map(|corners| corners.map(|v| uv[v as usize]))
        .all(|[a, b, c]| cross(a, b, c) > 0.0)
}

/// Whether every triangle can be reached from the first; false where there is none.
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

/// Whether the triangles around each inner vertex go round it once, and those around each border
/// vertex less than once.
///
/// Round an inner vertex they go as often as they pass its right, which comparing coordinates
/// counts exactly: a triangle passes it when it runs from below the vertex to its height or above.
/// At the border, where there are few, angles are added up: a turn is two half-turns apart from the
/// next sum that matters, so floating point can't be mistaken.
fn goes_round_once(uv: &[DVec2], triangles: &[[u32; 3]], neighbours: &[[u32; 3]]) -> bool {
    let mut passes = vec![0_u32; uv.len()];
    let mut border_edges = vec![0_u32; uv.len()];
    for (corners, across) in triangles.iter().zip(neighbours) {
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
        // Not once: a vertex of no triangle.
        0 => passes <= 1,
        2 => angle < std::f64::consts::TAU - 1e-9,
        // Two pieces that meet in a point: rare enough to leave to the search.
        _ => false,
    })
}

/// Whether no two border edges touch, except where they share a vertex. A sweep along x over edges
/// sorted by their left ends.
fn border_is_simple(uv: &[DVec2], triangles: &[[u32; 3]], neighbours: &[[u32; 3]]) -> bool {
    let border = triangles.iter().zip(neighbours).flat_map(|(&corners, across)| {
        (0..3).filter(|&i| across[i] == BORDER).map(move |i| edge(corners, i))
    });
    let point = |v: u32| uv[v as usize];
    let left = |&(a, b): &(u32, u32)| point(a).x.min(point(b).x);
    let mut edges: Vec<_> = border.collect();
    edges.sort_by(|e, f| left(e).total_cmp(&left(f)));
    let mut open: Vec<(u32, u32)> = Vec::new();
    for &(a, b) in &edges {
        let (p, q) = (point(a), point(b));
        open.retain(|&(c, d)| point(c).x.max(point(d).x) >= p.x.min(q.x));
        let touches = |&(c, d): &(u32, u32)| {
            let shares_vertex = a == c || a == d || b == c || b == d;
            !shares_vertex && segments_touch(p, q, point(c), point(d))
        };
        if open.iter().any(touches) {
            return false;
        }
        open.push((a, b));
    }
    true
}

fn segments_touch(p: DVec2, q: DVec2, r: DVec2, s: DVec2) -> bool {
    let apart = |low: f64, high: f64, other_low: f64, other_high: f64| {
        low.max(high) < other_low.min(other_high)
    };
    let boxes_apart = apart(p.x, q.x, r.x, s.x)
        || apart(r.x, s.x, p.x, q.x)
        || apart(p.y, q.y, r.y, s.y)
        || apart(r.y, s.y, p.y, q.y);
    let same_side = |a: f64, b: f64| (a > 0.0 && b > 0.0) || (a < 0.0 && b < 0.0);
    !boxes_apart
        && !same_side(cross(p, q, r), cross(p, q, s))
        && !same_side(cross(r, s, p), cross(r, s, q))
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
