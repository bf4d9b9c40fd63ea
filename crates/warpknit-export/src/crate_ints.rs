//! Whole numbers and text as a USD crate file stores them: integer coding in an LZ4 block.
//!
//! In: numbers in order, or bytes. Out: bytes of the file. A number is stored as its difference
//! from the one before, in two bits if that is the common difference and else in one, two or four
//! bytes more (OpenUSD 24.08, `pxr/usd/usd/integerCoding.cpp`). The crate format wants its
//! sections in LZ4 blocks. A block that only holds literals is valid, so nothing is searched for
//! repeats. Courses and wales of yarns take 0.4 bytes a point this way, where plain they take four.
//!
//! Not promised: small text. Names in a file take a few kilobytes whatever the cloth.

use std::io::{self, Write};

use super::spool::Spool;

/// Shorter arrays are plain, whatever their bit says.
pub(super) const FEWEST_CODED: usize = 16;
/// The most bytes in one block (`LZ4_MAX_INPUT_SIZE`).
const MOST_IN_BLOCK: u64 = 0x7E00_0000;

/// The bytes in front of `length` literals that make them a block, with the byte that says that
/// there is one block.
///
/// # Errors
/// Where they are more than a block holds.
pub(super) fn literals_head(length: u64) -> io::Result<Vec<u8>> {
    if length > MOST_IN_BLOCK {
        return Err(io::Error::other("an array of integers is longer than .usdc holds"));
    }
    let [short, ..] = length.min(15).to_le_bytes();
    let mut head = vec![0, short << 4];
    if let Some(rest) = length.checked_sub(15) {
        head.extend((0..rest / 255).map(|_| 255));
        let [last, ..] = (rest % 255).to_le_bytes();
        head.push(last);
    }
    Ok(head)
}

/// Bytes in a block.
///
/// # Errors
/// As of [`literals_head`].
pub(super) fn block(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut block = literals_head(bytes.len() as u64)?;
    block.extend_from_slice(bytes);
    Ok(block)
}

/// Numbers in a block: none for none.
///
/// # Errors
/// As of [`literals_head`].
pub(super) fn numbers_block(numbers: &[u32]) -> io::Result<Vec<u8>> {
    if numbers.is_empty() {
        return Ok(Vec::new());
    }
    // Indices mostly count up.
    let mut coder = Coder::new(1, Vec::new(), Vec::new());
    numbers.iter().try_for_each(|&number| coder.add(number.cast_signed()))?;
    coder.end_codes()?;
    let mut bytes = coder.common.to_le_bytes().to_vec();
    bytes.extend_from_slice(&coder.codes);
    bytes.extend_from_slice(&coder.differences);
    block(&bytes)
}

/// Codes numbers as they come.
#[derive(Debug)]
pub(super) struct Coder<W> {
    /// The difference that takes two bits.
    common: i32,
    previous: i32,
    /// How many numbers there were.
    count: u64,
    /// Codes that wait for the rest of their byte.
    waiting: u8,
    codes: W,
    differences: W,
}

impl<W: Write> Coder<W> {
    /// A coder without numbers. Codes and differences go to places of their own, since the codes
    /// come first in the file.
    pub(super) fn new(common: i32, codes: W, differences: W) -> Self {
        Self { common, previous: 0, count: 0, waiting: 0, codes, differences }
    }

    /// Adds a number.
    pub(super) fn add(&mut self, number: i32) -> io::Result<()> {
        let difference = number.wrapping_sub(self.previous);
        self.previous = number;
        let code = if difference == self.common {
            0
        } else if let Ok(byte) = i8::try_from(difference) {
            self.differences.write_all(&byte.to_le_bytes())?;
            1
        } else if let Ok(short) = i16::try_from(difference) {
            self.differences.write_all(&short.to_le_bytes())?;
            2
        } else {
            self.differences.write_all(&difference.to_le_bytes())?;
            3
        };
        self.waiting |= code << (2 * (self.count % 4));
        self.count += 1;
        if self.count.is_multiple_of(4) { self.end_byte() } else { Ok(()) }
    }

    /// Writes the codes that wait.
    fn end_codes(&mut self) -> io::Result<()> {
        if self.count.is_multiple_of(4) { Ok(()) } else { self.end_byte() }
    }

    fn end_byte(&mut self) -> io::Result<()> {
        self.codes.write_all(&[std::mem::take(&mut self.waiting)])
    }
}

/// An array of numbers that waits in spools until the array before it is written.
#[derive(Debug)]
pub(super) struct WaitingNumbers {
    coder: Coder<Spool>,
    /// The first ones as they are, for an array too short to be coded.
    first: Vec<i32>,
}

