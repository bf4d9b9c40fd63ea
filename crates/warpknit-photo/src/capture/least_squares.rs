//! Nonlinear least squares: the parameters whose residuals have the least sum of squares.
//!
//! In: [`LeastSquares`], residuals and their derivatives, and a start. Out: parameters at a local
//! minimum near it.
//!
//! Method: the Levenberg-Marquardt algorithm (Levenberg 1944, *A method for the solution of certain
//! non-linear problems in least squares*; Marquardt 1963, *An algorithm for least-squares
//! estimation of nonlinear parameters*) with a trust region, as in MINPACK (Moré 1978, *The
//! Levenberg-Marquardt algorithm: implementation and theory*), whose constants it has. Unlike
//! MINPACK it finds steps from the normal equations, by Cholesky's decomposition.
//!
//! Cost: a product of half of all pairs of columns for each Jacobian: a tenth of a millisecond for
//! two segments, one for eight; and up to eleven decompositions for each evaluation, of a tenth of
//! that each. Not promised: directions that change the residuals by less than a millionth of what
//! others do. Normal equations square such ratios, so those directions are damped.

use pulp::Arch;

/// Relative change of the error and of the parameters at which the iteration has converged. Layouts
/// are compared by differences of a percent; a smaller tolerance only adds iterations.
const TOLERANCE: f64 = 1e-4;
/// Size of the first trust region, in norms of the scaled start.
const FIRST_REGION: f64 = 100.0;
/// Share of the predicted gain from which on a step is taken.
const LEAST_GAIN: f64 = 1e-4;
/// A step reaches the edge of the trust region to this share of it.
const NEAR_EDGE: f64 = 0.1;
/// Searches for the damping that leads there, at most.
const DAMPINGS: usize = 10;
/// The least that a step is damped, of squared scales. Without any, parameters that don't matter
/// have no solution.
const LEAST_DAMPING: f64 = 1e-12;
/// Columns that are multiplied with another one together: what registers hold.
const TOGETHER: usize = 4;
/// Rows that are added up side by side.
const LANES: usize = 8;

/// A least-squares problem.
pub(super) trait LeastSquares {
    /// The residuals at some parameters, one and more.
    fn residuals(&self, parameters: &[f64]) -> Vec<f64>;
    /// Their derivatives, a column of all residuals for each parameter.
    fn jacobian(&self, parameters: &[f64]) -> Vec<f64>;
}

/// The parameters at a local minimum near a start, after at most so many evaluations of the
/// residuals beside the first.
pub(super) fn minimise(
    problem: &impl LeastSquares,
    start: Vec<f64>,
    evaluations: usize,
) -> Vec<f64> {
    let mut at = start;
    let mut residuals = problem.residuals(&at);
    let mut scales = vec![0.0_f64; at.len()];
    let mut normal = NormalEquations::new(&problem.jacobian(&at), &residuals);
    normal.widen(&mut scales);
    let mut region = TrustRegion::around(&at, &scales);
    for _ in 0..evaluations {
        let step = region.step(&normal, &scales);
        let moved: Vec<f64> = at.iter().zip(&step).map(|(at, step)| at + step).collect();
        let fresh = problem.residuals(&moved);
        let gain = Gain::new([&residuals, &fresh], &step, &normal, (region.damping, &scales));
        region.adapt(&gain);
        let is_better = gain.share() >= LEAST_GAIN;
        if is_better {
            (at, residuals) = (moved, fresh);
        }
        // Where residuals are no numbers the region shrinks until this ends it.
        let is_wide = region.radius > TOLERANCE * scaled(&at, &scales).sqrt();
        if gain.is_small() || !is_wide {
            break;
        }
        if is_better {
            normal = NormalEquations::new(&problem.jacobian(&at), &residuals);
            normal.widen(&mut scales);
        }
    }
    at
}

/// What a step brings.
struct Gain {
    /// Length of the step in scales.
    length: f64,
    /// The sum of squares that it takes off, as a share of the sum before.
    actual: f64,
    /// The squared change of the residuals if the problem were linear, as such a share.
    linear: f64,
    /// The squared length of the step times the damping, as such a share.
    damped: f64,
}

