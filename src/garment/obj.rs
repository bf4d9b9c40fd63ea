//! OBJ text to a triangulated mesh: a cleaning pass that streams into tobj.
//!
//! In: a path. Out: an [`ObjMesh`], its triangles in file order (a fan from each face's first
//! corner), positions and texture coordinates numbered apart, and for each face its line, its names
//! and whether all its corners have a `vt`.
//!
//! tobj 4.0.5 alone won't do: it fills a missing `vt` with a neighbour's, makes a triangle of `l 1
//! 2 3`, loses the first vertex to a byte order mark, accepts NaN, renumbers vertices at each
//! group, refuses `\` continuations and trailing comments, and its errors have no line. So
//! [`Cleaner`] stands in front of it. It joins continuations, drops everything but `v`, `vt` and
//! `f`, checks every number and every index with its line, makes indices positive, gives faces
//! without `vt` a dummy one (and remembers them), and hands tobj one clean group. Its memory is
//! bounded by the longest record ([`super::records`]) and the notes on faces, whatever the file's
//! length.
//!
//! Why tobj stays: on 81 MB of `v`, `vt` and `f` (a million triangles; 2 cores, 2026-11) the
//! cleaning pass takes 380 ms and both together 985 ms, so a reader of our own would save 600 ns a
//! triangle: 70 ms on the largest real garment, 115 200 triangles. No run that knits and draws such
//! a garment is held up by that, and nothing that the specification asks is out of reach.

use std::collections::HashMap;
use std::fs::File;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use glam::{DVec2, DVec3};

use super::error::{GarmentError, GarmentFault, quoted};
use super::records::{Records, Stop, split_keyword, tokens, without_comment};
use crate::ids::index32;

/// Most vertices or triangles: three times as many still have 32-bit indices.
const MOST: u64 = 1 << 30;
/// How much clean text is made ready for tobj at a time.
const CLEAN_CHUNK: usize = 1 << 15;

/// A mesh as the file has it, triangulated.
#[derive(Debug, Default)]
pub(super) struct ObjMesh {
    pub(super) positions: Vec<DVec3>,
    pub(super) texture: Vec<DVec2>,
    /// Faces as written, in file order.
    pub(super) faces: Vec<Face>,
    /// Triangles of all faces, indices into `positions`.
    pub(super) triangles: Vec<[u32; 3]>,
    /// The same triangles, indices into `texture`; empty where the file has no `vt`. Means nothing
    /// for untextured faces.
    pub(super) texture_triangles: Vec<[u32; 3]>,
    /// Object and group names; faces refer to them.
    pub(super) names: Vec<String>,
    /// `vt` records in the file, used or not.
    pub(super) texture_count: usize,
    /// The same for files whose faces have the same corners and names in the same order.
    pub(super) connectivity: u64,
    /// The file's own number of each of `positions`, from 0: they come in the order in which faces
    /// first use them, and unused ones are left out.
    pub(super) order: Vec<u32>,
}

impl ObjMesh {
    /// Whether every face has `vt`.
    pub(super) fn is_textured(&self) -> bool {
        self.faces.iter().all(|face| face.textured)
    }
}

/// A face as written.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face {
    pub(super) line: u64,
    pub(super) corners: u32,
    /// Whether every corner has a `vt`.
    pub(super) textured: bool,
    /// Index of its object's name.
    pub(super) object: Option<u32>,
    /// Index of its group's name.
    pub(super) group: Option<u32>,
}

/// Reads one OBJ file.
pub(super) fn read(path: &Path) -> Result<ObjMesh, GarmentError> {
    parse(open(path)?, path)
}

fn open(path: &Path) -> Result<BufReader<File>, GarmentError> {
    let refused = |reason| GarmentError::Open { path: path.to_path_buf(), reason };
    // Opening a folder works on Unix and fails on Windows: ask first, so that the message is the
    // same.
    if std::fs::metadata(path).map_err(refused)?.is_dir() {
        return Err(GarmentError::Directory { path: path.to_path_buf() });
    }
    Ok(BufReader::with_capacity(1 << 16, File::open(path).map_err(refused)?))
}

