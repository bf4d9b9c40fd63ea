//! Which spans of a panel's yarns are near each other on the body.
//!
//! In: the places of all yarns of a panel. Out: the partners of each span. They are those of the
//! flat cloth, and those that a fold brings near.
//!
//! Method: spans are cut into parts of a few radii, and a spatial hash gives those whose bounding
//! spheres meet. Long underlaps would meet most of what lies around them.
//!
//! Cost: some 0.4 µs a part, of which a stitch has some ten a bar. Not promised: cloth that lies on
//! cloth. Spans far apart on the flat panel are not compared.

use std::array::from_fn;
use std::ops::Range;

use glam::{DVec3, Vec3};

use super::SpanPair;
use super::panel::{PanelYarn, SweptPanel, control_points};
use crate::drape::segments::squared_distances;
use crate::ids::index32;
use crate::knit::clearance::{MAX_CANDIDATES, SAME_STRAND_RADII};
use crate::spatial_hash::{SpatialHash, Sphere};
use crate::yarn::curve::{self, Span};

/// Spans farther apart than this in the flat cloth are not compared, in sums of radii. In a tight fold
/// layers meet that lie a dozen apart; cloth on cloth is farther.
const NEIGHBOURS: f32 = 12.0;
/// Parts of a span are at most so long, in radii. Shorter ones cost more to sort, longer ones meet
/// more that is not near.
const PART_RADII: f64 = 3.0;
/// Parts that are compared with one at a time.
const LANES: usize = 4;
/// Limit of the parts of a span.
const MAX_PARTS: u32 = 12;

/// Which spans near one are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Partners {
    All,
    /// Those that come later on the panel, so that each pair is found once.
    Later,
}

/// A part of a span.
#[derive(Clone, Copy, Debug)]
struct SpanPart {
    yarn: u32,
    span: u32,
    ends: [Vec3; 2],
    /// How far another centre line may be from the chord, less what the other part adds, mm.
    reach: f32,
}

/// All parts of the spans of a panel, in space.
#[derive(Default)]
pub(super) struct SpanSearch {
    /// Pairs that are nearer than this, over touching, are found.
    ratio: f64,
    hash: SpatialHash,
    parts: Vec<SpanPart>,
    spheres: Vec<Sphere>,
    /// First part of each span by the place at which it starts, and the end of the last.
    starts: Vec<u32>,
}

impl SpanSearch {
    /// Sorts all spans of a panel by where they lie, to find pairs that are nearer than `ratio`, over
    /// touching.
    pub(super) fn fill(&mut self, panel: &SweptPanel<'_>, ratio: f64) {
        self.ratio = ratio;
        self.parts.clear();
        self.starts.clear();
        let near = panel.places.iter().copied().find(|place| !place.is_nan()).unwrap_or_default();
        for (number, yarn) in (0..).zip(&panel.yarns) {
            let own = &panel.places[yarn.places.clone()];
            for span in 0..own.len() {
                self.starts.push(index32(self.parts.len()));
                self.add_parts(panel, (number, yarn), span, near);
            }
        }
        self.starts.push(index32(self.parts.len()));
        self.spheres.clear();
        self.spheres.extend(self.parts.iter().map(SpanPart::sphere));
        let largest = self.spheres.iter().map(|sphere| sphere.reach).fold(0.0, f32::max);
        self.hash.fill(self.spheres.iter().copied(), 2.0 * largest);
    }

    /// Cuts a span into parts, unless it is off the panel or torn.
    fn add_parts(
        &mut self,
        panel: &SweptPanel<'_>,
        (number, yarn): (u32, &PanelYarn),
        span: usize,
        near: DVec3,
    ) {
        let Some(control) = control_points(&panel.places[yarn.places.clone()], span) else {
            return;
        };
        let (length, radius) = (panel.lengths[yarn.places.start + span], panel.radius(yarn));
        let chord = control[1].distance(control[2]);
        if panel.is_torn(yarn, span, chord) {
            return;
        }
        let length = length.max(chord);
        let curve = curve::span(&control, 1);
        let count = parts(length, radius);
        let share = 1.0 / f64::from(count);
        // Beside a torn span the curve swings out; it must not widen the cells of all others.
        let reach = self.ratio * radius + bulge(&curve, share).min(share * length);
        let mut from = control[1] - near;
        for k in 1..=count {
            let to = curve.at(f64::from(k) * share) - near;
            let ends = [from, to].map(|end| end.as_vec3());
            self.parts.push(SpanPart {
                yarn: number,
                span: index32(span),
                ends,
                reach: single(reach),
            });
            from = to;
        }
    }

