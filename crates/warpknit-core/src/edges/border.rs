//! The borders of panels: which of them were sewn to another, and which are open.
//!
//! In: the panels of a garment, each with its [`Locator`]. Out: [`BorderRun`]s, stretches of border that are
//! sewn or open along their whole length and have no corner inside.
//!
//! Borders without area, such as slits along defects, and small holes are left out.
//!
//! Method: an edge is sewn if its middle lies on the border of another panel, or on a part of its own
//! panel's border that is far from it in the flat pattern. Segments of border are looked up in a grid.
//!
//! Cost: linear in the border's edges. Not promised: that edges which lie on each other by chance are
//! distinguished from sewn ones.

use std::collections::{HashMap, HashSet};

use glam::{DVec2, DVec3};

use crate::garment::Panel;
use crate::locate::Locator;
use crate::number::double;
use crate::yarn::curve::nearest_on_segment;

/// Distance up to which borders count as sewn, mm. Simulations leave gaps of some tenths. Layers of
/// cloth, which lie farther apart, must not count as sewn.
const SEWN: f64 = 2.0;
/// Distance in the flat pattern from which on two parts of one border may be sewn, mm. Nearer ones are
/// neighbours on a bend.
const FAR: f64 = 20.0;
/// Cosine of the largest turn of a run, 40 degrees. At a larger one the run ends, as at the corner of
/// a placket.
const STRAIGHT: f64 = 0.766;
/// Length up to which the border of a hole is left raw, mm: a buttonhole.
const HOLE: f64 = 100.0;
/// Mean width up to which what a border encloses is a slit, mm.
const SLIT: f64 = 0.5;
/// Length of open border that counts as sewn if both its neighbours are, mm: the tip of a dart.
const SHORTEST: f64 = 15.0;

/// One edge of a border, with the panel to its left.
#[derive(Clone, Copy, Debug)]
struct BorderEdge {
    ends: [u32; 2],
    triangle: u32,
    is_sewn: bool,
    /// Whether cloth that can't be knitted goes on behind it.
    is_lost: bool,
}

/// A stretch of border.
#[derive(Clone, Debug)]
pub(super) struct BorderRun {
    /// Its vertices in order, with the panel to the left. A closed one has its first vertex again at
    /// its end.
    pub(super) vertices: Vec<u32>,
    /// A triangle on it, for locating places nearby.
    pub(super) triangle: u32,
    /// The vertices of the border before it and after it. `None` of a closed run.
    pub(super) beyond: Option<[u32; 2]>,
    /// Whether another border is sewn to it.
    pub(super) is_sewn: bool,
}

