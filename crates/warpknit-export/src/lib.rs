//! Files: what the pipeline makes, in formats that other tools open.
//!
//! In: blocks of yarns as [`warpknit_core::drape::run`] hands them over, yarn by yarn, so that nothing is
//! held whole. Out: one file a writer. Each goes to a temporary file beside its target ([`Output`])
//! and takes the target's name only when every output of the run is whole, so a failed run leaves
//! no partial file and the old one stays. A program that ends in another way than by returning
//! calls [`remove_temporaries`] first.

pub mod bcc;
mod buffer;
pub mod csv;
pub mod curves;
mod digits;
pub mod fibres;
mod folder;
pub mod glb;
pub mod inp;
mod lines;
pub mod mtl;
pub mod npz;
pub mod obj;
pub mod obj_lines;
mod output;
mod patched_header;
pub mod ply;
pub mod png;
mod spool;
mod temporary;
mod texture;
pub mod usda;
pub mod usda_frames;

use std::path::{Path, PathBuf};

pub use folder::OutputFolder;
pub use output::Output;
pub use temporary::{TemporaryFolder, remove_temporaries};
pub use texture::Wardrobe;
use warpknit_core::drape::Block;
use warpknit_core::fabric::Fabric;
use warpknit_core::yarn::tube::Section;

/// Binary formats take numbers as they lie in memory.
const _: () = assert!(cfg!(target_endian = "little"), ".glb and .ply are little-endian");

/// A writer that takes a run's blocks as they come.
pub trait Sink {
    /// Takes the next blocks, in yarn order.
    ///
    /// # Errors
    /// What the disk says.
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError>;

    /// Writes what belongs to the end and gives back the whole file, and those that come with it,
    /// still under their temporary names.
    ///
    /// # Errors
    /// What the disk says.
    fn finish(self: Box<Self>) -> Result<Vec<Output>, ExportError>;
}

/// What a file's ending asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A picture.
    Png,
    /// Binary glTF 2.0.
    Glb,
    /// Wavefront OBJ: tubes.
    Obj,
    /// Wavefront OBJ: centre lines. It has the ending of [`Format::Obj`], which is what endings ask
    /// for.
    ObjLines,
    /// Binary PLY.
    Ply,
    /// USD text: curves.
    Usda,
    /// Binary Curve Collection.
    Bcc,
    /// Mitsuba's curves, as text.
    Curves,
    /// Abaqus input: beams.
    Inp,
    /// Arrays for numpy.
    Npz,
    /// Data points.
    Csv,
    /// The run's report.
    Json,
}

/// What endings ask for.
const ENDINGS: [(&str, Format); 11] = [
    (".png", Format::Png),
    (".glb", Format::Glb),
    (".obj", Format::Obj),
    (".ply", Format::Ply),
    (".usda", Format::Usda),
    (".bcc", Format::Bcc),
    (".curves.txt", Format::Curves),
    (".inp", Format::Inp),
    (".npz", Format::Npz),
    (".csv", Format::Csv),
    (".json", Format::Json),
];

impl Format {
    /// The format of a path, by its ending in any case.
    ///
    /// # Errors
    /// [`ExportError::UnknownEnding`].
    pub fn of(path: &Path) -> Result<Self, ExportError> {
        let name = path
            .file_name()
            .and_then(|name| name.to_str())
            .unwrap_or_default()
            .to_ascii_lowercase();
        // A name is more than its ending.
        let known = ENDINGS
            .iter()
            .find(|(ending, _)| name.strip_suffix(ending).is_some_and(|stem| !stem.is_empty()));
        known.map(|(_, format)| *format).ok_or_else(|| ExportError::UnknownEnding(path.to_owned()))
    }

    /// The ending that asks for it.
    #[must_use]
    pub fn ending(self) -> &'static str {
        let asked = if self == Self::ObjLines { Self::Obj } else { self };
        ENDINGS.iter().find(|(_, format)| *format == asked).map_or("", |(ending, _)| ending)
    }

    /// Whether it holds tubes.
    #[must_use]
    pub fn holds_tubes(self) -> bool {
        matches!(self, Self::Glb | Self::Obj | Self::Ply)
    }
}

/// Each bar's radius, mm, where the thickest one's is the section's.
fn radii(fabric: &Fabric, section: &Section) -> Vec<f32> {
    let narrow = |thickness| warpknit_core::number::narrow(section.radius * thickness);
    fabric.thickness().into_iter().map(narrow).collect()
}

/// Why a file could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// No writer for that ending.
    #[error("{}: no writer for this ending; known are {}", .0.display(), ENDINGS.map(|(ending, _)| ending).join(" "))]
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
    #[error("{}: {bytes} bytes are over the 4 GiB that a .glb holds; make parts with --tile, lower --st, --sr or the densities, or write .obj", path.display())]
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
