//! A symmetric matrix by its profile, and its Cholesky factors.
//!
//! In: a graph of points that share residuals. Out: [`Profile`], a symmetric positive definite
//! matrix of 3 x 3 blocks, which is filled, factored and solved in place.
//!
//! Method: each row is stored from its first entry to the diagonal (the profile of Jennings 1966,
//! "A compact storage scheme for the solution of symmetric linear simultaneous equations"). Points
//! are numbered by the reverse of Cuthill and McKee's order (1969, "Reducing the bandwidth of sparse
//! symmetric matrices"), which keeps rows short. Cholesky factors fill the same profile. The three rows of a point are
//! factored together.
//!
//! Cost: rows times the square of their length, about a nanosecond for four products. Not promised: short rows in
//! cloth whose repeat is wide and long.

use std::rc::Rc;

use glam::DVec3;
use wide::f64x2;

use crate::ids::index32;

/// Products that are summed side by side, so that the compiler vectorises them.
const LANES: usize = 8;
/// The same for nine pairs of rows at once: nine sums of two fit the 16 vector registers of x86-64. Left to itself the
/// compiler groups other sums and shuffles them.
const PAIR: usize = 2;

/// Where the entries of a matrix stand.
#[derive(Debug, Default)]
pub(super) struct ProfileLayout {
    /// First row of each point.
    rows: Vec<u32>,
    /// The point whose rows stand at each place: the inverse of `rows`.
    order: Vec<u32>,
    /// First column of each row.
    first: Vec<u32>,
    /// Place in the entries at which column 0 of each row would stand.
    origin: Vec<isize>,
    /// Number of entries.
    len: usize,
}

impl ProfileLayout {
    /// For points with these neighbours, in both directions.
    pub(super) fn new(neighbours: &[Vec<u32>]) -> Self {
        let order = reverse_cuthill_mckee(neighbours);
        let mut rows = vec![0; order.len()];
        for (place, &point) in (0u32..).zip(&order) {
            rows[point as usize] = 3 * place;
        }
        let mut layout = Self { rows, order, ..Self::default() };
        let mut len = 0;
        for (place, &point) in (0u32..).zip(&layout.order) {
            let nearest =
                neighbours[point as usize].iter().map(|&other| layout.rows[other as usize]);
            let first = nearest.min().unwrap_or(3 * place).min(3 * place);
            for row in 3 * place..3 * place + 3 {
                layout.first.push(first);
                layout.origin.push(len - first as isize);
                len += (row - first + 1) as isize;
            }
        }
        layout.len = len.unsigned_abs();
        layout
    }

    /// Number of points.
    pub(super) fn points(&self) -> usize {
        self.rows.len()
    }

    fn at(&self, row: usize, column: usize) -> usize {
        place(self.origin[row], column)
    }
}

/// The matrix of normal equations.
#[derive(Clone, Debug, Default)]
pub(super) struct Profile {
    layout: Rc<ProfileLayout>,
    values: Vec<f64>,
}

impl Profile {
    /// Makes it an empty matrix of this layout.
    pub(super) fn reset(&mut self, layout: &Rc<ProfileLayout>) {
        self.layout = Rc::clone(layout);
        self.values.clear();
        self.values.resize(layout.len, 0.0);
    }

    /// Adds the products of a residual's gradient with itself: `entries` are points and derivatives
    /// by their places.
    pub(super) fn add_product(&mut self, entries: &[(u32, DVec3)]) {
        for &(one, a) in entries {
            let row = self.layout.rows[one as usize] as usize;
            // Each row of a point is longer by one than the row before it.
            let length = row - self.layout.first[row] as usize + 1;
            for &(other, b) in entries {
                let column = self.layout.rows[other as usize] as usize;
                if column > row {
                    continue;
                }
                let at = self.layout.at(row, column);
                let block = &mut self.values[at..];
                let b = b.to_array();
                for (i, (a, start)) in
                    a.to_array().into_iter().zip([0, length, 2 * length + 1]).enumerate()
                {
                    // Above the diagonal of a block on it, the entry of the other side counts.
                    let width = if column == row { i + 1 } else { 3 };
                    for (value, b) in block[start..start + width].iter_mut().zip(b) {
                        *value += a * b;
                    }
                }
            }
        }
    }

    /// Scales the diagonal and adds a constant to it.
    pub(super) fn damp(&mut self, factor: f64, constant: f64) {
        for row in 0..self.layout.first.len() {
            let at = self.layout.at(row, row);
            self.values[at] = self.values[at] * factor + constant;
        }
    }

    /// The largest entry of the diagonal.
    pub(super) fn largest(&self) -> f64 {
        (0..self.layout.first.len())
            .map(|row| self.values[self.layout.at(row, row)])
            .fold(0.0, f64::max)
    }

