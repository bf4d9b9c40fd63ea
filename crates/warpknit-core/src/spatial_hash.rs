//! Spatial hash: which of many small things in space may be near each other.
//!
//! In: things with their bounding spheres, mm. Out: a [`SpatialHash`]. It gives the things around a
//! place, or all pairs of neighbours, each once.
//!
//! Method: Teschner, Heidelberger, Müller, Pomerantes and Gross 2003, "Optimized spatial hashing
//! for collision detection of deformable objects". Things are sorted by the bucket of the cell in
//! which their middles lie. Space needs no bounds, so cloth that a simulation has blown up takes no
//! more memory than any other.
//!
//! Cost: linear in the things, 30 ns each, and 2 ns for each neighbour. The order depends on
//! nothing but the things, so sums over it are the same for any number of threads.
//!
//! Not promised: that what it gives is within reach. The caller checks distances.

use std::ops::Range;

use glam::Vec3;

use crate::ids::index32;

/// Spheres that are compared with one at a time: as many as an SSE2 register takes.
const LANES: usize = 4;

/// A bounding sphere: its middle, and its radius grown by the thing's share of the cutoff, mm.
///
/// Single precision, so that twice as many fit in the cache. The caller takes middles from a place
/// nearby and rounds radii up.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sphere {
    pub(crate) middle: Vec3,
    pub(crate) reach: f32,
}

/// A row of cells along x: the lowest 16 bits of its y and z. Rows with the same bits are too far
/// apart to be searched together.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
struct Row(u32);

impl Row {
    fn new(y: i32, z: i32) -> Self {
        Self((y.cast_unsigned() << 16) | (z.cast_unsigned() & 0xffff))
    }

    /// A row beside it.
    fn beside(self, y: i32, z: i32) -> Self {
        let y_bits = (self.0 >> 16).cast_signed().wrapping_add(y);
        Self::new(y_bits, self.0.cast_signed().wrapping_add(z))
    }

    /// Its hash. Large primes spread rows over the buckets (Teschner et al. 2003, section 3.1).
    fn hash(self) -> u32 {
        (self.0 >> 16).wrapping_mul(19_349_663) ^ (self.0 & 0xffff).wrapping_mul(83_492_791)
    }
}

/// Four spheres by coordinate: x, y and z of the middle, and the reach.
type SphereLanes = [[f32; LANES]; 4];

/// Things sorted by the cell of space in which their middles lie. A thing's place in this order is
/// its slot.
#[derive(Default)]
pub(crate) struct SpatialHash {
    /// Cells in one mm.
    per_mm: f32,
    /// First slot of each bucket, and the end of the last. The cells of a row have buckets that
    /// follow each other, so that neighbours lie side by side in memory.
    starts: Vec<u32>,
    /// The number of the thing in each slot, and its row.
    things: Vec<(u32, Row)>,
    /// The spheres of the slots, four by four.
    spheres: Vec<SphereLanes>,
}

impl SpatialHash {
    /// Sorts things anew, in memory that exists already. No two spheres that meet may have their
    /// middles further apart than `size`.
    pub(crate) fn fill(
        &mut self,
        spheres: impl ExactSizeIterator<Item = Sphere> + Clone,
        size: f32,
    ) {
        self.per_mm = 1.0 / size.max(f32::MIN_POSITIVE);
        // About one thing a bucket. Fewer buckets mix more cells in one; more cost memory and
        // cache.
        self.starts.clear();
        self.starts.resize(spheres.len().next_power_of_two() + 1, 0);
        // A counting sort: sizes of buckets, their ends by a running sum, then the things from the
        // last to the first of each bucket.
        for sphere in spheres.clone() {
            let (row, x) = self.cell(sphere.middle);
            let bucket = self.bucket(row, x);
            self.starts[bucket] += 1;
        }
        let mut sum = 0;
        for start in &mut self.starts {
            sum += *start;
            *start = sum;
        }
        self.things.resize(spheres.len(), (0, Row(0)));
        self.spheres.resize(spheres.len().div_ceil(LANES), SphereLanes::default());
        for (at, sphere) in (0..).zip(spheres) {
            let (row, x) = self.cell(sphere.middle);
            let bucket = self.bucket(row, x);
            self.starts[bucket] -= 1;
            let slot = self.starts[bucket] as usize;
            self.things[slot] = (at, row);
            let lanes = &mut self.spheres[slot / LANES];
            for (lane, value) in lanes.iter_mut().zip([
                sphere.middle.x,
                sphere.middle.y,
                sphere.middle.z,
                sphere.reach,
            ]) {
                lane[slot % LANES] = value;
            }
        }
    }

