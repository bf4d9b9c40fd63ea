//! Coverage masks: which of 64 places in a cell of the picture a piece of yarn covers.
//!
//! In: a piece as a capsule in the picture, and a cell. Out: a mask with a bit for each place
//! (Carpenter 1984, 'The A-buffer, an antialiased hidden surface method'). A capsule's mask is put
//! together from half planes, whose masks are looked up by direction and distance (Fiume, Fournier
//! and Rudolph 1983, 'A parallel scan conversion algorithm with anti-aliasing').
//!
//! Directions are rounded to about a degree and distances to 1/88 of a cell. Both errors average
//! out over cells. A round end is an octagon of the same area.

use std::array;

use glam::Vec2;

/// Places in a cell.
pub(super) const PLACES: usize = 64;
/// Directions of the table over half a turn. A power of two, so that an index needs no test.
const DIRECTIONS: usize = 128;
/// Distances of the table.
const DISTANCES: usize = 128;
/// Distances for each cell's width. So all of them reach from corner to corner of a cell, which
/// needs 1.42 cells.
const SCALE: f32 = 88.0;
/// Half the side of an octagon's inscribed square, that is its apothem, over the radius of the disc
/// with the same area: sqrt(pi / (8 tan(pi / 8))).
const OCTAGON: f32 = 0.973_7;
/// Length of a piece in the picture, cells, below which it has no direction and is a ball.
const SHORTEST: f32 = 1e-4;

/// The places in a cell, 0..1 across and down. Each row and column of an 8 x 8 grid has one, and so
/// has each of 64 strips across and of 64 strips down: no edge of a yarn lies along many of them.
pub(super) fn places() -> [Vec2; PLACES] {
    let part =
        |coarse: usize, fine: usize| (small(coarse) + (small(reversed(fine)) + 0.5) / 8.0) / 8.0;
    array::from_fn(|place| Vec2::new(part(place % 8, place / 8), part(place / 8, place % 8)))
}

/// The three bits of a number below 8 in reverse order.
fn reversed(bits: usize) -> usize {
    (bits & 1) << 2 | bits & 2 | bits >> 2
}

/// A number below 2^24 as a float.
fn small(number: usize) -> f32 {
    number as f32
}

/// A piece of yarn in the picture: a line segment with a round start, in cells. Its end needs no
/// round, because another piece starts there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stroke {
    start: Vec2,
    end: Vec2,
    radius: f32,
    /// 1 / length^2.
    scale: f32,
    /// The bands across and along the capsule, if it has a direction.
    bands: Option<[Band; 2]>,
}

/// All places whose distance from a line through `middle` is at most `half`.
#[derive(Clone, Copy, Debug)]
struct Band {
    row: usize,
    normal: Vec2,
    middle: Vec2,
    half: f32,
}

impl Band {
    fn new(normal: Vec2, middle: Vec2, half: f32) -> Self {
        // The table has directions that point down, that is toward larger rows.
        let down = if normal.y < 0.0 { -normal } else { normal };
        // A measure of the angle that needs no trigonometry: 1 to the right, 0 down, -1 to the left.
        let turn = down.x / (down.x.abs() + down.y);
        let row = nearest_index((1.0 - turn) * (DIRECTIONS as f32 / 2.0));
        // To the left is to the right, turned around.
        let normal = if row == DIRECTIONS { -down } else { down };
        Self { row, normal, middle, half }
    }

    /// Signed distance of its middle from a place.
    #[inline]
    fn distance(&self, place: Vec2) -> f32 {
        self.normal.dot(self.middle - place)
    }
}

/// A number in 0..=128 as the nearest integer: the lowest bits of a float whose unit in the last
/// place is 1.
#[inline]
fn nearest_index(number: f32) -> usize {
    const UNIT: f32 = 8_388_608.0;
    ((number + UNIT).to_bits() & 0xFF) as usize
}

impl Stroke {
    pub(super) fn new([start, end]: [Vec2; 2], radius: f32) -> Self {
        let length = start.distance(end);
        let bands = (length > SHORTEST).then(|| {
            let (along, middle) = ((end - start) / length, start.midpoint(end));
            [Band::new(along.perp(), middle, radius), Band::new(along, middle, length / 2.0)]
        });
        let scale = start.distance_squared(end).max(f32::MIN_POSITIVE).recip();
        Self { start, end, radius, scale, bands }
    }

    /// The corners of the box around it.
    #[inline]
    pub(super) fn extent(&self) -> (Vec2, Vec2) {
        (self.start.min(self.end) - self.radius, self.start.max(self.end) + self.radius)
    }

    /// Parameter along the axis, 0..1, of its point that is nearest to a place.
    #[inline]
    pub(super) fn share(&self, place: Vec2) -> f32 {
        ((place - self.start).dot(self.end - self.start) * self.scale).clamp(0.0, 1.0)
    }

    /// The point of the axis at a parameter.
    pub(super) fn at(&self, share: f32) -> Vec2 {
        self.start.lerp(self.end, share)
    }

    /// Unit vector across the capsule; any for a ball.
    pub(super) fn across(&self) -> Vec2 {
        (self.end - self.start).perp().normalize_or(Vec2::X)
    }
}

