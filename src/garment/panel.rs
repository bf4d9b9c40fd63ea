//! Panels: connected pieces of the flat pattern, each fitted to its plane and put in axes of its
//! own.
//!
//! In: [`Pairs`]. Out: [`Piece`]s in the order of their lowest face ([`pieces`]), then, once the
//! scale is known, [`Panel`]s.
//!
//! Two triangles belong to one piece where they share a flat vertex *that is at the same place
//! draped*. The flat vertex alone isn't enough: the left and the right sleeve often share their
//! `vt`, one lying mirrored on the other, while their `v` are elsewhere on the body.

use std::collections::HashMap;
use std::hash::Hash;

use glam::{DAffine3, DMat2, DMat3, DVec2, DVec3};
use robust::{Coord, orient2d};

use super::pair::{Paired, Pairs};
use super::unit::Stretch;
use super::{Panel, ReadOptions};
use crate::ids::index32;

/// A panel that leaves its plane by more than this part of its size is not flat.
const OFF_PLANE: f64 = 0.02;
/// A triangle with less than this part of its panel's flat area can't be told from a line.
const DEGENERATE: f64 = 1e-12;
/// Less area than this, in the file's units, is none: quotients of such areas would leave the range
/// of 64-bit floats.
const LEAST_AREA: f64 = 1e-30;
/// A piece with less flat area than this part of its size squared is a line, too. Atlases hold such
/// scraps, and scaling one to its draped area would make a panel of kilometres.
const SLIVER: f64 = 1e-6;
/// The grain runs along the flat y axis unless that projects to less than this on the panel's
/// plane.
const UPRIGHT: f64 = 0.1;

/// A usable piece of the pattern, in the files' own units.
#[derive(Debug)]
pub(super) struct Piece {
    /// Its triangles that have flat area, in order.
    triangles: Vec<Corners>,
    /// Its plane's unit normal, on the side from which most of its flat area is counter-clockwise.
    normal: DVec3,
    degenerate: usize,
}

/// A triangle of a piece: its pair, and its corners as the piece's vertices.
#[derive(Clone, Copy, Debug)]
struct Corners {
    pair: u32,
    vertices: [u32; 3],
    flipped: bool,
}

/// Why a piece is no panel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Refusal {
    /// All its flat triangles are lines or points.
    NoFlatArea,
    /// All its draped triangles are.
    NoDrapedArea,
    /// It leaves its plane by this part of its size.
    NotFlat(f64),
}

/// A piece that is no panel: why not, its number of triangles and its first polygon.
pub(super) type Refused = (Refusal, usize, u32);

/// Splits the pattern into pieces.
pub(super) fn pieces(pairs: &Pairs) -> Vec<Result<Piece, Refused>> {
    let vertices = vertex_ids(pairs);
    let mut piece_of = HashMap::new();
    let mut members: Vec<Vec<u32>> = Vec::new();
    let mut sets = Sets::new(vertices.iter().flatten().max().map_or(0, |&last| last as usize + 1));
    for [a, b, c] in &vertices {
        sets.join(*a, *b);
        sets.join(*a, *c);
    }
    for (i, [a, _, _]) in vertices.iter().enumerate() {
        let piece = *piece_of.entry(sets.root(*a)).or_insert_with(|| {
            members.push(Vec::new());
            members.len() - 1
        });
        members[piece].push(index32(i));
    }
    let fit = |triangles: Vec<u32>| {
        let polygon = pairs.triangles[triangles[0] as usize].polygon;
        Piece::fit(pairs, &vertices, &triangles)
            .map_err(|refusal| (refusal, triangles.len(), polygon))
    };
    members.into_iter().map(fit).collect()
}

/// One number for each flat vertex at each draped place. Copies of a draped vertex (an unwelded
/// export) are one place, also where rounding put them a little apart.
fn vertex_ids(pairs: &Pairs) -> Vec<[u32; 3]> {
    let same_place = pairs.same_place();
    let mut places: HashMap<u32, Places> = HashMap::new();
    let mut count = 0;
    let mut number = |flat: u32, draped: DVec3| {
        let places = places.entry(flat).or_default();
        places.find(draped, same_place).unwrap_or_else(|| {
            places.add(draped, count, same_place);
            count += 1;
            count - 1
        })
    };
    let corner = |triangle: &Paired| {
        let draped = pairs.draped_corners(triangle);
        std::array::from_fn(|i| number(triangle.flat[i], draped[i]))
    };
    pairs.triangles.iter().map(corner).collect()
}

/// The most places that are searched one by one.
const FEW: usize = 16;

