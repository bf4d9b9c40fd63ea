//! Rows of tiles: what the cells of a part of the picture see.
//!
//! In: blocks of pieces by tile. Out: [`TileRows`], about 16 bytes for each piece that a cell sees.
//! Tiles are drawn in parallel, and none depends on another.

use std::ops::Range;

use rayon::prelude::*;

use super::blocks::Blocks;
use super::masks::HalfPlanes;
use super::pieces::SplatPieces;
use super::screen::Screen;
use super::tiles::{Fragment, SIDE, TileFragments, TileMemory};

/// Tiles of some rows.
#[derive(Debug, Default)]
pub(super) struct TileRows {
    /// Cells across.
    pub(super) width: u32,
    /// Cells down in the whole picture.
    height: u32,
    rows: Range<u32>,
    across: u32,
    tiles: Vec<TileFragments>,
}

impl TileRows {
    /// The tiles that hold some rows of cells. Tiles that `before` has are taken from there.
    pub(super) fn new(
        before: Self,
        (pieces, screen, planes, blocks): (&SplatPieces<'_>, &Screen, &HalfPlanes, &Blocks),
        cells: &Range<u32>,
    ) -> Self {
        let rows = tile_rows(cells);
        let across = blocks.across;
        let mut tiles: Vec<Option<TileFragments>> = Vec::new();
        tiles.resize_with(across as usize * rows.len(), || None);
        for (number, tile) in (before.rows.start * across..).zip(before.tiles) {
            if rows.contains(&(number / across)) {
                tiles[(number - rows.start * across) as usize] = Some(tile);
            }
        }
        let first = rows.start * across;
        let tiles = (tiles.into_par_iter().zip(first..rows.end * across)).map_init(
            TileMemory::new,
            |memory, (tile, number)| {
                tile.unwrap_or_else(|| {
                    let [x, y] = [number % across, number / across];
                    memory.tile((pieces, screen, planes), [x * SIDE, y * SIDE], blocks.of(x, y))
                })
            },
        );
        let [width, height] = screen.size;
        Self { width, height, across, tiles: tiles.collect(), rows }
    }

    /// All rows of cells that these tiles hold.
    pub(super) fn cell_rows(&self) -> Range<u32> {
        self.rows.start * SIDE..self.height.min(self.rows.end * SIDE)
    }

    /// What a cell sees, from front to back.
    pub(super) fn cell(&self, [x, y]: [u32; 2]) -> &[Fragment] {
        let tile = (y / SIDE - self.rows.start) * self.across + x / SIDE;
        self.tiles[tile as usize].cell([x % SIDE, y % SIDE])
    }
}

/// The rows of tiles that hold some rows of cells.
pub(super) fn tile_rows(cells: &Range<u32>) -> Range<u32> {
    cells.start / SIDE..cells.end.div_ceil(SIDE)
}
