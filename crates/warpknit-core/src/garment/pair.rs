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
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::error::GarmentError;
use super::normals::cross;
use super::obj::{Label, ObjMesh};
use crate::ids::{FaceId, index32};

/// Largest coordinate. Squares of areas made of larger ones leave the range in which 64-bit floats
/// are exact enough.
pub(super) const LARGEST: f64 = 1e12;
/// Largest share of flat vertices that may have two draped positions. A few of them are a torn
/// seam, which gets a warning; many mean that the files hold different meshes, and they are
/// refused.
const TORN: f64 = 0.01;

/// Paired triangles, still in the files' own units. Arrays that are those of a file are shared with
/// its mesh.
#[derive(Debug, Default)]
pub(super) struct Pairs {
    /// Flat vertices, numbered as in the flat mesh. A `vt` has z = 0.
    pub(super) flat: Arc<Vec<DVec3>>,
    pub(super) draped: Arc<Vec<DVec3>>,
    /// The flat corners of each pair.
    pub(super) flat_triangles: Arc<Vec<[u32; 3]>>,
    /// The draped corners of each pair.
    pub(super) draped_triangles: Arc<Vec<[u32; 3]>>,
    /// The flat mesh's triangle of each pair, in ascending order.
    pub(super) faces: Vec<FaceId>,
    /// The polygon in the flat file of each pair, from 0.
    pub(super) polygons: Vec<u32>,
    /// Number of triangles of the flat mesh, including those without a pair.
    pub(super) total: usize,
    pub(super) untextured: usize,
    /// Draped area of the triangles without `vt`, square units.
    pub(super) untextured_area: f64,
    pub(super) warnings: Vec<String>,
    /// Low and high corner of the draped bounding box of all pairs. A body in the file and stray
    /// vertices don't count.
    bounds: [DVec3; 2],
}

impl Pairs {
    /// Number of pairs.
    pub(super) fn len(&self) -> usize {
        self.faces.len()
    }

    /// Distance up to which draped positions count as equal: a millionth of the bounding box's
    /// diagonal. Copies of a vertex in an unwelded file differ by rounding, which is less;
    /// different vertices are about an edge's length apart, which is far more.
    pub(super) fn same_place(&self) -> f64 {
        1e-6 * self.draped_extent().length()
    }

    /// Size of the draped bounding box of all paired triangles.
    pub(super) fn draped_extent(&self) -> DVec3 {
        let [low, high] = self.bounds;
        high - low
    }

    /// Twice the area vector of the flat triangle with index `i`.
    pub(super) fn flat_area(&self, i: u32) -> DVec3 {
        cross(self.flat_corners(i as usize))
    }

    /// Twice the area vector of the draped triangle with index `i`.
    pub(super) fn draped_area(&self, i: u32) -> DVec3 {
        cross(self.draped_corners(i as usize))
    }

    /// Corners of a triangle in the flat mesh.
    pub(super) fn flat_corners(&self, i: usize) -> [DVec3; 3] {
        self.flat_triangles[i].map(|vertex| self.flat[vertex as usize])
    }

    /// Corners of a triangle in the draped mesh.
    pub(super) fn draped_corners(&self, i: usize) -> [DVec3; 3] {
        self.draped_triangles[i].map(|vertex| self.draped[vertex as usize])
    }

