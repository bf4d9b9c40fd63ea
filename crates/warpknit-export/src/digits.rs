//! Numbers as text, eight digits at a time: most of an `.obj` consists of them.
//!
//! In: numbers. Out: ASCII in a reused buffer. Decimals have a step of 1e-4, without trailing
//! zeros. Where units are mm that is 0.1 µm, about the spacing of `f32` a metre away from 0.
//! Numbers that read back to the bit would take more bytes, and the time to write a file goes with
//! its bytes.
//!
//! Method: Paul Khuong, "How to print integers really fast (with open source AppNexus code!)",
//! 2017. All eight digits of a number are computed in one 64-bit word, one a byte. Leading zeros
//! are shifted out, and all eight bytes are stored whatever the number's length, so nothing
//! branches on it.

use std::io::Write as _;

use super::buffer::Buffer;

/// Steps of the last decimal in a unit.
const PARTS: u64 = 10_000;
/// Digits after the point.
const PLACES: usize = 4;
/// The first number of more than eight digits.
const LARGE: u64 = 100_000_000;
/// '0' in every byte.
const ZEROS: u64 = 0x3030_3030_3030_3030;
/// Room of a line. The longest one has nine indices of twenty digits with a separator each, or four
/// numbers of forty characters. Behind it there must be room for the word that is stored last.
pub(super) const LINE: usize = 256;

/// A line of text that is being made: at most two letters, and then four numbers or a triangle's
/// indices.
///
/// Functions that append to it take its length and return the new one. So the length stays in a
/// register, where a field would be stored and loaded again for each number.
pub(super) type Line = [u8; LINE];

/// Appends the lowest `count` bytes of a word, eight at most. All eight are stored, and the next
/// call overwrites those that are too many.
#[inline]
pub(super) fn word(line: &mut Line, at: usize, word: u64, count: usize) -> usize {
    *line[at..].first_chunk_mut().expect("a line has room for what belongs in it") =
        word.to_le_bytes();
    at + count
}

/// Appends a whole number three times, each behind its separator.
#[inline]
pub(super) fn thrice(line: &mut Line, mut at: usize, number: u64, separators: [u8; 3]) -> usize {
    if number >= LARGE {
        let [a, b, c] = separators.map(char::from);
        return rare(line, at, format_args!("{a}{number}{b}{number}{c}{number}"));
    }
    let (digits, count) = trimmed(number);
    for separator in separators {
        at = word(line, at, u64::from(separator), 1);
        at = word(line, at, digits, count);
    }
    at
}

/// Appends a number to four decimals.
#[inline]
pub(super) fn decimal(line: &mut Line, at: usize, number: f32) -> usize {
    // Rounded half up on the magnitude. An `f32` times 10000 is exact in an `f64`.
    let magnitude = f64::from(number.abs()) * PARTS as f64 + 0.5;
    if magnitude.is_nan() || magnitude >= (LARGE * PARTS) as f64 {
        return rare(line, at, format_args!("{number}"));
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and 1e12, and rounded by the half above"
    )]
    let parts = magnitude as i64 as u64;
    // No sign for a number that rounds to 0.
    let at = word(line, at, u64::from(b'-'), usize::from(number < 0.0 && parts > 0));
    let (digits, count) = trimmed(parts / PARTS);
    let at = word(line, at, digits, count);
    // The four digits of the fraction are the upper half of the word: the lowest byte is the first
    // digit, and those before them are 0. Trailing zeros are the highest bytes, so the word's
    // leading zero bits count them.
    let digits = eight(parts % PARTS);
    let zeros = (digits.leading_zeros() as usize / 8).min(PLACES);
    // The fraction moves down behind the point. A number without one stores the word too, and takes
    // none of its bytes.
    let point = (((digits | ZEROS) >> 32) << 8) | u64::from(b'.');
    word(line, at, point, if zeros == PLACES { 0 } else { PLACES + 1 - zeros })
}

/// Appends numbers to four decimals to a text, with a byte between each two.
#[inline]
pub(super) fn numbers<const N: usize>(text: &mut Buffer, numbers: [f32; N], between: u8) {
    add_line(text, |line| {
        let mut at = 0;
        for (index, number) in numbers.into_iter().enumerate() {
            at = word(line, at, u64::from(between), usize::from(index > 0));
            at = decimal(line, at, number);
        }
        at
    });
}