    /// Becomes a copy of another matrix, in place.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.layout = Rc::clone(&other.layout);
        self.values.clone_from(&other.values);
    }

    /// Replaces the matrix by its Cholesky factor. False where it is not positive definite.
    ///
    /// The three rows of a point begin in the same column, so they are taken together: nine products of rows then
    /// read six rows, where one at a time reads eighteen.
    pub(super) fn factor(&mut self) -> bool {
        for row in (0..self.layout.first.len()).step_by(3) {
            let start = self.layout.first[row] as usize;
            let (above, own) = self.values.split_at_mut(place(self.layout.origin[row], start));
            let (own, width) = (&mut own[..3 * (row - start) + 6], row - start);
            let (one, rest) = own.split_at_mut(width + 1);
            let (two, three) = rest.split_at_mut(width + 2);
            for column in (start..row).step_by(3) {
                let shared = start.max(self.layout.first[column] as usize);
                let others = [0, 1, 2].map(|line| {
                    let at = place(self.layout.origin[column + line], shared);
                    &above[at..=at + column + line - shared]
                });
                let (from, to) = (shared - start, column - start);
                let own = [&one[from..to], &two[from..to], &three[from..to]];
                let sums = products(own, others.map(|other| &other[..to - from]));
                let corner = others.map(|other| &other[to - from..]);
                for (line, sums) in [&mut *one, two, three].into_iter().zip(sums) {
                    solve_corner(&mut line[to..to + 3], sums, corner);
                }
            }
            let own = [&one[..width], &two[..width], &three[..width]];
            let sums = products(own, own);
            if !factor_corner([&mut one[width..], &mut two[width..], &mut three[width..]], sums) {
                return false;
            }
        }
        true
    }

    /// Solves for a right side by point, after [`Self::factor`].
    pub(super) fn solve(&self, right: &[DVec3]) -> Vec<DVec3> {
        let mut x: Vec<f64> =
            self.layout.order.iter().flat_map(|&point| right[point as usize].to_array()).collect();
        for row in 0..x.len() {
            let start = self.layout.first[row] as usize;
            let factors = &self.values[self.layout.at(row, start)..self.layout.at(row, row)];
            x[row] =
                (x[row] - dot(factors, &x[start..row])) / self.values[self.layout.at(row, row)];
        }
        for row in (0..x.len()).rev() {
            let start = self.layout.first[row] as usize;
            x[row] /= self.values[self.layout.at(row, row)];
            let (above, own) = x.split_at_mut(row);
            let factors = &self.values[self.layout.at(row, start)..self.layout.at(row, row)];
            for (value, factor) in above[start..].iter_mut().zip(factors) {
                *value -= factor * own[0];
            }
        }
        self.layout
            .rows
            .iter()
            .map(|&row| DVec3::from_slice(&x[row as usize..row as usize + 3]))
            .collect()
    }
}

/// The place of a column in a row that would begin at an origin.
fn place(origin: isize, column: usize) -> usize {
    origin.wrapping_add_unsigned(column).unsigned_abs()
}

/// The scalar products of three rows with three others, all of one length.
#[inline]
fn products(own: [&[f64]; 3], others: [&[f64]; 3]) -> [[f64; 3]; 3] {
    let (own, own_last) = chunks(own);
    let (others, others_last) = chunks(others);
    let count = own[0].len();
    let [own, others] = [own, others].map(|rows| rows.map(|row| &row[..count]));
    let mut sums = [[f64x2::ZERO; 3]; 3];
    for at in 0..count {
        let [own, others] = [own, others].map(|rows| rows.map(|row| f64x2::new(row[at])));
        for (sums, own) in sums.iter_mut().zip(own) {
            for (sum, other) in sums.iter_mut().zip(others) {
                *sum += own * other;
            }
        }
    }
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let last: f64 = own_last[i].iter().zip(others_last[j]).map(|(a, b)| a * b).sum();
            sums[i][j].reduce_add() + last
        })
    })
}

/// Three rows in pairs, and what is left of each.
fn chunks(rows: [&[f64]; 3]) -> ([&[[f64; PAIR]]; 3], [&[f64]; 3]) {
    let rows = rows.map(<[f64]>::as_chunks);
    (rows.map(|(pairs, _)| pairs), rows.map(|(_, last)| last))
}

/// Three entries of a row of the factor, from the matrix's, the products before them, and the lower triangle on the
/// diagonal of their columns.
#[inline]
fn solve_corner(entries: &mut [f64], sums: [f64; 3], corner: [&[f64]; 3]) {
    for column in 0..3 {
        let known: f64 = (0..column).map(|before| entries[before] * corner[column][before]).sum();
        entries[column] = (entries[column] - sums[column] - known) / corner[column][column];
    }
}

