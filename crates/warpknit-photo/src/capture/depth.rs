//! Step 4, depth: the height of each point of the cell.
//!
//! In: the mean cell, its segments and their colours, and the thickness of the cloth. Out:
//! [`Depth`], heights over the deepest ground, mm.
//!
//! Method: the fitted curved cylinders give most of the height. "Dark is deep" gives the rest, with
//! a scale of its own for each colour of yarn. The sum is smoothed where the cylinders have no
//! edge, by the fast global smoother (Min et al. 2014, *Fast global image smoothing based on
//! weighted least squares*): the weighted least squares of Farbman et al. 2008, *Edge-preserving
//! decompositions for multi-scale tone and detail manipulation*, row by row and column by column.
//!
//! Cost: some milliseconds; a few operations a point. Not promised: a depth where light is no sign
//! of it, as on satin. [`Depth::correlation`] says how far it is one.

use std::collections::BTreeSet;

use super::cell::Cell;
use super::layout::Layout;
use super::relief::{Samples, heights};
use crate::plane::{Plane, double, narrow, percentile};

/// Share of the light in the depth; the cylinders have the rest. At 0 fine relief would be lost; at
/// 1 stains and prints would become holes.
const LIGHT_SHARE: f64 = 0.25;
/// Weight of the smoothness term where there is no edge, in squares of grid points.
const SMOOTHNESS: f32 = 6.0;
/// Difference of heights that counts as an edge, in units of contrast: there the weight falls to
/// 1/e. Much smaller, the round sections of yarns would count as edges; much larger, yarns would
/// melt into each other.
const EDGE: f32 = 0.15;
/// Iterations of the smoother. Each one evens out what the rows of the last one left between the
/// columns.
const ITERATIONS: i32 = 3;
/// Quantiles of the heights that are taken for the deepest ground and for the highest yarn.
const ENDS: [f32; 2] = [0.01, 0.99];

/// Heights over a cell.
#[derive(Clone, Debug)]
pub(super) struct Depth {
    /// Heights in mm, on the cell's own grid.
    pub(super) cell: Cell,
    /// mm for a lightness of 1.
    pub(super) scale: f64,
    /// Correlation of the cell's light with the cylinders' heights.
    pub(super) correlation: f64,
}

impl Depth {
    /// The depth of cloth that is `thickness` mm thick. `groups` has the colour of each visible
    /// segment of the layout.
    pub(super) fn new(cell: &Cell, layout: &Layout, groups: &[usize], thickness: f64) -> Self {
        let Plane { width, height, ref values } = cell.plane;
        let samples = Samples::grid(&cell.lattice, [width, height]);
        let own: Vec<Vec<f64>> = layout
            .visible
            .iter()
            .map(|segment| heights(segment, &cell.lattice, &samples))
            .collect();
        let model: Vec<f64> = (0..values.len())
            .map(|at| own.iter().map(|heights| heights[at]).fold(0.0, f64::max))
            .collect();
        let light = || values.iter().map(|light| f64::from(*light));
        let correlation = Line::through(light().zip(model.iter().copied())).correlation;
        let combined = with_light(values, &model, &groups_of_points(&own, groups, values.len()));
        let plane = |values: &[f64]| Plane {
            width,
            height,
            values: values.iter().map(|value| narrow(*value)).collect(),
        };
        let smooth = smoothed(&plane(&combined), &plane(&model));
        // Quantiles instead of extrema: a speck would scale the whole cloth.
        let [low, high] = ENDS.map(|share| percentile(&mut smooth.values.clone(), share));
        let scale = thickness / f64::from((high - low).max(1e-3));
        let plane = smooth.map(|value| ((value - low) * narrow(scale)).max(0.0));
        Self { cell: Cell { lattice: cell.lattice, plane }, scale, correlation }
    }
}

/// The colour of each point: that of the highest segment there, `None` on the ground.
fn groups_of_points(heights: &[Vec<f64>], groups: &[usize], points: usize) -> Vec<Option<usize>> {
    (0..points)
        .map(|at| {
            let highest =
                (0..heights.len()).max_by(|&p, &q| heights[p][at].total_cmp(&heights[q][at]));
            highest.filter(|&segment| heights[segment][at] > 0.0).map(|segment| groups[segment])
        })
        .collect()
}

