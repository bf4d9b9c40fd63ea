//! One twist that explains the fibres of a yarn.
//!
//! In: the sticks of traced fibres on a yarn seen from above, relative to its middle. Out: a
//! [`Twist`].
//!
//! Method: a fibre on a straight cylinder of radius R that runs at the angle φ to the axis has, at
//! the distance v from the axis, the projected slope tan φ √(1 - (v/R)²): largest in the middle, 0
//! at the sides. A yarn that goes up and down through a cloth shows its back stretched on crests
//! and foreshortened where it dives. Both change slopes by half and more in a tight weave. So the
//! axis is modelled as a sine wave, of which a segment shows half and a little more. The height of
//! the wave is fitted too: the higher it is, the straighter are the fibres in a segment's middle
//! and the steeper at its ends. φ comes from robust least squares of the angles: Gauss-Newton steps
//! with Tukey's biweight (Beaton and Tukey 1974), which is iteratively reweighted least squares.
//!
//! Cost: sticks times heights times iterations. Not promised: yarns that aren't round, waves
//! sharper than a sine (their fibres seem twisted by a fifth more), and fibres that shifted along
//! each other when the yarn was bent.

use std::f64::consts::PI;

use glam::DVec2;

use super::sticks::Stick;
use crate::plane::double;
use warpknit_core::yarn::fibres::MIDDLING_SLOPE;

/// Gauss-Newton iterations of the fit; it converges in fewer.
const ITERATIONS: usize = 20;
/// Tukey's constant: a stick that is off by this many standard deviations counts nothing. 4.685 has
/// 95 % of the efficiency of least squares for normal errors.
const TUKEY: f64 = 4.685;
/// The least standard deviation, radians, and the least divisor of slopes. At 0, a perfect fit
/// would divide by 0.
const MIN_DEVIATION: f64 = 0.02;
/// Scale of the Cauchy loss by which heights of the wave are compared, radians: an error beyond it
/// counts ever less.
const LOSS_SCALE: f64 = 0.08;
/// How much longer than half its wave a yarn is visible, in widths: the yarn over it is narrower at
/// the height of its sides than in its middle.
const VISIBLE_EXCESS: f64 = 0.16;
/// Heights of the wave that are tried, and the step between them in radii of the yarn. The highest
/// is 1.4 radii; yarns of a plain weave reach about one.
const HEIGHTS: u8 = 14;
const HEIGHT_STEP: f64 = 0.1;
/// Bisections of half a segment; 14 of them are far below a pixel.
const BISECTIONS: usize = 14;
/// The largest change of the slope in one iteration. Where fibres are steep, the model is far from
/// linear and full steps would overshoot.
const MAX_STEP: f64 = 0.1;
/// The median absolute deviation of a normal distribution, in standard deviations.
const NORMAL_MEDIAN: f64 = 0.6745;
/// The largest standard deviation of the fibres' angles, degrees, of a twist that is no guess.
const MAX_SPREAD: f64 = 15.0;
/// The least number of fibres of a twist that is no guess.
const MIN_FIBRES: usize = 12;

/// How the fibres of a yarn are wound around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist {
    /// The angle of the outermost fibres to the yarn's axis. S is positive and Z negative, as for
    /// [`warpknit_render::scene::YarnLook::twist_slope`], whose arctangent it is.
    pub degrees: f64,
    /// Width of a fibre, pixels of the photo: an upper bound where the yarn is too narrow to
    /// measure it, 0 where no fibre is visible.
    pub fibre_px: f64,
    /// Whether too little is visible. Then the twist is that of an average yarn, and was not
    /// measured.
    pub is_guess: bool,
    /// Number of traced fibres, of all copies.
    pub fibres: usize,
    /// Standard deviation of the sticks' angles from those of the fitted twist, degrees.
    pub spread: f64,
}

/// The twist of an average yarn, degrees.
fn average_twist() -> f64 {
    f64::from(MIDDLING_SLOPE).atan().to_degrees()
}

impl Twist {
    /// Width of a fibre, pixels, below which fibres can't be told from noise.
    pub const LEAST_PX: f64 = 3.0;
    /// A fibre's width as a share of the visible spacing: fibres don't lie side by side, and lower
    /// ones show between them.
    const WIDTH: f64 = 0.65;

    pub(in crate::capture) fn guess(spacing: f64) -> Self {
        Self {
            degrees: average_twist(),
            fibre_px: Self::WIDTH * spacing,
            is_guess: true,
            fibres: 0,
            spread: 0.0,
        }
    }

    /// The twist of fibres that are `spacing` pixels apart on a segment; `size` is along and across
    /// it.
    pub(super) fn from_fibres(fibres: &[Vec<Stick>], spacing: f64, size: DVec2) -> Self {
        let sticks = fibres.concat();
        let Some(TwistFit { slope, deviation, .. }) = fitted(&sticks, size) else {
            return Self::guess(spacing);
        };
        // Slanted fibres are measured across the yarn, at an angle to their own width. Pictures
        // have y down, where a slope to the right is Z.
        let fibre_px = Self::WIDTH * spacing * slope.atan().cos();
        let degrees = -slope.atan().to_degrees();
        let spread = deviation.to_degrees();
        let is_guess =
            fibre_px < Self::LEAST_PX || fibres.len() < MIN_FIBRES || spread > MAX_SPREAD;
        let degrees = if is_guess { average_twist() } else { degrees };
        Self { degrees, fibre_px, is_guess, fibres: fibres.len(), spread }
    }
}

