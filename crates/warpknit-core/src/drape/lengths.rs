//! How long a yarn has to be: how far a panel reaches in the yarn's strip.

use std::ops::Range;

use glam::DVec2;

use crate::garment::Panel;
use crate::ids::index32;

/// How far a panel reaches along v, wale by wale.
pub(super) struct Lengths {
    spacing: f64,
    /// Lowest and highest v over each cell of width `spacing`, from u = 0.
    cells: Vec<(f64, f64)>,
}

impl Lengths {
    /// `place` turns the panel's points so that yarns run along y, none below 0. Cost: linear in
    /// the panel's triangles and in the cells that each covers.
    pub(super) fn new(panel: &Panel, place: impl Fn(DVec2) -> DVec2, spacing: f64) -> Self {
        let mut lengths = Self { spacing, cells: Vec::new() };
        for corners in &panel.triangles {
            let corners = corners.map(|v| place(panel.uv[v as usize]));
            for i in 0..3 {
                lengths.add_edge(corners[i], corners[(i + 1) % 3]);
            }
        }
        lengths
    }

    /// Adds what an edge covers of each cell: a triangle covers no more of a cell than its edges
    /// reach there.
    fn add_edge(&mut self, p: DVec2, q: DVec2) {
        let (left, right) = if p.x <= q.x { (p, q) } else { (q, p) };
        let (first, last) = (cell(left.x, self.spacing), cell(right.x, self.spacing));
        if self.cells.len() <= last {
            self.cells.resize(last + 1, (f64::INFINITY, f64::NEG_INFINITY));
        }
        let v_at = |u: f64| {
            let share = (u - left.x) / (right.x - left.x);
            if share.is_nan() {
                left.y
            } else {
                left.y + share.clamp(0.0, 1.0) * (right.y - left.y)
            }
        };
        for (at, (bottom, top)) in self.cells[first..=last].iter_mut().enumerate() {
            let cell = f64::from(index32(first + at));
            // An upright edge lies in one cell, with all of its length.
            let ends = if first == last {
                [left.y, right.y]
            } else {
                [v_at(cell * self.spacing), v_at((cell + 1.0) * self.spacing)]
            };
            *bottom = bottom.min(ends[0]).min(ends[1]);
            *top = top.max(ends[0]).max(ends[1]);
        }
    }

    /// The v that the panel covers within a strip of u; nothing where it isn't.
    pub(super) fn along(&self, u: Range<f64>) -> Option<Range<f64>> {
        let last = cell(u.end, self.spacing).min(self.cells.len().checked_sub(1)?);
        let cells = self.cells.get(cell(u.start, self.spacing)..=last)?;
        let (low, high) = cells
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (b, t)| (l.min(*b), h.max(*t)));
        (low <= high).then_some(low..high)
    }
}

/// The cell of a coordinate, the first one for all below.
fn cell(u: f64, spacing: f64) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "`as` saturates at 0, which is what is meant"
    )]
    let cell = (u / spacing).floor() as usize;
    cell
}
