//! Preparation of a run before its first yarn: tubes, textures, fibres and the repeat's clearance.
//!
//! In: a [`Job`] and its files. Out: [`Setup`], or an error before any work.

use std::sync::Arc;

use super::RunError;
use super::densities::drawn_radius;
use super::edges;
use super::fibres::Fibres;
use super::job::Job;
use super::numbers::RealCloth;
use super::settings::{Settings, Wanted};
use super::textures::{self, Textures};
use super::warnings::{loop_warnings, measured_warnings};
use crate::drape::DrapeOptions;
use crate::drape::evenness::Evenness;
use crate::export::{Facts, Format, TextureSet, default_section};
use crate::knit::clearance::{self, Clearance};
use crate::knit::links::{self, Links};
use crate::knit::run_in;
use crate::render::scene::{Scene, Shape};
use crate::yarn::tube::Section;

/// The prepared parts of a run.
pub(super) struct Setup {
    /// Section of the tubes in files.
    pub(super) section: Section,
    pub(super) textures: Textures,
    /// The textures in the form in which files store them.
    pub(super) textures_in_files: Arc<TextureSet>,
    /// What a page says of the fabric. Empty without one.
    pub(super) facts: Facts,
    /// The yarns' fibres and hairs. `None` if yarns are drawn and written whole and bare.
    pub(super) fibres: Option<Fibres>,
    /// Options of laying the yarns of files, with surfaces if one needs them.
    pub(super) options: DrapeOptions,
    /// Clearance between yarns on the flat fabric.
    pub(super) near: Clearance,
    /// Whether its loops are drawn through each other.
    pub(super) links: Links,
}

impl Setup {
    /// Prepares a run that writes these files.
    pub(super) fn new(job: &Job<'_>, wanted: &[Wanted]) -> Result<Self, RunError> {
        let section = section(job)?;
        let pattern = job.cloth.pattern();
        run_in::check(job.shown, pattern)?;
        let near = clearance::measure(job.shown, pattern, section.radius);
        let links = links::measure(job.shown, pattern);
        // Pictures make their own surfaces. Without a file of tubes a run needs none.
        let wants_surface = wanted.iter().any(|(_, format)| format.holds_tubes());
        let surface = wants_surface.then_some(section);
        let options = DrapeOptions { surface, evenness: Evenness::Regular, ..job.options };
        let textures = Textures::read(job.settings.picture.texture.as_deref(), job.shown)?;
        let textures_in_files = textures_in_files(wanted, job, section.radius, &textures);
        let fibres = Fibres::new(job, wanted, &section)?;
        let facts = facts(wanted, job, section.radius, near);
        Ok(Self { section, textures, textures_in_files, facts, fibres, options, near, links })
    }

    /// Warnings about the garment and about how the fabric is drawn, before any yarn is laid.
    pub(super) fn first_warnings(&self, job: &Job<'_>) -> Vec<String> {
        let garment = job.cloth.garment();
        let mut warnings = garment.summary.warnings.clone();
        let (pattern, radius) = (job.cloth.pattern(), self.section.radius);
        match &job.stretched {
            // What densities and yarns would fit says nothing of cloth that is pulled.
            Some(stretched) => {
                warnings.extend(loop_warnings(job.shown, pattern, &self.links));
                warnings.extend(stretched.warning(&self.near));
            }
            None => {
                let (near, links) = (&self.near, &self.links);
                warnings.extend(measured_warnings(job.shown, pattern, radius, near, links));
            }
        }
        if job.settings.picture.shape == Shape::Ribbon {
            warnings.extend(self.textures.misfit(job.shown));
        }
        warnings
    }

    /// The empty scene for the run's yarns.
    pub(super) fn scene(&self, job: &Job<'_>) -> Scene {
        let shape = job.settings.picture.shape;
        let Section { radius, flatten, .. } = self.section;
        let mut scene =
            textures::scene(shape, job.shown, radius, &self.textures).flattened(flatten);
        edges::add_thread_look(&mut scene, job.threads);
        Scene { evenness: job.options.evenness, spread: job.cloth.spread().cloned(), ..scene }
    }
}

/// The textures in the form in which files store them. Empty if no file stores textures.
fn textures_in_files(
    outputs: &[Wanted],
    job: &Job<'_>,
    radius: f64,
    textures: &Textures,
) -> Arc<TextureSet> {
    // Encoding textures takes time, so it is done only for files that store them.
    if !outputs.iter().any(|(_, format)| format.holds_textures()) {
        return Arc::default();
    }
    let scene = textures::scene(Shape::Tube, job.shown, radius, textures);
    Arc::new(TextureSet::from_scene(&scene))
}

/// What a page says of the fabric. Its numbers take a while, so without a page there are none.
fn facts(wanted: &[Wanted], job: &Job<'_>, radius: f64, near: Clearance) -> Facts {
    if !wanted.iter().any(|(_, format)| *format == Format::Html) {
        return Facts::default();
    }
    let RealCloth { fabric, numbers, .. } = RealCloth::of_job(job, radius, near);
    Facts::new(&fabric, &numbers, (job.shown, job.cloth.pattern()))
}

/// The section of tubes in files: the chosen values, or else the defaults.
fn section(job: &Job<'_>) -> Result<Section, RunError> {
    let Settings { radius, flatten, caps, .. } = *job.settings;
    let default = default_section(drawn_radius(job.shown, radius)?);
    let st = job.settings.st.unwrap_or(default.st);
    let sr = job.settings.sr.unwrap_or(default.sr);
    Ok(Section { st, sr, flatten: flatten.unwrap_or(1.0), caps, ..default })
}
