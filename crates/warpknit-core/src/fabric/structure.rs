//! How the yarns of a cloth are arranged: a warp knit, a weft knit or laid cloth, each with the
//! data that only it has.
//!
//! A yarn system is a set of equal yarns that one device brings: a guide bar, a feeder, or one
//! strand of laid cloth. Systems are numbered from 0, front first. Everything that is known of
//! every cloth is a method of [`Fabric`](super::Fabric). Where the kinds differ, code matches on
//! [`Structure`] without a catch-all arm, so that the compiler lists the places which a new kind
//! must fill in.

use std::fmt;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::bar::Bar;
use super::dimensions::Dimensions;
use super::motif::Motif;
use super::threading::Threading;
use super::yarn::Yarn;
use crate::ids::index32;

/// How the yarns of a cloth are arranged.
///
/// ```
/// use warpknit_core::fabric::{Fabric, Structure};
/// let yarns = match &Fabric::named("jersey")?.structure {
///     Structure::Warp(knit) => knit.bars.len(),
///     Structure::Weft(knit) => knit.feeders.len(),
///     Structure::Laid(cloth) => cloth.strands.len(),
/// };
/// assert_eq!(yarns, 1);
/// # Ok::<(), warpknit_core::fabric::FabricError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Structure {
    /// Guide bars lap their yarns along the wales.
    Warp(WarpKnit),
    /// Feeders bring yarns along the courses, and every needle forms its loop from them.
    Weft(WeftKnit),
    /// Nothing knits: yarns lie on paths that the file gives, as in woven cloth.
    Laid(LaidCloth),
}

/// A warp knit: guide bars lap their yarns around the needles.
#[derive(Clone, Debug, PartialEq)]
pub struct WarpKnit {
    /// Guide bars, front first (bar 1 = front guide bar, nearest the technical back).
    pub bars: Vec<Bar>,
    /// The shape of its loops.
    pub stitch: Dimensions,
}

/// A weft knit: feeders bring yarns across the whole width, and every needle loops them as the
/// motif says.
#[derive(Clone, Debug, PartialEq)]
pub struct WeftKnit {
    /// Which loop stands where.
    pub motif: Motif,
    /// Feeders; each course is knitted by exactly one of them.
    pub feeders: Vec<Feeder>,
}

/// A feeder of a weft-knitting machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Feeder {
    /// The courses that it knits, one mark a course.
    pub courses: Threading,
    /// The yarn that it brings.
    pub yarn: Yarn,
}

/// Laid cloth: strands that lie as their paths say, in cells of one wale and one course.
#[derive(Clone, Debug, PartialEq)]
pub struct LaidCloth {
    /// The strands of one cell.
    pub strands: Vec<LaidStrand>,
}

/// A yarn of laid cloth.
#[derive(Clone, Debug, PartialEq)]
pub struct LaidStrand {
    /// Points of the yarn in its cell: x and y in cells, counted from the lower left corner, z in
    /// mm before [`Fabric::enlargement`](super::Fabric::enlargement). From the last point the yarn
    /// goes on to the first one of the next cell.
    pub path: Vec<DVec3>,
    /// In which cell that next one is.
    pub direction: StrandDirection,
    /// The yarn.
    pub yarn: Yarn,
}

/// In which direction a laid strand goes on from cell to cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StrandDirection {
    /// Along the wales, upward.
    Along,
    /// Across the wales, to the right.
    Across,
}

impl StrandDirection {
    /// The way from a cell to the next one, cells.
    #[must_use]
    pub fn step(self) -> DVec3 {
        match self {
            Self::Along => DVec3::Y,
            Self::Across => DVec3::X,
        }
    }
}

impl fmt::Display for StrandDirection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Along => "along",
            Self::Across => "across",
        })
    }
}

impl Structure {
    /// How many yarn systems there are: bars, feeders or strands.
    #[must_use]
    pub fn yarn_systems(&self) -> usize {
        match self {
            Self::Warp(knit) => knit.bars.len(),
            Self::Weft(knit) => knit.feeders.len(),
            Self::Laid(cloth) => cloth.strands.len(),
        }
    }

    /// Stitches for each wale and course: one for each system whose guides are all threaded, a half
    /// for one that is half-set.
    #[must_use]
    pub fn stitches_per_cell(&self) -> f64 {
        match self {
            Self::Warp(knit) => knit.bars.iter().map(|bar| bar.threading.share()).sum(),
            Self::Weft(knit) => knit.feeders.iter().map(|feeder| feeder.courses.share()).sum(),
            Self::Laid(cloth) => f64::from(index32(cloth.strands.len())),
        }
    }

    /// The yarn of a system.
    ///
    /// # Panics
    /// If there is no such system.
    #[must_use]
    pub fn yarn(&self, system: usize) -> &Yarn {
        match self {
            Self::Warp(knit) => &knit.bars[system].yarn,
            Self::Weft(knit) => &knit.feeders[system].yarn,
            Self::Laid(cloth) => &cloth.strands[system].yarn,
        }
    }

