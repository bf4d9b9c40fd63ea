//! Finished edges: open ones are hemmed, and sewn ones get seam allowances, with their threads.
//!
//! In: a [`Garment`] and [`Sizes`]. Out: [`Finished`], the garment with the cloth that its edges turn
//! in as further panels, and the sewing threads.
//!
//! Method: `border` tells sewn borders from open ones, `rail` finds the way into the panel along them,
//! `band` folds cloth behind the panel there, and `thread` sews it. A panel that is hardly deeper than
//! two hems and sewn at its far side is doubled as a whole, as a neckband is.
//!
//! Cost: 1 µs a triangle of the garment, and some 10 µs for each 2.5 mm of edge, shared among threads.
//! Not promised: that turned-in cloth keeps off a body, or that yarns go on round the fold.

mod band;
mod border;
mod rail;
mod thread;

use glam::DVec2;
use rayon::prelude::*;

use crate::garment::{Garment, Panel};
use crate::locate::Locator;
use border::{BorderRun, from_segment, runs};
use rail::{Rail, Sheet};
pub use thread::Thread;

/// Depth of a hem, mm: that of T-shirts.
const HEM: f64 = 20.0;
/// Width of a seam's allowance, mm: that of an overlock.
const ALLOWANCE: f64 = 5.0;
/// Panels up to so many hems deep are too narrow for a hem.
const NARROW: f64 = 2.5;
/// Share of a narrow panel's depth that its edges turn in.
const TURNED_IN: f64 = 1.0 / 3.0;
/// Distances of a hem's two rows of stitches from its inner edge, mm.
const ROWS: [f64; 2] = [6.5, 1.5];
/// Reach of an overlock from the edge of an allowance, mm.
const OVERLOCK: f64 = 3.0;
/// Smallest depth of cloth that is turned in, mm. Less can't be sewn.
const SHALLOWEST: f64 = 2.0;
/// Distance from a border, mm, at which a place is at it.
const AT_BORDER: f64 = 2.0;

/// What finished edges have to know of the cloth, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sizes {
    /// Distance of its technical face from its middle.
    pub face: f64,
    /// Distance of its technical back from its middle.
    pub back: f64,
    /// Radius of the sewing thread.
    pub thread: f64,
}

/// A garment with finished edges.
#[derive(Clone, Debug)]
pub struct Finished {
    /// The garment. Panels that its edges turn in follow its own ([`Panel::turned_in`]).
    pub garment: Garment,
    /// Sewing threads.
    pub threads: Vec<Thread>,
}

/// What a garment's edges are, open or sewn, and how they are finished. It is the same in all drapes
/// of a garment, so a hem stays a hem where cloth touches cloth in some of them.
#[derive(Clone, Debug)]
pub struct Edges {
    /// Of each panel.
    runs: Vec<Vec<BorderRun>>,
    sizes: Sizes,
}

impl Edges {
    /// The edges of a garment.
    #[must_use]
    pub fn new(garment: &Garment, sizes: Sizes) -> Self {
        let locators: Vec<_> = garment.panels.par_iter().map(Locator::new).collect();
        Self { runs: runs(&garment.panels, &locators), sizes }
    }

    /// Finishes all edges of the garment, in this drape or another one.
    ///
    /// ```
    /// use warpknit_core::edges::{Edges, Sizes};
    /// use warpknit_core::garment::Garment;
    /// let garment = Garment::rectangle(300.0, 200.0);
    /// let edges = Edges::new(&garment, Sizes { face: 0.25, back: 0.25, thread: 0.1 });
    /// let finished = edges.finish(&garment);
    /// // A hem on each side, each with three threads.
    /// assert_eq!((finished.garment.panels.len(), finished.threads.len()), (1 + 4, 3 * 4));
    /// ```
    #[must_use]
    pub fn finish(&self, garment: &Garment) -> Finished {
        let locators: Vec<_> = garment.panels.par_iter().map(Locator::new).collect();
        let sheets: Vec<_> = (garment.panels.par_iter().zip(&locators).enumerate())
            .map(|(number, (panel, locator))| Sheet::new(number, panel, locator))
            .collect();
        let all: Vec<_> = sheets
            .iter()
            .zip(&self.runs)
            .flat_map(|(sheet, runs)| runs.iter().map(move |run| (sheet, runs, run)))
            .collect();
        let edges: Vec<_> = all
            .par_iter()
            .map(|(sheet, runs, run)| FinishedEdge::new(sheet, run, runs, &self.sizes))
            .collect();
        let mut finished = Finished { garment: garment.clone(), threads: Vec::new() };
        for FinishedEdge { band, threads } in edges {
            finished.garment.panels.extend(band);
            finished.threads.extend(threads);
        }
        finished
    }
}

