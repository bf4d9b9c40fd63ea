//! Guide bars: a lapping, a threading and a yarn; and what else brings yarns, wefts, feeders and
//! the strands of laid cloth.

use super::error::Fault;
use super::lapping::{Chain, Numbering};
use super::threading::Threading;
use super::yarn::Yarn;

/// What stands for a lapping where straight wefts are laid in.
const WEFT: &str = "weft";

/// A guide bar, or what lays wefts in.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// Its lapping, numbered from x = 0 upward; `0-0//` for what doesn't lap.
    pub chain: Chain,
    /// Which of its guides carry a yarn; for a weft and a feeder, which courses get one.
    pub threading: Threading,
    /// The yarn they carry.
    pub yarn: Yarn,
    /// What lays its yarns.
    pub kind: BarKind,
}

/// What lays a bar's yarns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BarKind {
    /// A guide bar, which laps.
    #[default]
    Guide,
    /// Weft insertion: straight yarns across the whole width, in the layer of an inlay.
    Weft,
    /// A feeder of a weft-knitting machine: a yarn across the whole width that loops on every
    /// needle, as the fabric's motif says.
    Feeder,
    /// Nothing: the yarn lies as its path in [`super::Fabric::paths`] says, and goes on along the
    /// wales.
    LaidAlong,
    /// The same, and goes on across the wales.
    LaidAcross,
}

impl BarKind {
    /// Whether yarns go on across the wales and not along them.
    #[must_use]
    pub fn runs_across(self) -> bool {
        matches!(self, Self::Weft | Self::Feeder | Self::LaidAcross)
    }
}

impl Bar {
    /// Whether one of this bar's yarns makes a loop on the needle of `wale` in `course`.
    #[must_use]
    pub fn loops_on(&self, wale: i64, course: i64) -> bool {
        match self.kind {
            BarKind::Weft | BarKind::LaidAlong | BarKind::LaidAcross => return false,
            BarKind::Feeder => return self.threading.carries(course),
            BarKind::Guide => {}
        }
        let lap = self.chain.lap(course);
        let needles = i64::from(lap.needle())..i64::from(lap.from.max(lap.to));
        needles.into_iter().any(|needle| self.threading.carries(wale - needle))
    }

    /// Courses and wales after which this bar and another repeat together.
    #[must_use]
    pub fn repeat_with(&self, other: &Self) -> [usize; 2] {
        [
            super::least_common_multiple(self.courses(), other.courses()),
            super::least_common_multiple(self.guides(), other.guides()),
        ]
    }

    /// Courses after which it laps, or lays wefts in, as before.
    #[must_use]
    pub fn courses(&self) -> usize {
        match self.kind {
            BarKind::Guide => self.chain.laps().len(),
            BarKind::Weft | BarKind::Feeder => self.threading.repeat(),
            BarKind::LaidAlong | BarKind::LaidAcross => 1,
        }
    }

    /// Guides after which it is threaded as before: a weft's threading counts no guides.
    #[must_use]
    pub fn guides(&self) -> usize {
        match self.kind {
            BarKind::Guide => self.threading.repeat(),
            BarKind::Weft | BarKind::Feeder | BarKind::LaidAlong | BarKind::LaidAcross => 1,
        }
    }

    /// Whether the drive is on the left, so that a designer writes its gaps with the other sign.
    ///
    /// Only a chain read with its drive on the left has gaps below 0.
    #[must_use]
    pub fn counts_from_left(&self) -> bool {
        self.chain.gaps().0 < 0
    }

    /// Its lapping as a designer writes it: the chain with gaps counted from the drive, or `weft`;
    /// for a feeder its courses, for a laid strand where it goes on.
    #[must_use]
    pub fn lapping(&self) -> String {
        match self.kind {
            BarKind::Guide => self.written_chain().to_string(),
            BarKind::Weft => WEFT.to_owned(),
            BarKind::Feeder => format!("courses {}", self.threading),
            BarKind::LaidAlong => "along".to_owned(),
            BarKind::LaidAcross => "across".to_owned(),
        }
    }

    /// The chain with gaps counted from the drive, never below 0.
    #[must_use]
    pub fn written_chain(&self) -> Chain {
        if self.counts_from_left() { self.chain.mirrored() } else { self.chain.clone() }
    }
}

impl Bar {
    /// A feeder that knits the courses that are marked.
    pub(super) fn feeder(courses: Threading, yarn: Yarn) -> Self {
        Self { chain: staying(), threading: courses, yarn, kind: BarKind::Feeder }
    }

    /// A strand of laid cloth.
    #[must_use]
    pub fn laid(kind: BarKind, yarn: Yarn) -> Self {
        Self { chain: staying(), threading: Threading::full(), yarn, kind }
    }
}

/// The chain of what doesn't lap.
fn staying() -> Chain {
    Chain::parse("0-0//", Numbering::default()).expect("the chain that stays where it is")
}

/// Reads a lapping: a chain, or `weft`. `what` names it in the fault.
pub(super) fn read_lapping(
    what: &str,
    text: &str,
    numbering: Numbering,
) -> Result<(BarKind, Chain), Fault> {
    let weft = text.trim() == WEFT;
    let kind = if weft { BarKind::Weft } else { BarKind::Guide };
    match Chain::parse(if weft { "0-0//" } else { text }, numbering) {
        Ok(chain) => Ok((kind, chain)),
        Err(why) => Err(Fault::Lapping { what: what.to_owned(), text: text.to_owned(), why }),
    }
}

/// Reads a threading. `what` names it in the fault.
pub(super) fn read_threading(what: &str, text: &str) -> Result<Threading, Fault> {
    Threading::parse(text).map_err(|why| Fault::Threading {
        what: what.to_owned(),
        text: text.to_owned(),
        why,
    })
}
