//! Sweeps on the body: yarns of a panel are moved apart where they come nearer than touching, and
//! keep their lengths.
//!
//! In: the mapped blocks of one panel. Out: the same with points moved by some radii at most.
//!
//! The table of strained repeats takes cloth to be strained alike all over a loop. Where strain
//! changes within a loop, or the cloth bends sharply, yarns still cut each other a little. A few
//! sweeps mend that. A repeat that is too large for the table gets more of them, and no table.
//! Where the cloth is strained too far for loops to follow, yarn has to stretch, and sweeps leave
//! its length as mapped. Yarn held at its own length there would be pulled into its neighbours.
//! Creases need more sweeps than the rest, so the last ones move only what is still too near.
//!
//! Method: position-based dynamics (Müller, Heidelberger, Hennix and Ratcliff 2007). The spans near
//! each other are found on the body (`search`), since folds bring others together than lie side by
//! side in flat cloth. Every sweep computes all contacts from the places before it and moves each
//! yarn by itself, so the result is the same for any number of threads. Lengths are corrected along
//! each yarn in turn.
//!
//! Cost: some 60 µs a stitch where little is wrong, nearly all of it to find out; up to three times as
//! much where loops are as large as the garment's triangles; and some 1200 where all of the cloth is
//! pulled further than its loops can follow. All blocks of a panel are in memory meanwhile,
//! some 7 kB a stitch. Not promised: cloth that lies on cloth.

mod panel;
mod search;

use std::array::from_fn;
use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::Block;
use crate::ids::index32;
use crate::knit::clearance::SAME_STRAND_RADII;
use crate::knit::strain::RepeatSpans;
use crate::yarn::curve;
use panel::{PanelYarn, SweptPanel, control_points, slices_of};
use search::{Partners, SpanSearch};

/// Pairs nearer than this share of the distance that sweeps aim at are moved.
const NEAR: f64 = 0.97;
/// Spans on both sides of one that is wrong that move along with it: about a stitch.
const REACH: usize = 10;
/// Yarn of [`REACH`] spans is moved whose length together is wrong by more. Single spans are wrong by
/// more all over, since yarn slips within a stitch.
const WRONG_LENGTH: f64 = 0.0075;
/// Number of sweeps after the table of strains.
const SWEEPS: usize = 18;
/// Number of further sweeps where yarns still lie nearer than [`TIGHT`] after those. Few do, so they
/// cost little.
const LATE_SWEEPS: usize = 60;
/// Pairs nearer than this, over touching, get the further sweeps.
const TIGHT: f64 = 0.99;
/// By how much the further sweeps aim beyond touching, since they end before all is moved.
const LATE_MARGIN: f64 = 0.03;
/// What the further sweeps leave of the stiffness of lengths: most of these pairs lie in creases,
/// where lengths and contacts can't both be kept. With 0.2 a folded collar keeps two to five times as
/// much yarn that is too near. With 0.02 as little is, but more of a dress has a wrong length.
const LATE_LENGTHS: f64 = 0.05;
/// One in so many spans must be tight for the further sweeps to end early, and fewer than one in so
/// many of these may have come free between two looks. A folded collar, where they still help, has a
/// tenth of its spans tight, of which a fifth come free.
const STUCK_SHARE: usize = 20;
const STUCK_GAIN: usize = 10;
/// Number of sweeps where the repeat is too large for a table, and yarns have been mapped as if they
/// were rubber. With 18, 2 % of a cabled sock's stitches are still over 2 % too long or too short.
const LONE_SWEEPS: usize = 60;
/// A sweep in so many looks for near spans; those between look at the pairs that were near then.
const LOOK: usize = 9;
/// Pairs nearer than this, over touching, are looked at again.
const ACTIVE: f64 = 1.05;
/// Share of its missing distance by which a contact moves each yarn. Neighbouring spans see the
/// same contact, so larger values overshoot.
const CONTACT_STIFFNESS: f64 = 0.6;
/// Share of its wrong length that a span gives back in a sweep.
const LENGTH_STIFFNESS: f64 = 0.6;
/// Wrong lengths that are left: less is not seen.
const LENGTH_TOLERANCE: f64 = 0.002;
/// Parts into which a span is divided to find where it is nearest to another.
const PARTS: usize = 3;
/// Limit of the move of a point in one sweep, radii.
const MAX_STEP: f64 = 0.2;
/// Limit of the move of a point, radii: it stays where the cloth is. A tight fold of thick cloth
/// needs some three.
const MAX_MOVE: f64 = 4.0;