/// Where a flat vertex is when draped, with the number of each place: one or two in a pattern,
/// thousands where a picture's `vt` are tiled over a mesh.
#[derive(Debug, Default)]
struct Places {
    /// All, as long as they are few.
    few: Vec<(DVec3, u32)>,
    /// All, once they are many, by cells twice as large as places may be apart.
    cells: HashMap<[i64; 3], Vec<(DVec3, u32)>>,
}

impl Places {
    /// The first number of a place that is no further off than that.
    fn find(&self, draped: DVec3, same_place: f64) -> Option<u32> {
        let near = |&&(place, _): &&(DVec3, u32)| place.distance(draped) <= same_place;
        if self.cells.is_empty() {
            return self.few.iter().find(near).map(|&(_, number)| number);
        }
        let [x, y, z] = cell(draped, same_place);
        let around = |at: i64| at.saturating_sub(1)..=at.saturating_add(1);
        let cells =
            around(x).flat_map(|x| around(y).flat_map(move |y| around(z).map(move |z| [x, y, z])));
        let found = cells.filter_map(|cell| self.cells.get(&cell)).flatten().filter(near);
        found.map(|&(_, number)| number).min()
    }

    fn add(&mut self, draped: DVec3, number: u32, same_place: f64) {
        if self.cells.is_empty() && self.few.len() < FEW {
            self.few.push((draped, number));
            return;
        }
        for (draped, number) in self.few.drain(..).chain([(draped, number)]) {
            self.cells.entry(cell(draped, same_place)).or_default().push((draped, number));
        }
    }
}

/// The cell of a place, twice as wide as places may be apart, so that rounding puts none of them
/// two cells away; all are one where nothing has an extent.
fn cell(draped: DVec3, same_place: f64) -> [i64; 3] {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "at most some million cells across, by the size's definition; `as` saturates"
    )]
    let cell = (draped / (2.0 * same_place)).to_array().map(|at| at.floor() as i64);
    cell
}

/// Numbers things in the order in which they first come.
#[derive(Debug)]
struct VertexNumbers<K>(HashMap<K, u32>);

impl<K> Default for VertexNumbers<K> {
    fn default() -> Self {
        Self(HashMap::new())
    }
}

impl<K: Eq + Hash> VertexNumbers<K> {
    fn of(&mut self, key: K) -> u32 {
        let next = index32(self.0.len());
        *self.0.entry(key).or_insert(next)
    }
}

/// Disjoint sets, joined by the smaller root and flattened while looking.
struct Sets(Vec<u32>);

impl Sets {
    fn new(count: usize) -> Self {
        Self((0..index32(count)).collect())
    }

