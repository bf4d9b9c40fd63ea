//! The pictures of a run: from the scene to `.png`, one, or several from all around.
//!
//! In: a scene, [`Settings`] and paths. Out: complete files, still under their temporary names.

use std::path::Path;

use glam::Vec3;
use image::RgbaImage;

use super::RunError;
use super::camera::camera;
use super::clock::{Clock, Task};
use super::fibres::Fibres;
use super::settings::Settings;
use crate::export::{Output, png};
use crate::render::fibres as near;
use crate::render::scene::Scene;
use crate::render::{self, Camera, Painter, RendererChoice};
use crate::tile::Tile;

/// Drawn pictures, and the name of the renderer that drew them.
#[derive(Default)]
pub(super) struct Pictures {
    pub(super) drawn_by: String,
    /// The reason why another renderer was used than the chosen one.
    pub(super) notice: Option<String>,
    /// Complete files, still under their temporary names.
    pub(super) files: Vec<Output>,
}

/// Draws the scene, or a tile of the picture, and writes it to `paths`. With a turntable, the paths
/// of one output's frames follow each other. The camera sees all of `extent`. Yarns that are wide
/// enough in the picture are drawn with their fibres.
pub(super) fn draw(
    scene: &Scene,
    fibres: Option<&Fibres>,
    settings: &Settings,
    tile: Option<Tile>,
    extent: &[Vec3],
    paths: &[&Path],
    clock: &mut Clock<'_>,
) -> Result<Pictures, RunError> {
    clock.begin(Task::Render, 0.0);
    let mut options = options(settings);
    if let Some(tile) = tile {
        options.rows = Some(tile.share(options.height));
        // The tiles of several machines must fit together, whichever machine has an adapter. The
        // CPU renderer gives the same pixels everywhere.
        if options.renderer == RendererChoice::Auto {
            options.renderer = RendererChoice::Cpu;
        }
    }
    let count = settings.picture.turntable.unwrap_or(1);
    let (mut far, mut pictures) = (None, Pictures::default());
    for frame in 0..count {
        clock.begin(Task::Render, f64::from(frame) / f64::from(count));
        let listener = clock.listener();
        let progress =
            |done: f32| listener.progress(f64::from((frame as f32 + done) / count as f32));
        let camera = camera(extent, &settings.picture, options.aspect(), frame);
        let size = [options.width, options.height];
        let close_up = fibres
            .and_then(|fibres| near::scene(scene, &fibres.bundles, fibres.near, &camera, size));
        // The scene of yarns serves all frames and is prepared once. The scene of fibres depends on
        // the camera, so it is prepared for each frame.
        let picture = match (&close_up, &mut far) {
            (Some(close_up), _) => pictures.draw(
                &mut Painter::new(close_up, &options)?,
                &camera,
                &options,
                &progress,
            )?,
            (None, Some(far)) => pictures.draw(far, &camera, &options, &progress)?,
            (None, None) => {
                let painter = far.insert(Painter::new(scene, &options)?);
                pictures.draw(painter, &camera, &options, &progress)?
            }
        };
        clock.begin(Task::Compress, 1.0);
        for path in paths.iter().skip(frame as usize).step_by(count as usize) {
            pictures.files.push(png::write(path, &picture)?);
        }
    }
    Ok(pictures)
}

impl Pictures {
    /// Draws one picture, and notes the renderer that drew it.
    fn draw(
        &mut self,
        painter: &mut Painter<'_>,
        camera: &Camera,
        options: &render::RenderOptions,
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

/// The renderer's options from a run's settings. Settings that nobody chose have the renderer's
/// defaults.
#[must_use]
pub fn options(settings: &Settings) -> render::RenderOptions {
    let picture = &settings.picture;
    let defaults = render::RenderOptions::default();
    let mut options = render::RenderOptions {
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
    options
}
