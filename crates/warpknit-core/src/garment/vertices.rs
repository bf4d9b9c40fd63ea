//! The vertices of the cloth: pairs of a flat vertex and a draped position.
//!
//! In: [`Pairs`]. Out: the vertices of each triangle ([`Vertices`]).
//!
//! A flat vertex isn't enough: the left and the right sleeve often share their `vt`, one mirrored
//! onto the other, while their `v` are at different places on the body. Nor is a draped one, since
//! seams are sewn there. Copies of a draped vertex in an unwelded export are one position, even if
//! rounding has put them a little apart.
//!
//! Cost: linear. Where each flat vertex has one draped vertex, as in most files, nothing is
//! searched.

use std::collections::HashMap;
use std::sync::Arc;

use glam::DVec3;

use super::pair::Pairs;
use crate::ids::index32;

/// Marks a flat vertex without a draped one so far.
const UNSEEN: u32 = u32::MAX;

/// The vertices of each pair's triangle.
#[derive(Debug)]
pub(super) struct Vertices {
    pub(super) triangles: Arc<Vec<[u32; 3]>>,
    /// All vertices are below this number.
    pub(super) count: usize,
}

impl Vertices {
    /// Numbers the vertices. The first place of a flat vertex has the flat vertex's number.
    pub(super) fn new(pairs: &Pairs) -> Self {
        let (flat, draped) = (&pairs.flat_triangles, &pairs.draped_triangles);
        let count = pairs.flat.len();
        if Arc::ptr_eq(flat, draped) || flat == draped {
            return Self { triangles: Arc::clone(flat), count };
        }
        let mut first = vec![UNSEEN; count];
        let corners = flat.as_flattened().iter().zip(draped.as_flattened());
        for (&flat, &draped) in corners.clone() {
            if first[flat as usize] == UNSEEN {
                first[flat as usize] = draped;
            }
        }
        if corners.clone().all(|(&flat, &draped)| first[flat as usize] == draped) {
            return Self { triangles: Arc::clone(flat), count };
        }
        Self::by_place(pairs, &first)
    }

    /// Numbers the vertices by their places. `first` is the first draped vertex of each flat one.
    fn by_place(pairs: &Pairs, first: &[u32]) -> Self {
        let same_place = pairs.same_place();
        let mut others: HashMap<u32, DrapedPlaces> = HashMap::new();
        let mut count = index32(pairs.flat.len());
        let mut vertex = |flat: u32, draped: u32| {
            let known = first[flat as usize];
            let [known, place] = [known, draped].map(|vertex| pairs.draped[vertex as usize]);
            if known.distance(place) <= same_place {
                return flat;
            }
            let places = others.entry(flat).or_default();
            places.find(place, same_place).unwrap_or_else(|| {
                places.add(place, count, same_place);
                count += 1;
                count - 1
            })
        };
        let corners = pairs.flat_triangles.iter().zip(pairs.draped_triangles.iter());
        let triangles = corners
            .map(|(flat, draped)| std::array::from_fn(|i| vertex(flat[i], draped[i])))
            .collect();
        Self { triangles: Arc::new(triangles), count: count as usize }
    }
}

/// Number of positions up to which all are searched in turn. Nearly every flat vertex has one or
/// two, for which a hash map would cost more than it saves. Beyond some tens the search would take
/// quadratic time.
const FEW: usize = 16;

/// The draped positions of a flat vertex, each with its number. A vertex of a pattern has one or
/// two; one of an image tiled over a mesh has thousands. Method: a list, and beyond [`FEW`]
/// positions a cell list (uniform grid, hashed).
#[derive(Debug, Default)]
struct DrapedPlaces {
    /// All positions, as long as they are few.
    few: Vec<(DVec3, u32)>,
    /// All positions, once they are many, by cell.
    cells: HashMap<[i64; 3], Vec<(DVec3, u32)>>,
}

impl DrapedPlaces {
    /// The smallest number of a position at most `same_place` from `draped`.
    fn find(&self, draped: DVec3, same_place: f64) -> Option<u32> {
        let is_same = |&&(place, _): &&(DVec3, u32)| place.distance(draped) <= same_place;
        if self.cells.is_empty() {
            return self.few.iter().find(is_same).map(|&(_, number)| number);
        }
        // A cell is wider than the tolerance, so a match lies in the cell itself or in one of its
        // 26 neighbours.
        let center = cell(draped, same_place);
        let mut found: Option<u32> = None;
        for index in 0..27 {
            let shift = [index % 3 - 1, index / 3 % 3 - 1, index / 9 - 1];
            let neighbour = std::array::from_fn(|axis| center[axis].saturating_add(shift[axis]));
            let places = self.cells.get(&neighbour).into_iter().flatten();
            // The smallest number, as the list gives it: the result must not depend on the cells.
            found =
                found.into_iter().chain(places.filter(is_same).map(|&(_, number)| number)).min();
        }
        found
    }

    /// Adds a position with its number, which is larger than all before.
    fn add(&mut self, draped: DVec3, number: u32, same_place: f64) {
        if self.cells.is_empty() && self.few.len() < FEW {
            self.few.push((draped, number));
            return;
        }
        for (draped, number) in self.few.drain(..).chain([(draped, number)]) {
            self.cells.entry(cell(draped, same_place)).or_default().push((draped, number));
        }
    }
}

/// The cell of a position. Cells are twice as wide as the tolerance, so that rounding can't put
/// equal positions two cells apart. Where the garment has no extent, all positions are in one cell.
fn cell(draped: DVec3, same_place: f64) -> [i64; 3] {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "some million cells across, by the definition of `same_place`; `as` saturates"
    )]
    let cell = (draped / (2.0 * same_place)).to_array().map(|at| at.floor() as i64);
    cell
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_places_are_found_as_few_are() {
        let mut places = DrapedPlaces::default();
        let mut all: Vec<(DVec3, u32)> = Vec::new();
        let mut state = 7_u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / f64::from(1 << 24)
        };
        let same_place = 0.01;
        for _ in 0..2000 {
            // Some on cells' borders.
            let point = DVec3::new(random(), (random() * 50.0).round() / 50.0, 0.1 * random());
            let first = all
                .iter()
                .find(|(place, _)| place.distance(point) <= same_place)
                .map(|(_, number)| *number);
            assert_eq!(places.find(point, same_place), first, "{point}");
            if first.is_none() {
                let number = index32(all.len());
                places.add(point, number, same_place);
                all.push((point, number));
            }
        }
        assert!(all.len() > 10 * FEW && places.few.is_empty());
        // Nothing that has an extent.
        let mut point = DrapedPlaces::default();
        (0..40).for_each(|number| point.add(DVec3::ONE, number, 0.0));
        assert_eq!(point.find(DVec3::ONE, 0.0), Some(0));
    }
}
