//! Light flattened: the yarn's colours as if lit alike everywhere, and going on under the fuzz and
//! the ground.
//!
//! In: the strip and its cut-out. Out: RGBA, straight, sRGB. A round yarn is brightest where it
//! faces the lamp, so each row has a mean of its own, and a lamp at one end makes a slope along the
//! yarn; both are divided out of the light (linear, not sRGB), by no more than [`MOST_GAIN`]. What
//! the plies and fibres do stays. Where the matte says that ground shows through, the colour is the
//! yarn's own beside it: alpha alone says how much there is. Beyond both flanks the colours run
//! toward each other, so that the picture also closes around a tube. Cost: two passes, 4 bytes a
//! pixel.

use glam::Vec3;
use image::{Rgb, RgbImage, RgbaImage};
use rayon::prelude::*;

use super::cutout::CutOut;
use crate::plane::{Plane, column_sums, double, float, narrow, side, whole};
use crate::render::maps::LINEAR;
use crate::render::tone;

/// Light is made at most so many times stronger or weaker.
const MOST_GAIN: f32 = 2.5;
/// Columns over which the colour of a flank is a mean, as a share of the yarn's width.
const FLANK_MEAN: f32 = 0.08;

/// The strip's colours with alpha.
pub(super) fn flattened(strip: &RgbImage, cut: &CutOut) -> RgbaImage {
    let gains = Gains::new(strip, cut.rows());
    let lit = |x: usize, y: usize| linear(*strip.get_pixel(side(x), side(y))) * gains.at(x, y);
    let runs: Vec<(usize, usize)> =
        (0..strip.width() as usize).into_par_iter().map(|x| opaque_run(cut, x)).collect();
    let radius = whole(FLANK_MEAN * narrow(cut.width)).max(1);
    let top = smoothed(runs.iter().enumerate().map(|(x, run)| lit(x, run.0)), radius);
    let bottom = smoothed(runs.iter().enumerate().map(|(x, run)| lit(x, run.1)), radius);
    let height = strip.height() as usize;
    let mut picture = RgbaImage::new(strip.width(), strip.height());
    picture.as_mut().par_chunks_mut(4 * strip.width() as usize).enumerate().for_each(|(y, row)| {
        for (x, texel) in row.chunks_exact_mut(4).enumerate() {
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

/// Colours along a flank, without what single fibres do to them.
fn smoothed(colors: impl Iterator<Item = Vec3>, radius: usize) -> Vec<Vec3> {
    let colors: Vec<Vec3> = colors.collect();
    let channel = |at: usize| {
        Plane::from_fn(colors.len(), 1, |x, _| colors[x][at]).blurred(radius, false).values
    };
    let [r, g, b] = [0, 1, 2].map(channel);
    r.into_iter().zip(g).zip(b).map(|((r, g), b)| Vec3::new(r, g, b)).collect()
}

/// What light is multiplied by, row by row and column by column.
struct Gains {
    rows: Vec<f32>,
    first: usize,
    along: Vec<f32>,
}

impl Gains {
    fn new(strip: &RgbImage, rows: std::ops::Range<usize>) -> Self {
        let width = strip.width() as usize;
        let light = |x: usize, y: usize| brightness(linear(*strip.get_pixel(side(x), side(y))));
        let row_means: Vec<f32> = (rows.clone().into_par_iter())
            .map(|y| {
                narrow((0..width).map(|x| f64::from(light(x, y))).sum::<f64>() / double(width))
            })
            .collect();
        let radius = (rows.len() / 12).max(1);
        let smooth = Plane { width: row_means.len(), height: 1, values: row_means }
            .blurred(radius, false)
            .values;
        let mean = smooth.iter().sum::<f32>() / float(smooth.len());
        let columns = column_sums(width, rows.clone(), light);
        let gains = smooth
            .iter()
            .map(|own| (mean / own.max(1e-4)).clamp(1.0 / MOST_GAIN, MOST_GAIN))
            .collect();
        let (start, slope) = slope(&columns);
        let gain = |x: usize| {
            narrow((-(start + slope * double(x))).exp()).clamp(1.0 / MOST_GAIN, MOST_GAIN)
        };
        Self { rows: gains, first: rows.start, along: (0..width).map(gain).collect() }
    }

    fn at(&self, x: usize, y: usize) -> f32 {
        let row = y.saturating_sub(self.first).min(self.rows.len() - 1);
        self.rows[row] * self.along[x]
    }
}

/// The line through the logarithms of numbers, less their mean: its value at 0 and its slope.
fn slope(numbers: &[f64]) -> (f64, f64) {
    let count = double(numbers.len());
    let middle = 0.5 * (count - 1.0);
    let log = |number: &f64| number.max(1e-6).ln();
    let (mut xx, mut xy) = (0.0, 0.0);
    for (x, number) in numbers.iter().enumerate() {
        let off = double(x) - middle;
        xx += off * off;
        xy += off * log(number);
    }
    let slope = if xx > 0.0 { xy / xx } else { 0.0 };
    (-slope * middle, slope)
}

fn linear(Rgb(bytes): Rgb<u8>) -> Vec3 {
    Vec3::from_array(bytes.map(|byte| LINEAR[usize::from(byte)]))
}

fn brightness(color: Vec3) -> f32 {
    color.dot(Vec3::new(0.2126, 0.7152, 0.0722))
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
