//! Step 2, mean cell: all copies folded into one.
//!
//! In: a plane of the picture and its [`Warp`]. Out: a [`Cell`], the mean of all copies on a grid
//! that goes along both vectors and tiles. Copies lie between each other's pixels, so the mean is
//! finer than the picture.

use glam::DVec2;
use rayon::prelude::*;

use super::lattice::Lattice;
use super::register::Warp;
use crate::plane::{Plane, double, float, narrow, whole};

/// Places along the shorter and along the longer vector: no fewer, and no more.
const FINEST: [f64; 2] = [48.0, 160.0];
/// How far from the mean a pixel counts half, where 1 is the picture's contrast: lint and stray
/// fibres don't count.
const TRUSTED: f32 = 0.5;
/// Bands of rows that are summed side by side; the same for any number of threads.
const BANDS: usize = 16;

/// A plane over one cell of a lattice: column i of row j is at i/width of a and j/height of b, and
/// what leaves on one side comes in on the other.
#[derive(Clone, Debug)]
pub(super) struct Cell {
    pub(super) lattice: Lattice,
    pub(super) plane: Plane,
}

/// Sums of weighted values.
struct Sums {
    values: Vec<f32>,
    weights: Vec<f32>,
}

impl Cell {
    /// The mean of all copies in `plane`, twice: the second time pixels far from the first mean
    /// count little.
    pub(super) fn folded(plane: &Plane, warp: &Warp, lattice: &Lattice) -> Self {
        let finer = (FINEST[0] / lattice.shorter()).max(1.0).min(FINEST[1] / lattice.longer());
        let size = [lattice.a, lattice.b]
            .map(|side| whole(narrow((side.length() * finer).round())).max(8));
        let first = Self::mean(plane, warp, lattice, size, None);
        Self::mean(plane, warp, lattice, size, Some(&first))
    }

    fn mean(
        plane: &Plane,
        warp: &Warp,
        lattice: &Lattice,
        size: [usize; 2],
        expected: Option<&Self>,
    ) -> Self {
        let bands: Vec<Sums> = (0..BANDS)
            .into_par_iter()
            .map(|band| {
                let mut sums = Sums {
                    values: vec![0.0; size[0] * size[1]],
                    weights: vec![0.0; size[0] * size[1]],
                };
                for y in plane.height * band / BANDS..plane.height * (band + 1) / BANDS {
                    for (x, value) in plane.row(y).iter().enumerate() {
                        sums.spread(
                            *value,
                            warp.count(DVec2::new(double(x), double(y))),
                            size,
                            expected,
                        );
                    }
                }
                sums
            })
            .collect();
        let sum = |of: &dyn Fn(&Sums) -> f32| bands.iter().map(of).sum::<f32>();
        let places = 0..size[0] * size[1];
        let all = places.clone().map(|at| sum(&|band| band.weights[at])).sum::<f32>()
            / float(places.len());
        // Where hardly any pixel falls, the value is nearly that of the whole.
        let value = |at: usize| {
            sum(&|band| band.values[at])
                / (sum(&|band| band.weights[at]) + 1e-4 * all).max(f32::MIN_POSITIVE)
        };
        let values = places.map(value).collect();
        Self { lattice: *lattice, plane: Plane { width: size[0], height: size[1], values } }
    }

    /// The value at counts of both vectors.
    pub(super) fn at(&self, count: DVec2) -> f32 {
        self.plane.around(count.x, count.y)
    }

    /// 3 x 3 copies as they lie in the picture, `scale` pixels for each of its own, and where its
    /// corner is in pixels of the picture.
    pub(super) fn grid(&self, scale: f64) -> (Plane, DVec2) {
        let corners = [[0.0, 0.0], [3.0, 0.0], [0.0, 3.0], [3.0, 3.0]]
            .map(|[i, j]| self.lattice.a * i + self.lattice.b * j);
        let low = corners.into_iter().fold(DVec2::INFINITY, DVec2::min);
        let high = corners.into_iter().fold(DVec2::NEG_INFINITY, DVec2::max);
        let [width, height] =
            ((high - low) * scale).to_array().map(|side| whole(narrow(side.ceil())).max(1));
        let inverse = self.lattice.matrix().inverse();
        let value = |x: usize, y: usize| {
            self.at(inverse * (low + DVec2::new(double(x), double(y)) / scale))
        };
        (Plane::from_fn(width, height, value), low)
    }
}

impl Sums {
    /// Adds a value to the four places around its own.
    fn spread(
        &mut self,
        value: f32,
        count: DVec2,
        [columns, rows]: [usize; 2],
        expected: Option<&Cell>,
    ) {
        let place = (count - count.floor()) * DVec2::new(double(columns), double(rows));
        let [left, top] = [whole(narrow(place.x)) % columns, whole(narrow(place.y)) % rows];
        let [right, bottom] = [(left + 1) % columns, (top + 1) % rows];
        let [u, v] = [narrow(place.x.fract()), narrow(place.y.fract())];
        let trust = expected.map_or(1.0, |cell| {
            1.0 / (1.0 + ((value - cell.plane.at(left, top)) / TRUSTED).powi(2))
        });
        let shares = [
            (left, top, (1.0 - u) * (1.0 - v)),
            (right, top, u * (1.0 - v)),
            (left, bottom, (1.0 - u) * v),
            (right, bottom, u * v),
        ];
        for (x, y, share) in shares {
            self.values[y * columns + x] += value * share * trust;
            self.weights[y * columns + x] += share * trust;
        }
    }
}
