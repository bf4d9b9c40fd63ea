//! Swept yarns, measured where a run holds those of a whole panel.
//!
//! In: the swept blocks of one panel. Out: the [`BodyClearance`] of its yarns. Strands are cut into
//! chunks, and each patch lists those that are near it, so a strand is not walked once for every
//! patch. Cost: 13 to 20 µs a stitch, and some 20 bytes a stitch for the lists.

use std::ops::Range;

use glam::{DVec2, DVec3, Vec3Swizzles};

use super::BodyClearance;
use super::measure::{Measure, Workplace, whole_stitches};
use super::patch::{ClothPatch, Patches};
use crate::drape::Block;
use crate::ids::index32;

/// Spans of a chunk. Two parts of a strand in one patch that a chunk beyond it parts count as two
/// strands, so a chunk is longer than the few radii within which a strand is not compared with
/// itself. Much longer ones reach into patches that they hardly touch.
const CHUNK: usize = 16;

/// Consecutive spans of a strand that are near a patch.
#[derive(Clone, Debug)]
struct StrandPart {
    block: u32,
    /// Its number in the block.
    strand: u32,
    /// Counted from the strand's first point.
    spans: Range<u32>,
}

/// The strands of one panel, sorted by the patches that they are near.
pub(super) struct PanelStrands<'a> {
    measure: &'a Measure<'a>,
    blocks: &'a [Block],
    /// The numbers of the panel's patches.
    numbers: Range<usize>,
    /// For each of them the parts of strands near it.
    parts: Vec<Vec<StrandPart>>,
}

impl<'a> PanelStrands<'a> {
    /// Sorts the strands of some blocks, all of one panel.
    pub(super) fn new(measure: &'a Measure<'a>, blocks: &'a [Block]) -> Self {
        let panel = blocks.first().map_or(0, |block| block.panel);
        let numbers = measure.patches.of_panel(panel);
        let mut parts = vec![Vec::new(); numbers.len()];
        for (number, block) in blocks.iter().enumerate() {
            add_parts(block, index32(number), &measure.patches, &mut parts);
        }
        Self { measure, blocks, numbers, parts }
    }

    /// Measures the panel.
    pub(super) fn measure(&self) -> BodyClearance {
        let add = |number: usize, patch: &ClothPatch, place: &mut Workplace| {
            for part in &self.parts[number - self.numbers.start] {
                let block = &self.blocks[part.block as usize];
                let strand = &block.strands.strands[part.strand as usize];
                let spans = part.spans.start as usize..part.spans.end as usize;
                self.measure.add_arcs(block, strand, spans, &patch.area, place);
            }
        };
        self.measure.all(self.numbers.clone(), add, &mut |_done| ())
    }
}

/// Adds the strands of a block to the lists of the patches that they are near.
fn add_parts(block: &Block, number: u32, patches: &Patches, parts: &mut [Vec<StrandPart>]) {
    for (strand_number, strand) in (0u32..).zip(&block.strands.strands) {
        let flat = &block.strands.flat[strand.range()];
        let whole = whole_stitches(&block.strands, strand);
        for start in whole.clone().step_by(CHUNK) {
            let end = (start + CHUNK).min(whole.end);
            for patch in patches.around(block.panel, bounds(&flat[start..=end])) {
                let (start, end) = (index32(start), index32(end));
                match parts[patch].last_mut() {
                    Some(last)
                        if (last.block, last.strand, last.spans.end)
                            == (number, strand_number, start) =>
                    {
                        last.spans.end = end;
                    }
                    _ => parts[patch].push(StrandPart {
                        block: number,
                        strand: strand_number,
                        spans: start..end,
                    }),
                }
            }
        }
    }
}

/// A box on the flat panel around the arcs of some spans: around their ends, and as much wider as
/// the longest span.
fn bounds(points: &[DVec3]) -> [DVec2; 2] {
    let longest = points.windows(2).map(|ends| ends[0].distance(ends[1])).fold(0.0, f64::max);
    let places = points.iter().map(|point| point.xy());
    let (low, high) = places.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), place| {
        (low.min(place), high.max(place))
    });
    [low - longest, high + longest]
}
