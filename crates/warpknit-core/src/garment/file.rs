//! A garment's file of any kind, as a mesh.
//!
//! In: a path. Out: an [`ObjMesh`], by the reader of what the file holds ([`Kind`]). `NAME@TIME` is
//! the USD file `NAME` at a time code of its stage, and [`moments`] lists the times of a file.

use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Read as _};
use std::path::{Path, PathBuf};

use super::error::GarmentError;
use super::garmentcode::SewingPattern;
use super::json::Json;
use super::kind::Kind;
use super::obj::{self, BUFFER, ObjMesh};
use super::{gltf, ply, usd};

/// Reads one file of any kind that is known.
pub(super) fn read(path: &Path) -> Result<ObjMesh, GarmentError> {
    let (file, time) = split(path);
    let mut input = open(&file)?;
    let wrong = |what| GarmentError::Mesh { path: path.to_path_buf(), what };
    // An error of the first bytes comes again when they are read, with its line.
    let kind = Kind::of(input.fill_buf().unwrap_or_default());
    if time.is_some() && kind != Kind::Usd {
        return Err(wrong(
            "only USD files have times: leave out the @ and what follows".to_owned(),
        ));
    }
    match kind {
        Kind::Obj => return obj::parse(input, path),
        Kind::Other(kind) => return Err(GarmentError::Kind { path: path.to_path_buf(), kind }),
        _ => {}
    }
    let bytes = whole(input, &file)?;
    let mesh = match kind {
        Kind::Ply => ply::parse(&bytes),
        Kind::Usd => usd::parse(&bytes, time),
        Kind::Glb => gltf::parse_binary(&bytes, &file),
        _ => gltf::parse_text(&bytes, &file),
    };
    mesh.map_err(wrong)
}

/// The sewing pattern that a file holds, if it is one of GarmentCode. One from a pipe is not found.
pub(super) fn pattern(path: &Path) -> Result<Option<SewingPattern>, GarmentError> {
    let mut input = open(path)?;
    if is_pipe(path) || Kind::of(input.fill_buf().unwrap_or_default()) != Kind::Json {
        return Ok(None);
    }
    // What is wrong with a JSON of another kind, its own reader says.
    let Ok(root) = Json::parse(&whole(input, path)?) else { return Ok(None) };
    SewingPattern::of(&root).map_err(|what| GarmentError::Mesh { path: path.to_path_buf(), what })
}

/// The frames that a file holds: a USD file whose mesh moves as `NAME@TIME` for each of its times, and
/// any other file as itself. A file that can't be read is itself too: reading it tells why. So is a
/// pipe, which can be read once only.
#[must_use]
pub fn moments(path: &Path) -> Vec<PathBuf> {
    let times = || {
        (!is_pipe(path)).then_some(())?;
        let mut input = open(path).ok()?;
        (Kind::of(input.fill_buf().ok()?) == Kind::Usd).then_some(())?;
        usd::times(&whole(input, path).ok()?).ok()
    };
    let times = times().unwrap_or_default();
    if times.len() < 2 {
        return vec![path.to_path_buf()];
    }
    let at = |time: &f64| {
        let mut name = path.as_os_str().to_owned();
        name.push(format!("@{time}"));
        name.into()
    };
    times.iter().map(at).collect()
}

/// The file that a path names: without its time, if it has one.
#[must_use]
pub fn file_of(path: &Path) -> PathBuf {
    split(path).0
}

/// A file and the time behind its name. A file whose own name has an @ is that file.
fn split(path: &Path) -> (PathBuf, Option<f64>) {
    let parts = path.to_str().filter(|_| !path.exists()).and_then(|text| text.rsplit_once('@'));
    let time = parts.and_then(|(name, time)| Some((name, time.parse::<f64>().ok()?)));
    match time.filter(|(_, time)| time.is_finite()) {
        Some((name, time)) => (name.into(), Some(time)),
        None => (path.to_path_buf(), None),
    }
}

/// Whether a path is a pipe or another thing that can't be read twice.
fn is_pipe(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|kind| !kind.is_file())
}

/// All bytes of a file.
fn whole(mut input: BufReader<File>, path: &Path) -> Result<Vec<u8>, GarmentError> {
    let mut bytes = Vec::new();
    input.read_to_end(&mut bytes).map_err(|reason| refused(path, reason))?;
    Ok(bytes)
}

/// The error for a file that the system refused to open.
fn refused(path: &Path, reason: io::Error) -> GarmentError {
    GarmentError::Open { path: path.to_path_buf(), reason }
}

/// Opens a file, but no folder.
fn open(path: &Path) -> Result<BufReader<File>, GarmentError> {
    // Opening a folder works on Unix and fails on Windows. Asking first gives the same message on
    // both.
    if std::fs::metadata(path).map_err(|reason| refused(path, reason))?.is_dir() {
        return Err(GarmentError::Directory { path: path.to_path_buf() });
    }
    Ok(BufReader::with_capacity(BUFFER, File::open(path).map_err(|reason| refused(path, reason))?))
}
