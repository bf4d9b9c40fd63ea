//! The map from the flat panel to the draped one.
//!
//! In: flat positions and their [`SurfacePoint`]s. Out: draped positions, mm, and unit normals.
//!
//! Method: [`Mapping::Frame`] is the affine map between the tangent frames of the flat and the
//! draped triangle (Liu, Kyosev and Jiang 2022, "Yarn-level modelling and geometric simulation of
//! warp-knitted clothing elements", section 3.2, equations 2 to 5). [`Mapping::Smooth`]
//! interpolates position and vertex normals by barycentric coordinates, as Phong 1975 does for
//! shading ("Illumination for computer generated pictures"), and moves the point by its depth along
//! that normal.
//!
//! Cost: 8 to 13 ns a point. Points need no search here: a drape sequence locates once and maps
//! each frame. Not promised: yarns that keep clear of each other on strongly bent cloth, where
//! depth along normals crowds points on the inner side.

pub mod relaxed;
pub(crate) mod surface;

use std::array::from_fn;

use glam::{DAffine3, DVec2, DVec3};

use crate::garment::Panel;
use crate::locate::SurfacePoint;

/// How the depth of a point over the surface is mapped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mapping {
    /// The paper's map: exactly affine in each triangle. Depth scales with the triangle's area.
    Frame,
    /// Depth in mm along an interpolated normal, which is continuous across triangle edges. Yarns
    /// have no cracks there and keep their thickness.
    Smooth,
    /// Yarn keeps its length: loops move within the cloth as it is strained. Fabrics that can't be
    /// relaxed are mapped by [`Self::Smooth`].
    #[default]
    Relaxed,
}

/// Draped points.
#[derive(Clone, Debug, Default)]
pub struct Draped {
    /// Positions, mm.
    pub positions: Vec<DVec3>,
    /// Unit normals of the draped surface beneath each, out of the technical face.
    pub normals: Vec<DVec3>,
    /// Whether the cloth is strained too far at each point for loops to follow. Empty unless the
    /// mapping is [`Mapping::Relaxed`].
    pub is_overstrained: Vec<bool>,
}

/// Maps located points. `flat` are their positions in panel axes (u, v, depth), mm.
///
/// Cost: a triangle is prepared once for all successive points that lie in it. With some fifty of
/// them it takes 15 ns a point (`smooth`) or 11 (`frame`), mostly for memory traffic.
///
/// ```
/// use warpknit_core::{garment::Garment, locate::Locator, map::{map, Mapping}};
/// use glam::DVec3;
/// let garment = Garment::rectangle(10.0, 10.0);
/// let flat = [DVec3::new(2.0, 1.0, 0.3)];
/// let located = Locator::new(&garment.panels[0]).locate(&flat);
/// let located: Vec<_> = located.into_iter().flatten().collect();
/// let draped = map(&garment.panels[0], &flat, &located, Mapping::Smooth);
/// // A swatch is its own drape.
/// assert!((draped.positions[0] - flat[0]).length() < 1e-12);
/// ```
#[must_use]
pub fn map(panel: &Panel, flat: &[DVec3], located: &[SurfacePoint], mapping: Mapping) -> Draped {
    let mut draped = Draped::default();
    map_into(panel, flat, located, mapping, &mut draped);
    draped
}

/// [`map`] into memory that exists already. Earlier values in `draped` are replaced.
pub fn map_into(
    panel: &Panel,
    flat: &[DVec3],
    located: &[SurfacePoint],
    mapping: Mapping,
    draped: &mut Draped,
) {
    draped.positions.resize(located.len(), DVec3::ZERO);
    draped.normals.resize(located.len(), DVec3::ZERO);
    draped.is_overstrained.clear();
    let (mut flat, mut positions, mut normals) =
        (flat, &mut draped.positions[..], &mut draped.normals[..]);
    // Successive points mostly lie in one triangle, whose loads and frames are shared by the run.
    for located in located.chunk_by(|one, next| one.triangle == next.triangle) {
        let (flat, positions, normals) = (
            take(&mut flat, located.len()),
            take_mut(&mut positions, located.len()),
            take_mut(&mut normals, located.len()),
        );
        match mapping {
            Mapping::Smooth | Mapping::Relaxed => {
                Facet::new(panel, located[0].triangle).map(flat, located, positions, normals);
            }
            Mapping::Frame => {
                let (matrix, normal) = frame_map(panel, located[0].triangle);
                positions
                    .iter_mut()
                    .zip(flat)
                    .for_each(|(position, point)| *position = matrix.transform_point3(*point));
                normals.fill(normal);
            }
        }
    }
}

/// Splits off the first `count` elements.
fn take<'a, T>(left: &mut &'a [T], count: usize) -> &'a [T] {
    left.split_off(..count).expect("as many as there are located points")
}

/// Splits off the first `count` elements, to be written.
fn take_mut<'a, T>(left: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    left.split_off_mut(..count).expect("as many as there are located points")
}

