//! The mesh of a file, while its records are read.
//!
//! In: records. Out: an [`ObjMesh`], or a fault. Every number and every index is checked here. The
//! faster way for plain lines is in `plain`, which adds to the same arrays.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;

use super::super::error::quoted;
use super::names::Names;
use super::records::{split_keyword, tokens, without_comment};
use super::{Face, GarmentError, GarmentFault, ObjMesh, UNTEXTURED};
use crate::ids::index32;

/// Largest number of vertices or triangles. Three times as many still have 32-bit indices.
pub(super) const MAX_RECORDS: u64 = 1 << 30;

/// The records so far.
#[derive(Debug, Default)]
pub(super) struct Builder {
    pub(super) positions: Vec<DVec3>,
    pub(super) texture: Vec<DVec3>,
    faces: Vec<Face>,
    pub(super) triangles: Vec<[u32; 3]>,
    texture_triangles: Vec<[u32; 3]>,
    untextured: usize,
    names: Names,
    /// The corners of the current face, counted from 1 through the file: vertex and texture
    /// coordinate, 0 where it has none.
    pub(super) corners: Vec<[u32; 2]>,
    beyond_v: Forward,
    beyond_vt: Forward,
}

/// Indices that point forward, to records that come later in the file (`vt` after the faces, say).
/// Whether they are in range is known only at the end. Only those that exceed all before them are
/// kept, as (index, line): the first one out of range is always among them.
#[derive(Debug, Default)]
struct Forward(Vec<(u64, u64)>);

impl Forward {
    /// Notes an index if it points forward. `count` is the number of records so far.
    #[inline]
    fn note(&mut self, index: u64, count: usize, line: u64) {
        if index > count as u64 && self.0.last().is_none_or(|&(largest, _)| index > largest) {
            self.0.push((index, line));
        }
    }

    /// The first index beyond the `count` records of the whole file, as (line, index).
    fn first_beyond(&self, count: u64) -> Option<(u64, u64)> {
        self.0.iter().find(|&&(index, _)| index > count).map(|&(index, line)| (line, index))
    }
}

impl Builder {
    /// Reads one record. All but `v`, `vt`, `f`, `o` and `g` are skipped.
    pub(super) fn record(&mut self, record: &[u8], line: u64) -> Result<(), GarmentFault> {
        let (keyword, rest) = split_keyword(record);
        match keyword {
            b"v" => {
                let [x, y, z] = numbers("v", without_comment(rest), 3, 7)?;
                add(&mut self.positions, DVec3::new(x, y, z))?;
            }
            b"vt" => {
                let [u, v, _] = numbers("vt", without_comment(rest), 1, 3)?;
                add(&mut self.texture, DVec3::new(u, v, 0.0))?;
            }
            b"f" => self.face(without_comment(rest), line)?,
            b"o" => self.names.object(rest),
            b"g" => self.names.group(rest),
            _ => {}
        }
        Ok(())
    }

    /// Checks a face and adds it.
    fn face(&mut self, rest: &[u8], line: u64) -> Result<(), GarmentFault> {
        self.corners.clear();
        for token in tokens(rest) {
            let [v, vt] = corner(token)?;
            let v = v.ok_or_else(|| malformed_corner(token))?;
            let v = absolute("v", v, self.positions.len(), token)?;
            self.beyond_v.note(v, self.positions.len(), line);
            let vt = vt.map(|vt| absolute("vt", vt, self.texture.len(), token)).transpose()?;
            if let Some(vt) = vt {
                self.beyond_vt.note(vt, self.texture.len(), line);
            }
            // An index beyond 32 bits is out of range, which is an error at the end of the file.
            self.corners
                .push([v, vt.unwrap_or(0)].map(|index| u32::try_from(index).unwrap_or(u32::MAX)));
        }
        let corners = self.corners.len();
        if corners < 3 {
            return Err(GarmentFault::FewCorners { found: corners });
        }
        if (self.triangles.len() + corners - 2) as u64 > MAX_RECORDS {
            return Err(GarmentFault::TooMany { limit: MAX_RECORDS });
        }
        self.push_face(line);
        Ok(())
    }

    /// Notes which of the current face's indices point forward.
    #[inline]
    pub(super) fn note_corners(&mut self, line: u64) {
        for &[v, vt] in &self.corners {
            self.beyond_v.note(u64::from(v), self.positions.len(), line);
            self.beyond_vt.note(u64::from(vt), self.texture.len(), line);
        }
    }

