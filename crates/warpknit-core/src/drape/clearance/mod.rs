//! Clearance of draped yarns: how near they come to each other on the body.
//!
//! In: a [`Cloth`] and the radius of its yarns. Out: the [`BodyClearance`] of the whole garment.
//!
//! Method: each panel is cut into square patches. The yarns of a patch and of a margin around it
//! are knitted, located and mapped once more, by the stages that [`run`](super::run) uses. So
//! memory does not grow with the stitches, and any mapping is measured. Sweeps know only the yarns
//! of the patch and its margin, which is nearly the same. Yarns are cut into short
//! segments (`arcs`) and compared where they are near (`nearest`), once on the body and, where the
//! flat cloth itself has near yarns, once flat.
//!
//! - Only neighbours of the flat cloth are compared. Cloth that lies on cloth is left out: that is
//!   the drape's doing and not the yarns'. Yarns of two panels at a seam are left out as well.
//! - Stitches cut by the panel's edge are left out, since the rest of a stitch bends differently
//!   from a whole one.
//! - A share of yarn length counts each yarn by its length in the flat cloth. What is too near flat
//!   already is left out of it, since the mapping is not the cause.
//!
//! Cost: 19 to 26 µs a stitch on one thread, twice that where the flat cloth is looked at too, and
//! some 20 MB for each thread. Patches do not depend on threads, and their results are added in
//! order, so the answer is the same for any number of them.
//!
//! Not promised: all cuts where a drape has torn its cloth. Of over 5000 arcs around one only some
//! are compared.

mod arcs;
mod nearest;

use std::ops::Range;
use std::sync::Mutex;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::body::Body;
use super::cloth::{BlockPlan, YarnPlan, along_yarns};
use super::strands::{CUT, Strand, Strands};
use super::sweeps;
use super::{Block, Cloth, DrapeOptions};
use crate::ids::index32;
use crate::knit::Knitted;
use crate::knit::clearance::MIN_RELAXED;
use crate::knit::mesh::StructureMesh;
use crate::locate::Locator;
use arcs::{Arc, SEGMENTS, StrandPoints};
use nearest::{NEIGHBOURS, Nearest};

/// Cutoff of the search on the body, over the sum of radii. It must be over 1, where yarns touch.
/// Relaxed cloth has many of its contacts just above it, so with 1.05 the search takes a sixth
/// longer.
const CUTOFF: f32 = 1.02;
/// Yarns nearer than this, over the sum of radii, count as too near on the body.
const TOO_NEAR: f32 = 0.95;
/// Yarns nearer than this in the flat cloth are left out of the share. A little more than
/// [`TOO_NEAR`], so that yarns that are just free when flat don't count for a hair of change.
#[expect(clippy::cast_possible_truncation, reason = "a number of two digits")]
const TOO_NEAR_FLAT: f32 = MIN_RELAXED as f32;
/// Data points of a patch, on average. A stitch has about ten. With a quarter of them the margin
/// would be as large as the patch. With many more, a patch (a kilobyte a point) would leave the
/// cache.
const PATCH_POINTS: f64 = 12_000.0;
/// Steps that a yarn is laid further than its patch at both ends, so that the ends, which have
/// mirrored points beyond them, lie outside.
const MORE_STEPS: i64 = 2;
/// Repeats of more patches than this are looked at patch by patch, as if they were near flat. They
/// would take much memory, and the cloth may be smaller.
const MAX_REPEAT_PATCHES: f64 = 4.0;
/// Patches for each thread between two reports of progress.
const THREAD_PATCHES: usize = 8;

/// The distances between draped yarns, in figures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyClearance {
    /// Least distance between centre lines over the sum of their radii (2r for equal yarns). Under
    /// 1 yarns cut each other. It is 1.02 at most, since the search ends there.
    pub min_over_2r: f64,
    /// Pairs of path segments nearer than 1.02 of touching.
    pub pairs: u64,
    /// Pairs nearer than touching.
    pub pairs_below_1: u64,
    /// Length of all yarns that were measured, mm of flat cloth.
    pub yarn_length: f64,
    /// Length that has another yarn nearer than 0.98 of touching in the flat cloth already, mm.
    pub near_flat: f64,
    /// Length that has another yarn nearer than 0.95 of touching on the body but isn't near one
    /// flat, mm.
    pub below_95: f64,
}

