//! The yarns' curves in the solver: spans between data points, sampled as segments.
//!
//! In: the chains of data points. Out: samples of their centripetal Catmull-Rom curves, with the
//! weights of the data points in each, and lengths along the yarns. Cost: some nanoseconds a
//! sample. Method and promises: see the parent module.

use glam::{DVec2, DVec3};

use super::shape::{LENGTH_TOLERANCE, largest_curvature};
use super::{Solver, YarnChain, YarnLength};
use crate::ids::index32;
use crate::knit::chain::{ControlChain, SpanControl, blend};
use crate::yarn::curve;

/// Length of a segment of the sampled curve, radii. Longer segments cut the corners of bends, so
/// contacts are missed there; shorter ones cost time with the square of their number.
const SEGMENT_RADII: f64 = 1.35;
/// Length of a drafted yarn over that of a straight line. At 1 the loops that it passes by turns
/// would have to leave their wale by their whole width.
const DRAFTED_LENGTH: f64 = 1.03;
/// Spans on each side of the one that starts at a data point to which that point is a control point.
/// The third one after it is not, which does no harm.
const CONTROLLED_SPANS: usize = 2;

/// A span of the curve between two data points.
#[derive(Clone, Copy)]
pub(super) struct ChainSpan {
    pub(super) yarn: u32,
    pub(super) control: SpanControl,
    /// Index of its first sample. It has one sample more than segments.
    pub(super) start: u32,
    pub(super) segments: u32,
    /// Its first segment.
    segment: u32,
}

/// A segment of a sampled curve: from a sample to the next.
#[derive(Clone, Copy)]
pub(super) struct CurveSegment {
    pub(super) span: u32,
    /// Its first sample.
    pub(super) sample: u32,
    /// Yarn length from the start of the repeat to its middle.
    pub(super) along: f64,
}

impl<'a> Solver<'a> {
    /// A solver at its start.
    pub(super) fn new(
        points: &'a mut [DVec3],
        shape: &[DVec3],
        yarns: &'a [YarnChain],
        cell: DVec2,
    ) -> Self {
        let mut solver = Self {
            rest_points: shape.to_vec(),
            points,
            yarns,
            cell,
            spans: Vec::new(),
            segments: Vec::new(),
            weights: Vec::new(),
            samples: Vec::new(),
            lengths: vec![0.0; yarns.len()],
            lengths_over_chords: Vec::new(),
            rest_lengths: Vec::new(),
            rest_chords: Vec::new(),
            length_tolerance: LENGTH_TOLERANCE,
            before: Vec::new(),
            list_points: Vec::new(),
            sampled_points: Vec::new(),
            moved: Vec::new(),
            span_lengths: Vec::new(),
            curvatures: Vec::new(),
            bends: Vec::new(),
            active: Vec::new(),
            pairs: Vec::new(),
            ratios: Vec::new(),
            swept_pairs: Vec::new(),
        };
        for (yarn, chain) in (0u32..).zip(yarns) {
            let chain = &chain.chain;
            chain.points.clone().for_each(|at| solver.add_span(yarn, chain, at));
        }
        solver.weights.resize(solver.samples.len(), [0.0; 4]);
        let spans = solver.spans.len();
        (solver.active, solver.moved) = (vec![true; spans], vec![true; spans]);
        (solver.span_lengths, solver.curvatures) = (vec![0.0; spans], vec![0.0; spans]);
        solver.set_rest_lengths();
        solver
    }

    /// Measures the yarns' lengths in their shape, and scales their chords to the lengths that they
    /// should have.
    fn set_rest_lengths(&mut self) {
        let mut lengths = vec![0.0; self.yarns.len()];
        for span in &self.spans {
            let control = self.images(span, &self.rest_points);
            lengths[span.yarn as usize] += curve::span(&control, 1).precise_length();
        }
        let scales = self.yarns.iter().zip(&lengths).map(|(yarn, length)| match yarn.length {
            YarnLength::Fed(fed) => fed / length,
            YarnLength::Slack(slack) => 1.0 + slack,
            YarnLength::Drafted => DRAFTED_LENGTH * yarn.chain.period.length() / length,
            YarnLength::Shape | YarnLength::Taut => 1.0,
        });
        let scales = scales.collect::<Vec<_>>();
        let chords = self.spans.iter().map(|span| {
            let [_, from, to, _] = self.images(span, &self.rest_points);
            scales[span.yarn as usize] * from.distance(to)
        });
        self.rest_chords = chords.collect();
        self.rest_lengths =
            lengths.iter().zip(scales).map(|(length, scale)| length * scale).collect();
    }

    /// Adds the span that starts at a point of a yarn.
    fn add_span(&mut self, yarn: u32, chain: &ControlChain, at: usize) {
        let (start, number) = (index32(self.samples.len()), index32(self.spans.len()));
        let segment = index32(self.segments.len());
        let control = chain.control(at);
        let [_, from, to, _] = control.places(self.points, chain.period);
        let segments = chain.segments(from.distance(to), SEGMENT_RADII);
        self.spans.push(ChainSpan { yarn, control, start, segments, segment });
        self.segments.extend((start..start + segments).map(|sample| CurveSegment {
            span: number,
            sample,
            along: 0.0,
        }));
        self.samples.resize(self.samples.len() + segments as usize + 1, DVec3::ZERO);
    }

