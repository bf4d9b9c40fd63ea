//! Conversions between kinds of numbers, each with a name that says what it may lose.
//!
//! In: a number. Out: the same in another type. They stand here once, so that the lints against
//! lossy casts hold everywhere else. All are inlined: kernels of other crates call them for each
//! pixel and each vertex.

/// The nearest `f32`: as precise as files, textures and renderers need.
#[inline]
#[must_use]
#[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
pub fn narrow(number: f64) -> f32 {
    number as f32
}

/// A count as `f32`. Exact up to 2^24; counts of pixels beyond are rounded far below what an eye
/// sees.
#[inline]
#[must_use]
#[expect(
    clippy::cast_precision_loss,
    reason = "counts of pixels: rounding is far below what is seen"
)]
pub fn float(count: usize) -> f32 {
    count as f32
}

/// A count as `f64`, exact up to 2^52.
#[inline]
#[must_use]
#[expect(clippy::cast_precision_loss, reason = "sides of pictures are far under 2^52")]
pub fn double(count: usize) -> f64 {
    count as f64
}

/// The whole part; 0 where the number is negative or not a number.
#[inline]
#[must_use]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
pub fn whole(number: f32) -> usize {
    number as usize
}

/// The whole part; 0 where the number is negative or not a number.
#[inline]
#[must_use]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
pub fn whole_f64(number: f64) -> usize {
    number as usize
}

/// The nearest byte, 0 or 255 beyond its range.
///
/// ```
/// use warpknit_core::number::byte;
/// assert_eq!([-3.0, 12.5, 900.0].map(byte), [0, 13, 255]);
/// ```
#[inline]
#[must_use]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
pub fn byte(value: f32) -> u8 {
    (value + 0.5) as u8
}
