//! Solid things beside a garment, such as the body that wears it.
//!
//! In: a mesh file of any kind that garments are read from, or a garment. Out: a [`Solid`], in the
//! garment's draped axes, wound so that its normals point outward. Texture coordinates are not needed.
//!
//! Cost: linear in the triangles. Not promised: that the body lies under the cloth.

use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;

use super::error::GarmentError;
use super::normals::{cross, normals};
use super::{Garment, Unit, file};
use crate::ids::index32;

/// Largest coordinate of a solid, mm: ten kilometres, as far as pictures reach.
const LARGEST: f64 = 1e7;

/// A surface that light does not pass.
#[derive(Clone, Debug, Default)]
pub struct Solid {
    /// Vertices, mm from [`super::GarmentSummary::origin`].
    pub positions: Vec<DVec3>,
    /// Unit normals of the vertices, angle-weighted.
    pub normals: Vec<DVec3>,
    /// Indices of the triangles' corners.
    pub triangles: Vec<[u32; 3]>,
}

impl Solid {
    /// Reads a mesh in the draped axes of a garment, whose unit counts where the file says none.
    ///
    /// # Errors
    /// [`GarmentError`]: one line that names the file and what is wrong.
    ///
    /// ```
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// use warpknit_core::garment::{Garment, solid::Solid};
    /// let path = tempfile::NamedTempFile::new()?;
    /// std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n")?;
    /// let body = Solid::read(path.path(), &Garment::rectangle(100.0, 40.0))?;
    /// assert_eq!(body.triangles, [[0, 1, 2]]);
    /// # Ok(())
    /// # }
    /// ```
    pub fn read(path: &Path, garment: &Garment) -> Result<Self, GarmentError> {
        let mesh = file::read(path)?;
        let own = garment.summary.unit.parse().unwrap_or(Unit::Mm);
        let unit_mm = mesh.unit.unwrap_or(own).millimetres();
        let origin = garment.summary.origin;
        let positions: Vec<DVec3> =
            mesh.positions.iter().map(|place| *place * unit_mm - origin).collect();
        if positions.iter().any(|place| place.abs().max_element() > LARGEST) {
            let what = format!(
                "has a vertex over {:.0} km from the garment: export it in the garment's unit and axes",
                LARGEST / 1e6
            );
            return Err(GarmentError::Mesh { path: path.to_path_buf(), what });
        }
        let corners = |triangle: &[u32; 3]| triangle.map(|vertex| positions[vertex as usize]);
        if mesh.triangles.iter().all(|triangle| cross(corners(triangle)) == DVec3::ZERO) {
            let what = "has no area: export the body as a mesh".to_owned();
            return Err(GarmentError::Mesh { path: path.to_path_buf(), what });
        }
        let mut triangles = welded(&positions, &mesh.triangles);
        let volume: f64 = triangles.iter().map(corners).map(|[a, b, c]| a.dot(b.cross(c))).sum();
        if volume < 0.0 {
            triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
        }
        let normals = normals(&positions, &triangles);
        Ok(Self { positions, normals, triangles })
    }

    /// A lining of a garment: its draped surface, so far behind its technical face, mm.
    #[must_use]
    pub fn lining(garment: &Garment, depth: f64) -> Self {
        let mut lining = Self::default();
        for panel in garment.panels.iter().filter(|panel| panel.turned_in.is_none()) {
            let first = index32(lining.positions.len());
            let places = panel.draped.iter().zip(&panel.normals);
            lining.positions.extend(places.map(|(place, normal)| *place - *normal * depth));
            lining.normals.extend(&panel.normals);
            let triangles = panel.triangles.iter().chain(&panel.flipped);
            lining.triangles.extend(triangles.map(|corners| corners.map(|vertex| first + vertex)));
        }
        lining
    }
}

/// Triangles whose corners at one place are one vertex. Files with texture coordinates hold a vertex
/// once for each side of a seam, and its normals would show the seam.
fn welded(positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut firsts = HashMap::new();
    let first: Vec<u32> = (0..)
        .zip(positions)
        .map(|(vertex, place)| {
            // Zero has two signs.
            *firsts.entry((*place + DVec3::ZERO).to_array().map(f64::to_bits)).or_insert(vertex)
        })
        .collect();
    triangles.iter().map(|corners| corners.map(|vertex| first[vertex as usize])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tetrahedron with a vertex for each corner of each face.
    fn soup(is_inside_out: bool) -> Solid {
        let places = ["0 0 0", "1 0 0", "0 1 0", "0 0 1"];
        let mut text = String::new();
        for [a, b, c] in [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]] {
            let corners = if is_inside_out { [a, c, b] } else { [a, b, c] };
            corners.iter().for_each(|&corner| text += &format!("v {}\n", places[corner]));
        }
        (0..4).for_each(|face| {
            text += &format!("f {} {} {}\n", 3 * face + 1, 3 * face + 2, 3 * face + 3);
        });
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        Solid::read(file.path(), &Garment::rectangle(10.0, 10.0)).unwrap()
    }

    #[test]
    fn normals_point_outward_whatever_the_winding_and_know_no_seams() {
        for solid in [soup(false), soup(true)] {
            let middle = DVec3::splat(0.25);
            for vertex in solid.triangles.iter().flatten().map(|&vertex| vertex as usize) {
                let place = solid.positions[vertex] - middle;
                assert!(solid.normals[vertex].dot(place) > 0.9 * place.length());
            }
            let used: std::collections::BTreeSet<u32> =
                solid.triangles.iter().flatten().copied().collect();
            assert_eq!(used.len(), 4);
        }
    }
}
