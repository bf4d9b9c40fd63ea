//! OBJ text to a triangulated mesh: a cleaning pass that streams into tobj.
//!
//! In: a path. Out: an [`ObjMesh`]. Its triangles are in file order, a fan from each face's first
//! corner. Positions and texture coordinates are numbered independently. Each face has its line,
//! its names and whether all its corners have a `vt`.
//!
//! tobj 4.0.5 alone isn't enough. It fills a missing `vt` with a neighbour's. It makes a triangle
//! of `l 1 2 3`. It loses the first vertex to a byte order mark. It accepts NaN. It renumbers
//! vertices at each group. It refuses `\` continuations and trailing comments. Its errors have no
//! line.
//!
//! So [`Cleaner`] filters the text before tobj reads it. It joins continuations and drops
//! everything but `v`, `vt` and `f`. It checks every number and every index, with its line. It
//! makes indices positive. It gives faces without `vt` a dummy one and remembers them. tobj then
//! reads a single clean group. Memory is bounded by the longest record ([`super::records`]) and by
//! the notes on each face, whatever the length of the file.
//!
//! Why tobj stays: on 81 MB of `v`, `vt` and `f` (a million triangles; 2 cores, 2026-11) the
//! cleaning pass takes 380 ms and both together 985 ms. A parser of our own would save 600 ns a
//! triangle: 70 ms on the largest real garment, which has 115 200 triangles. Knitting and drawing
//! such a garment takes far longer.

use std::collections::HashMap;
use std::fs::File;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use glam::{DVec2, DVec3};

use super::error::{GarmentError, GarmentFault, quoted};
use super::records::{Records, Stop, split_keyword, tokens, without_comment};
use crate::ids::index32;

/// Largest number of vertices or triangles. Three times as many still have 32-bit indices.
const MAX_RECORDS: u64 = 1 << 30;
/// Size of a chunk of clean text for tobj, bytes. It fits in the L1 cache; much smaller chunks
/// would cost a call for every few records.
const CLEAN_CHUNK: usize = 1 << 15;

/// The mesh of a file, triangulated.
#[derive(Debug, Default)]
pub(super) struct ObjMesh {
    pub(super) positions: Vec<DVec3>,
    pub(super) texture: Vec<DVec2>,
    /// Faces as written, in file order.
    pub(super) faces: Vec<Face>,
    /// Triangles of all faces, indices into `positions`.
    pub(super) triangles: Vec<[u32; 3]>,
    /// The same triangles, as indices into `texture`. Empty where the file has no `vt`. Entries of
    /// untextured faces are meaningless.
    pub(super) texture_triangles: Vec<[u32; 3]>,
    /// Object and group names; faces refer to them.
    pub(super) names: Vec<String>,
    /// Number of `vt` records in the file, used or not.
    pub(super) texture_count: usize,
    /// Hash of all faces' corners and names, in order. Equal for files with the same connectivity.
    pub(super) connectivity: u64,
    /// The number in the file, from 0, of each of `positions`. tobj lists positions in the order in
    /// which faces first use them, and leaves unused ones out.
    pub(super) order: Vec<u32>,
}

impl ObjMesh {
    /// Whether every face has `vt`.
    pub(super) fn is_textured(&self) -> bool {
        self.faces.iter().all(|face| face.textured)
    }
}

/// A face as written in the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face {
    pub(super) line: u64,
    pub(super) corners: u32,
    /// Whether every corner has a `vt`.
    pub(super) textured: bool,
    /// Index of its object's name in [`ObjMesh::names`].
    pub(super) object: Option<u32>,
    /// Index of its group's name in [`ObjMesh::names`].
    pub(super) group: Option<u32>,
}

/// Reads one OBJ file.
pub(super) fn read(path: &Path) -> Result<ObjMesh, GarmentError> {
    parse(open(path)?, path)
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
    Ok(BufReader::with_capacity(1 << 16, File::open(path).map_err(|reason| refused(path, reason))?))
}

/// Reads only the positions of an OBJ file, in the file's order, if its faces have this
/// connectivity. Nothing if they have another. It takes a third of the time of [`read`].
pub(super) fn read_positions(
    path: &Path,
    connectivity: u64,
) -> Result<Option<Vec<DVec3>>, GarmentError> {
    let mut cleaner = Cleaner::new(open(path)?);
    cleaner.kept = Some(Vec::new());
    loop {
        cleaner.refill().map_err(|stop| stop.in_file(path))?;
        if cleaner.clean.is_empty() {
            break;
        }
    }
    cleaner.check_whole(path)?;
    let same = cleaner.notes.connectivity.finish() == connectivity;
    Ok(cleaner.kept.filter(|_| same))
}