impl BodyClearance {
    /// No yarn at all.
    pub const FREE: Self = Self {
        min_over_2r: 1.02,
        pairs: 0,
        pairs_below_1: 0,
        yarn_length: 0.0,
        near_flat: 0.0,
        below_95: 0.0,
    };

    /// The clearance of two sets of yarns together.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            min_over_2r: self.min_over_2r.min(other.min_over_2r),
            pairs: self.pairs + other.pairs,
            pairs_below_1: self.pairs_below_1 + other.pairs_below_1,
            yarn_length: self.yarn_length + other.yarn_length,
            near_flat: self.near_flat + other.near_flat,
            below_95: self.below_95 + other.below_95,
        }
    }

    /// Share of the yarn length that has another yarn nearer than 0.95 of touching. What is near
    /// another in the flat cloth already counts neither above nor below the line.
    #[must_use]
    pub fn share_below_95(&self) -> f64 {
        share(self.below_95, self.yarn_length - self.near_flat)
    }

    /// Share of the yarn length that is left out of [`Self::share_below_95`].
    #[must_use]
    pub fn share_near_flat(&self) -> f64 {
        share(self.near_flat, self.yarn_length)
    }
}

/// A part of a whole; 0 where there is nothing.
fn share(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { 0.0 }
}

/// Measures a cloth whose thickest yarns are drawn with `radius` mm. `progress` gets the share that
/// is done, from 0 to 1.
///
/// ```
/// use warpknit_core::{drape::{self, clearance}, fabric::Fabric};
/// let fabric = Fabric::named("tricot")?;
/// let panel = drape::swatch_panel(&fabric, 8, 10);
/// let cloth = drape::Cloth::swatch(&panel, &fabric, 8, 10);
/// let options = drape::DrapeOptions::default();
/// let found = clearance::measure(&cloth, &options, fabric.radius(), &mut |_done| ());
/// assert!(found.min_over_2r > 0.98 && found.share_below_95() == 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn measure(
    cloth: &Cloth<'_>,
    options: &DrapeOptions,
    radius: f64,
    progress: &mut dyn FnMut(f64),
) -> BodyClearance {
    let pass = Pass::new(cloth, *options, radius);
    // Memory of as many patches as are worked on at a time.
    let places = Mutex::new(Vec::new());
    let measured = |at| {
        let taken = || places.lock().expect("no thread fails while it holds the lock");
        let mut place: Workplace = taken().pop().unwrap_or_default();
        let clearance = pass.measure(&pass.patch(at), &mut place);
        taken().push(place);
        clearance
    };
    let window = THREAD_PATCHES * rayon::current_num_threads();
    let mut clearance = BodyClearance::FREE;
    for first in (0..pass.patches()).step_by(window) {
        progress(f64::from(index32(first)) / f64::from(index32(pass.patches())));
        let patches = first..(first + window).min(pass.patches());
        let found: Vec<_> = patches.into_par_iter().map(measured).collect();
        clearance = found.into_iter().fold(clearance, BodyClearance::and);
    }
    clearance
}

/// A square of a panel whose yarns are measured together.
struct ClothPatch {
    panel: usize,
    area: Area,
}

/// A part of the flat cloth, and a margin around it.
struct Area {
    /// Its corners, mm.
    low: DVec2,
    high: DVec2,
    margin: f64,
}

impl Area {
    /// Whether a span with these ends may have arcs in it or in its margin.
    fn touches(&self, ends: [DVec3; 2]) -> bool {
        let reach = self.margin + ends[0].distance(ends[1]);
        let middle = ends[0].midpoint(ends[1]).truncate();
        middle.cmpge(self.low - reach).all() && middle.cmple(self.high + reach).all()
    }

    /// The place from which arcs have their flat places.
    fn near(&self) -> DVec3 {
        self.low.extend(0.0)
    }

