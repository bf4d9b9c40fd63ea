//! Spreading of yarns: how flat a yarn lies in the cloth at each data point.
//!
//! In: a fabric and its [`Pattern`]. Out: a [`Spread`], the ratio of the width of the yarn's
//! section to its height at each data point of the repeat. Areas stay. Filaments of a yarn
//! without twist lie beside each other where it floats free, and where another yarn presses on
//! it. They stay together where yarns lie side by side.
//!
//! Method, a heuristic: yarns are as flat as [`Yarn::most_flattening`] lets them be, but no flatter
//! than leaves room for the neighbours, which are as flat themselves. Two ellipses with axes in
//! the cloth's plane and across it, at distances x and z in units of touching, are free of each
//! other if x² / k + k z² >= 1. A yarn of ratio 1 becomes flatter until that no longer holds. So
//! neighbours in the cloth's plane, z = 0, share the space between them, and yarns on top of each
//! other, x = 0, do not hinder. The half-width changes by at most a quarter of the yarn's length.
//!
//! Cost: some 10 µs a data point. Not promised: that flattened yarns are free of each other where
//! they bend or cross obliquely. Yarns stay round in laid cloth, which gives their widths, and in
//! repeats over [`MAX_RELAXED_LAPS`] stitches.
//!
//! [`Yarn::most_flattening`]: crate::fabric::yarn::Yarn::most_flattening

use glam::DVec3;
use rayon::prelude::*;

use super::cell_list::CellList;
use super::clearance::SAME_STRAND_RADII;
use super::repeat::RepeatYarn;
use super::{MAX_RELAXED_LAPS, Pattern};
use crate::fabric::Fabric;
use crate::ids::index32;
use crate::number::narrow;
use crate::yarn::curve;

/// Places on each span that are compared.
const SAMPLES: usize = 4;
/// Change of a section's half-width for each mm of yarn. Filaments part slowly.
const SLOPE: f64 = 0.25;

/// Ratios of width to height of sections at the data points of a repeat.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread(Vec<f32>);

/// A place on a yarn of the repeat.
struct Sample {
    at: DVec3,
    radius: f64,
    /// Ratio that its yarn may have.
    most: f64,
    /// Index of its yarn, length from the yarn's start, and the length of its repeat, mm.
    yarn: usize,
    along: f64,
    period: f64,
}

impl Spread {
    /// That of a fabric's yarns, the thickest of which is drawn with `radius` mm.
    ///
    /// ```
    /// use warpknit_core::{fabric::Fabric, knit::{Pattern, spread::Spread}};
    /// let locknit = Fabric::named("locknit").unwrap();
    /// let spread = Spread::of(&locknit, &Pattern::new(&locknit), locknit.radius());
    /// assert!(spread.widest() > 2.0);
    /// ```
    #[must_use]
    pub fn of(fabric: &Fabric, pattern: &Pattern, radius: f64) -> Self {
        let repeat = &pattern.repeat;
        let stitches = pattern.size[0] * pattern.size[1] * fabric.yarn_systems();
        if fabric.is_laid() || stitches > MAX_RELAXED_LAPS {
            return Self(vec![1.0; repeat.points.len()]);
        }
        let radii: Vec<f64> =
            fabric.thickness().into_iter().map(|thickness| radius * thickness).collect();
        let most: Vec<f64> = fabric.yarns().map(|yarn| yarn.most_flattening()).collect();
        let mut samples = Vec::with_capacity(repeat.points.len() * SAMPLES);
        for (number, yarn) in repeat.yarns.iter().enumerate() {
            let first = samples.len();
            samples.extend(samples_of(pattern, (number, yarn), radii[yarn.bar], most[yarn.bar]));
            debug_assert_eq!(samples.len() - first, repeat.points_of(yarn).len() * SAMPLES);
        }
        let widest = most.iter().copied().fold(1.0, f64::max);
        let thickest = radii.iter().copied().fold(0.0, f64::max);
        let places: Vec<(DVec3, f64)> =
            samples.iter().map(|sample| (sample.at, sample.radius)).collect();
        // Two yarns as flat as can be side by side reach so far from each other.
        let gap = 2.0 * thickest * (widest.sqrt() - 1.0);
        let near = CellList::new(&places, pattern.repeat_size(), gap);
        let free: Vec<f64> = (0..samples.len())
            .into_par_iter()
            .map(|place| room(&samples, &near, place, pattern))
            .collect();
        let mut ratios = vec![1.0; repeat.points.len()];
        let mut first = 0;
        for yarn in &repeat.yarns {
            let points = repeat.points_of(yarn);
            let own = first..first + points.len() * SAMPLES;
            first = own.end;
            let widths = eased(&free[own.clone()], &samples[own]);
            // What any place up to the next data points has room for: between them it is between
            // their ratios.
            for (at, point) in points.clone().enumerate() {
                let around = (1..2 * SAMPLES).map(|step| {
                    let place = at * SAMPLES + step + widths.len() - SAMPLES;
                    widths[place % widths.len()]
                });
                ratios[point] = narrow(around.fold(f64::INFINITY, f64::min).powi(2));
            }
        }
        Self(ratios)
    }

    /// The ratio at a data point of the repeat, an origin of [`super::Knitted`].
    #[must_use]
    pub fn ratio(&self, origin: u32) -> f32 {
        self.0[origin as usize]
    }

    /// The largest ratio.
    #[must_use]
    pub fn widest(&self) -> f32 {
        self.0.iter().copied().fold(1.0, f32::max)
    }
}

