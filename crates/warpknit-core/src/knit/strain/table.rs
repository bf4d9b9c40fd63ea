//! The table of strained repeats: how far each data point moves within the cloth.
//!
//! In: a fabric's relaxed repeat. Out: a [`StrainTable`], which gives for a strain and a data point
//! of the repeat its offset in the axes of the flat cloth, interpolated between solved knots.
//!
//! Method: knots are solved when they are first asked for, each from a fixed neighbour nearer to
//! flat cloth, so its value depends on nothing but the fabric. Where the yarn would have to stretch,
//! or a loop would leave its old one, the cloth is locked, and the offsets stay those of the strain
//! at which it locks on the straight line from the flat state. Source: Sperl, Narain and Wojtan
//! 2021, "Mechanics-aware deformation of yarn pattern geometry".
//!
//! Cost: some twenty milliseconds a knot for two bars, 20 ns a lookup. Not promised: that a state is
//! the only one of its strain.

use std::sync::{OnceLock, mpsc};

use glam::DVec3;
use rayon::Yield;
use rayon::prelude::*;

use super::Strain;
use super::grid::{self, GridPlace, KNOTS};
use super::link_check::LinkCheck;
use super::rest::Rest;
use super::solver::{self, State};
use crate::ids::index32;
use crate::knit::Progress;

/// The largest repeat that is solved, data points. The work for a knot grows with the square of
/// their number.
pub(super) const MAX_POINTS: usize = 1000;
/// Largest move of a data point for a strain of [`SNAP_STRAIN`], radii. A state farther from its
/// start has snapped into another one.
const SNAP_RADII: f64 = 1.5;
const SNAP_STRAIN: f64 = 0.05;
/// Stretch of a yarn at which the cloth locks.
const LOCK_STRETCH: f64 = 0.01;
/// How far below touching yarns may lie before the cloth locks.
const LOCK_OVERLAP: f64 = 0.05;
/// How locked the cloth is where a loop has left its old one: so far beyond the lock that a point
/// is locked when a knot with an eighth of the weight around it is.
const TORN_LOCK: f64 = 8.0;
/// Places that are looked at on the line from flat cloth to a locked knot.
const RAY_STEPS: u32 = 32;

/// Offsets of the data points of a repeat over strains of the cloth.
#[derive(Debug)]
pub struct StrainTable {
    pub(super) rest: Rest,
    links: LinkCheck,
    elastic_bars: Vec<usize>,
    /// What the solver found at each knot.
    pub(super) solved: Vec<OnceLock<Knot>>,
    /// What lookups interpolate.
    placed: Vec<OnceLock<Vec<PlacedOffset>>>,
}

/// A solved knot.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Knot {
    /// From each flat data point to the strained one, in the axes of the flat cloth, mm.
    pub(super) offsets: Vec<[f32; 3]>,
    /// How locked the cloth is: over 1 the yarn would have to stretch, or a loop to leave its old
    /// one.
    pub(super) lock: f32,
}

/// The offset of a data point at a knot as lookups take it, at the lock for locked knots, and behind
/// it how locked the cloth is: four numbers that are interpolated together.
type PlacedOffset = [f32; 4];

/// The place of a strain in the table.
#[derive(Clone, Copy, Debug)]
pub struct Lookup<'a> {
    place: GridPlace,
    /// The offsets of the knots around it.
    corners: [&'a [PlacedOffset]; 8],
    weights: [f32; 8],
}

impl StrainTable {
    pub(super) fn of(mut rest: Rest, links: LinkCheck, elastic_bars: Vec<usize>) -> Self {
        solver::measure_rest(&mut rest);
        let mut solved = Vec::new();
        let mut placed = Vec::new();
        solved.resize_with(KNOTS, OnceLock::new);
        placed.resize_with(KNOTS, OnceLock::new);
        Self { rest, links, elastic_bars, solved, placed }
    }

    /// Solves in parallel the knots around these strains. `progress` gets the share that is done.
    pub fn prepare(
        &self,
        strains: impl IntoParallelIterator<Item = Strain>,
        progress: Progress<'_>,
    ) {
        if self.is_flat_only() {
            return;
        }
        let none = || vec![false; KNOTS];
        let wanted = strains.into_par_iter().fold(none, |mut is_wanted, strain| {
            for (knot, _) in GridPlace::of(strain).knots() {
                is_wanted[knot] = true;
            }
            is_wanted
        });
        let is_wanted = wanted.reduce(none, |mut all, some| {
            all.iter_mut().zip(some).for_each(|(all, some)| *all |= some);
            all
        });
        let mut wanted: Vec<_> = (0..KNOTS).filter(|&knot| is_wanted[knot]).collect();
        // From flat cloth outward, so that each knot finds the one it starts from.
        wanted.sort_by_key(|&knot| grid::level(knot));
        self.solve_all(&wanted, progress);
    }

