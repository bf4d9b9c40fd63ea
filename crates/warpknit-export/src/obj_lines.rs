//! Centre lines as Wavefront OBJ (Alias|Wavefront, "Advanced Visualizer Manual", appendix B1,
//! "Object Files (.obj)", version 3.0): one object a strand, a polyline (`l`) through its points in
//! mm, to four decimals, and a material a bar ([`super::mtl`]).

use std::fmt::Write as _;
use std::io::{Seek, Write};

use super::buffer::{Buffer, BufferPool};
use super::obj::add_place;
use super::{Axes, ClothInfo, Destination, ExportError, Sink, lines, mtl};
use warpknit_core::drape::Block;

/// Writes centre lines as text.
#[derive(Debug)]
pub struct ObjLinesWriter<W> {
    target: Destination<W>,
    st: u32,
    axes: Axes,
    /// Points written so far.
    points: u64,
    buffers: BufferPool,
}

impl<W: Write + Seek + Send> ObjLinesWriter<W> {
    /// Starts the file. Its materials are a file of their own: [`mtl::companions`].
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn create(mut target: Destination<W>, cloth: &ClothInfo<'_>) -> Result<Self, ExportError> {
        target.write(mtl::obj_beginning(target.path()).as_bytes())?;
        let (st, axes) = (cloth.section.st, cloth.axes);
        Ok(Self { target, st, axes, points: 0, buffers: BufferPool::default() })
    }
}

impl<W: Write + Seek + Send> Sink<W> for ObjLinesWriter<W> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let Self { target, st, axes, points, buffers } = self;
        // Point numbers run through the file, so each block is given its first one before blocks
        // are written in parallel.
        let mut numbered = Vec::with_capacity(blocks.len());
        for block in blocks {
            numbered.push((block, *points));
            *points += lines::count_all(block, *st);
        }
        buffers.write_each(
            &numbered,
            |(block, first), text| add_objects(block, (*st, *axes), *first, text),
            |text| target.write(text),
        )
    }

    fn finish(self: Box<Self>) -> Result<W, ExportError> {
        self.target.finish()
    }
}

/// The objects of a block whose first point has this number, counted from 0.
fn add_objects(block: &Block, (st, axes): (u32, Axes), mut first: u64, text: &mut Buffer) {
    let mut strands = block.strands.strands.iter();
    lines::each(block, st, |line| {
        let (panel, bar) = (block.panel, block.bar + 1);
        let yarn = strands.next().expect("a line a strand").yarn.0;
        write!(text, "o panel{panel}_bar{bar}_yarn{yarn}\nusemtl bar_{bar}\n")
            .expect("memory takes all text");
        for point in line {
            add_place(text, *point, axes);
        }
        let end = first + line.len() as u64;
        text.write_char('l').expect("memory takes all text");
        for point in first..end {
            // The format counts from 1.
            write!(text, " {}", point + 1).expect("memory takes all text");
        }
        text.write_char('\n').expect("memory takes all text");
        first = end;
    });
}
