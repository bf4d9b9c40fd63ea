//! The ground behind a yarn: its light as a smooth surface over the photo.
//!
//! In: a grey plane of the whole photo. Out: [`Ground`], a polynomial of degree two in x and y.
//!
//! Method: iteratively reweighted least squares with the weights of Geman and McClure 1987
//! ("Statistical methods for tomographic image reconstruction"), which fall to 0 for outliers such
//! as the yarn. The first fit uses the photo's border, which is mostly ground; the second one adds
//! pixels all over the photo. A lamp on one side of the photo makes a gradient that no single
//! threshold could separate from the yarn.
//!
//! Cost: 16 passes over the border and about [`SAMPLES`] pixels between. Sums run in one thread, so
//! the result does not depend on the number of threads.

use crate::plane::{Plane, double, float, narrow, percentile, whole};

/// Width of the border, as a share of the photo's shorter side.
const BORDER: f32 = 0.03;
/// Iterations of each of the two fits. The weights change little after a few.
const ITERATIONS: usize = 8;
/// About how many pixels all over the photo are used: six coefficients need no more.
const SAMPLES: usize = 16_384;
/// Least standard deviation of a camera's noise, grey levels. A smaller scale would reject the
/// ground of a noiseless picture over its rounding.
const LEAST_SPREAD: f32 = 0.6;

/// The grey of the empty ground at any place of a photo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ground {
    /// Factors of 1, x, y, x², xy, y², with x and y from -1 to 1 over the photo.
    coefficients: [f64; 6],
    width: f64,
    height: f64,
    /// Mean of the surface over the photo.
    pub(super) level: f32,
}

impl Ground {
    /// Fits the ground of a photo.
    pub(super) fn fit(grey: &Plane) -> Self {
        let border = border(grey);
        let mut values: Vec<f32> = border.iter().map(|&at| grey.values[at]).collect();
        let level = percentile(&mut values, 0.5);
        let (width, height) = (double(grey.width), double(grey.height));
        let mut ground = Self {
            coefficients: [f64::from(level), 0.0, 0.0, 0.0, 0.0, 0.0],
            width,
            height,
            level,
        };
        // The border alone first. A level surface at its median is a starting point that the yarn,
        // which crosses the border at two places at most, does not affect.
        for _ in 0..ITERATIONS {
            ground = ground.refitted(grey, &border, 0.5);
        }
        // The border says little about the middle of the photo. Pixels near the border's surface
        // are ground as well, and the reweighting finds them. A yarn may cover most of the photo,
        // so only the quarter of the pixels that lies nearest measures the noise.
        let all = grid_samples(grey);
        for _ in 0..ITERATIONS {
            ground = ground.refitted(grey, &all, 0.25);
        }
        let sum: f64 = all
            .iter()
            .map(|at| ground.over(double(at % grey.width), double(at / grey.width)))
            .sum();
        ground.level = narrow(sum / double(all.len()));
        ground
    }

    /// The grey at a place of the photo, given in shares of its sides.
    pub(super) fn at(&self, x: f32, y: f32) -> f32 {
        narrow(self.over(f64::from(x) * self.width, f64::from(y) * self.height))
    }

    /// The grey at a place in pixels.
    fn over(&self, x: f64, y: f64) -> f64 {
        self.terms(x, y)
            .iter()
            .zip(self.coefficients)
            .map(|(term, coefficient)| term * coefficient)
            .sum()
    }

    fn terms(&self, x: f64, y: f64) -> [f64; 6] {
        let (x, y) = (2.0 * x / self.width - 1.0, 2.0 * y / self.height - 1.0);
        [1.0, x, y, x * x, x * y, y * y]
    }

    /// One iteration: least squares over some pixels, weighted by their distance from this surface.
    /// At least `share` of the pixels must be ground.
    fn refitted(&self, grey: &Plane, pixels: &[usize], share: f32) -> Self {
        let place = |at: usize| (double(at % grey.width), double(at / grey.width));
        let off = |at: usize| {
            let (x, y) = place(at);
            f64::from(grey.values[at]) - self.over(x, y)
        };
        let mut near: Vec<f32> = pixels.iter().map(|&at| narrow(off(at).abs())).collect();
        // The noise's standard deviation from a quantile of the absolute residuals: half of normal
        // noise lies within 0.67 standard deviations, a quarter within 0.32.
        let spread = percentile(&mut near, share) / if share < 0.5 { 0.32 } else { 0.67 };
        let scale = f64::from(2.0 * spread.max(LEAST_SPREAD));
        let mut system = [[0.0; 7]; 6];
        for &at in pixels {
            let (x, y) = place(at);
            // Geman and McClure: w(r) = 1 / (1 + (r / s)²)².
            let weight = (1.0 + (off(at) / scale).powi(2)).powi(-2);
            // Normal equations, with the right-hand side in the seventh column.
            let terms = self.terms(x, y);
            for (row, a) in system.iter_mut().zip(terms) {
                for (cell, b) in row.iter_mut().zip(terms) {
                    *cell += weight * a * b;
                }
                row[6] += weight * a * f64::from(grey.values[at]);
            }
        }
        Self { coefficients: solved(system).unwrap_or(self.coefficients), ..*self }
    }
}

/// Pixels on a regular grid all over a photo.
fn grid_samples(grey: &Plane) -> Vec<usize> {
    let step =
        (1..).find(|step| (grey.width / step) * (grey.height / step) <= SAMPLES).unwrap_or(1);
    (0..grey.height)
        .step_by(step)
        .flat_map(|y| (0..grey.width).step_by(step).map(move |x| y * grey.width + x))
        .collect()
}

/// Pixels near the photo's border.
pub(super) fn border(grey: &Plane) -> Vec<usize> {
    let (width, height) = (grey.width, grey.height);
    let deep = whole(BORDER * float(width.min(height))).max(2);
    (0..width * height)
        .filter(|at| {
            let (x, y) = (at % width, at / width);
            x < deep || y < deep || x + deep >= width || y + deep >= height
        })
        .collect()
}

/// Solves the normal equations by Gauss-Jordan elimination with partial pivoting. `None` where they
/// don't determine all unknowns.
fn solved(mut system: [[f64; 7]; 6]) -> Option<[f64; 6]> {
    for column in 0..6 {
        let pivot = (column..6)
            .max_by(|&a, &b| system[a][column].abs().total_cmp(&system[b][column].abs()))?;
        system.swap(column, pivot);
        let row = system[column];
        if row[column].abs() < 1e-9 {
            return None;
        }
        for other in (0..6).filter(|&other| other != column) {
            let share = system[other][column] / row[column];
            system[other].iter_mut().zip(row).for_each(|(cell, own)| *cell -= share * own);
        }
    }
    Some(std::array::from_fn(|i| system[i][6] / system[i][i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_light_of_the_ground_is_found_behind_a_yarn() {
        let light = |x: usize, y: usize| 90.0 + 0.2 * float(x) - 0.1 * float(y);
        let photo =
            Plane::from_fn(120, 80, |x, y| if (30..55).contains(&y) { 220.0 } else { light(x, y) });
        let ground = Ground::fit(&photo);
        for (x, y) in [(5, 5), (60, 40), (110, 70)] {
            let found = ground.at(float(x) / 120.0, float(y) / 80.0);
            assert!((found - light(x, y)).abs() < 1.0, "{found} at {x} {y}");
        }
    }
}
