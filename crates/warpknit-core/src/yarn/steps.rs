//! Where rings of a tube, and points of a centre line, stand on the spans of a stitch: St segments,
//! evenly in the stitch's own parameter.

use crate::ids::index32;
use crate::number::narrow;

/// Where on its spans the rings of a stitch stand: the same for all stitches of as many spans,
/// which is nearly all of a yarn's.
#[derive(Default)]
pub(super) struct Steps {
    /// The share of its span at each ring, span after span.
    shares: Vec<f32>,
    /// The end of each span's.
    ends: Vec<usize>,
}

impl Steps {
    /// For St segments over so many spans. The very last ring is the last span's end, not the start
    /// of one more.
    pub(super) fn fit(&mut self, spans: usize, st: u32) {
        if self.ends.len() == spans && self.shares.len() == st as usize + 1 {
            return;
        }
        let length = f64::from(index32(spans)) / f64::from(st);
        self.shares.clear();
        self.ends.clear();
        for span in 0..spans {
            let start = f64::from(index32(span));
            let parameters = (index32(self.shares.len())..=st).map(|step| length * f64::from(step));
            let own =
                parameters.take_while(|&parameter| parameter < start + 1.0 || span + 1 == spans);
            self.shares.extend(own.map(|parameter| narrow(parameter - start)));
            self.ends.push(self.shares.len());
        }
    }

    pub(super) fn of_spans(&self) -> impl Iterator<Item = &[f32]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.shares[start..end])
    }
}
