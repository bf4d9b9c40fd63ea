//! Autocorrelation of planes: how alike a picture is to itself, moved by a lag.
//!
//! In: one plane, or two that are taken together. Out: a [`Correlogram`].
//!
//! Method: the Wiener-Khinchin theorem: the autocorrelation is the inverse Fourier transform of the
//! power spectrum. Cost: two fast Fourier transforms of about 2.3 times the pixels (0.1 s a
//! megapixel on two cores).

use std::sync::Arc;

use glam::DVec2;
use rayon::prelude::*;
use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};

use super::steps;
use crate::plane::{Plane, double, float, narrow};
use warpknit_core::ids::index32;

/// Normalised autocorrelation over lags of up to `reach` pixels each way: 1 at lag 0.
#[derive(Clone, Debug)]
pub(super) struct Correlogram {
    pub(super) reach: usize,
    /// Row by row from lag (-reach, -reach).
    values: Plane,
}

impl Correlogram {
    /// The autocorrelation of a plane, or of two planes as the real and the imaginary part of one:
    /// its real part is the sum of both autocorrelations. Means are taken off first.
    pub(super) fn new(real: &Plane, imaginary: Option<&Plane>, reach: usize) -> Self {
        let (width, height) = (real.width, real.height);
        // Padded by the largest lag, so that the periodic correlation of the transform never wraps
        // one border of the picture onto the other.
        let [columns, rows] = [width, height].map(|side| fast_length(side + reach));
        let means = [mean(real), imaginary.map_or(0.0, mean)];
        let mut grid = vec![Complex32::default(); columns * rows];
        grid.par_chunks_exact_mut(columns).take(height).enumerate().for_each(|(y, row)| {
            for (x, (value, real)) in row.iter_mut().zip(real.row(y)).enumerate() {
                let imaginary = imaginary.map_or(0.0, |plane| plane.at(x, y) - means[1]);
                *value = Complex32::new(real - means[0], imaginary);
            }
        });
        let mut planner = FftPlanner::new();
        let across = [planner.plan_fft_forward(columns), planner.plan_fft_forward(rows)];
        let back = [planner.plan_fft_inverse(columns), planner.plan_fft_inverse(rows)];
        let mut spectrum = transform(grid, columns, &across);
        // The power spectrum. Phases, which say where things are, drop out.
        spectrum.par_iter_mut().for_each(|value| *value = Complex32::new(value.norm_sqr(), 0.0));
        // The spectrum is transposed, so that the way back begins with the columns' plan and
        // transposes again.
        let [b_rows, b_columns] = [Arc::clone(&back[1]), Arc::clone(&back[0])];
        let grid = transform(spectrum, rows, &[b_rows, b_columns]);
        let side = 2 * reach + 1;
        let zero = grid[0].re / float(width * height);
        let scale = if zero > 0.0 { 1.0 / zero } else { 0.0 };
        let values = Plane::from_rows(side, side, |row, to| {
            for (column, to) in to.iter_mut().enumerate() {
                // Negative lags are at the far end of the transform.
                let [x, y] =
                    [(column, columns), (row, rows)].map(|(at, size)| (at + size - reach) % size);
                // Unbiased estimate: fewer pairs of pixels are far from each other. Without it far
                // lags would fade, and the finest lattice would always win.
                let pairs = (width - column.abs_diff(reach)) * (height - row.abs_diff(reach));
                *to = grid[y * columns + x].re * scale / float(pairs);
            }
        });
        Self { reach, values }
    }

    pub(super) fn smoothed(&self, sigma: f32) -> Self {
        Self { reach: self.reach, values: self.values.smoothed(sigma) }
    }

    /// The mean of two correlograms.
    pub(super) fn mean_with(&self, other: &Self) -> Self {
        Self { reach: self.reach, values: self.values.zip(&other.values, |a, b| 0.5 * (a + b)) }
    }

    /// Correlation at a lag.
    pub(super) fn at(&self, dx: i32, dy: i32) -> f32 {
        let [x, y] = [dx, dy].map(|lag| {
            self.reach.checked_add_signed(lag as isize).expect("lags are within the reach")
        });
        self.values.at(x, y)
    }

    /// Whether a lag and its surroundings are within the reach.
    pub(super) fn contains(&self, lag: DVec2, margin: f64) -> bool {
        lag.abs().max_element() + margin + 2.0 < double(self.reach)
    }

    /// The highest value within `radius` of a lag.
    pub(super) fn max_near(&self, lag: DVec2, radius: f64) -> f32 {
        self.peak_near(lag, radius).1
    }

    /// The lag of the highest value within `radius` of a lag, to a fraction of a pixel, and that
    /// value.
    pub(super) fn peak_near(&self, lag: DVec2, radius: f64) -> (DVec2, f32) {
        let (low, high) = ((lag - radius).floor(), (lag + radius).ceil());
        let mut best = (lag, f32::NEG_INFINITY);
        for dy in steps(low.y)..=steps(high.y) {
            for dx in steps(low.x)..=steps(high.x) {
                let at = DVec2::new(f64::from(dx), f64::from(dy));
                // At least half a pixel's diagonal, so that some pixel is within it.
                if at.distance(lag) <= radius.max(0.71) && self.at(dx, dy) > best.1 {
                    best = (at, self.at(dx, dy));
                }
            }
        }
        (self.subpixel_peak(best.0), best.1)
    }

