//! The pipeline: from a garment and a fabric to yarns on the body, block by block.
//!
//! In: a [`Garment`] and a [`Fabric`]. Out: [`Block`]s of consecutive yarns, delivered in yarn
//! order ([`run`]). A block is knitted, located, clipped at the panel's edge, mapped and, if asked,
//! given tubes. Then its memory is used for a later block. So memory is bounded by a window of
//! blocks and not by the fabric.
//!
//! Method: a window is a block for each thread, which knits, locates and maps it ([`Stage::Lay`]).
//! Of large blocks there are fewer. Where yarns are moved apart, a window is a whole panel. All
//! blocks of a window go through each later stage in parallel before the next one begins. A yarn
//! depends on no other yarn, so the result is the same for any number of threads.
//!
//! Cost: linear in the stitches. Not promised: yarns that know of each other across panels; each
//! panel is laid out on its own.
//!
//! [`Garment`]: crate::garment::Garment
//! [`Fabric`]: crate::fabric::Fabric

mod block;
mod body;
pub mod clearance;
mod cloth;
pub mod evenness;
pub mod fibres;
mod lay_times;
mod lengths;
pub mod seen;
mod segments;
pub mod sequence;
pub mod strands;
mod sweeps;

use rayon::prelude::*;

use crate::ids::index32;
use crate::knit::spread::Spread;
use crate::locate::Locator;
use crate::map::Mapping;
use crate::map::relaxed::StrainCounts;
use crate::yarn::tube::{Section, Tubes};
pub use block::Block;
use body::DrapedGarment;
pub use cloth::{Cloth, LayoutError, MAX_SWEPT_STITCHES, swatch_panel};
use evenness::Evenness;
pub use lay_times::LayTimes;
use strands::{Edge, Losses};

/// Memory of the window, bytes. A window holds at least one block, and a block at least one yarn,
/// so a single long yarn may take more.
const WINDOW_BYTES: usize = 256 << 20;
/// Memory of a stitch without its tubes, bytes: some ten points in all of a block's arrays.
const STITCH_BYTES: usize = 2500;

/// Options of the pipeline.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DrapeOptions {
    /// The mapping of depth, from the flat panel to the draped one.
    pub mapping: Mapping,
    /// The treatment of yarns at the panel's edge.
    pub edge: Edge,
    /// Whether yarns that cut each other on the body are moved apart, with [`Mapping::Relaxed`].
    /// `None`: up to [`MAX_SWEPT_STITCHES`].
    pub sweeps: Option<bool>,
    /// Whether stitches are copies of each other.
    pub evenness: Evenness,
    /// The section of tubes, if they are wanted. Its radius is that of the thickest bar.
    pub surface: Option<Section>,
}

/// The stages that the pipeline announces, and the parts of [`Stage::Lay`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Building the search structures, once a run.
    Index,
    /// Knitting, locating and mapping, block by block. [`Totals::laying`] has the time of each.
    Lay,
    /// Data points on the flat fabric. A part of [`Stage::Lay`], never announced.
    Knit,
    /// The triangle of each data point, and clipping at the panel's edge. A part of
    /// [`Stage::Lay`], never announced.
    Locate,
    /// Solving the repeat for the strains of the garment.
    Strain,
    /// Draped positions: a part of [`Stage::Lay`], and announced for the frames of a sequence.
    Map,
    /// Moving yarns apart on the body.
    Sweep,
    /// Measuring how near yarns come to each other, with [`clearance::run`].
    Clearance,
    /// Tubes.
    Surface,
    /// Delivering blocks.
    Deliver,
}

/// Counts of what a run made.
#[derive(Clone, Copy, Debug, Default)]
pub struct Totals {
    /// Yarns with any part on a panel.
    pub yarns: usize,
    /// Uninterrupted runs of yarn.
    pub strands: usize,
    /// Stitches, and parts of stitches, that are drawn.
    pub pieces: usize,
    /// Data points on the panels.
    pub data_points: usize,
    /// Counts of what edges and defects removed.
    pub losses: Losses,
    /// Counts of points where the cloth is strained too far.
    pub strain: StrainCounts,
    /// The time of each part of [`Stage::Lay`].
    pub laying: LayTimes,
}

