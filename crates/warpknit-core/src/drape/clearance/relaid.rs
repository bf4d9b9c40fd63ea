//! Yarns that are laid once more to be measured, patch by patch.
//!
//! In: a [`Cloth`] that is not swept, so that a yarn depends on no other. Out: its [`BodyClearance`].
//! The yarns of a patch and of its margin are knitted, located and mapped by the stages that
//! [`run`](crate::drape::run) uses. Cost: 19 to 26 µs a stitch, and the memory of a patch for each
//! thread, however large the cloth is.

use glam::DVec2;
use rayon::prelude::*;

use super::BodyClearance;
use super::measure::{Measure, Workplace, whole_stitches};
use super::patch::ClothPatch;
use crate::drape::body::DrapedGarment;
use crate::drape::cloth::{BlockPlan, YarnPlan};
use crate::drape::{Block, Cloth, DrapeOptions};
use crate::knit::Progress;
use crate::locate::Locator;

/// A cloth whose yarns are laid once more.
pub(super) struct RelaidYarns<'a> {
    measure: Measure<'a>,
    options: DrapeOptions,
    body: DrapedGarment<'a>,
    /// One for each panel.
    locators: Vec<Locator<'a>>,
    /// The yarns of each bar, in order of their guides, panel by panel.
    yarns: Vec<Vec<Vec<&'a YarnPlan>>>,
}

impl<'a> RelaidYarns<'a> {
    /// Prepares a cloth whose thickest yarns are drawn with `radius` mm.
    pub(super) fn new(cloth: &'a Cloth<'a>, options: DrapeOptions, radius: f64) -> Self {
        let (panels, bars) = (cloth.garment.panels.len(), cloth.thickness.len());
        let mut yarns = vec![vec![Vec::new(); bars]; panels];
        for block in &cloth.blocks {
            yarns[block.panel][block.bar].extend(&block.yarns);
        }
        let locators = cloth.garment.panels.par_iter().map(Locator::new).collect();
        let body =
            DrapedGarment::new(cloth.garment, cloth.strain(), options.mapping, false, &mut |_| ());
        Self { measure: Measure::new(cloth, radius), options, body, locators, yarns }
    }

    /// Measures all patches. `progress` gets the share that is done.
    pub(super) fn measure(&self, progress: Progress<'_>) -> BodyClearance {
        let all = 0..self.measure.patches.count();
        self.measure.all(all, |_, patch, place| self.add_patch(patch, place), progress)
    }

    /// Lays the yarns of a patch and adds their arcs.
    fn add_patch(&self, patch: &ClothPatch, place: &mut Workplace) {
        let mut blocks = std::mem::take(&mut place.blocks);
        blocks.resize_with(self.measure.radii.len(), Block::default);
        for (bar, block) in blocks.iter_mut().enumerate() {
            let (plan, locator) = (self.plan(patch, bar), &self.locators[patch.panel]);
            block.lay(self.measure.cloth, &plan, locator, Some(&self.body), &self.options);
            for strand in &block.strands.strands {
                let spans = whole_stitches(&block.strands, strand);
                self.measure.add_arcs(block, strand, spans, &patch.area, place);
            }
        }
        place.blocks = blocks;
    }

    /// The yarns of a bar that touch a patch or its margin, over the steps within it.
    fn plan(&self, patch: &ClothPatch, bar: usize) -> BlockPlan {
        let mesh = &self.measure.cloth.meshes[patch.panel];
        let origin = mesh.origin - DVec2::new(mesh.wale_spacing / 2.0, 0.0);
        let (numbers, steps) = self.measure.touching(&patch.area, bar, origin);
        let yarns = &self.yarns[patch.panel][bar];
        let yarns = numbers.filter_map(|number| {
            let yarn = yarns[yarns.binary_search_by_key(&number, |yarn| yarn.guide).ok()?];
            let courses = yarn.courses.start.max(steps.start)..yarn.courses.end.min(steps.end);
            (!courses.is_empty()).then(|| YarnPlan { courses, ..yarn.clone() })
        });
        BlockPlan { panel: patch.panel, bar, is_beside: false, yarns: yarns.collect() }
    }
}
