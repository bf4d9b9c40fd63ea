//! Contacts: yarns that are nearer than their radii allow are moved apart.
//!
//! In: the sampled curves. Out: a neighbour list of segments that may touch (Verlet 1967, "Computer
//! 'experiments' on classical fluids"), and moves of the data points. The list is rebuilt from a
//! cell list once yarns have moved by its skin. Cost: the list about a microsecond a segment, a
//! sweep some nanoseconds a pair.

use glam::DVec3;

use super::{
    BEND_TOLERANCE, MAX_CANDIDATES, MAX_PAIRS, SWEEPS_PER_STEP, Solver, TARGET_DISTANCE, TOLERANCE,
};
use crate::ids::index32;
use crate::knit::cell_list::CellList;
use crate::knit::chain::blend;
use crate::yarn::curve;

/// Cutoff of the neighbour list over the sum of the radii. What exceeds [`TARGET_DISTANCE`] is the
/// list's skin: two yarns may approach by that much before the list is rebuilt. A thinner skin
/// rebuilds it more often; a thicker one lengthens the list.
const LIST_CUTOFF: f64 = 1.35;
/// The list is rebuilt once a data point has moved by this many of its radii: a quarter less than
/// half of the skin, since a curve may move further than its points.
const LIST_MOVE: f64 = 0.25;
/// Fastest approach of two segments that the solver reckons with, over the sum of the radii, a
/// sweep. A pair is skipped for as many sweeps as it would need to meet at this speed. This is a
/// heuristic: faster moves are allowed. Lower values skip pairs that meet meanwhile, until the list
/// is looked at; higher values check distant pairs in vain.
const APPROACH_PER_SWEEP: f64 = 0.03;
/// Only fewer than one span in this many is swept alone.
const MOST_ACTIVE: usize = 5;
/// Spans on each side of an active one that are active too. A span's curve depends on its
/// neighbours' points, and so do theirs.
const ACTIVE_SPANS: usize = 3;
/// Share of its missing distance that a contact moves its yarns in one sweep (the constraint's
/// stiffness in position-based dynamics, 0 to 1). Many contacts share the same data points, so near
/// 1 their corrections add up and overshoot; near 0 they lose against stretch and bending.
const CONTACT_STIFFNESS: f64 = 0.4;
/// Limit of one contact's correction, over the sum of the radii. Without it, deep overlaps throw
/// points past their neighbours; much lower, they never come apart.
const MAX_MOVE: f64 = 0.3;

/// An entry of the neighbour list: two segments that may touch.
#[derive(Clone, Copy)]
pub(super) struct ContactPair {
    pub(super) a: u32,
    pub(super) b: u32,
    /// Sweeps for which the pair is skipped, since it is too far apart to meet.
    skipped_sweeps: u32,
    /// From b to its image beside a.
    offset: DVec3,
    /// Sum of both radii.
    contact_distance: f64,
}

