//! Parts of a file that are known while an earlier part is being written: they wait in a nameless temporary file, so that no part is held in memory.

use std::fs::File;
use std::io::{self, BufWriter, Read as _, Seek as _, Write as _};
use std::path::Path;

use super::output::BUFFER;
use super::{ExportError, Output};

/// One such part.
#[derive(Debug)]
pub(super) struct Spill {
    file: BufWriter<File>,
    length: u64,
}

impl Spill {
    /// An empty part of `target`, which errors name.
    ///
    /// # Errors
    /// What the disk says.
    pub(super) fn create(target: &Path) -> Result<Self, ExportError> {
        let file = tempfile::tempfile().map_err(|source| ExportError::Io { path: target.to_owned(), source })?;
        Ok(Self { file: BufWriter::with_capacity(BUFFER, file), length: 0 })
    }

    /// Bytes so far.
    pub(super) fn length(&self) -> u64 {
        self.length
    }

    /// Appends.
    ///
    /// # Errors
    /// What the disk says.
    pub(super) fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.length += bytes.len() as u64;
        self.file.write_all(bytes)
    }

    /// Copies the part to where it belongs; it is empty afterwards.
    ///
    /// # Errors
    /// What the disk says.
    pub(super) fn pour(&mut self, target: &mut impl io::Write) -> io::Result<()> {
        self.file.flush()?;
        let file = self.file.get_mut();
        file.rewind()?;
        io::copy(&mut file.take(self.length), target)?;
        file.rewind()?;
        self.length = 0;
        Ok(())
    }

    /// The same into an output.
    ///
    /// # Errors
    /// What the disk says, with the target's name.
    pub(super) fn pour_into(&mut self, output: &mut Output) -> Result<(), ExportError> {
        output.write_with(|file| self.pour(file))
    }
}
