//! A cell list: which balls lie near which others in a cell that repeats in both directions.
//!
//! In: places with a radius each, and the size of the periodic cell. Out: a [`CellList`]. It gives
//! for each place all others of which the surface is within a fixed gap, images in the neighbouring
//! cells included. The periodic cell may be smaller than that. A place then meets several images of
//! the same other one.
//!
//! Method: the cell list of molecular dynamics (Allen and Tildesley 1987, "Computer Simulation of
//! Liquids"), with stored images instead of wrapped indices. Cost: linear in the places and their
//! images within reach, some nanoseconds each. Not promised: pairs at the very gap, which rounding
//! may leave out.

use glam::{DVec2, DVec3};

use crate::ids::index32;

/// Places and their images around the periodic cell, sorted by the squares of a grid.
pub(super) struct CellList {
    /// Each place moved into the cell.
    homes: Vec<Image>,
    /// All images, square after square. Their places lie in them, not behind an index: most are
    /// too far away and need no further look.
    entries: Vec<Image>,
    /// First entry of each square, and the end of the last.
    starts: Vec<u32>,
    /// Lower left corner of the grid, mm.
    low: DVec2,
    /// Largest distance of two places, and side of a square, mm.
    reach: f64,
    /// Largest distance of two surfaces, mm.
    gap: f64,
    columns: usize,
    rows: usize,
}

/// An image of a place.
#[derive(Clone, Copy, Default)]
struct Image {
    at: DVec3,
    /// By how many cells it was moved.
    shift: DVec2,
    radius: f64,
    place: u32,
}

impl CellList {
    /// Sorts all places, each with its radius, and their images within reach of the cell.
    pub(super) fn new(places: &[(DVec3, f64)], cell: DVec2, gap: f64) -> Self {
        let largest = places.iter().map(|(_, radius)| *radius).fold(0.0, f64::max);
        let reach = gap + 2.0 * largest;
        let homes = (0u32..).zip(places).map(|(place, &(at, radius))| {
            let shift = -(at.truncate() / cell).floor();
            Image { at: at + (shift * cell).extend(0.0), shift, radius, place }
        });
        // Squares are as wide as the reach, so all neighbours of a place lie in the 3 x 3 squares
        // around it. Narrower squares would need a wider ring; wider ones hold more candidates.
        let [columns, rows] =
            ((cell + 2.0 * reach) / reach).to_array().map(|squares| as_count(squares) + 1);
        let mut list = Self {
            homes: homes.collect(),
            entries: Vec::new(),
            starts: vec![0; columns * rows + 1],
            low: DVec2::splat(-reach),
            reach,
            gap,
            columns,
            rows,
        };
        let placed = list.place_images(cell);
        list.sort(placed);
        list
    }

    /// Square and image of every image within reach of the cell.
    fn place_images(&self, cell: DVec2) -> Vec<(usize, Image)> {
        let far = (self.reach / cell).ceil();
        let shifts: Vec<_> = shifts_up_to(far.x)
            .flat_map(|x| shifts_up_to(far.y).map(move |y| DVec2::new(x, y)))
            .collect();
        let mut placed = Vec::with_capacity(self.homes.len());
        for home in &self.homes {
            for &shift in &shifts {
                let at = home.at + (shift * cell).extend(0.0);
                let flat = at.truncate();
                // Images are stored in a margin around the cell. Looking up a place then needs no
                // wrapping at the borders, and a cell smaller than the reach is no special case.
                if flat.cmpge(self.low).all() && flat.cmple(cell + self.reach).all() {
                    let shift = home.shift + shift;
                    placed.push((self.square(flat), Image { at, shift, ..*home }));
                }
            }
        }
        placed
    }

    /// Fills the grid by a counting sort, which keeps the order of places within a square.
    fn sort(&mut self, placed: Vec<(usize, Image)>) {
        for (square, _) in &placed {
            self.starts[square + 1] += 1;
        }
        for square in 1..self.starts.len() {
            self.starts[square] += self.starts[square - 1];
        }
        let mut next = self.starts.clone();
        self.entries = vec![Image::default(); placed.len()];
        for (square, image) in placed {
            self.entries[next[square] as usize] = image;
            next[square] += 1;
        }
    }

    fn square(&self, at: DVec2) -> usize {
        let [column, row] = ((at - self.low) / self.reach).to_array().map(as_count);
        row.min(self.rows - 1) * self.columns + column.min(self.columns - 1)
    }

    /// Calls `visit` with everything of which the surface is within the gap of a place's, and with
    /// its image shift relative to that place, in cells.
    pub(super) fn near(&self, place: usize, mut visit: impl FnMut(usize, DVec2)) {
        let home = &self.homes[place];
        let square = self.square(home.at.truncate());
        let (column, row) = (square % self.columns, square / self.columns);
        for row in row.saturating_sub(1)..=(row + 1).min(self.rows - 1) {
            let (first, last) = (column.saturating_sub(1), (column + 1).min(self.columns - 1));
            // The three squares of a row lie side by side in memory: one run of entries.
            let entries =
                self.starts[row * self.columns + first]..self.starts[row * self.columns + last + 1];
            for other in &self.entries[entries.start as usize..entries.end as usize] {
                let reach = self.gap + home.radius + other.radius;
                if other.at.distance_squared(home.at) <= reach * reach {
                    visit(other.place as usize, other.shift - home.shift);
                }
            }
        }
    }
}

/// Whole image shifts from `-far` to `far`.
fn shifts_up_to(far: f64) -> impl Iterator<Item = f64> {
    (0..=2 * as_count(far)).map(move |step| f64::from(index32(step)) - far)
}

/// A count that was computed in floating point.
fn as_count(count: f64) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "`as` saturates, and counts are not negative"
    )]
    let count = count as usize;
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_within_the_gap_is_met_images_included() {
        // A cell narrower than the reach, and places far outside of it.
        let (cell, gap) = (DVec2::new(0.7, 2.0), 0.6);
        let places: Vec<_> = (0..40)
            .map(|i| {
                let at = DVec3::new(f64::from(i) * 0.37 - 4.0, f64::from(i * i) * 0.11 - 7.0, 0.1);
                (at, 0.05 * f64::from(i % 4))
            })
            .collect();
        let list = CellList::new(&places, cell, gap);
        for one in 0..places.len() {
            let mut met = Vec::new();
            list.near(one, |other, shift| met.push((other, shift.as_i64vec2().to_array())));
            for (other, (place, radius)) in places.iter().enumerate() {
                for (x, y) in (-40..40).flat_map(|x| (-40..40).map(move |y| (x, y))) {
                    let image = place.truncate() + DVec2::new(f64::from(x), f64::from(y)) * cell;
                    let (at, own) = places[one];
                    if image.distance(at.truncate()) < gap + own + radius {
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
