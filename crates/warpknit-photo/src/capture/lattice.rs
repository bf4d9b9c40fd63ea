//! Step 1, unit cell: the two vectors after which the cloth looks the same again.
//!
//! In: how light each pixel is, without slow shading. Out: a [`UnitCell`], or nothing. In two
//! stages, since intensity alone locks on to a half or a third of a weave's cell: the finest
//! lattice that the autocorrelation of the intensity has; then, of all lattices of index 1 to 8 in
//! it, the one that tells best which of its points correlate and which don't, once the structure
//! tensor (in which direction things run) has its say too. A point's height is compared with others
//! as far away, since stretched cloth loses its step with distance.
//!
//! Not promised: cells under four pixels or over a third of the picture.

use std::num::NonZeroUsize;

use glam::{DMat2, DVec2};
use rayon::prelude::*;

use super::correlogram::Correlogram;
use super::steps;
use crate::plane::{Plane, double, float, narrow};
#[cfg(test)]
use warpknit_core::ids::index32;

/// Two vectors of a repeat, pixels, y down; reduced: none is shorter with the other added or taken
/// off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// The one nearer to the picture's rows.
    pub a: DVec2,
    /// The other.
    pub b: DVec2,
}

impl Lattice {
    /// The reduced basis of the same lattice (Gauss, Lagrange), `a` the one nearer to the picture's
    /// rows, pointing right, `b` pointing down.
    #[must_use]
    pub fn reduced(a: DVec2, b: DVec2) -> Self {
        let (mut a, mut b) = (a, b);
        for _ in 0..64 {
            if a.length_squared() > b.length_squared() {
                std::mem::swap(&mut a, &mut b);
            }
            let times = (a.dot(b) / a.length_squared()).round();
            if times == 0.0 || !times.is_finite() {
                break;
            }
            b -= times * a;
        }
        if a.x.abs() * b.length() < b.x.abs() * a.length() {
            std::mem::swap(&mut a, &mut b);
        }
        if a.x < 0.0 {
            a = -a;
        }
        if a.perp_dot(b) < 0.0 {
            b = -b;
        }
        Self { a, b }
    }

    /// Counts of both vectors to pixels.
    #[must_use]
    pub fn matrix(&self) -> DMat2 {
        DMat2::from_cols(self.a, self.b)
    }

    /// Of one cell, square pixels.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.a.perp_dot(self.b).abs()
    }

    /// Length of the shorter vector.
    #[must_use]
    pub fn shorter(&self) -> f64 {
        self.a.length().min(self.b.length())
    }

    /// Length of the longer vector.
    #[must_use]
    pub fn longer(&self) -> f64 {
        self.a.length().max(self.b.length())
    }

    /// A way less the lattice's vector nearest to it: the way to the nearest copy.
    #[must_use]
    pub fn nearest(&self, way: DVec2) -> DVec2 {
        let count = self.matrix().inverse() * way;
        self.matrix() * (count - count.round())
    }

    /// The copy of a place that is in the cell at the origin.
    #[must_use]
    pub fn home(&self, place: DVec2) -> DVec2 {
        let count = self.matrix().inverse() * place;
        self.matrix() * (count - count.floor())
    }

    /// Its points within a radius, one of each pair of opposite ones, without the origin, as counts
    /// of both vectors.
    fn points(&self, radius: f64) -> Vec<[i32; 2]> {
        let [m, n] = [self.b, self.a]
            .map(|other| steps((radius * other.length() / self.area()).ceil().min(200.0)));
        let mut points = Vec::new();
        for j in 0..=n {
            for i in -m..=m {
                let forward = j > 0 || i > 0;
                if forward && self.at([i, j]).length() <= radius {
                    points.push([i, j]);
                }
            }
        }
        points
    }

    fn at(&self, [i, j]: [i32; 2]) -> DVec2 {
        self.a * f64::from(i) + self.b * f64::from(j)
    }
}

/// The repeat that was found in a picture.
#[derive(Clone, Copy, Debug)]
pub struct UnitCell {
    /// Its vectors.
    pub lattice: Lattice,
    /// How sure it is, 0..1; under [`CERTAIN`] there may be no repeat at all.
    pub confidence: f64,
}

