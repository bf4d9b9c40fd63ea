//! Step 3, refinement: all segments together, by Levenberg-Marquardt on the cell.
//!
//! In: a [`Target`] and segments near what it shows. Out: a [`Fit`]. Derivatives are differences,
//! each drawing one segment over what the others make. Cost: a drawing of one segment for each of
//! its eleven numbers and side, a round; some milliseconds at 26 x 26 places.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, Owned};
use rayon::prelude::*;

use super::segment::{Segment, drawn, heights, over};
use super::target::Target;

/// The longest segment, in lengths of the cell's longer vector.
const LONGEST: f64 = 3.0;

/// How far one fit turns a segment, radians. Yarns of a weave run as their crossings do, and one
/// that is as wide as long shows no direction of its own: there it is so much less for each width
/// by which a segment is longer than wide, and no more than that for longer ones.
const TURNS: f64 = 0.2;
const WOVEN_TURNS: f64 = 0.08;

/// How far aside a segment bends, of what it is longer than so many widths: one that is as wide as
/// long has no bend of its own either.
const BENDS: f64 = 0.15;
const STUBBY: f64 = 1.5;
/// How much darker its edges are at most, of how much lighter than the ground its middle is: darker
/// ones would make it seem narrower than it is said to be.
const ROUNDEST: f64 = 0.6;

/// What a layout is sought as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hypothesis {
    /// A matrix of warp and weft.
    Woven,
    /// Whatever covers the cell best, such as legs of loops.
    Cover,
    /// A person's.
    Given,
}

/// Segments on a ground of some lightness, what they were sought as, and the share of the cell's
/// variance that they leave.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub(super) segments: Vec<Segment>,
    pub(super) hypothesis: Hypothesis,
    pub(super) ground: f64,
    pub(super) error: f64,
}

impl Fit {
    /// The fit of other segments of the same hypothesis.
    pub(super) fn with(&self, target: &Target, segments: &[Segment], rounds: usize) -> Self {
        refine(target, self.hypothesis, segments, self.ground, rounds)
    }
}

/// Moves segments until they suit the cell.
pub(super) fn refine(
    target: &Target,
    hypothesis: Hypothesis,
    segments: &[Segment],
    ground: f64,
    rounds: usize,
) -> Fit {
    let numbers = segments.iter().flat_map(Segment::numbers).chain([ground]);
    let problem = Problem {
        target,
        hypothesis,
        start: segments.to_vec(),
        numbers: DVector::from_iterator(segments.len() * Segment::NUMBERS + 1, numbers),
    };
    let (solved, _) = LevenbergMarquardt::new()
        .with_patience(rounds)
        .with_ftol(1e-4)
        .with_xtol(1e-4)
        .minimize(problem);
    let (segments, ground) = solved.segments(&solved.numbers);
    let error = target.error(&segments, ground);
    Fit { segments, hypothesis, ground, error }
}

struct Problem<'a> {
    target: &'a Target,
    hypothesis: Hypothesis,
    start: Vec<Segment>,
    numbers: DVector<f64>,
}

