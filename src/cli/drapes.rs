//! The drapes that `drape` is given: one, or the frames of a sequence, as files, folders and
//! patterns such as `'frames/*.obj'`.

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use warpknit::garment::{Frames, Garment, ReadOptions, read};
use warpknit::pipeline::Motion;

/// Which files hold a garment.
#[derive(Debug)]
pub(super) struct Drapes {
    /// The flat pattern, if it is a file of its own.
    flat: Option<PathBuf>,
    /// At least one.
    pub(super) frames: Vec<PathBuf>,
    /// What an output is called if none is named: the lone drape, or the folder of the frames.
    stem: PathBuf,
}

impl Drapes {
    /// A lone file has its flat pattern in its vt, and so has the first file of a lone folder or
    /// pattern; else the first path is the flat pattern.
    pub(super) fn from_paths(first: &Path, others: &[PathBuf]) -> Result<Self> {
        let named = others.first().map_or(first, PathBuf::as_path);
        let named = if named.is_dir() { named.file_name() } else { named.file_stem() };
        let stem = PathBuf::from(named.unwrap_or_default());
        if others.is_empty() {
            return Ok(Self { flat: None, frames: expanded(first)?, stem });
        }
        let mut frames = Vec::new();
        for path in others {
            let found = expanded(path)?;
            // The flat pattern may lie among its drapes, and is none of them unless it is named as
            // one.
            let is_flat = |frame: &PathBuf| {
                frame != path && frame.canonicalize().ok() == first.canonicalize().ok()
            };
            frames.extend(found.into_iter().filter(|frame| !is_flat(frame)));
        }
        if frames.is_empty() {
            bail!("{}: there is no drape beside the flat pattern", others[0].display());
        }
        Ok(Self { flat: Some(first.to_owned()), frames, stem })
    }

    /// Everything that is read, and must not be overwritten.
    pub(super) fn inputs(&self) -> impl Iterator<Item = &Path> {
        self.flat.iter().chain(&self.frames).map(PathBuf::as_path)
    }

    /// What an output is called if none is named.
    pub(super) fn stem(&self) -> &Path {
        &self.stem
    }

    /// Reads the garment as its first drape has it. Of a sequence drapes before it that can't be
    /// read are passed over, if they may be.
    pub(super) fn open(
        &self,
        options: &ReadOptions,
        skip_bad: bool,
    ) -> Result<(Garment, Option<Motion>)> {
        let (flat, frames) = (self.flat.as_deref(), &self.frames);
        if let [only] = frames.as_slice() {
            let garment = flat.map_or_else(
                || read(only, None, options),
                |flat| read(flat, Some(only), options),
            )?;
            return Ok((garment, None));
        }
        let mut bad = Vec::new();
        for (first, frame) in frames.iter().enumerate() {
            let opened = flat.map_or_else(
                || Frames::read(frame, None, options),
                |flat| Frames::read(flat, Some(frame), options),
            );
            match opened {
                Ok((garment, reader)) => return Ok((garment, Some(Motion { reader, first, bad }))),
                Err(error) if skip_bad => bad.push(error.to_string()),
                Err(error) => return Err(error.into()),
            }
        }
        bail!("not one of {} frames can be read; the first: {}", frames.len(), bad[0])
    }
}

/// The files that a path means: itself, the `.obj` files of a folder, or those that fit a pattern,
/// by the numbers in their names.
pub(super) fn expanded(path: &Path) -> Result<Vec<PathBuf>> {
    let pattern = path.to_str().filter(|text| text.contains(['*', '?', '[']) && !path.exists());
    let mut files: Vec<_> = match pattern {
        Some(pattern) => {
            let found = glob::glob(pattern)
                .with_context(|| format!("{pattern}: no pattern that can be understood"))?;
            found.collect::<Result<_, _>>()?
        }
        None if path.is_dir() => obj_files(path)?,
        None => Vec::new(),
    };
    if let (Some(pattern), true) = (pattern, files.is_empty()) {
        bail!("{pattern}: no file fits this pattern");
    }
    if files.is_empty() && path.is_dir() {
        bail!("{}: there is no .obj file in this folder", path.display());
    }
    if files.is_empty() {
        // What is missing is for its reader to name.
        files.push(path.to_owned());
    }
    files.sort_by(|a, b| by_numbers(&a.to_string_lossy(), &b.to_string_lossy()));
    Ok(files)
}

fn obj_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let named = || format!("{}: can't be listed", folder.display());
    let mut files = Vec::new();
    for entry in folder.read_dir().with_context(named)? {
        let path = entry.with_context(named)?.path();
        if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("obj"))
            && path.is_file()
        {
            files.push(path);
        }
    }
    Ok(files)
}

/// Orders names so that `frame_2` comes before `frame_10`: runs of digits by their number, all else
/// by its letters.
fn by_numbers(a: &str, b: &str) -> Ordering {
    let (mut a_rest, mut b_rest) = (a, b);
    while let (Some(x), Some(y)) = (a_rest.chars().next(), b_rest.chars().next()) {
        let order = if x.is_ascii_digit() && y.is_ascii_digit() {
            let (x, y) = (take_digits(&mut a_rest), take_digits(&mut b_rest));
            x.len().cmp(&y.len()).then(x.cmp(y))
        } else {
            (a_rest, b_rest) = (&a_rest[x.len_utf8()..], &b_rest[y.len_utf8()..]);
            x.cmp(&y)
        };
        if order.is_ne() {
            return order;
        }
    }
    // Names that differ in leading zeros alone still have an order.
    a_rest.len().cmp(&b_rest.len()).then(a.cmp(b))
}

/// The digits in front, without leading zeros.
fn take_digits<'a>(text: &mut &'a str) -> &'a str {
    let end = text.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(text.len());
    let (digits, rest) = text.split_at(end);
    *text = rest;
    digits.trim_start_matches('0')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_ordered_by_their_numbers() {
        let mut names = [
            "f_10.obj",
            "f_9.obj",
            "f_009.obj",
            "f_1b.obj",
            "f_1.obj",
            "e_99999999999999999999.obj",
            "f.obj",
        ];
        names.sort_by(|a, b| by_numbers(a, b));
        assert_eq!(
            names,
            [
                "e_99999999999999999999.obj",
                "f.obj",
                "f_1.obj",
                "f_1b.obj",
                "f_009.obj",
                "f_9.obj",
                "f_10.obj"
            ]
        );
    }

    #[test]
    fn folders_and_patterns_give_their_meshes_alone() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b10.obj", "b2.OBJ", "b2.mtl", "a.txt"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let named = |files: Vec<PathBuf>| {
            files.iter().map(|path| path.file_name().unwrap().to_owned()).collect::<Vec<_>>()
        };
        assert_eq!(named(expanded(folder.path()).unwrap()), ["b2.OBJ", "b10.obj"]);
        assert_eq!(
            named(expanded(&folder.path().join("b*.*")).unwrap()),
            ["b2.OBJ", "b2.mtl", "b10.obj"]
        );
        let missing = folder.path().join("c*.obj");
        let message = expanded(&missing).unwrap_err().to_string();
        assert!(message.contains(missing.to_str().unwrap()), "{message}");
        assert_eq!(expanded(&folder.path().join("c.obj")).unwrap(), [folder.path().join("c.obj")]);
    }
}