/// The heights of the model with a share of what the light says about them. Light becomes height by
/// a regression of its own for each colour: a dark yarn is no deeper than a light one.
fn with_light(values: &[f32], model: &[f64], groups: &[Option<usize>]) -> Vec<f64> {
    let mut combined = model.to_vec();
    for group in groups.iter().copied().collect::<BTreeSet<_>>() {
        let members = || (0..model.len()).filter(|&at| groups[at] == group);
        let line = Line::through(members().map(|at| (f64::from(values[at]), model[at])));
        for at in members() {
            // A negative gain means that lighter isn't higher: then the light says nothing.
            let height = if line.gain > 0.0 {
                line.gain * f64::from(values[at]) + line.offset
            } else {
                model[at]
            };
            combined[at] += LIGHT_SHARE * (height - model[at]);
        }
    }
    combined
}

/// A regression line.
struct Line {
    gain: f64,
    offset: f64,
    correlation: f64,
}

impl Line {
    /// The line through points by ordinary least squares.
    fn through(points: impl Iterator<Item = (f64, f64)> + Clone) -> Self {
        let count = double(points.clone().count()).max(1.0);
        let (x, y) = points
            .clone()
            .fold((0.0, 0.0), |(x, y), point| (x + point.0 / count, y + point.1 / count));
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for (px, py) in points {
            xx += (px - x).powi(2);
            xy += (px - x) * (py - y);
            yy += (py - y).powi(2);
        }
        let gain = if xx > 0.0 { xy / xx } else { 0.0 };
        let correlation = if xx > 0.0 && yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 };
        Self { gain, offset: y - gain * x, correlation }
    }
}

/// The fast global smoother on a torus: smooth except across edges of `guide`.
fn smoothed(plane: &Plane, guide: &Plane) -> Plane {
    // Smoothness falls by a factor of four with each iteration, and all add up to SMOOTHNESS, as in
    // Min et al. 2014. One iteration alone would leave streaks along the rows.
    let whole: f32 = (1..=ITERATIONS).map(|n| 4.0_f32.powi(ITERATIONS - n)).sum();
    let mut values = plane.clone();
    for n in 1..=ITERATIONS {
        let smoothness = SMOOTHNESS * 4.0_f32.powi(ITERATIONS - n) / whole;
        values = transposed(&rows_smoothed(
            &transposed(&rows_smoothed(&values, guide, smoothness)),
            &transposed(guide),
            smoothness,
        ));
    }
    values
}

fn transposed(plane: &Plane) -> Plane {
    Plane::from_fn(plane.height, plane.width, |x, y| plane.at(y, x))
}

/// Weight of the smoothness term between two neighbours with these guide values.
fn smoothness_weight(a: f32, b: f32) -> f32 {
    (-(a - b).abs() / EDGE).exp()
}

/// Each row by itself, as a ring: the weighted least squares of its values and of the differences
/// of neighbours.
fn rows_smoothed(plane: &Plane, guide: &Plane, smoothness: f32) -> Plane {
    Plane::from_rows(plane.width, plane.height, |y, row| {
        let guide = guide.row(y);
        let weights: Vec<f32> = (0..guide.len())
            .map(|x| smoothness * smoothness_weight(guide[x], guide[(x + 1) % guide.len()]))
            .collect();
        row.copy_from_slice(&solve_ring(&weights, plane.row(y)));
    })
}

/// Solves the cyclic tridiagonal system
/// `(1 + w[x-1] + w[x]) u[x] - w[x-1] u[x-1] - w[x] u[x+1] = f[x]` on a ring; `weights[x]` is
/// between x and x + 1.
fn solve_ring(weights: &[f32], right: &[f32]) -> Vec<f32> {
    // The Sherman-Morrison formula: the ring is a tridiagonal matrix T plus an outer product p q'
    // with the two corner elements, where p is (-d, 0, .., 0, -c) and q is (1, 0, .., 0, c/d).
    // c is the weight that closes the ring, and d the first diagonal element.
    let count = weights.len();
    let closing = weights[count - 1];
    let corner = 1.0 + closing + weights[0];
    let diagonal: Vec<f32> = (0..count)
        .map(|x| {
            // T has p q' taken off again in its corners.
            let opened = if x == 0 {
                corner
            } else if x + 1 == count {
                closing * closing / corner
            } else {
                0.0
            };
            1.0 + weights[(x + count - 1) % count] + weights[x] + opened
        })
        .collect();
    let (first, last) = (-corner, -closing);
    let mut update = vec![0.0; count];
    update[count - 1] = last;
    update[0] = first;
    let plain = solve_tridiagonal(&diagonal, weights, right);
    let bent = solve_tridiagonal(&diagonal, weights, &update);
    let along = |values: &[f32]| values[0] + values[count - 1] * last / first;
    let share = along(&plain) / (1.0 + along(&bent));
    plain.iter().zip(&bent).map(|(plain, bent)| plain - share * bent).collect()
}

