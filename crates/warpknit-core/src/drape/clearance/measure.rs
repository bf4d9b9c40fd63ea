//! Measuring the yarns of a patch, however they were laid.
//!
//! In: a [`Cloth`] with the radius of its yarns, and the strands near a patch. Out: the
//! [`BodyClearance`] of the yarns in it. Cost: 13 to 20 µs a stitch on one thread.

use std::ops::Range;
use std::sync::Mutex;

use glam::DVec2;
use rayon::prelude::*;

use super::BodyClearance;
use super::arcs::{Arc, SEGMENTS, StrandPoints};
use super::nearest::{NEIGHBOURS, NearestSegments};
use super::patch::{Area, ClothPatch, Patches};
use crate::drape::cloth::along_yarns;
use crate::drape::strands::{CUT, Strand, Strands};
use crate::drape::{Block, Cloth};
use crate::ids::index32;
use crate::knit::clearance::MIN_RELAXED;
use crate::knit::mesh::StructureMesh;
use crate::knit::{Knitted, Progress};

/// Cutoff of the search on the body, over the sum of radii. It must be over 1, where yarns touch.
/// Relaxed cloth has many of its contacts just above it, so with 1.05 the search takes a sixth
/// longer.
const CUTOFF: f32 = 1.02;
/// Yarns nearer than this, over the sum of radii, count as too near on the body.
const TOO_NEAR: f32 = 0.95;
/// Yarns nearer than this in the flat cloth are left out of the share. A little more than
/// [`TOO_NEAR`], so that yarns that are just free when flat don't count for a hair of change.
#[expect(clippy::cast_possible_truncation, reason = "a number of two digits")]
const TOO_NEAR_FLAT: f32 = MIN_RELAXED as f32;
/// Steps that a yarn is laid further than its patch at both ends, so that the ends, which have
/// mirrored points beyond them, lie outside.
const MORE_STEPS: i64 = 2;
/// Repeats of more patches than this are looked at patch by patch, as if they were near flat. They
/// would take much memory, and the cloth may be smaller.
const MAX_REPEAT_PATCHES: f64 = 4.0;
/// Patches for each thread between two reports of progress.
const THREAD_PATCHES: usize = 8;

/// What all patches have in common.
pub(super) struct Measure<'a> {
    pub(super) cloth: &'a Cloth<'a>,
    /// Each bar's drawn radius, mm.
    pub(super) radii: Vec<f64>,
    pub(super) patches: Patches,
    /// Whether yarns may be too near in the flat cloth already, so that it has to be looked at.
    flat: bool,
}

/// Memory of one thread, which each patch uses again.
#[derive(Default)]
pub(super) struct Workplace {
    /// Yarns that are laid once more, one block for each bar.
    pub(super) blocks: Vec<Block>,
    /// The arcs on the body, and the same arcs flat.
    draped: Vec<Arc>,
    flat: Vec<Arc>,
    /// Number of strands so far.
    strands: u32,
    near_draped: NearestSegments,
    near_flat: NearestSegments,
}

impl<'a> Measure<'a> {
    /// Prepares a cloth whose thickest yarns are drawn with `radius` mm.
    pub(super) fn new(cloth: &'a Cloth<'a>, radius: f64) -> Self {
        let radii: Vec<_> = cloth.thickness.iter().map(|thickness| radius * thickness).collect();
        let thickest = radii.iter().copied().fold(0.0, f64::max);
        let patches = Patches::new(cloth, 2.0 * f64::from(NEIGHBOURS) * thickest);
        let mut measure = Self { cloth, radii, patches, flat: true };
        measure.flat = cloth.meshes.first().is_some_and(|mesh| measure.may_be_near_flat(mesh));
        measure
    }

    /// Measures some patches in parallel. `add` adds the arcs near one of them. `progress` gets the
    /// share that is done.
    pub(super) fn all(
        &self,
        numbers: Range<usize>,
        add: impl Fn(usize, &ClothPatch, &mut Workplace) + Sync,
        progress: Progress<'_>,
    ) -> BodyClearance {
        // Memory of as many patches as are worked on at a time.
        let places = Mutex::new(Vec::new());
        let measured = |number| {
            let taken = || places.lock().expect("no thread fails while it holds the lock");
            let mut place: Workplace = taken().pop().unwrap_or_default();
            place.clear();
            add(number, &self.patches.patch(number), &mut place);
            let clearance = self.find(&mut place);
            taken().push(place);
            clearance
        };
        let window = THREAD_PATCHES * rayon::current_num_threads();
        let mut clearance = BodyClearance::FREE;
        for first in numbers.clone().step_by(window) {
            let done = index32(first - numbers.start);
            progress(f64::from(done) / f64::from(index32(numbers.len())));
            let patches = first..(first + window).min(numbers.end);
            let found: Vec<_> = patches.into_par_iter().map(measured).collect();
            clearance = found.into_iter().fold(clearance, BodyClearance::and);
        }
        clearance
    }

    /// Adds the arcs of a strand's spans that lie in an area or in its margin.
    pub(super) fn add_arcs(
        &self,
        block: &Block,
        strand: &Strand,
        spans: Range<usize>,
        area: &Area,
        place: &mut Workplace,
    ) {
        let Workplace { draped, flat, strands, .. } = place;
        let points = StrandPoints {
            draped: &block.draped.positions[strand.range()],
            flat: &block.strands.flat[strand.range()],
            number: *strands,
            radius: self.radii[block.bar],
        };
        *strands += 1;
        let touches = |ends| area.touches(ends);
        points.arcs(spans, area.near(), self.flat, touches, |arc, flat_arc| {
            if let Some(measured) = area.measures(&arc) {
                draped.push(Arc { measured, ..arc });
                flat.extend(flat_arc.map(|arc| Arc { measured, ..arc }));
            }
        });
    }

