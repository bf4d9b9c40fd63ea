//! Motifs of weft-knit fabric: which loop stands at each wale and course, as a chart that a
//! designer draws.
//!
//! In: rows of letters, the last course on top, and a legend of what each letter is. Out: a checked
//! [`Motif`], repeated for ever across and along; or a [`MotifError`] with the byte span that is
//! wrong. A run of one cable letter is as many crossings as fit into it.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::str::FromStr;

/// The most wales and courses of a motif.
pub const MOST_SIDE: usize = 1_000;
/// The most wales of either side of a cable.
pub const MOST_CROSSED: u32 = 12;

/// What a letter of the chart stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symbol {
    /// A loop whose legs show on the technical face.
    Face,
    /// A loop whose legs show on the technical back: a purl.
    Reverse,
    /// Face loops whose heads change places: those of `front` wales pass in front of those of
    /// `behind`.
    Cable {
        /// Wales that cross in front.
        front: u32,
        /// Wales that cross behind them.
        behind: u32,
        /// Which way the front ones lean, from the bottom up, seen from the technical face.
        lean: Lean,
    },
}

/// A way sideways.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lean {
    /// Toward lower wales.
    Left,
    /// Toward higher wales.
    Right,
}

/// One loop of a motif.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cell {
    /// Whether its legs show on the technical back.
    pub reverse: bool,
    /// By how many wales its head is carried to the right.
    pub carried: i32,
    /// 1 where it is carried in front of others, -1 behind, 0 where it isn't carried.
    pub layer: i32,
}

/// A motif: rows of loops.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Motif {
    /// The chart as written, last course first.
    rows: Vec<String>,
    legend: BTreeMap<char, Symbol>,
    wales: usize,
    /// The most wales that a head is carried.
    reach: i32,
    /// First course first, wale after wale.
    cells: Vec<Cell>,
}

impl Motif {
    /// Reads a chart: a line a course, the last one on top, a letter a loop. `k` is face and `p`
    /// reverse, unless the legend says otherwise.
    ///
    /// # Errors
    /// Rows of unequal length, letters without a meaning, cables that don't fit their run, too
    /// large a chart, or none.
    pub fn parse(chart: &str, legend: &BTreeMap<char, Symbol>) -> Result<Self, MotifError> {
        let mut known = BTreeMap::from([('k', Symbol::Face), ('p', Symbol::Reverse)]);
        known.extend(legend);
        let mut rows: Vec<(usize, &str)> = Vec::new();
        let mut start = 0;
        for line in chart.split('\n') {
            let row = line.trim();
            if !row.is_empty() {
                rows.push((start + line.find(row).unwrap_or(0), row));
            }
            start += line.len() + 1;
        }
        let Some(&(_, first)) = rows.first() else { return Err(Fault::Empty.at(0..chart.len())) };
        let wales = first.chars().count();
        if wales > MOST_SIDE || rows.len() > MOST_SIDE {
            return Err(Fault::TooLarge { wales, courses: rows.len() }.at(0..chart.len()));
        }
        let mut cells = Vec::with_capacity(wales * rows.len());
        for &(start, row) in rows.iter().rev() {
            let count = row.chars().count();
            if count != wales {
                return Err(Fault::Ragged { count, wales }.at(start..start + row.len()));
            }
            add_row(row, start, &known, &mut cells)?;
        }
        let rows = rows.into_iter().map(|(_, row)| row.to_owned()).collect();
        let reach = cells.iter().map(|cell| cell.carried.abs()).max().unwrap_or(0);
        Ok(Self { rows, legend: legend.clone(), wales, reach, cells })
    }

    /// Wales of one repeat.
    #[must_use]
    pub fn wales(&self) -> usize {
        self.wales
    }

    /// Courses of one repeat.
    #[must_use]
    pub fn courses(&self) -> usize {
        self.rows.len()
    }

    /// The loop at a wale and a course, counted from the motif's lower left.
    #[must_use]
    pub fn cell(&self, wale: i64, course: i64) -> Cell {
        let wrap = |at: i64, count: usize| {
            let count = i64::try_from(count).expect("motifs are small");
            usize::try_from(at.rem_euclid(count)).expect("a remainder is not negative")
        };
        self.cells[wrap(course, self.courses()) * self.wales + wrap(wale, self.wales)]
    }