/// The least confidence of a repeat that is believed.
pub const CERTAIN: f64 = 0.5;
/// How much better the lattice's points correlate than points anywhere: nothing, and enough.
const CONTRAST: [f64; 2] = [0.04, 0.18];
/// The same in deviations of points anywhere: weaves of two colours have 3.8 and more. Of 240
/// pictures that repeat nowhere none gets a confidence over .36 by all these rules.
const DEVIATIONS: [f64; 2] = [2.0, 5.5];
/// How much better they correlate, times the root of the copies in the picture: of few copies some
/// are alike by chance, as in an old wall. Of 100 walls the other rules let 12 pass, none of them
/// over 1.7; 100 drawn cloths have 2.9 and more, photos of cloth 4.
const CHANCE: [f64; 2] = [1.0, 3.0];
/// Copies of the cell along the picture's shorter side: too few, and enough.
const COPIES: [f64; 2] = [2.0, 4.0];

/// Finds the repeat of a picture without slow shading; nothing where nothing correlates.
pub(super) fn find(even: &Plane) -> Option<UnitCell> {
    let side = even.width.min(even.height);
    let intensity = Correlogram::of(even, None, side * 9 / 20).smoothed(0.7);
    let base = base(&intensity)?;
    let both = intensity.mean_with(&orientation(even, base.shorter(), intensity.reach));
    let lattice = fitted(&both, coarser(&both, &base));
    let confidence = confidence(&both, &lattice, [even.width, even.height].map(double));
    Some(UnitCell { lattice, confidence })
}

/// Share of the mean power that is added where directions are told by their clarity.
const FLOOR: f32 = 0.3;

/// Correlation of the structure tensor: its two components that say in which direction things run,
/// and how clearly. How strongly doesn't count: edges of holes, which are the strongest and repeat
/// after each crossing, would drown the yarns.
fn orientation(even: &Plane, scale: f64, reach: usize) -> Correlogram {
    let [gx, gy] = even.smoothed(narrow((0.05 * scale).clamp(0.6, 3.0))).gradient();
    let sigma = narrow((0.12 * scale).clamp(0.7, 8.0));
    let power = gx.zip(&gy, |x, y| x * x + y * y).smoothed(sigma);
    let floor = FLOOR * power.values.iter().sum::<f32>() / float(power.values.len());
    let clearly = |component: Plane| {
        component.smoothed(sigma).zip(&power, |value, power| value / (power + floor))
    };
    let (along, across) = (gx.zip(&gy, |x, y| x * x - y * y), gx.zip(&gy, |x, y| 2.0 * x * y));
    Correlogram::of(&clearly(along), Some(&clearly(across)), reach)
}

/// Peaks that may span the lattice.
const NEAREST: usize = 28;
/// How high a peak is, as a share of the highest, that counts.
const COUNTS: f32 = 0.3;
/// Places halfway between points that correlate so well, as a share of the points, lie on a ridge.
const RIDGE: f64 = 0.9;
/// The finest lattice is taken whose points correlate as well as this share of the best one's.
const FINEST: f64 = 0.6;

/// The finest lattice that the intensity has.
fn base(intensity: &Correlogram) -> Option<Lattice> {
    let peaks = intensity.peaks(2.5);
    let highest = peaks.first()?.1;
    let mut near: Vec<_> = peaks.into_iter().filter(|peak| peak.1 >= COUNTS * highest).collect();
    near.sort_by(|p, q| p.0.length().total_cmp(&q.0.length()));
    near.truncate(NEAREST);
    let pairs: Vec<_> =
        (0..near.len()).flat_map(|i| (i + 1..near.len()).map(move |j| (i, j))).collect();
    let scored: Vec<(Lattice, f64)> = pairs
        .into_par_iter()
        .filter_map(|(i, j)| {
            let (p, q) = (near[i].0, near[j].0);
            let lattice = Lattice::reduced(p, q);
            // Flat cells are no cells.
            if lattice.area() < 0.3 * lattice.shorter() * lattice.longer()
                || lattice.shorter() < 4.0
                || lattice.longer() > 6.0 * lattice.shorter()
            {
                return None;
            }
            let radius = 4.0 * lattice.longer();
            let score = score(intensity, &lattice, radius)?;
            // Along a ridge, as legs and floats make them, any step would do.
            let halves = [0.5 * lattice.a, 0.5 * lattice.b, 0.5 * (lattice.a + lattice.b)];
            let is_ridge = |half: DVec2| {
                mean_at(intensity, &lattice, radius, half)
                    .is_some_and(|between| between > RIDGE * score)
            };
            if halves.into_iter().any(is_ridge) {
                return None;
            }
            Some((lattice, score))
        })
        .collect();
    let best = scored.iter().map(|(_, score)| *score).fold(f64::NEG_INFINITY, f64::max);
    let good = scored.into_iter().filter(|(_, score)| *score >= FINEST * best && best > 0.0);
    // Of lattices that are the same but for a pixel, the better one.
    let rank = |lattice: &Lattice, score: f64| lattice.area() * (1.3 - 0.3 * score / best);
    let (lattice, _) = good.min_by(|(p, s), (q, t)| rank(p, *s).total_cmp(&rank(q, *t)))?;
    Some(fitted(intensity, lattice))
}

