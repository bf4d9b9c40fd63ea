//! Parts of a file that are made while an earlier part is being written.
//!
//! They wait in a nameless temporary file and are copied to their place afterwards, so that no part
//! is held in memory. (To write a job to a spool and take it up in order is as old as printers.)

use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::ops::Range;
use std::path::Path;

use super::temporary::nameless;
use super::write_behind::WriteBehind;

/// One such part.
#[derive(Debug)]
pub(super) struct Spool {
    file: WriteBehind,
    length: u64,
}

impl Spool {
    /// An empty part of the file at `target`, if it has a path.
    pub(super) fn create(target: Option<&Path>) -> io::Result<Self> {
        Ok(Self { file: WriteBehind::new(nameless(target)?), length: 0 })
    }

    /// Bytes so far.
    pub(super) fn length(&self) -> u64 {
        self.length
    }

    /// Copies the part to where it belongs and empties it.
    pub(super) fn drain(&mut self, target: &mut impl io::Write) -> io::Result<()> {
        let mut file = self.file.file()?;
        file.rewind()?;
        io::copy(&mut (&*file).take(self.length), target)?;
        file.rewind()?;
        self.length = 0;
        Ok(())
    }

    /// Overwrites bytes that are there.
    pub(super) fn patch(&mut self, at: u64, bytes: &[u8]) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(at))?;
        self.file.write_all(bytes)?;
        self.file.seek(SeekFrom::Start(self.length)).map(drop)
    }

    /// Copies a range of its bytes, and keeps them.
    pub(super) fn copy(
        &mut self,
        bytes: &Range<u64>,
        target: &mut impl io::Write,
    ) -> io::Result<()> {
        let mut file = self.file.file()?;
        file.seek(SeekFrom::Start(bytes.start))?;
        io::copy(&mut (&*file).take(bytes.end - bytes.start), target)?;
        // What comes next is appended.
        file.seek(SeekFrom::Start(self.length)).map(drop)
    }
}

impl io::Write for Spool {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.length += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}
