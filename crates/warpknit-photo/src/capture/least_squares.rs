//! Nonlinear least squares: the parameters whose residuals have the least sum of squares.
//!
//! In: [`LeastSquares`], residuals and their derivatives, and a start. Out: parameters at a local
//! minimum near it.
//!
//! Method: the Levenberg-Marquardt algorithm (Levenberg 1944, *A method for the solution of certain
//! non-linear problems in least squares*; Marquardt 1963, *An algorithm for least-squares
//! estimation of nonlinear parameters*) on the normal equations. Parameters are scaled by the
//! largest norms that their columns had, and convergence is judged as in MINPACK (Moré 1978). The
//! damping follows the gain of each step (Nielsen 1999, *Damping parameter in Marquardt's method*).
//!
//! Cost: a product of half of all pairs of columns for each Jacobian: a tenth of a millisecond for
//! two segments, one for eight. Not promised: more than half the digits of the residuals, which is
//! what normal equations keep.

use pulp::Arch;

/// Relative change of the error and of the parameters at which the iteration has converged. Layouts
/// are compared by differences of a percent; a smaller tolerance only adds iterations.
const TOLERANCE: f64 = 1e-5;
/// Damping of the first step, as a share of the squared scales: nearly a Gauss-Newton step.
const FIRST_DAMPING: f64 = 1e-3;
/// The least that a step is damped. Without any, parameters that don't matter have no solution.
const LEAST_DAMPING: f64 = 1e-9;
/// Damping at which no step will help.
const MOST_DAMPING: f64 = 1e12;
/// Share of the predicted gain from which on a step is taken.
const LEAST_GAIN: f64 = 1e-4;
/// Columns that are multiplied with another one together: what registers hold.
const TOGETHER: usize = 4;
/// Rows that are added up side by side.
const LANES: usize = 8;

/// A least-squares problem.
pub(super) trait LeastSquares {
    /// The residuals at some parameters.
    fn residuals(&self, parameters: &[f64]) -> Vec<f64>;
    /// Their derivatives, a column of all residuals for each parameter.
    fn jacobian(&self, parameters: &[f64]) -> Vec<f64>;
}

/// The parameters at a local minimum near a start, after at most so many evaluations of the
/// residuals.
pub(super) fn minimise(
    problem: &impl LeastSquares,
    start: Vec<f64>,
    evaluations: usize,
) -> Vec<f64> {
    let mut at = start;
    let mut residuals = problem.residuals(&at);
    let mut scales = vec![0.0_f64; at.len()];
    let (mut damping, mut growth, mut left) = (FIRST_DAMPING, 2.0, evaluations);
    let mut normal = NormalEquations::new(&problem.jacobian(&at), &residuals);
    normal.widen(&mut scales);
    while left > 0 && damping < MOST_DAMPING {
        left -= 1;
        let step = normal.step(damping, &scales);
        let moved: Vec<f64> = at.iter().zip(&step).map(|(at, step)| at + step).collect();
        let fresh = problem.residuals(&moved);
        let cost = square(&residuals);
        let gain = 1.0 - square(&fresh) / cost;
        let predicted = normal.predicted(&step, damping, &scales) / cost;
        let is_settled = gain.abs() <= TOLERANCE && predicted <= TOLERANCE
            || scaled(&step, &scales) <= TOLERANCE.powi(2) * scaled(&at, &scales);
        let share = gain / predicted;
        let is_better = share > LEAST_GAIN;
        if is_better {
            (at, residuals) = (moved, fresh);
            damping *= (1.0 - (2.0 * share - 1.0).powi(3)).max(1.0 / 3.0);
            damping = damping.max(LEAST_DAMPING);
            growth = 2.0;
        } else {
            damping *= growth;
            growth *= 2.0;
        }
        if is_settled {
            break;
        }
        if is_better {
            normal = NormalEquations::new(&problem.jacobian(&at), &residuals);
            normal.widen(&mut scales);
        }
    }
    at
}

/// Sum of squares.
fn square(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum()
}

/// Sum of squares of what scales multiply.
fn scaled(values: &[f64], scales: &[f64]) -> f64 {
    values.iter().zip(scales).map(|(value, scale)| (value * scale).powi(2)).sum()
}

/// The normal equations of a linear least-squares problem.
struct NormalEquations {
    /// Products of all pairs of columns, row by row; only those on and below the diagonal are set.
    products: Vec<f64>,
    /// Products of the columns with the residuals.
    gradient: Vec<f64>,
}

impl NormalEquations {
    fn new(jacobian: &[f64], residuals: &[f64]) -> Self {
        let columns: Vec<&[f64]> = jacobian.chunks_exact(residuals.len()).collect();
        let count = columns.len();
        let mut products = vec![0.0; count * count];
        let mut gradient = vec![0.0; count];
        Arch::new().dispatch(
            #[inline(always)]
            || {
                for (row, column) in columns.iter().enumerate() {
                    gradient[row] = dots([*column], residuals)[0];
                    let others = columns[..=row].chunks_exact(TOGETHER);
                    let rest = row + 1 - others.remainder().len();
                    for (number, others) in others.enumerate() {
                        let others: [&[f64]; TOGETHER] = std::array::from_fn(|at| others[at]);
                        products[row * count + number * TOGETHER..][..TOGETHER]
                            .copy_from_slice(&dots(others, column));
                    }
                    for other in rest..=row {
                        products[row * count + other] = dots([columns[other]], column)[0];
                    }
                }
            },
        );
        Self { products, gradient }
    }