/// Masks of half planes.
pub(super) struct HalfPlanes(Box<[[u64; DISTANCES]; DIRECTIONS]>);

impl HalfPlanes {
    pub(super) fn new() -> Self {
        let places = places().map(|place| place - 0.5);
        let mut table = Box::new([[0; DISTANCES]; DIRECTIONS]);
        for (row, masks) in table.iter_mut().enumerate() {
            let across = 1.0 - small(row) / (DIRECTIONS as f32 / 2.0);
            let normal = Vec2::new(across, 1.0 - across.abs()).normalize();
            for (index, mask) in masks.iter_mut().enumerate() {
                let distance = (small(index) - (DISTANCES - 1) as f32 / 2.0) / SCALE;
                for (bit, place) in places.iter().enumerate() {
                    *mask |= u64::from(place.dot(normal) <= distance) << bit;
                }
            }
        }
        Self(table)
    }

    /// The places of the cell with this centre that a capsule covers, and those that one of the same
    /// axis covers whose radius is a `share` of the stroke's.
    #[inline]
    pub(super) fn masks(&self, stroke: &Stroke, share: f32, centre: Vec2) -> [u64; 2] {
        let radii = [stroke.radius, stroke.radius * share];
        let body = stroke.bands.map_or([0; 2], |[across, along]| {
            let ends = self.between(along.row, along.distance(centre), along.half);
            let middle = across.distance(centre);
            radii.map(|radius| self.between(across.row, middle, radius) & ends)
        });
        let at = stroke.start - centre;
        // Most discs of thin yarns miss most cells of their piece.
        if at.abs().max_element() > stroke.radius + 0.5 {
            return body;
        }
        [body[0] | self.disc(at, radii[0]), body[1] | self.disc(at, radii[1])]
    }

    /// Places in a disc around `at`, as seen from the cell's centre.
    #[inline]
    fn disc(&self, at: Vec2, radius: f32) -> u64 {
        let half = radius * OCTAGON;
        let diagonal = std::f32::consts::FRAC_1_SQRT_2;
        self.between(0, at.x, half)
            & self.between(DIRECTIONS / 2, at.y, half)
            & self.between(DIRECTIONS / 4, (at.x + at.y) * diagonal, half)
            & self.between(DIRECTIONS / 4 * 3, (at.y - at.x) * diagonal, half)
    }

    /// Places whose distance in a direction is within `half` of `middle`.
    #[inline]
    fn between(&self, row: usize, middle: f32, half: f32) -> u64 {
        let last = (DISTANCES - 1) as f32;
        let masks = &self.0[row % DIRECTIONS];
        let [low, high] = [middle - half, middle + half]
            .map(|at| nearest_index((at * SCALE + last / 2.0).clamp(0.0, last)) % DISTANCES);
        masks[high] & !masks[low]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_spread_over_rows_columns_and_strips() {
        for axis in 0..2 {
            let mut strips = places().map(|place| (place[axis] * 64.0).floor());
            strips.sort_by(f32::total_cmp);
            assert!(strips.iter().enumerate().all(|(index, strip)| *strip == index as f32));
        }
    }

    /// Covered places of a long or short capsule, by distance and by the table, over many cells.
    fn counts(radius: f32, length: f32) -> (f32, f32, f32) {
        let (planes, places) = (HalfPlanes::new(), places());
        let (mut exact, mut found, mut differing) = (0.0, 0.0, 0.0);
        for step in 0_u16..60 {
            let angle = f32::from(step) * 0.37;
            let start =
                Vec2::new(4.0 + f32::from(step % 7) * 0.13, 4.0 + f32::from(step % 5) * 0.19);
            let end = start + Vec2::from_angle(angle) * length;
            let strokes = [Stroke::new([start, end], radius), Stroke::new([end; 2], radius)];
            for cell in 0_u16..81 {
                let corner = Vec2::new(f32::from(cell % 9), f32::from(cell / 9));
                let [own, next] = strokes.map(|stroke| planes.masks(&stroke, 1.0, corner + 0.5)[0]);
                let mask = own | next;
                for (bit, place) in places.iter().enumerate() {
                    let at = corner + *place - start;
                    let share = (at.dot(end - start) / (length * length).max(1e-9)).clamp(0.0, 1.0);
                    let inside = (at - (end - start) * share).length() <= radius;
                    let covers = mask >> bit & 1 == 1;
                    exact += f32::from(u8::from(inside));
                    found += f32::from(u8::from(covers));
                    differing += f32::from(u8::from(inside != covers));
                }
            }
        }
        (exact, found, differing)
    }

    #[test]
    fn masks_are_those_of_capsules_within_the_tables_steps() {
        for (radius, length, share) in [
            (1.0, 3.0, 0.05),
            (1.0, 0.0, 0.08),
            (0.3, 2.0, 0.12),
            (0.06, 2.5, 0.5),
            (0.06, 0.1, 0.8),
        ] {
            let (exact, found, differing) = counts(radius, length);
            assert!((found / exact - 1.0).abs() < 0.05, "{found} of {exact} at {radius} {length}");
            assert!(differing < share * exact, "{differing} of {exact} at {radius} {length}");
        }
    }
}
