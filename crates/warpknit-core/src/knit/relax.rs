//! The yarn relaxation: yarns that would cut each other are pushed apart.
//!
//! In: the yarns of one repeat as closed chains of data points, periodic across and along, and
//! their radii. Out: the same points, moved. Position-based: where two paths are nearer than the
//! sum of their radii, the data points that carry them are moved apart by what is missing, chords
//! pull back to their lengths and the yarn's bends to their shapes, sweep after sweep. The path is
//! the Catmull-Rom curve through the data points itself, so what is settled here is what is drawn.
//! Source: the specification's knit page; Müller et al. 2007 (position-based dynamics). Sweeps run
//! in a fixed order on one thread, so the result is the same everywhere. Not promised: a state
//! without cuts ([`Settled`] says how it ended, [`super::clearance`] measures it), or loops that
//! interlock where the layout doesn't: of three bars and more, a few are laid beside each other and
//! stay so.

use std::ops::Range;

use glam::{DVec2, DVec3};

use super::cell_list::Images;
use crate::ids::index32;
use crate::yarn::curve;

/// Segments of a span: one for so many radii of its length, within these limits.
const SEGMENT_RADII: f64 = 0.8;
const FEWEST_SEGMENTS: f64 = 4.0;
const MOST_SEGMENTS: f64 = 12.0;
/// What is aimed at: a little more than touching, for chords lie inside the curve's bends.
const TOUCHING: f64 = 1.04;
/// Settled at this share of touching.
const GOAL: f64 = 1.01;
/// Yarns start as thick as they lie clear and grow by this share a look, so that none is pushed
/// through to another's wrong side.
const GROWTH: f64 = 0.05;
/// Sweeps between two looks at what is near, and the most of them.
const SWEEPS: usize = 8;
const MOST_SWEEPS: usize = 400;
/// The most looks at a pair in all: some seconds.
const MOST_VISITS: usize = 40_000_000;
/// More neighbours than this at one look, or more pairs, mean that whole yarns lie in each other's
/// place, which nothing pushes apart.
const MOST_NEIGHBOURS: usize = 40_000_000;
const MOST_PAIRS: usize = 400_000;
/// Pairs up to this many times touching are watched until the next look.
const WATCHED: f64 = 1.35;
/// A watched pair is left alone for a sweep for each such share of touching between them.
const DOZING: f64 = 0.06;
/// Parts of one strand nearer along it than so many radii are neighbours, not contacts.
const NEIGHBOURHOOD: f64 = 6.0;
/// Share of its missing distance that a contact is given at once.
const CONTACT_STIFFNESS: f64 = 0.25;
/// No contact moves a yarn by more than this share of its radius at once.
const LARGEST_MOVE: f64 = 0.3;
/// Lengths are held to this; the specification allows 2 %.
const LENGTH_SLACK: f64 = 0.012;
const STRETCH_STIFFNESS: f64 = 0.15;
const BENDING_STIFFNESS: f64 = 0.12;
/// Stretch and bending fade by this each sweep, so that contacts have the last word.
const FADING: f64 = 0.95;

/// One yarn of the repeat: a chain that goes on into the next repeat.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    /// Its data points.
    pub(super) points: Range<usize>,
    /// From a point to the same one in the next repeat, mm: along the wales, or across for a weft.
    pub(super) period: DVec3,
    /// mm.
    pub(super) radius: f64,
}

/// How the relaxation ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settled {
    /// Sweeps over all contacts.
    pub sweeps: usize,
    /// The largest change of a yarn's length, as a share of it.
    pub stretch: f64,
}

