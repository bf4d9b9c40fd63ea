//! What the pictures of a run show of its cloth, and the loupe in them.
//!
//! In: a [`Job`] and its prepared parts. Out: [`Drawn`], found before the work: the cloth that has
//! to be knitted for the pictures, and that of the loupe, which is a picture from much nearer.

use std::convert::Infallible;
use std::sync::Arc;

use glam::Vec3;
use image::RgbaImage;

use super::RunError;
use super::clock::{Clock, Task};
use super::edges;
use super::estimates::{averaged_bytes, has_masks, picture_bytes};
use super::fibres::Fibres;
use super::job::Job;
use super::loupe::Loupe;
use super::pictures::{self, Pictures};
use super::setup::Setup;
use super::views::{self, InView};
use crate::drape::{self, Block, Cloth, DrapeOptions};
use crate::render::averaged::{self, AveragedCloth};
use crate::render::scene::Scene;
use crate::render::{Camera, RenderOptions, RendererChoice, cloth};

/// Stitches that are laid of a cloth that is drawn as a surface.
const SAMPLED_STITCHES: u64 = 50_000;

/// What pictures show of a cloth.
pub(super) struct Drawn<'a> {
    /// The cloth that pictures need, and its part of the whole.
    shown: ShownCloth<'a>,
    /// The cloth as a surface, and the share of the pictures that show it.
    averaged: Option<(Arc<AveragedCloth>, f32)>,
    loupe: Option<(Loupe, ShownCloth<'a>)>,
    /// Memory that the run needs for pictures, bytes.
    pub(super) bytes: f64,
}

/// The yarns that cameras see.
enum ShownCloth<'a> {
    All,
    /// Those in view.
    InView(InView, Cloth<'a>),
    /// None, since no pixel shows a yarn. Some are laid all the same: they tell how the cloth is
    /// strained.
    Averaged(Cloth<'a>),
}

impl<'a> Drawn<'a> {
    /// Finds what the pictures of a garment show. A swatch is drawn whole. `scene` is empty, and
    /// `points` are those that cameras frame.
    pub(super) fn of(
        job: &Job<'a>,
        setup: &Setup,
        scene: &Scene,
        points: &[Vec3],
    ) -> Result<Self, RunError> {
        let options = pictures::options_of(job);
        let whole = RenderOptions { rows: None, ..options.clone() };
        let cameras = pictures::cameras(job.settings, &options, points);
        let has_fibres = setup.fibres.as_ref().is_some_and(Fibres::replace_yarns);
        let in_view = |cameras: &[Camera], options: &RenderOptions| {
            let found = (!job.is_swatch)
                .then(|| InView::of_cameras(job.cloth, scene, cameras, options, has_fibres));
            found.flatten()
        };
        let averaged = averaged(job, scene, &cameras, &whole);
        let shown = match &averaged {
            Some((_, share)) if *share >= 1.0 => {
                ShownCloth::Averaged(job.cloth.sampled(SAMPLED_STITCHES))
            }
            _ => ShownCloth::of(in_view(&cameras, &whole), job),
        };
        let bytes = |shown: &ShownCloth<'a>, cameras: &[Camera], options: &RenderOptions| {
            let (cloth, laying) = (shown.cloth(job), shown.laying(job));
            picture_bytes(cloth, job.shown, scene, cameras, &laying, options)
        };
        let surface = averaged.as_ref().map_or(0.0, |_| averaged_bytes(job.cloth.garment()));
        let mut needed = surface + bytes(&shown, &cameras, &options);
        let loupe = match cameras.as_slice() {
            [camera] if !job.is_swatch => find_loupe(job, camera)?,
            _ => None,
        };
        let loupe = loupe.map(|loupe| {
            let (cameras, options) = ([*loupe.camera()], pictures::inset_options(job, &loupe));
            let shown = ShownCloth::of(in_view(&cameras, &options), job);
            // One is drawn after the other.
            needed = needed.max(bytes(&shown, &cameras, &options));
            (loupe, shown)
        });
        Ok(Self { shown, averaged, loupe, bytes: needed })
    }

    /// The cloth that pictures need.
    pub(super) fn cloth<'b>(&'b self, job: &'b Job<'a>) -> &'b Cloth<'a> {
        self.shown.cloth(job)
    }

    /// Stitches of the cloth that pictures show.
    pub(super) fn stitches(&self, job: &Job<'_>) -> u64 {
        if self.is_averaged() { job.cloth.stitches() } else { self.cloth(job).stitches() }
    }

    /// Options of laying the cloth that pictures need.
    pub(super) fn laying(&self, job: &Job<'_>) -> DrapeOptions {
        self.shown.laying(job)
    }

    /// Whether pictures show only a part of the cloth.
    pub(super) fn is_part(&self) -> bool {
        matches!(self.shown, ShownCloth::InView(..))
    }

    /// Whether pictures show no yarns but those of seams.
    pub(super) fn is_averaged(&self) -> bool {
        matches!(self.shown, ShownCloth::Averaged(_))
    }

    /// The cloth as a surface, and the share of the pictures that show it.
    pub(super) fn averaged(&self) -> Option<&(Arc<AveragedCloth>, f32)> {
        self.averaged.as_ref()
    }

    /// What cameras see, where that is a part of the cloth.
    pub(super) fn in_view(&self) -> Option<&InView> {
        self.shown.in_view()
    }

    /// Adds a block of the cloth that pictures need to a scene.
    pub(super) fn add_to(&self, scene: &mut Scene, block: &Block) {
        self.shown.add_to(scene, block);
    }

    /// The loupe.
    pub(super) fn loupe(&self) -> Option<&Loupe> {
        self.loupe.as_ref().map(|(loupe, _)| loupe)
    }

    /// Knits and draws what the loupe shows. This time counts as rendering.
    pub(super) fn inset(
        &self,
        job: &Job<'a>,
        setup: &Setup,
        extent: &Scene,
        pictures: &mut Pictures,
        clock: &mut Clock<'_>,
    ) -> Result<Option<RgbaImage>, RunError> {
        let Some((loupe, shown)) = &self.loupe else { return Ok(None) };
        clock.begin(Task::Render, 0.0);
        let mut scene = setup.scene(job);
        scene.extent = extent.extent;
        let Ok(_) = drape::run(shown.cloth(job), &job.options, &mut |_, _| {}, &mut |blocks| {
            blocks.iter().for_each(|block| shown.add_to(&mut scene, block));
            Ok::<_, Infallible>(())
        });
        edges::add_threads(&mut scene, job.threads, shown.in_view());
        pictures.inset(&scene, setup.fibres.as_ref(), job, loupe).map(Some)
    }
}

