//! The yarn relaxation: a constraint solver that grows yarns from thin to their full radius and
//! keeps them apart.
//!
//! In: the yarns of one repeat as closed chains of data points, periodic along the wales and across
//! them, with their radii, and the shape that they would take with room enough. Out: the same
//! points, moved, and a [`Relaxation`] that says how the solver ended. A yarn's path is the
//! centripetal Catmull-Rom curve through its data points. The solver works on that curve itself, so
//! the path that is drawn is the path that was relaxed.
//!
//! Method: position-based dynamics (Müller, Heidelberger, Hennix and Ratcliff 2007, "Position based
//! dynamics") without inertia, solved by Gauss-Seidel iteration. One iteration is a sweep over the
//! constraints: curvature, contact, the shape of each yarn and its length. Radii start thin and
//! grow step by step, each step only while nothing is much nearer than the radii of the moment. No
//! point moves by more than a fifth of its radius in a sweep. So yarns never pass through each
//! other, and the links of the layout stay.
//!
//! Cost: sweeps times pairs in the neighbour list, about a millisecond a lap of one or two bars and
//! some more for each further bar. Sweeps run in a fixed order on one thread, so the result is the
//! same on every machine.
//!
//! Not promised: that yarns reach their full radius ([`Relaxation::grown`] says how far they came,
//! [`super::clearance`] what they cut), nor loops that interlock where the input does not interlock
//! them ([`super::links`] counts those).

mod contacts;
mod curves;
mod shape;

use glam::{DVec2, DVec3};

use super::Progress;
use super::chain::ControlChain;
use contacts::ContactPair;
use curves::{ChainSpan, CurveSegment};

/// Distance that a contact aims at, over the sum of the radii. Segments are chords that lie inside
/// the bends of the curve, so at 1 the curves themselves would still cut. Larger values make cloth
/// thicker than its yarns are.
const TARGET_DISTANCE: f64 = 1.05;
/// Convergence tolerance: the solver stops once the nearest pair is at this distance over the sum
/// of the radii. It lies between touching (1) and [`TARGET_DISTANCE`]. Contacts are solved softly
/// and reach their target only in the limit, so a tolerance near the target is never met.
const TOLERANCE: f64 = 1.01;
/// Convergence tolerance of bends: the largest curvature over that of a bend with the yarn's
/// radius. At 1.03 bends of the drawn curve, measured between the places that the solver looks at,
/// keep over 0.95 of that radius.
const BEND_TOLERANCE: f64 = 1.03;
/// Convergence tolerance of lengths that are given, as a share of them.
const FEED_TOLERANCE: f64 = 0.008;
/// Radii of the first sweeps at least, over the full ones. Yarns that are laid out in the same place
/// start apart by so much; what lies right in front of another has to be farther away in the input.
const START: f64 = 0.15;
/// Share by which radii grow at a time. Larger steps take fewer sweeps, until contacts lag behind
/// and growth waits for them; at 0.12 it hardly ever does.
const GROWTH_STEP: f64 = 0.12;
/// Radii grow once the nearest pair is at this share of the distance that they ask for. A yarn that
/// came much nearer could be pushed out on the wrong side. Near [`TOLERANCE`] growth would wait
/// long for the last pair.
const GROWTH_CLEARANCE: f64 = 0.965;
/// Sweeps between two looks at the nearest pair. More of them let pairs meet that are not in the
/// list; fewer spend the time on looking.
const SWEEPS_PER_STEP: u32 = 8;
/// The solver gives up after so many looks in which neither the nearest pair nor the tightest bend
/// has become better by [`PROGRESS`]: some spots have no room.
const MAX_LOOKS_IN_VAIN: usize = 15;
const PROGRESS: f64 = 2e-3;
/// Limit of all sweeps. Fabrics whose yarns fit take one to six hundred.
const MAX_SWEEPS: usize = 1200;
/// Factor of the stiffness of stretch and bending from one sweep to the next, in sweeps that do not
/// grow. It fades so that contacts are satisfied in the end. At 1 the solver stalls where
/// constraints contradict each other; at much lower values yarns lose their shapes before they are
/// apart.
const STIFFNESS_DECAY: f64 = 0.8;
/// Share by which a press closes at a time.
const PRESS_STEP: f64 = 0.02;
/// Share by which the tolerance of lengths that are not given grows with each look at cloth that
/// does not fit: by half over some hundred sweeps.
const YIELDING: f64 = 0.03;
/// Thickness over the wanted one at which the press stops.
const PRESS_TOLERANCE: f64 = 1.005;
/// Stiffness below which stretch and bending no longer move anything that can be seen.
const FADED: f64 = 1e-3;
/// Above this number of candidates for one list, or of pairs in it, for each segment, whole yarns
/// lie in each other's place. Nothing pushes these apart, so the solver gives up.
const MAX_CANDIDATES: usize = 20_000;
const MAX_PAIRS: usize = 2_000;

