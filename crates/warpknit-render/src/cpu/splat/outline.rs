//! Rasterisation of capsules: the cells of a grid that a piece of yarn covers.
//!
//! In: both ends of a piece in the grid's coordinates (texels of the sun's map). Out: [`CapsuleOutline`],
//! that is the rows and columns whose middles the piece may cover, and a test of four places at once.

use std::ops::Range;

use glam::{Vec2, Vec4};

/// Rise of an axis, cells, below which it counts as horizontal. It limits 1 / rise, which would
/// overflow.
const MIN_RISE: f32 = 1e-3;
/// Length of an axis, cells, from which each row's columns are narrowed to the axis. For shorter
/// ones, the test of the whole bounding box is cheaper than the narrowing.
const LONG_AXIS: f32 = 5.0;
/// Share of a cell by which the cells near a piece are searched farther than it reaches.
const SLACK: f32 = 1e-3;

/// A piece of yarn as a line segment with round ends, in cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct CapsuleOutline {
    start: Vec2,
    /// From start to end.
    along: Vec2,
    /// 1 / length^2.
    scale: f32,
    radius: f32,
    /// 1 / radius^2.
    inverse2: f32,
    /// Change of the axis parameter from row to row, limited by [`MIN_RISE`]. `None` for short
    /// axes.
    rise: Option<f32>,
}

/// Places of four samples relative to an outline.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coverage {
    /// Parameter of the nearest point of the axis, 0..1.
    pub(super) share: Vec4,
    /// Squared distance from the axis, in radii.
    distance2: Vec4,
}

impl Coverage {
    /// Lanes of the samples that are covered.
    #[inline]
    pub(super) fn covered(&self) -> impl Iterator<Item = usize> + use<> {
        let mut left = self.distance2.cmple(Vec4::ONE).bitmask();
        std::iter::from_fn(move || {
            let lane = left.trailing_zeros() as usize;
            // Clears the lowest set bit.
            left &= left.wrapping_sub(1);
            (lane < 4).then_some(lane)
        })
    }

    /// Depths of the tube's surface at the four places, given the depths of the axis' ends and how
    /// far it rises toward the eye.
    #[inline]
    pub(super) fn depths(&self, [start, end]: [f32; 2], rise: f32) -> Vec4 {
        // The tube's round section: it rises toward the eye by sqrt(1 - d^2) radii at distance d
        // from the axis.
        let shares = (Vec4::ONE - self.distance2).max(Vec4::ZERO).sqrt();
        Vec4::splat(start) + self.share * (end - start) - shares * rise
    }
}

impl CapsuleOutline {
    pub(super) fn new([start, end]: [Vec2; 2], radius: f32) -> Self {
        let along = end - start;
        let scale = along.length_squared().max(f32::MIN_POSITIVE).recip();
        let rise = if along.y.abs() > MIN_RISE { along.y.recip() } else { MIN_RISE.recip() };
        let rise = (along.length_squared() > LONG_AXIS * LONG_AXIS).then_some(rise);
        Self { start, along, scale, rise, radius, inverse2: (radius * radius).recip() }
    }

    /// Those of some rows of a grid whose middles the piece may cover.
    #[inline]
    pub(super) fn rows(&self, rows: &Range<u32>) -> Range<u32> {
        let end = self.start.y + self.along.y;
        let near = cells(
            self.start.y.min(end) - self.radius,
            self.start.y.max(end) + self.radius,
            rows.end,
        );
        near.start.max(rows.start)..near.end
    }

    /// Columns of a row whose middles the piece may cover.
    #[inline]
    pub(super) fn columns(&self, row: u32, width: u32) -> Range<u32> {
        let (one, other) = match self.rise {
            Some(rise) => {
                // The part of the axis whose distance from the row is within reach. All of it,
                // where it is nearly horizontal.
                let (middle, reach) = (
                    (row as f32 + 0.5 - self.start.y) * rise,
                    ((SLACK + self.radius) * rise).abs(),
                );
                let [one, other] = [middle - reach, middle + reach]
                    .map(|at| self.start.x + self.along.x * at.clamp(0.0, 1.0));
                (one, other)
            }
            None => (self.start.x, self.start.x + self.along.x),
        };
        cells(one.min(other) - self.radius, one.max(other) + self.radius, width)
    }

