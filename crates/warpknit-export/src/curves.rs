//! Centre lines as text for Mitsuba's `linearcurve` and `bsplinecurve`: a line `x y z radius` a
//! point in mm, an empty line between yarns.
//!
//! Points are St a stitch. As a `linearcurve` yarns go through them; a `bsplinecurve` takes them
//! for control points, which rounds bends off by about the sixth part of the distance between
//! points squared over the bend's radius.

use std::fmt::Write as _;
use std::path::Path;

use super::buffer::{Buffer, Conveyor};
use super::digits::numbers;
use super::{ExportError, Output, Sink, lines};
use warpknit_core::drape::Block;
use warpknit_core::fabric::Fabric;
use warpknit_core::yarn::tube::Section;

/// Writes centre lines for Mitsuba.
#[derive(Debug)]
pub struct CurvesWriter {
    output: Output,
    st: u32,
    /// Each bar's radius, mm.
    radii: Vec<f32>,
    conveyor: Conveyor,
}

impl CurvesWriter {
    /// Starts the file of a fabric's yarns, as thick and with as many segments a stitch as their
    /// tubes.
    ///
    /// # Errors
    /// What the disk says.
    pub fn create(target: &Path, fabric: &Fabric, section: &Section) -> Result<Self, ExportError> {
        let radii = super::radii(fabric, section);
        Ok(Self {
            output: Output::create(target)?,
            st: section.st,
            radii,
            conveyor: Conveyor::default(),
        })
    }
}

impl Sink for CurvesWriter {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let Self { output, st, radii, conveyor } = self;
        let make = |block: &Block, text: &mut Buffer| add(block, *st, radii[block.bar], text);
        conveyor.carry(blocks, make, |text| {
            output.write_with(|file| std::io::Write::write_all(file, text))
        })
    }

    fn finish(self: Box<Self>) -> Result<Vec<Output>, ExportError> {
        Ok(vec![self.output.seal()?])
    }
}

fn add(block: &Block, st: u32, radius: f32, text: &mut Buffer) {
    lines::each(block, st, |line| {
        for point in line {
            numbers(text, [point.x, point.y, point.z, radius], b' ');
            text.write_char('\n').expect("memory takes all text");
        }
        text.write_char('\n').expect("memory takes all text");
    });
}
