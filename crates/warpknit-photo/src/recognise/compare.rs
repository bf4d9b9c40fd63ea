//! How much of a photo's mean cell a sketch explains, over all shifts and all lights.
//!
//! In: the mean of a photo's copies of a repeat, and the [`Sketch`] of a cloth. Out: a [`Match`].
//!
//! Method: for each shift the channels of the sketch are fitted to the cell by least squares. Their
//! products with the shifted cell come from Fourier transforms (normalised cross-correlation; Lewis
//! 1995, *Fast normalized cross-correlation*), and the normal matrix does not depend on the shift.
//! Cost: two transforms of the cell.

use std::cmp::Ordering;

use glam::{DMat4, DVec4};
use rustfft::num_complex::Complex32;

use super::sketch::{CHANNELS, Ground};
use crate::fourier::Fourier;
use crate::plane::{Plane, double, narrow};

/// Share of a channel's power that is added to it: a light of which a little is seen in the photo
/// may not explain much of it.
const RIDGE: [f64; CHANNELS] = [0.02, 0.3, 0.3, 0.3];
/// The same on light ground. Its own light may explain as much as the even sky's, so it has the same ridge.
const RIDGE_ON_LIGHT: [f64; CHANNELS] = [0.02, 0.3, 0.3, 0.02];

/// A sketch, ready to be compared.
#[derive(Clone)]
pub(super) struct Template {
    spectra: [Vec<Complex32>; CHANNELS],
    /// What products of the channels with a cell explain is this matrix between them.
    explained: DMat4,
    /// At a possible shift, the channels' products with the cell have a positive product with each of these:
    /// high yarns are lighter than low ones, whatever the light, and light ground adds light.
    possible: [DVec4; 2],
}

/// The best fit of a template to a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Match {
    /// Share of the cell's variance that it explains.
    pub(super) explained: f64,
    /// Pixels by which the sketch is moved to the right and down.
    pub(super) shift: [usize; 2],
}

/// A cell, ready to be compared.
pub(super) struct CellSpectrum {
    values: Vec<Complex32>,
    /// Sum of the squares of its values.
    power: f64,
}

impl CellSpectrum {
    /// The spectrum of a cell without its mean.
    pub(super) fn new(fourier: &Fourier, cell: &[f32]) -> Self {
        let mut values = fourier.spectrum(cell);
        values[0] = Complex32::default();
        let power = values.iter().map(|value| f64::from(value.norm_sqr())).sum::<f64>()
            / double(fourier.len());
        Self { values, power }
    }

    /// The cell at a coarser resolution: the low frequencies of the spectrum of `from`. It keeps the
    /// power of all, so that shares explained are of the same whole.
    pub(super) fn coarser(&self, from: &Fourier, to: &Fourier) -> Self {
        let scale = narrow(double(to.len()) / double(from.len()));
        let axis = |coarse: usize, fine: usize| {
            // The highest frequency of the coarse cell stands for two of the fine one.
            (0..coarse).map(move |at| match (2 * at).cmp(&coarse) {
                Ordering::Less => Some(at),
                Ordering::Equal => None,
                Ordering::Greater => Some(fine - (coarse - at)),
            })
        };
        let values = axis(to.height, from.height).flat_map(|y| {
            axis(to.width, from.width).map(move |x| {
                let value = y.zip(x).map(|(y, x)| self.values[y * from.width + x]);
                value.map_or(Complex32::default(), |value| value * scale)
            })
        });
        Self { values: values.collect(), power: self.power * f64::from(scale) }
    }
}

impl Template {
    /// The channels of a sketch on some ground, blurred by a Gaussian of so many of its pixels.
    pub(super) fn new(
        fourier: &Fourier,
        channels: [&Plane; CHANNELS],
        ground: Ground,
        blur: f64,
    ) -> Self {
        let channels = channels.map(|plane| &plane.values);
        let pair = |at: usize| {
            channels[at].iter().zip(channels[at + 1]).map(|(one, other)| [*one, *other])
        };
        let spectra = [pair(0), pair(2)].map(|pair| fourier.spectra_of_two(pair));
        Self::of_spectra(fourier, spectra, ground, blur)
    }

    /// The lights of a sketch in all channels, place by place, blurred in the same way.
    pub(super) fn of_lights(
        fourier: &Fourier,
        lights: &[[f32; CHANNELS]],
        ground: Ground,
        blur: f64,
    ) -> Self {
        let pair = |at: usize| lights.iter().map(move |light| [light[at], light[at + 1]]);
        let spectra = [pair(0), pair(2)].map(|pair| fourier.spectra_of_two(pair));
        Self::of_spectra(fourier, spectra, ground, blur)
    }

    /// The spectra of the channels, blurred in the same way.
    fn of_spectra(
        fourier: &Fourier,
        [[a, b], [c, d]]: [[Vec<Complex32>; 2]; 2],
        ground: Ground,
        blur: f64,
    ) -> Self {
        let weights = Gaussian::new(fourier, blur);
        let spectra = [a, b, c, d].map(|mut spectrum| {
            weights.blur(&mut spectrum);
            // Means tell nothing: the photo's own is taken off.
            spectrum[0] = Complex32::default();
            spectrum
        });
        let mut gram = products(&spectra, fourier.width);
        gram.iter_mut().flatten().for_each(|entry| *entry /= double(fourier.len()));
        let scale = gram[0][0].max(f64::MIN_POSITIVE);
        let plain = DMat4::from_cols_array_2d(&gram);
        let ridges = match ground {
            Ground::Dark | Ground::Bars => RIDGE,
            Ground::Light => RIDGE_ON_LIGHT,
        };
        for (at, ridge) in ridges.into_iter().enumerate() {
            gram[at][at] += ridge * gram[at][at] + 1e-9 * scale;
        }
        // The light `l` that fits products `p` is `inverse p`, and it explains `2 l p - l plain l`.
        let inverse = DMat4::from_cols_array_2d(&gram).inverse();
        // Beside light ground or lighter bars, high yarns may be dark places of the cell. But the light that
        // fits must shine on them, and on the other bars, and the ground must have some of its own.
        let possible = match ground {
            Ground::Dark => [DVec4::X; 2],
            Ground::Bars => [inverse.row(0), inverse.row(0) + inverse.row(CHANNELS - 1)],
            Ground::Light => [inverse.row(0), inverse.row(CHANNELS - 1)],
        };
        Self { spectra, explained: 2.0 * inverse - inverse * plain * inverse, possible }
    }

