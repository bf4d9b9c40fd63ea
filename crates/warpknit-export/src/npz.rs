//! All of a cloth's arrays for Python (`numpy.load`): an uncompressed `.npz`, one `.npy` an array,
//! little-endian.
//!
//! An entry a point, yarns one after the other, the ends that the panel's edge cut included:
//! `flat`, `draped`, `normal` (f8, 3 each, mm), `triangle` (u4, in file order), `weights` (f8, 3),
//! `course`, `wale` (i4), `kind` (u1: 0 loop, 1 inlay, 2 turn, 255 a cut end, whose other tags are
//! 0) and `point` (u2). An entry a strand: `length` (u4, its points), `yarn`, `panel`, `bar` (u4,
//! from 0). An entry a bar: `radius` (f8, mm), `color` (u1, 3, sRGB). Each array waits on the disk
//! until the archive is put together at the end.

use std::io::{self, Write as _};
use std::path::Path;

use glam::DVec3;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::buffer::{Buffer, Conveyor};
use super::spool::Spill;
use super::{ExportError, Output, Sink};
use warpknit_core::drape::Block;
use warpknit_core::drape::strands::CUT;
use warpknit_core::fabric::Fabric;
use warpknit_core::garment::{Garment, Panel};
use warpknit_core::ids::index32;
use warpknit_core::knit::PointKind;
use warpknit_core::yarn::tube::Section;

/// The kind of an end that was cut.
const CUT_KIND: u8 = u8::MAX;

/// An array with an entry a point or a strand.
#[derive(Clone, Copy, Debug)]
enum Array {
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

/// Each array's name, numpy's name of its type, and numbers an entry.
const ARRAYS: [(Array, &str, &str, usize); 13] = [
    (Array::Flat, "flat", "<f8", 3),
    (Array::Draped, "draped", "<f8", 3),
    (Array::Normal, "normal", "<f8", 3),
    (Array::Triangle, "triangle", "<u4", 1),
    (Array::Weights, "weights", "<f8", 3),
    (Array::Course, "course", "<i4", 1),
    (Array::Wale, "wale", "<i4", 1),
    (Array::Kind, "kind", "|u1", 1),
    (Array::Point, "point", "<u2", 1),
    (Array::Length, "length", "<u4", 1),
    (Array::Yarn, "yarn", "<u4", 1),
    (Array::Panel, "panel", "<u4", 1),
    (Array::Bar, "bar", "<u4", 1),
];

/// Writes arrays for numpy.
#[derive(Debug)]
pub struct NpzWriter<'a> {
    output: Output,
    garment: &'a Garment,
    /// In the order of [`ARRAYS`].
    spills: Vec<Spill>,
    /// Each bar's radius, mm, and colour.
    bars: Vec<(f64, [u8; 3])>,
    conveyor: Conveyor,
}

impl<'a> NpzWriter<'a> {
    /// Starts the file of a fabric's yarns on a garment, as thick as their tubes.
    ///
    /// # Errors
    /// What the disk says.
    pub fn create(
        target: &Path,
        fabric: &Fabric,
        garment: &'a Garment,
        section: &Section,
    ) -> Result<Self, ExportError> {
        let output = Output::create(target)?;
        let spills = ARRAYS.iter().map(|_| Spill::create(target)).collect::<Result<_, _>>()?;
        let radii = fabric.thickness().into_iter().map(|thickness| section.radius * thickness);
        let bars = radii.zip(fabric.yarns().map(|yarn| yarn.color.0)).collect();
        Ok(Self { output, garment, spills, bars, conveyor: Conveyor::default() })
    }
}

impl Sink for NpzWriter<'_> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let Self { output, garment, spills, conveyor, .. } = self;
        for ((array, ..), spill) in ARRAYS.iter().zip(spills) {
            conveyor.carry(
                blocks,
                |block, bytes| array.add(block, &garment.panels[block.panel], bytes),
                |bytes| output.write_with(|_| spill.write_all(bytes)),
            )?;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<Vec<Output>, ExportError> {
        let Self { mut output, mut spills, bars, .. } = *self;
        output.write_with(|file| archive(file, &mut spills, &bars))?;
        Ok(vec![output.seal()?])
    }
}

/// A file that takes everything after its first error and keeps that: an archive that is dropped
/// unfinished prints to stderr.
struct Lasting<W> {
    file: W,
    failed: io::Result<()>,
}