    /// Solves knots in this order, on all threads. The calling thread reports the progress.
    fn solve_all(&self, wanted: &[usize], progress: Progress<'_>) {
        let (sender, solved) = mpsc::channel();
        rayon::in_place_scope_fifo(|scope| {
            for &knot in wanted {
                let sender = sender.clone();
                scope.spawn_fifo(move |_| {
                    self.placed(knot);
                    // If nobody listens any more, another knot has panicked.
                    let _left = sender.send(());
                });
            }
            drop(sender);
            let mut done = 0;
            loop {
                // A thread of the pool works as well. Only where nothing is left to begin does it
                // wait for the others, until all have sent.
                if rayon::yield_now() != Some(Yield::Executed) {
                    let Ok(()) = solved.recv() else { break };
                    done += 1;
                }
                done += solved.try_iter().count();
                progress(f64::from(index32(done)) / f64::from(index32(wanted.len())));
            }
        });
    }

    /// Lowest and highest data point of the repeat, mm from the middle of the cloth.
    #[must_use]
    pub fn depths(&self) -> [f64; 2] {
        let depths = self.rest.points.iter().map(|point| point.z);
        depths.fold([0.0, 0.0], |[low, high], z| [z.min(low), z.max(high)])
    }

    /// Bars, from 0, whose yarns may stretch: elastane, and inlays with slack.
    #[must_use]
    pub fn elastic_bars(&self) -> &[usize] {
        &self.elastic_bars
    }

    /// Whether the repeat is too large to be solved. Then all strains get the offsets of flat cloth,
    /// which are none, and only sweeps on the body keep the lengths of yarns.
    #[must_use]
    pub fn is_flat_only(&self) -> bool {
        self.rest.points.len() > MAX_POINTS
    }

    /// The number of solved knots.
    #[must_use]
    pub fn knots(&self) -> usize {
        self.solved.iter().filter(|knot| knot.get().is_some()).count()
    }

    /// Finds a strain in the table.
    #[must_use]
    pub fn at(&self, strain: Strain) -> Lookup<'_> {
        let place = GridPlace::of(strain);
        Lookup { place, corners: self.around(&place), weights: weights(&place) }
    }

    /// The offsets of the knots around a place.
    fn around(&self, place: &GridPlace) -> [&[PlacedOffset]; 8] {
        place.corners().map(|knot| self.placed(knot))
    }

    /// How locked the cloth is between knots with these weights.
    fn lock_at(&self, knots: &[(usize, f64)]) -> f64 {
        knots.iter().map(|&(knot, weight)| weight * f64::from(self.solved(knot).lock)).sum()
    }

    /// What lookups interpolate.
    fn placed(&self, knot: usize) -> &[PlacedOffset] {
        let knot = if self.is_flat_only() { grid::flat() } else { knot };
        self.placed[knot].get_or_init(|| {
            let Knot { offsets, lock } = self.solved(knot);
            let with_lock = |&[x, y, z]: &[f32; 3]| [x, y, z, *lock];
            if *lock <= 1.0 {
                offsets.iter().map(with_lock).collect()
            } else {
                self.at_lock(knot).iter().map(with_lock).collect()
            }
        })
    }

    /// The offsets where the line from flat cloth to a locked knot meets the lock.
    fn at_lock(&self, knot: usize) -> Vec<[f32; 3]> {
        let target = grid::strain(knot);
        let mut last = Vec::new();
        for step in 1..RAY_STEPS {
            let share = f64::from(step) / f64::from(RAY_STEPS);
            let place = GridPlace::of(Strain::NONE.towards(target, share));
            let knots = place.knots().into_iter().filter(|(_, weight)| *weight > 0.0);
            let knots: Vec<_> = knots.collect();
            if self.lock_at(&knots) > 1.0 {
                break;
            }
            last = knots;
        }
        let mut offsets = vec![[0.0_f32; 3]; self.rest.points.len()];
        for (at, weight) in last {
            for (sum, offset) in offsets.iter_mut().zip(&self.solved(at).offsets) {
                for axis in 0..3 {
                    #[expect(clippy::cast_possible_truncation, reason = "offsets are stored so")]
                    let part = (weight * f64::from(offset[axis])) as f32;
                    sum[axis] += part;
                }
            }
        }
        offsets
    }

    fn solved(&self, knot: usize) -> &Knot {
        self.solved[knot].get_or_init(|| self.solve(knot))
    }

    /// Solves a knot from a neighbour nearer to flat cloth.
    fn solve(&self, knot: usize) -> Knot {
        let strain = grid::strain(knot);
        let mut best: Option<State> = None;
        for from in grid::inward(knot) {
            let start = self.state(from);
            let state = solver::solve(&self.rest, &start, strain);
            let has_snapped = self.has_snapped(&start, &state);
            if best.as_ref().is_none_or(|best| state.energy < best.energy) {
                best = Some(state);
            }
            if !has_snapped {
                break;
            }
        }
        best.map_or_else(|| self.flat_knot(), |state| self.knot(&state))
    }

    fn flat_knot(&self) -> Knot {
        Knot { offsets: vec![[0.0; 3]; self.rest.points.len()], lock: 0.0 }
    }

    /// Whether a point moved farther than small changes of strain move it.
    fn has_snapped(&self, from: &State, to: &State) -> bool {
        let far =
            from.points.iter().zip(&to.points).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        far > SNAP_RADII * self.rest.thinnest * from.strain.distance(to.strain) / SNAP_STRAIN
    }

    fn knot(&self, state: &State) -> Knot {
        let offsets = state.points.iter().zip(&self.rest.points);
        #[expect(clippy::cast_possible_truncation, reason = "offsets are stored so")]
        let offsets = offsets.map(|(point, flat)| (*point - *flat).to_array().map(|x| x as f32));
        #[expect(clippy::cast_possible_truncation, reason = "offsets are stored so")]
        let lock = lock(&self.rest, &self.links, state) as f32;
        Knot { offsets: offsets.collect(), lock }
    }

    /// A solved knot as a start.
    fn state(&self, knot: usize) -> State {
        let points = self.rest.points.iter().zip(&self.solved(knot).offsets);
        let points = points.map(|(flat, offset)| *flat + DVec3::from_array(offset.map(f64::from)));
        State { strain: grid::strain(knot), points: points.collect(), ..solver::flat(&self.rest) }
    }
}