/// Moves `points` until no two yarns are nearer than they are thick, or the sweeps are over.
pub(super) fn settle(points: &mut [DVec3], yarns: &[Chain], cell: DVec2) -> Settled {
    let mut state = State::new(points, yarns, cell);
    state.sample();
    let lengths = state.lengths.clone();
    let mut sweeps = 0;
    let mut visits = 0;
    let mut firmness = 1.0;
    let mut grown: f64 = 0.0;
    while sweeps < MOST_SWEEPS && visits < MOST_VISITS {
        state.sample();
        let Some(nearest) = state.watch() else { break };
        if nearest >= GOAL {
            break;
        }
        grown = (grown.max(nearest) + GROWTH).min(1.0);
        for _ in 0..SWEEPS {
            state.push_apart(grown);
            state.hold_chords(STRETCH_STIFFNESS * firmness);
            state.hold_bends(BENDING_STIFFNESS * firmness);
            state.hold_lengths();
            firmness *= FADING;
        }
        sweeps += SWEEPS;
        visits += SWEEPS * state.pairs.len();
    }
    state.sample();
    let changes =
        state.lengths.iter().zip(&lengths).map(|(now, &before)| (now / before - 1.0).abs());
    Settled { sweeps, stretch: changes.fold(0.0, f64::max) }
}

/// A span between two data points: the four that carry it, and its samples.
#[derive(Clone, Copy)]
struct Span {
    yarn: u32,
    points: [u32; 4],
    /// Periods from each to its image beside the span.
    turns: [f64; 4],
    /// Index of its first sample; one more than segments belong to it.
    start: u32,
    segments: u32,
}

/// A piece of a path: from a sample to the next.
#[derive(Clone, Copy)]
struct Segment {
    span: u32,
    /// Its first sample.
    sample: u32,
    /// Yarn length up to its middle.
    along: f64,
}

/// Two pieces of path that may touch.
#[derive(Clone, Copy)]
struct Pair {
    a: u32,
    b: u32,
    /// Sweeps for which the two are too far apart to be looked at.
    dozing: u32,
    /// From b to its image beside a.
    offset: DVec3,
    touching: f64,
}

struct State<'a> {
    points: &'a mut [DVec3],
    yarns: &'a [Chain],
    cell: DVec2,
    /// One a data point: the span that starts there.
    spans: Vec<Span>,
    segments: Vec<Segment>,
    /// Shares of a span's four points in its samples, and the samples.
    weights: Vec<[f64; 4]>,
    samples: Vec<DVec3>,
    /// Length of each yarn's repeat.
    lengths: Vec<f64>,
    /// The chords' lengths and the points as they were laid out.
    chords: Vec<f64>,
    drawn: Vec<DVec3>,
    pairs: Vec<Pair>,
}

impl<'a> State<'a> {
    fn new(points: &'a mut [DVec3], yarns: &'a [Chain], cell: DVec2) -> Self {
        let mut state = Self {
            drawn: points.to_vec(),
            points,
            yarns,
            cell,
            spans: Vec::new(),
            segments: Vec::new(),
            weights: Vec::new(),
            samples: Vec::new(),
            lengths: vec![0.0; yarns.len()],
            chords: Vec::new(),
            pairs: Vec::new(),
        };
        for (yarn, thread) in (0u32..).zip(yarns) {
            thread.points.clone().for_each(|at| state.add_span(yarn, thread, at));
        }
        state.weights.resize(state.samples.len(), [0.0; 4]);
        state
    }

