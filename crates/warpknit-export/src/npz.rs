//! All of a cloth's arrays for Python (`numpy.load`): an `.npz`, which is a ZIP archive, compressed
//! only if [`NpzOptions`] say so, with one `.npy` an array, little-endian (NumPy Enhancement Proposal 1, "A Simple File
//! Format for NumPy Arrays", version 1.0 of the format).
//!
//! - A row a point, strand after strand, with the ends that the panel's edge cut: `flat`, `draped`,
//!   `normal` (f8, 3 each, mm), `triangle` (u4, in file order), `weights` (f8, 3), `course`, `wale`
//!   (i4), `kind` (u1: 0 loop, 1 inlay, 2 turn, 255 a cut end) and `point` (u2; 0 of a cut end). A cut
//!   end has the course and the wale of the data point beside it.
//! - A row a strand: `length` (u4, its points), `yarn`, `panel`, `bar` (u4, from 0).
//! - A row a bar: `radius` (f8, mm), `color` (u1, 3, sRGB).
//!
//! On request all floats are f4: to within 0.02 µm half a metre from the origin.
//!
//! Each array waits in a spool until the archive is put together at the end.

use std::io::{self, Seek, Write};

use glam::DVec3;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::buffer::{Buffer, BufferPool};
use super::csv::check_panels;
use super::spool::Spool;
use super::{ClothInfo, Destination, ExportError, Sink};
use warpknit_core::drape::Block;
use warpknit_core::drape::strands::CUT;
use warpknit_core::garment::Panel;
use warpknit_core::ids::index32;
use warpknit_core::knit::PointKind;

/// The kind of an end that was cut.
const CUT_KIND: u8 = u8::MAX;

/// An array with a row a point or a strand.
#[derive(Clone, Copy, Debug)]
enum NpzArray {
    Flat,
    Draped,
    Normal,
    Triangle,
    Weights,
    Course,
    Wale,
    Kind,
    Point,
    Length,
    Yarn,
    Panel,
    Bar,
}

/// How an `.npz` holds its arrays. The default is floats of 64 bits, uncompressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NpzOptions {
    /// Whether floats have 32 bits.
    pub is_single: bool,
    /// Whether arrays are compressed, by the deflate method.
    pub is_compressed: bool,
}

impl NpzOptions {
    /// numpy's name of the type of an array that has this one by default.
    fn kind(self, kind: &'static str) -> &'static str {
        if self.is_single && kind == "<f8" { "<f4" } else { kind }
    }

    fn method(self) -> CompressionMethod {
        if self.is_compressed { CompressionMethod::Deflated } else { CompressionMethod::Stored }
    }
}

/// Each array's name, numpy's name of its type, and numbers in a row.
const ARRAYS: [(NpzArray, &str, &str, usize); 13] = [
    (NpzArray::Flat, "flat", "<f8", 3),
    (NpzArray::Draped, "draped", "<f8", 3),
    (NpzArray::Normal, "normal", "<f8", 3),
    (NpzArray::Triangle, "triangle", "<u4", 1),
    (NpzArray::Weights, "weights", "<f8", 3),
    (NpzArray::Course, "course", "<i4", 1),
    (NpzArray::Wale, "wale", "<i4", 1),
    (NpzArray::Kind, "kind", "|u1", 1),
    (NpzArray::Point, "point", "<u2", 1),
    (NpzArray::Length, "length", "<u4", 1),
    (NpzArray::Yarn, "yarn", "<u4", 1),
    (NpzArray::Panel, "panel", "<u4", 1),
    (NpzArray::Bar, "bar", "<u4", 1),
];

/// Writes arrays for numpy.
#[derive(Debug)]
pub struct NpzWriter<'a, W> {
    target: Destination<W>,
    panels: &'a [Panel],
    /// In the order of [`ARRAYS`].
    spools: Vec<Spool>,
    /// Each bar's radius, mm, and colour.
    bars: Vec<(f64, [u8; 3])>,
    options: NpzOptions,
    buffers: BufferPool,
}

