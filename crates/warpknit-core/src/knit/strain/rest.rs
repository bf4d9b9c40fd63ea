//! The repeat at rest: what its yarns keep when the cloth is strained.
//!
//! In: the data points of the flat relaxed repeat, periodic in both directions. Out: [`Rest`], spans
//! with their lengths and chords, and how near yarns lie. Cost: as a sweep of the relaxation.

use glam::{DVec2, DVec3};

use crate::ids::index32;
use crate::knit::chain::{ControlChain, SpanControl};

/// Length of a segment of the sampled curve, radii. Longer ones cut the corners of bends, so yarns
/// lie nearer than the solver sees; shorter ones cost time with the square of their number.
const SEGMENT_RADII: f64 = 0.9;

/// A yarn of the repeat at rest.
#[derive(Clone, Debug)]
pub(crate) struct RestYarn {
    pub(crate) chain: ControlChain,
    /// Whether it may change its length: elastane, and inlays with slack.
    pub(crate) is_elastic: bool,
}

/// A span of a yarn's curve between two data points.
#[derive(Clone, Copy, Debug)]
pub(super) struct RestSpan {
    pub(super) yarn: u32,
    pub(super) control: SpanControl,
    /// Its first sample. It has one sample more than segments.
    pub(super) start: u32,
    pub(super) segments: u32,
    /// Its length, mm, as the solver samples it.
    pub(super) length: f64,
    /// Distances of its first control point to the third and the fourth, mm.
    pub(super) chords: [f64; 2],
}

/// A segment of a sampled curve.
#[derive(Clone, Copy, Debug)]
pub(super) struct RestSegment {
    pub(super) span: u32,
    /// Its first sample.
    pub(super) sample: u32,
}

/// A repeat at rest.
#[derive(Clone, Debug)]
pub(super) struct Rest {
    pub(super) points: Vec<DVec3>,
    pub(super) yarns: Vec<RestYarn>,
    /// Size of the repeat, mm.
    pub(super) cell: DVec2,
    pub(super) spans: Vec<RestSpan>,
    pub(super) segments: Vec<RestSegment>,
    /// Number of all samples.
    pub(super) samples: usize,
    /// Radius of the thinnest yarn, mm.
    pub(super) thinnest: f64,
    /// Distance over the sum of the radii at which contacts aim.
    pub(super) target: f64,
    /// Weight of the pull towards the flat shape.
    pub(super) pull: f64,
    /// How far points are moved aside before a strain is solved, radii.
    pub(super) nudge: f64,
    /// How many times as much as usual bends resist.
    pub(super) bending: f64,
}

impl Rest {
    /// A repeat whose spans have no lengths yet.
    pub(super) fn new(points: Vec<DVec3>, yarns: Vec<RestYarn>, cell: DVec2, pull: f64) -> Self {
        let thinnest = yarns.iter().map(|yarn| yarn.chain.radius).fold(f64::INFINITY, f64::min);
        let mut rest = Self {
            points,
            yarns,
            cell,
            spans: Vec::new(),
            segments: Vec::new(),
            samples: 0,
            thinnest,
            target: 1.0,
            pull,
            nudge: 0.0,
            bending: 1.0,
        };
        for yarn in 0..rest.yarns.len() {
            rest.yarns[yarn].chain.points.clone().for_each(|at| rest.add_span(yarn, at));
        }
        rest
    }

    /// The four control points of a span.
    pub(super) fn control(&self, span: &RestSpan) -> [DVec3; 4] {
        span.control.places(&self.points, self.yarns[span.yarn as usize].chain.period)
    }

    /// Adds the span that starts at a point of a yarn.
    fn add_span(&mut self, number: usize, at: usize) {
        let chain = &self.yarns[number].chain;
        let control = chain.control(at);
        let [first, from, to, last] = control.places(&self.points, chain.period);
        let segments = chain.segments(from.distance(to), SEGMENT_RADII);
        let (span, start) = (index32(self.spans.len()), index32(self.samples));
        self.spans.push(RestSpan {
            yarn: index32(number),
            control,
            start,
            segments,
            length: 0.0,
            chords: [first.distance(to), first.distance(last)],
        });
        let own = (start..start + segments).map(|sample| RestSegment { span, sample });
        self.segments.extend(own);
        self.samples += segments as usize + 1;
    }
}
