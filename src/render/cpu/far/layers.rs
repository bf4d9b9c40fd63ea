//! How deep the nearest layer of cloth lies around a pixel: what tells how much of the sky a yarn
//! in it sees.
//!
//! In: the depths of all samples. Out: [`LayerDepths`], their means over squares of pixels, and what of
//! the sky is open between them.

use glam::Vec2;
use rayon::prelude::*;

use super::nearest::VisibilityBuffer;
use crate::render::shade::{self, LAYER_RADII};

/// Pixels a side of a square.
const SQUARE: u32 = 2;

/// Means of the nearest layer's depths.
#[derive(Debug)]
pub(super) struct LayerDepths {
    /// Row of squares that comes first.
    top: u32,
    /// Squares across and down.
    size: [u32; 2],
    /// Thickness of a layer, mm.
    layer: f32,
    /// A square's mean depth, and the share of its samples that lie in the layer.
    squares: Vec<[f32; 2]>,
}

impl LayerDepths {
    pub(super) fn new(buffer: &VisibilityBuffer, thinnest: f32) -> Self {
        let (top, end) = (buffer.rows.start / SQUARE, buffer.rows.end.div_ceil(SQUARE));
        let (across, layer) = (buffer.width.div_ceil(SQUARE), LAYER_RADII * thinnest);
        let squares = (top..end)
            .into_par_iter()
            .flat_map_iter(|y| (0..across).map(move |x| square(buffer, [x, y], layer)));
        Self { top, size: [across, end - top], layer, squares: squares.collect() }
    }

    /// Share of the sky that yarns nearby leave open for a yarn of some radius at `depth`, which is
    /// seen at `cosine` in the pixel at `place`.
    pub(super) fn sky_visibility(&self, place: Vec2, radius: f32, depth: f32, cosine: f32) -> f32 {
        let [mean, cover] = self.interpolate(place);
        let before = (depth - mean <= self.layer).then(|| (mean - depth) / radius);
        shade::sky_visibility(before, cover, cosine, false)
    }

    /// Mean depth and cover between squares.
    fn interpolate(&self, place: Vec2) -> [f32; 2] {
        let place = place / SQUARE as f32 - Vec2::new(0.5, 0.5 + self.top as f32);
        let corner = place.floor();
        let part = place - corner;
        #[expect(clippy::cast_possible_truncation, reason = "a pixel's number")]
        let square = |dx: i32, dy: i32| {
            let inside = |at: i32, size: u32| at.max(0).cast_unsigned().min(size - 1) as usize;
            self.squares[inside(corner.y as i32 + dy, self.size[1]) * self.size[0] as usize
                + inside(corner.x as i32 + dx, self.size[0])]
        };
        let mut sums = Vec2::ZERO;
        let mut add =
            |[mean, cover]: [f32; 2], share: f32| sums += Vec2::new(mean, 1.0) * (cover * share);
        add(square(0, 0), (1.0 - part.x) * (1.0 - part.y));
        add(square(1, 0), part.x * (1.0 - part.y));
        add(square(0, 1), (1.0 - part.x) * part.y);
        add(square(1, 1), part.x * part.y);
        [if sums.y > 0.0 { sums.x / sums.y } else { 0.0 }, sums.y]
    }
}

/// Mean depth and cover of the nearest layer in a square of pixels.
fn square(buffer: &VisibilityBuffer, [x, y]: [u32; 2], layer: f32) -> [f32; 2] {
    let columns = x * SQUARE..buffer.width.min((x + 1) * SQUARE);
    let rows = buffer.rows.start.max(y * SQUARE)..buffer.rows.end.min((y + 1) * SQUARE);
    let depths =
        || rows.clone().flat_map(|y| columns.clone().flat_map(move |x| buffer.depths([x, y])));
    let first = depths().flatten().fold(f32::INFINITY, f32::min);
    let (mut sum, mut inside, mut count) = (0.0, 0.0, 0.0);
    for depth in depths() {
        count += 1.0;
        if let Some(depth) = depth.filter(|depth| *depth <= first + layer) {
            sum += depth - first;
            inside += 1.0;
        }
    }
    if inside > 0.0 { [first + sum / inside, inside / count] } else { [0.0; 2] }
}
