//! The pictures of a run: from the scene to `.png`, one, or several from all around.
//!
//! In: a scene, [`Settings`] and paths. Out: complete files, still under their temporary names.

use std::path::Path;
use std::sync::Arc;

use glam::Vec3;
use image::RgbaImage;

use super::RunError;
use super::camera::camera;
use super::clock::{Clock, Task};
use super::densities::Gauge;
use super::estimates::has_masks;
use super::fibres::Fibres;
use super::job::Job;
use super::loupe::Loupe;
use super::settings::Settings;
use crate::export::{Output, png};
use crate::ids::index32;
use crate::render::averaged::AveragedCloth;
use crate::render::scene::{Bounds, Scene};
use crate::render::set::Set;
use crate::render::{Camera, Painter, RenderOptions, RendererChoice, tone};
use crate::system::address_space_gb;

/// Limit of the address space below which no graphics driver is looked for, GB. Drivers and their
/// compilers map one or two, and end the program where they can't.
const DRIVER_LIMIT_GB: f64 = 4.0;

/// Drawn pictures, and the name of the renderer that drew them.
#[derive(Default)]
pub(super) struct Pictures {
    /// What stands around the cloth.
    set: Option<Arc<Set>>,
    pub(super) drawn_by: String,
    /// The reason why another renderer was used than the chosen one.
    pub(super) notice: Option<String>,
    /// Complete files, still under their temporary names.
    pub(super) files: Vec<Output>,
}

/// What a camera sees of a cloth.
pub(super) struct Look<'a> {
    /// Its yarns.
    pub(super) scene: &'a Scene,
    /// Their fibres. Yarns that are wide enough in a picture are drawn with them.
    pub(super) fibres: Option<&'a Fibres>,
    /// The same from far away, if that is what pictures show.
    pub(super) far: Option<FarLook<'a>>,
}

/// Cloth whose stitches are too small for a picture.
pub(super) struct FarLook<'a> {
    pub(super) cloth: &'a Arc<AveragedCloth>,
    /// Share of the picture in which this look is mixed with the yarns.
    pub(super) share: f32,
    /// The threads of seams, which are drawn one by one.
    pub(super) threads: Scene,
}

impl Pictures {
    /// No pictures yet, of cloth in this set.
    pub(super) fn new(set: Option<Arc<Set>>) -> Self {
        Self { set, ..Self::default() }
    }

    /// Draws the scene, or a tile of the picture, and writes it to `paths`. With a turntable, the
    /// paths of one output's frames follow each other. The camera sees all of `extent`. A loupe's
    /// inset is drawn over it.
    pub(super) fn draw(
        &mut self,
        job: &Job<'_>,
        look: &Look<'_>,
        (extent, inset): (&[Vec3], Option<(&Loupe, &RgbaImage)>),
        paths: &[&Path],
        clock: &mut Clock<'_>,
    ) -> Result<(), RunError> {
        let Look { scene, fibres, far } = look;
        clock.begin(Task::Render, 0.0);
        let mut options = RenderOptions { set: self.set.clone(), ..options_of(job) };
        let cameras = cameras(job.settings, &options, extent);
        // Where yarns are so thin, the graphics processor's light is that of a mean over the cloth,
        // and the processor's is nearer to traced light. All frames of a sequence lie within the
        // extent, so one renderer draws them all.
        let around = Bounds::around(extent);
        options.renderer =
            processor_if(options.renderer, || has_masks(scene, around, &cameras, &options));
        let count = cameras.len();
        let mut yarns = None;
        for (frame, camera) in cameras.iter().enumerate() {
            let share = |done: f64| (f64::from(index32(frame)) + done) / f64::from(index32(count));
            clock.begin(Task::Render, share(0.0));
            let listener = clock.listener();
            let progress = |done: f32| listener.progress(share(f64::from(done)));
            // The scene of yarns serves all frames and is prepared once. The scene of fibres
            // depends on the camera, so it is prepared for each frame.
            let mut picture = match (far, close_up(scene, *fibres, camera, &options), &mut yarns) {
                (Some(far), _, _) if far.share >= 1.0 => {
                    self.paint_far(far, camera, &options, &progress)?
                }
                (_, Some(close_up), _) => {
                    let painter = &mut Painter::new(&close_up, &options)?;
                    self.paint(painter, camera, &options, &progress)?
                }
                (_, None, Some(yarns)) => self.paint(yarns, camera, &options, &progress)?,
                (_, None, None) => {
                    let painter = yarns.insert(Painter::new(scene, &options)?);
                    self.paint(painter, camera, &options, &progress)?
                }
            };
            if let Some(far) = far.as_ref().filter(|far| far.share < 1.0) {
                let averaged = self.paint_far(far, camera, &options, &progress)?;
                tone::mix(&mut picture, &averaged, far.share);
            }
            if let Some((loupe, inset)) = inset {
                loupe.draw(&mut picture, options.rows().start, inset);
            }
            clock.begin(Task::Compress, 1.0);
            for path in paths.iter().skip(frame).step_by(count) {
                self.files.push(png::write(path, &picture)?);
            }
        }
        Ok(())
    }

