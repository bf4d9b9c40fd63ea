//! The pipeline: from a garment and a fabric to yarns on the body, block by block.
//!
//! In: a [`Garment`] and a [`Fabric`]. Out: [`Block`]s of consecutive yarns, delivered in yarn
//! order ([`run`]). A block is knitted, located, clipped at the panel's edge, mapped and, if asked,
//! given tubes. Then its memory is used for a later block. So memory is bounded by a window of
//! blocks and not by the fabric.
//!
//! Method: stages in lockstep over a window. All blocks of a window go through one stage in
//! parallel before the next stage begins, so each stage can be timed. A yarn depends on no other
//! yarn, so the result is the same for any number of threads.
//!
//! Cost: linear in the stitches. Not promised: yarns that know of each other across panels; each
//! panel is laid out on its own.

mod body;
pub mod clearance;
pub mod fibres;
mod lengths;
pub mod seen;
pub mod sequence;
pub mod strands;
mod sweeps;

use std::ops::Range;
use std::sync::Arc;

use glam::{DVec2, Vec2Swizzles};
use rayon::prelude::*;

use crate::fabric::Fabric;
use crate::garment::{Garment, Panel};
use crate::ids::{YarnId, index32};
use crate::knit::mesh::{StructureMesh, vertices};
use crate::knit::strain::StrainTable;
use crate::knit::{Knitted, Pattern, YarnCopy};
use crate::locate::{Locator, SurfacePoint};
use crate::map::relaxed::StrainCounts;
use crate::map::{Draped, Mapping};
use crate::tile::Tile;
use crate::yarn::tube::{Section, Tubes};
use body::Body;
use lengths::Lengths;
use strands::{Edge, Losses, Strands};

/// Stitches after which a block ends. Much smaller blocks would cost more in scheduling than in
/// work; much larger ones (a stitch takes [`STITCH_BYTES`]) would not stay in a core's cache
/// between stages, and would divide a small fabric among too few threads.
const BLOCK_STITCHES: usize = 512;
/// Blocks in the window for each thread. With 1, a thread that finishes early waits at the end of
/// every stage. With many more, a block's data has left the cache before the next stage reads it.
const THREAD_BLOCKS: usize = 4;
/// The largest number of blocks in the window.
const MAX_BLOCKS: usize = 64;
/// Memory of the window, bytes. A window holds at least one block, and a block at least one yarn,
/// so a single long yarn may take more.
const WINDOW_BYTES: usize = 256 << 20;
/// Memory of a stitch without its tubes, bytes: some ten points in all of a block's arrays.
const STITCH_BYTES: usize = 2500;
/// The largest number of wales or courses of a panel. A garment at true gauge has some thousand, so
/// a larger panel is one in the wrong unit, and planning it would take all memory.
const MAX_SPACINGS: f64 = 1e6;

/// Reasons why a fabric can't be laid out over a garment.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LayoutError {
    /// A panel would have over a million wales or courses.
    #[error(
        "panel {panel} is {width:.3e} x {height:.3e} mm and would take over a million wales or \
         courses: check --unit, or lower the densities"
    )]
    TooLarge {
        /// The panel, from 0.
        panel: usize,
        /// Its width, mm.
        width: f64,
        /// Its height, mm.
        height: f64,
    },
    /// The fabric has a layout for a panel that doesn't exist.
    #[error(
        "the fabric has a [[panels]] table for panel {panel}, but the garment's panels are \
         numbered 0 to {last}: `inspect` lists them"
    )]
    NoPanel {
        /// The panel, from 0.
        panel: usize,
        /// The garment's last panel.
        last: usize,
    },
}

/// A yarn to be knitted: its guide, and the courses that it runs through.
#[derive(Clone, Debug)]
struct YarnPlan {
    id: YarnId,
    guide: i64,
    courses: Range<i64>,
}

/// Consecutive yarns of one bar on one panel.
#[derive(Clone, Debug)]
struct BlockPlan {
    panel: usize,
    bar: usize,
    /// Whether its yarns belong to another part of the cloth, and only lie beside this part's.
    is_beside: bool,
    yarns: Vec<YarnPlan>,
}

