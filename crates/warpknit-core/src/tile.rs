//! Tiles: parts of a job that is divided among machines.
//!
//! In: the number of a part and the number of all parts. Out: the items that belong to it, such as
//! rows of a picture or yarns of a cloth.
//!
//! A part depends only on the size of the whole, so machines need not talk to each other. Parts
//! follow each other without gaps or overlaps, and their sizes differ by one item at most. Cost:
//! constant. Not promised: parts of equal running time.

use std::ops::Range;
use std::str::FromStr;

/// One of several parts, counted from 1.
///
/// ```
/// use warpknit_core::tile::Tile;
/// let rows: Vec<_> = (1..=3).map(|number| Tile::new(number, 3).unwrap().share(8)).collect();
/// assert_eq!(rows, [0..2, 2..5, 5..8]);
/// assert_eq!("2/3".parse(), Ok(Tile::new(2, 3).unwrap()));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tile {
    number: u32,
    /// Number of parts.
    of: u32,
}

/// Reasons why a text names no part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TileError {
    /// The text is not two numbers with a slash between them.
    #[error("write it as 2/3: which part, counted from 1, and of how many")]
    Form,
    /// The number is 0 or larger than the number of parts.
    #[error("of {of} parts there is no part {number}: they are counted from 1 to {of}")]
    Missing {
        /// The number of the part.
        number: u32,
        /// The number of parts.
        of: u32,
    },
}

impl Tile {
    /// Part `number` of `of`. Nothing if there is no such part.
    #[must_use]
    pub fn new(number: u32, of: u32) -> Option<Self> {
        (1..=of).contains(&number).then_some(Self { number, of })
    }

    /// The number of the part, from 1, and the number of parts.
    #[must_use]
    pub fn numbers(self) -> [u32; 2] {
        [self.number, self.of]
    }

    /// The range of this part among `count` items.
    #[must_use]
    pub fn share(self, count: u32) -> Range<u32> {
        self.border(self.number - 1, count)..self.border(self.number, count)
    }

    /// The number of items in the first `parts` parts. Neighbouring parts compute the same border,
    /// so there is neither gap nor overlap.
    fn border(self, parts: u32, count: u32) -> u32 {
        // 64 bits: the product of two 32-bit numbers may exceed 32 bits.
        let border = u64::from(count) * u64::from(parts) / u64::from(self.of);
        u32::try_from(border).expect("no more than the count")
    }

    /// Whether this part holds the position `at` of a line of this length. The end of the line
    /// belongs to the last part.
    #[must_use]
    pub fn holds(self, at: u64, length: u64) -> bool {
        // 128 bits: positions are counts of up to 64 bits.
        let part =
            (u128::from(at) * u128::from(self.of)).checked_div(u128::from(length)).unwrap_or(0);
        part.min(u128::from(self.of - 1)) == u128::from(self.number - 1)
    }
}

impl FromStr for Tile {
    type Err = TileError;

    fn from_str(text: &str) -> Result<Self, TileError> {
        let numbers = text
            .split_once('/')
            .and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
        let (number, of) = numbers.ok_or(TileError::Form)?;
        if of == 0 {
            Err(TileError::Form)
        } else {
            Self::new(number, of).ok_or(TileError::Missing { number, of })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_follow_each_other_and_miss_nothing() {
        for (count, of) in [(0, 1), (7, 1), (7, 3), (7, 7), (3, 7), (u32::MAX, 5)] {
            let mut next = 0;
            for number in 1..=of {
                let share = Tile::new(number, of).unwrap().share(count);
                assert!(share.start == next && share.end - share.start <= count.div_ceil(of));
                next = share.end;
            }
            assert_eq!(next, count);
        }
    }

    #[test]
    fn a_place_is_held_by_one_part() {
        for (at, length) in [(0, 0), (0, 9), (4, 9), (9, 9), (u64::MAX, u64::MAX)] {
            let holding =
                (1..=5).filter(|&number| Tile::new(number, 5).unwrap().holds(at, length)).count();
            assert_eq!(holding, 1, "{at} of {length}");
        }
    }

    #[test]
    fn texts_that_name_no_part_are_told_apart() {
        for text in ["3", "a/b", "1/", "/2", "-1/2", "1/0", "1/2/3", ""] {
            assert_eq!(text.parse::<Tile>(), Err(TileError::Form), "{text}");
        }
        for (number, of) in [(0, 3), (4, 3)] {
            assert_eq!(
                format!("{number}/{of}").parse::<Tile>(),
                Err(TileError::Missing { number, of })
            );
        }
    }
}
