//! The records of an OBJ text, one at a time, for any line ends, continuations and comments.
//!
//! In: bytes. Out: `Records::record`, one record without leading blanks, with the line on which it
//! starts; or the bytes themselves, for whoever can read whole lines faster
//! ([`Records::take_lines`]). Memory is bounded by [`LONGEST_RECORD`]: gigabytes of blanks or comments are read
//! without being stored. Cost: one pass over the bytes.

use std::io::{self, BufRead};
use std::path::Path;

use super::super::error::{GarmentError, GarmentFault};
use super::numbers::line_end;

/// Longest accepted record with its continuations, bytes: enough for a polygon of 50 000 corners.
/// It bounds memory for files that are no text.
const LONGEST_RECORD: usize = 1 << 20;

/// Reasons why reading stopped, each with its line.
#[derive(Debug)]
pub(super) enum Stop {
    Fault(u64, GarmentFault),
    Input(u64, io::Error),
}

impl Stop {
    /// The error for it, in the file at `path`.
    pub(super) fn in_file(self, path: &Path) -> GarmentError {
        match self {
            Self::Fault(line, fault) => GarmentError::record(path, line, fault),
            Self::Input(line, reason) => {
                GarmentError::Read { path: path.to_path_buf(), line, reason }
            }
        }
    }
}

/// Records of a text: lines without leading blanks, without comment lines, and with the `\`
/// continuations of `v`, `vt` and `f` joined.
///
/// Other records aren't joined. A comment or a `mtllib` may end in the `\` of a Windows folder, and
/// joining it would lose the next line.
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
    /// Whether the last line ended in a carriage return, whose line feed is not a new line.
    after_return: bool,
}

impl<R: BufRead> Records<R> {
    pub(super) fn new(input: R) -> Self {
        Self { input, record: Vec::new(), first: 0, number: 0, bytes: 0, after_return: false }
    }

    /// Offers the text that is at hand to `take`, which gets it with the number of lines before it.
    /// It returns the bytes and the lines that it has taken: whole lines from the start.
    pub(super) fn take_lines(
        &mut self,
        take: impl FnOnce(&[u8], u64) -> (usize, u64),
    ) -> Result<(), Stop> {
        // The first line may begin with a byte order mark.
        if self.bytes == 0 {
            return Ok(());
        }
        let after_return = std::mem::take(&mut self.after_return);
        let buffer = filled(&mut self.input, self.number + 1)?;
        let start = usize::from(after_return && buffer.first() == Some(&b'\n'));
        // No line that is longer than a record may be is ever whole here.
        let text = &buffer[start..buffer.len().min(LONGEST_RECORD)];
        let (used, lines) = take(text, self.number);
        self.number += lines;
        self.bytes += (start + used) as u64;
        self.after_return = after_return && buffer.is_empty();
        self.input.consume(start + used);
        Ok(())
    }

    /// Reads the next record into `self.record`. False at the end of the file.
    pub(super) fn next(&mut self) -> Result<bool, Stop> {
        self.record.clear();
        loop {
            // Only the new line is examined. Examining the whole record each time would take
            // quadratic time for a record of a hundred thousand continuations.
            let from = self.record.len();
            let more = self.line()?;
            let line = self.record[from..].trim_ascii_end();
            // A `\` behind a `#` belongs to a comment and continues nothing.
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

    /// Appends the next line to `self.record`. False where the file ends. Blanks and comments
    /// before a record aren't stored, so gigabytes of them take no memory.
    fn line(&mut self) -> Result<bool, Stop> {
        self.number += 1;
        if self.record.is_empty() {
            self.first = self.number;
        }
        let (mut comment, mut has_text) = (false, false);
        loop {
            let buffer = filled(&mut self.input, self.number)?;
            if buffer.is_empty() {
                // Nothing behind the last line's end is no line.
                self.number -= u64::from(!has_text);
                return Ok(false);
            }
            // A line may end in LF, CR or CR LF. The LF may be in the next buffer, so a CR ends the
            // line at once and the LF is skipped later.
            let mut start = 0;
            if std::mem::take(&mut self.after_return) && buffer[0] == b'\n' {
                start = 1;
            }
            // A UTF-8 byte order mark would otherwise be part of the first keyword.
            if self.bytes == 0 && buffer.starts_with(b"\xEF\xBB\xBF") {
                start = 3;
            }
            let rest = &buffer[start..];
            let end = line_end(rest);
            let text = &rest[..end.unwrap_or(rest.len())];
            // The first text of a record tells whether the line is a comment.
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
            has_text |= used > start;
            self.bytes += used as u64;
            self.input.consume(used);
            if end.is_some() {
                return Ok(true);
            }
        }
    }
}

/// The bytes that are at hand, at least one unless the input has ended. `line` is for the error.
fn filled(input: &mut impl BufRead, line: u64) -> Result<&[u8], Stop> {
    while let Err(error) = input.fill_buf() {
        if error.kind() != io::ErrorKind::Interrupted {
            return Err(Stop::Input(line, error));
        }
    }
    // The bytes are there, so this asks the system for nothing.
    input.fill_buf().map_err(|error| Stop::Input(line, error))
}

/// The words of a record.
pub(super) fn tokens(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(|byte| is_blank(*byte)).filter(|token| !token.is_empty())
}

/// Whether a byte is a space, a tab or a line end.
fn is_blank(byte: u8) -> bool {
    byte == b' ' || (b'\t'..=b'\r').contains(&byte)
}

/// The first word of a record, and the rest. A `\` ends the word too: a record may be continued
/// right after its keyword.
pub(super) fn split_keyword(record: &[u8]) -> (&[u8], &[u8]) {
    let end =
        record.iter().position(|&byte| is_blank(byte) || byte == b'\\').unwrap_or(record.len());
    record.split_at(end)
}

/// The text before a `#`. The `#` of `1.#QNAN` begins no comment.
pub(super) fn without_comment(text: &[u8]) -> &[u8] {
    let end = (0..text.len()).find(|&i| text[i] == b'#' && (i == 0 || text[i - 1] != b'.'));
    &text[..end.unwrap_or(text.len())]
}
