//! Step 3, binarise: separates yarn and ground by one threshold.
//!
//! In: a grey plane, 0..=255, and the side of the threshold on which the ground lies. Out: the mask
//! of the yarn: set where the grey is at least the threshold, or below it before a light ground.
//!
//! Method: Otsu 1979, "A threshold selection method from gray-level histograms". The threshold
//! maximises the variance between the two classes, which minimises the variance within them. The
//! ground is the class to which most of the photo's border belongs. Cost: one pass for the
//! histogram.

use super::mask::Mask;
use crate::plane::{Plane, byte, float, percentile};

/// A threshold and the two classes of greys that it makes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Split {
    /// Greys from here on are in the upper class.
    pub(super) threshold: f32,
    /// Median of the lower class, then of the upper one.
    pub(super) medians: [f32; 2],
    /// Spread of each class around its median. For normal noise it equals the standard deviation.
    pub(super) spreads: [f32; 2],
}

/// Otsu's threshold of greys from 0 to 255 (Otsu 1979): the maximum of ω₀ ω₁ (μ₁ - μ₀)², the
/// variance between the classes.
pub(super) fn otsu(grey: &Plane) -> f32 {
    let mut counts = [0_u32; 256];
    grey.values.iter().for_each(|&value| counts[usize::from(byte(value))] += 1);
    let levels =
        || (0_u8..=255).zip(counts).map(|(level, count)| (f64::from(level), f64::from(count)));
    let (all, total) =
        levels().fold((0.0, 0.0), |(n, sum), (level, count)| (n + count, sum + level * count));
    // Counts and sums of the greys below `level` are updated from bin to bin, so that each
    // candidate threshold costs a few operations.
    let (mut below, mut sum) = (0.0, 0.0);
    // The largest variance between classes, and the first and last threshold that reach it.
    let mut best = (0.0, 0.0, 0.0);
    for (level, count) in levels() {
        if below > 0.0 && below < all {
            let apart = sum / below - (total - sum) / (all - below);
            let between = below * (all - below) * apart * apart;
            // Every threshold within an empty stretch of the histogram gives the same classes. The
            // middle of the stretch is as far from both as possible. The tolerance is for rounding.
            if between > best.0 * (1.0 + 1e-12) {
                best = (between, level, level);
            } else if between >= best.0 * (1.0 - 1e-12) {
                best.2 = level;
            }
        }
        below += count;
        sum += level * count;
    }
    #[expect(clippy::cast_possible_truncation, reason = "a mean of two bytes")]
    let threshold = (0.5 * (best.1 + best.2)) as f32;
    threshold
}

impl Split {
    /// The classes of a plane's greys.
    pub(super) fn at(threshold: f32, grey: &Plane) -> Self {
        let class = |upper: bool| {
            let mut values: Vec<f32> =
                grey.sampled().filter(|&value| (value >= threshold) == upper).collect();
            let median = percentile(&mut values, 0.5);
            values.iter_mut().for_each(|value| *value = (*value - median).abs());
            // 1.48 times the median absolute deviation estimates the standard deviation of normal
            // noise, and outliers such as fibres do not move it.
            (median, 1.48 * percentile(&mut values, 0.5))
        };
        let (lower, upper) = (class(false), class(true));
        Self { threshold, medians: [lower.0, upper.0], spreads: [lower.1, upper.1] }
    }

    /// Distance between the classes' medians.
    pub(super) fn contrast(&self) -> f32 {
        self.medians[1] - self.medians[0]
    }

    /// Median and spread of the ground's class.
    pub(super) fn ground(&self, is_light: bool) -> (f32, f32) {
        let class = usize::from(is_light);
        (self.medians[class], self.spreads[class])
    }
}

/// Whether most of these pixels are in the upper class.
pub(super) fn is_light(grey: &Plane, border: &[usize], threshold: f32) -> bool {
    let light = border.iter().filter(|&&at| grey.values[at] >= threshold).count();
    float(light) > 0.5 * float(border.len())
}

/// The yarn's pixels.
pub(super) fn binarise(grey: &Plane, threshold: f32, light_ground: bool) -> Mask {
    Mask::from_plane(grey, |value| (value >= threshold) != light_ground)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn otsu_splits_between_two_heaps_and_the_border_says_which_is_ground() {
        let grey =
            Plane::from_fn(
                40,
                20,
                |x, y| if (6..14).contains(&y) { 200.0 } else { 30.0 + float(x % 5) },
            );
        let threshold = otsu(&grey);
        assert!((34.0..200.0).contains(&threshold), "{threshold}");
        let border = super::super::ground::border(&grey);
        assert!(!is_light(&grey, &border, threshold));
        assert!((binarise(&grey, threshold, false).share() - 0.4).abs() < 1e-6);
        assert!((binarise(&grey, threshold, true).share() - 0.6).abs() < 1e-6);
        let split = Split::at(threshold, &grey);
        assert_eq!((split.medians, split.ground(true)), ([32.0, 200.0], (200.0, 0.0)));
    }
}