    fn root(&mut self, mut x: u32) -> u32 {
        while self.0[x as usize] != x {
            self.0[x as usize] = self.0[self.0[x as usize] as usize];
            x = self.0[x as usize];
        }
        x
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

/// Twice a triangle's area, as a vector along its normal.
pub(super) fn cross([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

impl Piece {
    fn fit(pairs: &Pairs, vertices: &[[u32; 3]], triangles: &[u32]) -> Result<Self, Refusal> {
        let flat = |i: u32| cross(pairs.flat_corners(&pairs.triangles[i as usize]));
        let total: f64 = triangles.iter().map(|&i| flat(i).length()).sum();
        let mut solid: Vec<u32> = triangles.to_vec();
        solid.retain(|&i| total > LEAST_AREA && flat(i).length() >= DEGENERATE * total);
        let largest = solid
            .iter()
            .map(|&i| flat(i))
            .max_by(|a, b| a.length().total_cmp(&b.length()))
            .ok_or(Refusal::NoFlatArea)?;
        let draped_area: f64 = solid
            .iter()
            .map(|&i| cross(pairs.draped_corners(&pairs.triangles[i as usize])).length())
            .sum();
        if draped_area <= LEAST_AREA {
            return Err(Refusal::NoDrapedArea);
        }
        // Every normal is first turned to the largest triangle's side, so that flipped triangles
        // can't cancel the sum.
        let normal: DVec3 =
            solid.iter().map(|&i| flat(i)).map(|n| if n.dot(largest) < 0.0 { -n } else { n }).sum();
        let mut normal = normal.normalize();
        let winding: f64 = solid.iter().map(|&i| flat(i).dot(normal)).sum();
        // Of two equal halves the one that lies face up wins.
        let balanced = winding.abs() <= 1e-9 * total;
        if if balanced { faces_down(normal) } else { winding < 0.0 } {
            normal = -normal;
        }
        let corners = |&i: &u32| Corners {
            pair: i,
            vertices: vertices[i as usize],
            flipped: flat(i).dot(normal) < 0.0,
        };
        let piece = Self {
            triangles: solid.iter().map(corners).collect(),
            normal,
            degenerate: triangles.len() - solid.len(),
        };
        let axes = piece.axes(0.0, false).transpose();
        let [low, high] = bounds(piece.flat_points(pairs).map(|p| axes * p));
        let extent = high - low;
        let size = extent.x.max(extent.y);
        // Half of the thickness: the best plane lies midway.
        let off_plane = 0.5 * extent.z / size;
        if off_plane > OFF_PLANE {
            return Err(Refusal::NotFlat(off_plane));
        }
        if 0.5 * total < SLIVER * size * size {
            return Err(Refusal::NoFlatArea);
        }
        Ok(piece)
    }

    fn flat_points<'a>(&'a self, pairs: &'a Pairs) -> impl Iterator<Item = DVec3> + 'a {
        self.triangles.iter().flat_map(|t| pairs.flat_corners(&pairs.triangles[t.pair as usize]))
    }

    /// Panel axes (columns u, v, w) in the flat mesh's: v along its y, or z where y stands on the
    /// panel, turned by `grain`.
    fn axes(&self, grain: f64, turn: bool) -> DMat3 {
        let normal = if turn { -self.normal } else { self.normal };
        let [right, up] = as_cut(normal);
        let (sin, cos) = grain.sin_cos();
        DMat3::from_cols(right * cos + up * sin, up * cos - right * sin, normal)
    }

    /// Area ratios of its triangles, draped mm² over flat units².
    pub(super) fn stretches(&self, pairs: &Pairs, unit_mm: f64) -> Vec<Stretch> {
        let ratio = |t: &Corners| {
            let pair = &pairs.triangles[t.pair as usize];
            let weight = cross(pairs.flat_corners(pair)).length();
            Stretch {
                ratio: cross(pairs.draped_corners(pair)).length() * unit_mm * unit_mm / weight,
                weight,
            }
        };
        self.triangles.iter().map(ratio).collect()
    }

    /// The panel in mm, and its degenerate triangles: those without area, and slivers so thin that
    /// rounding to panel axes closed them.
    pub(super) fn panel(
        &self,
        pairs: &Pairs,
        scale_mm: f64,
        unit_mm: f64,
        options: &ReadOptions,
    ) -> (Panel, usize) {
        let axes = self.axes(options.grain, options.turn);
        // The middle of the piece is the origin: patterns lie anywhere, and numbers near zero are
        // the most exact.
        let [low, high] = bounds(self.flat_points(pairs).map(|p| axes.transpose() * p));
        let origin = axes * ((low + high) * 0.5) * scale_mm;
        let mut panel = Panel {
            uv: Vec::new(),
            draped: Vec::new(),
            normals: Vec::new(),
            triangles: Vec::new(),
            faces: Vec::new(),
            flipped: Vec::new(),
            flat_from_panel: DAffine3::from_mat3_translation(axes, origin),
            mirrored: faces_down(self.normal),
        };
        let mut numbering = VertexNumbers::default();
        let mut vanished = 0;
        for t in &self.triangles {
            let pair = &pairs.triangles[t.pair as usize];
            let (flat, draped) = (pairs.flat_corners(pair), pairs.draped_corners(pair));
            let uv = flat.map(|p| (axes.transpose() * (p * scale_mm - origin)).truncate());
            // The same cloth seen from behind: the other way round in (u, v), and the other way out
            // on the body.
            let order = if options.turn { [0, 2, 1] } else { [0, 1, 2] };
            if side(order.map(|corner| uv[corner])) != if t.flipped { -1.0 } else { 1.0 } {
                vanished += 1;
                continue;
            }
            let triangle = order.map(|corner| {
                let vertex = numbering.of(t.vertices[corner]);
                if vertex as usize == panel.uv.len() {
                    panel.uv.push(uv[corner]);
                    panel.draped.push(draped[corner] * unit_mm);
                }
                vertex
            });
            if t.flipped {
                panel.flipped.push(triangle);
            } else {
                panel.triangles.push(triangle);
                panel.faces.push(pair.face);
            }
        }
        panel.normals.resize(panel.draped.len(), DVec3::Z);
        panel.order_along_curve();
        // In this order, as for each frame of a sequence, so that the same drape has the same
        // normals to the last bit.
        panel.normals = normals(&panel.draped, &panel.triangles);
        (panel, self.degenerate + vanished)
    }
}

/// Right and up of a piece as it lies in the flat file, seen from the side to which the normal
/// points.
fn as_cut(normal: DVec3) -> [DVec3; 2] {
    let along = |axis: DVec3| axis - normal * axis.dot(normal);
    let up = along(DVec3::Y);
    let up = if up.length() < UPRIGHT { along(DVec3::Z) } else { up }.normalize();
    [up.cross(normal), up]
}

impl Panel {
    /// How far the wale direction is turned from the flat mesh's upright axis, radians,
    /// counter-clockwise seen from the technical face.
    ///
    /// ```
    /// use warpknit::garment::Garment;
    /// let mut garment = Garment::rectangle(100.0, 40.0);
    /// garment.turn_grain(0, 0.25);
    /// assert!((garment.panels[0].grain() - 0.25).abs() < 1e-12);
    /// ```
    #[must_use]
    pub fn grain(&self) -> f64 {
        let axes = self.flat_from_panel.matrix3;
        let [right, up] = as_cut(axes.z_axis);
        (-axes.y_axis.dot(right)).atan2(axes.y_axis.dot(up))
    }

    /// Turns the wale direction further, by `grain` radians counter-clockwise seen from the
    /// technical face, and gives the number of triangles that are lost: slivers so thin that
    /// rounding to the new axes closed them.
    pub(super) fn turn_grain(&mut self, grain: f64) -> usize {
        let old_from_new = DMat2::from_angle(grain);
        let new_from_old = old_from_new.transpose();
        self.uv.iter_mut().for_each(|point| *point = new_from_old * *point);
        self.flat_from_panel *= DAffine3::from_mat3(DMat3::from_mat2(old_from_new));
        let before = self.triangles.len() + self.flipped.len();
        let wound = |triangle: &[u32; 3]| side(triangle.map(|vertex| self.uv[vertex as usize]));
        let kept: Vec<_> = self.triangles.iter().map(|triangle| wound(triangle) > 0.0).collect();
        self.flipped.retain(|triangle| wound(triangle) < 0.0);
        let mut keep = kept.iter();
        self.triangles.retain(|_| *keep.next().expect("one for each triangle"));
        let mut keep = kept.iter();
        self.faces.retain(|_| *keep.next().expect("a face for each triangle"));
        before - self.triangles.len() - self.flipped.len()
    }
}

/// 1 for a counter-clockwise triangle, -1 for a clockwise one, 0 for one so thin that exact and
/// plain arithmetic disagree: location judges by the exact sign, but what divides by the area must
/// not meet the plain one's opposite.
fn side(corners: [DVec2; 3]) -> f64 {
    let [a, b, c] = corners;
    let plain = (b - a).perp_dot(c - a);
    let [a, b, c] = corners.map(|p| Coord { x: p.x, y: p.y });
    if orient2d(a, b, c) * plain > 0.0 { plain.signum() } else { 0.0 }
}

/// Whether a flat normal points against the axis it is nearest to: the piece lies clockwise to
/// somebody who looks down that axis.
fn faces_down(normal: DVec3) -> bool {
    let [x, y, z] = normal.abs().to_array();
    let dominant = if z >= x && z >= y {
        normal.z
    } else if y >= x {
        normal.y
    } else {
        normal.x
    };
    dominant < 0.0
}

fn bounds(points: impl Iterator<Item = DVec3>) -> [DVec3; 2] {
    points.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)])
}

/// Unit vertex normals, each triangle weighted by its angle at the vertex, so that they don't
/// depend on how the cloth was triangulated.
///
/// A vertex of collapsed triangles alone takes the panel's mean normal, and where that vanishes too
/// (a closed or collapsed panel) +z.
pub(super) fn normals(draped: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; draped.len()];
    let mut mean = DVec3::ZERO;
    for triangle in triangles {
        let corners = triangle.map(|vertex| draped[vertex as usize]);
        let area = cross(corners);
        mean += area;
        let normal = area.normalize_or_zero();
        for i in 0..3 {
            let (to_next, to_last) =
                (corners[(i + 1) % 3] - corners[i], corners[(i + 2) % 3] - corners[i]);
            let angle = to_next.cross(to_last).length().atan2(to_next.dot(to_last));
            sums[triangle[i] as usize] += normal * angle;
        }
    }
    let fallback = mean.normalize_or(DVec3::Z);
    sums.into_iter().map(|sum| sum.normalize_or(fallback)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_places_are_found_as_few_are() {
        let mut places = Places::default();
        let mut all: Vec<(DVec3, u32)> = Vec::new();
        let mut state = 7_u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / f64::from(1 << 24)
        };
        let same_place = 0.01;
        for _ in 0..2000 {
            // Some on cells' borders.
            let point = DVec3::new(random(), (random() * 50.0).round() / 50.0, 0.1 * random());
            let first = all
                .iter()
                .find(|(place, _)| place.distance(point) <= same_place)
                .map(|(_, number)| *number);
            assert_eq!(places.find(point, same_place), first, "{point}");
            if first.is_none() {
                let number = index32(all.len());
                places.add(point, number, same_place);
                all.push((point, number));
            }
        }
        assert!(all.len() > 10 * FEW && places.few.is_empty());
        // Nothing that has an extent.
        let mut point = Places::default();
        (0..40).for_each(|number| point.add(DVec3::ONE, number, 0.0));
        assert_eq!(point.find(DVec3::ONE, 0.0), Some(0));
    }
}
