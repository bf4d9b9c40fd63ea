//! A photo laid out by wales and courses, and folded into one repeat.
//!
//! In: a photo's light, and where each wale and course lies in it. Out: a [`UnfoldedPhoto`] on the grid of
//! the sketches, and its [`Fold`]s: the mean of all copies of a repeat, and which share of the
//! photo's variance all copies have in common. Cost: a bilinear sample a pixel.

use glam::{DVec2, USizeVec2};

use super::frames::Frame;
use super::sketch::{COURSE, WALE};
use crate::plane::{Plane, double, float, narrow, whole};

/// Pixels of a row over which the cloth is taken to bend evenly, a quarter of a wale: some five pixels of the
/// photo, and bends change over tens of them.
const SAME_BEND: usize = WALE / 4;

/// A photo on the grid of sketches.
pub(super) struct UnfoldedPhoto {
    width: usize,
    /// Wale and course of its first pixel.
    first: [i64; 2],
    /// Without a value where the photo ends.
    values: Vec<Option<f32>>,
    /// How many of them have one.
    count: usize,
    /// Mean of the squares.
    power: f32,
}

/// The mean of all copies of a repeat.
pub(super) struct Fold {
    /// Without their mean.
    pub(super) values: Vec<f32>,
    pub(super) mean: f32,
    /// Share of the photo's variance that it explains.
    pub(super) share: f64,
}

/// The share of a picture's variance that the means of its rows leave, or those of its columns,
/// whichever leave less: nothing of stripes.
pub(super) fn beyond_stripes(values: &[f32], width: usize) -> f32 {
    let (columns, rows) = (float(width), float(values.len() / width));
    let mean = values.iter().sum::<f32>() / (columns * rows);
    let mut sums = vec![0.0_f32; width];
    let (mut whole, mut by_rows) = (f32::MIN_POSITIVE, 0.0);
    for row in values.chunks_exact(width) {
        whole += row.iter().map(|value| (value - mean).powi(2)).sum::<f32>();
        by_rows += columns * (row.iter().sum::<f32>() / columns - mean).powi(2);
        sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
    }
    let by_columns = sums.iter().map(|sum| rows * (sum / rows - mean).powi(2)).sum::<f32>();
    1.0 - by_rows.max(by_columns) / whole
}

impl UnfoldedPhoto {
    /// The photo in a frame whose origin is the photo's middle. `place` says where in the photo a
    /// place of the undistorted cloth is, pixels.
    pub(super) fn new(even: &Plane, frame: Frame, place: impl Fn(DVec2) -> DVec2) -> Self {
        let size = DVec2::new(double(even.width - 1), double(even.height - 1));
        let middle = 0.5 * size;
        let inverse = frame.0.inverse();
        let corners = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]]
            .map(|corner| inverse * (middle * DVec2::from(corner)));
        let low = corners.into_iter().fold(DVec2::INFINITY, DVec2::min).floor();
        let high = corners.into_iter().fold(DVec2::NEG_INFINITY, DVec2::max).ceil();
        let cells = DVec2::new(double(WALE), double(COURSE));
        let [width, height] = ((high - low) * cells).to_array().map(|side| whole(narrow(side)));
        let inside = |at: DVec2| at.min_element() >= 0.0 && at.cmple(size).all();
        let first = middle + frame.0 * (low + 0.5 / cells);
        let [across, down] = [frame.0.x_axis / cells.x, frame.0.y_axis / cells.y];
        let mut values: Vec<Option<f32>> = Vec::with_capacity(width * height);
        for y in 0..height {
            let first = first + double(y) * down;
            let mut next = place(first);
            for x in (0..width).step_by(SAME_BEND) {
                let begin = next;
                next = place(first + double(x + SAME_BEND) * across);
                let step = (next - begin) / double(SAME_BEND);
                values.extend((0..SAME_BEND).map(|number| {
                    let at = begin + double(number) * step;
                    inside(at).then(|| even.sample(at))
                }));
            }
        }
        let known = values.iter().flatten();
        let known_count = known.clone().count();
        let count = float(known_count.max(1));
        let mean = known.clone().sum::<f32>() / count;
        let power = known.map(|value| (value - mean).powi(2)).sum::<f32>() / count;
        #[expect(clippy::cast_possible_truncation, reason = "some hundred wales at most")]
        let first = low.to_array().map(|at| at as i64);
        Self { width, first, values, count: known_count, power }
    }

    /// All copies of a repeat, wales and courses, folded into one.
    pub(super) fn fold(&self, repeat: [usize; 2]) -> Fold {
        let side = USizeVec2::new(repeat[0] * WALE, repeat[1] * COURSE);
        // The first pixel's place in the repeat.
        let start = |at: i64, count: usize, cell: usize| {
            let count = i64::try_from(count).expect("repeats are limited");
            usize::try_from(at.rem_euclid(count)).expect("a remainder is not negative") * cell
        };
        let [left, top] =
            [start(self.first[0], repeat[0], WALE), start(self.first[1], repeat[1], COURSE)];
        let mut sums = vec![[0.0_f32; 2]; side.x * side.y];
        for (y, row) in self.values.chunks_exact(self.width).enumerate() {
            let to = (y + top) % side.y * side.x;
            let mut x = left;
            for value in row {
                if let Some(value) = value {
                    let sum = &mut sums[to + x];
                    sum[0] += value;
                    sum[1] += 1.0;
                }
                x = if x + 1 == side.x { 0 } else { x + 1 };
            }
        }
        let count = sums.iter().map(|sum| sum[1]).sum::<f32>().max(1.0);
        let mean = sums.iter().map(|sum| sum[0]).sum::<f32>() / count;
        let values: Vec<f32> = sums
            .iter()
            .map(|[sum, count]| if *count > 0.0 { sum / count - mean } else { 0.0 })
            .collect();
        let common =
            sums.iter().zip(&values).map(|(sum, value)| sum[1] * value * value).sum::<f32>();
        let share = f64::from(common / (count * self.power).max(f32::MIN_POSITIVE));
        Fold { values, mean, share }
    }

    /// How many copies of a repeat it shows.
    pub(super) fn copies(&self, repeat: [usize; 2]) -> f64 {
        double(self.count) / double(repeat[0] * WALE * repeat[1] * COURSE)
    }
}

#[cfg(test)]
mod tests {
    use super::super::candidate::{warp_knits, weft_knits};
    use super::super::{Face, LEAST_BEYOND_STRIPES};
    use super::*;

    #[test]
    fn stripes_leave_nothing_of_stripes_and_most_of_a_knit() {
        let striped: Vec<f32> = (0..96).map(|at| float(at / 12 % 3)).collect();
        assert!(beyond_stripes(&striped, 12) < 1e-5);
        let upright: Vec<f32> = (0..96).map(|at| float(at % 12 % 4)).collect();
        assert!(beyond_stripes(&upright, 12) < 1e-5);
        let mut all: Vec<(f32, String)> = Vec::new();
        for candidate in warp_knits().iter().chain(weft_knits()) {
            for face in [Face::Front, Face::Back] {
                let light = &candidate.sketch(face).channels[0].blurred(1, true);
                let beyond = beyond_stripes(&light.values, light.width);
                all.push((beyond, format!("{} {face:?}", candidate.fabric.name)));
            }
        }
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        assert!(all[0].0 > 1.5 * LEAST_BEYOND_STRIPES, "{:?}", all[0]);
    }
}