/// Mean correlation at a lattice's points; none if too few are in reach.
fn score(correlogram: &Correlogram, lattice: &Lattice, radius: f64) -> Option<f64> {
    mean_at(correlogram, lattice, radius, DVec2::ZERO)
}

/// The same at places that are off its points.
fn mean_at(correlogram: &Correlogram, lattice: &Lattice, radius: f64, off: DVec2) -> Option<f64> {
    let tolerance = (0.1 * lattice.shorter()).max(0.71);
    let values: Vec<_> = lattice
        .points(radius)
        .into_iter()
        .map(|point| lattice.at(point) + off)
        .filter(|&lag| correlogram.holds(lag, tolerance))
        .map(|lag| f64::from(correlogram.highest_near(lag, tolerance)))
        .collect();
    (values.len() >= 4).then(|| values.iter().sum::<f64>() / double(values.len()))
}

/// The lattice of index 1 to 8 in `base` that tells best which of its points correlate well and
/// which don't, where one does.
fn coarser(correlogram: &Correlogram, base: &Lattice) -> Lattice {
    let radius = (5.0 * base.longer()).min(0.9 * double(correlogram.reach));
    let tolerance = (0.1 * base.shorter()).max(0.71);
    let points: Vec<([i32; 2], f64, f64)> = base
        .points(radius)
        .into_iter()
        .filter(|&point| correlogram.holds(base.at(point), tolerance))
        .map(|point| {
            let lag = base.at(point);
            (
                point,
                lag.length() / base.longer(),
                f64::from(correlogram.highest_near(lag, tolerance)),
            )
        })
        .collect();
    let alike = Split::of(&points, |_| true);
    let mut best = (alike.rest, *base);
    for index in 2..=8 {
        for [p, q, r] in hermite(index) {
            let lattice = Lattice::reduced(
                base.a * f64::from(p) + base.b * f64::from(q),
                base.b * f64::from(r),
            );
            if lattice.longer() > 8.5 * lattice.shorter() {
                continue;
            }
            let inverse = DMat2::from_cols(
                DVec2::new(f64::from(p), f64::from(q)),
                DVec2::new(0.0, f64::from(r)),
            )
            .inverse();
            let is_on = |[i, j]: [i32; 2]| {
                let place = inverse * DVec2::new(f64::from(i), f64::from(j));
                (place - place.round()).abs().max_element() < 1e-6
            };
            let split = Split::of(&points, is_on);
            if split.count >= 3
                && split.on > ABOVE * split.off.max(0.0) + 0.03
                && split.rest < best.0
            {
                best = (split.rest, lattice);
            }
        }
    }
    if best.0 < EXPLAINS * alike.rest { best.1 } else { *base }
}

/// How much better the points of a coarser lattice correlate than the others, at least.
const ABOVE: f64 = 1.1;
/// What a coarser lattice leaves of the differences between points, at most.
const EXPLAINS: f64 = 0.75;

/// Points in two groups, each with a correlation that dies away with the distance. Near ones tell
/// more: how far others have lost their step differs by direction.
struct Split {
    on: f64,
    off: f64,
    /// How many are on.
    count: usize,
    /// Weighted squares that are left.
    rest: f64,
}