/// A fabric laid out over a garment: the plan of all its yarns.
#[derive(Debug)]
pub struct Cloth<'a> {
    garment: &'a Garment,
    pattern: Pattern,
    /// How the repeat changes with the cloth's strain. `None` where it can't be relaxed.
    strain: Option<Arc<StrainTable>>,
    /// Each bar's drawn radius relative to that of the thickest bar.
    thickness: Vec<f64>,
    /// The structure mesh of each panel.
    meshes: Vec<StructureMesh>,
    blocks: Vec<BlockPlan>,
    yarns: usize,
    /// Stitches of the whole cloth. `None` unless this is what pictures see of it.
    whole: Option<u64>,
}

/// The most stitches whose yarns are swept on the body unless that is asked for. All yarns of a
/// panel are in memory then, some kilobytes a stitch.
pub const MAX_SWEPT_STITCHES: u64 = 1_000_000;

impl<'a> Cloth<'a> {
    /// Covers every panel. The fabric starts at the lowest-left corner of the panel's bounding box
    /// along the grain, or at the origin that the fabric's layout of that panel gives. A layout's
    /// grain is not applied here: the caller has turned the panels by [`Garment::turn_grain`].
    ///
    /// # Errors
    /// A panel that would take more stitches than any garment has, or a layout of a panel that
    /// doesn't exist.
    pub fn cover(garment: &'a Garment, fabric: &Fabric) -> Result<Self, LayoutError> {
        Self::cover_with(garment, fabric, Pattern::new(fabric))
    }

    /// The same with a repeat of the fabric that is knitted already.
    ///
    /// # Errors
    /// Those of [`Self::cover`].
    pub fn cover_with(
        garment: &'a Garment,
        fabric: &Fabric,
        pattern: Pattern,
    ) -> Result<Self, LayoutError> {
        for (panel, size) in garment.panels.iter().map(Panel::size).enumerate() {
            if size.x > MAX_SPACINGS * fabric.wale_spacing()
                || size.y > MAX_SPACINGS * fabric.course_spacing()
            {
                return Err(LayoutError::TooLarge { panel, width: size.x, height: size.y });
            }
        }
        let last = garment.panels.len().saturating_sub(1);
        if let Some(layout) = fabric.panels.iter().find(|layout| layout.panel > last) {
            return Err(LayoutError::NoPanel { panel: layout.panel, last });
        }
        let origins = garment
            .panels
            .iter()
            .enumerate()
            .map(|(at, panel)| panel.bounds()[0] + layout_offset(fabric, at));
        let meshes = origins.map(|origin| StructureMesh::anchored_at(fabric, origin)).collect();
        let mut cloth = Self::without_yarns(garment, fabric, pattern, meshes);
        for panel in 0..garment.panels.len() {
            for bar in 0..fabric.yarn_systems() {
                cloth.plan_bar(fabric, panel, bar);
            }
        }
        Ok(cloth)
    }

    /// A swatch of `wales` yarns a bar and `courses` courses, without cut loops. Its panel is that
    /// of [`swatch_panel`].
    #[must_use]
    pub fn swatch(panel: &'a Garment, fabric: &Fabric, wales: u32, courses: u32) -> Self {
        Self::swatch_with(panel, fabric, Pattern::new(fabric), [wales, courses])
    }

    /// The same with a repeat of the fabric that is knitted already: `[wales, courses]`.
    #[must_use]
    pub fn swatch_with(
        panel: &'a Garment,
        fabric: &Fabric,
        pattern: Pattern,
        [wales, courses]: [u32; 2],
    ) -> Self {
        // One auxiliary wale on the left and half a course below: the first loops' feet and the
        // underlaps' turns extend beyond the pattern.
        let low = fabric.structure.lowest_gap();
        let corner = DVec2::new(
            (1.0 - f64::from(low)) * fabric.wale_spacing(),
            0.5 * fabric.course_spacing(),
        );
        let mesh = StructureMesh::anchored_at(fabric, corner);
        let mut cloth = Self::without_yarns(panel, fabric, pattern, vec![mesh]);
        let (wales, courses) = (i64::from(wales), i64::from(courses));
        for bar in 0..fabric.yarn_systems() {
            let (numbers, steps) =
                if cloth.pattern.runs_across(bar) { (courses, wales) } else { (wales, courses) };
            let numbers: Vec<_> =
                (0..numbers).filter(|&number| cloth.pattern.has_yarn(bar, number)).collect();
            cloth.plan_yarns(0, bar, numbers.into_iter().map(|number| (number, 0..steps)));
        }
        cloth
    }