    /// The row of a place, and its cell there.
    fn cell(&self, at: Vec3) -> (Row, i32) {
        let [x, y, z] = (at * self.per_mm).to_array().map(floor);
        (Row::new(y, z), x)
    }

    /// The bucket of a cell.
    #[inline]
    fn bucket(&self, row: Row, x: i32) -> usize {
        // The number of buckets is a power of two, so a mask takes the remainder.
        let mask = index32(self.starts.len() - 2);
        (row.hash().wrapping_add(x.cast_unsigned()) & mask) as usize
    }

    /// The slots of some cells of a row, among others of the same hash: in one piece, or in two if
    /// the row runs over the last bucket.
    fn slots(&self, row: Row, [first, last]: [i32; 2]) -> [Range<usize>; 2] {
        let [first, last] = [first, last].map(|x| self.bucket(row, x));
        let slots = |from: usize, to: usize| self.starts[from] as usize..self.starts[to] as usize;
        if first <= last {
            [slots(first, last + 1), 0..0]
        } else {
            [slots(first, self.starts.len() - 1), slots(0, last + 1)]
        }
    }

    /// The sphere in a slot.
    fn sphere(&self, slot: usize) -> Sphere {
        let [x, y, z, reach] = self.spheres[slot / LANES].map(|lanes| lanes[slot % LANES]);
        Sphere { middle: Vec3::new(x, y, z), reach }
    }

    /// The numbers of all things by their slots. Neighbours are mostly near each other in it.
    pub(crate) fn order(&self) -> impl Iterator<Item = u32> {
        self.things.iter().map(|(at, _)| *at)
    }

    /// Finds the numbers of the things whose spheres meet another, which lies anywhere. Only the first
    /// `most` candidates are looked at, or a few more.
    pub(crate) fn around(&self, sphere: Sphere, most: usize, found: &mut Vec<u32>) {
        found.clear();
        let (home, x) = self.cell(sphere.middle);
        let mut left = most;
        for (y, z) in (-1..=1).flat_map(|z| (-1..=1).map(move |y| (y, z))) {
            let row = home.beside(y, z);
            for slots in self.slots(row, [x - 1, x + 1]) {
                let slots = slots.start..slots.end.min(slots.start.saturating_add(left));
                left -= slots.len();
                self.meeting(&sphere, row, slots, found);
            }
        }
        for slot in found {
            *slot = self.things[*slot as usize].0;
        }
    }

    /// Calls `meet` for each thing with those whose spheres meet its own, all by their slots. Each
    /// pair comes once, with either of the two. Of the candidates of one thing only the first
    /// `most` are looked at, or a few more.
    pub(crate) fn pairs(&self, most: usize, meet: &mut impl FnMut(usize, &[u32])) {
        let mut found = Vec::new();
        let (mut home, mut around) = (None, Vec::new());
        for slot in 0..self.things.len() {
            let sphere = self.sphere(slot);
            let cell @ (row, x) = self.cell(sphere.middle);
            if home != Some(cell) {
                home = Some(cell);
                self.ahead(row, x, &mut around);
            }
            found.clear();
            let mut left = most;
            for (row, slots) in &around {
                // Its own cell comes first, of which only the rest is looked at.
                let first =
                    if slots.contains(&slot) && *row == cell.0 { slot + 1 } else { slots.start };
                let end = slots.end.min(first.saturating_add(left));
                left -= end.saturating_sub(first);
                self.meeting(&sphere, *row, first..end, &mut found);
            }
            meet(slot, &found);
        }
    }

