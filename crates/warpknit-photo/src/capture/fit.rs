//! Step 3, refinement: all segments of a layout at once, by least squares on the mean cell.
//!
//! In: a [`FitTarget`] and segments near those that it shows. Out: a [`LayoutFit`].
//!
//! Method: nonlinear least squares ([`minimise`]). Derivatives are central differences. Constraints
//! are a projection of the parameters onto the bounds of what a yarn can be.
//!
//! Cost: two renderings of one segment for each of its seven parameters of place, and one for those
//! of its light together, an iteration; a millisecond or two at 26 x 26 points. Not promised: the
//! global minimum. The result depends on the start, so that many starts compete.

use rayon::prelude::*;

use super::least_squares::{LeastSquares, minimise};
use super::relief::{heights, heights_in_lights, max_into, rendered};
use super::segment::Segment;
use super::target::FitTarget;

/// The longest segment, in lengths of the cell's longer vector.
const MAX_LENGTH: f64 = 3.0;

/// How far one fit may turn a segment, radians. At 0 no leg of a loop would find its slant; from
/// about half a radian on a segment may turn onto its neighbour.
const MAX_TURN: f64 = 0.2;
/// The same for a weave, whose yarns run as their crossings do. A segment that is as wide as long
/// shows no direction of its own: the bound grows from 0 there to this value at twice the width.
const MAX_WOVEN_TURN: f64 = 0.08;

/// Largest bow and sway, as a share of the length beyond [`STRAIGHT_ASPECT`] widths.
const MAX_BEND: f64 = 0.15;
/// Segments up to so many widths long stay straight. A segment that is as wide as long shows no
/// bend, and its bow would follow noise.
const STRAIGHT_ASPECT: f64 = 1.5;
/// The largest `round`, as a share of `top`. With darker edges a segment looks narrower than its
/// width says, and the width drifts up.
const MAX_ROUND: f64 = 0.6;

/// Steps of the central differences: of parameters in pixels as a share of the width, and of angles
/// and lightness, which are about 1. Much smaller steps would fall below the blur of edges in the
/// model, larger ones would reach over the narrowest yarns.
const PIXEL_STEP: f64 = 0.03;
const UNIT_STEP: f64 = 0.01;

/// The kind of cloth that a layout was sought as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hypothesis {
    /// A matrix of warp and weft.
    Woven,
    /// The segments that cover the cell best, such as legs of loops.
    Cover,
    /// A layout that a person gave.
    Given,
}

/// Segments on a ground of some lightness, the hypothesis behind them, and the share of the cell's
/// variance that they leave unexplained.
#[derive(Clone, Debug)]
pub(super) struct LayoutFit {
    pub(super) segments: Vec<Segment>,
    pub(super) hypothesis: Hypothesis,
    pub(super) ground: f64,
    pub(super) error: f64,
}

impl LayoutFit {
    /// The fit of other segments under the same hypothesis.
    pub(super) fn refit(
        &self,
        target: &FitTarget,
        segments: &[Segment],
        iterations: usize,
    ) -> Self {
        refine(target, self.hypothesis, segments, self.ground, iterations)
    }
}

/// Moves segments until their rendering matches the cell. `iterations` bounds the evaluations of
/// the solver: that many for each parameter and once more.
pub(super) fn refine(
    target: &FitTarget,
    hypothesis: Hypothesis,
    segments: &[Segment],
    ground: f64,
    iterations: usize,
) -> LayoutFit {
    let start: Vec<f64> = segments.iter().flat_map(Segment::parameters).chain([ground]).collect();
    let evaluations = iterations * (start.len() + 1);
    let problem = Problem { target, hypothesis, start: segments };
    let (segments, ground) = problem.segments(&minimise(&problem, start, evaluations));
    let error = target.error(&segments, ground);
    LayoutFit { segments, hypothesis, ground, error }
}

/// The segments to be moved. Parameters are those of all segments, and then the ground's lightness.
struct Problem<'a> {
    target: &'a FitTarget,
    hypothesis: Hypothesis,
    start: &'a [Segment],
}

