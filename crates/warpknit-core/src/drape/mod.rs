//! The pipeline: from a garment and a fabric to yarns on the body, block by block.
//!
//! In: a [`Garment`] and a [`Fabric`]. Out: [`Block`]s of consecutive yarns, handed in yarn order
//! to whoever wants them ([`run`]). A block is knitted, located, cut at the panel's edge, mapped
//! and, if asked, given a surface; then its memory serves the next one. So memory is bounded by a
//! window of blocks, not by the fabric. Blocks of a window are worked on in parallel, stage by
//! stage; each yarn depends on nothing but itself, so the result is the same for any number of
//! threads.

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

/// Stitches after which a block ends: enough work for a thread to be worth handing out, few enough
/// to stay in its cache.
const BLOCK_STITCHES: usize = 512;
/// Blocks in the window for each thread: enough to keep all of them busy, few enough that what they
/// hold is used again before it is cold.
const THREAD_BLOCKS: usize = 4;
/// The most blocks in the window.
const MOST_BLOCKS: usize = 64;
/// What the window may take, bytes; it holds one block in any case, and a block one yarn.
const WINDOW_BYTES: usize = 256 << 20;
/// What a stitch takes without its surface, bytes: some ten points in all of a block's arrays.
const STITCH_BYTES: usize = 2500;
/// The most wales or courses of a panel. A garment at true gauge has some thousand.
const MOST_SPACINGS: f64 = 1e6;

/// Why a fabric can't be laid out over a garment.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LayoutError {
    /// A panel of over a million wales or courses.
    #[error(
        "panel {panel} is {width:.3e} x {height:.3e} mm and would take over a million wales or courses: check --unit, or lower the densities"
    )]
    TooLarge {
        /// The panel, from 0.
        panel: usize,
        /// Its width, mm.
        width: f64,
        /// Its height, mm.
        height: f64,
    },
    /// The fabric lays out a panel that isn't there.
    #[error(
        "the fabric has a [[panels]] table for panel {panel}, but the garment's panels are numbered 0 to {last}: `inspect` lists them"
    )]
    NoPanel {
        /// The panel, from 0.
        panel: usize,
        /// The garment's last panel.
        last: usize,
    },
}

/// One yarn to be laid.
#[derive(Clone, Debug)]
struct Job {
    yarn: YarnId,
    guide: i64,
    courses: Range<i64>,
}

/// Consecutive yarns of one bar on one panel.
#[derive(Clone, Debug)]
struct BlockPlan {
    panel: usize,
    bar: usize,
    jobs: Vec<Job>,
}

/// A fabric laid out over a garment: which yarns there are, and where.
#[derive(Debug)]
pub struct Cloth<'a> {
    garment: &'a Garment,
    pattern: Pattern,
    /// Each bar's drawn radius over the thickest one's.
    thickness: Vec<f64>,
    /// One structure mesh a panel.
    meshes: Vec<StructureMesh>,
    blocks: Vec<BlockPlan>,
    yarns: usize,
}

impl<'a> Cloth<'a> {
    /// Covers every panel, from the lowest-left corner of its bounding box along the grain, or from
    /// where the fabric's layout of that panel says. Panels are as they were turned: their layouts'
    /// grain is for [`Garment::turn_grain`], before.
    ///
    /// # Errors
    /// A panel that would take more stitches than any garment has, or a layout of a panel that
    /// isn't there.
    pub fn cover(garment: &'a Garment, fabric: &Fabric) -> Result<Self, LayoutError> {
        for (panel, size) in garment.panels.iter().map(Panel::size).enumerate() {
            if size.x > MOST_SPACINGS * fabric.wale_spacing()
                || size.y > MOST_SPACINGS * fabric.course_spacing()
            {
                return Err(LayoutError::TooLarge { panel, width: size.x, height: size.y });
            }
        }
        let last = garment.panels.len().saturating_sub(1);
        if let Some(layout) = fabric.panels.iter().find(|layout| layout.panel > last) {
            return Err(LayoutError::NoPanel { panel: layout.panel, last });
        }
        let corners = garment
            .panels
            .iter()
            .enumerate()
            .map(|(at, panel)| panel.bounds()[0] + shift(fabric, at));
        let meshes = corners.map(|corner| StructureMesh::anchored_at(fabric, corner)).collect();
        let mut cloth = Self::bare(garment, fabric, meshes);
        for panel in 0..garment.panels.len() {
            for bar in 0..fabric.yarn_systems() {
                cloth.plan_bar(fabric, panel, bar);
            }
        }
        Ok(cloth)
    }