    /// Adds the span that starts at a point of a yarn.
    fn add_span(&mut self, yarn: u32, thread: &Chain, at: usize) {
        let count = i64::from(index32(thread.points.len()));
        let at = i64::from(index32(at - thread.points.start));
        let carriers = [at - 1, at, at + 1, at + 2];
        let place =
            |i: i64| usize::try_from(i.rem_euclid(count)).expect("a remainder is not negative");
        #[expect(clippy::cast_precision_loss, reason = "a repeat or two")]
        let turns = |i: i64| i.div_euclid(count) as f64;
        let (start, number) = (index32(self.samples.len()), index32(self.spans.len()));
        let points = carriers.map(|i| index32(thread.points.start + place(i)));
        self.spans.push(Span { yarn, points, turns: carriers.map(turns), start, segments: 0 });
        let chord = self.chord(number as usize).length();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to some segments"
        )]
        let segments = (chord / (SEGMENT_RADII * thread.radius))
            .ceil()
            .clamp(FEWEST_SEGMENTS, MOST_SEGMENTS) as u32;
        self.spans[number as usize].segments = segments;
        self.chords.push(chord);
        self.segments.extend((start..start + segments).map(|sample| Segment {
            span: number,
            sample,
            along: 0.0,
        }));
        self.samples.resize(self.samples.len() + segments as usize + 1, DVec3::ZERO);
    }

    /// The four points that carry a span, beside it.
    fn carriers(&self, span: &Span) -> [DVec3; 4] {
        let period = self.yarns[span.yarn as usize].period;
        std::array::from_fn(|k| self.points[span.points[k] as usize] + period * span.turns[k])
    }

    fn chord(&self, span: usize) -> DVec3 {
        let [_, from, to, _] = self.carriers(&self.spans[span]);
        to - from
    }

    /// Draws the paths anew.
    fn sample(&mut self) {
        for span in &self.spans {
            let carriers = self.carriers(span);
            let weights = curve::weights(&carriers);
            for step in 0..=span.segments {
                let shares = weights.at(f64::from(step) / f64::from(span.segments));
                let sample = (span.start + step) as usize;
                self.weights[sample] = shares;
                self.samples[sample] = blend(&carriers, &shares);
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

    /// Notes all pairs that might touch before the next look, and returns the least distance over
    /// touching; `None` if there are too many.
    fn watch(&mut self) -> Option<f64> {
        let thickest = self.yarns.iter().map(|yarn| yarn.radius).fold(0.0, f64::max);
        let ends =
            |segment: &Segment| [0, 1].map(|end| self.samples[segment.sample as usize + end]);
        let middles: Vec<_> =
            self.segments.iter().map(|s| (ends(s)[0] + ends(s)[1]) / 2.0).collect();
        let halves: Vec<_> =
            self.segments.iter().map(|s| ends(s)[0].distance(ends(s)[1]) / 2.0).collect();
        let longest = halves.iter().copied().fold(0.0, f64::max);
        let images = Images::new(&middles, self.cell, WATCHED * 2.0 * thickest + 2.0 * longest);
        let mut pairs = std::mem::take(&mut self.pairs);
        pairs.clear();
        let (mut nearest, mut neighbours) = (f64::INFINITY, 0);
        for (s, one) in self.segments.iter().enumerate() {
            if pairs.len() > MOST_PAIRS || neighbours > MOST_NEIGHBOURS {
                return None;
            }
            let yarn_s = self.spans[one.span as usize].yarn;
            let thread_s = &self.yarns[yarn_s as usize];
            images.near(s, |t, turns| {
                neighbours += 1;
                // Each pair is met from both sides; an image of the segment itself likewise.
                if t < s || (t == s && (turns.x, turns.y) <= (0.0, 0.0)) {
                    return;
                }
                let other = &self.segments[t];
                let yarn_t = self.spans[other.span as usize].yarn;
                let touching = thread_s.radius + self.yarns[yarn_t as usize].radius;
                let offset = (turns * self.cell).extend(0.0);
                let reach = WATCHED * touching + halves[s] + halves[t];
                if (middles[t] + offset).distance_squared(middles[s]) > reach * reach {
                    return;
                }
                if yarn_s == yarn_t && self.is_neighbour(one, other, turns, thread_s) {
                    return;
                }
                let ratio = gap(ends(one), ends(other).map(|end| end + offset)).length() / touching;
                nearest = nearest.min(ratio);
                if ratio < WATCHED {
                    pairs.push(Pair { a: index32(s), b: index32(t), dozing: 0, offset, touching });
                }
            });
        }
        self.pairs = pairs;
        Some(nearest)
    }

    /// Whether two segments of one yarn are parts of one strand that lie close along it.
    fn is_neighbour(&self, s: &Segment, t: &Segment, turns: DVec2, thread: &Chain) -> bool {
        let runs_across = thread.period.x != 0.0;
        let (beside, along) = if runs_across { (turns.y, turns.x) } else { (turns.x, turns.y) };
        let length = self.lengths[self.spans[s.span as usize].yarn as usize];
        beside == 0.0 && (t.along + along * length - s.along).abs() <= NEIGHBOURHOOD * thread.radius
    }

    /// Moves the yarns of each watched pair apart by what is missing.
    fn push_apart(&mut self, grown: f64) {
        for at in 0..self.pairs.len() {
            let Pair { a, b, dozing, offset, touching } = self.pairs[at];
            if dozing > 0 {
                self.pairs[at].dozing -= 1;
                continue;
            }
            let (a, b) = (self.segments[a as usize], self.segments[b as usize]);
            let (span_a, span_b) = (self.spans[a.span as usize], self.spans[b.span as usize]);
            let (carriers_a, carriers_b) = (self.carriers(&span_a), self.carriers(&span_b));
            let shares =
                |segment: Segment, end: usize| &self.weights[segment.sample as usize + end];
            let one = [0, 1].map(|end| blend(&carriers_a, shares(a, end)));
            let other = [0, 1].map(|end| blend(&carriers_b, shares(b, end)) + offset);
            let (along_a, along_b) = curve::nearest_of_segments(one, other);
            let apart = one[0].lerp(one[1], along_a) - other[0].lerp(other[1], along_b);
            let distance = apart.length();
            let missing = TOUCHING * grown * touching - distance;
            if missing <= 0.0 {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a few sweeps"
                )]
                let sweeps = (-missing / (DOZING * touching)) as u32;
                self.pairs[at].dozing = sweeps;
                continue;
            }
            let direction = if distance > 1e-9 { apart / distance } else { DVec3::Z };
            let between = |segment: Segment, along: f64| -> [f64; 4] {
                std::array::from_fn(|k| {
                    shares(segment, 0)[k] + along * (shares(segment, 1)[k] - shares(segment, 0)[k])
                })
            };
            let (shares_a, shares_b) = (between(a, along_a), between(b, along_b));
            let inertia: f64 = shares_a.iter().chain(&shares_b).map(|share| share * share).sum();
            let push =
                direction * ((CONTACT_STIFFNESS * missing).min(LARGEST_MOVE * touching) / inertia);
            for k in 0..4 {
                self.points[span_a.points[k] as usize] += push * shares_a[k];
                self.points[span_b.points[k] as usize] -= push * shares_b[k];
            }
        }
    }

    /// Pulls neighbouring data points back to their distance.
    fn hold_chords(&mut self, stiffness: f64) {
        for span in 0..self.spans.len() {
            let chord = self.chord(span);
            let length = chord.length().max(1e-9);
            let pull = chord * (0.5 * stiffness * (length - self.chords[span]) / length);
            let [_, from, to, _] = self.spans[span].points.map(|point| point as usize);
            self.points[from] += pull;
            self.points[to] -= pull;
        }
    }

    /// Evens out how far neighbouring data points were moved: bends keep their shape.
    fn hold_bends(&mut self, stiffness: f64) {
        for span in 0..self.spans.len() {
            let [before, at, after, _] = self.spans[span].points.map(|point| point as usize);
            let moved = |point: usize| self.points[point] - self.drawn[point];
            let pull = stiffness * (moved(before).midpoint(moved(after)) - moved(at));
            self.points[at] += pull;
        }
    }

    /// Brings yarns that grew or shrank too much back to their lengths, along the steepest way.
    fn hold_lengths(&mut self) {
        for yarn in self.yarns {
            // The curve's length follows its chords'.
            let chords: Vec<_> = yarn.points.clone().map(|span| self.chord(span)).collect();
            let now: f64 = chords.iter().map(|chord| chord.length()).sum();
            let drawn: f64 = self.chords[yarn.points.clone()].iter().sum();
            let change = now / drawn - 1.0;
            let excess = change - change.clamp(-LENGTH_SLACK, LENGTH_SLACK);
            let count = chords.len();
            let gradient = |i: usize| {
                chords[(i + count - 1) % count].normalize_or_zero() - chords[i].normalize_or_zero()
            };
            let steepness: f64 = (0..count).map(|i| gradient(i).length_squared()).sum();
            if excess == 0.0 || steepness < 1e-12 {
                continue;
            }
            let step = 0.5 * excess * drawn / steepness;
            for (i, point) in self.points[yarn.points.clone()].iter_mut().enumerate() {
                *point -= gradient(i) * step;
            }
        }
    }
}