/// What sweeps do for one yarn until the next look.
#[derive(Clone, Debug, Default)]
struct Active {
    /// The spans that may move.
    spans: Vec<Range<usize>>,
    pairs: Vec<SpanPair>,
    /// Spans that are wrong: at first those too near others or of a wrong length, then those of pairs
    /// that are nearer than [`TIGHT`].
    tight: Vec<usize>,
    /// Whether nothing of the yarn has to move.
    is_idle: bool,
}

impl Active {
    /// A yarn whose spans all may move.
    fn whole(points: usize) -> Self {
        let all = 1..points.saturating_sub(2).max(1);
        Self { spans: std::iter::once(all).collect(), ..Self::default() }
    }

    /// Leaves only the spans around tight ones to be moved.
    fn narrow(&mut self, points: usize) {
        self.spans.clear();
        self.tight.sort_unstable();
        for &span in &self.tight {
            let around =
                span.saturating_sub(REACH).max(1)..(span + REACH + 1).min(points.saturating_sub(2));
            match self.spans.last_mut() {
                Some(last) if around.start <= last.end => last.end = around.end,
                _ => self.spans.push(around),
            }
        }
    }
}

/// What a sweep aims at.
#[derive(Clone, Copy, Debug)]
struct Aim {
    /// Distance of contacts, over touching.
    distance: f64,
    /// Share of its wrong length that a span gives back.
    length_stiffness: f64,
}

/// A span of a yarn and one of another that is near it.
#[derive(Clone, Copy, Debug)]
struct SpanPair {
    span: u32,
    other_yarn: u32,
    other_span: u32,
    /// Sum of the radii, mm.
    touching: f64,
    /// Distance of the chords at which curves may touch, mm.
    reach: f64,
}

/// Where a span is nearest to another.
#[derive(Clone, Copy, Debug)]
struct NearestPoint {
    /// The span's own control points.
    control: [DVec3; 4],
    /// From the other yarn, mm.
    apart: DVec3,
    /// Share of the way along the span.
    share: f64,
}

/// Moves the yarns of a panel apart.
pub(super) fn sweep(blocks: &mut [Block], repeat: &RepeatSpans) {
    let sweeps = if repeat.is_flat_only { LONE_SWEEPS } else { SWEEPS };
    let mut panel = SweptPanel::new(blocks, repeat);
    let mut search = SpanSearch::default();
    search.fill(&panel, NEAR * repeat.target);
    let mut active = panel.wrong(&search);
    let mut next = panel.places.clone();
    // Tight spans at the look before.
    let mut before = usize::MAX;
    for sweep in 0..sweeps + LATE_SWEEPS {
        if active.iter().all(|active| active.is_idle && active.tight.is_empty()) {
            break;
        }
        let is_look = sweep % LOOK == 0;
        if is_look {
            let left = active.iter().map(|active| active.tight.len()).sum();
            // Only further sweeps are compared with each other: those before them aim at less.
            let is_stuck = sweep > sweeps && is_stuck(left, before, panel.places.len());
            if sweep >= sweeps && (left == 0 || is_stuck) {
                break;
            }
            before = left;
            search.fill(&panel, ACTIVE);
        }
        let slices = slices_of(&mut next, &panel.yarns);
        let aim = Aim::of(repeat.target, sweep >= sweeps);
        panel.yarns.par_iter().zip(&mut active).zip(slices).enumerate().for_each(
            |(number, ((yarn, active), own))| {
                if is_look {
                    if sweep >= sweeps {
                        active.narrow(own.len());
                    }
                    active.is_idle = active.spans.is_empty();
                    let Active { spans, pairs, .. } = active;
                    search.find_pairs(&panel, number, Partners::All, spans, pairs);
                }
                if !active.is_idle {
                    panel.move_yarn(yarn, active, aim, own);
                }
            },
        );
        std::mem::swap(&mut panel.places, &mut next);
        next.copy_from_slice(&panel.places);
    }
    panel.write_back(blocks);
}

/// Whether further sweeps are in vain: many of a panel's spans are tight, and hardly fewer than at
/// the look before. Cloth that is pressed together all over has no room, unlike a crease.
fn is_stuck(tight: usize, before: usize, spans: usize) -> bool {
    tight > spans / STUCK_SHARE && tight > before / STUCK_GAIN * (STUCK_GAIN - 1)
}

impl Aim {
    fn of(target: f64, is_late: bool) -> Self {
        if is_late {
            Self {
                distance: target + LATE_MARGIN,
                length_stiffness: LATE_LENGTHS * LENGTH_STIFFNESS,
            }
        } else {
            Self { distance: target, length_stiffness: LENGTH_STIFFNESS }
        }
    }
}

