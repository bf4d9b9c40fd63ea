//! Contacts of the strain solver: which segments of yarn may touch, and how near they are.
//!
//! In: the sampled curves of a strained repeat. Out: a neighbour list, rebuilt once yarns have moved
//! by its skin, and the distance of each pair.
//!
//! Method: the list is taken from a wider one, whose skin lasts for many steps (Verlet 1967,
//! "Computer experiments on classical fluids"). Cost: two microseconds a segment for the wide list,
//! some nanoseconds a pair of it for the near one.

use glam::{DMat2, DVec2, DVec3, Vec3Swizzles};

use super::rest::{Rest, RestSegment, RestSpan};
use super::solver::StrainSolver;
use crate::ids::index32;
use crate::knit::cell_list::CellList;
use crate::yarn::curve;

/// Contacts are nearer than this, over touching.
const CONTACT_CUTOFF: f64 = 1.0;
/// Cutoff of the neighbour list that is searched for them, over touching.
const NEAR_CUTOFF: f64 = 1.4;
/// Cutoff of the wider list from which that is taken. From 1.8 to 4 the whole takes up to a quarter
/// longer.
const WIDE_CUTOFF: f64 = 2.5;

/// Two segments that may touch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    a: u32,
    b: u32,
    /// From b to its image beside a, in cells.
    shift: DVec2,
    /// Sum of both radii, mm.
    pub(super) touching: f64,
}

impl Pair {
    /// The spans of both segments.
    pub(super) fn spans<'a>(&self, rest: &'a Rest) -> [&'a RestSpan; 2] {
        [self.a, self.b].map(|at| &rest.spans[rest.segments[at as usize].span as usize])
    }
}

/// How near two segments are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contact {
    /// Distance over touching.
    pub(super) ratio: f64,
    /// From the second one to the first, of unit length.
    pub(super) direction: DVec3,
    /// Weights of the four control points of each in its nearest place.
    pub(super) weights: [[f64; 4]; 2],
}

/// Pairs of segments, and the repeat when they were found.
#[derive(Debug, Default)]
pub(super) struct NeighbourList {
    pub(super) pairs: Vec<Pair>,
    /// The cloth's map, and the samples in the axes of the flat cloth.
    strain: DMat2,
    flat_samples: Vec<DVec3>,
}

