//! The yarns of a cloth that pictures need.
//!
//! In: a planned [`Cloth`] and what pictures see. Out: a cloth of the stretches of its yarns that
//! are seen or cast shadows on what is seen. A stretch has the number that its yarn has in the
//! whole, and its points lie where they lie in the whole.
//!
//! Cost: linear in the cells that yarns cross. Not promised: exact ends; a stretch is some stitches
//! longer than what is seen of it.

use std::ops::Range;

use glam::DVec2;

use super::{PanelPart, Seen};
use crate::drape::cloth::{BLOCK_STITCHES, BlockPlan, YarnPlan};
use crate::drape::{Cloth, DrapeOptions};

/// Steps that a stretch is longer than what is seen of it: before it [`LEAD_POINTS`], four a step
/// at least, and behind it room for the points around a run of [`Seen::runs`].
const CONTEXT_STEPS: [i64; 2] = [12, 3];
/// Points before a run from which on a strand is divided into pieces. Pieces shorter than a pixel
/// are merged one after another, so the first ones depend on where the strand begins.
pub const LEAD_POINTS: usize = 40;
/// Stretches of a yarn with fewer steps between them are joined: a new one would lay its context
/// anew.
const JOINED_STEPS: i64 = 16;
/// Stitches around what is seen whose yarns are swept with it. A sweep moves yarns by their
/// neighbours, and 18 of them pass a move on, by a smaller part each time.
const SWEPT_STITCHES: f64 = 12.0;

/// How long the stretches of seen yarns are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stretches {
    /// As far as they are seen.
    AsSeen,
    /// From the yarn's start on, for pictures that show how plies lie: they turn around the yarn
    /// all along it.
    FromStart,
}

impl<'a> Cloth<'a> {
    /// The part of the cloth that pictures need. `options` are those with which it is laid.
    #[must_use]
    pub fn seen(&self, seen: &Seen, options: &DrapeOptions, stretches: Stretches) -> Self {
        let is_swept = self.is_swept(options);
        let mut cloth = self.bare();
        for block in &self.blocks {
            let mut own = Vec::new();
            for yarn in &block.yarns {
                let ranges = self.ranges(block, yarn, seen, is_swept);
                own.extend(stretches_of(yarn, ranges, stretches, is_swept));
            }
            cloth.add_stretches(block, own);
        }
        cloth
    }

    /// Some of its yarns, evenly from all of them: about `most` stitches, for numbers that are
    /// shares of the cloth.
    #[must_use]
    pub fn sampled(&self, most: u64) -> Self {
        let step = usize::try_from(self.stitches().div_ceil(most.max(1))).unwrap_or(usize::MAX);
        let mut cloth = self.bare();
        let mut number = 0;
        for block in &self.blocks {
            let is_wanted = |_: &&YarnPlan| {
                number += 1;
                number % step.max(1) == 0
            };
            let yarns: Vec<_> = block.yarns.iter().filter(is_wanted).cloned().collect();
            if !yarns.is_empty() {
                cloth.blocks.push(BlockPlan { yarns, ..*block });
            }
        }
        cloth
    }

    /// The cloth without any of its yarns.
    fn bare(&self) -> Self {
        Self {
            garment: self.garment,
            pattern: self.pattern.clone(),
            strain: self.strain.clone(),
            thickness: self.thickness.clone(),
            spread: self.spread.clone(),
            meshes: self.meshes.clone(),
            blocks: Vec::new(),
            yarns: self.yarns,
            whole: Some(self.whole_stitches()),
        }
    }

    /// The steps of a yarn that are seen or cast shadows, with their context.
    fn ranges(
        &self,
        block: &BlockPlan,
        yarn: &YarnPlan,
        seen: &Seen,
        is_swept: bool,
    ) -> Vec<(Range<i64>, PanelPart)> {
        let (bar, pattern) = (block.bar, &self.pattern);
        // Yarns across the wales are numbered along y and run along x.
        let axis = usize::from(pattern.runs_across(bar));
        let mesh = &self.meshes[block.panel];
        let cell = DVec2::new(mesh.wale_spacing, mesh.course_spacing);
        // Gap 0 of guide 0 lies half a wale to the left of wale 0.
        let origin = mesh.origin - DVec2::new(cell.x / 2.0, 0.0);
        let around = if is_swept { SWEPT_STITCHES } else { 0.0 };
        let strip = pattern.strip(bar, yarn.guide);
        let aside = around * cell[axis];
        let strip = strip.start + origin[axis] - aside..strip.end + origin[axis] + aside;
        let along = around * cell[1 - axis];
        let ranges = seen.panels[block.panel].ranges(axis, strip).into_iter();
        let steps = ranges.map(|(range, part)| {
            let from = range.start - along - origin[1 - axis];
            let steps = pattern.steps_along(bar, from..range.end + along - origin[1 - axis]);
            let from = (steps.start - CONTEXT_STEPS[0]).max(yarn.courses.start);
            (from..(steps.end + CONTEXT_STEPS[1]).min(yarn.courses.end), part)
        });
        steps.filter(|(steps, _)| !steps.is_empty()).collect()
    }

    /// Adds stretches of yarns of one block, in blocks of about [`BLOCK_STITCHES`] stitches.
    fn add_stretches(&mut self, of: &BlockPlan, stretches: Vec<YarnPlan>) {
        for stretch in stretches {
            match self.blocks.last_mut() {
                Some(last)
                    if (last.panel, last.bar) == (of.panel, of.bar)
                        && last.stitches() < BLOCK_STITCHES as u64 =>
                {
                    last.yarns.push(stretch);
                }
                _ => self.blocks.push(BlockPlan { yarns: vec![stretch], ..*of }),
            }
        }
    }
}

/// The stretches of one yarn, given the ranges of its steps that pictures need.
fn stretches_of(
    yarn: &YarnPlan,
    ranges: Vec<(Range<i64>, PanelPart)>,
    stretches: Stretches,
    is_swept: bool,
) -> Vec<YarnPlan> {
    let mut joined: Vec<Range<i64>> = Vec::new();
    for (mut range, part) in ranges {
        if stretches == Stretches::FromStart && part == PanelPart::Seen {
            range.start = yarn.courses.start;
            joined.clear();
        }
        match joined.last_mut() {
            // Swept yarns are in one piece: their neighbours are found by their numbers.
            Some(last) if is_swept || range.start - last.end < JOINED_STEPS => {
                last.end = last.end.max(range.end);
            }
            _ => joined.push(range),
        }
    }
    joined.into_iter().map(|courses| YarnPlan { courses, ..*yarn }).collect()
}
