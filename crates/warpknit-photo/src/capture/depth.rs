//! Step 4, depth: how high each place of the cell lies.
//!
//! In: the mean cell, its segments and their colours, and how thick the cloth is. Out: [`Depth`],
//! heights over the deepest ground, mm. The curved cylinders that were fitted say most of it; 'dark
//! is deep' says the rest, for each colour of yarn on a scale of its own, and what both say is
//! smoothed where the cylinders have no edge. The smoother is the fast global one of Min et al.
//! 2014: the weighted least squares of Farbman et al. 2008, row by row and column by column. Cost:
//! some milliseconds; a few operations a place.
//!
//! Not promised: a depth where light is no sign of it, as on satin; [`Depth::correlation`] says how
//! far it is one.

use super::cell::Cell;
use super::layout::Layout;
use super::segment::{heights, places};
use crate::plane::{Plane, double, narrow, percentile};

/// The light's share in the depth; the cylinders' is the rest.
const PRIOR: f64 = 0.25;
/// How far the smoother carries a value where there is no edge, squares of places, and the
/// difference of heights that is one, in contrasts.
const SMOOTHNESS: f32 = 6.0;
const EDGE: f32 = 0.15;
/// Rounds of the smoother; each evens out what rows left between columns.
const ROUNDS: i32 = 3;
/// Shares of the places that lie below the deepest ground and above the highest yarn that count.
const ENDS: [f32; 2] = [0.01, 0.99];

/// Heights over a cell.
#[derive(Clone, Debug)]
pub(super) struct Depth {
    /// mm, on the cell's own grid.
    pub(super) cell: Cell,
    /// mm for a lightness of 1.
    pub(super) scale: f64,
    /// Correlation of the cell's light with the cylinders' heights.
    pub(super) correlation: f64,
}

impl Depth {
    /// The depth of cloth that is `thickness` mm thick; `groups` has a colour for each of the
    /// layout's segments that are seen.
    pub(super) fn of(cell: &Cell, layout: &Layout, groups: &[usize], thickness: f64) -> Self {
        let Plane { width, height, ref values } = cell.plane;
        let places = places(&cell.lattice, [width, height]);
        let own: Vec<Vec<f64>> =
            layout.seen.iter().map(|segment| heights(segment, &cell.lattice, &places)).collect();
        let model: Vec<f64> = (0..places.len())
            .map(|at| own.iter().map(|heights| heights[at]).fold(0.0, f64::max))
            .collect();
        let correlation =
            line(values.iter().map(|light| f64::from(*light)).zip(model.iter().copied())).2;
        // Which colour each place has: that of the highest segment.
        let group = |at: usize| {
            let highest = (0..own.len()).max_by(|&p, &q| own[p][at].total_cmp(&own[q][at]));
            highest.filter(|&segment| own[segment][at] > 0.0).map(|segment| groups[segment])
        };
        let of_places: Vec<Option<usize>> = (0..places.len()).map(group).collect();
        let mut said = model.clone();
        for group in groups
            .iter()
            .copied()
            .map(Some)
            .chain([None])
            .collect::<std::collections::BTreeSet<_>>()
        {
            let members = || (0..places.len()).filter(|&at| of_places[at] == group);
            let (gain, offset, _) = line(members().map(|at| (f64::from(values[at]), model[at])));
            for at in members() {
                // Where lighter isn't higher, light says nothing.
                let light =
                    if gain > 0.0 { gain * f64::from(values[at]) + offset } else { model[at] };
                said[at] += PRIOR * (light - model[at]);
            }
        }
        let plane = |values: &[f64]| Plane {
            width,
            height,
            values: values.iter().map(|value| narrow(*value)).collect(),
        };
        let smooth = smoothed(&plane(&said), &plane(&model));
        let [low, high] = ENDS.map(|share| percentile(&mut smooth.values.clone(), share));
        let scale = thickness / f64::from((high - low).max(1e-3));
        let plane = smooth.map(|value| ((value - low) * narrow(scale)).max(0.0));
        Self { cell: Cell { lattice: cell.lattice, plane }, scale, correlation }
    }
}

