//! The yarns of a panel, as sweeps move them.
//!
//! In: the mapped blocks of one panel. Out: a [`SweptPanel`], arrays with an entry for each data
//! point of all its yarns; and at the end the blocks, with the points where they are by then.
//!
//! Cost: linear in the points. Not promised: a curve beside points that are off the panel.

use std::ops::Range;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::drape::Block;
use crate::drape::strands::CUT;
use crate::ids::index32;
use crate::knit::YarnCopy;
use crate::knit::strain::RepeatSpans;
use crate::map::Draped;
use crate::yarn::curve;

/// A span longer than its flat length by this factor is torn, unless it is too long by less than
/// [`MENDABLE`]: it lies in a crease of the mesh, where no move would mend it. With 1.3 a sharply
/// folded dress keeps the lengths of 3 % fewer stitches.
const MAX_STRETCH: f64 = 2.0;
/// A short span that is too long by less, in radii, is not torn, however large its share. A fold of
/// thick cloth makes a span of two radii three times as long, and moves can mend that: both its ends
/// may move by some radii. With 0 yarns pass through each other there; 8 gives what 5 does.
const MENDABLE: f64 = 5.0;

/// One yarn of the panel.
pub(super) struct PanelYarn {
    pub(super) copy: YarnCopy,
    /// The part of the panel's arrays that it fills.
    pub(super) places: Range<usize>,
}

/// All yarns of a panel.
pub(super) struct SweptPanel<'a> {
    pub(super) repeat: &'a RepeatSpans,
    pub(super) yarns: Vec<PanelYarn>,
    /// Place of each data point; not a number for those off the panel.
    pub(super) places: Vec<DVec3>,
    /// Where each data point lies in the flat cloth.
    pub(super) flat: Vec<Vec3>,
    /// The places as mapped.
    pub(super) mapped: Vec<DVec3>,
    /// Whether the cloth is strained too far at a place for loops to follow.
    is_overstrained: Vec<bool>,
    /// Length that the span from each place keeps, mm.
    pub(super) lengths: Vec<f64>,
    /// Length of yarn from its start to each place, mm.
    pub(super) along: Vec<f64>,
}

/// The parts of an array that yarns fill.
pub(super) fn slices_of<'a, T>(all: &'a mut [T], yarns: &[PanelYarn]) -> Vec<&'a mut [T]> {
    let mut rest = all;
    let slices = yarns.iter().map(|yarn| {
        rest.split_off_mut(..yarn.places.len()).expect("yarns fill the array one after another")
    });
    slices.collect()
}

impl<'a> SweptPanel<'a> {
    pub(super) fn new(blocks: &[Block], repeat: &'a RepeatSpans) -> Self {
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

    /// The data point of the repeat of which a yarn's point is a copy, and its cell along the yarn.
    pub(super) fn origin(&self, yarn: &PanelYarn, point: usize) -> (usize, i64) {
        let (count, start) = self.points_of(yarn.copy.yarn);
        let at = yarn.copy.first + i64::from(index32(point));
        let within = usize::try_from(at.rem_euclid(count)).expect("a remainder is not negative");
        (start + within, at.div_euclid(count))
    }

    /// Radius of a yarn, mm.
    pub(super) fn radius(&self, yarn: &PanelYarn) -> f64 {
        self.repeat.yarns[yarn.copy.yarn].chain.radius
    }

    /// Whether a span of such a length is torn: no move would mend it.
    pub(super) fn is_torn(&self, yarn: &PanelYarn, span: usize, length: f64) -> bool {
        let kept = self.lengths[yarn.places.start + span];
        length > MAX_STRETCH * kept && length > kept + MENDABLE * self.radius(yarn)
    }

    /// Number of data points of a yarn of the repeat, and the first of them.
    fn points_of(&self, yarn: usize) -> (i64, usize) {
        let points = &self.repeat.yarns[yarn].chain.points;
        (i64::from(index32(points.len())), points.start)
    }

    /// Writes the places into the blocks.
    pub(super) fn write_back(&self, blocks: &mut [Block]) {
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
pub(super) fn control_points(own: &[DVec3], span: usize) -> Option<[DVec3; 4]> {
    let control: [DVec3; 4] = own.get(span.checked_sub(1)?..span + 3)?.try_into().ok()?;
    control.iter().all(|place| !place.is_nan()).then_some(control)
}