    /// The largest norms that columns had so far. A column of zeros has 1.
    fn widen(&self, scales: &mut [f64]) {
        for (row, scale) in scales.iter_mut().enumerate() {
            let norm = self.products[row * (self.gradient.len() + 1)].sqrt();
            *scale = if *scale == 0.0 && norm == 0.0 { 1.0 } else { scale.max(norm) };
        }
    }

    /// The step that solves the equations with a damping on the diagonal.
    fn step(&self, damping: f64, scales: &[f64]) -> Vec<f64> {
        let count = self.gradient.len();
        let mut lower = self.products.clone();
        for (row, scale) in scales.iter().enumerate() {
            lower[row * (count + 1)] += damping * scale * scale;
        }
        // Cholesky's decomposition, row by row.
        for row in 0..count {
            let (above, rest) = lower.split_at_mut(row * count);
            for column in 0..row {
                let other = &above[column * count..];
                rest[column] =
                    (rest[column] - product(&rest[..column], &other[..column])) / other[column];
            }
            // Rounding may take the pivot of a column below 0 that others nearly make up.
            rest[row] = (rest[row] - square(&rest[..row])).max(f64::MIN_POSITIVE).sqrt();
        }
        let mut step = vec![0.0; count];
        for row in 0..count {
            let own = &lower[row * count..];
            step[row] = (-self.gradient[row] - product(&own[..row], &step[..row])) / own[row];
        }
        for row in (0..count).rev() {
            step[row] /= lower[row * (count + 1)];
            let own = step[row];
            let entries = &lower[row * count..][..row];
            step[..row].iter_mut().zip(entries).for_each(|(step, entry)| *step -= own * entry);
        }
        step
    }

    /// By how much a damped step lowers the sum of squares if the problem is linear.
    fn predicted(&self, step: &[f64], damping: f64, scales: &[f64]) -> f64 {
        damping * scaled(step, scales) - product(&self.gradient, step)
    }
}

/// Scalar product.
fn product(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(one, other)| one * other).sum()
}

/// Scalar products of some columns with another one.
#[inline(always)]
fn dots<const N: usize>(columns: [&[f64]; N], other: &[f64]) -> [f64; N] {
    let mut sums = [[0.0; LANES]; N];
    let whole = other.len() / LANES * LANES;
    for first in (0..whole).step_by(LANES) {
        let other = &other[first..first + LANES];
        for (sums, column) in sums.iter_mut().zip(columns) {
            let own = sums.iter_mut().zip(&column[first..first + LANES]).zip(other);
            own.for_each(|((sum, column), other)| *sum += column * other);
        }
    }
    std::array::from_fn(|at| {
        sums[at].iter().sum::<f64>() + product(&columns[at][whole..], &other[whole..])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The valley of Rosenbrock (1960), and a parameter that nothing depends on.
    struct Valley;

    impl LeastSquares for Valley {
        fn residuals(&self, at: &[f64]) -> Vec<f64> {
            vec![10.0 * (at[1] - at[0] * at[0]), 1.0 - at[0]]
        }

        fn jacobian(&self, at: &[f64]) -> Vec<f64> {
            vec![-20.0 * at[0], -1.0, 10.0, 0.0, 0.0, 0.0]
        }
    }

    #[test]
    fn a_bent_valley_is_followed_to_its_lowest_place() {
        let found = minimise(&Valley, vec![-1.2, 1.0, 5.0], 100);
        assert!((found[0] - 1.0).abs() < 1e-3 && (found[1] - 1.0).abs() < 2e-3, "{found:?}");
        assert!((found[2] - 5.0).abs() < f64::EPSILON, "it stays where it was: {found:?}");
    }

    #[test]
    fn products_of_any_number_of_rows_and_columns() {
        for (rows, columns) in [(3, 1), (8, 4), (21, 9)] {
            let value = |at: usize| f64::from(u32::try_from(at * 7 % 11).unwrap()) - 4.0;
            let jacobian: Vec<f64> = (0..rows * columns).map(value).collect();
            let residuals: Vec<f64> = (0..rows).map(|at| value(at + 3)).collect();
            let normal = NormalEquations::new(&jacobian, &residuals);
            let column = |at: usize| &jacobian[at * rows..][..rows];
            for row in 0..columns {
                assert_eq!(
                    normal.gradient[row].to_bits(),
                    product(column(row), &residuals).to_bits()
                );
                for other in 0..=row {
                    let own = normal.products[row * columns + other];
                    assert_eq!(own.to_bits(), product(column(row), column(other)).to_bits());
                }
            }
        }
    }
}
