//! Step 3, the other hypothesis, knit legs among them: whatever yarns cover the cell best, sought
//! by oriented matched filters and taken greedily.
//!
//! In: a [`Target`]. Out: [`Fit`]s, one a width of filters: the two spots that explain most
//! together, refined, and then one more where the cell is lighter than drawn, as long as that
//! helps.

use std::f64::consts::PI;

use glam::DVec2;
use rayon::prelude::*;

use super::fit::{Fit, Hypothesis, refine};
use super::segment::{Segment, drawn, heights, over};
use super::steps;
use super::target::Target;
use crate::plane::double;
use warpknit_core::ids::index32;

/// Directions of the filters.
const ANGLES: usize = 60;
/// Widths of filters, as shares of the cell's shorter height.
const WIDTHS: [f64; 5] = [0.16, 0.22, 0.3, 0.4, 0.54];
/// Lengths of filters, in widths.
const LENGTHS: [f64; 4] = [1.6, 2.4, 3.6, 5.4];
/// Places that are looked at for each filter's greedy cover.
const TRIED: usize = 48;

/// Layouts that cover the cell, refined, one a width of filters.
pub(super) fn fits(target: &Target, ground: f64, top: f64) -> impl ParallelIterator<Item = Fit> {
    let scale = target.lattice.area().sqrt();
    WIDTHS.into_par_iter().filter_map(move |share| {
        let spots = spots(target, &target.light, share * scale, ground, top);
        let pair = best_pair(target, &spots)?;
        Some(grown(target, refine(target, Hypothesis::Cover, &pair, ground, 8), top))
    })
}

/// Most segments of a cell.
const MOST: usize = 8;
/// A segment must bring the error below this share of what it was.
const HELPS: f64 = 0.85;

/// With segments added where the cell is lighter than drawn, while they help.
pub(super) fn grown(target: &Target, mut fit: Fit, top: f64) -> Fit {
    while fit.segments.len() < MOST && fit.error > 0.02 {
        let drawn = drawn(&fit.segments, fit.ground, &target.lattice, &target.places);
        let rest: Vec<f64> =
            target.light.iter().zip(&drawn).map(|(light, drawn)| light - drawn).collect();
        let mean_width = fit.segments.iter().map(|segment| segment.width).sum::<f64>()
            / double(fit.segments.len());
        let widths = [0.7 * mean_width, mean_width];
        let spots: Vec<Segment> = widths
            .into_iter()
            .flat_map(|width| spots(target, &rest, width, fit.ground, top).into_iter().take(24))
            .collect();
        let left = |spot: &Segment| {
            let mut with = heights(spot, &target.lattice, &target.places);
            with.iter_mut().for_each(|height| *height += fit.ground);
            over(&mut with, &drawn);
            target.left(&with)
        };
        let mut tried: Vec<(f64, &Segment)> =
            spots.par_iter().map(|spot| (left(spot), spot)).collect();
        tried.sort_by(|p, q| p.0.total_cmp(&q.0));
        tried.truncate(2);
        let with = |(_, spot): &(f64, &Segment)| {
            fit.with(target, &[&fit.segments[..], &[**spot]].concat(), 8)
        };
        let best = tried.par_iter().map(with).min_by(|p, q| p.error.total_cmp(&q.error));
        match best {
            Some(better) if better.error < HELPS * fit.error => fit = better,
            _ => break,
        }
    }
    fit
}

/// Where filters of a width answer most.
fn spots(target: &Target, light: &[f64], width: f64, ground: f64, top: f64) -> Vec<Segment> {
    let longest = 2.0 * target.lattice.longer();
    let filters: Vec<(usize, f64)> = (0..ANGLES)
        .flat_map(|angle| LENGTHS.map(|length| (angle, length * width)))
        .filter(|(_, length)| *length <= longest)
        .collect();
    let [columns, rows] = target.size;
    let twice = twice(light, target.size);
    let mut answers: Vec<(f64, Segment)> = filters
        .into_par_iter()
        .flat_map_iter(|(angle, length)| {
            let angle = double(angle) / double(ANGLES) * PI;
            let answers = answers(&kernel(target, angle, width, length), &twice, target.size);
            let mut peaks: Vec<(f64, Segment)> = Vec::new();
            for at in 0..columns * rows {
                let (x, y) = (at % columns + columns, at / columns + rows);
                let value = answers[at];
                let higher = (0..9).any(|n| {
                    answers[(y + n / 3 - 1) % rows * columns + (x + n % 3 - 1) % columns] > value
                });
                if value > 0.0 && !higher {
                    peaks.push((
                        value,
                        Segment::straight(target.places[at], angle, width, length, top - ground),
                    ));
                }
            }
            peaks
        })
        .collect();
    answers.sort_by(|p, q| q.0.total_cmp(&p.0));
    let near = |p: &Segment, q: &Segment| {
        let off = target.lattice.nearest(p.centre - q.centre).length();
        let turn = (p.angle - q.angle).rem_euclid(PI);
        off < 0.4 * width && turn.min(PI - turn) < 0.2 && (p.length - q.length).abs() < 0.1 * width
    };
    let mut kept: Vec<Segment> = Vec::new();
    for (_, segment) in answers {
        if kept.len() < TRIED && !kept.iter().any(|other| near(other, &segment)) {
            kept.push(segment);
        }
    }
    kept
}

