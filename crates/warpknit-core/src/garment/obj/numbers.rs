//! Bytes to numbers: the decimal numbers and the corners of faces that nearly every file holds.
//!
//! In: bytes and a place among them. Out: the number with the place behind it, or nothing where the
//! text is of another form. Then the caller reads the record as a whole, slowly, with its messages.
//!
//! Method: up to 19 digits are gathered in an integer. If that is below 2^53 and the power of ten
//! at most 22, both are exact as 64-bit floats, and their product or quotient is rounded once. So
//! the result is that of the standard library, to the bit (Clinger, How to read floating point
//! numbers accurately, 1990). Other numbers are left to the standard library.

/// Powers of ten that are exact as 64-bit floats.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];
/// Most digits that are gathered: more could leave the range of 64-bit integers.
const MOST_DIGITS: usize = 19;
/// Most digits of an index that is read here: 9 of them fit 32 bits.
const MOST_INDEX_DIGITS: usize = 9;

/// A cursor on the text of a record.
#[derive(Clone, Copy, Debug)]
pub(super) struct RecordCursor<'a> {
    pub(super) text: &'a [u8],
    pub(super) at: usize,
}

impl RecordCursor<'_> {
    /// The byte at the cursor. A line feed where the text ends.
    #[inline]
    pub(super) fn byte(&self) -> u8 {
        self.text.get(self.at).copied().unwrap_or(b'\n')
    }

    /// Skips spaces and tabs.
    #[inline]
    pub(super) fn skip_blanks(&mut self) {
        while matches!(self.byte(), b' ' | b'\t') {
            self.at += 1;
        }
    }

    /// Whether a token ends at the cursor.
    #[inline]
    fn is_token_end(&self) -> bool {
        matches!(self.byte(), b' ' | b'\t' | b'\r' | b'\n')
    }

    /// Adds digits to `value`, and returns how many there were.
    #[inline]
    fn digits(&mut self, value: &mut u64) -> usize {
        let start = self.at;
        while let digit @ 0..=9 = self.byte().wrapping_sub(b'0') {
            // A value that overflows is refused by the number of its digits.
            *value = value.wrapping_mul(10).wrapping_add(u64::from(digit));
            self.at += 1;
        }
        self.at - start
    }

    /// A number that fills its token.
    #[inline]
    pub(super) fn number(&mut self) -> Option<f64> {
        let start = self.at;
        let negative = self.byte() == b'-';
        self.at += usize::from(negative);
        let mut digits = 0;
        let mut count = self.digits(&mut digits);
        let mut power = 0;
        if self.byte() == b'.' {
            self.at += 1;
            let decimals = self.digits(&mut digits);
            count += decimals;
            power = -i32::try_from(decimals).unwrap_or(i32::MAX);
        }
        let exponent_follows = matches!(self.byte(), b'e' | b'E');
        if count == 0 || count > MOST_DIGITS || exponent_follows || !self.is_token_end() {
            return self.standard_number(start);
        }
        self.exact(digits, power, negative).or_else(|| self.standard_number(start))
    }

    /// The number of these digits times a power of ten that is at most 1, if one rounding gives it.
    #[inline]
    fn exact(self, digits: u64, power: i32, negative: bool) -> Option<f64> {
        if digits >= 1 << 53 {
            return None;
        }
        let scale = POWERS.get(usize::try_from(-power).ok()?)?;
        #[expect(clippy::cast_precision_loss, reason = "below 2^53")]
        let value = digits as f64 / scale;
        Some(if negative { -value } else { value })
    }

    /// The number of the token at `start`, read by the standard library. Nothing if it is none, or
    /// not finite.
    #[cold]
    fn standard_number(&mut self, start: usize) -> Option<f64> {
        self.at = start;
        while !self.is_token_end() {
            self.at += 1;
        }
        let token = std::str::from_utf8(&self.text[start..self.at]).ok()?;
        token.parse().ok().filter(|value: &f64| value.is_finite())
    }

    /// A positive index. Nothing for a sign, or for so many digits that it may exceed 32 bits.
    #[inline]
    fn index(&mut self) -> Option<u32> {
        let mut value = 0;
        let count = self.digits(&mut value);
        let plain = (1..=MOST_INDEX_DIGITS).contains(&count) && value > 0;
        plain.then(|| u32::try_from(value).expect("nine digits fit 32 bits"))
    }

    /// A corner that fills its token: its vertex, and its texture coordinate or 0 where it has
    /// none.
    #[inline]
    pub(super) fn corner(&mut self) -> Option<[u32; 2]> {
        let vertex = self.index()?;
        let mut texture = 0;
        if self.byte() == b'/' {
            self.at += 1;
            let bare = self.byte() == b'/';
            if !bare {
                texture = self.index()?;
            }
            if self.byte() == b'/' {
                self.at += 1;
                // A normal is not used, but must be a number, and may be left out.
                self.digits(&mut 0);
            }
        }
        self.is_token_end().then_some([vertex, texture])
    }

    /// The place behind the line's end, over blanks. Nothing if something else is there, or if the
    /// text ends before it is known where the line does.
    #[inline]
    pub(super) fn end_line(mut self) -> Option<usize> {
        self.skip_blanks();
        match self.text.get(self.at..)? {
            [b'\n', ..] => Some(self.at + 1),
            [b'\r', b'\n', ..] => Some(self.at + 2),
            [b'\r', _, ..] => Some(self.at + 1),
            _ => None,
        }
    }
}