/// Appends a line; `fill` writes it and returns its length.
#[inline]
pub(super) fn add_line(text: &mut Buffer, fill: impl FnOnce(&mut Line) -> usize) {
    let line = text.grow(LINE).first_chunk_mut().expect("grown by as much");
    let length = fill(line);
    text.shrink(LINE - length);
}

/// Appends by the standard library what hardly any garment has: numbers of more than eight digits,
/// infinities and NaN.
#[cold]
fn rare(line: &mut Line, at: usize, text: std::fmt::Arguments<'_>) -> usize {
    let mut rest = &mut line[at..];
    rest.write_fmt(text).expect("a line has room for what belongs in it");
    LINE - rest.len()
}

/// A whole number below [`LARGE`] as text in a word, and its length in bytes.
fn trimmed(number: u64) -> (u64, usize) {
    let digits = eight(number);
    // A bit in the highest byte keeps the last digit, even of 0.
    let zeros = (digits | (1 << 56)).trailing_zeros() / 8;
    ((digits | ZEROS) >> (8 * zeros), 8 - zeros as usize)
}

/// The eight digits of a number below [`LARGE`], each as a byte from 0 to 9, the first in the
/// lowest byte.
fn eight(number: u64) -> u64 {
    // Divide and conquer within the word (SIMD within a register): two halves of four digits, then
    // four quarters of two, then eight single ones. Each step divides all lanes by one
    // multiplication: x / 100 is x * 10486 >> 20 for x below 10000, and x / 10 is x * 103 >> 10 for
    // x below 100. The masks clear the bits that a shift brings in from the lane above.
    let halves = (number / 10_000) | ((number % 10_000) << 32);
    let hundreds = ((halves * 10_486) >> 20) & 0x7f_0000_007f;
    let quarters = hundreds | ((halves - 100 * hundreds) << 16);
    let tens = ((quarters * 103) >> 10) & 0x000f_000f_000f_000f;
    tens | ((quarters - 10 * tens) << 8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn line(fill: impl FnOnce(&mut Line) -> usize) -> String {
        let mut bytes = [b'?'; LINE];
        let length = fill(&mut bytes);
        String::from_utf8(bytes[..length].to_vec()).unwrap()
    }

    fn decimal(number: f32) -> String {
        line(|line| super::decimal(line, 0, number))
    }

    #[test]
    fn decimals_are_rounded_and_trimmed() {
        for (number, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (-0.00004, "0"),
            (0.00006, "0.0001"),
            (1.0, "1"),
            (-1.5, "-1.5"),
            (0.2, "0.2"),
            (0.01, "0.01"),
            (123.4567, "123.4567"),
            (-1234.05, "-1234.05"),
            (99_999_992.0, "99999992"),
            (-0.99996, "-1"),
            (1e9, "1000000000"),
            (f32::INFINITY, "inf"),
        ] {
            assert_eq!(decimal(number), text);
        }
    }

    #[test]
    fn a_line_has_room_for_the_longest_numbers() {
        let longest = line(|line| (0..3).fold(0, |at, _| super::decimal(line, at, -f32::MAX)));
        assert_eq!(longest, format!("{0}{0}{0}", -f32::MAX));
        let longest = line(|line| (0..3).fold(0, |at, _| thrice(line, at, u64::MAX, *b" //")));
        assert_eq!(longest, format!(" {0}/{0}/{0}", u64::MAX).repeat(3));
    }

    proptest! {
        #[test]
        fn whole_numbers_are_as_the_standard_library_prints_them(number in 0_u64..LARGE) {
            let (word, count) = trimmed(number);
            let expected = number.to_string();
            prop_assert_eq!(&word.to_le_bytes()[..count], expected.as_bytes());
        }

        #[test]
        fn decimals_read_back_within_half_a_part(number in -2e6_f32..2e6) {
            let text = decimal(number);
            let read: f64 = text.parse().unwrap();
            let error = (read - f64::from(number)).abs();
            prop_assert!(error <= 0.500_001e-4, "{} for {}", text, number);
            prop_assert!(!text.contains('.') || !text.ends_with('0'));
        }
    }
}
