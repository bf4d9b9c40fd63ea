//! Image filters on planes that only capture needs: lightness, Gaussian blur, gradient, bilinear
//! sampling, and the removal of slow shading.
//!
//! In: a [`Plane`], or a picture. Out: planes of the same size. Cost: a few operations a pixel.

use glam::DVec2;
use image::RgbImage;
use rayon::prelude::*;

use crate::plane::{Plane, double, float, narrow, whole, whole_f64};
use warpknit_core::fabric::yarn::Color;

/// Standard deviation from which on a Gaussian is replaced by two box blurs, pixels. They cost the
/// same for any width. Below, boxes of a few pixels would be a poor approximation.
const BOXES_FROM: f32 = 4.0;
/// Largest absolute value of the normalised contrast, in standard deviations. Glints and holes
/// count no more than that in a fit.
const MAX_CONTRAST: f32 = 3.0;
/// Share of the picture's mean power that is added to the local power. At 0, noise of blank areas
/// would be amplified to full contrast.
const POWER_FLOOR: f32 = 0.1;

impl Plane {
    /// Lightness of each pixel, 0..1: CIE L* / 100 of its colour.
    pub(crate) fn lightness(picture: &RgbImage) -> Self {
        let linear = linear_of_bytes();
        let [width, height] = [picture.width(), picture.height()].map(|side| side as usize);
        let values = picture
            .as_raw()
            .par_chunks_exact(3)
            .map(|pixel| {
                let [red, green, blue] =
                    [0, 1, 2].map(|channel| linear[usize::from(pixel[channel])]);
                let luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue;
                if luminance > 0.008_856 {
                    1.16 * luminance.cbrt() - 0.16
                } else {
                    9.033 * luminance
                }
            })
            .collect();
        Self { width, height, values }
    }

    /// Red, green and blue of each pixel in linear light, 0..1.
    pub(crate) fn channels(picture: &RgbImage) -> [Self; 3] {
        let linear = linear_of_bytes();
        let [width, height] = [picture.width(), picture.height()].map(|side| side as usize);
        [0, 1, 2].map(|channel| {
            let pixels = picture.as_raw().par_chunks_exact(3);
            let values = pixels.map(|pixel| linear[usize::from(pixel[channel])]).collect();
            Self { width, height, values }
        })
    }

    /// A Gaussian blur of that standard deviation, pixels. Beyond the border, the picture goes on
    /// as at its rim.
    pub(crate) fn smoothed(&self, sigma: f32) -> Self {
        if sigma >= BOXES_FROM {
            // Two boxes of 2 r + 1 pixels have the variance ((2 r + 1)^2 - 1) / 6.
            let radius = (((6.0 * sigma * sigma + 1.0).sqrt() - 1.0) / 2.0).round();
            return self.blurred(whole(radius), false);
        }
        let weights = gaussian_kernel(sigma);
        let reach = weights.len() / 2;
        let inside = |at: usize, side: usize| at.saturating_sub(reach).min(side - 1);
        // The Gaussian is separable: rows first, and then columns.
        let across = Self::from_rows(self.width, self.height, |y, row| {
            // A padded copy of the row keeps the border's clamp out of the inner loop.
            let padded: Vec<f32> =
                (0..self.width + 2 * reach).map(|x| self.at(inside(x, self.width), y)).collect();
            for (value, window) in row.iter_mut().zip(padded.windows(weights.len())) {
                *value = window.iter().zip(&weights).map(|(value, weight)| value * weight).sum();
            }
        });
        // Columns are summed as whole rows, which lie in memory one after another.
        Self::from_rows(self.width, self.height, |y, row| {
            for (off, weight) in weights.iter().enumerate() {
                let source = across.row(inside(y + off, self.height));
                row.iter_mut().zip(source).for_each(|(value, source)| *value += weight * source);
            }
        })
    }

    /// A function of this plane's values and another plane's at the same places.
    pub(super) fn zip(&self, other: &Self, of: impl Fn(f32, f32) -> f32 + Sync) -> Self {
        let values = self.values.par_iter().zip(&other.values).map(|(a, b)| of(*a, *b)).collect();
        Self { values, ..*self }
    }

    /// Mean of the squares.
    pub(super) fn mean_square(&self) -> f32 {
        narrow(
            self.values.iter().map(|value| f64::from(*value).powi(2)).sum::<f64>()
                / double(self.values.len().max(1)),
        )
    }

    /// Derivatives along x and y by Scharr's operator. Its error of direction is far below that of
    /// Sobel's, and directions are what a structure tensor is for.
    pub(super) fn gradient(&self) -> [Self; 2] {
        // x and y count from 1 before the picture; beyond the border the rim goes on.
        let at = |x: usize, y: usize| {
            self.at(
                x.saturating_sub(1).min(self.width - 1),
                y.saturating_sub(1).min(self.height - 1),
            )
        };
        let column = |x: usize, y: usize| [at(x, y), at(x, y + 1), at(x, y + 2)];
        let row = |x: usize, y: usize| [at(x, y), at(x + 1, y), at(x + 2, y)];
        [
            Self::from_fn(self.width, self.height, |x, y| scharr(column(x, y), column(x + 2, y))),
            Self::from_fn(self.width, self.height, |x, y| scharr(row(x, y), row(x, y + 2))),
        ]
    }

