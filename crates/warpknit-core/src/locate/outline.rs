//! A coarse picture of a panel's outline. It tells at once that a place is far off the panel, or how
//! far it is from the border at least.
//!
//! In: the border edges of a panel that covers no place twice. Out: an [`Outline`].
//!
//! Method: a grid of square cells over the panel. A border edge marks each cell that it passes. Any
//! other cell lies on the panel or off it as a whole. Its middle decides: the edges to its left in
//! its row are counted, those that run down as 1 and those that run up as -1 (the border's winding
//! number). A chessboard distance transform in two passes (Rosenfeld and Pfaltz 1966, "Sequential
//! operations in digital picture processing") counts the cells from each to the nearest marked one.
//!
//! Cost: some nanoseconds a cell, of which there are about [`TRIANGLE_CELLS`] a triangle; 3 ns a
//! question. Not promised: an answer near the border, where exact predicates decide.

use glam::DVec2;

use crate::number::{double, whole_f64};

/// Cells for each triangle. Fewer leave more places near the border undecided; more take longer
/// than they save.
const TRIANGLE_CELLS: usize = 4;
/// Bounds of the number of cells. A panel of two triangles is worth looking at closely too. The cells
/// of a very fine one should stay in the cache, and take less time than they save.
const MIN_CELLS: usize = 1 << 12;
const MAX_CELLS: usize = 1 << 18;
/// Room for the rounding of a place in the grid, in cells. Grids have some thousand columns, where a
/// place is rounded by 1e-12.
const ROUNDING: f64 = 1e-6;
/// Cells between the panel's bounding box and the sides of the grid. The outermost cells are then
/// never marked.
const FRAME: f64 = 1.5;

/// What a cell tells of its places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BorderSide {
    /// All on the panel.
    On,
    /// The border passes.
    Border,
    /// All off the panel.
    Off,
}

/// A grid of cells over a panel.
#[derive(Clone, Debug)]
pub(super) struct Outline {
    /// The corner of the first cell, mm.
    low: DVec2,
    /// The side of a cell, mm.
    side: f64,
    /// Cells a millimetre.
    per_mm: f64,
    columns: usize,
    rows: usize,
    /// Chessboard distance of each cell from the border, row by row: 0 where the border passes,
    /// positive on the panel and negative off it.
    cells: Vec<i8>,
}

impl Outline {
    /// The outline of a panel of so many triangles, with these corners of its bounding box, mm. The
    /// panel lies to the left of each border edge.
    ///
    /// Nothing where a grid doesn't pay: on a panel without area, or with a border so long that it
    /// fills the grid.
    pub(super) fn new(
        [low, high]: [DVec2; 2],
        triangles: usize,
        border: &[[DVec2; 2]],
    ) -> Option<Self> {
        let size = high - low;
        let wanted = (TRIANGLE_CELLS * triangles).clamp(MIN_CELLS, MAX_CELLS);
        let side = (size.x * size.y / double(wanted)).sqrt();
        let length: f64 =
            border.iter().map(|[a, b]| (b - a).abs().element_sum() / side + 1.0).sum();
        let [columns, rows] = (size / side + 2.0 * FRAME).to_array().map(|n| whole_f64(n.ceil()));
        let pays = length <= double(wanted) && columns.saturating_mul(rows) <= 4 * wanted;
        if !pays {
            return None;
        }
        let low = low - FRAME * side;
        let cells = vec![i8::MAX; columns * rows];
        let mut outline = Self { low, side, per_mm: side.recip(), columns, rows, cells };
        let border: Vec<_> = border.iter().map(|edge| edge.map(|p| outline.place(p))).collect();
        outline.mark(&border);
        outline.spread();
        outline.tell_sides(&border);
        Some(outline)
    }

    /// Whether a place is surely off the panel.
    #[inline]
    pub(super) fn is_off(&self, p: DVec2) -> bool {
        self.cell(p) < 0
    }

    /// On which side of the border a place lies.
    pub(super) fn side(&self, p: DVec2) -> BorderSide {
        match self.cell(p) {
            0 => BorderSide::Border,
            1.. => BorderSide::On,
            _ => BorderSide::Off,
        }
    }

