//! Bytes as text in the base64 alphabet (RFC 4648, section 4), as they are written.
//!
//! In: bytes in pieces of any length. Out: four characters for each three bytes, without line
//! breaks, and `=` at the end where the last three are not full.

use std::io::{self, Write};

const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// Writes what it is given as base64. [`Base64::finish`] writes the last characters.
#[derive(Debug)]
pub(super) struct Base64<W> {
    target: W,
    /// Bytes that wait for their third.
    open: Vec<u8>,
}

impl<W: Write> Base64<W> {
    pub(super) fn new(target: W) -> Self {
        Self { target, open: Vec::with_capacity(3) }
    }

    /// Writes what waits, filled up with `=`, and gives the target back.
    pub(super) fn finish(mut self) -> io::Result<W> {
        if !self.open.is_empty() {
            let mut three = [0; 3];
            three[..self.open.len()].copy_from_slice(&self.open);
            let mut four = characters(three);
            four[self.open.len() + 1..].fill(b'=');
            self.target.write_all(&four)?;
        }
        Ok(self.target)
    }
}

impl<W: Write> Write for Base64<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut text = Vec::with_capacity(bytes.len().div_ceil(3) * 4 + 4);
        let missing = if self.open.is_empty() { 0 } else { 3 - self.open.len() };
        let (first, rest) = bytes.split_at(missing.min(bytes.len()));
        self.open.extend_from_slice(first);
        if let Ok(three) = <[u8; 3]>::try_from(self.open.as_slice()) {
            text.extend(characters(three));
            self.open.clear();
        }
        let (threes, last) = rest.as_chunks::<3>();
        text.extend(threes.iter().flat_map(|three| characters(*three)));
        self.open.extend_from_slice(last);
        self.target.write_all(&text)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.target.flush()
    }
}

/// The four characters of three bytes, six bits each, the highest first.
fn characters([a, b, c]: [u8; 3]) -> [u8; 4] {
    let bits = u32::from_be_bytes([0, a, b, c]);
    [18, 12, 6, 0].map(|shift| ALPHABET[(bits >> shift & 63) as usize])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of RFC 4648, section 10, however the bytes come.
    #[test]
    fn the_standard_s_own_examples() {
        let examples = ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg==", "Zm9vYmE=", "Zm9vYmFy"];
        for (length, expected) in examples.into_iter().enumerate() {
            for piece in 1..=6 {
                let mut writer = Base64::new(Vec::new());
                let bytes = &b"foobar"[..length];
                bytes.chunks(piece).for_each(|bytes| writer.write_all(bytes).unwrap());
                assert_eq!(writer.finish().unwrap(), expected.as_bytes(), "{length} by {piece}");
            }
        }
    }
}
