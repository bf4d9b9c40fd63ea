//! Grey pictures as numbers, and masks: what the steps hand to each other.
//!
//! In: pixels. Out: [`Plane`]s of f32, row by row, four bytes a pixel, and [`Mask`]s. A photo is never held as f64 or as three planes, so that
//! 48 megapixels fit 2 GB. Rows are worked on in parallel and each sum stays within one row or one thread: results are the same for any number
//! of threads.

use image::{Rgb, RgbImage};
use rayon::prelude::*;

/// Numbers, a row after another.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plane {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) values: Vec<f32>,
}

/// Pixels that belong to something.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Mask {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) set: Vec<bool>,
}

impl Plane {
    pub(super) fn from_fn(width: usize, height: usize, of: impl Fn(usize, usize) -> f32 + Sync) -> Self {
        let mut values = vec![0.0; width * height];
        values.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
            row.iter_mut().enumerate().for_each(|(x, value)| *value = of(x, y));
        });
        Self { width, height, values }
    }

    /// Grey values of a picture, made smaller by a whole number: means of squares of `step` pixels.
    pub(super) fn grey(picture: &RgbImage, step: usize) -> Self {
        let (width, height) = (picture.width() as usize / step, picture.height() as usize / step);
        let bytes = picture.as_raw();
        let stride = 3 * picture.width() as usize;
        let pixels = float(step * step);
        Self::from_fn(width, height, |x, y| {
            let rows = (y * step..(y + 1) * step).map(|row| &bytes[row * stride + 3 * x * step..][..3 * step]);
            let sum: f32 = rows.flat_map(|row| row.chunks_exact(3)).map(|p| luma(Rgb([p[0], p[1], p[2]]))).sum();
            sum / pixels
        })
    }

    pub(super) fn row(&self, y: usize) -> &[f32] {
        &self.values[y * self.width..(y + 1) * self.width]
    }

    pub(super) fn at(&self, x: usize, y: usize) -> f32 {
        self.values[y * self.width + x]
    }

    pub(super) fn map(&self, of: impl Fn(f32) -> f32 + Sync) -> Self {
        let values = self.values.par_iter().map(|&value| of(value)).collect();
        Self { values, ..*self }
    }

    /// Means over boxes of `2 radius + 1` pixels each way, twice, which is nearly a bell; along x it goes around if `wraps`. Cost: a few operations a
    /// pixel whatever the radius.
    pub(super) fn blurred(&self, radius: usize, wraps: bool) -> Self {
        let once = |plane: &Self| plane.box_rows(radius, wraps).transposed().box_rows(radius, false).transposed();
        if radius == 0 { self.clone() } else { once(&once(self)) }
    }

    fn box_rows(&self, radius: usize, wraps: bool) -> Self {
        let mut result = self.clone();
        let width = self.width;
        let radius = radius.min(width.saturating_sub(1) / 2);
        result.values.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
            let source = self.row(y);
            let at = |x: usize| {
                // x counts from `radius` before the row.
                if wraps { source[(x + width - radius) % width] } else { source[x.saturating_sub(radius).min(width - 1)] }
            };
            let mut sum: f64 = (0..2 * radius).map(|x| f64::from(at(x))).sum();
            for (x, value) in row.iter_mut().enumerate() {
                sum += f64::from(at(x + 2 * radius));
                *value = narrow(sum) / float(2 * radius + 1);
                sum -= f64::from(at(x));
            }
        });
        result
    }

    fn transposed(&self) -> Self {
        Self::from_fn(self.height, self.width, |x, y| self.at(y, x))
    }
}

impl Mask {
    pub(super) fn of(plane: &Plane, is_set: impl Fn(f32) -> bool + Sync) -> Self {
        let set = plane.values.par_iter().map(|&value| is_set(value)).collect();
        Self { width: plane.width, height: plane.height, set }
    }

    pub(super) fn at(&self, x: usize, y: usize) -> bool {
        self.set[y * self.width + x]
    }

    pub(super) fn share(&self) -> f32 {
        float(self.set.iter().filter(|&&set| set).count()) / float(self.set.len().max(1))
    }

    /// Its pixels, as places in the rows one after another.
    pub(super) fn pixels(&self) -> impl Iterator<Item = usize> {
        (0..self.set.len()).filter(|&at| self.set[at])
    }

    pub(super) fn or(&self, other: &Self) -> Self {
        let set = self.set.iter().zip(&other.set).map(|(a, b)| *a || *b).collect();
        Self { set, ..*self }
    }

    /// What is linked to the pixels of `seeds`, diagonally too.
    pub(super) fn linked_to(&self, seeds: impl Iterator<Item = usize>) -> Self {
        let mut found = vec![false; self.set.len()];
        self.flood(seeds, &mut found);
        Self { set: found, ..*self }
    }