/// Solves a symmetric tridiagonal system by Thomas's algorithm; `-weights[x]` is beside the
/// diagonal, between x and x + 1. No pivoting is needed, since the diagonal dominates.
fn solve_tridiagonal(diagonal: &[f32], weights: &[f32], right: &[f32]) -> Vec<f32> {
    let count = diagonal.len();
    let (mut upper, mut values) = (vec![0.0; count], vec![0.0; count]);
    for x in 0..count {
        let lower = if x == 0 { 0.0 } else { -weights[x - 1] };
        let pivot = diagonal[x] - lower * if x == 0 { 0.0 } else { upper[x - 1] };
        upper[x] = if x + 1 == count { 0.0 } else { -weights[x] / pivot };
        values[x] = (right[x] - lower * if x == 0 { 0.0 } else { values[x - 1] }) / pivot;
    }
    for x in (0..count.saturating_sub(1)).rev() {
        values[x] -= upper[x] * values[x + 1];
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::float;

    #[test]
    fn a_ring_is_solved() {
        let ties: Vec<f32> = (0..7).map(|x| 0.3 + 0.2 * float(x % 3)).collect();
        let right: Vec<f32> = (0..7).map(|x| float(x * x % 5)).collect();
        let solved = solve_ring(&ties, &right);
        for x in 0..7 {
            let (before, after) = ((x + 6) % 7, (x + 1) % 7);
            let left = (1.0 + ties[before] + ties[x]) * solved[x]
                - ties[before] * solved[before]
                - ties[x] * solved[after];
            assert!((left - right[x]).abs() < 1e-5, "{x}: {left} {}", right[x]);
        }
    }

    #[test]
    fn the_smoother_is_near_the_exact_least_squares_and_keeps_edges() {
        let (width, height) = (20, 16);
        let guide =
            Plane::from_fn(
                width,
                height,
                |x, y| if (4..13).contains(&x) && y > 3 { 1.0 } else { 0.0 },
            );
        let noise = |x: usize, y: usize| float((x * 37 + y * 101) % 19) / 19.0 - 0.5;
        let plane = Plane::from_fn(width, height, |x, y| guide.at(x, y) + noise(x, y));
        let fast = smoothed(&plane, &guide);
        // (1 + smoothness · Laplacian of the ties) u = f, all at once.
        let mut matrix = nalgebra::DMatrix::<f64>::identity(width * height, width * height);
        for y in 0..height {
            for x in 0..width {
                for (i, j) in [((x + 1) % width, y), (x, (y + 1) % height)] {
                    let (p, q) = (y * width + x, j * width + i);
                    let tie =
                        f64::from(SMOOTHNESS * smoothness_weight(guide.at(x, y), guide.at(i, j)));
                    matrix[(p, p)] += tie;
                    matrix[(q, q)] += tie;
                    matrix[(p, q)] -= tie;
                    matrix[(q, p)] -= tie;
                }
            }
        }
        let right = nalgebra::DVector::from_iterator(
            width * height,
            plane.values.iter().map(|value| f64::from(*value)),
        );
        let exact = matrix.cholesky().unwrap().solve(&right);
        let rms = |of: &dyn Fn(usize) -> f64| {
            ((0..width * height).map(|at| of(at).powi(2)).sum::<f64>() / 320.0).sqrt()
        };
        let (off, noise) = (
            rms(&|at| f64::from(fast.values[at]) - exact[at]),
            rms(&|at| f64::from(plane.values[at]) - exact[at]),
        );
        assert!(off < 0.2 * noise, "{off} of {noise}");
        let edge = fast.at(4, 10) - fast.at(3, 10);
        assert!((edge - 1.0).abs() < 0.2, "{edge}");
    }
}
