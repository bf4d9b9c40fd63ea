//! The grid of strains for which repeats are solved.
//!
//! In: a [`Strain`]. Out: the eight knots around it with their weights, or for a knot its strain and
//! the knots on the way to flat cloth. The flat state is a knot, so flat cloth is met exactly.
//!
//! Cost: some nanoseconds a strain. Not promised: strains beyond the grid; these are moved along the
//! line to the flat state until they are on it.

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
pub(super) struct Place {
    /// The knot with the lowest index of each axis.
    low: usize,
    /// Shares of the way to the next knot of each axis.
    shares: [f64; 3],
    /// Whether the strain lies beyond the grid.
    pub(super) is_outside: bool,
}

impl Place {
    /// The place of a strain.
    pub(super) fn of(strain: Strain) -> Self {
        let (strain, is_outside) = into_grid(strain);
        let [x, y, z] = [
            interval(&STRETCHES, strain.courses),
            interval(&STRETCHES, strain.wales),
            interval(&SHEARS, strain.shear),
        ];
        Self { low: index([x.0, y.0, z.0]), shares: [x.1, y.1, z.1], is_outside }
    }

    /// The knots around it with their weights, which add up to 1.
    #[inline]
    pub(super) fn knots(&self) -> [(usize, f64); 8] {
        let [x, y, z] = self.shares;
        std::array::from_fn(|corner| {
            let mut weight = 1.0;
            let mut knot = self.low;
            for (bit, share, stride) in [(1, x, 1), (2, y, SIZE[0]), (4, z, SIZE[0] * SIZE[1])] {
                let is_high = corner & bit != 0;
                weight *= if is_high { share } else { 1.0 - share };
                knot += if is_high { stride } else { 0 };
            }
            (knot, weight)
        })
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

/// The interval of a rising list that holds a value, and the share of the way through it.
#[inline]
fn interval(values: &[f64], value: f64) -> (usize, f64) {
    let inner = &values[1..values.len() - 1];
    let low = inner.iter().map(|&knot| usize::from(value >= knot)).sum();
    let share = (value - values[low]) / (values[low + 1] - values[low]);
    (low, share.clamp(0.0, 1.0))
}

/// The number of a knot.
fn index([x, y, z]: [usize; 3]) -> usize {
    (z * SIZE[1] + y) * SIZE[0] + x
}

/// The indices of a knot along each axis.
fn axes(knot: usize) -> [usize; 3] {
    [knot % SIZE[0], knot / SIZE[0] % SIZE[1], knot / SIZE[0] / SIZE[1]]
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
    let far: [usize; 3] = std::array::from_fn(|axis| at[axis].abs_diff(FLAT[axis]));
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
            let found = Place::of(strain(knot)).knots();
            let own: f64 = found.iter().filter(|(at, _)| *at == knot).map(|(_, w)| w).sum();
            assert_eq!(own, 1.0, "{knot}");
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
