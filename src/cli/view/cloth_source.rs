//! The source of cloth for the window: the fabrics that can be chosen, and the garment or the
//! swatch that they are knitted on.
//!
//! In: the arguments, then one [`Recipe`] at a time. Out: a [`KnittedScene`]. Nothing here depends
//! on a window.

use std::borrow::Cow;
use std::cell::RefCell;
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context, Result};
use warpknit::drape::evenness::Evenness;
use warpknit::drape::{self, Block, Cloth, DrapeOptions, Totals};
use warpknit::fabric::{Fabric, builtin};
use warpknit::garment::{Garment, Panel};
use warpknit::knit::Pattern;
use warpknit::render::cloth;
use warpknit::render::scene::{Scene, Shape};
use warpknit::report::Timings;

use super::super::args::Live;
use super::super::choice::{fabric, named_fabric};
use warpknit::pipeline::{
    self, Clock, EdgeFinish, Enlarge, Placement, StrainCache, Task, Textures, check_laid,
    check_memory, check_placement, check_stitches, drawn_radius, lengths_note, loss_warning,
    read_garment, turn_panels,
};

/// Memory of a stitch, GB: 160 bytes of scene, and on a software adapter 25 for each of ten points,
/// with the copies made while uploading.
const STITCH_GB: f64 = 1e-6;

/// Everything that does not change while the window is open.
pub(super) struct ClothSource {
    /// The fabrics on the list; the one that the command line names comes first.
    pub(super) choices: Vec<FabricChoice>,
    base: ClothBase,
    placement: Placement,
    /// How edges are finished, where the user chose it.
    edges: Option<EdgeFinish>,
    /// The folder in which strained repeats are kept.
    cache: Option<PathBuf>,
    /// Tubes or ribbons, as the command line asks.
    shape: Shape,
    /// Width over height of the yarns' sections, where the user chose it.
    flatten: Option<f64>,
    /// Whether stitches are alike.
    evenness: Evenness,
}

/// A fabric on the list.
pub(super) struct FabricChoice {
    pub(super) label: String,
    /// The fabric at the densities at which it is first shown.
    pub(super) fabric: Fabric,
    /// The textures of its yarns.
    textures: Arc<Textures>,
}

/// The surface that is covered with fabric.
enum ClothBase {
    Garment(Box<Garment>),
    Swatch { wales: u32, courses: u32 },
}

/// The parameters of a cloth. Equal recipes give the same cloth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Recipe {
    /// Index in [`ClothSource::choices`].
    pub(super) fabric: usize,
    pub(super) wales_per_cm: f64,
    pub(super) courses_per_cm: f64,
    /// Radius of the yarns, mm; `None` for that of the fabric's yarns.
    pub(super) radius: Option<f64>,
    pub(super) shape: Shape,
}

/// A cloth, ready to be drawn.
pub(super) struct KnittedScene {
    pub(super) scene: Scene,
    pub(super) totals: Totals,
    /// Radius of the thickest yarn, mm.
    pub(super) radius: f64,
    /// Size of the loops over that in the real cloth.
    pub(super) enlargement: f64,
    pub(super) timings: Timings,
    pub(super) warnings: Vec<String>,
}

/// The reason to stop knitting: a newer cloth is wanted.
struct Superseded;

