//! Which spans of a repeat lie near which others, and what each span keeps.
//!
//! In: the repeat at rest. Out: [`Neighbours`], the partners of each span, for yarns laid many times
//! over a panel. Cost: as one neighbour list of the solver.

use super::StrainTable;
use super::rest::RestYarn;
use super::solver;
use crate::yarn::curve;

/// A span near another one, counted from that one's cell of the endless cloth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct NearSpan {
    /// Its yarn in the repeat.
    pub(crate) yarn: u32,
    /// The data point of the repeat at which it starts.
    pub(crate) point: u32,
    /// Cells to the right and up.
    pub(crate) cells: [i32; 2],
}

/// The spans of a repeat.
#[derive(Clone, Debug)]
pub(crate) struct Neighbours {
    pub(crate) yarns: Vec<RestYarn>,
    /// For each data point, the spans near the one that starts there.
    pub(crate) near: Vec<Vec<NearSpan>>,
    /// Length of the span that starts at each data point, mm.
    pub(crate) lengths: Vec<f64>,
    /// How far that span's curve leaves its chord, mm.
    pub(crate) bulges: Vec<f64>,
    /// Distance over touching that yarns keep.
    pub(crate) target: f64,
    /// Whether the repeat has no table of strains, so that sweeps have all to do.
    pub(crate) is_flat_only: bool,
}

impl StrainTable {
    /// The spans of the repeat that are near each other when the cloth is flat, and those that
    /// strains bring near. `cutoff` is their distance over touching.
    pub(crate) fn neighbours(&self, cutoff: f64) -> Neighbours {
        let rest = &self.rest;
        let (near, bulges) = solver::near_spans(rest, cutoff);
        let lengths = rest.spans.iter().map(|span| curve::span(&rest.control(span), 1).length());
        Neighbours {
            yarns: rest.yarns.clone(),
            near,
            lengths: lengths.collect(),
            bulges,
            target: rest.target,
            is_flat_only: self.is_flat_only(),
        }
    }
}