impl WaitingNumbers {
    /// An empty array, whose numbers mostly differ by `common`.
    pub(super) fn new(common: i32, codes: Spool, differences: Spool) -> Self {
        Self { coder: Coder::new(common, codes, differences), first: Vec::new() }
    }

    /// Adds numbers from their bytes.
    pub(super) fn add(&mut self, bytes: &[u8]) -> io::Result<()> {
        for bytes in bytes.as_chunks().0 {
            let number = i32::from_le_bytes(*bytes);
            if self.first.len() < FEWEST_CODED {
                self.first.push(number);
            }
            self.coder.add(number)?;
        }
        Ok(())
    }

    /// Writes the array and empties it. Returns how many bytes it took, and whether it is coded.
    pub(super) fn drain(&mut self, mut file: &mut dyn Write) -> io::Result<(u64, bool)> {
        let Self { coder, first } = self;
        coder.end_codes()?;
        let count = std::mem::take(&mut coder.count);
        coder.previous = 0;
        file.write_all(&count.to_le_bytes())?;
        let first = std::mem::take(first);
        if count < FEWEST_CODED as u64 {
            first.iter().try_for_each(|number| file.write_all(&number.to_le_bytes()))?;
            coder.codes.drain(&mut io::sink())?;
            coder.differences.drain(&mut io::sink())?;
            return Ok((8 + 4 * count, false));
        }
        let length = 4 + coder.codes.length() + coder.differences.length();
        let head = literals_head(length)?;
        let size = head.len() as u64 + length;
        file.write_all(&size.to_le_bytes())?;
        file.write_all(&head)?;
        file.write_all(&coder.common.to_le_bytes())?;
        coder.codes.drain(&mut file)?;
        coder.differences.drain(&mut file)?;
        Ok((16 + size, true))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The numbers of a block of literals.
    fn decoded(block: &[u8], count: usize) -> Vec<u32> {
        assert_eq!(block[0], 0, "one block");
        let (mut at, mut length) = (2, usize::from(block[1] >> 4));
        if length == 15 {
            loop {
                length += usize::from(block[at]);
                at += 1;
                if block[at - 1] != 255 {
                    break;
                }
            }
        }
        let bytes = &block[at..];
        assert_eq!(bytes.len(), length);
        let common = i32::from_le_bytes(bytes[..4].try_into().unwrap());
        let (codes, mut rest) = bytes[4..].split_at(count.div_ceil(4));
        let mut number = 0_i32;
        let mut numbers = Vec::new();
        for index in 0..count {
            let width = [0, 1, 2, 4][usize::from(codes[index / 4] >> (2 * (index % 4)) & 3)];
            let (bytes, behind) = rest.split_at(width);
            rest = behind;
            number = number.wrapping_add(match *bytes {
                [] => common,
                [a] => i32::from(a.cast_signed()),
                [a, b] => i32::from(i16::from_le_bytes([a, b])),
                [a, b, c, d] => i32::from_le_bytes([a, b, c, d]),
                _ => unreachable!(),
            });
            numbers.push(number.cast_unsigned());
        }
        assert!(rest.is_empty());
        numbers
    }

    proptest! {
        #[test]
        fn numbers_come_back(numbers in prop::collection::vec(
            prop_oneof![any::<u32>(), 0_u32..40, Just(u32::MAX)], 1..400
        )) {
            let block = numbers_block(&numbers).unwrap();
            prop_assert_eq!(decoded(&block, numbers.len()), numbers);
        }
    }

    #[test]
    fn waiting_numbers_are_coded_from_sixteen_on_and_then_empty() {
        let spool = || Spool::create(None).unwrap();
        let mut waiting = WaitingNumbers::new(0, spool(), spool());
        for count in [15_u32, 16, 3, 0, 1000] {
            let numbers: Vec<_> = (0..count).map(|i| i / 7 * 1000).collect();
            waiting.add(&numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<_>>()).unwrap();
            let mut file = Vec::new();
            let (bytes, coded) = waiting.drain(&mut file).unwrap();
            assert_eq!((bytes, coded), (file.len() as u64, count >= 16));
            assert_eq!(file[..8], u64::from(count).to_le_bytes());
            if coded {
                assert_eq!(file[8..16], (bytes - 16).to_le_bytes());
                assert_eq!(decoded(&file[16..], numbers.len()), numbers);
            } else {
                let plain: Vec<_> = numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
                assert_eq!(file[8..], plain);
            }
        }
        assert!(literals_head(MOST_IN_BLOCK + 1).is_err());
    }
}