    /// A cloth without yarns; they are planned next.
    fn without_yarns(
        garment: &'a Garment,
        fabric: &Fabric,
        pattern: Pattern,
        meshes: Vec<StructureMesh>,
    ) -> Self {
        let thickness = fabric.thickness();
        let strain = StrainTable::new(fabric, &pattern).map(Arc::new);
        Self {
            garment,
            pattern,
            strain,
            thickness,
            meshes,
            blocks: Vec::new(),
            yarns: 0,
            whole: None,
        }
    }

    /// The yarns of one part of the cloth, with the numbers that they have in the whole. A part
    /// consists of consecutive yarns. Parts have as nearly equal numbers of stitches as whole yarns
    /// allow: a yarn belongs to the part that holds its middle stitch.
    #[must_use]
    pub fn part(&self, tile: Tile) -> Self {
        // Positions are doubled, so that the middle of an odd number of stitches is an integer.
        let twice_all = 2 * self.stitches();
        let mut before = 0;
        let mut blocks = Vec::new();
        for block in &self.blocks {
            let mut is_own = |yarn: &YarnPlan| {
                let twice_middle = 2 * before + yarn.stitches();
                before += yarn.stitches();
                tile.holds(twice_middle, twice_all)
            };
            let (own, others): (Vec<_>, Vec<_>) =
                block.yarns.iter().cloned().partition(|yarn| is_own(yarn));
            for (is_beside, yarns) in [(false, own), (true, others)] {
                if !yarns.is_empty() {
                    blocks.push(BlockPlan { is_beside, yarns, ..*block });
                }
            }
        }
        // Yarns push their neighbours aside on their own panel only.
        let panels: Vec<_> =
            blocks.iter().filter(|block| !block.is_beside).map(|block| block.panel).collect();
        blocks.retain(|block| panels.binary_search(&block.panel).is_ok());
        let yarns = self.yarns;
        let (pattern, strain) = (self.pattern.clone(), self.strain.clone());
        let (thickness, meshes) = (self.thickness.clone(), self.meshes.clone());
        let whole = self.whole;
        Self { garment: self.garment, pattern, strain, thickness, meshes, blocks, yarns, whole }
    }

    /// The repeat of the fabric.
    #[must_use]
    pub fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// How the repeat changes with the cloth's strain. Nothing where it can't be relaxed.
    #[must_use]
    pub fn strain(&self) -> Option<&StrainTable> {
        self.strain.as_deref()
    }

    /// Number of planned stitches, including those that will turn out to lie off their panel.
    #[must_use]
    pub fn stitches(&self) -> u64 {
        self.own_blocks().map(BlockPlan::stitches).sum()
    }

    /// Stitches of the whole cloth of which this is a part, planned as in [`Self::stitches`].
    #[must_use]
    pub fn whole_stitches(&self) -> u64 {
        self.whole.unwrap_or_else(|| self.blocks.iter().map(BlockPlan::stitches).sum())
    }

    /// The blocks that [`run`] delivers.
    fn own_blocks(&self) -> impl Iterator<Item = &BlockPlan> {
        self.blocks.iter().filter(|block| !block.is_beside)
    }

    /// Whether its yarns are swept on the body. For a part that depends on the whole cloth.
    fn is_swept(&self, options: &DrapeOptions) -> bool {
        options.mapping == Mapping::Relaxed
            && self.strain.is_some()
            && options.sweeps.unwrap_or_else(|| self.whole_stitches() <= MAX_SWEPT_STITCHES)
    }

