//! Step 3, the second hypothesis: the segments that cover the cell best, whatever the cloth is.
//! Legs of knit loops are found in this way.
//!
//! In: a [`FitTarget`]. Out: [`LayoutFit`]s, one for each width of filters.
//!
//! Method: a greedy cover by oriented matched filters. The filters' strongest responses become
//! candidate segments. The pair of candidates that explains most is refined by Levenberg-Marquardt,
//! and then candidates are added one by one where the cell is lighter than rendered, while each
//! lowers the error by enough.
//!
//! Cost: filters times kernel size times sample points, plus a rendering for each pair of
//! candidates. Not promised: the best cover. A greedy choice is never taken back here; the local
//! search of `layout.rs` joins and drops segments afterwards.

use std::f64::consts::PI;

use glam::DVec2;
use pulp::Arch;
use rayon::prelude::*;

use super::fit::{Hypothesis, LayoutFit, refine};
use super::relief::{heights, max_into, rendered};
use super::segment::Segment;
use super::steps;
use super::target::FitTarget;
use crate::plane::double;
use warpknit_core::ids::index32;

/// Directions of the filters: steps of three degrees. A filter of the longest kind (5.4 widths)
/// still overlaps most of a yarn that lies half a step off.
const ANGLES: usize = 60;
/// Widths of the filters as shares of the square root of the cell's area: from six yarns side by
/// side to two. A refinement changes a width by a factor of two at most, so that neighbouring
/// widths overlap.
const WIDTHS: [f64; 5] = [0.16, 0.22, 0.3, 0.4, 0.54];
/// Lengths of the filters, in widths.
const LENGTHS: [f64; 4] = [1.6, 2.4, 3.6, 5.4];
/// Candidates for each width. All pairs of them are rendered, so that the cost grows with the
/// square.
const MAX_CANDIDATES: usize = 48;
/// Candidates that are tried for each of two widths when one segment is added.
const CANDIDATES_TO_ADD: usize = 24;
/// Segments in a cell, at most.
const MAX_SEGMENTS: usize = 8;
/// An added segment must bring the error below this share of the error before. Nearer to 1, noise
/// would be covered by segments too.
const MAX_ERROR_RATIO: f64 = 0.85;
/// Share of the variance that is left where nothing is added any more: what noise leaves.
const EXPLAINED: f64 = 0.02;
/// Iterations of the refinement after each step of the cover.
const ITERATIONS: usize = 8;

/// Layouts that cover the cell, refined, one for each width of filters.
pub(super) fn fits(
    target: &FitTarget,
    ground: f64,
    top: f64,
) -> impl ParallelIterator<Item = LayoutFit> {
    let scale = target.lattice.area().sqrt();
    WIDTHS.into_par_iter().filter_map(move |share| {
        let candidates = candidates(target, &target.light, share * scale, ground, top);
        // Two segments at once, because one alone would settle between two yarns that cross.
        let pair = best_pair(target, &candidates)?;
        Some(extended(target, refine(target, Hypothesis::Cover, &pair, ground, ITERATIONS), top))
    })
}

/// A fit with segments added where the cell is lighter than rendered, while they help.
pub(super) fn extended(target: &FitTarget, mut fit: LayoutFit, top: f64) -> LayoutFit {
    while fit.segments.len() < MAX_SEGMENTS && fit.error > EXPLAINED {
        match with_one_more(target, &fit, top) {
            Some(better) if better.error < MAX_ERROR_RATIO * fit.error => fit = better,
            _ => break,
        }
    }
    fit
}

/// The best fit with one segment more.
fn with_one_more(target: &FitTarget, fit: &LayoutFit, top: f64) -> Option<LayoutFit> {
    let rendered = rendered(&fit.segments, fit.ground, &target.lattice, &target.samples);
    // Matching pursuit (Mallat and Zhang 1993): the filters look for the residual only.
    let rest: Vec<f64> =
        target.light.iter().zip(&rendered).map(|(light, rendered)| light - rendered).collect();
    let mean_width =
        fit.segments.iter().map(|segment| segment.width).sum::<f64>() / double(fit.segments.len());
    // A yarn that is left shows less of its width than those that were found before it.
    let candidates: Vec<Segment> = [0.7 * mean_width, mean_width]
        .into_iter()
        .flat_map(|width| {
            candidates(target, &rest, width, fit.ground, top).into_iter().take(CANDIDATES_TO_ADD)
        })
        .collect();
    let mut tried: Vec<(f64, &Segment)> = candidates
        .par_iter()
        .map(|candidate| (residual_with(target, &rendered, candidate, fit.ground), candidate))
        .collect();
    tried.sort_by(|p, q| p.0.total_cmp(&q.0));
    // A refinement costs far more than a rendering: only the two best ones get one.
    tried.truncate(2);
    tried
        .par_iter()
        .map(|(_, candidate)| {
            fit.refit(target, &[&fit.segments[..], &[**candidate]].concat(), ITERATIONS)
        })
        .min_by(|p, q| p.error.total_cmp(&q.error))
}

