//! Pairs of flat and draped triangles, one to one.
//!
//! In: one [`ObjMesh`] with `vt`, or a flat and a draped one. Out: [`Pairs`].
//!
//! Method: faces are paired by their names or by their order, and corners by their order, never by
//! welded vertices. `v` and `vt` are numbered independently at seams, and exporters weld in their
//! own ways. Polygons are fans from their first corner in both files, so their triangles pair too.
//!
//! Cost: linear in the faces. Not promised: that the pairs are right where the two files list the
//! same numbers of corners in a different order; [`check_corners`] finds most of such cases.

use std::collections::{HashMap, VecDeque};
use std::path::Path;

use glam::DVec3;

use super::error::GarmentError;
use super::obj::{Face, ObjMesh};
use super::panel::cross;
use crate::ids::{FaceId, index32};

/// Largest coordinate. Squares of areas made of larger ones leave the range in which 64-bit floats
/// are exact enough.
pub(super) const LARGEST: f64 = 1e12;
/// Largest share of flat vertices that may have two draped positions. A few of them are a torn
/// seam, which gets a warning; many mean that the files hold different meshes, and they are
/// refused.
const TORN: f64 = 0.01;

/// Paired triangles, still in the files' own units.
#[derive(Debug, Default)]
pub(super) struct Pairs {
    /// Flat vertices, numbered as in the flat mesh. A `vt` has z = 0.
    pub(super) flat: Vec<DVec3>,
    pub(super) draped: Vec<DVec3>,
    pub(super) triangles: Vec<Paired>,
    /// Number of triangles of the flat mesh, including those without a pair.
    pub(super) total: usize,
    pub(super) untextured: usize,
    pub(super) warnings: Vec<String>,
}

/// One triangle in both meshes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Paired {
    pub(super) flat: [u32; 3],
    pub(super) draped: [u32; 3],
    pub(super) face: FaceId,
    /// The polygon in the flat file, from 0.
    pub(super) polygon: u32,
    /// The lines of the polygon in the flat file and in the draped one.
    pub(super) lines: [u64; 2],
}

impl Pairs {
    /// Distance up to which draped positions count as equal: a millionth of the bounding box's
    /// diagonal. Copies of a vertex in an unwelded file differ by rounding, which is less;
    /// different vertices are about an edge's length apart, which is far more.
    pub(super) fn same_place(&self) -> f64 {
        1e-6 * self.draped_extent().length()
    }

    /// Size of the draped bounding box of all paired triangles. A body in the file and stray
    /// vertices don't count.
    pub(super) fn draped_extent(&self) -> DVec3 {
        let corners = self.triangles.iter().flat_map(|triangle| self.draped_corners(triangle));
        let [low, high] = corners.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| {
            [low.min(p), high.max(p)]
        });
        high - low
    }

    /// Twice the area vector of the flat triangle with index `i`.
    pub(super) fn flat_area(&self, i: u32) -> DVec3 {
        cross(self.flat_corners(&self.triangles[i as usize]))
    }

    /// Twice the area vector of the draped triangle with index `i`.
    pub(super) fn draped_area(&self, i: u32) -> DVec3 {
        cross(self.draped_corners(&self.triangles[i as usize]))
    }

    /// Corners of a triangle in the flat mesh.
    pub(super) fn flat_corners(&self, triangle: &Paired) -> [DVec3; 3] {
        triangle.flat.map(|vertex| self.flat[vertex as usize])
    }

    /// Corners of a triangle in the draped mesh.
    pub(super) fn draped_corners(&self, triangle: &Paired) -> [DVec3; 3] {
        triangle.draped.map(|vertex| self.draped[vertex as usize])
    }
}

/// The coordinates of the flat file that are the flat pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FlatSource {
    /// Its positions, `v`.
    Positions,
    /// Its texture coordinates, `vt`.
    Texture,
}

/// Pairs `v` with `vt` of one file.
pub(super) fn with_texture(mesh: &ObjMesh, path: &Path) -> Result<Pairs, GarmentError> {
    let faces = triangle_faces(mesh);
    let mut pairs = Pairs { total: faces.len(), ..Default::default() };
    for (triangle, &face) in faces.iter().enumerate() {
        let Face { line, textured, .. } = mesh.faces[face as usize];
        let draped = mesh.triangles[triangle];
        if textured {
            let flat = mesh.texture_triangles[triangle];
            pairs.triangles.push(Paired {
                flat,
                draped,
                face: FaceId(index32(triangle)),
                polygon: face,
                lines: [line, line],
            });
        } else {
            pairs.untextured += 1;
        }
    }
    pairs.flat = mesh.texture.iter().map(|vt| vt.extend(0.0)).collect();
    pairs.draped.clone_from(&mesh.positions);
    check_texture(&mut pairs, mesh, path)?;
    check_size(&pairs, path, path)?;
    Ok(pairs)
}