impl ClothSource {
    /// Reads the garment and all fabrics.
    pub(super) fn from_arguments(arguments: &Live) -> Result<Self> {
        let shared = &arguments.shared;
        let first = fabric(shared)?;
        let base = match &arguments.flat {
            Some(flat) => {
                let options = arguments.reading.options();
                ClothBase::Garment(
                    read_garment(flat, arguments.draped.as_deref(), &options)?.into(),
                )
            }
            None => ClothBase::Swatch { wales: arguments.wales, courses: arguments.courses },
        };
        let enlarge = arguments.laying.enlarge.unwrap_or(Enlarge::Auto);
        // On a garment a fine fabric may have too many stitches, and is then enlarged. A swatch has
        // as many as were asked for, so its area counts as 0.
        let area = base.area();
        let asked = shared.chains.label(&shared.fabric, &first);
        let label = if asked.is_empty() { "your chains" } else { asked }.to_owned();
        // A texture named on the command line applies to every fabric on the list.
        let (textures, for_all) = (
            Arc::new(Textures::read(shared.drawing.texture.as_deref(), &first)?),
            shared.drawing.texture.is_some(),
        );
        let others = builtin::names().filter(|name| *name != label).map(|name| {
            let fabric = enlarge.of_fabric(&named_fabric(name)?, area)?;
            let textures = if for_all { Arc::clone(&textures) } else { Arc::default() };
            Ok(FabricChoice { label: name.to_owned(), fabric, textures })
        });
        let others = others.collect::<Result<Vec<_>>>()?;
        let shown = if shared.densities().are_chosen() {
            first
        } else {
            enlarge.of_fabric(&first, area)?
        };
        let mut choices =
            vec![FabricChoice { label, fabric: shown, textures: Arc::clone(&textures) }];
        choices.extend(others);
        let placement = arguments.laying.placement();
        check_placement(placement)?;
        Ok(Self {
            choices,
            base,
            placement,
            edges: arguments.edges.map(Into::into),
            cache: arguments.laying.cache(),
            shape: shared.drawing.shape.into(),
            flatten: shared.flatten,
            evenness: shared.drawing.evenness(),
        })
    }

    /// The recipe with which a fabric is first shown.
    pub(super) fn recipe(&self, fabric: usize) -> Recipe {
        let Fabric { wales_per_cm, courses_per_cm, .. } = self.choices[fabric].fabric;
        Recipe { fabric, wales_per_cm, courses_per_cm, radius: None, shape: self.shape }
    }

    /// Knits a cloth. Returns `None` if `superseded` turns true meanwhile.
    pub(super) fn knit(
        &self,
        recipe: Recipe,
        superseded: &dyn Fn() -> bool,
    ) -> Result<Option<KnittedScene>> {
        let fabric = self.fabric(&recipe)?;
        let radius = drawn_radius(&fabric, recipe.radius)?;
        let mut clock = Clock::start(&());
        clock.begin(Task::Knit, 0.0);
        match &self.base {
            ClothBase::Garment(garment) => {
                self.knit_on(garment, &fabric, radius, recipe, clock, superseded)
            }
            ClothBase::Swatch { wales, courses } => {
                let panel = drape::swatch_panel(&fabric, *wales, *courses);
                let cloth = Cloth::swatch(&panel, &fabric, *wales, *courses);
                let cloth = pipeline::spread(cloth, &fabric, radius, (self.flatten, self.evenness));
                self.lay(&cloth, &fabric, radius, recipe, clock, superseded)
            }
        }
    }

    /// Knits a cloth on a garment, and finishes its edges.
    fn knit_on(
        &self,
        garment: &Garment,
        fabric: &Fabric,
        radius: f64,
        recipe: Recipe,
        clock: Clock<'_>,
        superseded: &dyn Fn() -> bool,
    ) -> Result<Option<KnittedScene>> {
        let mut garment = Cow::Borrowed(garment);
        if !fabric.panels.is_empty() {
            turn_panels(garment.to_mut(), fabric);
        }
        let label = || self.choices[recipe.fabric].label.clone();
        Cloth::check_sizes(&garment, fabric).with_context(label)?;
        let pattern = Pattern::new(fabric);
        let finished = pipeline::has_finished_edges(self.edges, fabric.enlargement <= 1.0)
            .then(|| pipeline::edges_of(&garment, &pattern, radius).finish(&garment));
        let garment = finished.as_ref().map_or(&*garment, |finished| &finished.garment);
        let cloth = Cloth::cover_with(garment, fabric, pattern).with_context(label)?;
        let cloth = pipeline::spread(cloth, fabric, radius, (self.flatten, self.evenness));
        let mut knitted = self.lay(&cloth, fabric, radius, recipe, clock, superseded)?;
        if let (Some(knitted), Some(finished)) = (&mut knitted, &finished) {
            pipeline::add_thread_look(&mut knitted.scene, &finished.threads);
            pipeline::add_threads(&mut knitted.scene, &finished.threads, None);
        }
        Ok(knitted)
    }

