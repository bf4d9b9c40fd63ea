//! Centre lines as a Binary Curve Collection, the format of Cem Yuksel's yarn-level models
//! (cemyuksel.com, "Yarn-level Cloth Models", file format BCC).
//!
//! Open Catmull-Rom curves with uniform parameters (`C0`) in three dimensions, y up, `i32` and
//! `f32`, mm. The curve through our data points has centripetal parameters, so the file holds St
//! points a stitch on that curve. With few of them the two curves differ between points. The format
//! has no radii. Its header counts curves and points, which are known last, so it gets room.

use std::io::{Seek, Write};

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::buffer::{Buffer, Conveyor};
use super::patched_header::PatchedHeader;
use super::{ClothInfo, Destination, ExportError, Sink, lines};
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

/// Writes centre lines as BCC.
#[derive(Debug)]
pub struct BccWriter<W> {
    file: PatchedHeader<W>,
    st: u32,
    curves: u64,
    points: u64,
    conveyor: Conveyor,
}

impl<W: Write + Seek + Send> BccWriter<W> {
    /// Starts the file.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn create(target: Destination<W>, cloth: &ClothInfo<'_>) -> Result<Self, ExportError> {
        let file = PatchedHeader::create(target, Some(size_of::<BccHeader>()))?;
        let st = cloth.section.st;
        Ok(Self { file, st, curves: 0, points: 0, conveyor: Conveyor::default() })
    }
}

impl<W: Write + Seek + Send> Sink<W> for BccWriter<W> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let Self { file, st, curves, points, conveyor } = self;
        *curves += blocks.iter().map(|block| block.strands.strands.len() as u64).sum::<u64>();
        *points += blocks.iter().map(|block| lines::count_all(block, *st)).sum::<u64>();
        conveyor.carry(
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

/// A curve: the number of its points, which would be negative for a closed curve, and the points.
fn add_curve(line: &[Vec3], bytes: &mut Buffer) {
    bytes.grow(4).copy_from_slice(&index32(line.len()).to_le_bytes());
    let points: &[u8] = bytemuck::cast_slice(line);
    bytes.grow(points.len()).copy_from_slice(points);
}
