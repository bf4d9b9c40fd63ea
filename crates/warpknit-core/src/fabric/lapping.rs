//! The chain notation of warp knitting: `1-0/1-2//` to laps, and back.
//!
//! In: the text of one guide bar's lapping. Out: a [`Chain`], one [`Lap`] a course; or a
//! [`LappingError`] with the byte span of the fault, so that a caller can point at it. `-` is the
//! overlap in front of the needle, `/` the underlap behind the needles. Gaps between needles are
//! numbered as on tricot machines (0, 1, 2 …), or as in raschel charts (0, 2, 4 …), whose numbers
//! are halved. Links after a course's second only time the movement on the machine (tempi) and have
//! no geometry. Cost: linear in the text. Not promised: that a machine can knit the chain.

use std::fmt;
use std::ops::Range;

use serde::{Deserialize, Serialize};

/// The highest gap a chain may name.
pub const MAX_GAP: i32 = 4096;
/// The most needles one overlap may pass.
pub const MAX_OVERLAP: i32 = 2;
/// The most links a course may have (4-link tempi).
const MAX_LINKS: usize = 4;

/// How gaps are numbered in the chart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Numbering {
    /// 0, 1, 2 …
    #[default]
    Tricot,
    /// 0, 2, 4 …
    Raschel,
}

/// One course of a bar: the guide swings through gap `from` to the front of the needles, passes
/// over to gap `to` (the overlap), and swings back.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Lap {
    /// The gap before the overlap.
    pub from: i32,
    /// The gap after the overlap.
    pub to: i32,
}

impl Lap {
    /// The overlap's direction: -1, 0 (laid in) or 1.
    #[must_use]
    pub fn overlap(self) -> i32 {
        (self.to - self.from).signum()
    }

    /// The needle of the first loop, counted from the guide's own gap 0 (or the gap itself for an
    /// inlay).
    #[must_use]
    pub fn needle(self) -> i32 {
        self.from.min(self.to)
    }

    /// The needles that get a loop, counted from the guide's own gap 0, in the order of the swing;
    /// none for an inlay.
    ///
    /// ```
    /// use warpknit_core::fabric::lapping::Lap;
    /// assert_eq!(Lap { from: 0, to: 2 }.needles().collect::<Vec<_>>(), [0, 1]);
    /// assert_eq!(Lap { from: 2, to: 0 }.needles().collect::<Vec<_>>(), [1, 0]);
    /// assert_eq!(Lap { from: 1, to: 1 }.needles().count(), 0);
    /// ```
    pub fn needles(self) -> impl Iterator<Item = i32> {
        let count = (self.to - self.from).abs();
        (0..count).map(
            move |step| if self.to > self.from { self.from + step } else { self.from - 1 - step },
        )
    }
}

/// A bar's lapping: one lap a course, repeated without end.
///
/// ```
/// use warpknit_core::fabric::lapping::{Chain, Lap, Numbering};
/// let chain = Chain::parse("2-3/1-0//", Numbering::Tricot).unwrap();
/// assert_eq!(chain.laps(), [Lap { from: 2, to: 3 }, Lap { from: 1, to: 0 }]);
/// assert_eq!(chain.to_string(), "2-3/1-0//");
/// assert_eq!(chain.underlap(0), -2);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chain {
    laps: Vec<Lap>,
}

impl Chain {
    /// Reads a chain. It may end in `//`, `/`, `,` or nothing, and spaces may stand anywhere.
    ///
    /// # Errors
    /// The first fault in the text, with its span.
    pub fn parse(text: &str, numbering: Numbering) -> Result<Self, LappingError> {
        let courses = split(text)?;
        if courses.is_empty() {
            return Err(LappingError { fault: LappingFault::Empty, span: 0..text.len() });
        }
        let laps =
            courses.into_iter().map(|course| course.lap(numbering)).collect::<Result<_, _>>()?;
        Ok(Self { laps })
    }

    /// The laps of one repeat, first course first; never empty.
    #[must_use]
    pub fn laps(&self) -> &[Lap] {
        &self.laps
    }

    /// The lap of any course, before or after the first.
    #[must_use]
    pub fn lap(&self, course: i64) -> Lap {
        let repeat = i64::try_from(self.laps.len()).expect("a chain is far shorter than 2^63");
        self.laps[usize::try_from(course.rem_euclid(repeat)).expect("a remainder is not negative")]
    }