impl StrainSolver<'_> {
    /// Brings the neighbour list up to date. Returns whether that took a new list.
    pub(super) fn update_list(&mut self) -> bool {
        if !self.is_stale(&self.near, NEAR_CUTOFF, CONTACT_CUTOFF) {
            return false;
        }
        let balls = self.balls();
        let mut near = std::mem::take(&mut self.near);
        if self.is_stale(&self.wide, WIDE_CUTOFF, NEAR_CUTOFF) {
            let mut wide = std::mem::take(&mut self.wide);
            self.begin(&mut wide);
            self.find_pairs(&balls, &mut wide.pairs);
            self.wide = wide;
        }
        self.begin(&mut near);
        let is_near = |pair: &&Pair| {
            self.may_be_within(NEAR_CUTOFF, pair, &balls)
                && self.contact(pair, NEAR_CUTOFF).is_some()
        };
        near.pairs.extend(self.wide.pairs.iter().filter(is_near));
        self.near = near;
        true
    }

    /// Whether segments that are not in a list of this cutoff may have come nearer than `reach`.
    /// Both are over touching. Segments come nearer by the moves of both within the cloth, and by
    /// what its strain takes from their distance. They are straight between samples, so none of
    /// their places moves farther than these do.
    fn is_stale(&self, list: &NeighbourList, cutoff: f64, reach: f64) -> bool {
        if list.flat_samples.len() != self.samples.len() {
            return true;
        }
        let change = norm(self.strain * list.strain.inverse() - DMat2::IDENTITY);
        let limit = (cutoff - reach - cutoff * change) * self.rest.thinnest;
        let samples = self.samples.iter().zip(&list.flat_samples);
        let mut moves =
            samples.map(|(&sample, &flat)| sample.distance_squared(self.strained(flat)));
        limit <= 0.0 || moves.any(|squared| squared > limit * limit)
    }

    /// Empties a list for the repeat as it is.
    fn begin(&self, list: &mut NeighbourList) {
        list.pairs.clear();
        list.strain = self.strain;
        list.flat_samples = self.flat(&self.samples);
    }

    /// The middle of each segment, and half its length.
    fn balls(&self) -> Vec<(DVec3, f64)> {
        let ends = self.rest.segments.iter().map(|segment| self.ends(segment));
        ends.map(|[from, to]| (from.midpoint(to), from.distance(to) / 2.0)).collect()
    }

    /// Whether the balls around two segments are so near that these may be within a cutoff.
    #[inline]
    fn may_be_within(&self, cutoff: f64, pair: &Pair, balls: &[(DVec3, f64)]) -> bool {
        let [(one, half), (other, other_half)] = [pair.a, pair.b].map(|at| balls[at as usize]);
        let reach = cutoff * pair.touching + half + other_half;
        (other + self.offset(pair.shift)).distance_squared(one) <= reach * reach
    }

    /// Finds all pairs of segments that may be within the wider cutoff. Parts of one strand are left
    /// out by the yarn's lengths at this time, which the solver hardly changes.
    fn find_pairs(&self, balls: &[(DVec3, f64)], pairs: &mut Vec<Pair>) {
        let back = self.strain.inverse();
        let thickest = self.rest.yarns.iter().map(|yarn| yarn.chain.radius).fold(0.0, f64::max);
        // The list is sorted in the axes of the flat cloth, whose cell is a rectangle. A strained
        // distance is longer there by the norm of the inverse map at most; depths stay.
        let longer = norm(back).max(1.0);
        let flat_balls = balls
            .iter()
            .map(|(middle, half)| ((back * middle.xy()).extend(middle.z), half * longer));
        let flat_balls: Vec<_> = flat_balls.collect();
        let list =
            CellList::new(&flat_balls, self.rest.cell, 2.0 * WIDE_CUTOFF * thickest * longer);
        for (a, one) in self.rest.segments.iter().enumerate() {
            list.near(a, |b, shift| {
                if b < a || (b == a && (shift.x, shift.y) <= (0.0, 0.0)) {
                    return;
                }
                let other = &self.rest.segments[b];
                let yarns = [one, other].map(|s| self.rest.spans[s.span as usize].yarn as usize);
                let [chain, other_chain] = yarns.map(|yarn| &self.rest.yarns[yarn].chain);
                let touching = chain.radius + other_chain.radius;
                let pair = Pair { a: index32(a), b: index32(b), shift, touching };
                let is_same_strand = yarns[0] == yarns[1]
                    && chain.is_same_strand(
                        self.along(other) - self.along(one),
                        shift,
                        self.lengths[yarns[0]],
                    );
                if !is_same_strand && self.may_be_within(WIDE_CUTOFF, &pair, balls) {
                    pairs.push(pair);
                }
            });
        }
    }

    /// For each point the points with which it shares residuals, in ascending order.
    pub(super) fn neighbours(&self) -> Vec<Vec<u32>> {
        let mut joined = PointSets::new(self.points.len());
        self.rest.spans.iter().for_each(|span| joined.join(&span.control.points));
        let mut before = None;
        for pair in &self.near.pairs {
            let spans = pair.spans(self.rest);
            // Pairs of the same two spans often follow each other.
            let points = spans.map(|span| span.control.points);
            if before.replace(points) != Some(points) {
                joined.join(points.as_flattened());
            }
        }
        joined.lists()
    }

    /// How near a pair is; nothing if it is farther than `cutoff` over touching.
    #[inline]
    pub(super) fn contact(&self, pair: &Pair, cutoff: f64) -> Option<Contact> {
        let [a, b] = [pair.a, pair.b].map(|at| &self.rest.segments[at as usize]);
        let offset = self.offset(pair.shift);
        let (one, other) = (self.ends(a), self.ends(b).map(|end| end + offset));
        let (along, along_other) = curve::nearest_of_segments(one, other);
        let apart = one[0].lerp(one[1], along) - other[0].lerp(other[1], along_other);
        let distance = apart.length();
        let ratio = distance / pair.touching;
        (ratio < cutoff).then(|| Contact {
            ratio,
            // Centre lines that meet have no direction apart; depth is where cloth has room.
            direction: if distance > 1e-9 { apart / distance } else { DVec3::Z },
            weights: [self.shares(a, along), self.shares(b, along_other)],
        })
    }

    /// Weights of the control points at a share of the way along a segment.
    fn shares(&self, segment: &RestSegment, along: f64) -> [f64; 4] {
        let at = segment.sample as usize;
        let (from, to) = (&self.weights[at], &self.weights[at + 1]);
        std::array::from_fn(|k| from[k] + along * (to[k] - from[k]))
    }

    fn ends(&self, segment: &RestSegment) -> [DVec3; 2] {
        let at = segment.sample as usize;
        [self.samples[at], self.samples[at + 1]]
    }

    /// A shift in cells as a place of the strained cloth.
    fn offset(&self, shift: DVec2) -> DVec3 {
        (self.strain * (shift * self.rest.cell)).extend(0.0)
    }

    /// Yarn length from the start of the repeat to the middle of a segment.
    fn along(&self, segment: &RestSegment) -> f64 {
        let sample = segment.sample as usize;
        f64::midpoint(self.along[sample], self.along[sample + 1])
    }
}