/// Places on one repeat of a yarn, in order.
fn samples_of(
    pattern: &Pattern,
    (number, yarn): (usize, &RepeatYarn),
    radius: f64,
    most: f64,
) -> Vec<Sample> {
    let unrolled = pattern.repeat.unrolled(yarn);
    let (mut samples, mut along) = (Vec::new(), 0.0);
    for index in 1..unrolled.len() - 2 {
        let span = curve::span(&unrolled, index);
        let length = span.length();
        for step in 0..SAMPLES {
            let share = f64::from(index32(step)) / f64::from(index32(SAMPLES));
            let along = along + length * share;
            samples.push(Sample {
                at: span.at(share),
                radius,
                most,
                yarn: number,
                along,
                period: 0.0,
            });
        }
        along += length;
    }
    samples.iter_mut().for_each(|sample| sample.period = along);
    samples
}

/// The ratio that a place has room for.
fn room(samples: &[Sample], near: &CellList, place: usize, pattern: &Pattern) -> f64 {
    let here = &samples[place];
    let mut ratio = here.most;
    if ratio <= 1.0 {
        return 1.0;
    }
    let cell = pattern.repeat_size();
    near.near(place, |other, shift| {
        let there = &samples[other];
        // Copies of a yarn in cells along it are the same strand.
        let period = pattern.repeat.yarns[here.yarn].period;
        let [beside, cells] =
            if period.x > period.y { [shift.y, shift.x] } else { [shift.x, shift.y] };
        let is_beside = beside != 0.0;
        let along = there.along - here.along + cells * here.period;
        if here.yarn == there.yarn && !is_beside && along.abs() <= SAME_STRAND_RADII * here.radius {
            return;
        }
        let apart =
            (there.at - here.at + (shift * cell).extend(0.0)) / (here.radius + there.radius);
        ratio = ratio.min(flattest(apart.truncate().length_squared(), apart.z * apart.z));
    });
    ratio.max(1.0)
}

/// The largest ratio that two equal ellipses have room for that become flatter from circles on.
/// `beside` and `above` are the squares of their distances in the cloth's plane and across it, 1
/// where circles touch.
fn flattest(beside: f64, above: f64) -> f64 {
    // The ratios between the roots of above k² - k + beside = 0 have no room.
    let discriminant = 1.0 - 4.0 * beside * above;
    if discriminant <= 0.0 {
        return f64::INFINITY;
    }
    let root = discriminant.sqrt();
    // The smaller root, in a form that has no 0 / 0 for yarns side by side.
    let low = 2.0 * beside / (1.0 + root);
    let has_room = low < 1.0 && 2.0 * above >= 1.0 + root;
    // Yarns that press on each other make room as they become flatter.
    if has_room || (low < 1.0 && above > beside) { f64::INFINITY } else { low }
}

/// Half-widths over the radius, from the ratios that places along a closed yarn have room for, so
/// that they change slowly.
fn eased(ratios: &[f64], samples: &[Sample]) -> Vec<f64> {
    let count = ratios.len();
    let mut widths: Vec<f64> = ratios.iter().map(|ratio| ratio.sqrt()).collect();
    let step = |from: usize, to: usize| {
        let Sample { radius, period, .. } = samples[from];
        SLOPE * (samples[to].along - samples[from].along).rem_euclid(period) / radius
    };
    // Twice around, so that the narrowest place counts on both sides.
    for at in 0..2 * count {
        let (before, here) = (at % count, (at + 1) % count);
        widths[here] = widths[here].min(widths[before] + step(before, here));
    }
    for at in (0..2 * count).rev() {
        let (here, after) = (at % count, (at + 1) % count);
        widths[here] = widths[here].min(widths[after] + step(here, after));
    }
    widths
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::knit::PointKind;

    #[test]
    fn neighbours_share_the_space_and_crossing_yarns_spread() {
        assert!((flattest(2.25, 0.0) - 2.25).abs() < 1e-12, "half of the space for each");
        assert!((flattest(1.0, 0.0) - 1.0).abs() < 1e-12, "they touch side by side");
        assert_eq!(flattest(0.0, 1.0), f64::INFINITY, "they touch on top of each other");
        assert_eq!(flattest(0.02, 0.95), f64::INFINITY, "the one presses on the other");
        assert!(flattest(0.95, 0.02) <= 1.0);
        for (beside, above) in [(0.8, 0.3), (2.0, 0.05), (0.6, 0.42)] {
            let most = flattest(beside, above).min(20.0);
            for step in 0..100 {
                let ratio = 1.0 + (most - 1.0) * f64::from(step) / 100.0;
                assert!(beside / ratio + ratio * above >= 1.0 - 1e-9, "{beside} {above} {ratio}");
            }
        }
    }

    #[test]
    fn underlaps_of_filaments_spread_most_and_twisted_yarns_hardly() {
        let locknit = Fabric::named("locknit").unwrap();
        let pattern = Pattern::new(&locknit);
        let spread = Spread::of(&locknit, &pattern, locknit.radius());
        let mean = |kind: PointKind| {
            let points = (0..).zip(&pattern.repeat.tags).filter(|(_, tag)| tag.kind == kind);
            let ratios: Vec<f32> = points.map(|(origin, _)| spread.ratio(origin)).collect();
            ratios.iter().sum::<f32>() / ratios.len() as f32
        };
        let [underlaps, loops] = [PointKind::Underlap, PointKind::WarpLoop].map(mean);
        assert!(underlaps > 1.2 * loops && loops > 1.1, "{underlaps} {loops}");
        let jersey = Fabric::named("jersey").unwrap();
        let spread = Spread::of(&jersey, &Pattern::new(&jersey), jersey.radius());
        assert!(spread.widest() < 1.5);
    }
}