    /// The underlap that follows a course, in gaps: positive to higher gaps.
    #[must_use]
    pub fn underlap(&self, course: i64) -> i32 {
        self.lap(course + 1).from - self.lap(course).to
    }

    /// Whether the lap of a course is closed: its underlap returns against its overlap.
    #[must_use]
    pub fn is_closed(&self, course: i64) -> bool {
        self.lap(course).overlap() * self.underlap(course).signum() < 0
    }

    /// Whether the bar never knits: all of its laps are laid in.
    #[must_use]
    pub fn is_inlay(&self) -> bool {
        self.laps.iter().all(|lap| lap.overlap() == 0)
    }

    /// Lowest and highest gap.
    #[must_use]
    pub fn gaps(&self) -> (i32, i32) {
        // The chain was checked to have a course, so neither is empty.
        let lowest = self.laps.iter().map(|lap| lap.from.min(lap.to)).min();
        let highest = self.laps.iter().map(|lap| lap.from.max(lap.to)).max();
        (lowest.expect("a chain has a lap"), highest.expect("a chain has a lap"))
    }

    /// Whether the drive is on the left, so that a designer writes its gaps with the other sign.
    ///
    /// Only a chain that was read with its drive on the left has gaps below 0.
    #[must_use]
    pub fn counts_from_left(&self) -> bool {
        self.gaps().0 < 0
    }

    /// The chain with gaps counted from the drive, never below 0.
    #[must_use]
    pub fn as_written(&self) -> Self {
        if self.counts_from_left() { self.mirrored() } else { self.clone() }
    }

    /// The same lapping with the drive on the other side: gaps counted the other way.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        Self { laps: self.laps.iter().map(|lap| Lap { from: -lap.from, to: -lap.to }).collect() }
    }
}

impl fmt::Display for Chain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (course, lap) in self.laps.iter().enumerate() {
            write!(f, "{}{}-{}", if course == 0 { "" } else { "/" }, lap.from, lap.to)?;
        }
        f.write_str("//")
    }
}

/// A fault in a chain, and its place.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{fault}")]
pub struct LappingError {
    /// The fault.
    pub fault: LappingFault,
    /// The bytes of the text that are to blame.
    pub span: Range<usize>,
}

/// The faults that a chain can have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LappingFault {
    /// No course at all.
    #[error("the chain is empty: write a course as two gaps, such as 1-0")]
    Empty,
    /// A character other than a digit, `-`, `/` or `,`.
    #[error("'{0}' is not a number: a chain holds gaps, '-', '/' and ',' alone")]
    NotANumber(char),
    /// `1-` or `-0` or `1--0`.
    #[error("a link is missing beside '-': a course is two gaps, such as 1-0")]
    MissingLink,
    /// A course of one gap.
    #[error("a course needs two gaps, such as {0}-{0}; this one has {0} alone")]
    LoneLink(i32),
    /// More links than tempi have.
    #[error("a course of {0} links: 2, 3 or 4 (tempi) are known")]
    TooManyLinks(usize),
    /// Two numbers with only a space between them.
    #[error("two gaps without '-' or '/' between them")]
    NoSeparator,
    /// A course after `//`.
    #[error("'//' ends the chain, but more follows: courses are separated by one '/'")]
    AfterEnd,
    /// Over [`MAX_GAP`].
    #[error("gap {0} is over {MAX_GAP}")]
    GapTooHigh(String),
    /// Over [`MAX_OVERLAP`] needles.
    #[error("an overlap over {0} needles: guides lap over 1 or 2")]
    OverlapTooWide(i32),
    /// An odd gap in a raschel chart.
    #[error("gap {0} is odd, but raschel charts number gaps 0, 2, 4 …")]
    OddRaschelGap(i32),
}

/// A number of the text and its place.
struct Link {
    gap: i32,
    span: Range<usize>,
}

impl Link {
    /// The gap as tricot machines number it.
    fn number(&self, numbering: Numbering) -> Result<i32, LappingError> {
        match numbering {
            Numbering::Tricot => Ok(self.gap),
            Numbering::Raschel if self.gap % 2 == 0 => Ok(self.gap / 2),
            Numbering::Raschel => {
                let fault = LappingFault::OddRaschelGap(self.gap);
                Err(LappingError { fault, span: self.span.clone() })
            }
        }
    }
}

