//! A drape sequence as one `.usda`: the curves of [`super::usda`] with time samples, a time code a
//! frame.
//!
//! Points and boxes have samples; which yarns there are, their courses and wales and their lengths
//! are the first frame's, since the yarns of a sequence are those of its first frame. Frames come
//! one after the other and the file wants each prim with all of its frames, so everything waits in
//! a nameless temporary file until the last frame is there.

use std::io::Write as _;
use std::ops::Range;
use std::path::Path;

use glam::Vec3;
use rayon::prelude::*;

use super::buffer::Conveyor;
use super::spool::Spill;
use super::usda::{Attributes, EMPTY, bars, bounds, boxed, groups, head, points, prim, union};
use super::{ExportError, Output, Sink};
use warpknit_core::drape::Block;
use warpknit_core::fabric::Fabric;
use warpknit_core::yarn::tube::Section;

/// Writes yarns as USD curves that move.
#[derive(Debug)]
pub struct UsdaFramesWriter {
    output: Output,
    /// Each bar's colour, linear, and radius, mm.
    bars: Vec<([f32; 3], f32)>,
    frames_per_second: f64,
    /// All prims' samples, and behind the first frame's their attributes.
    waiting: Spill,
    prims: Vec<Prim>,
    /// Time codes of the frames so far.
    codes: Vec<u32>,
    /// The prim to which the last blocks belonged.
    current: Option<usize>,
    attributes: Attributes,
    conveyor: Conveyor,
}

/// What waits of a prim.
#[derive(Debug)]
struct Prim {
    panel: usize,
    bar: usize,
    /// Points, a sample a frame.
    points: Vec<Range<u64>>,
    /// Lowest and highest control point, mm, of each.
    extents: Vec<[Vec3; 2]>,
    /// Lines of attributes that don't move.
    attributes: Range<u64>,
}

impl UsdaFramesWriter {
    /// Starts the file of a fabric's yarns, as thick as their tubes.
    ///
    /// # Errors
    /// What the disk says.
    pub fn create(
        target: &Path,
        fabric: &Fabric,
        section: &Section,
        frames_per_second: f64,
    ) -> Result<Self, ExportError> {
        Ok(Self {
            output: Output::create(target)?,
            bars: bars(fabric, section),
            frames_per_second,
            waiting: Spill::create(target)?,
            prims: Vec::new(),
            codes: Vec::new(),
            current: None,
            attributes: Attributes::create(target)?,
            conveyor: Conveyor::default(),
        })
    }

    /// Says that the blocks to come are those of the frame with this time code: higher than the
    /// last one's.
    ///
    /// # Errors
    /// What the disk says.
    pub fn begin_frame(&mut self, code: u32) -> Result<(), ExportError> {
        self.end_prim()?;
        self.codes.push(code);
        Ok(())
    }

    fn add(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let at = (blocks[0].panel, blocks[0].bar);
        let known = |prim: &Prim| (prim.panel, prim.bar) == at;
        if !self.current.is_some_and(|current| known(&self.prims[current])) {
            self.end_prim()?;
            let place = self.prims.iter().position(known).unwrap_or(self.prims.len());
            if place == self.prims.len() {
                let (panel, bar) = at;
                self.prims.push(Prim {
                    panel,
                    bar,
                    points: Vec::new(),
                    extents: Vec::new(),
                    attributes: 0..0,
                });
            }
            let start = self.waiting.length();
            self.prims[place].points.push(start..start);
            self.prims[place].extents.push(EMPTY);
            self.current = Some(place);
        }
        let Self { output, waiting, prims, codes, current, attributes, conveyor, .. } = self;
        let prim = &mut prims[current.expect("set above")];
        let extent = prim.extents.last_mut().expect("one was pushed");
        *extent = blocks.par_iter().map(bounds).reduce(|| *extent, union);
        conveyor.carry(blocks, points, |text| output.write_with(|_| waiting.write_all(text)))?;
        prim.points.last_mut().expect("one was pushed").end = waiting.length();
        if codes.len() == 1 {
            attributes.add(blocks, conveyor, output)?;
        }
        Ok(())
    }

    /// Puts the attributes of the first frame's prim behind its points.
    fn end_prim(&mut self) -> Result<(), ExportError> {
        let Some(current) = self.current.take() else { return Ok(()) };
        if self.codes.len() == 1 {
            let start = self.waiting.length();
            let Self { output, waiting, attributes, .. } = self;
            output.write_with(|_| attributes.pour(waiting))?;
            self.prims[current].attributes = start..self.waiting.length();
        }
        Ok(())
    }

    /// What the file says of time.
    fn time(&self) -> String {
        let (first, last) =
            (self.codes.first().copied().unwrap_or(1), self.codes.last().copied().unwrap_or(1));
        let speed = self.frames_per_second;
        format!(
            "    startTimeCode = {first}\n    endTimeCode = {last}\n    timeCodesPerSecond = {speed}\n    framesPerSecond = {speed}\n"
        )
    }
}

impl Sink for UsdaFramesWriter {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        groups(blocks).try_for_each(|blocks| self.add(blocks))
    }

    fn finish(mut self: Box<Self>) -> Result<Vec<Output>, ExportError> {
        self.end_prim()?;
        let time = self.time();
        let Self { mut output, bars, mut waiting, prims, codes, .. } = *self;
        output.write_with(|file| {
            file.write_all(head(&bars, &time).as_bytes())?;
            for Prim { panel, bar, points, extents, attributes } in &prims {
                writeln!(
                    file,
                    "{}        point3f[] points.timeSamples = {{",
                    prim(*panel, *bar, bars[*bar])
                )?;
                for (code, sample) in codes.iter().zip(points) {
                    write!(file, "            {code}: [")?;
                    waiting.copy(sample, file)?;
                    file.write_all(b"],\n")?;
                }
                file.write_all(b"        }\n")?;
                waiting.copy(attributes, file)?;
                file.write_all(b"        float3[] extent.timeSamples = {\n")?;
                for (code, extent) in codes.iter().zip(extents) {
                    writeln!(file, "            {code}: {},", boxed(*extent, bars[*bar].1))?;
                }
                file.write_all(b"        }\n    }\n")?;
            }
            file.write_all(b"}\n")
        })?;
        Ok(vec![output.seal()?])
    }
}