    /// The top of the parabolas through a pixel and its neighbours along x and along y.
    fn subpixel_peak(&self, at: DVec2) -> DVec2 {
        let (x, y) = (steps(at.x), steps(at.y));
        let middle = self.at(x, y);
        at + DVec2::new(
            parabola_top(self.at(x - 1, y), middle, self.at(x + 1, y)),
            parabola_top(self.at(x, y - 1), middle, self.at(x, y + 1)),
        )
    }

    /// Local maxima at lags of at least `least` pixels, the highest first. The autocorrelation is
    /// even, so that only one of each pair of opposite lags is given.
    pub(super) fn peaks(&self, least: f64) -> Vec<(DVec2, f32)> {
        let reach = index32(self.reach).cast_signed() - 3;
        let mut peaks: Vec<_> = (0..=reach)
            .into_par_iter()
            .flat_map_iter(|dy| {
                let first = if dy == 0 { 1 } else { -reach };
                (first..=reach).filter_map(move |dx| {
                    let value = self.at(dx, dy);
                    let lag = DVec2::new(f64::from(dx), f64::from(dy));
                    (lag.length() >= least && value > 0.0 && self.is_maximum(dx, dy, value))
                        .then(|| (self.subpixel_peak(lag), value))
                })
            })
            .collect();
        peaks.sort_by(|a, b| b.1.total_cmp(&a.1));
        peaks
    }

    /// Whether no value within two pixels is higher. A window of 3 x 3 would let ripples of noise
    /// on a broad peak count as peaks.
    fn is_maximum(&self, dx: i32, dy: i32, value: f32) -> bool {
        !(-2..=2)
            .any(|oy| (-2..=2).any(|ox| (ox, oy) != (0, 0) && self.at(dx + ox, dy + oy) > value))
    }
}

/// Where the parabola through three equidistant values has its maximum, from the middle one.
fn parabola_top(before: f32, middle: f32, after: f32) -> f64 {
    let bend = before - 2.0 * middle + after;
    if bend < 0.0 { f64::from(0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
}

fn mean(plane: &Plane) -> f32 {
    narrow(
        plane.values.iter().map(|value| f64::from(*value)).sum::<f64>()
            / double(plane.values.len().max(1)),
    )
}

/// The transform of rows, then of columns. The result is transposed.
fn transform(
    mut grid: Vec<Complex32>,
    columns: usize,
    plans: &[Arc<dyn Fft<f32>>; 2],
) -> Vec<Complex32> {
    let rows = grid.len() / columns;
    transform_rows(&mut grid, &plans[0], columns);
    // Transposed in between: a transform of contiguous rows is several times faster than one of
    // strided columns.
    let mut transposed = vec![Complex32::default(); grid.len()];
    transposed.par_chunks_exact_mut(rows).enumerate().for_each(|(x, column)| {
        for (y, value) in column.iter_mut().enumerate() {
            *value = grid[y * columns + x];
        }
    });
    drop(grid);
    transform_rows(&mut transposed, &plans[1], rows);
    transposed
}

/// Transforms each row in place; a thread allocates its scratch memory once.
fn transform_rows(grid: &mut [Complex32], plan: &Arc<dyn Fft<f32>>, length: usize) {
    grid.par_chunks_exact_mut(length).for_each_init(
        || vec![Complex32::default(); plan.get_inplace_scratch_len()],
        |scratch, row| plan.process_with_scratch(row, scratch),
    );
}

/// The next length whose only prime factors are 2, 3 and 5: transforms are fast there.
fn fast_length(least: usize) -> usize {
    (least.max(1)..)
        .find(|&number| [2, 3, 5].into_iter().fold(number, without_factor) == 1)
        .expect("powers of two have no end")
}

/// A number divided by a prime as often as it can be.
fn without_factor(number: usize, prime: usize) -> usize {
    let mut rest = number;
    while rest.is_multiple_of(prime) {
        rest /= prime;
    }
    rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_is_like_itself_a_wavelength_on() {
        let wave = Plane::from_fn(120, 90, |x, y| {
            (std::f32::consts::TAU * (float(x) / 12.0 + float(y) / 30.0)).sin()
        });
        let found = Correlogram::new(&wave, None, 40);
        assert!((found.at(0, 0) - 1.0).abs() < 1e-4);
        for (dx, dy, expected) in
            [(12, 0, 1.0), (6, 0, -1.0), (0, 30, 1.0), (-12, 30, 1.0), (3, 0, 0.0)]
        {
            assert!((found.at(dx, dy) - expected).abs() < 0.1, "{dx} {dy}: {}", found.at(dx, dy));
        }
        let (peak, _) = found.peak_near(DVec2::new(11.0, 1.0), 3.0);
        assert!(peak.distance(DVec2::new(12.0, 0.0)) < 2.0, "{peak}");
        assert!(
            (found.at(-5, 7) - found.at(5, -7)).abs() < 1e-5,
            "lags of opposite signs are the same"
        );
    }

    #[test]
    fn transforms_have_sizes_that_are_quick() {
        assert_eq!([1, 7, 97, 1001].map(fast_length), [1, 8, 100, 1024]);
    }
}
