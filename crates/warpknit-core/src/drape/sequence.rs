//! Yarns that are located once and draped many times: the frames of a sequence.
//!
//! In: a [`Cloth`], and the garment as draped in each frame. Out: [`Block`]s as [`super::run`]
//! delivers them, frame by frame.
//!
//! Knitting, location and clipping at the panels' edges happen on the flat pattern, which is the
//! same in all frames. So they are done once, and their results are kept: about 1 kB a stitch. A
//! frame costs the mapping, and the tubes where they are asked for.
//!
//! Not promised: memory bounded by a window, as [`super::run`] has it. All located yarns are kept.

use std::sync::Arc;

use rayon::prelude::*;

use super::body::DrapedGarment;
use super::{
    Announce, Block, Cloth, DrapeOptions, Stage, Totals, YarnBodies, deliver_blocks, lay_blocks,
    map_window, sweep_and_count,
};
use crate::garment::Garment;
use crate::ids::index32;
use crate::knit::spread::Spread;
use crate::knit::strain::StrainTable;
use crate::map::Draped;
use crate::map::relaxed::StrainCounts;
use crate::yarn::tube::Tubes;

/// All of a cloth's yarns, located on the flat pattern.
#[derive(Debug)]
pub struct LocatedCloth {
    blocks: Vec<Block>,
    /// Each bar's drawn radius relative to that of the thickest bar.
    thickness: Vec<f64>,
    /// How flat yarns lie. `None` where a section's ratio tells.
    spread: Option<Arc<Spread>>,
    totals: Totals,
    strain: Option<Arc<StrainTable>>,
    is_swept: bool,
    /// Memory for the draped points of one window. The blocks of all windows take turns in using
    /// it.
    spare: Vec<Draped>,
    /// The same for tubes.
    spare_tubes: Vec<Tubes>,
}

impl LocatedCloth {
    /// Knits the yarns and locates them on the flat panels. `announce` is that of [`super::run`].
    #[must_use]
    pub fn locate(cloth: &Cloth<'_>, options: &DrapeOptions, announce: &mut Announce<'_>) -> Self {
        let mut located = Vec::with_capacity(cloth.blocks());
        let Ok(totals) = lay_blocks(cloth, None, options, announce, &mut |blocks, _, _| {
            located.extend(blocks.iter().map(Block::located_copy));
            Ok::<(), std::convert::Infallible>(())
        });
        let (thickness, strain) = (cloth.thickness.clone(), cloth.strain.clone());
        let spread = cloth.spread.clone();
        let is_swept = cloth.is_swept(options);
        let (spare, spare_tubes) = (Vec::new(), Vec::new());
        Self { blocks: located, thickness, spread, totals, strain, is_swept, spare, spare_tubes }
    }

    /// The numbers of yarns, stitches and losses.
    #[must_use]
    pub fn totals(&self) -> &Totals {
        &self.totals
    }

    /// Delivers the yarns as draped on `garment`: the garment that they were located on, or a frame
    /// of it.
    ///
    /// # Errors
    /// The first error of `deliver`. Nothing is delivered after it.
    ///
    /// ```
    /// use warpknit_core::{drape::{self, sequence::LocatedCloth}, fabric::Fabric};
    /// let fabric = Fabric::named("tricot")?;
    /// let panel = drape::swatch_panel(&fabric, 4, 5);
    /// let cloth = drape::Cloth::swatch(&panel, &fabric, 4, 5);
    /// let options = drape::DrapeOptions::default();
    /// let mut located = LocatedCloth::locate(&cloth, &options, &mut |_, _| {});
    /// let mut raised = panel.clone();
    /// raised.panels[0].draped.iter_mut().for_each(|point| point.z += 10.0);
    /// located.run_frame(&raised, &options, &mut |_, _| {}, &mut |blocks| {
    ///     assert!(blocks[0].draped.positions.iter().all(|point| point.z > 5.0));
    ///     Ok::<_, std::io::Error>(())
    /// })?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn run_frame<E>(
        &mut self,
        garment: &Garment,
        options: &DrapeOptions,
        announce: &mut Announce<'_>,
        deliver: &mut dyn FnMut(&[Block]) -> Result<(), E>,
    ) -> Result<StrainCounts, E> {
        let Self { blocks, strain: table, is_swept, spare, spare_tubes, .. } = self;
        let bodies = YarnBodies { thickness: &self.thickness, spread: self.spread.as_deref() };
        announce(Stage::Strain, 0.0);
        let (mapping, is_swept) = (options.mapping, *is_swept);
        let body = DrapedGarment::new(garment, table.as_deref(), mapping, is_swept, &mut |done| {
            announce(Stage::Strain, done);
        });
        let mut strain = StrainCounts::default();
        let all = blocks.len();
        let mut rest = blocks.as_mut_slice();
        while !rest.is_empty() {
            let done = 1.0 - f64::from(index32(rest.len())) / f64::from(index32(all));
            // The same windows as in `run`, so that draped points take no more memory than there.
            let next = rest.iter().map(|block| (block.panel, block.stitches()));
            let fitting = map_window(next, is_swept, options);
            let (window, later) = rest.split_at_mut(fitting);
            rest = later;
            // The spare memory grows to the largest window and is then used by all.
            spare.resize_with(spare.len().max(window.len()), Default::default);
            exchange(window, spare);
            let mut announce = |stage| announce(stage, done);
            announce(Stage::Map);
            window.par_iter_mut().for_each(|block| block.map(&body));
            strain += sweep_and_count(window, &body, &mut announce);
            deliver_blocks(window, spare_tubes, bodies, options, &mut announce, deliver)?;
            exchange(window, spare);
        }
        Ok(strain)
    }
}

/// Swaps the blocks' draped points with the spare memory. Called once before a window is draped and
/// once after it.
fn exchange(blocks: &mut [Block], spare: &mut [Draped]) {
    for (block, draped) in blocks.iter_mut().zip(spare) {
        std::mem::swap(&mut block.draped, draped);
    }
}

impl Block {
    /// A copy of the located yarns, without draped points and tubes, and without spare capacity.
    fn located_copy(&self) -> Self {
        let Self { panel, bar, origin, knitted, strands, yarns, is_beside, .. } = self;
        Self {
            panel: *panel,
            bar: *bar,
            origin: *origin,
            knitted: knitted.clone(),
            strands: strands.clone(),
            yarns: yarns.clone(),
            is_beside: *is_beside,
            ..Self::default()
        }
    }
}
