//! Yarns as files that other tools open.
//!
//! In: blocks of yarns as [`warpknit_core::drape::run`] hands them over, and a [`ClothInfo`]: what
//! the files say of the cloth besides its points. Out: bytes in one of the [`Format`]s. Blocks are
//! written as they come, in yarn order, so memory stays bounded however large the cloth is.
//!
//! - [`write()`] knits, maps and writes a cloth in one call.
//! - [`writer`] makes a [`Sink`] of any format over anything that is `Write + Seek`: a file or a
//!   `Cursor<Vec<u8>>`. Hand it blocks, then finish it.
//! - [`FileWriter`] does the same for a path: the file and its companions (the `.mtl` and the
//!   pictures of an `.obj`) are [`Output`]s, which appear under their names only when they are
//!   whole. So a failed run leaves no partial file, and an old file stays as it was.
//!
//! Files and folders are touched in `output.rs`, `write_behind.rs`, `folder.rs` and `temporary.rs`
//! alone. A program that may end without returning calls [`remove_temporaries`] first.

mod axes;
mod base64;
pub mod bcc;
mod buffer;
mod crate_file;
mod crate_ints;
mod crate_spec;
pub mod csv;
pub mod curves;
mod destination;
mod digits;
mod facts;
pub mod fibres;
mod file_writer;
mod folder;
mod format;
pub mod glb;
mod glb_array;
mod glb_block;
mod glb_grid;
mod glb_material;
mod glb_nodes;
mod glb_options;
pub mod html;
mod html_lines;
mod info;
pub mod inp;
mod lines;
pub mod material;
mod meshopt;
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
mod usd_stage;
pub mod usda;
pub mod usda_frames;
pub mod usdc;
mod whole;
mod write_behind;

use std::io::{Seek, Write};
use std::path::{Path, PathBuf};

pub use axes::{Axes, FileUnit, UpAxis};
pub use destination::Destination;
pub use facts::{Facts, SystemFacts};
pub use file_writer::FileWriter;
pub use folder::OutputFolder;
pub use format::Format;
pub use info::{ClothInfo, Expected, StrandStyle, default_section};
pub use inp::InpDialect;
pub use mtl::Companion;
pub use output::Output;
pub use temporary::{TemporaryFolder, remove_temporaries};
pub use texture::TextureSet;
pub use usd_stage::UsdCurves;
use warpknit_core::drape::Block;
pub use whole::{WriteOptions, Written, write};

/// Binary formats take numbers as they lie in memory.
const _: () = assert!(cfg!(target_endian = "little"), ".glb and .ply are little-endian");

/// A writer that takes a run's blocks as they come; `W` is where its bytes go.
pub trait Sink<W> {
    /// Writes the next blocks, in yarn order.
    ///
    /// # Errors
    /// [`ExportError::Io`]; [`ExportError::TooLarge`] and [`ExportError::TooMany`] at a format's
    /// limits; [`ExportError::NoPanel`] where a format needs a panel that the [`ClothInfo`] lacks.
    ///
    /// # Panics
    /// If a block is of a bar that has no [`StrandStyle`].
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError>;

    /// Writes the end of the file, flushes it and gives the target back.
    ///
    /// # Errors
    /// As of [`Sink::take`], and [`ExportError::HeaderTooLong`].
    fn finish(self: Box<Self>) -> Result<W, ExportError>;
}

