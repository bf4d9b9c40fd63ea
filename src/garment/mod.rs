//! The garment: panels that know where each of their flat triangles lies when draped.
//!
//! In: one OBJ with `vt`, or a flat and a draped OBJ ([`read`]). Out: a [`Garment`] in millimetres, each [`Panel`] in axes of its
//! own. The specification's garment page says what real files hold and what is made of it.

mod rectangle;
pub mod stretch;

use glam::{DAffine3, DVec2, DVec3};

use crate::ids::FaceId;

/// A panel: one connected piece of the flat pattern, with its draped positions.
///
/// Panel axes: `u` across the wales, to the right seen from the technical face; `v` along the wales; `w` out of the technical
/// face. Triangles are counter-clockwise in (u, v), and their draped winding points out of the technical face.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Flat vertices in panel axes, mm.
    pub uv: Vec<DVec2>,
    /// The same vertices draped, mm.
    pub draped: Vec<DVec3>,
    /// Unit draped vertex normals, angle-weighted over this panel's triangles alone (split at panel borders).
    pub normals: Vec<DVec3>,
    /// Triangles that can hold stitches, in increasing [`FaceId`].
    pub triangles: Vec<[u32; 3]>,
    /// The face of each triangle.
    pub faces: Vec<FaceId>,
    /// Triangles wound against their panel: they take no stitches, but points that fall there are counted as lost.
    pub flipped: Vec<[u32; 3]>,
    /// Panel axes (u, v, depth) to the flat mesh's own axes, both in mm.
    pub flat_from_panel: DAffine3,
    /// Whether the flat piece lies mirrored (clockwise) in its own plane.
    pub mirrored: bool,
}

/// All panels of a garment, and what was noticed while reading.
#[derive(Clone, Debug)]
pub struct Garment {
    /// Usable panels, in order of their lowest face.
    pub panels: Vec<Panel>,
    /// What reading found.
    pub facts: Facts,
}

/// What reading found, for the report and for `inspect`.
#[derive(Clone, Debug, Default)]
pub struct Facts {
    /// Triangles in the file, usable or not.
    pub triangles: usize,
    /// Name of the unit that draped coordinates are in: mm, cm, dm, m, in.
    pub unit: &'static str,
    /// mm that one flat unit stands for (the garment's; panels that differ are named in `warnings`).
    pub uv_scale_mm: f64,
    /// Triangles without flat area.
    pub degenerate: usize,
    /// Triangles wound against their panel.
    pub flipped: usize,
    /// Triangles with a corner that has no `vt`.
    pub untextured: usize,
    /// One line each, fit for the user.
    pub warnings: Vec<String>,
}