/// One yarn of the repeat, and what sets its length.
#[derive(Clone, Debug)]
pub(super) struct YarnChain {
    pub(super) chain: ControlChain,
    pub(super) length: YarnLength,
}

/// All yarns of a repeat.
#[derive(Clone, Debug)]
pub(super) struct RelaxedCloth<'a> {
    pub(super) yarns: &'a [YarnChain],
    /// Size of the repeat, mm.
    pub(super) cell: DVec2,
    /// The distance of two planes that press it, mm.
    pub(super) press: Option<f64>,
}

/// What sets the length of a yarn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum YarnLength {
    /// Its shape. Like all yarn that is fed, it may take or give a little.
    Shape,
    /// The feed: mm a repeat.
    Fed(f64),
    /// Its shape, and this share more.
    Slack(f64),
    /// Its tension, which pulls it as straight as the other yarns allow.
    Taut,
    /// Its draft, which pulls it straight, so that the other yarns give way.
    Drafted,
}

impl YarnLength {
    /// Whether tension draws the yarn straight, so that it keeps to no shape.
    fn is_tense(self) -> bool {
        matches!(self, Self::Taut | Self::Drafted)
    }
}

/// How the relaxation ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relaxation {
    /// Sweeps over all constraints.
    pub sweeps: usize,
    /// The largest difference of a yarn's length from that of its shape or its feed, as a share of
    /// it. Yarns under tension have none.
    pub stretch: f64,
    /// The share of their radii to which yarns could grow: 1 where they fit.
    pub grown: f64,
    /// Least distance of two yarns over the sum of their radii, as the solver sees it: infinite
    /// where no two are near.
    pub nearest: f64,
    /// From the lowest to the highest surface of the yarns, mm.
    pub thickness: f64,
}

/// Moves `points` until no two yarns are nearer than they are thick and no bend is too tight, or a
/// limit is reached. `shape` holds the same points as they would lie with room enough. Returns also
/// the data point at which two yarns are nearest.
pub(super) fn relax(
    points: &mut [DVec3],
    shape: &[DVec3],
    cloth: &RelaxedCloth<'_>,
    progress: Progress<'_>,
) -> (Relaxation, Option<usize>) {
    let press = cloth.press;
    let mut solver = Solver::new(points, shape, cloth.yarns, cloth.cell);
    let mut sweeps = 0;
    let mut gave_up = false;
    let mut stiffness = 1.0;
    let mut grown = START;
    let mut thickness = f64::INFINITY;
    // The nearest pair, the tightest bend and the worst feed since shapes have faded, and looks
    // without a better.
    let (mut best, mut looks_in_vain) = ([0.0_f64, f64::INFINITY, f64::INFINITY], 0);
    while sweeps < MAX_SWEEPS {
        progress(share_done(grown, stiffness));
        solver.sample();
        let Some(nearest) = solver.nearest() else {
            gave_up = true;
            break;
        };
        let bend = solver.find_bends(grown);
        let is_grown = grown >= 1.0;
        let is_pressed = press.is_none_or(|press| solver.thickness() <= press * PRESS_TOLERANCE);
        let misfed = solver.misfed();
        let is_fed = misfed <= FEED_TOLERANCE;
        if is_grown && is_pressed && is_fed && nearest >= TOLERANCE && bend <= BEND_TOLERANCE {
            break;
        }
        // Radii grow only while nothing is much nearer than they are now: what lies in front of
        // another yarn stays there.
        let has_room = nearest >= GROWTH_CLEARANCE * grown;
        if has_room && !is_grown {
            grown = ((1.0 + GROWTH_STEP) * grown).max(nearest).min(1.0);
        } else if has_room && let Some(press) = press {
            // The planes close step by step too. They hold the data points, and the curve between
            // bulges a little beyond them.
            if solver.thickness() > press * PRESS_TOLERANCE {
                thickness = thickness.min(solver.thickness()) * (1.0 - PRESS_STEP);
            }
        }
        let is_waiting = is_grown || !has_room;
        if is_grown && is_pressed && is_fed && stiffness <= FADED {
            solver.find_active();
        }
        if stiffness <= FADED {
            let is_better = nearest > best[0] + PROGRESS
                || bend < best[1] - PROGRESS
                || misfed < best[2] - PROGRESS;
            best = [best[0].max(nearest), best[1].min(bend), best[2].min(misfed)];
            looks_in_vain = if is_better { 0 } else { looks_in_vain + 1 };
            if looks_in_vain > MAX_LOOKS_IN_VAIN {
                break;
            }
            // What still does not fit needs yarn, or gives some.
            solver.length_tolerance *= 1.0 + YIELDING;
        }
        solver.choose_pairs();
        for _ in 0..SWEEPS_PER_STEP {
            solver.sweep(grown, stiffness, thickness);
            if is_waiting {
                stiffness *= STIFFNESS_DECAY;
            }
        }
        sweeps += SWEEPS_PER_STEP as usize;
    }
    solver.sample();
    // Too many pairs are no distance at all.
    let nearest = if gave_up { 0.0 } else { solver.nearest().unwrap_or(0.0) };
    let (stretch, thickness) = (solver.stretch(), solver.thickness());
    (Relaxation { sweeps, stretch, grown, nearest, thickness }, solver.tightest())
}