/// Reads the positions of an OBJ file alone, in its own order, where its faces have that
/// connectivity; nothing where they have another. It costs a third of [`read`].
pub(super) fn read_positions(
    path: &Path,
    connectivity: u64,
) -> Result<Option<Vec<DVec3>>, GarmentError> {
    let mut cleaner = Cleaner::new(open(path)?);
    cleaner.kept = Some(Vec::new());
    loop {
        cleaner.refill().map_err(|stop| stop.at(path))?;
        if cleaner.clean.is_empty() {
            break;
        }
    }
    cleaner.check_whole(path)?;
    let same = cleaner.notes.connectivity.finish() == connectivity;
    Ok(cleaner.kept.filter(|_| same))
}

/// Reads OBJ text; `path` is for messages alone.
pub(super) fn parse(input: impl BufRead, path: &Path) -> Result<ObjMesh, GarmentError> {
    let mut cleaner = Cleaner::new(input);
    let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
    let parsed =
        tobj::load_obj_buf(&mut cleaner, &options, |_| Err(tobj::LoadError::OpenFileFailed));
    if let Some(stop) = cleaner.stop.take() {
        return Err(stop.at(path));
    }
    cleaner.check_whole(path)?;
    let (models, _) =
        parsed.map_err(|reason| GarmentError::Parser { path: path.to_path_buf(), reason })?;
    let mesh = models.into_iter().next().expect("tobj makes one model of one group").mesh;
    Ok(cleaner.notes.into_mesh(mesh))
}

/// What the cleaning pass keeps besides the text it hands on.
#[derive(Debug, Default)]
struct Notes {
    faces: Vec<Face>,
    names: Vec<String>,
    positions: u64,
    texture: u64,
    triangles: u64,
    /// All faces' corners so far.
    connectivity: DefaultHasher,
    /// Their vertices as numbered in the file, from 1.
    corners: Vec<u32>,
}

impl Notes {
    fn into_mesh(self, mesh: tobj::Mesh) -> ObjMesh {
        let threes = |indices: &[u32]| {
            indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect::<Vec<_>>()
        };
        let triangles = threes(&mesh.indices);
        let expected: usize = self.faces.iter().map(|face| face.corners as usize - 2).sum();
        assert_eq!(
            triangles.len(),
            expected,
            "tobj fans every face of three or more corners into two fewer triangles"
        );
        ObjMesh {
            positions: mesh
                .positions
                .chunks_exact(3)
                .map(|p| DVec3::new(p[0], p[1], p[2]))
                .collect(),
            texture: mesh.texcoords.chunks_exact(2).map(|p| DVec2::new(p[0], p[1])).collect(),
            faces: self.faces,
            triangles,
            texture_triangles: threes(&mesh.texcoord_indices),
            names: self.names,
            texture_count: usize::try_from(self.texture).unwrap_or(usize::MAX),
            connectivity: self.connectivity.finish(),
            order: first_uses(&self.corners, self.positions),
        }
    }
}

/// The vertices, of so many, in the order in which corners first use them, from 0.
fn first_uses(corners: &[u32], vertices: u64) -> Vec<u32> {
    let mut used = vec![false; usize::try_from(vertices).expect("they have been read")];
    let is_new = |vertex: &u32| !std::mem::replace(&mut used[*vertex as usize], true);
    corners.iter().map(|vertex| vertex - 1).filter(is_new).collect()
}

/// Positive indices may point forward (`vt` after the faces), so they can be judged at the end
/// alone. Only those that exceed all before them are kept: the first one out of range is always
/// among them.
#[derive(Debug, Default)]
struct Forward(Vec<(u64, u64)>);

impl Forward {
    fn note(&mut self, index: u64, count: u64, line: u64) {
        if index > count && self.0.last().is_none_or(|&(largest, _)| index > largest) {
            self.0.push((index, line));
        }
    }

