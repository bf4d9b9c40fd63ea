//! Cubic NURBS: the path of a weft-knit course.
//!
//! In: control points with weights, or points that the curve is to pass through. Out: [`Nurbs`],
//! clamped at both ends, which interpolates its first and last control point. Source: the ribbon
//! paper's loop model (`C(u) = Σ N w A / Σ N w`); basis functions after de Boor; Piegl and Tiller,
//! The NURBS Book, chapter 9, for the interpolation. Solving takes about 50 ns a point and an
//! evaluation about 20.

use glam::DVec3;

const DEGREE: usize = 3;

/// A cubic curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Nurbs {
    /// Control points `A`, mm; four at least.
    pub control: Vec<DVec3>,
    /// Their weights `w`, over 0.
    pub weights: Vec<f64>,
    /// Rising; four equal ones at both ends.
    knots: Vec<f64>,
}

impl Nurbs {
    /// The curve with all weights 1 that passes through `points`, at the [`parameters`] given for
    /// them.
    ///
    /// # Panics
    /// With fewer than four points, or another number of parameters.
    ///
    /// ```
    /// use glam::DVec3;
    /// use warpknit_core::yarn::nurbs::{Nurbs, parameters};
    /// let points: Vec<_> = (0..9).map(|i| DVec3::new(f64::from(i), f64::from(i % 2), 0.0)).collect();
    /// let at = parameters(&points);
    /// let curve = Nurbs::through(&points, &at);
    /// assert_eq!(curve.control.len(), points.len());
    /// assert!(curve.at(at[4]).distance(points[4]) < 1e-12);
    /// ```
    #[must_use]
    pub fn through(points: &[DVec3], parameters: &[f64]) -> Self {
        assert!(
            points.len() > DEGREE && points.len() == parameters.len(),
            "a cubic has four points, and each a parameter"
        );
        let mut curve = Self {
            control: points.to_vec(),
            weights: vec![1.0; points.len()],
            knots: knots(parameters),
        };
        curve.interpolate(parameters);
        curve
    }

    /// The point at a parameter, which is held to the curve's range.
    #[must_use]
    pub fn at(&self, u: f64) -> DVec3 {
        let (span, basis) = self.basis(u);
        let first = span - DEGREE;
        let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
        for (share, index) in basis.into_iter().zip(first..) {
            sum += self.control[index] * (share * self.weights[index]);
            weight += share * self.weights[index];
        }
        sum / weight
    }

    /// The four basis functions that are not 0 at `u`, and the knot span, whose number is that of
    /// the last of them.
    ///
    /// They are at least 0 and add up to 1.
    #[must_use]
    pub fn basis(&self, u: f64) -> (usize, [f64; DEGREE + 1]) {
        let last = self.control.len() - 1;
        let u = u.clamp(self.knots[DEGREE], self.knots[last + 1]);
        let span = (self.knots.partition_point(|&knot| knot <= u) - 1).clamp(DEGREE, last);
        let mut basis = [1.0, 0.0, 0.0, 0.0];
        for degree in 1..=DEGREE {
            let mut carried = 0.0;
            for (at, value) in basis.iter_mut().enumerate().take(degree) {
                let (right, left) = (self.knots[span + at + 1], self.knots[span + 1 + at - degree]);
                let share = *value / (right - left);
                *value = carried + (right - u) * share;
                carried = (u - left) * share;
            }
            basis[degree] = carried;
        }
        (span, basis)
    }

    /// Moves the control points, which are the points to be passed, to where they make the curve
    /// pass there.
    ///
    /// The matrix of basis functions is banded and totally positive, so elimination needs no pivots
    /// (de Boor 1978).
    fn interpolate(&mut self, parameters: &[f64]) {
        let count = parameters.len();
        // Row by row, the diagonal in the middle.
        let mut band = vec![[0.0; 2 * DEGREE + 1]; count];
        for (row, &u) in parameters.iter().enumerate() {
            let (span, basis) = self.basis(u);
            for (share, column) in basis.into_iter().zip(span - DEGREE..) {
                // At the ends alone functions reach farther, where they are 0.
                if let Some(entry) =
                    (column + DEGREE).checked_sub(row).and_then(|at| band[row].get_mut(at))
                {
                    *entry = share;
                }
            }
        }
        for pivot in 0..count {
            for row in pivot + 1..count.min(pivot + 1 + DEGREE) {
                let factor = band[row][pivot + DEGREE - row] / band[pivot][DEGREE];
                for column in pivot..count.min(pivot + 1 + DEGREE) {
                    band[row][column + DEGREE - row] -=
                        factor * band[pivot][column + DEGREE - pivot];
                }
                let known = self.control[pivot];
                self.control[row] -= known * factor;
            }
        }
        for row in (0..count).rev() {
            let mut known = self.control[row];
            for column in row + 1..count.min(row + 1 + DEGREE) {
                known -= self.control[column] * band[row][column + DEGREE - row];
            }
            self.control[row] = known / band[row][DEGREE];
        }
    }
}

