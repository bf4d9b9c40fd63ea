//! How alike a picture is to itself, moved: the autocorrelation of planes.
//!
//! In: one plane, or two that are taken together. Out: a [`Correlogram`]. Cost: two Fourier
//! transforms of about twice the pixels (0.1 s a megapixel on two cores).

use std::sync::Arc;

use glam::DVec2;
use rayon::prelude::*;
use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};

use super::steps;
use crate::plane::{Plane, double, float, narrow};
use warpknit_core::ids::index32;

/// Normalised autocorrelation over lags of up to `reach` pixels each way: 1 at no lag.
#[derive(Clone, Debug)]
pub(super) struct Correlogram {
    pub(super) reach: usize,
    /// Row by row from lag (-reach, -reach).
    values: Plane,
}

impl Correlogram {
    /// Of a plane, or of two as the parts of a complex one: the correlation of both together. Means
    /// are taken off. Products are divided by how many pairs of pixels there are. Cost: two Fourier
    /// transforms of 2.3 times the pixels.
    pub(super) fn of(real: &Plane, imaginary: Option<&Plane>, reach: usize) -> Self {
        let (width, height) = (real.width, real.height);
        let [columns, rows] = [width, height].map(|side| smooth(side + reach));
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
        spectrum.par_iter_mut().for_each(|value| *value = Complex32::new(value.norm_sqr(), 0.0));
        let [b_rows, b_columns] = [Arc::clone(&back[1]), Arc::clone(&back[0])];
        let grid = transform(spectrum, rows, &[b_rows, b_columns]);
        let side = 2 * reach + 1;
        let zero = grid[0].re / float(width * height);
        let scale = if zero > 0.0 { 1.0 / zero } else { 0.0 };
        let values = Plane::from_rows(side, side, |row, to| {
            for (column, to) in to.iter_mut().enumerate() {
                // Lags below 0 are at the transform's far end.
                let [x, y] =
                    [(column, columns), (row, rows)].map(|(at, size)| (at + size - reach) % size);
                let pairs = (width - column.abs_diff(reach)) * (height - row.abs_diff(reach));
                *to = grid[y * columns + x].re * scale / float(pairs);
            }
        });
        Self { reach, values }
    }

    pub(super) fn smoothed(&self, sigma: f32) -> Self {
        Self { reach: self.reach, values: self.values.smoothed(sigma) }
    }

    /// Half of each.
    pub(super) fn mean_with(&self, other: &Self) -> Self {
        Self { reach: self.reach, values: self.values.zip(&other.values, |a, b| 0.5 * (a + b)) }
    }

    /// Correlation at a lag.
    pub(super) fn at(&self, dx: i32, dy: i32) -> f32 {
        let place = |lag: i32| {
            self.reach.checked_add_signed(lag as isize).expect("lags are asked within the reach")
        };
        self.values.at(place(dx), place(dy))
    }

    /// Whether lags around one can be asked for.
    pub(super) fn holds(&self, lag: DVec2, margin: f64) -> bool {
        lag.abs().max_element() + margin + 2.0 < double(self.reach)
    }

    /// The highest value within `radius` of a lag.
    pub(super) fn highest_near(&self, lag: DVec2, radius: f64) -> f32 {
        self.summit_near(lag, radius).1
    }

    /// Where the highest value within `radius` of a lag is, to a fraction of a pixel, and how high.
    pub(super) fn summit_near(&self, lag: DVec2, radius: f64) -> (DVec2, f32) {
        let (low, high) = ((lag - radius).floor(), (lag + radius).ceil());
        let mut best = (lag, f32::NEG_INFINITY);
        for dy in steps(low.y)..=steps(high.y) {
            for dx in steps(low.x)..=steps(high.x) {
                let at = DVec2::new(f64::from(dx), f64::from(dy));
                if at.distance(lag) <= radius.max(0.71) && self.at(dx, dy) > best.1 {
                    best = (at, self.at(dx, dy));
                }
            }
        }
        (self.refined(best.0), best.1)
    }

