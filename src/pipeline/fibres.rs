//! The fibres of a run: whether files and pictures show them, and whether files can hold them.
//!
//! In: a [`Job`] and its files. Out: [`Fibres`], or an error before any work.

use super::RunError;
use super::job::Job;
use super::settings::Wanted;
use crate::drape::fibres;
use crate::export::Format;
use crate::ids::index32;
use crate::render::fibres::MIN_YARN_PIXELS;
use crate::render::scene::Shape;
use crate::yarn::fibres::Bundle;
use crate::yarn::tube::Section;

/// The most points of fibres in files: as curves, of which a .usda takes some 20 GB, and as tubes,
/// of which a .glb holds no more than 4 GB.
const MOST_CURVE_POINTS: f64 = 2e8;
const MOST_TUBE_POINTS: f64 = 1.5e7;
/// Edges of a fibre's section in files, where nobody asks for others.
const FIBRE_SR: u32 = 4;

/// The fibres of a run.
pub(super) struct Fibres {
    /// The fibres of each bar's yarns.
    pub(super) bundles: Vec<Bundle>,
    /// Pixels across a yarn from which on a picture shows them.
    pub(super) near: f64,
    /// How the tubes of fibres in files are made; none where files hold yarns.
    pub(super) filed: Option<Section>,
}

impl Fibres {
    /// The fibres that are asked for; unasked, captured cloth shows them in pictures from near.
    pub(super) fn new(
        job: &Job<'_>,
        wanted: &[Wanted],
        section: &Section,
    ) -> Result<Option<Self>, RunError> {
        let asked = job.settings.fibres;
        let is_ribbon = job.settings.picture.shape == Shape::Ribbon;
        if is_ribbon && asked == Some(true) {
            return Err(RunError::RibbonsOfFibres);
        }
        if is_ribbon || !asked.unwrap_or(job.shown.is_laid()) {
            return Ok(None);
        }
        let bundles = fibres::bundles(job.shown, section.radius, job.settings.fibre_radius);
        if asked.is_none() {
            return Ok(Some(Self { bundles, near: MIN_YARN_PIXELS, filed: None }));
        }
        check_formats(wanted)?;
        check_size(job, &bundles, wanted)?;
        let section = Section { sr: job.settings.sr.unwrap_or(FIBRE_SR), ..*section };
        Ok(Some(Self { bundles, near: 0.0, filed: Some(section) }))
    }
}

/// Refuses files of data points, which fibres don't have.
fn check_formats(wanted: &[Wanted]) -> Result<(), RunError> {
    let of_points = wanted.iter().find(|(_, format)| matches!(format, Format::Csv | Format::Npz));
    match of_points {
        Some((path, _)) => Err(RunError::DataPointsOfFibres { path: path.clone() }),
        None => Ok(()),
    }
}

/// Refuses files of more fibres than they or the memory can hold, before the work.
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

/// Points that the fibres of a stitch take, as a mean over the bars.
fn points_a_stitch(job: &Job<'_>, bundles: &[Bundle]) -> f64 {
    let (pattern, shown) = (job.cloth.pattern(), job.shown);
    let side = shown.wale_spacing().max(shown.course_spacing());
    let mut sum = 0.0;
    for (bar, bundle) in bundles.iter().enumerate() {
        let steps =
            if pattern.runs_across(bar) { shown.threading_repeat() } else { shown.repeat() };
        let spans = f64::from(index32(pattern.points_per_repeat(bar))) / f64::from(index32(steps));
        // A span has two points of each fibre at the least.
        sum += f64::from(bundle.count) * (bundle.points_per_mm() * side).max(2.0 * spans);
    }
    sum / f64::from(index32(bundles.len()))
}
