//! Mean depth of the nearest layer of cloth around each pixel. It tells how deep a yarn lies in its
//! cloth, and from that how much of the sky is visible from it.
//!
//! In: what cells see. Out: [`LayerDepths`], means over squares of pixels. The idea is
//! that of screen-space ambient occlusion (Mittring 2007, 'Finding next gen'): compare a depth with
//! those around it.

use glam::Vec2;
use rayon::prelude::*;

use super::masks::PLACES;
use super::tiles::{Fragment, SIDE, TileFragments};
use super::visible::TileRows;
use crate::shade::{self, LAYER_RADII};

/// Side of a square, pixels. One pixel has too few samples for a mean. Larger squares blur the
/// cloth's relief and span its folds.
const SQUARE: u32 = 2;

/// Means of the nearest layer's depths.
#[derive(Debug)]
pub(super) struct LayerDepths {
    /// First column and row of squares.
    first: [u32; 2],
    /// Number of squares across and down.
    size: [u32; 2],
    /// Side of a square, cells.
    side: u32,
    /// Thickness of a layer, mm.
    layer: f32,
    /// Mean depth of each square, and the fraction of its places in the nearest layer.
    squares: Vec<[f32; 2]>,
}

impl LayerDepths {
    /// Averages the depths of some rows of cells. `thinnest` is the radius of the thinnest yarn, and
    /// a pixel is `split` cells wide.
    pub(super) fn new(tiles: &TileRows, thinnest: f32, split: u32) -> Self {
        let side = SQUARE * split;
        let rows = tiles.cell_rows();
        let (top, end) = (rows.start / side, rows.end.div_ceil(side));
        let (across, layer) = (tiles.width.div_ceil(side), LAYER_RADII * thinnest);
        let squares = (top..end)
            .into_par_iter()
            .flat_map_iter(|y| (0..across).map(move |x| square(tiles, [x, y], side, layer)));
        Self { first: [0, top], size: [across, end - top], side, layer, squares: squares.collect() }
    }

    /// Averages the depths of one tile, in this column and row.
    pub(super) fn of_tile(tile: &TileFragments, at: [u32; 2], thinnest: f32, split: u32) -> Self {
        let side = (SQUARE * split).min(SIDE);
        let (count, layer) = (SIDE / side, LAYER_RADII * thinnest);
        let of_square = |[x, y]: [u32; 2]| {
            let cells = (y * side..(y + 1) * side)
                .flat_map(|y| (x * side..(x + 1) * side).map(move |x| tile.cell([x, y])));
            mean(cells, layer)
        };
        let squares = (0..count).flat_map(|y| (0..count).map(move |x| [x, y])).map(of_square);
        let first = at.map(|at| at * count);
        Self { first, size: [count; 2], side, layer, squares: squares.collect() }
    }

    /// Level in the cloth of a yarn of this radius at `depth`, at `place`, in cells: see
    /// [`shade::sky_level`].
    pub(super) fn sky_level(&self, place: Vec2, radius: f32, depth: f32) -> f32 {
        let [mean, cover] = self.interpolate(place);
        // A yarn behind the layer belongs to another layer, such as the far side of a skirt. Its
        // depth says nothing about its place in its own cloth.
        let before = (depth - mean <= self.layer).then(|| (mean - depth) / radius);
        shade::sky_level(before, cover)
    }

    /// Mean depth and cover, interpolated between squares.
    fn interpolate(&self, place: Vec2) -> [f32; 2] {
        let first = Vec2::new(self.first[0] as f32, self.first[1] as f32);
        let place = place / self.side as f32 - first - 0.5;
        let corner = place.floor();
        let part = place - corner;
        #[expect(clippy::cast_possible_truncation, reason = "a pixel's number")]
        let [x, y] = [corner.x as i32, corner.y as i32];
        // Bilinear interpolation. Each mean is weighted by its cover too, so squares without yarn
        // do not count.
        let mut sums = Vec2::ZERO;
        for ([column, row], share) in [
            ([x, y], (1.0 - part.x) * (1.0 - part.y)),
            ([x + 1, y], part.x * (1.0 - part.y)),
            ([x, y + 1], (1.0 - part.x) * part.y),
            ([x + 1, y + 1], part.x * part.y),
        ] {
            let [mean, cover] = self.clamped_square(column, row);
            sums += Vec2::new(mean, 1.0) * (cover * share);
        }
        [if sums.y > 0.0 { sums.x / sums.y } else { 0.0 }, sums.y]
    }

    /// The square at a column and row, or the nearest one at the border.
    fn clamped_square(&self, column: i32, row: i32) -> [f32; 2] {
        let [x, y] = [(column, self.size[0]), (row, self.size[1])]
            .map(|(at, size)| at.max(0).cast_unsigned().min(size - 1) as usize);
        self.squares[y * self.size[0] as usize + x]
    }
}

/// Mean depth and cover of the nearest layer in one square of cells.
fn square(tiles: &TileRows, [x, y]: [u32; 2], side: u32, layer: f32) -> [f32; 2] {
    let all = tiles.cell_rows();
    let columns = x * side..tiles.width.min((x + 1) * side);
    let rows = all.start.max(y * side)..all.end.min((y + 1) * side);
    mean(rows.flat_map(|y| columns.clone().map(move |x| tiles.cell([x, y]))), layer)
}

/// Mean depth of the nearest layer of some cells, and its cover.
fn mean<'a>(cells: impl Iterator<Item = &'a [Fragment]> + Clone, layer: f32) -> [f32; 2] {
    let first =
        (cells.clone().flatten()).fold(f32::INFINITY, |first, fragment| first.min(fragment.depth));
    // Depths are summed relative to the nearest one: in `f32`, sums of metres would lose a yarn's
    // radius.
    let (mut sum, mut inside, mut count) = (0.0, 0.0, 0.0);
    for cell in cells {
        count += PLACES as f32;
        for fragment in cell.iter().filter(|fragment| fragment.depth <= first + layer) {
            let places = fragment.mask.count_ones() as f32;
            sum += (fragment.depth - first) * places;
            inside += places;
        }
    }
    if inside > 0.0 { [first + sum / inside, inside / count] } else { [0.0; 2] }
}
