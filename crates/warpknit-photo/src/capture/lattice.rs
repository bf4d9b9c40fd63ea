//! Step 1, unit cell: the two vectors that the cloth repeats after.
//!
//! In: the lightness of each pixel, without slow shading. Out: a [`UnitCell`], or nothing.
//!
//! Method: peaks of the autocorrelation, in two stages. Intensity alone locks on to a half or a
//! third of a weave's cell, because each crossing looks like the next one. So the first stage finds
//! the finest lattice that the autocorrelation of the intensity has. The second stage adds the
//! autocorrelation of the structure tensor (Bigün and Granlund 1987, *Optimal orientation detection
//! of linear symmetry*), and takes the superlattice of index 1 to 8 that separates best the points
//! that correlate from those that don't. A point is compared with others at the same distance,
//! because stretched cloth decorrelates with distance.
//!
//! Cost: two autocorrelations. Not promised: cells under four pixels or over a third of the
//! picture.

use std::num::NonZeroUsize;

use glam::{DMat2, DVec2};
use rayon::prelude::*;

use super::correlogram::Correlogram;
use super::steps;
use crate::plane::{Plane, double, float, narrow};
#[cfg(test)]
use warpknit_core::ids::index32;

/// Two vectors that a pattern repeats after, pixels, y down. The basis is reduced: neither vector
/// is shorter with the other one added or taken off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// The vector nearer to the picture's rows.
    pub a: DVec2,
    /// The other vector.
    pub b: DVec2,
}