/// The links of one course.
#[derive(Default)]
struct CourseText {
    links: Vec<Link>,
    /// Position of a `-` whose right-hand link has not come yet.
    open_dash: Option<usize>,
}

impl CourseText {
    fn push(&mut self, link: Link) -> Result<(), LappingError> {
        // After the first link each needs a dash of its own.
        if !self.links.is_empty() && self.open_dash.take().is_none() {
            return Err(LappingError { fault: LappingFault::NoSeparator, span: link.span });
        }
        self.links.push(link);
        Ok(())
    }

    fn dash(&mut self, at: usize) -> Result<(), LappingError> {
        if self.links.is_empty() || self.open_dash.is_some() {
            return Err(LappingError { fault: LappingFault::MissingLink, span: at..at + 1 });
        }
        self.open_dash = Some(at);
        Ok(())
    }

    /// Ends the course: its links must be whole.
    fn finish(&self) -> Result<(), LappingError> {
        match (self.open_dash, self.links.as_slice()) {
            (Some(at), _) => {
                Err(LappingError { fault: LappingFault::MissingLink, span: at..at + 1 })
            }
            (None, [only]) => Err(LappingError {
                fault: LappingFault::LoneLink(only.gap),
                span: only.span.clone(),
            }),
            (None, links) if links.len() > MAX_LINKS => Err(LappingError {
                fault: LappingFault::TooManyLinks(links.len()),
                span: self.span(),
            }),
            _ => Ok(()),
        }
    }

    fn span(&self) -> Range<usize> {
        self.links[0].span.start..self.links[self.links.len() - 1].span.end
    }

    /// The lap: links after the second are timing steps of tempi and have no geometry of their own.
    fn lap(&self, numbering: Numbering) -> Result<Lap, LappingError> {
        let [from, to] = [&self.links[0], &self.links[1]].map(|link| link.number(numbering));
        let lap = Lap { from: from?, to: to? };
        let needles = (lap.to - lap.from).abs();
        if needles > MAX_OVERLAP {
            return Err(LappingError {
                fault: LappingFault::OverlapTooWide(needles),
                span: self.span(),
            });
        }
        Ok(lap)
    }
}

/// Splits the text into courses of at least two links each.
fn split(text: &str) -> Result<Vec<CourseText>, LappingError> {
    let mut courses = Vec::new();
    let mut course = CourseText::default();
    let mut rest = text.char_indices().peekable();
    let mut ended = false;
    // One pass from left to right; a course is complete at the separator after it.
    while let Some((at, c)) = rest.next() {
        if ended && c.is_ascii_digit() {
            return Err(LappingError {
                fault: LappingFault::AfterEnd,
                span: at..text.trim_end().len(),
            });
        }
        match c {
            '0'..='9' => {
                let mut end = at + 1;
                while let Some((next, _)) = rest.next_if(|(_, d)| d.is_ascii_digit()) {
                    end = next + 1;
                }
                course.push(Link { gap: gap_number(&text[at..end], at)?, span: at..end })?;
            }
            '-' => course.dash(at)?,
            '/' | ',' => {
                course.finish()?;
                if !course.links.is_empty() {
                    courses.push(std::mem::take(&mut course));
                // A separator right after another ends the chain; before the first course both are
                // ignored.
                } else if !courses.is_empty() {
                    ended = true;
                }
            }
            c if c.is_whitespace() => {}
            c => {
                return Err(LappingError {
                    fault: LappingFault::NotANumber(c),
                    span: at..at + c.len_utf8(),
                });
            }
        }
    }
    course.finish()?;
    if !course.links.is_empty() {
        courses.push(course);
    }
    Ok(courses)
}