    /// Whether a triangle of the panel reaches a cell that the border passes. Sometimes true for
    /// one nearby that doesn't.
    pub(super) fn may_reach_border(&self, [a, b, c]: [DVec2; 3]) -> bool {
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        // Rounding keeps the order of places. So a place in the triangle's bounding box has a cell
        // between those of the box's corners.
        let cells = (self.place(high).floor() - self.place(low).floor()).max_element();
        f64::from(self.cell(low).unsigned_abs()) <= cells
    }

    /// A place on the panel is at least so far from the border, mm; 0 near the border and off the
    /// panel.
    #[inline]
    pub(super) fn room(&self, p: DVec2) -> f64 {
        (f64::from(self.cell(p)) - 1.0 - ROUNDING).max(0.0) * self.side
    }

    /// The distance of a place from the border, in cells. Beyond the grid everything is off the
    /// panel.
    #[inline]
    fn cell(&self, p: DVec2) -> i8 {
        // What is negative or not a number counts as the first cell, which is off the panel too.
        let [column, row] = self.place(p).to_array().map(whole_f64);
        if column < self.columns && row < self.rows {
            self.cells[row * self.columns + column]
        } else {
            i8::MIN
        }
    }

    /// A place in the grid, in cells.
    #[inline]
    fn place(&self, p: DVec2) -> DVec2 {
        (p - self.low) * self.per_mm
    }

    /// Marks the cells that edges pass, and those that they come within a rounding of.
    fn mark(&mut self, border: &[[DVec2; 2]]) {
        for [a, b] in border {
            let (low, high) = (a.min(*b) - ROUNDING, a.max(*b) + ROUNDING);
            for row in whole_f64(low.y)..=whole_f64(high.y) {
                // The part of the edge in this row.
                let [bottom, top] = [double(row) - ROUNDING, double(row + 1) + ROUNDING]
                    .map(|y| a.lerp(*b, ((y - a.y) / (b.y - a.y)).clamp(0.0, 1.0)).x);
                let first = whole_f64(bottom.min(top) - ROUNDING);
                let last = whole_f64(bottom.max(top) + ROUNDING);
                let row = row * self.columns;
                self.cells[row + first..=row + last].fill(0);
            }
        }
    }

    /// Counts the cells from each to the nearest marked one. The grid's own sides are left out: the
    /// frame keeps all places of which the distance is asked away from them.
    fn spread(&mut self) {
        let columns = self.columns;
        for row in 1..self.rows {
            let (before, own) = self.cells.split_at_mut(row * columns);
            let own = &mut own[..columns];
            near_row(&before[(row - 1) * columns..], own);
            let mut last = i8::MAX;
            own.iter_mut().for_each(|cell| one_on(&mut last, cell));
        }
        for row in (1..self.rows).rev() {
            let (own, after) = self.cells.split_at_mut(row * columns);
            let own = &mut own[(row - 1) * columns..];
            near_row(&after[..columns], own);
            let mut last = i8::MAX;
            own.iter_mut().rev().for_each(|cell| one_on(&mut last, cell));
        }
    }

    /// Makes the distances of cells off the panel negative.
    fn tell_sides(&mut self, border: &[[DVec2; 2]]) {
        // How the winding number changes from the cell before to this one.
        let mut turns = vec![0_i32; self.cells.len()];
        for [a, b] in border {
            let down = if b.y < a.y { 1 } else { -1 };
            let [first, end] = [a.y.min(b.y), a.y.max(b.y)].map(|y| whole_f64((y - 0.5).ceil()));
            for row in first..end {
                let share = (double(row) + 0.5 - a.y) / (b.y - a.y);
                let column = whole_f64((a.lerp(*b, share).x - 0.5).ceil());
                turns[row * self.columns + column] += down;
            }
        }
        let rows = self.cells.chunks_exact_mut(self.columns);
        for (cells, turns) in rows.zip(turns.chunks_exact(self.columns)) {
            let mut winding = 0;
            for (cell, turn) in cells.iter_mut().zip(turns) {
                winding += turn;
                if winding <= 0 {
                    *cell = -*cell;
                }
            }
        }
    }
}

/// Lowers distances in a row to one more than those of the three cells of the row beside it. There
/// is no branch and no wait for the cell before, so that it is done for many cells at a time.
fn near_row(beside: &[i8], own: &mut [i8]) {
    let inner = own.len() - 1;
    for (own, beside) in own[1..inner].iter_mut().zip(beside.array_windows()) {
        let [left, middle, right]: [i8; 3] = *beside;
        *own = (*own).min(left.min(middle).min(right).saturating_add(1));
    }
}