    /// The fabric of a recipe at the recipe's densities.
    fn fabric(&self, recipe: &Recipe) -> Result<Fabric> {
        let fabric = self.choices[recipe.fabric].fabric.clone();
        if (fabric.wales_per_cm, fabric.courses_per_cm)
            == (recipe.wales_per_cm, recipe.courses_per_cm)
        {
            return Ok(fabric);
        }
        Ok(fabric.at_densities(recipe.wales_per_cm, recipe.courses_per_cm)?)
    }

    /// The cache of a cloth's strained repeats. Only a fabric as it is first shown has one: a slider
    /// that is dragged makes dozens of others.
    fn cache(&self, cloth: &Cloth<'_>, recipe: Recipe) -> StrainCache {
        let first = self.recipe(recipe.fabric);
        let is_first = (recipe.wales_per_cm, recipe.courses_per_cm)
            == (first.wales_per_cm, first.courses_per_cm);
        StrainCache::open(self.cache.as_deref().filter(|_| is_first), cloth)
    }

    /// Runs the pipeline on a cloth and collects its blocks in a scene. It checks after each group
    /// of blocks whether the cloth is still wanted.
    fn lay(
        &self,
        cloth: &Cloth<'_>,
        fabric: &Fabric,
        radius: f64,
        recipe: Recipe,
        mut clock: Clock<'_>,
        superseded: &dyn Fn() -> bool,
    ) -> Result<Option<KnittedScene>> {
        check_room(cloth.stitches())?;
        let cache = self.cache(cloth, recipe);
        let textures = &self.choices[recipe.fabric].textures;
        let mut scene = Scene {
            evenness: self.evenness,
            spread: cloth.spread().cloned(),
            ..pipeline::scene(recipe.shape, fabric, radius, textures)
                .flattened(self.flatten.unwrap_or(1.0))
        };
        let totals = {
            let clock = RefCell::new(&mut clock);
            let mut announce = |stage, done| clock.borrow_mut().begin(Task::from(stage), done);
            let mut deliver = |blocks: &[Block]| {
                blocks.iter().for_each(|block| cloth::add_to(&mut scene, block));
                if superseded() { Err(Superseded) } else { Ok(()) }
            };
            let options = DrapeOptions { evenness: self.evenness, ..self.placement.into() };
            drape::run(cloth, &options, &mut announce, &mut deliver)
        };
        clock.stop();
        let Ok(totals) = totals else { return Ok(None) };
        clock.divide(&totals.laying);
        check_laid(&totals)?;
        cache.keep(cloth);
        let mut warnings = cloth.garment().summary.warnings.clone();
        warnings.extend(loss_warning(&totals));
        warnings.extend(lengths_note(cloth, &self.placement.into()));
        let (enlargement, timings) = (fabric.enlargement, clock.timings());
        Ok(Some(KnittedScene { scene, totals, radius, enlargement, timings, warnings }))
    }
}

impl ClothBase {
    /// Flat area of a garment, mm²; 0 of a swatch.
    fn area(&self) -> f64 {
        match self {
            Self::Garment(garment) => garment.panels.iter().map(Panel::area).sum(),
            Self::Swatch { .. } => 0.0,
        }
    }
}

/// Refuses cloth whose stitches can't be numbered or would not fit the memory.
fn check_room(stitches: u64) -> Result<()> {
    check_stitches(stitches)?;
    #[expect(clippy::cast_precision_loss, reason = "an estimate")]
    let needed = stitches as f64 * STITCH_GB;
    Ok(check_memory("a picture", stitches, needed, "lower the densities")?)
}