/// What a candidate leaves unexplained over what others have rendered.
fn residual_with(target: &FitTarget, rendered: &[f64], candidate: &Segment, ground: f64) -> f64 {
    let mut with = heights(candidate, &target.lattice, &target.samples);
    with.iter_mut().for_each(|height| *height += ground);
    max_into(&mut with, rendered);
    target.residual(&with)
}

/// Candidate segments of one width: local maxima of the filters' responses, strongest first.
fn candidates(
    target: &FitTarget,
    light: &[f64],
    width: f64,
    ground: f64,
    top: f64,
) -> Vec<Segment> {
    // Beyond two cells a filter would mostly see its own copies.
    let longest = 2.0 * target.lattice.longer();
    let filters: Vec<(usize, f64)> = (0..ANGLES)
        .flat_map(|angle| LENGTHS.map(|length| (angle, length * width)))
        .filter(|(_, length)| *length <= longest)
        .collect();
    let tiled = tiled_twice(light, target.size);
    let mut responses: Vec<(f64, Segment)> = filters
        .into_par_iter()
        .flat_map_iter(|(angle, length)| {
            let angle = double(angle) / double(ANGLES) * PI;
            let response = responses(&kernel(target, angle, width, length), &tiled, target.size);
            maxima(&response, target.size).into_iter().map(move |at| {
                let centre = target.samples.points[at];
                let segment = Segment::straight(centre, angle, width, length, top - ground);
                (response[at], segment)
            })
        })
        .collect();
    responses.sort_by(|p, q| q.0.total_cmp(&p.0));
    // Non-maximum suppression: neighbouring angles and places respond to the same yarn, and would
    // take all the candidates' slots.
    let mut kept: Vec<Segment> = Vec::new();
    for (_, segment) in responses {
        let is_new = !kept.iter().any(|other| is_alike(other, &segment, target));
        if kept.len() < MAX_CANDIDATES && is_new {
            kept.push(segment);
        }
    }
    kept
}

/// Indices of the positive local maxima of a response on the periodic grid.
fn maxima(response: &[f64], [columns, rows]: [usize; 2]) -> Vec<usize> {
    let mut maxima = Vec::new();
    for at in 0..columns * rows {
        let (x, y) = (at % columns + columns, at / columns + rows);
        let value = response[at];
        let is_exceeded = (0..9).any(|n| {
            response[(y + n / 3 - 1) % rows * columns + (x + n % 3 - 1) % columns] > value
        });
        if value > 0.0 && !is_exceeded {
            maxima.push(at);
        }
    }
    maxima
}

/// Whether two candidates of one width are of the same yarn.
fn is_alike(p: &Segment, q: &Segment, target: &FitTarget) -> bool {
    let offset = target.lattice.nearest(p.centre - q.centre).length();
    let turn = (p.angle - q.angle).rem_euclid(PI);
    offset < 0.4 * q.width
        && turn.min(PI - turn) < 0.2
        && (p.length - q.length).abs() < 0.1 * q.width
}

/// A cell's light twice each way. Then a filter at any place of the first copy reads contiguous
/// rows, without a modulo in the inner loop.
fn tiled_twice(light: &[f64], [columns, rows]: [usize; 2]) -> Vec<f64> {
    (0..2 * rows)
        .flat_map(|y| {
            let row = &light[y % rows * columns..][..columns];
            [row, row].concat()
        })
        .collect()
}