    /// The most wales that a head is carried; 0 without cables.
    #[must_use]
    pub fn reach(&self) -> i32 {
        self.reach
    }

    /// The chart as written, the last course on top.
    #[must_use]
    pub fn rows(&self) -> &[String] {
        &self.rows
    }

    /// What its letters stand for, beside `k` and `p`.
    #[must_use]
    pub fn legend(&self) -> &BTreeMap<char, Symbol> {
        &self.legend
    }
}

/// Appends a row's loops.
fn add_row(
    row: &str,
    start: usize,
    legend: &BTreeMap<char, Symbol>,
    cells: &mut Vec<Cell>,
) -> Result<(), MotifError> {
    let letters: Vec<(usize, char)> = row.char_indices().collect();
    let mut at = 0;
    while let Some(&(byte, letter)) = letters.get(at) {
        let span = start + byte..start + byte + letter.len_utf8();
        let Some(&symbol) = legend.get(&letter) else {
            return Err(Fault::Unknown(letter).at(span));
        };
        let plain = |reverse| Cell { reverse, carried: 0, layer: 0 };
        match symbol {
            Symbol::Face | Symbol::Reverse => {
                cells.push(plain(symbol == Symbol::Reverse));
                at += 1;
            }
            Symbol::Cable { front, behind, lean } => {
                let width = (front + behind) as usize;
                let run = letters[at..].iter().take_while(|(_, other)| *other == letter).count();
                if run < width {
                    let end = letters.get(at + run).map_or(row.len(), |(byte, _)| *byte);
                    return Err(Fault::Narrow { letter, symbol, run }.at(span.start..start + end));
                }
                cells.extend(crossing(front, behind, lean));
                at += width;
            }
        }
    }
    Ok(())
}

/// The loops of a crossing, from left to right.
fn crossing(front: u32, behind: u32, lean: Lean) -> impl Iterator<Item = Cell> {
    let moved = |wales: u32| i32::try_from(wales).expect("cables are narrow");
    let (in_front, at_back) = match lean {
        Lean::Right => (moved(behind), -moved(front)),
        Lean::Left => (-moved(behind), moved(front)),
    };
    let block = |count: u32, carried, layer| {
        (0..count).map(move |_| Cell { reverse: false, carried, layer })
    };
    let (fronts, backs) = (block(front, in_front, 1), block(behind, at_back, -1));
    let (left, right): (Vec<Cell>, Vec<Cell>) = match lean {
        Lean::Right => (fronts.collect(), backs.collect()),
        Lean::Left => (backs.collect(), fronts.collect()),
    };
    left.into_iter().chain(right)
}

impl FromStr for Symbol {
    type Err = SymbolError;

    /// Reads `face`, `reverse`, or a cable such as `cable 3/3 left`.
    fn from_str(text: &str) -> Result<Self, SymbolError> {
        let error = || SymbolError(text.to_owned());
        match text.split_whitespace().collect::<Vec<_>>()[..] {
            ["face"] => Ok(Self::Face),
            ["reverse"] => Ok(Self::Reverse),
            ["cable", wales, lean] => {
                let (front, behind) = wales.split_once('/').ok_or_else(error)?;
                let count = |text: &str| {
                    text.parse()
                        .ok()
                        .filter(|count| (1..=MOST_CROSSED).contains(count))
                        .ok_or_else(error)
                };
                let lean = match lean {
                    "left" => Lean::Left,
                    "right" => Lean::Right,
                    _ => return Err(error()),
                };
                Ok(Self::Cable { front: count(front)?, behind: count(behind)?, lean })
            }
            _ => Err(error()),
        }
    }
}

impl fmt::Display for Symbol {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Face => f.write_str("face"),
            Self::Reverse => f.write_str("reverse"),
            Self::Cable { front, behind, lean } => {
                write!(
                    f,
                    "cable {front}/{behind} {}",
                    if *lean == Lean::Left { "left" } else { "right" }
                )
            }
        }
    }
}

