//! Step 2, registration: how far each copy of the cell lies from its place on the lattice.
//!
//! In: the picture without slow shading, and its lattice. Out: a [`DisplacementField`], which
//! changes slowly across the picture.
//!
//! Method: geometric phase analysis (Hÿtch, Snoeck and Kilaas 1998, *Quantitative measurement of
//! displacement and strain fields from HREM micrographs*). A displacement d changes the phase of
//! the wave with wave vector k by -2π k·d. Two waves that aren't parallel determine d. All strong
//! waves together, by weighted least squares, determine it better.
//!
//! Cost: a few operations a pixel and wave. Not promised: displacements that change by half a cell
//! or more from one cell to the next, where the phase jumps.

use std::collections::BinaryHeap;
use std::f64::consts::TAU;

use glam::{DMat2, DVec2};
use rayon::prelude::*;

use super::lattice::Lattice;
use crate::plane::{Plane, double, narrow, whole};

/// How far the cloth is displaced, on a coarse grid. It is 0 in the middle of the picture.
#[derive(Clone, Debug)]
pub(crate) struct DisplacementField {
    /// Pixels to cell coordinates, where nothing is displaced.
    to_cell: DMat2,
    grid: NodeGrid,
    /// The displacement of the cloth that is visible at each node.
    nodes: Vec<DVec2>,
}

/// A grid of nodes over the picture.
#[derive(Clone, Copy, Debug)]
struct NodeGrid {
    /// Pixels from one node to the next.
    step: f64,
    columns: usize,
    rows: usize,
}

impl NodeGrid {
    /// The node in the middle of the picture.
    fn middle(&self) -> usize {
        (self.rows / 2) * self.columns + self.columns / 2
    }

    /// The index of the node nearest to a pixel along one axis.
    fn nearest(&self, pixel: usize) -> usize {
        whole(narrow((double(pixel) / self.step).round()))
    }

    fn empty_plane(&self) -> Plane {
        Plane {
            width: self.columns,
            height: self.rows,
            values: vec![0.0; self.columns * self.rows],
        }
    }

    /// The neighbours of a node to the left, to the right, above and below.
    fn neighbours(&self, node: usize) -> impl Iterator<Item = usize> + use<> {
        let (x, y) = (node % self.columns, node / self.columns);
        [
            (x > 0).then(|| node - 1),
            (x + 1 < self.columns).then(|| node + 1),
            (y > 0).then(|| node - self.columns),
            (y + 1 < self.rows).then(|| node + self.columns),
        ]
        .into_iter()
        .flatten()
    }
}

impl DisplacementField {
    /// The displacement of the cloth at a pixel, bilinear between nodes.
    fn displacement(&self, at: DVec2) -> DVec2 {
        let NodeGrid { step, columns, rows } = self.grid;
        let place =
            (at / step).clamp(DVec2::ZERO, DVec2::new(double(columns - 1), double(rows - 1)));
        let [x, y] = [(place.x, columns), (place.y, rows)]
            .map(|(at, count)| whole(narrow(at)).min(count.saturating_sub(2)));
        let (right, down) = ((x + 1).min(columns - 1), (y + 1).min(rows - 1));
        let (u, v) = (place.x - double(x), place.y - double(y));
        let [upper, lower] =
            [y, down].map(|y| self.nodes[y * columns + x].lerp(self.nodes[y * columns + right], u));
        upper.lerp(lower, v)
    }

    /// Cell coordinates at a pixel: counts of the lattice's vectors.
    pub(super) fn cell_coordinates(&self, at: DVec2) -> DVec2 {
        self.to_cell * (at - self.displacement(at))
    }

    /// The pixel at cell coordinates.
    pub(super) fn pixel_at(&self, coordinates: DVec2) -> DVec2 {
        self.displaced(self.to_cell.inverse() * coordinates)
    }

    /// The pixel where a place of the undisplaced cloth is seen.
    pub(crate) fn displaced(&self, undisplaced: DVec2) -> DVec2 {
        // Fixed-point iteration. It converges because displacements change slowly; six steps are
        // far below a pixel.
        (0..6).fold(undisplaced, |at, _| undisplaced + self.displacement(at))
    }
}