    /// The slots of a cell and of half of the cells around it. The other half are their opposites,
    /// so pairs of neighbouring cells come once.
    fn ahead(&self, home: Row, x: i32, around: &mut Vec<(Row, Range<usize>)>) {
        around.clear();
        let mut add = |row: Row, cells: [i32; 2]| {
            let slots = self.slots(row, cells).into_iter().filter(|slots| !slots.is_empty());
            around.extend(slots.map(|slots| (row, slots)));
        };
        add(home, [x, x + 1]);
        for (y, z) in [(1, 0), (-1, 1), (0, 1), (1, 1)] {
            add(home.beside(y, z), [x - 1, x + 1]);
        }
    }

    /// Adds the slots of a row whose spheres meet another.
    #[inline]
    fn meeting(&self, sphere: &Sphere, row: Row, slots: Range<usize>, found: &mut Vec<u32>) {
        let Sphere { middle: Vec3 { x, y, z }, reach } = *sphere;
        if slots.is_empty() {
            return;
        }
        let lanes = slots.start / LANES..slots.end.div_ceil(LANES);
        let mut first = lanes.start * LANES;
        for [xs, ys, zs, reaches] in &self.spheres[lanes] {
            let mut apart = [0.0; LANES];
            for lane in 0..LANES {
                let (x, y, z) = (xs[lane] - x, ys[lane] - y, zs[lane] - z);
                let reach = reaches[lane] + reach;
                apart[lane] = x * x + y * y + z * z - reach * reach;
            }
            // One test for four, since most are too far away.
            if apart.iter().fold(false, |any, &apart| any | (apart <= 0.0)) {
                for (slot, apart) in (first..).zip(apart) {
                    if apart <= 0.0 && slots.contains(&slot) && self.things[slot].1 == row {
                        found.push(index32(slot));
                    }
                }
            }
            first += LANES;
        }
    }
}

/// The largest integer that isn't larger. `f32::floor` is a call where the target has no
/// instruction for it.
#[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "it saturates")]
fn floor(x: f32) -> i32 {
    let whole = x as i32;
    whole.saturating_sub(i32::from(whole as f32 > x))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether two spheres meet.
    fn meet(a: &Sphere, b: &Sphere) -> bool {
        let reach = a.reach + b.reach;
        a.middle.distance_squared(b.middle) <= reach * reach
    }

    #[test]
    fn pairs_are_those_of_brute_force() {
        // Places without order, from a sequence of low discrepancy, on both sides of 0.
        let spheres: Vec<_> = (0..400_u16)
            .map(|n| {
                let place = Vec3::new(0.754_877_7, 0.569_840_3, 0.430_159_7) * f32::from(n);
                Sphere { middle: (place.fract() - 0.5) * 20.0, reach: 0.3 + f32::from(n % 7) * 0.1 }
            })
            .collect();
        let mut hash = SpatialHash::default();
        hash.fill(spheres.iter().copied(), 1.8);
        let mut found = Vec::new();
        let order: Vec<_> = hash.order().collect();
        hash.pairs(usize::MAX, &mut |a, others| {
            let a = order[a];
            let others = others.iter().map(|&b| order[b as usize]);
            found.extend(others.map(|b| (a.min(b), a.max(b))));
        });
        found.sort_unstable();
        let mut expected = Vec::new();
        for (at, a) in (0..).zip(&spheres) {
            let after = (0..).zip(&spheres).skip(at as usize + 1);
            expected.extend(after.filter(|(_, b)| meet(a, b)).map(|(other, _)| (at, other)));
        }
        assert!(expected.len() > 100);
        assert_eq!(found, expected);
        let mut around = Vec::new();
        let counts = spheres.iter().map(|sphere| {
            hash.around(*sphere, usize::MAX, &mut around);
            around.len()
        });
        assert_eq!(counts.sum::<usize>(), 2 * expected.len() + spheres.len());
    }
}
