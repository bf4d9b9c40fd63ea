//! Grey pictures in floating point, the data that the steps of `photo` and `capture` pass on.
//!
//! In: pixels. Out: [`Plane`]s of f32, row by row, four bytes a pixel, with box filters, column
//! sums and percentiles. A photo is never held in f64 or as three planes, so that 48 megapixels fit
//! into 2 GB.
//!
//! Rows are processed in parallel. Each sum stays within one row, one band of rows or one block of
//! columns whose size does not depend on the number of threads, so the results are the same for any
//! number of threads.

use image::{Rgb, RgbImage};
use rayon::prelude::*;

pub(crate) use warpknit_core::number::{byte, double, float, narrow, whole, whole_f64};

/// A picture with one number a pixel.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Plane {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Row after row.
    pub(crate) values: Vec<f32>,
}

impl Plane {
    /// A plane whose values are a function of x and y.
    pub(crate) fn from_fn(
        width: usize,
        height: usize,
        of: impl Fn(usize, usize) -> f32 + Sync,
    ) -> Self {
        Self::from_rows(width, height, |y, row| {
            row.iter_mut().enumerate().for_each(|(x, value)| *value = of(x, y));
        })
    }

    /// A plane whose rows are filled one by one; `fill` takes y and the row.
    pub(crate) fn from_rows(
        width: usize,
        height: usize,
        fill: impl Fn(usize, &mut [f32]) + Sync,
    ) -> Self {
        let mut values = vec![0.0; width * height];
        values.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| fill(y, row));
        Self { width, height, values }
    }

    /// The luma of a picture, reduced by a whole factor: means over squares of `step` pixels.
    pub(crate) fn grey(picture: &RgbImage, step: usize) -> Self {
        let (width, height) = (picture.width() as usize / step, picture.height() as usize / step);
        let bytes = picture.as_raw();
        let stride = 3 * picture.width() as usize;
        let pixels = float(step * step);
        Self::from_fn(width, height, |x, y| {
            let rows = (y * step..(y + 1) * step)
                .map(|row| &bytes[row * stride + 3 * x * step..][..3 * step]);
            let sum: f32 = rows
                .flat_map(|row| row.chunks_exact(3))
                .map(|p| luma(Rgb([p[0], p[1], p[2]])))
                .sum();
            sum / pixels
        })
    }

    pub(crate) fn row(&self, y: usize) -> &[f32] {
        &self.values[y * self.width..(y + 1) * self.width]
    }

    pub(crate) fn at(&self, x: usize, y: usize) -> f32 {
        self.values[y * self.width + x]
    }

    /// A regular subsample of one to two million values at most, which is enough for any
    /// percentile.
    pub(crate) fn sampled(&self) -> impl Iterator<Item = f32> {
        self.values.iter().copied().step_by((self.values.len() >> 20).max(1))
    }

    /// A function of each value.
    pub(crate) fn map(&self, of: impl Fn(f32) -> f32 + Sync) -> Self {
        let values = self.values.par_iter().map(|&value| of(value)).collect();
        Self { values, ..*self }
    }

    /// A box filter of `2 radius + 1` pixels each way, applied twice, which approximates a Gaussian
    /// (Wells 1986, "Efficient synthesis of Gaussian filters by cascaded uniform filters"). Along x
    /// the picture is periodic if `wraps`; otherwise its border pixels continue. Cost: a few
    /// operations a pixel whatever the radius.
    pub(crate) fn blurred(&self, radius: usize, wraps: bool) -> Self {
        if radius == 0 {
            return self.clone();
        }
        let once = self.box_rows(radius, wraps).box_columns(radius);
        once.box_rows(radius, wraps).box_columns(radius)
    }

    /// A box filter along the rows, by a running sum.
    fn box_rows(&self, radius: usize, wraps: bool) -> Self {
        let width = self.width;
        let radius = radius.min(width.saturating_sub(1) / 2);
        Self::from_rows(width, self.height, |y, row| {
            let source = self.row(y);
            let at = |x: usize| {
                // x counts from `radius` pixels before the row, so that it is never negative.
                if wraps {
                    source[(x + width - radius) % width]
                } else {
                    source[x.saturating_sub(radius).min(width - 1)]
                }
            };
            // The sum is f64: in f32 the rounding errors of thousands of additions and subtractions
            // would add up to visible drift along the row.
            let mut sum: f64 = (0..2 * radius).map(|x| f64::from(at(x))).sum();
            for (x, value) in row.iter_mut().enumerate() {
                sum += f64::from(at(x + 2 * radius));
                *value = narrow(sum) / float(2 * radius + 1);
                sum -= f64::from(at(x));
            }
        })
    }

    /// A box filter along the columns, by running sums. Each thread works on a band of whole rows
    /// and keeps one sum a column: walking down single columns would miss the cache at every pixel.
    fn box_columns(&self, radius: usize) -> Self {
        let radius = radius.min(self.height.saturating_sub(1) / 2);
        // y counts from `radius` rows before the picture.
        let row = |y: usize| self.row(y.saturating_sub(radius).min(self.height - 1));
        let band = band(radius);
        let mut values = vec![0.0; self.values.len()];
        values.par_chunks_mut((band * self.width).max(1)).enumerate().for_each(|(at, rows)| {
            let mut sums = vec![0.0_f64; self.width];
            // The first window of the band, less its last row.
            for y in band * at..band * at + 2 * radius {
                sums.iter_mut().zip(row(y)).for_each(|(sum, value)| *sum += f64::from(*value));
            }
            for (y, values) in (band * at..).zip(rows.chunks_exact_mut(self.width)) {
                let ends = row(y + 2 * radius).iter().zip(row(y));
                for ((sum, value), (next, last)) in sums.iter_mut().zip(values).zip(ends) {
                    *sum += f64::from(*next);
                    *value = narrow(*sum) / float(2 * radius + 1);
                    *sum -= f64::from(*last);
                }
            }
        });
        Self { values, ..*self }
    }
}

