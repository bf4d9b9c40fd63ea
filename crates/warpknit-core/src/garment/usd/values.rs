//! Values of a USD crate file (OpenUSD 24.08, `pxr/usd/usd/crateFile.cpp`, `crateValueInliners.h`).
//!
//! In: a value's word, which holds it or says where in the file it lies. Out: its numbers or texts,
//! or `None` for what is damaged or of no use to a mesh. Memory: an array's numbers, of which the
//! file must hold the bytes.

use super::UsdValue;
use super::packed::{long_numbers, numbers};
use super::samples::{Between, mixed};
use crate::cursor::{Cursor, Number, long};

/// Marks of a word: an array, a value in the word itself, coded numbers.
const ARRAY: u64 = 1 << 63;
const INLINED: u64 = 1 << 62;
const CODED: u64 = 1 << 61;
const PAYLOAD: u64 = (1 << 48) - 1;
/// Arrays shorter than this are plain, whatever their mark says.
const FEWEST_CODED: u64 = 16;

/// The file and its names.
#[derive(Debug)]
pub(super) struct Values<'a> {
    pub(super) bytes: &'a [u8],
    /// The middle number of the format's version.
    pub(super) minor: u8,
    /// The time whose values are wanted.
    pub(super) time: Option<f64>,
    pub(super) tokens: Vec<&'a str>,
    /// Tokens that are strings.
    pub(super) strings: Vec<u32>,
}

/// What a type of values is made of.
#[derive(Clone, Copy, Debug)]
enum Composition {
    /// So many numbers.
    Numbers(Number, usize),
    /// A square matrix of doubles.
    Matrix(usize),
    /// A rotation, its real part last in the file and first here.
    Turn(Number),
    Token,
    String,
    /// Tokens with their count.
    Tokens,
    Samples,
    Specifier,
    /// Doubles with their count, such as times.
    Doubles,
}

impl Composition {
    /// By its number in the file.
    fn of(number: u64) -> Option<Self> {
        use Number::{F16, F32, F64, I32, I64, U8, U32, U64};
        Some(match number {
            1 | 2 => Self::Numbers(U8, 1),
            3 => Self::Numbers(I32, 1),
            4 => Self::Numbers(U32, 1),
            5 => Self::Numbers(I64, 1),
            6 => Self::Numbers(U64, 1),
            7 => Self::Numbers(F16, 1),
            8 => Self::Numbers(F32, 1),
            9 => Self::Numbers(F64, 1),
            10 => Self::String,
            11 => Self::Token,
            13..=15 => Self::Matrix([2, 3, 4][usize::try_from(number - 13).ok()?]),
            16 => Self::Turn(F64),
            17 => Self::Turn(F32),
            18 => Self::Turn(F16),
            19..=30 => {
                let place = usize::try_from(number - 19).ok()?;
                Self::Numbers([F64, F32, F16, I32][place % 4], 2 + place / 4)
            }
            41 => Self::Tokens,
            42 => Self::Specifier,
            46 => Self::Samples,
            48 => Self::Doubles,
            _ => return None,
        })
    }
}

