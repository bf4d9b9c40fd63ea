//! The strain solver: where the yarns of a repeat lie once the cloth is strained.
//!
//! In: the repeat at rest, a strain of the cloth, and a state of nearby strain to start from. Out:
//! the data points of the strained repeat ([`State`]).
//!
//! Method: nonlinear least squares by Levenberg and Marquardt (Marquardt 1963, "An algorithm for
//! least-squares estimation of nonlinear parameters"), with damping after Nielsen (1999, "Damping
//! parameter in Marquardt's method"). Residuals are the length of each span, its two chords (the
//! yarn's bending), the distance of yarns that come nearer than touching, and a weak pull towards
//! the flat shape moved with the cloth. The repeat is a periodic cell that takes the strain as a
//! whole. Moves are limited to a part of a radius, and steps that bring yarns much nearer than
//! touching are refused, so yarns never pass through each other.
//!
//! Cost: some fifty iterations of a third of a millisecond for two bars. Not promised: the smallest
//! of all minima; the state is the one reached from the given start.

use std::rc::Rc;

use glam::{DMat2, DVec2, DVec3, Vec3Swizzles};

use super::Strain;
use super::contacts::NeighbourList;
use super::profile::{Profile, ProfileLayout};
use super::rest::{Rest, RestSpan};
use crate::knit::chain::blend;
use crate::yarn::curve;

/// Weights of the residuals: a change of a span's length by one, yarns at distance 0, a change of a
/// chord by a radius. Their ratios say what yields first: length hardly, contact a little, bends
/// freely.
const LENGTH: f64 = 100.0;
const ELASTIC_LENGTH: f64 = 1.0;
pub(super) const CONTACT: f64 = 30.0;
pub(super) const CHORDS: [f64; 2] = [0.3, 0.09];
/// Limit of the move of a point in one iteration, radii.
const MAX_MOVE: f64 = 0.3;
/// Yarns nearer than this, over touching, may have been about to pass through each other: the step
/// is refused.
const MIN_RATIO: f64 = 0.76;
/// Limit of iterations for a strain on the way, and for the last one.
const ITERATIONS: [usize; 2] = [8, 60];
/// The solver stops once an iteration lowers the energy by less than this share, and moves no point
/// by more than this many radii.
const ENERGY_TOLERANCE: f64 = 1e-3;
const MOVE_TOLERANCE: f64 = 0.05;
/// Share by which the energy falls at most in another turn, once a state is refined, and the turns.
const REFINED_TOLERANCE: f64 = 1e-6;
const MAX_REFINEMENTS: usize = 100;
/// Largest change of strain at a time.
const STRAIN_STEP: f64 = 0.05;
/// The damping starts here. Between these bounds it follows what steps gain.
const DAMPING: f64 = 1e-3;
const MIN_DAMPING: f64 = 1e-7;
const MAX_DAMPING: f64 = 1e6;

/// Turns by it point all ways, none of them twice: 137.5 degrees.
const GOLDEN_ANGLE: f64 = 2.4;
/// Shorter lengths have no direction, mm.
const MIN_LENGTH: f64 = 1e-12;

/// A strained repeat.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) strain: Strain,
    /// Data points in the axes of the flat cloth, mm.
    pub(super) points: Vec<DVec3>,
    /// Sum of squared residuals.
    pub(super) energy: f64,
    /// The largest change of a yarn's length, as a share of it.
    pub(super) stretch: f64,
    /// Least distance of two yarns over touching; infinite where none is nearer than the target.
    pub(super) nearest: f64,
}

/// The solver at one strain.
pub(super) struct StrainSolver<'a> {
    pub(super) rest: &'a Rest,
    /// The cloth's map from flat places to strained ones.
    pub(super) strain: DMat2,
    /// Data points of the strained repeat.
    pub(super) points: Vec<DVec3>,
    pub(super) samples: Vec<DVec3>,
    /// Weights of the four control points in each sample.
    pub(super) weights: Vec<[f64; 4]>,
    /// Yarn length from the start of the repeat to each sample, and of each yarn.
    pub(super) along: Vec<f64>,
    pub(super) lengths: Vec<f64>,
    /// Segments that may touch, and the wider list from which they are taken.
    pub(super) near: NeighbourList,
    pub(super) wide: NeighbourList,
    /// Where entries of the matrix stand, for points that share residuals with this list.
    layout: Rc<ProfileLayout>,
    /// Normal equations that are being filled, and those at the last step that was taken.
    normal: Normal,
    taken: Normal,
    /// The factors of the latter, damped.
    factors: Profile,
}