/// The line through some points by least squares: gain, offset, and the correlation.
fn line(points: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, f64, f64) {
    let count = double(points.clone().count()).max(1.0);
    let (x, y) =
        points.clone().fold((0.0, 0.0), |(x, y), point| (x + point.0 / count, y + point.1 / count));
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for (px, py) in points {
        xx += (px - x).powi(2);
        xy += (px - x) * (py - y);
        yy += (py - y).powi(2);
    }
    let gain = if xx > 0.0 { xy / xx } else { 0.0 };
    (gain, y - gain * x, if xx > 0.0 && yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 })
}

/// Smoothed along what `guide` has no edge across; goes around on all sides.
fn smoothed(plane: &Plane, guide: &Plane) -> Plane {
    // Rounds add up to the smoothness, each a quarter of the one before.
    let whole: f32 = (1..=ROUNDS).map(|round| 4.0_f32.powi(ROUNDS - round)).sum();
    let mut values = plane.clone();
    for round in 1..=ROUNDS {
        let smoothness = SMOOTHNESS * 4.0_f32.powi(ROUNDS - round) / whole;
        values = turned(&rows_smoothed(
            &turned(&rows_smoothed(&values, guide, smoothness)),
            &turned(guide),
            smoothness,
        ));
    }
    values
}

/// Rows for columns.
fn turned(plane: &Plane) -> Plane {
    Plane::from_fn(plane.height, plane.width, |x, y| plane.at(y, x))
}

/// How near neighbours are held to each other.
fn tie(a: f32, b: f32) -> f32 {
    (-(a - b).abs() / EDGE).exp()
}

/// Each row by itself, a ring: the least squares of its values and the ties of neighbours.
fn rows_smoothed(plane: &Plane, guide: &Plane, smoothness: f32) -> Plane {
    Plane::from_rows(plane.width, plane.height, |y, row| {
        let guide = guide.row(y);
        let ties: Vec<f32> = (0..guide.len())
            .map(|x| smoothness * tie(guide[x], guide[(x + 1) % guide.len()]))
            .collect();
        row.copy_from_slice(&ring(&ties, plane.row(y)));
    })
}

/// Solves (1 + t before + t after) u - t before u before - t after u after = f on a ring; `ties[x]`
/// is between x and x + 1. The Sherman-Morrison formula opens the ring, and Thomas's elimination
/// solves both lines that are left.
fn ring(ties: &[f32], right: &[f32]) -> Vec<f32> {
    let count = ties.len();
    let closing = ties[count - 1];
    let corner = 1.0 + closing + ties[0];
    let before = |x: usize| ties[(x + count - 1) % count];
    let opened = |x: usize| {
        if x == 0 {
            corner
        } else if x + 1 == count {
            closing * closing / corner
        } else {
            0.0
        }
    };
    let diagonal = |x: usize| 1.0 + before(x) + ties[x] + opened(x);
    let line = |right: &dyn Fn(usize) -> f32| {
        let (mut upper, mut values) = (vec![0.0; count], vec![0.0; count]);
        for x in 0..count {
            let lower = if x == 0 { 0.0 } else { -ties[x - 1] };
            let pivot = diagonal(x) - lower * if x == 0 { 0.0 } else { upper[x - 1] };
            upper[x] = if x + 1 == count { 0.0 } else { -ties[x] / pivot };
            values[x] = (right(x) - lower * if x == 0 { 0.0 } else { values[x - 1] }) / pivot;
        }
        for x in (0..count.saturating_sub(1)).rev() {
            values[x] -= upper[x] * values[x + 1];
        }
        values
    };
    let (first, last) = (-corner, -closing);
    let plain = line(&|x| right[x]);
    let bent = line(&|x| {
        if x == 0 {
            first
        } else if x + 1 == count {
            last
        } else {
            0.0
        }
    });
    let along = |values: &[f32]| values[0] + values[count - 1] * last / first;
    let share = along(&plain) / (1.0 + along(&bent));
    plain.iter().zip(&bent).map(|(plain, bent)| plain - share * bent).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::float;

    #[test]
    fn a_ring_is_solved() {
        let ties: Vec<f32> = (0..7).map(|x| 0.3 + 0.2 * float(x % 3)).collect();
        let right: Vec<f32> = (0..7).map(|x| float(x * x % 5)).collect();
        let solved = ring(&ties, &right);
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
                    let tie = f64::from(SMOOTHNESS * tie(guide.at(x, y), guide.at(i, j)));
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