/// A draped triangle with normals at its corners. Both are linear in the barycentric coordinates of
/// the second and the third corner: a value at the first corner, and two differences from it.
struct Facet {
    position: [DVec3; 3],
    normal: [DVec3; 3],
}

/// Points that are mapped at a time. The same coordinate of four points lies side by side, so the
/// compiler takes two roots and two divisions at a time (SSE2): 6 instead of 8 ns a point. Wider
/// registers would take four.
const LANES: usize = 4;

/// Values at the three corners as a linear function of the barycentric weights of the second and
/// the third one: the value at the first corner, and both differences from it.
#[inline]
fn linear([a, b, c]: [DVec3; 3]) -> [DVec3; 3] {
    [a, b - a, c - a]
}

impl Facet {
    fn new(panel: &Panel, triangle: u32) -> Self {
        let corners = panel.triangles[triangle as usize];
        Self {
            position: linear(corners.map(|v| panel.draped[v as usize])),
            normal: linear(corners.map(|v| panel.normals[v as usize])),
        }
    }

    /// Maps a run of points in the triangle.
    #[inline]
    fn map(
        &self,
        flat: &[DVec3],
        located: &[SurfacePoint],
        positions: &mut [DVec3],
        normals: &mut [DVec3],
    ) {
        let (flat, last_flat) = flat.as_chunks::<LANES>();
        let (located, last_located) = located.as_chunks::<LANES>();
        let (positions, last_positions) = positions.as_chunks_mut::<LANES>();
        let (normals, last_normals) = normals.as_chunks_mut::<LANES>();
        for (((flat, located), positions), normals) in
            flat.iter().zip(located).zip(positions).zip(normals)
        {
            self.map_lanes(flat, located, positions, normals);
        }
        // The same code with one lane, so a point has the same bits wherever in a run it lies.
        let last = last_flat.iter().zip(last_located).zip(last_positions).zip(last_normals);
        for (((flat, located), position), normal) in last {
            self.map_lanes(
                &[*flat],
                &[*located],
                std::array::from_mut(position),
                std::array::from_mut(normal),
            );
        }
    }

    /// Computes the interpolated normal, of unit length (+z where it vanishes), and the position at
    /// the point's depth along it.
    #[inline]
    fn map_lanes<const N: usize>(
        &self,
        flat: &[DVec3; N],
        located: &[SurfacePoint; N],
        positions: &mut [DVec3; N],
        normals: &mut [DVec3; N],
    ) {
        // Structure of arrays: every inner loop runs over the points of one coordinate, which the
        // compiler vectorises. Point by point it would not.
        let (b, c): ([f64; N], [f64; N]) = (from_fn(|k| located[k].b), from_fn(|k| located[k].c));
        let (mut position, mut normal, mut squared) = ([[0.0; N]; 3], [[0.0; N]; 3], [0.0; N]);
        for axis in 0..3 {
            let [[p, p_b, p_c], [n, n_b, n_c]] =
                [&self.position, &self.normal].map(|corners| corners.map(|corner| corner[axis]));
            for k in 0..N {
                position[axis][k] = p + p_b * b[k] + p_c * c[k];
                normal[axis][k] = n + n_b * b[k] + n_c * c[k];
                squared[k] += normal[axis][k] * normal[axis][k];
            }
        }
        let over_length = squared.map(|squared| 1.0 / squared.sqrt());
        for k in 0..N {
            // Corner normals may cancel each other out. The division above then gives infinity in
            // that lane only, and a selection here replaces it; a branch above would stop the
            // vectorisation.
            let unit = DVec3::from_array(from_fn(|axis| normal[axis][k])) * over_length[k];
            let unit = if squared[k] > 0.0 { unit } else { DVec3::Z };
            normals[k] = unit;
            positions[k] = DVec3::from_array(from_fn(|axis| position[axis][k])) + unit * flat[k].z;
        }
    }
}

/// A triangle's matrix M and its draped unit normal.
///
/// M = M1 · M2⁻¹ maps flat points to draped ones if M1 is the frame of the target (the draped
/// triangle) and M2 the frame of the source (the flat one). The paper takes M1 from the flat
/// triangle and M2 from the draped one. With column vectors that is the inverse map.
fn frame_map(panel: &Panel, triangle: u32) -> (DAffine3, DVec3) {
    let corners = panel.triangles[triangle as usize];
    let source = frame(corners.map(|v| panel.uv[v as usize]).map(|p: DVec2| p.extend(0.0)));
    let target = frame(corners.map(|v| panel.draped[v as usize]));
    (target * source.inverse(), target.matrix3.z_axis.normalize_or(DVec3::Z))
}

/// The tangent frame of a triangle, a 4 x 4 matrix (equations 2 and 3) with the columns AB, AC,
/// AB x AC (not normalised) and A. Its last row is always 0 0 0 1.
fn frame([a, b, c]: [DVec3; 3]) -> DAffine3 {
    let (ab, ac) = (b - a, c - a);
    DAffine3::from_cols(ab, ac, ab.cross(ac), a)
}
