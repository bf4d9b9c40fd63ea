//! Step 2, mean cell: the mean of all copies of the cell.
//!
//! In: a plane of the picture and its [`DisplacementField`]. Out: a [`Cell`], the mean of all
//! copies on a grid that runs along both vectors and tiles. Pixels of one copy lie between those of
//! another, so the mean is finer than the picture.
//!
//! Method: bilinear splatting of each pixel onto the cell's grid, twice. The second pass is one
//! step of iteratively reweighted least squares with Cauchy's weights, so that lint counts little.
//! Cost: a few operations a pixel.
//!
//! Not promised: sharpness beyond the photo's own blur and the error of the registration.

use glam::DVec2;
use rayon::prelude::*;

use super::lattice::Lattice;
use super::register::DisplacementField;
use crate::plane::{Plane, double, float, narrow, whole};

/// Grid points along the shorter vector, at least. Fewer would not resolve the round section of
/// yarns in a small cell.
const MIN_POINTS: f64 = 48.0;
/// Grid points along the longer vector beyond which the grid is not refined for that.
const MAX_POINTS: f64 = 160.0;
/// Deviation from the mean at which a pixel counts half, in units of the picture's contrast. A
/// tenth of it would trust only the first mean, and ten times as much would let lint count fully.
const OUTLIER_SCALE: f32 = 0.5;
/// Bands of rows that are summed in parallel. The number is fixed: sums in another order would
/// round differently for another number of threads.
const BANDS: usize = 16;

/// A plane over one cell of a lattice. Column i of row j is at i/width of a and j/height of b. It
/// is periodic on all sides.
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
    /// The robust mean of all copies in `plane`.
    pub(super) fn mean_of_copies(
        plane: &Plane,
        field: &DisplacementField,
        lattice: &Lattice,
    ) -> Self {
        let finer = (MIN_POINTS / lattice.shorter()).max(1.0).min(MAX_POINTS / lattice.longer());
        let size = [lattice.a, lattice.b]
            .map(|side| whole(narrow((side.length() * finer).round())).max(8));
        let first = Self::weighted_mean(plane, field, lattice, size, None);
        Self::weighted_mean(plane, field, lattice, size, Some(&first))
    }

    /// The mean of all copies; pixels far from `expected` count little.
    fn weighted_mean(
        plane: &Plane,
        field: &DisplacementField,
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
                        let at = DVec2::new(double(x), double(y));
                        sums.splat(*value, field.cell_coordinates(at), size, expected);
                    }
                }
                sums
            })
            .collect();
        let places = 0..size[0] * size[1];
        let mean_weight =
            places.clone().map(|at| total_weight(&bands, at)).sum::<f32>() / float(places.len());
        let values = places
            .map(|at| {
                let value = bands.iter().map(|band| band.values[at]).sum::<f32>();
                // A small share of the mean weight keeps grid points that hardly any pixel falls
                // on from dividing by nearly nothing.
                value / (total_weight(&bands, at) + 1e-4 * mean_weight).max(f32::MIN_POSITIVE)
            })
            .collect();
        Self { lattice: *lattice, plane: Plane { width: size[0], height: size[1], values } }
    }

    /// The value at cell coordinates.
    pub(super) fn at(&self, coordinates: DVec2) -> f32 {
        self.plane.sample_periodic(coordinates.x, coordinates.y)
    }

    /// 3 x 3 copies as they lie in the picture, `scale` pixels for each of its own, and the
    /// position of the corner in pixels of the picture.
    pub(super) fn grid(&self, scale: f64) -> (Plane, DVec2) {
        let corners = [[0.0, 0.0], [3.0, 0.0], [0.0, 3.0], [3.0, 3.0]]
            .map(|[i, j]| self.lattice.a * i + self.lattice.b * j);
        let low = corners.into_iter().fold(DVec2::INFINITY, DVec2::min);
        let high = corners.into_iter().fold(DVec2::NEG_INFINITY, DVec2::max);
        let [width, height] =
            ((high - low) * scale).to_array().map(|side| whole(narrow(side.ceil())).max(1));
        let inverse = self.lattice.matrix().inverse();
        let grid = Plane::from_fn(width, height, |x, y| {
            self.at(inverse * (low + DVec2::new(double(x), double(y)) / scale))
        });
        (grid, low)
    }
}

/// The sum of all bands' weights at a grid point.
fn total_weight(bands: &[Sums], at: usize) -> f32 {
    bands.iter().map(|band| band.weights[at]).sum()
}

impl Sums {
    /// Adds a value to the four grid points around its cell coordinates, by bilinear weights.
    fn splat(
        &mut self,
        value: f32,
        coordinates: DVec2,
        [columns, rows]: [usize; 2],
        expected: Option<&Cell>,
    ) {
        let place = (coordinates - coordinates.floor()) * DVec2::new(double(columns), double(rows));
        let [left, top] = [whole(narrow(place.x)) % columns, whole(narrow(place.y)) % rows];
        let [right, bottom] = [(left + 1) % columns, (top + 1) % rows];
        let [u, v] = [narrow(place.x.fract()), narrow(place.y.fract())];
        // Cauchy's weight. It never reaches 0, so that a grid point under lint in most copies still
        // gets a value.
        let trust = expected.map_or(1.0, |cell| {
            1.0 / (1.0 + ((value - cell.plane.at(left, top)) / OUTLIER_SCALE).powi(2))
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