    /// Whether an arc is to be measured. `None` if it is too far away to matter.
    fn measures(&self, arc: &Arc) -> Option<bool> {
        let middle = arc.flat.truncate().as_dvec2();
        let size = self.high - self.low;
        let near = middle.cmpge(DVec2::splat(-self.margin)).all()
            && middle.cmple(size + self.margin).all();
        near.then(|| middle.cmpge(DVec2::ZERO).all() && middle.cmplt(size).all())
    }
}

/// What all patches have in common.
struct Pass<'a> {
    cloth: &'a Cloth<'a>,
    options: DrapeOptions,
    body: Body<'a>,
    /// One for each panel.
    locators: Vec<Locator<'a>>,
    /// The yarns of each bar, in order of their guides, panel by panel.
    yarns: Vec<Vec<Vec<&'a YarnPlan>>>,
    /// Each bar's drawn radius, mm.
    radii: Vec<f64>,
    /// Side of a patch, mm.
    side: f64,
    /// Number of patches up to and including those of each panel.
    ends: Vec<usize>,
    /// How far from a patch its yarns have neighbours, mm.
    margin: f64,
    /// Whether yarns may be too near in the flat cloth already, so that it has to be looked at.
    flat: bool,
}

/// Memory of one thread, which each patch uses again.
#[derive(Default)]
struct Workplace {
    /// One for each bar.
    blocks: Vec<Block>,
    /// The arcs on the body, and the same arcs flat.
    draped: Vec<Arc>,
    flat: Vec<Arc>,
    near_draped: Nearest,
    near_flat: Nearest,
}

impl<'a> Pass<'a> {
    fn new(cloth: &'a Cloth<'a>, options: DrapeOptions, radius: f64) -> Self {
        let (panels, bars) = (cloth.garment.panels.len(), cloth.thickness.len());
        let mut yarns = vec![vec![Vec::new(); bars]; panels];
        for block in &cloth.blocks {
            yarns[block.panel][block.bar].extend(&block.yarns);
        }
        let radii: Vec<_> = cloth.thickness.iter().map(|thickness| radius * thickness).collect();
        let thickest = radii.iter().copied().fold(0.0, f64::max);
        let margin = 2.0 * f64::from(NEIGHBOURS) * thickest;
        let side = (PATCH_POINTS / cloth.pattern.points_per_area()).sqrt().max(margin);
        let locators = cloth.garment.panels.par_iter().map(Locator::new).collect();
        let (ends, flat) = (Vec::new(), true);
        let is_swept = cloth.is_swept(&options);
        let body =
            Body::new(cloth.garment, cloth.strain(), options.mapping, is_swept, &mut |_done| ());
        let mut pass =
            Self { cloth, options, body, locators, yarns, radii, side, ends, margin, flat };
        for panel in 0..panels {
            pass.ends.push(pass.patches() + pass.grid(panel).iter().product::<usize>());
        }
        pass.flat = cloth.meshes.first().is_some_and(|mesh| pass.may_be_near_flat(mesh));
        pass
    }

    /// The lowest left corner of a panel's patches. Curves may bulge over the panel's edge by less
    /// than the distance of two wales or courses.
    fn origin(&self, panel: usize) -> DVec2 {
        self.cloth.garment.panels[panel].bounds()[0] - self.overhang(panel)
    }

    fn overhang(&self, panel: usize) -> DVec2 {
        let mesh = &self.cloth.meshes[panel];
        DVec2::splat(mesh.wale_spacing.max(mesh.course_spacing))
    }

    /// Columns and rows of a panel's patches.
    fn grid(&self, panel: usize) -> [usize; 2] {
        let size = self.cloth.garment.panels[panel].size() + 2.0 * self.overhang(panel);
        // Panels are limited to a million wales and courses, and a patch has more than one of each.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "see above")]
        (size / self.side).to_array().map(|count| count.floor() as usize + 1)
    }

    /// Number of patches of all panels.
    fn patches(&self) -> usize {
        self.ends.last().copied().unwrap_or(0)
    }

