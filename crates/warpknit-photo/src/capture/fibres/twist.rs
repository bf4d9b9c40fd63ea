//! One twist that explains the fibres of a yarn.
//!
//! In: the sticks of traced fibres on a yarn seen from above, relative to its middle. Out: a
//! [`Twist`]. A fibre on a straight cylinder of radius R that leans by φ against the axis is seen,
//! v off the axis, with the slope tan φ √(1 - (v/R)²): the most in the middle, none at the sides. A
//! yarn that goes up and down through a cloth is stretched where its back bends, and is seen
//! shortened where it dives: both change slopes by half and more, in a tight weave. So its axis is
//! taken for a wave, of which a segment shows half and a little more, and how high the wave is
//! comes from the fibres too: they are the straighter in a segment's middle and the steeper at its
//! ends, the higher it is. φ by least squares of the angles (Gauss-Newton), sticks far from it
//! counting less each time (Tukey's weights).
//!
//! Not promised: the twist of yarns that aren't round or whose waves are sharper than a sine
//! (fibres of a sharp one seem twisted by a fifth more), and of those whose fibres shifted along
//! each other when they were bent.

use std::f64::consts::PI;

use glam::DVec2;

use super::sticks::Stick;
use crate::plane::double;
use warpknit_core::yarn::fibres::MIDDLING_SLOPE;

/// Rounds of the fit.
const ROUNDS: usize = 20;
/// Deviations from which on a stick counts nothing (Tukey), and the least deviation, radians.
const COUNTS: f64 = 4.685;
const LEAST: f64 = 0.02;
/// Errors from which on a stick says little of the wave, radians.
const FAR: f64 = 0.08;
/// How much longer than half its wave a yarn is seen, in widths: what lies over it is narrower at
/// its sides' height than in its middle.
const BEYOND: f64 = 0.16;
/// Waves that are tried, each so many radii higher than the last.
const WAVES: u8 = 14;
const HIGHER: f64 = 0.1;
/// An interval of a segment's half, halved so often, is far under a pixel.
const HALVINGS: usize = 14;
/// The most that a round changes a slope: where fibres are steep it leaps otherwise.
const STRIDE: f64 = 0.1;
/// A median deviation is so much of a bell's standard one.
const MEDIAN: f64 = 0.6745;
/// Degrees by which fibres may differ from one twist, and how many there are at least.
const SPREAD: f64 = 15.0;
const FIBRES: usize = 12;

/// How the fibres of a yarn are wound around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist {
    /// The angle of the outermost fibres to the yarn's axis. S over 0, Z under 0, as of
    /// [`crate::scene::YarnLook::twist_slope`], whose arctangent it is.
    pub degrees: f64,
    /// How wide a fibre is, pixels of the photo; the most that it can be where the yarn is too
    /// narrow to look, 0 where none is seen.
    pub fibre_px: f64,
    /// Whether too little is seen: then the twist is a middling one, which says nothing of this
    /// yarn.
    pub is_guess: bool,
    /// Fibres that were traced, of all copies.
    pub fibres: usize,
    /// Standard deviation of their sticks' angles from what the twist has there, degrees.
    pub spread: f64,
}

/// Degrees where no twist is seen.
fn middling() -> f64 {
    f64::from(MIDDLING_SLOPE).atan().to_degrees()
}

impl Twist {
    /// Pixels below which fibres are told from nothing.
    pub const LEAST_PX: f64 = 3.0;
    /// A fibre's width as a share of the spacing at which fibres are seen: they don't lie side by
    /// side, and lower ones show between them.
    const WIDTH: f64 = 0.65;

    pub(in crate::capture) fn guess(spacing: f64) -> Self {
        Self {
            degrees: middling(),
            fibre_px: Self::WIDTH * spacing,
            is_guess: true,
            fibres: 0,
            spread: 0.0,
        }
    }

