//! Pieces: connected parts of the flat pattern, each with its plane.
//!
//! In: [`Pairs`] whose winding is mended, and their [`Vertices`]. Out: [`Piece`]s in the order of
//! their lowest face ([`pieces`]), or why they are no panels. Once the scale is known they become
//! panels (`panel`).
//!
//! Method: connected components by union-find over the vertices. A plane is fitted by the
//! area-weighted normal. Faces of a piece all agree, so triangles that are clockwise in its plane
//! lie on the other side of a fold. A piece that is folded becomes one piece for each connected
//! side ([`unfold`]), so that none lies over itself there. A lone clockwise triangle is no fold but
//! a defect of the pattern.
//!
//! Cost: linear in the triangles. Not promised: welding of vertices that the flat file has numbered
//! apart; a seam in the flat file is a border of panels.

use std::collections::HashMap;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::pair::Pairs;
use super::panel::{faces_down, flat_axes};
use super::sets::Sets;
use super::unit::AreaRatio;
use super::vertices::Vertices;
use crate::ids::index32;

/// Largest distance of a panel's points from its plane, relative to its size. A larger limit would
/// accept garments at rest on the body as patterns; a much smaller one would refuse pattern pieces
/// that an exporter has bent a little.
const OFF_PLANE: f64 = 0.02;
/// Share of its panel's flat area below which a triangle counts as degenerate. Rounding of 64-bit
/// coordinates makes areas of some 1e-16 of the panel out of nothing; real triangles are far above
/// the limit, even with a million of them in a panel.
const DEGENERATE: f64 = 1e-12;
/// Smallest area, in the square of the file's units, that is not taken for 0. Quotients of smaller
/// areas could leave the range of 64-bit floats.
const MIN_AREA: f64 = 1e-30;
/// Flat area over the square of the size below which a piece counts as a line. Atlases hold such
/// scraps, and scaling one to its draped area would make a panel of kilometres.
const SLIVER: f64 = 1e-6;
/// Triangles on the other side of a fold from which on they are a panel. A single one is a vertex
/// of the pattern that has been pulled over an edge.
const LEAST_FOLD: usize = 2;
/// Share of its piece's flat area from which on a side of a fold is a panel. Less is a wrinkle of
/// the pattern, too small for a stitch.
const LEAST_SIDE: f64 = 1e-3;

/// Area vectors and areas of all pairs.
#[derive(Debug)]
pub(super) struct Areas {
    /// Twice the area vector of each flat triangle.
    flat: Vec<DVec3>,
    /// Twice the area of each draped triangle, square units.
    draped: Vec<f64>,
}

impl Areas {
    /// Measures all pairs.
    pub(super) fn new(pairs: &Pairs) -> Self {
        let all = 0..index32(pairs.len());
        let draped = all.clone().into_par_iter().map(|i| pairs.draped_area(i).length());
        Self {
            draped: draped.collect(),
            flat: all.into_par_iter().map(|i| pairs.flat_area(i)).collect(),
        }
    }

    fn flat(&self, i: u32) -> DVec3 {
        self.flat[i as usize]
    }

    fn draped(&self, i: u32) -> f64 {
        self.draped[i as usize]
    }

    /// Draped area of some triangles, square units.
    pub(super) fn draped_sum<'a>(&self, triangles: impl IntoIterator<Item = &'a u32>) -> f64 {
        0.5 * triangles.into_iter().map(|&i| self.draped(i)).sum::<f64>()
    }

    /// Draped area of all triangles, square units.
    pub(super) fn draped_total(&self) -> f64 {
        0.5 * self.draped.iter().sum::<f64>()
    }
}

/// A usable piece of the pattern, in the files' own units.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    /// Its triangles that have flat area, in order.
    pub(super) triangles: Vec<u32>,
    /// Those of them that are clockwise in its plane.
    flipped: Vec<u32>,
    /// Unit normal of its plane. Seen from its side most of the flat area is counter-clockwise.
    pub(super) normal: DVec3,
    /// Its triangles without flat area.
    pub(super) degenerate: Vec<u32>,
    /// The lowest triangle of the folded piece that it is a side of.
    pub(super) folded: Option<u32>,
}

/// Reasons why a piece is no panel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Refusal {
    /// All its flat triangles are degenerate.
    NoFlatArea,
    /// All its draped triangles are degenerate.
    NoDrapedArea,
    /// Its points lie off its plane by this share of its size.
    NotFlat(f64),
}

