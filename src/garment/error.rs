//! What can be wrong with a garment's files: one line each, with the file, the line where there is
//! one, and what to do.

use std::path::{Path, PathBuf};

use thiserror::Error;

/// Why no garment could be read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum GarmentError {
    /// The file could not be opened.
    #[error("{}: cannot be opened ({reason}): check the path and its permissions", .path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system said.
        reason: std::io::Error,
    },
    /// A folder was given where a file is needed.
    #[error("{}: is a directory: give an OBJ file", .path.display())]
    Directory {
        /// The folder.
        path: PathBuf,
    },
    /// Reading stopped half-way.
    #[error("{}:{line}: cannot be read on ({reason}): copy the file to a sound disk and try again", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The line that could not be read, from 1.
        line: u64,
        /// What the system said.
        reason: std::io::Error,
    },
    /// The file has no bytes.
    #[error("{}: is empty: export the garment again", .path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// Not one record of the file is a vertex or a face.
    #[error("{}: is no OBJ text file ({lines} lines, no `v` and no `f` record): export the garment as Wavefront OBJ", .path.display())]
    NotObj {
        /// The file.
        path: PathBuf,
        /// Lines looked at.
        lines: u64,
    },
    /// Vertices, but nothing between them.
    #[error("{}: holds {vertices} vertices and no face: export the garment as a mesh, not as points or curves", .path.display())]
    NoFaces {
        /// The file.
        path: PathBuf,
        /// Vertices it holds.
        vertices: u64,
    },
    /// A record is wrong.
    #[error("{}:{line}: {fault}", .path.display())]
    Record {
        /// The file.
        path: PathBuf,
        /// The line on which the record starts, from 1.
        line: u64,
        /// What is wrong with it.
        fault: GarmentFault,
    },
    /// A coordinate is finite, but areas made of it would not be.
    #[error("{}:{line}: this face has a coordinate of {value:e}, over the limit of {limit:e}: export the garment in a common unit", .path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// The face's line.
        line: u64,
        /// The coordinate.
        value: f64,
        /// The largest that is accepted.
        limit: f64,
    },
    /// One file was given and it has no flat pattern in it.
    #[error(
        "{}: no face uses a texture coordinate (the file holds {texture} `vt`), so there is no flat pattern: \
         export it with UVs, or give a FLAT and a DRAPED file", .path.display()
    )]
    NoTexture {
        /// The file.
        path: PathBuf,
        /// Texture coordinates that no face uses.
        texture: usize,
    },
    /// The two files have different faces.
    #[error(
        "{} has {flat_faces} faces and {} has {draped_faces}; the first that differs is face {face} ({difference}): \
         export both from the same mesh, faces in the same order", .flat.display(), .draped.display()
    )]
    Faces {
        /// The flat file.
        flat: PathBuf,
        /// The draped file.
        draped: PathBuf,
        /// Faces of the flat file.
        flat_faces: usize,
        /// Faces of the draped file.
        draped_faces: usize,
        /// The first face that differs, from 1.
        face: usize,
        /// How it differs, with both lines.
        difference: String,
    },
    /// As many faces, but their corners belong to different vertices.
    #[error(
        "{} has {flat_faces} faces and {} has {draped_faces}, but their corners disagree: {disagreeing} of {vertices} flat vertices \
         are at two places when draped, first in face {face} (lines {flat_line} and {draped_line}): export both from the same mesh, \
         faces and corners in the same order", .flat.display(), .draped.display()
    )]
    Corners {
        /// The flat file.
        flat: PathBuf,
        /// The draped file.
        draped: PathBuf,
        /// Faces of the flat file.
        flat_faces: usize,
        /// Faces of the draped file.
        draped_faces: usize,
        /// Flat vertices that would be at two places.
        disagreeing: usize,
        /// Flat vertices in use.
        vertices: usize,
        /// The first such face of the flat file, from 1.
        face: usize,
        /// Its line in the flat file.
        flat_line: u64,
        /// Its line in the draped file.
        draped_line: u64,
    },
    /// Not one piece of the pattern can be knitted on.
    #[error("{}: no usable panel: {reason}", .path.display())]
    NoPanel {
        /// The file with the flat pattern.
        path: PathBuf,
        /// Why the pieces were refused.
        reason: String,
    },
    /// An option's number makes no sense.
    #[error("{option} is {value}, but must be {must}")]
    Option {
        /// The option as the user writes it.
        option: &'static str,
        /// What was given.
        value: f64,
        /// What it must be.
        must: &'static str,
    },
    /// tobj refused what the cleaning pass had let through; no input known does that.
    #[error("{}: the OBJ parser refused the file ({reason}): please report it", .path.display())]
    Parser {
        /// The file.
        path: PathBuf,
        /// What tobj said.
        reason: tobj::LoadError,
    },
}