/// Periodic correlation of a kernel with a cell that is given as [`tiled_twice`].
fn responses(
    kernel: &[(usize, usize, f64)],
    tiled: &[f64],
    [columns, rows]: [usize; 2],
) -> Vec<f64> {
    let mut responses = vec![0.0; columns * rows];
    // Rows outside, weights inside: a row of responses stays in the nearest cache, and the inner
    // loop runs along it in wide registers.
    Arch::new().dispatch(
        #[inline(always)]
        || {
            for (y, row) in responses.chunks_exact_mut(columns).enumerate() {
                for &(dx, dy, weight) in kernel {
                    let light = &tiled[(y + dy) * 2 * columns + dx..][..columns];
                    let both = row.iter_mut().zip(light);
                    both.for_each(|(response, light)| *response += light * weight);
                }
            }
        },
    );
    responses
}

/// A signed step on a ring of `count` places.
fn wrapped_index(step: i32, count: usize) -> usize {
    let count = index32(count).cast_signed();
    usize::try_from(step.rem_euclid(count)).expect("a remainder is not negative")
}

/// A matched filter: the shading of a straight cylinder and dark flanks, as offsets on the grid
/// with weights of mean 0 and norm 1.
fn kernel(target: &FitTarget, angle: f64, width: f64, length: f64) -> Vec<(usize, usize, f64)> {
    let [columns, rows] = target.size;
    let lattice = &target.lattice;
    let radius = 0.5 * length + width;
    // The cell may be sheared: the rows of the grid are nearer to each other by this sine.
    let sine = lattice.area() / (lattice.a.length() * lattice.b.length());
    let [across, down] = [(lattice.a, columns), (lattice.b, rows)]
        .map(|(vector, count)| steps((radius * double(count) / (vector.length() * sine)).ceil()));
    let mut weights = Vec::new();
    for j in -down..=down {
        for i in -across..=across {
            let offset = lattice.a * (f64::from(i) / double(columns))
                + lattice.b * (f64::from(j) / double(rows));
            let at = DVec2::from_angle(-angle).rotate(offset);
            let v = at.y.abs() / (0.5 * width);
            // Flanks of a quarter of a width to either side. Without them a filter would respond to
            // any light area as strongly as to a yarn.
            if at.x.abs() > 0.5 * length || v > 1.5 {
                continue;
            }
            let light = if v < 1.0 { 0.35 + 0.65 * (1.0 - v * v).sqrt() } else { 0.0 };
            weights.push((wrapped_index(i, columns), wrapped_index(j, rows), light));
        }
    }
    // Zero mean takes off the local brightness. Norm 1 makes the square of a response the variance
    // that the filter explains, so that filters of all sizes compare.
    let mean = weights.iter().map(|weight| weight.2).sum::<f64>() / double(weights.len().max(1));
    let norm = weights.iter().map(|weight| (weight.2 - mean).powi(2)).sum::<f64>().sqrt().max(1e-9);
    weights.iter_mut().for_each(|weight| weight.2 = (weight.2 - mean) / norm);
    weights
}

/// The two candidates that explain most together.
fn best_pair(target: &FitTarget, candidates: &[Segment]) -> Option<[Segment; 2]> {
    let own: Vec<Vec<f64>> = candidates
        .par_iter()
        .map(|candidate| heights(candidate, &target.lattice, &target.samples))
        .collect();
    let pairs: Vec<[usize; 2]> = (0..candidates.len())
        .flat_map(|i| (i + 1..candidates.len()).map(move |j| [i, j]))
        .collect();
    // Heights are rendered once a candidate; a pair only takes the maximum of two of them.
    let best = pairs
        .par_iter()
        .map(|pair| {
            let mut both = own[pair[0]].clone();
            max_into(&mut both, &own[pair[1]]);
            (target.residual_scaled(&both), pair)
        })
        .min_by(|p, q| p.0.total_cmp(&q.0));
    best.map(|(_, pair)| pair.map(|number| candidates[number]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn responses_are_periodic() {
        let (size, light) = ([3, 2], [1.0, 2.0, 4.0, 8.0, 16.0, 32.0]);
        let found = responses(&[(0, 0, 1.0), (2, 1, 10.0)], &tiled_twice(&light, size), size);
        // Each place, and ten times the one two to its right (one to its left) in the other row.
        assert_eq!(found, [321.0, 82.0, 164.0, 48.0, 26.0, 52.0]);
    }
}