/// A piece that is no panel.
#[derive(Clone, Debug)]
pub(super) struct Refused {
    pub(super) reason: Refusal,
    pub(super) triangles: Vec<u32>,
}

/// Splits the pattern into its connected pieces, and those at their folds.
pub(super) fn pieces(
    pairs: &Pairs,
    vertices: &Vertices,
    areas: &Areas,
) -> Vec<Result<Piece, Refused>> {
    let mut all = Vec::new();
    for triangles in connected(vertices) {
        match Piece::fit(pairs, areas, triangles) {
            Ok(piece) => all.extend(unfold(pairs, vertices, areas, piece)),
            refused => all.push(refused),
        }
    }
    all.sort_by_key(|piece| match piece {
        Ok(Piece { triangles, degenerate, .. }) => {
            triangles.iter().chain(degenerate).min().copied()
        }
        Err(refused) => refused.triangles.iter().min().copied(),
    });
    all
}

/// The triangles of each connected piece.
fn connected(vertices: &Vertices) -> Vec<Vec<u32>> {
    const NONE: u32 = u32::MAX;
    let mut sets = Sets::new(vertices.count);
    for &[a, b, c] in vertices.triangles.iter() {
        sets.join(a, b);
        sets.join(a, c);
    }
    let mut piece_of = vec![NONE; vertices.count];
    let mut members: Vec<Vec<u32>> = Vec::new();
    for (&[a, _, _], i) in vertices.triangles.iter().zip(0..) {
        let piece = &mut piece_of[sets.root(a) as usize];
        if *piece == NONE {
            *piece = index32(members.len());
            members.push(Vec::new());
        }
        members[*piece as usize].push(i);
    }
    members
}

/// Splits a piece that is folded over itself: one piece for each connected side of its folds.
fn unfold(
    pairs: &Pairs,
    vertices: &Vertices,
    areas: &Areas,
    piece: Piece,
) -> Vec<Result<Piece, Refused>> {
    if piece.flipped.len() < LEAST_FOLD {
        return vec![Ok(piece)];
    }
    let mut sides = sides(vertices, areas, &piece);
    let area = |side: &[u32]| side.iter().map(|&i| areas.flat(i).length()).sum::<f64>();
    let least = LEAST_SIDE * area(&piece.triangles);
    let Some(largest) = (0..sides.len())
        .filter(|&i| !is_flipped(areas, piece.normal, sides[i][0]))
        .max_by(|&a, &b| area(&sides[a]).total_cmp(&area(&sides[b])).then(b.cmp(&a)))
    else {
        return vec![Ok(piece)];
    };
    let mut main = std::mem::take(&mut sides[largest]);
    let (folds, small): (Vec<_>, Vec<_>) =
        sides.into_iter().partition(|side| side.len() >= LEAST_FOLD && area(side) >= least);
    if folds.is_empty() {
        return vec![Ok(piece)];
    }
    // What is too small stays with the largest side, as the defect that it is.
    main.extend(small.into_iter().flatten());
    main.sort_unstable();
    main.extend(&piece.degenerate);
    let folded = Some(piece.triangles[0]);
    std::iter::once(main)
        .chain(folds)
        .map(|side| Piece::fit(pairs, areas, side).map(|side| Piece { folded, ..side }))
        .collect()
}

/// The triangles of each connected side of a piece's folds, in order. Two triangles are connected
/// where they share a vertex and both are clockwise or neither is.
fn sides(vertices: &Vertices, areas: &Areas, piece: &Piece) -> Vec<Vec<u32>> {
    // The vertices that the piece uses, apart for both windings.
    let mut numbers: HashMap<(u32, bool), u32> = HashMap::new();
    let mut corners = Vec::with_capacity(piece.triangles.len());
    for &i in &piece.triangles {
        let flipped = is_flipped(areas, piece.normal, i);
        corners.push(vertices.triangles[i as usize].map(|vertex| {
            let next = index32(numbers.len());
            *numbers.entry((vertex, flipped)).or_insert(next)
        }));
    }
    let own = Vertices { count: numbers.len(), triangles: corners.into() };
    let mut sides = connected(&own);
    sides.iter_mut().flatten().for_each(|i| *i = piece.triangles[*i as usize]);
    sides
}

/// Whether a flat triangle is clockwise, seen from the side of `normal`.
fn is_flipped(areas: &Areas, normal: DVec3, i: u32) -> bool {
    areas.flat(i).dot(normal) < 0.0
}