    /// The top of the parabolas through a pixel and its neighbours.
    fn refined(&self, at: DVec2) -> DVec2 {
        let (x, y) = (steps(at.x), steps(at.y));
        let top = |before: f32, middle: f32, after: f32| {
            let bend = before - 2.0 * middle + after;
            if bend < 0.0 { f64::from(0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
        };
        let middle = self.at(x, y);
        at + DVec2::new(
            top(self.at(x - 1, y), middle, self.at(x + 1, y)),
            top(self.at(x, y - 1), middle, self.at(x, y + 1)),
        )
    }

    /// Local maxima at lags of at least `least` pixels, one of each pair of opposite ones, the
    /// highest first.
    pub(super) fn peaks(&self, least: f64) -> Vec<(DVec2, f32)> {
        let reach = index32(self.reach).cast_signed() - 3;
        let mut peaks: Vec<_> = (0..=reach)
            .into_par_iter()
            .flat_map_iter(|dy| {
                let first = if dy == 0 { 1 } else { -reach };
                (first..=reach).filter_map(move |dx| {
                    let value = self.at(dx, dy);
                    let lag = DVec2::new(f64::from(dx), f64::from(dy));
                    let higher = |oy: i32| {
                        (-2..=2).any(|ox| (ox, oy) != (0, 0) && self.at(dx + ox, dy + oy) > value)
                    };
                    (lag.length() >= least && value > 0.0 && !(-2..=2).any(higher))
                        .then(|| (self.refined(lag), value))
                })
            })
            .collect();
        peaks.sort_by(|a, b| b.1.total_cmp(&a.1));
        peaks
    }
}

fn mean(plane: &Plane) -> f32 {
    narrow(
        plane.values.iter().map(|value| f64::from(*value)).sum::<f64>()
            / double(plane.values.len().max(1)),
    )
}

/// Rows, then columns; the result is transposed.
fn transform(
    mut grid: Vec<Complex32>,
    columns: usize,
    plans: &[Arc<dyn Fft<f32>>; 2],
) -> Vec<Complex32> {
    let rows = grid.len() / columns;
    let run = |grid: &mut [Complex32], plan: &Arc<dyn Fft<f32>>, length: usize| {
        grid.par_chunks_exact_mut(length).for_each_init(
            || vec![Complex32::default(); plan.get_inplace_scratch_len()],
            |scratch, row| plan.process_with_scratch(row, scratch),
        );
    };
    run(&mut grid, &plans[0], columns);
    let mut turned = vec![Complex32::default(); grid.len()];
    turned.par_chunks_exact_mut(rows).enumerate().for_each(|(x, column)| {
        for (y, value) in column.iter_mut().enumerate() {
            *value = grid[y * columns + x];
        }
    });
    drop(grid);
    run(&mut turned, &plans[1], rows);
    turned
}

/// The next number whose only prime factors are 2, 3 and 5: transforms are quick there.
fn smooth(least: usize) -> usize {
    let without = |number: usize, prime: usize| {
        let mut rest = number;
        while rest.is_multiple_of(prime) {
            rest /= prime;
        }
        rest
    };
    (least.max(1)..)
        .find(|&number| [2, 3, 5].into_iter().fold(number, without) == 1)
        .expect("powers of two have no end")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_is_like_itself_a_wavelength_on() {
        let wave = Plane::from_fn(120, 90, |x, y| {
            (std::f32::consts::TAU * (float(x) / 12.0 + float(y) / 30.0)).sin()
        });
        let found = Correlogram::of(&wave, None, 40);
        assert!((found.at(0, 0) - 1.0).abs() < 1e-4);
        for (dx, dy, expected) in
            [(12, 0, 1.0), (6, 0, -1.0), (0, 30, 1.0), (-12, 30, 1.0), (3, 0, 0.0)]
        {
            assert!((found.at(dx, dy) - expected).abs() < 0.1, "{dx} {dy}: {}", found.at(dx, dy));
        }
        let (summit, _) = found.summit_near(DVec2::new(11.0, 1.0), 3.0);
        assert!(summit.distance(DVec2::new(12.0, 0.0)) < 2.0, "{summit}");
        assert!(
            (found.at(-5, 7) - found.at(5, -7)).abs() < 1e-5,
            "lags of opposite signs are the same"
        );
    }

    #[test]
    fn transforms_have_sizes_that_are_quick() {
        assert_eq!([1, 7, 97, 1001].map(smooth), [1, 8, 100, 1024]);
    }
}
