//! Step 2, registration: how far each copy of the cell lies from where the lattice has it.
//!
//! In: the picture without slow shading, and its lattice. Out: a [`Warp`], a displacement at each
//! place that changes slowly across the picture.
//!
//! Waves of the lattice's frequencies are followed through the picture (geometric phase analysis,
//! Hÿtch, Snoeck and Kilaas 1998): where the cloth is moved by d, the phase of a wave k is less by
//! k·d. Two waves that aren't parallel tell d, and all strong ones together tell it better. Cost: a
//! few operations a pixel and wave.
//!
//! Not promised: cloth that is moved by half a cell or more from one cell to the next.

use std::collections::BinaryHeap;
use std::f64::consts::TAU;

use glam::{DMat2, DVec2};
use rayon::prelude::*;

use super::lattice::Lattice;
use crate::plane::{Plane, double, narrow, whole};

/// How far the cloth is moved, on a coarse grid; nothing in the picture's middle.
#[derive(Clone, Debug)]
pub(super) struct Warp {
    /// Pixels to counts of the lattice's vectors.
    to_counts: DMat2,
    /// Pixels from one node to the next.
    step: f64,
    columns: usize,
    rows: usize,
    /// The displacement of the cloth that is seen at each node.
    nodes: Vec<DVec2>,
}

impl Warp {
    /// How far the cloth at a pixel is from where it belongs.
    fn displacement(&self, at: DVec2) -> DVec2 {
        let place = (at / self.step)
            .clamp(DVec2::ZERO, DVec2::new(double(self.columns - 1), double(self.rows - 1)));
        let node = |at: f64, count: usize| whole(narrow(at)).min(count.saturating_sub(2));
        let (x, y) = (node(place.x, self.columns), node(place.y, self.rows));
        let (right, down) = ((x + 1).min(self.columns - 1), (y + 1).min(self.rows - 1));
        let (u, v) = (place.x - double(x), place.y - double(y));
        let row = |y: usize| {
            self.nodes[y * self.columns + x].lerp(self.nodes[y * self.columns + right], u)
        };
        row(y).lerp(row(down), v)
    }

    /// Counts of the lattice's vectors at a pixel.
    pub(super) fn count(&self, at: DVec2) -> DVec2 {
        self.to_counts * (at - self.displacement(at))
    }

    /// The pixel at counts of the lattice's vectors.
    pub(super) fn place(&self, count: DVec2) -> DVec2 {
        let straight = self.to_counts.inverse() * count;
        // Displacements change slowly, so that each step is some times nearer.
        (0..6).fold(straight, |at, _| straight + self.displacement(at))
    }
}

/// Waves that are followed at most.
const WAVES: usize = 6;

/// Follows the cloth through `even`, the picture without slow shading.
pub(super) fn register(even: &Plane, lattice: &Lattice) -> Warp {
    let step = (0.5 * lattice.shorter()).max(3.0);
    let [columns, rows] =
        [even.width, even.height].map(|side| whole(narrow(double(side) / step)) + 2);
    // A window of some cells: less would let the wave's neighbours in.
    let sigma = 1.1 * lattice.longer();
    let reciprocal = lattice.matrix().inverse().transpose();
    let waves: Vec<DVec2> = (-4..=4)
        .flat_map(|m| (0..=4).map(move |n| [m, n]))
        .filter(|&[m, n]| n > 0 || m > 0)
        .map(|[m, n]| reciprocal * DVec2::new(f64::from(m), f64::from(n)))
        .filter(|wave| wave.length() < 0.4)
        .collect();
    let strength = |field: &[[f64; 2]]| {
        field.iter().map(|[re, im]| re.hypot(*im)).sum::<f64>() / double(field.len())
    };
    let mut followed: Vec<(f64, DVec2, Vec<[f64; 2]>)> = waves
        .into_par_iter()
        .map(|wave| {
            let field = follow(even, wave, step, columns, rows, sigma);
            (strength(&field), wave, field)
        })
        .collect();
    followed.sort_by(|p, q| q.0.total_cmp(&p.0));
    followed.truncate(WAVES);
    let phases: Vec<Vec<f64>> =
        followed.iter().map(|(_, _, field)| unwrapped(field, columns, rows)).collect();
    // Phases of the middle are the cloth's own; only what is other elsewhere is displacement.
    let middle = (rows / 2) * columns + columns / 2;
    let nodes = (0..columns * rows).map(|node| {
        let (mut normal, mut right) = (DMat2::ZERO, DVec2::ZERO);
        for ((_, wave, field), phase) in followed.iter().zip(&phases) {
            let [re, im] = field[node];
            let weight = re * re + im * im;
            let turn = *wave * TAU;
            normal += DMat2::from_cols(turn * turn.x, turn * turn.y) * weight;
            right -= turn * (weight * (phase[node] - phase[middle]));
        }
        let ridge = 1e-6 * (normal.x_axis.x + normal.y_axis.y) + 1e-18;
        (normal + DMat2::IDENTITY * ridge).inverse() * right
    });
    Warp { to_counts: lattice.matrix().inverse(), step, columns, rows, nodes: nodes.collect() }
}

