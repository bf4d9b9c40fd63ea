//! From the photo's lattice to a cell that can be laid: its sides along the wales and along the
//! courses.
//!
//! In: the lattice, and segments on it. Out: [`Upright`], a rectangular cell of some copies of the
//! lattice's, with the way from the photo's pixels to it. What the photo is turned and sheared by
//! is taken off: yarns of a weave run as its warp and weft do, and other cloth stands as the photo
//! does.

use std::f64::consts::FRAC_PI_2;

use glam::{DMat2, DVec2};

use super::lattice::Lattice;
use super::segment::Segment;

/// The longest side that is tried, in vectors of the lattice.
const REACH: i32 = 8;
/// Sides that leave a right angle by so much cost as much as a cell of twice the size, radians.
const SKEW: f64 = 0.07;
/// The same for a cell that is turned against the cloth: where its segments run two square ways,
/// and what is added where they run anyhow.
const TURN: (f64, f64) = (0.1, 1.0);
/// Copies of the lattice's cell in the rectangular one, at most.
const MOST_COPIES: f64 = 36.0;
/// Segments that run along an upright cross as far as this are a weave's; legs of loops aren't.
const SQUARE: f64 = 0.6;

/// A rectangular cell on a lattice.
#[derive(Clone, Debug)]
pub(super) struct Upright {
    /// Its lower side and its left one, in pixels of the photo: to the right and up.
    sides: DMat2,
    /// The corners of the copies of the lattice's cell in it, pixels.
    pub(super) copies: Vec<DVec2>,
}

impl Upright {
    /// The smallest cell whose sides are nearly as upright as the cloth.
    pub(super) fn of(lattice: &Lattice, segments: &[Segment]) -> Self {
        let (angle, squareness) = square_angle(segments);
        let right = DVec2::from_angle(angle);
        let up = -right.perp();
        let most_turned = TURN.0 + TURN.1 * (1.0 - squareness);
        let counts = (-REACH..=REACH)
            .flat_map(|j| (-REACH..=REACH).map(move |i| DVec2::new(f64::from(i), f64::from(j))));
        let near = |way: DVec2| -> Vec<(DVec2, f64)> {
            let turn = |count: DVec2| (count, (lattice.matrix() * count).angle_to(way));
            let near = counts.clone().filter(|count| *count != DVec2::ZERO).map(turn);
            near.filter(|(_, turn)| turn.abs() < FRAC_PI_2 / 2.0).collect()
        };
        let (across, along) = (near(right), near(up));
        let mut best = (f64::INFINITY, DMat2::IDENTITY);
        for &(a, turned_a) in &across {
            for &(b, turned_b) in &along {
                let index = a.perp_dot(b).abs();
                let (skew, turn) = (turned_a - turned_b, 0.5 * (turned_a + turned_b));
                let cost = index * (1.0 + (skew / SKEW).powi(2) + (turn / most_turned).powi(2));
                if index > 0.5 && index < MOST_COPIES + 0.5 && cost < best.0 {
                    best = (cost, DMat2::from_cols(a, b));
                }
            }
        }
        let inverse = best.1.inverse();
        let is_within = |count: &DVec2| {
            let share = inverse * *count;
            share.min_element() > -1e-9 && share.max_element() < 1.0 - 1e-9
        };
        // Counts within the cell reach as far as its sides together do.
        let all = (-2 * REACH..=2 * REACH).flat_map(|j| {
            (-2 * REACH..=2 * REACH).map(move |i| DVec2::new(f64::from(i), f64::from(j)))
        });
        Self {
            sides: lattice.matrix() * best.1,
            copies: all.filter(is_within).map(|count| lattice.matrix() * count).collect(),
        }
    }

    /// The cell's width and height, pixels: its area is kept.
    pub(super) fn size(&self) -> DVec2 {
        let width = self.sides.x_axis.length();
        DVec2::new(width, self.sides.determinant().abs() / width)
    }

    /// A place of the photo, pixels from a cell's corner, in counts of both sides.
    pub(super) fn count(&self, place: DVec2) -> DVec2 {
        self.sides.inverse() * place
    }
}

/// The angle of the cloth's upright cross in the photo, within an eighth of a turn, and how far
/// segments run along it, 0..1; of segments that run otherwise, such as legs of loops, 0 and 1:
/// such cloth stands as the photo does.
fn square_angle(segments: &[Segment]) -> (f64, f64) {
    let sum: DVec2 = segments
        .iter()
        .map(|segment| DVec2::from_angle(4.0 * segment.angle) * segment.length)
        .sum();
    let squareness = sum.length() / segments.iter().map(|segment| segment.length).sum::<f64>();
    if segments.len() > 1 && squareness > SQUARE {
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
        let upright = Upright::of(&lattice, &[segment(0.1), segment(0.1 + FRAC_PI_2)]);
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
        let upright = Upright::of(&lattice, &[segment(1.1), segment(2.04)]);
        assert!(
            upright.copies == [DVec2::ZERO]
                && (upright.size() - DVec2::new(20.0, 14.0)).length() < 1e-9,
            "{upright:?}"
        );
    }
}
