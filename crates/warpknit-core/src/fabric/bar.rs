//! Guide bars of a warp knit: a lapping, a threading and a yarn; or wefts that are laid in.

use super::error::FabricFault;
use super::file::Limits;
use super::lapping::{Chain, Numbering};
use super::threading::Threading;
use super::yarn::Yarn;

/// What stands for a lapping where straight wefts are laid in.
const WEFT: &str = "weft";

/// A guide bar, or a device that lays wefts in.
#[derive(Clone, Debug, PartialEq)]
pub struct Bar {
    /// How its yarns are laid.
    pub lay: Lay,
    /// Which of its guides carry a yarn; for wefts, which courses get one.
    pub threading: Threading,
    /// Yarn that each of its guides is fed, mm a rack of 480 courses, where it is given: it sets
    /// the length of its loops or inlays. Wefts have none.
    pub run_in: Option<f64>,
    /// How much longer than straight its yarns lie, as a share, where it is given: for inlays and
    /// wefts, which otherwise lie straight under tension.
    pub slack: Option<f64>,
    /// The yarn that they carry.
    pub yarn: Yarn,
}

/// Courses of a rack, the unit in which warp knitters state run-in.
pub(crate) const RACK: f64 = 480.0;
/// Run-ins that are taken. Tricots take 1 to 3 m a rack, the coarsest cloth that can be described
/// some hundred times as much.
pub(super) const RUN_IN: Limits = (1.0, 1e6, "mm a rack of 480 courses");

/// How a bar lays its yarns.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Lay {
    /// Guides lap as the chain says, numbered from x = 0 upward.
    Lapping(Chain),
    /// Weft insertion: straight yarns across the whole width, in the layer of an inlay.
    Weft,
}

impl Bar {
    /// The chain of its guides; none for wefts.
    #[must_use]
    pub fn chain(&self) -> Option<&Chain> {
        match &self.lay {
            Lay::Lapping(chain) => Some(chain),
            Lay::Weft => None,
        }
    }

    /// Whether none of its yarns is ever knitted: all are laid in.
    #[must_use]
    pub fn is_inlay(&self) -> bool {
        self.chain().is_none_or(Chain::is_inlay)
    }

    /// Whether it lays drafted yarns into single ribs: in these they lie straight, and the loops
    /// stand by turns on both sides. Over several wales they would draw the cloth together.
    #[must_use]
    pub fn is_pulled_straight(&self) -> bool {
        let (low, high) = self.gaps();
        self.is_inlay() && self.chain().is_some() && self.yarn.draft.is_some() && high - low <= 1
    }

    /// Why its run-in and its slack can't both be as they are, if they can't.
    pub(super) fn contradiction(&self) -> Option<&'static str> {
        if self.run_in.is_some() && self.chain().is_none() {
            Some("wefts have no run_in_mm, since no guide feeds them; slack makes them longer")
        } else if self.slack.is_some() && !self.is_inlay() {
            Some("slack is for yarns that are laid in, and this bar knits: it takes run_in_mm")
        } else if self.slack.is_some() && self.run_in.is_some() {
            Some("its length is given twice: leave either run_in_mm or slack out")
        } else {
            None
        }
    }

    /// Lowest and highest gap of its guides. Wefts have none, and count as gap 0.
    #[must_use]
    pub fn gaps(&self) -> (i32, i32) {
        self.chain().map_or((0, 0), Chain::gaps)
    }

    /// Whether one of this bar's yarns makes a loop on the needle of `wale` in `course`.
    #[must_use]
    pub fn loops_on(&self, wale: i64, course: i64) -> bool {
        self.loop_count(wale, course) > 0
    }

    /// How many of this bar's yarns make a loop on the needle of `wale` in `course`: more than one
    /// where laps over two needles overlap.
    #[must_use]
    pub fn loop_count(&self, wale: i64, course: i64) -> usize {
        let Some(chain) = self.chain() else { return 0 };
        let lap = chain.lap(course);
        // The guide that stands n gaps to the left passes needle n of its own.
        let needles = i64::from(lap.needle())..i64::from(lap.from.max(lap.to));
        needles.filter(|needle| self.threading.carries(wale - needle)).count()
    }

    /// Courses after which its lapping, or its laying-in of wefts, repeats.
    #[must_use]
    pub fn courses(&self) -> usize {
        match &self.lay {
            Lay::Lapping(chain) => chain.laps().len(),
            Lay::Weft => self.threading.repeat(),
        }
    }

    /// Guides after which its threading repeats; the threading of wefts counts no guides.
    #[must_use]
    pub fn guides(&self) -> usize {
        match self.lay {
            Lay::Lapping(_) => self.threading.repeat(),
            Lay::Weft => 1,
        }
    }

    /// Whether its drive is on the left: see [`Chain::counts_from_left`].
    #[must_use]
    pub fn counts_from_left(&self) -> bool {
        self.chain().is_some_and(Chain::counts_from_left)
    }

    /// Its lapping as a designer writes it: the chain with gaps counted from the drive, or `weft`.
    #[must_use]
    pub fn lapping(&self) -> String {
        match &self.lay {
            Lay::Lapping(chain) => chain.as_written().to_string(),
            Lay::Weft => WEFT.to_owned(),
        }
    }

    /// Its threading as a designer writes it: guides counted from the drive.
    #[must_use]
    pub fn written_threading(&self) -> Threading {
        if self.counts_from_left() { self.threading.mirrored() } else { self.threading.clone() }
    }
}

/// Reads a lapping: a chain, or `weft`. `what` names it in the fault.
pub(super) fn read_lapping(
    what: &str,
    text: &str,
    numbering: Numbering,
) -> Result<Lay, FabricFault> {
    if text.trim() == WEFT {
        return Ok(Lay::Weft);
    }
    Chain::parse(text, numbering).map(Lay::Lapping).map_err(|why| FabricFault::Lapping {
        what: what.to_owned(),
        text: text.to_owned(),
        why,
    })
}

/// Reads a threading. `what` names it in the fault.
pub(super) fn read_threading(what: &str, text: &str) -> Result<Threading, FabricFault> {
    Threading::parse(text).map_err(|why| FabricFault::Threading {
        what: what.to_owned(),
        text: text.to_owned(),
        why,
    })
}
