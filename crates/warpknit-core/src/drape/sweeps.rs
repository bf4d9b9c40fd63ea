//! Sweeps on the body: yarns of a panel are moved apart where they come nearer than touching, and
//! keep their lengths.
//!
//! In: the mapped blocks of one panel. Out: the same with points moved by a part of a radius.
//!
//! The table of strained repeats takes cloth to be strained alike all over a loop. Where strain
//! changes within a loop, or the cloth bends sharply, yarns still cut each other a little. A few
//! sweeps mend that. A repeat that is too large for the table gets more of them, and no table.
//! Where the cloth is strained too far for loops to follow, yarn has to stretch, and sweeps leave
//! its length as mapped. Yarn held at its own length there would be pulled into its neighbours.
//! Creases need more sweeps than the rest, so the last ones move only what is still too near.
//!
//! Method: position-based dynamics (Müller, Heidelberger, Hennix and Ratcliff 2007). Cloth is
//! periodic, so a span's partners are those of its repeat, and no search is needed. Every sweep
//! computes all contacts from the places before it and moves each yarn by itself, so the result is
//! the same for any number of threads. Lengths are corrected along each yarn in turn.
//!
//! Cost: some 90 µs a stitch (300 without a table). All blocks of a panel are in memory meanwhile,
//! some 2.7 kB a stitch. Not promised: cloth that lies on cloth.

use std::array::from_fn;
use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use super::Block;
use super::strands::CUT;
use crate::ids::index32;
use crate::knit::YarnCopy;
use crate::knit::strain::{NearSpan, Neighbours};
use crate::map::Draped;
use crate::yarn::curve;

/// Cutoff of the partners of a span in the flat repeat, over touching. Strains of a fifth bring
/// yarns nearer by some tenths of touching; with 1.5 some that meet in folds are missed.
pub(super) const NEAR: f64 = 2.0;
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
/// where lengths and contacts can't both be kept.
const LATE_LENGTHS: f64 = 0.5;
/// Spans on both sides of such a pair that move along with it.
const TIGHT_REACH: usize = 10;
/// Number of sweeps where the repeat is too large for a table, and yarns have been mapped as if they
/// were rubber. With 18, 2 % of a cabled sock's stitches are still over 2 % too long or too short.
const LONE_SWEEPS: usize = 60;
/// A sweep in so many looks for near spans; those between look at the pairs that were near then.
const LOOK: usize = 6;
/// Pairs nearer than this, over touching, are looked at again.
const ACTIVE: f64 = 1.05;
/// Share of its missing distance by which a contact moves each yarn. Neighbouring spans see the
/// same contact, so larger values overshoot.
const CONTACT_STIFFNESS: f64 = 0.6;
/// Share of its wrong length that a span gives back in a sweep.
const LENGTH_STIFFNESS: f64 = 0.6;
/// Wrong lengths that are left: less is not seen.
const LENGTH_TOLERANCE: f64 = 0.002;
/// Lengths that are wrong by more are those of creases in the mesh. Moving their points would not
/// mend them. Without a table yarns begin farther from their lengths.
const LENGTH_LIMIT: f64 = 0.3;
const LONE_LENGTH_LIMIT: f64 = 0.5;
/// Parts into which a span is divided to find where it is nearest to another.
const PARTS: usize = 3;
/// Limit of the move of a point in one sweep, radii.
const MAX_STEP: f64 = 0.2;
/// Limit of the move of a point, radii: it stays where the cloth is.
const MAX_MOVE: f64 = 2.0;

/// One yarn of the panel.
struct PanelYarn {
    copy: YarnCopy,
    /// The part of the panel's arrays that it fills.
    places: Range<usize>,
}

/// All yarns of a panel.
struct SweptPanel<'a> {
    neighbours: &'a Neighbours,
    yarns: Vec<PanelYarn>,
    /// For each yarn of the repeat: the first copy, and the number in `yarns` of each copy from
    /// there on.
    copies: Vec<(i64, Vec<Option<u32>>)>,
    /// Place of each data point; not a number for those off the panel.
    places: Vec<DVec3>,
    /// The places as mapped.
    mapped: Vec<DVec3>,
    /// Whether the cloth is strained too far at a place for loops to follow.
    is_overstrained: Vec<bool>,
    /// Length that the span from each place keeps, mm.
    lengths: Vec<f64>,
}

/// What sweeps do for one yarn until the next look.
#[derive(Clone, Debug, Default)]
struct Active {
    /// The spans that may move.
    spans: Vec<Range<usize>>,
    pairs: Vec<SpanPair>,
    /// Spans of pairs that are nearer than [`TIGHT`], in order.
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

