//! A block: consecutive yarns of one bar on one panel, on their way through the stages.
//!
//! In: a plan of yarns. Out: their flat data points, the strands on the panel, draped points and
//! tubes, in memory that a later block uses again.

use std::ops::Range;

use glam::{DVec2, DVec3};

use super::DrapeOptions;
use super::body::DrapedGarment;
use super::cloth::{BlockPlan, Cloth};
use super::evenness::{self, Evenness};
use super::lay_times::{Lap, LayTimes};
use super::strands::{CUT, Edge, Strand, Strands};
#[cfg(doc)]
use crate::garment::Garment;
use crate::ids::{YarnId, index32};
use crate::knit::mesh::StructureMesh;
use crate::knit::spread::Spread;
use crate::knit::{Knitted, Tag, YarnCopy};
use crate::locate::{Locator, SurfacePoint};
use crate::map::Draped;
use crate::map::relaxed::StrainCounts;
use crate::yarn::tube::{Section, Tubes};

/// Consecutive yarns of one bar on one panel, after all stages.
#[derive(Clone, Debug, Default)]
pub struct Block {
    /// Index of the panel in [`Garment::panels`].
    pub panel: usize,
    /// Index of the bar, counted from the front.
    pub bar: usize,
    /// The place from which its draped coordinates count, mm: [`GarmentSummary::origin`].
    ///
    /// [`GarmentSummary::origin`]: crate::garment::GarmentSummary::origin
    pub origin: DVec3,
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
    pub(super) yarns: Vec<BlockYarn>,
    /// Whether it is only there for its neighbours' sake.
    pub(super) is_beside: bool,
    /// The location of each data point of `knitted`.
    pub(super) located: Vec<Option<SurfacePoint>>,
    /// How long it took to lay.
    pub(super) times: LayTimes,
}

/// A yarn of a block.
#[derive(Clone, Debug)]
pub(super) struct BlockYarn {
    pub(super) id: YarnId,
    /// Its stitches in [`Block::knitted`].
    pub(super) stitches: Range<usize>,
    /// The yarn of the repeat that it copies.
    pub(super) copy: YarnCopy,
}

impl Block {
    pub(super) fn stitches(&self) -> u64 {
        self.knitted.stitches.len() as u64
    }

    /// The data points of some stitches in `knitted`.
    pub(super) fn points_of(&self, stitches: &Range<usize>) -> Range<usize> {
        let [start, end] = [stitches.start, stitches.end].map(|stitch| {
            let points = self.knitted.points.len();
            self.knitted.stitches.get(stitch).map_or(points, |&point| point as usize)
        });
        start..end
    }

    /// Knits, locates and maps the planned yarns. Without a body they aren't mapped.
    pub(super) fn lay(
        &mut self,
        cloth: &Cloth<'_>,
        plan: &BlockPlan,
        locator: &Locator<'_>,
        body: Option<&DrapedGarment<'_>>,
        options: &DrapeOptions,
    ) {
        let mut lap = Lap::start();
        self.knit(cloth, plan, options.evenness);
        self.times.knit = lap.split();
        self.locate(locator, options.edge);
        self.times.locate = lap.split();
        if let Some(body) = body {
            self.map(body);
        }
        self.times.map = lap.split();
    }

    /// Computes the flat data points of the planned yarns.
    fn knit(&mut self, cloth: &Cloth<'_>, plan: &BlockPlan, evenness: Evenness) {
        (self.panel, self.bar, self.is_beside) = (plan.panel, plan.bar, plan.is_beside);
        self.origin = cloth.garment.summary.origin;
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
        if evenness == Evenness::Uneven {
            self.displace(&cloth.meshes[plan.panel]);
        }
    }

    /// Moves the flat data points as the cloth's unevenness moves them.
    fn displace(&mut self, mesh: &StructureMesh) {
        let stitch = DVec2::new(mesh.wale_spacing, mesh.course_spacing);
        for point in &mut self.knitted.points {
            let place = (point.truncate() - mesh.origin) / stitch;
            *point += (evenness::shift(self.panel, place) * stitch).extend(0.0);
        }
    }

    /// The tag of a strand's point. An end that was cut has that of the data point beside it.
    #[must_use]
    pub fn tag_near(&self, point: usize) -> &Tag {
        &self.knitted.tags[self.strands.source_near(point) as usize]
    }

    /// The data point of the repeat that a strand's point is a copy of. An end that was cut has
    /// that of the data point beside it.
    #[must_use]
    pub fn origin_near(&self, point: usize) -> u32 {
        self.knitted.origins[self.strands.source_near(point) as usize]
    }

    /// The number of a strand's first point, counted along its yarn from a place that is the same
    /// however much of the yarn was planned.
    #[must_use]
    pub fn first_along(&self, strand: &Strand) -> i64 {
        let at = self.yarns.binary_search_by_key(&strand.yarn, |yarn| yarn.id);
        let yarn = &self.yarns[at.expect("a strand is a part of one of the block's yarns")];
        let first = strand.range().start;
        // A cut end counts as the data point before the second.
        let before = i64::from(self.strands.sources[first] == CUT);
        let source = i64::from(self.strands.source_near(first)) - before;
        yarn.copy.first + source - i64::from(index32(self.points_of(&yarn.stitches).start))
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
    pub(super) fn map(&mut self, body: &DrapedGarment<'_>) {
        let Self { strands, knitted, draped, .. } = self;
        self.strain = body.map(self.panel, strands, knitted, draped);
    }

    /// Makes the strands' tubes. `thickness` is the bar's radius relative to the section's, and
    /// `spread` takes the place of the section's ratio.
    pub(super) fn add_tubes(&mut self, section: &Section, thickness: f64, spread: Option<&Spread>) {
        let section = &Section { radius: section.radius * thickness, ..*section };
        self.tubes.clear();
        self.tubes.reserve(self.strands.pieces.len(), self.strands.strands.len(), section);
        let mut ratios = Vec::new();
        for strand in &self.strands.strands {
            let (positions, normals) =
                (&self.draped.positions[strand.range()], &self.draped.normals[strand.range()]);
            ratios.clear();
            if let Some(spread) = spread {
                let origins = strand.range().map(|point| self.origin_near(point));
                ratios.extend(origins.map(|origin| spread.ratio(origin)));
            }
            // The frame of a round section does not follow the cloth.
            if ratios.iter().all(|ratio| *ratio == 1.0) {
                ratios.clear();
            }
            let pieces = self.strands.pieces_of(strand);
            self.tubes.add_spread(positions, normals, &ratios, pieces, section);
        }
    }
}