impl Problem<'_> {
    /// Segments as the numbers have them, held to what yarns can be.
    fn segments(&self, numbers: &DVector<f64>) -> (Vec<Segment>, f64) {
        let numbers = numbers.as_slice();
        let longer = self.target.lattice.longer();
        let segment = |(numbers, start): (&[f64], &Segment)| {
            let s = Segment::of_numbers(numbers);
            // However often a fit begins anew from the last one's end, no float is longer than some
            // cells.
            let width =
                s.width.clamp(0.5 * start.width, 1.9 * start.width).min(0.5 * LONGEST * longer);
            let length = s
                .length
                .clamp(0.45 * start.length, 2.2 * start.length)
                .min(LONGEST * longer)
                .max(0.7 * width);
            let top = s.top.max(0.0);
            // A yarn of a weave, which lies below others for the most part, could slide along its
            // way for ever.
            let (farthest, turns) = match self.hypothesis {
                Hypothesis::Woven => (longer, WOVEN_TURNS * (length / width - 1.0).clamp(0.0, 1.0)),
                Hypothesis::Cover | Hypothesis::Given => (f64::INFINITY, TURNS),
            };
            let bends = BENDS * (length - STUBBY * width).max(0.0);
            Segment {
                centre: start.centre + (s.centre - start.centre).clamp_length_max(farthest),
                angle: s.angle.clamp(start.angle - turns, start.angle + turns),
                width,
                length,
                top,
                round: s.round.clamp(0.0, ROUNDEST * top),
                sag: s.sag.clamp(0.0, 6.0),
                tilt: s.tilt.clamp(-3.0, 3.0),
                bow: s.bow.clamp(-bends, bends),
                sway: s.sway.clamp(-bends, bends),
            }
        };
        (
            numbers.chunks_exact(Segment::NUMBERS).zip(&self.start).map(segment).collect(),
            numbers[numbers.len() - 1],
        )
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
        Some(DVector::from_iterator(
            values.len(),
            values.iter().zip(&self.target.light).map(|(model, light)| model - light),
        ))
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let (segments, _) = self.segments(&self.numbers);
        let Target { lattice, places, light, .. } = self.target;
        let own: Vec<Vec<f64>> =
            segments.par_iter().map(|segment| heights(segment, lattice, places)).collect();
        let others = |number: usize| {
            let mut highest = vec![0.0_f64; places.len()];
            for heights in own
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != number)
                .map(|(_, heights)| heights)
            {
                over(&mut highest, heights);
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
                let step = if Segment::PIXELS.contains(&(number % Segment::NUMBERS)) {
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
                let slope = |((more, less), others): ((&f64, &f64), &f64)| {
                    (more.max(*others) - less.max(*others)) / (2.0 * step)
                };
                more.iter().zip(&less).zip(&others[which]).map(slope).collect()
            })
            .collect();
        Some(DMatrix::from_iterator(light.len(), columns.len(), columns.into_iter().flatten()))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use glam::DVec2;

    use super::super::cell::Cell;
    use super::super::lattice::Lattice;
    use super::*;
    use crate::plane::{Plane, double, narrow};

    const LATTICE: Lattice = Lattice { a: DVec2::new(30.0, 2.0), b: DVec2::new(-3.0, 24.0) };

    /// A cell that two segments make, of so many places a pixel.
    fn cell(segments: &[Segment]) -> Cell {
        let light = |x: usize, y: usize| {
            let place = LATTICE.a * (double(x) / 60.0) + LATTICE.b * (double(y) / 48.0);
            narrow(drawn(segments, -1.0, &LATTICE, &[place])[0])
        };
        Cell { lattice: LATTICE, plane: Plane::from_fn(60, 48, light) }
    }

    fn segment(x: f64, y: f64, angle: f64) -> Segment {
        Segment {
            sag: 0.5,
            tilt: 0.1,
            ..Segment::straight(DVec2::new(x, y), angle, 9.0, 20.0, 1.6)
        }
    }

    #[test]
    fn segments_move_to_where_the_cell_has_them() {
        let truth = [segment(8.0, 7.0, 0.2), segment(21.0, 16.0, FRAC_PI_2)];
        let target = Target::new(&cell(&truth), 40.0);
        let start = truth.map(|s| Segment {
            centre: s.centre + 1.2,
            angle: s.angle - 0.1,
            width: 8.0,
            top: 1.2,
            tilt: 0.0,
            ..s
        });
        let fit = refine(&target, Hypothesis::Cover, &start, -0.8, 30);
        assert!(fit.error < 0.01, "{fit:?}");
        for (found, truth) in fit.segments.iter().zip(&truth) {
            assert!(
                found.centre.distance(truth.centre) < 0.6
                    && (found.angle - truth.angle).abs() < 0.05,
                "{found:?}"
            );
            assert!((found.width / truth.width - 1.0).abs() < 0.08, "{found:?}");
        }
    }

    #[test]
    fn no_segment_outgrows_some_cells() {
        let start = vec![segment(8.0, 7.0, 0.2)];
        let target = Target::new(&cell(&start), 20.0);
        let mut fit = refine(&target, Hypothesis::Cover, &start, -1.0, 1);
        for _ in 0..20 {
            let numbers = DVector::from_element(Segment::NUMBERS + 1, 1e12);
            let problem = Problem {
                target: &target,
                hypothesis: fit.hypothesis,
                start: fit.segments,
                numbers,
            };
            fit.segments = problem.segments(&problem.numbers).0;
        }
        assert!(
            fit.segments[0].length <= 3.0 * LATTICE.longer()
                && fit.segments[0].copies(&LATTICE).len() < 400,
            "{fit:?}"
        );
    }
}