impl Values<'_> {
    /// The value of a word.
    pub(super) fn value(&self, word: u64) -> Option<UsdValue> {
        if word & ARRAY != 0 {
            return self.array(word);
        }
        if word & INLINED != 0 {
            return self.inlined(word);
        }
        let mut at = Cursor::at(self.bytes, word & PAYLOAD)?;
        let mut value = UsdValue::default();
        match Composition::of(word >> 48 & 0xFF)? {
            Composition::Numbers(number, width) => {
                value.numbers = at.numbers(number, width)?;
            }
            Composition::Matrix(width) => {
                value.numbers = at.numbers(Number::F64, width * width)?;
            }
            Composition::Turn(number) => {
                value.numbers = at.numbers(number, 4)?;
                value.numbers.rotate_right(1);
            }
            Composition::Tokens => {
                let count = at.u64()?;
                value.texts = self.texts(&mut at, count)?;
            }
            Composition::Doubles => {
                let count = usize::try_from(at.u64()?).ok()?;
                value.numbers = at.numbers(Number::F64, count)?;
            }
            Composition::Samples
            | Composition::Token
            | Composition::String
            | Composition::Specifier => return None,
        }
        Some(value)
    }

    /// The value that a word holds itself.
    fn inlined(&self, word: u64) -> Option<UsdValue> {
        let [a, b, c, d, ..] = word.to_le_bytes();
        let payload = u32::from_le_bytes([a, b, c, d]);
        let own = [a, b, c, d];
        let mut own = Cursor::new(&own);
        let mut value = UsdValue::default();
        match Composition::of(word >> 48 & 0xFF)? {
            Composition::Token => value.texts.push(self.token(payload)?),
            Composition::String => {
                let token = *self.strings.get(usize::try_from(payload).ok()?)?;
                value.texts.push(self.token(token)?);
            }
            Composition::Numbers(number, 1) => {
                // Those of 64 bits are in the word where 32 bits hold them.
                let short = match number {
                    Number::I64 => Number::I32,
                    Number::U64 => Number::U32,
                    Number::F64 => Number::F32,
                    own => own,
                };
                value.numbers.push(own.number(short)?);
            }
            Composition::Numbers(_, width) => {
                value.numbers = own.numbers(Number::I8, width)?;
            }
            // Its diagonal.
            Composition::Matrix(width) => {
                value.numbers = vec![0.0; width * width];
                for row in 0..width {
                    value.numbers[row * (width + 1)] = own.number(Number::I8)?;
                }
            }
            Composition::Specifier => value.numbers.push(payload.into()),
            Composition::Turn(_)
            | Composition::Tokens
            | Composition::Samples
            | Composition::Doubles => return None,
        }
        Some(value)
    }

    fn array(&self, word: u64) -> Option<UsdValue> {
        let place = word & PAYLOAD;
        let mut value = UsdValue::default();
        if place == 0 {
            return Some(value);
        }
        let mut at = Cursor::at(self.bytes, place)?;
        if self.minor < 5 {
            // The number of dimensions, which was always one.
            at.u32()?;
        }
        let count = if self.minor < 7 { at.u32()?.into() } else { at.u64()? };
        let is_coded = word & CODED != 0 && count >= FEWEST_CODED;
        match Composition::of(word >> 48 & 0xFF)? {
            Composition::Numbers(number, 1) if is_coded => {
                value.numbers = coded(number, &mut at, count)?;
            }
            Composition::Numbers(number, width) => {
                let count = usize::try_from(count.checked_mul(width as u64)?).ok()?;
                value.numbers = at.numbers(number, count)?;
            }
            Composition::Token => value.texts = self.texts(&mut at, count)?,
            _ => return None,
        }
        Some(value)
    }

    /// The times of the values over time, and the value of the one that is wanted. A jump counts from
    /// its own place.
    pub(super) fn sampled(&self, word: u64, is_smooth: bool) -> Option<(Vec<f64>, UsdValue)> {
        matches!(Composition::of(word >> 48 & 0xFF)?, Composition::Samples).then_some(())?;
        let jump = |place: u64| {
            let jump = Cursor::at(self.bytes, place)?.i64()?;
            place.checked_add_signed(jump)
        };
        let times_place = jump(word & PAYLOAD)?;
        let times = self.value(Cursor::at(self.bytes, times_place)?.u64()?)?.numbers;
        let values_place = jump(times_place.checked_add(8)?)?;
        let count = Cursor::at(self.bytes, values_place)?.u64()?;
        (count == times.len() as u64).then_some(())?;
        let value = |place: usize| {
            let place = values_place.checked_add(8 * (place as u64 + 1))?;
            self.value(Cursor::at(self.bytes, place)?.u64()?)
        };
        let Between { before, after, share } = Between::of(&times, self.time)?;
        let own = value(before)?;
        let is_between = is_smooth && share > 0.0;
        Some((times, if is_between { mixed(own, &value(after)?, share) } else { own }))
    }

    /// The token of that number.
    pub(super) fn token(&self, number: u32) -> Option<String> {
        self.tokens.get(usize::try_from(number).ok()?).map(|token| (*token).to_owned())
    }

    fn texts(&self, at: &mut Cursor<'_>, count: u64) -> Option<Vec<String>> {
        let mut own = Cursor::new(at.slice(count.checked_mul(4)?)?);
        let mut texts = Vec::new();
        while !own.rest().is_empty() {
            texts.push(self.token(own.u32()?)?);
        }
        Some(texts)
    }
}

/// Coded numbers: whole ones in a block, and floats as whole numbers or as places in a table.
fn coded(number: Number, at: &mut Cursor<'_>, count: u64) -> Option<Vec<f64>> {
    let block = |at: &mut Cursor<'_>| {
        let size = at.u64()?;
        numbers(at.slice(size)?, count)
    };
    let floats = |numbers: Vec<i32>| numbers.into_iter().map(f64::from).collect();
    match number {
        Number::I32 => block(at).map(floats),
        Number::U32 => block(at)
            .map(|own| own.into_iter().map(|number| number.cast_unsigned().into()).collect()),
        Number::I64 | Number::U64 => {
            let size = at.u64()?;
            let own = long_numbers(at.slice(size)?, count)?;
            Some(own.into_iter().map(long).collect())
        }
        Number::F16 | Number::F32 | Number::F64 => match at.take()? {
            [b'i'] => block(at).map(floats),
            [b't'] => {
                let size = at.count()?;
                let table = at.numbers(number, size)?;
                let place = |place: i32| table.get(usize::try_from(place).ok()?).copied();
                block(at)?.into_iter().map(place).collect()
            }
            _ => None,
        },
        Number::U8 | Number::I8 | Number::I16 | Number::U16 => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_hold_short_values() {
        let values =
            Values { bytes: &[], minor: 8, time: None, tokens: vec!["", "Mesh"], strings: vec![1] };
        let word = |kind: u64, payload: u64| INLINED | kind << 48 | payload;
        let numbers = |word| values.value(word).unwrap().numbers;
        assert_eq!(numbers(word(9, 0.5_f32.to_bits().into())), [0.5]);
        assert_eq!(numbers(word(3, 0xFFFF_FFFF)), [-1.0]);
        assert_eq!(numbers(word(24, 0x03_FE_01)), [1.0, -2.0, 3.0]);
        assert_eq!(numbers(word(15, 0x01_02_02_02))[15], 1.0);
        assert_eq!(values.value(word(11, 1)).unwrap().texts, ["Mesh"]);
        assert_eq!(values.value(word(10, 0)).unwrap().texts, ["Mesh"]);
        for wrong in [word(11, 2), word(10, 1), word(99, 0), 24 << 48, ARRAY | 24 << 48 | 1] {
            assert_eq!(values.value(wrong), None);
        }
    }
}
