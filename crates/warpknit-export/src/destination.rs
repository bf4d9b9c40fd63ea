//! Where a writer's bytes go.

use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};

use super::spool::Spool;
use super::{ExportError, Output};

/// Something that takes bytes, with its path if it has one.
///
/// Errors name the path. The companions of an `.obj` are named after it, and parts of a file that
/// have to wait do so in its folder. A writer makes many small writes, so put a bare
/// [`std::fs::File`] into a [`std::io::BufWriter`]. An [`Output`] is written by other threads while
/// the next bytes are made.
///
/// What can't be sought, such as a pipe, is found out by asking for its position: then a file whose
/// header is known last is put together in a temporary file first.
#[derive(Debug)]
pub struct Destination<W> {
    bytes: W,
    path: Option<PathBuf>,
    /// Where the path leads if it is a link: errors name that file, which is the one that is full.
    leads_to: Option<PathBuf>,
}

impl<W> Destination<W> {
    /// A target without a name.
    #[must_use]
    pub fn new(bytes: W) -> Self {
        Self { bytes, path: None, leads_to: None }
    }

    /// A target of that path, which need not be a file's.
    #[must_use]
    pub fn named(bytes: W, path: impl Into<PathBuf>) -> Self {
        Self { bytes, path: Some(path.into()), leads_to: None }
    }

    /// Its path, if it has one.
    #[must_use]
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// The path that errors name.
    pub(super) fn error_path(&self) -> Option<PathBuf> {
        self.leads_to.clone().or_else(|| self.path.clone())
    }

    /// The result with the target's name in its error.
    pub(super) fn name_error<T>(&self, result: io::Result<T>) -> Result<T, ExportError> {
        result.map_err(|source| ExportError::Io { path: self.error_path(), source })
    }

    /// An empty part of the file, to be copied to its place later.
    pub(super) fn spool(&self) -> Result<Spool, ExportError> {
        self.name_error(Spool::create(self.path()))
    }
}

impl Destination<Output> {
    /// An [`Output`] at that path.
    ///
    /// # Errors
    /// As of [`Output::create`].
    pub fn create(path: &Path) -> Result<Self, ExportError> {
        let bytes = Output::create(path)?;
        let leads_to = Some(bytes.target().to_owned());
        Ok(Self { bytes, path: Some(path.to_owned()), leads_to })
    }
}

impl<W: Write + Seek> Destination<W> {
    /// Appends bytes.
    pub(super) fn write(&mut self, bytes: &[u8]) -> Result<(), ExportError> {
        self.write_with(|target| target.write_all(bytes))
    }

    /// Lets `write` append bytes.
    pub(super) fn write_with<T>(
        &mut self,
        write: impl FnOnce(&mut W) -> io::Result<T>,
    ) -> Result<T, ExportError> {
        let result = write(&mut self.bytes);
        self.name_error(result)
    }

    /// Flushes, and gives back what took the bytes. A full disk may show only now.
    pub(super) fn finish(mut self) -> Result<W, ExportError> {
        self.write_with(Write::flush)?;
        Ok(self.bytes)
    }
}
