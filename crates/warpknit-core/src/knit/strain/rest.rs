//! The repeat at rest: what its yarns keep when the cloth is strained.
//!
//! In: the data points of the flat relaxed repeat, periodic in both directions. Out: [`Rest`], spans
//! with their lengths and chords, and how near yarns lie. Cost: as a sweep of the relaxation.

use std::array::from_fn;
use std::ops::Range;

use glam::{DVec2, DVec3};

use crate::ids::index32;

/// Length of a segment of the sampled curve, radii. Longer ones cut the corners of bends, so yarns
/// lie nearer than the solver sees; shorter ones cost time with the square of their number.
const SEGMENT_RADII: f64 = 0.9;
/// Limits of the segments of one span.
const MIN_SEGMENTS: f64 = 4.0;
const MAX_SEGMENTS: f64 = 12.0;

/// A yarn of the repeat: a chain that continues in the next repeat.
#[derive(Clone, Debug)]
pub(crate) struct RestYarn {
    /// Its data points.
    pub(crate) points: Range<usize>,
    /// From a point to the same point in the next repeat, mm.
    pub(crate) period: DVec3,
    /// mm.
    pub(crate) radius: f64,
    /// Whether it may change its length: elastane, and inlays with slack.
    pub(crate) is_elastic: bool,
}

/// A span of a yarn's curve between two data points.
#[derive(Clone, Copy, Debug)]
pub(super) struct RestSpan {
    pub(super) yarn: u32,
    /// Its four control points.
    pub(super) points: [u32; 4],
    /// Whole periods from each control point to its image beside the span.
    pub(super) shifts: [f64; 4],
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
pub(super) struct Segment {
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
    pub(super) segments: Vec<Segment>,
    /// Number of all samples.
    pub(super) samples: usize,
    /// Radius of the thinnest yarn, mm.
    pub(super) thinnest: f64,
    /// Distance over the sum of the radii at which contacts aim.
    pub(super) target: f64,
    /// Weight of the pull towards the flat shape.
    pub(super) pull: f64,
    /// How many times as much as usual bends resist.
    pub(super) bending: f64,
}

impl Rest {
    /// A repeat whose spans have no lengths yet.
    pub(super) fn new(points: Vec<DVec3>, yarns: Vec<RestYarn>, cell: DVec2, pull: f64) -> Self {
        let thinnest = yarns.iter().map(|yarn| yarn.radius).fold(f64::INFINITY, f64::min);
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
            bending: 1.0,
        };
        for yarn in 0..rest.yarns.len() {
            rest.yarns[yarn].points.clone().for_each(|at| rest.add_span(yarn, at));
        }
        rest
    }

    /// The four control points of a span.
    pub(super) fn control(&self, span: &RestSpan) -> [DVec3; 4] {
        let period = self.yarns[span.yarn as usize].period;
        from_fn(|k| self.points[span.points[k] as usize] + period * span.shifts[k])
    }

    /// Adds the span that starts at a point of a yarn.
    fn add_span(&mut self, number: usize, at: usize) {
        let yarn = &self.yarns[number];
        let count = i64::from(index32(yarn.points.len()));
        let at = i64::from(index32(at - yarn.points.start));
        // The four control points, counted along the endless yarn.
        let indices = [at - 1, at, at + 1, at + 2];
        let points = indices.map(|i| {
            let wrapped = usize::try_from(i.rem_euclid(count));
            index32(yarn.points.start + wrapped.expect("a remainder is not negative"))
        });
        #[expect(clippy::cast_precision_loss, reason = "a repeat or two")]
        let shifts = indices.map(|i| i.div_euclid(count) as f64);
        let control: [DVec3; 4] =
            from_fn(|k| self.points[points[k] as usize] + yarn.period * shifts[k]);
        let [first, from, to, last] = control;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to some segments"
        )]
        let segments = (from.distance(to) / (SEGMENT_RADII * yarn.radius))
            .ceil()
            .clamp(MIN_SEGMENTS, MAX_SEGMENTS) as u32;
        let (span, start) = (index32(self.spans.len()), index32(self.samples));
        self.spans.push(RestSpan {
            yarn: index32(number),
            points,
            shifts,
            start,
            segments,
            length: 0.0,
            chords: [first.distance(to), first.distance(last)],
        });
        let own = (start..start + segments).map(|sample| Segment { span, sample });
        self.segments.extend(own);
        self.samples += segments as usize + 1;
    }
}
