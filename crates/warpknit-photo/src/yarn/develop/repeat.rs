//! Step 5, repeat: the shortest length along the yarn after which it looks the same again.
//!
//! In: the flattened strip and the yarn's rows. Out: [`YarnRepeat`]: the length in pixels of the
//! photo, and the correlation at that lag.
//!
//! Method: normalised autocorrelation of column features. The features of a column are the mean
//! colours of the yarn in [`BANDS`] bands, detrended: each band's mean and slope along the yarn are
//! subtracted. The autocorrelation peaks at every whole number of repeats. The repeat is the
//! shortest lag whose peak is nearly as high as the highest: plies that look alike repeat each time
//! one follows the other, plies of several colours only after a whole turn. Peaks at multiples of
//! the repeat then refine it to a fraction of a pixel.
//!
//! Cost: lags times columns times bands, with the strip reduced to at most [`COLUMNS`] columns.
//!
//! Not promised: that a yarn without plies repeats at all. It gets the length at which it is most
//! similar to itself, and [`YarnRepeat::is_found`] is false.

use image::RgbaImage;
use rayon::prelude::*;

use crate::plane::{double, float, narrow, whole};

/// Bands across the yarn. The number of features (three colours a band) is a multiple of eight, as
/// [`dot`] needs it.
const BANDS: usize = 24;
/// Share of the yarn's width that the bands cover. The flanks are left out: they show more fuzz
/// than plies.
const COVERED: f64 = 0.9;
/// Most columns that are compared.
const COLUMNS: usize = 1500;
/// Longest lag, as a share of the strip. At a longer one too few columns are left to compare.
const LONGEST_LAG: f64 = 0.6;
/// Shortest lag, in widths of the yarn and in columns. Below it fibres repeat, not plies.
const SHORTEST_LAG: (f64, usize) = (0.25, 5);
/// Least height of the repeat's peak, as a share of the highest peak. With a lower limit, one ply
/// of a yarn with plies of several colours would pass as the whole repeat; with a higher one, a
/// multiple of the repeat would be taken wherever noise makes its peak a little higher.
const LEAST_PEAK_SHARE: f32 = 0.75;
/// Least correlation of a repeat; a lower one is chance.
const LEAST_CORRELATION: f32 = 0.3;
/// How far from its expected place the peak of a multiple is searched, in repeats.
const PEAK_TOLERANCE: f64 = 0.2;
/// Least height of a multiple's peak, as a share of the first peak. A yarn that is stretched
/// unevenly loses its correlation with the lag, and lower peaks would not be its own.
const LEAST_MULTIPLE_SHARE: f32 = 0.6;

/// The length after which a yarn repeats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YarnRepeat {
    /// Its length, pixels.
    pub length: f64,
    /// Correlation of the yarn with itself at that lag, up to 1.
    pub correlation: f32,
    /// Whether it is a repeat, and not only the lag at which the yarn is most similar to itself.
    pub is_found: bool,
}

/// Finds the repeat of a yarn that is `width` wide around row `middle`.
pub(super) fn repeat(strip: &RgbaImage, middle: f64, width: f64) -> YarnRepeat {
    let step = (strip.width() as usize).div_ceil(COLUMNS);
    let features = features(strip, middle, width, step);
    let energies = cumulative_energies(&features);
    let columns = features.len();
    let longest = whole(narrow(LONGEST_LAG * double(columns))).max(2);
    let curve: Vec<f32> =
        (0..=longest).into_par_iter().map(|lag| correlation(&features, &energies, lag)).collect();
    let shortest = whole(narrow(SHORTEST_LAG.0 * width / double(step))).max(SHORTEST_LAG.1);
    let peaks: Vec<usize> = (shortest.max(1)..longest)
        .filter(|&lag| curve[lag] > curve[lag - 1] && curve[lag] >= curve[lag + 1])
        .collect();
    let highest = peaks.iter().map(|&lag| curve[lag]).fold(0.0, f32::max);
    // All multiples of the repeat have peaks of about the same height: the shortest of them is the
    // repeat itself.
    let chosen = peaks.iter().find(|&&lag| curve[lag] >= LEAST_PEAK_SHARE * highest);
    match chosen {
        Some(&lag) if highest >= LEAST_CORRELATION => {
            let length = refined(&curve, lag) * double(step);
            YarnRepeat { length, correlation: curve[lag], is_found: true }
        }
        _ => best_fit(&curve, width / double(step), double(step)),
    }
}

/// For a yarn without a repeat: the lag of the highest correlation, at least two widths long, so
/// that the tiling is not noticed soon.
fn best_fit(curve: &[f32], width: f64, step: f64) -> YarnRepeat {
    let last = curve.len() - 1;
    let first = whole(narrow(2.0 * width)).clamp(1, last);
    let lag = (first..=last).max_by(|&a, &b| curve[a].total_cmp(&curve[b])).unwrap_or(last);
    YarnRepeat { length: double(lag) * step, correlation: curve[lag], is_found: false }
}