/// Refuses a file without a textured face, and warns of faces without `vt`.
fn check_texture(pairs: &mut Pairs, mesh: &ObjMesh, path: &Path) -> Result<(), GarmentError> {
    if pairs.triangles.is_empty() {
        return Err(GarmentError::NoTexture {
            path: path.to_path_buf(),
            texture: mesh.texture_count,
        });
    }
    if pairs.untextured > 0 {
        pairs.warnings.push(format!(
            "{} of {} triangles have no vt and take no stitches",
            pairs.untextured, pairs.total
        ));
    }
    Ok(())
}

/// Pairs a flat file with a draped one.
pub(super) fn two_files(
    flat: &ObjMesh,
    draped: &ObjMesh,
    paths: [&Path; 2],
    pattern: FlatSource,
) -> Result<Pairs, GarmentError> {
    let mut pairs = Pairs { total: flat.triangles.len(), ..Default::default() };
    // Names first: they still pair a garment whose draped file lists its pieces in another order or
    // holds a body as well. Files of most tools have no names, or the same name for all faces.
    let partner = match by_name(flat, draped) {
        Some(partner) => partner,
        None => by_order(flat, draped, paths, &mut pairs.warnings)?,
    };
    let (flat_first, draped_first) = (first_triangles(flat), first_triangles(draped));
    for (face, &other) in partner.iter().enumerate() {
        // Both files have the same number of corners here, hence the same fan of triangles.
        let fans = flat.faces[face].corners as usize - 2;
        if pattern == FlatSource::Texture && !flat.faces[face].textured {
            pairs.untextured += fans;
            continue;
        }
        for fan in 0..fans {
            let triangle = flat_first[face] + fan;
            pairs.triangles.push(Paired {
                flat: if pattern == FlatSource::Texture {
                    flat.texture_triangles[triangle]
                } else {
                    flat.triangles[triangle]
                },
                draped: draped.triangles[draped_first[other as usize] + fan],
                face: FaceId(index32(triangle)),
                polygon: index32(face),
                lines: [flat.faces[face].line, draped.faces[other as usize].line],
            });
        }
    }
    pairs.draped.clone_from(&draped.positions);
    match pattern {
        FlatSource::Positions => {
            pairs.flat.clone_from(&flat.positions);
            check_size(&pairs, paths[0], paths[1])?;
            check_corners(&mut pairs, paths, [flat.faces.len(), draped.faces.len()])?;
        }
        // No check of the corners here: two sleeves may share their `vt`, so a flat vertex may well
        // have two draped positions.
        FlatSource::Texture => {
            pairs.flat = flat.texture.iter().map(|vt| vt.extend(0.0)).collect();
            check_texture(&mut pairs, flat, paths[0])?;
            check_size(&pairs, paths[0], paths[1])?;
        }
    }
    Ok(pairs)
}

/// The face of each triangle.
fn triangle_faces(mesh: &ObjMesh) -> Vec<u32> {
    let mut faces = Vec::with_capacity(mesh.triangles.len());
    for (i, face) in mesh.faces.iter().enumerate() {
        faces.extend(std::iter::repeat_n(index32(i), face.corners as usize - 2));
    }
    faces
}

/// The first triangle of each face.
fn first_triangles(mesh: &ObjMesh) -> Vec<usize> {
    let mut next = 0;
    let mut firsts = Vec::with_capacity(mesh.faces.len());
    for face in &mesh.faces {
        firsts.push(next);
        next += face.corners as usize - 2;
    }
    firsts
}

/// The draped face of each flat face, by object names or else by group names. Nothing unless every
/// flat name occurs in the draped file with as many faces of the same corners.
///
/// It pairs a garment that was exported with the body, before it or after it, and pieces that come
/// in another order.
fn by_name(flat: &ObjMesh, draped: &ObjMesh) -> Option<Vec<u32>> {
    by_names_of(flat, draped, |face| face.object)
        .or_else(|| by_names_of(flat, draped, |face| face.group))
}

/// The draped face of each flat face, by the names that `name_of` gives.
fn by_names_of(
    flat: &ObjMesh,
    draped: &ObjMesh,
    name_of: fn(&Face) -> Option<u32>,
) -> Option<Vec<u32>> {
    // For each name a queue of its draped faces: within a name faces pair by their order.
    let mut waiting: HashMap<&str, VecDeque<u32>> = HashMap::new();
    for (i, face) in draped.faces.iter().enumerate() {
        if let Some(name) = name_of(face) {
            waiting.entry(&draped.names[name as usize]).or_default().push_back(index32(i));
        }
    }
    let mut partner = Vec::with_capacity(flat.faces.len());
    for face in &flat.faces {
        let name = &flat.names[name_of(face)? as usize];
        let other = waiting.get_mut(name.as_str())?.pop_front()?;
        if draped.faces[other as usize].corners != face.corners {
            return None;
        }
        partner.push(other);
    }
    // A name with draped faces left over means different things in the two files (`default`, say).
    // Then the order has to decide.
    let mut used = flat.faces.iter().filter_map(name_of).map(|name| &flat.names[name as usize]);
    let all_paired = used.all(|name| waiting.get(name.as_str()).is_some_and(VecDeque::is_empty));
    all_paired.then_some(partner)
}