    /// A patch, counted over all panels.
    fn patch(&self, at: usize) -> ClothPatch {
        let panel = self.ends.partition_point(|&end| end <= at);
        let [columns, rows] = self.grid(panel);
        let at = at + columns * rows - self.ends[panel];
        let at = [at % columns, at / columns];
        // Both sides of a border come from the same formula, so no yarn is lost between them.
        let corner = |at: [usize; 2]| {
            let [x, y] = at.map(|count| f64::from(index32(count)));
            self.origin(panel) + self.side * DVec2::new(x, y)
        };
        let (low, high) = (corner(at), corner(at.map(|count| count + 1)));
        ClothPatch { panel, area: Area { low, high, margin: self.margin } }
    }

    /// Whether yarns may be too near each other in the flat cloth: whether they are in one repeat.
    /// Larger repeats are not looked at here. `mesh` is that of any panel.
    fn may_be_near_flat(&self, mesh: &StructureMesh) -> bool {
        let pattern = &self.cloth.pattern;
        let mesh = StructureMesh { origin: DVec2::new(mesh.wale_spacing / 2.0, 0.0), ..*mesh };
        let area = Area { low: DVec2::ZERO, high: pattern.repeat_size(), margin: self.margin };
        if area.high.element_product() > MAX_REPEAT_PATCHES * self.side * self.side {
            return true;
        }
        let (mut arcs, mut knitted, mut number) = (Vec::new(), Knitted::default(), 0);
        for (bar, &radius) in self.radii.iter().enumerate() {
            let (numbers, steps) = self.touching(&area, bar, DVec2::ZERO);
            for yarn in numbers {
                knitted.clear();
                pattern.lay(bar, yarn, steps.clone(), &mesh, &mut knitted);
                let points = &knitted.points;
                let strand = StrandPoints { draped: points, flat: points, number, radius };
                let spans = 0..points.len().saturating_sub(1);
                strand.arcs(
                    spans,
                    area.near(),
                    false,
                    |ends| area.touches(ends),
                    |arc, _| {
                        if let Some(measured) = area.measures(&arc) {
                            arcs.push(Arc { measured, ..arc });
                        }
                    },
                );
                number += 1;
            }
        }
        let mut near = Nearest::default();
        near.find(&arcs, TOO_NEAR_FLAT);
        near.pairs > 0
    }

    /// The numbers of a bar's yarns that touch an area or its margin, and their steps there with
    /// some more. `origin` is the place of gap 0 of guide 0.
    fn touching(
        &self,
        area: &Area,
        bar: usize,
        origin: DVec2,
    ) -> (impl Iterator<Item = i64>, Range<i64>) {
        let pattern = &self.cloth.pattern;
        let across = pattern.runs_across(bar);
        let [low, high] = [area.low - area.margin, area.high + area.margin]
            .map(|corner| along_yarns(corner - origin, across));
        let steps = pattern.steps_along(bar, low.y..high.y);
        let more = steps.start - MORE_STEPS..steps.end + MORE_STEPS;
        (pattern.yarns_over(bar, low.x..high.x), more)
    }

    /// Measures the yarns of a patch.
    fn measure(&self, patch: &ClothPatch, place: &mut Workplace) -> BodyClearance {
        place.draped.clear();
        place.flat.clear();
        let mut strands = 0;
        let mut blocks = std::mem::take(&mut place.blocks);
        blocks.resize_with(self.radii.len(), Block::default);
        for (bar, block) in blocks.iter_mut().enumerate() {
            let (plan, locator) = (self.plan(patch, bar), &self.locators[patch.panel]);
            block.lay(self.cloth, &plan, locator, &self.body, self.options.edge);
        }
        if let Some(neighbours) = self.body.swept() {
            sweeps::sweep(&mut blocks, neighbours);
        }
        for block in &blocks {
            self.add_arcs(block, &patch.area, &mut strands, place);
        }
        place.blocks = blocks;
        if !place.draped.iter().any(|arc| arc.measured) {
            return BodyClearance::FREE;
        }
        place.near_draped.find(&place.draped, CUTOFF);
        if self.flat {
            place.near_flat.find(&place.flat, TOO_NEAR_FLAT);
        }
        sum(place)
    }

