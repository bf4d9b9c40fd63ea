//! Cloth pulled along its courses: how much narrower it gets along its wales, and its yarns then.
//!
//! In: a fabric and its relaxed [`Pattern`]. Out: a [`Puller`], which gives the stretched cloth at a
//! [`Strain`] as a fabric and a pattern of their own ([`Puller::at`]), and the strains at which the
//! cloth is free along the wales ([`Puller::free`]).
//!
//! Method: at a pull the repeat is solved at several widths along the wales, each from the last one.
//! A parabola through three energies gives the width of the least. The energy is that of the solver:
//! yarns resist changes of length, contact, and changes of their bends, and are pulled weakly
//! towards the flat shape. The result depends on how much bends resist beside contact
//! ([`Puller::with_bending`]). So it is a model's answer and not a measurement. With a tenth of the
//! pull towards the flat shape curves jump by 0.03 between states that lie side by side.
//!
//! Cost: some tenths of a second a pull for two bars. Not promised: friction and the set that heat
//! gives to yarns. Both make real cloth narrow less or more than here.

use glam::{DVec2, Vec3Swizzles};

use super::link_check::LinkCheck;
use super::rest::Rest;
use super::solver::{self, State};
use super::table::{MAX_POINTS, lock};
use super::{Strain, rest_of};
use crate::fabric::{Fabric, Structure};
use crate::ids::index32;
use crate::knit::{Pattern, Progress};

/// How much bends resist, unless [`Puller::with_bending`] says otherwise: a bend whose chord changes
/// by a radius takes as much energy as two yarns pressed together by this share of touching.
pub const BENDING: f64 = solver::CHORDS[0] / solver::CONTACT;
/// Largest step from one pull to the next.
const PULL_STEP: f64 = 0.05;
/// Distance between widths whose energies are compared. Under a hundredth the energies differ by
/// little more than the solver's tolerance; over a twentieth they are no parabola.
const PROBE: f64 = 0.02;
/// A state has converged when solving it again leaves at least this share of its energy.
const CONVERGED: f64 = 0.99;
/// How often a state is solved again at most.
const MOST_TRIES: usize = 8;
/// Parabolas for one pull at most. Two are the rule.
const MOST_PARABOLAS: usize = 12;

/// A fabric that can be pulled.
#[derive(Debug)]
pub struct Puller<'a> {
    fabric: &'a Fabric,
    pattern: &'a Pattern,
    rest: Rest,
    links: LinkCheck,
}

/// A pulled cloth.
#[derive(Clone, Debug)]
pub struct Pulled {
    /// The fabric at the densities that it is pulled to, without run-ins of its own: the yarn is
    /// that of the flat cloth.
    pub fabric: Fabric,
    /// Its repeat, as wide and as long as pulled.
    pub pattern: Pattern,
    /// Whether the cloth is locked: its yarn would have to stretch, or its loops would come apart.
    pub is_locked: bool,
}

impl<'a> Puller<'a> {
    /// A fabric and its relaxed repeat. Nothing where [`super::StrainTable::new`] gives nothing, or
    /// where the repeat is too large to be solved ([`super::StrainTable::is_flat_only`]).
    #[must_use]
    pub fn new(fabric: &'a Fabric, pattern: &'a Pattern) -> Option<Self> {
        let mut rest = rest_of(fabric, pattern).filter(|rest| rest.points.len() <= MAX_POINTS)?;
        solver::measure_rest(&mut rest);
        let links = LinkCheck::new(fabric, pattern);
        Some(Self { fabric, pattern, rest, links })
    }

    /// The same cloth with yarns whose bends resist so many times as much.
    #[must_use]
    pub fn with_bending(mut self, factor: f64) -> Self {
        self.rest.bending = factor;
        self
    }

