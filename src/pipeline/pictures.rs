//! The pictures of a run: from the scene to `.png`, one or all around.
//!
//! In: a scene, [`Settings`] and paths. Out: files that wait for their names.

use std::path::Path;

use glam::Vec3;

use super::RunError;
use super::camera::camera;
use super::clock::{Clock, Task};
use super::fibres::Fibres;
use super::settings::Settings;
use crate::export::{Output, png};
use crate::render::fibres as near;
use crate::render::scene::Scene;
use crate::render::{self, Painter, RendererChoice};
use crate::tile::Tile;

/// What drew, and where the pictures wait for their names.
pub(super) struct Pictures {
    pub(super) drawn_by: String,
    /// Why it was not what was asked for.
    pub(super) notice: Option<String>,
    pub(super) files: Vec<Output>,
}

/// Draws the scene, or a tile of the picture, and writes it to `paths`: each place's frames in a
/// row. The camera sees all of `seen`, or all of the scene, with its fibres where they show.
pub(super) fn draw(
    scene: &Scene,
    fibres: Option<&Fibres>,
    settings: &Settings,
    tile: Option<Tile>,
    seen: Option<&[Vec3]>,
    paths: &[&Path],
    clock: &mut Clock<'_>,
) -> Result<Pictures, RunError> {
    clock.begin(Task::Render, 0.0);
    let mut options = options(settings);
    if let Some(tile) = tile {
        options.rows = Some(tile.share(options.height));
        // What one machine draws and another one draws must fit together, whichever has an adapter.
        if options.renderer == RendererChoice::Auto {
            options.renderer = RendererChoice::Cpu;
        }
    }
    let count = settings.picture.turntable.unwrap_or(1);
    let (mut far, mut drawn_by, mut notice) = (None, String::new(), None);
    let mut files = Vec::new();
    for frame in 0..count {
        clock.begin(Task::Render, f64::from(frame) / f64::from(count));
        let listener = clock.listener();
        let progress =
            |done: f32| listener.progress(f64::from((frame as f32 + done) / count as f32));
        let camera = camera(scene, seen, &settings.picture, options.aspect(), frame);
        let size = [options.width, options.height];
        let spun = fibres
            .and_then(|fibres| near::scene(scene, &fibres.bundles, fibres.near, &camera, size));
        let mut drawn = |painter: &mut Painter<'_>| {
            let picture = painter.draw(&camera, &options, &progress)?;
            painter.name().clone_into(&mut drawn_by);
            notice = painter.notice().map(str::to_owned).or(notice.take());
            Ok::<_, RunError>(picture)
        };
        // Yarns are made ready once; fibres are those that this camera sees.
        let picture = match (&spun, &mut far) {
            (Some(spun), _) => drawn(&mut Painter::new(spun, &options)?)?,
            (None, Some(far)) => drawn(far)?,
            (None, None) => drawn(far.insert(Painter::new(scene, &options)?))?,
        };
        clock.begin(Task::Compress, 1.0);
        for path in paths.iter().skip(frame as usize).step_by(count as usize) {
            files.push(png::write(path, &picture)?);
        }
    }
    Ok(Pictures { drawn_by, notice, files })
}

/// The renderer's options.
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
