//! Where a run's files go: none over an input or over another, each seen only when whole.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use super::RunError;
use crate::export::{ExportError, Output};

/// Refuses outputs that are inputs or named twice.
///
/// # Errors
/// [`RunError::NotDistinct`].
pub fn check_distinct<'a>(
    inputs: impl IntoIterator<Item = &'a Path>,
    outputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), RunError> {
    let mut taken: Vec<PathBuf> = inputs.into_iter().map(place).collect();
    for path in outputs {
        if taken.contains(&place(path)) {
            return Err(RunError::NotDistinct { path: path.to_owned() });
        }
        taken.push(place(path));
    }
    Ok(())
}

/// The names of `count` files in place of one with this ending: `NAME-001.png` and so on.
#[must_use]
pub fn numbered(path: &Path, ending: &str, count: u32) -> Vec<PathBuf> {
    let digits = count.to_string().len().max(3);
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let (stem, ending) = name.split_at(name.len() - ending.len());
    (1..=count)
        .map(|number| path.with_file_name(format!("{stem}-{number:0digits$}{ending}")))
        .collect()
}

/// Where a path leads, however it is spelled; a file that is not there yet is looked for in its
/// folder.
fn place(path: &Path) -> PathBuf {
    let in_folder = || {
        let folder =
            path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Some(folder.canonicalize().ok()?.join(path.file_name()?))
    };
    path.canonicalize().ok().or_else(in_folder).unwrap_or_else(|| path.to_owned())
}

/// A whole file of text, still under its temporary name.
///
/// # Errors
/// What the disk says.
pub fn text_file(path: &Path, text: &str) -> Result<Output, ExportError> {
    let mut output = Output::create(path)?;
    output.write_with(|file| file.write_all(text.as_bytes()))?;
    output.seal()
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