/// Parses OBJ text. `path` is only for messages.
pub(super) fn parse(input: impl BufRead, path: &Path) -> Result<ObjMesh, GarmentError> {
    let mut cleaner = Cleaner::new(input);
    let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
    let parsed =
        tobj::load_obj_buf(&mut cleaner, &options, |_| Err(tobj::LoadError::OpenFileFailed));
    // The cleaning pass knows the line, so its error takes precedence over tobj's.
    if let Some(stop) = cleaner.stop.take() {
        return Err(stop.in_file(path));
    }
    cleaner.check_whole(path)?;
    let (models, _) =
        parsed.map_err(|reason| GarmentError::Parser { path: path.to_path_buf(), reason })?;
    let mesh = models.into_iter().next().expect("tobj makes one model of one group").mesh;
    Ok(cleaner.notes.into_mesh(mesh))
}

/// The data that the cleaning pass collects besides the text that it passes on.
#[derive(Debug, Default)]
struct Notes {
    faces: Vec<Face>,
    names: Vec<String>,
    positions: u64,
    texture: u64,
    triangles: u64,
    /// Hash of all faces so far.
    connectivity: DefaultHasher,
    /// The vertices of all corners so far, as numbered in the file, from 1.
    corners: Vec<u32>,
}

impl Notes {
    fn into_mesh(self, mesh: tobj::Mesh) -> ObjMesh {
        let triangles = triples(&mesh.indices);
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
            texture_triangles: triples(&mesh.texcoord_indices),
            names: self.names,
            texture_count: usize::try_from(self.texture).unwrap_or(usize::MAX),
            connectivity: self.connectivity.finish(),
            order: first_uses(&self.corners, self.positions),
        }
    }
}

/// Indices in groups of three: the corners of triangles.
fn triples(indices: &[u32]) -> Vec<[u32; 3]> {
    indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect()
}

/// The vertices that corners use, from 0, in the order in which they are first used. `vertices` is
/// the number of vertices in the file.
fn first_uses(corners: &[u32], vertices: u64) -> Vec<u32> {
    let mut used = vec![false; usize::try_from(vertices).expect("they have been read")];
    let mut order = Vec::new();
    for vertex in corners.iter().map(|vertex| vertex - 1) {
        if !std::mem::replace(&mut used[vertex as usize], true) {
            order.push(vertex);
        }
    }
    order
}

/// Indices that point forward, to records that come later in the file (`vt` after the faces, say).
/// Whether they are in range is known only at the end. Only those that exceed all before them are
/// kept, as (index, line): the first one out of range is always among them.
#[derive(Debug, Default)]
struct Forward(Vec<(u64, u64)>);

impl Forward {
    /// Notes an index if it points forward. `count` is the number of records so far.
    fn note(&mut self, index: u64, count: u64, line: u64) {
        if index > count && self.0.last().is_none_or(|&(largest, _)| index > largest) {
            self.0.push((index, line));
        }
    }

    /// The first index beyond the `count` records of the whole file, as (line, index).
    fn first_beyond(&self, count: u64) -> Option<(u64, u64)> {
        self.0.iter().find(|&&(index, _)| index > count).map(|&(index, line)| (line, index))
    }
}

/// The name of the following faces. It is stored only once a face has it: a file may hold millions
/// of names without faces.
#[derive(Debug, Default)]
enum Label {
    #[default]
    None,
    Written(String),
    /// Its index in [`Notes::names`].
    Kept(u32),
}

impl Label {
    /// The name written in an `o` or `g` record, blanks normalised.
    fn from_record(rest: &[u8]) -> Self {
        let words: Vec<_> = tokens(rest).map(String::from_utf8_lossy).collect();
        Self::Written(words.join(" "))
    }

    /// The index of the name, for a face that has it. The first such face stores it.
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

/// The cleaning pass: OBJ text in, clean OBJ text out, as a [`BufRead`] for tobj.
struct Cleaner<R> {
    lines: Records<R>,
    /// The current chunk of clean text, of which tobj has read the first `at` bytes.
    clean: Vec<u8>,
    at: usize,
    notes: Notes,
    /// Index of each name in [`Notes::names`].
    known: HashMap<String, u32>,
    object: Label,
    group: Label,
    forward_v: Forward,
    forward_vt: Forward,
    /// Why the pass ended early. tobj gets a plain I/O error instead.
    stop: Option<Stop>,
    /// All positions, if they are wanted.
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