/// The share of the work that is done, roughly: half of it is growth, half comes after it.
fn share_done(grown: f64, stiffness: f64) -> f64 {
    0.5 * (grown - START) / (1.0 - START) + 0.5 * stiffness.max(FADED).log(FADED)
}

/// The state of the solver: structure of arrays.
struct Solver<'a> {
    points: &'a mut [DVec3],
    yarns: &'a [YarnChain],
    cell: DVec2,
    /// One for each data point: the span that starts there.
    spans: Vec<ChainSpan>,
    segments: Vec<CurveSegment>,
    /// For each sample, the weights of its span's four control points.
    weights: Vec<[f64; 4]>,
    /// Samples of the curves.
    samples: Vec<DVec3>,
    /// Length of each yarn's repeat.
    lengths: Vec<f64>,
    /// The length of each yarn over that of its chords.
    lengths_over_chords: Vec<f64>,
    /// The length that each yarn should have, mm a repeat.
    rest_lengths: Vec<f64>,
    /// Lengths of the chords that make up that length.
    rest_chords: Vec<f64>,
    /// The data points of the shape.
    rest_points: Vec<DVec3>,
    /// Tolerance of the length of a yarn that keeps to its shape, as a share of it.
    length_tolerance: f64,
    /// The data points before this sweep.
    before: Vec<DVec3>,
    /// The data points when the neighbour list was built.
    list_points: Vec<DVec3>,
    /// The data points when the curves were sampled.
    sampled_points: Vec<DVec3>,
    /// Whether a span was sampled anew at the last look.
    moved: Vec<bool>,
    /// The length of each span.
    span_lengths: Vec<f64>,
    /// The largest curvature of each span.
    curvatures: Vec<f64>,
    /// The same over that of a bend with the yarn's radius at the last look.
    bends: Vec<f64>,
    /// Whether a span still takes part in sweeps.
    active: Vec<bool>,
    /// The neighbour list.
    pairs: Vec<ContactPair>,
    /// For each pair, the distance over the sum of the radii at the last look.
    ratios: Vec<f64>,
    /// The pairs that take part in sweeps.
    swept_pairs: Vec<u32>,
}

impl Solver<'_> {
    /// One iteration over all constraints. `grown` is the share of their radii that yarns have,
    /// `stiffness` that of the constraints which fade, `thickness` the distance of the planes that
    /// press the cloth, mm.
    fn sweep(&mut self, grown: f64, stiffness: f64, thickness: f64) {
        self.before.clear();
        self.before.extend_from_slice(self.points);
        self.solve_curvature(grown);
        self.solve_contacts(grown);
        if stiffness > FADED {
            self.solve_stretch(stiffness);
            self.solve_bending(stiffness);
        }
        self.solve_lengths();
        self.press(thickness);
        self.limit_moves(grown);
    }
}

