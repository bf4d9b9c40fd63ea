//! The yarn relaxation: a constraint solver that pushes apart yarns that would cut each other.
//!
//! In: the yarns of one repeat as closed chains of data points, periodic along the wales and across
//! them, with their radii. Out: the same points, moved, and a [`Relaxation`] that says how the
//! solver ended. A yarn's path is the centripetal Catmull-Rom curve through its data points. The
//! solver works on that curve itself, so the path that is drawn is the path that was relaxed.
//!
//! Method: position-based dynamics (Müller, Heidelberger, Hennix and Ratcliff 2007, "Position based
//! dynamics") without inertia, solved by Gauss-Seidel iteration. One iteration is a sweep over four
//! kinds of constraints: contacts between segments of the curves, stretch of chords, bending, and
//! the length of each yarn. Contacts are kept in a neighbour list (Verlet 1967, "Computer
//! 'experiments' on classical fluids") that is rebuilt every few sweeps from a cell list.
//!
//! Cost: sweeps times pairs in the list, some milliseconds for a common repeat. The limits below
//! bound it to some seconds. Sweeps run in a fixed order on one thread, so the result is the same
//! on every machine.
//!
//! Not promised: convergence to a state without cuts ([`super::clearance`] measures it), nor loops
//! that interlock where the layout does not interlock them. In fabrics of three bars and more a few
//! loops are laid out beside each other, and contacts keep them there.

use std::ops::Range;

use glam::{DVec2, DVec3};

use super::cell_list::CellList;
use crate::ids::index32;
use crate::yarn::curve;

/// Length of a segment of the sampled curve, radii. Longer segments cut the corners of bends, so
/// contacts are missed there; shorter ones cost time with the square of their number.
const SEGMENT_RADII: f64 = 0.8;
/// Limits of the segments of one span. Under four, a loop's head becomes a polygon. The upper limit
/// bounds the work for very thin yarns, whose radii would ask for many more.
const MIN_SEGMENTS: f64 = 4.0;
const MAX_SEGMENTS: f64 = 12.0;
/// Distance that a contact aims at, over the sum of the radii. Segments are chords that lie inside
/// the bends of the curve, so at 1 the curves themselves would still cut. Larger values make cloth
/// thicker than its yarns are.
const TARGET_DISTANCE: f64 = 1.04;
/// Convergence tolerance: the solver stops once the nearest pair is at this distance over the sum
/// of the radii. It lies between touching (1) and [`TARGET_DISTANCE`]. Contacts are solved softly
/// and reach their target only in the limit, so a tolerance near the target is never met.
const TOLERANCE: f64 = 1.01;
/// Share by which radii grow at a time.
const GROWTH_STEP: f64 = 0.05;
/// Radii grow once the nearest pair is at this share of the distance that they ask for.
const GROWTH_CLEARANCE: f64 = 0.965;
/// Limit of a point's move in one sweep, radii.
const MAX_STEP: f64 = 0.2;
/// Sweeps for which a neighbour list serves. More sweeps let pairs meet that are not in the list;
/// fewer spend the time on rebuilding it.
const SWEEPS_PER_LIST: usize = 8;
/// Limit of all sweeps. Stretch and bending have faded long before it (0.95^100 is 0.6 %).
const MAX_SWEEPS: usize = 1200;
/// Limit of sweeps times pairs: some seconds.
const MAX_PAIR_CHECKS: usize = 4_000_000_000;
/// Above this number of candidates for one list, or of pairs in it, whole yarns lie in each other's
/// place. Nothing pushes these apart, so the solver gives up.
const MAX_CANDIDATES: usize = 400_000_000;
const MAX_PAIRS: usize = 4_000_000;
/// Cutoff of the neighbour list over the sum of the radii. What exceeds [`TARGET_DISTANCE`] is the
/// list's skin: two yarns may approach by that much before the list is rebuilt. A thinner skin
/// misses contacts between rebuilds; a thicker one lengthens the list.
const LIST_CUTOFF: f64 = 1.35;
/// Fastest approach of two segments that the solver reckons with, over the sum of the radii, a
/// sweep. A pair is skipped for as many sweeps as it would need to meet at this speed. This is a
/// heuristic: [`MAX_MOVE`] allows faster moves. Lower values skip pairs that meet meanwhile, until
/// the list is rebuilt; higher values check distant pairs in vain.
const APPROACH_PER_SWEEP: f64 = 0.06;
/// Parts of one strand that are nearer than this along it, in radii, are no contacts. In the
/// tightest bend, a half circle of one radius, parts that are 3.1 radii apart along the yarn lie
/// two radii from each other. Smaller values would open such bends as if they were contacts; values
/// beyond some ten radii would let the two legs of a narrow loop cut each other.
const SAME_STRAND_RADII: f64 = 6.0;
/// Share of its missing distance that a contact moves its yarns in one sweep (the constraint's
/// stiffness in position-based dynamics, 0 to 1). Many contacts share the same data points, so near
/// 1 their corrections add up and overshoot; near 0 they lose against stretch and bending.
const CONTACT_STIFFNESS: f64 = 0.25;
/// Limit of one contact's correction, over the sum of the radii. Without it, deep overlaps throw
/// points past their neighbours; much lower, they never come apart.
const MAX_MOVE: f64 = 0.3;
/// Tolerance of a yarn's length, as a share of it. The aim is 2 % along the curve. The solver
/// measures chords, whose lengths change a little less, so its tolerance is tighter.
const LENGTH_TOLERANCE: f64 = 0.012;
/// Stiffness of stretch and bending in the first sweep (0 to 1). Higher values pull yarns back into
/// each other; at 0 contacts crumple the yarns.
const STRETCH_STIFFNESS: f64 = 0.15;
const BENDING_STIFFNESS: f64 = 0.12;
/// Factor of both stiffnesses from one sweep to the next. They fade so that contacts are satisfied
/// in the end. At 1 the solver stalls where constraints contradict each other; at much lower values
/// yarns lose their shapes before they are apart.
const STIFFNESS_DECAY: f64 = 0.95;

