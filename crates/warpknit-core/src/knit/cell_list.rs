//! What lies near what in a cell that repeats: a grid over the cell and the images of its
//! surroundings.
//!
//! In: places and the size of the cell. Out: [`Images`], which tells for each place what lies near
//! it, images in the neighbouring cells included. The cell may be smaller than the reach: then a
//! place meets several images of the same other. Cost: linear in the places and their images within
//! reach.

use glam::{DVec2, DVec3};

use crate::ids::index32;

/// Places and their images around the cell, sorted by the square of a grid.
pub(super) struct Images {
    /// Each place moved into the cell, and by how many cells it was moved.
    homes: Vec<(DVec2, DVec2)>,
    /// Place and cells moved, square after square.
    entries: Vec<(u32, DVec2)>,
    starts: Vec<u32>,
    low: DVec2,
    reach: f64,
    columns: usize,
    rows: usize,
}

impl Images {
    /// Sorts all places, and their images within `reach` of the cell.
    pub(super) fn new(places: &[DVec3], cell: DVec2, reach: f64) -> Self {
        let home = |place: &DVec3| {
            let shift = -(place.truncate() / cell).floor();
            (place.truncate() + shift * cell, shift)
        };
        let [columns, rows] =
            ((cell + 2.0 * reach) / reach).to_array().map(|squares| whole(squares) + 1);
        let mut images = Self {
            homes: places.iter().map(home).collect(),
            entries: Vec::new(),
            starts: vec![0; columns * rows + 1],
            low: DVec2::splat(-reach),
            reach,
            columns,
            rows,
        };
        let placed = images.around_cell(cell);
        images.sort(placed);
        images
    }

    /// Square, place and cells moved of every image within reach of the cell.
    fn around_cell(&self, cell: DVec2) -> Vec<(usize, u32, DVec2)> {
        let far = (self.reach / cell).ceil();
        let turns = |far: f64| (0..=2 * whole(far)).map(move |turn| f64::from(index32(turn)) - far);
        let around: Vec<_> =
            turns(far.x).flat_map(|x| turns(far.y).map(move |y| DVec2::new(x, y))).collect();
        let mut placed = Vec::with_capacity(self.homes.len());
        for (place, &(home, shift)) in (0u32..).zip(&self.homes) {
            for &turn in &around {
                let at = home + turn * cell;
                if at.cmpge(self.low).all() && at.cmple(cell + self.reach).all() {
                    placed.push((self.square(at), place, shift + turn));
                }
            }
        }
        placed
    }

    /// Fills the grid by counting.
    fn sort(&mut self, placed: Vec<(usize, u32, DVec2)>) {
        for (square, ..) in &placed {
            self.starts[square + 1] += 1;
        }
        for square in 1..self.starts.len() {
            self.starts[square] += self.starts[square - 1];
        }
        let mut next = self.starts.clone();
        self.entries = vec![(0, DVec2::ZERO); placed.len()];
        for (square, place, shift) in placed {
            self.entries[next[square] as usize] = (place, shift);
            next[square] += 1;
        }
    }

    fn square(&self, at: DVec2) -> usize {
        let [column, row] = ((at - self.low) / self.reach).to_array().map(whole);
        row.min(self.rows - 1) * self.columns + column.min(self.columns - 1)
    }

    /// Calls `each` with everything that may lie within reach of a place, and by how many cells it
    /// is moved beside that place.
    pub(super) fn near(&self, place: usize, mut each: impl FnMut(usize, DVec2)) {
        let (at, shift) = self.homes[place];
        let square = self.square(at);
        let (column, row) = (square % self.columns, square / self.columns);
        for row in row.saturating_sub(1)..=(row + 1).min(self.rows - 1) {
            let (first, last) = (column.saturating_sub(1), (column + 1).min(self.columns - 1));
            let entries =
                self.starts[row * self.columns + first]..self.starts[row * self.columns + last + 1];
            for &(other, moved) in &self.entries[entries.start as usize..entries.end as usize] {
                each(other as usize, moved - shift);
            }
        }
    }
}

/// A count that was worked out in floating point.
fn whole(count: f64) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "`as` saturates, and counts are not negative"
    )]
    let whole = count as usize;
    whole
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_within_reach_is_met_images_included() {
        // A cell narrower than the reach, and places far outside of it.
        let (cell, reach) = (DVec2::new(0.7, 2.0), 0.9);
        let places: Vec<_> = (0..40)
            .map(|i| DVec3::new(f64::from(i) * 0.37 - 4.0, f64::from(i * i) * 0.11 - 7.0, 0.0))
            .collect();
        let images = Images::new(&places, cell, reach);
        for one in 0..places.len() {
            let mut met = Vec::new();
            images.near(one, |other, turns| met.push((other, turns.as_i64vec2().to_array())));
            for (other, place) in places.iter().enumerate() {
                for (x, y) in (-40..40).flat_map(|x| (-40..40).map(move |y| (x, y))) {
                    let image = place.truncate() + DVec2::new(f64::from(x), f64::from(y)) * cell;
                    if image.distance(places[one].truncate()) < reach {
                        let times = met
                            .iter()
                            .filter(|&&found| found == (other, [i64::from(x), i64::from(y)]))
                            .count();
                        assert_eq!(times, 1, "{one} meets {other} moved by {x}, {y}");
                    }
                }
            }
        }
    }
}