    /// Of fibres that are `spacing` pixels apart on a segment; `size` is along and across it.
    pub(super) fn of(fibres: &[Vec<Stick>], spacing: f64, size: DVec2) -> Self {
        let sticks = fibres.concat();
        let Some(Fit { slope, deviation: spread, .. }) = fitted(&sticks, size) else {
            return Self::guess(spacing);
        };
        // Leaning fibres are cut across at an angle, and pictures have y down, where towards the
        // right is Z.
        let (fibre_px, degrees, spread) = (
            Self::WIDTH * spacing * slope.atan().cos(),
            -slope.atan().to_degrees(),
            spread.to_degrees(),
        );
        let is_guess = fibre_px < Self::LEAST_PX || fibres.len() < FIBRES || spread > SPREAD;
        let degrees = if is_guess { middling() } else { degrees };
        Self { degrees, fibre_px, is_guess, fibres: fibres.len(), spread }
    }
}

/// How fibres lie on a segment.
#[derive(Clone, Copy)]
struct Fit {
    /// Of the outermost ones, were the yarn straight.
    slope: f64,
    /// Deviation of the sticks from it, radians.
    deviation: f64,
    /// The sticks' errors, those far off counting little.
    loss: f64,
}

/// The wave that explains the sticks best, and their slope on it.
fn fitted(sticks: &[Stick], size: DVec2) -> Option<Fit> {
    let fits = (0..=WAVES).map(|height| on_wave(sticks, size, f64::from(height) * HIGHER));
    let fits: Vec<Fit> = fits.collect::<Option<_>>()?;
    let best = (0..fits.len()).min_by(|&p, &q| fits[p].loss.total_cmp(&fits[q].loss))?;
    let [Some(before), Some(after)] = [best.checked_sub(1), Some(best + 1)].map(|at| fits.get(at?))
    else {
        return Some(fits[best]);
    };
    // The lowest point of a parabola through three losses.
    let off = 0.5 * (before.loss - after.loss)
        / (before.loss - 2.0 * fits[best].loss + after.loss).max(f64::MIN_POSITIVE);
    on_wave(sticks, size, (double(best) + off.clamp(-0.5, 0.5)) * HIGHER)
        .filter(|fit| fit.loss <= fits[best].loss)
        .or(Some(fits[best]))
}

/// The slope that explains the sticks best if the axis is a wave so many radii high.
fn on_wave(sticks: &[Stick], size: DVec2, height: f64) -> Option<Fit> {
    let seen: Vec<(f64, Lean)> = sticks
        .iter()
        .map(|stick| ((stick.way.y / stick.way.x).atan(), Lean::at(stick.middle, size, height)))
        .collect();
    let mut slope = median(
        seen.iter().map(|(angle, lean)| (angle / lean.share.max(LEAST)).clamp(-1.0, 1.0)).collect(),
    )?;
    let off = |(angle, lean): &(f64, Lean), slope: f64| angle - lean.seen(slope).0.atan();
    let mut deviation = 0.0;
    for _ in 0..ROUNDS {
        deviation = median(seen.iter().map(|stick| off(stick, slope).abs()).collect())? / MEDIAN;
        let (mut normal, mut right) = (0.0, 0.0);
        for stick in &seen {
            let far = off(stick, slope) / (COUNTS * deviation.max(LEAST));
            let weight = (1.0 - far * far).max(0.0).powi(2);
            let (as_seen, change) = stick.1.seen(slope);
            let change = change / (1.0 + as_seen * as_seen);
            normal += weight * change * change;
            right += weight * change * off(stick, slope);
        }
        if normal <= 0.0 {
            return None;
        }
        slope += (right / normal).clamp(-STRIDE, STRIDE);
    }
    let loss = seen.iter().map(|stick| (1.0 + (off(stick, slope) / FAR).powi(2)).ln()).sum();
    Some(Fit { slope, deviation, loss })
}