/// Places in each span at which its curvature is held.
const CURVATURE_PLACES: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
/// Least radius of the bends of a yarn, over its own.
const MIN_BEND_RADIUS: f64 = 1.05;
const CURVATURE_STIFFNESS: f64 = 0.5;
const BEND_TOLERANCE: f64 = 1.03;

/// One yarn of the repeat: a chain that continues in the next repeat.
#[derive(Clone, Debug)]
pub(super) struct YarnChain {
    /// Its data points.
    pub(super) points: Range<usize>,
    /// From a point to the same point in the next repeat, mm: along the wales, for a weft across.
    pub(super) period: DVec3,
    /// mm.
    pub(super) radius: f64,
}

/// How the relaxation ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relaxation {
    /// Sweeps over all constraints.
    pub sweeps: usize,
    /// The largest change of a yarn's length, as a share of it.
    pub stretch: f64,
    /// The share of their radii to which yarns could grow: 1 where they fit.
    pub grown: f64,
}

fn env(name: &str, default: f64) -> f64 { std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default) }

/// Moves `points` until no two yarns are nearer than they are thick and no bend is too tight, or a
/// limit is reached.
pub(super) fn relax(
    points: &mut [DVec3],
    shape: &[DVec3],
    yarns: &[YarnChain],
    cell: DVec2,
) -> Relaxation {
    let mut solver = Solver::new(points, shape, yarns, cell);
    solver.sample();
    let lengths = solver.lengths.clone();
    let mut sweeps = 0;
    let mut pair_checks = 0;
    let mut stiffness = 1.0;
    // The share of their radii that yarns have.
    let mut grown: f64 = 0.0;
    let mut bend = f64::INFINITY;
    let mut stalled = 0;
    let press = env("PRESS", 0.0);
    while sweeps < MAX_SWEEPS && pair_checks < MAX_PAIR_CHECKS {
        solver.sample();
        let Some(nearest) = solver.find_contacts() else { break };
        if nearest >= TOLERANCE && bend <= BEND_TOLERANCE && grown >= 1.0 {
            break;
        }
        // Radii grow only while nothing is much nearer than they are now: what lies in front of
        // another yarn stays there.
        if nearest >= GROWTH_CLEARANCE * grown {
            grown = (grown.max(nearest.min(1.0) / (1.0 + env("STEP", GROWTH_STEP))) * (1.0 + env("STEP", GROWTH_STEP))).min(1.0);
            stalled = 0;
        } else {
            stalled += 1;
            if stalled > 40 { break; }
        }
        for _ in 0..SWEEPS_PER_LIST {
            solver.begin_sweep();
            bend = solver.solve_curvature(CURVATURE_STIFFNESS, grown);
            solver.solve_contacts(grown);
            solver.solve_stretch(STRETCH_STIFFNESS * stiffness);
            solver.solve_bending(BENDING_STIFFNESS * stiffness);
            solver.solve_lengths();
            if press > 0.0 { for p in solver.points.iter_mut() { p.z *= 1.0 - press * stiffness; } }
            solver.limit_moves(grown);
            if grown >= 1.0 || stalled > 0 { stiffness *= env("DECAY", STIFFNESS_DECAY); }
        }
        sweeps += SWEEPS_PER_LIST;
        pair_checks += SWEEPS_PER_LIST * solver.pairs.len();
    }
    solver.sample();
    let changes =
        solver.lengths.iter().zip(&lengths).map(|(now, &before)| (now / before - 1.0).abs());
    Relaxation { sweeps, stretch: changes.fold(0.0, f64::max), grown }
}

