//! Step 3: the mean cell as the fits compare it with segments.
//!
//! In: a [`Cell`]. Out: a [`FitTarget`], some hundred sample points with the lightness of each, and
//! measures of the variance that a rendering leaves unexplained.

use glam::DVec2;
use rayon::prelude::*;

use super::cell::Cell;
use super::lattice::Lattice;
use super::relief::{Samples, rendered};
use super::segment::Segment;
use crate::plane::{double, narrow, whole};

/// Samples each way that are averaged for one sample point.
const OVERSAMPLING: usize = 4;

/// What a fit works on: a cell, resampled to some number of points.
#[derive(Clone, Debug)]
pub(super) struct FitTarget {
    pub(super) lattice: Lattice,
    /// Columns and rows.
    pub(super) size: [usize; 2],
    pub(super) samples: Samples,
    /// Lightness of each sample.
    pub(super) light: Vec<f64>,
    pub(super) variance: f64,
}

impl FitTarget {
    /// A cell resampled to about `side` points each way; each point is a mean of four by four
    /// samples.
    pub(super) fn new(cell: &Cell, side: f64) -> Self {
        let lattice = cell.lattice;
        // Never finer than the cell's own grid: more points would cost time and tell nothing new.
        let scale = (side / (lattice.a.length() * lattice.b.length()).sqrt())
            .min(double(cell.plane.width) / lattice.a.length());
        let size = [lattice.a, lattice.b]
            .map(|vector| whole(narrow((vector.length() * scale).round())).max(8));
        let light: Vec<f64> = (0..size[0] * size[1])
            .into_par_iter()
            .map(|at| box_mean(cell, at % size[0], at / size[0], size))
            .collect();
        let mean = light.iter().sum::<f64>() / double(light.len());
        let variance =
            light.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / double(light.len());
        let samples = Samples::grid(&lattice, size);
        Self { lattice, size, samples, light, variance: variance.max(1e-12) }
    }

    /// The lightness below which a share of the cell lies.
    pub(super) fn quantile(&self, share: f64) -> f64 {
        let mut sorted = self.light.clone();
        sorted.sort_by(f64::total_cmp);
        sorted[whole(narrow(double(sorted.len() - 1) * share))]
    }

    /// Share of the cell's variance that segments leave unexplained.
    pub(super) fn error(&self, segments: &[Segment], ground: f64) -> f64 {
        self.residual(&rendered(segments, ground, &self.lattice, &self.samples))
    }

    /// Share of the cell's variance that a rendering leaves unexplained.
    pub(super) fn residual(&self, rendered: &[f64]) -> f64 {
        let sum: f64 =
            rendered.iter().zip(&self.light).map(|(model, light)| (model - light).powi(2)).sum();
        sum / (double(self.light.len()) * self.variance)
    }

    /// The same after the best gain and offset: 1 less the squared correlation coefficient. It
    /// ranks candidates whose contrast has not been fitted yet.
    pub(super) fn residual_scaled(&self, rendered: &[f64]) -> f64 {
        let count = double(rendered.len());
        let (mx, my) =
            (rendered.iter().sum::<f64>() / count, self.light.iter().sum::<f64>() / count);
        let (mut xx, mut xy) = (1e-12, 0.0);
        for (x, y) in rendered.iter().zip(&self.light) {
            xx += (x - mx).powi(2);
            xy += (x - mx) * (y - my);
        }
        // A negative gain would take yarns for gaps: it explains nothing.
        if xy <= 0.0 { 1.0 } else { 1.0 - xy * xy / (xx * count * self.variance) }
    }
}

/// Mean of the cell over the area of one sample point.
fn box_mean(cell: &Cell, column: usize, row: usize, [columns, rows]: [usize; 2]) -> f64 {
    // Averages before it drops samples, so that fine texture does not alias into the target.
    let share = |at: usize, part: usize, count: usize| {
        (double(at) + (double(part) + 0.5) / double(OVERSAMPLING) - 0.5) / double(count)
    };
    (0..OVERSAMPLING * OVERSAMPLING)
        .map(|part| {
            f64::from(cell.at(DVec2::new(
                share(column, part % OVERSAMPLING, columns),
                share(row, part / OVERSAMPLING, rows),
            )))
        })
        .sum::<f64>()
        / double(OVERSAMPLING * OVERSAMPLING)
}
