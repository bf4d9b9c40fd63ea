//! Files of fibres: any writer, with each yarn replaced by its fibres.
//!
//! In: blocks of yarns. Out: what the inner writer makes of blocks of fibres
//! ([`warpknit_core::drape::fibres::block`]). Fibres take about a thousand times their yarn's
//! memory, so blocks are handed on in groups of one a thread.

use rayon::prelude::*;

use super::{ExportError, Sink};
use warpknit_core::drape::{Block, fibres};
use warpknit_core::yarn::fibres::Bundle;
use warpknit_core::yarn::tube::Section;

/// Replaces yarns by their fibres on the way to another writer.
pub struct FibreWriter<'a, W> {
    writer: Box<dyn Sink<W> + 'a>,
    /// One a bar.
    bundles: Vec<Bundle>,
    surface: Option<Section>,
}

impl<'a, W> FibreWriter<'a, W> {
    /// Hands fibres of these bundles, one a bar, to `writer`; with tubes where `surface` says how
    /// fine they are.
    #[must_use]
    pub fn new(
        writer: Box<dyn Sink<W> + 'a>,
        bundles: Vec<Bundle>,
        surface: Option<Section>,
    ) -> Self {
        Self { writer, bundles, surface }
    }
}

impl<W> Sink<W> for FibreWriter<'_, W> {
    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        let Self { writer, bundles, surface } = self;
        // As many blocks as threads: fewer would leave threads idle, more would only take memory.
        for blocks in blocks.chunks(rayon::current_num_threads().max(1)) {
            let fibres: Vec<Block> = blocks
                .par_iter()
                .map(|block| fibres::block(block, &bundles[block.bar], surface.as_ref()))
                .collect();
            writer.take(&fibres)?;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<W, ExportError> {
        self.writer.finish()
    }
}