    /// Cleans one record. All but `v`, `vt`, `f`, `o` and `g` are skipped.
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
                self.object = Label::from_record(rest);
                Ok(())
            }
            b"g" => {
                self.group = Label::from_record(rest);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Checks a `v` or `vt`, and passes on its first three or two numbers. Weights, colours and a
    /// third `vt` coordinate are not used.
    fn numbers(
        &mut self,
        record: &'static str,
        rest: &[u8],
        least: usize,
        most: usize,
    ) -> Result<(), GarmentFault> {
        if self.notes.positions.max(self.notes.texture) > MAX_RECORDS {
            return Err(GarmentFault::TooMany { limit: MAX_RECORDS });
        }
        let kept = if record == "v" { 3 } else { 2 };
        self.clean.extend_from_slice(record.as_bytes());
        let mut found = 0;
        let mut position = DVec3::ZERO;
        for token in tokens(rest) {
            let value: Option<f64> =
                std::str::from_utf8(token).ok().and_then(|text| text.parse().ok());
            // Microsoft's older runtimes print a NaN as 1.#QNAN. It deserves the message for NaN.
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
        // A one-dimensional `vt` is legal OBJ, but tobj needs two numbers.
        self.clean.extend_from_slice(if found < kept { b" 0\n" } else { b"\n" });
        Ok(())
    }

    /// Checks a face and passes it on with positive indices.
    fn face(&mut self, rest: &[u8]) -> Result<(), GarmentFault> {
        let start = self.clean.len();
        let textured = self.corners(rest, true)?;
        if !textured {
            // tobj would fill a missing `vt` with that of the corner before. So the face is written
            // again with a dummy `vt` on every corner.
            self.clean.truncate(start);
            self.corners(rest, false)?;
        }
        let corners = tokens(rest).count();
        if corners < 3 {
            return Err(GarmentFault::FewCorners { found: corners });
        }
        self.notes.triangles += corners as u64 - 2;
        if self.notes.triangles > MAX_RECORDS {
            return Err(GarmentFault::TooMany { limit: MAX_RECORDS });
        }
        // Corners are hashed one by one in `corners`; their number separates one face from the
        // next.
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

    /// Adds names to the connectivity hash where they change. Faces are paired by their names
    /// first, so files with other names have another connectivity.
    fn note_names(&mut self, names: [Option<u32>; 2]) {
        if self.named != Some(names) {
            self.named = Some(names);
            names
                .map(|name| name.map(|name| self.notes.names[name as usize].as_str()))
                .hash(&mut self.notes.connectivity);
        }
    }

    /// Writes a face's corners, each with its own `vt` or with the dummy `vt` 1. True if all
    /// corners have a `vt` of their own.
    fn corners(&mut self, rest: &[u8], own_texture: bool) -> Result<bool, GarmentFault> {
        let mut textured = true;
        self.clean.push(b'f');
        for token in tokens(rest) {
            let [v, vt] = corner(token)?;
            let v = v.ok_or_else(|| malformed_corner(token))?;
            let v = absolute("v", v, self.notes.positions, token)?;
            self.forward_v.note(v, self.notes.positions, self.lines.first);
            if own_texture {
                self.notes.connectivity.write_u64(v);
                // An index beyond 32 bits is out of range, which `check_whole` reports at the end.
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

    /// Checks that need the whole file.
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

/// A corner's vertex and texture indices as written. The normal's index must be a number, but is
/// not used.
fn corner(token: &[u8]) -> Result<[Option<i64>; 2], GarmentFault> {
    let mut parts = token.split(|&byte| byte == b'/');
    let mut indices = [None; 3];
    let mut count = 0;
    for part in parts.by_ref().take(3) {
        indices[count] = if part.is_empty() {
            None
        } else {
            Some(integer(part).ok_or_else(|| malformed_corner(token))?)
        };
        count += 1;
    }
    // Real exporters write `1//`. A bare `1/` occurs only in a truncated file.
    if parts.next().is_some() || indices[0].is_none() || (count == 2 && indices[1].is_none()) {
        return Err(malformed_corner(token));
    }
    Ok([indices[0], indices[1]])
}

/// The fault of a corner that is not of a known form.
fn malformed_corner(token: &[u8]) -> GarmentFault {
    GarmentFault::Corner { token: quoted(token) }
}

/// An integer. One beyond 64 bits becomes the largest, which is out of range too.
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

/// The positive form of an index. Negative ones count back from the records so far. Positive ones
/// are checked at the end of the file.
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

/// Appends an index as decimal digits.
fn push_index(text: &mut Vec<u8>, mut index: u64) {
    let start = text.len();
    while index > 0 {
        text.push(b'0' + u8::try_from(index % 10).expect("a digit"));
        index /= 10;
    }
    text[start..].reverse();
}