#[cfg(test)]
mod tests {
    use std::ops::Range;

    use super::*;
    use crate::ids::index32;
    use crate::knit::clearance::SampledPaths;

    const CELL: DVec2 = DVec2::new(1.0, 1.0);

    /// Relaxes yarns that keep the shape in which they come.
    fn relaxed(points: &mut [DVec3], yarns: &[YarnChain], cell: DVec2) -> Relaxation {
        let shape = points.to_vec();
        relax(points, &shape, &RelaxedCloth { yarns, cell, press: None }, &mut |_| ()).0
    }

    /// A straight yarn up the cell through `points` places.
    fn upright(x: f64, z: f64, points: usize) -> Vec<DVec3> {
        (0..points)
            .map(|i| DVec3::new(x, f64::from(index32(i)) / f64::from(index32(points)), z))
            .collect()
    }

    fn chain(points: Range<usize>, radius: f64) -> YarnChain {
        let chain = ControlChain { points, period: DVec3::Y, radius };
        YarnChain { chain, length: YarnLength::Shape }
    }

    #[test]
    fn yarns_that_overlap_side_by_side_end_up_touching() {
        let mut points = [upright(0.5, 0.0, 4), upright(0.55, 0.01, 4)].concat();
        let relaxation = relaxed(&mut points, &[chain(0..4, 0.05), chain(4..8, 0.05)], CELL);
        // They may slide along each other.
        for (a, b) in points[..4].iter().zip(&points[4..]) {
            let apart = DVec2::new(a.x - b.x, a.z - b.z).length();
            assert!((0.1..0.14).contains(&apart), "{apart}");
        }
        assert!(relaxation.sweeps > 0 && relaxation.stretch < 0.001);
    }

    #[test]
    fn a_yarn_keeps_clear_of_its_own_image_in_the_next_repeat() {
        // It bulges over the cell's right border towards the image's straight part.
        let mut points: Vec<_> = upright(0.05, 0.0, 16);
        (points[7].x, points[8].x, points[9].x) = (0.55, 1.04, 0.55);
        let before = points.clone();
        relaxed(&mut points, &[chain(0..16, 0.06)], CELL);
        let least = |points: &[DVec3]| {
            let mut paths = SampledPaths::default();
            // The yarn and its image, over three repeats.
            for image in [DVec3::ZERO, DVec3::X] {
                let run = (-1..2).flat_map(|repeat| {
                    points.iter().map(move |p| *p + image + DVec3::Y * f64::from(repeat))
                });
                paths.add(&run.collect::<Vec<_>>(), 0.06, |_| true);
            }
            paths.clearance(|p| DVec2::new(0.0, p.y).floor().as_i64vec2()).min_over_2r
        };
        assert!(
            least(&before) < 0.6 && least(&points) > 0.98,
            "{} before, {} after",
            least(&before),
            least(&points)
        );
    }

    #[test]
    fn yarns_apart_are_left_as_they_are() {
        let mut points = [upright(0.2, 0.0, 3), upright(0.7, 0.0, 5)].concat();
        let before = points.clone();
        let relaxation = relaxed(&mut points, &[chain(0..3, 0.1), chain(3..8, 0.1)], CELL);
        assert_eq!(points, before);
        assert_eq!((relaxation.grown, relaxation.stretch), (1.0, 0.0));
        assert!(relaxation.nearest == f64::INFINITY && (relaxation.thickness - 0.2).abs() < 1e-12);
    }

    #[test]
    fn what_lies_in_the_same_place_stays_finite() {
        let mut points =
            [upright(0.5, 0.0, 3), upright(0.5, 0.0, 3), upright(0.5, 0.0, 3)].concat();
        let chains = [chain(0..3, 0.05), chain(3..6, 0.05), chain(6..9, 0.02)];
        let relaxation = relaxed(&mut points, &chains, CELL);
        assert!(points.iter().all(|p| p.is_finite()) && relaxation.stretch < 0.02);
    }
}