    /// The yarns of a bar that touch a patch or its margin, over the steps within it.
    fn plan(&self, patch: &ClothPatch, bar: usize) -> BlockPlan {
        let mesh = &self.cloth.meshes[patch.panel];
        let origin = mesh.origin - DVec2::new(mesh.wale_spacing / 2.0, 0.0);
        let (numbers, steps) = self.touching(&patch.area, bar, origin);
        let yarns = &self.yarns[patch.panel][bar];
        let yarns = numbers.filter_map(|number| {
            let yarn = yarns[yarns.binary_search_by_key(&number, |yarn| yarn.guide).ok()?];
            let courses = yarn.courses.start.max(steps.start)..yarn.courses.end.min(steps.end);
            (!courses.is_empty()).then(|| YarnPlan { courses, ..yarn.clone() })
        });
        BlockPlan { panel: patch.panel, bar, is_beside: false, yarns: yarns.collect() }
    }

    /// Adds the arcs of a block's strands that lie in the area or in its margin.
    fn add_arcs(&self, block: &Block, area: &Area, strands: &mut u32, place: &mut Workplace) {
        let Workplace { draped, flat, .. } = place;
        for strand in &block.strands.strands {
            let points = StrandPoints {
                draped: &block.draped.positions[strand.range()],
                flat: &block.strands.flat[strand.range()],
                number: *strands,
                radius: self.radii[block.bar],
            };
            *strands += 1;
            let spans = whole_stitches(&block.strands, strand);
            let touches = |ends| area.touches(ends);
            points.arcs(spans, area.near(), self.flat, touches, |arc, flat_arc| {
                if let Some(measured) = area.measures(&arc) {
                    draped.push(Arc { measured, ..arc });
                    flat.extend(flat_arc.map(|arc| Arc { measured, ..arc }));
                }
            });
        }
    }
}

/// Adds up what was found in a patch.
fn sum(place: &Workplace) -> BodyClearance {
    let Workplace { draped, near_draped, near_flat, .. } = place;
    let mut clearance = BodyClearance {
        // Two measured segments count twice.
        pairs: near_draped.pairs / 2,
        pairs_below_1: near_draped.pairs_below_1 / 2,
        ..BodyClearance::FREE
    };
    let mut least = CUTOFF * CUTOFF;
    // Without a search of the flat cloth nothing is near in it.
    let flat = |at: usize| near_flat.squared.get(at).copied().unwrap_or([f32::INFINITY; SEGMENTS]);
    for (at, arc) in draped.iter().enumerate().filter(|(_, arc)| arc.measured) {
        for ((draped, flat), length) in
            near_draped.squared[at].into_iter().zip(flat(at)).zip(arc.lengths)
        {
            let length = f64::from(length);
            least = least.min(draped);
            clearance.yarn_length += length;
            if flat < TOO_NEAR_FLAT * TOO_NEAR_FLAT {
                clearance.near_flat += length;
            } else if draped < TOO_NEAR * TOO_NEAR {
                clearance.below_95 += length;
            }
        }
    }
    if least < CUTOFF * CUTOFF {
        clearance.min_over_2r = f64::from(least.sqrt());
    }
    clearance
}

/// The spans of a strand's whole stitches, counted from its first.
fn whole_stitches(strands: &Strands, strand: &Strand) -> Range<usize> {
    let (first, last) = (strand.points.start as usize, strand.points.end as usize - 1);
    let pieces = &strands.pieces[strand.pieces.start as usize..strand.pieces.end as usize];
    // An end that the panel's edge cut has no data point. There the first or the last piece goes.
    let start = match strands.sources[first] {
        CUT => pieces.get(1).map_or(last, |&piece| piece as usize),
        _ => first,
    };
    let end = match strands.sources[last] {
        CUT => pieces.last().map_or(first, |&piece| piece as usize),
        _ => last,
    };
    start - first..end.max(start) - first
}
