//! One run: a fabric onto a garment or into a swatch, drawn and written.
//!
//! In: a garment or the size of a swatch, a fabric, [`Settings`]. Out: files and [`Done`]. The files
//! appear under their names only when all of them are complete.

use std::borrow::Cow;
use std::cell::RefCell;
use std::path::{Path, PathBuf};

use glam::Vec3;

use super::RunError;
use super::clock::{Clock, Message, Task};
use super::densities::{enlarged, turn_grains};
use super::job::{Job, Source};
use super::limits::{check_laid, check_request, check_settings, loss_warning, unstrained_note};
use super::pictures;
use super::sequence::{self, Sequence};
use super::settings::{Settings, Wanted};
use super::setup::Setup;
use super::stretch::pull;
use super::summary::{Done, RunSummary, say_warnings};
use super::targets::numbered;
use super::views::{self, InView, draped_points};
use super::writers::{check_places, finished, sinks, wanted};
use crate::drape::clearance::{self, BodyClearance};
use crate::drape::{self, Block, Cloth, Totals, swatch_panel};
use crate::export::{ExportError, FileWriter, Format, Output};
use crate::fabric::Fabric;
use crate::garment::{Garment, Panel};
use crate::knit::Pattern;
use crate::map::Mapping;
use crate::render::cloth;
use crate::render::scene::Scene;

/// Knits a fabric onto a garment. With a `sequence`, `garment` is its first frame, and the fabric is
/// knitted onto all frames.
///
/// # Errors
/// [`RunError`]. Nothing is written then, except the frames of a sequence that were complete before.
///
/// ```no_run
/// use warpknit::fabric::Fabric;
/// use warpknit::garment::{self, ReadOptions};
/// use warpknit::pipeline::{Clock, Settings, Source, drape};
/// let garment = garment::read("tshirt.obj".as_ref(), None, &ReadOptions::default())?;
/// let source = Source { stem: "tshirt".into(), ..Source::default() };
/// let (fabric, settings) = (Fabric::named("locknit")?, Settings::default());
/// let done = drape(garment, None, &fabric, &source, &settings, Clock::start(&()))?;
/// println!("{} stitches: {}", done.totals.losses.stitches, done.files);
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
    turn_grains(&mut garment, fabric);
    clock.stop();
    let mut settings = Cow::Borrowed(settings);
    if let Some((eye, target)) = settings.picture.eye {
        // The user's places are in the file's axes.
        let origin = garment.summary.origin;
        settings.to_mut().picture.eye = Some((eye - origin, target - origin));
    }
    let settings = &*settings;
    let area = garment.panels.iter().map(Panel::area).sum();
    // The caller has already applied chosen densities to the fabric. They are never changed here.
    let (shown, note) = if settings.densities.are_chosen() {
        (Cow::Borrowed(fabric), None)
    } else {
        let (shown, note) = enlarged(fabric, area)?;
        (Cow::Owned(shown), note)
    };
    check_settings(settings, source, &shown)?;
    let pattern = relaxed(&shown, &mut clock);
    let cloth = Cloth::cover_with(&garment, &shown, pattern)
        .map_err(|error| RunError::Layout { fabric: source.fabric.clone(), source: error })?;
    let job = Job {
        settings,
        fabric,
        shown: &shown,
        notes: note
            .into_iter()
            .chain(garment.summary.notes.iter().cloned())
            .chain(unstrained_note(&cloth, settings.placement))
            .collect(),
        part: settings.tile.map(|tile| (tile, cloth.part(tile))),
        cloth: &cloth,
        options: settings.placement.into(),
        area,
        source,
        is_swatch: false,
    };
    match sequence {
        None => make(&job, clock),
        Some(sequence) => sequence::make(&job, sequence, clock),
    }
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
    check_settings(settings, source, fabric)?;
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
    let area =
        f64::from(wales) * fabric.wale_spacing() * f64::from(courses) * fabric.course_spacing();
    let job = Job {
        settings: &settings,
        fabric,
        shown: &shown,
        notes: Vec::new(),
        part: settings.tile.map(|tile| (tile, cloth.part(tile))),
        cloth: &cloth,
        options: flat_options(),
        area,
        source,
        is_swatch: true,
    };
    Ok(Done { stretched, ..make(&job, clock)? })
}

/// Options of a swatch: it is its own drape, so no strain has to be looked up.
fn flat_options() -> drape::DrapeOptions {
    drape::DrapeOptions { mapping: Mapping::Smooth, ..drape::DrapeOptions::default() }
}