    /// Leaves only the spans around tight pairs to be moved.
    fn narrow(&mut self, points: usize) {
        self.spans.clear();
        for &span in &self.tight {
            let around = span.saturating_sub(TIGHT_REACH).max(1)
                ..(span + TIGHT_REACH + 1).min(points.saturating_sub(2));
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

/// Moves the yarns of a panel apart.
pub(super) fn sweep(blocks: &mut [Block], neighbours: &Neighbours) {
    let sweeps = if neighbours.is_flat_only { LONE_SWEEPS } else { SWEEPS };
    let mut panel = SweptPanel::new(blocks, neighbours);
    let whole = |yarn: &PanelYarn| Active::whole(yarn.places.len());
    let mut active: Vec<_> = panel.yarns.iter().map(whole).collect();
    let mut next = panel.places.clone();
    for sweep in 0..sweeps + LATE_SWEEPS {
        let is_look = sweep % LOOK == 0;
        if is_look && sweep >= sweeps && active.iter().all(|active| active.tight.is_empty()) {
            break;
        }
        let slices = slices_of(&mut next, &panel.yarns);
        let aim = Aim::of(neighbours.target, sweep >= sweeps);
        panel.yarns.par_iter().zip(&mut active).zip(slices).for_each(|((yarn, active), own)| {
            if is_look {
                if sweep >= sweeps {
                    active.narrow(own.len());
                }
                active.is_idle = active.spans.is_empty();
                panel.find_pairs(yarn, &active.spans, &mut active.pairs);
            }
            if !active.is_idle {
                panel.move_yarn(yarn, active, aim, own);
            }
        });
        std::mem::swap(&mut panel.places, &mut next);
        next.copy_from_slice(&panel.places);
    }
    panel.write_back(blocks);
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
    fn new(blocks: &[Block], neighbours: &'a Neighbours) -> Self {
        let mut panel = Self {
            neighbours,
            yarns: Vec::new(),
            copies: vec![(0, Vec::new()); neighbours.yarns.len()],
            places: Vec::new(),
            mapped: Vec::new(),
            is_overstrained: Vec::new(),
            lengths: Vec::new(),
        };
        for block in blocks {
            let start = panel.places.len();
            let end = start + block.knitted.points.len();
            panel.places.resize(end, DVec3::NAN);
            panel.is_overstrained.resize(end, false);
            panel.add_places(block, start);
            panel.yarns.extend(block.yarns.iter().map(|yarn| {
                let points = block.points_of(&yarn.stitches);
                PanelYarn { copy: yarn.copy, places: start + points.start..start + points.end }
            }));
        }
        panel.mapped.clone_from(&panel.places);
        panel.sort_copies();
        panel.lengths = panel.kept_lengths();
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
                lengths[span] = control.map_or(self.neighbours.lengths[point], |control| {
                    curve::span(&control, 1).length()
                });
            }
        });
        lengths
    }

    /// Finds the copies of each yarn of the repeat.
    fn sort_copies(&mut self) {
        for (yarn, (first, copies)) in self.copies.iter_mut().enumerate() {
            let own = self.yarns.iter().filter(|copy| copy.copy.yarn == yarn);
            let beside: Vec<_> = own.map(|copy| copy.copy.beside).collect();
            let (Some(&low), Some(&high)) = (beside.iter().min(), beside.iter().max()) else {
                continue;
            };
            *first = low;
            copies.resize(usize::try_from(high - low + 1).expect("low is the least"), None);
        }
        for (number, yarn) in (0u32..).zip(&self.yarns) {
            let (first, copies) = &mut self.copies[yarn.copy.yarn];
            let at = usize::try_from(yarn.copy.beside - *first).expect("the first is the least");
            copies[at] = Some(number);
        }
    }

    /// Finds the spans that are near those of a yarn.
    fn find_pairs(&self, yarn: &PanelYarn, spans: &[Range<usize>], pairs: &mut Vec<SpanPair>) {
        pairs.clear();
        let own = &self.places[yarn.places.clone()];
        for span in spans.iter().cloned().flatten() {
            let (point, along) = self.origin(yarn, span);
            for near in &self.neighbours.near[point] {
                let Some((number, other_span)) = self.partner(&yarn.copy, along, near) else {
                    continue;
                };
                let other = &self.places[self.yarns[number as usize].places.clone()];
                let Some(&[from, to]) = other.get(other_span..other_span + 2) else { continue };
                let [one, radius] = [yarn.copy.yarn, near.yarn as usize]
                    .map(|yarn| self.neighbours.yarns[yarn].chain.radius);
                let touching = one + radius;
                let bulges =
                    self.neighbours.bulges[point] + self.neighbours.bulges[near.point as usize];
                let reach = ACTIVE * touching + bulges;
                // Bounding balls of the chords; a place off the panel is no number and not near.
                let apart = own[span].midpoint(own[span + 1]).distance(from.midpoint(to));
                let halves = (own[span].distance(own[span + 1]) + from.distance(to)) / 2.0;
                if apart < reach + halves {
                    let (span, other_span) = (index32(span), index32(other_span));
                    pairs.push(SpanPair { span, other_yarn: number, other_span, touching, reach });
                }
            }
        }
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
        let radius = self.neighbours.yarns[yarn.copy.yarn].chain.radius;
        if pushed {
            for (place, step) in own.iter_mut().zip(&moves) {
                *place += step.clamp_length_max(MAX_STEP * radius);
            }
        }
        let is_elastic = self.neighbours.yarns[yarn.copy.yarn].is_elastic;
        let stretched = !is_elastic && self.keep_lengths(yarn, &active.spans, aim, own);
        active.is_idle = !pushed && !stretched;
        for (place, &mapped) in own.iter_mut().zip(&self.mapped[yarn.places.clone()]) {
            *place = mapped + (*place - mapped).clamp_length_max(MAX_MOVE * radius);
        }
    }

