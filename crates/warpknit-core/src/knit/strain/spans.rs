//! What each span of a repeat keeps, for yarns laid many times over a panel.
//!
//! In: the repeat at rest. Out: [`RepeatSpans`]. Cost: some nanoseconds a span.

use super::StrainTable;
use super::rest::RestYarn;
use super::solver;
use crate::yarn::curve;

/// The spans of a repeat.
#[derive(Clone, Debug)]
pub(crate) struct RepeatSpans {
    pub(crate) yarns: Vec<RestYarn>,
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
    /// The spans of the repeat when the cloth is flat.
    pub(crate) fn spans(&self) -> RepeatSpans {
        let rest = &self.rest;
        let lengths = rest.spans.iter().map(|span| curve::span(&rest.control(span), 1).length());
        RepeatSpans {
            yarns: rest.yarns.clone(),
            lengths: lengths.collect(),
            bulges: solver::bulges(rest),
            target: rest.target,
            is_flat_only: self.is_flat_only(),
        }
    }
}