impl Gain {
    /// The gain of a step from residuals to others.
    fn new(
        [before, after]: [&[f64]; 2],
        step: &[f64],
        normal: &NormalEquations,
        (damping, scales): (f64, &[f64]),
    ) -> Self {
        let cost = square(before);
        let square_length = scaled(step, scales);
        let damped = damping * square_length / cost;
        let linear = -product(&normal.gradient, step) / cost - damped;
        // Residuals that are no numbers count as far worse.
        let actual = (1.0 - square(after) / cost).max(-99.0);
        Self { length: square_length.sqrt(), actual, linear, damped }
    }

    fn predicted(&self) -> f64 {
        self.linear + 2.0 * self.damped
    }

    /// The actual gain as a share of the predicted one.
    fn share(&self) -> f64 {
        let predicted = self.predicted();
        if predicted > 0.0 { self.actual / predicted } else { 0.0 }
    }

    /// Whether there is no more to be gained.
    fn is_small(&self) -> bool {
        self.actual.abs() <= TOLERANCE && self.predicted() <= TOLERANCE && self.share() <= 2.0
    }
}

/// How far the problem is taken to be linear.
struct TrustRegion {
    /// In scales.
    radius: f64,
    /// The damping of the last step, which ended it near the edge.
    damping: f64,
    is_first: bool,
}

impl TrustRegion {
    fn around(start: &[f64], scales: &[f64]) -> Self {
        let size = scaled(start, scales).sqrt();
        let radius = FIRST_REGION * if size > 0.0 { size } else { 1.0 };
        Self { radius, damping: 0.0, is_first: true }
    }

    /// The best step that ends inside it, or beyond its edge by a tenth at most.
    fn step(&mut self, normal: &NormalEquations, scales: &[f64]) -> Vec<f64> {
        let Self { radius, .. } = *self;
        let mut best = normal.damped(0.0, scales);
        let mut excess = best.length - radius;
        if excess <= NEAR_EDGE * radius {
            self.damping = 0.0;
            return best.step;
        }
        // Newton's method for the damping whose step ends on the edge, between bounds.
        let mut low = excess / radius / best.bend;
        let steepest = normal.gradient.iter().zip(scales).map(|(slope, scale)| slope / scale);
        let mut high = steepest.map(|slope| slope * slope).sum::<f64>().sqrt() / radius;
        let mut damping = self.damping.max(low).min(high);
        for _ in 0..DAMPINGS {
            self.damping = damping;
            best = normal.damped(damping, scales);
            excess = best.length - radius;
            if excess.abs() <= NEAR_EDGE * radius {
                break;
            }
            if excess > 0.0 {
                low = low.max(damping);
            } else {
                high = high.min(damping);
            }
            damping = (damping + excess / radius / best.bend).max(low).min(high);
        }
        best.step
    }

    /// Follows the gain of a step.
    fn adapt(&mut self, gain: &Gain) {
        if self.is_first {
            self.radius = self.radius.min(gain.length);
            self.is_first = false;
        }
        let share = gain.share();
        if share <= 0.25 {
            // The lowest place of the parabola through what is known along the step.
            let slope = gain.linear + gain.damped;
            let lowest = 0.5 * slope / (slope - 0.5 * gain.actual);
            let cut = if gain.actual >= 0.0 { 0.5 } else { lowest.max(0.1) };
            self.radius = cut * self.radius.min(10.0 * gain.length);
            self.damping /= cut;
        } else if self.damping == 0.0 || share >= 0.75 {
            self.radius = 2.0 * gain.length;
            self.damping *= 0.5;
        }
    }
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
    fn damped(&self, damping: f64, scales: &[f64]) -> DampedStep {
        let count = self.gradient.len();
        let mut lower = self.products.clone();
        for (row, scale) in scales.iter().enumerate() {
            lower[row * (count + 1)] += (damping + LEAST_DAMPING) * scale * scale;
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
            let least = LEAST_DAMPING * scales[row] * scales[row];
            rest[row] = (rest[row] - square(&rest[..row])).max(least).sqrt();
        }
        let mut step = solved_forward(&lower, self.gradient.iter().map(|slope| -slope));
        for row in (0..count).rev() {
            step[row] /= lower[row * (count + 1)];
            let own = step[row];
            let entries = &lower[row * count..][..row];
            step[..row].iter_mut().zip(entries).for_each(|(step, entry)| *step -= own * entry);
        }
        let length = scaled(&step, scales).sqrt();
        let turned = step.iter().zip(scales).map(|(step, scale)| scale * scale * step / length);
        let bend = square(&solved_forward(&lower, turned));
        DampedStep { step, length, bend }
    }
}

