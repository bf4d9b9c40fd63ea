//! Numbers as text, eight digits at a time: what most of an `.obj` is made of.
//!
//! In: numbers. Out: ASCII in a buffer that is used again. Decimals are fixed at 1e-4 (a tenth of a
//! micrometre where units are mm, about what an `f32` still holds a metre away from 0) and lose
//! their trailing zeros: fewer bytes than numbers that read back to the bit, and bytes are what
//! writing costs. Eight digits are found in one 64-bit word (P. Khuong, "How to print integers
//! really fast", 2017), whose leading zeros are shifted out, and always eight bytes are stored, so
//! that nothing branches on how long a number is.

use std::io::Write as _;

use super::buffer::Buffer;

/// Parts of a unit that are kept.
const PARTS: u64 = 10_000;
/// Digits after the point.
const PLACES: usize = 4;
/// The first number of more than eight digits.
const LARGE: u64 = 100_000_000;
/// '0' in every byte.
const ZEROS: u64 = 0x3030_3030_3030_3030;
/// Room of a line: nine indices of twenty digits and what is between them, or four numbers of
/// forty, and the word that is stored last.
pub(super) const LINE: usize = 256;

/// Where a line of text is made: no more than two letters, and three numbers or a triangle's
/// indices.
///
/// Functions that append to it take and return its length, which so stays in a register.
pub(super) type Line = [u8; LINE];

/// Appends the lowest `count` bytes of a word, eight at most.
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
    let at = word(line, at, u64::from(b'-'), usize::from(number < 0.0 && parts > 0));
    let (digits, count) = trimmed(parts / PARTS);
    let at = word(line, at, digits, count);
    // The fraction stands in the upper half of the word, behind four zeros; zeros at its own end
    // are the highest bytes.
    let digits = eight(parts % PARTS);
    let zeros = (digits.leading_zeros() as usize / 8).min(PLACES);
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

/// Appends what `fill` puts into a line and says the length of.
#[inline]
pub(super) fn add_line(text: &mut Buffer, fill: impl FnOnce(&mut Line) -> usize) {
    let line = text.grow(LINE).first_chunk_mut().expect("grown by as much");
    let length = fill(line);
    text.shrink(LINE - length);
}

/// Appends what hardly any garment has: numbers of more than eight digits, or none at all.
#[cold]
fn rare(line: &mut Line, at: usize, text: std::fmt::Arguments<'_>) -> usize {
    let mut rest = &mut line[at..];
    rest.write_fmt(text).expect("a line has room for what belongs in it");
    LINE - rest.len()
}

/// A whole number below [`LARGE`] as text in a word, and how many bytes of it.
fn trimmed(number: u64) -> (u64, usize) {
    let digits = eight(number);
    // The last digit stays, be it 0.
    let zeros = (digits | (1 << 56)).trailing_zeros() / 8;
    ((digits | ZEROS) >> (8 * zeros), 8 - zeros as usize)
}

/// The eight digits of a number below [`LARGE`], the first in the lowest byte.
fn eight(number: u64) -> u64 {
    // Two halves of four digits, then four quarters of two, then eight digits, each step for all of
    // them at once: x / 100 is x * 10486 >> 20 for x below 10000, and x / 10 is x * 103 >> 10 for x
    // below 100.
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
            prop_assert!((read - f64::from(number)).abs() <= 0.500_001e-4, "{} for {}", text, number);
            prop_assert!(!text.contains('.') || !text.ends_with('0'));
        }
    }
}