/// Normal equations: the matrix, and the gradient by points.
#[derive(Debug, Default)]
struct Normal {
    matrix: Profile,
    gradient: Vec<DVec3>,
}

impl Normal {
    /// Sets all to 0, for a matrix of this layout.
    fn reset(&mut self, layout: &Rc<ProfileLayout>) {
        self.matrix.reset(layout);
        self.gradient.clear();
        self.gradient.resize(layout.points(), DVec3::ZERO);
    }

    /// Adds a residual with its gradient by points.
    fn add(&mut self, residual: f64, entries: &[(u32, DVec3)]) {
        for &(point, derivative) in entries {
            self.gradient[point as usize] += derivative * residual;
        }
        self.matrix.add_product(entries);
    }
}

/// The damping of Levenberg and Marquardt. It follows the share of the expected gain that a step
/// brings (Nielsen 1999).
#[derive(Clone, Copy, Debug)]
struct Damping {
    /// By how much the diagonal of the matrix grows, as a share of it.
    factor: f64,
    /// By how much the next refused step raises it.
    rise: f64,
}

impl Default for Damping {
    fn default() -> Self {
        Self { factor: DAMPING, rise: 2.0 }
    }
}

impl Damping {
    /// After a step that brought this share of its expected gain, the damping's own part left out.
    fn taken(&mut self, gained: f64) {
        let change = 1.0 - (2.0 * gained - 1.0).powi(3);
        self.factor = (self.factor * change.max(1.0 / 3.0)).max(MIN_DAMPING);
        self.rise = 2.0;
    }

    /// After a step that was refused, or has no solution.
    fn refused(&mut self) {
        self.factor *= self.rise;
        self.rise *= 2.0;
    }
}

/// The sum of squared residuals, and the least distance of two yarns over touching; infinite where
/// none is nearer than the target.
#[derive(Clone, Copy, Debug)]
struct Energy {
    sum: f64,
    nearest: f64,
}

impl<'a> StrainSolver<'a> {
    pub(super) fn new(rest: &'a Rest) -> Self {
        let zero = vec![DVec3::ZERO; rest.samples];
        Self {
            rest,
            strain: DMat2::IDENTITY,
            points: rest.points.clone(),
            samples: zero,
            weights: vec![[0.0; 4]; rest.samples],
            along: vec![0.0; rest.samples],
            lengths: vec![0.0; rest.yarns.len()],
            near: NeighbourList::default(),
            wide: NeighbourList::default(),
            layout: Rc::default(),
            normal: Normal::default(),
            taken: Normal::default(),
            factors: Profile::default(),
        }
    }

    /// The four control points of a span.
    fn control(&self, span: &RestSpan) -> [DVec3; 4] {
        let period = self.strained(self.rest.yarns[span.yarn as usize].chain.period);
        span.control.places(&self.points, period)
    }

    /// A flat place moved with the cloth.
    pub(super) fn strained(&self, place: DVec3) -> DVec3 {
        (self.strain * place.xy()).extend(place.z)
    }

    /// Samples the curves at the points' present places.
    pub(super) fn sample(&mut self) {
        self.lengths.fill(0.0);
        for span in &self.rest.spans {
            let control = self.control(span);
            let weights = curve::weights(&control);
            let mut along = self.lengths[span.yarn as usize];
            let mut before = control[1];
            for step in 0..=span.segments {
                let at = (span.start + step) as usize;
                let shares = weights.at(f64::from(step) / f64::from(span.segments));
                let sample = blend(&control, &shares);
                along += before.distance(sample);
                before = sample;
                (self.weights[at], self.samples[at], self.along[at]) = (shares, sample, along);
            }
            self.lengths[span.yarn as usize] = along;
        }
    }

