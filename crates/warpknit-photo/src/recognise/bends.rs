//! Where the places of the undisplaced cloth lie in a photo, looked up quickly.
//!
//! In: a [`DisplacementField`], which needs some hundred operations a place. Out: [`Bends`], which
//! interpolate between its values on a grid. The field changes over tens of pixels, so that a grid
//! of [`STEP`] is exact to a hundredth of a pixel. Cost: the field once a node.

use glam::DVec2;

use crate::capture::register::DisplacementField;
use crate::plane::{double, narrow, whole, whole_f64};

/// Pixels between nodes.
const STEP: f64 = 4.0;

/// Displacements on a grid over a photo.
pub(super) struct Bends {
    columns: usize,
    rows: usize,
    nodes: Vec<DVec2>,
}

impl Bends {
    /// No displacements, for a photo of that size.
    pub(super) fn none(width: usize, height: usize) -> Self {
        let [columns, rows] = nodes(width, height);
        Self { columns, rows, nodes: vec![DVec2::ZERO; columns * rows] }
    }

    /// The displacements of a photo of that size.
    pub(super) fn new(field: &DisplacementField, width: usize, height: usize) -> Self {
        let [columns, rows] = nodes(width, height);
        let nodes = (0..columns * rows)
            .map(|node| {
                let at = STEP * DVec2::new(double(node % columns), double(node / columns));
                field.displaced(at) - at
            })
            .collect();
        Self { columns, rows, nodes }
    }

    /// The pixel where a place of the undisplaced cloth is seen.
    pub(super) fn displaced(&self, at: DVec2) -> DVec2 {
        let last = DVec2::new(double(self.columns - 1), double(self.rows - 1));
        let place = (at / STEP).clamp(DVec2::ZERO, last - 1e-9);
        let [column, row] = place.to_array().map(whole_f64);
        let part = place - DVec2::new(double(column), double(row));
        let node = row * self.columns + column;
        let node = node.min(self.nodes.len() - self.columns - 2);
        let upper = self.nodes[node].lerp(self.nodes[node + 1], part.x);
        let below = node + self.columns;
        let lower = self.nodes[below].lerp(self.nodes[below + 1], part.x);
        at + upper.lerp(lower, part.y)
    }
}

/// Nodes each way on a photo of that size.
fn nodes(width: usize, height: usize) -> [usize; 2] {
    [width, height].map(|side| whole(narrow((double(side) / STEP).ceil())) + 2)
}
