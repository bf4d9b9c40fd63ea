//! Errors in fabrics: the fault, and the place in the text that is to blame.
//!
//! A fault carries the values and limits that its message names. The place is found when the file
//! is read, so that the binary can print the line with carets below it.

use std::fmt;
use std::ops::Range;

use super::builtin;
use super::lapping::LappingError;
use super::motif::MotifError;
use super::threading::ThreadingError;
use super::{MAX_BARS, MAX_REPEAT, MAX_THREADING};

/// Why there is no fabric.
///
/// It prints as one line without its place. The caller, who knows the file's name, puts the place
/// in front: see [`Place`].
#[derive(Debug, thiserror::Error)]
#[error("{fault}")]
pub struct FabricError {
    /// The fault.
    pub fault: FabricFault,
    /// Its place, if it is about one in a text.
    pub place: Option<Box<Place>>,
}

/// The faults that a fabric can have.
#[derive(Debug, thiserror::Error)]
pub enum FabricFault {
    /// The file can't be read.
    #[error("can't read the fabric file: {0}")]
    Io(std::io::Error),
    /// No built-in fabric of that name.
    #[error(
        "there is no built-in fabric '{0}': `warpknit fabrics` lists them, and a file's name ends \
         in .toml{hint}",
        hint = builtin::nearest(.0)
            .map_or_else(String::new, |near| format!("; did you mean '{near}'?"))
    )]
    Unknown(String),
    /// Not TOML, or not the keys and types of a fabric file, in the TOML reader's words.
    #[error("{0}")]
    Toml(String),
    /// A chain that can't be read.
    #[error("{what} {text:?}: {why}")]
    Lapping {
        /// Which chain it is.
        what: String,
        /// The chain as written.
        text: String,
        /// The fault in it, with its span in `text`.
        why: LappingError,
    },
    /// A threading that can't be read.
    #[error("{what} {text:?}: {why}")]
    Threading {
        /// Which threading it is.
        what: String,
        /// The marks as written.
        text: String,
        /// The fault in it, with its span in `text`.
        why: ThreadingError,
    },
    /// A number out of its range.
    #[error("{what} is {value}, but must be {range}")]
    Range {
        /// The key.
        what: String,
        /// Its value.
        value: f64,
        /// Its range, in words.
        range: String,
    },
    /// Wales by two keys.
    #[error("the wales are given twice: leave either wales_per_cm or gauge (needles an inch) out")]
    TwoGauges,
    /// Wales by no key.
    #[error("the wales are missing: give wales_per_cm or gauge (needles an inch)")]
    NoGauge,
    /// An unknown key of `[stitch]`.
    #[error("[stitch] has no {0}: it takes {known}", known = super::dimensions::names())]
    UnknownDimension(String),
    /// Two tables for one panel.
    #[error("panel {0} has two [[panels]] tables")]
    PanelTwice(usize),
    /// A chart that can't be read.
    #[error("chart: {0}")]
    Chart(MotifError),
    /// An unknown letter or symbol of a legend.
    #[error("legend: {0}")]
    Legend(String),
    /// A key that only another kind of fabric has.
    #[error("a {kind} has no {key}: {instead}")]
    OtherKind {
        /// Such as `warp knit`.
        kind: &'static str,
        /// The key.
        key: &'static str,
        /// The keys that this kind has.
        instead: &'static str,
    },
    /// No feeder.
    #[error("a weft knit needs a chart and at least one [[feeders]] table")]
    NoFeeders,
    /// A course without a yarn, or with several.
    #[error(
        "course {course} is knitted by {count} feeders: the marks of `courses` must give each \
         course one"
    )]
    Feeders {
        /// Counted from 1.
        course: usize,
        /// How many feeders knit it.
        count: usize,
    },
    /// No strand.
    #[error("laid cloth needs at least one [[strands]] table")]
    NoStrands,
    /// A strand's path with a fault.
    #[error("strand {number}: its path {why}")]
    Path {
        /// Counted from 1.
        number: usize,
        /// The fault and its remedy.
        why: &'static str,
    },
    /// A bar whose run-in or slack can't be.
    #[error("bar {number}: {why}")]
    Bar {
        /// Counted from 1.
        number: usize,
        /// The fault and its remedy.
        why: &'static str,
    },
    /// A flag that is given once for each yarn system, and too often.
    #[error(
        "{flag} is given {given} times, but the fabric has {systems} {system}{}",
        if *systems == 1 { "" } else { "s" }
    )]
    TooManyValues {
        /// The flag.
        flag: &'static str,
        /// How often it is given.
        given: usize,
        /// `bar`, `feeder` or `strand`.
        system: &'static str,
        /// How many bars, feeders or strands the fabric has.
        systems: usize,
    },
    /// No bar.
    #[error("a fabric needs at least one [[bars]] table")]
    NoBars,
    /// Over [`MAX_BARS`].
    #[error("{0} bars; at most {MAX_BARS} are taken")]
    TooManyBars(usize),
    /// Threadings that meet too rarely.
    #[error(
        "the threadings repeat together only after {0} guides; at most {MAX_THREADING} are taken"
    )]
    ThreadingTooLong(usize),
    /// Bars that meet too rarely.
    #[error("the bars repeat together only after {0} courses; at most {MAX_REPEAT} are taken")]
    RepeatTooLong(usize),
    /// Bars and threadings that meet too rarely together.
    #[error(
        "a repeat of {wales} wales by {courses} courses is too large for {bars} bars or feeders; \
         at most {most} laps are taken"
    )]
    RepeatTooLarge {
        /// Wales of the common repeat.
        wales: usize,
        /// Its courses.
        courses: usize,
        /// Bars that lap each of them, or the one feeder that does.
        bars: usize,
        /// The limit.
        most: usize,
    },
}

