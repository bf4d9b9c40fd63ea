//! What was recognised, beside the photo, for a person to check.
//!
//! In: a fit and its photos. Out: for each photo a picture of some repeats of its mean and, to the
//! right, of their drawing.

use image::{Rgba, RgbaImage};

use super::fit::{Fit, seen};
use super::view::FaceView;
use crate::plane::{byte, side};

/// The least side of one half, pixels of sketches.
const LEAST: usize = 160;
/// Pixels for each pixel of a sketch.
const TIMES: usize = 2;
/// Columns between the halves.
const GAP: usize = 8;

/// The mean repeat of each photo and its drawing.
pub(super) fn comparisons(fit: &Fit, views: &[FaceView]) -> Vec<RgbaImage> {
    views
        .iter()
        .zip(&fit.scores)
        .map(|(view, score)| {
            let sketch = fit.candidate.sketch(seen(view, views.len(), &fit.candidate));
            let mirrored = fit.is_mirrored.then(|| sketch.mirrored());
            let drawn = &mirrored.as_ref().unwrap_or(sketch).channels[0];
            let (width, height) = (drawn.width, drawn.height);
            let photo = view.mean_cell(fit.candidate.repeat(), score.frame);
            let [right, down] = score.matched.shift;
            let columns = LEAST.div_ceil(width) * width;
            let rows = LEAST.div_ceil(height) * height;
            let (photo, drawing) = (stretched(&photo), stretched(&drawn.values));
            let total = side(TIMES * (2 * columns + GAP));
            RgbaImage::from_fn(total, side(TIMES * rows), |x, y| {
                let [x, y] = [x as usize / TIMES, y as usize / TIMES];
                let grey = if x < columns {
                    photo[y % height * width + x % width]
                } else if x < columns + GAP {
                    255
                } else {
                    let x = x - columns - GAP;
                    let [x, y] = [(x + width - right) % width, (y + height - down) % height];
                    drawing[y * width + x]
                };
                Rgba([grey, grey, grey, 255])
            })
        })
        .collect()
}

/// Values from black to white.
fn stretched(values: &[f32]) -> Vec<u8> {
    let low = values.iter().copied().fold(f32::INFINITY, f32::min);
    let high = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let scale = 255.0 / (high - low).max(f32::MIN_POSITIVE);
    values.iter().map(|value| byte((value - low) * scale)).collect()
}