/// Waves that determine the displacement, at most. Weak ones are mostly noise.
const MAX_WAVES: usize = 6;
/// Largest order of the waves that are tried, along either reciprocal vector.
const MAX_ORDER: i32 = 4;
/// Largest frequency, cycles a pixel: a little below the limit of 0.5, near which a photo's blur
/// leaves nothing.
const MAX_FREQUENCY: f64 = 0.4;
/// Deviation of the Gaussian window, in lengths of the longer vector. Narrower windows let the
/// neighbouring waves in, and wider ones smooth the displacement away.
const WINDOW: f64 = 1.1;
/// Pixels between nodes: a share of the shorter vector, and the least.
const NODE_STEP: f64 = 0.5;
const MIN_NODE_STEP: f64 = 3.0;

/// A wave with its local amplitude at each node, as real and imaginary part.
struct Wave {
    /// Cycles a pixel.
    vector: DVec2,
    amplitudes: Vec<[f64; 2]>,
    /// Mean modulus of the amplitudes.
    strength: f64,
}

/// The displacement of the cloth in `even`, the picture without slow shading.
pub(crate) fn register(even: &Plane, lattice: &Lattice) -> DisplacementField {
    register_in(even, lattice, WINDOW * lattice.longer())
}

/// The same in windows of that deviation, pixels: for cells so long that displacements change
/// within one.
pub(crate) fn register_in(even: &Plane, lattice: &Lattice, sigma: f64) -> DisplacementField {
    let step = (NODE_STEP * lattice.shorter()).max(MIN_NODE_STEP);
    let [columns, rows] =
        [even.width, even.height].map(|side| whole(narrow(double(side) / step)) + 2);
    let grid = NodeGrid { step, columns, rows };
    let waves = strongest_waves(even, lattice, grid, sigma);
    let phases: Vec<Vec<f64>> =
        waves.iter().map(|wave| unwrapped_phases(&wave.amplitudes, grid)).collect();
    let nodes = (0..columns * rows).map(|node| displacement_at(node, &waves, &phases, grid));
    DisplacementField { to_cell: lattice.matrix().inverse(), grid, nodes: nodes.collect() }
}

/// The waves of the lattice that are strongest in the picture.
fn strongest_waves(even: &Plane, lattice: &Lattice, grid: NodeGrid, sigma: f64) -> Vec<Wave> {
    // Columns of the inverse transpose are the reciprocal lattice's vectors: only waves on it have
    // the period of the cell.
    let reciprocal = lattice.matrix().inverse().transpose();
    // Half of the orders: opposite waves of a real picture are conjugates of each other.
    let vectors: Vec<DVec2> = (-MAX_ORDER..=MAX_ORDER)
        .flat_map(|m| (0..=MAX_ORDER).map(move |n| [m, n]))
        .filter(|&[m, n]| n > 0 || m > 0)
        .map(|[m, n]| reciprocal * DVec2::new(f64::from(m), f64::from(n)))
        .filter(|wave| wave.length() < MAX_FREQUENCY)
        .collect();
    let mut waves: Vec<Wave> = vectors
        .into_par_iter()
        .map(|vector| {
            let amplitudes = local_amplitudes(even, vector, grid, sigma);
            let strength = amplitudes.iter().map(|[re, im]| re.hypot(*im)).sum::<f64>()
                / double(amplitudes.len());
            Wave { vector, amplitudes, strength }
        })
        .collect();
    waves.sort_by(|p, q| q.strength.total_cmp(&p.strength));
    waves.truncate(MAX_WAVES);
    waves
}