/// A wave's amplitude at each node, relative to one that goes straight on: real and imaginary part.
fn follow(
    even: &Plane,
    wave: DVec2,
    step: f64,
    columns: usize,
    rows: usize,
    sigma: f64,
) -> Vec<[f64; 2]> {
    let along = |count: usize, wave: f64| -> Vec<(f64, f64)> {
        (0..count).map(|at| (TAU * wave * double(at)).sin_cos()).collect()
    };
    let (along_x, along_y) = (along(even.width, wave.x), along(even.height, wave.y));
    let node = |at: usize| whole(narrow((double(at) / step).round()));
    // Sums around each node first, then a blur of the nodes.
    let [mut re, mut im, mut counts] =
        [(); 3].map(|()| Plane { width: columns, height: rows, values: vec![0.0; columns * rows] });
    for (y, &(sin_y, cos_y)) in along_y.iter().enumerate() {
        let row = node(y) * columns;
        for ((x, value), &(sin_x, cos_x)) in even.row(y).iter().enumerate().zip(&along_x) {
            let at = row + node(x);
            let value = f64::from(*value);
            re.values[at] += narrow(value * (cos_x * cos_y - sin_x * sin_y));
            im.values[at] -= narrow(value * (sin_x * cos_y + cos_x * sin_y));
            counts.values[at] += 1.0;
        }
    }
    let [re, im, counts] = [re, im, counts].map(|plane| plane.smoothed(narrow(sigma / step)));
    let mean = |sum: f32, count: f32| f64::from(sum / count.max(1e-6));
    let both = re.values.iter().zip(&im.values).zip(&counts.values);
    both.map(|((re, im), count)| [mean(*re, *count), mean(*im, *count)]).collect()
}

/// Phases without jumps of a turn, from the strongest neighbours to the weakest.
fn unwrapped(field: &[[f64; 2]], columns: usize, rows: usize) -> Vec<f64> {
    let mut phases = vec![f64::NAN; field.len()];
    let start = (rows / 2) * columns + columns / 2;
    let angle = |node: usize| field[node][1].atan2(field[node][0]);
    phases[start] = angle(start);
    let mut heap = BinaryHeap::new();
    // Amplitudes over 0 are in the order of their bits.
    let key = |node: usize| field[node][0].hypot(field[node][1]).to_bits();
    heap.push((u64::MAX, start));
    while let Some((_, node)) = heap.pop() {
        let (x, y) = (node % columns, node / columns);
        let neighbours = [
            (x > 0).then(|| node - 1),
            (x + 1 < columns).then(|| node + 1),
            (y > 0).then(|| node - columns),
            (y + 1 < rows).then(|| node + columns),
        ];
        for next in neighbours.into_iter().flatten() {
            if phases[next].is_nan() {
                let turns = ((phases[node] - angle(next)) / TAU).round();
                phases[next] = angle(next) + turns * TAU;
                heap.push((key(next), next));
            }
        }
    }
    phases
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_and_counts_are_each_others_inverse() {
        let lattice = Lattice { a: DVec2::new(20.0, 1.0), b: DVec2::new(-2.0, 16.0) };
        let inverse = lattice.matrix().inverse();
        let moved = Plane::from_fn(300, 260, |x, y| {
            let at = DVec2::new(double(x), double(y));
            let count = inverse * (at + DVec2::new((at.y / 60.0).sin(), (at.x / 50.0).cos()) * 3.0);
            narrow((TAU * count.x).cos() + (TAU * count.y).sin())
        });
        let warp = register(&moved, &lattice);
        for at in [[20.0, 30.0], [150.0, 130.0], [290.0, 250.0]].map(DVec2::from) {
            assert!(
                warp.displacement(at).length() < 8.0
                    && warp.place(warp.count(at)).distance(at) < 1e-2,
                "{at}"
            );
        }
    }
}