impl SweptPanel<'_> {
    /// What has to move of each yarn: the spans that are too near others or of a wrong length, and
    /// those around them.
    fn wrong(&self, search: &SpanSearch) -> Vec<Active> {
        let yarns = 0..self.yarns.len();
        let mut active: Vec<_> =
            yarns.clone().into_par_iter().map(|number| self.wrong_of(number, search)).collect();
        for number in yarns {
            for pair in std::mem::take(&mut active[number].pairs) {
                active[pair.other_yarn as usize].tight.push(pair.other_span as usize);
            }
        }
        let points = self.yarns.par_iter().map(|yarn| yarn.places.len());
        active.par_iter_mut().zip(points).for_each(|(active, points)| {
            active.narrow(points);
            active.is_idle = active.spans.is_empty();
        });
        active
    }

    /// Spans of a yarn that are too near others or of a wrong length, with the pairs of which the yarn
    /// is the first.
    fn wrong_of(&self, number: usize, search: &SpanSearch) -> Active {
        let yarn = &self.yarns[number];
        let mut active = Active::whole(yarn.places.len());
        search.find_pairs(self, number, Partners::Later, &active.spans, &mut active.pairs);
        active.pairs.retain(|pair| {
            self.nearest_of_pair(yarn, pair).is_some_and(|nearest| {
                nearest.apart.length() < NEAR * self.repeat.target * pair.touching
            })
        });
        active.tight.extend(active.pairs.iter().map(|pair| pair.span as usize));
        if !self.repeat.yarns[yarn.copy.yarn].is_elastic {
            let own = &self.places[yarn.places.clone()];
            // They overlap by half. What is left at the end is judged with the spans before it.
            let end = own.len().saturating_sub(2 + REACH / 2).max(2);
            let is_wrong = |start: &usize| self.is_wrong(yarn, own, *start..*start + REACH);
            let stretches = (1..end).step_by(REACH / 2).filter(is_wrong);
            active.tight.extend(stretches.map(|start| start + REACH / 2));
        }
        active
    }

    /// Moves one yarn by its contacts, then by its lengths. `own` are its places. Pairs that turn
    /// out to be far apart leave the list.
    fn move_yarn(&self, yarn: &PanelYarn, active: &mut Active, aim: Aim, own: &mut [DVec3]) {
        let mut moves = vec![DVec3::ZERO; own.len()];
        let mut pushed = false;
        active.tight.clear();
        active.pairs.retain(|pair| {
            let ratio = self.push_pair(yarn, pair, aim, &mut moves);
            pushed |= ratio < aim.distance;
            if ratio < TIGHT {
                active.tight.push(pair.span as usize);
            }
            ratio < ACTIVE
        });
        let radius = self.repeat.yarns[yarn.copy.yarn].chain.radius;
        if pushed {
            for (place, step) in own.iter_mut().zip(&moves) {
                *place += step.clamp_length_max(MAX_STEP * radius);
            }
        }
        let is_elastic = self.repeat.yarns[yarn.copy.yarn].is_elastic;
        let stretched = !is_elastic && self.keep_lengths(yarn, &active.spans, aim, own);
        active.is_idle = !pushed && !stretched;
        for (place, &mapped) in own.iter_mut().zip(&self.mapped[yarn.places.clone()]) {
            *place = mapped + (*place - mapped).clamp_length_max(MAX_MOVE * radius);
        }
    }

    /// Adds to the moves of a yarn what a pair asks for. Returns its distance over touching.
    fn push_pair(&self, yarn: &PanelYarn, pair: &SpanPair, aim: Aim, moves: &mut [DVec3]) -> f64 {
        let Some(NearestPoint { control, apart, share }) = self.nearest_of_pair(yarn, pair) else {
            return f64::INFINITY;
        };
        let distance = apart.length();
        let missing = aim.distance * pair.touching - distance;
        if missing > 0.0 && distance > 0.0 {
            let weights = curve::weights(&control).at(share);
            let squared: f64 = weights.iter().map(|weight| weight * weight).sum();
            let push = apart * (0.5 * CONTACT_STIFFNESS * missing / (distance * squared));
            for (k, weight) in weights.into_iter().enumerate() {
                moves[pair.span as usize + k - 1] += push * weight;
            }
        }
        distance / pair.touching
    }

    /// Where a yarn is nearest to the other of a pair. Nothing where they are far apart or off the
    /// panel.
    fn nearest_of_pair(&self, yarn: &PanelYarn, pair: &SpanPair) -> Option<NearestPoint> {
        let other_yarn = &self.yarns[pair.other_yarn as usize];
        let control = control_points(&self.places[yarn.places.clone()], pair.span as usize)?;
        let other =
            control_points(&self.places[other_yarn.places.clone()], pair.other_span as usize)?;
        let may_touch =
            |s, t| self.may_touch([(yarn, pair.span, s), (other_yarn, pair.other_span, t)]);
        let (apart, share) = nearest_of_spans(&control, &other, pair.reach, may_touch)?;
        Some(NearestPoint { control, apart, share })
    }

    /// Whether two places of yarn may touch, each a share of the way along its span: those close
    /// along one yarn don't count.
    fn may_touch(&self, places: [(&PanelYarn, u32, f64); 2]) -> bool {
        let [(yarn, ..), (other, ..)] = places;
        let [one, two] = places.map(|(yarn, span, share)| {
            let at = yarn.places.start + span as usize;
            self.along[at] + share * self.lengths[at]
        });
        yarn.places != other.places || (one - two).abs() > SAME_STRAND_RADII * self.radius(yarn)
    }

    /// Corrects the lengths of a yarn's spans. Returns whether any was wrong.
    fn keep_lengths(
        &self,
        yarn: &PanelYarn,
        spans: &[Range<usize>],
        aim: Aim,
        own: &mut [DVec3],
    ) -> bool {
        let mut any = false;
        for span in spans.iter().cloned().flatten() {
            let Some(wrong) = self.wrong_length(yarn, own, span) else { continue };
            if wrong.abs() > LENGTH_TOLERANCE {
                let step = (own[span + 1] - own[span]) * (0.5 * aim.length_stiffness * wrong);
                own[span] += step;
                own[span + 1] -= step;
                any = true;
            }
        }
        any
    }

    /// Whether yarn of some spans together has a wrong length.
    fn is_wrong(&self, yarn: &PanelYarn, own: &[DVec3], spans: Range<usize>) -> bool {
        let (mut wrong, mut length) = (0.0, 0.0);
        for span in spans {
            if let Some(share) = self.wrong_length(yarn, own, span) {
                let kept = self.lengths[yarn.places.start + span];
                wrong += share * kept;
                length += kept;
            }
        }
        f64::abs(wrong) > WRONG_LENGTH * length
    }

    /// By how much a span is too long, as a share of its length. Nothing where it is off the panel,
    /// torn or without length.
    fn wrong_length(&self, yarn: &PanelYarn, own: &[DVec3], span: usize) -> Option<f64> {
        let control = control_points(own, span)?;
        let kept = self.lengths[yarn.places.start + span];
        let length = curve::span(&control, 1).length();
        // A span that was mapped to a point has no length to be wrong by.
        (kept > 0.0 && !self.is_torn(yarn, span, length)).then_some(length / kept - 1.0)
    }
}

