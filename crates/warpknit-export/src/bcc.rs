//! Centre lines as a Binary Curve Collection, the format of Cem Yuksel's yarn-level models
//! (cemyuksel.com, "Yarn-level Cloth Models", file format BCC).
//!
//! Open Catmull-Rom curves with uniform parameters (`C0`) in three dimensions, y up, `i32` and
//! `f32`, mm. The curve through our data points has centripetal parameters, so the file holds St
//! points a stitch on that curve. With few of them the two curves differ between points. A uniform
//! Catmull-Rom curve runs from its second point to its last but one, so both ends have one more
//! point, which mirrors its neighbour. The header counts curves and points, which are known last,
//! so it gets room.
//!
//! The format has no radii and no masses. A JSON beside the file ([`companion`]) has those of each
//! bar, and the matrix that takes the file's points to metres.

use std::borrow::Cow;
use std::io::{Seek, Write};
use std::path::{Path, PathBuf};

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::buffer::{Buffer, BufferPool};
use super::patched_header::PatchedHeader;
use super::{ClothInfo, Companion, Destination, ExportError, Sink, lines};
use warpknit_core::drape::Block;
use warpknit_core::ids::index32;

/// The header as it lies in the file.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct BccHeader {
    sign: [u8; 3],
    /// Bytes of an integer and of a float, four bits each.
    sizes: u8,
    /// Catmull-Rom (`C`) with uniform parameters (`0`).
    curve: [u8; 2],
    dimensions: u8,
    /// Axis that points up: 1 is y.
    up: u8,
    curves: u64,
    points: u64,
    info: [u8; 40],
}

/// Who wrote the file.
const INFO: &[u8] = b"yarns by warpknit, mm";
/// Points that are added to a curve at its ends.
const ADDED: u64 = 2;

/// The path of the JSON beside a `.bcc`: `skirt.bcc.json`.
#[must_use]
pub fn companion_path(bcc: &Path) -> PathBuf {
    let mut name = bcc.file_name().unwrap_or_default().to_owned();
    name.push(".json");
    bcc.with_file_name(name)
}

/// The JSON beside a `.bcc`: radius (m) and mass (kg/m) of each bar's yarns, and the matrix, row by
/// row, that takes the file's points to metres.
#[must_use]
pub fn companion<'c>(bcc: &Path, cloth: &ClothInfo<'_>) -> Companion<'c> {
    const MM: f64 = 1e-3;
    let bars = cloth.strands.iter().zip(1..).map(|(style, number)| {
        serde_json::json!({
            "bar": number,
            "radius_m": style.radius * MM,
            "kg_per_m": style.tex * 1e-6,
        })
    });
    let text = serde_json::json!({
        "file": bcc.file_name().unwrap_or_default().to_string_lossy(),
        "unit": "mm",
        "up": "y",
        "to_metres": [[MM, 0.0, 0.0, 0.0], [0.0, MM, 0.0, 0.0], [0.0, 0.0, MM, 0.0],
            [0.0, 0.0, 0.0, 1.0]],
        "phantom_points_a_curve": ADDED,
        "bars": bars.collect::<Vec<_>>(),
    });
    let bytes = Cow::from(format!("{text:#}\n").into_bytes());
    Companion { path: companion_path(bcc), bytes }
}

/// Writes centre lines as BCC.
#[derive(Debug)]
pub struct BccWriter<W> {
    file: PatchedHeader<W>,
    st: u32,
    curves: u64,
    points: u64,
    buffers: BufferPool,
}

impl<W: Write + Seek + Send> BccWriter<W> {
    /// Starts the file.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn create(target: Destination<W>, cloth: &ClothInfo<'_>) -> Result<Self, ExportError> {
        let file = PatchedHeader::create(target, Some(size_of::<BccHeader>()))?;
        let st = cloth.section.st;
        Ok(Self { file, st, curves: 0, points: 0, buffers: BufferPool::default() })
    }
}

impl<W: Write + Seek + Send> Sink<W> for BccWriter<W> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let Self { file, st, curves, points, buffers } = self;
        *curves += blocks.iter().map(|block| block.strands.strands.len() as u64).sum::<u64>();
        let count = |block: &Block| {
            lines::count_all(block, *st) + ADDED * block.strands.strands.len() as u64
        };
        *points += blocks.iter().map(count).sum::<u64>();
        buffers.write_each(
            blocks,
            |block, bytes| lines::each(block, *st, |line| add_curve(line, bytes)),
            |bytes| file.write(bytes),
        )
    }

    fn finish(self: Box<Self>) -> Result<W, ExportError> {
        // The field is text, filled up with zeros.
        let mut info = [0; 40];
        info[..INFO.len()].copy_from_slice(INFO);
        let (curves, points) = (self.curves, self.points);
        let header = BccHeader {
            sign: *b"BCC",
            sizes: 0x44,
            curve: *b"C0",
            dimensions: 3,
            up: 1,
            curves,
            points,
            info,
        };
        self.file.finish(bytemuck::bytes_of(&header))
    }
}

/// A curve: the number of its points, which would be negative for a closed curve, and the points,
/// with one more at each end.
fn add_curve(line: &[Vec3], bytes: &mut Buffer) {
    let added = |end: Vec3, inner: Vec3| 2.0 * end - inner;
    let [first, second, ..] = line else { return };
    let [.., before, last] = line else { return };
    bytes.grow(4).copy_from_slice(&(index32(line.len()) + 2).to_le_bytes());
    for points in [&[added(*first, *second)][..], line, &[added(*last, *before)]] {
        let points: &[u8] = bytemuck::cast_slice(points);
        bytes.grow(points.len()).copy_from_slice(points);
    }
}
