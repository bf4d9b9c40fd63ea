//! The length of each yarn: how far a panel extends within the yarn's strip.
//!
//! In: a [`Panel`] and the spacing of the yarns. Out: for each strip the range that the panel
//! covers along it. Method: the edges of all triangles are rasterised into strips, and each strip
//! keeps its lowest and highest coordinate. So a concave panel gets a range for each strip, which
//! is shorter than its bounding box. Not promised: gaps within a strip, such as holes, are not left
//! out.

use std::ops::Range;

use glam::DVec2;

use crate::garment::Panel;
use crate::ids::index32;

/// The extent of a panel along v, strip by strip.
pub(super) struct Lengths {
    spacing: f64,
    /// Lowest and highest v in each strip of width `spacing`, from u = 0.
    cells: Vec<(f64, f64)>,
}

impl Lengths {
    /// Rasterises a panel. `place` maps its points so that yarns run along y, with no coordinate
    /// below 0. Cost: linear in the panel's triangles and in the strips that each covers.
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

    /// Adds the range that an edge covers in each strip. Edges are enough: a triangle is convex, so
    /// within a strip its extremes lie on its edges.
    fn add_edge(&mut self, p: DVec2, q: DVec2) {
        let (left, right) = if p.x <= q.x { (p, q) } else { (q, p) };
        let (first, last) = (cell(left.x, self.spacing), cell(right.x, self.spacing));
        if self.cells.len() <= last {
            self.cells.resize(last + 1, (f64::INFINITY, f64::NEG_INFINITY));
        }
        for (at, (bottom, top)) in self.cells[first..=last].iter_mut().enumerate() {
            let cell = f64::from(index32(first + at));
            // Within a single strip the whole edge counts. This includes upright edges, which have
            // no height at a given u.
            let ends = if first == last {
                [left.y, right.y]
            } else {
                [
                    height_at(cell * self.spacing, left, right),
                    height_at((cell + 1.0) * self.spacing, left, right),
                ]
            };
            *bottom = bottom.min(ends[0]).min(ends[1]);
            *top = top.max(ends[0]).max(ends[1]);
        }
    }

    /// The range of v that the panel covers within a range of u, or nothing outside the panel.
    pub(super) fn along(&self, u: Range<f64>) -> Option<Range<f64>> {
        let last = cell(u.end, self.spacing).min(self.cells.len().checked_sub(1)?);
        let cells = self.cells.get(cell(u.start, self.spacing)..=last)?;
        let (low, high) = cells
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (b, t)| (l.min(*b), h.max(*t)));
        (low <= high).then_some(low..high)
    }
}

/// The v of an edge at `u`, clamped to the edge's ends.
fn height_at(u: f64, left: DVec2, right: DVec2) -> f64 {
    let t = (u - left.x) / (right.x - left.x);
    if t.is_nan() { left.y } else { left.y + t.clamp(0.0, 1.0) * (right.y - left.y) }
}

/// The strip of a coordinate. Coordinates below 0 are in the first strip.
fn cell(u: f64, spacing: f64) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "`as` saturates at 0, which is what is meant"
    )]
    let cell = (u / spacing).floor() as usize;
    cell
}