    /// The sampled length of a span.
    fn length(&self, span: &RestSpan) -> f64 {
        self.along[(span.start + span.segments) as usize] - self.along[span.start as usize]
    }

    /// The energy at the present places, without or with its gradient and matrix.
    fn evaluate(&mut self, with_matrix: bool) -> Energy {
        self.sample();
        if self.update_list() {
            self.layout = Rc::new(ProfileLayout::new(&self.neighbours()));
        }
        if with_matrix {
            self.normal.reset(&self.layout);
        }
        let mut sum = 0.0;
        for span in &self.rest.spans {
            sum += self.add_length(span, with_matrix) + self.add_chords(span, with_matrix);
        }
        let (contacts, nearest) = self.add_contacts(with_matrix);
        sum += contacts + self.add_pull(with_matrix);
        Energy { sum, nearest }
    }

    /// A yarn keeps the length of each span.
    fn add_length(&mut self, span: &RestSpan, with_matrix: bool) -> f64 {
        let is_elastic = self.rest.yarns[span.yarn as usize].is_elastic;
        let weight = if is_elastic { ELASTIC_LENGTH } else { LENGTH };
        let residual = weight * (self.length(span) / span.length - 1.0);
        if with_matrix {
            let mut derivatives = [DVec3::ZERO; 4];
            for at in span.start as usize..(span.start + span.segments) as usize {
                let along = self.samples[at + 1] - self.samples[at];
                let along = along * (weight / (along.length().max(MIN_LENGTH) * span.length));
                for (k, derivative) in derivatives.iter_mut().enumerate() {
                    *derivative += along * (self.weights[at + 1][k] - self.weights[at][k]);
                }
            }
            let entries: [_; 4] = std::array::from_fn(|k| (span.control.points[k], derivatives[k]));
            self.normal.add(residual, &entries);
        }
        residual * residual
    }

    /// A yarn keeps its bends: the distances of a control point to the next but one and the one
    /// after that.
    fn add_chords(&mut self, span: &RestSpan, with_matrix: bool) -> f64 {
        let radius = self.rest.yarns[span.yarn as usize].chain.radius;
        let control = self.control(span);
        let mut sum = 0.0;
        for (chord, far) in [2, 3].into_iter().enumerate() {
            let weight = self.rest.bending * CHORDS[chord] / radius;
            let across = control[far] - control[0];
            let length = across.length().max(MIN_LENGTH);
            let residual = weight * (length - span.chords[chord]);
            sum += residual * residual;
            if with_matrix {
                let derivative = across * (weight / length);
                let ends = [span.control.points[far], span.control.points[0]];
                let entries = [(ends[0], derivative), (ends[1], -derivative)];
                self.normal.add(residual, &entries);
            }
        }
        sum
    }

    /// Yarns keep apart. Returns also the least distance over touching.
    fn add_contacts(&mut self, with_matrix: bool) -> (f64, f64) {
        let (mut sum, mut nearest) = (0.0, f64::INFINITY);
        for at in 0..self.near.pairs.len() {
            let pair = self.near.pairs[at];
            let Some(contact) = self.contact(&pair, self.rest.target) else { continue };
            nearest = nearest.min(contact.ratio);
            let residual = CONTACT * (self.rest.target - contact.ratio);
            sum += residual * residual;
            if with_matrix {
                let [one, other] = pair.spans(self.rest);
                let apart = contact.direction * (CONTACT / pair.touching);
                let entries: [_; 8] = std::array::from_fn(|k| {
                    if k < 4 {
                        (one.control.points[k], apart * -contact.weights[0][k])
                    } else {
                        (other.control.points[k - 4], apart * contact.weights[1][k - 4])
                    }
                });
                self.normal.add(residual, &entries);
            }
        }
        (sum, nearest)
    }

