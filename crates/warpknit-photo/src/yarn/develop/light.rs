//! Flattening of the light: the yarn's colours as if the light were even, continued under the fuzz
//! and the ground.
//!
//! In: the strip and its cut-out. Out: a picture with straight alpha, sRGB.
//!
//! Method: shading correction by gains, in linear light. A round yarn is brightest where it faces
//! the lamp, so each row is divided by its smoothed mean. A lamp at one end makes a slope along the
//! yarn, which is divided out as well. No gain exceeds [`MOST_GAIN`]. The shading of plies and
//! fibres stays, since it averages out along a row.
//!
//! A pixel through which ground shows takes the colour of the yarn beside it; its alpha alone says
//! how much yarn there is. Beyond both flanks the colours blend toward each other, so that the
//! picture also closes around a tube. Cost: two passes, 4 bytes a pixel.

use glam::Vec3;
use image::{Rgb, RgbImage, RgbaImage};
use rayon::prelude::*;

use super::cutout::CutOut;
use crate::plane::{Plane, column_sums, double, float, narrow, side, whole};
use warpknit_render::mips::LINEAR;
use warpknit_render::tone;

/// Largest factor by which light is made stronger or weaker. More would amplify the noise of dark
/// flanks into grain; much less would leave a visible shade.
const MOST_GAIN: f32 = 2.5;
/// Radius of the mean along a flank that gives the colours beyond it, in widths of the yarn. A
/// smaller one draws single fibres out into stripes.
const FLANK_RADIUS: f32 = 0.08;

/// The strip's colours without shading, with alpha.
pub(super) fn flattened(strip: &RgbImage, cut: &CutOut) -> RgbaImage {
    let gains = Gains::new(strip, cut.rows());
    let lit = |x: usize, y: usize| linear(*strip.get_pixel(side(x), side(y))) * gains.at(x, y);
    let runs: Vec<(usize, usize)> =
        (0..strip.width() as usize).into_par_iter().map(|x| opaque_run(cut, x)).collect();
    let radius = whole(FLANK_RADIUS * narrow(cut.width)).max(1);
    let top = smoothed(runs.iter().enumerate().map(|(x, run)| lit(x, run.0)), radius);
    let bottom = smoothed(runs.iter().enumerate().map(|(x, run)| lit(x, run.1)), radius);
    let height = strip.height() as usize;
    let mut picture = RgbaImage::new(strip.width(), strip.height());
    picture.as_mut().par_chunks_mut(4 * strip.width() as usize).enumerate().for_each(|(y, row)| {
        for (x, texel) in row.chunks_exact_mut(4).enumerate() {
            // At the flank the colour is the flank's own; at the picture's edge it is the mean of
            // both flanks, so row 0 and the last row match when the picture goes around a tube.
            let (first, last) = runs[x];
            let color = if y < first {
                top[x].lerp(bottom[x], 0.5 * float(first - y) / float(first))
            } else if y > last {
                bottom[x].lerp(top[x], 0.5 * float(y - last) / float(height - 1 - last))
            } else {
                lit(x, y)
            };
            let [r, g, b] = tone::encode(color);
            texel.copy_from_slice(&[r, g, b, tone::byte(cut.alpha.at(x, y))]);
        }
    });
    picture
}

/// The first and the last opaque pixel of a column, from the yarn's middle outward.
fn opaque_run(cut: &CutOut, x: usize) -> (usize, usize) {
    let rows = cut.rows();
    let middle = (rows.start + rows.end) / 2;
    let is_opaque = |y: &usize| cut.alpha.at(x, *y) >= 1.0;
    let first = (0..middle).rev().take_while(is_opaque).last();
    let last = (middle..cut.alpha.height).take_while(is_opaque).last();
    (first.unwrap_or(middle), last.unwrap_or(middle))
}

/// Colours along a flank, blurred so that single fibres do not show.
fn smoothed(colors: impl Iterator<Item = Vec3>, radius: usize) -> Vec<Vec3> {
    let colors: Vec<Vec3> = colors.collect();
    let [r, g, b] = [0, 1, 2].map(|channel| {
        Plane::from_fn(colors.len(), 1, |x, _| colors[x][channel]).blurred(radius, false).values
    });
    r.into_iter().zip(g).zip(b).map(|((r, g), b)| Vec3::new(r, g, b)).collect()
}

/// The factors that light is multiplied by: the product of one for the row and one for the column.
struct Gains {
    rows: Vec<f32>,
    first: usize,
    along: Vec<f32>,
}