/// A fit of the fibres of a segment.
#[derive(Clone, Copy)]
struct TwistFit {
    /// Slope of the outermost fibres if the yarn were straight.
    slope: f64,
    /// Standard deviation of the sticks from it, radians.
    deviation: f64,
    /// Cauchy loss of the sticks' errors.
    loss: f64,
}

/// The height of the wave that explains the sticks best, and the slope on it.
fn fitted(sticks: &[Stick], size: DVec2) -> Option<TwistFit> {
    // A grid search: the loss may have several minima over the height.
    let fits = (0..=HEIGHTS).map(|n| fitted_on_wave(sticks, size, f64::from(n) * HEIGHT_STEP));
    let fits: Vec<TwistFit> = fits.collect::<Option<_>>()?;
    let best = (0..fits.len()).min_by(|&p, &q| fits[p].loss.total_cmp(&fits[q].loss))?;
    let [Some(before), Some(after)] = [best.checked_sub(1), Some(best + 1)].map(|at| fits.get(at?))
    else {
        return Some(fits[best]);
    };
    // Then the minimum of the parabola through three losses, if it is better indeed.
    let offset = 0.5 * (before.loss - after.loss)
        / (before.loss - 2.0 * fits[best].loss + after.loss).max(f64::MIN_POSITIVE);
    fitted_on_wave(sticks, size, (double(best) + offset.clamp(-0.5, 0.5)) * HEIGHT_STEP)
        .filter(|fit| fit.loss <= fits[best].loss)
        .or(Some(fits[best]))
}

/// A stick's angle, and how slopes are projected there.
struct Observation {
    angle: f64,
    projection: FibreProjection,
}

impl Observation {
    /// The error of a slope, radians.
    fn error(&self, slope: f64) -> f64 {
        self.angle - self.projection.projected(slope).0.atan()
    }
}

/// The slope that explains the sticks best if the axis is a wave `height` radii high.
fn fitted_on_wave(sticks: &[Stick], size: DVec2, height: f64) -> Option<TwistFit> {
    let observations: Vec<Observation> = sticks
        .iter()
        .map(|stick| Observation {
            angle: (stick.direction.y / stick.direction.x).atan(),
            projection: FibreProjection::at(stick.middle, size, height),
        })
        .collect();
    // The median as a start: Tukey's biweight has local minima, and must begin among the bulk.
    let mut slope = median(
        observations
            .iter()
            .map(|o| (o.angle / o.projection.share.max(MIN_DEVIATION)).clamp(-1.0, 1.0))
            .collect(),
    )?;
    let mut deviation = 0.0;
    for _ in 0..ITERATIONS {
        // Median absolute deviation: outliers don't widen it.
        deviation =
            median(observations.iter().map(|o| o.error(slope).abs()).collect())? / NORMAL_MEDIAN;
        let (mut normal, mut right) = (0.0, 0.0);
        for observation in &observations {
            let far = observation.error(slope) / (TUKEY * deviation.max(MIN_DEVIATION));
            let weight = (1.0 - far * far).max(0.0).powi(2);
            let (projected, derivative) = observation.projection.projected(slope);
            // The chain rule: errors are angles, the arctangent of the projected slope.
            let derivative = derivative / (1.0 + projected * projected);
            normal += weight * derivative * derivative;
            right += weight * derivative * observation.error(slope);
        }
        if normal <= 0.0 {
            return None;
        }
        slope += (right / normal).clamp(-MAX_STEP, MAX_STEP);
    }
    let loss =
        observations.iter().map(|o| (1.0 + (o.error(slope) / LOSS_SCALE).powi(2)).ln()).sum();
    Some(TwistFit { slope, deviation, loss })
}

/// The projection of slopes at a place of a yarn.
#[derive(Clone, Copy)]
struct FibreProjection {
    /// Projected slope for a small slope of 1.
    share: f64,
    /// How fast a fibre that comes down a side of a diving yarn moves along it, for a slope of 1:
    /// it looks steeper there, and less steep on the other side.
    drift: f64,
}