    /// A swatch of `wales` yarns a bar and `courses` courses, all of its loops whole, on the panel
    /// that [`swatch_panel`] gives.
    #[must_use]
    pub fn swatch(panel: &'a Garment, fabric: &Fabric, wales: u32, courses: u32) -> Self {
        // One auxiliary wale on the left and half a course below: the first yarn's feet and turns
        // reach out of the pattern.
        let low = fabric.structure.lowest_gap();
        let corner = DVec2::new(
            (1.0 - f64::from(low)) * fabric.wale_spacing(),
            0.5 * fabric.course_spacing(),
        );
        let mut cloth = Self::bare(panel, fabric, vec![StructureMesh::anchored_at(fabric, corner)]);
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

    /// No yarn planned yet.
    fn bare(garment: &'a Garment, fabric: &Fabric, meshes: Vec<StructureMesh>) -> Self {
        let (pattern, thickness) = (Pattern::new(fabric), fabric.thickness());
        Self { garment, pattern, thickness, meshes, blocks: Vec::new(), yarns: 0 }
    }

    /// One part's yarns, numbered as they are in the whole. Parts are of consecutive yarns and as
    /// even as whole yarns allow: a yarn is where its middle stitch is.
    #[must_use]
    pub fn part(&self, tile: Tile) -> Self {
        let twice_all = 2 * self.stitches();
        let mut before = 0;
        let mut is_own = |job: &Job| {
            let twice_middle = 2 * before + job.stitches();
            before += job.stitches();
            tile.holds(twice_middle, twice_all)
        };
        let own = |block: &BlockPlan| BlockPlan {
            jobs: block.jobs.iter().filter(|job| is_own(job)).cloned().collect(),
            ..*block
        };
        let blocks: Vec<_> =
            self.blocks.iter().map(own).filter(|block| !block.jobs.is_empty()).collect();
        let yarns = blocks.iter().map(|block| block.jobs.len()).sum();
        let (pattern, thickness, meshes) =
            (self.pattern.clone(), self.thickness.clone(), self.meshes.clone());
        Self { garment: self.garment, pattern, thickness, meshes, blocks, yarns }
    }

    /// The repeat that is laid.
    #[must_use]
    pub fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// Stitches planned, those that turn out to miss their panel included.
    #[must_use]
    pub fn stitches(&self) -> u64 {
        self.blocks.iter().map(BlockPlan::stitches).sum()
    }

    /// Blocks that [`run`] will hand over.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.blocks.len()
    }

    /// Yarns planned, those that turn out to miss their panel included; one that is cut into blocks
    /// counts in each.
    #[must_use]
    pub fn yarns(&self) -> usize {
        self.blocks.iter().map(|block| block.jobs.len()).sum()
    }

    /// The garment beneath.
    #[must_use]
    pub fn garment(&self) -> &'a Garment {
        self.garment
    }

    /// Plans the yarns of a bar that may touch a panel, each no longer than the panel is in its
    /// strip.
    fn plan_bar(&mut self, fabric: &Fabric, panel: usize, bar: usize) {
        // Gap 0 of guide 0 lies half a wale to the left of wale 0.
        let origin = self.meshes[panel].origin - DVec2::new(fabric.wale_spacing() / 2.0, 0.0);
        let across = self.pattern.runs_across(bar);
        // From here on x is where a yarn lies and y where it runs.
        let turned = |p: DVec2| if across { p.yx() } else { p };
        let [low, high] = self.garment.panels[panel].bounds().map(|corner| turned(corner - origin));
        let spacing = if across { fabric.course_spacing() } else { fabric.wale_spacing() };
        let lengths =
            Lengths::new(&self.garment.panels[panel], |p| turned(p - origin) - low, spacing);
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

    /// Shares yarns out among blocks.
    fn plan_yarns(
        &mut self,
        panel: usize,
        bar: usize,
        yarns: impl IntoIterator<Item = (i64, Range<i64>)>,
    ) {
        let mut stitches = usize::MAX;
        for (guide, courses) in yarns {
            if stitches >= BLOCK_STITCHES {
                self.blocks.push(BlockPlan { panel, bar, jobs: Vec::new() });
                stitches = 0;
            }
            stitches += usize::try_from(courses.end - courses.start).unwrap_or(0);
            let job = Job { yarn: YarnId(index32(self.yarns)), guide, courses };
            self.blocks.last_mut().expect("pushed above").jobs.push(job);
            self.yarns += 1;
        }
    }
}