/// A finished edge.
#[derive(Default)]
struct FinishedEdge {
    /// The cloth that is turned in.
    band: Option<Panel>,
    threads: Vec<Thread>,
}

/// How an edge is finished.
enum TurnedEdge {
    /// Turned in so deep and sewn.
    Hem(f64),
    /// Turned in as far as the panel goes.
    Doubled,
    /// Turned in so deep, with an overlock around its edge.
    Allowance(f64),
}

impl FinishedEdge {
    /// Finishes a run of a panel's border. `all` are all of the panel's.
    fn new(sheet: &Sheet<'_>, run: &BorderRun, all: &[BorderRun], sizes: &Sizes) -> Self {
        let rail = Rail::new(sheet, run, HEM, NARROW * HEM);
        let finish = TurnedEdge::of(sheet, run, &rail, all);
        let wanted = match finish {
            TurnedEdge::Hem(depth) | TurnedEdge::Allowance(depth) => depth,
            TurnedEdge::Doubled => f64::INFINITY,
        };
        if wanted < SHALLOWEST {
            return Self::default();
        }
        let depths: Vec<f64> =
            rail.stations.iter().map(|station| wanted.min(station.reach)).collect();
        let gap = 2.0 * sizes.back;
        let band = band::band(sheet, &rail, &depths, gap);
        // The technical face of what is turned in looks away from the panel.
        let (above, behind) =
            (sizes.face + sizes.thread / 2.0, -gap - sizes.face - sizes.thread / 2.0);
        let threads = match finish {
            TurnedEdge::Hem(depth) => {
                let rows = ROWS.map(|row| depth - row).map(|row| row.max(depth / 2.0));
                let needles = rows
                    .iter()
                    .flat_map(|&row| thread::needle(sheet, &rail, row, [-sizes.back, above]));
                needles.chain(thread::looper(sheet, &rail, rows, behind)).collect()
            }
            TurnedEdge::Allowance(depth) => {
                let near = (depth - OVERLOCK).max(depth / 2.0);
                thread::looper(sheet, &rail, [near, depth], behind)
            }
            TurnedEdge::Doubled => Vec::new(),
        };
        Self { band, threads }
    }
}

impl TurnedEdge {
    fn of(sheet: &Sheet<'_>, run: &BorderRun, rail: &Rail, all: &[BorderRun]) -> Self {
        let reach = rail.median_reach();
        let is_narrow = reach < NARROW * HEM;
        if run.is_sewn {
            return Self::Allowance(if is_narrow {
                ALLOWANCE.min(TURNED_IN * reach)
            } else {
                ALLOWANCE
            });
        }
        if !is_narrow {
            return Self::Hem(HEM);
        }
        let middle = rail.at(rail.length() / 2.0);
        let far_side = middle.map(|middle| middle.flat + middle.inward * middle.reach);
        if far_side.is_some_and(|place| is_sewn_at(sheet.panel, all, place)) {
            Self::Doubled
        } else {
            Self::Hem(TURNED_IN * reach)
        }
    }
}

/// Whether a flat place lies at a sewn border of its panel.
fn is_sewn_at(panel: &Panel, runs: &[BorderRun], place: DVec2) -> bool {
    let vertex = |vertex: u32| panel.uv[vertex as usize].extend(0.0);
    let mut sewn = runs.iter().filter(|run| run.is_sewn).flat_map(|run| run.vertices.windows(2));
    sewn.any(|ends| from_segment(place.extend(0.0), [vertex(ends[0]), vertex(ends[1])]) < AT_BORDER)
}

#[cfg(test)]
mod tests;