/// How locked the cloth is in a state: over 1 the yarn would have to stretch, or a loop to leave its
/// old one.
pub(super) fn lock(rest: &Rest, links: &LinkCheck, state: &State) -> f64 {
    if !links.hold(&state.points) {
        return TORN_LOCK;
    }
    let overlap = (rest.target - state.nearest).max(0.0);
    (state.stretch / LOCK_STRETCH).max(overlap / LOCK_OVERLAP)
}

/// The weights of the knots around a place, as precise as offsets are.
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "offsets are stored so")]
fn weights(place: &GridPlace) -> [f32; 8] {
    place.weights().map(|weight| weight as f32)
}

impl<'a> Lookup<'a> {
    /// Goes on to another strain of the same table. Between the same knots this takes no look at
    /// them.
    #[inline]
    pub fn move_to(&mut self, table: &'a StrainTable, strain: Strain) {
        let place = self.place.moved_to(strain);
        if !place.has_same_knots(&self.place) {
            self.corners = table.around(&place);
        }
        self.weights = weights(&place);
        self.place = place;
    }

    /// Whether the strain lies beyond the table.
    #[inline]
    #[must_use]
    pub fn is_outside(&self) -> bool {
        self.place.is_outside
    }

    /// Whether the cloth is locked there.
    #[must_use]
    pub fn is_locked(&self) -> bool {
        self.offset_and_lock(0).1
    }

    /// The offset of a data point of the repeat, in the axes of the flat cloth, mm.
    #[must_use]
    pub fn offset(&self, point: usize) -> DVec3 {
        self.offset_and_lock(point).0
    }

