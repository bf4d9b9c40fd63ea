//! Step 5, repeat unit: the shortest stretch of yarn after which it looks the same again.
//!
//! In: the flattened strip and the yarn's rows. Out: [`YarnRepeat`], in pixels of the photo, with the
//! correlation that speaks for it.
//!
//! A column's features are the colours of its yarn in [`BINS`] bands, less each band's mean and
//! slope along the yarn. Their normalised autocorrelation peaks at every whole number of repeats.
//! The shortest lag whose peak is nearly as high as the highest is the repeat: plies that look
//! alike repeat each time one follows the other, a coloured one among them only after a whole turn.
//! Peaks at its multiples then make it more exact. Cost: lags times columns times bands, with the
//! strip brought down to [`COLUMNS`] columns.
//!
//! Not promised: that yarns without plies repeat at all; they get the stretch that fits itself
//! best, and [`YarnRepeat::is_found`] says no.

use image::RgbaImage;
use rayon::prelude::*;

use crate::plane::{double, float, narrow, whole};

/// Bands across the yarn.
const BINS: usize = 24;
/// Share of the yarn's width that bands cover; the flanks show more fuzz than plies.
const COVERED: f64 = 0.9;
/// Most columns that are compared.
const COLUMNS: usize = 1500;
/// The longest lag, as a share of the strip: the rest is what is compared.
const LONGEST: f64 = 0.6;
/// The shortest lag, in widths of the yarn and in columns: fibres, not plies, repeat below it.
const SHORTEST: (f64, usize) = (0.25, 5);
/// How high a peak is, as a share of the highest, that may be the repeat.
const NEARLY: f32 = 0.75;
/// The least correlation of a repeat.
const LEAST: f32 = 0.3;
/// How far from its place a multiple's peak is searched, in repeats.
const STRAY: f64 = 0.2;

/// A stretch that repeats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YarnRepeat {
    /// Its length, pixels.
    pub length: f64,
    /// Correlation of the yarn with itself that far on, up to 1.
    pub correlation: f32,
    /// Whether it is a repeat, and not only the stretch that fits itself best.
    pub is_found: bool,
}

/// The repeat of a yarn that is `width` wide around row `middle`.
pub(super) fn repeat(strip: &RgbaImage, middle: f64, width: f64) -> YarnRepeat {
    let step = (strip.width() as usize).div_ceil(COLUMNS);
    let features = features(strip, middle, width, step);
    let energies = energies(&features);
    let columns = features.len();
    let longest = whole(narrow(LONGEST * double(columns))).max(2);
    let curve: Vec<f32> =
        (0..=longest).into_par_iter().map(|lag| correlation(&features, &energies, lag)).collect();
    let shortest = whole(narrow(SHORTEST.0 * width / double(step))).max(SHORTEST.1);
    let peaks: Vec<usize> = (shortest.max(1)..longest)
        .filter(|&lag| curve[lag] > curve[lag - 1] && curve[lag] >= curve[lag + 1])
        .collect();
    let highest = peaks.iter().map(|&lag| curve[lag]).fold(0.0, f32::max);
    let chosen = peaks.iter().find(|&&lag| curve[lag] >= NEARLY * highest);
    match chosen {
        Some(&lag) if highest >= LEAST => {
            let length = refined(&curve, lag) * double(step);
            YarnRepeat { length, correlation: curve[lag], is_found: true }
        }
        _ => best_fit(&curve, width / double(step), double(step)),
    }
}

/// Without a repeat: a stretch of two widths at least, so that the eye doesn't find it again soon.
fn best_fit(curve: &[f32], width: f64, step: f64) -> YarnRepeat {
    let last = curve.len() - 1;
    let first = whole(narrow(2.0 * width)).clamp(1, last);
    let lag = (first..=last).max_by(|&a, &b| curve[a].total_cmp(&curve[b])).unwrap_or(last);
    YarnRepeat { length: double(lag) * step, correlation: curve[lag], is_found: false }
}

/// A column's bands, three colours each, means and slopes taken off.
fn features(strip: &RgbaImage, middle: f64, width: f64, step: usize) -> Vec<Vec<f32>> {
    let columns = strip.width() as usize / step;
    let top = middle - 0.5 * COVERED * width;
    let row = |edge: usize| {
        let place = top + COVERED * width * double(edge) / double(BINS) + 0.5;
        whole(narrow(place)).min(strip.height() as usize - 1)
    };
    let mut features: Vec<Vec<f32>> = (0..columns)
        .into_par_iter()
        .map(|column| {
            let band = |bin: usize| {
                let (first, end) = (row(bin), row(bin + 1).max(row(bin) + 1));
                let mut sum = [0.0_f32; 3];
                for y in first..end {
                    let pixels = &strip.as_raw()
                        [4 * (y * strip.width() as usize + column * step)..][..4 * step];
                    for pixel in pixels.chunks_exact(4) {
                        sum.iter_mut()
                            .zip(pixel)
                            .for_each(|(sum, value)| *sum += f32::from(*value));
                    }
                }
                sum.map(|sum| sum / float((end - first) * step))
            };
            (0..BINS).flat_map(band).collect()
        })
        .collect();
    (0..3 * BINS).for_each(|band| take_off_line(&mut features, band));
    features
}