    /// The best fit to a cell over all shifts.
    pub(super) fn best(&self, fourier: &Fourier, cell: &CellSpectrum) -> Match {
        let products = [[0, 1], [2, 3]].map(|[real, imaginary]| {
            // Correlations are real, so that two fit into one transform.
            let mut grid: Vec<Complex32> = cell
                .values
                .iter()
                .zip(&self.spectra[real])
                .zip(&self.spectra[imaginary])
                .map(|((value, a), b)| {
                    let (a, b) = (value * a.conj(), value * b.conj());
                    Complex32::new(a.re - b.im, a.im + b.re)
                })
                .collect();
            fourier.inverse(&mut grid);
            grid
        });
        let scale = 1.0 / double(fourier.len());
        let mut best = Match { explained: 0.0, shift: [0, 0] };
        for (at, (first, second)) in products[0].iter().zip(&products[1]).enumerate() {
            let product =
                DVec4::new(first.re.into(), first.im.into(), second.re.into(), second.im.into())
                    * scale;
            if self.possible.iter().any(|way| product.dot(*way) <= 0.0) {
                continue;
            }
            let explained = product.dot(self.explained * product);
            if explained > best.explained {
                best = Match { explained, shift: [at % fourier.width, at / fourier.width] };
            }
        }
        best.explained /= cell.power.max(f64::MIN_POSITIVE);
        best
    }
}

/// The sums of products of each channel with each, of spectra of real planes whose rows are so
/// long. Opposite frequencies add the same, so that half of each row is enough. One pass adds to
/// all sums: one after another would wait for each of its additions.
fn products(spectra: &[Vec<Complex32>; CHANNELS], width: usize) -> [[f64; CHANNELS]; CHANNELS] {
    let mut products = [[0.0; CHANNELS]; CHANNELS];
    let [a, b, c, d] = spectra.each_ref().map(|spectrum| spectrum.chunks_exact(width));
    for (((a, b), c), d) in a.zip(b).zip(c).zip(d) {
        for at in 0..=width / 2 {
            let values = [a[at], b[at], c[at], d[at]];
            let is_alone = at == 0 || 2 * at == width;
            let count = if is_alone { 1.0 } else { 2.0 };
            for (row, one) in values.iter().enumerate() {
                for (column, other) in values.iter().enumerate().skip(row) {
                    products[row][column] +=
                        count * f64::from(one.re * other.re + one.im * other.im);
                }
            }
        }
    }
    std::array::from_fn(|row| {
        std::array::from_fn(|column| products[row.min(column)][row.max(column)])
    })
}

/// The spectrum of a Gaussian.
struct Gaussian {
    across: Vec<f32>,
    down: Vec<f32>,
}

impl Gaussian {
    fn new(fourier: &Fourier, sigma: f64) -> Self {
        let weights = |side: usize| -> Vec<f32> {
            (0..side)
                .map(|at| {
                    let frequency = double(at.min(side - at)) / double(side);
                    narrow((-2.0 * (std::f64::consts::PI * sigma * frequency).powi(2)).exp())
                })
                .collect()
        };
        Self { across: weights(fourier.width), down: weights(fourier.height) }
    }

    /// Multiplies a spectrum by it.
    fn blur(&self, spectrum: &mut [Complex32]) {
        for (row, weight) in spectrum.chunks_exact_mut(self.across.len()).zip(&self.down) {
            row.iter_mut().zip(&self.across).for_each(|(value, other)| *value *= weight * other);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::float;

    /// Waves of few periods, at so many places each way.
    fn waves(width: usize, height: usize) -> Vec<f32> {
        let wave = |at: usize, side: usize, count: f32| {
            (std::f32::consts::TAU * count * float(at) / float(side)).sin()
        };
        let at = |x, y| {
            wave(x, width, 3.0) * wave(y, height, 2.0) + wave(y, height, 5.0) + wave(x, width, -1.0)
        };
        (0..width * height).map(|place| at(place % width, place / width)).collect()
    }

    #[test]
    fn a_coarser_cell_is_that_of_fewer_places() {
        let [from, to] = [(16, 24), (8, 12)].map(|(width, height)| Fourier::new(width, height));
        let cell = waves(16, 24);
        let coarse = CellSpectrum::new(&to, &waves(8, 12));
        // Neighbours of opposite sign: a wave that fewer places can't show.
        let ripple = |at: usize| if at.is_multiple_of(2) { 0.5 } else { -0.5 };
        let rippled: Vec<f32> =
            cell.iter().enumerate().map(|(at, value)| value + ripple(at)).collect();
        for (values, power) in [(&cell, coarse.power), (&rippled, coarse.power + 0.25 * 96.0)] {
            let found = CellSpectrum::new(&from, values).coarser(&from, &to);
            for (a, b) in found.values.iter().zip(&coarse.values) {
                assert!((a - b).norm() < 1e-3, "{a} {b}");
            }
            assert!((found.power / power - 1.0).abs() < 1e-4);
        }
    }
}
