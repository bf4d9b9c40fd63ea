//! A triangle near each place of a panel, from which a walk to that place is short.
//!
//! In: a panel's vertices and triangles. Out: [`Starts`].
//!
//! Method: a grid of square cells over the panel. Each triangle writes its index in the cell of its
//! first corner. A cell in which none begins takes over that of a cell beside it. This is
//! jump-and-walk (Mücke, Saias and Zhu 1999, "Fast randomized point location without preprocessing
//! in two- and three-dimensional Delaunay triangulations") with a grid instead of a random sample.
//!
//! Cost: 2 ns a triangle, and a byte of memory; 2 ns a question. Not promised: that the triangle is
//! the nearest. On a panel with notches it may lie across one.

use glam::DVec2;

use crate::ids::index32;
use crate::number::{double, whole_f64};

/// Triangles for each cell. Fewer take more memory than they save steps.
const CELL_TRIANGLES: usize = 4;
/// A cell without a triangle.
const EMPTY: u32 = u32::MAX;

/// A grid with a triangle in each cell.
#[derive(Clone, Debug)]
pub(super) struct Starts {
    /// The corner of the first cell, mm.
    low: DVec2,
    /// Cells a millimetre.
    per_mm: f64,
    columns: usize,
    rows: usize,
    /// Triangles, row by row.
    cells: Vec<u32>,
}

impl Starts {
    /// The grid over a panel with these corners of its bounding box, mm.
    pub(super) fn new([low, high]: [DVec2; 2], uv: &[DVec2], triangles: &[[u32; 3]]) -> Self {
        let size = high - low;
        let wanted = double(triangles.len() / CELL_TRIANGLES + 1);
        let per_mm = (wanted / (size.x * size.y)).sqrt();
        // A panel that is all but a line has a row or a column of cells, and no more of them than
        // another panel. One without area has a single cell.
        let per_mm = per_mm.min(wanted / size.max_element());
        let per_mm = if per_mm.is_finite() { per_mm } else { 0.0 };
        let [columns, rows] = (size * per_mm).to_array().map(|n| whole_f64(n) + 1);
        let mut starts = Self { low, per_mm, columns, rows, cells: vec![EMPTY; columns * rows] };
        for (triangle, corners) in triangles.iter().enumerate() {
            let cell = starts.cell(uv[corners[0] as usize]);
            starts.cells[cell] = index32(triangle);
        }
        starts.fill();
        starts
    }

    /// A triangle near a place. Beyond the grid it is one near the grid's side.
    #[inline]
    pub(super) fn near(&self, p: DVec2) -> u32 {
        self.cells[self.cell(p)]
    }

    #[inline]
    fn cell(&self, p: DVec2) -> usize {
        // What is negative or not a number counts as the first row or column.
        let [column, row] = ((p - self.low) * self.per_mm).to_array().map(whole_f64);
        row.min(self.rows - 1) * self.columns + column.min(self.columns - 1)
    }

    /// Gives each empty cell the triangle of the cell below it, or else of the last one before it in
    /// the order of rows.
    fn fill(&mut self) {
        let mut last = 0;
        for cell in 0..self.cells.len() {
            if self.cells[cell] == EMPTY {
                let below = cell.checked_sub(self.columns).map(|below| self.cells[below]);
                self.cells[cell] = below.unwrap_or(last);
            }
            last = self.cells[cell];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corners of a square of cells in rows, each of two triangles.
    fn square(across: u32) -> (Vec<DVec2>, Vec<[u32; 3]>) {
        let uv = (0..=across)
            .flat_map(|y| (0..=across).map(move |x| DVec2::new(f64::from(x), f64::from(y))));
        let corners = (0..across).flat_map(|y| (0..across).map(move |x| y * (across + 1) + x));
        let triangles =
            corners.flat_map(|a| [[a, a + 1, a + across + 2], [a, a + across + 2, a + across + 1]]);
        (uv.collect(), triangles.collect())
    }

    #[test]
    fn the_start_lies_near() {
        let (uv, triangles) = square(40);
        let starts = Starts::new([DVec2::ZERO, DVec2::splat(40.0)], &uv, &triangles);
        for step in 0..1600_u32 {
            let p = DVec2::new(f64::from(step % 40), f64::from(step / 40)) + 0.3;
            let start = uv[triangles[starts.near(p) as usize][0] as usize];
            assert!(start.distance(p) < 3.0, "{p} starts at {start}");
        }
    }

    #[test]
    fn any_place_of_any_panel_has_a_start() {
        let line = [DVec2::ZERO, DVec2::new(9.0, 0.0), DVec2::new(4.0, 0.0)];
        let (uv, triangles) = square(3);
        for (bounds, uv, triangles) in [
            ([line[0], line[1]], line.to_vec(), vec![[0, 1, 2]; 1000]),
            ([line[0]; 2], vec![line[0]; 3], vec![[0, 1, 2]; 1000]),
            ([DVec2::ZERO, DVec2::splat(3.0)], uv, triangles),
        ] {
            let starts = Starts::new(bounds, &uv, &triangles);
            assert!(starts.cells.len() <= 1002);
            for x in [f64::NEG_INFINITY, -1e300, -1.0, 0.0, 2.5, 1e9, f64::INFINITY, f64::NAN] {
                assert!((starts.near(DVec2::new(x, 1.0)) as usize) < triangles.len());
            }
        }
    }
}
