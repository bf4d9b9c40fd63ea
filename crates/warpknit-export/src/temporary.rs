//! Files and folders that have no name yet, and that don't outlive their process for long.
//!
//! In: a folder. Out: a file or a folder in it called `.warpknit-` and six letters and `.part`. It
//! goes when it is dropped or published. When a signal ends the process it goes if the program
//! calls [`remove_temporaries`]. After SIGKILL the next process that writes into the same folder
//! removes it. To tell a dead process's temporaries from those in use, each is locked while it is
//! written: the system releases locks however a process ends.
//!
//! Not promised: that temporaries of dead processes are removed where files can't be locked (some
//! network file systems), or elsewhere than on Unix.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::{Builder, TempDir, TempPath};

const PREFIX: &str = ".warpknit-";
const SUFFIX: &str = ".part";
const RANDOM_LETTERS: usize = 6;
/// How often removing a folder is tried again while another thread writes into it.
const REMOVALS: usize = 100;

/// This process's temporaries. Its lock is held while one is made, published or removed.
static REGISTER: Mutex<Register> = Mutex::new(Register { alive: Vec::new(), swept: Vec::new() });

struct Register {
    /// Those that are on the disk.
    alive: Vec<PathBuf>,
    /// Folders without temporaries of dead processes.
    swept: Vec<PathBuf>,
}

fn register() -> MutexGuard<'static, Register> {
    REGISTER.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes all temporary files and folders of a process that is about to end. From now on none can
/// be made or published: a thread that tries waits until the process ends.
///
/// A program calls it when a signal asks it to end. Files that were published stay.
pub fn remove_temporaries() {
    let register = register();
    for path in register.alive.iter().rev() {
        // There is no remedy for one that can't be removed.
        let _gone = if path.is_dir() { remove_folder(path) } else { fs::remove_file(path) };
    }
    // The lock is never released, so nothing can be made any more.
    std::mem::forget(register);
}

/// Removes a folder, though another thread may be writing into it.
fn remove_folder(path: &Path) -> io::Result<()> {
    let mut result = Ok(());
    for _ in 0..REMOVALS {
        result = fs::remove_dir_all(path);
        if result.is_ok() || !path.exists() {
            return Ok(());
        }
    }
    result
}

/// A path's place in the register, removed on drop.
#[derive(Debug)]
struct Registration(PathBuf);

impl Registration {
    fn new(register: &mut Register, path: &Path) -> Self {
        register.alive.push(path.to_owned());
        Self(path.to_owned())
    }
}

impl Drop for Registration {
    fn drop(&mut self) {
        register().alive.retain(|path| *path != self.0);
    }
}

/// A file without a name.
#[derive(Debug)]
pub(super) struct TemporaryFile {
    path: TempPath,
    _registration: Registration,
}

impl TemporaryFile {
    /// A new file in `folder`, with the rights that the user's own new files have. It is locked
    /// until it is closed.
    pub(super) fn create_in(folder: &Path) -> io::Result<(File, Self)> {
        let mut builder = builder();
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut register = register();
        register.sweep(folder);
        loop {
            let (file, path) = builder.tempfile_in(folder)?.into_parts();
            if is_kept(&file, &path) {
                let registration = Registration::new(&mut register, &path);
                return Ok((file, Self { path, _registration: registration }));
            }
        }
    }

    /// Gives the file its name, in place of any file of that name.
    pub(super) fn publish(self, target: &Path) -> io::Result<()> {
        let Self { path, _registration } = self;
        let _guard = register();
        path.persist(target).map_err(|refused| refused.error)
    }
}

/// A folder without a name.
#[derive(Debug)]
pub struct TemporaryFolder {
    folder: TempDir,
    _registration: Registration,
    /// Its open handle, which holds the lock where folders can be locked.
    _lock: Option<File>,
}

impl TemporaryFolder {
    /// A new folder in another one, with the rights that the user's own new folders have.
    ///
    /// # Errors
    /// What the disk says.
    pub fn create_in(around: &Path) -> io::Result<Self> {
        let mut builder = builder();
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o777));
        let mut register = register();
        register.sweep(around);
        loop {
            let folder = builder.tempdir_in(around)?;
            let lock = match File::open(folder.path()) {
                Ok(lock) => Some(lock),
                // Another process removed it before it could be locked.
                Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                Err(_no_lock) => None,
            };
            if lock.as_ref().is_none_or(|lock| is_kept(lock, folder.path())) {
                let registration = Registration::new(&mut register, folder.path());
                return Ok(Self { folder, _registration: registration, _lock: lock });
            }
        }
    }

    /// Its temporary path.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Gives the folder its name. Where a folder of that name is there, the files are moved into it
    /// one by one.
    pub(super) fn publish(self, target: &Path) -> io::Result<()> {
        let Self { _registration, _lock, folder } = self;
        let _guard = register();
        move_into(folder.path(), target)
    }
}