impl<'a, W: Write + Seek + Send> NpzWriter<'a, W> {
    /// Starts the file of yarns on the cloth's panels.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn create(target: Destination<W>, cloth: &ClothInfo<'a>) -> Result<Self, ExportError> {
        let spools = ARRAYS.iter().map(|_| target.spool()).collect::<Result<_, _>>()?;
        let bars = cloth.strands.iter().map(|style| (style.radius, style.color.0)).collect();
        let (panels, options) = (cloth.panels, cloth.npz);
        Ok(Self { target, panels, spools, bars, options, buffers: BufferPool::default() })
    }
}

impl<W: Write + Seek + Send> Sink<W> for NpzWriter<'_, W> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let Self { target, panels, spools, options, buffers, .. } = self;
        check_panels(blocks, panels, target)?;
        // Array by array, since each has a spool of its own to be written to in order.
        for ((array, ..), spool) in ARRAYS.iter().zip(spools) {
            buffers.write_each(
                blocks,
                |block, bytes| array.add(block, &panels[block.panel], *options, bytes),
                |bytes| target.write_with(|_| spool.write_all(bytes)),
            )?;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<W, ExportError> {
        let Self { mut target, mut spools, bars, options, .. } = *self;
        target.write_with(|file| write_archive(file, &mut spools, &bars, options))?;
        target.finish()
    }
}

/// A file that keeps its first error and pretends to take everything after it. An archive that is
/// dropped unfinished tries to finish itself and prints to stderr if that fails; so it mustn't.
struct KeepsError<W> {
    file: W,
    failed: io::Result<()>,
}

impl<W: io::Write> io::Write for KeepsError<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.failed.is_ok() {
            self.failed = self.file.write_all(bytes);
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        if self.failed.is_ok() {
            self.failed = self.file.flush();
        }
        Ok(())
    }
}

/// Puts all arrays into one file.
fn write_archive(
    file: &mut impl io::Write,
    spools: &mut [Spool],
    bars: &[(f64, [u8; 3])],
    options: NpzOptions,
) -> io::Result<()> {
    let mut file = KeepsError { file, failed: Ok(()) };
    // As a stream: sizes and checksums follow each array, so the archive needs no seeking and a
    // pipe gets the same bytes as a file.
    fill(ZipWriter::new_stream(&mut file), spools, bars, options)?;
    file.failed
}

/// Copies the spools into the archive, and adds the arrays of the bars.
fn fill(
    mut archive: ZipWriter<impl Write + Seek>,
    spools: &mut [Spool],
    bars: &[(f64, [u8; 3])],
    options: NpzOptions,
) -> io::Result<()> {
    for ((_, name, kind, width), spool) in ARRAYS.iter().zip(spools) {
        let kind = options.kind(kind);
        let rows = spool.length() / (*width * size(kind)) as u64;
        let header = header(kind, rows, *width);
        begin_array(&mut archive, name, &header, spool.length(), options)?;
        spool.drain(&mut archive)?;
    }
    let rows = bars.len() as u64;
    let mut radii = Buffer::default();
    bars.iter().for_each(|(radius, _)| add_floats(&[*radius], options, &mut radii));
    begin_array(&mut archive, "radius", &header(options.kind("<f8"), rows, 1), 8 * rows, options)?;
    archive.write_all(radii.as_bytes())?;
    let colors: Vec<[u8; 3]> = bars.iter().map(|(_, color)| *color).collect();
    begin_array(&mut archive, "color", &header("|u1", rows, 3), 3 * rows, options)?;
    archive.write_all(bytemuck::cast_slice(&colors))?;
    archive.finish()?;
    Ok(())
}

/// Begins an array's file, whose numbers take so many bytes behind the header.
fn begin_array(
    archive: &mut ZipWriter<impl Write + Seek>,
    name: &str,
    header: &[u8],
    bytes: u64,
    options: NpzOptions,
) -> io::Result<()> {
    // From 4 GiB on sizes take ZIP64's 8 bytes. The header has far fewer than 4096 bytes.
    let large = bytes + 4096 > u64::from(u32::MAX);
    let options =
        SimpleFileOptions::default().compression_method(options.method()).large_file(large);
    archive.start_file(format!("{name}.npy"), options)?;
    archive.write_all(header)
}