    /// Marks what is linked to the seeds, and says how many pixels that are.
    fn flood(&self, seeds: impl Iterator<Item = usize>, found: &mut [bool]) -> usize {
        let mut open: Vec<usize> = seeds.filter(|&at| self.set[at]).collect();
        open.retain(|&at| !std::mem::replace(&mut found[at], true));
        let mut count = open.len();
        while let Some(at) = open.pop() {
            let (x, y) = (at % self.width, at / self.width);
            for row in y.saturating_sub(1)..=(y + 1).min(self.height - 1) {
                for column in x.saturating_sub(1)..=(x + 1).min(self.width - 1) {
                    let next = row * self.width + column;
                    if self.set[next] && !found[next] {
                        found[next] = true;
                        count += 1;
                        open.push(next);
                    }
                }
            }
        }
        count
    }

    /// The largest piece whose pixels are linked.
    pub(super) fn largest(&self) -> Self {
        let mut seen = vec![false; self.set.len()];
        let mut best = (0, 0);
        for at in 0..self.set.len() {
            if self.set[at] && !seen[at] {
                let count = self.flood(std::iter::once(at), &mut seen);
                if count > best.0 {
                    best = (count, at);
                }
            }
        }
        self.linked_to((best.0 > 0).then_some(best.1).into_iter())
    }

    /// The mask without the holes that it closes in from all sides.
    pub(super) fn filled(&self) -> Self {
        let ground = Self { set: self.set.iter().map(|&set| !set).collect(), ..*self };
        let (width, height) = (self.width, self.height);
        let rim = (0..width * height).filter(|at| {
            let (x, y) = (at % width, at / width);
            x == 0 || y == 0 || x + 1 == width || y + 1 == height
        });
        let outside = ground.linked_to(rim);
        Self { set: outside.set.iter().map(|&out| !out).collect(), ..*self }
    }

    /// The mask less the pixels next to what isn't in it; the picture's rim does not count as outside.
    pub(super) fn eroded(&self) -> Self {
        self.spread(false)
    }

    /// The mask and the pixels next to it.
    pub(super) fn dilated(&self) -> Self {
        self.spread(true)
    }

    /// Lets set pixels, or unset ones, take the eight around them.
    fn spread(&self, value: bool) -> Self {
        let mut set = vec![!value; self.set.len()];
        set.par_chunks_mut(self.width.max(1)).enumerate().for_each(|(y, row)| {
            let rows = y.saturating_sub(1)..=(y + 1).min(self.height - 1);
            for (x, cell) in row.iter_mut().enumerate() {
                let columns = x.saturating_sub(1)..=(x + 1).min(self.width - 1);
                if rows.clone().any(|y| columns.clone().any(|x| self.at(x, y) == value)) {
                    *cell = value;
                }
            }
        });
        Self { set, ..*self }
    }
}

/// How bright a pixel looks, 0..=255, by Rec. 709's weights of the codes.
pub(super) fn luma(Rgb([r, g, b]): Rgb<u8>) -> f32 {
    0.2126 * f32::from(r) + 0.7152 * f32::from(g) + 0.0722 * f32::from(b)
}

/// The value below which a share of the values lies; 0 of none.
pub(super) fn percentile(values: &mut [f32], share: f32) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let at = whole(share.clamp(0.0, 1.0) * float(values.len() - 1));
    *values.select_nth_unstable_by(at, f32::total_cmp).1
}

#[expect(clippy::cast_precision_loss, reason = "counts of pixels: rounding is far below what is seen")]
pub(super) fn float(count: usize) -> f32 {
    count as f32
}

#[expect(clippy::cast_precision_loss, reason = "sides of pictures are far under 2^52")]
pub(super) fn double(count: usize) -> f64 {
    count as f64
}

#[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
pub(super) fn narrow(number: f64) -> f32 {
    number as f32
}

/// The whole part; 0 of what is negative.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
pub(super) fn whole(number: f32) -> usize {
    number as usize
}

/// The nearest byte.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
pub(super) fn byte(value: f32) -> u8 {
    (value + 0.5) as u8
}

/// A side of a picture in the 32 bits that the image crate counts with.
pub(super) fn side(count: usize) -> u32 {
    u32::try_from(count).expect("sides of photos are limited")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(rows: &[&str]) -> Mask {
        let set = rows.iter().flat_map(|row| row.bytes().map(|byte| byte == b'#')).collect();
        Mask { width: rows[0].len(), height: rows.len(), set }
    }

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
    fn the_largest_piece_stays_and_its_holes_are_filled() {
        let found = mask(&["#......", "...###.", "...#.#.", "...###."]).largest().filled();
        assert_eq!(found, mask(&[".......", "...###.", "...###.", "...###."]));
        assert_eq!(found.eroded().share(), 2.0 / 28.0, "the lower rim is not outside");
        assert_eq!(found.eroded().dilated(), mask(&[".......", "...###.", "...###.", "...###."]));
        assert_eq!(mask(&["..", ".."]).largest().share(), 0.0);
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