/// The runs of each panel.
pub(super) fn runs(panels: &[Panel], locators: &[Locator<'_>]) -> Vec<Vec<BorderRun>> {
    let mut borders: Vec<_> =
        panels.iter().zip(locators).map(|(panel, locator)| loops(panel, locator)).collect();
    let segments = BorderSegments::new(panels, &borders);
    for (number, border) in borders.iter_mut().enumerate() {
        for edge in border.iter_mut().flatten() {
            edge.is_sewn = segments.touch(&panels[number], number, edge.ends);
        }
    }
    let runs = panels.iter().zip(&borders);
    runs.map(|(panel, border)| border.iter().flat_map(|edges| cut(panel, edges)).collect())
        .collect()
}

/// The closed curves of a panel's border. One that defects leave open is left out.
fn loops(panel: &Panel, locator: &Locator<'_>) -> Vec<Vec<BorderEdge>> {
    let mut border: Vec<_> = locator.border().collect();
    let sides = panel.flipped.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let defects: HashSet<[u32; 2]> = sides.flat_map(|[a, b]| [[a, b], [b, a]]).collect();
    border.sort_unstable();
    let mut is_used = vec![false; border.len()];
    let mut loops = Vec::new();
    for first in 0..border.len() {
        let (mut at, mut edges) = (first, Vec::new());
        while !is_used[at] {
            is_used[at] = true;
            let (ends, triangle) = border[at];
            let is_lost = defects.contains(&ends);
            edges.push(BorderEdge { ends, triangle, is_sewn: false, is_lost });
            // Where borders meet in one vertex, the first edge that is free goes on.
            let from = border.partition_point(|(edge, _)| edge[0] < ends[1]);
            let next = (from..border.len()).take_while(|&next| border[next].0[0] == ends[1]);
            at = next.into_iter().find(|&next| !is_used[next]).unwrap_or(first);
        }
        let is_closed = |edges: &[BorderEdge]| match edges {
            [first, .., last] => first.ends[0] == last.ends[1],
            _ => false,
        };
        if is_closed(&edges) && encloses_cloth(panel, &edges) {
            loops.push(edges);
        }
    }
    loops
}

/// Whether a closed border has an edge to finish: neither a slit nor a small hole.
fn encloses_cloth(panel: &Panel, edges: &[BorderEdge]) -> bool {
    let (mut twice_area, mut length) = (0.0, 0.0);
    for edge in edges {
        let [a, b] = edge.ends.map(|vertex| panel.uv[vertex as usize]);
        twice_area += a.perp_dot(b);
        length += a.distance(b);
    }
    let is_hole = twice_area < 0.0;
    f64::abs(twice_area) > SLIT * length && !(is_hole && length < HOLE)
}

/// A segment of border.
#[derive(Clone, Copy, Debug)]
struct BorderSegment {
    panel: usize,
    flat: [DVec2; 2],
    draped: [DVec3; 2],
}

/// All segments, by the cells of space that they pass.
struct BorderSegments {
    all: Vec<BorderSegment>,
    side: f64,
    cells: HashMap<[i64; 3], Vec<u32>>,
}

impl BorderSegments {
    fn new(panels: &[Panel], borders: &[Vec<Vec<BorderEdge>>]) -> Self {
        let mut all = Vec::new();
        for (number, border) in borders.iter().enumerate() {
            let panel = &panels[number];
            all.extend(border.iter().flatten().map(|edge| BorderSegment {
                panel: number,
                flat: edge.ends.map(|vertex| panel.uv[vertex as usize]),
                draped: edge.ends.map(|vertex| panel.draped[vertex as usize]),
            }));
        }
        let lengths: f64 = all.iter().map(|segment| segment.length()).sum();
        let side = (lengths / double(all.len().max(1))).max(2.0 * SEWN);
        let mut cells: HashMap<_, Vec<u32>> = HashMap::new();
        for (number, segment) in (0..).zip(&all) {
            let steps = (segment.length() / side).ceil().max(1.0);
            let mut step = 0.0;
            while step <= steps {
                let [a, b] = segment.draped;
                let cell = cells.entry(cell(a.lerp(b, step / steps), side)).or_default();
                if cell.last() != Some(&number) {
                    cell.push(number);
                }
                step += 1.0;
            }
        }
        Self { all, side, cells }
    }

    /// Whether the middle of an edge lies on a border to which it can be sewn.
    fn touch(&self, panel: &Panel, number: usize, ends: [u32; 2]) -> bool {
        let [a, b] = ends.map(|vertex| panel.draped[vertex as usize]);
        let [flat_a, flat_b] = ends.map(|vertex| panel.uv[vertex as usize]);
        let (middle, flat) = (a.midpoint(b), flat_a.midpoint(flat_b));
        let home = cell(middle, self.side);
        around(home).filter_map(|cell| self.cells.get(&cell)).flatten().any(|&other| {
            let other = &self.all[other as usize];
            let can_be = other.panel != number || other.flat_distance(flat) > FAR;
            can_be && other.distance(middle) < SEWN
        })
    }
}

impl BorderSegment {
    fn length(&self) -> f64 {
        self.draped[0].distance(self.draped[1])
    }

    /// Distance of a draped place.
    fn distance(&self, place: DVec3) -> f64 {
        from_segment(place, self.draped)
    }

    /// Distance of a flat place.
    fn flat_distance(&self, place: DVec2) -> f64 {
        from_segment(place.extend(0.0), self.flat.map(|end| end.extend(0.0)))
    }
}

/// Distance of a place from a segment.
pub(super) fn from_segment(place: DVec3, [a, b]: [DVec3; 2]) -> f64 {
    place.distance(a.lerp(b, nearest_on_segment(a, b - a, place)))
}

/// The cell of a place.
#[expect(clippy::cast_possible_truncation, reason = "`as` saturates, so far cells fall together")]
fn cell(place: DVec3, side: f64) -> [i64; 3] {
    (place / side).floor().to_array().map(|number| number as i64)
}

/// A cell and those that touch it.
fn around([x, y, z]: [i64; 3]) -> impl Iterator<Item = [i64; 3]> {
    (0..27).map(move |number| {
        let [i, j, k] = [number % 3, number / 3 % 3, number / 9].map(|step| step - 1);
        [x.saturating_add(i), y.saturating_add(j), z.saturating_add(k)]
    })
}

/// Cuts a closed border into runs.
fn cut(panel: &Panel, edges: &[BorderEdge]) -> Vec<BorderRun> {
    let edges = mended(panel, edges);
    let way = |edge: &BorderEdge| {
        let [a, b] = edge.ends.map(|vertex| panel.uv[vertex as usize]);
        (b - a).normalize_or_zero()
    };
    let count = edges.len();
    let before = |at: usize| &edges[(at + count - 1) % count];
    let is_cut = |at: usize| {
        edges[at].is_sewn != before(at).is_sewn
            || edges[at].is_lost != before(at).is_lost
            || way(&edges[at]).dot(way(before(at))) < STRAIGHT
    };
    let cuts: Vec<usize> = (0..count).filter(|&at| is_cut(at)).collect();
    let Some(&first) = cuts.first() else {
        return vec![run(&edges, 0..count, None)];
    };
    let ends = cuts.iter().skip(1).copied().chain([first + count]);
    let kept = cuts.iter().zip(ends).filter(|(start, _)| !edges[**start].is_lost);
    let runs = kept.map(|(&start, end)| {
        let beyond = [before(start).ends[0], edges[end % count].ends[1]];
        run(&edges, start..end, Some(beyond))
    });
    runs.collect()
}

/// A run of consecutive edges, counted around the border.
fn run(edges: &[BorderEdge], range: std::ops::Range<usize>, beyond: Option<[u32; 2]>) -> BorderRun {
    let first = edges[range.start % edges.len()];
    let ends = range.map(|at| edges[at % edges.len()].ends[1]);
    BorderRun {
        vertices: std::iter::once(first.ends[0]).chain(ends).collect(),
        triangle: first.triangle,
        beyond,
        is_sewn: first.is_sewn,
    }
}

/// The edges, with short open stretches between sewn ones counted as sewn.
fn mended(panel: &Panel, edges: &[BorderEdge]) -> Vec<BorderEdge> {
    let mut mended = edges.to_vec();
    let Some(sewn) = edges.iter().position(|edge| edge.is_sewn) else { return mended };
    // From a sewn edge on, no open stretch goes on past the end.
    mended.rotate_left(sewn);
    let length = |edge: &BorderEdge| {
        let [a, b] = edge.ends.map(|vertex| panel.uv[vertex as usize]);
        a.distance(b)
    };
    for stretch in mended.chunk_by_mut(|one, next| one.is_sewn == next.is_sewn) {
        if stretch.iter().map(length).sum::<f64>() < SHORTEST {
            stretch.iter_mut().for_each(|edge| edge.is_sewn = true);
        }
    }
    mended
}
