//! The orientation of fibres and the spacing between them.
//!
//! In: copies of a segment in their own frames. Out: the spacing of fibres across the yarn, from
//! all copies together, and the [`Orientation`] of one copy.
//!
//! Method: a structure tensor (Bigün and Granlund 1987, *Optimal orientation detection of linear
//! symmetry*) of the copy less its blur. A blur wider than a fibre leaves the fibres and takes off
//! the rest of the cylinder's shading. The strongest of several Gabor filters, as in Wu et al.,
//! errs by 8 to 17 degrees here; the tensor errs by 1 or 2.
//!
//! Not promised: two directions at one place. The stronger one or a mean of both comes out.

use glam::DVec2;

use crate::plane::{Plane, double, narrow, whole};

/// Standard deviation of the blur that is taken off before the spacing is measured, as a share of
/// the yarn's width.
const COARSE_BLUR: f64 = 0.1;
/// The same once the spacing is known, in spacings of fibres.
const FINE_BLUR: f32 = 0.8;
/// Standard deviation of the blur before derivatives are taken, in spacings. Wider ones erase the
/// fibres; without it the derivative is that of the pixels' noise.
const DERIVATIVE_SCALE: f32 = 0.15;
/// Standard deviation of the tensor's window, in spacings. Narrower windows see a single edge of a
/// fibre; wider ones mix directions along the helix.
const WINDOW: f32 = 0.8;
/// The least coherence of a place with visible fibres: 0 has no direction, 1 has only one.
const MIN_COHERENCE: f32 = 0.3;
/// The share of a yarn's width, in its middle, where the spacing of fibres is hardly foreshortened.
const MIDDLE: f64 = 0.5;
/// How far the autocorrelation at half the spacing must lie below 0, as a share of the power.
/// Noise, which doesn't repeat, stays nearer to 0.
const MIN_DIP: f64 = 0.04;

/// Where fibres run in one copy, in the double-angle representation: a vector at twice the angle
/// whose length is the coherence.
pub(super) struct Orientation {
    cosine: Plane,
    sine: Plane,
}

impl Orientation {
    /// The orientation of fibres with this spacing, in pixels.
    pub(super) fn new(detail: &Plane, spacing: f32) -> Self {
        let sharp = detail.zip(&detail.smoothed(FINE_BLUR * spacing), |value, mean| value - mean);
        let [gx, gy] = sharp.smoothed((DERIVATIVE_SCALE * spacing).max(0.6)).gradient();
        let sigma = WINDOW * spacing;
        let trace = gx.zip(&gy, |x, y| x * x + y * y).smoothed(sigma);
        // The gradient is across the fibre: a right angle, which is a half turn of the doubled
        // angle. Hence the signs.
        let [cosine, sine] = [gx.zip(&gy, |x, y| y * y - x * x), gx.zip(&gy, |x, y| -2.0 * x * y)]
            .map(|component| {
                component
                    .smoothed(sigma)
                    .zip(&trace, |component, trace| component / trace.max(f32::MIN_POSITIVE))
            });
        Self { cosine, sine }
    }

    /// Whether one direction prevails at a place.
    pub(super) fn is_clear(&self, x: usize, y: usize) -> bool {
        self.cosine.at(x, y).hypot(self.sine.at(x, y)) >= MIN_COHERENCE
    }

    /// The unit direction at a place, onwards along the yarn.
    pub(super) fn direction(&self, x: usize, y: usize) -> DVec2 {
        DVec2::from_angle(f64::from(0.5 * self.sine.at(x, y).atan2(self.cosine.at(x, y))))
    }
}

/// The spacing of fibres across a yarn `width` pixels wide: twice the lag of the first minimum of
/// the autocorrelation across it. `None` where nothing repeats.
pub(super) fn spacing(details: &[Plane], width: f64) -> Option<f64> {
    let first = details.first()?;
    let reach = whole(narrow(0.5 * width * MIDDLE)).min(first.height / 3);
    let (top, bottom) = (
        whole(narrow(0.5 * (1.0 - MIDDLE) * width)),
        whole(narrow(0.5 * (1.0 + MIDDLE) * width)).min(first.height),
    );
    let mut sums = vec![0.0_f64; reach + 1];
    for detail in details {
        let blurred = detail.smoothed(narrow(COARSE_BLUR * width));
        let sharp = detail.zip(&blurred, |value, mean| value - mean);
        for (lag, sum) in sums.iter_mut().enumerate() {
            let rows = (top + lag..bottom).map(|y| {
                let products = sharp.row(y).iter().zip(sharp.row(y - lag)).map(|(a, b)| a * b);
                f64::from(products.sum::<f32>())
            });
            *sum += rows.sum::<f64>() / double((bottom - top).saturating_sub(lag).max(1));
        }
    }
    // The minimum at half the spacing and not the maximum at the whole one: fibres are irregular,
    // and their autocorrelation has faded at the maximum.
    let at = (1..reach).find(|&lag| sums[lag] < sums[lag - 1] && sums[lag] <= sums[lag + 1])?;
    if sums[at] > -MIN_DIP * sums[0] {
        return None;
    }
    // To a fraction of a pixel, by a parabola.
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
            let orientation = Orientation::new(&stripes(degrees, fibre), fibre);
            for (x, y) in [(40, 30), (30, 22), (52, 37)] {
                let found = orientation.direction(x, y).to_angle().to_degrees();
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