    /// The yarns of all systems, to be changed.
    pub fn yarns_mut(&mut self) -> impl ExactSizeIterator<Item = &mut Yarn> {
        // The three lists hold different types, so their references are collected into one.
        let yarns: Vec<&mut Yarn> = match self {
            Self::Warp(knit) => knit.bars.iter_mut().map(|bar| &mut bar.yarn).collect(),
            Self::Weft(knit) => knit.feeders.iter_mut().map(|feeder| &mut feeder.yarn).collect(),
            Self::Laid(cloth) => cloth.strands.iter_mut().map(|strand| &mut strand.yarn).collect(),
        };
        yarns.into_iter()
    }

    /// Whether a system's yarns run across the wales, as those of wefts and feeders do, and not
    /// along them.
    ///
    /// # Panics
    /// If there is no such system.
    #[must_use]
    pub fn runs_across(&self, system: usize) -> bool {
        match self {
            // Guides lead their yarns along the wales; wefts have no guides.
            Self::Warp(knit) => knit.bars[system].chain().is_none(),
            Self::Weft(_) => true,
            Self::Laid(cloth) => cloth.strands[system].direction == StrandDirection::Across,
        }
    }

    /// How a system is laid, as a designer writes it: the chain of a bar or `weft`, the courses of
    /// a feeder such as `courses I.`, or the direction of a strand, `along` or `across`.
    ///
    /// # Panics
    /// If there is no such system.
    #[must_use]
    pub fn lapping(&self, system: usize) -> String {
        match self {
            Self::Warp(knit) => knit.bars[system].lapping(),
            Self::Weft(knit) => format!("courses {}", knit.feeders[system].courses),
            Self::Laid(cloth) => cloth.strands[system].direction.to_string(),
        }
    }

    /// How many loops the needle of a wale forms in a course, one a thread.
    #[must_use]
    pub fn threads_on(&self, wale: i64, course: i64) -> usize {
        match self {
            Self::Warp(knit) => knit.threads_on(wale, course),
            Self::Weft(knit) => knit.feeders_of(course),
            Self::Laid(_) => 0,
        }
    }

    /// Courses after which all systems repeat together.
    #[must_use]
    pub fn repeat(&self) -> usize {
        match self {
            Self::Warp(knit) => knit.bars.iter().map(Bar::courses).fold(1, least_common_multiple),
            Self::Weft(knit) => {
                let courses = knit.feeders.iter().map(|feeder| feeder.courses.repeat());
                courses.fold(knit.motif.courses(), least_common_multiple)
            }
            Self::Laid(_) => 1,
        }
    }

    /// Wales after which all systems repeat together: the guides of all threadings in a warp knit,
    /// the wales of the motif in a weft knit. Wefts count courses and no guides.
    #[must_use]
    pub fn threading_repeat(&self) -> usize {
        match self {
            Self::Warp(knit) => knit.bars.iter().map(Bar::guides).fold(1, least_common_multiple),
            Self::Weft(knit) => knit.motif.wales(),
            Self::Laid(_) => 1,
        }
    }

    /// The most gaps between the lowest and the highest that one bar's guides take; 0 where no
    /// guides lap.
    #[must_use]
    pub fn widest_lapping(&self) -> u32 {
        match self {
            Self::Warp(knit) => {
                let widths = knit.bars.iter().map(Bar::gaps).map(|(low, high)| high.abs_diff(low));
                widths.max().unwrap_or(0)
            }
            Self::Weft(_) | Self::Laid(_) => 0,
        }
    }

    /// The lowest gap of all bars; 0 where no guides lap.
    #[must_use]
    pub fn lowest_gap(&self) -> i32 {
        match self {
            Self::Warp(knit) => knit.bars.iter().map(|bar| bar.gaps().0).min().unwrap_or(0),
            Self::Weft(_) | Self::Laid(_) => 0,
        }
    }
}

impl WarpKnit {
    /// How many loops the needle of a wale forms in a course. A bar that laps two needles at once
    /// may form two of them.
    #[must_use]
    pub fn threads_on(&self, wale: i64, course: i64) -> usize {
        self.bars.iter().map(|bar| bar.loop_count(wale, course)).sum()
    }
}

impl WeftKnit {
    /// How many feeders knit a course.
    pub(super) fn feeders_of(&self, course: i64) -> usize {
        self.feeders.iter().filter(|feeder| feeder.courses.carries(course)).count()
    }
}

/// The least number that both divide. It saturates: whoever asks refuses large ones.
pub(super) fn least_common_multiple(a: usize, b: usize) -> usize {
    // Euclid's algorithm: x ends as the greatest common divisor.
    let (mut x, mut y) = (a, b);
    while y != 0 {
        (x, y) = (y, x % y);
    }
    (a / x).saturating_mul(b)
}