    /// Measures the arcs of a patch.
    fn find(&self, place: &mut Workplace) -> BodyClearance {
        if !place.draped.iter().any(|arc| arc.measured) {
            return BodyClearance::FREE;
        }
        place.near_draped.find(&place.draped, CUTOFF);
        if self.flat {
            place.near_flat.find(&place.flat, TOO_NEAR_FLAT);
        }
        sum(place)
    }

    /// Whether yarns may be too near each other in the flat cloth: whether they are in one repeat.
    /// Larger repeats are not looked at here. `mesh` is that of any panel.
    fn may_be_near_flat(&self, mesh: &StructureMesh) -> bool {
        let (pattern, patches) = (&self.cloth.pattern, &self.patches);
        let mesh = StructureMesh { origin: DVec2::new(mesh.wale_spacing / 2.0, 0.0), ..*mesh };
        let area = Area { low: DVec2::ZERO, high: pattern.repeat_size(), margin: patches.margin };
        if area.high.element_product() > MAX_REPEAT_PATCHES * patches.side * patches.side {
            return true;
        }
        let (mut arcs, mut knitted, mut number) = (Vec::new(), Knitted::default(), 0);
        for (bar, &radius) in self.radii.iter().enumerate() {
            let (numbers, steps) = self.touching(&area, bar, DVec2::ZERO);
            for yarn in numbers {
                knitted.clear();
                pattern.lay(bar, yarn, steps.clone(), &mesh, &mut knitted);
                let points = &knitted.points;
                let strand = StrandPoints { draped: points, flat: points, number, radius };
                let spans = 0..points.len().saturating_sub(1);
                strand.arcs(
                    spans,
                    area.near(),
                    false,
                    |ends| area.touches(ends),
                    |arc, _| {
                        if let Some(measured) = area.measures(&arc) {
                            arcs.push(Arc { measured, ..arc });
                        }
                    },
                );
                number += 1;
            }
        }
        let mut near = NearestSegments::default();
        near.find(&arcs, TOO_NEAR_FLAT);
        near.pairs > 0
    }

    /// The numbers of a bar's yarns that touch an area or its margin, and their steps there with
    /// some more. `origin` is the place of gap 0 of guide 0.
    pub(super) fn touching(
        &self,
        area: &Area,
        bar: usize,
        origin: DVec2,
    ) -> (impl Iterator<Item = i64>, Range<i64>) {
        let pattern = &self.cloth.pattern;
        let across = pattern.runs_across(bar);
        let [low, high] = [area.low - area.margin, area.high + area.margin]
            .map(|corner| along_yarns(corner - origin, across));
        let steps = pattern.steps_along(bar, low.y..high.y);
        let more = steps.start - MORE_STEPS..steps.end + MORE_STEPS;
        (pattern.yarns_over(bar, low.x..high.x), more)
    }
}

impl Workplace {
    fn clear(&mut self) {
        self.draped.clear();
        self.flat.clear();
        self.strands = 0;
    }
}

/// Adds up what was found in a patch.
fn sum(place: &Workplace) -> BodyClearance {
    let Workplace { draped, near_draped, near_flat, .. } = place;
    let mut clearance = BodyClearance {
        // Two measured segments count twice.
        pairs: near_draped.pairs / 2,
        pairs_below_1: near_draped.pairs_below_1 / 2,
        ..BodyClearance::FREE
    };
    let mut least = CUTOFF * CUTOFF;
    // Without a search of the flat cloth nothing is near in it.
    let flat = |at: usize| near_flat.squared.get(at).copied().unwrap_or([f32::INFINITY; SEGMENTS]);
    for (at, arc) in draped.iter().enumerate().filter(|(_, arc)| arc.measured) {
        for ((draped, flat), length) in
            near_draped.squared[at].into_iter().zip(flat(at)).zip(arc.lengths)
        {
            let length = f64::from(length);
            least = least.min(draped);
            clearance.yarn_length += length;
            if flat < TOO_NEAR_FLAT * TOO_NEAR_FLAT {
                clearance.near_flat += length;
            } else if draped < TOO_NEAR * TOO_NEAR {
                clearance.below_95 += length;
            }
        }
    }
    if least < CUTOFF * CUTOFF {
        clearance.min_over_2r = f64::from(least.sqrt());
    }
    clearance
}

/// The spans of a strand's whole stitches, counted from its first.
pub(super) fn whole_stitches(strands: &Strands, strand: &Strand) -> Range<usize> {
    let (first, last) = (strand.points.start as usize, strand.points.end as usize - 1);
    let pieces = &strands.pieces[strand.pieces.start as usize..strand.pieces.end as usize];
    // An end that the panel's edge cut has no data point. There the first or the last piece goes.
    let start = match strands.sources[first] {
        CUT => pieces.get(1).map_or(last, |&piece| piece as usize),
        _ => first,
    };
    let end = match strands.sources[last] {
        CUT => pieces.last().map_or(first, |&piece| piece as usize),
        _ => last,
    };
    start - first..end.max(start) - first
}
