//! One run: a fabric onto a garment or into a swatch, drawn and written.
//!
//! In: a garment or the size of a swatch, a fabric, [`Settings`]. Out: files and [`Done`]. The files
//! appear under their names only when all of them are complete. A picture of a garment at true gauge
//! and files of it are jobs of their own: its cloth is then knitted twice.

use std::borrow::Cow;

use super::RunError;
use super::clock::{Clock, Task};
use super::densities::{Gauge, Shown, drawn_radius, shown, turn_panels};
use super::edges;
use super::job::{Job, Source};
use super::limits::{check_settings, lengths_note};
use super::make::make;
use super::motion::Sequence;
use super::sequence;
use super::settings::{Settings, Wanted};
use super::stretch::pull;
use super::summary::Done;
use super::writers::wanted;
use crate::drape::evenness::Evenness;
use crate::drape::{self, Cloth, LayoutError, swatch_panel};
use crate::edges::{Edges, Finished};
use crate::export::Format;
use crate::fabric::Fabric;
use crate::garment::{Garment, Panel};
use crate::knit::Pattern;
use crate::map::Mapping;

/// Files that show one cloth, before its yarns are laid.
struct Part<'a> {
    shown: Shown<'a>,
    pattern: Pattern,
    /// The garment's edges and the garment with these finished, where the files show that.
    finished: Option<(Edges, Finished)>,
}

/// Knits a fabric onto a garment. With a `sequence`, `garment` is its first frame, and the fabric is
/// knitted onto all frames.
///
/// # Errors
/// [`RunError`]. Nothing is written then, except the frames of a sequence that were complete before.
///
/// ```no_run
/// use warpknit::fabric::Fabric;
/// use warpknit::garment::ReadOptions;
/// use warpknit::pipeline::{Clock, Settings, Source, drape, read_garment};
/// let garment = read_garment("tshirt.obj".as_ref(), None, &ReadOptions::default())?;
/// let source = Source { stem: "tshirt".into(), ..Source::default() };
/// let (fabric, settings) = (Fabric::named("locknit")?, Settings::default());
/// let done = drape(garment, None, &fabric, &source, &settings, Clock::start(&()))?;
/// for part in done.parts {
///     println!("{} stitches: {}", part.totals.losses.stitches, part.files);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn drape(
    mut garment: Garment,
    sequence: Option<&Sequence<'_>>,
    fabric: &Fabric,
    source: &Source,
    settings: &Settings,
    mut clock: Clock<'_>,
) -> Result<Done, RunError> {
    turn_panels(&mut garment, fabric);
    clock.stop();
    let mut settings = Cow::Borrowed(settings);
    if let Some((eye, target)) = settings.picture.eye {
        // The user's places are in the file's axes.
        let origin = garment.summary.origin;
        settings.to_mut().picture.eye = Some((eye - origin, target - origin));
    }
    let settings = &*settings;
    let area = area_of(&garment);
    let outputs = wanted(settings, source);
    check_settings(settings, source, &outputs, sequence.is_some())?;
    let whole = shown(fabric, area, settings, outputs, sequence.is_some())?;
    let parts = parts(whole, &garment, settings, source, &mut clock)?;
    let cloths = parts.iter().map(|part| {
        let garment = part.finished.as_ref().map_or(&garment, |(_, finished)| &finished.garment);
        let Shown { fabric: shown, outputs, .. } = &part.shown;
        let cloth = Cloth::cover_with(garment, shown, part.pattern.clone())
            .map_err(|error| misfit(error, source))?;
        spread_for(outputs, cloth, shown, settings)
    });
    let cloths = cloths.collect::<Result<Vec<_>, RunError>>()?;
    let jobs: Vec<_> = parts
        .iter()
        .zip(&cloths)
        .map(|(part, cloth)| {
            let Shown { fabric: shown, outputs, gauge } = &part.shown;
            let notes = garment.summary.all_notes().into_iter();
            let options = laying(settings, *gauge);
            Job {
                settings,
                fabric,
                shown,
                outputs: outputs.clone(),
                gauge: *gauge,
                notes: notes.chain(lengths_note(cloth, &options)).collect(),
                part: settings.tile.map(|tile| (tile, cloth.part(tile))),
                cloth,
                edges: part.finished.as_ref().map(|(edges, _)| edges),
                threads: part.finished.as_ref().map_or(&[], |(_, finished)| &finished.threads),
                options,
                area: area_of(cloth.garment()),
                source,
                is_swatch: false,
                stretched: None,
            }
        })
        .collect();
    match sequence {
        Some(sequence) => sequence::make(&jobs, sequence, clock),
        None => make(&jobs, clock),
    }
}