/// Centripetal parameters for points to be passed: from 0, by the square root of each distance.
/// Equal points lie a hair apart.
#[must_use]
pub fn parameters(points: &[DVec3]) -> Vec<f64> {
    let steps =
        points.windows(2).map(|ends| ends[0].distance(ends[1]).sqrt().max(f64::EPSILON.sqrt()));
    std::iter::once(0.0)
        .chain(steps.scan(0.0, |sum, step| {
            *sum += step;
            Some(*sum)
        }))
        .collect()
}

/// Knots for an interpolation: inner ones are means of three parameters, so that each span has a
/// point.
fn knots(parameters: &[f64]) -> Vec<f64> {
    let count = parameters.len();
    let (first, last) = (parameters[0], parameters[count - 1]);
    let inner =
        parameters[1..count - 1].windows(DEGREE).map(|three| three.iter().sum::<f64>() / 3.0);
    [first; DEGREE + 1]
        .into_iter()
        .chain(inner.take(count - DEGREE - 1))
        .chain([last; DEGREE + 1])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// de Boor's algorithm by its definition: repeated corner cutting, in homogeneous coordinates.
    fn de_boor(curve: &Nurbs, u: f64) -> DVec3 {
        let t = &curve.knots;
        let k = (3..curve.control.len()).rfind(|&k| t[k] <= u && t[k] < t[k + 1]).unwrap_or(3);
        let mut d: Vec<glam::DVec4> = (0..4)
            .map(|j| {
                (curve.control[j + k - 3] * curve.weights[j + k - 3])
                    .extend(curve.weights[j + k - 3])
            })
            .collect();
        for r in 1..4 {
            for j in (r..4).rev() {
                let a = (u - t[j + k - 3]) / (t[j + 1 + k - r] - t[j + k - 3]);
                d[j] = d[j - 1] * (1.0 - a) + d[j] * a;
            }
        }
        d[3].truncate() / d[3].w
    }

    fn wavy(count: u32) -> Vec<DVec3> {
        (0..count)
            .map(f64::from)
            .map(|i| DVec3::new(i + (i * 1.7).sin(), (i * 0.9).cos() * 2.0, (i * 2.3).sin()))
            .collect()
    }

    #[test]
    fn curves_pass_through_their_points_and_end_in_their_control_points() {
        for count in [4, 5, 6, 9, 17, 161] {
            let points = wavy(count);
            let at = parameters(&points);
            let curve = Nurbs::through(&points, &at);
            assert_eq!((curve.control.len(), curve.control[0]), (points.len(), points[0]));
            assert!(curve.control.last().unwrap().distance(*points.last().unwrap()) < 1e-12);
            for (point, u) in points.iter().zip(at) {
                assert!(curve.at(u).distance(*point) < 1e-10, "{count} points at {u}");
            }
        }
    }

    proptest! {
        #[test]
        fn evaluation_agrees_with_de_boor_and_functions_add_up_to_one(
            weights in prop::collection::vec(0.1..10.0, 12),
            places in prop::collection::vec(0.0..=1.0, 40),
        ) {
            let points = wavy(12);
            let mut curve = Nurbs::through(&points, &parameters(&points));
            curve.weights = weights;
            let end = curve.knots[curve.knots.len() - 1];
            for place in places {
                let u: f64 = place * end;
                prop_assert!(curve.at(u).distance(de_boor(&curve, u)) < 1e-6);
                let (_, basis) = curve.basis(u);
                prop_assert!((basis.iter().sum::<f64>() - 1.0).abs() < 1e-12 && basis.iter().all(|share| *share >= 0.0));
            }
        }
    }

    #[test]
    fn equal_points_and_places_beyond_the_ends_are_no_fault() {
        let mut points = wavy(8);
        points[3] = points[2];
        let at = parameters(&points);
        let curve = Nurbs::through(&points, &at);
        assert!((0..100).all(|i| curve.at(f64::from(i) * 0.1 - 1.0).is_finite()));
        assert_eq!(curve.at(-5.0), points[0]);
    }
}
