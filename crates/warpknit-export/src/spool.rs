//! Parts of a file that are known while an earlier part is being written: they wait in a nameless
//! temporary file beside the target, so that no part is held in memory.

use std::fs::File;
use std::io::{self, BufWriter, Read as _, Seek as _, SeekFrom, Write as _};
use std::ops::Range;
use std::path::Path;

use super::ExportError;
use super::output::{BUFFER, folder_of};

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
        // There is room for the file itself, which is more than the system's own place for such
        // files may have; beside a pipe there may be none.
        let file =
            tempfile::tempfile_in(folder_of(target)).or_else(|_refused| tempfile::tempfile());
        let file = file.map_err(|source| ExportError::Io { path: target.to_owned(), source })?;
        Ok(Self { file: BufWriter::with_capacity(BUFFER, file), length: 0 })
    }

    /// Bytes so far.
    pub(super) fn length(&self) -> u64 {
        self.length
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

    /// Copies so many of its bytes, counted from its beginning; it stays.
    ///
    /// # Errors
    /// What the disk says.
    pub(super) fn copy(
        &mut self,
        bytes: &Range<u64>,
        target: &mut impl io::Write,
    ) -> io::Result<()> {
        self.file.flush()?;
        let file = self.file.get_mut();
        file.seek(SeekFrom::Start(bytes.start))?;
        io::copy(&mut file.take(bytes.end - bytes.start), target)?;
        file.seek(SeekFrom::Start(self.length)).map(drop)
    }
}

impl io::Write for Spill {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.length += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}