/// For each point a set of points, as bits: 125 kB for a thousand points.
struct PointSets {
    /// Words of a set.
    width: usize,
    words: Vec<u64>,
}

impl PointSets {
    fn new(points: usize) -> Self {
        let width = points.div_ceil(64);
        Self { width, words: vec![0; points * width] }
    }

    /// Puts each of some points into the sets of the others.
    fn join(&mut self, points: &[u32]) {
        for &one in points {
            let own = &mut self.words[one as usize * self.width..][..self.width];
            for &other in points.iter().filter(|&&other| other != one) {
                own[other as usize / 64] |= 1 << (other % 64);
            }
        }
    }

    fn lists(&self) -> Vec<Vec<u32>> {
        let list = |set: &[u64]| {
            let words = (0u32..).step_by(64).zip(set);
            words.flat_map(|(first, &word)| bits(word).map(move |bit| first + bit)).collect()
        };
        self.words.chunks_exact(self.width.max(1)).map(list).collect()
    }
}

/// The places of a word's bits, in ascending order.
fn bits(word: u64) -> impl Iterator<Item = u32> {
    std::iter::successors((word != 0).then_some(word), |word| {
        let rest = word & (word - 1);
        (rest != 0).then_some(rest)
    })
    .map(u64::trailing_zeros)
}

/// The largest stretch of a map.
fn norm(map: DMat2) -> f64 {
    let (a, b) = (map.x_axis, map.y_axis);
    let (aa, bb, ab) = (a.length_squared(), b.length_squared(), a.dot(b));
    (0.5 * (aa + bb) + (0.5 * (aa - bb)).hypot(ab)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fabric::Fabric;
    use crate::knit::Pattern;
    use crate::knit::strain::{Strain, rest_of};

    /// Pairs of a solver's list that are nearer than touching.
    fn closed(solver: &StrainSolver<'_>) -> Vec<(u32, u32, [i64; 2])> {
        let pairs = solver.near.pairs.iter();
        let mut closed: Vec<_> = pairs
            .filter(|pair| solver.contact(pair, CONTACT_CUTOFF).is_some())
            .map(|pair| (pair.a, pair.b, pair.shift.as_i64vec2().to_array()))
            .collect();
        closed.sort_unstable();
        closed
    }

    #[test]
    fn lists_that_were_kept_have_all_contacts() {
        for name in ["tricot", "jersey", "double-atlas"] {
            let fabric = Fabric::named(name).unwrap();
            let rest = rest_of(&fabric, &Pattern::new(&fabric)).unwrap();
            let mut kept = StrainSolver::new(&rest);
            let (mut near_lists, mut wide_lists, mut contacts) = (0, 0, 0);
            // Cloth is pressed together along courses, and all points wander a radius within it.
            let steps = 60;
            for step in 0..steps {
                let share = f64::from(step) / f64::from(steps);
                let strain = Strain {
                    courses: 1.0 - 0.5 * share,
                    wales: 1.0 + 0.1 * share,
                    shear: 0.3 * share,
                };
                kept.set_strain(strain);
                for (at, point) in kept.points.iter_mut().enumerate() {
                    let turn = f64::from(index32(at));
                    let way = DVec3::new(turn.sin(), turn.cos(), (2.0 * turn).sin()).normalize();
                    *point += way * (rest.thinnest / f64::from(steps));
                }
                kept.sample();
                let was_stale = kept.is_stale(&kept.wide, WIDE_CUTOFF, NEAR_CUTOFF);
                if kept.update_list() {
                    near_lists += 1;
                    wide_lists += u32::from(was_stale);
                }
                let mut fresh = StrainSolver::new(&rest);
                fresh.set_strain(strain);
                fresh.points.clone_from(&kept.points);
                fresh.sample();
                fresh.update_list();
                assert_eq!(closed(&kept), closed(&fresh), "{name} {step}");
                contacts += closed(&fresh).len();
            }
            let lists = [1, wide_lists, near_lists, steps];
            assert!(lists.is_sorted_by(|a, b| a < b), "{name}: {lists:?}");
            assert!(contacts > 100, "{name}: {contacts}");
        }
    }

    #[test]
    fn joined_points_know_each_other_in_order() {
        let mut sets = PointSets::new(130);
        sets.join(&[129, 0, 64, 63]);
        sets.join(&[0, 64]);
        let lists = sets.lists();
        assert_eq!(lists[0], [63, 64, 129]);
        assert_eq!(lists[129], [0, 63, 64]);
        assert!(lists.len() == 130 && lists[1].is_empty());
        assert!(PointSets::new(0).lists().is_empty());
    }
}
