//! Motifs of weft-knit fabric: the loop at each wale and course, as a chart that a designer draws.
//!
//! In: rows of letters, the last course on top, and a legend of their meanings. Out: a checked
//! [`Motif`], repeated without end across and along; or a [`MotifError`] with the byte span of the
//! fault. A run of one cable letter holds as many crossings as fit into it. Cost: linear in the
//! chart. Not promised: tucks, floats and transfers other than cables have no letters.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::str::FromStr;

/// The most wales and courses of a motif.
pub const MOST_SIDE: usize = 1_000;
/// The most wales of either side of a cable.
pub const MOST_CROSSED: u32 = 12;

/// The meaning of a letter of the chart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symbol {
    /// A loop whose legs show on the technical face.
    Face,
    /// A loop whose legs show on the technical back: a purl stitch.
    Reverse,
    /// Face loops whose heads change places: those of `front` wales pass in front of those of
    /// `behind`.
    Cable {
        /// Wales that cross in front.
        front: u32,
        /// Wales that cross behind them.
        behind: u32,
        /// The side to which the front ones lean, from the bottom up, seen from the technical face.
        lean: Lean,
    },
}

/// The side to which a crossing leans.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lean {
    /// Toward lower wales.
    Left,
    /// Toward higher wales.
    Right,
}

/// One loop of a motif.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChartCell {
    /// Whether its legs show on the technical back, and not on the face.
    pub reverse: bool,
    /// Wales by which its head is carried to the right; negative to the left.
    pub carried: i32,
    /// 1 where its head passes in front of others, -1 behind them, 0 where it is not carried.
    pub layer: i32,
}

