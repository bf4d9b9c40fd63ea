//! Panels: connected pieces of the flat pattern, each with its plane and axes of its own.
//!
//! In: [`Pairs`]. Out: [`Piece`]s in the order of their lowest face ([`pieces`]). Once the scale is
//! known they become [`Panel`]s.
//!
//! Method: connected components by union-find over flat vertices. Two triangles belong to one piece
//! where they share a flat vertex *that has the same draped position*. A shared flat vertex isn't
//! enough: the left and the right sleeve often share their `vt`, one mirrored onto the other, while
//! their `v` are at different places on the body. A plane is fitted by the area-weighted normal.
//!
//! Cost: linear in the triangles. Not promised: welding of vertices that the flat file has numbered
//! apart; a seam in the flat file is a border of panels.

use std::collections::HashMap;
use std::hash::Hash;

use glam::{DAffine3, DMat2, DMat3, DVec2, DVec3};
use robust::{Coord, orient2d};

use super::pair::Pairs;
use super::unit::Stretch;
use super::{Panel, ReadOptions};
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
/// Shortest projection of the flat y axis onto the panel's plane for which the wales run along it.
/// The axis is 6 degrees from the normal then; nearer to it the projection's direction is
/// arbitrary, and the z axis is used.
const MIN_UPRIGHT: f64 = 0.1;

/// A usable piece of the pattern, in the files' own units.
#[derive(Debug)]
pub(super) struct Piece {
    /// Its triangles that have flat area, in order.
    triangles: Vec<Corners>,
    /// Unit normal of its plane. Seen from its side most of the flat area is counter-clockwise.
    normal: DVec3,
    /// Number of its triangles without flat area.
    degenerate: usize,
}

/// A triangle of a piece: the index of its pair, and its vertices from [`vertex_ids`].
#[derive(Clone, Copy, Debug)]
struct Corners {
    pair: u32,
    vertices: [u32; 3],
    flipped: bool,
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

/// A piece that is no panel: the reason, its number of triangles and its first polygon.
pub(super) type Refused = (Refusal, usize, u32);

/// Splits the pattern into its connected pieces.
pub(super) fn pieces(pairs: &Pairs) -> Vec<Result<Piece, Refused>> {
    let vertices = vertex_ids(pairs);
    let mut sets = Sets::new(vertices.iter().flatten().max().map_or(0, |&last| last as usize + 1));
    for [a, b, c] in &vertices {
        sets.join(*a, *b);
        sets.join(*a, *c);
    }
    // Pieces are numbered as triangles first reach them, so that their order is that of the file.
    let mut piece_of = HashMap::new();
    let mut members: Vec<Vec<u32>> = Vec::new();
    for (i, [a, _, _]) in vertices.iter().enumerate() {
        let piece = *piece_of.entry(sets.root(*a)).or_insert_with(|| {
            members.push(Vec::new());
            members.len() - 1
        });
        members[piece].push(index32(i));
    }
    members
        .into_iter()
        .map(|triangles| {
            let polygon = pairs.triangles[triangles[0] as usize].polygon;
            Piece::fit(pairs, &vertices, &triangles)
                .map_err(|refusal| (refusal, triangles.len(), polygon))
        })
        .collect()
}

/// The vertices of each triangle: one number for each pair of a flat vertex and a draped position.
/// Copies of a draped vertex in an unwelded export are one position, even if rounding has put them
/// a little apart.
fn vertex_ids(pairs: &Pairs) -> Vec<[u32; 3]> {
    let same_place = pairs.same_place();
    let mut places_of: HashMap<u32, Places> = HashMap::new();
    let mut count = 0;
    let mut ids = Vec::with_capacity(pairs.triangles.len());
    for triangle in &pairs.triangles {
        let draped = pairs.draped_corners(triangle);
        ids.push(std::array::from_fn(|i| {
            let places = places_of.entry(triangle.flat[i]).or_default();
            places.find(draped[i], same_place).unwrap_or_else(|| {
                places.add(draped[i], count, same_place);
                count += 1;
                count - 1
            })
        }));
    }
    ids
}

/// Number of positions up to which all are searched in turn. Nearly every flat vertex has one or
/// two, for which a hash map would cost more than it saves. Beyond some tens the search would take
/// quadratic time.
const FEW: usize = 16;

/// The draped positions of a flat vertex, each with its number. A vertex of a pattern has one or
/// two; one of an image tiled over a mesh has thousands. Method: a list, and beyond [`FEW`]
/// positions a cell list (uniform grid, hashed).
#[derive(Debug, Default)]
struct Places {
    /// All positions, as long as they are few.
    few: Vec<(DVec3, u32)>,
    /// All positions, once they are many, by cell.
    cells: HashMap<[i64; 3], Vec<(DVec3, u32)>>,
}

impl Places {
    /// The smallest number of a position at most `same_place` from `draped`.
    fn find(&self, draped: DVec3, same_place: f64) -> Option<u32> {
        let is_same = |&&(place, _): &&(DVec3, u32)| place.distance(draped) <= same_place;
        if self.cells.is_empty() {
            return self.few.iter().find(is_same).map(|&(_, number)| number);
        }
        // A cell is wider than the tolerance, so a match lies in the cell itself or in one of its
        // 26 neighbours.
        let center = cell(draped, same_place);
        let mut found: Option<u32> = None;
        for index in 0..27 {
            let shift = [index % 3 - 1, index / 3 % 3 - 1, index / 9 - 1];
            let neighbour = std::array::from_fn(|axis| center[axis].saturating_add(shift[axis]));
            let places = self.cells.get(&neighbour).into_iter().flatten();
            // The smallest number, as the list gives it: the result must not depend on the cells.
            found =
                found.into_iter().chain(places.filter(is_same).map(|&(_, number)| number)).min();
        }
        found
    }