/// A span of the curve between two data points: its four control points and its samples.
#[derive(Clone, Copy)]
struct ChainSpan {
    yarn: u32,
    points: [u32; 4],
    /// Image shifts of the control points: how many periods lie from each point to its image beside
    /// the span.
    image_shifts: [f64; 4],
    /// Index of its first sample. It has one sample more than segments.
    start: u32,
    segments: u32,
}

/// A segment of a sampled curve: from a sample to the next.
#[derive(Clone, Copy)]
struct CurveSegment {
    span: u32,
    /// Its first sample.
    sample: u32,
    /// Yarn length from the start of the repeat to its middle.
    along: f64,
}

/// An entry of the neighbour list: two segments that may touch.
#[derive(Clone, Copy)]
struct ContactPair {
    a: u32,
    b: u32,
    /// Sweeps for which the pair is skipped, since it is too far apart to meet.
    skipped_sweeps: u32,
    /// From b to its image beside a.
    offset: DVec3,
    /// Sum of both radii.
    contact_distance: f64,
}

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
    /// The chords' lengths as they were laid out.
    rest_chords: Vec<f64>,
    /// The data points as they were laid out.
    rest_points: Vec<DVec3>,
    /// The data points before this sweep.
    before: Vec<DVec3>,
    /// The neighbour list.
    pairs: Vec<ContactPair>,
}

impl<'a> Solver<'a> {
    fn new(
        points: &'a mut [DVec3],
        shape: &[DVec3],
        yarns: &'a [YarnChain],
        cell: DVec2,
    ) -> Self {
        let mut solver = Self {
            rest_points: shape.to_vec(),
            before: Vec::new(),
            points,
            yarns,
            cell,
            spans: Vec::new(),
            segments: Vec::new(),
            weights: Vec::new(),
            samples: Vec::new(),
            lengths: vec![0.0; yarns.len()],
            rest_chords: Vec::new(),
            pairs: Vec::new(),
        };
        for (yarn, chain) in (0u32..).zip(yarns) {
            chain.points.clone().for_each(|at| solver.add_span(yarn, chain, at));
        }
        solver.weights.resize(solver.samples.len(), [0.0; 4]);
        solver
    }