/// Lowers a distance to one more than the last, and makes it the last.
fn one_on(last: &mut i8, cell: &mut i8) {
    *last = (*cell).min(last.saturating_add(1));
    *cell = *last;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The border of a ring: a square with a square hole, turned a little.
    fn ring() -> Vec<[DVec2; 2]> {
        let square = |half: f64, turn: f64| {
            let corner = move |k: u8| {
                DVec2::from_angle(0.3 + turn * f64::from(k) * std::f64::consts::FRAC_PI_2) * half
            };
            (0..4).map(move |k| [corner(k), corner(k + 1)])
        };
        square(50.0, 1.0).chain(square(20.0, -1.0)).collect()
    }

    fn distance(p: DVec2, [a, b]: [DVec2; 2]) -> f64 {
        let share = (p - a).dot(b - a) / (b - a).length_squared();
        p.distance(a.lerp(b, share.clamp(0.0, 1.0)))
    }

    #[test]
    fn a_ring_is_on_and_off_where_it_should_be_and_has_no_more_room_than_there_is() {
        let border = ring();
        let bounds = [DVec2::splat(-50.0), DVec2::splat(50.0)];
        let outline = Outline::new(bounds, 2000, &border).unwrap();
        let (mut off, mut with_room) = (0, 0);
        for step in 0..40_000_u32 {
            let p = DVec2::new(f64::from(step % 200), f64::from(step / 200)) * 0.7 - 70.0;
            let nearest = border.iter().map(|&edge| distance(p, edge)).fold(f64::MAX, f64::min);
            // To the left of all edges of the outer square, and of one of the hole's.
            let left = |[a, b]: &[DVec2; 2]| (b - a).perp_dot(p - a) > 0.0;
            let is_on = border[..4].iter().all(left) && border[4..].iter().any(left);
            if outline.is_off(p) {
                assert!(!is_on, "{p}");
                off += 1;
            }
            let room = outline.room(p);
            assert!(room == 0.0 || is_on && room <= nearest, "{p}: {room} of {nearest}");
            with_room += u32::from(room > 0.0);
        }
        assert!(off > 20_000 && with_room > 4000, "{off} off, {with_room} with room");
        let beyond =
            [f64::MAX, f64::NEG_INFINITY, f64::NAN].map(|x| outline.is_off(DVec2::splat(x)));
        assert_eq!(beyond, [true; 3]);
    }

    #[test]
    fn triangles_that_hold_places_at_the_border_are_told_from_those_far_within() {
        let bounds = [DVec2::splat(-50.0), DVec2::splat(50.0)];
        // Without its hole, some places are more cells from the border than a cell can tell.
        for (triangles, border) in [(2000, ring()), (250_000, ring()[..4].to_vec())] {
            let outline = Outline::new(bounds, triangles, &border).unwrap();
            let (mut reach, mut within) = (0, 0);
            for step in 0..10_000_u32 {
                let p = DVec2::new(f64::from(step % 100), f64::from(step / 100)) - 49.5;
                let corners = [p, p + DVec2::new(0.9, 0.2), p + DVec2::new(-0.3, 0.7)];
                let may_reach = outline.may_reach_border(corners);
                let places =
                    [corners[0], corners[1], corners[2], corners.iter().sum::<DVec2>() / 3.0];
                let holds_border = places.iter().any(|&p| outline.side(p) == BorderSide::Border);
                assert!(may_reach || !holds_border, "{p}");
                reach += u32::from(may_reach);
                within += u32::from(!may_reach && outline.side(p) == BorderSide::On);
            }
            assert!(reach > 300 && within > 3000, "{reach} reach it, {within} lie within");
        }
    }

    #[test]
    fn a_grid_that_does_not_pay_is_not_made() {
        let flat = [DVec2::ZERO, DVec2::new(100.0, 0.0)];
        assert!(Outline::new(flat, 2, &[flat]).is_none());
        let comb =
            (0..8000).map(|x| [DVec2::new(f64::from(x), 0.0), DVec2::new(f64::from(x), 8e3)]);
        let bounds = [DVec2::ZERO, DVec2::splat(8e3)];
        assert!(Outline::new(bounds, 8000, &comb.collect::<Vec<_>>()).is_none());
    }
}