/// Runs the pipeline, and delivers windows of blocks in yarn order.
///
/// `announce` is called at the start of each stage, with the share of blocks that are done, and
/// often during [`Stage::Strain`], with the share of strains. A program can time stages or draw a
/// progress bar with it.
///
/// # Errors
/// The first error of `deliver`. Nothing is delivered after it.
///
/// ```
/// use warpknit_core::{drape, fabric::Fabric};
/// let fabric = Fabric::named("tricot")?;
/// let panel = drape::swatch_panel(&fabric, 8, 10);
/// let cloth = drape::Cloth::swatch(&panel, &fabric, 8, 10);
/// let options = drape::DrapeOptions::default();
/// let deliver = &mut |_: &[drape::Block]| Ok::<_, std::io::Error>(());
/// let totals = drape::run(&cloth, &options, &mut |_, _| {}, deliver)?;
/// assert_eq!(totals.losses.stitches, 2 * 8 * 10);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run<E>(
    cloth: &Cloth<'_>,
    options: &DrapeOptions,
    announce: &mut dyn FnMut(Stage, f64),
    deliver: &mut dyn FnMut(&[Block]) -> Result<(), E>,
) -> Result<Totals, E> {
    run_with(cloth, options, announce, &mut |_, _| (), deliver)
}

/// Called with the mapped blocks of a window before they are delivered. It announces its own stage.
type Look<'a> = dyn FnMut(&[Block], &mut dyn FnMut(Stage)) + 'a;

/// Runs the pipeline, and shows each window to `look` before it is delivered.
fn run_with<E>(
    cloth: &Cloth<'_>,
    options: &DrapeOptions,
    announce: &mut dyn FnMut(Stage, f64),
    look: &mut Look<'_>,
    deliver: &mut dyn FnMut(&[Block]) -> Result<(), E>,
) -> Result<Totals, E> {
    announce(Stage::Strain, 0.0);
    let is_swept = cloth.is_swept(options);
    let body =
        DrapedGarment::new(cloth.garment, cloth.strain(), options.mapping, is_swept, &mut |done| {
            announce(Stage::Strain, done);
        });
    let (mut strain, mut spare) = (StrainCounts::default(), Vec::new());
    let take = &mut |blocks: &mut [Block], announce: &mut Announce<'_>, done| {
        let mut announce = |stage| announce(stage, done);
        strain += sweep_and_count(blocks, &body, &mut announce);
        look(blocks, &mut announce);
        let bodies = YarnBodies { thickness: &cloth.thickness, spread: cloth.spread.as_deref() };
        deliver_blocks(blocks, &mut spare, bodies, options, &mut announce, deliver)
    };
    let mut totals = lay_blocks(cloth, Some(&body), options, announce, take)?;
    totals.strain = strain;
    Ok(totals)
}

/// Called at the start of each stage, with the share of blocks that are done.
type Announce<'a> = dyn FnMut(Stage, f64) + 'a;

/// Called with the laid blocks of a window. It announces the later stages itself; the number is the
/// share of blocks that are done.
type TakeLaid<'a, E> = dyn FnMut(&mut [Block], &mut Announce<'_>, f64) -> Result<(), E> + 'a;

/// Knits and locates all yarns, and maps them if there is a body, window by window, and passes each
/// window to `take`.
fn lay_blocks<E>(
    cloth: &Cloth<'_>,
    body: Option<&DrapedGarment<'_>>,
    options: &DrapeOptions,
    announce: &mut Announce<'_>,
    take: &mut TakeLaid<'_, E>,
) -> Result<Totals, E> {
    announce(Stage::Index, 0.0);
    let locators: Vec<_> = cloth.garment.panels.par_iter().map(Locator::new).collect();
    // The blocks of the largest window. Each window uses their memory again, so after the first
    // ones nothing is allocated any more.
    let mut blocks: Vec<Block> = Vec::new();
    let mut totals = Totals::default();
    let is_swept = cloth.is_swept(options);
    let all: Vec<_> = cloth.blocks.iter().filter(|plan| is_swept || !plan.is_beside).collect();
    let mut rest = all.as_slice();
    while !rest.is_empty() {
        let done = 1.0 - f64::from(index32(rest.len())) / f64::from(index32(all.len()));
        let next = rest.iter().map(|plan| (plan.panel, plan.stitches()));
        let fitting = map_window(next, is_swept, options);
        let (plans, later) = rest.split_at(fitting);
        rest = later;
        blocks.resize_with(blocks.len().max(fitting), Block::default);
        let blocks = &mut blocks[..fitting];
        announce(Stage::Lay, done);
        blocks
            .par_iter_mut()
            .zip(plans)
            .for_each(|(block, plan)| block.lay(cloth, plan, &locators[plan.panel], body, options));
        blocks.iter().for_each(|block| totals.laying += block.times);
        let own = blocks.iter().filter(|block| !block.is_beside);
        own.for_each(|block| totals.add(block, options.edge));
        take(blocks, announce, done)?;
    }
    Ok(totals)
}

