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

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::cell_list::CellList;
use super::clearance::SAME_STRAND_RADII;
use super::{MAX_RELAXED_LAPS, Pattern};
use crate::fabric::Fabric;
use crate::fabric::yarn::Yarn;
use crate::ids::index32;
use crate::number::narrow;
use crate::yarn::curve;

/// Places on each span that are compared.
const PLACES: usize = 4;
/// Change of a section's half-width for each mm of yarn. Filaments part slowly.
const SLOPE: f64 = 0.25;

/// Ratios of width to height of sections at the data points of a repeat.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    ratios: Vec<f32>,
    widest: f32,
}

/// A yarn of the repeat as a body.
struct YarnBody {
    radius: f64,
    /// Ratio that it may have.
    most: f64,
    /// Length of its repeat, mm.
    length: f64,
    /// Whether it runs across the wales.
    runs_across: bool,
}

/// A place on a yarn of the repeat.
struct YarnPlace {
    at: DVec3,
    /// Index of its yarn, and the length from the yarn's start, mm.
    yarn: usize,
    along: f64,
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
            return Self { ratios: vec![1.0; repeat.points.len()], widest: 1.0 };
        }
        let (bodies, places) = bodies_and_places(fabric, pattern, radius);
        let free = rooms(&bodies, &places, pattern.repeat_size());
        let mut ratios = vec![1.0; repeat.points.len()];
        let mut first = 0;
        for (yarn, body) in repeat.yarns.iter().zip(&bodies) {
            let points = repeat.points_of(yarn);
            let own = first..first + points.len() * PLACES;
            first = own.end;
            let widths = eased(&free[own.clone()], &places[own], body);
            // What any place up to the next data points has room for: between them it is between
            // their ratios.
            for (at, point) in points.enumerate() {
                let around = (1..2 * PLACES).map(|step| {
                    let place = at * PLACES + step + widths.len() - PLACES;
                    widths[place % widths.len()]
                });
                ratios[point] = narrow(around.fold(f64::INFINITY, f64::min).powi(2));
            }
        }
        let widest = ratios.iter().copied().fold(1.0, f32::max);
        Self { ratios, widest }
    }

    /// The ratio at a data point of the repeat, an origin of [`super::Knitted`].
    #[must_use]
    pub fn ratio(&self, origin: u32) -> f32 {
        self.ratios[origin as usize]
    }

    /// The largest ratio.
    #[must_use]
    pub fn widest(&self) -> f32 {
        self.widest
    }
}

/// The yarns of the repeat, and places on one repeat of each, in order.
fn bodies_and_places(
    fabric: &Fabric,
    pattern: &Pattern,
    radius: f64,
) -> (Vec<YarnBody>, Vec<YarnPlace>) {
    let repeat = &pattern.repeat;
    let thickness = fabric.thickness();
    let most: Vec<f64> = fabric.yarns().map(Yarn::most_flattening).collect();
    let mut places = Vec::with_capacity(repeat.points.len() * PLACES);
    let bodies = repeat.yarns.iter().enumerate().map(|(number, yarn)| {
        let length = add_places(&repeat.unrolled(yarn), number, &mut places);
        YarnBody {
            radius: radius * thickness[yarn.bar],
            most: most[yarn.bar],
            length,
            runs_across: pattern.runs_across(yarn.bar),
        }
    });
    (bodies.collect(), places)
}

/// Adds the places on a yarn number `yarn`, whose points have one before and two after its repeat.
/// Returns the yarn's length, mm.
fn add_places(unrolled: &[DVec3], yarn: usize, places: &mut Vec<YarnPlace>) -> f64 {
    let mut before = 0.0;
    for index in 1..unrolled.len() - 2 {
        let span = curve::span(unrolled, index);
        let length = span.length();
        places.extend((0..PLACES).map(|step| {
            let share = f64::from(index32(step)) / f64::from(index32(PLACES));
            YarnPlace { at: span.at(share), yarn, along: before + length * share }
        }));
        before += length;
    }
    before
}

/// The ratio that each place has room for, in cloth that repeats after `cell`.
fn rooms(bodies: &[YarnBody], places: &[YarnPlace], cell: DVec2) -> Vec<f64> {
    let balls: Vec<_> = places.iter().map(|place| (place.at, bodies[place.yarn].radius)).collect();
    let widest = bodies.iter().map(|body| body.most).fold(1.0, f64::max);
    let thickest = bodies.iter().map(|body| body.radius).fold(0.0, f64::max);
    // Two yarns as flat as can be side by side reach so far from each other.
    let near = CellList::new(&balls, cell, 2.0 * thickest * (widest.sqrt() - 1.0));
    (0..places.len())
        .into_par_iter()
        .map(|place| room(bodies, places, &near, place, cell))
        .collect()
}

/// The ratio that one place has room for.
fn room(
    bodies: &[YarnBody],
    places: &[YarnPlace],
    near: &CellList,
    place: usize,
    cell: DVec2,
) -> f64 {
    let here = &places[place];
    let own = &bodies[here.yarn];
    let mut ratio = own.most;
    if ratio <= 1.0 {
        return 1.0;
    }
    near.near(place, |other, shift| {
        let there = &places[other];
        // Copies of a yarn in cells along it are the same strand.
        let (beside, cells) = if own.runs_across { (shift.y, shift.x) } else { shift.into() };
        let along = there.along - here.along + cells * own.length;
        if here.yarn == there.yarn && beside == 0.0 && along.abs() <= SAME_STRAND_RADII * own.radius
        {
            return;
        }
        let touching = own.radius + bodies[there.yarn].radius;
        let apart = (there.at - here.at + (shift * cell).extend(0.0)) / touching;
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
fn eased(ratios: &[f64], places: &[YarnPlace], body: &YarnBody) -> Vec<f64> {
    let count = ratios.len();
    let mut widths: Vec<f64> = ratios.iter().map(|ratio| ratio.sqrt()).collect();
    let step = |from: usize, to: usize| {
        let apart = (places[to].along - places[from].along).rem_euclid(body.length);
        SLOPE * apart / body.radius
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