    /// Adds a position with its number, which is larger than all before.
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

/// The cell of a position. Cells are twice as wide as the tolerance, so that rounding can't put
/// equal positions two cells apart. Where the garment has no extent, all positions are in one cell.
fn cell(draped: DVec3, same_place: f64) -> [i64; 3] {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "some million cells across, by the definition of `same_place`; `as` saturates"
    )]
    let cell = (draped / (2.0 * same_place)).to_array().map(|at| at.floor() as i64);
    cell
}

/// Numbers keys from 0, in the order in which they first occur.
#[derive(Debug)]
struct VertexNumbers<K>(HashMap<K, u32>);

impl<K> Default for VertexNumbers<K> {
    fn default() -> Self {
        Self(HashMap::new())
    }
}

impl<K: Eq + Hash> VertexNumbers<K> {
    /// The number of a key. A new key gets the next number.
    fn number_of(&mut self, key: K) -> u32 {
        let next = index32(self.0.len());
        *self.0.entry(key).or_insert(next)
    }
}

/// Disjoint sets (union-find) with path halving. The smaller root wins a union, so that a set's
/// root is its smallest member, whatever the order of unions.
struct Sets(Vec<u32>);

impl Sets {
    fn new(count: usize) -> Self {
        Self((0..index32(count)).collect())
    }

    /// The root of the set of `x`.
    fn root(&mut self, mut x: u32) -> u32 {
        while self.0[x as usize] != x {
            // Path halving (Tarjan and van Leeuwen, Worst-case analysis of set union algorithms,
            // 1984): each element on the way is attached to its grandparent.
            self.0[x as usize] = self.0[self.0[x as usize] as usize];
            x = self.0[x as usize];
        }
        x
    }

