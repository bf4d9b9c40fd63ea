//! The shape of yarns in the solver: curvature, stretch, bending and length.
//!
//! In: the data points, and those of the shape that yarns would take with room enough. Out: moves
//! of the data points. Cost: linear in the data points.

use glam::DVec3;

use super::{Solver, YarnLength};
use crate::knit::chain::blend;
use crate::yarn::curve::{self, Weights};

/// Least radius of the bends of a yarn, over its own. Real yarns bend no tighter than their radius:
/// their inner side would fold.
const MIN_BEND_RADIUS: f64 = 1.05;
/// Share of the excess curvature that a sweep takes away.
const CURVATURE_STIFFNESS: f64 = 0.5;
/// Places in each span at which its curvature is held. The curvature of a cubic is largest at its
/// ends or near its middle.
const CURVATURE_PLACES: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
/// Places at which all bends are looked at, less one.
const BEND_LOOKS: u8 = 8;
/// Spans with less than this curvature, over that of a bend with the yarn's radius, are left alone
/// until the next look.
const EASY_BEND: f64 = 0.7;
/// Limit of a data point's move in one sweep, radii. Two yarns that touch, and move towards each
/// other by so much, still lie on their own sides.
const MAX_STEP: f64 = 0.2;
/// Tolerance of the length of a yarn that keeps to its shape, as a share of it, at the start.
pub(super) const LENGTH_TOLERANCE: f64 = 0.012;
/// The same for yarns of which the length is given. It is less than the solver's tolerance at the
/// end, so that they come there.
const FEED_DEAD_ZONE: f64 = 0.002;
/// Limit of the share by which a sweep changes a yarn's length. Contacts hold against such a pull.
/// With more, a run-in that is far too short would pull loops out of each other.
const MAX_FEED_STEP: f64 = 0.01;
/// Stiffness of stretch and bending in the first sweep (0 to 1). Higher values pull yarns back into
/// each other; at 0 contacts crumple the yarns.
const STRETCH_STIFFNESS: f64 = 0.15;
const BENDING_STIFFNESS: f64 = 0.12;
/// Share of the way to the middle of its neighbours that tension draws a point in the first sweep.
const TENSION_STIFFNESS: f64 = 0.3;