    /// Number of blocks that [`run`] will deliver.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.own_blocks().count()
    }

    /// Number of planned yarns, including those that will turn out to lie off their panel.
    #[must_use]
    pub fn yarns(&self) -> usize {
        self.own_blocks().map(|block| block.yarns.len()).sum()
    }

    /// The garment that the cloth covers.
    #[must_use]
    pub fn garment(&self) -> &'a Garment {
        self.garment
    }

    /// Plans the yarns of a bar that may touch a panel. Each is as long as the panel is within the
    /// yarn's strip.
    fn plan_bar(&mut self, fabric: &Fabric, panel: usize, bar: usize) {
        // Gap 0 of guide 0 lies half a wale to the left of wale 0.
        let origin = self.meshes[panel].origin - DVec2::new(fabric.wale_spacing() / 2.0, 0.0);
        let across = self.pattern.runs_across(bar);
        // From here on, x counts the yarns and y runs along them. Wefts run across the wales, so
        // for them the coordinates are swapped.
        let [low, high] =
            self.garment.panels[panel].bounds().map(|corner| along_yarns(corner - origin, across));
        let spacing = if across { fabric.course_spacing() } else { fabric.wale_spacing() };
        let place = |p: DVec2| along_yarns(p - origin, across) - low;
        let lengths = Lengths::new(&self.garment.panels[panel], place, spacing);
        let numbers = self.pattern.yarns_over(bar, low.x..high.x);
        let yarns: Vec<_> = numbers
            .filter_map(|number| {
                let strip = self.pattern.strip(bar, number);
                let along = lengths.along(strip.start - low.x..strip.end - low.x)?;
                Some((
                    number,
                    self.pattern.steps_along(bar, along.start + low.y..along.end + low.y),
                ))
            })
            .collect();
        self.plan_yarns(panel, bar, yarns);
    }

    /// Divides yarns into blocks of about [`BLOCK_STITCHES`] stitches. A yarn is never split.
    fn plan_yarns(
        &mut self,
        panel: usize,
        bar: usize,
        yarns: impl IntoIterator<Item = (i64, Range<i64>)>,
    ) {
        // Full from the start, so that the first yarn opens a block.
        let mut stitches = usize::MAX;
        for (guide, courses) in yarns {
            if stitches >= BLOCK_STITCHES {
                self.blocks.push(BlockPlan { panel, bar, is_beside: false, yarns: Vec::new() });
                stitches = 0;
            }
            stitches += usize::try_from(courses.end - courses.start).unwrap_or(0);
            let yarn = YarnPlan { id: YarnId(index32(self.yarns)), guide, courses };
            self.blocks.last_mut().expect("pushed above").yarns.push(yarn);
            self.yarns += 1;
        }
    }
}

/// A point with the coordinate along the yarns last: swapped for yarns that run across the wales.
fn along_yarns(p: DVec2, across: bool) -> DVec2 {
    if across { p.yx() } else { p }
}

/// The start of the fabric on a panel, relative to the panel's lowest-left corner.
///
/// The layout's origin is moved by whole repeats until it lies at the corner, or to the left of it
/// and below it. Then wales and courses count from 0 on, as they do without an origin.
fn layout_offset(fabric: &Fabric, panel: usize) -> DVec2 {
    let repeat = DVec2::new(
        f64::from(index32(fabric.threading_repeat())) * fabric.wale_spacing(),
        f64::from(index32(fabric.repeat())) * fabric.course_spacing(),
    );
    let origin = fabric
        .panels
        .iter()
        .find(|layout| layout.panel == panel)
        .map_or(DVec2::ZERO, |layout| layout.origin);
    -(-origin).rem_euclid(repeat)
}

/// The panel of a swatch. It is as large as the swatch's structure mesh, including auxiliary
/// vertices, plus half a course at both ends.
#[must_use]
pub fn swatch_panel(fabric: &Fabric, wales: u32, courses: u32) -> Garment {
    let (wales, courses) = vertices(fabric, wales, courses);
    Garment::rectangle(
        f64::from(wales) * fabric.wale_spacing(),
        f64::from(courses + 1) * fabric.course_spacing(),
    )
}

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
    /// The section of tubes, if they are wanted. Its radius is that of the thickest bar.
    pub surface: Option<Section>,
}

/// Consecutive yarns of one bar on one panel, after all stages.
#[derive(Clone, Debug, Default)]
pub struct Block {
    /// Index of the panel in [`Garment::panels`].
    pub panel: usize,
    /// Index of the bar, counted from the front.
    pub bar: usize,
    /// Flat data points of all its yarns, on the panel or not.
    pub knitted: Knitted,
    /// The parts of the yarns that lie on the panel.
    pub strands: Strands,
    /// The draped positions of the strands' points.
    pub draped: Draped,
    /// How many of these points lie where the cloth is strained too far.
    pub strain: StrainCounts,
    /// The strands' tubes, if they are wanted.
    pub tubes: Tubes,
    yarns: Vec<BlockYarn>,
    /// Whether it is only there for its neighbours' sake.
    is_beside: bool,
    /// The location of each data point of `knitted`.
    located: Vec<Option<SurfacePoint>>,
}

/// A yarn of a block.
#[derive(Clone, Debug)]
struct BlockYarn {
    id: YarnId,
    /// Its stitches in [`Block::knitted`].
    stitches: Range<usize>,
    /// The yarn of the repeat that it copies.
    copy: YarnCopy,
}

