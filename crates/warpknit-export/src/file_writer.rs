//! A file of yarns at a path, with the files that come with it.

use std::path::Path;

use super::{ClothInfo, Destination, ExportError, Format, Output, Sink, mtl, writer};
use warpknit_core::drape::Block;

/// Writes a file of any format that holds yarns, and its companions.
pub struct FileWriter<'a> {
    writer: Box<dyn Sink<Output> + 'a>,
    companions: Vec<Output>,
}

impl<'a> FileWriter<'a> {
    /// Opens the file and writes its companions ([`mtl::companions`]) beside it, all under
    /// temporary names.
    ///
    /// # Errors
    /// As of [`Output::create`] and [`writer`].
    pub fn create(path: &Path, format: Format, cloth: &ClothInfo<'a>) -> Result<Self, ExportError> {
        let companions = mtl::companions(format, Some(path), cloth)
            .iter()
            .map(|companion| Output::create_whole(&companion.path, &companion.bytes))
            .collect::<Result<_, _>>()?;
        let target = Destination::create(path)?;
        Ok(Self { writer: writer(format, target, cloth)?, companions })
    }

    /// Writes the next blocks, in yarn order.
    ///
    /// # Errors
    /// As of [`Sink::take`].
    pub fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        self.writer.take(blocks)
    }

    /// Writes the end, and gives back the whole file and its companions, still under their
    /// temporary names.
    ///
    /// # Errors
    /// As of [`Sink::finish`].
    pub fn finish(self) -> Result<Vec<Output>, ExportError> {
        let Self { writer, companions } = self;
        Ok(std::iter::once(writer.finish()?).chain(companions).collect())
    }
}