/// A step that solves damped equations.
struct DampedStep {
    step: Vec<f64>,
    /// In scales.
    length: f64,
    /// By how much more damping would shorten it, as a share of its length.
    bend: f64,
}

/// The solution of equations whose matrix is lower triangular, row by row.
fn solved_forward(lower: &[f64], right: impl ExactSizeIterator<Item = f64>) -> Vec<f64> {
    let count = right.len();
    let mut solved: Vec<f64> = Vec::with_capacity(count);
    for (right, own) in right.zip(lower.chunks_exact(count)) {
        solved.push((right - product(&own[..solved.len()], &solved)) / own[solved.len()]);
    }
    solved
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

    /// Equations of three parameters, and their scales.
    fn normal() -> (NormalEquations, Vec<f64>) {
        let jacobian = [1.0, 2.0, 0.0, 1.0, 0.0, 1.0, 3.0, -1.0, 2.0, 0.0, 1.0, 1.0];
        let normal = NormalEquations::new(&jacobian, &[4.0, -2.0, 7.0, 1.0]);
        let mut scales = vec![0.0; 3];
        normal.widen(&mut scales);
        (normal, scales)
    }

    #[test]
    fn steps_solve_the_damped_equations() {
        let (normal, scales) = normal();
        for damping in [0.0, 0.3, 20.0] {
            let DampedStep { step, length, bend } = normal.damped(damping, &scales);
            for row in 0..3 {
                let entry = |column: usize| normal.products[row.max(column) * 3 + row.min(column)];
                let left: f64 = (0..3).map(|column| entry(column) * step[column]).sum();
                let left = left + damping * scales[row].powi(2) * step[row];
                assert!((left + normal.gradient[row]).abs() < 1e-9, "{damping}, {row}");
            }
            let further = normal.damped(damping + 1e-4, &scales);
            let share = (1.0 - further.length / length) / 1e-4;
            assert!((share / bend - 1.0).abs() < 1e-2, "{damping}: {share} {bend}");
        }
    }

    #[test]
    fn steps_end_near_the_edge_of_a_small_region_and_inside_a_large_one() {
        let (normal, scales) = normal();
        let free = normal.damped(0.0, &scales);
        for (share, is_damped) in [(0.01, true), (0.3, true), (0.8, true), (2.0, false)] {
            let radius = share * free.length;
            let mut region = TrustRegion { radius, damping: 0.0, is_first: false };
            let step = region.step(&normal, &scales);
            let length = scaled(&step, &scales).sqrt();
            assert_eq!(region.damping > 0.0, is_damped, "{share}");
            assert!(!is_damped || (length / radius - 1.0).abs() <= NEAR_EDGE, "{share}: {length}");
            assert_eq!(step, normal.damped(region.damping, &scales).step, "{share}");
        }
    }

    #[test]
    fn the_region_follows_gains() {
        let gain = |actual| Gain { length: 1.0, actual, linear: 0.2, damped: 0.1 };
        // Of 0.4 predicted: all, half, hardly any, a loss, and no number.
        for (actual, radius) in [(0.4, 2.0), (0.2, 3.0), (0.01, 1.5), (-0.6, 0.75), (-99.0, 0.3)] {
            let mut region = TrustRegion { radius: 3.0, damping: 0.1, is_first: false };
            region.adapt(&gain(actual));
            assert!((region.radius - radius).abs() < 1e-9, "{actual}: {}", region.radius);
        }
        assert!(gain(0.0).share() < LEAST_GAIN && !gain(0.0).is_small());
        let mut first = TrustRegion { radius: 100.0, damping: 0.0, is_first: true };
        first.adapt(&gain(0.4));
        assert!((first.radius - 2.0).abs() < 1e-9);
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