    /// Bilinear sample of a periodic plane. `u` and `v` are shares of the width and of the height.
    pub(super) fn sample_periodic(&self, u: f64, v: f64) -> f32 {
        let [x, y] = [(u, self.width), (v, self.height)]
            .map(|(share, side)| (share - share.floor()) * double(side));
        let [left, top] =
            [(x, self.width), (y, self.height)].map(|(at, side)| whole(narrow(at)).min(side - 1));
        let [right, bottom] = [(left + 1) % self.width, (top + 1) % self.height];
        self.bilinear(
            [left, right],
            [top, bottom],
            [narrow(x) - float(left), narrow(y) - float(top)],
        )
    }

    /// Bilinear sample at a place in pixels. Beyond the border, the picture goes on as at its rim.
    pub(crate) fn sample(&self, place: DVec2) -> f32 {
        let place =
            place.clamp(DVec2::ZERO, DVec2::new(double(self.width - 1), double(self.height - 1)));
        let [left, top] = place.to_array().map(whole_f64);
        let [right, bottom] = [(left + 1).min(self.width - 1), (top + 1).min(self.height - 1)];
        let parts = [place.x - double(left), place.y - double(top)].map(narrow);
        self.bilinear([left, right], [top, bottom], parts)
    }

    /// The bilinear mean of four pixels, by the distances from the left ones and from the upper
    /// ones.
    fn bilinear(
        &self,
        [left, right]: [usize; 2],
        [top, bottom]: [usize; 2],
        [across, down]: [f32; 2],
    ) -> f32 {
        let [upper, lower] =
            [top, bottom].map(|y| self.at(left, y) * (1.0 - across) + self.at(right, y) * across);
        upper * (1.0 - down) + lower * down
    }
}

/// Scharr's derivative from the three pixels before and the three pixels after one.
fn scharr(before: [f32; 3], after: [f32; 3]) -> f32 {
    (3.0 * (after[0] - before[0]) + 10.0 * (after[1] - before[1]) + 3.0 * (after[2] - before[2]))
        / 32.0
}

/// A whole picture without slow shading.
pub(super) fn without_shading(lightness: &Plane) -> Plane {
    normalized_contrast(lightness, float(lightness.width.min(lightness.height)) / 8.0)
}

/// Local mean and variance normalisation: slow shading is taken off, and the contrast becomes the
/// same everywhere. Values are about -3..3. `sigma` is the window's standard deviation; one much
/// below the cell would flatten the yarns themselves.
pub(crate) fn normalized_contrast(lightness: &Plane, sigma: f32) -> Plane {
    let detail = lightness.zip(&lightness.smoothed(sigma), |value, mean| value - mean);
    let power = detail.map(|value| value * value).smoothed(sigma);
    let floor = POWER_FLOOR * detail.mean_square() + f32::MIN_POSITIVE;
    detail.zip(&power, |value, power| {
        (value / (power + floor).sqrt()).clamp(-MAX_CONTRAST, MAX_CONTRAST)
    })
}

/// Linear light of each byte of sRGB.
fn linear_of_bytes() -> Vec<f32> {
    (0..=u8::MAX).map(|byte| Color([byte; 3]).linear()[0]).collect()
}

/// Weights of a Gaussian up to three standard deviations, with a sum of 1.
fn gaussian_kernel(sigma: f32) -> Vec<f32> {
    let reach = i16::try_from(whole((3.0 * sigma).ceil())).expect("a few pixels");
    let weights: Vec<f32> =
        (-reach..=reach).map(|x| (-0.5 * (f32::from(x) / sigma).powi(2)).exp()).collect();
    let sum: f32 = weights.iter().sum();
    weights.iter().map(|weight| weight / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothing_widens_a_spot_by_the_deviation() {
        for sigma in [0.7, 1.5, 2.5, 4.0, 6.0] {
            let spot = Plane::from_fn(81, 81, |x, y| if (x, y) == (40, 40) { 1.0 } else { 0.0 })
                .smoothed(sigma);
            let sum: f32 = spot.values.iter().sum();
            let square = |x: usize| (float(x) - 40.0).powi(2);
            let variance: f32 = (0..81 * 81).map(|at| square(at % 81) * spot.values[at]).sum();
            assert!(
                (sum - 1.0).abs() < 1e-4 && (variance.sqrt() / sigma - 1.0).abs() < 0.1,
                "{sigma}: {sum} {variance}"
            );
        }
    }

    #[test]
    fn slopes_and_places_between_pixels() {
        let slope = Plane::from_fn(9, 7, |x, y| 2.0 * float(x) - 3.0 * float(y));
        let [along, down] = slope.gradient();
        assert!((along.at(4, 3) - 2.0).abs() < 1e-5 && (down.at(4, 3) + 3.0).abs() < 1e-5);
        let ring = Plane::from_fn(4, 1, |x, _| float(x));
        assert_eq!(
            [0.25, 0.375, 0.875, -0.125].map(|u| ring.sample_periodic(u, 0.4)),
            [1.0, 1.5, 1.5, 1.5]
        );
    }

    #[test]
    fn evening_takes_off_shading_and_contrast() {
        let wave = |x: usize| (float(x) * 1.3).sin();
        let shaded = Plane::from_fn(200, 40, |x, _| {
            0.3 + 0.002 * float(x) + (0.05 + 0.0005 * float(x)) * wave(x)
        });
        let even = normalized_contrast(&shaded, 20.0);
        let power =
            |from: usize| (from..from + 40).map(|x| even.at(x, 20).powi(2)).sum::<f32>() / 40.0;
        assert!((power(40) / power(120) - 1.0).abs() < 0.25, "{} {}", power(40), power(120));
    }
}