impl Problem<'_> {
    /// The segments and the ground that parameters stand for, within the bounds of what yarns can
    /// be.
    fn segments(&self, parameters: &[f64]) -> (Vec<Segment>, f64) {
        let segments = parameters
            .chunks_exact(Segment::PARAMETERS)
            .zip(self.start)
            .map(|(own, start)| self.bounded(&Segment::from_parameters(own), start))
            .collect();
        (segments, parameters[parameters.len() - 1])
    }

    /// A segment projected onto the bounds around the one where the fit starts. The solver itself
    /// is unconstrained: beyond a bound the rendering stops changing, and the derivative is 0.
    fn bounded(&self, s: &Segment, start: &Segment) -> Segment {
        let longer = self.target.lattice.longer();
        // Bounds relative to the start alone would let a chain of fits, each from the end of the
        // last one, grow a float without end; hence the bounds by the cell.
        let width =
            s.width.clamp(0.5 * start.width, 1.9 * start.width).min(0.5 * MAX_LENGTH * longer);
        let length = s
            .length
            .clamp(0.45 * start.length, 2.2 * start.length)
            .min(MAX_LENGTH * longer)
            .max(0.7 * width);
        let top = s.top.max(0.0);
        // A yarn of a weave that lies mostly below others could slide along its own direction
        // without any change of the error.
        let (farthest, max_turn) = match self.hypothesis {
            Hypothesis::Woven => (longer, MAX_WOVEN_TURN * (length / width - 1.0).clamp(0.0, 1.0)),
            Hypothesis::Cover | Hypothesis::Given => (f64::INFINITY, MAX_TURN),
        };
        let max_bend = MAX_BEND * (length - STRAIGHT_ASPECT * width).max(0.0);
        Segment {
            centre: start.centre + (s.centre - start.centre).clamp_length_max(farthest),
            angle: s.angle.clamp(start.angle - max_turn, start.angle + max_turn),
            width,
            length,
            top,
            round: s.round.clamp(0.0, MAX_ROUND * top),
            // A few times the contrast of the photo: beyond, an end is as good as vertical.
            sag: s.sag.clamp(0.0, 6.0),
            tilt: s.tilt.clamp(-3.0, 3.0),
            bow: s.bow.clamp(-max_bend, max_bend),
            sway: s.sway.clamp(-max_bend, max_bend),
        }
    }

    /// A segment with one of its parameters moved by `by` steps, within the bounds.
    fn moved(&self, (segment, own): (usize, &[f64]), parameter: usize, by: f64) -> Segment {
        let mut moved = own.to_vec();
        moved[parameter] += by * self.step(segment, parameter);
        self.bounded(&Segment::from_parameters(&moved), &self.start[segment])
    }

    /// The step of a central difference.
    fn step(&self, segment: usize, parameter: usize) -> f64 {
        if Segment::PIXEL_PARAMETERS.contains(&parameter) {
            PIXEL_STEP * self.start[segment].width.max(0.3)
        } else {
            UNIT_STEP
        }
    }

    /// Writes columns of the Jacobian: derivatives by a segment's parameters from `first` on. `own`
    /// is the segment's number and its parameters, `others` the upper envelope of the others.
    fn derivatives(&self, own: (usize, &[f64]), first: usize, columns: &mut [f64], others: &[f64]) {
        let FitTarget { lattice, samples, .. } = self.target;
        let both = |parameter| [1.0, -1.0].map(|by| self.moved(own, parameter, by));
        let mut write = |number: usize, [more, less]: [&[f64]; 2]| {
            let column = columns[number * others.len()..].iter_mut();
            let twice = 2.0 * self.step(own.0, first + number);
            // Where another segment is higher at both ends of the difference, the derivative is 0:
            // what is hidden has no say in the fit.
            for (((column, more), less), others) in column.zip(more).zip(less).zip(others) {
                *column = (more.max(*others) - less.max(*others)) / twice;
            }
        };
        if first == Segment::LIGHT_PARAMETERS.start {
            // Parameters of the light leave all places where they are.
            let lights = Segment::LIGHT_PARAMETERS.flat_map(both);
            let heights = heights_in_lights(&lights.collect::<Vec<_>>(), lattice, samples);
            for (number, pair) in heights.chunks_exact(2).enumerate() {
                write(number, [&pair[0], &pair[1]]);
            }
        } else {
            let [more, less] = both(first).map(|moved| heights(&moved, lattice, samples));
            write(0, [&more, &less]);
        }
    }
}