impl Split {
    fn of(points: &[([i32; 2], f64, f64)], is_on: impl Fn([i32; 2]) -> bool) -> Self {
        let member: Vec<bool> = points.iter().map(|point| is_on(point.0)).collect();
        let count = member.iter().filter(|on| **on).count();
        let weight = |distance: f64| 1.0 / (1.0 + distance * distance);
        let of = |reach: f64| {
            let fade = |distance: f64| (-0.5 * (distance / reach).powi(2)).exp();
            let level = |which: bool| {
                let (mut product, mut square) = (0.0, 1e-12);
                for ((_, distance, height), _) in
                    points.iter().zip(&member).filter(|(_, on)| **on == which)
                {
                    product += weight(*distance) * fade(*distance) * height;
                    square += weight(*distance) * fade(*distance).powi(2);
                }
                product / square
            };
            let (on, off) = (level(true), level(false));
            let error = |((_, distance, height), is_on): (&([i32; 2], f64, f64), &bool)| {
                weight(*distance)
                    * (height - fade(*distance) * if *is_on { on } else { off }).powi(2)
            };
            Self { on, off, count, rest: points.iter().zip(&member).map(error).sum() }
        };
        [1.5, 2.2, 3.3, 5.0, 10.0, 100.0]
            .into_iter()
            .map(of)
            .min_by(|p, q| p.rest.total_cmp(&q.rest))
            .expect("there are some")
    }
}

/// All lattices of an index in another: their Hermite normal forms.
pub(super) fn hermite(index: i32) -> impl Iterator<Item = [i32; 3]> {
    (1..=index)
        .filter(move |p| index % p == 0)
        .flat_map(move |p| (0..index / p).map(move |q| [p, q, index / p]))
}

/// The lattice through the peaks near its points, by least squares, from near ones to far ones.
fn fitted(correlogram: &Correlogram, mut lattice: Lattice) -> Lattice {
    for radius in [1.6, 2.6, 4.5, 6.5] {
        let tolerance = (0.12 * lattice.shorter()).max(0.71);
        let mut normal = DMat2::ZERO;
        let mut right = [DVec2::ZERO; 2];
        for point in lattice.points(radius * lattice.longer()) {
            let lag = lattice.at(point);
            if !correlogram.holds(lag, tolerance) {
                continue;
            }
            let (summit, value) = correlogram.summit_near(lag, tolerance);
            let weight = f64::from(value.max(0.0)).powi(2);
            let count = DVec2::new(f64::from(point[0]), f64::from(point[1]));
            normal += DMat2::from_cols(count * count.x, count * count.y) * weight;
            right[0] += count * (weight * summit.x);
            right[1] += count * (weight * summit.y);
        }
        if normal.determinant().abs() < 1e-9 {
            break;
        }
        let inverse = normal.inverse();
        let (x, y) = (inverse * right[0], inverse * right[1]);
        lattice = Lattice { a: DVec2::new(x.x, y.x), b: DVec2::new(x.y, y.y) };
    }
    Lattice::reduced(lattice.a, lattice.b)
}

