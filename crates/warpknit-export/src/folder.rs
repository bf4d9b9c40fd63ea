//! A folder that appears under its name only when it is whole. If it is there already, the new
//! files are moved into it one by one, each whole.

use std::io;
use std::path::{Path, PathBuf};

use super::ExportError;
use super::temporary::{TemporaryFolder, folder_of};

/// A folder being filled beside its target.
///
/// Dropped before [`OutputFolder::publish`], it leaves nothing behind. A folder that is there
/// already keeps its other files.
#[derive(Debug)]
pub struct OutputFolder {
    target: PathBuf,
    temporary: TemporaryFolder,
}

impl OutputFolder {
    /// Opens a temporary folder beside the target.
    ///
    /// # Errors
    /// [`ExportError::Io`] where the folder around it is missing or can't be written, or the target
    /// is a file.
    pub fn create(target: &Path) -> Result<Self, ExportError> {
        Self::open(target)
            .map_err(|source| ExportError::Io { path: Some(target.to_owned()), source })
    }

    fn open(target: &Path) -> io::Result<Self> {
        // A link is followed, so that files go to the folder it points to.
        let target = target.canonicalize().unwrap_or_else(|_absent| target.to_owned());
        if target.exists() && !target.is_dir() {
            return Err(io::Error::new(
                io::ErrorKind::NotADirectory,
                "it is a file, and a folder is needed",
            ));
        }
        let around = folder_of(&target);
        if !around.is_dir() {
            return Err(io::Error::new(
                io::ErrorKind::NotFound,
                format!("there is no folder {}", around.display()),
            ));
        }
        let temporary = TemporaryFolder::create_in(around)?;
        Ok(Self { target, temporary })
    }

    /// The folder's final path.
    #[must_use]
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Where to write a file of this name.
    #[must_use]
    pub fn file(&self, name: &str) -> PathBuf {
        self.temporary.path().join(name)
    }

    /// Gives the folder its name. Where a folder of that name is there, the files are moved into it
    /// one by one.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn publish(self) -> Result<(), ExportError> {
        let Self { target, temporary } = self;
        temporary.publish(&target).map_err(|source| ExportError::Io { path: Some(target), source })
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn nothing_is_seen_before_it_is_published_and_other_files_stay() {
        let around = tempfile::tempdir().unwrap();
        let target = around.path().join("yarn");
        let folder = OutputFolder::create(&target).unwrap();
        fs::write(folder.file("a"), "1").unwrap();
        assert!(!target.exists());
        drop(folder);
        assert_eq!(fs::read_dir(around.path()).unwrap().count(), 0);
        for text in ["1", "2"] {
            let folder = OutputFolder::create(&target).unwrap();
            fs::write(folder.file("a"), text).unwrap();
            folder.publish().unwrap();
            assert_eq!(fs::read_to_string(target.join("a")).unwrap(), text);
            fs::write(target.join("other"), "").unwrap();
        }
        assert!(target.join("other").is_file());
        assert_eq!(fs::read_dir(around.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_file_or_a_missing_folder_is_an_error_that_names_the_target() {
        let around = tempfile::tempdir().unwrap();
        fs::write(around.path().join("file"), "").unwrap();
        for target in [around.path().join("file"), around.path().join("no").join("yarn")] {
            let message =
                format!("{:#}", anyhow::Error::from(OutputFolder::create(&target).unwrap_err()));
            assert!(message.contains(&target.display().to_string()), "{message}");
        }
    }
}
