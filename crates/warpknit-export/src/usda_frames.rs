//! A drape sequence as one `.usda`: the curves of [`super::usda`] with time samples, a time code a
//! frame.
//!
//! Points and bounding boxes have samples. The yarns, their courses, wales and lengths are the
//! first frame's: the yarns of a sequence are laid once. Frames come one after the other, but the
//! file needs each prim with all of its frames. So everything waits in a spool until the last frame
//! is there.

use std::io::{Seek, Write};
use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::buffer::BufferPool;
use super::spool::Spool;
use super::usd_stage::{EMPTY, UsdCurves, blocks_by_prim, bounds, union};
use super::usda::{Attributes, add_points, beginning, extent_text, prim_beginning};
use super::{ClothInfo, Destination, ExportError, Sink, StrandStyle};
use warpknit_core::drape::Block;

/// Writes yarns as USD curves that move.
#[derive(Debug)]
pub struct UsdaFramesWriter<W> {
    target: Destination<W>,
    styles: Vec<StrandStyle>,
    curves: UsdCurves,
    frames_per_second: f64,
    /// All prims' samples, and behind the first frame's their attributes.
    waiting: Spool,
    prims: Vec<WaitingPrim>,
    /// Time codes of the frames so far.
    codes: Vec<u32>,
    /// The prim to which the last blocks belonged.
    current: Option<usize>,
    attributes: Attributes,
    buffers: BufferPool,
}

/// Where a prim's parts wait in the spool.
#[derive(Debug)]
struct WaitingPrim {
    panel: usize,
    bar: usize,
    /// The points of each frame.
    points: Vec<Range<u64>>,
    /// Lowest and highest control point of each frame, in the stage's units.
    extents: Vec<[Vec3; 2]>,
    /// The attributes, which are the same in all frames.
    attributes: Range<u64>,
}

impl<W: Write + Seek + Send> UsdaFramesWriter<W> {
    /// Starts the file.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn create(
        target: Destination<W>,
        cloth: &ClothInfo<'_>,
        frames_per_second: f64,
    ) -> Result<Self, ExportError> {
        Ok(Self {
            styles: cloth.strands.clone(),
            curves: cloth.usd_curves,
            frames_per_second,
            waiting: target.spool()?,
            prims: Vec::new(),
            codes: Vec::new(),
            current: None,
            attributes: Attributes::create(&target, cloth.usd_curves)?,
            buffers: BufferPool::default(),
            target,
        })
    }

    /// Begins the frame with this time code, which is higher than the last one's. The blocks to
    /// come are that frame's.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn begin_frame(&mut self, code: u32) -> Result<(), ExportError> {
        self.end_prim()?;
        self.codes.push(code);
        Ok(())
    }

    /// Adds blocks of one bar of one panel.
    fn add(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        self.find_prim(blocks[0].panel, blocks[0].bar)?;
        let curves = self.curves;
        let Self { target, waiting, prims, codes, current, attributes, buffers, .. } = self;
        let prim = &mut prims[current.expect("found above")];
        let extent = prim.extents.last_mut().expect("one was pushed");
        *extent = blocks.par_iter().map(|block| bounds(block, curves)).reduce(|| *extent, union);
        buffers.write_each(
            blocks,
            |block, text| add_points(block, curves, text),
            |text| target.write_with(|_| waiting.write_all(text)),
        )?;
        prim.points.last_mut().expect("one was pushed").end = waiting.length();
        // Later frames have the same yarns, so their attributes would be the same.
        if codes.len() == 1 {
            attributes.add(blocks, buffers, target)?;
        }
        Ok(())
    }

    /// Makes the prim of a panel's bar the current one, with a sample of this frame.
    fn find_prim(&mut self, panel: usize, bar: usize) -> Result<(), ExportError> {
        let place = self.prims.iter().position(|prim| (prim.panel, prim.bar) == (panel, bar));
        if place.is_some() && self.current == place {
            return Ok(());
        }
        self.end_prim()?;
        let place = place.unwrap_or(self.prims.len());
        if place == self.prims.len() {
            let (points, extents) = (Vec::new(), Vec::new());
            self.prims.push(WaitingPrim { panel, bar, points, extents, attributes: 0..0 });
        }
        let start = self.waiting.length();
        self.prims[place].points.push(start..start);
        self.prims[place].extents.push(EMPTY);
        self.current = Some(place);
        Ok(())
    }

    /// Puts the attributes of the first frame's prim behind its points.
    fn end_prim(&mut self) -> Result<(), ExportError> {
        let Some(current) = self.current.take() else { return Ok(()) };
        if self.codes.len() == 1 {
            let start = self.waiting.length();
            let Self { target, waiting, attributes, .. } = self;
            target.write_with(|_| attributes.drain(waiting))?;
            self.prims[current].attributes = start..self.waiting.length();
        }
        Ok(())
    }

    /// The lines that say how time runs.
    fn time(&self) -> String {
        let first = self.codes.first().copied().unwrap_or(1);
        let last = self.codes.last().copied().unwrap_or(1);
        let speed = self.frames_per_second;
        format!(
            "    startTimeCode = {first}\n    endTimeCode = {last}\n    \
             timeCodesPerSecond = {speed}\n    framesPerSecond = {speed}\n"
        )
    }
}

impl<W: Write + Seek + Send> Sink<W> for UsdaFramesWriter<W> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        blocks_by_prim(blocks).try_for_each(|blocks| self.add(blocks))
    }

    fn finish(mut self: Box<Self>) -> Result<W, ExportError> {
        self.end_prim()?;
        let time = self.time();
        let Self { mut target, styles, curves, mut waiting, prims, codes, .. } = *self;
        target.write(beginning(&styles, curves, &time).as_bytes())?;
        for prim in &prims {
            let style = &styles[prim.bar];
            target.write_with(|file| prim.write(&codes, style, curves, &mut waiting, file))?;
        }
        target.write(b"}\n")?;
        target.finish()
    }
}

impl WaitingPrim {
    /// Writes the prim with a sample for each time code.
    fn write(
        &self,
        codes: &[u32],
        style: &StrandStyle,
        curves: UsdCurves,
        waiting: &mut Spool,
        file: &mut impl Write,
    ) -> std::io::Result<()> {
        let text = prim_beginning(self.panel, self.bar, style, curves);
        writeln!(file, "{text}        point3f[] points.timeSamples = {{")?;
        for (code, sample) in codes.iter().zip(&self.points) {
            write!(file, "            {code}: [")?;
            waiting.copy(sample, file)?;
            file.write_all(b"],\n")?;
        }
        file.write_all(b"        }\n")?;
        waiting.copy(&self.attributes, file)?;
        file.write_all(b"        float3[] extent.timeSamples = {\n")?;
        for (code, extent) in codes.iter().zip(&self.extents) {
            writeln!(file, "            {code}: {},", extent_text(*extent, style, curves))?;
        }
        file.write_all(b"        }\n    }\n")
    }
}