    /// The strains of pulls from 1 to `last` at which the cloth is free along the wales: flat cloth
    /// first, and a strain each twentieth.
    ///
    /// ```
    /// use warpknit_core::fabric::Fabric;
    /// use warpknit_core::knit::{Pattern, strain::pull::Puller};
    /// let jersey = Fabric::named("jersey").unwrap();
    /// let pattern = Pattern::new(&jersey);
    /// let free = Puller::new(&jersey, &pattern).unwrap().free(1.1, &mut |_| ());
    /// assert_eq!(free.len(), 3);
    /// assert!(free[2].courses == 1.1 && free[2].wales < free[1].wales);
    /// ```
    #[must_use]
    pub fn free(&self, last: f64, progress: Progress<'_>) -> Vec<Strain> {
        let pulls = pulls_to(last);
        let mut state = solver::flat(&self.rest);
        let mut free = vec![state.strain];
        for (done, &courses) in (1..).zip(&pulls) {
            let guess = extrapolated(&free, courses);
            state = self.freed(&state, courses, guess);
            free.push(state.strain);
            progress(f64::from(done) / f64::from(index32(pulls.len())));
        }
        free
    }

    /// The state of least energy at a pull.
    fn freed(&self, from: &State, courses: f64, guess: f64) -> State {
        let at =
            |from: &State, wales: f64| self.converged(from, Strain { courses, wales, shear: 0.0 });
        let mut middle = at(from, guess);
        for _ in 0..MOST_PARABOLAS {
            let wales = middle.strain.wales;
            let [less, more] = [wales - PROBE, wales + PROBE].map(|wales| at(&middle, wales));
            let slope = more.energy - less.energy;
            let bend = more.energy - 2.0 * middle.energy + less.energy;
            // Downhill, where the energies don't enclose the least one.
            let shift = if bend > 0.0 { -0.5 * slope / bend } else { -2.0 * slope.signum() };
            middle = at(&middle, wales + PROBE * shift.clamp(-2.0, 2.0));
            if shift.abs() <= 1.0 {
                break;
            }
        }
        middle
    }

    /// The state at a strain, solved anew from itself until that leaves nearly all of its energy.
    /// Where loops are about to leave their symmetry the solver stops before they have, and each new
    /// solution moves those of weft knits aside again.
    fn converged(&self, from: &State, strain: Strain) -> State {
        let solved =
            |from: &State| solver::refine(&self.rest, solver::solve(&self.rest, from, strain));
        let mut state = solved(from);
        for _ in 0..MOST_TRIES {
            let next = solved(&state);
            let is_converged = next.energy >= CONVERGED * state.energy;
            if next.energy < state.energy {
                state = next;
            }
            if is_converged {
                break;
            }
        }
        state
    }

    /// The cloth at a strain without shear.
    #[must_use]
    pub fn at(&self, strain: Strain) -> Pulled {
        let state = self.converged(&solver::flat(&self.rest), strain);
        let mut fabric = Fabric {
            wales_per_cm: self.fabric.wales_per_cm / strain.courses,
            courses_per_cm: self.fabric.courses_per_cm / strain.wales,
            ..self.fabric.clone()
        };
        if let Structure::Warp(knit) = &mut fabric.structure {
            // Given run-ins were asked of the flat cloth. At other densities they may not fit.
            knit.bars.iter_mut().for_each(|bar| bar.run_in = None);
        }
        Pulled {
            fabric,
            pattern: self.pattern.pulled(&state),
            is_locked: lock(&self.rest, &self.links, &state) > 1.0,
        }
    }
}

impl Pattern {
    /// The repeat in a state of the solver.
    fn pulled(&self, state: &State) -> Self {
        let Strain { courses, wales, .. } = state.strain;
        let scale = DVec2::new(courses, wales);
        let mut pulled = self.clone();
        for (point, own) in state.points.iter().zip(&mut pulled.repeat.points) {
            *own = (scale * point.xy()).extend(point.z);
        }
        for yarn in &mut pulled.repeat.yarns {
            yarn.period = (scale * yarn.period.xy()).extend(yarn.period.z);
        }
        pulled.spacing *= scale;
        pulled.measure_bounds();
        pulled
    }
}

/// Pulls from the first one over 1 to the last.
fn pulls_to(last: f64) -> Vec<f64> {
    let step = PULL_STEP.copysign(last - 1.0);
    let whole = (1..).map(|count| 1.0 + step * f64::from(count));
    let before = |pull: &f64| (last - pull) * step.signum() > 1e-9;
    let last = (last != 1.0).then_some(last);
    whole.take_while(before).chain(last).collect()
}