    /// Unites the sets of `a` and `b`.
    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

/// Twice the area vector of a triangle: its length is twice the area, its direction the normal.
pub(super) fn cross([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

impl Piece {
    /// Fits a plane to the triangles of a connected piece, or refuses it.
    fn fit(pairs: &Pairs, vertices: &[[u32; 3]], triangles: &[u32]) -> Result<Self, Refusal> {
        let total: f64 = triangles.iter().map(|&i| pairs.flat_area(i).length()).sum();
        let mut solid: Vec<u32> = triangles.to_vec();
        solid.retain(|&i| total > MIN_AREA && pairs.flat_area(i).length() >= DEGENERATE * total);
        let largest = solid
            .iter()
            .map(|&i| pairs.flat_area(i))
            .max_by(|a, b| a.length().total_cmp(&b.length()))
            .ok_or(Refusal::NoFlatArea)?;
        let draped_area: f64 = solid.iter().map(|&i| pairs.draped_area(i).length()).sum();
        if draped_area <= MIN_AREA {
            return Err(Refusal::NoDrapedArea);
        }
        // The plane's normal is the sum of the area vectors. Each is first turned to the side of
        // the largest triangle: otherwise flipped triangles could cancel the sum.
        let normal: DVec3 = solid
            .iter()
            .map(|&i| pairs.flat_area(i))
            .map(|n| if n.dot(largest) < 0.0 { -n } else { n })
            .sum();
        let mut normal = normal.normalize();
        // Then the normal is put on the side from which most of the area is counter-clockwise.
        let winding: f64 = solid.iter().map(|&i| pairs.flat_area(i).dot(normal)).sum();
        // Where both halves are equal the sign of the sum is rounding. Then the side that points
        // along the nearest axis is taken.
        let balanced = winding.abs() <= 1e-9 * total;
        if if balanced { faces_down(normal) } else { winding < 0.0 } {
            normal = -normal;
        }
        let piece = Self {
            triangles: solid
                .iter()
                .map(|&i| Corners {
                    pair: i,
                    vertices: vertices[i as usize],
                    flipped: pairs.flat_area(i).dot(normal) < 0.0,
                })
                .collect(),
            normal,
            degenerate: triangles.len() - solid.len(),
        };
        let axes = piece.axes(0.0, false).transpose();
        let [low, high] = bounds(piece.flat_points(pairs).map(|p| axes * p));
        let extent = high - low;
        let size = extent.x.max(extent.y);
        // The best plane lies midway, so the largest distance from it is half of the thickness.
        let off_plane = 0.5 * extent.z / size;
        if off_plane > OFF_PLANE {
            return Err(Refusal::NotFlat(off_plane));
        }
        if 0.5 * total < SLIVER * size * size {
            return Err(Refusal::NoFlatArea);
        }
        Ok(piece)
    }

    /// Flat corners of all its triangles.
    fn flat_points<'a>(&'a self, pairs: &'a Pairs) -> impl Iterator<Item = DVec3> + 'a {
        self.triangles.iter().flat_map(|t| pairs.flat_corners(&pairs.triangles[t.pair as usize]))
    }

    /// The panel's axes as columns u, v, w, in the flat mesh's coordinates. v runs along y, or
    /// along z where y is perpendicular to the panel, turned by `grain`.
    fn axes(&self, grain: f64, turn: bool) -> DMat3 {
        let normal = if turn { -self.normal } else { self.normal };
        let [right, up] = flat_axes(normal);
        let (sin, cos) = grain.sin_cos();
        DMat3::from_cols(right * cos + up * sin, up * cos - right * sin, normal)
    }

    /// Area ratios of its triangles: draped mm² over flat units².
    pub(super) fn stretches(&self, pairs: &Pairs, unit_mm: f64) -> Vec<Stretch> {
        self.triangles
            .iter()
            .map(|t| {
                let pair = &pairs.triangles[t.pair as usize];
                let weight = cross(pairs.flat_corners(pair)).length();
                let draped = cross(pairs.draped_corners(pair)).length();
                Stretch { ratio: draped * unit_mm * unit_mm / weight, weight }
            })
            .collect()
    }

    /// The panel in mm, and its number of degenerate triangles: those without area, and slivers so
    /// thin that rounding to panel axes has closed them.
    pub(super) fn panel(
        &self,
        pairs: &Pairs,
        scale_mm: f64,
        unit_mm: f64,
        options: &ReadOptions,
    ) -> (Panel, usize) {
        let axes = self.axes(options.grain, options.turn);
        // The origin is the middle of the bounding box. A pattern may lie anywhere in its file, and
        // floating-point numbers are most exact near zero.
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
        let mut numbers = VertexNumbers::default();
        let mut vanished = 0;
        for t in &self.triangles {
            let pair = &pairs.triangles[t.pair as usize];
            let (flat, draped) = (pairs.flat_corners(pair), pairs.draped_corners(pair));
            let uv = flat.map(|p| (axes.transpose() * (p * scale_mm - origin)).truncate());
            // A turned panel is the same cloth seen from behind. Swapping two corners keeps the
            // winding counter-clockwise in (u, v) and reverses it on the body.
            let order = if options.turn { [0, 2, 1] } else { [0, 1, 2] };
            // Rounding to panel axes may have closed or turned over a thin triangle. Location and
            // mapping rely on the winding, so such a triangle is left out.
            if side(order.map(|corner| uv[corner])) != if t.flipped { -1.0 } else { 1.0 } {
                vanished += 1;
                continue;
            }
            let triangle = order.map(|corner| {
                let vertex = numbers.number_of(t.vertices[corner]);
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
        // Placeholders, since reordering moves normals along with the positions.
        panel.normals.resize(panel.draped.len(), DVec3::Z);
        panel.order_along_curve();
        // Normals are computed after reordering, as for the frames of a sequence. Sums in another
        // order would differ in the last bit for the same drape.
        panel.normals = normals(&panel.draped, &panel.triangles);
        (panel, self.degenerate + vanished)
    }
}

/// The directions to the right and up of a piece as it lies in the flat file, seen from the side to
/// which the normal points.
fn flat_axes(normal: DVec3) -> [DVec3; 2] {
    let mut up = DVec3::Y - normal * DVec3::Y.dot(normal);
    if up.length() < MIN_UPRIGHT {
        up = DVec3::Z - normal * DVec3::Z.dot(normal);
    }
    let up = up.normalize();
    [up.cross(normal), up]
}

impl Panel {
    /// Angle from the flat mesh's upright axis to the wale direction, radians, counter-clockwise as
    /// seen from the technical face.
    ///
    /// ```
    /// use warpknit_core::garment::Garment;
    /// let mut garment = Garment::rectangle(100.0, 40.0);
    /// garment.turn_grain(0, 0.25);
    /// assert!((garment.panels[0].grain() - 0.25).abs() < 1e-12);
    /// ```
    #[must_use]
    pub fn grain(&self) -> f64 {
        let axes = self.flat_from_panel.matrix3;
        let [right, up] = flat_axes(axes.z_axis);
        (-axes.y_axis.dot(right)).atan2(axes.y_axis.dot(up))
    }

    /// Turns the wale direction by `grain` radians, counter-clockwise as seen from the technical
    /// face. Returns the number of lost triangles: slivers so thin that rounding to the new axes
    /// has closed them.
    pub(super) fn turn_grain(&mut self, grain: f64) -> usize {
        let old_from_new = DMat2::from_angle(grain);
        let new_from_old = old_from_new.transpose();
        self.uv.iter_mut().for_each(|point| *point = new_from_old * *point);
        self.flat_from_panel *= DAffine3::from_mat3(DMat3::from_mat2(old_from_new));
        let before = self.triangles.len() + self.flipped.len();
        let uv = &self.uv;
        let kept: Vec<_> =
            self.triangles.iter().map(|triangle| winding(uv, triangle) > 0.0).collect();
        self.flipped.retain(|triangle| winding(uv, triangle) < 0.0);
        // Triangles and their faces are parallel arrays and lose the same entries.
        let mut keep = kept.iter();
        self.triangles.retain(|_| *keep.next().expect("one for each triangle"));
        let mut keep = kept.iter();
        self.faces.retain(|_| *keep.next().expect("a face for each triangle"));
        before - self.triangles.len() - self.flipped.len()
    }
}

/// The winding of a panel's triangle, as [`side`] gives it.
fn winding(uv: &[DVec2], triangle: &[u32; 3]) -> f64 {
    side(triangle.map(|vertex| uv[vertex as usize]))
}

/// The winding of a triangle: 1 if counter-clockwise, -1 if clockwise. It is 0 for a triangle so
/// thin that the exact orientation predicate (Shewchuk, Adaptive precision floating-point
/// arithmetic and fast robust geometric predicates, 1997) and plain arithmetic disagree.
///
/// Location uses the exact sign, while the mapping divides by the area in plain arithmetic. A
/// triangle whose two signs differ would turn the mapping inside out.
fn side(corners: [DVec2; 3]) -> f64 {
    let [a, b, c] = corners;
    let plain = (b - a).perp_dot(c - a);
    let [a, b, c] = corners.map(|p| Coord { x: p.x, y: p.y });
    if orient2d(a, b, c) * plain > 0.0 { plain.signum() } else { 0.0 }
}

/// Whether a flat normal points against the axis that it is nearest to. Such a piece is clockwise
/// as seen from the positive end of that axis: it lies face down.
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

/// Lowest and highest corner of the bounding box.
fn bounds(points: impl Iterator<Item = DVec3>) -> [DVec3; 2] {
    points.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)])
}

/// Unit vertex normals, each triangle weighted by its angle at the vertex (Thürmer and Wüthrich,
/// Computing vertex normals from polygonal facets, 1998). With these weights the normals don't
/// depend on how the cloth was triangulated.
///
/// A vertex that has collapsed triangles only gets the panel's mean normal. Where that vanishes too
/// (a closed or collapsed panel) it gets +z.
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
            // atan2 is exact for angles near 0 and 180 degrees, where acos of a dot product is not.
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