/// Relaxes the repeat of each cloth of a run, and divides files with finished edges from those without.
fn parts<'a>(
    whole: Vec<Shown<'a>>,
    garment: &Garment,
    settings: &Settings,
    source: &Source,
    clock: &mut Clock<'_>,
) -> Result<Vec<Part<'a>>, RunError> {
    let mut parts = Vec::new();
    for cloth in whole {
        let radius = drawn_radius(&cloth.fabric, settings.radius)?;
        Cloth::check_sizes(garment, &cloth.fabric).map_err(|error| misfit(error, source))?;
        let pattern = relaxed(&cloth.fabric, clock);
        for (shown, has_edges) in edges::divided(cloth, settings.picture.edges) {
            let finished = has_edges.then(|| {
                let edges = edges::edges_of(garment, &pattern, radius);
                let finished = edges.finish(garment);
                (edges, finished)
            });
            parts.push(Part { shown, pattern: pattern.clone(), finished });
        }
    }
    Ok(parts)
}

/// A fabric that has no place on a garment.
fn misfit(error: LayoutError, source: &Source) -> RunError {
    RunError::Layout { fabric: source.fabric.clone(), source: error }
}

/// Knits a flat piece of fabric of `wales` yarns a bar and `courses` courses, and pulls it if the
/// settings say so.
///
/// # Errors
/// [`RunError`]. Nothing is written then.
pub fn swatch(
    [wales, courses]: [u32; 2],
    fabric: &Fabric,
    source: &Source,
    settings: &Settings,
    mut clock: Clock<'_>,
) -> Result<Done, RunError> {
    let outputs = wanted(settings, source);
    check_settings(settings, source, &outputs, false)?;
    drawn_radius(fabric, settings.radius)?;
    let pattern = relaxed(fabric, &mut clock);
    let mut settings = Cow::Borrowed(settings);
    let (shown, pattern, stretched) = match settings.stretch {
        None => (Cow::Borrowed(fabric), pattern, None),
        Some(stretch) => {
            let (pulled, stretched) = pull(fabric, &pattern, stretch, &mut clock)?;
            // Densities limit the radius at which loops are drawn. Pulled yarns stay as thick.
            settings.to_mut().radius.get_or_insert(fabric.radius());
            (Cow::Owned(pulled.fabric), pulled.pattern, Some(stretched))
        }
    };
    let panel = swatch_panel(&shown, wales, courses);
    let cloth = Cloth::swatch_with(&panel, &shown, pattern, [wales, courses]);
    let cloth = spread_for(&outputs, cloth, &shown, &settings)?;
    let area =
        f64::from(wales) * fabric.wale_spacing() * f64::from(courses) * fabric.course_spacing();
    let job = Job {
        settings: &settings,
        fabric,
        shown: &shown,
        outputs,
        gauge: Gauge::Chosen,
        notes: Vec::new(),
        part: settings.tile.map(|tile| (tile, cloth.part(tile))),
        cloth: &cloth,
        edges: None,
        threads: &[],
        options: flat_options(&settings),
        area,
        source,
        is_swatch: true,
        stretched: stretched.clone(),
    };
    Ok(Done { stretched, ..make(&[job], clock)? })
}

/// A cloth with spread yarns, where any file shows their sections and the settings ask for it.
fn spread_for<'a>(
    outputs: &[Wanted],
    cloth: Cloth<'a>,
    shown: &Fabric,
    settings: &Settings,
) -> Result<Cloth<'a>, RunError> {
    let shows = |format: Format| format == Format::Png || format.holds_tubes();
    if !outputs.iter().any(|(_, format)| shows(*format)) {
        return Ok(cloth);
    }
    let radius = drawn_radius(shown, settings.radius)?;
    Ok(spread(cloth, shown, radius, (settings.flatten, settings.picture.evenness)))
}

/// A cloth whose yarns lie as flat as their neighbours leave room, unless a ratio is chosen or the
/// cloth is regular.
pub fn spread<'a>(
    cloth: Cloth<'a>,
    fabric: &Fabric,
    radius: f64,
    (flatten, evenness): (Option<f64>, Evenness),
) -> Cloth<'a> {
    if flatten.is_none() && evenness == Evenness::Uneven {
        cloth.with_spread_yarns(fabric, radius)
    } else {
        cloth
    }
}

/// Flat area of a garment, mm².
fn area_of(garment: &Garment) -> f64 {
    garment.panels.iter().map(Panel::area).sum()
}

/// Options of a garment's cloth. A picture at true gauge that nobody asked for is not swept: there is
/// little to mend, and less to see of it.
fn laying(settings: &Settings, gauge: Gauge) -> drape::DrapeOptions {
    let mut options = drape::DrapeOptions {
        evenness: settings.picture.evenness,
        ..drape::DrapeOptions::from(settings.placement)
    };
    if gauge == Gauge::True {
        options.sweeps.get_or_insert(false);
    }
    options
}

/// Options of a swatch: it is its own drape, so no strain has to be looked up.
fn flat_options(settings: &Settings) -> drape::DrapeOptions {
    let evenness = settings.picture.evenness;
    drape::DrapeOptions { mapping: Mapping::Smooth, evenness, ..drape::DrapeOptions::default() }
}

/// The relaxed repeat of a fabric.
fn relaxed(fabric: &Fabric, clock: &mut Clock<'_>) -> Pattern {
    clock.begin(Task::Relax, 0.0);
    let listener = clock.listener();
    let pattern = Pattern::with_progress(fabric, &mut |done| listener.progress(done));
    clock.stop();
    pattern
}