/// The upper envelope of all segments but one, from the heights of each.
fn envelope_without(number: usize, heights: &[Vec<f64>], points: usize) -> Vec<f64> {
    let mut highest = vec![0.0_f64; points];
    for (other, heights) in heights.iter().enumerate() {
        if other != number {
            max_into(&mut highest, heights);
        }
    }
    highest
}

impl LeastSquares for Problem<'_> {
    fn residuals(&self, parameters: &[f64]) -> Vec<f64> {
        let FitTarget { lattice, samples, light, .. } = self.target;
        let (segments, ground) = self.segments(parameters);
        let mut residuals = rendered(&segments, ground, lattice, samples);
        residuals.iter_mut().zip(light).for_each(|(model, light)| *model -= light);
        residuals
    }

    fn jacobian(&self, parameters: &[f64]) -> Vec<f64> {
        let FitTarget { lattice, samples, light, .. } = self.target;
        let (segments, _) = self.segments(parameters);
        // One parameter moves one segment. The envelope of the others is computed once for each
        // segment, so that a column costs two renderings of one segment instead of all of them.
        let own: Vec<Vec<f64>> =
            segments.par_iter().map(|segment| heights(segment, lattice, samples)).collect();
        let others: Vec<Vec<f64>> =
            (0..segments.len()).map(|number| envelope_without(number, &own, light.len())).collect();
        let points = light.len();
        let mut entries = vec![0.0; points * parameters.len()];
        let (columns, ground) = entries.split_at_mut(points * (parameters.len() - 1));
        // The ground lifts every point alike.
        ground.fill(1.0);
        let lights = Segment::LIGHT_PARAMETERS;
        let mut parts: Vec<(usize, usize, &mut [f64])> = Vec::new();
        let all = columns.chunks_exact_mut(points * Segment::PARAMETERS).enumerate();
        for (segment, columns) in all {
            let (before, rest) = columns.split_at_mut(points * lights.start);
            let (light, after) = rest.split_at_mut(points * lights.len());
            let single = |first| move |(at, column)| (segment, first + at, column);
            parts.extend(before.chunks_exact_mut(points).enumerate().map(single(0)));
            parts.push((segment, lights.start, light));
            parts.extend(after.chunks_exact_mut(points).enumerate().map(single(lights.end)));
        }
        parts.into_par_iter().for_each(|(segment, first, columns)| {
            let own = &parameters[segment * Segment::PARAMETERS..][..Segment::PARAMETERS];
            self.derivatives((segment, own), first, columns, &others[segment]);
        });
        entries
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use glam::DVec2;

    use super::super::cell::Cell;
    use super::super::lattice::Lattice;
    use super::super::relief::Samples;
    use super::*;
    use crate::plane::{Plane, double, narrow};

    const LATTICE: Lattice = Lattice { a: DVec2::new(30.0, 2.0), b: DVec2::new(-3.0, 24.0) };

    /// A cell that two segments make, of so many places a pixel.
    fn cell(segments: &[Segment]) -> Cell {
        let light = |x: usize, y: usize| {
            let place = LATTICE.a * (double(x) / 60.0) + LATTICE.b * (double(y) / 48.0);
            narrow(rendered(segments, -1.0, &LATTICE, &Samples::new(vec![place]))[0])
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
        let target = FitTarget::new(&cell(&truth), 40.0);
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
        let target = FitTarget::new(&cell(&start), 20.0);
        let mut fit = refine(&target, Hypothesis::Cover, &start, -1.0, 1);
        for _ in 0..20 {
            let problem =
                Problem { target: &target, hypothesis: fit.hypothesis, start: &fit.segments };
            fit.segments = problem.segments(&[1e12; Segment::PARAMETERS + 1]).0;
        }
        assert!(
            fit.segments[0].length <= 3.0 * LATTICE.longer()
                && fit.segments[0].copies(&LATTICE).len() < 400,
            "{fit:?}"
        );
    }
}
