//! Panels from pieces of the pattern, and their axes.
//!
//! In: a [`Piece`] and its scale. Out: a [`Panel`] in axes of its own, in mm.
//!
//! Cost: linear in the triangles.

use glam::{DAffine3, DMat2, DMat3, DVec2, DVec3};
use rayon::prelude::*;
use robust::{Coord, orient2d};

use super::normals::{cross, normals};
use super::pair::Pairs;
use super::pieces::Piece;
use super::vertices::Vertices;
use super::{Panel, ReadOptions};
use crate::ids::index32;

/// Shortest projection of the flat y axis onto the panel's plane for which the wales run along it.
/// The axis is 6 degrees from the normal then; nearer to it the projection's direction is
/// arbitrary, and the z axis is used.
const MIN_UPRIGHT: f64 = 0.1;

/// Numbers the vertices of one panel after another.
pub(super) struct PanelNumbers {
    /// The number of each vertex in the current panel.
    number_of: Vec<u32>,
    /// The corners, as pair and corner, where the vertices were first used.
    first: Vec<(u32, usize)>,
}

impl PanelNumbers {
    const NONE: u32 = u32::MAX;

    pub(super) fn new(vertices: &Vertices) -> Self {
        Self { number_of: vec![Self::NONE; vertices.count], first: Vec::new() }
    }

    /// The triangles of a piece in the numbers of its own vertices, which are counted as they are
    /// first used.
    fn triangles(&mut self, vertices: &Vertices, piece: &Piece) -> Vec<[u32; 3]> {
        self.first.clear();
        let mut triangles = Vec::with_capacity(piece.triangles.len());
        for &pair in &piece.triangles {
            let corners = vertices.triangles[pair as usize];
            triangles.push(std::array::from_fn(|corner| {
                let number = &mut self.number_of[corners[corner] as usize];
                if *number == Self::NONE {
                    *number = index32(self.first.len());
                    self.first.push((pair, corner));
                }
                *number
            }));
        }
        for &(pair, corner) in &self.first {
            self.number_of[vertices.triangles[pair as usize][corner] as usize] = Self::NONE;
        }
        triangles
    }
}

/// What a piece loses on its way to a panel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Left {
    /// Triangles without flat area, and slivers so thin that rounding to panel axes has closed
    /// them.
    pub(super) degenerate: usize,
    /// Their draped area, mm².
    pub(super) degenerate_area: f64,
    /// Draped area of the flipped triangles, mm².
    pub(super) flipped_area: f64,
}

impl Piece {
    /// The panel in mm, and what it leaves out.
    pub(super) fn panel(
        &self,
        pairs: &Pairs,
        (vertices, numbers): (&Vertices, &mut PanelNumbers),
        scale_mm: f64,
        unit_mm: f64,
        options: &ReadOptions,
    ) -> (Panel, Left) {
        let axes = self.axes(options.grain, options.turn);
        // The origin is the middle of the bounding box. A pattern may lie anywhere in its file, and
        // floating-point numbers are most exact near zero.
        let [low, high] = self.bounds(pairs, axes);
        let origin = axes * ((low + high) * 0.5) * scale_mm;
        let corners = numbers.triangles(vertices, self);
        let into_axes = axes.transpose();
        let first = &numbers.first;
        let flat = |&(pair, corner): &(u32, usize)| {
            let flat = pairs.flat[pairs.flat_triangles[pair as usize][corner] as usize];
            (into_axes * (flat * scale_mm - origin)).truncate()
        };
        let draped = |&(pair, corner): &(u32, usize)| {
            pairs.draped[pairs.draped_triangles[pair as usize][corner] as usize] * unit_mm
        };
        let mut panel = Panel {
            uv: first.par_iter().map(flat).collect(),
            draped: first.par_iter().map(draped).collect(),
            normals: Vec::new(),
            triangles: Vec::with_capacity(corners.len()),
            faces: Vec::with_capacity(corners.len()),
            flipped: Vec::new(),
            flat_from_panel: DAffine3::from_mat3_translation(axes, origin),
            mirrored: faces_down(self.normal),
            turned_in: None,
        };
        let left = panel.add_triangles(pairs, self, &corners, options.turn);
        // Placeholders, since reordering moves normals along with the positions.
        panel.normals.resize(panel.draped.len(), DVec3::Z);
        panel.order_along_curve();
        // Normals are computed after reordering, as for the frames of a sequence. Sums in another
        // order would differ in the last bit for the same drape.
        panel.normals = normals(&panel.draped, &panel.triangles);
        let degenerate = self.degenerate.iter();
        let closed: f64 = degenerate.map(|&i| 0.5 * pairs.draped_area(i).length()).sum();
        let left = Left {
            degenerate: left.degenerate + self.degenerate.len(),
            degenerate_area: left.degenerate_area + closed * unit_mm * unit_mm,
            ..left
        };
        (panel, left)
    }
}

/// The directions to the right and up of a piece as it lies in the flat file, seen from the side to
/// which the normal points.
pub(super) fn flat_axes(normal: DVec3) -> [DVec3; 2] {
    let mut up = DVec3::Y - normal * DVec3::Y.dot(normal);
    if up.length() < MIN_UPRIGHT {
        up = DVec3::Z - normal * DVec3::Z.dot(normal);
    }
    let up = up.normalize();
    [up.cross(normal), up]
}

impl Panel {
    /// Adds the triangles of a piece, given in the panel's vertices. Returns what is left out.
    fn add_triangles(
        &mut self,
        pairs: &Pairs,
        piece: &Piece,
        corners: &[[u32; 3]],
        turned: bool,
    ) -> Left {
        // A turned panel is the same cloth seen from behind. Swapping two corners keeps the winding
        // counter-clockwise in (u, v) and reverses it on the body.
        let order = if turned { [0, 2, 1] } else { [0, 1, 2] };
        let corners = corners.par_iter().map(|corners| order.map(|corner: usize| corners[corner]));
        let sides: Vec<_> =
            corners.map(|triangle| (winding(&self.uv, &triangle), triangle)).collect();
        let mut left = Left { degenerate: 0, degenerate_area: 0.0, flipped_area: 0.0 };
        for (&pair, (side, triangle)) in piece.triangles.iter().zip(sides) {
            let expected = if piece.is_flipped(pair) { -1.0 } else { 1.0 };
            if side == 1.0 && expected == 1.0 {
                self.triangles.push(triangle);
                self.faces.push(pairs.faces[pair as usize]);
                continue;
            }
            let area = 0.5 * cross(triangle.map(|vertex| self.draped[vertex as usize])).length();
            // Rounding to panel axes may have closed or turned over a thin triangle. Location and
            // mapping rely on the winding, so such a triangle is left out.
            if side == expected {
                self.flipped.push(triangle);
                left.flipped_area += area;
            } else {
                left.degenerate += 1;
                left.degenerate_area += area;
            }
        }
        left
    }

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

    /// Turns the cloth over: its technical face is on the other side then. The wales keep their
    /// direction, and the vertices their numbers.
    pub(super) fn turn_over(&mut self) {
        self.uv.iter_mut().for_each(|point| point.x = -point.x);
        self.flat_from_panel *=
            DAffine3::from_mat3(DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0)));
        for triangle in self.triangles.iter_mut().chain(&mut self.flipped) {
            triangle.swap(1, 2);
        }
        self.normals = normals(&self.draped, &self.triangles);
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
pub(super) fn faces_down(normal: DVec3) -> bool {
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
