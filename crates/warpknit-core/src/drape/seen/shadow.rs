//! Which parts of a garment stand between the sun and what a picture shows.
//!
//! In: the facets in view, and the sun. Out: a [`SunGrid`], which tells for any facet whether it may
//! cast a shadow on them.
//!
//! Method: a grid across the sun's rays keeps the depth of the deepest place in view, a shadow map
//! with receivers in place of casters. A facet may shadow a cell if it lies nearer to the sun than
//! that depth and within the cone that the sun's disc spans there. Cost: a few cells a facet. Not
//! promised: that a facet which passes is lit itself.

use std::ops::Range;

use glam::{DVec2, DVec3};

use super::{FlatFacet, Sight};

/// Cells along the longer side of the grid. With more, wide penumbras take longer; with fewer, more
/// cloth counts as a caster than casts shadows.
const CELLS: f64 = 64.0;

/// The deepest places in view, along the sun's rays.
pub(super) struct SunGrid {
    across: DVec3,
    up: DVec3,
    toward: DVec3,
    spread: f64,
    low: DVec2,
    cell: f64,
    /// Columns and rows.
    size: [usize; 2],
    /// Depth away from the sun, mm. Minus infinity where nothing in view lies.
    deepest: Vec<f64>,
    /// The deepest of all.
    bottom: f64,
}

impl SunGrid {
    /// The grid over what is in view. `None` without any cloth in view.
    pub(super) fn new(in_view: &[FlatFacet], sight: &Sight) -> Option<Self> {
        let (across, up) = sight.toward_sun.any_orthonormal_pair();
        let mut grid = Self {
            across,
            up,
            toward: sight.toward_sun,
            spread: sight.sun_spread,
            low: DVec2::INFINITY,
            cell: 0.0,
            size: [1, 1],
            deepest: Vec::new(),
            bottom: f64::NEG_INFINITY,
        };
        let places: Vec<_> = in_view.iter().map(|facet| grid.project(facet)).collect();
        let mut high = DVec2::NEG_INFINITY;
        for (place, reach) in &places {
            grid.low = grid.low.min(place.truncate() - *reach);
            high = high.max(place.truncate() + *reach);
        }
        let extent = high - grid.low;
        if !extent.is_finite() {
            return None;
        }
        grid.cell = (extent.max_element() / CELLS).max(f64::MIN_POSITIVE);
        grid.size = [0, 1].map(|axis| whole(extent[axis] / grid.cell) + 1);
        grid.deepest = vec![f64::NEG_INFINITY; grid.size[0] * grid.size[1]];
        for (place, reach) in places {
            let depth = place.z + reach;
            grid.bottom = grid.bottom.max(depth);
            for row in grid.cells(1, place.y, reach) {
                for column in grid.cells(0, place.x, reach) {
                    let own = &mut grid.deepest[row * grid.size[0] + column];
                    *own = own.max(depth);
                }
            }
        }
        Some(grid)
    }

    /// Whether a facet may cast a shadow on what is in view.
    pub(super) fn is_shadowed_by(&self, facet: &FlatFacet) -> bool {
        let (place, reach) = self.project(facet);
        let top = place.z - reach;
        let farthest = self.spread * (self.bottom - top);
        if farthest < 0.0 {
            return false;
        }
        // A cell counts as far as its corner.
        let margin = reach + self.cell * std::f64::consts::FRAC_1_SQRT_2;
        self.cells(1, place.y, reach + farthest).any(|row| {
            self.cells(0, place.x, reach + farthest).any(|column| {
                let below = self.deepest[row * self.size[0] + column] - top;
                let middle = DVec2::new(as_f64(column) + 0.5, as_f64(row) + 0.5) * self.cell;
                let apart = (self.low + middle).distance(place.truncate()) - margin;
                below > 0.0 && apart <= self.spread * below
            })
        })
    }

    /// Place across the sun's rays and depth along them, and the reach of the facet with its yarns.
    fn project(&self, facet: &FlatFacet) -> (DVec3, f64) {
        let (middle, reach) = facet.ball();
        let place =
            DVec3::new(middle.dot(self.across), middle.dot(self.up), -middle.dot(self.toward));
        (place, reach + facet.depth)
    }

    /// The columns (axis 0) or rows (axis 1) within `reach` of a coordinate. Empty beside the grid.
    fn cells(&self, axis: usize, at: f64, reach: f64) -> Range<usize> {
        let from = (at - reach - self.low[axis]) / self.cell;
        let to = (at + reach - self.low[axis]) / self.cell;
        if to < 0.0 || from >= as_f64(self.size[axis]) {
            return 0..0;
        }
        whole(from)..self.size[axis].min(whole(to) + 1)
    }
}

/// A coordinate rounded down; 0 for what lies below.
fn whole(at: f64) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "`as` saturates, and grids are small"
    )]
    let whole = at.floor() as usize;
    whole
}

/// The number of a cell.
fn as_f64(cell: usize) -> f64 {
    f64::from(crate::ids::index32(cell))
}