    /// The four control points of a span, as images beside it.
    pub(super) fn control_points(&self, span: &ChainSpan) -> [DVec3; 4] {
        self.images(span, self.points)
    }

    /// The images beside a span of its four points in `points`.
    #[inline]
    fn images(&self, span: &ChainSpan, points: &[DVec3]) -> [DVec3; 4] {
        span.control.places(points, self.yarns[span.yarn as usize].chain.period)
    }

    pub(super) fn chord(&self, span: usize) -> DVec3 {
        let [_, from, to, _] = self.control_points(&self.spans[span]);
        to - from
    }

    /// Both ends of a segment.
    pub(super) fn ends(&self, segment: &CurveSegment) -> [DVec3; 2] {
        [0, 1].map(|end| self.samples[segment.sample as usize + end])
    }

    /// Weights of the control points at both ends of a segment.
    pub(super) fn end_weights(&self, segment: CurveSegment) -> [&[f64; 4]; 2] {
        [0, 1].map(|end| &self.weights[segment.sample as usize + end])
    }

    /// Samples the curves at the points' present places. What has not moved since the last call is
    /// left as it is.
    pub(super) fn sample(&mut self) {
        self.find_moved();
        // The knots of a centripetal Catmull-Rom curve depend on its control points, so the weights
        // do too. They are frozen here until the next call. Between two calls a sample is then
        // linear in the control points, which gives each contact a constant gradient.
        for number in 0..self.spans.len() {
            if !self.moved[number] {
                continue;
            }
            let span = self.spans[number];
            let control = self.control_points(&span);
            let weights = curve::weights(&control);
            for step in 0..=span.segments {
                let shares = weights.at(f64::from(step) / f64::from(span.segments));
                let sample = (span.start + step) as usize;
                self.weights[sample] = shares;
                self.samples[sample] = blend(&control, &shares);
            }
            self.span_lengths[number] = curve::span(&control, 1).precise_length();
            self.curvatures[number] = largest_curvature(&control, &weights);
        }
        self.measure_lengths();
    }

    /// Marks the spans of which a control point has moved since the last call.
    fn find_moved(&mut self) {
        let mut moved = std::mem::take(&mut self.moved);
        moved.fill(self.sampled_points.is_empty());
        let places = self.points.iter().zip(&self.sampled_points);
        for (at, _) in (0u32..).zip(places).filter(|(_, (now, then))| now != then) {
            self.mark(at, CONTROLLED_SPANS, &mut moved);
        }
        self.moved = moved;
        self.sampled_points.clear();
        self.sampled_points.extend_from_slice(self.points);
    }

    /// Marks a span and those of its yarn that are at most so many places away.
    pub(super) fn mark(&self, span: u32, reach: usize, marks: &mut [bool]) {
        let yarn = &self.yarns[self.spans[span as usize].yarn as usize];
        let (first, count) = (yarn.chain.points.start, yarn.chain.points.len());
        for beside in 0..=2 * reach {
            let at = (span as usize - first + beside + count * reach - reach) % count;
            marks[first + at] = true;
        }
    }

    /// Measures the length of each yarn, and how far along it each segment lies.
    fn measure_lengths(&mut self) {
        self.lengths.fill(0.0);
        for (span, length) in self.spans.iter().zip(&self.span_lengths) {
            let along = &mut self.lengths[span.yarn as usize];
            // The segments of a span are about equally long.
            let step = length / f64::from(span.segments);
            let first = span.segment as usize;
            for (segment, number) in self.segments[first..].iter_mut().zip(0..span.segments) {
                segment.along = *along + (f64::from(number) + 0.5) * step;
            }
            *along += length;
        }
        let chords = self.yarns.iter().map(|yarn| {
            yarn.chain.points.clone().map(|span| self.chord(span).length()).sum::<f64>().max(1e-9)
        });
        self.lengths_over_chords =
            chords.zip(&self.lengths).map(|(chords, length)| length / chords).collect();
    }

    /// The largest difference of a yarn's length from what it should be, as a share of it.
    pub(super) fn stretch(&self) -> f64 {
        self.length_error(|length| !length.is_tense())
    }

    /// The same of the yarns of which the length is given, by a run-in or a draft.
    pub(super) fn misfed(&self) -> f64 {
        self.length_error(|length| matches!(length, YarnLength::Fed(_) | YarnLength::Drafted))
    }

    fn length_error(&self, counts: impl Fn(YarnLength) -> bool) -> f64 {
        let yarns = self.yarns.iter().zip(self.lengths.iter().zip(&self.rest_lengths));
        let counted = yarns.filter(|(yarn, _)| counts(yarn.length));
        let errors = counted.map(|(yarn, (&length, &rest))| {
            let change = length / rest - 1.0;
            match yarn.length {
                YarnLength::Shape | YarnLength::Fed(_) | YarnLength::Slack(_) => change.abs(),
                YarnLength::Drafted => change.max(0.0),
                YarnLength::Taut => 0.0,
            }
        });
        errors.fold(0.0, f64::max)
    }

    /// From the lowest to the highest surface of the yarns, mm.
    pub(super) fn thickness(&self) -> f64 {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for span in &self.spans {
            let radius = self.yarns[span.yarn as usize].chain.radius;
            let start = span.start as usize;
            for sample in &self.samples[start..=start + span.segments as usize] {
                (low, high) = (low.min(sample.z - radius), high.max(sample.z + radius));
            }
        }
        high - low
    }
}
