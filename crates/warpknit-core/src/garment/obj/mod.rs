//! OBJ text to a triangulated mesh.
//!
//! In: a path. Out: an [`ObjMesh`]. Its triangles are in file order, a fan from each face's first
//! corner. Positions and texture coordinates are numbered independently, as in the file.
//!
//! Method: two ways to read a record. Nearly all lines of nearly all files are plain: a keyword, and
//! decimal numbers or positive indices behind it. Those are read where they lie in the buffer, in
//! one pass over their bytes (`plain`, with `numbers`). Any other line is read slowly (`records`
//! joins continuations and drops comments, [`Builder::record`] checks word by word). That way has
//! all messages, so the fast one never refuses anything: it leaves what it does not know.
//!
//! tobj 4.0.5, the usual reader, no longer reads garments. It takes 539 ns a triangle with `v`,
//! `vt` and `vn`. Reading two files of two million triangles spends some 90 ns a triangle and file
//! here (a profile on a busy machine of 2 cores, 2026-11). And tobj alone isn't enough. It fills a missing
//! `vt` with a neighbour's. It makes a triangle of `l 1 2 3`. It loses the first vertex to a byte
//! order mark. It accepts NaN. It renumbers vertices at each group. It refuses `\` continuations and
//! trailing comments. Its errors have no line. tobj stays as the second reader in tests: what it
//! reads well must come out the same here (`tests`).
//!
//! Memory is bounded by the longest record and by the mesh: blanks, comments and unknown records
//! take none. A face takes 16 bytes, a triangle 12 or 24, a position 24.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::io::BufRead;
use std::path::Path;
use std::sync::Arc;

use glam::DVec3;

use super::Unit;
use super::error::{GarmentError, GarmentFault};
use builder::Builder;
use records::{Records, Stop};

mod builder;
mod names;
mod numbers;
mod plain;
mod records;
#[cfg(test)]
mod tests;

/// Size of the read buffer, bytes. It fits in the L2 cache. Each buffer's end cuts a line, which is
/// read slowly, so much smaller ones would cost time.
pub(super) const BUFFER: usize = 1 << 18;
/// The index of a texture coordinate that a corner doesn't have.
pub(super) const UNTEXTURED: u32 = u32::MAX;

/// The mesh of a file, triangulated. Its arrays are shared with those who pair it.
#[derive(Debug, Default)]
pub(super) struct ObjMesh {
    pub(super) positions: Arc<Vec<DVec3>>,
    /// Texture coordinates, with z = 0.
    pub(super) texture: Arc<Vec<DVec3>>,
    /// Faces as written, in file order.
    pub(super) faces: Vec<Face>,
    /// Triangles of all faces, indices into `positions`.
    pub(super) triangles: Arc<Vec<[u32; 3]>>,
    /// The same triangles, as indices into `texture`. Empty where no face has `vt`. The entries of
    /// an untextured face are no indices.
    pub(super) texture_triangles: Arc<Vec<[u32; 3]>>,
    /// Number of triangles of faces with a corner that has no `vt`.
    pub(super) untextured: usize,
    /// Names of the faces' objects and groups; faces refer to them.
    pub(super) labels: Vec<Label>,
    /// Object and group names; labels refer to them.
    pub(super) names: Vec<String>,
    /// The unit of positions, where the file says one.
    pub(super) unit: Option<Unit>,
}

/// The object and the group of a face, as indices into [`ObjMesh::names`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Label {
    pub(super) object: Option<u32>,
    pub(super) group: Option<u32>,
}

/// A face as written in the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face {
    pub(super) line: u64,
    pub(super) corners: u32,
    /// Index into [`ObjMesh::labels`].
    pub(super) label: u32,
}

impl Face {
    /// Number of its triangles.
    pub(super) fn triangles(self) -> usize {
        self.corners as usize - 2
    }
}

impl ObjMesh {
    /// Whether every face has `vt`.
    pub(super) fn is_textured(&self) -> bool {
        self.untextured == 0
    }

    /// Whether a triangle's corners all have `vt`.
    pub(super) fn has_texture(&self, triangle: usize) -> bool {
        self.texture_triangles.get(triangle).is_some_and(|corners| corners[0] != UNTEXTURED)
    }

    /// The names of a face.
    pub(super) fn label(&self, face: &Face) -> Label {
        self.labels[face.label as usize]
    }

    /// Hash of all faces' corners and names, in order. Equal for files with the same connectivity.
    pub(super) fn connectivity(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.triangles.hash(&mut hasher);
        let mut last = None;
        for face in &self.faces {
            hasher.write_u32(face.corners);
            // Names are hashed where they change. Faces are paired by their names first, so files
            // with other names have another connectivity.
            if last != Some(face.label) {
                last = Some(face.label);
                let Label { object, group } = self.label(face);
                [object, group]
                    .map(|name| name.map(|name| &self.names[name as usize]))
                    .hash(&mut hasher);
            }
        }
        hasher.finish()
    }
}

/// Parses OBJ text. `path` is only for messages.
pub(super) fn parse(mut input: impl BufRead, path: &Path) -> Result<ObjMesh, GarmentError> {
    // An error of the first bytes comes again when they are read, with its line.
    if input.fill_buf().is_ok_and(is_wide) {
        return Err(GarmentError::Wide { path: path.to_path_buf() });
    }
    let mut lines = Records::new(input);
    let mut builder = Builder::default();
    read_records(&mut lines, &mut builder).map_err(|stop| stop.in_file(path))?;
    if lines.bytes == 0 {
        return Err(GarmentError::Empty { path: path.to_path_buf() });
    }
    builder.into_mesh(lines.number, path)
}

/// Reads all records: plain lines as long as there are any, then one record slowly, and so on.
fn read_records(lines: &mut Records<impl BufRead>, builder: &mut Builder) -> Result<(), Stop> {
    loop {
        lines.take_lines(|text, before| builder.plain_lines(text, before))?;
        if !lines.next()? {
            return Ok(());
        }
        let first = lines.first;
        builder.record(&lines.record, first).map_err(|fault| Stop::Fault(first, fault))?;
    }
}

/// Whether text begins as UTF-16 and UTF-32 do: with their byte order mark, or with a character
/// and a zero byte.
fn is_wide(text: &[u8]) -> bool {
    match text {
        [0xFF, 0xFE, ..] | [0xFE, 0xFF, ..] => true,
        [0, 0, 0xFE, 0xFF, ..] => true,
        [0, 0, 0, other, ..] | [0, other, ..] | [other, 0, ..] => {
            matches!(other, b'\t'..=b'\r' | b' '..=b'~')
        }
        _ => false,
    }
}