/// How sure a lattice is: its points correlate better than those of the same lattice turned this
/// way and that, and there are some copies of the cell, the more the less they correlate.
fn confidence(correlogram: &Correlogram, lattice: &Lattice, [width, height]: [f64; 2]) -> f64 {
    let radius = 3.2 * lattice.longer();
    let turned: Vec<f64> = (1..40)
        .filter_map(|turn| {
            // The golden angle comes back to no direction.
            let turn =
                DVec2::from_angle(f64::from(turn) * 2.399_963) * (0.8 + 0.01 * f64::from(turn));
            score(
                correlogram,
                &Lattice { a: turn.rotate(lattice.a), b: turn.rotate(lattice.b) },
                radius,
            )
        })
        .collect();
    let (Some(on), Some(count)) =
        (score(correlogram, lattice, radius), NonZeroUsize::new(turned.len()))
    else {
        return 0.0;
    };
    let count = double(count.get());
    let mean = turned.iter().sum::<f64>() / count;
    let deviation = (turned.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt();
    let between = |value: f64, [nothing, enough]: [f64; 2]| {
        ((value - nothing) / (enough - nothing)).clamp(0.0, 1.0)
    };
    let better = on - mean;
    let chance = between(better * (width * height / lattice.area()).sqrt(), CHANCE);
    let contrast = between(better, CONTRAST).min(chance);
    contrast
        .min(between(better / deviation.max(1e-9), DEVIATIONS))
        .min(between(width.min(height) / lattice.longer(), COPIES))
}

#[cfg(test)]
mod tests {
    use super::super::plane::without_shading;
    use super::*;

    #[test]
    fn any_basis_of_a_lattice_reduces_to_the_same() {
        let (a, b) = (DVec2::new(10.0, 1.0), DVec2::new(-2.0, 12.0));
        let expected = Lattice::reduced(a, b);
        assert_eq!((expected.a, expected.b), (a, b));
        for [p, q, r, s] in [[1, 0, 3, 1], [2, 1, 1, 1], [0, 1, -1, 0], [5, 2, 2, 1]] {
            let [p, q, r, s] = [p, q, r, s].map(f64::from);
            let other = Lattice::reduced(a * p + b * q, a * r + b * s);
            assert!(other.a.distance(a) < 1e-9 && other.b.distance(b) < 1e-9, "{other:?}");
        }
    }

    #[test]
    fn super_lattices_are_counted_as_the_sum_of_divisors() {
        let counts: Vec<_> = (1..=8).map(|index| hermite(index).count()).collect();
        assert_eq!(counts, [1, 3, 4, 7, 6, 12, 8, 15]);
    }

    #[test]
    fn a_chequered_wave_has_the_cell_that_its_directions_have() {
        // Bumps on a square lattice of 12 pixels, ridged in turn along x and along y: the intensity
        // repeats after one bump, the cloth after two.
        let bump = |x: f64, y: f64| {
            let (i, j) = ((x / 12.0).round(), (y / 12.0).round());
            let (u, v) = (x - 12.0 * i, y - 12.0 * j);
            let along_x = (i + j).rem_euclid(2.0) < 0.5;
            let (u, v) = if along_x { (u, v) } else { (v, u) };
            narrow(0.5 + 0.4 * (-(u * u / 60.0) - v * v / 18.0).exp())
        };
        let found =
            find(&without_shading(&Plane::from_fn(240, 220, |x, y| bump(double(x), double(y)))))
                .unwrap();
        assert!(
            (found.lattice.area() / 288.0 - 1.0).abs() < 0.02 && found.confidence > CERTAIN,
            "{found:?}"
        );
    }

    #[test]
    fn deep_holes_do_not_drown_a_weave() {
        // A plain weave of flat yarns, each lighter along its middle by a little, with black holes
        // after each crossing.
        let light = |x: f64, y: f64| {
            let (i, j) = ((x / 12.0).round(), (y / 12.0).round());
            let (u, v) = (x - 12.0 * i, y - 12.0 * j);
            let is_hole = u.abs() > 4.5 && v.abs() > 4.5;
            let warp_is_up =
                if u.abs() > 4.5 { false } else { v.abs() > 4.5 || (i + j).rem_euclid(2.0) < 0.5 };
            let off = if warp_is_up { u } else { v };
            if is_hole { 0.0 } else { narrow(0.7 - 0.006 * off * off) }
        };
        let found = find(&without_shading(
            &Plane::from_fn(240, 220, |x, y| light(double(x), double(y))).smoothed(0.7),
        ))
        .unwrap();
        assert!(
            (found.lattice.area() / 288.0 - 1.0).abs() < 0.02 && found.confidence > CERTAIN,
            "{found:?}"
        );
    }

    #[test]
    fn noise_has_no_repeat() {
        let noise = Plane::from_fn(200, 200, |x, y| {
            narrow(
                f64::from(warpknit_render::ply::hash(index32(200 * y + x))) / f64::from(u32::MAX),
            )
        });
        assert!(
            find(&without_shading(&noise.smoothed(1.5))).is_none_or(|found| found.confidence < 0.2)
        );
        assert!(find(&without_shading(&Plane::from_fn(64, 64, |_, _| 0.5))).is_none());
    }
}