impl<'a> ShownCloth<'a> {
    /// What is in view of a job's cloth, or all of it.
    fn of(in_view: Option<InView>, job: &Job<'a>) -> Self {
        in_view.map_or(Self::All, |in_view| {
            let cloth = in_view.cloth(job.cloth, &job.options);
            Self::InView(in_view, cloth)
        })
    }

    fn cloth<'b>(&'b self, job: &'b Job<'a>) -> &'b Cloth<'a> {
        match self {
            Self::All => job.cloth,
            Self::InView(_, cloth) | Self::Averaged(cloth) => cloth,
        }
    }

    fn in_view(&self) -> Option<&InView> {
        match self {
            Self::InView(in_view, _) => Some(in_view),
            Self::All | Self::Averaged(_) => None,
        }
    }

    /// Options of laying it. Yarns that stand for the others have no neighbours to be moved from.
    fn laying(&self, job: &Job<'_>) -> DrapeOptions {
        match self {
            Self::All | Self::InView(..) => job.options,
            Self::Averaged(_) => DrapeOptions { sweeps: Some(false), ..job.options },
        }
    }

    fn add_to(&self, scene: &mut Scene, block: &Block) {
        match self {
            Self::InView(in_view, _) => in_view.add_to(scene, block),
            Self::All => cloth::add_to(scene, block),
            Self::Averaged(_) => {}
        }
    }
}

/// A garment's cloth as a surface, where its pictures are from so far away that no pixel shows a
/// stitch, with the share of the pictures that show it. Only the processor draws such cloth, and
/// none whose fibres someone asked for.
fn averaged(
    job: &Job<'_>,
    scene: &Scene,
    cameras: &[Camera],
    options: &RenderOptions,
) -> Option<(Arc<AveragedCloth>, f32)> {
    let is_far = !job.is_swatch
        && job.settings.fibres != Some(true)
        && options.renderer != RendererChoice::Gpu
        && has_masks(scene, scene.extent, cameras, options);
    let extent = scene.extent.filter(|_| is_far)?;
    let shares = cameras.iter().map(|camera| averaged::share(job.shown, &extent, camera, options));
    let share = shares.fold(1.0, f32::min);
    if share <= 0.0 {
        return None;
    }
    let cloth = AveragedCloth::new(job.cloth.garment(), job.shown, job.cloth.pattern(), scene)?;
    Some((Arc::new(cloth), share))
}

/// The loupe of a garment's only picture.
fn find_loupe(job: &Job<'_>, camera: &Camera) -> Result<Option<Loupe>, RunError> {
    let picture = &job.settings.picture;
    if picture.turntable.is_some() {
        return Ok(None);
    }
    let size = [picture.size.0, picture.size.1];
    let light = pictures::options_of(job).light;
    let wale = job.shown.wale_spacing();
    Loupe::find(picture.loupe, job.cloth.garment(), wale, (camera, &light), size)
}

/// The empty scene of a run's pictures, with the box around its cloth.
pub(super) fn empty_scene(job: &Job<'_>, setup: &Setup, points: &[Vec3]) -> Scene {
    let mut scene = setup.scene(job);
    scene.extent = views::extent(points, job.cloth);
    scene
}
