//! Numbers from the bytes of a file, each checked to lie within it.
//!
//! In: bytes, with the lowest of a number first or last, and a place. Out: numbers, or `None` past
//! the end. Garments in binary formats and tables of strained repeats are read through it.

/// A place in bytes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cursor<'a> {
    rest: &'a [u8],
    /// Whether numbers have their highest byte first.
    is_big: bool,
}

/// A kind of number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F16,
    F32,
    F64,
}

impl Number {
    /// The bytes that one takes.
    pub(crate) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 | Self::F16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

impl<'a> Cursor<'a> {
    /// The start of these bytes, whose numbers have their lowest byte first.
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, is_big: false }
    }

    /// The start of these bytes, whose numbers have their highest byte first.
    pub(crate) fn big(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, is_big: true }
    }

    /// A place in these bytes.
    pub(crate) fn at(bytes: &'a [u8], place: u64) -> Option<Self> {
        Some(Self::new(bytes.get(usize::try_from(place).ok()?..)?))
    }

    /// The bytes that are left.
    pub(crate) fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// The next `count` bytes.
    pub(crate) fn slice(&mut self, count: u64) -> Option<&'a [u8]> {
        let (taken, rest) = self.rest.split_at_checked(usize::try_from(count).ok()?)?;
        self.rest = rest;
        Some(taken)
    }

    /// The next `N` bytes, those of a number: the lowest first.
    pub(crate) fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.rest.split_first_chunk()?;
        self.rest = rest;
        let mut taken = *taken;
        if self.is_big {
            taken.reverse();
        }
        Some(taken)
    }

    pub(crate) fn u16(&mut self) -> Option<u16> {
        self.take().map(u16::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Option<u64> {
        self.take().map(u64::from_le_bytes)
    }

    pub(crate) fn i64(&mut self) -> Option<i64> {
        self.take().map(i64::from_le_bytes)
    }

    pub(crate) fn f32(&mut self) -> Option<f32> {
        self.take().map(f32::from_le_bytes)
    }

    /// A count of 32 bits.
    pub(crate) fn count(&mut self) -> Option<usize> {
        usize::try_from(self.u32()?).ok()
    }

    /// The next number of a kind.
    pub(crate) fn number(&mut self, kind: Number) -> Option<f64> {
        Some(match kind {
            Number::I8 => i8::from_le_bytes(self.take()?).into(),
            Number::U8 => u8::from_le_bytes(self.take()?).into(),
            Number::I16 => i16::from_le_bytes(self.take()?).into(),
            Number::U16 => self.u16()?.into(),
            Number::I32 => i32::from_le_bytes(self.take()?).into(),
            Number::U32 => self.u32()?.into(),
            Number::I64 => long(self.i64()?),
            Number::U64 => long(self.u64()?.cast_signed()),
            Number::F16 => half(self.u16()?),
            Number::F32 => self.f32()?.into(),
            Number::F64 => f64::from_le_bytes(self.take()?),
        })
    }

    /// The next `count` numbers of a kind. No count makes more memory than the bytes have.
    pub(crate) fn numbers(&mut self, kind: Number, count: usize) -> Option<Vec<f64>> {
        (count.checked_mul(kind.bytes())? <= self.rest.len()).then_some(())?;
        (0..count).map(|_| self.number(kind)).collect()
    }
}

/// A long number, to within what a float holds: indices of points are far smaller.
#[expect(clippy::cast_precision_loss, reason = "no index reaches 2^53")]
pub(crate) fn long(number: i64) -> f64 {
    number as f64
}

/// A float of 16 bits (IEEE 754).
fn half(bits: u16) -> f64 {
    let sign = if bits >> 15 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = (bits >> 10 & 31, f64::from(bits & 1023));
    sign * match exponent {
        0 => fraction * 2_f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * 2_f64.powi(i32::from(exponent) - 25),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_those_of_the_standard() {
        let pairs = [
            (0x0000, 0.0),
            (0x3C00, 1.0),
            (0xC000, -2.0),
            (0x3555, 0.333_251_953_125),
            (0x0001, 2_f64.powi(-24)),
            (0x7BFF, 65504.0),
            (0x7C00, f64::INFINITY),
        ];
        for (bits, number) in pairs {
            assert_eq!(half(bits), number, "{bits:#x}");
        }
        assert!(half(0x7C01).is_nan());
    }

    #[test]
    fn either_order_of_bytes_gives_the_numbers() {
        let kinds = [
            (Number::I8, vec![0xFE], -2.0),
            (Number::U8, vec![0xFE], 254.0),
            (Number::I16, (-300_i16).to_le_bytes().to_vec(), -300.0),
            (Number::U16, 60_000_u16.to_le_bytes().to_vec(), 60_000.0),
            (Number::I32, (-70_000_i32).to_le_bytes().to_vec(), -70_000.0),
            (Number::U32, 4_000_000_000_u32.to_le_bytes().to_vec(), 4e9),
            (Number::I64, (-5_i64).to_le_bytes().to_vec(), -5.0),
            (Number::U64, 5_u64.to_le_bytes().to_vec(), 5.0),
            (Number::F16, 0xC000_u16.to_le_bytes().to_vec(), -2.0),
            (Number::F32, 0.5_f32.to_le_bytes().to_vec(), 0.5),
            (Number::F64, 0.1_f64.to_le_bytes().to_vec(), 0.1),
        ];
        for (kind, mut bytes, number) in kinds {
            assert_eq!(bytes.len(), kind.bytes());
            assert_eq!(Cursor::new(&bytes).number(kind), Some(number));
            assert_eq!(Cursor::new(&bytes[1..]).number(kind), None);
            assert_eq!(Cursor::new(&bytes).numbers(kind, usize::MAX), None);
            bytes.reverse();
            assert_eq!(Cursor::big(&bytes).number(kind), Some(number));
        }
    }
}
