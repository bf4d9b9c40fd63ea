//! Centre lines as Wavefront OBJ: one object a strand, a polyline (`l`) through its points in mm,
//! to four decimals, and a material a bar ([`super::mtl`]).

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use super::buffer::{Buffer, Conveyor};
use super::digits::numbers;
use super::texture::Wardrobe;
use super::{ExportError, Output, Sink, lines, mtl};
use warpknit_core::drape::Block;
use warpknit_core::fabric::Fabric;

/// Writes centre lines as text.
#[derive(Debug)]
pub struct ObjLinesWriter {
    output: Output,
    /// Materials.
    companions: Vec<Output>,
    st: u32,
    /// Points written so far.
    points: u64,
    conveyor: Conveyor,
}

impl ObjLinesWriter {
    /// Starts the file of lines with `st` segments a stitch, and writes the materials that come
    /// with it, one for each of the fabric's bars.
    ///
    /// # Errors
    /// What the disk says.
    pub fn create(target: &Path, fabric: &Fabric, st: u32) -> Result<Self, ExportError> {
        // A line has no surface to put a picture on.
        let companions = mtl::write(target, fabric, &Wardrobe::default())?;
        let mut output = Output::create(target)?;
        output.write_with(|file| {
            write!(file, "# yarns by warpknit, mm\n{}", mtl::reference(target))
        })?;
        Ok(Self { output, companions, st, points: 0, conveyor: Conveyor::default() })
    }
}

impl Sink for ObjLinesWriter {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let Self { output, st, points, conveyor, .. } = self;
        let number = |block| {
            let first = *points;
            *points += block_points(block, *st);
            (block, first)
        };
        let numbered: Vec<_> = blocks.iter().map(number).collect();
        conveyor.carry(
            &numbered,
            |(block, first), text| objects(block, *st, *first, text),
            |text| output.write_with(|file| file.write_all(text)),
        )
    }

    fn finish(self: Box<Self>) -> Result<Vec<Output>, ExportError> {
        let Self { output, companions, .. } = *self;
        Ok(std::iter::once(output.seal()?).chain(companions).collect())
    }
}

fn block_points(block: &Block, st: u32) -> u64 {
    block.strands.strands.iter().map(|strand| u64::from(lines::count(strand, st))).sum()
}

/// The objects of a block whose first point is the file's `first`, counted from 0.
fn objects(block: &Block, st: u32, mut first: u64, text: &mut Buffer) {
    let mut strands = block.strands.strands.iter();
    lines::each(block, st, |line| {
        let (panel, bar) = (block.panel, block.bar + 1);
        let yarn = strands.next().expect("a line a strand").yarn.0;
        write!(text, "o panel{panel}_bar{bar}_yarn{yarn}\nusemtl bar_{bar}\n")
            .expect("memory takes all text");
        for point in line {
            text.write_str("v ").expect("memory takes all text");
            numbers(text, point.to_array(), b' ');
            text.write_char('\n').expect("memory takes all text");
        }
        let end = first + line.len() as u64;
        text.write_char('l').expect("memory takes all text");
        (first..end)
            .for_each(|point| write!(text, " {}", point + 1).expect("memory takes all text"));
        text.write_char('\n').expect("memory takes all text");
        first = end;
    });
}
