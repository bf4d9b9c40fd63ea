//! Blocks and coded numbers of a USD crate file: LZ4 (Collet, "LZ4 Block Format Description"), and
//! whole numbers as differences in two bits and some bytes (OpenUSD 24.08,
//! `pxr/base/tf/fastCompression.cpp` and `pxr/usd/usd/integerCoding.cpp`).
//!
//! In: bytes of the file. Out: bytes and numbers, or `None` for what is damaged. Memory: what a
//! block truly holds, up to [`MOST_BYTES`]; a count that claims more makes none.

use crate::cursor::Cursor;

/// The most bytes that a block may unpack to: over 60 million corners of faces.
const MOST_BYTES: usize = 1 << 28;
/// The fewest bytes that a copy has.
const SHORTEST_COPY: usize = 4;

/// What a block holds. Its first byte is the number of its pieces, or 0 for one that fills it.
pub(super) fn unpacked(packed: &[u8]) -> Option<Vec<u8>> {
    let mut block = Cursor::new(packed);
    let [pieces] = block.take()?;
    let mut bytes = Vec::new();
    if pieces == 0 {
        unpack(block.rest(), &mut bytes)?;
    }
    for _ in 0..pieces {
        let length = block.u32()?;
        // A piece never copies from the one before.
        let mut piece = Vec::new();
        unpack(block.slice(length.into())?, &mut piece)?;
        bytes.extend_from_slice(&piece);
        (bytes.len() <= MOST_BYTES).then_some(())?;
    }
    Some(bytes)
}

/// Unpacks one LZ4 block.
fn unpack(packed: &[u8], bytes: &mut Vec<u8>) -> Option<()> {
    let mut block = Cursor::new(packed);
    loop {
        let [token] = block.take()?;
        let literals = length(&mut block, token >> 4)?;
        bytes.extend_from_slice(block.slice(literals as u64)?);
        // The last literals have no copy behind them.
        if block.rest().is_empty() {
            return (bytes.len() <= MOST_BYTES).then_some(());
        }
        let distance = usize::from(block.u16()?);
        let copied = length(&mut block, token & 15)? + SHORTEST_COPY;
        let start = bytes.len().checked_sub(distance).filter(|_| distance > 0)?;
        (bytes.len() + copied <= MOST_BYTES).then_some(())?;
        // A copy may reach into itself.
        for at in start..start + copied {
            bytes.push(bytes[at]);
        }
    }
}

/// A length of four bits, which goes on in further bytes where they are all set.
fn length(block: &mut Cursor<'_>, short: u8) -> Option<usize> {
    let mut length = usize::from(short);
    if short == 15 {
        loop {
            let [more] = block.take()?;
            length += usize::from(more);
            if more != 255 {
                break;
            }
        }
    }
    Some(length)
}

/// `count` numbers of 32 bits from a block.
pub(super) fn numbers(packed: &[u8], count: u64) -> Option<Vec<i32>> {
    let numbers = coded::<4>(packed, count, [0, 1, 2, 4])?;
    // The lower half is what 32-bit differences add up to, whether they wrap or not.
    Some(numbers.into_iter().map(low_half).collect())
}

/// `count` numbers of 64 bits from a block.
pub(super) fn long_numbers(packed: &[u8], count: u64) -> Option<Vec<i64>> {
    coded::<8>(packed, count, [0, 2, 4, 8])
}

#[expect(clippy::cast_possible_truncation, reason = "the lower half is meant")]
fn low_half(number: i64) -> i32 {
    number as i32
}

/// Numbers of `N` bytes, whose differences have so many bytes by their codes.
fn coded<const N: usize>(packed: &[u8], count: u64, widths: [u64; 4]) -> Option<Vec<i64>> {
    if count == 0 {
        return Some(Vec::new());
    }
    let bytes = unpacked(packed)?;
    let mut differences = Cursor::new(&bytes);
    let common = signed(differences.slice(N as u64)?);
    // So a false count makes no memory: its codes aren't there.
    let codes = differences.slice(count.div_ceil(4))?;
    let mut number = 0_i64;
    let mut numbers = Vec::new();
    for index in 0..usize::try_from(count).ok()? {
        let code = codes[index / 4] >> (2 * (index % 4)) & 3;
        let difference = match widths[usize::from(code)] {
            0 => common,
            width => signed(differences.slice(width)?),
        };
        number = number.wrapping_add(difference);
        numbers.push(number);
    }
    Some(numbers)
}

/// A number from up to eight bytes, the lowest first.
fn signed(bytes: &[u8]) -> i64 {
    let is_negative = bytes.last().is_some_and(|byte| *byte >= 0x80);
    let mut whole = [if is_negative { 0xFF } else { 0 }; 8];
    whole[..bytes.len()].copy_from_slice(bytes);
    i64::from_le_bytes(whole)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn literals_copies_and_pieces_are_unpacked() {
        // "abc", three more by a copy that reaches into itself, then "z" as the last literals.
        let block = [0x33, b'a', b'b', b'c', 3, 0, 0x10, b'z'];
        let whole = [&[0][..], &block].concat();
        assert_eq!(unpacked(&whole).unwrap(), b"abcabcabcaz");
        let two = [&[2, 8, 0, 0, 0][..], &block, &[8, 0, 0, 0], &block].concat();
        assert_eq!(unpacked(&two).unwrap(), b"abcabcabcazabcabcabcaz");
        for end in 0..two.len() {
            assert_eq!(unpacked(&two[..end]), None, "{end}");
        }
        assert_eq!(unpacked(&[0, 0x10, b'a', 0, 0, 0]), None, "a copy from nowhere");
        assert_eq!(unpacked(&[0, 0x10, b'a', 2, 0, 0]), None, "a copy from before the start");
    }

    #[test]
    fn numbers_are_sums_of_their_differences() {
        // Common difference 1; codes 0, 1, 2, 3; differences -2, 300, 100 000.
        let plain = [1, 0, 0, 0, 0b1110_0100, 0xFE, 0x2C, 1, 0xA0, 0x86, 1, 0];
        let block = [&[0, 0xC0][..], &plain].concat();
        assert_eq!(numbers(&block, 4).unwrap(), [1, -1, 299, 100_299]);
        assert_eq!(numbers(&block, 5), None);
        assert_eq!(numbers(&block, u64::MAX), None);
        let plain = [1, 0, 0, 0, 0, 0, 0, 0, 0b0100, 0xFE, 0xFF];
        let block = [&[0, 0xB0][..], &plain].concat();
        assert_eq!(long_numbers(&block, 2).unwrap(), [1, -1]);
    }

    proptest! {
        #[test]
        fn anything_is_read_or_refused(block in prop::collection::vec(any::<u8>(), 0..60), count in any::<u32>()) {
            let _numbers = numbers(&block, count.into());
            let _numbers = long_numbers(&[&[0], &block[..]].concat(), count.into());
        }
    }
}