/// Where the fabric starts on a panel, from its lowest-left corner: its origin, moved by whole
/// repeats to the corner or to the left of and below it, so that wales and courses count from 0 on
/// as they do without an origin.
fn shift(fabric: &Fabric, panel: usize) -> DVec2 {
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

/// The panel of a swatch: as large as its structure mesh, auxiliary vertices included, and half a
/// course more at both ends.
#[must_use]
pub fn swatch_panel(fabric: &Fabric, wales: u32, courses: u32) -> Garment {
    let (wales, courses) = vertices(fabric, wales, courses);
    Garment::rectangle(
        f64::from(wales) * fabric.wale_spacing(),
        f64::from(courses + 1) * fabric.course_spacing(),
    )
}

/// How the pipeline is to run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// How depth is carried along.
    pub mapping: Mapping,
    /// What happens at the panel's edge.
    pub edge: Edge,
    /// Tubes, if someone wants them; the radius is the thickest bar's.
    pub surface: Option<Section>,
}

/// Some consecutive yarns of one bar on one panel, after all stages.
#[derive(Clone, Debug, Default)]
pub struct Block {
    /// Index of the panel in [`Garment::panels`].
    pub panel: usize,
    /// Index of the bar, front first.
    pub bar: usize,
    /// Flat data points of all its yarns, on the panel or not.
    pub knitted: Knitted,
    /// What of them is on the panel.
    pub strands: Strands,
    /// The strands' points, draped.
    pub draped: Draped,
    /// The strands' surfaces, where asked for.
    pub tubes: Tubes,
    /// Yarns with their stitches in `knitted`.
    yarns: Vec<(YarnId, Range<usize>)>,
    located: Vec<Option<SurfacePoint>>,
}

/// The stages that the pipeline announces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Building what the other stages search in, once a run.
    Index,
    /// Data points on the flat fabric.
    Knit,
    /// The triangle of each, and the cut at the edge.
    Locate,
    /// Draped positions.
    Map,
    /// Tubes.
    Surface,
    /// Handing blocks over.
    Deliver,
}

/// What was made.
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
    /// What edges and defects took.
    pub losses: Losses,
}

/// Runs the pipeline, handing windows of blocks to `deliver` in yarn order.
///
/// `announce` hears of each stage as it begins, with the share of yarns that are done: a program
/// can time stages or draw a progress bar by it.
///
/// # Errors
/// The first error of `deliver`, at once.
///
/// ```
/// use warpknit_core::{drape, fabric::Fabric};
/// let fabric = Fabric::named("tricot")?;
/// let panel = drape::swatch_panel(&fabric, 8, 10);
/// let cloth = drape::Cloth::swatch(&panel, &fabric, 8, 10);
/// let totals = drape::run(&cloth, &drape::Options::default(), &mut |_, _| {}, &mut |_| Ok::<_, std::io::Error>(()))?;
/// assert_eq!(totals.losses.stitches, 2 * 8 * 10);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run<E>(
    cloth: &Cloth<'_>,
    options: &Options,
    announce: &mut dyn FnMut(Stage, f64),
    deliver: &mut dyn FnMut(&[Block]) -> Result<(), E>,
) -> Result<Totals, E> {
    lay(cloth, options, announce, &mut |blocks, announce, done| {
        clothe(blocks, cloth.garment, &cloth.thickness, options, &mut |stage| {
            announce(stage, done);
        });
        announce(Stage::Deliver, done);
        deliver(blocks)
    })
}