impl Gains {
    /// Measures the shading over the given rows, those of the yarn without its fuzz.
    fn new(strip: &RgbImage, rows: std::ops::Range<usize>) -> Self {
        let width = strip.width() as usize;
        let light = |x, y| luminance(strip, x, y);
        let row_means: Vec<f32> = (rows.clone().into_par_iter())
            .map(|y| {
                narrow((0..width).map(|x| f64::from(light(x, y))).sum::<f64>() / double(width))
            })
            .collect();
        // Unsmoothed row means would also divide out what a groove or a single fibre does.
        let radius = (rows.len() / 12).max(1);
        let smooth = Plane { width: row_means.len(), height: 1, values: row_means }
            .blurred(radius, false)
            .values;
        let mean = smooth.iter().sum::<f32>() / float(smooth.len());
        let row_gains = smooth
            .iter()
            .map(|own| (mean / own.max(1e-4)).clamp(1.0 / MOST_GAIN, MOST_GAIN))
            .collect();
        // Along the yarn only an exponential trend is divided out: a freer curve would follow the
        // plies, which are what the texture has to show.
        let columns = column_sums(width, rows.clone(), light);
        let (start, slope) = log_trend(&columns);
        let mut column_gains = Vec::with_capacity(width);
        for x in 0..width {
            let gain = narrow((-(start + slope * double(x))).exp());
            column_gains.push(gain.clamp(1.0 / MOST_GAIN, MOST_GAIN));
        }
        Self { rows: row_gains, first: rows.start, along: column_gains }
    }

    /// The gain of a pixel. Rows beyond the yarn have that of the nearest flank.
    fn at(&self, x: usize, y: usize) -> f32 {
        let row = y.saturating_sub(self.first).min(self.rows.len() - 1);
        self.rows[row] * self.along[x]
    }
}

/// The least-squares line through the logarithms of numbers, shifted to a mean of 0: its value at 0
/// and its slope. A lamp's falloff is a factor, so it is a sum in logarithms.
fn log_trend(numbers: &[f64]) -> (f64, f64) {
    let count = double(numbers.len());
    let middle = 0.5 * (count - 1.0);
    let (mut xx, mut xy) = (0.0, 0.0);
    for (x, number) in numbers.iter().enumerate() {
        let off = double(x) - middle;
        xx += off * off;
        xy += off * number.max(1e-6).ln();
    }
    let slope = if xx > 0.0 { xy / xx } else { 0.0 };
    (-slope * middle, slope)
}

/// A pixel in linear light.
fn linear(Rgb(bytes): Rgb<u8>) -> Vec3 {
    Vec3::from_array(bytes.map(|byte| LINEAR[usize::from(byte)]))
}

/// Luminance of a pixel in linear light (Rec. 709).
fn luminance(strip: &RgbImage, x: usize, y: usize) -> f32 {
    linear(*strip.get_pixel(side(x), side(y))).dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shade_across_and_a_slope_of_light_along_go_and_both_flanks_meet() {
        let shade = |x: u32, y: u32| {
            let across = (f64::from(y) - 19.5) / 10.0;
            let light = (1.0 - 0.6 * across * across).max(0.0) * (0.3 + 0.003 * f64::from(x));
            tone::encode(Vec3::splat(narrow(light)))[0]
        };
        let strip = RgbImage::from_fn(100, 40, |x, y| {
            Rgb([if (10..30).contains(&y) { shade(x, y) } else { 10 }; 3])
        });
        let alpha = Plane::from_fn(100, 40, |_, y| if (10..30).contains(&y) { 1.0 } else { 0.0 });
        let flat = flattened(&strip, &CutOut { alpha, width: 20.0, middle: 19.5 });
        let greys: Vec<u8> = (5..95)
            .flat_map(|x| (12..28).map(move |y| (x, y)))
            .map(|(x, y)| flat.get_pixel(x, y).0[0])
            .collect();
        let (low, high) = (*greys.iter().min().unwrap(), *greys.iter().max().unwrap());
        assert!(high - low < 40, "{low} {high}");
        assert!(
            (0..100).all(|x| flat.get_pixel(x, 0).0[0].abs_diff(flat.get_pixel(x, 39).0[0]) < 4)
        );
        assert_eq!((flat.get_pixel(50, 0).0[3], flat.get_pixel(50, 20).0[3]), (0, 255));
    }
}
