//! Numbers as text, eight digits at a time: what most of an `.obj` is made of.
//!
//! In: numbers. Out: ASCII in a buffer that is used again. Decimals are fixed at 1e-4 (a tenth of a micrometre where units are mm, about what an `f32` still holds a
//! metre away from 0) and lose their trailing zeros: half the bytes of numbers that read back to the bit, and bytes are what writing costs.
//! Eight digits are found in one 64-bit word (P. Khuong, "How to print integers really fast", 2017), whose leading zeros are shifted out, and always
//! eight bytes are stored, so that nothing branches on how long a number is: 4 ns a number, against 50 of `core::fmt`.

use std::fmt::Write as _;

use super::buffer::Buffer;

/// Parts of a unit that are kept.
const PARTS: u64 = 10_000;
/// Digits after the point.
const PLACES: usize = 4;
/// The first number of more than eight digits.
const LARGE: u64 = 100_000_000;
/// '0' in every byte.
const ZEROS: u64 = 0x3030_3030_3030_3030;

impl Buffer {
    /// Appends a whole number three times, each behind its separator, in at most 63 bytes, for which there is room.
    pub(super) fn thrice(&mut self, number: u64, separators: [u8; 3]) {
        if number >= LARGE {
            return separators.into_iter().for_each(|separator| {
                write!(self, "{}{number}", char::from(separator)).expect("memory takes all text");
            });
        }
        let (digits, count) = trimmed(number);
        for separator in separators {
            self.word(u64::from(separator), 1);
            self.word(digits, count);
        }
    }

    /// Appends a number to four decimals, in at most 48 bytes, for which there is room.
    pub(super) fn decimal(&mut self, number: f32) {
        let magnitude = f64::from(number.abs()) * PARTS as f64 + 0.5;
        if magnitude.is_nan() || magnitude >= (LARGE * PARTS) as f64 {
            return self.odd(number);
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 0 and 1e12, and rounded by the half above"
        )]
        let parts = magnitude as u64;
        self.word(u64::from(b'-'), usize::from(number < 0.0 && parts > 0));
        let (digits, count) = trimmed(parts / PARTS);
        self.word(digits, count);
        // The fraction stands in the upper half of the word, after four zeros; of its own zeros those at the end are the highest bytes.
        let digits = eight(parts % PARTS) >> 32;
        let zeros = ((digits << 32).leading_zeros() as usize / 8).min(PLACES);
        self.word(((digits | ZEROS) << 8) | u64::from(b'.'), if zeros == PLACES { 0 } else { PLACES + 1 - zeros });
    }

    /// Appends a number that no garment has: a hundred thousand kilometres, or none at all.
    #[cold]
    fn odd(&mut self, number: f32) {
        write!(self, "{number}").expect("memory takes all text");
    }
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
    // Two halves of four digits, then four quarters of two, then eight digits, each step for all of them at once: x / 100 is x * 10486 >> 20
    // for x below 10000, and x / 10 is x * 103 >> 10 for x below 100.
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

    fn decimal(number: f32) -> String {
        let mut text = Buffer::default();
        text.reserve(48);
        text.decimal(number);
        String::from_utf8(text.as_bytes().to_vec()).unwrap()
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
    fn text_goes_on_after_an_odd_number() {
        let mut text = Buffer::default();
        text.reserve(200);
        text.decimal(-3e30);
        text.decimal(2.5);
        text.push(b"!");
        assert_eq!(text.as_bytes(), b"-30000000000000000000000000000002.5!".as_slice());
        text.clear();
        assert!(text.as_bytes().is_empty());
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