/// Moves the yarns of mapped blocks apart if they are swept, and counts where they are strained too
/// far. Blocks of a swept garment are those of a whole panel.
fn sweep_and_count(
    blocks: &mut [Block],
    body: &DrapedGarment<'_>,
    announce: &mut dyn FnMut(Stage),
) -> StrainCounts {
    let panel = blocks.first().map_or(0, |block| block.panel);
    if let Some(spans) = body.swept(panel) {
        announce(Stage::Sweep);
        sweeps::sweep(blocks, spans);
    }
    let mut strain = StrainCounts::default();
    blocks.iter().filter(|block| !block.is_beside).for_each(|block| strain += block.strain);
    strain
}

/// What tubes need to know of yarns besides their places.
#[derive(Clone, Copy)]
struct YarnBodies<'a> {
    /// Each bar's radius relative to that of the thickest bar.
    thickness: &'a [f64],
    spread: Option<&'a Spread>,
}

/// Delivers mapped blocks, with tubes if they are wanted. `spare` is memory for tubes that all
/// windows share, so that tubes of one window exist at a time.
fn deliver_blocks<E>(
    blocks: &mut [Block],
    spare: &mut Vec<Tubes>,
    bodies: YarnBodies<'_>,
    options: &DrapeOptions,
    announce: &mut dyn FnMut(Stage),
    deliver: &mut dyn FnMut(&[Block]) -> Result<(), E>,
) -> Result<(), E> {
    let alike = |one: &Block, next: &Block| one.is_beside == next.is_beside;
    for own in blocks.chunk_by_mut(alike).filter(|blocks| !blocks[0].is_beside) {
        let mut rest = own;
        while !rest.is_empty() {
            let fitting = window_len(rest.iter().map(Block::stitches), options);
            let (window, later) = rest.split_at_mut(fitting);
            rest = later;
            if let Some(section) = &options.surface {
                announce(Stage::Surface);
                spare.resize_with(spare.len().max(window.len()), Tubes::default);
                window.par_iter_mut().zip(spare.par_iter_mut()).for_each(|(block, spare)| {
                    std::mem::swap(&mut block.tubes, spare);
                    block.add_tubes(section, bodies.thickness[block.bar], bodies.spread);
                });
            }
            announce(Stage::Deliver);
            deliver(window)?;
            let tubes = window.iter_mut().map(|block| &mut block.tubes);
            tubes.zip(&mut *spare).for_each(|(tubes, spare)| std::mem::swap(tubes, spare));
        }
    }
    Ok(())
}

/// The number of the next blocks that are mapped together, given the panel and the stitches of each:
/// those of a whole panel if they are swept.
fn map_window(
    mut blocks: impl Iterator<Item = (usize, u64)>,
    is_swept: bool,
    options: &DrapeOptions,
) -> usize {
    if !is_swept {
        return window_len(blocks.map(|(_, stitches)| stitches), options);
    }
    let first = blocks.next().map(|(panel, _)| panel);
    1 + blocks.take_while(|(panel, _)| Some(*panel) == first).count()
}

/// The number of the next blocks that fit in a window, given the stitches of each.
fn window_len(stitches: impl Iterator<Item = u64>, options: &DrapeOptions) -> usize {
    // A vertex takes 32 bytes and a triangle 12. The factor of 4 leaves room for the bytes or the
    // text into which a writer turns them.
    let (vertices, triangles) = options.surface.map_or((0, 0), |section| section.size_of(1, 1));
    let stitch = STITCH_BYTES + 4 * (32 * vertices + 12 * triangles);
    // One a thread, so that the next window finds the memory of this one in the core's own cache.
    // Threads wait for each other at a window's end, for a short time since blocks are of like size.
    let most = rayon::current_num_threads();
    let mut bytes = 0;
    let fitting = stitches.take(most).take_while(|&stitches| {
        bytes += stitch.saturating_mul(usize::try_from(stitches).unwrap_or(usize::MAX));
        bytes <= WINDOW_BYTES
    });
    // A block that is larger than the window goes through it alone.
    fitting.count().max(1)
}

impl Totals {
    fn add(&mut self, block: &Block, edge: Edge) {
        let strands = &block.strands;
        self.yarns += strands.strands.chunk_by(|a, b| a.yarn == b.yarn).count();
        self.strands += strands.strands.len();
        self.pieces += strands.pieces.len();
        self.data_points +=
            strands.sources.iter().filter(|&&source| source != strands::CUT).count();
        self.losses += strands.losses;
        // With `Drop`, stitches at the edge are not drawn, so they don't count as stitches.
        if edge == Edge::Drop {
            self.losses.stitches -= strands.losses.clipped;
        }
    }
}