fn gap_number(digits: &str, at: usize) -> Result<i32, LappingError> {
    // Only overflow can fail here, and a number that long is over the limit as well.
    match digits.parse::<i32>() {
        Ok(gap) if gap <= MAX_GAP => Ok(gap),
        _ => Err(LappingError {
            fault: LappingFault::GapTooHigh(digits.to_owned()),
            span: at..at + digits.len(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn fault(text: &str) -> (LappingFault, Range<usize>) {
        let error = Chain::parse(text, Numbering::Tricot).unwrap_err();
        (error.fault, error.span)
    }

    #[test]
    fn end_marks_and_spaces_are_free() {
        let plain = Chain::parse("1-0/1-2//", Numbering::Tricot).unwrap();
        for text in ["1-0/1-2", "1-0/1-2/", "1-0, 1-2,", " 1 - 0 / 1-2 //", "1-0\n/1-2//"] {
            assert_eq!(Chain::parse(text, Numbering::Tricot).unwrap(), plain, "{text:?}");
        }
    }

    #[test]
    fn every_fault_has_its_span() {
        assert_eq!(fault(""), (LappingFault::Empty, 0..0));
        assert_eq!(fault(" // "), (LappingFault::Empty, 0..4));
        assert_eq!(fault("1-0/x-2"), (LappingFault::NotANumber('x'), 4..5));
        assert_eq!(fault("1-0/1-é"), (LappingFault::NotANumber('é'), 6..8));
        assert_eq!(fault("1-0/1-/"), (LappingFault::MissingLink, 5..6));
        assert_eq!(fault("-0"), (LappingFault::MissingLink, 0..1));
        assert_eq!(fault("1--0"), (LappingFault::MissingLink, 2..3));
        assert_eq!(fault("1-0/12/"), (LappingFault::LoneLink(12), 4..6));
        assert_eq!(fault("1 0"), (LappingFault::NoSeparator, 2..3));
        assert_eq!(fault("1-0/1-2//3-4 "), (LappingFault::AfterEnd, 9..12));
        assert_eq!(fault("1-0-0-0-0"), (LappingFault::TooManyLinks(5), 0..9));
        assert_eq!(fault("0-4097"), (LappingFault::GapTooHigh("4097".into()), 2..6));
        assert_eq!(
            fault("0-99999999999999999999"),
            (LappingFault::GapTooHigh("99999999999999999999".into()), 2..22)
        );
        assert_eq!(fault("1-0/0-3//"), (LappingFault::OverlapTooWide(3), 4..7));
    }

    #[test]
    fn raschel_numbers_are_halved() {
        let raschel = Chain::parse("2-0/2-4//", Numbering::Raschel).unwrap();
        assert_eq!(raschel.to_string(), "1-0/1-2//");
        let odd = Chain::parse("2-1//", Numbering::Raschel).unwrap_err();
        assert_eq!((odd.fault, odd.span), (LappingFault::OddRaschelGap(1), 2..3));
    }

    #[test]
    fn tempi_are_timing_steps_without_geometry() {
        let tempi = Chain::parse("1-0-0/1-2-2//", Numbering::Tricot).unwrap();
        assert_eq!(tempi, Chain::parse("1-0/1-2//", Numbering::Tricot).unwrap());
    }

    #[test]
    fn laps_open_and_close() {
        let closed = Chain::parse("1-0/1-2//", Numbering::Tricot).unwrap();
        assert!(closed.is_closed(0) && closed.is_closed(1));
        let open = Chain::parse("0-1/2-1//", Numbering::Tricot).unwrap();
        assert!(!open.is_closed(0) && !open.is_closed(1));
        let pillar = Chain::parse("1-0/0-1//", Numbering::Tricot).unwrap();
        assert_eq!((pillar.underlap(0), pillar.underlap(-1), pillar.is_closed(0)), (0, 0, false));
    }

    proptest! {
        #[test]
        fn print_and_parse_round_trip(laps in prop::collection::vec((0..=MAX_GAP, -2..=2), 1..40)) {
            let lap = |(from, by): (i32, i32)| Lap { from, to: (from + by).clamp(0, MAX_GAP) };
            let laps = laps.into_iter().map(lap).collect();
            let chain = Chain { laps };
            prop_assert_eq!(Chain::parse(&chain.to_string(), Numbering::Tricot).unwrap(), chain);
        }

        #[test]
        fn no_text_panics(text in "[0-9/,\\- xé]{0,60}|.{0,40}") {
            if let Err(error) = Chain::parse(&text, Numbering::Raschel) {
                prop_assert!(error.span.start <= error.span.end && error.span.end <= text.len());
                prop_assert!(text.is_char_boundary(error.span.start));
                prop_assert!(text.is_char_boundary(error.span.end));
            }
        }
    }
}