    /// Finds the spans that are near those of a yarn.
    pub(super) fn find_pairs(
        &self,
        panel: &SweptPanel<'_>,
        number: usize,
        wanted: Partners,
        spans: &[Range<usize>],
        pairs: &mut Vec<SpanPair>,
    ) {
        pairs.clear();
        let yarn = &panel.yarns[number];
        let (mut found, mut partners) = (Vec::new(), Vec::new());
        for span in spans.iter().cloned().flatten() {
            partners.clear();
            let at = yarn.places.start + span;
            for own in self.starts[at]..self.starts[at + 1] {
                let part = &self.parts[own as usize];
                self.hash.around(part.sphere(), MAX_CANDIDATES, &mut found);
                if wanted == Partners::Later {
                    found.retain(|&other| other > own);
                }
                self.add_partners(part, &found, &mut partners);
            }
            partners.sort_unstable();
            partners.dedup();
            let pair = |&other: &(u32, u32)| panel.pair(number, span, other, self.ratio);
            pairs.extend(partners.iter().filter_map(pair));
        }
    }

    /// Adds the spans of those parts that may touch one.
    fn add_partners(&self, part: &SpanPart, found: &[u32], partners: &mut Vec<(u32, u32)>) {
        // Spans that share a point can't touch.
        let is_other =
            |other: &&SpanPart| other.yarn != part.yarn || other.span.abs_diff(part.span) > 1;
        let parts = found.iter().map(|&other| &self.parts[other as usize]);
        let mut parts = parts.filter(is_other);
        let [start, end] = part.ends;
        loop {
            let mut lanes = [part; LANES];
            let count =
                lanes.iter_mut().zip(parts.by_ref()).map(|(lane, other)| *lane = other).count();
            let coordinates =
                |of: fn(&SpanPart) -> Vec3| from_fn(|axis| lanes.map(|lane| of(lane)[axis]));
            let starts = coordinates(|part| part.ends[0]);
            let steps = coordinates(|part| part.ends[1] - part.ends[0]);
            let squared = squared_distances(start, end - start, starts, steps);
            for (lane, squared) in lanes.iter().zip(squared).take(count) {
                let reach = part.reach + lane.reach;
                if squared < reach * reach {
                    partners.push((lane.yarn, lane.span));
                }
            }
            if count < LANES {
                break;
            }
        }
    }
}

impl SpanPart {
    fn sphere(&self) -> Sphere {
        let [from, to] = self.ends;
        let reach = self.reach + from.distance(to) / 2.0;
        Sphere { middle: from.midpoint(to), reach }
    }
}

impl SweptPanel<'_> {
    /// Two spans that may touch. Nothing for those close along one yarn, and those far apart in the
    /// flat cloth.
    fn pair(
        &self,
        number: usize,
        span: usize,
        (other, other_span): (u32, u32),
        ratio: f64,
    ) -> Option<SpanPair> {
        let (yarn, other_yarn) = (&self.yarns[number], &self.yarns[other as usize]);
        let [one, two] = [yarn.places.start + span, other_yarn.places.start + other_span as usize];
        let radius = self.radius(yarn);
        let touching = radius + self.radius(other_yarn);
        if other as usize == number {
            let (first, last) = (one.min(two), one.max(two) + 1);
            if self.along[last] - self.along[first] <= SAME_STRAND_RADII * radius {
                return None;
            }
        }
        let [flat, other_flat] = [one, two].map(|at| self.flat[at].midpoint(self.flat[at + 1]));
        let cutoff = NEIGHBOURS * single(touching);
        let point = |yarn, span| self.origin(yarn, span).0;
        let bulges = self.repeat.bulges[point(yarn, span)]
            + self.repeat.bulges[point(other_yarn, other_span as usize)];
        (flat.distance_squared(other_flat) <= cutoff * cutoff).then(|| SpanPair {
            span: index32(span),
            other_yarn: other,
            other_span,
            touching,
            reach: ratio * touching + bulges,
        })
    }
}

/// Number of parts of a span.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it is limited")]
fn parts(length: f64, radius: f64) -> u32 {
    ((length / (PART_RADII * radius)).ceil() as u32).clamp(1, MAX_PARTS)
}

/// How far a cubic may leave the chord of a part of it: an eighth of its second derivative by the
/// square of the part's share.
fn bulge(curve: &Span, share: f64) -> f64 {
    let [a, b, ..] = curve.cubic();
    let second = (2.0 * b).length().max((6.0 * a + 2.0 * b).length());
    second * share * share / 8.0
}

#[expect(clippy::cast_possible_truncation, reason = "lengths of some mm")]
fn single(length: f64) -> f32 {
    length as f32
}
