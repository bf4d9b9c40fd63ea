//! A file that appears under its name only when it is whole.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::ExportError;
use super::temporary::{TemporaryFile, folder_of};
use super::write_behind::WriteBehind;

/// A file being written beside its target, or the target itself where that is no regular file (a
/// pipe, `/dev/stdout`).
///
/// Dropped before [`Output::publish`], it leaves nothing behind.
#[derive(Debug)]
pub struct Output {
    target: PathBuf,
    file: WriteBehind,
    /// The temporary name, removed on drop.
    temporary: Option<TemporaryFile>,
}

impl Output {
    /// Opens a temporary file in the target's folder.
    ///
    /// # Errors
    /// [`ExportError::Io`] where the folder is missing or can't be written, or the target is a
    /// folder.
    pub fn create(target: &Path) -> Result<Self, ExportError> {
        Self::open(target)
            .map_err(|source| ExportError::Io { path: Some(target.to_owned()), source })
    }

    /// A whole file of these bytes, still under its temporary name.
    ///
    /// # Errors
    /// As of [`Output::create`], and [`ExportError::Io`].
    pub fn create_whole(target: &Path, bytes: &[u8]) -> Result<Self, ExportError> {
        let mut output = Self::create(target)?;
        output.write_with(|file| file.write_all(bytes))?;
        output.seal()
    }

    /// Checks, before the work, that the target can be written after it. A pipe is not opened: its
    /// reader would take that for the end.
    ///
    /// # Errors
    /// As of [`Output::create`].
    pub fn check(target: &Path) -> Result<(), ExportError> {
        if is_pipe(target) { Ok(()) } else { Self::create(target).map(drop) }
    }

    fn open(target: &Path) -> io::Result<Self> {
        // A link is followed, so that the file it points to is replaced and not the link.
        let target = target.canonicalize().unwrap_or_else(|_absent| target.to_owned());
        if target.is_dir() {
            return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder"));
        }
        let (file, temporary) = if is_pipe(&target) {
            (File::options().write(true).open(&target)?, None)
        } else {
            let (file, temporary) = temporary_beside(&target)?;
            (file, Some(temporary))
        };
        Ok(Self { target, file: WriteBehind::new(file), temporary })
    }

    /// The file's final path.
    #[must_use]
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Lets `write` append bytes; its error is given the target's name.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn write_with<T>(
        &mut self,
        write: impl FnOnce(&mut Self) -> io::Result<T>,
    ) -> Result<T, ExportError> {
        write(self).map_err(|source| ExportError::Io { path: Some(self.target.clone()), source })
    }

    /// Waits until the system has taken all bytes. A full disk may show only now.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn seal(mut self) -> Result<Self, ExportError> {
        self.write_with(Write::flush)?;
        Ok(self)
    }

    /// Gives the file its name, in place of any file of that name.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn publish(mut self) -> Result<(), ExportError> {
        self.write_with(Write::flush)?;
        match self.temporary {
            Some(temporary) => temporary
                .publish(&self.target)
                .map_err(|source| ExportError::Io { path: Some(self.target.clone()), source }),
            None => Ok(()),
        }
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.file.write_all(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for Output {
    /// Refused for a pipe and for any other target that is no regular file: a terminal or
    /// `/dev/null` may take a seek and ignore it.
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        match self.temporary {
            Some(_) => self.file.seek(position),
            None => Err(io::ErrorKind::NotSeekable.into()),
        }
    }
}

/// Whether the target is there and neither a file nor a folder.
fn is_pipe(target: &Path) -> bool {
    target.exists() && !target.is_file() && !target.is_dir()
}

/// A new file beside `target`.
fn temporary_beside(target: &Path) -> io::Result<(File, TemporaryFile)> {
    let folder = folder_of(target);
    if !folder.is_dir() {
        return Err(io::Error::new(
            io::ErrorKind::NotFound,
            format!("there is no folder {}", folder.display()),
        ));
    }
    TemporaryFile::create_in(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files_in(folder: &Path) -> Vec<String> {
        let names = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned());
        names.collect()
    }

    #[test]
    fn nothing_is_seen_before_it_is_published_and_nothing_stays_of_what_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("yarns.obj");
        std::fs::write(&target, "old").unwrap();
        let mut output = Output::create(&target).unwrap();
        output.write_with(|file| file.write_all(b"new")).unwrap();
        assert_eq!(std::fs::read_to_string(&target).unwrap(), "old");
        drop(output);
        assert_eq!(files_in(folder.path()), ["yarns.obj"]);

        let mut output = Output::create(&target).unwrap();
        output.write_with(|file| file.write_all(b"new")).unwrap();
        output.seal().unwrap().publish().unwrap();
        assert_eq!(std::fs::read_to_string(&target).unwrap(), "new");
        assert_eq!(files_in(folder.path()), ["yarns.obj"]);

        let mut output = Output::create(&target).unwrap();
        output.write_with(|file| file.write_all(b"not sealed")).unwrap();
        output.publish().unwrap();
        assert_eq!(std::fs::read_to_string(&target).unwrap(), "not sealed");
    }

    #[test]
    fn a_folder_or_a_missing_folder_is_an_error_that_names_the_target() {
        let folder = tempfile::tempdir().unwrap();
        for target in [folder.path().to_owned(), folder.path().join("no").join("a.png")] {
            let message =
                format!("{:#}", anyhow::Error::from(Output::create(&target).unwrap_err()));
            assert!(
                message.contains(&target.display().to_string()) && !message.contains('\n'),
                "{message}"
            );
        }
    }
}