/// A cell's light twice each way, so that no filter within it has to come in again on the other
/// side.
fn twice(light: &[f64], [columns, rows]: [usize; 2]) -> Vec<f64> {
    let row = |y: usize| &light[y % rows * columns..][..columns];
    (0..2 * rows).flat_map(|y| [row(y), row(y)].concat()).collect()
}

/// What a filter answers at each place of a cell that is given [`twice`].
fn answers(kernel: &[(usize, usize, f64)], twice: &[f64], [columns, rows]: [usize; 2]) -> Vec<f64> {
    let mut answers = vec![0.0; columns * rows];
    for &(dx, dy, weight) in kernel {
        for (y, row) in answers.chunks_exact_mut(columns).enumerate() {
            let light = &twice[(y + dy) * 2 * columns + dx..][..columns];
            row.iter_mut().zip(light).for_each(|(answer, light)| *answer += light * weight);
        }
    }
    answers
}

/// A step on a ring of that many places.
fn around(step: i32, count: usize) -> usize {
    let count = index32(count).cast_signed();
    usize::try_from(step.rem_euclid(count)).expect("a remainder is not negative")
}

/// A filter's weights: a cylinder's shading, its flanks and nothing on the whole; its answer is
/// what it explains of the cell.
fn kernel(target: &Target, angle: f64, width: f64, length: f64) -> Vec<(usize, usize, f64)> {
    let [columns, rows] = target.size;
    let lattice = &target.lattice;
    let reach = 0.5 * length + width;
    let sine = lattice.area() / (lattice.a.length() * lattice.b.length());
    let counts = [(lattice.a, columns), (lattice.b, rows)];
    let [across, down] = counts
        .map(|(vector, count)| steps((reach * double(count) / (vector.length() * sine)).ceil()));
    let mut weights = Vec::new();
    for j in -down..=down {
        for i in -across..=across {
            let off = lattice.a * (f64::from(i) / double(columns))
                + lattice.b * (f64::from(j) / double(rows));
            let at = DVec2::from_angle(-angle).rotate(off);
            let v = at.y.abs() / (0.5 * width);
            if at.x.abs() > 0.5 * length || v > 1.5 {
                continue;
            }
            let light = if v < 1.0 { 0.35 + 0.65 * (1.0 - v * v).sqrt() } else { 0.0 };
            weights.push((around(i, columns), around(j, rows), light));
        }
    }
    let mean = weights.iter().map(|weight| weight.2).sum::<f64>() / double(weights.len().max(1));
    let norm = weights.iter().map(|weight| (weight.2 - mean).powi(2)).sum::<f64>().sqrt().max(1e-9);
    weights.iter_mut().for_each(|weight| weight.2 = (weight.2 - mean) / norm);
    weights
}

/// The two spots that explain most together.
fn best_pair(target: &Target, spots: &[Segment]) -> Option<[Segment; 2]> {
    let own: Vec<Vec<f64>> =
        spots.par_iter().map(|spot| heights(spot, &target.lattice, &target.places)).collect();
    let pairs: Vec<[usize; 2]> =
        (0..spots.len()).flat_map(|i| (i + 1..spots.len()).map(move |j| [i, j])).collect();
    let left = |&[i, j]: &[usize; 2]| {
        let mut both = own[i].clone();
        over(&mut both, &own[j]);
        target.left_scaled(&both)
    };
    let best = pairs.par_iter().map(|pair| (left(pair), pair)).min_by(|p, q| p.0.total_cmp(&q.0));
    best.map(|(_, pair)| pair.map(|number| spots[number]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_come_in_again_on_the_other_side() {
        let (size, light) = ([3, 2], [1.0, 2.0, 4.0, 8.0, 16.0, 32.0]);
        let answers = answers(&[(0, 0, 1.0), (2, 1, 10.0)], &twice(&light, size), size);
        // Each place, and ten times the one two to its right (one to its left) in the other row.
        assert_eq!(answers, [321.0, 82.0, 164.0, 48.0, 26.0, 52.0]);
    }
}
