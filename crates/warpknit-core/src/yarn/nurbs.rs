//! Cubic NURBS: the path of a weft-knit course.
//!
//! In: control points with weights, or points that the curve is to interpolate. Out: [`Nurbs`],
//! clamped at both ends, so that the first and the last control point are the curve's ends.
//!
//! Method: the rational form `C(u) = Σ N w A / Σ N w`, as in the ribbon model's loops (see
//! docs/method.md, weft loops). The algorithms are those of Piegl and Tiller, The NURBS Book, 1997:
//! basis functions A2.2, interpolation section 9.2.1 with the knots of equation 9.8.
//!
//! Cost: interpolation is linear in the points, about 50 ns a point. An evaluation takes about
//! 20 ns, plus a binary search for its knot span.
//!
//! Not promised: a shape without overshoot between points.

use glam::DVec3;

const DEGREE: usize = 3;

/// A cubic curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Nurbs {
    /// Control points `A`, mm; at least four.
    pub control: Vec<DVec3>,
    /// Their weights `w`, each over 0.
    pub weights: Vec<f64>,
    /// Ascending, with four equal ones at both ends.
    knots: Vec<f64>,
}

impl Nurbs {
    /// The curve with all weights 1 that interpolates `points` at the [`parameters`] given for
    /// them.
    ///
    /// # Panics
    /// With fewer than four points, or with a different number of parameters.
    ///
    /// ```
    /// use glam::DVec3;
    /// use warpknit_core::yarn::nurbs::{Nurbs, parameters};
    /// let points: Vec<_> =
    ///     (0..9).map(|i| DVec3::new(f64::from(i), f64::from(i % 2), 0.0)).collect();
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
            knots: averaged_knots(parameters),
        };
        curve.interpolate(parameters);
        curve
    }

    /// The point at a parameter. A parameter beyond the curve's range is clamped to it.
    #[must_use]
    pub fn at(&self, u: f64) -> DVec3 {
        let (span, basis) = self.basis(u);
        let first = span - DEGREE;
        // Only four control points have an influence at u: those of the basis functions that are
        // not 0 there.
        let (mut sum, mut weight) = (DVec3::ZERO, 0.0);
        for (value, index) in basis.into_iter().zip(first..) {
            sum += self.control[index] * (value * self.weights[index]);
            weight += value * self.weights[index];
        }
        sum / weight
    }

    /// The index of the knot span that holds `u`, and the four basis functions that are not 0
    /// there. The span's index is that of the last of the four.
    ///
    /// They are at least 0 and add up to 1.
    #[must_use]
    pub fn basis(&self, u: f64) -> (usize, [f64; DEGREE + 1]) {
        let last = self.control.len() - 1;
        let u = u.clamp(self.knots[DEGREE], self.knots[last + 1]);
        // The clamp of the span matters only at the end of the curve: there the knot search runs
        // past the last span, which would be of length 0.
        let span = (self.knots.partition_point(|&knot| knot <= u) - 1).clamp(DEGREE, last);
        // The Cox-de Boor recursion, degree by degree (The NURBS Book, algorithm A2.2). Each pass
        // splits the functions of one degree between their two neighbours of the next degree.
        // `carried` is the part that goes to the right one. The knots of the triangular scheme
        // enclose u, so no denominator is 0.
        let mut basis = [1.0, 0.0, 0.0, 0.0];
        for degree in 1..=DEGREE {
            let mut carried = 0.0;
            for (at, value) in basis.iter_mut().enumerate().take(degree) {
                let (right, left) = (self.knots[span + at + 1], self.knots[span + 1 + at - degree]);
                let ratio = *value / (right - left);
                *value = carried + (right - u) * ratio;
                carried = (u - left) * ratio;
            }
            basis[degree] = carried;
        }
        (span, basis)
    }

    /// Replaces the control points, which hold the points to interpolate, by those that make the
    /// curve pass there (The NURBS Book, section 9.2.1).
    ///
    /// The matrix of basis functions is banded and totally positive. So Gaussian elimination needs
    /// no pivoting and stays within the band (de Boor, A Practical Guide to Splines, 1978, chapter
    /// 13). A dense solver would take cubic time: minutes for a course of ten thousand points.
    fn interpolate(&mut self, parameters: &[f64]) {
        let count = parameters.len();
        // Row i holds columns i - 3 to i + 3; the diagonal is at index 3.
        let mut band = vec![[0.0; 2 * DEGREE + 1]; count];
        for (row, &u) in parameters.iter().enumerate() {
            let (span, basis) = self.basis(u);
            for (value, column) in basis.into_iter().zip(span - DEGREE..) {
                // Only at the two ends do functions lie outside the band, and there they are 0.
                if let Some(entry) =
                    (column + DEGREE).checked_sub(row).and_then(|at| band[row].get_mut(at))
                {
                    *entry = value;
                }
            }
        }
        // Forward elimination. The right-hand side is transformed in place, three coordinates at
        // once. A pivot reaches DEGREE rows down and DEGREE columns to the right: the band's width.
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
        // Back substitution.
        for row in (0..count).rev() {
            let mut known = self.control[row];
            for column in row + 1..count.min(row + 1 + DEGREE) {
                known -= self.control[column] * band[row][column + DEGREE - row];
            }
            self.control[row] = known / band[row][DEGREE];
        }
    }
}

/// Centripetal parameters for points to interpolate: from 0, each larger than the one before by the
/// square root of the distance (The NURBS Book, equation 9.6, without normalisation).
///
/// Equal points get a step of the root of the machine epsilon. A step of 0 would give two equal
/// rows of the matrix, which then has no solution.
#[must_use]
pub fn parameters(points: &[DVec3]) -> Vec<f64> {
    let mut sum = 0.0;
    let mut parameters = Vec::with_capacity(points.len());
    parameters.push(sum);
    for ends in points.windows(2) {
        sum += ends[0].distance(ends[1]).sqrt().max(f64::EPSILON.sqrt());
        parameters.push(sum);
    }
    parameters
}

/// Knots for an interpolation: each inner knot is the mean of three parameters (The NURBS Book,
/// equation 9.8). Then each span holds a parameter, as the Schoenberg-Whitney condition for a
/// solvable matrix demands. Equally spaced knots would fail where points are unevenly spaced.
fn averaged_knots(parameters: &[f64]) -> Vec<f64> {
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
                let sum = basis.iter().sum::<f64>();
                prop_assert!((sum - 1.0).abs() < 1e-12);
                prop_assert!(basis.iter().all(|value| *value >= 0.0));
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
