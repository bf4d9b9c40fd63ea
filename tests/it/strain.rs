//! Strained cloth: repeats that are kept from one run to the next.

use std::path::{Path, PathBuf};

use assert_cmd::Command;

use crate::drape::mesh;

/// Drapes a coarse fabric, with a folder of caches of its own. Returns the bytes of the yarns.
fn drape(folder: &Path, flags: &[&str]) -> Vec<u8> {
    let mut command = Command::cargo_bin("warpknit").unwrap();
    command.current_dir(folder).env("XDG_CACHE_HOME", folder.join("cache"));
    command.arg("drape").args([mesh("pinch_flat.obj"), mesh("pinch_draped.obj")]);
    command.args(["--fabric", "jersey", "--wales-per-cm", "1", "-o", "yarns.csv", "--quiet"]);
    command.args(flags).assert().success();
    std::fs::read(folder.join("yarns.csv")).unwrap()
}

/// The only file of the cache.
fn kept(folder: &Path) -> PathBuf {
    let mut entries = std::fs::read_dir(folder.join("cache/warpknit")).unwrap();
    let file = entries.next().unwrap().unwrap().path();
    assert!(entries.next().is_none(), "a temporary file stays");
    file
}

#[test]
fn yarns_are_the_same_with_the_cache_without_it_and_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let without = drape(folder, &["--no-cache", "--threads", "1"]);
    assert!(!folder.join("cache").exists());
    let first = drape(folder, &["--threads", "2"]);
    let bytes = std::fs::read(kept(folder)).unwrap();
    let second = drape(folder, &["--threads", "2"]);
    assert!(without == first && first == second);
    assert_eq!(std::fs::read(kept(folder)).unwrap(), bytes);
    // A file that is cut short is solved anew and replaced.
    std::fs::write(kept(folder), &bytes[..bytes.len() / 2]).unwrap();
    assert!(drape(folder, &["--threads", "3"]) == first);
    assert_eq!(std::fs::read(kept(folder)).unwrap(), bytes);
}

#[test]
fn a_cache_that_cannot_be_written_is_no_error() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("cache"), "a file and not a folder").unwrap();
    assert!(!drape(folder.path(), &[]).is_empty());
}