    /// The first index that the whole file doesn't hold: (line, index).
    fn first_beyond(&self, count: u64) -> Option<(u64, u64)> {
        self.0.iter().find(|&&(index, _)| index > count).map(|&(index, line)| (line, index))
    }
}

/// What the faces to come are called. A name is kept only once a face has it: a file may hold
/// millions that none has.
#[derive(Debug, Default)]
enum Label {
    #[default]
    None,
    Written(String),
    /// Its index in [`Notes::names`].
    Kept(u32),
}

impl Label {
    fn of(rest: &[u8]) -> Self {
        let words: Vec<_> = tokens(rest).map(String::from_utf8_lossy).collect();
        Self::Written(words.join(" "))
    }

    /// The name's index, for a face that has it.
    fn keep(&mut self, known: &mut HashMap<String, u32>, names: &mut Vec<String>) -> Option<u32> {
        if let Self::Written(name) = self {
            let next = index32(names.len());
            let index = *known.entry(std::mem::take(name)).or_insert_with_key(|name| {
                names.push(name.clone());
                next
            });
            *self = Self::Kept(index);
        }
        match self {
            Self::Kept(index) => Some(*index),
            _ => None,
        }
    }
}

/// OBJ text in, clean OBJ text out, as a [`BufRead`] for tobj.
struct Cleaner<R> {
    lines: Records<R>,
    clean: Vec<u8>,
    at: usize,
    notes: Notes,
    known: HashMap<String, u32>,
    object: Label,
    group: Label,
    forward_v: Forward,
    forward_vt: Forward,
    stop: Option<Stop>,
    /// Positions, if they are to be kept.
    kept: Option<Vec<DVec3>>,
    /// Object and group of the last face.
    named: Option<[Option<u32>; 2]>,
}

impl<R: BufRead> Cleaner<R> {
    fn new(input: R) -> Self {
        Self {
            lines: Records::new(input),
            clean: Vec::with_capacity(CLEAN_CHUNK + 4096),
            at: 0,
            notes: Notes::default(),
            known: HashMap::new(),
            object: Label::None,
            group: Label::None,
            forward_v: Forward::default(),
            forward_vt: Forward::default(),
            stop: None,
            kept: None,
            named: None,
        }
    }

    /// Cleans records until a chunk is ready or the file ends.
    fn refill(&mut self) -> Result<(), Stop> {
        self.clean.clear();
        self.at = 0;
        while self.clean.len() < CLEAN_CHUNK && self.lines.next()? {
            let record = std::mem::take(&mut self.lines.record);
            let result = self.record(&record).map_err(|fault| Stop::Fault(self.lines.first, fault));
            self.lines.record = record;
            result?;
        }
        Ok(())
    }