fn take_off_line(features: &mut [Vec<f32>], band: usize) {
    let count = double(features.len());
    let middle = 0.5 * (count - 1.0);
    let mean = features.iter().map(|column| f64::from(column[band])).sum::<f64>() / count;
    let places = || (0..features.len()).map(|x| double(x) - middle);
    let xx: f64 = places().map(|off| off * off).sum();
    let xy: f64 =
        places().zip(features.iter()).map(|(off, column)| off * f64::from(column[band])).sum();
    let slope = if xx > 0.0 { xy / xx } else { 0.0 };
    for (x, column) in features.iter_mut().enumerate() {
        column[band] -= narrow(mean + slope * (double(x) - middle));
    }
}

/// Sums of the columns' squares, up to each column.
fn energies(features: &[Vec<f32>]) -> Vec<f64> {
    let mut sum = 0.0;
    let up_to = features.iter().map(|column| {
        sum += f64::from(dot(column, column));
        sum
    });
    std::iter::once(0.0).chain(up_to).collect()
}

/// Correlation of the columns with those `lag` on.
fn correlation(features: &[Vec<f32>], energies: &[f64], lag: usize) -> f32 {
    let product: f64 =
        features.iter().zip(&features[lag..]).map(|(a, b)| f64::from(dot(a, b))).sum();
    let count = features.len();
    let (left, right) = (energies[count - lag], energies[count] - energies[lag]);
    narrow(product / (left * right).sqrt().max(1e-9))
}

/// Eight sums side by side, as processors like them: there are a multiple of eight features.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; 8];
    for (a, b) in a.chunks_exact(8).zip(b.chunks_exact(8)) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    sums.iter().sum()
}

/// The repeat by the last of its multiples that still peaks where it should.
fn refined(curve: &[f32], lag: usize) -> f64 {
    let mut length = summit(curve, lag);
    for times in 2..64 {
        let place = length * f64::from(times);
        let around = STRAY * length;
        let (first, last) = (whole(narrow(place - around)), whole(narrow(place + around)) + 1);
        if last + 1 >= curve.len() {
            break;
        }
        let Some(peak) = (first..=last).max_by(|&a, &b| curve[a].total_cmp(&curve[b])) else {
            break;
        };
        if peak == first || peak == last || curve[peak] < 0.6 * curve[lag] {
            break;
        }
        length = summit(curve, peak) / f64::from(times);
    }
    length
}

/// Where the parabola through a peak and its neighbours is highest.
fn summit(curve: &[f32], peak: usize) -> f64 {
    let [before, at, after] = [curve[peak - 1], curve[peak], curve[peak + 1]].map(f64::from);
    let bend = before - 2.0 * at + after;
    double(peak) + if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::side;
    use crate::render::ply::hash;
    use image::Rgba;
    use std::f64::consts::TAU;

    fn strip(columns: u32, shade: impl Fn(f64, f64) -> f64) -> RgbaImage {
        RgbaImage::from_fn(columns, 40, |x, y| {
            let grey = crate::plane::byte(narrow(128.0 + 90.0 * shade(f64::from(x), f64::from(y))));
            Rgba([grey, grey, grey, 255])
        })
    }

    #[test]
    fn the_repeat_is_found_to_a_fraction_of_a_pixel() {
        for length in [17.3, 40.0, 61.7] {
            let found =
                repeat(&strip(300, |x, y| (TAU * (x / length + y / 40.0)).sin()), 20.0, 36.0);
            assert!(
                found.is_found && (found.length / length - 1.0).abs() < 0.004,
                "{length}: {found:?}"
            );
        }
    }

    #[test]
    fn a_coloured_ply_makes_the_repeat_a_whole_turn() {
        let plies = |x: f64, y: f64| {
            (TAU * (x / 20.0 + y / 40.0)).sin()
                * if (x / 20.0 + y / 40.0) % 3.0 < 1.0 { 1.0 } else { 0.3 }
        };
        let found = repeat(&strip(400, plies), 20.0, 36.0);
        assert!((found.length - 60.0).abs() < 1.0, "{found:?}");
    }

    #[test]
    fn a_yarn_without_plies_gets_a_stretch_all_the_same() {
        let hashed = |x: f64, y: f64| {
            f64::from(hash(side(whole(narrow(x + 1000.0 * y)))) >> 16) / 32_768.0 - 1.0
        };
        let found = repeat(&strip(300, hashed), 20.0, 36.0);
        assert!(!found.is_found && found.length >= 72.0 && found.length <= 180.0, "{found:?}");
        assert!(!repeat(&strip(300, |_, _| 0.0), 20.0, 36.0).is_found);
    }
}
