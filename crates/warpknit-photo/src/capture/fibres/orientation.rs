//! Where fibres run, and how far apart they lie.
//!
//! In: copies of a segment in their own frames. Out: the spacing of fibres across the yarn, of all
//! copies together; and the [`Orientation`] of one. A structure tensor (Bigün and Granlund 1987) of
//! the copy less its blur: a blur wider than a fibre leaves the fibres, and takes off what remains
//! of the cylinder's shading. The strongest of some Gabor filters, as in the paper, errs by 8 to 17
//! degrees here, this by one or two.
//!
//! Not promised: two directions at one place, of which the stronger or their mean is told.

use glam::DVec2;

use crate::plane::{Plane, double, narrow, whole};

/// Deviation of the blur that is taken off before fibres are measured, as a share of the yarn's
/// width, and after, in widths of a fibre.
const COARSE: f64 = 0.1;
const BLUR: f32 = 0.8;
/// Deviations before slopes are taken, and of the tensor's blur, in widths of a fibre.
const BEFORE: f32 = 0.15;
const AFTER: f32 = 0.8;
/// The least coherence of a place where fibres are believed: 0 no direction, 1 nothing but one.
const CLEAR: f32 = 0.3;
/// The share of a yarn's width in its middle where fibres are as far apart as they seem.
const MIDDLE: f64 = 0.5;
/// Fibres correlate less at half their spacing than what doesn't repeat, by so much of their power.
const DIP: f64 = 0.04;

/// Where fibres run in one copy: the doubled angle's cosine and sine, as long as the coherence.
pub(super) struct Orientation {
    along: Plane,
    across: Plane,
}

impl Orientation {
    /// Of fibres that are so many pixels apart.
    pub(super) fn of(detail: &Plane, fibre: f32) -> Self {
        let sharp = detail.zip(&detail.smoothed(BLUR * fibre), |value, mean| value - mean);
        let [gx, gy] = sharp.smoothed((BEFORE * fibre).max(0.6)).gradient();
        let sigma = AFTER * fibre;
        let all = gx.zip(&gy, |x, y| x * x + y * y).smoothed(sigma);
        // Fibres run across the slope, which is a half turn of the doubled angle.
        let share = |part: Plane| {
            part.smoothed(sigma).zip(&all, |part, all| part / all.max(f32::MIN_POSITIVE))
        };
        Self {
            along: share(gx.zip(&gy, |x, y| y * y - x * x)),
            across: share(gx.zip(&gy, |x, y| -2.0 * x * y)),
        }
    }

    /// Whether things run one way at a place.
    pub(super) fn is_clear(&self, x: usize, y: usize) -> bool {
        self.along.at(x, y).hypot(self.across.at(x, y)) >= CLEAR
    }

    /// The direction at a place, of unit length, onwards along the yarn.
    pub(super) fn way(&self, x: usize, y: usize) -> DVec2 {
        DVec2::from_angle(f64::from(0.5 * self.across.at(x, y).atan2(self.along.at(x, y))))
    }
}

/// How far apart fibres lie across a yarn `width` pixels wide: twice the lag at which they
/// correlate least. Nothing where nothing repeats.
pub(super) fn spacing(details: &[Plane], width: f64) -> Option<f64> {
    let first = details.first()?;
    let reach = whole(narrow(0.5 * width * MIDDLE)).min(first.height / 3);
    let (top, bottom) = (
        whole(narrow(0.5 * (1.0 - MIDDLE) * width)),
        whole(narrow(0.5 * (1.0 + MIDDLE) * width)).min(first.height),
    );
    let mut sums = vec![0.0_f64; reach + 1];
    for detail in details {
        let sharp =
            detail.zip(&detail.smoothed(narrow(COARSE * width)), |value, mean| value - mean);
        for (lag, sum) in sums.iter_mut().enumerate() {
            let rows = (top + lag..bottom).map(|y| {
                let products = sharp.row(y).iter().zip(sharp.row(y - lag)).map(|(a, b)| a * b);
                f64::from(products.sum::<f32>())
            });
            *sum += rows.sum::<f64>() / double((bottom - top).saturating_sub(lag).max(1));
        }
    }
    let at = (1..reach).find(|&lag| sums[lag] < sums[lag - 1] && sums[lag] <= sums[lag + 1])?;
    if sums[at] > -DIP * sums[0] {
        return None;
    }
    let (before, here, after) = (sums[at - 1], sums[at], sums[at + 1]);
    let bend = (before - 2.0 * here + after).max(f64::MIN_POSITIVE);
    Some(2.0 * (double(at) + (0.5 * (before - after) / bend).clamp(-0.5, 0.5)))
}

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;

    use super::*;
    use crate::plane::float;

    fn stripes(degrees: f32, fibre: f32) -> Plane {
        let (sin, cos) = degrees.to_radians().sin_cos();
        Plane::from_fn(81, 61, |x, y| (TAU / fibre * (float(y) * cos - float(x) * sin)).cos())
    }

    #[test]
    fn stripes_run_as_they_were_drawn() {
        for (degrees, fibre) in [(0.0, 6.0), (12.0, 4.0), (-25.0, 5.0), (35.0, 8.0), (-60.0, 6.0)] {
            let orientation = Orientation::of(&stripes(degrees, fibre), fibre);
            for (x, y) in [(40, 30), (30, 22), (52, 37)] {
                let found = orientation.way(x, y).to_angle().to_degrees();
                assert!(
                    orientation.is_clear(x, y) && (found - f64::from(degrees)).abs() < 1.0,
                    "{degrees}: {found}"
                );
            }
        }
    }

    #[test]
    fn stripes_are_as_far_apart_as_they_were_drawn() {
        for fibre in [4.0, 5.5, 8.0] {
            let found = spacing(&[stripes(0.0, fibre)], 60.0).unwrap();
            assert!((found / f64::from(fibre) - 1.0).abs() < 0.08, "{fibre}: {found}");
        }
        assert_eq!(spacing(&[Plane::from_fn(81, 61, |x, _| float(x))], 60.0), None);
        assert_eq!(spacing(&[], 60.0), None);
    }
}