/// The draped face of each flat face, by their order in the files. The draped file may hold more
/// faces after them.
fn by_order(
    flat: &ObjMesh,
    draped: &ObjMesh,
    paths: [&Path; 2],
    warnings: &mut Vec<String>,
) -> Result<Vec<u32>, GarmentError> {
    let [flat_path, draped_path] = paths.map(|path| path.display());
    let (flat_faces, draped_faces) = (flat.faces.len(), draped.faces.len());
    let differing = flat.faces.iter().zip(&draped.faces).position(|(a, b)| a.corners != b.corners);
    if differing.is_some() || draped_faces < flat_faces {
        let face = differing.unwrap_or(draped_faces);
        let here = flat.faces[face];
        let difference = match draped.faces.get(face) {
            Some(there) => format!(
                "{} corners at {flat_path}:{}, {} at {draped_path}:{}",
                here.corners, here.line, there.corners, there.line
            ),
            None => format!("{flat_path}:{} has no counterpart", here.line),
        };
        let [flat, draped] = paths.map(Path::to_path_buf);
        return Err(GarmentError::Faces {
            flat,
            draped,
            flat_faces,
            draped_faces,
            face: face + 1,
            difference,
        });
    }
    if draped_faces > flat_faces {
        warnings.push(format!(
            "{draped_path} has {draped_faces} faces and {flat_path} {flat_faces}: \
             the first {flat_faces} are paired, the rest is left out"
        ));
    }
    Ok((0..index32(flat_faces)).collect())
}

/// Refuses coordinates over [`LARGEST`].
fn check_size(pairs: &Pairs, flat: &Path, draped: &Path) -> Result<(), GarmentError> {
    for triangle in &pairs.triangles {
        let values = [
            largest_coordinate(pairs.flat_corners(triangle)),
            largest_coordinate(pairs.draped_corners(triangle)),
        ];
        for ((path, line), value) in [flat, draped].into_iter().zip(triangle.lines).zip(values) {
            if value > LARGEST {
                return Err(GarmentError::TooLarge {
                    path: path.to_path_buf(),
                    line,
                    value,
                    limit: LARGEST,
                });
            }
        }
    }
    Ok(())
}

/// The largest absolute coordinate of a triangle.
fn largest_coordinate(corners: [DVec3; 3]) -> f64 {
    corners.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max)
}

/// Checks that corners correspond. A flat vertex is one point of the cloth, so it has one draped
/// position, maybe under several numbers. Where many flat vertices have two, the files are refused.
fn check_corners(
    pairs: &mut Pairs,
    paths: [&Path; 2],
    faces: [usize; 2],
) -> Result<(), GarmentError> {
    // The first draped position of each flat vertex is kept, and later ones are compared with it.
    let tolerance = pairs.same_place();
    let mut places: Vec<Option<DVec3>> = vec![None; pairs.flat.len()];
    let mut torn = vec![false; pairs.flat.len()];
    let mut first = None;
    for (i, triangle) in pairs.triangles.iter().enumerate() {
        for (flat, place) in triangle.flat.into_iter().zip(pairs.draped_corners(triangle)) {
            let known = *places[flat as usize].get_or_insert(place);
            if known.distance(place) > tolerance {
                torn[flat as usize] = true;
                first.get_or_insert(i);
            }
        }
    }
    let Some(first) = first else { return Ok(()) };
    let disagreeing = torn.iter().filter(|&&torn| torn).count();
    let vertices = places.iter().flatten().count();
    let Paired { polygon, lines: [flat_line, draped_line], .. } = pairs.triangles[first];
    let face = polygon as usize + 1;
    if disagreeing as f64 > TORN * vertices as f64 {
        return Err(GarmentError::Corners {
            flat: paths[0].to_path_buf(),
            draped: paths[1].to_path_buf(),
            flat_faces: faces[0],
            draped_faces: faces[1],
            disagreeing,
            vertices,
            face,
            flat_line,
            draped_line,
        });
    }
    pairs.warnings.push(format!(
        "{disagreeing} of {vertices} flat vertices are at two places when draped, \
         first in face {face} ({}:{draped_line}): torn there",
        paths[1].display()
    ));
    Ok(())
}