impl From<FabricFault> for FabricError {
    fn from(fault: FabricFault) -> Self {
        Self { fault, place: None }
    }
}

impl FabricFault {
    /// The bytes of its own text that are to blame; an empty range for faults about no text.
    pub(super) fn span(&self) -> Range<usize> {
        match self {
            Self::Lapping { why, .. } => why.span.clone(),
            Self::Threading { why, .. } => why.span.clone(),
            Self::Chart(why) => why.span.clone(),
            _ => 0..0,
        }
    }

    /// The error in the text that it is about.
    pub(super) fn in_own(self, text: &str) -> FabricError {
        let span = self.span();
        self.at(text, span)
    }

    /// The error at some bytes of a text.
    pub(super) fn at(self, text: &str, span: Range<usize>) -> FabricError {
        FabricError { fault: self, place: Some(Box::new(Place::new(text, span))) }
    }
}

/// A place in a text, ready to be pointed at. It prints as the line with carets below.
///
/// ```
/// use warpknit_core::fabric::Fabric;
/// let error = Fabric::parse("name = 'x'\nwales_per_cm = 0.0\n").unwrap_err();
/// assert_eq!(error.to_string(), "missing field `courses_per_cm`");
/// let text = "name = 'x'\nwales_per_cm = 0.0\ncourses_per_cm = 1\nbars = []";
/// let error = Fabric::parse(text).unwrap_err();
/// let place = error.place.unwrap();
/// assert_eq!(place.line, 2);
/// assert_eq!(place.to_string(), "wales_per_cm = 0.0\n               ^^^");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// Number of the line, counted from 1.
    pub line: usize,
    /// Text of the line; `…` where a long one is cut.
    pub text: String,
    /// The characters of `text` that are to blame, at least one.
    pub columns: Range<usize>,
}

/// Characters of a long line that are shown before the fault, and from it on: a chain of a thousand
/// courses need not fill the screen.
const SHOWN: usize = 80;

impl Place {
    /// The place of some bytes of a text. A span over several lines ends with its first line.
    #[must_use]
    pub fn new(text: &str, span: Range<usize>) -> Self {
        // A span that comes from another parser may cut a character: its bytes are rounded down.
        let start = text.floor_char_boundary(span.start);
        let line_start = text[..start].rfind('\n').map_or(0, |newline| newline + 1);
        let line_end = text[start..].find('\n').map_or(text.len(), |newline| start + newline);
        let end = text.floor_char_boundary(span.end.clamp(start, line_end));
        let before: Vec<_> = text[line_start..start].chars().collect();
        let after: Vec<_> = text[start..line_end].trim_end_matches('\r').chars().collect();
        // An empty span still gets a caret.
        let wrong = text[start..end].chars().count().clamp(1, SHOWN);

        // Columns count characters, not bytes, so that carets stand below what they point at.
        let cut = before.len().saturating_sub(SHOWN);
        let mut shown: String = if cut > 0 { "…" } else { "" }.to_owned();
        shown.extend(&before[cut..]);
        let column = shown.chars().count();
        shown.extend(after.iter().take(SHOWN));
        shown.push_str(if after.len() > SHOWN { "…" } else { "" });
        let line = 1 + text[..line_start].matches('\n').count();
        Self { line, text: shown, columns: column..column + wrong }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // A tab above stays a tab below, whatever width the terminal gives it.
        let indent: String = self
            .text
            .chars()
            .take(self.columns.start)
            .map(|c| if c == '\t' { c } else { ' ' })
            .collect();
        write!(f, "{}\n{indent}{}", self.text, "^".repeat(self.columns.len()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn places_are_pointed_at() {
        let text = "a = 1\n\tb = \"é-2\"\r\nc";
        assert_eq!(Place::new(text, 12..14).to_string(), "\tb = \"é-2\"\n\t     ^");
        assert_eq!(Place::new(text, 12..14).line, 2);
        assert_eq!(Place::new(text, 0..text.len()).to_string(), "a = 1\n^^^^^");
        assert_eq!(Place::new("", 0..0).to_string(), "\n^");
        let long = "x".repeat(1000);
        let place = Place::new(&long, 500..501);
        assert_eq!(
            (place.text.chars().count(), place.columns),
            (SHOWN * 2 + 2, SHOWN + 1..SHOWN + 2)
        );
    }

    proptest! {
        #[test]
        fn no_place_panics(
            text in "[é\t\r\n a]{0,30}|.{0,200}",
            start in 0_usize..60,
            length in 0_usize..60,
        ) {
            let start = start.min(text.len());
            let place = Place::new(&text, start..start + length);
            prop_assert!(place.columns.start <= place.text.chars().count());
            prop_assert!(place.line >= 1 && place.to_string().lines().count() <= 2);
        }
    }
}
