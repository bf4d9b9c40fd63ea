//! The curve parameters of a stitch's rings: St segments, evenly spaced in the stitch's parameter.
//!
//! In: a number of spans and St. Out: for each span the parameters of the rings on it. Tubes and
//! centre lines both use it, so a line passes through the middles of the rings. Cost: nothing for a
//! stitch of as many spans as the one before.

use crate::ids::index32;
use crate::number::narrow;

/// The ring parameters of a stitch. They depend only on the number of spans. It is the same for
/// nearly all stitches of a yarn, so they are kept from stitch to stitch.
#[derive(Default)]
pub(super) struct Steps {
    /// The parameter within its span, in 0..1, of each ring, span after span.
    parameters: Vec<f32>,
    /// The end of each span's entries in `parameters`.
    ends: Vec<usize>,
}

impl Steps {
    /// Computes the parameters of St segments over so many spans.
    pub(super) fn fit(&mut self, spans: usize, st: u32) {
        if self.ends.len() == spans && self.parameters.len() == st as usize + 1 {
            return;
        }
        let length = f64::from(index32(spans)) / f64::from(st);
        self.parameters.clear();
        self.ends.clear();
        for span in 0..spans {
            let start = f64::from(index32(span));
            // A ring on the border of two spans is the start of the later one. The very last ring
            // has no later span, so it is the end of the last one.
            let is_last = span + 1 == spans;
            for step in index32(self.parameters.len())..=st {
                let parameter = length * f64::from(step);
                if parameter >= start + 1.0 && !is_last {
                    break;
                }
                self.parameters.push(narrow(parameter - start));
            }
            self.ends.push(self.parameters.len());
        }
    }

    /// The ring parameters of each span, in order.
    pub(super) fn per_span(&self) -> impl Iterator<Item = &[f32]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.parameters[start..end])
    }
}