/// From the nearest point of the second segment to that of the first.
fn gap(one: [DVec3; 2], other: [DVec3; 2]) -> DVec3 {
    let (along_one, along_other) = curve::nearest_of_segments(one, other);
    one[0].lerp(one[1], along_one) - other[0].lerp(other[1], along_other)
}

fn blend(carriers: &[DVec3; 4], weights: &[f64; 4]) -> DVec3 {
    carriers[0] * weights[0]
        + carriers[1] * weights[1]
        + carriers[2] * weights[2]
        + carriers[3] * weights[3]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::knit::clearance::Paths;

    const CELL: DVec2 = DVec2::new(1.0, 1.0);

    /// A straight yarn up the cell through `points` places.
    fn upright(x: f64, z: f64, points: usize) -> Vec<DVec3> {
        (0..points)
            .map(|i| DVec3::new(x, f64::from(index32(i)) / f64::from(index32(points)), z))
            .collect()
    }

    fn chain(points: Range<usize>, radius: f64) -> Chain {
        Chain { points, period: DVec3::Y, radius }
    }

    #[test]
    fn yarns_that_overlap_side_by_side_end_up_touching() {
        let mut points = [upright(0.5, 0.0, 4), upright(0.55, 0.01, 4)].concat();
        let settled = settle(&mut points, &[chain(0..4, 0.05), chain(4..8, 0.05)], CELL);
        // They may slide along each other.
        for (a, b) in points[..4].iter().zip(&points[4..]) {
            let apart = DVec2::new(a.x - b.x, a.z - b.z).length();
            assert!((0.1..0.14).contains(&apart), "{apart}");
        }
        assert!(settled.sweeps > 0 && settled.stretch < 0.001);
    }

    #[test]
    fn a_yarn_keeps_clear_of_its_own_image_in_the_next_repeat() {
        // It bulges over the cell's right border towards the image's straight part.
        let mut points: Vec<_> = upright(0.05, 0.0, 8);
        points[4].x = 1.02;
        let before = points.clone();
        settle(&mut points, &[chain(0..8, 0.06)], CELL);
        let least = |points: &[DVec3]| {
            let mut paths = Paths::default();
            // The yarn and its image, over three repeats.
            for image in [DVec3::ZERO, DVec3::X] {
                let run = (-1..2).flat_map(|turn| {
                    points.iter().map(move |p| *p + image + DVec3::Y * f64::from(turn))
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
        let settled = settle(&mut points, &[chain(0..3, 0.1), chain(3..8, 0.1)], CELL);
        assert_eq!((points, settled), (before, Settled { sweeps: 0, stretch: 0.0 }));
    }

    #[test]
    fn what_lies_in_the_same_place_stays_finite() {
        let mut points =
            [upright(0.5, 0.0, 3), upright(0.5, 0.0, 3), upright(0.5, 0.0, 3)].concat();
        let chains = [chain(0..3, 0.05), chain(3..6, 0.05), chain(6..9, 0.02)];
        let settled = settle(&mut points, &chains, CELL);
        assert!(points.iter().all(|p| p.is_finite()) && settled.stretch < 0.02);
    }
}
