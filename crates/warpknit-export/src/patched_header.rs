//! Files that begin with what is known last: counts, or a table of contents.
//!
//! The body is written behind room for the header, and the header into that room at the end. So no
//! byte is written twice.
//!
//! The body waits in a spool instead, and is copied behind the header, where the target can't be
//! sought (a pipe) or nobody knows how long the header will be at the most.

use std::io::{Seek, SeekFrom, Write};
use std::path::PathBuf;

use super::spool::Spool;
use super::{Destination, ExportError};

/// A file whose header is known last.
#[derive(Debug)]
pub(super) struct PatchedHeader<W> {
    target: Destination<W>,
    /// The body, where it has to wait.
    waiting: Option<Spool>,
    /// Where the file begins in the target.
    start: u64,
    /// Bytes kept for the header; 0 where its length is open.
    room: usize,
}

impl<W: Write + Seek> PatchedHeader<W> {
    /// Starts the file with so many bytes of room for the header, or with an open length.
    pub(super) fn create(
        mut target: Destination<W>,
        room: Option<usize>,
    ) -> Result<Self, ExportError> {
        let start = target.write_with(Seek::stream_position).ok();
        let mut waiting = None;
        if let (Some(start), Some(room)) = (start, room) {
            // What lies between is zeros until the header is written over them.
            target.write_with(|bytes| bytes.seek(SeekFrom::Start(start + room as u64)))?;
        } else {
            waiting = Some(target.spool()?);
        }
        Ok(Self { target, waiting, start: start.unwrap_or(0), room: room.unwrap_or(0) })
    }

    /// Length to which the header is to be filled up, if it is shorter.
    pub(super) fn room(&self) -> usize {
        self.room
    }

    /// The path that errors name.
    pub(super) fn error_path(&self) -> Option<PathBuf> {
        self.target.error_path()
    }

    /// Appends to the body.
    pub(super) fn write(&mut self, bytes: &[u8]) -> Result<(), ExportError> {
        match &mut self.waiting {
            Some(waiting) => {
                let result = waiting.write_all(bytes);
                self.target.name_error(result)
            }
            None => self.target.write(bytes),
        }
    }

    /// Lets `write` append to the body.
    pub(super) fn write_with<T>(
        &mut self,
        write: impl FnOnce(&mut dyn Write) -> std::io::Result<T>,
    ) -> Result<T, ExportError> {
        match &mut self.waiting {
            Some(waiting) => {
                let result = write(waiting);
                self.target.name_error(result)
            }
            None => self.target.write_with(|bytes| write(bytes)),
        }
    }

    /// Overwrites bytes of the body, `at` of them behind the file's beginning. What comes next is
    /// appended.
    pub(super) fn patch(&mut self, at: u64, bytes: &[u8]) -> Result<(), ExportError> {
        if let Some(waiting) = &mut self.waiting {
            // The header comes in front of the spool.
            let result = waiting.patch(at - self.room as u64, bytes);
            return self.target.name_error(result);
        }
        let place = self.start + at;
        self.target.write_with(|file| {
            let end = file.stream_position()?;
            file.seek(SeekFrom::Start(place))?;
            file.write_all(bytes)?;
            file.seek(SeekFrom::Start(end)).map(drop)
        })
    }

    /// The result with the target's name in its error.
    pub(super) fn name_error<T>(&self, result: std::io::Result<T>) -> Result<T, ExportError> {
        self.target.name_error(result)
    }

    /// Puts the header in front, flushes, and gives the target back, positioned at the file's end.
    ///
    /// # Errors
    /// [`ExportError::Io`], and [`ExportError::HeaderTooLong`] where the header overflows its room.
    pub(super) fn finish(self, header: &[u8]) -> Result<W, ExportError> {
        let Self { mut target, waiting, start, room } = self;
        match waiting {
            Some(mut body) => target.write_with(|bytes| {
                bytes.write_all(header)?;
                body.drain(bytes)
            })?,
            None if header.len() == room => target.write_with(|bytes| {
                let end = bytes.stream_position()?;
                bytes.seek(SeekFrom::Start(start))?;
                bytes.write_all(header)?;
                bytes.seek(SeekFrom::Start(end)).map(drop)
            })?,
            None => {
                let (path, bytes) = (target.error_path(), header.len());
                return Err(ExportError::HeaderTooLong { path, bytes, room });
            }
        }
        target.finish()
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Cursor, Read as _};

    use super::*;

    fn written<W: Write + Seek>(
        target: Destination<W>,
        room: Option<usize>,
        header: &[u8],
    ) -> Result<W, ExportError> {
        let mut file = PatchedHeader::create(target, room)?;
        (0..3).try_for_each(|_| file.write(b"body"))?;
        file.finish(header)
    }

    #[test]
    fn a_header_stands_in_front_whether_it_has_room_or_its_length_is_open() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        for (header, room) in [("head", Some(4)), ("a long header", None)] {
            let target = Destination::create(&path).unwrap();
            written(target, room, header.as_bytes()).unwrap().publish().unwrap();
            let expected = format!("{header}bodybodybody");
            assert_eq!(std::fs::read_to_string(&path).unwrap(), expected);
            let memory = Destination::new(Cursor::new(Vec::new()));
            let memory = written(memory, room, header.as_bytes()).unwrap();
            assert_eq!(memory.into_inner(), expected.as_bytes());
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing else stays");
    }

    #[test]
    fn a_header_that_overflows_its_room_is_an_error_that_names_the_target() {
        let target = Destination::named(Cursor::new(Vec::new()), "a.glb");
        let error = written(target, Some(4), b"a long header").unwrap_err().to_string();
        assert!(error.starts_with("a.glb: ") && error.contains("room for 4"), "{error}");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_target_that_cant_go_back_gets_the_same_bytes() {
        // Linux writes to a pipe through a file of this name, as a shell's `>(...)` has it.
        for header in ["head", "a long header"] {
            let (mut reader, writer) = std::io::pipe().unwrap();
            let path = format!("/proc/self/fd/{}", std::os::fd::AsRawFd::as_raw_fd(&writer));
            let target = Destination::create(path.as_ref()).unwrap();
            written(target, Some(4), header.as_bytes()).unwrap().publish().unwrap();
            drop(writer);
            let mut text = String::new();
            reader.read_to_string(&mut text).unwrap();
            assert_eq!(text, format!("{header}bodybodybody"));
        }
    }
}