    /// Adds to the moves of a yarn what a pair asks for. Returns its distance over touching.
    fn push_pair(&self, yarn: &PanelYarn, pair: &SpanPair, aim: Aim, moves: &mut [DVec3]) -> f64 {
        let other = &self.yarns[pair.other_yarn as usize];
        let control = control_points(&self.places[yarn.places.clone()], pair.span as usize);
        let other = control_points(&self.places[other.places.clone()], pair.other_span as usize);
        let found = control.zip(other).and_then(|(control, other)| {
            nearest_of_spans(&control, &other, pair.reach).map(|found| (control, found))
        });
        let Some((control, (apart, t))) = found else { return f64::INFINITY };
        let distance = apart.length();
        let missing = aim.distance * pair.touching - distance;
        if missing > 0.0 && distance > 0.0 {
            let weights = curve::weights(&control).at(t);
            let squared: f64 = weights.iter().map(|weight| weight * weight).sum();
            let push = apart * (0.5 * CONTACT_STIFFNESS * missing / (distance * squared));
            for (k, weight) in weights.into_iter().enumerate() {
                moves[pair.span as usize + k - 1] += push * weight;
            }
        }
        distance / pair.touching
    }

    /// Corrects the lengths of a yarn's spans. Returns whether any was wrong.
    fn keep_lengths(
        &self,
        yarn: &PanelYarn,
        spans: &[Range<usize>],
        aim: Aim,
        own: &mut [DVec3],
    ) -> bool {
        let limit = if self.neighbours.is_flat_only { LONE_LENGTH_LIMIT } else { LENGTH_LIMIT };
        let lengths = &self.lengths[yarn.places.clone()];
        let mut any = false;
        for span in spans.iter().cloned().flatten() {
            let Some(control) = control_points(own, span) else { continue };
            let wrong = curve::span(&control, 1).length() / lengths[span] - 1.0;
            if wrong.abs() > LENGTH_TOLERANCE && wrong.abs() < limit {
                let step = (control[2] - control[1]) * (0.5 * aim.length_stiffness * wrong);
                own[span] += step;
                own[span + 1] -= step;
                any = true;
            }
        }
        any
    }

    /// The data point of the repeat of which a yarn's point is a copy, and its cell along the yarn.
    fn origin(&self, yarn: &PanelYarn, point: usize) -> (usize, i64) {
        let (count, start) = self.points_of(yarn.copy.yarn);
        let at = yarn.copy.first + i64::from(index32(point));
        let within = usize::try_from(at.rem_euclid(count)).expect("a remainder is not negative");
        (start + within, at.div_euclid(count))
    }

    /// A partner of a span of a copy in its cell `along`, with its span.
    fn partner(&self, copy: &YarnCopy, along: i64, near: &NearSpan) -> Option<(u32, usize)> {
        let own = if copy.runs_across { [along, copy.beside] } else { [copy.beside, along] };
        let [x, y] = [0, 1].map(|axis| own[axis] + i64::from(near.cells[axis]));
        let (first, copies) = &self.copies[near.yarn as usize];
        let runs_across = self.neighbours.yarns[near.yarn as usize].chain.runs_across();
        let (beside, along) = if runs_across { (y, x) } else { (x, y) };
        let at = usize::try_from(beside - first).ok()?;
        let number = (*copies.get(at)?)?;
        let (count, start) = self.points_of(near.yarn as usize);
        let index = along * count + i64::from(near.point) - i64::from(index32(start));
        let span = usize::try_from(index - self.yarns[number as usize].copy.first).ok()?;
        Some((number, span))
    }

    /// Number of data points of a yarn of the repeat, and the first of them.
    fn points_of(&self, yarn: usize) -> (i64, usize) {
        let points = &self.neighbours.yarns[yarn].chain.points;
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
/// Nothing if their chords are farther apart than `reach`.
fn nearest_of_spans(one: &[DVec3; 4], other: &[DVec3; 4], reach: f64) -> Option<(DVec3, f64)> {
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
            let (s, t) =
                curve::nearest_of_segments([places[i], places[i + 1]], [others[j], others[j + 1]]);
            let apart = places[i].lerp(places[i + 1], s) - others[j].lerp(others[j + 1], t);
            if apart.length_squared() < best.0 {
                let share = |k: usize, t: f64| knots[k] + t / f64::from(index32(PARTS));
                best = (apart.length_squared(), share(i, s), share(j, t));
            }
        }
    }
    let (_, s, t) = best;
    Some((one.at(s) - other.at(t), s))
}
