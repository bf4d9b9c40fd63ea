//! The paths of a run's files. No file overwrites an input or another output.
//!
//! In: the paths that a user named. Out: an error, or the paths of numbered files.

use std::path::{Path, PathBuf};

use super::RunError;
use crate::garment::file_of;

/// Refuses outputs that are also inputs, and outputs that are named twice.
///
/// # Errors
/// [`RunError::NotDistinct`].
pub fn check_distinct<'a>(
    inputs: impl IntoIterator<Item = &'a Path>,
    outputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), RunError> {
    // Runs have few files, so a linear search is enough.
    let mut taken: Vec<PathBuf> = inputs.into_iter().map(|input| place(&file_of(input))).collect();
    for path in outputs {
        if taken.contains(&place(path)) {
            return Err(RunError::NotDistinct { path: path.to_owned() });
        }
        taken.push(place(path));
    }
    Ok(())
}

/// Numbered paths in place of one path with this ending: `NAME-001.png` and so on. The numbers have
/// at least three digits, so that names sort in order.
#[must_use]
pub fn numbered(path: &Path, ending: &str, count: u32) -> Vec<PathBuf> {
    let digits = count.to_string().len().max(3);
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let (stem, ending) = name.split_at(name.len() - ending.len());
    (1..=count)
        .map(|number| path.with_file_name(format!("{stem}-{number:0digits$}{ending}")))
        .collect()
}

/// The canonical form of a path, so that `a.png` and `./a.png` are the same file. A path that can't
/// be resolved stays as it is.
fn place(path: &Path) -> PathBuf {
    path.canonicalize().ok().or_else(|| new_place(path)).unwrap_or_else(|| path.to_owned())
}

/// The canonical form of a path to a file that does not exist yet: that of its folder, and its name.
fn new_place(path: &Path) -> Option<PathBuf> {
    // `canonicalize` refuses the empty path, which is the parent of a bare file name.
    let folder =
        path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Some(folder.canonicalize().ok()?.join(path.file_name()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_numbered_before_their_ending() {
        let named = |path, ending, count| numbered(Path::new(path), ending, count);
        assert_eq!(
            named("out/skirt.png", ".png", 2),
            [Path::new("out/skirt-001.png"), Path::new("out/skirt-002.png")]
        );
        assert_eq!(named("a.b.Curves.TXT", ".curves.txt", 1), [Path::new("a.b-001.Curves.TXT")]);
        assert_eq!(named("skirt.svg", ".svg", 1000)[999], Path::new("skirt-1000.svg"));
        assert_eq!(named("skirt.svg", ".svg", 1000)[0], Path::new("skirt-0001.svg"));
    }
}
