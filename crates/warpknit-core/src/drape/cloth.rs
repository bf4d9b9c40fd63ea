//! A fabric laid out over a garment: the plan of all its yarns.
//!
//! In: a [`Garment`] and a [`Fabric`]. Out: a [`Cloth`], the blocks of yarns that may touch each panel
//! and how far each yarn runs. Nothing is knitted yet.
//!
//! Cost: some nanoseconds a triangle and a yarn. Not promised: that every planned stitch lies on its
//! panel; clipping decides that.

use std::ops::Range;
use std::sync::Arc;

use glam::{DVec2, Vec2Swizzles};

use super::DrapeOptions;
use super::lengths::Lengths;
use crate::fabric::Fabric;
use crate::garment::{Garment, Panel};
use crate::ids::{YarnId, index32};
use crate::knit::Pattern;
use crate::knit::mesh::{StructureMesh, vertices};
use crate::knit::spread::Spread;
use crate::knit::strain::StrainTable;
use crate::map::Mapping;
use crate::tile::Tile;

/// Stitches after which a block ends. Much smaller blocks would cost more in scheduling than in
/// work; much larger ones would not stay in a core's cache from knitting to mapping, and would
/// divide a small fabric among too few threads.
pub(super) const BLOCK_STITCHES: usize = 512;
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
pub(super) struct YarnPlan {
    pub(super) id: YarnId,
    pub(super) guide: i64,
    pub(super) courses: Range<i64>,
}

/// Consecutive yarns of one bar on one panel.
#[derive(Clone, Debug)]
pub(super) struct BlockPlan {
    pub(super) panel: usize,
    pub(super) bar: usize,
    /// Whether its yarns belong to another part of the cloth, and only lie beside this part's.
    pub(super) is_beside: bool,
    pub(super) yarns: Vec<YarnPlan>,
}

impl YarnPlan {
    pub(super) fn stitches(&self) -> u64 {
        u64::try_from(self.courses.end - self.courses.start).unwrap_or(0)
    }
}

impl BlockPlan {
    pub(super) fn stitches(&self) -> u64 {
        self.yarns.iter().map(YarnPlan::stitches).sum()
    }
}

/// A fabric laid out over a garment: the plan of all its yarns.
#[derive(Debug)]
pub struct Cloth<'a> {
    pub(super) garment: &'a Garment,
    pub(super) pattern: Pattern,
    /// How the repeat changes with the cloth's strain. `None` where it can't be relaxed.
    pub(super) strain: Option<Arc<StrainTable>>,
    /// Each bar's drawn radius relative to that of the thickest bar.
    pub(super) thickness: Vec<f64>,
    /// How flat its yarns lie. `None` where a section's ratio tells.
    pub(super) spread: Option<Arc<Spread>>,
    /// The structure mesh of each panel.
    pub(super) meshes: Vec<StructureMesh>,
    pub(super) blocks: Vec<BlockPlan>,
    pub(super) yarns: usize,
    /// Stitches of the whole cloth. `None` unless this is a part of it, or what pictures see of it.
    pub(super) whole: Option<u64>,
}

/// The most stitches whose yarns are swept on the body unless that is asked for. All yarns of a
/// panel are in memory then, some kilobytes a stitch.
pub const MAX_SWEPT_STITCHES: u64 = 1_000_000;

impl<'a> Cloth<'a> {
    /// Covers every panel. The fabric starts at the lowest-left corner of the panel's bounding box
    /// along the grain, or at the origin that the fabric's layout of that panel gives. A layout's
    /// sides and grain are not applied here: the caller has turned the panels by
    /// [`Garment::turn_over`] and [`Garment::turn_grain`].
    ///
    /// # Errors
    /// A panel that would take more stitches than any garment has, or a layout of a panel that
    /// doesn't exist.
    pub fn cover(garment: &'a Garment, fabric: &Fabric) -> Result<Self, LayoutError> {
        Self::cover_with(garment, fabric, Pattern::new(fabric))
    }