/// The stages that the pipeline announces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Building the search structures, once a run.
    Index,
    /// Data points on the flat fabric.
    Knit,
    /// The triangle of each data point, and clipping at the panel's edge.
    Locate,
    /// Solving the repeat for the strains of the garment.
    Strain,
    /// Draped positions.
    Map,
    /// Moving yarns apart on the body.
    Sweep,
    /// Tubes.
    Surface,
    /// Delivering blocks.
    Deliver,
}

/// Counts of what a run made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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
    announce(Stage::Strain, 0.0);
    let is_swept = cloth.is_swept(options);
    let body = Body::new(cloth.garment, cloth.strain(), options.mapping, is_swept, &mut |done| {
        announce(Stage::Strain, done);
    });
    let (mut strain, mut spare) = (StrainCounts::default(), Vec::new());
    let mut totals = knit_and_locate(cloth, options, announce, &mut |blocks, announce, done| {
        strain += map_blocks(blocks, &body, &mut |stage| announce(stage, done));
        let mut announce = |stage| announce(stage, done);
        deliver_blocks(blocks, &mut spare, &cloth.thickness, options, &mut announce, deliver)
    })?;
    totals.strain = strain;
    Ok(totals)
}

/// Called at the start of each stage, with the share of blocks that are done.
type Announce<'a> = dyn FnMut(Stage, f64) + 'a;

/// Called with the located blocks of a window. It announces the later stages itself; the number is
/// the share of blocks that are done.
type TakeLocated<'a, E> = dyn FnMut(&mut [Block], &mut Announce<'_>, f64) -> Result<(), E> + 'a;

/// Knits and locates all yarns, window by window, and passes each window to `take`.
fn knit_and_locate<E>(
    cloth: &Cloth<'_>,
    options: &DrapeOptions,
    announce: &mut Announce<'_>,
    take: &mut TakeLocated<'_, E>,
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
        let fitting = match is_swept {
            true => rest.iter().take_while(|plan| plan.panel == rest[0].panel).count(),
            false => window_len(rest.iter().map(|plan| plan.stitches()), options.surface.as_ref()),
        };
        let (plans, later) = rest.split_at(fitting);
        rest = later;
        blocks.resize_with(blocks.len().max(fitting), Block::default);
        let blocks = &mut blocks[..fitting];
        announce(Stage::Knit, done);
        blocks.par_iter_mut().zip(plans).for_each(|(block, plan)| block.knit(cloth, plan));
        announce(Stage::Locate, done);
        blocks.par_iter_mut().for_each(|block| block.locate(&locators[block.panel], options.edge));
        let own = blocks.iter().filter(|block| !block.is_beside);
        own.for_each(|block| totals.add(block, options.edge));
        take(blocks, announce, done)?;
    }
    Ok(totals)
}

/// Maps located blocks to the draped garment. Blocks of a swept garment are those of a whole panel.
fn map_blocks(
    blocks: &mut [Block],
    body: &Body<'_>,
    announce: &mut dyn FnMut(Stage),
) -> StrainCounts {
    announce(Stage::Map);
    blocks.par_iter_mut().for_each(|block| block.map(body));
    if let Some(neighbours) = body.swept() {
        announce(Stage::Sweep);
        sweeps::sweep(blocks, neighbours);
    }
    let mut strain = StrainCounts::default();
    blocks.iter().filter(|block| !block.is_beside).for_each(|block| strain += block.strain);
    strain
}

