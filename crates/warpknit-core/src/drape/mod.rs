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

pub mod clearance;
pub mod fibres;
mod lengths;
pub mod sequence;
pub mod strands;

use std::ops::Range;

use glam::{DVec2, Vec2Swizzles};
use rayon::prelude::*;

use crate::fabric::Fabric;
use crate::garment::{Garment, Panel};
use crate::ids::{YarnId, index32};
use crate::knit::mesh::{StructureMesh, vertices};
use crate::knit::{Knitted, Pattern};
use crate::locate::{Locator, SurfacePoint};
use crate::map::{Draped, Mapping, map_into};
use crate::tile::Tile;
use crate::yarn::tube::{Section, Tubes};
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
    yarns: Vec<YarnPlan>,
}

/// A fabric laid out over a garment: the plan of all its yarns.
#[derive(Debug)]
pub struct Cloth<'a> {
    garment: &'a Garment,
    pattern: Pattern,
    /// Each bar's drawn radius relative to that of the thickest bar.
    thickness: Vec<f64>,
    /// The structure mesh of each panel.
    meshes: Vec<StructureMesh>,
    blocks: Vec<BlockPlan>,
    yarns: usize,
}

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
        Self { garment, pattern, thickness, meshes, blocks: Vec::new(), yarns: 0 }
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
            let mut own = BlockPlan { yarns: Vec::new(), ..*block };
            for yarn in &block.yarns {
                let twice_middle = 2 * before + yarn.stitches();
                before += yarn.stitches();
                if tile.holds(twice_middle, twice_all) {
                    own.yarns.push(yarn.clone());
                }
            }
            if !own.yarns.is_empty() {
                blocks.push(own);
            }
        }
        let yarns = blocks.iter().map(|block| block.yarns.len()).sum();
        let (pattern, thickness, meshes) =
            (self.pattern.clone(), self.thickness.clone(), self.meshes.clone());
        Self { garment: self.garment, pattern, thickness, meshes, blocks, yarns }
    }

    /// The repeat of the fabric.
    #[must_use]
    pub fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// Number of planned stitches, including those that will turn out to lie off their panel.
    #[must_use]
    pub fn stitches(&self) -> u64 {
        self.blocks.iter().map(BlockPlan::stitches).sum()
    }

    /// Number of blocks that [`run`] will deliver.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.blocks.len()
    }

    /// Number of planned yarns, including those that will turn out to lie off their panel.
    #[must_use]
    pub fn yarns(&self) -> usize {
        self.blocks.iter().map(|block| block.yarns.len()).sum()
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
                self.blocks.push(BlockPlan { panel, bar, yarns: Vec::new() });
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
    /// The strands' tubes, if they are wanted.
    pub tubes: Tubes,
    /// Each yarn with its stitches in `knitted`.
    yarns: Vec<(YarnId, Range<usize>)>,
    /// The location of each data point of `knitted`.
    located: Vec<Option<SurfacePoint>>,
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
    /// Draped positions.
    Map,
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
}

/// Runs the pipeline, and delivers windows of blocks in yarn order.
///
/// `announce` is called at the start of each stage, with the share of blocks that are done. A
/// program can time stages or draw a progress bar with it.
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
    knit_and_locate(cloth, options, announce, &mut |blocks, announce, done| {
        drape_blocks(blocks, cloth.garment, &cloth.thickness, options, &mut |stage| {
            announce(stage, done);
        });
        announce(Stage::Deliver, done);
        deliver(blocks)
    })
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
    blocks.resize_with(cloth.blocks.len().min(MAX_BLOCKS), Block::default);
    let mut totals = Totals::default();
    let mut rest = cloth.blocks.as_slice();
    while !rest.is_empty() {
        let done = 1.0 - f64::from(index32(rest.len())) / f64::from(index32(cloth.blocks.len()));
        let (plans, later) = rest
            .split_at(window_len(rest.iter().map(BlockPlan::stitches), options.surface.as_ref()));
        rest = later;
        let blocks = &mut blocks[..plans.len()];
        announce(Stage::Knit, done);
        blocks.par_iter_mut().zip(plans).for_each(|(block, plan)| block.knit(cloth, plan));
        announce(Stage::Locate, done);
        blocks.par_iter_mut().for_each(|block| block.locate(&locators[block.panel], options.edge));
        blocks.iter().for_each(|block| totals.add(block, options.edge));
        take(blocks, announce, done)?;
    }
    Ok(totals)
}

/// Maps located blocks to the draped garment, and adds their tubes if they are wanted.
fn drape_blocks(
    blocks: &mut [Block],
    garment: &Garment,
    thickness: &[f64],
    options: &DrapeOptions,
    announce: &mut dyn FnMut(Stage),
) {
    announce(Stage::Map);
    blocks
        .par_iter_mut()
        .for_each(|block| block.map(&garment.panels[block.panel], options.mapping));
    if let Some(section) = &options.surface {
        announce(Stage::Surface);
        blocks.par_iter_mut().for_each(|block| block.add_tubes(section, thickness[block.bar]));
    }
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
    /// Knits, locates and maps the planned yarns.
    fn lay(
        &mut self,
        cloth: &Cloth<'_>,
        plan: &BlockPlan,
        locator: &Locator<'_>,
        options: &DrapeOptions,
    ) {
        self.knit(cloth, plan);
        self.locate(locator, options.edge);
        self.map(&cloth.garment.panels[self.panel], options.mapping);
    }

    /// Computes the flat data points of the planned yarns.
    fn knit(&mut self, cloth: &Cloth<'_>, plan: &BlockPlan) {
        (self.panel, self.bar) = (plan.panel, plan.bar);
        self.knitted.clear();
        self.yarns.clear();
        for yarn in &plan.yarns {
            let first = self.knitted.stitches.len();
            let mesh = &cloth.meshes[plan.panel];
            cloth.pattern.lay(plan.bar, yarn.guide, yarn.courses.clone(), mesh, &mut self.knitted);
            self.yarns.push((yarn.id, first..self.knitted.stitches.len()));
        }
    }

    /// Locates the data points on the panel and clips the yarns at its edge.
    fn locate(&mut self, locator: &Locator<'_>, edge: Edge) {
        locator.locate_into(&self.knitted.points, &mut self.located);
        self.strands.clear();
        for (yarn, stitches) in &self.yarns {
            self.strands.add_yarn(
                *yarn,
                &self.knitted,
                stitches.clone(),
                &self.located,
                locator,
                edge,
            );
        }
    }

    /// Maps the strands' points to the draped panel.
    fn map(&mut self, panel: &Panel, mapping: Mapping) {
        map_into(panel, &self.strands.flat, &self.strands.located, mapping, &mut self.draped);
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