/// The width at a pull on the line through the last two.
fn extrapolated(free: &[Strain], courses: f64) -> f64 {
    match free {
        [.., before, last] => {
            let slope = (last.wales - before.wales) / (last.courses - before.courses);
            last.wales + slope * (courses - last.courses)
        }
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::knit::{links, numbers};

    /// Widths along the wales of a fabric's pulls to 1.2.
    fn widths(name: &str, bending: f64) -> Vec<f64> {
        let fabric = Fabric::named(name).unwrap();
        let pattern = Pattern::new(&fabric);
        let puller = Puller::new(&fabric, &pattern).unwrap().with_bending(bending);
        puller.free(1.2, &mut |_| ()).iter().map(|strain| strain.wales).collect()
    }

    /// Checks that widths change from pull to pull by as much as before, but for `most`.
    fn assert_smooth(what: &str, widths: &[f64], most: f64) {
        assert_eq!((widths.len(), widths[0]), (5, 1.0), "{what}");
        let steps: Vec<_> = widths.windows(2).map(|ends| ends[0] - ends[1]).collect();
        let is_smooth = steps.windows(2).all(|ends| (ends[0] - ends[1]).abs() < most);
        assert!(is_smooth, "{what}: {widths:?}");
    }

    #[test]
    fn a_pulled_cloth_narrows_smoothly() {
        for (name, expected) in [("tricot", 0.04..0.08), ("locknit", 0.05..0.09)] {
            let widths = widths(name, 1.0);
            assert_smooth(name, &widths, 0.006);
            assert!(widths.windows(2).all(|ends| ends[0] > ends[1]), "{name}: {widths:?}");
            assert!(expected.contains(&(1.0 - widths[4])), "{name}: {widths:?}");
        }
    }

    #[test]
    fn pulled_jersey_leaves_its_symmetry_without_a_jump() {
        for bending in [0.5, 1.0, 2.0] {
            let widths = widths("jersey", bending);
            // Twice as stiff, it keeps its width up to 1.15 and then narrows by a hundredth at once.
            // A state that has not converged is off by as much, and would double that.
            assert_smooth(&format!("bending {bending}"), &widths, 0.01);
            assert!(
                widths.windows(2).all(|ends| ends[1] < ends[0] + 0.003),
                "{bending}: {widths:?}"
            );
        }
    }

    #[test]
    fn limper_yarns_let_a_warp_knit_narrow_more() {
        let [soft, stiff] = [0.5, 2.0].map(|bending| widths("tricot", bending)[4]);
        assert!(soft < stiff - 0.02, "{soft} {stiff}");
    }

    #[test]
    fn pulled_yarn_keeps_its_length_and_its_loops() {
        let fabric = Fabric::named("locknit").unwrap();
        let pattern = Pattern::new(&fabric);
        let strain = Strain { courses: 1.15, wales: 0.95, shear: 0.0 };
        let pulled = Puller::new(&fabric, &pattern).unwrap().at(strain);
        assert!(!pulled.is_locked);
        assert!((pulled.pattern.spacing.x / pattern.spacing.x - 1.15).abs() < 1e-12);
        assert_eq!(links::measure(&pulled.fabric, &pulled.pattern).wrong, 0);
        let before = numbers::measure(&fabric, &pattern).run_in;
        let after = numbers::measure(&pulled.fabric, &pulled.pattern).run_in;
        for (before, after) in before.iter().flatten().zip(after.iter().flatten()) {
            assert!((after / before - 1.0).abs() < 0.01, "{before} {after}");
        }
    }

    #[test]
    fn cloth_that_is_not_pulled_stays_as_it_is() {
        let fabric = Fabric::named("tricot").unwrap();
        let pattern = Pattern::new(&fabric);
        let puller = Puller::new(&fabric, &pattern).unwrap();
        assert_eq!(puller.free(1.0, &mut |_| ()).last(), Some(&Strain::NONE));
        let still = puller.at(Strain::NONE).pattern;
        for (before, after) in pattern.repeat.points.iter().zip(&still.repeat.points) {
            assert!(before.distance(*after) < 1e-9);
        }
    }

    #[test]
    fn pulls_end_at_the_last_one() {
        let is = |found: Vec<f64>, expected: &[f64]| {
            let same = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12);
            assert!(same && found.len() == expected.len(), "{found:?} {expected:?}");
        };
        is(pulls_to(1.12), &[1.05, 1.1, 1.12]);
        is(pulls_to(1.1), &[1.05, 1.1]);
        is(pulls_to(0.93), &[0.95, 0.93]);
        is(pulls_to(1.0), &[]);
    }
}