/// Who hears of each stage, with the share of yarns that are done.
type Announce<'a> = dyn FnMut(Stage, f64) + 'a;

/// Who takes the located blocks of a window, tells of what is done with them, and knows the share
/// of yarns that are done.
type HandOn<'a, E> = dyn FnMut(&mut [Block], &mut Announce<'_>, f64) -> Result<(), E> + 'a;

/// Knits and locates, handing windows of blocks on.
fn lay<E>(
    cloth: &Cloth<'_>,
    options: &Options,
    announce: &mut Announce<'_>,
    hand_on: &mut HandOn<'_, E>,
) -> Result<Totals, E> {
    announce(Stage::Index, 0.0);
    let locators: Vec<_> = cloth.garment.panels.par_iter().map(Locator::new).collect();
    let mut blocks: Vec<Block> = Vec::new();
    blocks.resize_with(cloth.blocks.len().min(MOST_BLOCKS), Block::default);
    let mut totals = Totals::default();
    let mut rest = cloth.blocks.as_slice();
    while !rest.is_empty() {
        let done = 1.0 - f64::from(index32(rest.len())) / f64::from(index32(cloth.blocks.len()));
        let (plans, later) =
            rest.split_at(window(rest.iter().map(BlockPlan::stitches), options.surface.as_ref()));
        rest = later;
        let blocks = &mut blocks[..plans.len()];
        announce(Stage::Knit, done);
        blocks.par_iter_mut().zip(plans).for_each(|(block, plan)| block.knit(cloth, plan));
        announce(Stage::Locate, done);
        blocks.par_iter_mut().for_each(|block| block.locate(&locators[block.panel], options.edge));
        blocks.iter().for_each(|block| totals.add(block, options.edge));
        hand_on(blocks, announce, done)?;
    }
    Ok(totals)
}

/// Maps located blocks to where the garment is, and gives them surfaces if asked to.
fn clothe(
    blocks: &mut [Block],
    garment: &Garment,
    thickness: &[f64],
    options: &Options,
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

/// How many of the next blocks, of so many stitches each, fit the window.
fn window(stitches: impl Iterator<Item = u64>, surface: Option<&Section>) -> usize {
    // A surface is held once, and again as bytes or text on its way to a file.
    let (vertices, triangles) = surface.map_or((0, 0), |section| section.size_of(1, 1));
    let stitch = STITCH_BYTES + 4 * (32 * vertices + 12 * triangles);
    let most = (THREAD_BLOCKS * rayon::current_num_threads()).min(MOST_BLOCKS);
    let mut bytes = 0;
    let fits = |&stitches: &u64| {
        bytes += stitch.saturating_mul(usize::try_from(stitches).unwrap_or(usize::MAX));
        bytes <= WINDOW_BYTES
    };
    stitches.take(most).take_while(fits).count().max(1)
}

impl Job {
    fn stitches(&self) -> u64 {
        u64::try_from(self.courses.end - self.courses.start).unwrap_or(0)
    }
}

impl BlockPlan {
    fn stitches(&self) -> u64 {
        self.jobs.iter().map(Job::stitches).sum()
    }
}

impl Block {
    fn knit(&mut self, cloth: &Cloth<'_>, plan: &BlockPlan) {
        (self.panel, self.bar) = (plan.panel, plan.bar);
        self.knitted.clear();
        self.yarns.clear();
        for job in &plan.jobs {
            let first = self.knitted.stitches.len();
            let mesh = &cloth.meshes[plan.panel];
            cloth.pattern.lay(plan.bar, job.guide, job.courses.clone(), mesh, &mut self.knitted);
            self.yarns.push((job.yarn, first..self.knitted.stitches.len()));
        }
    }

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

    fn map(&mut self, panel: &Panel, mapping: Mapping) {
        map_into(panel, &self.strands.flat, &self.strands.located, mapping, &mut self.draped);
    }

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
        if edge == Edge::Drop {
            self.losses.stitches -= strands.losses.clipped;
        }
    }
}
