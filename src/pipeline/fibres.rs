//! The fibres and hairs of a run: whether files and pictures show them, and whether files can hold
//! them.
//!
//! In: a [`Job`] and its files. Out: [`Fibres`], or an error before any work.

use super::RunError;
use super::job::Job;
use super::settings::Wanted;
use crate::drape::evenness::Evenness;
use crate::drape::fibres;
use crate::export::Format;
use crate::ids::index32;
use crate::render::fibres::MIN_YARN_PIXELS;
use crate::render::scene::{Scene, Shape};
use crate::render::{self, Camera};
use crate::yarn::fibres::Bundle;
use crate::yarn::hairs;
use crate::yarn::tube::Section;

/// The most points of fibres in a file. As curves, so many make a .usda of about 20 GB. As tubes,
/// more would not fit the 4 GB of a .glb.
const MOST_CURVE_POINTS: f64 = 2e8;
const MOST_TUBE_POINTS: f64 = 1.5e7;
/// Edges of a fibre's section in files, unless others were chosen. Fibres are so thin that a square
/// section suffices.
const FIBRE_SR: u32 = 4;

/// The fibres of a run.
pub(super) struct Fibres {
    /// The fibres of each bar's yarns.
    bundles: Vec<Bundle>,
    /// Width of a yarn in a picture, pixels, from which on its fibres are drawn. `None` if yarns are
    /// drawn whole, with their hairs.
    near: Option<f64>,
    /// Section of the fibres' tubes in files. `None` if files contain yarns.
    filed: Option<Section>,
}

impl Fibres {
    /// The fibres of a run, or `None` for yarns without hairs. Where nobody chose, captured cloth has
    /// fibres in pictures from near, and no other cloth has. Regular cloth has no hairs.
    pub(super) fn new(
        job: &Job<'_>,
        wanted: &[Wanted],
        section: &Section,
    ) -> Result<Option<Self>, RunError> {
        let asked = job.settings.fibres;
        // A ribbon shows its fibres by its texture.
        let is_ribbon = job.settings.picture.shape == Shape::Ribbon;
        if is_ribbon && asked == Some(true) {
            return Err(RunError::RibbonsOfFibres);
        }
        if is_ribbon || asked == Some(false) {
            return Ok(None);
        }
        let mut bundles = fibres::bundles(job.shown, section.radius, job.settings.fibre_radius);
        if job.settings.picture.evenness == Evenness::Regular {
            bundles.iter_mut().for_each(|bundle| bundle.hairs = None);
        }
        if asked.is_none() {
            // Nobody asked: files keep the yarns, and only near pictures show fibres.
            let near = job.shown.is_laid().then_some(MIN_YARN_PIXELS);
            let shows_any = near.is_some() || bundles.iter().any(|bundle| bundle.hairs.is_some());
            return Ok(shows_any.then_some(Self { bundles, near, filed: None }));
        }
        check_formats(wanted)?;
        check_size(job, &bundles, wanted)?;
        let section = Section { sr: job.settings.sr.unwrap_or(FIBRE_SR), ..*section };
        Ok(Some(Self { bundles, near: Some(0.0), filed: Some(section) }))
    }

    /// Whether fibres take the place of yarns in pictures from near.
    pub(super) fn replace_yarns(&self) -> bool {
        self.near.is_some()
    }

    /// The bundles that files hold in place of yarns, and the section of their tubes.
    pub(super) fn in_files(&self) -> Option<(&[Bundle], Section)> {
        self.filed.map(|section| (self.bundles.as_slice(), section))
    }

    /// The scene of fibres and hairs for a camera and a picture of this size in pixels. `None` where
    /// yarns are drawn whole and bare.
    pub(super) fn close_up(&self, scene: &Scene, camera: &Camera, size: [u32; 2]) -> Option<Scene> {
        let near = self.near;
        let fibres =
            near.and_then(|near| render::fibres::scene(scene, &self.bundles, near, camera, size));
        render::hairs::with_hairs(scene, fibres, &self.bundles, camera, size)
    }
}

/// Refuses files of data points, because fibres have none.
fn check_formats(wanted: &[Wanted]) -> Result<(), RunError> {
    let of_points = wanted.iter().find(|(_, format)| matches!(format, Format::Csv | Format::Npz));
    match of_points {
        Some((path, _)) => Err(RunError::DataPointsOfFibres { path: path.clone() }),
        None => Ok(()),
    }
}

/// Refuses files of too many fibres, before the work.
fn check_size(job: &Job<'_>, bundles: &[Bundle], wanted: &[Wanted]) -> Result<(), RunError> {
    let stitches = job.filed().stitches();
    #[expect(clippy::cast_precision_loss, reason = "an estimate")]
    let points = points_a_stitch(job, bundles) * stitches as f64;
    for (path, format) in wanted {
        let most = match format {
            Format::Png | Format::Json => continue,
            format if format.holds_tubes() => MOST_TUBE_POINTS,
            _ => MOST_CURVE_POINTS,
        };
        if points > most {
            return Err(RunError::TooManyFibres { path: path.clone(), stitches, points, most });
        }
    }
    Ok(())
}

/// Number of points of the fibres of one stitch, as a mean over the bars.
fn points_a_stitch(job: &Job<'_>, bundles: &[Bundle]) -> f64 {
    let (pattern, shown) = (job.cloth.pattern(), job.shown);
    let side = shown.wale_spacing().max(shown.course_spacing());
    let mut sum = 0.0;
    for (bar, bundle) in bundles.iter().enumerate() {
        let steps =
            if pattern.runs_across(bar) { shown.threading_repeat() } else { shown.repeat() };
        let spans = f64::from(index32(pattern.points_per_repeat(bar))) / f64::from(index32(steps));
        // A fibre has a point for each of its steps along the yarn, but at least two for each span
        // between data points.
        sum += f64::from(bundle.count) * (bundle.points_per_mm() * side).max(2.0 * spans);
        let hairs = bundle.hairs.map_or(0.0, |hairs| hairs.per_mm);
        sum += hairs * side * f64::from(hairs::POINTS);
    }
    sum / f64::from(index32(bundles.len()))
}