/// From the nearest point of the other span to that of the first, and where on the first that is.
/// Nothing if their chords are farther apart than `reach`. Only parts that may touch count, each told
/// by the places of its middle.
fn nearest_of_spans(
    one: &[DVec3; 4],
    other: &[DVec3; 4],
    reach: f64,
    may_touch: impl Fn(f64, f64) -> bool,
) -> Option<(DVec3, f64)> {
    let (s, t) = curve::nearest_of_segments([one[1], one[2]], [other[1], other[2]]);
    let apart = one[1].lerp(one[2], s) - other[1].lerp(other[2], t);
    if apart.length_squared() > reach * reach {
        return None;
    }
    let (one, other) = (curve::span(one, 1), curve::span(other, 1));
    let knots: [f64; PARTS + 1] = from_fn(|k| f64::from(index32(k)) / f64::from(index32(PARTS)));
    let (places, others) = (knots.map(|t| one.at(t)), knots.map(|t| other.at(t)));
    // Heads of two bars run side by side, so one pair of chords would see their ends only.
    let mut best = (f64::INFINITY, 0.0, 0.0);
    for i in 0..PARTS {
        for j in 0..PARTS {
            if !may_touch(knots[i].midpoint(knots[i + 1]), knots[j].midpoint(knots[j + 1])) {
                continue;
            }
            let (s, t) =
                curve::nearest_of_segments([places[i], places[i + 1]], [others[j], others[j + 1]]);
            let apart = places[i].lerp(places[i + 1], s) - others[j].lerp(others[j + 1], t);
            if apart.length_squared() < best.0 {
                let share = |k: usize, t: f64| knots[k] + t / f64::from(index32(PARTS));
                best = (apart.length_squared(), share(i, s), share(j, t));
            }
        }
    }
    let (squared, s, t) = best;
    squared.is_finite().then(|| (one.at(s) - other.at(t), s))
}
