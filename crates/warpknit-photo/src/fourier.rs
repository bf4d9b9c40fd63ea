//! Fourier transforms of small planes.
//!
//! In: the values of a plane, row by row. Out: its spectrum, or a plane again. Plans are made once
//! for each size. Cost: `n log n` operations. Nothing here is parallel: callers are.

use std::sync::Arc;

use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};

/// The transforms of one size.
#[derive(Clone)]
pub(crate) struct Fourier {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Along rows and along columns, forward.
    forward: [Arc<dyn Fft<f32>>; 2],
    /// The same back.
    inverse: [Arc<dyn Fft<f32>>; 2],
}

impl Fourier {
    /// The transforms of planes of that size.
    pub(crate) fn new(width: usize, height: usize) -> Self {
        let mut planner = FftPlanner::new();
        Self {
            width,
            height,
            forward: [width, height].map(|side| planner.plan_fft_forward(side)),
            inverse: [width, height].map(|side| planner.plan_fft_inverse(side)),
        }
    }

    /// How many values a plane has.
    pub(crate) fn len(&self) -> usize {
        self.width * self.height
    }

    /// The spectrum of real values.
    pub(crate) fn spectrum(&self, values: &[f32]) -> Vec<Complex32> {
        let mut grid: Vec<_> = values.iter().map(|value| Complex32::new(*value, 0.0)).collect();
        self.transform(&mut grid, &self.forward);
        grid
    }

    /// The spectra of two planes of real values, by one transform.
    pub(crate) fn spectra_of_two(
        &self,
        both: impl Iterator<Item = [f32; 2]>,
    ) -> [Vec<Complex32>; 2] {
        let mut grid: Vec<_> = both.map(|[one, other]| Complex32::new(one, other)).collect();
        self.transform(&mut grid, &self.forward);
        // Of a real plane, opposite frequencies are conjugate.
        let half = Complex32::new(0.5, 0.0);
        let minus_half_i = Complex32::new(0.0, -0.5);
        let (mut one, mut other) = (Vec::with_capacity(self.len()), Vec::with_capacity(self.len()));
        for (y, row) in grid.chunks_exact(self.width).enumerate() {
            let from = (self.height - y) % self.height * self.width;
            let opposite = &grid[from..from + self.width];
            // The first one is opposite itself, the others from the end.
            let opposites = opposite[..1].iter().chain(opposite[1..].iter().rev());
            for (a, b) in row.iter().zip(opposites) {
                let b = b.conj();
                one.push((a + b) * half);
                other.push((a - b) * minus_half_i);
            }
        }
        [one, other]
    }

    /// The plane of a spectrum, not divided by the number of values.
    pub(crate) fn inverse(&self, spectrum: &mut [Complex32]) {
        self.transform(spectrum, &self.inverse);
    }

    /// Rows, then columns, in place.
    fn transform(&self, grid: &mut [Complex32], plans: &[Arc<dyn Fft<f32>>; 2]) {
        plans[0].process(grid);
        // Several columns at a time, copied together, so that each cache line is read once.
        const COLUMNS: usize = 8;
        let mut columns = vec![Complex32::default(); COLUMNS * self.height];
        for left in (0..self.width).step_by(COLUMNS) {
            let count = COLUMNS.min(self.width - left);
            for (y, row) in grid.chunks_exact(self.width).enumerate() {
                for (column, value) in row[left..left + count].iter().enumerate() {
                    columns[column * self.height + y] = *value;
                }
            }
            plans[1].process(&mut columns[..count * self.height]);
            for (y, row) in grid.chunks_exact_mut(self.width).enumerate() {
                for (column, value) in row[left..left + count].iter_mut().enumerate() {
                    *value = columns[column * self.height + y];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::{double, float, narrow};

    #[test]
    fn two_planes_have_the_spectra_of_each() {
        let fourier = Fourier::new(4, 6);
        let values = |seed: usize| -> Vec<f32> {
            (0..24).map(|at| float((at * at + seed * at) % 7)).collect()
        };
        let (one, other) = (values(1), values(3));
        let both =
            fourier.spectra_of_two(one.iter().zip(&other).map(|(one, other)| [*one, *other]));
        for (found, values) in both.iter().zip([&one, &other]) {
            for (a, b) in found.iter().zip(fourier.spectrum(values)) {
                assert!((a - b).norm() < 1e-4);
            }
        }
    }

    #[test]
    fn a_wave_is_one_line_and_comes_back() {
        let (width, height) = (12, 18);
        let wave = |at: usize| {
            let phase = 2.0 * double(at % width) / double(width)
                + 5.0 * double(at / width) / double(height);
            narrow((std::f64::consts::TAU * phase).cos())
        };
        let values: Vec<f32> = (0..width * height).map(wave).collect();
        let fourier = Fourier::new(width, height);
        let mut spectrum = fourier.spectrum(&values);
        for (at, value) in spectrum.iter().enumerate() {
            let is_line = [(2, 5), (10, 13)].contains(&(at % width, at / width));
            let expected = if is_line { float(width * height) / 2.0 } else { 0.0 };
            assert!((value.norm() - expected).abs() < 1e-3, "{at}");
        }
        fourier.inverse(&mut spectrum);
        for (value, back) in values.iter().zip(&spectrum) {
            assert!((value - back.re / float(fourier.len())).abs() < 1e-5);
        }
    }
}