impl Solver<'_> {
    /// Looks at all bends. Returns the largest curvature, over that of a bend with the yarn's
    /// radius.
    pub(super) fn find_bends(&mut self, grown: f64) -> f64 {
        let bends = self.spans.iter().zip(&self.curvatures).map(|(span, curvature)| {
            curvature * self.yarns[span.yarn as usize].chain.radius * grown
        });
        self.bends = bends.collect();
        self.bends.iter().copied().fold(0.0, f64::max)
    }

    /// Curvature constraints: opens bends that are tighter than the yarn's radius allows. Spans that
    /// are far from a tight bend wait for the next look.
    pub(super) fn solve_curvature(&mut self, grown: f64) {
        for number in 0..self.spans.len() {
            if self.active[number] && self.bends[number] > EASY_BEND {
                self.open_bend(number, grown);
            }
        }
    }

    /// Opens the bends of one span.
    fn open_bend(&mut self, number: usize, grown: f64) {
        let span = self.spans[number];
        let radius = self.yarns[span.yarn as usize].chain.radius * grown;
        let limit = 1.0 / (MIN_BEND_RADIUS * radius);
        for t in CURVATURE_PLACES {
            let control = self.control_points(&span);
            let [first, second] = curve::weights(&control).derivatives(t);
            let (u, v) = (blend(&control, &first), blend(&control, &second));
            let (speed, curvature) = (u.length().max(1e-12), curvature(u, v));
            if curvature <= limit {
                continue;
            }
            // Projection of the constraint (Müller et al. 2007, section 3.3). The derivatives are
            // weighted sums of the control points while the knots are taken as constant.
            let axis = u.cross(v).normalize_or(DVec3::Z);
            let by_first = v.cross(axis) / speed.powi(3) - 3.0 * curvature * u / (speed * speed);
            let by_second = axis.cross(u) / speed.powi(3);
            let gradients: [DVec3; 4] =
                std::array::from_fn(|k| first[k] * by_first + second[k] * by_second);
            let squared: f64 = gradients.iter().map(|gradient| gradient.length_squared()).sum();
            for (point, gradient) in span.control.points.into_iter().zip(gradients) {
                let step = gradient * (CURVATURE_STIFFNESS * (curvature - limit) / squared);
                self.points[point as usize] -= step.clamp_length_max(MAX_STEP * radius);
            }
        }
    }

    /// Stretch constraints: pulls neighbouring data points to their distance in the shape (the
    /// distance constraint of Müller et al. 2007).
    pub(super) fn solve_stretch(&mut self, stiffness: f64) {
        for number in 0..self.spans.len() {
            let span = self.spans[number];
            if self.yarns[span.yarn as usize].length.is_tense() {
                continue;
            }
            let chord = self.chord(number);
            let length = chord.length().max(1e-9);
            // Both ends have the same mass, so each takes half of the correction.
            let share = 0.5 * STRETCH_STIFFNESS * stiffness;
            let pull = chord * (share * (length - self.rest_chords[number]) / length);
            let [_, from, to, _] = span.control.points.map(|point| point as usize);
            self.points[from] += pull;
            self.points[to] -= pull;
        }
    }

    /// Bending constraints: evens out the displacements of neighbouring data points, so that bends
    /// keep their shape. Yarns under tension have none to keep: they are drawn straight.
    pub(super) fn solve_bending(&mut self, stiffness: f64) {
        for number in 0..self.spans.len() {
            let span = self.spans[number];
            let [before, at, after, _] = span.control.points.map(|point| point as usize);
            if self.yarns[span.yarn as usize].length.is_tense() {
                let [before, here, after, _] = self.control_points(&span);
                let pull = TENSION_STIFFNESS * stiffness * (before.midpoint(after) - here);
                self.points[at] += pull;
                continue;
            }
            // The constraint keeps each point's discrete Laplacian as it is in the shape. An angle
            // constraint would straighten loops, since it does not know their rest shape. Whole
            // yarns may move freely: equal displacements give no pull.
            let pull = BENDING_STIFFNESS
                * stiffness
                * (self.displacement(before).midpoint(self.displacement(after))
                    - self.displacement(at));
            self.points[at] += pull;
        }
    }

    /// How far a data point has moved from where its shape has it.
    fn displacement(&self, point: usize) -> DVec3 {
        self.points[point] - self.rest_points[point]
    }

    /// Length constraints: brings yarns that grew or shrank by more than the tolerance back to
    /// their lengths, along the gradient of the length.
    pub(super) fn solve_lengths(&mut self) {
        for (number, yarn) in self.yarns.iter().enumerate() {
            if !self.active[yarn.chain.points.clone()].contains(&true) {
                continue;
            }
            // The length of the chords stands for that of the curve: it has a simple gradient, and
            // from one look at the curve to the next both change in proportion.
            let chords: Vec<_> = yarn.chain.points.clone().map(|span| self.chord(span)).collect();
            let now: f64 = chords.iter().map(|chord| chord.length()).sum();
            let rest = self.rest_lengths[number] / self.lengths_over_chords[number];
            // An inequality constraint: within the tolerance a yarn may take or give length, as
            // real yarn slips through its loops. Nothing happens there.
            let change = now / rest - 1.0;
            let excess = match yarn.length {
                YarnLength::Shape => {
                    change - change.clamp(-self.length_tolerance, self.length_tolerance)
                }
                YarnLength::Fed(_) | YarnLength::Slack(_) => {
                    change - change.clamp(-FEED_DEAD_ZONE, FEED_DEAD_ZONE)
                }
                YarnLength::Drafted => change.max(0.0),
                YarnLength::Taut => 0.0,
            };
            let excess = excess.clamp(-MAX_FEED_STEP, MAX_FEED_STEP);
            if excess == 0.0 {
                continue;
            }
            let gradient_squared: f64 =
                (0..chords.len()).map(|i| length_gradient(&chords, i).length_squared()).sum();
            // A straight yarn has no gradient: no small move of its points changes its length.
            if gradient_squared < 1e-12 {
                continue;
            }
            let step = 0.5 * excess * rest / gradient_squared;
            for (i, point) in self.points[yarn.chain.points.clone()].iter_mut().enumerate() {
                *point -= length_gradient(&chords, i) * step;
            }
        }
    }

    /// Presses the cloth between two planes at a distance of `thickness`, mm.
    pub(super) fn press(&mut self, thickness: f64) {
        if thickness == f64::INFINITY {
            return;
        }
        let (low, high) = self
            .points
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |all, p| (all.0.min(p.z), all.1.max(p.z)));
        let middle = low.midpoint(high);
        for yarn in self.yarns {
            let reach = (thickness / 2.0 - yarn.chain.radius).max(0.0);
            for point in &mut self.points[yarn.chain.points.clone()] {
                point.z = point.z.clamp(middle - reach, middle + reach);
            }
        }
    }

    /// Takes back what a data point moved in this sweep beyond the limit.
    pub(super) fn limit_moves(&mut self, grown: f64) {
        for yarn in self.yarns {
            let limit = MAX_STEP * grown * yarn.chain.radius;
            for at in yarn.chain.points.clone() {
                let before = self.before[at];
                self.points[at] = before + (self.points[at] - before).clamp_length_max(limit);
            }
        }
    }
}

/// Curvature of a curve with the derivatives `u` and `v`.
fn curvature(u: DVec3, v: DVec3) -> f64 {
    u.cross(v).length() / u.length().max(1e-12).powi(3)
}

/// The largest curvature of a span.
pub(super) fn largest_curvature(control: &[DVec3; 4], weights: &Weights) -> f64 {
    let places = (0..=BEND_LOOKS).map(|at| f64::from(at) / f64::from(BEND_LOOKS));
    let curvatures = places.map(|t| {
        let [u, v] = weights.derivatives(t).map(|weights| blend(control, &weights));
        curvature(u, v)
    });
    curvatures.fold(0.0, f64::max)
}

/// Gradient of a closed chain's length for its `i`th point, from which chord `i` starts.
fn length_gradient(chords: &[DVec3], i: usize) -> DVec3 {
    let count = chords.len();
    chords[(i + count - 1) % count].normalize_or_zero() - chords[i].normalize_or_zero()
}
