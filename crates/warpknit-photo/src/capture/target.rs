//! Step 3: the mean cell as fits compare it with segments.
//!
//! In: a [`Cell`]. Out: a [`Target`], some hundred places with how light each is.

use glam::DVec2;
use rayon::prelude::*;

use super::cell::Cell;
use super::lattice::Lattice;
use super::segment::{Segment, drawn, places};
use crate::plane::{double, narrow, whole};

/// What the fit works on: a cell, brought to some number of places.
#[derive(Clone, Debug)]
pub(super) struct Target {
    pub(super) lattice: Lattice,
    /// Columns and rows.
    pub(super) size: [usize; 2],
    pub(super) places: Vec<DVec2>,
    /// How light each is.
    pub(super) light: Vec<f64>,
    pub(super) variance: f64,
}

impl Target {
    /// A cell brought to about `side` places each way, means over four by four.
    pub(super) fn new(cell: &Cell, side: f64) -> Self {
        const OVER: usize = 4;
        let lattice = cell.lattice;
        let scale = (side / (lattice.a.length() * lattice.b.length()).sqrt())
            .min(double(cell.plane.width) / lattice.a.length());
        let size = [lattice.a, lattice.b]
            .map(|vector| whole(narrow((vector.length() * scale).round())).max(8));
        let [columns, rows] = size;
        let within = |at: usize, part: usize, count: usize| {
            (double(at) + (double(part) + 0.5) / double(OVER) - 0.5) / double(count)
        };
        let mean = |at: usize| {
            let place = |part: usize| {
                DVec2::new(
                    within(at % columns, part % OVER, columns),
                    within(at / columns, part / OVER, rows),
                )
            };
            (0..OVER * OVER).map(|part| f64::from(cell.at(place(part)))).sum::<f64>()
                / double(OVER * OVER)
        };
        let light: Vec<f64> = (0..columns * rows).into_par_iter().map(mean).collect();
        let mean = light.iter().sum::<f64>() / double(light.len());
        let variance =
            light.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / double(light.len());
        Self { lattice, size, places: places(&lattice, size), light, variance: variance.max(1e-12) }
    }

    /// The lightness below which a share of the cell is.
    pub(super) fn quantile(&self, share: f64) -> f64 {
        let mut sorted = self.light.clone();
        sorted.sort_by(f64::total_cmp);
        sorted[whole(narrow(double(sorted.len() - 1) * share))]
    }

    /// Share of the cell's variance that segments leave.
    pub(super) fn error(&self, segments: &[Segment], ground: f64) -> f64 {
        self.left(&drawn(segments, ground, &self.lattice, &self.places))
    }

    /// The same of what they draw.
    pub(super) fn left(&self, drawn: &[f64]) -> f64 {
        let sum: f64 =
            drawn.iter().zip(&self.light).map(|(model, light)| (model - light).powi(2)).sum();
        sum / (double(self.light.len()) * self.variance)
    }

    /// The same, with the gain and offset that suit best.
    pub(super) fn left_scaled(&self, drawn: &[f64]) -> f64 {
        let count = double(drawn.len());
        let (mx, my) = (drawn.iter().sum::<f64>() / count, self.light.iter().sum::<f64>() / count);
        let (mut xx, mut xy) = (1e-12, 0.0);
        for (x, y) in drawn.iter().zip(&self.light) {
            xx += (x - mx).powi(2);
            xy += (x - mx) * (y - my);
        }
        if xy <= 0.0 { 1.0 } else { 1.0 - xy * xy / (xx * count * self.variance) }
    }
}