    /// The pairs of one polygon each, in order.
    pub(super) fn polygon_ranges(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let mut start = 0;
        self.polygons.chunk_by(|a, b| a == b).map(move |polygon| {
            start += polygon.len();
            start - polygon.len()..start
        })
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
    let partner: Vec<u32> = (0..index32(mesh.faces.len())).collect();
    let mut pairs = paired(mesh, mesh, &partner, FlatSource::Texture);
    check_texture(&mut pairs, mesh, path)?;
    check_size(&pairs, [mesh, mesh], [path, path], &partner)?;
    Ok(pairs)
}

/// Refuses a file without a textured face, and warns of faces without `vt`.
fn check_texture(pairs: &mut Pairs, mesh: &ObjMesh, path: &Path) -> Result<(), GarmentError> {
    if pairs.len() == 0 {
        return Err(GarmentError::NoTexture {
            path: path.to_path_buf(),
            texture: mesh.texture.len(),
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
    let mut warnings = Vec::new();
    // Names first: they still pair a garment whose draped file lists its pieces in another order or
    // holds a body as well. Files of most tools have no names, or the same name for all faces.
    let partner = match by_name(flat, draped) {
        Some(partner) => partner,
        None => by_order(flat, draped, paths, &mut warnings)?,
    };
    let mut pairs = Pairs { warnings, ..paired(flat, draped, &partner, pattern) };
    match pattern {
        FlatSource::Positions => {
            check_size(&pairs, [flat, draped], paths, &partner)?;
            check_corners(&mut pairs, [flat, draped], paths, &partner)?;
        }
        // No check of the corners here: two sleeves may share their `vt`, so a flat vertex may well
        // have two draped positions.
        FlatSource::Texture => {
            check_texture(&mut pairs, flat, paths[0])?;
            check_size(&pairs, [flat, draped], paths, &partner)?;
        }
    }
    Ok(pairs)
}

/// The pairs of two meshes, whose `partner` has the draped face of each flat one. Both faces have
/// the same number of corners, hence the same fan of triangles.
fn paired(flat: &ObjMesh, draped: &ObjMesh, partner: &[u32], pattern: FlatSource) -> Pairs {
    let textured = pattern == FlatSource::Texture;
    let (positions, source) = if textured {
        (&flat.texture, &flat.texture_triangles)
    } else {
        (&flat.positions, &flat.triangles)
    };
    let mut pairs = Pairs {
        flat: Arc::clone(positions),
        draped: Arc::clone(&draped.positions),
        total: flat.triangles.len(),
        ..Pairs::default()
    };
    let in_order = partner.iter().zip(0..).all(|(&other, face)| other == face);
    let none_left_out = !textured || flat.is_textured();
    if in_order && none_left_out && flat.triangles.len() == draped.triangles.len() {
        pairs.flat_triangles = Arc::clone(source);
        pairs.draped_triangles = Arc::clone(&draped.triangles);
        pairs.faces = (0..index32(pairs.total)).map(FaceId).collect();
        pairs.polygons = triangle_faces(flat);
    } else {
        select(&mut pairs, flat, draped, partner, textured);
    }
    let corners = || pairs.draped_triangles.par_iter().flatten_iter();
    pairs.bounds = corners().map(|&vertex| [pairs.draped[vertex as usize]; 2]).reduce(
        || [DVec3::INFINITY, DVec3::NEG_INFINITY],
        |[low, high], [other_low, other_high]| [low.min(other_low), high.max(other_high)],
    );
    pairs
}

/// Pairs triangle by triangle: where files differ in their order, or faces are left out.
fn select(pairs: &mut Pairs, flat: &ObjMesh, draped: &ObjMesh, partner: &[u32], textured: bool) {
    let source = if textured { &flat.texture_triangles } else { &flat.triangles };
    let (flat_first, draped_first) = (first_triangles(flat), first_triangles(draped));
    let (mut flat_triangles, mut draped_triangles) = (Vec::new(), Vec::new());
    for (face, &other) in partner.iter().enumerate() {
        for fan in 0..flat.faces[face].triangles() {
            let triangle = flat_first[face] + fan;
            let body = draped.triangles[draped_first[other as usize] + fan];
            if textured && !flat.has_texture(triangle) {
                pairs.untextured += 1;
                let corners = body.map(|vertex| draped.positions[vertex as usize]);
                pairs.untextured_area += 0.5 * cross(corners).length();
                continue;
            }
            flat_triangles.push(source[triangle]);
            draped_triangles.push(body);
            pairs.faces.push(FaceId(index32(triangle)));
            pairs.polygons.push(index32(face));
        }
    }
    pairs.flat_triangles = Arc::new(flat_triangles);
    pairs.draped_triangles = Arc::new(draped_triangles);
}

/// The face of each triangle.
pub(super) fn triangle_faces(mesh: &ObjMesh) -> Vec<u32> {
    let mut faces = Vec::with_capacity(mesh.triangles.len());
    for (i, face) in mesh.faces.iter().enumerate() {
        faces.extend(std::iter::repeat_n(index32(i), face.triangles()));
    }
    faces
}

/// The first triangle of each face.
fn first_triangles(mesh: &ObjMesh) -> Vec<usize> {
    let mut next = 0;
    let mut firsts = Vec::with_capacity(mesh.faces.len());
    for face in &mesh.faces {
        firsts.push(next);
        next += face.triangles();
    }
    firsts
}

/// The draped face of each flat face, by object names or else by group names. Nothing unless every
/// flat name occurs in the draped file with as many faces of the same corners.
///
/// It pairs a garment that was exported with the body, before it or after it, and pieces that come
/// in another order.
fn by_name(flat: &ObjMesh, draped: &ObjMesh) -> Option<Vec<u32>> {
    by_names_of(flat, draped, |label| label.object)
        .or_else(|| by_names_of(flat, draped, |label| label.group))
}

/// The draped face of each flat face, by the names that `name_of` gives.
fn by_names_of(
    flat: &ObjMesh,
    draped: &ObjMesh,
    name_of: fn(Label) -> Option<u32>,
) -> Option<Vec<u32>> {
    // Most files have no names, which is seen at once.
    name_of(flat.label(flat.faces.first()?))?;
    // For each name a queue of its draped faces: within a name faces pair by their order.
    let mut waiting: HashMap<&str, VecDeque<u32>> = HashMap::new();
    for (i, face) in draped.faces.iter().enumerate() {
        if let Some(name) = name_of(draped.label(face)) {
            waiting.entry(&draped.names[name as usize]).or_default().push_back(index32(i));
        }
    }
    let mut partner = Vec::with_capacity(flat.faces.len());
    for face in &flat.faces {
        let name = &flat.names[name_of(flat.label(face))? as usize];
        let other = waiting.get_mut(name.as_str())?.pop_front()?;
        if draped.faces[other as usize].corners != face.corners {
            return None;
        }
        partner.push(other);
    }
    // A name with draped faces left over means different things in the two files (`default`, say).
    // Then the order has to decide.
    let labels = flat.labels.iter().filter_map(|&label| name_of(label));
    let mut used = labels.map(|name| &flat.names[name as usize]);
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
            "{draped_path} has {draped_faces} faces and {flat_path} {flat_faces}: the first \
             {flat_faces} are paired, and the rest, {:.1} % of the area, is left out: right for a body, \
             and lost if it is cloth",
            100.0 * area_share_from(draped, flat_faces)
        ));
    }
    Ok((0..index32(flat_faces)).collect())
}

/// The share of a mesh's area that lies in its faces from one on.
fn area_share_from(mesh: &ObjMesh, face: usize) -> f64 {
    let area = |corners: &[u32; 3]| cross(corners.map(|v| mesh.positions[v as usize])).length();
    let (before, after) = mesh.triangles.split_at(first_triangles(mesh)[face]);
    let [before, after] = [before, after].map(|part| part.iter().map(area).sum::<f64>());
    if after > 0.0 { after / (before + after) } else { 0.0 }
}

/// Refuses coordinates over [`LARGEST`]. Vertices that no pair uses may be anywhere.
fn check_size(
    pairs: &Pairs,
    meshes: [&ObjMesh; 2],
    paths: [&Path; 2],
    partner: &[u32],
) -> Result<(), GarmentError> {
    let within = |points: &[DVec3]| points.par_iter().all(|p| p.abs().max_element() <= LARGEST);
    if within(&pairs.flat) && within(&pairs.draped) {
        return Ok(());
    }
    for i in 0..pairs.len() {
        let values = [pairs.flat_corners(i), pairs.draped_corners(i)].map(largest_coordinate);
        let lines = lines(meshes, partner, pairs.polygons[i]);
        for ((path, line), value) in paths.into_iter().zip(lines).zip(values) {
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

/// The lines of a polygon in the flat file and in the draped one.
fn lines([flat, draped]: [&ObjMesh; 2], partner: &[u32], polygon: u32) -> [u64; 2] {
    let other = partner[polygon as usize];
    [flat.faces[polygon as usize].line, draped.faces[other as usize].line]
}

/// Checks that corners correspond. A flat vertex is one point of the cloth, so it has one draped
/// position, maybe under several numbers. Where many flat vertices have two, the files are refused.
fn check_corners(
    pairs: &mut Pairs,
    meshes: [&ObjMesh; 2],
    paths: [&Path; 2],
    partner: &[u32],
) -> Result<(), GarmentError> {
    // Most tools write the same numbers in both files. Then each vertex has one position.
    if pairs.flat_triangles == pairs.draped_triangles {
        return Ok(());
    }
    // The first draped position of each flat vertex is kept, and later ones are compared with it.
    let tolerance = pairs.same_place();
    let mut places: Vec<Option<DVec3>> = vec![None; pairs.flat.len()];
    let mut torn = vec![false; pairs.flat.len()];
    let mut first = None;
    for (i, flat) in pairs.flat_triangles.iter().enumerate() {
        for (&flat, place) in flat.iter().zip(pairs.draped_corners(i)) {
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
    let polygon = pairs.polygons[first];
    let [flat_line, draped_line] = lines(meshes, partner, polygon);
    let face = polygon as usize + 1;
    if disagreeing as f64 > TORN * vertices as f64 {
        return Err(GarmentError::Corners {
            flat: paths[0].to_path_buf(),
            draped: paths[1].to_path_buf(),
            flat_faces: meshes[0].faces.len(),
            draped_faces: meshes[1].faces.len(),
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