    /// Adds the span that starts at a point of a yarn.
    fn add_span(&mut self, yarn: u32, chain: &YarnChain, at: usize) {
        let count = i64::from(index32(chain.points.len()));
        let at = i64::from(index32(at - chain.points.start));
        // The four control points, counted along the endless yarn. Beyond the chain's ends they are
        // images of points of this repeat, some whole periods away.
        let indices = [at - 1, at, at + 1, at + 2];
        let points = indices.map(|i| {
            let wrapped = usize::try_from(i.rem_euclid(count));
            index32(chain.points.start + wrapped.expect("a remainder is not negative"))
        });
        #[expect(clippy::cast_precision_loss, reason = "a repeat or two")]
        let image_shifts = indices.map(|i| i.div_euclid(count) as f64);
        let (start, number) = (index32(self.samples.len()), index32(self.spans.len()));
        self.spans.push(ChainSpan { yarn, points, image_shifts, start, segments: 0 });
        let chord = self.chord(number as usize).length();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to some segments"
        )]
        let segments = (chord / (SEGMENT_RADII * chain.radius))
            .ceil()
            .clamp(MIN_SEGMENTS, MAX_SEGMENTS) as u32;
        self.spans[number as usize].segments = segments;
        let rest = self.rest_chord(number as usize);
        self.rest_chords.push(rest);
        self.segments.extend((start..start + segments).map(|sample| CurveSegment {
            span: number,
            sample,
            along: 0.0,
        }));
        self.samples.resize(self.samples.len() + segments as usize + 1, DVec3::ZERO);
    }

    /// The four control points of a span, as images beside it.
    fn control_points(&self, span: &ChainSpan) -> [DVec3; 4] {
        let period = self.yarns[span.yarn as usize].period;
        std::array::from_fn(|k| {
            self.points[span.points[k] as usize] + period * span.image_shifts[k]
        })
    }

    /// The length of a span's chord in the shape that yarns take with room enough.
    fn rest_chord(&self, span: usize) -> f64 {
        let span = &self.spans[span];
        let period = self.yarns[span.yarn as usize].period;
        let [from, to] =
            [1, 2].map(|k| self.rest_points[span.points[k] as usize] + period * span.image_shifts[k]);
        from.distance(to)
    }

    fn chord(&self, span: usize) -> DVec3 {
        let [_, from, to, _] = self.control_points(&self.spans[span]);
        to - from
    }

    /// Both ends of a segment.
    fn ends(&self, segment: &CurveSegment) -> [DVec3; 2] {
        [0, 1].map(|end| self.samples[segment.sample as usize + end])
    }

    /// Weights of the control points at both ends of a segment.
    fn end_weights(&self, segment: CurveSegment) -> [&[f64; 4]; 2] {
        [0, 1].map(|end| &self.weights[segment.sample as usize + end])
    }

    /// Samples the curves at the points' present places.
    fn sample(&mut self) {
        // The knots of a centripetal Catmull-Rom curve depend on its control points, so the weights
        // do too. They are frozen here until the next call. Between two calls a sample is then
        // linear in the control points, which gives each contact a constant gradient.
        for span in &self.spans {
            let control = self.control_points(span);
            let weights = curve::weights(&control);
            for step in 0..=span.segments {
                let shares = weights.at(f64::from(step) / f64::from(span.segments));
                let sample = (span.start + step) as usize;
                self.weights[sample] = shares;
                self.samples[sample] = blend(&control, &shares);
            }
        }
        self.lengths.fill(0.0);
        for segment in &mut self.segments {
            let length = &mut self.lengths[self.spans[segment.span as usize].yarn as usize];
            let own = self.samples[segment.sample as usize]
                .distance(self.samples[segment.sample as usize + 1]);
            segment.along = *length + own / 2.0;
            *length += own;
        }
    }

    /// Builds the neighbour list: all pairs that might touch before it is built again. Returns the
    /// least distance over the sum of the radii, or `None` if there are too many pairs.
    fn find_contacts(&mut self) -> Option<f64> {
        let thickest = self.yarns.iter().map(|yarn| yarn.radius).fold(0.0, f64::max);
        let middles: Vec<_> = self
            .segments
            .iter()
            .map(|s| {
                let [from, to] = self.ends(s);
                (from + to) / 2.0
            })
            .collect();
        let halves: Vec<_> = self
            .segments
            .iter()
            .map(|s| {
                let [from, to] = self.ends(s);
                from.distance(to) / 2.0
            })
            .collect();
        let longest = halves.iter().copied().fold(0.0, f64::max);
        // Two segments within the cutoff have their middles within this distance, so a cell list of
        // the middles finds every pair.
        let cell_list =
            CellList::new(&middles, self.cell, LIST_CUTOFF * 2.0 * thickest + 2.0 * longest);
        let mut pairs = std::mem::take(&mut self.pairs);
        pairs.clear();
        let (mut nearest, mut candidates) = (f64::INFINITY, 0);
        for (s, one) in self.segments.iter().enumerate() {
            if pairs.len() > MAX_PAIRS || candidates > MAX_CANDIDATES {
                return None;
            }
            let yarn_s = self.spans[one.span as usize].yarn;
            let chain_s = &self.yarns[yarn_s as usize];
            cell_list.near(s, |t, shift| {
                candidates += 1;
                // The cell list gives each pair from both sides. Only one side is kept, or the
                // contact would be solved twice. A segment and its own image come twice likewise.
                if t < s || (t == s && (shift.x, shift.y) <= (0.0, 0.0)) {
                    return;
                }
                let other = &self.segments[t];
                let yarn_t = self.spans[other.span as usize].yarn;
                let contact_distance = chain_s.radius + self.yarns[yarn_t as usize].radius;
                let offset = (shift * self.cell).extend(0.0);
                // Bounding spheres reject most candidates before the exact distance is taken.
                let reach = LIST_CUTOFF * contact_distance + halves[s] + halves[t];
                if (middles[t] + offset).distance_squared(middles[s]) > reach * reach {
                    return;
                }
                if yarn_s == yarn_t && self.is_same_strand(one, other, shift, chain_s) {
                    return;
                }
                let other_ends = self.ends(other).map(|end| end + offset);
                let ratio = separation(self.ends(one), other_ends).length() / contact_distance;
                nearest = nearest.min(ratio);
                if ratio < LIST_CUTOFF {
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
        self.pairs = pairs;
        Some(nearest)
    }

    /// Whether two segments of one yarn are parts of one strand that lie close along it. `shift` is
    /// the image shift of the second one.
    fn is_same_strand(
        &self,
        s: &CurveSegment,
        t: &CurveSegment,
        shift: DVec2,
        chain: &YarnChain,
    ) -> bool {
        let runs_across = chain.period.x != 0.0;
        let (beside, along) = if runs_across { (shift.y, shift.x) } else { (shift.x, shift.y) };
        let length = self.lengths[self.spans[s.span as usize].yarn as usize];
        // An image shifted beside the yarn is another strand. One shifted along it is the same
        // strand, whole lengths of the repeat further on.
        beside == 0.0
            && (t.along + along * length - s.along).abs() <= SAME_STRAND_RADII * chain.radius
    }

    /// Contact constraints: moves the yarns of each pair in the list apart by what is missing from
    /// their distance. `inflation` is the share of their full radii that yarns have in this sweep.
    fn solve_contacts(&mut self, inflation: f64) {
        for at in 0..self.pairs.len() {
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
            let missing = TARGET_DISTANCE * inflation * contact_distance - distance;
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
                self.points[span_a.points[k] as usize] += push * weights_a[k];
                self.points[span_b.points[k] as usize] -= push * weights_b[k];
            }
        }
    }

    fn begin_sweep(&mut self) {
        self.before.clear();
        self.before.extend_from_slice(self.points);
    }

    fn limit_moves(&mut self, grown: f64) {
        for yarn in self.yarns {
            let limit = MAX_STEP * grown * yarn.radius;
            for at in yarn.points.clone() {
                let before = self.before[at];
                self.points[at] = before + (self.points[at] - before).clamp_length_max(limit);
            }
        }
    }

    /// Curvature constraints: opens bends that are tighter than the yarn's radius allows.
    /// Returns the largest curvature, over that of a bend with the yarn's radius.
    fn solve_curvature(&mut self, stiffness: f64, inflation: f64) -> f64 {
        let mut worst: f64 = 0.0;
        for number in 0..self.spans.len() {
            let span = self.spans[number];
            let radius = self.yarns[span.yarn as usize].radius * inflation.min(1.0);
            for t in CURVATURE_PLACES {
                let control = self.control_points(&span);
                let [first, second] = curve::weights(&control).derivatives(t);
                let (u, v) = (blend(&control, &first), blend(&control, &second));
                let turn = u.cross(v);
                let (speed, size) = (u.length().max(1e-12), turn.length());
                let curvature = size / (speed * speed * speed);
                worst = worst.max(curvature * radius);
                let excess = curvature - 1.0 / (MIN_BEND_RADIUS * radius);
                if excess <= 0.0 {
                    continue;
                }
                let axis = turn / size;
                let (by_first, by_second) = (
                    v.cross(axis) / speed.powi(3) - 3.0 * curvature * u / (speed * speed),
                    axis.cross(u) / speed.powi(3),
                );
                let gradients: [DVec3; 4] =
                    std::array::from_fn(|k| first[k] * by_first + second[k] * by_second);
                let squared: f64 = gradients.iter().map(|g| g.length_squared()).sum();
                for k in 0..4 {
                    let step = gradients[k] * (stiffness * excess / squared);
                    self.points[span.points[k] as usize] -= step.clamp_length_max(0.2 * radius);
                }
            }
        }
        worst
    }

    /// Stretch constraints: pulls neighbouring data points back to their distance as laid out
    /// (the distance constraint of Müller et al. 2007).
    fn solve_stretch(&mut self, stiffness: f64) {
        for span in 0..self.spans.len() {
            let chord = self.chord(span);
            let length = chord.length().max(1e-9);
            // Both ends have the same mass, so each takes half of the correction.
            let pull = chord * (0.5 * stiffness * (length - self.rest_chords[span]) / length);
            let [_, from, to, _] = self.spans[span].points.map(|point| point as usize);
            self.points[from] += pull;
            self.points[to] -= pull;
        }
    }

    /// Bending constraints: evens out the displacements of neighbouring data points, so that bends
    /// keep their shape.
    fn solve_bending(&mut self, stiffness: f64) {
        for span in 0..self.spans.len() {
            let [before, at, after, _] = self.spans[span].points.map(|point| point as usize);
            // The constraint keeps each point's discrete Laplacian as it was laid out. An angle
            // constraint would straighten loops, since it does not know their rest shape. Whole
            // yarns may move freely: equal displacements give no pull.
            let pull = stiffness
                * (self.displacement(before).midpoint(self.displacement(after))
                    - self.displacement(at));
            self.points[at] += pull;
        }
    }

    /// How far a data point has moved from where it was laid out.
    fn displacement(&self, point: usize) -> DVec3 {
        self.points[point] - self.rest_points[point]
    }

    /// Length constraints: brings yarns that grew or shrank by more than the tolerance back to
    /// their lengths, along the gradient of the length.
    fn solve_lengths(&mut self) {
        for yarn in self.yarns {
            // The length of the chords stands for that of the curve: it has a simple gradient, and
            // both change nearly alike.
            let chords: Vec<_> = yarn.points.clone().map(|span| self.chord(span)).collect();
            let now: f64 = chords.iter().map(|chord| chord.length()).sum();
            let rest: f64 = self.rest_chords[yarn.points.clone()].iter().sum();
            // An inequality constraint: within the tolerance a yarn may take or give length, as
            // real yarn slips through its loops. Nothing happens there.
            let change = now / rest - 1.0;
            let excess = change - change.clamp(-LENGTH_TOLERANCE, LENGTH_TOLERANCE);
            let gradient_squared: f64 =
                (0..chords.len()).map(|i| length_gradient(&chords, i).length_squared()).sum();
            // A straight yarn has no gradient: no small move of its points changes its length.
            if excess == 0.0 || gradient_squared < 1e-12 {
                continue;
            }
            let step = 0.5 * excess * rest / gradient_squared;
            for (i, point) in self.points[yarn.points.clone()].iter_mut().enumerate() {
                *point -= length_gradient(&chords, i) * step;
            }
        }
    }
}

/// Gradient of a closed chain's length for its `i`th point, from which chord `i` starts.
fn length_gradient(chords: &[DVec3], i: usize) -> DVec3 {
    let count = chords.len();
    chords[(i + count - 1) % count].normalize_or_zero() - chords[i].normalize_or_zero()
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

fn blend(control: &[DVec3; 4], weights: &[f64; 4]) -> DVec3 {
    control[0] * weights[0]
        + control[1] * weights[1]
        + control[2] * weights[2]
        + control[3] * weights[3]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::knit::clearance::SampledPaths;

    const CELL: DVec2 = DVec2::new(1.0, 1.0);

    /// A straight yarn up the cell through `points` places.
    fn upright(x: f64, z: f64, points: usize) -> Vec<DVec3> {
        (0..points)
            .map(|i| DVec3::new(x, f64::from(index32(i)) / f64::from(index32(points)), z))
            .collect()
    }

    fn chain(points: Range<usize>, radius: f64) -> YarnChain {
        YarnChain { points, period: DVec3::Y, radius }
    }

    #[test]
    fn yarns_that_overlap_side_by_side_end_up_touching() {
        let mut points = [upright(0.5, 0.0, 4), upright(0.55, 0.01, 4)].concat();
        let relaxation = relax(&mut points, &[chain(0..4, 0.05), chain(4..8, 0.05)], CELL);
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
        let mut points: Vec<_> = upright(0.05, 0.0, 8);
        points[4].x = 1.02;
        let before = points.clone();
        relax(&mut points, &[chain(0..8, 0.06)], CELL);
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
            least(&before) < 0.5 && least(&points) > 0.98,
            "{} before, {} after",
            least(&before),
            least(&points)
        );
    }

    #[test]
    fn yarns_apart_are_left_as_they_are() {
        let mut points = [upright(0.2, 0.0, 3), upright(0.7, 0.0, 5)].concat();
        let before = points.clone();
        let relaxation = relax(&mut points, &[chain(0..3, 0.1), chain(3..8, 0.1)], CELL);
        assert_eq!((points, relaxation), (before, Relaxation { sweeps: 0, stretch: 0.0, grown: 1.0 }));
    }

    #[test]
    fn what_lies_in_the_same_place_stays_finite() {
        let mut points =
            [upright(0.5, 0.0, 3), upright(0.5, 0.0, 3), upright(0.5, 0.0, 3)].concat();
        let chains = [chain(0..3, 0.05), chain(3..6, 0.05), chain(6..9, 0.02)];
        let relaxation = relax(&mut points, &chains, CELL);
        assert!(points.iter().all(|p| p.is_finite()) && relaxation.stretch < 0.02);
    }
}