    /// Adds the current face as a fan from its first corner.
    #[inline]
    pub(super) fn push_face(&mut self, line: u64) {
        let corners = &self.corners;
        let textured = corners.iter().all(|&[_, vt]| vt > 0);
        let label = self.names.label();
        self.faces.push(Face { line, corners: index32(corners.len()), label });
        let fan = || (1..corners.len() - 1).map(|i| [corners[0], corners[i], corners[i + 1]]);
        if textured && self.texture_triangles.len() < self.triangles.len() {
            // The first face with `vt`: those before have none.
            self.texture_triangles.resize(self.triangles.len(), [UNTEXTURED; 3]);
        }
        if textured || !self.texture_triangles.is_empty() {
            let corner = |[_, vt]: [u32; 2]| if textured { vt - 1 } else { UNTEXTURED };
            self.texture_triangles.extend(fan().map(|triangle| triangle.map(corner)));
        }
        if !textured {
            self.untextured += corners.len() - 2;
        }
        self.triangles.extend(fan().map(|triangle| triangle.map(|[v, _]| v - 1)));
    }

    /// The mesh, after checks that need the whole file. `lines` is the number of its lines.
    pub(super) fn into_mesh(self, lines: u64, path: &Path) -> Result<ObjMesh, GarmentError> {
        self.check_whole(lines, path)?;
        Ok(ObjMesh {
            positions: Arc::new(self.positions),
            texture: Arc::new(self.texture),
            faces: self.faces,
            triangles: Arc::new(self.triangles),
            texture_triangles: Arc::new(self.texture_triangles),
            untextured: self.untextured,
            labels: self.names.labels,
            names: self.names.names,
            unit: None,
        })
    }

    fn check_whole(&self, lines: u64, path: &Path) -> Result<(), GarmentError> {
        let path = path.to_path_buf();
        let (positions, texture) = (self.positions.len() as u64, self.texture.len() as u64);
        if positions == 0 && self.faces.is_empty() {
            return Err(GarmentError::NotObj { path, lines });
        }
        let beyond_v = self
            .beyond_v
            .first_beyond(positions)
            .map(|(line, index)| (line, "v", index, positions));
        let beyond_vt =
            self.beyond_vt.first_beyond(texture).map(|(line, index)| (line, "vt", index, texture));
        if let Some((line, record, index, count)) = beyond_v.into_iter().chain(beyond_vt).min() {
            let index = i64::try_from(index).unwrap_or(i64::MAX);
            return Err(GarmentError::Record {
                path,
                line,
                fault: GarmentFault::IndexRange { record, index, count },
            });
        }
        if self.faces.is_empty() {
            return Err(GarmentError::NoFaces { path, vertices: positions });
        }
        Ok(())
    }
}

/// Adds a point, unless there are too many.
fn add(points: &mut Vec<DVec3>, point: DVec3) -> Result<(), GarmentFault> {
    if points.len() as u64 >= MAX_RECORDS {
        return Err(GarmentFault::TooMany { limit: MAX_RECORDS });
    }
    points.push(point);
    Ok(())
}

/// Checks the numbers of a `v` or `vt`, and returns the first three, 0 where there are fewer.
/// Weights and colours are not used.
fn numbers(
    record: &'static str,
    rest: &[u8],
    least: usize,
    most: usize,
) -> Result<[f64; 3], GarmentFault> {
    let mut kept = [0.0; 3];
    let mut found = 0;
    for token in tokens(rest) {
        let value: Option<f64> = std::str::from_utf8(token).ok().and_then(|text| text.parse().ok());
        // Microsoft's older runtimes print a NaN as 1.#QNAN. It deserves the message for NaN.
        let microsoft_nan = token.windows(2).any(|pair| pair == b".#");
        match value {
            Some(value) if value.is_finite() => {
                if let Some(place) = kept.get_mut(found) {
                    *place = value;
                }
            }
            None if !microsoft_nan => {
                return Err(GarmentFault::Number { record, token: quoted(token) });
            }
            _ => return Err(GarmentFault::NotFinite { record, token: quoted(token) }),
        }
        found += 1;
    }
    if !(least..=most).contains(&found) {
        return Err(GarmentFault::NumberCount { record, found, least, most });
    }
    Ok(kept)
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
    count: usize,
    token: &[u8],
) -> Result<u64, GarmentFault> {
    let (from_end, count) = (index.unsigned_abs(), count as u64);
    match index {
        0 => Err(GarmentFault::IndexZero { token: quoted(token) }),
        1.. => Ok(from_end),
        _ if from_end <= count => Ok(count - from_end + 1),
        _ => Err(GarmentFault::IndexRange { record, index, count }),
    }
}
