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

mod search;

use std::array::from_fn;
use std::ops::Range;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::Block;
use super::strands::CUT;
use crate::ids::index32;
use crate::knit::YarnCopy;
use crate::knit::clearance::SAME_STRAND_RADII;
use crate::knit::strain::RepeatSpans;
use crate::map::Draped;
use crate::yarn::curve;
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
/// Spans that are too long by a larger share are those of creases in the mesh. Moving their points
/// would not mend them, unless it is by less than [`MENDABLE`]. With 0.3 a sharply folded dress
/// keeps the lengths of 3 % fewer stitches; with 1 it keeps those of a few more.
const LENGTH_LIMIT: f64 = 0.7;
/// A short span that is too long by less, in radii, is not torn, however large its share. A fold of
/// thick cloth makes a span of two radii three times as long, and moves can mend that: both its ends
/// may move by [`MAX_MOVE`]. With 0 yarns pass through each other there; 8 gives what 5 does.
const MENDABLE: f64 = 5.0;
/// Parts into which a span is divided to find where it is nearest to another.
const PARTS: usize = 3;
/// Limit of the move of a point in one sweep, radii.
const MAX_STEP: f64 = 0.2;
/// Limit of the move of a point, radii: it stays where the cloth is. A tight fold of thick cloth
/// needs some three.
const MAX_MOVE: f64 = 4.0;

/// One yarn of the panel.
struct PanelYarn {
    copy: YarnCopy,
    /// The part of the panel's arrays that it fills.
    places: Range<usize>,
}

/// All yarns of a panel.
struct SweptPanel<'a> {
    repeat: &'a RepeatSpans,
    yarns: Vec<PanelYarn>,
    /// Place of each data point; not a number for those off the panel.
    places: Vec<DVec3>,
    /// Where each data point lies in the flat cloth.
    flat: Vec<Vec3>,
    /// The places as mapped.
    mapped: Vec<DVec3>,
    /// Whether the cloth is strained too far at a place for loops to follow.
    is_overstrained: Vec<bool>,
    /// Length that the span from each place keeps, mm.
    lengths: Vec<f64>,
    /// Length of yarn from its start to each place, mm.
    along: Vec<f64>,
}

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

/// The parts of an array that yarns fill.
fn slices_of<'a, T>(all: &'a mut [T], yarns: &[PanelYarn]) -> Vec<&'a mut [T]> {
    let mut rest = all;
    let slices = yarns.iter().map(|yarn| {
        rest.split_off_mut(..yarn.places.len()).expect("yarns fill the array one after another")
    });
    slices.collect()
}

impl<'a> SweptPanel<'a> {
    fn new(blocks: &[Block], repeat: &'a RepeatSpans) -> Self {
        let mut panel = Self {
            repeat,
            yarns: Vec::new(),
            places: Vec::new(),
            flat: Vec::new(),
            mapped: Vec::new(),
            is_overstrained: Vec::new(),
            lengths: Vec::new(),
            along: Vec::new(),
        };
        for block in blocks {
            let start = panel.places.len();
            let end = start + block.knitted.points.len();
            panel.places.resize(end, DVec3::NAN);
            panel.is_overstrained.resize(end, false);
            panel.flat.extend(block.knitted.points.iter().map(|point| point.as_vec3()));
            panel.add_places(block, start);
            panel.yarns.extend(block.yarns.iter().map(|yarn| {
                let points = block.points_of(&yarn.stitches);
                PanelYarn { copy: yarn.copy, places: start + points.start..start + points.end }
            }));
        }
        panel.mapped.clone_from(&panel.places);
        panel.lengths = panel.kept_lengths();
        panel.along = panel.arc_lengths();
        panel
    }

    /// Adds the data points of a block on the panel.
    fn add_places(&mut self, block: &Block, start: usize) {
        let Draped { positions, is_overstrained, .. } = &block.draped;
        let places = positions.iter().zip(is_overstrained);
        for (&source, (&place, &is_overstrained)) in block.strands.sources.iter().zip(places) {
            if source != CUT {
                self.places[start + source as usize] = place;
                self.is_overstrained[start + source as usize] = is_overstrained;
            }
        }
    }

    /// The length of each span: that of the flat repeat, or as mapped where yarn has to stretch.
    fn kept_lengths(&self) -> Vec<f64> {
        let mut lengths = vec![0.0; self.places.len()];
        let slices = slices_of(&mut lengths, &self.yarns);
        self.yarns.par_iter().zip(slices).for_each(|(yarn, lengths)| {
            let mapped = &self.mapped[yarn.places.clone()];
            let is_overstrained = &self.is_overstrained[yarn.places.clone()];
            for span in 1..mapped.len().saturating_sub(2) {
                let (point, _) = self.origin(yarn, span);
                let has_to_stretch = is_overstrained[span] || is_overstrained[span + 1];
                let control = control_points(mapped, span).filter(|_| has_to_stretch);
                lengths[span] = control.map_or(self.repeat.lengths[point], |control| {
                    curve::span(&control, 1).length()
                });
            }
        });
        lengths
    }

    /// Length of yarn from the start of each yarn to its points.
    fn arc_lengths(&self) -> Vec<f64> {
        let mut along = vec![0.0; self.lengths.len()];
        for yarn in &self.yarns {
            let mut sum = 0.0;
            for at in yarn.places.clone() {
                along[at] = sum;
                sum += self.lengths[at];
            }
        }
        along
    }

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

    /// By how much a span is too long, as a share of its length. Nothing off the panel, and where no
    /// move would mend it.
    fn wrong_length(&self, yarn: &PanelYarn, own: &[DVec3], span: usize) -> Option<f64> {
        let control = control_points(own, span)?;
        let kept = self.lengths[yarn.places.start + span];
        let wrong = curve::span(&control, 1).length() / kept - 1.0;
        let is_mendable = wrong * kept < MENDABLE * self.radius(yarn);
        (wrong < LENGTH_LIMIT || is_mendable).then_some(wrong)
    }

    /// The data point of the repeat of which a yarn's point is a copy, and its cell along the yarn.
    fn origin(&self, yarn: &PanelYarn, point: usize) -> (usize, i64) {
        let (count, start) = self.points_of(yarn.copy.yarn);
        let at = yarn.copy.first + i64::from(index32(point));
        let within = usize::try_from(at.rem_euclid(count)).expect("a remainder is not negative");
        (start + within, at.div_euclid(count))
    }

    /// Radius of a yarn, mm.
    fn radius(&self, yarn: &PanelYarn) -> f64 {
        self.repeat.yarns[yarn.copy.yarn].chain.radius
    }

    /// Number of data points of a yarn of the repeat, and the first of them.
    fn points_of(&self, yarn: usize) -> (i64, usize) {
        let points = &self.repeat.yarns[yarn].chain.points;
        (i64::from(index32(points.len())), points.start)
    }

    /// Writes the places into the blocks.
    fn write_back(&self, blocks: &mut [Block]) {
        let mut start = 0;
        for block in blocks {
            let Block { knitted, strands, draped, .. } = block;
            for (&source, place) in strands.sources.iter().zip(&mut draped.positions) {
                if source != CUT {
                    *place = self.places[start + source as usize];
                }
            }
            start += knitted.points.len();
        }
    }
}

/// The control points of a span of a yarn. Nothing where one of them is off the panel: there the
/// curve is not that of the repeat.
fn control_points(own: &[DVec3], span: usize) -> Option<[DVec3; 4]> {
    let control: [DVec3; 4] = own.get(span.checked_sub(1)?..span + 3)?.try_into().ok()?;
    control.iter().all(|place| !place.is_nan()).then_some(control)
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
