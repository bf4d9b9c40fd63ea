//! Strained repeats, kept from one run to the next.
//!
//! In: the folder of the cache and a cloth. Out: its table of strained repeats with the knots that
//! earlier runs solved, and after the run a file with those that this one added.
//!
//! A repeat has a file of its own, named by the repeat and by the program's version. A file appears
//! only when it is whole. One that can't be read or doesn't fit counts as none, and one that can't be
//! written is left out: the result of a run is the same without the cache.
//!
//! Cost: some milliseconds for two bars. Not promised: that two runs at the same time keep the knots
//! of both; the last one's stay.

use std::ffi::OsStr;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::drape::Cloth;
use crate::export::{ExportError, Output};
use crate::knit::strain::StrainTable;

/// The ending of the cache's files.
const ENDING: &str = "knots";
/// Files of the cache. Those that no run has used for longest make room for a new one: each density
/// of a fabric has its own.
const MOST_FILES: usize = 64;
/// Size of a file that is read or written at most. Two bars take about a megabyte.
const MOST_BYTES: u64 = 64 << 20;

/// The folder in which the command keeps strained repeats: `$XDG_CACHE_HOME/warpknit`, or else
/// `warpknit` in the system's folder for such files. Nothing where there is none.
#[must_use]
pub fn cache_folder() -> Option<PathBuf> {
    let chosen = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from);
    let base = chosen.filter(|folder| folder.is_absolute()).or_else(system_folder)?;
    Some(base.join("warpknit"))
}

/// The system's folder for files that can be made again.
fn system_folder() -> Option<PathBuf> {
    if cfg!(windows) {
        return std::env::var_os("LOCALAPPDATA").map(PathBuf::from);
    }
    let inside = if cfg!(target_os = "macos") { "Library/Caches" } else { ".cache" };
    std::env::home_dir().filter(|home| home.is_absolute()).map(|home| home.join(inside))
}

/// The file of a cloth's strained repeats.
#[derive(Debug)]
pub struct StrainCache {
    /// `None` without a cache, or for a repeat that can't be strained.
    file: Option<PathBuf>,
    /// Solved knots in the file.
    kept: usize,
}

impl StrainCache {
    /// Gives a cloth the knots that earlier runs solved. Without a folder nothing is kept.
    #[must_use]
    pub fn open(folder: Option<&Path>, cloth: &Cloth<'_>) -> Self {
        let none = Self { file: None, kept: 0 };
        let table = cloth.strain().filter(|table| !table.is_flat_only());
        let Some((folder, table)) = folder.zip(table) else { return none };
        let file = folder.join(format!("{:016x}.{ENDING}", table.fingerprint()));
        let kept = read(&file).is_some_and(|bytes| table.load(&bytes));
        if kept {
            mark_used(&file);
        }
        Self { file: Some(file), kept: if kept { table.knots() } else { 0 } }
    }

    /// Keeps the knots of a cloth, if the run has solved any.
    pub fn keep(&self, cloth: &Cloth<'_>) {
        let Some((file, table)) = self.file.as_ref().zip(cloth.strain()) else { return };
        if table.knots() > self.kept {
            // A disk without room, or a folder that can't be written, costs the next run its time.
            let _not_kept = write(file, table);
        }
    }
}

/// The bytes of a file of bounded size.
fn read(file: &Path) -> Option<Vec<u8>> {
    // A pipe in its place would never open.
    let about = std::fs::metadata(file).ok()?;
    if !about.is_file() || about.len() > MOST_BYTES {
        return None;
    }
    let mut bytes = Vec::new();
    std::fs::File::open(file).ok()?.take(MOST_BYTES).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

/// Gives a file the time of its last use, by which [`make_room`] chooses. Not all systems keep the
/// time at which a file was read.
fn mark_used(file: &Path) {
    let opened = std::fs::File::options().append(true).open(file);
    // A cache that can't be written keeps its files anyway.
    let _unmarked = opened.and_then(|file| file.set_modified(SystemTime::now()));
}

/// Writes the file of a table.
fn write(file: &Path, table: &StrainTable) -> Result<(), ExportError> {
    let bytes = table.to_bytes();
    if bytes.len() as u64 > MOST_BYTES {
        return Ok(());
    }
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder)
            .map_err(|source| ExportError::Io { path: Some(folder.to_owned()), source })?;
        make_room(folder);
    }
    Output::create_whole(file, &bytes)?.publish()
}

