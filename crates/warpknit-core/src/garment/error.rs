//! Errors of reading a garment's files.
//!
//! Each message is a single line. It names the file, the line of the file where there is one, and
//! what the user can do.

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::counted::counted;

/// Reasons why no garment could be read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum GarmentError {
    /// The file could not be opened.
    #[error("{}: cannot be opened ({reason}): check the path and its permissions", one_line(.path))]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system said.
        reason: std::io::Error,
    },
    /// A folder was given where a file is needed.
    #[error("{}: is a directory: give a file", one_line(.path))]
    Directory {
        /// The folder.
        path: PathBuf,
    },
    /// Reading stopped half-way.
    #[error(
        "{}:{line}: cannot be read on ({reason}): copy the file to a sound disk and try again",
        one_line(.path)
    )]
    Read {
        /// The file.
        path: PathBuf,
        /// The line that could not be read, from 1.
        line: u64,
        /// What the system said.
        reason: std::io::Error,
    },
    /// The file is of a kind that isn't read.
    #[error("{}: this is {kind}; export OBJ, GLB, USD or PLY", one_line(.path))]
    Kind {
        /// The file.
        path: PathBuf,
        /// What it is.
        kind: &'static str,
    },
    /// A file that isn't OBJ is wrong.
    #[error("{}: {what}", one_line(.path))]
    Mesh {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// The file has no bytes.
    #[error("{}: is empty: export the garment again", one_line(.path))]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The file has no vertex and no face.
    #[error(
        "{}: is no OBJ text file (no `v` and no `f` record in {}): \
         export the garment as Wavefront OBJ", one_line(.path), counted(*.lines, "line")
    )]
    NotObj {
        /// The file.
        path: PathBuf,
        /// Lines of the file.
        lines: u64,
    },
    /// The file is text of 16-bit or 32-bit characters.
    #[error(
        "{}: is UTF-16 or UTF-32 text, which OBJ files are not: save it as UTF-8 or plain text \
         (on Windows, PowerShell's `>` writes UTF-16)", one_line(.path)
    )]
    Wide {
        /// The file.
        path: PathBuf,
    },
    /// The file has vertices but no face.
    #[error(
        "{}: holds {} and no face: export the garment as a mesh, not as points or curves",
        one_line(.path), counted(*.vertices, "point")
    )]
    NoFaces {
        /// The file.
        path: PathBuf,
        /// Vertices it holds.
        vertices: u64,
    },
    /// A record is wrong.
    #[error("{}:{line}: {fault}", one_line(.path))]
    Record {
        /// The file.
        path: PathBuf,
        /// The line on which the record starts, from 1.
        line: u64,
        /// What is wrong with it.
        fault: GarmentFault,
    },
    /// A coordinate is finite, but too large for areas computed from it to be exact.
    #[error(
        "{}:{line}: this face has a coordinate of {value:e}, over the limit of {limit:e}: \
         export the garment in a common unit", one_line(.path)
    )]
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
    /// The file has no texture coordinates that could be the flat pattern.
    #[error(
        "{}: no face uses a texture coordinate (the file holds {texture} `vt`), \
         so there is no flat pattern: export it with UVs, or give a FLAT and a DRAPED file",
        one_line(.path)
    )]
    NoTexture {
        /// The file.
        path: PathBuf,
        /// Texture coordinates that no face uses.
        texture: usize,
    },
    /// The two files have different faces.
    #[error(
        "{} has {} and {} has {}; \
         the first that differs is face {face} ({difference}): \
         export both from the same mesh, faces in the same order",
        one_line(.flat), counted(*.flat_faces as u64, "face"),
        one_line(.draped), counted(*.draped_faces as u64, "face")
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
    /// The files have the same number of faces, but their corners belong to different vertices.
    #[error(
        "{} has {} and {} has {}, but their corners disagree: \
         {disagreeing} of {vertices} flat vertices are at two places when draped, \
         first in face {face} (lines {flat_line} and {draped_line}): \
         export both from the same mesh, faces and corners in the same order",
        one_line(.flat), counted(*.flat_faces as u64, "face"),
        one_line(.draped), counted(*.draped_faces as u64, "face")
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
    /// No piece of the pattern can hold stitches.
    #[error("{}: no usable panel: {reason}", one_line(.path))]
    NoPanel {
        /// The file with the flat pattern.
        path: PathBuf,
        /// Why the pieces were refused.
        reason: String,
    },
    /// Too much of the garment can't be knitted.
    #[error(
        "{}: {what}; over {} % is refused: {remedy}, or give --allow-loss",
        one_line(.path),
        100.0 * super::MOST_LOSS
    )]
    Loss {
        /// The file with the flat pattern.
        path: PathBuf,
        /// The area, its share and the reasons.
        what: String,
        /// What to do about it.
        remedy: String,
    },
    /// An option has a number out of its range.
    #[error("{option} is {value}, but must be {must}")]
    Option {
        /// The option as the user writes it.
        option: &'static str,
        /// What was given.
        value: f64,
        /// What it must be.
        must: &'static str,
    },
    /// Arrays that don't belong together.
    #[error("the arrays hold no garment")]
    Arrays(#[from] ArrayFault),
}

