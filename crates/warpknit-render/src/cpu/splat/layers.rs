//! Mean depth of the nearest layer of cloth around each pixel. It tells how deep a yarn lies in its
//! cloth, and from that how much of the sky is visible from it.
//!
//! In: the depths of all samples. Out: [`LayerDepths`], means over squares of pixels. The idea is
//! that of screen-space ambient occlusion (Mittring 2007, 'Finding next gen'): compare a depth with
//! those around it.

use glam::Vec2;
use rayon::prelude::*;

use super::nearest::VisibilityBuffer;
use crate::shade::{self, LAYER_RADII};

/// Side of a square, pixels. One pixel has too few samples for a mean. Larger squares blur the
/// cloth's relief and span its folds.
const SQUARE: u32 = 2;

/// Means of the nearest layer's depths.
#[derive(Debug)]
pub(super) struct LayerDepths {
    /// First row of squares.
    top: u32,
    /// Number of squares across and down.
    size: [u32; 2],
    /// Thickness of a layer, mm.
    layer: f32,
    /// Mean depth of each square, and the fraction of its samples in the nearest layer.
    squares: Vec<[f32; 2]>,
}

impl LayerDepths {
    /// Averages the depths of the buffer's rows. `thinnest` is the radius of the thinnest yarn.
    pub(super) fn new(buffer: &VisibilityBuffer, thinnest: f32) -> Self {
        let (top, end) = (buffer.rows.start / SQUARE, buffer.rows.end.div_ceil(SQUARE));
        let (across, layer) = (buffer.width.div_ceil(SQUARE), LAYER_RADII * thinnest);
        let squares = (top..end)
            .into_par_iter()
            .flat_map_iter(|y| (0..across).map(move |x| square(buffer, [x, y], layer)));
        Self { top, size: [across, end - top], layer, squares: squares.collect() }
    }

    /// Visibility of the sky for a yarn of this radius at `depth`, in the pixel at `place`.
    /// `cosine` is that of the angle between its normal and the direction to the eye.
    pub(super) fn sky_visibility(&self, place: Vec2, radius: f32, depth: f32, cosine: f32) -> f32 {
        let [mean, cover] = self.interpolate(place);
        // A yarn behind the layer belongs to another layer, such as the far side of a skirt. Its
        // depth says nothing about its place in its own cloth.
        let before = (depth - mean <= self.layer).then(|| (mean - depth) / radius);
        shade::sky_visibility(before, cover, cosine, false)
    }

    /// Mean depth and cover, interpolated between squares.
    fn interpolate(&self, place: Vec2) -> [f32; 2] {
        let place = place / SQUARE as f32 - Vec2::new(0.5, 0.5 + self.top as f32);
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

/// Mean depth and cover of the nearest layer in one square of pixels.
fn square(buffer: &VisibilityBuffer, [x, y]: [u32; 2], layer: f32) -> [f32; 2] {
    let columns = x * SQUARE..buffer.width.min((x + 1) * SQUARE);
    let rows = buffer.rows.start.max(y * SQUARE)..buffer.rows.end.min((y + 1) * SQUARE);
    let depths = rows.flat_map(|y| columns.clone().flat_map(move |x| buffer.depths([x, y])));
    let first = depths.clone().flatten().fold(f32::INFINITY, f32::min);
    // Depths are summed relative to the nearest one: in `f32`, sums of metres would lose a yarn's
    // radius.
    let (mut sum, mut inside, mut count) = (0.0, 0.0, 0.0);
    // Nested iterators are far faster from inside than with a `for` loop.
    depths.for_each(|depth| {
        count += 1.0;
        if let Some(depth) = depth.filter(|depth| *depth <= first + layer) {
            sum += depth - first;
            inside += 1.0;
        }
    });
    if inside > 0.0 { [first + sum / inside, inside / count] } else { [0.0; 2] }
}