impl Lattice {
    /// The reduced basis of the same lattice, by the algorithm of Lagrange and Gauss. `a` is the
    /// vector nearer to the picture's rows and points right; `b` points down.
    #[must_use]
    pub fn reduced(a: DVec2, b: DVec2) -> Self {
        let (mut a, mut b) = (a, b);
        // Euclid's algorithm on vectors. A few rounds suffice; the bound is for vectors that are
        // parallel or not finite.
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

    /// Cell coordinates (counts of both vectors) to pixels.
    #[must_use]
    pub fn matrix(&self) -> DMat2 {
        DMat2::from_cols(self.a, self.b)
    }

    /// The same in pixels of another size.
    pub(super) fn scaled(&self, scale: f64) -> Self {
        Self { a: self.a * scale, b: self.b * scale }
    }

    /// Area of one cell, square pixels.
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

    /// The offset to the nearest copy: an offset less the lattice vector nearest to it.
    #[must_use]
    pub fn nearest(&self, offset: DVec2) -> DVec2 {
        let count = self.matrix().inverse() * offset;
        self.matrix() * (count - count.round())
    }

    /// The copy of a place that lies in the cell at the origin.
    #[must_use]
    pub fn wrap_to_cell(&self, place: DVec2) -> DVec2 {
        let count = self.matrix().inverse() * place;
        self.matrix() * (count - count.floor())
    }

    /// Its points within a radius as counts of both vectors: one of each pair of opposite points,
    /// and without the origin.
    fn points(&self, radius: f64) -> Vec<[i32; 2]> {
        // The circle's extent in cell coordinates. The bound is for cells as flat as a line.
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
    /// Confidence, 0..1. Under [`CERTAIN`] there may be no repeat at all.
    pub confidence: f64,
}

/// The least confidence of a repeat.
pub const CERTAIN: f64 = 0.5;
/// How much better the lattice's points correlate than points anywhere: where the confidence is 0,
/// and where it is 1.
const CONTRAST: [f64; 2] = [0.04, 0.18];
/// The same in standard deviations of points anywhere. Weaves of two colours have 3.8 and more. Of
/// 240 pictures that repeat nowhere none gets a confidence over 0.36 by all these rules.
const DEVIATIONS: [f64; 2] = [2.0, 5.5];
/// How much better they correlate, times the square root of the number of copies in the picture. Of
/// few copies some are alike by chance, as in an old wall. The other rules let 12 of 100 walls
/// pass, and none of these is over 1.7; 100 drawn cloths have 2.9 and more, photos of cloth 4.
const CHANCE: [f64; 2] = [1.0, 3.0];
/// Copies of the cell along the picture's shorter side: too few, and enough.
const COPIES: [f64; 2] = [2.0, 4.0];

/// Finds the repeat of a picture without slow shading; `None` where nothing correlates.
pub(super) fn find(even: &Plane) -> Option<UnitCell> {
    let side = even.width.min(even.height);
    // Lags up to 0.45 of the side: farther ones have too few pairs of pixels to average noise out.
    let intensity = Correlogram::new(even, None, side * 9 / 20).smoothed(0.7);
    let finest = finest_lattice(&intensity)?;
    let both = intensity.mean_with(&orientation(even, finest.shorter(), intensity.reach));
    let lattice = refined(&both, best_superlattice(&both, &finest));
    let confidence = confidence(&both, &lattice, [even.width, even.height].map(double));
    Some(UnitCell { lattice, confidence })
}

/// Share of the mean power that is added where the tensor is normalised. At 0, flat areas would
/// show directions of noise; at 1 and more, the strength of edges would count again.
const POWER_FLOOR: f32 = 0.3;

/// Autocorrelation of the structure tensor's two components of orientation, normalised by its
/// trace. They tell the direction of edges and how clear it is, but not how strong the edges are.
/// Edges of holes are the strongest and repeat after each crossing; they would drown the yarns.
fn orientation(even: &Plane, scale: f64, reach: usize) -> Correlogram {
    // Scales follow the finest lattice: a derivative finer than a yarn, a window of about a yarn.
    let [gx, gy] = even.smoothed(narrow((0.05 * scale).clamp(0.6, 3.0))).gradient();
    let sigma = narrow((0.12 * scale).clamp(0.7, 8.0));
    let power = gx.zip(&gy, |x, y| x * x + y * y).smoothed(sigma);
    let floor = POWER_FLOOR * power.values.iter().sum::<f32>() / float(power.values.len());
    // The double-angle representation: opposite directions are the same orientation.
    let components = [gx.zip(&gy, |x, y| x * x - y * y), gx.zip(&gy, |x, y| 2.0 * x * y)];
    let [real, imaginary] = components.map(|component| {
        component.smoothed(sigma).zip(&power, |value, power| value / (power + floor))
    });
    Correlogram::new(&real, Some(&imaginary), reach)
}

/// Peaks whose pairs may span the lattice: the nearest ones. All pairs of them are scored.
const MAX_PEAKS: usize = 28;
/// The least height of such a peak, as a share of the highest.
const MIN_PEAK: f32 = 0.3;
/// The least lag of a peak, pixels: below, a picture's blur correlates with itself.
const MIN_LAG: f64 = 2.5;
/// Points lie on a ridge if places halfway between them correlate by more than this share of them.
const RIDGE: f64 = 0.9;
/// The finest lattice is taken whose points correlate by this share of the best lattice's. Nearer
/// to 1, noise would choose a multiple of it; much lower, a half of it would pass.
const FINEST: f64 = 0.6;

/// The finest lattice of the intensity's autocorrelation.
fn finest_lattice(intensity: &Correlogram) -> Option<Lattice> {
    let peaks = intensity.peaks(MIN_LAG);
    let highest = peaks.first()?.1;
    let mut near: Vec<_> = peaks.into_iter().filter(|peak| peak.1 >= MIN_PEAK * highest).collect();
    near.sort_by(|p, q| p.0.length().total_cmp(&q.0.length()));
    near.truncate(MAX_PEAKS);
    let pairs: Vec<_> =
        (0..near.len()).flat_map(|i| (i + 1..near.len()).map(move |j| (i, j))).collect();
    let scored: Vec<(Lattice, f64)> = pairs
        .into_par_iter()
        .filter_map(|(i, j)| {
            let lattice = Lattice::reduced(near[i].0, near[j].0);
            Some((lattice, scored_candidate(intensity, &lattice)?))
        })
        .collect();
    let best = scored.iter().map(|(_, score)| *score).fold(f64::NEG_INFINITY, f64::max);
    // Pairs of noisy peaks span nearly the same lattice many times. The area chooses among
    // different lattices, and the score among those that differ by a pixel.
    let (lattice, _) = scored
        .into_iter()
        .filter(|(_, score)| *score >= FINEST * best && best > 0.0)
        .min_by(|p, q| rank(p, best).total_cmp(&rank(q, best)))?;
    Some(refined(intensity, lattice))
}

/// The order of candidates for the finest lattice: the area, and up to 30 % of it for a low score.
fn rank((lattice, score): &(Lattice, f64), best: f64) -> f64 {
    lattice.area() * (1.3 - 0.3 * score / best)
}

/// The mean correlation at the points of a candidate lattice, if it may be a cell's.
fn scored_candidate(intensity: &Correlogram, lattice: &Lattice) -> Option<f64> {
    // Vectors that are nearly parallel, very short or of very different lengths span no cell of a
    // cloth. Pairs of peaks on one line would.
    if lattice.area() < 0.3 * lattice.shorter() * lattice.longer()
        || lattice.shorter() < 4.0
        || lattice.longer() > 6.0 * lattice.shorter()
    {
        return None;
    }
    let radius = 4.0 * lattice.longer();
    let score = mean_correlation(intensity, lattice, radius)?;
    // Along a ridge, as legs and floats make them, points correlate at any spacing. Then the places
    // halfway between correlate too, and the spacing means nothing.
    let halves = [0.5 * lattice.a, 0.5 * lattice.b, 0.5 * (lattice.a + lattice.b)];
    let is_on_ridge = halves.into_iter().any(|half| {
        mean_correlation_at(intensity, lattice, radius, half)
            .is_some_and(|between| between > RIDGE * score)
    });
    (!is_on_ridge).then_some(score)
}

/// Mean correlation at a lattice's points within a radius; `None` if too few are in reach.
fn mean_correlation(correlogram: &Correlogram, lattice: &Lattice, radius: f64) -> Option<f64> {
    mean_correlation_at(correlogram, lattice, radius, DVec2::ZERO)
}

/// The same at places that are off its points.
fn mean_correlation_at(
    correlogram: &Correlogram,
    lattice: &Lattice,
    radius: f64,
    offset: DVec2,
) -> Option<f64> {
    // The highest value nearby: a distorted cloth has its peaks a little off the lattice.
    let tolerance = (0.1 * lattice.shorter()).max(0.71);
    let values: Vec<_> = lattice
        .points(radius)
        .into_iter()
        .map(|point| lattice.at(point) + offset)
        .filter(|&lag| correlogram.contains(lag, tolerance))
        .map(|lag| f64::from(correlogram.max_near(lag, tolerance)))
        .collect();
    (values.len() >= 4).then(|| values.iter().sum::<f64>() / double(values.len()))
}

/// A point of the finest lattice.
struct LagPoint {
    /// Counts of both vectors.
    count: [i32; 2],
    /// Distance from lag 0, in lengths of the longer vector.
    distance: f64,
    /// Correlation there.
    correlation: f64,
}

/// The superlattice of index 1 to 8 that separates best the points of `finest` that correlate from
/// those that don't; `finest` itself where none does.
fn best_superlattice(correlogram: &Correlogram, finest: &Lattice) -> Lattice {
    let radius = (5.0 * finest.longer()).min(0.9 * double(correlogram.reach));
    let tolerance = (0.1 * finest.shorter()).max(0.71);
    let points: Vec<LagPoint> = finest
        .points(radius)
        .into_iter()
        .filter(|&point| correlogram.contains(finest.at(point), tolerance))
        .map(|count| {
            let lag = finest.at(count);
            LagPoint {
                count,
                distance: lag.length() / finest.longer(),
                correlation: f64::from(correlogram.max_near(lag, tolerance)),
            }
        })
        .collect();
    let one_group = CorrelationSplit::new(&points, |_| true);
    let mut best = (one_group.residual, *finest);
    for index in 2..=8 {
        for [p, q, r] in hermite_forms(index) {
            let lattice = Lattice::reduced(
                finest.a * f64::from(p) + finest.b * f64::from(q),
                finest.b * f64::from(r),
            );
            if lattice.longer() > 8.5 * lattice.shorter() {
                continue;
            }
            let inverse = DMat2::from_cols(
                DVec2::new(f64::from(p), f64::from(q)),
                DVec2::new(0.0, f64::from(r)),
            )
            .inverse();
            let split = CorrelationSplit::new(&points, |[i, j]: [i32; 2]| {
                let place = inverse * DVec2::new(f64::from(i), f64::from(j));
                (place - place.round()).abs().max_element() < 1e-6
            });
            // Three points at least, or the split would explain single outliers.
            if split.count >= 3
                && split.on > MIN_RATIO * split.off.max(0.0) + MIN_DIFFERENCE
                && split.residual < best.0
            {
                best = (split.residual, lattice);
            }
        }
    }
    if best.0 < MAX_RESIDUAL * one_group.residual { best.1 } else { *finest }
}

/// How much better the points of a superlattice correlate than the other points, at least: as a
/// ratio and as a difference. Noise alone makes small differences.
const MIN_RATIO: f64 = 1.1;
const MIN_DIFFERENCE: f64 = 0.03;
/// Share of the differences between points that a superlattice may leave. Nearer to 1, noise would
/// multiply the cell; much lower, a weave of one colour would keep half of its cell.
const MAX_RESIDUAL: f64 = 0.75;

/// Points in two groups, each with a correlation that decays with distance as a Gaussian. Near
/// points weigh more: how much far ones have decorrelated differs by direction.
struct CorrelationSplit {
    /// Correlation at lag 0 of the points on the superlattice.
    on: f64,
    /// The same of the other points.
    off: f64,
    /// Number of points on the superlattice.
    count: usize,
    /// Weighted sum of squares that is left.
    residual: f64,
}

impl CorrelationSplit {
    /// The best fit of both groups over a few lengths of decay.
    fn new(points: &[LagPoint], is_on: impl Fn([i32; 2]) -> bool) -> Self {
        let member: Vec<bool> = points.iter().map(|point| is_on(point.count)).collect();
        [1.5, 2.2, 3.3, 5.0, 10.0, 100.0]
            .into_iter()
            .map(|decay| Self::with_decay(points, &member, decay))
            .min_by(|p, q| p.residual.total_cmp(&q.residual))
            .expect("there are some")
    }

    /// The least-squares levels of both groups where correlations decay over a length.
    fn with_decay(points: &[LagPoint], member: &[bool], decay: f64) -> Self {
        let [on, off] = [true, false].map(|group| {
            let (mut product, mut square) = (0.0, 1e-12);
            for (point, _) in points.iter().zip(member).filter(|(_, on)| **on == group) {
                product += point.weight() * point.decayed(decay) * point.correlation;
                square += point.weight() * point.decayed(decay).powi(2);
            }
            product / square
        });
        let residual = points
            .iter()
            .zip(member)
            .map(|(point, is_on)| {
                let level = if *is_on { on } else { off };
                point.weight() * (point.correlation - point.decayed(decay) * level).powi(2)
            })
            .sum();
        Self { on, off, count: member.iter().filter(|on| **on).count(), residual }
    }
}

impl LagPoint {
    fn weight(&self) -> f64 {
        1.0 / (1.0 + self.distance * self.distance)
    }

    fn decayed(&self, decay: f64) -> f64 {
        (-0.5 * (self.distance / decay).powi(2)).exp()
    }
}

/// All sublattices of an index, as Hermite normal forms [p, q, r] with p r equal to the index.
pub(super) fn hermite_forms(index: i32) -> impl Iterator<Item = [i32; 3]> {
    (1..=index)
        .filter(move |p| index % p == 0)
        .flat_map(move |p| (0..index / p).map(move |q| [p, q, index / p]))
}

/// The lattice through the peaks near its points, by weighted least squares.
fn refined(correlogram: &Correlogram, mut lattice: Lattice) -> Lattice {
    // From near points to far ones. Far points fix the vectors best, but an error of a fraction of
    // a pixel in them grows with the count: at once, the wrong peaks would be found there.
    for radius in [1.6, 2.6, 4.5, 6.5] {
        let tolerance = (0.12 * lattice.shorter()).max(0.71);
        let mut normal = DMat2::ZERO;
        let mut right = [DVec2::ZERO; 2];
        for point in lattice.points(radius * lattice.longer()) {
            let lag = lattice.at(point);
            if !correlogram.contains(lag, tolerance) {
                continue;
            }
            let (peak, value) = correlogram.peak_near(lag, tolerance);
            let weight = f64::from(value.max(0.0)).powi(2);
            let count = DVec2::new(f64::from(point[0]), f64::from(point[1]));
            // Normal equations of peak = a i + b j; x and y share the matrix.
            normal += DMat2::from_cols(count * count.x, count * count.y) * weight;
            right[0] += count * (weight * peak.x);
            right[1] += count * (weight * peak.y);
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

/// The confidence in a lattice: its points correlate better than those of the same lattice turned
/// and scaled, and the picture shows enough copies of the cell.
fn confidence(correlogram: &Correlogram, lattice: &Lattice, [width, height]: [f64; 2]) -> f64 {
    let radius = 3.2 * lattice.longer();
    // A null distribution: the same lattice at other angles and scales. Fur and noise correlate as
    // well there.
    let null: Vec<f64> = (1..40)
        .filter_map(|turn| {
            // Multiples of the golden angle, which come back to no direction.
            let turn =
                DVec2::from_angle(f64::from(turn) * 2.399_963) * (0.8 + 0.01 * f64::from(turn));
            mean_correlation(
                correlogram,
                &Lattice { a: turn.rotate(lattice.a), b: turn.rotate(lattice.b) },
                radius,
            )
        })
        .collect();
    let (Some(on), Some(count)) =
        (mean_correlation(correlogram, lattice, radius), NonZeroUsize::new(null.len()))
    else {
        return 0.0;
    };
    let count = double(count.get());
    let mean = null.iter().sum::<f64>() / count;
    let deviation = (null.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt();
    let better = on - mean;
    // The minimum: each rule alone lets some of the pictures pass that repeat nowhere.
    let chance = ramp(better * (width * height / lattice.area()).sqrt(), CHANCE);
    let contrast = ramp(better, CONTRAST).min(chance);
    contrast
        .min(ramp(better / deviation.max(1e-9), DEVIATIONS))
        .min(ramp(width.min(height) / lattice.longer(), COPIES))
}

/// A linear ramp from 0 at `low` to 1 at `high`.
fn ramp(value: f64, [low, high]: [f64; 2]) -> f64 {
    ((value - low) / (high - low)).clamp(0.0, 1.0)
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
        let counts: Vec<_> = (1..=8).map(|index| hermite_forms(index).count()).collect();
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