    /// Points are pulled towards the flat shape moved with the cloth.
    fn add_pull(&mut self, with_matrix: bool) -> f64 {
        let weight = self.rest.pull / self.rest.thinnest;
        let mut sum = 0.0;
        for (at, &flat) in self.rest.points.iter().enumerate() {
            let apart = weight * (self.points[at] - self.strained(flat));
            sum += apart.length_squared();
            if with_matrix {
                self.normal.gradient[at] += weight * apart;
            }
        }
        if with_matrix {
            self.normal.matrix.damp(1.0, weight * weight);
        }
        sum
    }

    /// Iterates at one strain, at most `limit` times. Returns the energy.
    fn minimise(&mut self, limit: usize) -> f64 {
        let radius = self.rest.thinnest;
        let mut damping = Damping::default();
        let mut energy = self.evaluate(true);
        std::mem::swap(&mut self.taken, &mut self.normal);
        for _ in 0..limit {
            if damping.factor > MAX_DAMPING {
                break;
            }
            self.factors.copy_from(&self.taken.matrix);
            self.factors.damp(1.0 + damping.factor, 1e-9 * self.taken.matrix.largest());
            if !self.factors.factor() {
                damping.refused();
                continue;
            }
            let moves = self.factors.solve(&self.taken.gradient);
            let longest = moves.iter().map(|step| step.length()).fold(0.0, f64::max);
            let share = (MAX_MOVE * radius / longest.max(1e-300)).min(1.0);
            let before = self.points.clone();
            for (point, step) in self.points.iter_mut().zip(&moves) {
                *point -= *step * share;
            }
            // Two thirds of steps are taken, so the matrix is wanted.
            let next = self.evaluate(true);
            let passes = next.nearest < MIN_RATIO && next.nearest < energy.nearest;
            let is_better = next.sum <= energy.sum && !passes;
            if !is_better {
                self.points = before;
                damping.refused();
                continue;
            }
            let slope: f64 =
                moves.iter().zip(&self.taken.gradient).map(|(step, way)| step.dot(*way)).sum();
            damping.taken((energy.sum - next.sum) / (share * (2.0 - share) * slope).max(1e-300));
            let gain = (energy.sum - next.sum) / energy.sum.max(1e-12);
            let is_done = gain < ENERGY_TOLERANCE && share * longest < MOVE_TOLERANCE * radius;
            energy = next;
            std::mem::swap(&mut self.taken, &mut self.normal);
            if is_done || energy.sum < 1e-9 {
                break;
            }
        }
        energy.sum
    }

    /// Moves points aside, each its own way, so that a symmetric repeat may leave its symmetry.
    fn nudge(&mut self) {
        let far = self.rest.nudge * self.rest.thinnest;
        for (at, point) in (0..).zip(&mut self.points) {
            let way = DVec2::from_angle(GOLDEN_ANGLE * f64::from(at));
            *point += (far * way).extend(0.0);
        }
    }

    /// Sets the strain, and moves the points with the cloth.
    pub(super) fn set_strain(&mut self, strain: Strain) {
        let map = strain.map();
        let change = map * self.strain.inverse();
        for point in &mut self.points {
            *point = (change * point.xy()).extend(point.z);
        }
        self.strain = map;
    }

    /// Strained places in the axes of the flat cloth.
    pub(super) fn flat(&self, places: &[DVec3]) -> Vec<DVec3> {
        let back = self.strain.inverse();
        places.iter().map(|p| (back * p.xy()).extend(p.z)).collect()
    }
}

/// Measures the rest lengths of a repeat's spans and how near its yarns lie.
pub(super) fn measure_rest(rest: &mut Rest) {
    let mut solver = StrainSolver::new(rest);
    solver.evaluate(false);
    let lengths: Vec<_> = rest.spans.iter().map(|span| solver.length(span)).collect();
    let ratios = solver.near.pairs.iter().filter_map(|pair| solver.contact(pair, f64::INFINITY));
    let nearest = ratios.map(|contact| contact.ratio).fold(f64::INFINITY, f64::min);
    for (span, length) in rest.spans.iter_mut().zip(lengths) {
        span.length = length;
    }
    rest.target = nearest.min(1.0);
}