impl<W: io::Write> io::Write for Lasting<W> {
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
fn archive(
    file: &mut impl io::Write,
    spills: &mut [Spill],
    bars: &[(f64, [u8; 3])],
) -> io::Result<()> {
    let mut file = Lasting { file, failed: Ok(()) };
    fill(ZipWriter::new_stream(&mut file), spills, bars)?;
    file.failed
}

fn fill(
    mut archive: ZipWriter<impl io::Write + io::Seek>,
    spills: &mut [Spill],
    bars: &[(f64, [u8; 3])],
) -> io::Result<()> {
    let begin = |archive: &mut ZipWriter<_>, name: &str, header: &[u8], bytes: u64| {
        let large = bytes + 4096 > u64::from(u32::MAX);
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .large_file(large);
        archive.start_file(format!("{name}.npy"), options)?;
        archive.write_all(header)
    };
    for ((_, name, kind, width), spill) in ARRAYS.iter().zip(spills) {
        let rows = spill.length() / (*width * size(kind)) as u64;
        begin(&mut archive, name, &header(kind, rows, *width), spill.length())?;
        spill.pour(&mut archive)?;
    }
    let rows = bars.len() as u64;
    let radii: Vec<f64> = bars.iter().map(|(radius, _)| *radius).collect();
    begin(&mut archive, "radius", &header("<f8", rows, 1), 8 * rows)?;
    archive.write_all(bytemuck::cast_slice(&radii))?;
    let colors: Vec<[u8; 3]> = bars.iter().map(|(_, color)| *color).collect();
    begin(&mut archive, "color", &header("|u1", rows, 3), 3 * rows)?;
    archive.write_all(bytemuck::cast_slice(&colors))?;
    archive.finish()?;
    Ok(())
}

impl Array {
    /// Appends a block's entries.
    fn add(self, block: &Block, panel: &Panel, bytes: &mut Buffer) {
        let strands = &block.strands;
        let mut put = |entry: &[u8]| bytes.grow(entry.len()).copy_from_slice(entry);
        let vector = |v: DVec3| v.to_array();
        let tag = |source: u32| (source != CUT).then(|| block.knitted.tags[source as usize]);
        let tags = || strands.sources.iter().map(|&source| tag(source));
        match self {
            Self::Flat => {
                let own = |flat: &DVec3| vector(panel.flat_from_panel.transform_point3(*flat));
                strands.flat.iter().for_each(|flat| put(bytemuck::bytes_of(&own(flat))));
            }
            Self::Draped => {
                block.draped.positions.iter().for_each(|at| put(bytemuck::bytes_of(&vector(*at))));
            }
            Self::Normal => block
                .draped
                .normals
                .iter()
                .for_each(|normal| put(bytemuck::bytes_of(&vector(*normal)))),
            Self::Triangle => {
                strands
                    .located
                    .iter()
                    .for_each(|at| put(&panel.faces[at.triangle as usize].0.to_le_bytes()));
            }
            Self::Weights => {
                strands.located.iter().for_each(|at| put(bytemuck::bytes_of(&at.weights())));
            }
            Self::Course => {
                tags().for_each(|tag| put(&tag.map_or(0, |tag| tag.course).to_le_bytes()));
            }
            Self::Wale => tags().for_each(|tag| put(&tag.map_or(0, |tag| tag.wale).to_le_bytes())),
            Self::Kind => {
                tags().for_each(|tag| put(&[tag.map_or(CUT_KIND, |tag| number(tag.kind))]));
            }
            Self::Point => {
                tags().for_each(|tag| put(&tag.map_or(0, |tag| tag.point).to_le_bytes()));
            }
            Self::Length => {
                strands.strands.iter().for_each(|strand| {
                    put(&(strand.points.end - strand.points.start).to_le_bytes());
                });
            }
            Self::Yarn => {
                strands.strands.iter().for_each(|strand| put(&strand.yarn.0.to_le_bytes()));
            }
            Self::Panel => {
                strands.strands.iter().for_each(|_| put(&index32(block.panel).to_le_bytes()));
            }
            Self::Bar => {
                strands.strands.iter().for_each(|_| put(&index32(block.bar).to_le_bytes()));
            }
        }
    }
}

fn number(kind: PointKind) -> u8 {
    match kind {
        PointKind::WarpLoop | PointKind::WeftLoop => 0,
        PointKind::Inlay => 1,
        PointKind::Underlap => 2,
    }
}

/// Bytes of a number.
fn size(kind: &str) -> usize {
    usize::from(kind.as_bytes()[2] - b'0')
}

/// What an array's file begins with: version 1.0 of the format, filled up to a multiple of 64
/// bytes.
fn header(kind: &str, rows: u64, width: usize) -> Vec<u8> {
    let shape = if width == 1 { format!("({rows},)") } else { format!("({rows}, {width})") };
    let mut text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}");
    // Ten bytes come before it, and a newline ends it.
    let length = (10 + text.len() + 1).next_multiple_of(64) - 10;
    text += &" ".repeat(length - text.len() - 1);
    text.push('\n');
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend(u16::try_from(length).expect("some hundred characters").to_le_bytes());
    header.extend(text.as_bytes());
    header
}
