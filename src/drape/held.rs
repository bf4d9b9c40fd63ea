//! Yarns that are laid once and shown on many drapes of their garment.
//!
//! In: a [`Cloth`], and the garment as each frame of a sequence has it. Out: [`Block`]s as
//! [`super::run`] hands them over, frame by frame. Knitting, location and the cut at the panels'
//! edges happen on the flat pattern, which doesn't change, so they are done once and held: some 1
//! kB a stitch. A frame costs its mapping, and its surfaces if it has any.

use super::{Announce, Block, Cloth, DrapeOptions, Stage, Totals, clothe, lay, window};
use crate::garment::Garment;
use crate::ids::index32;
use crate::map::Draped;
use crate::yarn::tube::Tubes;

/// All of a cloth's yarns, located on the flat pattern.
#[derive(Debug)]
pub struct LocatedCloth {
    blocks: Vec<Block>,
    /// Each bar's drawn radius over the thickest one's.
    thickness: Vec<f64>,
    totals: Totals,
    /// Memory of the blocks of a window.
    spare: Vec<(Draped, Tubes)>,
}

impl LocatedCloth {
    /// Lays the yarns. `announce` is that of [`super::run`].
    #[must_use]
    pub fn locate(cloth: &Cloth<'_>, options: &DrapeOptions, announce: &mut Announce<'_>) -> Self {
        let mut held = Vec::with_capacity(cloth.blocks());
        let laid = lay(
            cloth,
            options,
            announce,
            &mut |blocks, _, _| -> Result<(), std::convert::Infallible> {
                held.extend(blocks.iter().map(Block::located));
                Ok(())
            },
        );
        let Ok(totals) = laid;
        Self { blocks: held, thickness: cloth.thickness.clone(), totals, spare: Vec::new() }
    }

    /// What was laid.
    #[must_use]
    pub fn totals(&self) -> &Totals {
        &self.totals
    }

    /// Hands over the yarns where `garment` has them: the one that they were laid on, or a frame of
    /// it.
    ///
    /// # Errors
    /// The first error of `deliver`, at once.
    ///
    /// ```
    /// use warpknit::{drape::{self, held::LocatedCloth}, fabric::Fabric};
    /// let fabric = Fabric::named("tricot")?;
    /// let panel = drape::swatch_panel(&fabric, 4, 5);
    /// let cloth = drape::Cloth::swatch(&panel, &fabric, 4, 5);
    /// let options = drape::DrapeOptions::default();
    /// let mut held = LocatedCloth::locate(&cloth, &options, &mut |_, _| {});
    /// let mut raised = panel.clone();
    /// raised.panels[0].draped.iter_mut().for_each(|point| point.z += 10.0);
    /// held.run_frame(&raised, &options, &mut |_, _| {}, &mut |blocks| {
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
    ) -> Result<(), E> {
        let Self { blocks, thickness, spare, .. } = self;
        let all = blocks.len();
        let mut rest = blocks.as_mut_slice();
        while !rest.is_empty() {
            let done = 1.0 - f64::from(index32(rest.len())) / f64::from(index32(all));
            let fitting = window(rest.iter().map(Block::stitches), options.surface.as_ref());
            let (window, later) = rest.split_at_mut(fitting);
            rest = later;
            spare.resize_with(spare.len().max(window.len()), Default::default);
            exchange(window, spare);
            clothe(window, garment, thickness, options, &mut |stage| announce(stage, done));
            announce(Stage::Deliver, done);
            deliver(window)?;
            exchange(window, spare);
        }
        Ok(())
    }
}

/// Lends blocks the spare memory, or takes it back.
fn exchange(blocks: &mut [Block], spare: &mut [(Draped, Tubes)]) {
    for (block, (draped, tubes)) in blocks.iter_mut().zip(spare) {
        std::mem::swap(&mut block.draped, draped);
        std::mem::swap(&mut block.tubes, tubes);
    }
}

impl Block {
    /// A copy of what is known on the flat pattern, as small as it is.
    fn located(&self) -> Self {
        let Self { panel, bar, knitted, strands, yarns, .. } = self;
        Self {
            panel: *panel,
            bar: *bar,
            knitted: knitted.clone(),
            strands: strands.clone(),
            yarns: yarns.clone(),
            ..Self::default()
        }
    }

    fn stitches(&self) -> u64 {
        self.knitted.stitches.len() as u64
    }
}
