//! Centre lines as text for the shapes `linearcurve` and `bsplinecurve` of the renderer Mitsuba 3
//! ("Mitsuba 3 documentation", plugin reference, shapes): a line `x y z radius` a point in mm, an
//! empty line after each yarn.
//!
//! There are St points a stitch. A `linearcurve` goes through them. A `bsplinecurve` takes them as
//! control points, which cuts bends short by about d²/(6r), where d is the distance between points
//! and r the bend's radius.

use std::fmt::Write as _;
use std::io::{Seek, Write};

use super::buffer::{Buffer, BufferPool};
use super::digits::numbers;
use super::{ClothInfo, Destination, ExportError, Sink, StrandStyle, lines};
use warpknit_core::drape::Block;

/// Writes centre lines for Mitsuba.
#[derive(Debug)]
pub struct CurvesWriter<W> {
    target: Destination<W>,
    st: u32,
    /// Each bar's radius, mm.
    radii: Vec<f32>,
    buffers: BufferPool,
}

impl<W: Write + Seek + Send> CurvesWriter<W> {
    /// Starts the file.
    ///
    /// # Errors
    /// None: nothing is written before the first block.
    pub fn create(target: Destination<W>, cloth: &ClothInfo<'_>) -> Result<Self, ExportError> {
        let radii = cloth.strands.iter().map(StrandStyle::radius_f32).collect();
        Ok(Self { target, st: cloth.section.st, radii, buffers: BufferPool::default() })
    }
}

impl<W: Write + Seek + Send> Sink<W> for CurvesWriter<W> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let Self { target, st, radii, buffers } = self;
        buffers.write_each(
            blocks,
            |block, text| add_curves(block, *st, radii[block.bar], text),
            |text| target.write(text),
        )
    }

    fn finish(self: Box<Self>) -> Result<W, ExportError> {
        self.target.finish()
    }
}

/// The centre lines of a block.
fn add_curves(block: &Block, st: u32, radius: f32, text: &mut Buffer) {
    lines::each(block, st, |line| {
        for point in line {
            numbers(text, [point.x, point.y, point.z, radius], b' ');
            text.write_char('\n').expect("memory takes all text");
        }
        text.write_char('\n').expect("memory takes all text");
    });
}
