//! From the photo's lattice to a cell that can be laid: a rectangle along the wales and the
//! courses.
//!
//! In: the lattice, and segments on it. Out: [`Upright`], a rectangular cell that holds some copies
//! of the lattice's cell, and the map from the photo's pixels to it. The turn and the shear of the
//! photo are taken off: warp and weft of a weave become the sides, and other cloth stands as it
//! does in the photo.
//!
//! Method: exhaustive search over pairs of short lattice vectors, by a cost of size, skew and turn.
//! Cost: some ten thousand pairs. Not promised: the smallest repeat of a cloth whose lattice has no
//! nearly rectangular superlattice of at most [`MAX_COPIES`] copies.

use std::f64::consts::FRAC_PI_2;

use glam::{DMat2, DVec2};

use super::lattice::Lattice;
use super::segment::Segment;

/// The longest side that is tried, in vectors of the lattice.
const MAX_SIDE: i32 = 8;
/// The skew that costs as much as a cell of twice the size, radians. Smaller, cells would grow to
/// take off shear that nobody sees; larger, courses would run aslant.
const SKEW: f64 = 0.07;
/// The turn against the cloth that costs the same, radians, where segments run in two square
/// directions.
const SQUARE_TURN: f64 = 0.1;
/// What is added to it where segments run in all directions.
const ANY_TURN: f64 = 1.0;
/// Copies of the lattice's cell in the rectangular one, at most.
const MAX_COPIES: f64 = 36.0;
/// Squareness from which on segments are those of a weave. Legs of loops have less.
const MIN_SQUARENESS: f64 = 0.6;

/// A rectangular cell on a lattice.
#[derive(Clone, Debug)]
pub(super) struct Upright {
    /// Its lower side to the right and its left side up, in pixels of the photo.
    sides: DMat2,
    /// The corners of the copies of the lattice's cell in it, pixels.
    pub(super) copies: Vec<DVec2>,
}

/// A lattice vector in counts, and its turn from a wanted direction.
type TurnedVector = (DVec2, f64);

impl Upright {
    /// The smallest cell whose sides are nearly along the cloth.
    pub(super) fn new(lattice: &Lattice, segments: &[Segment]) -> Self {
        let (angle, squareness) = square_angle(segments);
        let right = DVec2::from_angle(angle);
        let up = -right.perp();
        let max_turn = SQUARE_TURN + ANY_TURN * (1.0 - squareness);
        let (across, along) = (vectors_near(lattice, right), vectors_near(lattice, up));
        let mut best = (f64::INFINITY, DMat2::IDENTITY);
        for &(a, turned_a) in &across {
            for &(b, turned_b) in &along {
                // The determinant in counts is the number of copies in the cell.
                let index = a.perp_dot(b).abs();
                let (skew, turn) = (turned_a - turned_b, 0.5 * (turned_a + turned_b));
                let cost = index * (1.0 + (skew / SKEW).powi(2) + (turn / max_turn).powi(2));
                if index > 0.5 && index < MAX_COPIES + 0.5 && cost < best.0 {
                    best = (cost, DMat2::from_cols(a, b));
                }
            }
        }
        let inverse = best.1.inverse();
        // Counts within the cell reach as far as its sides together do.
        let copies = counts(2 * MAX_SIDE)
            .filter(|count| {
                let share = inverse * *count;
                share.min_element() > -1e-9 && share.max_element() < 1.0 - 1e-9
            })
            .map(|count| lattice.matrix() * count)
            .collect();
        Self { sides: lattice.matrix() * best.1, copies }
    }

    /// Width and height of the cell, pixels. Its area is kept.
    pub(super) fn size(&self) -> DVec2 {
        let width = self.sides.x_axis.length();
        DVec2::new(width, self.sides.determinant().abs() / width)
    }

    /// A place of the photo, pixels from a cell's corner, in counts of both sides.
    pub(super) fn count(&self, place: DVec2) -> DVec2 {
        self.sides.inverse() * place
    }
}

/// All counts of both vectors from `-reach` to `reach`, row by row.
fn counts(reach: i32) -> impl Iterator<Item = DVec2> {
    (-reach..=reach)
        .flat_map(move |j| (-reach..=reach).map(move |i| DVec2::new(f64::from(i), f64::from(j))))
}

/// Lattice vectors within an eighth of a turn of a direction.
fn vectors_near(lattice: &Lattice, direction: DVec2) -> Vec<TurnedVector> {
    counts(MAX_SIDE)
        .filter(|count| *count != DVec2::ZERO)
        .map(|count| (count, (lattice.matrix() * count).angle_to(direction)))
        .filter(|(_, turn)| turn.abs() < FRAC_PI_2 / 2.0)
        .collect()
}

/// The angle of the cloth's two square directions in the photo, within an eighth of a turn, and the
/// squareness 0..1: how far segments run along them. Where they don't, as legs of loops, the angle
/// is 0 and the squareness 1: such cloth stands as it does in the photo.
fn square_angle(segments: &[Segment]) -> (f64, f64) {
    // The mean of directions at four times the angle: warp and weft, a quarter turn apart, agree.
    let sum: DVec2 = segments
        .iter()
        .map(|segment| DVec2::from_angle(4.0 * segment.angle) * segment.length)
        .sum();
    let squareness = sum.length() / segments.iter().map(|segment| segment.length).sum::<f64>();
    if segments.len() > 1 && squareness > MIN_SQUARENESS {
        (sum.to_angle() / 4.0, squareness)
    } else {
        (0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(angle: f64) -> Segment {
        Segment::straight(DVec2::ZERO, angle, 4.0, 12.0, 1.0)
    }

    #[test]
    fn a_plain_weave_has_two_copies_and_goes_with_its_yarns() {
        let turned = |vector: DVec2| DVec2::from_angle(0.1).rotate(vector);
        let lattice =
            Lattice::reduced(turned(DVec2::new(10.0, 8.0)), turned(DVec2::new(10.0, -8.0)));
        let upright = Upright::new(&lattice, &[segment(0.1), segment(0.1 + FRAC_PI_2)]);
        assert!(
            (upright.size() - DVec2::new(20.0, 16.0)).length() < 1e-9 && upright.copies.len() == 2,
            "{upright:?}"
        );
        // Up in the cloth is up in the photo, whose y goes down.
        let up = upright.count(turned(DVec2::new(0.0, -16.0)));
        assert!((up - DVec2::Y).length() < 1e-9, "{up}");
    }

    #[test]
    fn slanting_legs_leave_the_photo_upright() {
        let lattice = Lattice::reduced(DVec2::new(20.0, 0.0), DVec2::new(0.5, 14.0));
        let upright = Upright::new(&lattice, &[segment(1.1), segment(2.04)]);
        assert!(
            upright.copies == [DVec2::ZERO]
                && (upright.size() - DVec2::new(20.0, 14.0)).length() < 1e-9,
            "{upright:?}"
        );
    }
}
