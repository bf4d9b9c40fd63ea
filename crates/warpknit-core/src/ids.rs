//! Typed indices of 32 bits. Millions of them stay small, and the compiler keeps faces and yarns
//! apart.
//!
//! A count over `u32::MAX` would need over 100 GB of input, so [`index32`] treats a smaller one as
//! an invariant.

/// Index of a triangle in the garment's triangulated faces, in file order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FaceId(pub u32);

/// Index of a yarn in a garment. Yarns are ordered by panel, then by bar from the front, then by
/// guide from x = 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct YarnId(pub u32);

/// Converts an index to 32 bits.
///
/// # Panics
/// Over `u32::MAX`, which no input that fits in memory reaches.
///
/// ```
/// assert_eq!(warpknit_core::ids::index32(7), 7);
/// ```
#[must_use]
#[inline]
pub fn index32(index: usize) -> u32 {
    u32::try_from(index).expect("an index over 2^32 needs more memory than any reader here accepts")
}