    /// The offset of a data point, and whether the cloth is locked.
    #[inline]
    #[must_use]
    pub fn offset_and_lock(&self, point: usize) -> (DVec3, bool) {
        let mut sum = [0.0; 4];
        for (offsets, weight) in self.corners.iter().zip(self.weights) {
            let offset = offsets[point];
            for (sum, part) in sum.iter_mut().zip(offset) {
                *sum += part * weight;
            }
        }
        let [x, y, z, lock] = sum;
        (DVec3::from_array([x, y, z].map(f64::from)), lock > 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fabric::Fabric;
    use crate::knit::{Pattern, links};

    fn table(name: &str) -> (Fabric, Pattern, StrainTable) {
        let fabric = Fabric::named(name).unwrap();
        let pattern = Pattern::new(&fabric);
        let table = StrainTable::new(&fabric, &pattern).unwrap();
        (fabric, pattern, table)
    }

    fn strained(courses: f64, wales: f64, shear: f64) -> Strain {
        Strain { courses, wales, shear }
    }

    #[test]
    fn yarn_keeps_its_length_and_its_distance() {
        for name in ["tricot", "locknit", "jersey"] {
            let (.., table) = table(name);
            for strain in [
                strained(1.2, 1.0, 0.0),
                strained(0.8, 1.0, 0.0),
                strained(1.0, 1.1, 0.0),
                strained(1.1, 0.9, 0.2),
            ] {
                let knots = GridPlace::of(strain).knots();
                let (knot, _) = knots.into_iter().find(|(_, weight)| *weight > 0.99).unwrap();
                // The lock counts whole per cents of stretch, and twentieths of touching.
                let lock = table.solved(knot).lock;
                assert!(lock < 0.5, "{name} {strain:?}: {lock}");
            }
        }
    }

    #[test]
    fn cloth_locks_where_no_loop_can_follow() {
        let (.., table) = table("jersey");
        assert!(table.at(strained(1.5, 1.5, 0.0)).is_locked());
        assert!(table.at(strained(3.0, 1.0, 0.0)).is_outside());
        let pulled = table.at(strained(1.1, 1.0, 0.0));
        assert!(!pulled.is_outside() && !pulled.is_locked());
    }

    #[test]
    fn cloth_locks_before_a_loop_leaves_its_old_one() {
        let (fabric, pattern, table) = table("power-net");
        let strain = strained(1.0, 1.35, 0.0);
        let knots = GridPlace::of(strain).knots();
        let (torn, _) = knots.into_iter().find(|(_, weight)| *weight > 0.99).unwrap();
        assert!(!table.links.hold(&table.state(torn).points));
        let lookup = table.at(strain);
        assert!(lookup.is_locked());
        let mut moved = pattern.clone();
        for (at, point) in moved.repeat.points.iter_mut().enumerate() {
            *point += lookup.offset(at);
        }
        assert_eq!(links::measure(&fabric, &moved).wrong, 0);
    }

    #[test]
    fn links_stay_as_they_are() {
        for name in ["tricot", "locknit", "jersey"] {
            let (fabric, pattern, table) = table(name);
            for strain in [strained(1.35, 0.8, 0.2), strained(0.7, 1.2, -0.2)] {
                let lookup = table.at(strain);
                let mut moved = pattern.clone();
                for (at, point) in moved.repeat.points.iter_mut().enumerate() {
                    *point += lookup.offset(at);
                }
                assert_eq!(links::measure(&fabric, &moved).wrong, 0, "{name} {strain:?}");
            }
        }
    }

    #[test]
    fn a_knot_does_not_depend_on_what_else_was_asked() {
        let (.., one) = table("tricot");
        let (.., other) = table("tricot");
        other.prepare([strained(0.8, 1.2, 0.2), strained(1.2, 1.1, -0.1)], &mut |_| ());
        let strain = strained(1.17, 1.04, 0.03);
        assert_eq!(one.at(strain).offset(7), other.at(strain).offset(7));
    }

    #[test]
    fn progress_rises_to_the_whole_on_any_number_of_threads() {
        let strains = [strained(0.8, 1.2, 0.2), strained(1.2, 1.1, -0.1)];
        let heard = |table: &StrainTable| {
            let mut shares = Vec::new();
            table.prepare(strains, &mut |share| shares.push(share));
            assert!(shares.len() > 1 && shares.is_sorted() && shares.last() == Some(&1.0));
        };
        let (.., table) = table("jersey");
        heard(&table);
        for threads in [1, 2, 3] {
            let (.., table) = self::table("jersey");
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| heard(&table));
        }
    }

    #[test]
    fn slack_inlays_and_elastane_may_stretch() {
        let (fabric, _, table) = table("elastic-locknit");
        assert!(table.rest.yarns.iter().any(|yarn| yarn.is_elastic));
        assert!(table.rest.yarns.iter().any(|yarn| !yarn.is_elastic));
        let bars = fabric.yarns().map(|yarn| yarn.draft.is_some());
        let expected: Vec<_> = (0..).zip(bars).filter(|(_, is_drafted)| *is_drafted).collect();
        assert_eq!(table.elastic_bars(), expected.iter().map(|(bar, _)| *bar).collect::<Vec<_>>());
    }
}