/// The lower triangle of the factor on the diagonal. False where it is not positive definite.
fn factor_corner(corner: [&mut [f64]; 3], sums: [[f64; 3]; 3]) -> bool {
    for row in 0..3 {
        for column in 0..=row {
            let known: f64 =
                (0..column).map(|before| corner[row][before] * corner[column][before]).sum();
            let rest = corner[row][column] - sums[row][column] - known;
            if column < row {
                corner[row][column] = rest / corner[column][column];
            } else if rest > 0.0 {
                corner[row][row] = rest.sqrt();
            } else {
                return false;
            }
        }
    }
    true
}

/// The scalar product of two rows.
#[inline]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, last_a) = a.as_chunks::<LANES>();
    let (b, last_b) = b.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (a, b) in a.iter().zip(b) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let last: f64 = last_a.iter().zip(last_b).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + last
}

/// Points in the reverse of Cuthill and McKee's order.
fn reverse_cuthill_mckee(neighbours: &[Vec<u32>]) -> Vec<u32> {
    let mut order: Vec<u32> = Vec::with_capacity(neighbours.len());
    let mut is_placed = vec![false; neighbours.len()];
    let by_degree = |point: &u32| (neighbours[*point as usize].len(), *point);
    let mut starts: Vec<u32> = (0..index32(neighbours.len())).collect();
    starts.sort_by_key(by_degree);
    for start in starts {
        if std::mem::replace(&mut is_placed[start as usize], true) {
            continue;
        }
        let mut next = order.len();
        order.push(start);
        while let Some(&point) = order.get(next) {
            next += 1;
            let free = neighbours[point as usize].iter().copied();
            let mut free: Vec<_> = free
                .filter(|&other| !std::mem::replace(&mut is_placed[other as usize], true))
                .collect();
            free.sort_by_key(by_degree);
            order.append(&mut free);
        }
    }
    order.reverse();
    order
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    /// Solves for known places of `count` points, of which some pairs share a residual.
    fn solves(count: u32, pairs: &[(u32, u32)]) {
        let mut neighbours = vec![Vec::new(); count as usize];
        for &(one, other) in pairs.iter().filter(|(one, other)| one != other) {
            neighbours[one as usize].push(other);
            neighbours[other as usize].push(one);
        }
        let mut matrix = Profile::default();
        matrix.reset(&Rc::new(ProfileLayout::new(&neighbours)));
        let gradients: Vec<_> = (0u32..)
            .zip(pairs)
            .map(|(at, &(one, other))| {
                let turn = f64::from(at);
                let gradient = DVec3::new(turn.sin(), turn.cos(), 0.3 * (turn % 7.0));
                [(one, gradient), (other, DVec3::new(-gradient.z, 0.4, gradient.y))]
            })
            .collect();
        gradients.iter().for_each(|entries| matrix.add_product(entries));
        matrix.damp(1.0, 0.5);
        let wanted: Vec<_> = (0..count).map(|at| DVec3::new(1.0, f64::from(at), -2.0)).collect();
        // The product of the matrix with the wanted solution, residual by residual.
        let mut right: Vec<_> = wanted.iter().map(|&place| 0.5 * place).collect();
        for entries in &gradients {
            let along: f64 = entries.iter().map(|(at, g)| g.dot(wanted[*at as usize])).sum();
            for (at, gradient) in entries {
                right[*at as usize] += *gradient * along;
            }
        }
        assert!(matrix.factor());
        for (found, wanted) in matrix.solve(&right).iter().zip(&wanted) {
            assert!(found.distance(*wanted) < 1e-9, "{found} {wanted}");
        }
    }

    #[test]
    fn a_solution_gives_back_the_right_side_around_a_ring() {
        let ring: Vec<_> = (0..9).map(|at| (at, (at + 1) % 9)).collect();
        solves(9, &ring);
    }

    proptest! {
        /// Random graphs, whose rows begin before and behind those of their neighbours.
        #[test]
        fn a_solution_gives_back_the_right_side(
            count in 2..20u32, pairs in vec((0..20u32, 0..20u32), 1..60),
        ) {
            let pairs: Vec<_> = pairs.iter().map(|(one, other)| (one % count, other % count)).collect();
            solves(count, &pairs);
        }
    }

    #[test]
    fn a_matrix_that_is_not_positive_is_refused() {
        let mut matrix = Profile::default();
        matrix.reset(&Rc::new(ProfileLayout::new(&[Vec::new()])));
        matrix.add_product(&[(0, DVec3::X)]);
        assert!(!matrix.factor());
    }
}
