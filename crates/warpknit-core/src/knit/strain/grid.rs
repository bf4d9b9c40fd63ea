//! The grid of strains for which repeats are solved.
//!
//! In: a [`Strain`]. Out: the eight knots around it with their weights, or for a knot its strain and
//! the knots on the way to flat cloth. The flat state is a knot, so flat cloth is met exactly.
//!
//! Cost: some nanoseconds a strain. Not promised: strains beyond the grid; these are moved along the
//! line to the flat state until they are on it.

use std::array::from_fn;

use super::Strain;

/// Stretches of the knots along courses and along wales: a tenth apart near flat cloth, where
/// clothes are, and 0.15 further out.
const STRETCHES: [f64; 9] = [0.55, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.35, 1.5];
/// Sines of the shear of the knots.
const SHEARS: [f64; 5] = [-0.4, -0.2, 0.0, 0.2, 0.4];
/// Index of flat cloth in both.
const FLAT: [usize; 3] = [4, 4, 2];
/// Knots along courses, along wales, in shear.
const SIZE: [usize; 3] = [STRETCHES.len(), STRETCHES.len(), SHEARS.len()];
/// Number of all knots.
pub(super) const KNOTS: usize = SIZE[0] * SIZE[1] * SIZE[2];

/// A place in the grid: the eight knots around it.
#[derive(Clone, Copy, Debug)]
pub(super) struct GridPlace {
    /// Interval of each axis.
    intervals: [Interval; 3],
    /// Shares of the way to the next knot of each axis.
    shares: [f64; 3],
    /// Whether the strain lies beyond the grid.
    pub(super) is_outside: bool,
}

/// The interval between two knots of an axis.
#[derive(Clone, Copy, Debug)]
struct Interval {
    /// Number of the lower knot.
    number: usize,
    from: f64,
    to: f64,
}

impl GridPlace {
    /// The place of a strain.
    pub(super) fn of(strain: Strain) -> Self {
        FLAT_PLACE.moved_to(strain)
    }

    /// The place of another strain. Each axis is walked from its interval here to that of the strain.
    #[inline]
    pub(super) fn moved_to(&self, strain: Strain) -> Self {
        let (strain, is_outside) = into_grid(strain);
        let [x, y, z] = &self.intervals;
        let intervals = [
            x.moved_to(&STRETCHES, strain.courses),
            y.moved_to(&STRETCHES, strain.wales),
            z.moved_to(&SHEARS, strain.shear),
        ];
        let [x, y, z] = &intervals;
        let shares = [x.share(strain.courses), y.share(strain.wales), z.share(strain.shear)];
        Self { intervals, shares, is_outside }
    }

    /// Whether the same knots lie around another place.
    #[inline]
    pub(super) fn has_same_knots(&self, other: &Self) -> bool {
        (0..3).all(|axis| self.intervals[axis].number == other.intervals[axis].number)
    }

    /// The knots around it. Each bit of a corner's number stands for the upper knot of an axis.
    pub(super) fn corners(&self) -> [usize; 8] {
        let low = index(self.intervals.map(|interval| interval.number));
        from_fn(|corner| {
            let strides = [(1, 1), (2, SIZE[0]), (4, SIZE[0] * SIZE[1])].into_iter();
            low + strides
                .map(|(bit, stride)| usize::from(corner & bit != 0) * stride)
                .sum::<usize>()
        })
    }

    /// The weights of the knots around it, which add up to 1.
    #[inline]
    pub(super) fn weights(&self) -> [f64; 8] {
        let [x, y, z] = self.shares.map(|share| [1.0 - share, share]);
        from_fn(|corner| x[corner & 1] * y[corner >> 1 & 1] * z[corner >> 2])
    }

    /// The knots around it with their weights.
    pub(super) fn knots(&self) -> [(usize, f64); 8] {
        let (corners, weights) = (self.corners(), self.weights());
        from_fn(|corner| (corners[corner], weights[corner]))
    }
}

/// The place of flat cloth.
const FLAT_PLACE: GridPlace = GridPlace {
    intervals: [
        Interval::at(&STRETCHES, FLAT[0]),
        Interval::at(&STRETCHES, FLAT[1]),
        Interval::at(&SHEARS, FLAT[2]),
    ],
    shares: [0.0; 3],
    is_outside: false,
};

impl Interval {
    /// An interval of a rising list.
    const fn at(values: &[f64], number: usize) -> Self {
        Self { number, from: values[number], to: values[number + 1] }
    }