/// The relaxed repeat of a fabric.
fn relaxed(fabric: &Fabric, clock: &mut Clock<'_>) -> Pattern {
    clock.begin(Task::Relax, 0.0);
    let listener = clock.listener();
    let pattern = Pattern::with_progress(fabric, &mut |done| listener.progress(done));
    clock.stop();
    pattern
}

/// Knits, draws and writes. Files appear under their names only when all are complete.
fn make(job: &Job<'_>, mut clock: Clock<'_>) -> Result<Done, RunError> {
    let outputs = all_around(wanted(job.settings, job.source), job.settings.picture.turntable);
    let pictures: Vec<_> = outputs
        .iter()
        .filter(|(_, format)| *format == Format::Png)
        .map(|(path, _)| path.as_path())
        .collect();
    let setup = Setup::new(job, &outputs)?;
    check_places(job, outputs.iter(), &setup.textures)?;
    let mut scene = setup.scene(job);
    let mut points = if job.is_swatch { Vec::new() } else { draped_points(job.cloth.garment()) };
    let drawn = (!pictures.is_empty()).then(|| {
        scene.extent = views::extent(&points, job.cloth);
        Drawn::of(job, &setup, &scene, &points)
    });
    // The rest that can be refused is refused here, before the work.
    let gb_a_stitch = views::gb_a_stitch(&scene, &points, job.settings);
    check_request(job, drawn.as_ref().map(|drawn| (drawn.cloth(job), gb_a_stitch)))?;
    let mut warnings = setup.first_warnings(job);
    let mut sinks = sinks(&outputs, job, &setup)?;

    let is_only_drawn = pictures.len() == outputs.len();
    clock.begin(Task::Strain, 0.0);
    let cache = job.cache();
    let receivers = Receivers {
        pictures: drawn.as_ref().map(|drawn| (drawn, &mut scene)),
        sinks: &mut sinks,
        is_only_drawn,
    };
    let totals = lay(job, &setup.options, receivers, &mut clock)?;
    cache.keep(job.cloth);
    let in_view = drawn
        .as_ref()
        .filter(|drawn| is_only_drawn && job.part.is_none() && drawn.in_view.is_some());
    // A part of the cloth can be without yarns while the whole has some.
    if job.part.is_none() && in_view.is_none() {
        check_laid(&totals)?;
    }
    let whole = in_view.map(|_| job.cloth.stitches());
    if job.is_swatch {
        points.clone_from(&scene.positions);
    }
    warnings.extend(loss_warning(&totals));
    say_warnings(job, &mut warnings, &clock);
    let draped = wants_clearance(job, &outputs)
        .then(|| body_clearance(job, setup.section.radius, &mut clock));

    clock.begin(Task::Write, 1.0);
    let mut files = finished(sinks)?;
    let drawn_by = if pictures.is_empty() {
        String::new()
    } else {
        draw(job, &setup, (&scene, &points), &pictures, &mut files, &mut warnings, &mut clock)?
    };
    clock.stop();
    // The report comes last, because it has the times of everything else.
    let summary = RunSummary {
        setup: &setup,
        totals: &totals,
        draped,
        warnings,
        drawn_by,
        frames: Vec::new(),
    };
    let (reports, real) = summary.files(job, &outputs, &clock)?;
    files.into_iter().chain(reports).try_for_each(Output::publish)?;
    let names: Vec<_> = outputs.iter().map(|(path, _)| path.display().to_string()).collect();
    Ok(Done { totals, whole, files: names.join(" "), frames: None, real, stretched: None })
}

/// Draws all pictures and adds them to `files`, the complete ones. Cameras see all of `extent`. Returns the renderer's
/// name.
fn draw(
    job: &Job<'_>,
    setup: &Setup,
    (scene, extent): (&Scene, &[Vec3]),
    paths: &[&Path],
    files: &mut Vec<Output>,
    warnings: &mut Vec<String>,
    clock: &mut Clock<'_>,
) -> Result<String, RunError> {
    let fibres = setup.fibres.as_ref();
    let pictures = pictures::draw(scene, fibres, job.settings, job.tile(), extent, paths, clock)?;
    if let Some(notice) = pictures.notice {
        clock.listener().say(Message::Note(&notice));
        warnings.push(notice);
    }
    files.extend(pictures.files);
    Ok(pictures.drawn_by)
}

/// The files of a run. With a turntable, each picture becomes `turntable` numbered ones.
fn all_around(wanted: Vec<Wanted>, turntable: Option<u32>) -> Vec<Wanted> {
    let Some(count) = turntable else { return wanted };
    let mut all = Vec::new();
    for (path, format) in wanted {
        match format {
            Format::Png => {
                let paths: Vec<PathBuf> = numbered(&path, format.ending(), count);
                all.extend(paths.into_iter().map(|path| (path, format)));
            }
            _ => all.push((path, format)),
        }
    }
    all
}

