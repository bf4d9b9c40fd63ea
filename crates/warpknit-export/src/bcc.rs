//! Centre lines as a Binary Curve Collection, the format of Cem Yuksel's yarn-level models
//! (cemyuksel.com, "Yarn-level Cloth Models").
//!
//! Open Catmull-Rom curves with uniform parameters (`C0`) in three dimensions, y up, `i32` and
//! `f32`, mm. The curve through our points has centripetal parameters, so points are St a stitch on
//! that curve: with few of them the two curves part between points. Radii are no part of the
//! format. The header counts curves and points, which are known last: it gets room.

use std::path::Path;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::buffer::{Buffer, Conveyor};
use super::patched_header::HeadLast;
use super::{ExportError, Output, Sink, lines};
use warpknit_core::drape::Block;
use warpknit_core::ids::index32;

/// What the file begins with.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Header {
    sign: [u8; 3],
    /// Bytes of an integer and of a float, four bits each.
    sizes: u8,
    curve: [u8; 2],
    dimensions: u8,
    up: u8,
    curves: u64,
    points: u64,
    info: [u8; 40],
}

/// Who wrote the file.
const INFO: &[u8] = b"yarns by warpknit, mm";

/// Writes centre lines as BCC.
#[derive(Debug)]
pub struct BccWriter {
    file: HeadLast,
    st: u32,
    curves: u64,
    points: u64,
    conveyor: Conveyor,
}

impl BccWriter {
    /// Starts the file, of so many segments a stitch.
    ///
    /// # Errors
    /// What the disk says.
    pub fn create(target: &Path, st: u32) -> Result<Self, ExportError> {
        let file = HeadLast::create(target, size_of::<Header>())?;
        Ok(Self { file, st, curves: 0, points: 0, conveyor: Conveyor::default() })
    }
}

impl Sink for BccWriter {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let Self { file, st, curves, points, conveyor } = self;
        for strand in blocks.iter().flat_map(|block| &block.strands.strands) {
            *curves += 1;
            *points += u64::from(lines::count(strand, *st));
        }
        let make =
            |block: &Block, bytes: &mut Buffer| lines::each(block, *st, |line| add(line, bytes));
        conveyor.carry(blocks, make, |bytes| file.write(bytes))
    }

    fn finish(self: Box<Self>) -> Result<Vec<Output>, ExportError> {
        let mut info = [0; 40];
        info[..INFO.len()].copy_from_slice(INFO);
        let (curves, points) = (self.curves, self.points);
        let header = Header {
            sign: *b"BCC",
            sizes: 0x44,
            curve: *b"C0",
            dimensions: 3,
            up: 1,
            curves,
            points,
            info,
        };
        Ok(vec![self.file.finish(bytemuck::bytes_of(&header))?])
    }
}

/// A curve: its points' number, over 0 where it is open, and they.
fn add(line: &[Vec3], bytes: &mut Buffer) {
    bytes.grow(4).copy_from_slice(&index32(line.len()).to_le_bytes());
    let points: &[u8] = bytemuck::cast_slice(line);
    bytes.grow(points.len()).copy_from_slice(points);
}
