//! The mesh arguments of `drape`: one drape, or the frames of a sequence.
//!
//! In: paths of files, folders, and patterns such as `'frames/*.obj'`. Out: the files in the order of
//! their numbers, a USD file that moves once for each of its times, and the garment of the first one.

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use warpknit::garment::{Garment, ReadOptions, moments};
use warpknit::pipeline::{Motion, read_frames, read_garment};

/// The files of a garment.
#[derive(Debug)]
pub(super) struct Drapes {
    /// The flat pattern, if it is a file of its own.
    flat: Option<PathBuf>,
    /// The drapes, at least one.
    pub(super) frames: Vec<PathBuf>,
    /// Name of the output without its ending, if no output is named: the name of the only drape, or
    /// of the frames' folder.
    stem: PathBuf,
}

impl Drapes {
    /// Finds the files. If there are `others`, `first` is the flat pattern. If there are none, the
    /// flat pattern is in the vt of `first`, or of its first file if it is a folder or a pattern.
    pub(super) fn from_paths(first: &Path, others: &[PathBuf]) -> Result<Self> {
        let named = others.first().map_or(first, PathBuf::as_path);
        let named = if named.is_dir() { named.file_name() } else { named.file_stem() };
        let stem = PathBuf::from(named.unwrap_or_default());
        if others.is_empty() {
            return Ok(Self { flat: None, frames: moving(expanded(first)?), stem });
        }
        let mut frames = Vec::new();
        for path in others {
            let found = expanded(path)?;
            // The flat pattern may be in the folder of its drapes. It counts as a drape only if the
            // user named it as one.
            frames.extend(found.into_iter().filter(|frame| {
                frame == path || frame.canonicalize().ok() != first.canonicalize().ok()
            }));
        }
        if frames.is_empty() {
            bail!("{}: there is no drape beside the flat pattern", others[0].display());
        }
        Ok(Self { flat: Some(first.to_owned()), frames: moving(frames), stem })
    }

    /// All input files. They must not be overwritten.
    pub(super) fn inputs(&self) -> impl Iterator<Item = &Path> {
        self.flat.iter().chain(&self.frames).map(PathBuf::as_path)
    }

    /// Name of the output without its ending, if no output is named.
    pub(super) fn stem(&self) -> &Path {
        &self.stem
    }

    /// Reads the garment with its first drape. With `skip_bad`, a sequence starts at the first frame
    /// that can be read, and the errors of the frames before it are returned.
    pub(super) fn open(
        &self,
        options: &ReadOptions,
        skip_bad: bool,
    ) -> Result<(Garment, Option<Motion>)> {
        let (flat, frames) = (self.flat.as_deref(), &self.frames);
        if let [only] = frames.as_slice() {
            let garment = flat.map_or_else(
                || read_garment(only, None, options),
                |flat| read_garment(flat, Some(only), options),
            )?;
            return Ok((garment, None));
        }
        let mut bad = Vec::new();
        for (first, frame) in frames.iter().enumerate() {
            let opened = flat.map_or_else(
                || read_frames(frame, None, options),
                |flat| read_frames(flat, Some(frame), options),
            );
            match opened {
                Ok((garment, reader)) => return Ok((garment, Some(Motion { reader, first, bad }))),
                Err(error) if skip_bad => bad.push(error.to_string()),
                Err(error) => return Err(error.into()),
            }
        }
        bail!("none of {} frames can be read; error of the first: {}", frames.len(), bad[0])
    }
}

/// The files that a path stands for: the path itself, the `.obj` files of a folder, or the files that
/// match a pattern. They are ordered by the numbers in their names.
pub(super) fn expanded(path: &Path) -> Result<Vec<PathBuf>> {
    // A file whose name has brackets is a file, not a pattern.
    let pattern = path.to_str().filter(|text| text.contains(['*', '?', '[']) && !path.exists());
    let mut files: Vec<_> = match pattern {
        Some(pattern) => {
            let found = glob::glob(pattern)
                .with_context(|| format!("{pattern}: this pattern can't be understood"))?;
            found.collect::<Result<_, _>>()?
        }
        None if path.is_dir() => garment_files(path)?,
        None => Vec::new(),
    };
    if let (Some(pattern), true) = (pattern, files.is_empty()) {
        bail!("{pattern}: no file matches this pattern");
    }
    if files.is_empty() && path.is_dir() {
        bail!("{}: there is no .obj, .glb, .usd or .ply file in this folder", path.display());
    }
    if files.is_empty() {
        // A missing file is an error of the reader, which names it.
        files.push(path.to_owned());
    }
    files.sort_by(|a, b| by_numbers(&a.to_string_lossy(), &b.to_string_lossy()));
    Ok(files)
}

/// Files with the frames in them, where one has several.
fn moving(files: Vec<PathBuf>) -> Vec<PathBuf> {
    files.iter().flat_map(|file| moments(file)).collect()
}

/// Endings of garments' files.
const ENDINGS: [&str; 8] = ["obj", "glb", "gltf", "usd", "usda", "usdc", "usdz", "ply"];

/// The garments' files of a folder, in no order.
fn garment_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = folder.read_dir().and_then(Iterator::collect::<Result<Vec<_>, _>>);
    let entries = entries.with_context(|| format!("{}: can't be listed", folder.display()))?;
    let mut files = Vec::new();
    for path in entries.iter().map(std::fs::DirEntry::path) {
        let is_garment =
            |ending: &std::ffi::OsStr| ENDINGS.iter().any(|own| ending.eq_ignore_ascii_case(own));
        if path.extension().is_some_and(is_garment) && path.is_file() {
            files.push(path);
        }
    }
    Ok(files)
}

/// Natural order of names, so that `frame_2` comes before `frame_10`: runs of digits are compared as
/// numbers, everything else by its letters.
fn by_numbers(a: &str, b: &str) -> Ordering {
    let (mut a_rest, mut b_rest) = (a, b);
    while let (Some(x), Some(y)) = (a_rest.chars().next(), b_rest.chars().next()) {
        let order = if x.is_ascii_digit() && y.is_ascii_digit() {
            // Without leading zeros a longer number is larger. Numbers of any length work.
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
    // Names that differ only in leading zeros need an order too, or sorting would depend on the disk.
    a_rest.len().cmp(&b_rest.len()).then(a.cmp(b))
}

/// Takes the digits from the front of a text, and returns them without leading zeros.
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