impl GarmentError {
    /// The fault of a record, at its place.
    pub(super) fn record(path: &Path, line: u64, fault: GarmentFault) -> Self {
        Self::Record { path: path.to_path_buf(), line, fault }
    }
}

/// What can be wrong with one record of an OBJ file. Tokens are quoted cut short and with odd
/// characters escaped.
#[derive(Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum GarmentFault {
    /// The record, its continuations joined, doesn't end.
    #[error("this line is longer than {limit} bytes: is the file a text file, with line ends?")]
    LineTooLong {
        /// The longest that is accepted.
        limit: usize,
    },
    /// Not a number.
    #[error("`{record}` holds {token}, which is no number: write it like 1.25 or 1.8e-2")]
    Number {
        /// `v` or `vt`.
        record: &'static str,
        /// What stands there.
        token: String,
    },
    /// A NaN, an infinity, or a number over what 64-bit floats hold.
    #[error(
        "`{record}` holds {token}, which is not finite: repair or re-run the simulation that wrote it"
    )]
    NotFinite {
        /// `v` or `vt`.
        record: &'static str,
        /// What stands there.
        token: String,
    },
    /// Too few or too many numbers.
    #[error("`{record}` holds {found} numbers, but needs {least} to {most}: is the file cut off?")]
    NumberCount {
        /// `v` or `vt`.
        record: &'static str,
        /// How many stand there.
        found: usize,
        /// The fewest.
        least: usize,
        /// The most.
        most: usize,
    },
    /// A corner that isn't `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    #[error(
        "the face's corner {token} is not of the form v, v/vt, v//vn or v/vt/vn: is the file cut off?"
    )]
    Corner {
        /// What stands there.
        token: String,
    },
    /// OBJ counts from 1.
    #[error("the face's corner {token} has the index 0, but OBJ counts from 1: re-export the file")]
    IndexZero {
        /// The corner.
        token: String,
    },
    /// A vertex that the file doesn't hold.
    #[error(
        "the face refers to `{record}` number {index}, but there are {count}: is the file cut off, or edited by hand?"
    )]
    IndexRange {
        /// `v` or `vt`.
        record: &'static str,
        /// The index as written, negative ones included.
        index: i64,
        /// How many there are (for a negative index: up to this line).
        count: u64,
    },
    /// Fewer than three corners.
    #[error("the face has {found} corners, but needs three or more: is the file cut off?")]
    FewCorners {
        /// How many it has.
        found: usize,
    },
    /// More triangles than 32-bit indices can name.
    #[error("from here on there are over {limit} triangles or vertices: split the garment")]
    TooMany {
        /// The most that is accepted.
        limit: u64,
    },
}

/// A token for a message: cut at 40 characters, in quotes, with control characters escaped so that
/// it stays on one line.
pub(super) fn quoted(token: &[u8]) -> String {
    let text = String::from_utf8_lossy(&token[..token.len().min(160)]);
    let mut short: String = text.chars().take(40).collect();
    if short.len() < text.len() || token.len() > 160 {
        short.push('…');
    }
    format!("{short:?}")
}