/// What pictures show of a cloth.
struct Drawn<'a> {
    /// What is in view. `None` for all.
    in_view: Option<(InView, Cloth<'a>)>,
}

impl<'a> Drawn<'a> {
    /// Finds what the pictures of a garment show. A swatch is drawn whole.
    fn of(job: &Job<'a>, setup: &Setup, scene: &Scene, points: &[Vec3]) -> Self {
        if job.is_swatch {
            return Self { in_view: None };
        }
        let has_fibres = setup.fibres.is_some();
        let found = InView::of_pictures(job.cloth, scene, points, job.settings, has_fibres);
        Self {
            in_view: found.map(|found| {
                let cloth = found.cloth(job.cloth, &job.options);
                (found, cloth)
            }),
        }
    }

    /// The cloth that pictures need.
    fn cloth<'b>(&'b self, job: &'b Job<'a>) -> &'b Cloth<'a> {
        self.in_view.as_ref().map_or(job.cloth, |(_, cloth)| cloth)
    }

    /// Adds a block of that cloth to a scene.
    fn add_to(&self, scene: &mut Scene, block: &Block) {
        match &self.in_view {
            Some((in_view, _)) => in_view.add_to(scene, block),
            None => cloth::add_to(scene, block),
        }
    }
}

/// The receivers of a run's yarns.
struct Receivers<'a, 'b, 'c> {
    /// What pictures show, and their scene. `None` without pictures.
    pictures: Option<(&'a Drawn<'c>, &'a mut Scene)>,
    /// Files that are written block by block.
    sinks: &'a mut [FileWriter<'b>],
    /// Whether all files are pictures.
    is_only_drawn: bool,
}

/// Lays the yarns block by block and gives each block to the receivers.
fn lay(
    job: &Job<'_>,
    options: &drape::DrapeOptions,
    receivers: Receivers<'_, '_, '_>,
    clock: &mut Clock<'_>,
) -> Result<Totals, RunError> {
    let Receivers { mut pictures, sinks, is_only_drawn } = receivers;
    // The closures below need the clock, and `drape::run` calls them in turn.
    let clock = RefCell::new(clock);
    let mut announce = |stage, done| clock.borrow_mut().begin(Task::from(stage), done);
    // A tile of a picture has the light and shadows of the whole cloth, and a close-up takes a part
    // of it: pictures then need other yarns than files.
    if let Some((drawn, scene)) =
        pictures.take_if(|(drawn, _)| job.part.is_some() || drawn.in_view.is_some())
    {
        let mut show = |blocks: &[Block]| -> Result<(), ExportError> {
            blocks.iter().for_each(|block| drawn.add_to(scene, block));
            Ok(())
        };
        if is_only_drawn && job.part.is_none() {
            return Ok(drape::run(drawn.cloth(job), &job.options, &mut announce, &mut show)?);
        }
        // This time counts as rendering, so that it stays out of the files' own numbers.
        let mut announce = |_, _| clock.borrow_mut().begin(Task::Render, 0.0);
        drape::run(drawn.cloth(job), &job.options, &mut announce, &mut show)?;
    }
    let mut deliver = |blocks: &[Block]| -> Result<(), ExportError> {
        if let Some((drawn, scene)) = &mut pictures {
            blocks.iter().for_each(|block| drawn.add_to(scene, block));
        }
        sinks.iter_mut().try_for_each(|sink| sink.take(blocks))
    };
    Ok(drape::run(job.filed(), options, &mut announce, &mut deliver)?)
}

/// Measures the clearance on the body of yarns drawn with a radius.
fn body_clearance(job: &Job<'_>, radius: f64, clock: &mut Clock<'_>) -> BodyClearance {
    clock.begin(Task::Clearance, 0.0);
    let listener = clock.listener();
    let progress = &mut |done| listener.progress(done);
    let clearance = clearance::measure(job.cloth, &job.options, radius, progress);
    clock.stop();
    clearance
}

/// Whether to measure the clearance on the body: only for a report of the whole cloth, and not for a
/// swatch, because that has no body.
fn wants_clearance(job: &Job<'_>, outputs: &[Wanted]) -> bool {
    // A part lacks its neighbouring yarns, and one of them may be the nearest.
    let draped = !job.is_swatch && job.part.is_none();
    draped && outputs.iter().any(|(_, format)| *format == Format::Json)
}