/// Delivers mapped blocks, with tubes if they are wanted. `spare` is memory for tubes that all
/// windows share, so that tubes of one window exist at a time.
fn deliver_blocks<E>(
    blocks: &mut [Block],
    spare: &mut Vec<Tubes>,
    thickness: &[f64],
    options: &DrapeOptions,
    announce: &mut dyn FnMut(Stage),
    deliver: &mut dyn FnMut(&[Block]) -> Result<(), E>,
) -> Result<(), E> {
    let alike = |one: &Block, next: &Block| one.is_beside == next.is_beside;
    for own in blocks.chunk_by_mut(alike).filter(|blocks| !blocks[0].is_beside) {
        let mut rest = own;
        while !rest.is_empty() {
            let fitting = window_len(rest.iter().map(Block::stitches), options.surface.as_ref());
            let (window, later) = rest.split_at_mut(fitting);
            rest = later;
            if let Some(section) = &options.surface {
                announce(Stage::Surface);
                spare.resize_with(spare.len().max(window.len()), Tubes::default);
                window.par_iter_mut().zip(spare.par_iter_mut()).for_each(|(block, spare)| {
                    std::mem::swap(&mut block.tubes, spare);
                    block.add_tubes(section, thickness[block.bar]);
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

/// The number of the next blocks that fit in a window, given the stitches of each.
fn window_len(stitches: impl Iterator<Item = u64>, surface: Option<&Section>) -> usize {
    // A vertex takes 32 bytes and a triangle 12. The factor of 4 leaves room for the bytes or the
    // text into which a writer turns them.
    let (vertices, triangles) = surface.map_or((0, 0), |section| section.size_of(1, 1));
    let stitch = STITCH_BYTES + 4 * (32 * vertices + 12 * triangles);
    let most = (THREAD_BLOCKS * rayon::current_num_threads()).min(MAX_BLOCKS);
    let mut bytes = 0;
    let fitting = stitches.take(most).take_while(|&stitches| {
        bytes += stitch.saturating_mul(usize::try_from(stitches).unwrap_or(usize::MAX));
        bytes <= WINDOW_BYTES
    });
    // A block that is larger than the window goes through it alone.
    fitting.count().max(1)
}

impl YarnPlan {
    fn stitches(&self) -> u64 {
        u64::try_from(self.courses.end - self.courses.start).unwrap_or(0)
    }
}

impl BlockPlan {
    fn stitches(&self) -> u64 {
        self.yarns.iter().map(YarnPlan::stitches).sum()
    }
}

impl Block {
    fn stitches(&self) -> u64 {
        self.knitted.stitches.len() as u64
    }

    /// The data points of some stitches in `knitted`.
    fn points_of(&self, stitches: &Range<usize>) -> Range<usize> {
        let [start, end] = [stitches.start, stitches.end].map(|stitch| {
            let points = self.knitted.points.len();
            self.knitted.stitches.get(stitch).map_or(points, |&point| point as usize)
        });
        start..end
    }

    /// Knits, locates and maps the planned yarns.
    fn lay(
        &mut self,
        cloth: &Cloth<'_>,
        plan: &BlockPlan,
        locator: &Locator<'_>,
        body: &Body<'_>,
        edge: Edge,
    ) {
        self.knit(cloth, plan);
        self.locate(locator, edge);
        self.map(body);
    }

    /// Computes the flat data points of the planned yarns.
    fn knit(&mut self, cloth: &Cloth<'_>, plan: &BlockPlan) {
        (self.panel, self.bar, self.is_beside) = (plan.panel, plan.bar, plan.is_beside);
        self.knitted.clear();
        self.yarns.clear();
        for yarn in &plan.yarns {
            let first = self.knitted.stitches.len();
            let mesh = &cloth.meshes[plan.panel];
            cloth.pattern.lay(plan.bar, yarn.guide, yarn.courses.clone(), mesh, &mut self.knitted);
            let copy = cloth.pattern.copy(plan.bar, yarn.guide, yarn.courses.start);
            self.yarns.extend(copy.map(|copy| BlockYarn {
                id: yarn.id,
                stitches: first..self.knitted.stitches.len(),
                copy,
            }));
        }
    }

    /// Locates the data points on the panel and clips the yarns at its edge.
    fn locate(&mut self, locator: &Locator<'_>, edge: Edge) {
        locator.locate_into(&self.knitted.points, &mut self.located);
        self.strands.clear();
        for yarn in &self.yarns {
            self.strands.add_yarn(
                yarn.id,
                &self.knitted,
                yarn.stitches.clone(),
                &self.located,
                locator,
                edge,
            );
        }
    }

    /// Maps the strands' points to the draped panel.
    fn map(&mut self, body: &Body<'_>) {
        let Self { strands, knitted, draped, .. } = self;
        self.strain = body.map(self.panel, strands, knitted, draped);
    }

    /// Makes the strands' tubes. `thickness` is the bar's radius relative to the section's.
    fn add_tubes(&mut self, section: &Section, thickness: f64) {
        let section = &Section { radius: section.radius * thickness, ..*section };
        self.tubes.clear();
        self.tubes.reserve(self.strands.pieces.len(), self.strands.strands.len(), section);
        for strand in &self.strands.strands {
            let (positions, normals) =
                (&self.draped.positions[strand.range()], &self.draped.normals[strand.range()]);
            self.tubes.add(positions, normals, self.strands.pieces_of(strand), section);
        }
    }
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