    /// Coverage at four places, given as four columns and four rows.
    #[inline]
    pub(super) fn within(&self, [columns, rows]: [Vec4; 2]) -> Coverage {
        let (x, y) = (columns - self.start.x, rows - self.start.y);
        // Projection onto the axis, clamped to its ends: this makes the ends round.
        let share =
            ((x * self.along.x + y * self.along.y) * self.scale).clamp(Vec4::ZERO, Vec4::ONE);
        let (x, y) = (x - share * self.along.x, y - share * self.along.y);
        Coverage { share, distance2: (x * x + y * y) * self.inverse2 }
    }
}

/// Cells whose middles lie from `low` to `high`, in a grid of `end` cells.
#[inline]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturates, as it should"
)]
fn cells(low: f32, high: f32, end: u32) -> Range<u32> {
    // The slack covers the rounding of the ends; a cell too many costs a test.
    ((low + (0.5 - SLACK)) as u32)..end.min((high + (0.5 + SLACK)) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn within(outline: &CapsuleOutline, place: Vec2) -> Option<[f32; 2]> {
        let within = outline
            .within([Vec4::splat(place.x), Vec4::new(f32::INFINITY, place.y, place.y, f32::NAN)]);
        let covered: Vec<_> = within.covered().collect();
        assert!(covered.is_empty() || covered == [1, 2], "the others are no places: {covered:?}");
        (!covered.is_empty()).then(|| [within.share.y, -within.depths([0.0; 2], 1.0).z])
    }

    fn cells(outline: &CapsuleOutline, size: [u32; 2]) -> Vec<[u32; 2]> {
        outline
            .rows(&(0..size[1]))
            .flat_map(|y| outline.columns(y, size[0]).map(move |x| [x, y]))
            .collect()
    }

    #[test]
    fn cells_hold_all_that_is_covered_and_end_with_the_grid() {
        let outline = CapsuleOutline::new([Vec2::new(-3.0, 2.5), Vec2::new(4.2, 3.1)], 0.3);
        assert_eq!(outline.rows(&(2..9)), 2..3);
        let near = cells(&outline, [4, 9]);
        assert_eq!(near, [[0, 2]], "farther on it rises above the middle of the row");
        let diagonal =
            cells(&CapsuleOutline::new([Vec2::ZERO, Vec2::splat(900.0)], 0.4), [900, 900]).len();
        assert!((900..5000).contains(&diagonal), "{diagonal}");
        for step in 0..400_u16 {
            let outline = CapsuleOutline::new(
                [Vec2::new(3.1, 4.7), Vec2::from_angle(f32::from(step)) * 2.5 + 4.0],
                0.3 + f32::from(step) * 0.005,
            );
            let near = cells(&outline, [8, 8]);
            for cell in (0..64).map(|cell| [cell % 8, cell / 8]) {
                let middle = Vec2::new(cell[0] as f32 + 0.5, cell[1] as f32 + 0.5);
                assert!(within(&outline, middle).is_none() || near.contains(&cell), "{cell:?}");
            }
        }
        let beside =
            |x: f32| cells(&CapsuleOutline::new([Vec2::new(x, 1.5); 2], 0.3), [4, 4]).len();
        assert_eq!([-0.5, 0.5, 3.9, 4.5].map(beside), [0, 1, 0, 0]);
    }

    #[test]
    fn places_know_where_along_they_are_and_how_high_the_yarn_rises_there() {
        let outline = CapsuleOutline::new([Vec2::ZERO, Vec2::new(4.0, 0.0)], 2.0);
        let close = |found: Option<[f32; 2]>, wanted: [f32; 2]| {
            found.is_some_and(|found| (0..2).all(|i| (found[i] - wanted[i]).abs() < 1e-6))
        };
        assert!(close(within(&outline, Vec2::new(1.0, -1.0)), [0.25, 0.75_f32.sqrt()]));
        assert!(close(within(&outline, Vec2::new(5.0, 0.0)), [1.0, 0.75_f32.sqrt()]), "round ends");
        assert_eq!(within(&outline, Vec2::new(5.5, 1.5)), None);
    }
}