/// How slopes are seen at a place of a yarn.
#[derive(Clone, Copy)]
struct Lean {
    /// What is seen of a small slope.
    share: f64,
    /// How fast a fibre that comes down a side of a diving yarn moves along it, a slope of it: it
    /// is seen steeper, and on the other side less steep.
    drift: f64,
}

impl Lean {
    /// At a place of a yarn whose axis is a wave so many radii high.
    fn at(place: DVec2, size: DVec2, height: f64) -> Self {
        let radius = 0.5 * size.y;
        let sine = (place.y / radius).clamp(-1.0, 1.0);
        let cosine = (1.0 - sine * sine).sqrt();
        let wave = PI / (size.x - BEYOND * size.y);
        let steep = height * radius * wave;
        // At a place of the axis: how much longer than its shadow it is, where the back over it is
        // seen, and how fast that moves.
        let dive = |x: f64| (1.0 + (steep * (wave * x).sin()).powi(2)).sqrt();
        let back = |x: f64| x + radius * cosine * steep * (wave * x).sin() / dive(x);
        let speed =
            |x: f64| 1.0 + radius * cosine * steep * wave * (wave * x).cos() / dive(x).powi(3);
        // The back runs ahead of the axis: halving an interval that holds the place.
        let (mut low, mut high) = (0.0, place.x.abs().min(0.5 * size.x));
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if back(middle) < place.x.abs() { low = middle } else { high = middle }
        }
        let speed_there = speed(low).max(LEAST);
        Self {
            share: cosine * dive(low) / speed_there,
            drift: sine * steep * (wave * low).sin() * place.x.signum() / speed_there,
        }
    }

    /// The slope that is seen of one, and how fast it changes with that.
    fn seen(&self, slope: f64) -> (f64, f64) {
        let onward = (1.0 - slope * self.drift).max(0.2);
        (slope * self.share / onward, self.share / (onward * onward))
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
        Stick { middle: DVec2::new(along, across), way: DVec2::from_angle(angle) }
    }

    const SIZE: DVec2 = DVec2::new(60.0, 40.0);

    /// Fibres wound around an axis that is a wave so many radii high, and others that lie anyhow.
    /// Points of a helix are drawn, and sticks lie between points.
    fn helix(degrees: f64, height: f64, wrong: u8) -> Vec<Vec<Stick>> {
        let turns = -degrees.to_radians().tan() / 20.0;
        let fibre = |number: u8| -> Vec<Stick> {
            let (mut arc, mut points) = (0.0, Vec::new());
            for step in -300..=300 {
                let (x, wave) = (0.1 * f64::from(step), PI / (SIZE.x - BEYOND * SIZE.y));
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
                stick.middle.x.abs() < 25.0 && stick.middle.y.abs() < 16.0 && stick.way.x > 0.5
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
                let twist = Twist::of(&helix(degrees, height, wrong), 8.0, SIZE);
                assert!(
                    !twist.is_guess && (twist.degrees - degrees).abs() < 1.0,
                    "{degrees}, {height} high, {wrong} wrong: {twist:?}"
                );
                assert_eq!(twist.fibres, 40 + usize::from(wrong));
            }
        }
        assert!(Twist::of(&helix(0.0, 0.5, 0), 8.0, SIZE).degrees.abs() < 1e-6);
    }

    #[test]
    fn what_says_too_little_is_a_guess() {
        let helix = helix(15.0, 0.0, 0);
        let scattered: Vec<_> =
            (0..60).map(|n| vec![stick(0.0, 0.0, 0.05 * f64::from(n) - 1.5)]).collect();
        for (fibres, spacing) in
            [(&helix[..], 4.0), (&helix[..8], 8.0), (&scattered[..], 8.0), (&[], 8.0)]
        {
            let twist = Twist::of(fibres, spacing, SIZE);
            assert!(twist.is_guess && twist.degrees == middling(), "{twist:?}");
        }
    }
}
