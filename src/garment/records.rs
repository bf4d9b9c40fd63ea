//! The records of an OBJ text, one at a time, whatever its line ends, continuations and comments.
//!
//! In: bytes. Out: `Records::record`, one record without leading blanks, with the line on which it
//! starts. Memory is bounded by `LONGEST_RECORD`: gigabytes of blanks or comments pass through
//! without being kept.

use std::io::{self, BufRead};
use std::path::Path;

use super::error::{GarmentError, GarmentFault};

/// Longest record that is accepted, in bytes, continuations joined: a polygon of 50 000 corners.
const LONGEST_RECORD: usize = 1 << 20;
/// Why the cleaning pass stopped.
#[derive(Debug)]
pub(super) enum Stop {
    Fault(u64, GarmentFault),
    Input(u64, io::Error),
}

impl Stop {
    pub(super) fn at(self, path: &Path) -> GarmentError {
        match self {
            Self::Fault(line, fault) => GarmentError::record(path, line, fault),
            Self::Input(line, reason) => {
                GarmentError::Read { path: path.to_path_buf(), line, reason }
            }
        }
    }
}

/// Records of a text: lines without leading blanks and comment lines, `\` continuations of `v`,
/// `vt` and `f` joined.
///
/// Other records aren't joined: a comment or a `mtllib` may well end in the `\` of a Windows
/// folder, and would swallow the next line.
pub(super) struct Records<R> {
    input: R,
    /// The current record.
    pub(super) record: Vec<u8>,
    /// Line on which `record` starts, from 1.
    pub(super) first: u64,
    /// Lines begun so far.
    pub(super) number: u64,
    /// Bytes read so far.
    pub(super) bytes: u64,
    after_return: bool,
}

impl<R: BufRead> Records<R> {
    pub(super) fn new(input: R) -> Self {
        Self { input, record: Vec::new(), first: 0, number: 0, bytes: 0, after_return: false }
    }

    /// Puts the next record in `self.record`; false at the end of the file.
    pub(super) fn next(&mut self) -> Result<bool, Stop> {
        self.record.clear();
        loop {
            // Only the new line is looked at: a record of a hundred thousand continuations must not
            // take their square in time.
            let from = self.record.len();
            let more = self.line()?;
            let line = self.record[from..].trim_ascii_end();
            if line.last() == Some(&b'\\')
                && matches!(split_keyword(&self.record).0, b"v" | b"vt" | b"f")
                && without_comment(line).len() == line.len()
            {
                let end = from + line.len() - 1;
                self.record.truncate(end);
                self.record.push(b' ');
                if more {
                    continue;
                }
            }
            if !more || !self.record.is_empty() {
                return Ok(!self.record.is_empty());
            }
        }
    }

    /// Appends the next line to `self.record`; false where the file ends. Blanks and comments
    /// before a record aren't kept, so gigabytes of them take no memory.
    fn line(&mut self) -> Result<bool, Stop> {
        self.number += 1;
        if self.record.is_empty() {
            self.first = self.number;
        }
        let mut comment = false;
        loop {
            let number = self.number;
            let buffer = match self.input.fill_buf() {
                Ok(buffer) => buffer,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(Stop::Input(number, error)),
            };
            if buffer.is_empty() {
                return Ok(false);
            }
            let mut start = 0;
            if std::mem::take(&mut self.after_return) && buffer[0] == b'\n' {
                start = 1;
            }
            if self.bytes == 0 && buffer.starts_with(b"\xEF\xBB\xBF") {
                start = 3;
            }
            let rest = &buffer[start..];
            let end = rest.iter().position(|&byte| byte == b'\n' || byte == b'\r');
            let text = &rest[..end.unwrap_or(rest.len())];
            let kept = if self.record.is_empty() { text.trim_ascii_start() } else { text };
            comment |= self.record.is_empty() && kept.first() == Some(&b'#');
            if !comment {
                if self.record.len() + kept.len() > LONGEST_RECORD {
                    return Err(Stop::Fault(
                        self.first,
                        GarmentFault::LineTooLong { limit: LONGEST_RECORD },
                    ));
                }
                self.record.extend_from_slice(kept);
            }
            self.after_return = end.is_some_and(|end| rest[end] == b'\r');
            let used = start + text.len() + usize::from(end.is_some());
            self.bytes += used as u64;
            self.input.consume(used);
            if end.is_some() {
                return Ok(true);
            }
        }
    }
}

/// The words of a record.
pub(super) fn tokens(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(|byte| is_blank(*byte)).filter(|token| !token.is_empty())
}

fn is_blank(byte: u8) -> bool {
    byte == b' ' || (b'\t'..=b'\r').contains(&byte)
}

/// A record's first word, and the rest. A `\` ends it too: the record may continue right after its
/// keyword.
pub(super) fn split_keyword(record: &[u8]) -> (&[u8], &[u8]) {
    let end =
        record.iter().position(|&byte| is_blank(byte) || byte == b'\\').unwrap_or(record.len());
    record.split_at(end)
}

/// Text up to a `#`, but not up to the `#` of `1.#QNAN`.
pub(super) fn without_comment(text: &[u8]) -> &[u8] {
    let end = (0..text.len()).find(|&i| text[i] == b'#' && (i == 0 || text[i - 1] != b'.'));
    &text[..end.unwrap_or(text.len())]
}
