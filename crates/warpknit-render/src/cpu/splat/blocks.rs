//! Blocks of pieces, binned by the tiles of the picture that they may touch.
//!
//! In: pieces and a screen. Out: [`Blocks`], 8 bytes for each tile that a block meets. All
//! boxes are computed in parallel. Entries lie in the order of the pieces for any number of
//! threads.

use std::ops::Range;

use glam::{Vec2, Vec3Swizzles};
use rayon::prelude::*;

use super::pieces::{BLOCK, SplatPieces};
use super::screen::Screen;
use super::tiles::SIDE;

/// A block in a tile.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockEntry {
    /// Smallest depth of its yarns' surfaces, not negative.
    pub(super) nearest: f32,
    /// First data point of its first piece.
    pub(super) first: u32,
}

/// The blocks of each tile.
pub(super) struct Blocks {
    /// Tiles across.
    pub(super) across: u32,
    /// First row of tiles.
    top: u32,
    /// Where each tile's entries begin.
    starts: Vec<u32>,
    entries: Vec<BlockEntry>,
}

/// A block and a tile, numbered row by row from `top` on.
type Binned = (u32, BlockEntry);

impl Blocks {
    /// Bins all blocks that meet some rows of tiles.
    pub(super) fn new(pieces: &SplatPieces, screen: &Screen, rows: Range<u32>) -> Self {
        let across = screen.size[0].div_ceil(SIDE);
        let parts: Vec<Vec<Binned>> = (pieces.parts().into_par_iter())
            .map(|(_, points)| bin(pieces, screen, points, across, &rows))
            .collect();
        let count = across as usize * rows.len();
        // Counting sort: it keeps the order of the pieces.
        let mut starts = vec![0; count + 1];
        for (tile, _) in parts.iter().flatten() {
            starts[*tile as usize + 1] += 1;
        }
        for tile in 0..count {
            starts[tile + 1] += starts[tile];
        }
        let mut next = starts.clone();
        let nothing = BlockEntry { nearest: 0.0, first: 0 };
        let mut entries = vec![nothing; starts[count] as usize];
        for part in parts {
            for (tile, entry) in part {
                entries[next[tile as usize] as usize] = entry;
                next[tile as usize] += 1;
            }
        }
        Self { across, top: rows.start, starts, entries }
    }

    /// The blocks that meet the tile in a column and row of tiles.
    pub(super) fn of(&self, column: u32, row: u32) -> &[BlockEntry] {
        let tile = ((row - self.top) * self.across + column) as usize;
        &self.entries[self.starts[tile] as usize..self.starts[tile + 1] as usize]
    }
}

/// The tiles of the blocks of some points of a strand.
fn bin(
    pieces: &SplatPieces,
    screen: &Screen,
    points: Range<u32>,
    across: u32,
    rows: &Range<u32>,
) -> Vec<Binned> {
    let mut binned = Vec::new();
    for first in points.step_by(BLOCK as usize) {
        let (mut low, mut high) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
        let mut nearest = f32::INFINITY;
        pieces.for_each_in_block(first, screen, |_, ends, silhouette| {
            let reach = screen.radius(silhouette.half_width, ends[0].z);
            for end in ends {
                low = low.min(end.xy() - reach);
                high = high.max(end.xy() + reach);
                nearest = nearest.min(end.z - silhouette.rise);
            }
        });
        let entry = BlockEntry { nearest: nearest.max(0.0), first };
        let [columns, lines] = [(low.x, high.x, 0..across), (low.y, high.y, rows.clone())]
            .map(|(low, high, all)| tiles(low, high, &all));
        for row in lines {
            let left = (row - rows.start) * across;
            binned.extend(columns.clone().map(|column| (left + column, entry)));
        }
    }
    binned.shrink_to_fit();
    binned
}

/// Columns or rows of tiles from `low` to `high`, as far as they are among `all`.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturates, as it should"
)]
fn tiles(low: f32, high: f32, all: &Range<u32>) -> Range<u32> {
    if high < 0.0 {
        return 0..0;
    }
    let [first, last] = [low, high].map(|at| (at / SIDE as f32) as u32);
    first.max(all.start)..last.saturating_add(1).min(all.end)
}