/// A motif: rows of loops, repeated across and along.
///
/// ```
/// use std::collections::BTreeMap;
/// use warpknit_core::fabric::motif::Motif;
/// let rib = Motif::parse("kp", &BTreeMap::new()).unwrap();
/// assert_eq!((rib.wales(), rib.courses()), (2, 1));
/// assert!(!rib.cell(0, 0).reverse && rib.cell(3, 7).reverse);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Motif {
    /// The chart as written, last course first.
    rows: Vec<String>,
    legend: BTreeMap<char, Symbol>,
    wales: usize,
    /// The most wales by which a head is carried.
    reach: i32,
    /// First course first, wale after wale.
    cells: Vec<ChartCell>,
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
        // Rows with the byte at which each starts: errors point into the chart as written.
        let mut rows: Vec<(usize, &str)> = Vec::new();
        let mut start = 0;
        for line in chart.split('\n') {
            let row = line.trim();
            if !row.is_empty() {
                rows.push((start + line.find(row).unwrap_or(0), row));
            }
            start += line.len() + 1;
        }
        let Some(&(_, first)) = rows.first() else {
            return Err(MotifFault::Empty.at(0..chart.len()));
        };
        let wales = first.chars().count();
        if wales > MOST_SIDE || rows.len() > MOST_SIDE {
            return Err(MotifFault::TooLarge { wales, courses: rows.len() }.at(0..chart.len()));
        }
        let mut cells = Vec::with_capacity(wales * rows.len());
        // Charts are drawn as the cloth hangs, so the first course is the lowest row.
        for &(start, row) in rows.iter().rev() {
            let count = row.chars().count();
            if count != wales {
                return Err(MotifFault::Ragged { count, wales }.at(start..start + row.len()));
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

    /// The loop at a wale and a course, counted from the lower left of one repeat.
    #[must_use]
    pub fn cell(&self, wale: i64, course: i64) -> ChartCell {
        self.cells[wrapped(course, self.courses()) * self.wales + wrapped(wale, self.wales)]
    }

    /// The most wales by which a head is carried; 0 without cables.
    #[must_use]
    pub fn reach(&self) -> i32 {
        self.reach
    }

    /// The chart as written, the last course on top.
    #[must_use]
    pub fn rows(&self) -> &[String] {
        &self.rows
    }

    /// The meanings of its letters other than `k` and `p`.
    #[must_use]
    pub fn legend(&self) -> &BTreeMap<char, Symbol> {
        &self.legend
    }
}

/// A place within one repeat of `count` places.
fn wrapped(at: i64, count: usize) -> usize {
    let count = i64::try_from(count).expect("motifs are small");
    usize::try_from(at.rem_euclid(count)).expect("a remainder is not negative")
}

/// Appends a row's loops.
fn add_row(
    row: &str,
    start: usize,
    legend: &BTreeMap<char, Symbol>,
    cells: &mut Vec<ChartCell>,
) -> Result<(), MotifError> {
    let letters: Vec<(usize, char)> = row.char_indices().collect();
    let mut at = 0;
    while let Some(&(byte, letter)) = letters.get(at) {
        let span = start + byte..start + byte + letter.len_utf8();
        let Some(&symbol) = legend.get(&letter) else {
            return Err(MotifFault::Unknown(letter).at(span));
        };
        match symbol {
            Symbol::Face | Symbol::Reverse => {
                let reverse = symbol == Symbol::Reverse;
                cells.push(ChartCell { reverse, carried: 0, layer: 0 });
                at += 1;
            }
            Symbol::Cable { front, behind, lean } => {
                let width = (front + behind) as usize;
                let run = letters[at..].iter().take_while(|(_, other)| *other == letter).count();
                if run < width {
                    let end = letters.get(at + run).map_or(row.len(), |(byte, _)| *byte);
                    return Err(
                        MotifFault::Narrow { letter, symbol, run }.at(span.start..start + end)
                    );
                }
                // The rest of the run, if there is any, is read as a crossing of its own.
                cells.extend(crossing(front, behind, lean));
                at += width;
            }
        }
    }
    Ok(())
}

/// The loops of a crossing, from left to right.
fn crossing(front: u32, behind: u32, lean: Lean) -> impl Iterator<Item = ChartCell> {
    let [front_wales, behind_wales] =
        [front, behind].map(|wales| i32::try_from(wales).expect("cables are narrow"));
    // The two blocks change places: each is carried by the width of the other. Front loops that
    // lean right start on the left.
    let [left, right] = match lean {
        Lean::Right => [(front, behind_wales, 1), (behind, -front_wales, -1)],
        Lean::Left => [(behind, front_wales, -1), (front, -behind_wales, 1)],
    };
    [left, right].into_iter().flat_map(|(count, carried, layer)| {
        (0..count).map(move |_| ChartCell { reverse: false, carried, layer })
    })
}

/// Wales of one side of a cable, if the text is a number of them.
fn crossed_wales(text: &str) -> Option<u32> {
    text.parse().ok().filter(|count| (1..=MOST_CROSSED).contains(count))
}

impl Symbol {
    fn read(text: &str) -> Option<Self> {
        match text.split_whitespace().collect::<Vec<_>>()[..] {
            ["face"] => Some(Self::Face),
            ["reverse"] => Some(Self::Reverse),
            ["cable", wales, lean] => {
                let (front, behind) = wales.split_once('/')?;
                let lean = match lean {
                    "left" => Lean::Left,
                    "right" => Lean::Right,
                    _ => return None,
                };
                let [front, behind] = [front, behind].map(crossed_wales);
                Some(Self::Cable { front: front?, behind: behind?, lean })
            }
            _ => None,
        }
    }
}

impl FromStr for Symbol {
    type Err = SymbolError;

    /// Reads `face`, `reverse`, or a cable such as `cable 3/3 left`.
    fn from_str(text: &str) -> Result<Self, SymbolError> {
        Self::read(text).ok_or_else(|| SymbolError(text.to_owned()))
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
    "{0:?} is no loop: face, reverse, or a cable such as \"cable 3/3 left\" (3 wales in front \
     of 3, 12 at most)"
)]
pub struct SymbolError(String);

/// A fault in a chart, and its place.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{fault}")]
pub struct MotifError {
    fault: MotifFault,
    /// Bytes of the chart.
    pub span: Range<usize>,
}

/// The faults that a chart can have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
enum MotifFault {
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

impl MotifFault {
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
