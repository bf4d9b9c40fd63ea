//! Files: what the pipeline makes, in formats that other tools open.
//!
//! In: blocks of yarns as [`crate::drape::run`] hands them over, yarn by yarn, so that nothing is held whole. Out: one file a writer. Each goes to a
//! temporary file beside its target ([`Output`]) and takes the target's name only when every output of the run is whole, so a failed run
//! leaves no partial file and the old one stays.

mod buffer;
pub mod csv;
mod digits;
mod folder;
pub mod glb;
mod head;
pub mod obj;
mod output;
pub mod ply;
pub mod png;

use std::path::{Path, PathBuf};

use crate::drape::Block;
pub use folder::OutputFolder;
pub use output::Output;

/// Binary formats take numbers as they lie in memory.
const _: () = assert!(cfg!(target_endian = "little"), ".glb and .ply are little-endian");

/// A writer that takes a run's blocks as they come.
pub trait Sink {
    /// Takes the next blocks, in yarn order.
    ///
    /// # Errors
    /// What the disk says.
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError>;

    /// Writes what belongs to the end and gives back the whole file, still under its temporary name.
    ///
    /// # Errors
    /// What the disk says.
    fn finish(self: Box<Self>) -> Result<Output, ExportError>;
}

/// What a file's ending asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A picture.
    Png,
    /// Binary glTF 2.0.
    Glb,
    /// Wavefront OBJ.
    Obj,
    /// Binary PLY.
    Ply,
    /// Data points.
    Csv,
    /// The run's report.
    Json,
}

impl Format {
    /// The format of a path, by its ending in any case.
    ///
    /// # Errors
    /// [`ExportError::UnknownEnding`].
    pub fn of(path: &Path) -> Result<Self, ExportError> {
        let ending = path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
        match ending.as_deref() {
            Some("png") => Ok(Self::Png),
            Some("glb") => Ok(Self::Glb),
            Some("obj") => Ok(Self::Obj),
            Some("ply") => Ok(Self::Ply),
            Some("csv") => Ok(Self::Csv),
            Some("json") => Ok(Self::Json),
            _ => Err(ExportError::UnknownEnding(path.to_owned())),
        }
    }
}

/// Why a file could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// No writer for that ending.
    #[error("{}: no writer for this ending; known are .png .glb .obj .ply .csv .json", .0.display())]
    UnknownEnding(PathBuf),
    /// The disk said no.
    #[error("{}: can't write", path.display())]
    Io {
        /// The target.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Over what the format holds.
    #[error("{}: {bytes} bytes are over the 4 GiB that a .glb holds; lower --st or --sr, or write .obj", path.display())]
    TooLarge {
        /// The target.
        path: PathBuf,
        /// What it would take.
        bytes: u64,
    },
    /// More vertices than the format numbers.
    #[error("{}: {vertices} vertices are more than the 2^32 that a .ply numbers; lower --st or --sr, or write .obj", path.display())]
    TooMany {
        /// The target.
        path: PathBuf,
        /// How many there would be.
        vertices: u64,
    },
}