impl Solver<'_> {
    /// Least distance of two yarns over the sum of their radii, or `None` if there are too many
    /// pairs. Rebuilds the neighbour list if yarns moved so far that others might meet.
    pub(super) fn nearest(&mut self) -> Option<f64> {
        if self.list_is_stale() {
            self.list_points.clear();
            self.list_points.extend_from_slice(self.points);
            return self.find_contacts();
        }
        let mut ratios = std::mem::take(&mut self.ratios);
        for (pair, ratio) in self.pairs.iter().zip(&mut ratios) {
            if self.spans_of(pair).iter().any(|&span| self.moved[span]) {
                *ratio = self.ratio(pair);
            }
        }
        self.ratios = ratios;
        Some(self.ratios.iter().copied().fold(f64::INFINITY, f64::min))
    }

    /// The data point before the place at which two yarns are nearest.
    pub(super) fn tightest(&self) -> Option<usize> {
        let pairs = self.pairs.iter().zip(&self.ratios);
        let (nearest, _) = pairs.min_by(|(_, one), (_, other)| one.total_cmp(other))?;
        let [span, _] = self.spans_of(nearest);
        Some(self.spans[span].control.points[1] as usize)
    }

    /// The spans in which the two segments of a pair lie.
    fn spans_of(&self, pair: &ContactPair) -> [usize; 2] {
        [pair.a, pair.b].map(|segment| self.segments[segment as usize].span as usize)
    }

    /// Distance of the two segments of a pair over the sum of their radii.
    fn ratio(&self, pair: &ContactPair) -> f64 {
        let (a, b) = (&self.segments[pair.a as usize], &self.segments[pair.b as usize]);
        let other = self.ends(b).map(|end| end + pair.offset);
        separation(self.ends(a), other).length() / pair.contact_distance
    }

    /// Marks the spans around each pair that is too near and each bend that is too tight. Once all
    /// other constraints have faded, only these need further sweeps.
    pub(super) fn find_active(&mut self) {
        let mut active = std::mem::take(&mut self.active);
        active.fill(false);
        let near = self.pairs.iter().zip(&self.ratios).filter(|(_, ratio)| **ratio < TOLERANCE);
        for span in near.flat_map(|(pair, _)| self.spans_of(pair)) {
            self.mark(index32(span), ACTIVE_SPANS, &mut active);
        }
        for (span, _) in (0u32..).zip(&self.bends).filter(|(_, bend)| **bend > BEND_TOLERANCE) {
            self.mark(span, ACTIVE_SPANS, &mut active);
        }
        // Where much is still too near, room has to come from everywhere.
        let count = active.iter().filter(|&&is_active| is_active).count();
        if count > active.len() / MOST_ACTIVE {
            active.fill(true);
        }
        self.active = active;
    }

    /// Chooses the pairs of the next sweeps: those with an active span. The others wait as long.
    pub(super) fn choose_pairs(&mut self) {
        let mut chosen = std::mem::take(&mut self.swept_pairs);
        chosen.clear();
        for at in 0..self.pairs.len() {
            if self.spans_of(&self.pairs[at]).iter().any(|&span| self.active[span]) {
                chosen.push(index32(at));
            } else {
                let skipped = &mut self.pairs[at].skipped_sweeps;
                *skipped = skipped.saturating_sub(SWEEPS_PER_STEP);
            }
        }
        self.swept_pairs = chosen;
    }

    /// Whether two yarns that were not near enough for the list may have met since it was built.
    fn list_is_stale(&self) -> bool {
        self.list_points.len() != self.points.len()
            || self.yarns.iter().any(|yarn| {
                let limit = LIST_MOVE * yarn.chain.radius;
                yarn.chain.points.clone().any(|at| {
                    self.points[at].distance_squared(self.list_points[at]) > limit * limit
                })
            })
    }

    /// Builds the neighbour list: all pairs that might touch before it is built again. Returns the
    /// least distance over the sum of the radii, or `None` if there are too many pairs.
    fn find_contacts(&mut self) -> Option<f64> {
        let thickest = self.yarns.iter().map(|yarn| yarn.chain.radius).fold(0.0, f64::max);
        // Two segments within the cutoff have bounding balls within it.
        let balls = self.segments.iter().map(|segment| {
            let [from, to] = self.ends(segment);
            (from.midpoint(to), from.distance(to) / 2.0)
        });
        let cell_list =
            CellList::new(&balls.collect::<Vec<_>>(), self.cell, LIST_CUTOFF * 2.0 * thickest);
        let mut pairs = std::mem::take(&mut self.pairs);
        pairs.clear();
        self.ratios.clear();
        let mut ratios = std::mem::take(&mut self.ratios);
        let (mut nearest, mut candidates) = (f64::INFINITY, 0);
        for (s, one) in self.segments.iter().enumerate() {
            if pairs.len() > MAX_PAIRS * self.segments.len()
                || candidates > MAX_CANDIDATES * self.segments.len()
            {
                return None;
            }
            let yarn_s = self.spans[one.span as usize].yarn;
            let chain = &self.yarns[yarn_s as usize].chain;
            cell_list.near(s, |t, shift| {
                candidates += 1;
                // The cell list gives each pair from both sides. Only one side is kept, or the
                // contact would be solved twice. A segment and its own image come twice likewise.
                if t < s || (t == s && (shift.x, shift.y) <= (0.0, 0.0)) {
                    return;
                }
                let other = &self.segments[t];
                let yarn_t = self.spans[other.span as usize].yarn;
                let contact_distance = chain.radius + self.yarns[yarn_t as usize].chain.radius;
                let offset = (shift * self.cell).extend(0.0);
                let (along, length) = (other.along - one.along, self.lengths[yarn_s as usize]);
                if yarn_s == yarn_t && chain.is_same_strand(along, shift, length) {
                    return;
                }
                let other_ends = self.ends(other).map(|end| end + offset);
                let ratio = separation(self.ends(one), other_ends).length() / contact_distance;
                nearest = nearest.min(ratio);
                if ratio < LIST_CUTOFF {
                    ratios.push(ratio);
                    pairs.push(ContactPair {
                        a: index32(s),
                        b: index32(t),
                        skipped_sweeps: 0,
                        offset,
                        contact_distance,
                    });
                }
            });
        }
        (self.pairs, self.ratios) = (pairs, ratios);
        Some(nearest)
    }

    /// Contact constraints: moves the yarns of each pair in the list apart by what is missing from
    /// their distance. `grown` is the share of their full radii that yarns have in this sweep.
    pub(super) fn solve_contacts(&mut self, grown: f64) {
        for at in 0..self.swept_pairs.len() {
            let at = self.swept_pairs[at] as usize;
            let ContactPair { a, b, skipped_sweeps, offset, contact_distance } = self.pairs[at];
            if skipped_sweeps > 0 {
                self.pairs[at].skipped_sweeps -= 1;
                continue;
            }
            let (a, b) = (self.segments[a as usize], self.segments[b as usize]);
            let (span_a, span_b) = (self.spans[a.span as usize], self.spans[b.span as usize]);
            // The samples are recomputed from the control points instead of read: earlier contacts
            // of this sweep have moved the points (Gauss-Seidel). Stale samples would apply the
            // same correction several times over.
            let (control_a, control_b) =
                (self.control_points(&span_a), self.control_points(&span_b));
            let (weights_a, weights_b) = (self.end_weights(a), self.end_weights(b));
            let one = weights_a.map(|weights| blend(&control_a, weights));
            let other = weights_b.map(|weights| blend(&control_b, weights) + offset);
            let (along_a, along_b) = curve::nearest_of_segments(one, other);
            let apart = one[0].lerp(one[1], along_a) - other[0].lerp(other[1], along_b);
            let distance = apart.length();
            let missing = TARGET_DISTANCE * grown * contact_distance - distance;
            if missing <= 0.0 {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a few sweeps"
                )]
                let sweeps = (-missing / (APPROACH_PER_SWEEP * contact_distance)) as u32;
                self.pairs[at].skipped_sweeps = sweeps;
                continue;
            }
            // Centre lines that meet have no direction apart: any one serves, and depth is the one
            // in which cloth has room.
            let direction = if distance > 1e-9 { apart / distance } else { DVec3::Z };
            let weights_a = lerp_weights(weights_a, along_a);
            let weights_b = lerp_weights(weights_b, along_b);
            // Projection of the constraint C = |apart| - target (Müller et al. 2007, section 3.3,
            // all masses equal): the nearest points are weighted sums of control points, so the
            // gradient of C for a control point is its weight times the direction. Division by the
            // squared gradient makes the nearest points move by the distance asked, however the
            // weights are spread over the control points.
            let gradient_squared: f64 =
                weights_a.iter().chain(&weights_b).map(|weight| weight * weight).sum();
            let push = direction
                * ((CONTACT_STIFFNESS * missing).min(MAX_MOVE * contact_distance)
                    / gradient_squared);
            for k in 0..4 {
                self.points[span_a.control.points[k] as usize] += push * weights_a[k];
                self.points[span_b.control.points[k] as usize] -= push * weights_b[k];
            }
        }
    }
}

/// From the nearest point of the second segment to that of the first.
fn separation(one: [DVec3; 2], other: [DVec3; 2]) -> DVec3 {
    let (along_one, along_other) = curve::nearest_of_segments(one, other);
    one[0].lerp(one[1], along_one) - other[0].lerp(other[1], along_other)
}

/// Weights of the control points at a share of the way along a segment.
fn lerp_weights([from, to]: [&[f64; 4]; 2], along: f64) -> [f64; 4] {
    std::array::from_fn(|k| from[k] + along * (to[k] - from[k]))
}