    /// Refuses panels that would take more stitches than any garment has.
    ///
    /// # Errors
    /// [`LayoutError::TooLarge`].
    pub fn check_sizes(garment: &Garment, fabric: &Fabric) -> Result<(), LayoutError> {
        for (panel, size) in garment.panels.iter().map(Panel::size).enumerate() {
            if size.x > MAX_SPACINGS * fabric.wale_spacing()
                || size.y > MAX_SPACINGS * fabric.course_spacing()
            {
                return Err(LayoutError::TooLarge { panel, width: size.x, height: size.y });
            }
        }
        Ok(())
    }

    /// Checks that the garment has all panels of which the fabric says how it lies there.
    ///
    /// # Errors
    /// [`LayoutError::NoPanel`].
    pub fn check_panels(garment: &Garment, fabric: &Fabric) -> Result<(), LayoutError> {
        let own = garment.panels.iter().filter(|panel| panel.turned_in.is_none());
        let last = own.count().saturating_sub(1);
        match fabric.panels.iter().find(|layout| layout.panel > last) {
            Some(layout) => Err(LayoutError::NoPanel { panel: layout.panel, last }),
            None => Ok(()),
        }
    }

    /// [`Self::cover`] with a repeat of the fabric that is knitted already.
    ///
    /// # Errors
    /// Those of [`Self::cover`].
    pub fn cover_with(
        garment: &'a Garment,
        fabric: &Fabric,
        pattern: Pattern,
    ) -> Result<Self, LayoutError> {
        Self::check_sizes(garment, fabric)?;
        Self::check_panels(garment, fabric)?;
        let corner = |panel: &Panel| panel.bounds()[0];
        let origins = garment.panels.iter().enumerate().map(|(at, panel)| {
            match panel.turned_in.and_then(|at| garment.panels.get(at).zip(Some(at))) {
                None => corner(panel) + layout_offset(fabric, at),
                // Cloth that is turned in goes on where its panel ends.
                Some((front, at)) => {
                    let origin = corner(front) + layout_offset(fabric, at) - corner(panel);
                    corner(panel) - (-origin).rem_euclid(repeat_of(fabric))
                }
            }
        });
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
            spread: None,
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
            let is_beside = block.yarns.iter().map(|yarn| {
                let twice_middle = 2 * before + yarn.stitches();
                before += yarn.stitches();
                !tile.holds(twice_middle, twice_all)
            });
            let marked: Vec<_> = is_beside.zip(block.yarns.iter().cloned()).collect();
            // Yarns stay in order, so that sums over those near a yarn are those of the whole.
            for run in marked.chunk_by(|(one, _), (next, _)| one == next) {
                let yarns = run.iter().map(|(_, yarn)| yarn.clone()).collect();
                blocks.push(BlockPlan { is_beside: run[0].0, yarns, ..*block });
            }
        }
        // Yarns push their neighbours aside on their own panel only.
        let panels: Vec<_> =
            blocks.iter().filter(|block| !block.is_beside).map(|block| block.panel).collect();
        blocks.retain(|block| panels.binary_search(&block.panel).is_ok());
        let yarns = self.yarns;
        let (pattern, strain) = (self.pattern.clone(), self.strain.clone());
        let (thickness, meshes) = (self.thickness.clone(), self.meshes.clone());
        let (garment, spread) = (self.garment, self.spread.clone());
        // Whether yarns are swept depends on the whole, of which other panels are missing here.
        let whole = Some(self.whole_stitches());
        Self { garment, pattern, strain, thickness, spread, meshes, blocks, yarns, whole }
    }

    /// The same cloth with yarns that lie as flat as their neighbours leave room. The thickest of
    /// them is drawn with `radius` mm.
    #[must_use]
    pub fn with_spread_yarns(self, fabric: &Fabric, radius: f64) -> Self {
        let spread = Some(Arc::new(Spread::of(fabric, &self.pattern, radius)));
        Self { spread, ..self }
    }

    /// How flat its yarns lie. `None` where a section's ratio tells.
    #[must_use]
    pub fn spread(&self) -> Option<&Arc<Spread>> {
        self.spread.as_ref()
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

    /// The same of one bar.
    #[must_use]
    pub fn stitches_of_bar(&self, bar: usize) -> u64 {
        self.own_blocks().filter(|block| block.bar == bar).map(BlockPlan::stitches).sum()
    }

    /// Stitches of the whole cloth of which this is a part, planned as in [`Self::stitches`].
    #[must_use]
    pub fn whole_stitches(&self) -> u64 {
        self.whole.unwrap_or_else(|| self.blocks.iter().map(BlockPlan::stitches).sum())
    }

    /// The blocks that [`super::run`] delivers.
    pub(super) fn own_blocks(&self) -> impl Iterator<Item = &BlockPlan> {
        self.blocks.iter().filter(|block| !block.is_beside)
    }

    /// Stitches that are in memory together while they are swept, those of a panel. 0 if yarns are not
    /// swept with these options.
    #[must_use]
    pub fn swept_together(&self, options: &DrapeOptions) -> u64 {
        if !self.is_swept(options) {
            return 0;
        }
        let panels = self.blocks.chunk_by(|one, next| one.panel == next.panel);
        panels.map(|panel| panel.iter().map(BlockPlan::stitches).sum()).max().unwrap_or(0)
    }

    /// Whether its yarns are swept on the body. For a part that depends on the whole cloth.
    pub(super) fn is_swept(&self, options: &DrapeOptions) -> bool {
        options.mapping == Mapping::Relaxed
            && self.strain.is_some()
            && options.sweeps.unwrap_or_else(|| self.whole_stitches() <= MAX_SWEPT_STITCHES)
    }

    /// Whether yarns keep their lengths on the body: by the table of strained repeats, or by sweeps
    /// alone if the repeat is too large for it.
    #[must_use]
    pub fn keeps_lengths(&self, options: &DrapeOptions) -> bool {
        let is_tabled = self.strain().is_some_and(|table| !table.is_flat_only());
        options.mapping == Mapping::Relaxed && (is_tabled || self.is_swept(options))
    }

    /// Number of blocks that [`super::run`] will deliver.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.own_blocks().count()
    }

    /// Number of planned yarns, including those that will turn out to lie off their panel.
    #[must_use]
    pub fn yarns(&self) -> usize {
        self.own_blocks().map(|block| block.yarns.len()).sum()
    }

    /// Where wale 0 and course 0 of each panel begin, in its axes, mm.
    #[cfg(test)]
    pub(crate) fn origins(&self) -> impl Iterator<Item = DVec2> {
        self.meshes.iter().map(|mesh| mesh.origin)
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
pub(super) fn along_yarns(p: DVec2, across: bool) -> DVec2 {
    if across { p.yx() } else { p }
}

/// The start of the fabric on a panel, relative to the panel's lowest-left corner.
///
/// The layout's origin is moved by whole repeats until it lies at the corner, or to the left of it
/// and below it. Then wales and courses count from 0 on, as they do without an origin.
fn layout_offset(fabric: &Fabric, panel: usize) -> DVec2 {
    let origin = fabric
        .panels
        .iter()
        .find(|layout| layout.panel == panel)
        .map_or(DVec2::ZERO, |layout| layout.origin);
    -(-origin).rem_euclid(repeat_of(fabric))
}

/// Width and height of the repeat, with that of the threading, mm.
fn repeat_of(fabric: &Fabric) -> DVec2 {
    DVec2::new(
        f64::from(index32(fabric.threading_repeat())) * fabric.wale_spacing(),
        f64::from(index32(fabric.repeat())) * fabric.course_spacing(),
    )
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