/// Removes the files of the cache that were used longest ago, so that a new one is the last that
/// fits.
fn make_room(folder: &Path) {
    let Ok(entries) = folder.read_dir() else { return };
    let own = entries.filter_map(Result::ok).map(|entry| entry.path());
    let own = own.filter(|path| path.extension() == Some(OsStr::new(ENDING)));
    let mut files: Vec<(SystemTime, PathBuf)> =
        own.filter_map(|path| Some((path.metadata().ok()?.modified().ok()?, path))).collect();
    files.sort();
    let old = files.len().saturating_sub(MOST_FILES - 1);
    for (_, path) in &files[..old] {
        // Another run may have removed it.
        let _gone = std::fs::remove_file(path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drape::swatch_panel;
    use crate::fabric::Fabric;
    use crate::knit::strain::Strain;

    fn with_cloth(work: impl Fn(&Cloth<'_>)) {
        let fabric = Fabric::named("jersey").unwrap();
        let panel = swatch_panel(&fabric, 2, 2);
        work(&Cloth::swatch(&panel, &fabric, 2, 2));
    }

    fn solve(cloth: &Cloth<'_>) {
        let strain = Strain { courses: 1.05, ..Strain::NONE };
        cloth.strain().unwrap().prepare([strain], &mut |_| ());
    }

    fn only_file(folder: &Path) -> PathBuf {
        let mut entries = folder.read_dir().unwrap().map(|entry| entry.unwrap().path());
        let only = entries.next().unwrap();
        assert!(entries.next().is_none(), "one file for one repeat");
        only
    }

    #[test]
    fn what_one_run_solves_the_next_one_reads() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("not").join("there");
        with_cloth(|cloth| {
            let cache = StrainCache::open(Some(&folder), cloth);
            solve(cloth);
            cache.keep(cloth);
        });
        let bytes = std::fs::read(only_file(&folder)).unwrap();
        with_cloth(|cloth| {
            let cache = StrainCache::open(Some(&folder), cloth);
            assert_eq!(cloth.strain().unwrap().to_bytes(), bytes);
            solve(cloth);
            cache.keep(cloth);
        });
        assert_eq!(std::fs::read(only_file(&folder)).unwrap(), bytes);
    }

    /// The pipe has no writer, so whoever opened it would wait forever.
    #[cfg(unix)]
    #[test]
    fn a_pipe_in_place_of_the_file_is_not_opened() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        assert!(read(&pipe).is_none());
    }

    #[test]
    fn a_damaged_file_is_replaced_and_a_folder_that_is_none_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let keep = |folder: &Path| {
            with_cloth(|cloth| {
                let cache = StrainCache::open(Some(folder), cloth);
                assert_eq!(cloth.strain().unwrap().knots(), 0);
                solve(cloth);
                cache.keep(cloth);
            });
        };
        keep(folder.path());
        let file = only_file(folder.path());
        let bytes = std::fs::read(&file).unwrap();
        std::fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
        keep(folder.path());
        assert_eq!(std::fs::read(&file).unwrap(), bytes);
        keep(&file);
        assert_eq!(std::fs::read(&file).unwrap(), bytes);
        std::fs::remove_file(&file).unwrap();
        std::fs::create_dir(&file).unwrap();
        keep(folder.path());
        assert!(file.is_dir());
    }

    #[test]
    fn what_was_used_lately_stays() {
        let folder = tempfile::tempdir().unwrap();
        let open = |cloth: &Cloth<'_>| StrainCache::open(Some(folder.path()), cloth);
        with_cloth(|cloth| {
            let cache = open(cloth);
            solve(cloth);
            cache.keep(cloth);
        });
        let used = only_file(folder.path());
        let long_ago = |file: &Path, seconds: u64| {
            let time = SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(seconds);
            std::fs::File::options().append(true).open(file).unwrap().set_modified(time).unwrap();
        };
        long_ago(&used, 1);
        for number in 0..MOST_FILES {
            let file = folder.path().join(format!("{number}.{ENDING}"));
            std::fs::write(&file, "").unwrap();
            long_ago(&file, 1000 + number as u64);
        }
        with_cloth(|cloth| drop(open(cloth)));
        make_room(folder.path());
        assert!(used.exists() && !folder.path().join(format!("0.{ENDING}")).exists());
    }

    #[test]
    fn the_cache_stays_small() {
        let folder = tempfile::tempdir().unwrap();
        for number in 0..MOST_FILES + 5 {
            std::fs::write(folder.path().join(format!("{number}.{ENDING}")), "").unwrap();
        }
        std::fs::write(folder.path().join("other.txt"), "").unwrap();
        make_room(folder.path());
        assert_eq!(folder.path().read_dir().unwrap().count(), MOST_FILES - 1 + 1);
        assert!(folder.path().join("other.txt").exists());
    }
}