    /// The interval of a rising list that holds a value: itself mostly.
    #[inline]
    fn moved_to(&self, values: &[f64], value: f64) -> Self {
        let mut number = self.number;
        while value >= values[number + 1] && number + 2 < values.len() {
            number += 1;
        }
        while value < values[number] && number > 0 {
            number -= 1;
        }
        Self::at(values, number)
    }

    /// The share of the way through it.
    #[inline]
    fn share(&self, value: f64) -> f64 {
        ((value - self.from) / (self.to - self.from)).clamp(0.0, 1.0)
    }
}

/// The strain, moved along the line to the flat state until it lies on the grid, and whether it was
/// moved.
fn into_grid(strain: Strain) -> (Strain, bool) {
    let mut share = 1.0_f64;
    for (value, flat, values) in [
        (strain.courses, 1.0, &STRETCHES[..]),
        (strain.wales, 1.0, &STRETCHES[..]),
        (strain.shear, 0.0, &SHEARS[..]),
    ] {
        let bound = if value > flat { values[values.len() - 1] } else { values[0] };
        if (value - flat).abs() > (bound - flat).abs() {
            share = share.min((bound - flat) / (value - flat));
        }
    }
    if share < 1.0 { (Strain::NONE.towards(strain, share), true) } else { (strain, false) }
}

/// The number of a knot.
fn index([x, y, z]: [usize; 3]) -> usize {
    (z * SIZE[1] + y) * SIZE[0] + x
}

/// The indices of a knot along each axis.
fn axes(knot: usize) -> [usize; 3] {
    [knot % SIZE[0], knot / SIZE[0] % SIZE[1], knot / SIZE[0] / SIZE[1]]
}

/// The knot of flat cloth.
pub(super) fn flat() -> usize {
    index(FLAT)
}

/// The strain of a knot.
pub(super) fn strain(knot: usize) -> Strain {
    let [x, y, z] = axes(knot);
    Strain { courses: STRETCHES[x], wales: STRETCHES[y], shear: SHEARS[z] }
}

/// The knots next to a knot that lie one step nearer to flat cloth, the one along its farthest axis
/// first. Flat cloth has none.
pub(super) fn inward(knot: usize) -> impl Iterator<Item = usize> {
    let at = axes(knot);
    let far: [usize; 3] = from_fn(|axis| at[axis].abs_diff(FLAT[axis]));
    // Shear comes first where it is as far, then courses: an order is needed, and any one serves.
    let mut order = [2, 0, 1];
    order.sort_by_key(|&axis| std::cmp::Reverse(far[axis]));
    order.into_iter().filter(move |&axis| far[axis] > 0).map(move |axis| {
        let mut next = at;
        next[axis] = if at[axis] > FLAT[axis] { at[axis] - 1 } else { at[axis] + 1 };
        index(next)
    })
}

/// Steps along the axes from a knot to flat cloth.
pub(super) fn level(knot: usize) -> usize {
    let at = axes(knot);
    (0..3).map(|axis| at[axis].abs_diff(FLAT[axis])).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_knot_is_met_exactly() {
        for knot in 0..KNOTS {
            let found = GridPlace::of(strain(knot)).knots();
            let own: f64 = found.iter().filter(|(at, _)| *at == knot).map(|(_, w)| w).sum();
            assert_eq!(own, 1.0, "{knot}");
        }
    }

    #[test]
    fn a_place_does_not_depend_on_the_one_before() {
        let strains = || (0..KNOTS).step_by(7).map(|knot| Strain::NONE.towards(strain(knot), 0.97));
        for from in strains() {
            for to in strains() {
                let (direct, walked) = (GridPlace::of(to), GridPlace::of(from).moved_to(to));
                assert_eq!(direct.knots(), walked.knots());
            }
        }
    }

    #[test]
    fn the_way_inward_ends_at_flat_cloth() {
        for knot in 0..KNOTS {
            let mut at = knot;
            for _ in 0..level(knot) {
                at = inward(at).next().unwrap();
            }
            assert_eq!(strain(at), Strain::NONE);
            assert!(inward(at).next().is_none());
        }
    }

    #[test]
    fn strains_beyond_the_grid_keep_their_direction() {
        let strain = Strain { courses: 2.0, wales: 0.9, shear: 0.1 };
        let (moved, is_outside) = into_grid(strain);
        assert!(is_outside);
        let expected = [1.5, 0.95, 0.05];
        for (found, expected) in [moved.courses, moved.wales, moved.shear].iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12);
        }
    }
}
