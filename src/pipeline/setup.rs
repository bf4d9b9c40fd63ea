//! What a run needs before its first yarn: tubes, textures, fibres and the clearance of the repeat.
//!
//! In: a [`Job`] and its files. Out: [`Setup`], or an error before any work.

use std::sync::Arc;

use super::RunError;
use super::densities::drawn_radius;
use super::fibres::Fibres;
use super::job::Job;
use super::settings::{Settings, Wanted};
use super::textures::{self, Textures};
use crate::drape::DrapeOptions;
use crate::export::{TextureSet, default_section};
use crate::knit::clearance::{self, Clearance};
use crate::render::scene::{Scene, Shape};
use crate::yarn::tube::Section;

/// What a run's files make and draw with.
pub(super) struct Setup {
    pub(super) section: Section,
    pub(super) textures: Textures,
    /// The same as files hold them.
    pub(super) textures_in_files: Arc<TextureSet>,
    /// The yarns' fibres, where they are to be seen.
    pub(super) fibres: Option<Fibres>,
    /// How yarns are laid, with surfaces where a file holds them.
    pub(super) options: DrapeOptions,
    /// How near yarns come to each other on the flat fabric.
    pub(super) near: Clearance,
}

impl Setup {
    /// What a run with these files needs.
    pub(super) fn new(job: &Job<'_>, wanted: &[Wanted]) -> Result<Self, RunError> {
        let section = section(job)?;
        let near = clearance::measure(job.shown, job.cloth.pattern(), section.radius);
        let wants_surface = wanted.iter().any(|(_, format)| format.holds_tubes());
        let options = DrapeOptions { surface: wants_surface.then_some(section), ..job.options };
        let textures = Textures::read(job.settings.picture.texture.as_deref(), job.shown)?;
        let textures_in_files = textures_in_files(wanted, job, section.radius, &textures);
        let fibres = Fibres::new(job, wanted, &section)?;
        Ok(Self { section, textures, textures_in_files, fibres, options, near })
    }

    /// Warnings about the garment and about how the fabric is drawn, before any yarn is laid.
    pub(super) fn first_warnings(&self, job: &Job<'_>) -> Vec<String> {
        let mut warnings = job.cloth.garment().summary.warnings.clone();
        let pattern = job.cloth.pattern();
        warnings.extend(clearance::warnings(job.shown, pattern, &self.near, self.section.radius));
        if job.settings.picture.shape == Shape::Ribbon {
            warnings.extend(self.textures.misfit(job.shown));
        }
        warnings
    }

    /// The scene that the run's yarns are drawn in.
    pub(super) fn scene(&self, job: &Job<'_>) -> Scene {
        let shape = job.settings.picture.shape;
        textures::scene(shape, job.shown, self.section.radius, &self.textures)
    }
}

/// The textures of these files, made ready where there is a file that holds some.
fn textures_in_files(
    outputs: &[Wanted],
    job: &Job<'_>,
    radius: f64,
    textures: &Textures,
) -> Arc<TextureSet> {
    if !outputs.iter().any(|(_, format)| format.holds_textures()) {
        return Arc::default();
    }
    let scene = textures::scene(Shape::Tube, job.shown, radius, textures);
    Arc::new(TextureSet::from_scene(&scene))
}

/// How fine and how thick tubes in files are.
fn section(job: &Job<'_>) -> Result<Section, RunError> {
    let Settings { radius, flatten, caps, .. } = *job.settings;
    let default = default_section(drawn_radius(job.shown, radius)?);
    let st = job.settings.st.unwrap_or(default.st);
    let sr = job.settings.sr.unwrap_or(default.sr);
    Ok(Section { st, sr, flatten, caps, ..default })
}