/// How far the curve of each span of the flat repeat leaves its chord, mm.
pub(super) fn bulges(rest: &Rest) -> Vec<f64> {
    let mut solver = StrainSolver::new(rest);
    solver.sample();
    let bulge = |span: &RestSpan| {
        let samples = &solver.samples[span.start as usize..=(span.start + span.segments) as usize];
        let (from, chord) = (samples[0], samples[samples.len() - 1] - samples[0]);
        let way = chord.normalize_or_zero();
        samples
            .iter()
            .map(|at| (at - from).reject_from_normalized(way).length())
            .fold(0.0, f64::max)
    };
    rest.spans.iter().map(bulge).collect()
}

/// The state without strain.
pub(super) fn flat(rest: &Rest) -> State {
    State {
        strain: Strain::NONE,
        points: rest.points.clone(),
        energy: 0.0,
        stretch: 0.0,
        nearest: rest.target,
    }
}

/// Solves for a strain, starting from a state of another one.
pub(super) fn solve(rest: &Rest, from: &State, strain: Strain) -> State {
    let mut solver = StrainSolver::new(rest);
    solver.points.clone_from(&from.points);
    // The flat state solves to itself, and no strain needs more than some dozen steps.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "strains are limited by the grid"
    )]
    let steps = (from.strain.distance(strain) / STRAIN_STEP - 1e-9).ceil().max(1.0) as u32;
    solver.set_strain(from.strain);
    solver.nudge();
    for step in 1..=steps {
        let share = f64::from(step) / f64::from(steps);
        solver.set_strain(from.strain.towards(strain, share));
        solver.minimise(ITERATIONS[usize::from(step == steps)]);
    }
    solver.state(strain)
}

/// Iterates on until the energy no longer falls: for what depends on the energy itself.
pub(super) fn refine(rest: &Rest, state: State) -> State {
    let mut solver = StrainSolver::new(rest);
    solver.points.clone_from(&state.points);
    solver.set_strain(state.strain);
    let mut energy = state.energy;
    for _ in 0..MAX_REFINEMENTS {
        let before = std::mem::replace(&mut energy, solver.minimise(ITERATIONS[1]));
        if before - energy <= REFINED_TOLERANCE * energy {
            break;
        }
    }
    solver.state(state.strain)
}

impl StrainSolver<'_> {
    /// The present state.
    fn state(&mut self, strain: Strain) -> State {
        let Energy { sum: energy, nearest } = self.evaluate(false);
        let points = self.flat(&self.points);
        State { strain, points, energy, stretch: self.stretch(), nearest }
    }

    /// The largest change of a yarn's length, as a share of it. Elastic yarns don't count.
    fn stretch(&self) -> f64 {
        let mut rest = vec![0.0; self.lengths.len()];
        for span in &self.rest.spans {
            rest[span.yarn as usize] += span.length;
        }
        let yarns = self.rest.yarns.iter().zip(self.lengths.iter().zip(&rest));
        let rigid = yarns.filter(|(yarn, _)| !yarn.is_elastic);
        rigid.map(|(_, (length, rest))| (length / rest - 1.0).abs()).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fabric::Fabric;
    use crate::knit::Pattern;
    use crate::knit::strain::rest_of;

    #[test]
    fn a_state_is_that_of_its_points_and_solving_on_only_lowers_its_energy() {
        let fabric = Fabric::named("tricot").unwrap();
        let mut rest = rest_of(&fabric, &Pattern::new(&fabric)).unwrap();
        measure_rest(&mut rest);
        for (courses, wales, shear) in [(1.1, 1.0, 0.0), (1.0, 1.0, 0.2), (0.8, 1.2, -0.2)] {
            // Of these ways some steps are refused, and the last iteration may be one.
            let state = solve(&rest, &flat(&rest), Strain { courses, wales, shear });
            let mut fresh = StrainSolver::new(&rest);
            fresh.points.clone_from(&state.points);
            fresh.set_strain(state.strain);
            let found = fresh.evaluate(false).sum;
            assert!((found - state.energy).abs() < 1e-6 * found, "{found} {}", state.energy);
            assert!(fresh.minimise(5) <= found);
        }
    }
}
