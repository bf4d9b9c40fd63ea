//! Where a run's files go: none over an input or over another, each seen only when whole.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use warpknit::export::{ExportError, Output};

/// Refuses outputs that are inputs or named twice.
pub(super) fn check_distinct<'a>(
    inputs: impl IntoIterator<Item = &'a Path>,
    outputs: impl IntoIterator<Item = &'a Path>,
) -> Result<()> {
    let place = |path: &Path| path.canonicalize().unwrap_or_else(|_absent| path.to_owned());
    let mut taken: Vec<PathBuf> = inputs.into_iter().map(place).collect();
    for path in outputs {
        if taken.contains(&place(path)) {
            bail!("{}: this file is an input or another output; name another one with -o", path.display());
        }
        taken.push(place(path));
    }
    Ok(())
}

/// A whole file of text, still under its temporary name.
pub(super) fn text_file(path: &Path, text: &str) -> Result<Output, ExportError> {
    let mut output = Output::create(path)?;
    output.write_with(|file| file.write_all(text.as_bytes()))?;
    output.seal()
}