/// A symbol that can't be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{0:?} is no loop: face, reverse, or a cable such as \"cable 3/3 left\" (3 wales in front of 3, 12 at most)"
)]
pub struct SymbolError(String);

/// What is wrong with a chart, and where.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{fault}")]
pub struct MotifError {
    fault: Fault,
    /// Bytes of the chart.
    pub span: Range<usize>,
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
enum Fault {
    #[error("the chart is empty: a line a course, a letter a loop")]
    Empty,
    #[error(
        "the chart has {wales} wales and {courses} courses; at most {MOST_SIDE} of each are taken"
    )]
    TooLarge { wales: usize, courses: usize },
    #[error("this row has {count} loops, the first one {wales}")]
    Ragged { count: usize, wales: usize },
    #[error(
        "'{0}' stands for nothing: k is face, p reverse, and other letters need a line in [legend]"
    )]
    Unknown(char),
    #[error("'{letter}' is {symbol}, but stands {run} times in a row, too few for a crossing")]
    Narrow { letter: char, symbol: Symbol, run: usize },
}

impl Fault {
    fn at(self, span: Range<usize>) -> MotifError {
        MotifError { fault: self, span }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motif(chart: &str) -> Result<Motif, MotifError> {
        let legend = [('L', "cable 2/1 left"), ('R', "cable 2/2 right")];
        Motif::parse(chart, &legend.map(|(letter, text)| (letter, text.parse().unwrap())).into())
    }

    #[test]
    fn the_lowest_row_is_the_first_course_and_motifs_repeat() {
        let motif = motif("\n  pk\n  kk\n").unwrap();
        assert_eq!((motif.wales(), motif.courses()), (2, 2));
        let reverse = |wale, course| motif.cell(wale, course).reverse;
        assert!(
            !reverse(0, 0) && reverse(0, 1) && !reverse(1, 1) && reverse(-2, -1) && reverse(4, 7)
        );
    }

    #[test]
    fn heads_of_a_crossing_change_places() {
        for chart in ["kLLLp", "RRRRRRRR"] {
            let motif = motif(chart).unwrap();
            let mut places: Vec<i64> = (0_i64..)
                .take(motif.wales())
                .map(|w| w + i64::from(motif.cell(w, 0).carried))
                .collect();
            places.sort_unstable();
            assert_eq!(places, (0_i64..).take(motif.wales()).collect::<Vec<_>>(), "{chart}");
        }
        let left = motif("LLL").unwrap();
        let cells = [0, 1, 2].map(|wale| (left.cell(wale, 0).carried, left.cell(wale, 0).layer));
        assert_eq!(
            cells,
            [(2, -1), (-1, 1), (-1, 1)],
            "the one behind goes right, the two in front lean left"
        );
    }

    #[test]
    fn faults_are_pointed_at() {
        let fault = |chart: &str| motif(chart).unwrap_err();
        let pointed = |chart: &'static str| &chart[fault(chart).span];
        assert_eq!(pointed("kk\nkxk\nkk"), "kxk");
        assert_eq!(pointed("kk\n é k"), "é k");
        assert_eq!(pointed("kk\nk?"), "?");
        assert_eq!(pointed("kLLk"), "LL");
        assert!(fault("kLLk").to_string().contains("cable 2/1 left, but stands 2 times"));
        assert!(
            fault(" \n ").to_string().contains("empty")
                && fault(&"k".repeat(1001)).to_string().contains("1001 wales")
        );
    }

    #[test]
    fn symbols_read_as_they_print() {
        for text in ["face", "reverse", "cable 3/3 left", "cable 1/12 right"] {
            assert_eq!(text.parse::<Symbol>().unwrap().to_string(), text);
        }
        for text in [
            "",
            "cable",
            "cable 3/3",
            "cable 0/3 left",
            "cable 3/13 left",
            "cable 3 left",
            "cable 3/3 up",
        ] {
            assert!(text.parse::<Symbol>().is_err(), "{text}");
        }
    }
}