/// The displacement at a node that explains the phases of all waves best, by weighted least
/// squares.
fn displacement_at(node: usize, waves: &[Wave], phases: &[Vec<f64>], grid: NodeGrid) -> DVec2 {
    // The phase of the middle is the cloth's own pattern. Only the difference from it is
    // displacement.
    let middle = grid.middle();
    let (mut normal, mut right) = (DMat2::ZERO, DVec2::ZERO);
    for (wave, phase) in waves.iter().zip(phases) {
        let [re, im] = wave.amplitudes[node];
        // The variance of a phase is inverse to the squared amplitude, which makes this the
        // optimal weight.
        let weight = re * re + im * im;
        let k = wave.vector * TAU;
        normal += DMat2::from_cols(k * k.x, k * k.y) * weight;
        right -= k * (weight * (phase[node] - phase[middle]));
    }
    // Tikhonov's regularisation: stripes have waves of one direction only, and the displacement
    // along them is unknown. It becomes 0 instead of infinite.
    let ridge = 1e-6 * (normal.x_axis.x + normal.y_axis.y) + 1e-18;
    (normal + DMat2::IDENTITY * ridge).inverse() * right
}

/// The amplitude of a wave at each node, in a Gaussian window, relative to the undisplaced wave: a
/// windowed Fourier transform at one frequency.
fn local_amplitudes(even: &Plane, wave: DVec2, grid: NodeGrid, sigma: f64) -> Vec<[f64; 2]> {
    // The wave is separable: two tables of sines instead of one evaluation a pixel.
    let along_x = sin_cos_table(even.width, wave.x);
    let along_y = sin_cos_table(even.height, wave.y);
    // Sums around each node first, then a blur of the nodes: about as good as a window around each
    // pixel, and cheaper by the number of pixels a node.
    let [mut re, mut im, mut counts] = [(); 3].map(|()| grid.empty_plane());
    let nodes: Vec<usize> = (0..even.width).map(|x| grid.nearest(x)).collect();
    for (y, &(sin_y, cos_y)) in along_y.iter().enumerate() {
        let row = grid.nearest(y) * grid.columns;
        for ((value, node), &(sin_x, cos_x)) in even.row(y).iter().zip(&nodes).zip(&along_x) {
            let at = row + node;
            let value = f64::from(*value);
            // Times exp(-2πi k·x): demodulation to frequency 0.
            re.values[at] += narrow(value * (cos_x * cos_y - sin_x * sin_y));
            im.values[at] -= narrow(value * (sin_x * cos_y + cos_x * sin_y));
            counts.values[at] += 1.0;
        }
    }
    let [re, im, counts] = [re, im, counts].map(|plane| plane.smoothed(narrow(sigma / grid.step)));
    // Normalised convolution: near the border the window holds fewer pixels.
    re.values
        .iter()
        .zip(&im.values)
        .zip(&counts.values)
        .map(|((re, im), count)| [f64::from(re / count.max(1e-6)), f64::from(im / count.max(1e-6))])
        .collect()
}

fn sin_cos_table(count: usize, frequency: f64) -> Vec<(f64, f64)> {
    (0..count).map(|at| (TAU * frequency * double(at)).sin_cos()).collect()
}

/// Phases without jumps of a turn: quality-guided unwrapping, from the middle over the strongest
/// neighbours to the weakest (Ghiglia and Pritt 1998, *Two-dimensional phase unwrapping*). In any
/// other order one weak node, whose phase is noise, would pass its error on to all behind it.
fn unwrapped_phases(amplitudes: &[[f64; 2]], grid: NodeGrid) -> Vec<f64> {
    let mut phases = vec![f64::NAN; amplitudes.len()];
    let start = grid.middle();
    phases[start] = phase(amplitudes[start]);
    let mut heap = BinaryHeap::new();
    heap.push((u64::MAX, start));
    while let Some((_, node)) = heap.pop() {
        for next in grid.neighbours(node) {
            if phases[next].is_nan() {
                let wrapped = phase(amplitudes[next]);
                let turns = ((phases[node] - wrapped) / TAU).round();
                phases[next] = wrapped + turns * TAU;
                let [re, im] = amplitudes[next];
                // Floats of one sign are in the order of their bits, and bits can be heap keys.
                heap.push((re.hypot(im).to_bits(), next));
            }
        }
    }
    phases
}

fn phase([re, im]: [f64; 2]) -> f64 {
    im.atan2(re)
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
                    && warp.pixel_at(warp.cell_coordinates(at)).distance(at) < 1e-2,
                "{at}"
            );
        }
    }
}