/// The place of the first line feed or carriage return. Eight bytes are examined at a time.
pub(super) fn line_end(text: &[u8]) -> Option<usize> {
    const ONES: u64 = 0x0101_0101_0101_0101;
    const HIGHS: u64 = 0x8080_8080_8080_8080;
    // The lowest of the high bits that this sets is that of the first zero byte (Warren, Hacker's
    // Delight, 2012, 6-1). Those above it may be wrong.
    let zero_bytes = |word: u64| word.wrapping_sub(ONES) & !word & HIGHS;
    let (words, rest) = text.as_chunks::<8>();
    for (i, word) in words.iter().enumerate() {
        let word = u64::from_le_bytes(*word);
        let found = zero_bytes(word ^ (ONES * u64::from(b'\n')))
            | zero_bytes(word ^ (ONES * u64::from(b'\r')));
        if found != 0 {
            return Some(8 * i + found.trailing_zeros() as usize / 8);
        }
    }
    let at = rest.iter().position(|byte| matches!(byte, b'\n' | b'\r'))?;
    Some(8 * words.len() + at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn number(text: &str) -> Option<f64> {
        let mut cursor = RecordCursor { text: text.as_bytes(), at: 0 };
        let value = cursor.number();
        assert!(value.is_none() || cursor.at == text.trim_end().len(), "{text}: {}", cursor.at);
        value
    }

    #[test]
    fn numbers_of_any_form_are_those_of_the_standard_library() {
        let texts = [
            "0",
            "-0",
            "-0.0",
            ".5",
            "5.",
            "-.25",
            "+1.5",
            "1e3",
            "1.8e-002",
            "-1.8E+02",
            "1e308",
            "5e-324",
            "9007199254740991",
            "9007199254740993",
            "9007199254740992.5",
            "0.1",
            "123456789012345678901234567890",
            "0.000000000000000000000000000001",
            "3.14159265358979323846",
            "00000000000000000000001.5",
            "1.7976931348623157e308",
        ];
        for text in texts {
            let expected: f64 = text.parse().unwrap();
            let found = number(text).unwrap_or_else(|| panic!("{text} is not read"));
            assert_eq!(found.to_bits(), expected.to_bits(), "{text}: {found}");
        }
        for text in ["", "-", ".", "-.", "1e", "e5", "0x10", "1,5", "nan", "inf", "1e999", "1#"] {
            assert_eq!(number(text), None, "{text}");
        }
    }

    #[test]
    fn corners_of_every_form() {
        let corner = |text: &str| RecordCursor { text: text.as_bytes(), at: 0 }.corner();
        for (text, expected) in [
            ("7", Some([7, 0])),
            ("7/8", Some([7, 8])),
            ("7//9", Some([7, 0])),
            ("7//", Some([7, 0])),
            ("7/8/9", Some([7, 8])),
            ("7/8/", Some([7, 8])),
            ("999999999", Some([999_999_999, 0])),
        ] {
            assert_eq!(corner(text), expected, "{text}");
        }
        // Faulty, or of a form that is left to the slow way.
        for text in ["", "0", "7/", "7/0", "-1", "+1", "7/8/9/1", "1.5", "a", "1000000000", "7/8/n"]
        {
            assert_eq!(corner(text), None, "{text}");
        }
    }

    #[test]
    fn line_ends_are_found_wherever_they_are() {
        for length in 0..40 {
            let mut text = vec![b'x'; length];
            assert_eq!(line_end(&text), None);
            for (at, end) in (0..length).zip([b'\n', b'\r'].into_iter().cycle()) {
                text[at] = end;
                text[length - 1] = b'\n';
                assert_eq!(line_end(&text), Some(at));
                text.fill(0x8a);
            }
        }
    }

    proptest! {
        #[test]
        fn any_float_is_read_to_the_bit(value in any::<f64>().prop_filter("finite", |v| v.is_finite()), places in 0_usize..12) {
            for text in [format!("{value}"), format!("{value:e}"), format!("{:.places$}", value % 1e6)] {
                let expected: f64 = text.parse().unwrap();
                prop_assert_eq!(number(&text).map(f64::to_bits), Some(expected.to_bits()), "{}", text);
            }
        }
    }
}