/// Rows of a band, the unit of work of a thread. A band reads `2 radius` rows more than its own, so
/// it has at least twice as many. The number of threads plays no role, so that sums are the same
/// for any number of them.
pub(crate) fn band(radius: usize) -> usize {
    (4 * radius).max(64)
}

/// Columns that a thread sums together. Their values of a row lie side by side in memory and fill a
/// few cache lines.
const COLUMNS: usize = 64;

/// For each column the sum of a function over some rows.
pub(crate) fn column_sums(
    columns: usize,
    rows: impl Iterator<Item = usize> + Clone + Sync,
    of: impl Fn(usize, usize) -> f32 + Sync,
) -> Vec<f64> {
    let mut sums = vec![0.0; columns];
    sums.par_chunks_mut(COLUMNS).enumerate().for_each(|(at, sums)| {
        for y in rows.clone() {
            (COLUMNS * at..).zip(sums.iter_mut()).for_each(|(x, sum)| *sum += f64::from(of(x, y)));
        }
    });
    sums
}

/// Luma of a pixel, 0..=255: Rec. 709's weights, applied to the encoded values.
pub(crate) fn luma(Rgb([r, g, b]): Rgb<u8>) -> f32 {
    0.2126 * f32::from(r) + 0.7152 * f32::from(g) + 0.0722 * f32::from(b)
}

/// The value below which a share of the values lies; 0 of none. Reorders the values (quickselect,
/// linear time).
pub(crate) fn percentile(values: &mut [f32], share: f32) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let at = whole(share.clamp(0.0, 1.0) * float(values.len() - 1));
    *values.select_nth_unstable_by(at, f32::total_cmp).1
}

/// A side of a picture in the 32 bits that the image crate counts with.
pub(crate) fn side(count: usize) -> u32 {
    u32::try_from(count).expect("sides of photos are limited")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blurring_keeps_a_flat_plane_and_goes_around_if_asked() {
        let flat = Plane::from_fn(9, 5, |_, _| 3.0);
        assert!(flat.blurred(2, false).values.iter().all(|value| (value - 3.0).abs() < 1e-6));
        let spot = Plane::from_fn(9, 5, |x, _| if x == 0 { 1.0 } else { 0.0 });
        let (around, ends) = (spot.blurred(1, true), spot.blurred(1, false));
        assert!(around.at(8, 2) > 0.2 && ends.at(8, 2) == 0.0);
        let row: f32 = around.row(2).iter().sum();
        assert!((row - 1.0).abs() < 1e-5);
    }

    #[test]
    fn blurring_is_a_mean_over_boxes_whatever_the_band() {
        let plane = Plane::from_fn(7, 200, |x, y| float((x * 31 + y * 17) % 23));
        let blurred = plane.box_columns(2);
        for (x, y) in [(0, 0), (3, 63), (4, 64), (5, 66), (6, 199)] {
            let near = |off: usize| plane.at(x, (y + off).saturating_sub(2).min(199));
            let mean = (0..5).map(near).sum::<f32>() / 5.0;
            assert!((blurred.at(x, y) - mean).abs() < 1e-4, "{x} {y}");
        }
    }

    #[test]
    fn smaller_planes_are_means_and_percentiles_are_values() {
        let picture = RgbImage::from_fn(5, 4, |x, _| Rgb([if x < 2 { 0 } else { 100 }; 3]));
        let half = Plane::grey(&picture, 2);
        assert_eq!((half.width, half.height), (2, 2));
        assert!(half.at(0, 0) == 0.0 && (half.at(1, 1) - 100.0).abs() < 1e-4);
        assert_eq!(percentile(&mut [3.0, 1.0, 2.0], 0.5), 2.0);
        assert_eq!(percentile(&mut [], 0.5), 0.0);
    }
}
