//! The fast way to read records: plain lines, where they lie in the buffer.
//!
//! In: text. Out: what its lines add to the mesh, and how many bytes they were. A plain line is
//! whole, holds no continuation and no comment behind a record, and its numbers have the forms of
//! [`RecordCursor`]. The first line of another kind ends the text, and nothing of it is kept.
//!
//! Cost: one pass over the bytes. Not promised: to take every sound line. What is left here the slow way
//! reads, to the same mesh.

use glam::DVec3;

use super::builder::{Builder, MAX_RECORDS};
use super::numbers::{RecordCursor, line_end};

impl Builder {
    /// Reads plain lines from the start of a text. Returns their bytes and their number. `before` is
    /// the number of lines before the text.
    pub(super) fn plain_lines(&mut self, text: &[u8], before: u64) -> (usize, u64) {
        let (mut done, mut lines) = (0, 0);
        while let Some(end) = self.plain_line(RecordCursor { text, at: done }, before + lines + 1) {
            done = end;
            lines += 1;
        }
        (done, lines)
    }

    /// Reads a line. Returns the place behind it, or nothing if it isn't plain.
    #[inline]
    fn plain_line(&mut self, mut cursor: RecordCursor<'_>, line: u64) -> Option<usize> {
        cursor.skip_blanks();
        match cursor.text.get(cursor.at..)? {
            [b'v', b' ' | b'\t', ..] => self.plain_position(cursor),
            [b'f', b' ' | b'\t', ..] => self.plain_face(cursor, line),
            [b'v', b't', b' ' | b'\t', ..] => self.plain_texture(cursor),
            // Names, and all that is no plain record of its keyword. Normals are not used.
            [b'v', after, ..] if *after != b'n' => None,
            [b'f' | b'g' | b'o', ..] => None,
            [b'\n' | b'\r', ..] => cursor.end_line(),
            // A comment, or a record that is not used. Neither is ever continued.
            [b'!'..=b'~', rest @ ..] => {
                cursor.at += 1 + line_end(rest)?;
                cursor.end_line()
            }
            _ => None,
        }
    }

    #[inline]
    fn plain_position(&mut self, mut cursor: RecordCursor<'_>) -> Option<usize> {
        cursor.at += 1;
        let (end, [x, y, z]) = coordinates::<3>(cursor, 3, 7)?;
        let fits = (self.positions.len() as u64) < MAX_RECORDS;
        fits.then(|| {
            self.positions.push(DVec3::new(x, y, z));
            end
        })
    }

    #[inline]
    fn plain_texture(&mut self, mut cursor: RecordCursor<'_>) -> Option<usize> {
        cursor.at += 2;
        let (end, [u, v]) = coordinates::<2>(cursor, 1, 3)?;
        let fits = (self.texture.len() as u64) < MAX_RECORDS;
        fits.then(|| {
            self.texture.push(DVec3::new(u, v, 0.0));
            end
        })
    }

    #[inline]
    fn plain_face(&mut self, mut cursor: RecordCursor<'_>, line: u64) -> Option<usize> {
        cursor.at += 1;
        self.corners.clear();
        let end = loop {
            cursor.skip_blanks();
            let mut behind = cursor;
            let Some(corner) = behind.corner() else { break cursor.end_line()? };
            self.corners.push(corner);
            cursor = behind;
        };
        let count = self.corners.len();
        let fits = count >= 3 && (self.triangles.len() + count) as u64 <= MAX_RECORDS;
        fits.then(|| {
            self.note_corners(line);
            self.push_face(line);
            end
        })
    }
}

/// Up to `most` numbers and the line's end. The first N are returned, 0 where there are fewer, with
/// the place behind the line. Nothing for fewer than `least` numbers, or more.
#[inline]
fn coordinates<const N: usize>(
    mut cursor: RecordCursor<'_>,
    least: usize,
    most: usize,
) -> Option<(usize, [f64; N])> {
    let mut kept = [0.0; N];
    for found in 0..=most {
        cursor.skip_blanks();
        if matches!(cursor.byte(), b'\n' | b'\r') {
            return (found >= least).then(|| Some((cursor.end_line()?, kept)))?;
        }
        let number = cursor.number()?;
        if let Some(place) = kept.get_mut(found) {
            *place = number;
        }
    }
    None
}
