//! Reconstruction filter: from samples to pixels.
//!
//! In: the samples of a row of pixels, each with its place in its pixel. Out: their contributions
//! to this row and to the rows above and below it. The filter is a tent (the bilinear filter), two
//! pixels wide. Each sample counts in all four pixels whose tent covers it ('splatting').
//!
//! A tent suppresses the moiré that a box filter would leave in distant cloth. Because neighbouring
//! pixels share samples, it also has about a third less noise than a box with the same few samples.
//! Rows are added in a fixed order, so floating-point sums are the same for any number of threads.

use glam::Vec4;

/// Pixels that a sample counts in at most: its own and those around it.
pub(super) const NEAR: usize = 9;

/// A weighted sum of samples: the numerator and denominator of the filtered value.
#[derive(Clone, Copy, Debug, Default)]
struct WeightedSum {
    light: Vec4,
    weight: f32,
}

/// Contributions of one row's samples to the row above, to the row itself and to the row below.
#[derive(Debug)]
pub(super) struct Splats {
    sums: [Vec<WeightedSum>; 3],
    /// Light of the set behind each pixel of the row. Empty without a set.
    behind: Vec<Vec4>,
}

impl Splats {
    /// An empty row for a picture `width` pixels wide.
    pub(super) fn new(width: u32) -> Self {
        let sums = std::array::from_fn(|_| vec![WeightedSum::default(); width as usize]);
        Self { sums, behind: Vec::new() }
    }

    /// Appends the light of the set behind the row's next pixel.
    pub(super) fn push_behind(&mut self, light: Vec4) {
        self.behind.push(light);
    }

    /// Light of the set behind a pixel of the row.
    pub(super) fn behind(&self, x: usize) -> Vec4 {
        self.behind.get(x).copied().unwrap_or_default()
    }

    /// Adds a sample at `place` within pixel `x`, 0..1 to the right and down.
    pub(super) fn add(&mut self, x: u32, place: [f32; 2], light: Vec4) {
        let [across, down] = [tent_weights(place[0]), tent_weights(place[1])];
        for (row, down) in self.sums.iter_mut().zip(down) {
            for (next, across) in (x as usize..).zip(across) {
                // `next` counts one too far to the right, since pixel x - 1 may lie left of the
                // picture.
                if let Some(sum) = next.checked_sub(1).and_then(|column| row.get_mut(column)) {
                    sum.light += light * (across * down);
                    sum.weight += across * down;
                }
            }
        }
    }

    /// Adds the sums over all samples of pixel `x` to the nine pixels around it, row by row: their
    /// weighted lights, and their weights.
    pub(super) fn add_sums(&mut self, x: u32, lights: &[Vec4; NEAR], weights: &[f32; NEAR]) {
        let sums = lights.chunks_exact(3).zip(weights.chunks_exact(3));
        for (row, (lights, weights)) in self.sums.iter_mut().zip(sums) {
            for (next, (light, weight)) in (x as usize..).zip(lights.iter().zip(weights)) {
                if let Some(sum) = next.checked_sub(1).and_then(|column| row.get_mut(column)) {
                    sum.light += *light;
                    sum.weight += *weight;
                }
            }
        }
    }

    /// The filtered light of pixel `x` in the middle one of three rows.
    pub(super) fn pixel(rows: &[Self], x: usize) -> Vec4 {
        let (above, own, below) = (rows[0].sums[2][x], rows[1].sums[1][x], rows[2].sums[0][x]);
        let weight = above.weight + own.weight + below.weight;
        // Dividing by the sum of weights (Pharr, Jakob and Humphreys 2016, 'Physically Based
        // Rendering', section 7.8) keeps uniform light uniform, also at the border, where part of a
        // tent lies outside the picture.
        if weight > 0.0 { (above.light + own.light + below.light) / weight } else { Vec4::ZERO }
    }
}

/// Weights of a sample at `place` in its pixel, in the nine pixels around it, row by row.
pub(super) fn weights_around(place: [f32; 2]) -> [f32; NEAR] {
    let [across, down] = place.map(tent_weights);
    std::array::from_fn(|near| across[near % 3] * down[near / 3])
}

/// Weights of a sample at `at`, 0..1 across its pixel, in the previous pixel, its own and the next
/// one. The tent of a pixel is 1 at its centre and 0 at the centres of its neighbours, so the three
/// add up to 1.
fn tent_weights(at: f32) -> [f32; 3] {
    [(0.5 - at).max(0.0), 1.0 - (at - 0.5).abs(), (at - 0.5).max(0.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_in_a_pixels_middle_is_its_own_and_one_on_a_corner_is_shared_by_four() {
        let mut rows = [(); 3].map(|()| Splats::new(3));
        rows[1].add(1, [0.5, 0.5], Vec4::ONE);
        let weights = |rows: &[Splats; 3]| {
            rows[1].sums.each_ref().map(|row| row.iter().map(|sum| sum.weight).collect::<Vec<_>>())
        };
        assert_eq!(weights(&rows), [[0.0; 3], [0.0, 1.0, 0.0], [0.0; 3]]);
        rows[1] = Splats::new(3);
        rows[1].add(1, [0.0, 1.0], Vec4::ONE);
        assert_eq!(weights(&rows), [[0.0; 3], [0.25, 0.25, 0.0], [0.25, 0.25, 0.0]]);
    }

    #[test]
    fn even_light_stays_even_up_to_the_border() {
        let rows = [(); 3].map(|()| {
            let mut row = Splats::new(4);
            (0..4).for_each(|x| row.add(x, [0.3, 0.9], Vec4::splat(0.7)));
            row
        });
        for x in 0..4 {
            assert!((Splats::pixel(&rows, x).x - 0.7).abs() < 1e-6);
        }
    }

    #[test]
    fn the_row_above_gives_its_lower_part() {
        let mut rows = [(); 3].map(|()| Splats::new(1));
        rows[0].add(0, [0.5, 1.0], Vec4::X);
        rows[2].add(0, [0.5, 1.0], Vec4::Y);
        assert_eq!(Splats::pixel(&rows, 0), Vec4::X);
    }
}