impl FibreProjection {
    /// The projection at a place of a yarn whose axis is a wave `height` radii high.
    fn at(place: DVec2, size: DVec2, height: f64) -> Self {
        let radius = 0.5 * size.y;
        let sine = (place.y / radius).clamp(-1.0, 1.0);
        let cosine = (1.0 - sine * sine).sqrt();
        let frequency = PI / (size.x - VISIBLE_EXCESS * size.y);
        let wave = WaveBack { radius, cosine, frequency, steepest: height * radius * frequency };
        // Which place of the axis lies under the visible one? The back runs ahead of the axis
        // monotonically, so that bisection finds it.
        let (mut low, mut high) = (0.0, place.x.abs().min(0.5 * size.x));
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if wave.back(middle) < place.x.abs() { low = middle } else { high = middle }
        }
        let speed = wave.speed(low).max(MIN_DEVIATION);
        Self {
            share: cosine * wave.stretch(low) / speed,
            drift: sine * wave.steepest * (frequency * low).sin() * place.x.signum() / speed,
        }
    }

    /// The projection of a slope, and its derivative by the slope.
    fn projected(&self, slope: f64) -> (f64, f64) {
        // At 0 a fibre would be seen end on; the bound keeps the step of Gauss-Newton finite.
        let onward = (1.0 - slope * self.drift).max(0.2);
        (slope * self.share / onward, self.share / (onward * onward))
    }
}

/// A line on the back of a yarn whose axis is a cosine wave, seen from above.
struct WaveBack {
    radius: f64,
    /// Height of the line over the axis, in radii.
    cosine: f64,
    /// Radians a pixel.
    frequency: f64,
    /// The steepest slope of the axis.
    steepest: f64,
}

impl WaveBack {
    /// Length of the axis over the length of its projection.
    fn stretch(&self, x: f64) -> f64 {
        (1.0 + (self.steepest * (self.frequency * x).sin()).powi(2)).sqrt()
    }

    /// Where the line is seen over a place of the axis: the normal of a diving axis leans ahead.
    fn back(&self, x: f64) -> f64 {
        x + self.radius * self.cosine * self.steepest * (self.frequency * x).sin() / self.stretch(x)
    }

    /// The derivative of [`WaveBack::back`].
    fn speed(&self, x: f64) -> f64 {
        1.0 + self.radius
            * self.cosine
            * self.steepest
            * self.frequency
            * (self.frequency * x).cos()
            / self.stretch(x).powi(3)
    }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stick(along: f64, across: f64, angle: f64) -> Stick {
        Stick { middle: DVec2::new(along, across), direction: DVec2::from_angle(angle) }
    }

    const SIZE: DVec2 = DVec2::new(60.0, 40.0);

    /// Fibres wound around an axis that is a wave so many radii high, and others that lie anyhow.
    /// Points of a helix are drawn, and sticks lie between points.
    fn helix(degrees: f64, height: f64, wrong: u8) -> Vec<Vec<Stick>> {
        let turns = -degrees.to_radians().tan() / 20.0;
        let fibre = |number: u8| -> Vec<Stick> {
            let (mut arc, mut points) = (0.0, Vec::new());
            for step in -300..=300 {
                let (x, wave) = (0.1 * f64::from(step), PI / (SIZE.x - VISIBLE_EXCESS * SIZE.y));
                let dive = -height * 20.0 * wave * (wave * x).sin();
                arc += 0.1 * dive.hypot(1.0);
                let (sin, cos) = (turns * arc - 1.5 + 0.075 * f64::from(number)).sin_cos();
                points.push(DVec2::new(x - 20.0 * cos * dive / dive.hypot(1.0), 20.0 * sin));
            }
            let at = |n: usize| {
                stick(points[n].x, points[n].y, (points[n + 1] - points[n - 1]).to_angle())
            };
            // Sides that dive turn away before they end.
            let is_seen = |stick: &Stick| {
                stick.middle.x.abs() < 25.0
                    && stick.middle.y.abs() < 16.0
                    && stick.direction.x > 0.5
            };
            (1..600).step_by(40).map(at).filter(is_seen).collect()
        };
        let anyhow = |number: u8| vec![stick(0.0, 0.0, -1.3 + 0.1 * f64::from(number))];
        (0..40).map(fibre).chain((0..wrong).map(anyhow)).collect()
    }

    #[test]
    fn a_helix_has_its_twist_however_its_yarn_bends() {
        for degrees in [-35.0, -8.0, 15.0, 28.0] {
            for (height, wrong) in [(0.0, 0), (0.0, 12), (0.5, 0), (0.95, 12)] {
                let twist = Twist::from_fibres(&helix(degrees, height, wrong), 8.0, SIZE);
                assert!(
                    !twist.is_guess && (twist.degrees - degrees).abs() < 1.0,
                    "{degrees}, {height} high, {wrong} wrong: {twist:?}"
                );
                assert_eq!(twist.fibres, 40 + usize::from(wrong));
            }
        }
        assert!(Twist::from_fibres(&helix(0.0, 0.5, 0), 8.0, SIZE).degrees.abs() < 1e-6);
    }

    #[test]
    fn too_few_or_thin_or_scattered_fibres_are_a_guess() {
        let helix = helix(15.0, 0.0, 0);
        let scattered: Vec<_> =
            (0..60).map(|n| vec![stick(0.0, 0.0, 0.05 * f64::from(n) - 1.5)]).collect();
        for (fibres, spacing) in
            [(&helix[..], 4.0), (&helix[..8], 8.0), (&scattered[..], 8.0), (&[], 8.0)]
        {
            let twist = Twist::from_fibres(fibres, spacing, SIZE);
            assert!(twist.is_guess && twist.degrees == average_twist(), "{twist:?}");
        }
    }
}
