//! Parts of a whole, for work that is shared out among machines.
//!
//! In: which of how many parts. Out: what belongs to it. Every part is found from the whole's size
//! alone, the parts follow each other without gap or overlap, and they are as even as things that
//! aren't cut allow: rows of a picture, yarns of a cloth.

use std::ops::Range;
use std::str::FromStr;

/// One of some parts, counted from 1.
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
    of: u32,
}

/// Why a text names no part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TileError {
    /// Not two numbers.
    #[error("write it as 2/3: which part, counted from 1, and of how many")]
    Form,
    /// Part 0, or one beyond the last.
    #[error("of {of} parts there is no part {number}: they are counted from 1 to {of}")]
    Missing {
        /// The part.
        number: u32,
        /// How many there are.
        of: u32,
    },
}

impl Tile {
    /// Part `number` of `of`; nothing if there is no such part.
    #[must_use]
    pub fn new(number: u32, of: u32) -> Option<Self> {
        (1..=of).contains(&number).then_some(Self { number, of })
    }

    /// Which part, from 1, and of how many.
    #[must_use]
    pub fn numbers(self) -> [u32; 2] {
        [self.number, self.of]
    }

    /// What of `count` things in a row is this part's.
    #[must_use]
    pub fn share(self, count: u32) -> Range<u32> {
        let border = |number: u32| {
            let border = u64::from(count) * u64::from(number) / u64::from(self.of);
            u32::try_from(border).expect("no more than the count")
        };
        border(self.number - 1)..border(self.number)
    }

    /// Whether this part holds the place `at` on a way of some length; places at its end are the
    /// last part's.
    #[must_use]
    pub fn holds(self, at: u64, length: u64) -> bool {
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