/// Why arrays hold no garment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ArrayFault {
    /// No triangle.
    #[error("there are no triangles")]
    Empty,
    /// A vertex lacks its flat or its draped position.
    #[error("there are {flat} flat and {draped} draped positions: give each vertex both")]
    Lengths {
        /// Flat positions.
        flat: usize,
        /// Draped positions.
        draped: usize,
    },
    /// A triangle names a vertex that isn't there.
    #[error("triangle {triangle} names vertex {vertex} of {vertices}: count vertices from 0")]
    Index {
        /// The triangle, from 0.
        triangle: usize,
        /// The vertex that it names.
        vertex: u32,
        /// How many there are.
        vertices: usize,
    },
    /// A position that is infinite or not a number.
    #[error("a position of vertex {vertex} is not finite: leave such vertices out")]
    NotFinite {
        /// The vertex, from 0.
        vertex: usize,
    },
}

impl GarmentError {
    /// The error for a fault in the record at `line`.
    pub(super) fn record(path: &Path, line: u64, fault: GarmentFault) -> Self {
        Self::Record { path: path.to_path_buf(), line, fault }
    }
}

/// Faults of a single record of an OBJ file. Tokens are quoted, shortened and escaped.
#[derive(Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum GarmentFault {
    /// The record is too long, with its continuation lines joined.
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
        /// The text found there.
        token: String,
    },
    /// A NaN, an infinity, or a number beyond the range of 64-bit floats.
    #[error(
        "`{record}` holds {token}, which is not finite: \
         repair or re-run the simulation that wrote it"
    )]
    NotFinite {
        /// `v` or `vt`.
        record: &'static str,
        /// The text found there.
        token: String,
    },
    /// Too few or too many numbers.
    #[error(
        "`{record}` holds {}, but needs {least} to {most}: is the file cut off?",
        counted(*.found as u64, "number")
    )]
    NumberCount {
        /// `v` or `vt`.
        record: &'static str,
        /// Numbers found.
        found: usize,
        /// The smallest allowed count.
        least: usize,
        /// The largest allowed count.
        most: usize,
    },
    /// A corner that isn't `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    #[error(
        "the face's corner {token} is not of the form v, v/vt, v//vn or v/vt/vn: \
         is the file cut off?"
    )]
    Corner {
        /// The text found there.
        token: String,
    },
    /// An index of 0. OBJ counts from 1.
    #[error("the face's corner {token} has the index 0, but OBJ counts from 1: re-export the file")]
    IndexZero {
        /// The corner.
        token: String,
    },
    /// An index of a vertex that the file doesn't hold.
    #[error(
        "the face refers to `{record}` number {index}, but there are {count}: \
         is the file cut off, or edited by hand?"
    )]
    IndexRange {
        /// `v` or `vt`.
        record: &'static str,
        /// The index as written, which may be negative.
        index: i64,
        /// Number of vertices in the file, or up to this line for a negative index.
        count: u64,
    },
    /// Fewer than three corners.
    #[error(
        "the face has {}, but needs three or more: is the file cut off?",
        counted(*.found as u64, "corner")
    )]
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

/// A path for a message, with control characters escaped so that the message stays on one line.
fn one_line(path: &Path) -> String {
    let path = path.display().to_string();
    path.chars()
        .map(|c| if c.is_control() { c.escape_default().to_string() } else { c.into() })
        .collect()
}

/// A token for a message: in quotes, shortened to 40 characters, with control characters escaped so
/// that the message stays on one line.
pub(super) fn quoted(token: &[u8]) -> String {
    // 160 bytes hold 40 characters of any encoding. A token may have a megabyte, of which only the
    // start is converted.
    let text = String::from_utf8_lossy(&token[..token.len().min(160)]);
    let mut short: String = text.chars().take(40).collect();
    if short.len() < text.len() || token.len() > 160 {
        short.push('…');
    }
    format!("{short:?}")
}
