//! Files of fibres: whatever a writer takes, with each yarn's fibres in its place.
//!
//! In: blocks of yarns. Out: what the writer makes of blocks of fibres. Blocks are spun in
//! parallel, as many at a time as there are threads: fibres take a thousand times a yarn's memory.

use rayon::prelude::*;

use super::{ExportError, Output, Sink};
use warpknit_core::drape::{Block, fibres};
use warpknit_core::yarn::fibres::Bundle;
use warpknit_core::yarn::tube::Section;

/// Spins yarns on their way to a writer.
pub struct SpunWriter<'a> {
    writer: Box<dyn Sink + 'a>,
    /// One a bar.
    bundles: Vec<Bundle>,
    surface: Option<Section>,
}

impl<'a> SpunWriter<'a> {
    /// Spins for a writer of the fabric that [`fibres::fabric`] gives; `surface` where it takes
    /// tubes.
    #[must_use]
    pub fn new(writer: Box<dyn Sink + 'a>, bundles: Vec<Bundle>, surface: Option<Section>) -> Self {
        Self { writer, bundles, surface }
    }
}

impl Sink for SpunWriter<'_> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        for blocks in blocks.chunks(rayon::current_num_threads().max(1)) {
            let spun: Vec<Block> = blocks
                .par_iter()
                .map(|block| fibres::block(block, &self.bundles[block.bar], self.surface.as_ref()))
                .collect();
            self.writer.take(&spun)?;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<Vec<Output>, ExportError> {
        self.writer.finish()
    }
}