    /// Draws one picture of averaged cloth with the threads of its seams.
    fn paint_far(
        &mut self,
        far: &FarLook<'_>,
        camera: &Camera,
        options: &RenderOptions,
        progress: &(dyn Fn(f32) + Sync),
    ) -> Result<RgbaImage, RunError> {
        let options = RenderOptions { averaged: Some(Arc::clone(far.cloth)), ..options.clone() };
        self.paint(&mut Painter::new(&far.threads, &options)?, camera, &options, progress)
    }

    /// Draws the inset of a loupe.
    pub(super) fn inset(
        &mut self,
        scene: &Scene,
        fibres: Option<&Fibres>,
        job: &Job<'_>,
        loupe: &Loupe,
    ) -> Result<RgbaImage, RunError> {
        let options = RenderOptions { set: self.set.clone(), ..inset_options(job, loupe) };
        let camera = loupe.camera();
        let close_up = close_up(scene, fibres, camera, &options);
        let mut painter = Painter::new(close_up.as_ref().unwrap_or(scene), &options)?;
        self.paint(&mut painter, camera, &options, &|_| ())
    }

    /// Draws one picture, and notes the renderer that drew it.
    fn paint(
        &mut self,
        painter: &mut Painter<'_>,
        camera: &Camera,
        options: &RenderOptions,
        progress: &(dyn Fn(f32) + Sync),
    ) -> Result<RgbaImage, RunError> {
        let picture = painter.draw(camera, options, progress)?;
        painter.name().clone_into(&mut self.drawn_by);
        // A notice of an earlier picture is kept: the run reports it once.
        if let Some(notice) = painter.notice() {
            self.notice = Some(notice.to_owned());
        }
        Ok(picture)
    }
}

/// The scene of fibres and hairs for a camera. `None` where yarns are drawn whole and bare.
fn close_up(
    scene: &Scene,
    fibres: Option<&Fibres>,
    camera: &Camera,
    options: &RenderOptions,
) -> Option<Scene> {
    let size = [options.width, options.height];
    fibres.and_then(|fibres| fibres.close_up(scene, camera, size))
}

/// The cameras of a run's pictures. They see all of `extent`.
pub(super) fn cameras(
    settings: &Settings,
    options: &RenderOptions,
    extent: &[Vec3],
) -> Vec<Camera> {
    let frames = 0..settings.picture.turntable.unwrap_or(1);
    frames.map(|frame| camera(extent, &settings.picture, options.aspect(), frame)).collect()
}

/// The renderer's options for a job's pictures, or for its tile of them.
pub(super) fn options_of(job: &Job<'_>) -> RenderOptions {
    let mut options = options(job.settings);
    options.rows = job.tile().map(|tile| tile.share(options.height));
    // The tiles of several machines must fit together, whichever machine has an adapter. The CPU
    // renderer gives the same pixels everywhere. At true gauge its light is nearer to traced light
    // too. The graphics processor draws no bodies, and its shadows are those of the studio's sun,
    // whatever the size of an environment's.
    options.renderer = processor_if(options.renderer, || {
        job.tile().is_some()
            || job.gauge == Gauge::True
            || job.settings.picture.has_body()
            || job.settings.picture.environment.is_some()
            || address_space_gb().is_some_and(|limit| limit < DRIVER_LIMIT_GB)
    });
    options
}

/// The renderer's options for the inset of a loupe. All tiles of a picture draw the whole of it. A
/// picture that needs a loupe has thin yarns, which the processor draws, and so its inset too.
pub(super) fn inset_options(job: &Job<'_>, loupe: &Loupe) -> RenderOptions {
    let [width, height] = loupe.size();
    let options = RenderOptions { width, height, rows: None, is_round: true, ..options_of(job) };
    RenderOptions { renderer: processor_if(options.renderer, || true), ..options }
}

/// The processor, where nobody chose a renderer and the picture needs it.
fn processor_if(chosen: RendererChoice, needs_it: impl FnOnce() -> bool) -> RendererChoice {
    if chosen == RendererChoice::Auto && needs_it() { RendererChoice::Cpu } else { chosen }
}

/// The renderer's options from a run's settings. Settings that nobody chose have the renderer's
/// defaults.
#[must_use]
pub fn options(settings: &Settings) -> RenderOptions {
    let picture = &settings.picture;
    let defaults = RenderOptions::default();
    let mut options = RenderOptions {
        width: picture.size.0,
        height: picture.size.1,
        renderer: picture.renderer,
        spp: picture.spp,
        samples: picture.samples,
        st: settings.st.unwrap_or(defaults.st),
        sr: settings.sr.unwrap_or(defaults.sr),
        lod: picture.lod,
        ..defaults
    };
    if let Some(background) = picture.background {
        options.background = background;
    }
    if let Some(environment) = &picture.environment {
        options.light = environment.light();
    } else if let Some(sun) = picture.sun {
        options.light.sun_direction = sun.as_vec3();
    }
    options
}
