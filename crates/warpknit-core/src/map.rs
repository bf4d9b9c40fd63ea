//! From the flat panel to the draped one.
//!
//! In: [`SurfacePoint`]s with the flat position they stand for. Out: draped positions, mm, and unit
//! normals. Source: Liu, Kyosev, Jiang 2022, section 3.2, equations 2 to 5. The search structure is
//! not needed here: a drape sequence locates once and maps each frame.

use std::array::from_fn;

use glam::{DAffine3, DVec2, DVec3};

use crate::garment::Panel;
use crate::locate::SurfacePoint;

/// How depth over the surface is carried along.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mapping {
    /// The paper's: exactly affine in each triangle, depth scales with the triangle's area.
    Frame,
    /// Depth in mm along a normal that is smooth across triangle edges, so yarns neither crack nor
    /// change their thickness.
    #[default]
    Smooth,
}

/// Draped points.
#[derive(Clone, Debug, Default)]
pub struct Draped {
    /// Positions, mm.
    pub positions: Vec<DVec3>,
    /// Unit normals of the draped surface beneath each, out of the technical face.
    pub normals: Vec<DVec3>,
}

/// Maps located points. `flat` are their positions in panel axes (u, v, depth), mm.
///
/// Cost: a triangle is worked out once for all points in a row that lie in it. With some fifty of
/// them 15 ns a point (`smooth`) or 11 (`frame`), of which most is the way through memory.
///
/// ```
/// use warpknit_core::{garment::Garment, locate::Locator, map::{map, Mapping}};
/// use glam::DVec3;
/// let garment = Garment::rectangle(10.0, 10.0);
/// let flat = [DVec3::new(2.0, 1.0, 0.3)];
/// let located: Vec<_> = Locator::new(&garment.panels[0]).locate(&flat).into_iter().flatten().collect();
/// let draped = map(&garment.panels[0], &flat, &located, Mapping::Smooth);
/// assert!((draped.positions[0] - flat[0]).length() < 1e-12); // a swatch is its own drape
/// ```
#[must_use]
pub fn map(panel: &Panel, flat: &[DVec3], located: &[SurfacePoint], mapping: Mapping) -> Draped {
    let mut draped = Draped::default();
    map_into(panel, flat, located, mapping, &mut draped);
    draped
}

/// [`map`] into memory that is there already: what `draped` held is forgotten.
pub fn map_into(
    panel: &Panel,
    flat: &[DVec3],
    located: &[SurfacePoint],
    mapping: Mapping,
    draped: &mut Draped,
) {
    draped.positions.resize(located.len(), DVec3::ZERO);
    draped.normals.resize(located.len(), DVec3::ZERO);
    let (mut flat, mut positions, mut normals) =
        (flat, &mut draped.positions[..], &mut draped.normals[..]);
    for located in located.chunk_by(|one, next| one.triangle == next.triangle) {
        let (flat, positions, normals) = (
            take(&mut flat, located.len()),
            take_mut(&mut positions, located.len()),
            take_mut(&mut normals, located.len()),
        );
        match mapping {
            Mapping::Smooth => {
                Facet::of(panel, located[0].triangle).map(flat, located, positions, normals);
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

/// The first `count` of what is left.
fn take<'a, T>(left: &mut &'a [T], count: usize) -> &'a [T] {
    left.split_off(..count).expect("as many as there are located points")
}

fn take_mut<'a, T>(left: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    left.split_off_mut(..count).expect("as many as there are located points")
}

/// A draped triangle with normals at its corners: both are linear in the second and the third
/// corner's weights.
struct Facet {
    position: [DVec3; 3],
    normal: [DVec3; 3],
}

/// Points that are mapped at a time: each number of four lies side by side, so that roots and
/// divisions are taken by twos. 6 instead of 8 ns a point; wider registers would take fours.
const LANES: usize = 4;

impl Facet {
    fn of(panel: &Panel, triangle: u32) -> Self {
        let corners = panel.triangles[triangle as usize];
        let linear = |[a, b, c]: [DVec3; 3]| [a, b - a, c - a];
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

    /// The interpolated normal, of unit length (+z where it vanishes), and the position at the
    /// point's depth along it.
    #[inline]
    fn map_lanes<const N: usize>(
        &self,
        flat: &[DVec3; N],
        located: &[SurfacePoint; N],
        positions: &mut [DVec3; N],
        normals: &mut [DVec3; N],
    ) {
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
            // Corners' normals that cancel each other: rarer than rare, and the lanes need not know
            // of it.
            let unit = DVec3::from_array(from_fn(|axis| normal[axis][k])) * over_length[k];
            let unit = if squared[k] > 0.0 { unit } else { DVec3::Z };
            normals[k] = unit;
            positions[k] = DVec3::from_array(from_fn(|axis| position[axis][k])) + unit * flat[k].z;
        }
    }
}

/// A triangle's matrix M and its draped unit normal.
///
/// M = M1 · M2⁻¹ takes flat points to draped ones when M1 is the frame of the target (the draped
/// triangle) and M2 the frame of the source (the flat one). The paper makes M1 of the flat triangle
/// and M2 of the draped one; with column vectors that goes the wrong way.
fn frame_map(panel: &Panel, triangle: u32) -> (DAffine3, DVec3) {
    let corners = panel.triangles[triangle as usize];
    let source = frame(corners.map(|v| panel.uv[v as usize]).map(|p: DVec2| p.extend(0.0)));
    let target = frame(corners.map(|v| panel.draped[v as usize]));
    (target * source.inverse(), target.matrix3.z_axis.normalize_or(DVec3::Z))
}

/// The 4 x 4 frame of a triangle (equations 2 and 3), whose last row is always 0 0 0 1: columns AB,
/// AC, AB x AC (not normalised) and A.
fn frame([a, b, c]: [DVec3; 3]) -> DAffine3 {
    let (ab, ac) = (b - a, c - a);
    DAffine3::from_cols(ab, ac, ab.cross(ac), a)
}