impl NpzArray {
    /// Appends a block's rows.
    fn add(self, block: &Block, panel: &Panel, options: NpzOptions, bytes: &mut Buffer) {
        let strands = &block.strands;
        match self {
            Self::Flat => {
                for flat in &strands.flat {
                    add_vector(panel.flat_from_panel.transform_point3(*flat), options, bytes);
                }
            }
            Self::Draped => {
                let points = block.draped.positions.iter();
                points.for_each(|point| add_vector(*point + block.origin, options, bytes));
            }
            Self::Normal => {
                let normals = block.draped.normals.iter();
                normals.for_each(|normal| add_vector(*normal, options, bytes));
            }
            Self::Triangle => {
                for point in &strands.located {
                    add(&panel.faces[point.triangle as usize].0.to_le_bytes(), bytes);
                }
            }
            Self::Weights => {
                for point in &strands.located {
                    add_floats(&point.weights(), options, bytes);
                }
            }
            Self::Course | Self::Wale | Self::Kind | Self::Point => self.add_tags(block, bytes),
            Self::Length | Self::Yarn | Self::Panel | Self::Bar => self.add_strands(block, bytes),
        }
    }

    /// Appends what the points' tags say.
    fn add_tags(self, block: &Block, bytes: &mut Buffer) {
        for (point, source) in block.strands.sources.iter().enumerate() {
            let near = block.tag_near(point);
            let own = (*source != CUT).then_some(near);
            match self {
                Self::Course => add(&near.course.to_le_bytes(), bytes),
                Self::Wale => add(&near.wale.to_le_bytes(), bytes),
                Self::Kind => add(&[own.map_or(CUT_KIND, |tag| kind_number(tag.kind))], bytes),
                _ => add(&own.map_or(0, |tag| tag.point).to_le_bytes(), bytes),
            }
        }
    }

    /// Appends a row a strand.
    fn add_strands(self, block: &Block, bytes: &mut Buffer) {
        for strand in &block.strands.strands {
            let number = match self {
                Self::Length => strand.points.end - strand.points.start,
                Self::Yarn => strand.yarn.0,
                Self::Panel => index32(block.panel),
                _ => index32(block.bar),
            };
            add(&number.to_le_bytes(), bytes);
        }
    }
}

/// Appends a row. Inlined, so that the compiler knows how long it is and copies it without a call.
#[inline(always)]
fn add(row: &[u8], bytes: &mut Buffer) {
    bytes.grow(row.len()).copy_from_slice(row);
}

#[inline]
fn add_vector(vector: DVec3, options: NpzOptions, bytes: &mut Buffer) {
    add_floats(&vector.to_array(), options, bytes);
}

/// Appends floats of 64 or 32 bits.
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "the user chose 32 bits")]
fn add_floats<const N: usize>(floats: &[f64; N], options: NpzOptions, bytes: &mut Buffer) {
    if options.is_single {
        floats.iter().for_each(|float| add(&(*float as f32).to_le_bytes(), bytes));
    } else {
        floats.iter().for_each(|float| add(&float.to_le_bytes(), bytes));
    }
}

/// A kind of point as a number.
fn kind_number(kind: PointKind) -> u8 {
    match kind {
        PointKind::WarpLoop | PointKind::WeftLoop => 0,
        PointKind::Inlay => 1,
        PointKind::Underlap => 2,
    }
}

/// Bytes of a number of that type.
fn size(kind: &str) -> usize {
    usize::from(kind.as_bytes()[2] - b'0')
}

/// The header of an array's file: a Python dictionary, filled up with spaces so that the numbers
/// begin at a multiple of 64 bytes, which lets them be mapped into memory.
fn header(kind: &str, rows: u64, width: usize) -> Vec<u8> {
    let shape = if width == 1 { format!("({rows},)") } else { format!("({rows}, {width})") };
    let mut text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}");
    // The dictionary stands behind ten bytes and before a newline.
    let length = (10 + text.len() + 1).next_multiple_of(64) - 10;
    text += &" ".repeat(length - text.len() - 1);
    text.push('\n');
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend(u16::try_from(length).expect("some hundred characters").to_le_bytes());
    header.extend(text.as_bytes());
    header
}