impl Piece {
    /// Fits a plane to the triangles of a connected piece, or refuses it.
    fn fit(pairs: &Pairs, areas: &Areas, triangles: Vec<u32>) -> Result<Self, Refused> {
        let refused = |reason, triangles| Err(Refused { reason, triangles });
        let total: f64 = triangles.iter().map(|&i| areas.flat(i).length()).sum();
        let is_solid = |&i: &u32| total > MIN_AREA && areas.flat(i).length() >= DEGENERATE * total;
        let (solid, degenerate): (Vec<u32>, Vec<u32>) =
            triangles.iter().copied().partition(is_solid);
        let largest = solid
            .iter()
            .map(|&i| areas.flat(i))
            .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        let Some(largest) = largest else { return refused(Refusal::NoFlatArea, triangles) };
        if solid.iter().map(|&i| areas.draped(i)).sum::<f64>() <= MIN_AREA {
            return refused(Refusal::NoDrapedArea, triangles);
        }
        let normal = plane(areas, &solid, largest, total);
        let flipped = solid.iter().copied().filter(|&i| is_flipped(areas, normal, i)).collect();
        let piece = Self { triangles: solid, flipped, normal, degenerate, folded: None };
        let [low, high] = piece.bounds(pairs, piece.axes(0.0, false));
        let extent = high - low;
        let size = extent.x.max(extent.y);
        // The best plane lies midway, so the largest distance from it is half of the thickness.
        let off_plane = 0.5 * extent.z / size;
        if off_plane > OFF_PLANE {
            return refused(Refusal::NotFlat(off_plane), triangles);
        }
        if 0.5 * total < SLIVER * size * size {
            return refused(Refusal::NoFlatArea, triangles);
        }
        Ok(piece)
    }

    /// Whether one of its triangles is clockwise in its plane.
    pub(super) fn is_flipped(&self, i: u32) -> bool {
        self.flipped.binary_search(&i).is_ok()
    }

    /// Low and high corner of its bounding box in these axes.
    pub(super) fn bounds(&self, pairs: &Pairs, axes: DMat3) -> [DVec3; 2] {
        let into_axes = axes.transpose();
        let corners = self.triangles.par_iter().flat_map_iter(|&i| pairs.flat_corners(i as usize));
        corners.map(|p| into_axes * p).map(|p| [p, p]).reduce(
            || [DVec3::INFINITY, DVec3::NEG_INFINITY],
            |[low, high], [other_low, other_high]| [low.min(other_low), high.max(other_high)],
        )
    }

    /// The panel's axes as columns u, v, w, in the flat mesh's coordinates. v runs along y, or
    /// along z where y is perpendicular to the panel, turned by `grain`.
    pub(super) fn axes(&self, grain: f64, turn: bool) -> DMat3 {
        let normal = if turn { -self.normal } else { self.normal };
        let [right, up] = flat_axes(normal);
        let (sin, cos) = grain.sin_cos();
        DMat3::from_cols(right * cos + up * sin, up * cos - right * sin, normal)
    }

    /// Area ratios of its triangles: draped mm² over flat units².
    pub(super) fn stretches(&self, areas: &Areas, unit_mm: f64) -> Vec<AreaRatio> {
        let stretch = |&i: &u32| {
            let weight = areas.flat(i).length();
            AreaRatio { ratio: areas.draped(i) * unit_mm * unit_mm / weight, weight }
        };
        self.triangles.iter().map(stretch).collect()
    }
}

/// The unit normal of the plane of some triangles, on the side from which most of their area is
/// counter-clockwise.
fn plane(areas: &Areas, triangles: &[u32], largest: DVec3, total: f64) -> DVec3 {
    // The sum of the area vectors. Each is first turned to the side of the largest triangle:
    // otherwise clockwise triangles could cancel the sum.
    let flat = || triangles.iter().map(|&i| areas.flat(i));
    let sum: DVec3 = flat().map(|n| if n.dot(largest) < 0.0 { -n } else { n }).sum();
    let normal = sum.normalize();
    let winding: f64 = flat().map(|n| n.dot(normal)).sum();
    // Where both halves are equal the sign of the sum is rounding. Then the side that points along
    // the nearest axis is taken.
    let balanced = winding.abs() <= 1e-9 * total;
    if if balanced { faces_down(normal) } else { winding < 0.0 } { -normal } else { normal }
}
