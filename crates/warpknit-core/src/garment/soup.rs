//! Polygons whose corners have places and texture coordinates of their own, as an [`ObjMesh`].
//!
//! In: the corners of each face, as `.glb`, USD and `.ply` have them: a vertex that lies on a seam of
//! the pattern is there once for each side. Out: the mesh as an OBJ would have it. Vertices at the
//! same place, to the bit, are one. Texture coordinates are one where they and their places are
//! equal, so panels that lie over each other in the pattern stay apart.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::obj::{Face, Label, ObjMesh, UNTEXTURED};

/// Faces that come one by one.
#[derive(Debug, Default)]
pub(super) struct Soup {
    positions: Vec<DVec3>,
    places: HashMap<[u64; 3], u32>,
    texture: Vec<DVec3>,
    texture_places: HashMap<(u32, [u64; 2]), u32>,
    faces: Vec<Face>,
    triangles: Vec<[u32; 3]>,
    texture_triangles: Vec<[u32; 3]>,
    untextured: usize,
    names: Vec<String>,
}

impl Soup {
    /// Begins an object, to which the faces belong from here on.
    pub(super) fn begin(&mut self, name: &str) {
        self.names.push(name.to_owned());
    }

    /// Adds a face of three corners or more: places, and texture coordinates where it has them.
    /// False for a number that is not finite.
    pub(super) fn add(&mut self, places: &[DVec3], texture: Option<&[DVec2]>) -> bool {
        let are_finite = places.iter().all(|place| place.is_finite())
            && texture.is_none_or(|texture| texture.iter().all(|place| place.is_finite()));
        if !are_finite || places.len() < 3 {
            return false;
        }
        let corners: Vec<u32> = places.iter().map(|place| self.place(*place)).collect();
        let texture: Option<Vec<u32>> = texture.map(|texture| {
            corners
                .iter()
                .zip(texture)
                .map(|(corner, place)| self.texture_place(*corner, *place))
                .collect()
        });
        self.faces.push(Face {
            line: self.faces.len() as u64 + 1,
            corners: narrow(corners.len()),
            // The first label is that of faces without an object.
            label: narrow(self.names.len()),
        });
        for corner in 1..corners.len() - 1 {
            let fan = [0, corner, corner + 1];
            self.triangles.push(fan.map(|at| corners[at]));
            match &texture {
                Some(texture) => self.texture_triangles.push(fan.map(|at| texture[at])),
                None => {
                    self.untextured += 1;
                    self.texture_triangles.push([UNTEXTURED; 3]);
                }
            }
        }
        true
    }

    fn place(&mut self, place: DVec3) -> u32 {
        // Zero has two signs.
        let place = place + DVec3::ZERO;
        let next = narrow(self.positions.len());
        let number = *self.places.entry(place.to_array().map(f64::to_bits)).or_insert(next);
        if number == next {
            self.positions.push(place);
        }
        number
    }

    fn texture_place(&mut self, corner: u32, place: DVec2) -> u32 {
        let place = place + DVec2::ZERO;
        let next = narrow(self.texture.len());
        let key = (corner, place.to_array().map(f64::to_bits));
        let number = *self.texture_places.entry(key).or_insert(next);
        if number == next {
            self.texture.push(place.extend(0.0));
        }
        number
    }

    /// The mesh, if it has a face.
    pub(super) fn into_mesh(self) -> Option<ObjMesh> {
        if self.faces.is_empty() {
            return None;
        }
        let is_textured = self.untextured < self.triangles.len();
        let own = |object| Label { object: Some(narrow(object)), group: None };
        let labels = std::iter::once(Label::default()).chain((0..self.names.len()).map(own));
        Some(ObjMesh {
            positions: Arc::new(self.positions),
            texture: Arc::new(self.texture),
            faces: self.faces,
            triangles: Arc::new(self.triangles),
            texture_triangles: Arc::new(if is_textured {
                self.texture_triangles
            } else {
                Vec::new()
            }),
            untextured: self.untextured,
            labels: labels.collect(),
            names: self.names,
            ..ObjMesh::default()
        })
    }
}

/// A count of things in a file that is far under 4 billion.
fn narrow(count: usize) -> u32 {
    crate::ids::index32(count)
}
