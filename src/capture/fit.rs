//! Step 3, refinement: all segments together, by Levenberg-Marquardt on the cell.
//!
//! In: a [`Target`] and segments near what it shows. Out: a [`Fit`]. Derivatives are differences, each drawing one segment over what the others make. Cost: a drawing
//! of one segment for each of its nine numbers and side, a round; some milliseconds at 26 x 26 places.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, Owned};
use rayon::prelude::*;

use super::segment::{Segment, drawn, heights};
use super::target::Target;

/// Segments on a ground of some lightness, and the share of the cell's variance that they leave.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub(super) segments: Vec<Segment>,
    pub(super) ground: f64,
    pub(super) error: f64,
}

/// Moves segments until they suit the cell.
pub(super) fn refine(target: &Target, segments: &[Segment], ground: f64, rounds: usize) -> Fit {
    let numbers = segments.iter().flat_map(Segment::numbers).chain([ground]);
    let problem = Problem {
        target,
        start: segments.to_vec(),
        numbers: DVector::from_iterator(segments.len() * Segment::NUMBERS + 1, numbers),
    };
    let (solved, _) = LevenbergMarquardt::new().with_patience(rounds).with_ftol(1e-4).with_xtol(1e-4).minimize(problem);
    let (segments, ground) = solved.segments(&solved.numbers);
    let error = target.error(&segments, ground);
    Fit { segments, ground, error }
}

struct Problem<'a> {
    target: &'a Target,
    start: Vec<Segment>,
    numbers: DVector<f64>,
}

impl Problem<'_> {
    /// Segments as the numbers have them, held to what yarns can be.
    fn segments(&self, numbers: &DVector<f64>) -> (Vec<Segment>, f64) {
        let numbers = numbers.as_slice();
        let segment = |(numbers, start): (&[f64], &Segment)| {
            let s = Segment::of_numbers(numbers);
            Segment {
                width: s.width.clamp(0.5 * start.width, 1.9 * start.width),
                length: s.length.clamp(0.45 * start.length, 2.2 * start.length).max(0.7 * s.width),
                top: s.top.max(0.0),
                round: s.round.clamp(0.0, 6.0),
                sag: s.sag.clamp(0.0, 6.0),
                tilt: s.tilt.clamp(-3.0, 3.0),
                ..s
            }
        };
        (numbers.chunks_exact(Segment::NUMBERS).zip(&self.start).map(segment).collect(), numbers[numbers.len() - 1])
    }

    fn values(&self, numbers: &DVector<f64>) -> Vec<f64> {
        let (segments, ground) = self.segments(numbers);
        drawn(&segments, ground, &self.target.lattice, &self.target.places)
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Problem<'_> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, numbers: &DVector<f64>) {
        self.numbers.copy_from(numbers);
    }

    fn params(&self) -> DVector<f64> {
        self.numbers.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let values = self.values(&self.numbers);
        Some(DVector::from_iterator(values.len(), values.iter().zip(&self.target.light).map(|(model, light)| model - light)))
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let (segments, _) = self.segments(&self.numbers);
        let Target { lattice, places, light, .. } = self.target;
        let own: Vec<Vec<f64>> = segments.par_iter().map(|segment| heights(segment, lattice, places)).collect();
        let others = |number: usize| {
            let mut highest = vec![0.0_f64; places.len()];
            for heights in own.iter().enumerate().filter(|(other, _)| *other != number).map(|(_, heights)| heights) {
                highest.iter_mut().zip(heights).for_each(|(highest, height)| *highest = highest.max(*height));
            }
            highest
        };
        let others: Vec<Vec<f64>> = (0..segments.len()).map(others).collect();
        let last = self.numbers.len() - 1;
        let columns: Vec<Vec<f64>> = (0..=last)
            .into_par_iter()
            .map(|number| {
                if number == last {
                    return vec![1.0; places.len()];
                }
                // Lengths are pixels; angles and lightness are about 1.
                let which = number / Segment::NUMBERS;
                let step = if matches!(number % Segment::NUMBERS, 0 | 1 | 3 | 4) {
                    0.03 * self.start[which].width.max(0.3)
                } else {
                    0.01
                };
                let mut moved = self.numbers.clone();
                let mut at = |by: f64| {
                    moved[number] = self.numbers[number] + by;
                    heights(&self.segments(&moved).0[which], lattice, places)
                };
                let (more, less) = (at(step), at(-step));
                let slope = |((more, less), others): ((&f64, &f64), &f64)| (more.max(*others) - less.max(*others)) / (2.0 * step);
                more.iter().zip(&less).zip(&others[which]).map(slope).collect()
            })
            .collect();
        Some(DMatrix::from_iterator(light.len(), columns.len(), columns.into_iter().flatten()))
    }
}