    /// Cleans one record; all but `v`, `vt`, `f`, `o` and `g` are skipped.
    fn record(&mut self, record: &[u8]) -> Result<(), GarmentFault> {
        let (keyword, rest) = split_keyword(record);
        match keyword {
            b"v" => {
                self.notes.positions += 1;
                self.numbers("v", without_comment(rest), 3, 7)
            }
            b"vt" => {
                self.notes.texture += 1;
                self.numbers("vt", without_comment(rest), 1, 3)
            }
            b"f" => self.face(without_comment(rest)),
            b"o" => {
                self.object = Label::of(rest);
                Ok(())
            }
            b"g" => {
                self.group = Label::of(rest);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Checks a `v` or `vt`, and hands on its first three or two numbers: weights, colours and a
    /// third `vt` play no part.
    fn numbers(
        &mut self,
        record: &'static str,
        rest: &[u8],
        least: usize,
        most: usize,
    ) -> Result<(), GarmentFault> {
        if self.notes.positions.max(self.notes.texture) > MOST {
            return Err(GarmentFault::TooMany { limit: MOST });
        }
        let kept = if record == "v" { 3 } else { 2 };
        self.clean.extend_from_slice(record.as_bytes());
        let mut found = 0;
        let mut position = DVec3::ZERO;
        for token in tokens(rest) {
            let value: Option<f64> =
                std::str::from_utf8(token).ok().and_then(|text| text.parse().ok());
            // 1.#QNAN is how Microsoft's older runtimes print a NaN.
            let microsoft_nan = token.windows(2).any(|pair| pair == b".#");
            match value {
                Some(value) if value.is_finite() => {
                    if found < 3 {
                        position[found] = value;
                    }
                }
                None if !microsoft_nan => {
                    return Err(GarmentFault::Number { record, token: quoted(token) });
                }
                _ => return Err(GarmentFault::NotFinite { record, token: quoted(token) }),
            }
            if found < kept {
                self.clean.push(b' ');
                self.clean.extend_from_slice(token);
            }
            found += 1;
        }
        if !(least..=most).contains(&found) {
            return Err(GarmentFault::NumberCount { record, found, least, most });
        }
        if record == "v"
            && let Some(positions) = &mut self.kept
        {
            positions.push(position);
        }
        // A one-dimensional `vt` is legal OBJ; tobj wants two numbers.
        self.clean.extend_from_slice(if found < kept { b" 0\n" } else { b"\n" });
        Ok(())
    }

    /// Checks a face and hands it on with positive indices.
    fn face(&mut self, rest: &[u8]) -> Result<(), GarmentFault> {
        let start = self.clean.len();
        let textured = self.corners(rest, true)?;
        if !textured {
            // tobj would fill a missing `vt` with the last corner's; a dummy on every corner has no
            // such history.
            self.clean.truncate(start);
            self.corners(rest, false)?;
        }
        let corners = tokens(rest).count();
        if corners < 3 {
            return Err(GarmentFault::FewCorners { found: corners });
        }
        self.notes.triangles += corners as u64 - 2;
        if self.notes.triangles > MOST {
            return Err(GarmentFault::TooMany { limit: MOST });
        }
        self.notes.connectivity.write_usize(corners);
        let names = [&mut self.object, &mut self.group]
            .map(|label| label.keep(&mut self.known, &mut self.notes.names));
        self.note_names(names);
        let [object, group] = names;
        self.notes.faces.push(Face {
            line: self.lines.first,
            corners: index32(corners),
            textured,
            object,
            group,
        });
        Ok(())
    }

    /// Faces are paired by their names first, so files whose faces have other names are connected
    /// otherwise.
    fn note_names(&mut self, names: [Option<u32>; 2]) {
        if self.named != Some(names) {
            self.named = Some(names);
            names
                .map(|name| name.map(|name| self.notes.names[name as usize].as_str()))
                .hash(&mut self.notes.connectivity);
        }
    }

    /// Writes a face's corners, each with its own `vt` or the dummy `vt` 1; whether all had one of
    /// their own.
    fn corners(&mut self, rest: &[u8], own_texture: bool) -> Result<bool, GarmentFault> {
        let mut textured = true;
        self.clean.push(b'f');
        for token in tokens(rest) {
            let [v, vt] = corner(token)?;
            let v = v.ok_or_else(|| GarmentFault::Corner { token: quoted(token) })?;
            let v = absolute("v", v, self.notes.positions, token)?;
            self.forward_v.note(v, self.notes.positions, self.lines.first);
            if own_texture {
                self.notes.connectivity.write_u64(v);
                // One beyond 32 bits is out of range, which is judged at the end.
                self.notes.corners.push(u32::try_from(v).unwrap_or(u32::MAX));
            }
            let vt = vt.map(|vt| absolute("vt", vt, self.notes.texture, token)).transpose()?;
            if let Some(vt) = vt {
                self.forward_vt.note(vt, self.notes.texture, self.lines.first);
            }
            textured &= vt.is_some();
            self.clean.push(b' ');
            push_index(&mut self.clean, v);
            self.clean.push(b'/');
            push_index(&mut self.clean, vt.filter(|_| own_texture).unwrap_or(1));
        }
        self.clean.push(b'\n');
        Ok(textured)
    }

    /// What can be judged at the end of the file alone.
    fn check_whole(&self, path: &Path) -> Result<(), GarmentError> {
        let path = path.to_path_buf();
        if self.lines.bytes == 0 {
            return Err(GarmentError::Empty { path });
        }
        let (positions, texture) = (self.notes.positions, self.notes.texture);
        if positions == 0 && self.notes.faces.is_empty() {
            return Err(GarmentError::NotObj { path, lines: self.lines.number });
        }
        let beyond_v = self
            .forward_v
            .first_beyond(positions)
            .map(|(line, index)| (line, "v", index, positions));
        let beyond_vt =
            self.forward_vt.first_beyond(texture).map(|(line, index)| (line, "vt", index, texture));
        if let Some((line, record, index, count)) = beyond_v.into_iter().chain(beyond_vt).min() {
            let index = i64::try_from(index).unwrap_or(i64::MAX);
            return Err(GarmentError::Record {
                path,
                line,
                fault: GarmentFault::IndexRange { record, index, count },
            });
        }
        if self.notes.faces.is_empty() {
            return Err(GarmentError::NoFaces { path, vertices: positions });
        }
        Ok(())
    }
}

impl<R: BufRead> Read for Cleaner<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(buffer)?;
        self.consume(count);
        Ok(count)
    }
}

impl<R: BufRead> BufRead for Cleaner<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.at == self.clean.len()
            && self.stop.is_none()
            && let Err(stop) = self.refill()
        {
            self.stop = Some(stop);
            return Err(io::Error::other("the cleaning pass stopped"));
        }
        Ok(&self.clean[self.at..])
    }

    fn consume(&mut self, count: usize) {
        self.at += count;
    }
}