/// The detrended features of each column: the mean colour of each band, three channels.
fn features(strip: &RgbaImage, middle: f64, width: f64, step: usize) -> Vec<Vec<f32>> {
    let columns = strip.width() as usize / step;
    let top = middle - 0.5 * COVERED * width;
    let row = |edge: usize| {
        let place = top + COVERED * width * double(edge) / double(BANDS) + 0.5;
        whole(narrow(place)).min(strip.height() as usize - 1)
    };
    let mut features: Vec<Vec<f32>> = (0..columns)
        .into_par_iter()
        .map(|column| {
            // A thin yarn has fewer rows than bands: each band then has at least one row, and some
            // share one.
            let band = |number: usize| {
                let (first, end) = (row(number), row(number + 1).max(row(number) + 1));
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
            (0..BANDS).flat_map(band).collect()
        })
        .collect();
    // A slope along the yarn, from uneven light, would correlate at every lag.
    (0..3 * BANDS).for_each(|feature| detrend(&mut features, feature));
    features
}

/// Subtracts from one feature of all columns the line fitted to it by least squares.
fn detrend(features: &mut [Vec<f32>], feature: usize) {
    let count = double(features.len());
    let middle = 0.5 * (count - 1.0);
    let mean = features.iter().map(|column| f64::from(column[feature])).sum::<f64>() / count;
    let places = || (0..features.len()).map(|x| double(x) - middle);
    let xx: f64 = places().map(|off| off * off).sum();
    let xy: f64 =
        places().zip(features.iter()).map(|(off, column)| off * f64::from(column[feature])).sum();
    let slope = if xx > 0.0 { xy / xx } else { 0.0 };
    for (x, column) in features.iter_mut().enumerate() {
        column[feature] -= narrow(mean + slope * (double(x) - middle));
    }
}

/// Cumulative sums of the columns' squared norms: the energy of any range of columns is a
/// difference of two of them.
fn cumulative_energies(features: &[Vec<f32>]) -> Vec<f64> {
    let mut sum = 0.0;
    let up_to = features.iter().map(|column| {
        sum += f64::from(dot(column, column));
        sum
    });
    std::iter::once(0.0).chain(up_to).collect()
}

/// Normalised correlation of the columns with those `lag` on:
/// r(k) = Σ f(x)·f(x + k) / √(Σ |f(x)|² Σ |f(x + k)|²), the sums over the x at which both exist.
fn correlation(features: &[Vec<f32>], energies: &[f64], lag: usize) -> f32 {
    let product: f64 =
        features.iter().zip(&features[lag..]).map(|(a, b)| f64::from(dot(a, b))).sum();
    let count = features.len();
    // Normalising by the energies of the two overlapping parts, not of the whole, keeps long lags
    // from being underrated. A plain yarn has no energy and correlation 0.
    let (left, right) = (energies[count - lag], energies[count] - energies[lag]);
    narrow(product / (left * right).sqrt().max(1e-9))
}

/// Dot product in eight partial sums, which the compiler turns into SIMD: one running sum would
/// force a strict order of additions. The length is a multiple of eight.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; 8];
    for (a, b) in a.chunks_exact(8).zip(b.chunks_exact(8)) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    sums.iter().sum()
}

/// The repeat to a fraction of a column: the place of the farthest multiple's peak over its number.
/// The n-th peak is as exact as the first one, so the repeat becomes n times as exact.
fn refined(curve: &[f32], lag: usize) -> f64 {
    let mut length = summit(curve, lag);
    for times in 2..64 {
        let place = length * f64::from(times);
        let around = PEAK_TOLERANCE * length;
        let (first, last) = (whole(narrow(place - around)), whole(narrow(place + around)) + 1);
        if last + 1 >= curve.len() {
            break;
        }
        let Some(peak) = (first..=last).max_by(|&a, &b| curve[a].total_cmp(&curve[b])) else {
            break;
        };
        // A maximum at the end of the window is a slope that goes on, not a peak.
        if peak == first || peak == last || curve[peak] < LEAST_MULTIPLE_SHARE * curve[lag] {
            break;
        }
        length = summit(curve, peak) / f64::from(times);
    }
    length
}

/// The vertex of the parabola through a peak and its two neighbours.
fn summit(curve: &[f32], peak: usize) -> f64 {
    let [before, at, after] = [curve[peak - 1], curve[peak], curve[peak + 1]].map(f64::from);
    let bend = before - 2.0 * at + after;
    double(peak) + if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::side;
    use image::Rgba;
    use std::f64::consts::TAU;
    use warpknit_render::ply::hash;

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