/// Renames a folder, or moves its files into the folder that has the name already, whole folders in
/// it likewise.
fn move_into(folder: &Path, target: &Path) -> io::Result<()> {
    if !target.is_dir() {
        return fs::rename(folder, target);
    }
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let (from, to) = (entry.path(), target.join(entry.file_name()));
        if from.is_dir() { move_into(&from, &to)? } else { fs::rename(from, to)? }
    }
    Ok(())
}

/// A nameless file, which is gone when it is closed: beside `target`, or else in the system's
/// folder for temporary files.
pub(super) fn nameless(target: Option<&Path>) -> io::Result<File> {
    // There is room for the target, which is more than the system's folder may have. Beside a pipe
    // no file may be allowed.
    target
        .and_then(|target| tempfile::tempfile_in(folder_of(target)).ok())
        .map_or_else(tempfile::tempfile, Ok)
}

fn builder() -> Builder<'static, 'static> {
    let mut builder = Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX).rand_bytes(RANDOM_LETTERS);
    builder
}

/// Whether a name is one that [`builder`] makes.
fn is_temporary(name: &OsStr) -> bool {
    let letters = name.to_str().and_then(|name| name.strip_prefix(PREFIX)?.strip_suffix(SUFFIX));
    letters.is_some_and(|letters| {
        letters.len() == RANDOM_LETTERS
            && letters.bytes().all(|letter| letter.is_ascii_alphanumeric())
    })
}

/// Locks a new temporary. False if another process removed it between its making and its locking,
/// taking it for one of a dead process.
#[cfg(unix)]
fn is_kept(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    // Where files can't be locked, nobody sweeps either.
    let _unlocked = file.lock();
    match (file.metadata(), fs::symlink_metadata(path)) {
        (Ok(made), Ok(there)) => (made.dev(), made.ino()) == (there.dev(), there.ino()),
        _ => false,
    }
}

#[cfg(not(unix))]
fn is_kept(_file: &File, _path: &Path) -> bool {
    true
}

impl Register {
    /// Removes what dead processes left in a folder. A process does it once a folder.
    fn sweep(&mut self, folder: &Path) {
        if !cfg!(unix) || self.swept.iter().any(|swept| swept == folder) {
            return;
        }
        self.swept.push(folder.to_owned());
        let Ok(entries) = fs::read_dir(folder) else { return };
        for entry in entries.flatten().filter(|entry| is_temporary(&entry.file_name())) {
            // What can't be removed belongs to another process, and is no reason to fail.
            let _kept = remove_dead(&entry.path());
        }
    }
}

/// Removes a temporary that nobody has locked.
fn remove_dead(path: &Path) -> io::Result<()> {
    let kind = fs::symlink_metadata(path)?.file_type();
    if kind.is_dir() {
        let folder = File::open(path)?;
        folder.try_lock()?;
        fs::remove_dir_all(path)
    } else if kind.is_file() {
        // Network file systems lock only files that are open for writing.
        let file = File::options().write(true).open(path)?;
        file.try_lock()?;
        fs::remove_file(path)
    } else {
        Ok(())
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn what_the_dead_left_is_removed_and_nothing_else() {
        let around = tempfile::tempdir().unwrap();
        let place = |name: &str| around.path().join(name);
        fs::write(place(".warpknit-dead00.part"), "x").unwrap();
        fs::create_dir(place(".warpknit-dead01.part")).unwrap();
        fs::write(place(".warpknit-dead01.part/map.png"), "x").unwrap();
        std::os::unix::fs::symlink(place("own"), place(".warpknit-aLink0.part")).unwrap();
        let kept = [
            ".warpknit-notes",
            ".warpknit-long-name.part",
            ".warpknit-é0000.part",
            ".warpknit-alive0.part",
            "own",
        ];
        kept.iter().for_each(|name| fs::write(place(name), "x").unwrap());
        let alive = File::open(place(".warpknit-alive0.part")).unwrap();
        alive.lock().unwrap();
        let (_file, temporary) = TemporaryFile::create_in(around.path()).unwrap();
        for name in [".warpknit-dead00.part", ".warpknit-dead01.part"] {
            assert!(!place(name).exists(), "{name}");
        }
        assert!(
            kept.iter().all(|name| place(name).exists())
                && place(".warpknit-aLink0.part").is_symlink()
        );
        assert!(temporary.path.exists() && is_temporary(temporary.path.file_name().unwrap()));
    }

    #[test]
    fn a_temporary_at_work_is_locked() {
        let around = tempfile::tempdir().unwrap();
        let (_file, file) = TemporaryFile::create_in(around.path()).unwrap();
        let folder = TemporaryFolder::create_in(around.path()).unwrap();
        assert!(remove_dead(&file.path).is_err() && remove_dead(folder.path()).is_err());
        assert!(file.path.exists() && folder.path().exists());
        assert!(!is_kept(&_file, &around.path().join("gone")));
    }
}
/// The folder that a file is in.
pub(super) fn folder_of(target: &Path) -> &Path {
    target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}