/// A corner's vertex and texture indices as written. The normal's must be a number, but which one
/// plays no part.
fn corner(token: &[u8]) -> Result<[Option<i64>; 2], GarmentFault> {
    let malformed = || GarmentFault::Corner { token: quoted(token) };
    let mut parts = token.split(|&byte| byte == b'/');
    let mut indices = [None; 3];
    let mut count = 0;
    for part in parts.by_ref().take(3) {
        indices[count] =
            if part.is_empty() { None } else { Some(integer(part).ok_or_else(malformed)?) };
        count += 1;
    }
    // `1//` is written by real exporters, a bare `1/` only by a cut-off file.
    if parts.next().is_some() || indices[0].is_none() || (count == 2 && indices[1].is_none()) {
        return Err(malformed());
    }
    Ok([indices[0], indices[1]])
}

/// A whole number; one beyond 64 bits becomes the largest, which is out of range all the same.
fn integer(text: &[u8]) -> Option<i64> {
    let (negative, digits) = match text {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        digits => (false, digits),
    };
    if digits.is_empty() || !digits.iter().all(u8::is_ascii_digit) {
        return None;
    }
    let value = digits.iter().fold(0_i64, |value, &digit| {
        value.saturating_mul(10).saturating_add(i64::from(digit - b'0'))
    });
    Some(if negative { -value } else { value })
}

/// A written index as a positive one. Negative ones count back from the records so far; positive
/// ones are judged at the end.
fn absolute(
    record: &'static str,
    index: i64,
    count: u64,
    token: &[u8],
) -> Result<u64, GarmentFault> {
    let from_end = index.unsigned_abs();
    match index {
        0 => Err(GarmentFault::IndexZero { token: quoted(token) }),
        1.. => Ok(from_end),
        _ if from_end <= count => Ok(count - from_end + 1),
        _ => Err(GarmentFault::IndexRange { record, index, count }),
    }
}

fn push_index(text: &mut Vec<u8>, mut index: u64) {
    let start = text.len();
    while index > 0 {
        text.push(b'0' + u8::try_from(index % 10).expect("a digit"));
        index /= 10;
    }
    text[start..].reverse();
}