/// A writer of any format that holds yarns.
///
/// Where the cloth is described by its bundles ([`ClothInfo::from_bundles`]), the writer replaces
/// each yarn by its fibres. Formats of tubes need blocks with surfaces; those of fibres get theirs
/// here.
///
/// # Errors
/// [`ExportError::Io`]; [`ExportError::NotOfYarns`] for pictures and reports.
///
/// ```
/// use std::io::Cursor;
/// use warpknit_core::{drape, fabric::Fabric};
/// use warpknit_export::{ClothInfo, ExportError, Format, Destination, default_section, writer};
///
/// let fabric = Fabric::named("tricot")?;
/// let panel = drape::swatch_panel(&fabric, 4, 6);
/// let cloth = drape::Cloth::swatch(&panel, &fabric, 4, 6);
/// let info = ClothInfo::from_fabric(&fabric, default_section(fabric.radius()));
/// let mut sink = writer(Format::Bcc, Destination::new(Cursor::new(Vec::new())), &info)?;
/// let mut take = |blocks: &[drape::Block]| sink.take(blocks);
/// drape::run(&cloth, &drape::DrapeOptions::default(), &mut |_, _| {}, &mut take)?;
/// let bytes = sink.finish()?.into_inner();
/// assert_eq!(&bytes[..3], b"BCC");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn writer<'a, W: Write + Seek + Send + 'a>(
    format: Format,
    target: Destination<W>,
    cloth: &ClothInfo<'a>,
) -> Result<Box<dyn Sink<W> + 'a>, ExportError> {
    let writer: Box<dyn Sink<W> + 'a> = match format {
        Format::Glb => Box::new(glb::GlbWriter::create(target, cloth)?),
        Format::Obj => Box::new(obj::ObjWriter::create(target, cloth)?),
        Format::ObjLines => Box::new(obj_lines::ObjLinesWriter::create(target, cloth)?),
        Format::Ply => Box::new(ply::PlyWriter::create(target, cloth)?),
        Format::Html => Box::new(html::HtmlWriter::create(target, cloth)?),
        Format::Usda => Box::new(usda::UsdaWriter::create(target, cloth)?),
        Format::Usdc => Box::new(usdc::UsdcWriter::create(target, cloth)?),
        Format::Bcc => Box::new(bcc::BccWriter::create(target, cloth)?),
        Format::Curves => Box::new(curves::CurvesWriter::create(target, cloth)?),
        Format::Inp => Box::new(inp::InpWriter::create(target, cloth)?),
        Format::Npz => Box::new(npz::NpzWriter::create(target, cloth)?),
        Format::Csv => Box::new(csv::CsvWriter::create(target, cloth)?),
        Format::Png | Format::Json => return Err(ExportError::NotOfYarns(format.ending())),
    };
    if cloth.bundles.is_empty() {
        return Ok(writer);
    }
    let surface = format.holds_tubes().then_some(cloth.section);
    Ok(Box::new(fibres::FibreWriter::new(writer, cloth.bundles.clone(), surface)))
}

/// Why a file could not be written. The path is that of the target, where one is known.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// No writer for that ending.
    #[error("{}: no writer for this ending; known are {}", .0.display(), format::endings())]
    UnknownEnding(PathBuf),
    /// The format holds no yarns.
    #[error("a {0} holds no yarns, and blocks can't be written to it")]
    NotOfYarns(&'static str),
    /// The target or the disk refused.
    #[error("{}can't write", prefix(path.as_deref()))]
    Io {
        /// The target.
        path: Option<PathBuf>,
        /// What the system says.
        source: std::io::Error,
    },
    /// Over what the format holds.
    #[error("{}{bytes} bytes are over the 4 GiB that a .glb holds; make parts with --tile, lower \
             --st, --sr or the densities, or write .obj", prefix(path.as_deref()))]
    TooLarge {
        /// The target.
        path: Option<PathBuf>,
        /// What it would take.
        bytes: u64,
    },
    /// More vertices than the format numbers.
    #[error("{}{vertices} vertices are more than the 2^32 that a .ply numbers; lower --st or \
             --sr, or write .obj", prefix(path.as_deref()))]
    TooMany {
        /// The target.
        path: Option<PathBuf>,
        /// How many there would be.
        vertices: u64,
    },
    /// More than a page holds.
    #[error("{}{count} {what} are over the {most} that a page holds; make a swatch of \
             fewer wales and courses, enlarge the loops of a garment (drape --enlarge auto), make \
             parts with --tile, or write .glb or .usda", prefix(path.as_deref()))]
    PageTooLarge {
        /// The target.
        path: Option<PathBuf>,
        /// How many there are, so far or in all.
        count: u64,
        /// Of what.
        what: &'static str,
        /// The most.
        most: u64,
    },
    /// A header longer than the room that was kept for it.
    #[error("{}the header takes {bytes} bytes and there is room for {room}; there were more \
             blocks or yarns than expected", prefix(path.as_deref()))]
    HeaderTooLong {
        /// The target.
        path: Option<PathBuf>,
        /// What the header takes.
        bytes: usize,
        /// What was kept for it.
        room: usize,
    },
    /// A block of a panel that the [`ClothInfo`] lacks.
    #[error("{}yarns lie on panel {panel}, and {panels} panels are known", prefix(path.as_deref()))]
    NoPanel {
        /// The target.
        path: Option<PathBuf>,
        /// The block's panel, from 0.
        panel: usize,
        /// How many there are.
        panels: usize,
    },
}

/// What an error begins with: the target's path, where one is known.
fn prefix(path: Option<&Path>) -> String {
    path.map_or_else(String::new, |path| format!("{}: ", path.display()))
}
