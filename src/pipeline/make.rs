//! The work of a run: its jobs are prepared, then knitted, drawn and written, one after the other.
//!
//! In: the [`Job`]s of a run, one, or that of its pictures and that of its files. Out: files and
//! [`Done`]. Whatever can be refused is refused before the first yarn is laid. Files appear under
//! their names only when those of all jobs are complete.

use std::cell::RefCell;
use std::path::PathBuf;
use std::sync::Arc;

use glam::Vec3;

use super::RunError;
use super::clock::{Clock, Task};
use super::drawn::{Drawn, empty_scene};
use super::edges;
use super::job::Job;
use super::limits::{
    check_laid, check_memory, check_pages, check_stitches, locked_warning, loss_warning,
};
use super::messages::Messages;
use super::notes;
use super::pictures::{FarLook, Look, Pictures};
use super::set;
use super::settings::Wanted;
use super::setup::Setup;
use super::summary::{Done, Laid, RunSummary};
use super::targets::numbered;
use super::views::draped_points;
use super::writers::{check_places, finished, sinks};
use crate::drape::clearance::{self, BodyClearance};
use crate::drape::evenness::Evenness;
use crate::drape::{self, Block, Totals};
use crate::export::{ExportError, FileWriter, Format, Output};
use crate::map::relaxed::StrainCounts;
use crate::render::cloth;
use crate::render::scene::Scene;
use crate::render::set::Set;
use crate::report::{LoupeReport, PictureReport};

/// A job that is ready to be knitted.
struct Prepared<'a> {
    job: &'a Job<'a>,
    setup: Setup,
    outputs: Vec<Wanted>,
    /// Points that cameras frame.
    points: Vec<Vec3>,
    /// What pictures show, and their empty scene. `None` without pictures.
    pictures: Option<(Drawn<'a>, Scene)>,
    /// What stands around the cloth in them.
    set: Option<Arc<Set>>,
    /// Files that are written block by block.
    sinks: Vec<FileWriter<'a>>,
}

/// What the jobs of a run have in common.
#[derive(Default)]
struct Gathered {
    /// Complete files, still under their temporary names.
    files: Vec<Output>,
    messages: Messages,
    /// Name of the renderer. Empty without a picture.
    drawn_by: String,
    picture: Option<PictureReport>,
    parts: Vec<Laid>,
}

/// Knits, draws and writes.
pub(super) fn make(jobs: &[Job<'_>], mut clock: Clock<'_>) -> Result<Done, RunError> {
    let prepared = jobs.iter().map(Prepared::new).collect::<Result<Vec<_>, _>>()?;
    let mut all = Gathered::default();
    for one in &prepared {
        let warnings = one.setup.first_warnings(one.job);
        all.messages.warn(warnings, &clock);
    }
    for one in &prepared {
        all.messages.note(one.notes(jobs), &clock);
    }
    let mut summary = None;
    let last = prepared.len();
    for (number, one) in prepared.into_iter().enumerate() {
        // The time of a picture stays out of the numbers of files that are made after it.
        summary = Some(one.knit(&mut all, number + 1 == last, &mut clock)?);
    }
    let (job, setup, outputs, totals, draped) = summary.expect("a run has a job");
    clock.stop();
    // The report comes last, because it has the times of everything else.
    let Gathered { mut files, messages, drawn_by, picture, parts } = all;
    let summary = RunSummary {
        setup: &setup,
        totals: &totals,
        draped,
        messages,
        drawn_by,
        picture,
        frames: Vec::new(),
    };
    let (reports, real) = summary.files(job, &outputs, &clock)?;
    files.extend(reports);
    files.into_iter().try_for_each(Output::publish)?;
    Ok(Done { parts, frames: None, real, stretched: None })
}

impl Gathered {
    /// Adds the drawn pictures of a job.
    fn add(&mut self, drawing: Pictures, job: &Job<'_>, drawn: &Drawn<'_>, clock: &Clock<'_>) {
        self.messages.note(drawing.notice, clock);
        self.files.extend(drawing.files);
        self.drawn_by = drawing.drawn_by;
        let loupe = drawn.loupe();
        self.picture = (!job.is_swatch).then(|| PictureReport {
            wales_per_cm: job.shown.wales_per_cm,
            courses_per_cm: job.shown.courses_per_cm,
            stitches: drawn.stitches(job),
            loupe: loupe
                .map(|loupe| LoupeReport { at: loupe.place.to_array(), times: loupe.times }),
        });
    }
}

/// What the report needs of the last job.
type Summed<'a> = (&'a Job<'a>, Setup, Vec<Wanted>, Totals, Option<BodyClearance>);

impl<'a> Prepared<'a> {
    /// Prepares a job, or refuses it.
    fn new(job: &'a Job<'a>) -> Result<Self, RunError> {
        let outputs = all_around(&job.outputs, job.settings.picture.turntable);
        let setup = Setup::new(job, &outputs)?;
        check_places(job, outputs.iter(), &setup.textures)?;
        let points = if job.is_swatch { Vec::new() } else { draped_points(job.cloth.garment()) };
        let has_picture = outputs.iter().any(|(_, format)| *format == Format::Png);
        let (pictures, set) = if has_picture {
            let scene = empty_scene(job, &setup, &points);
            set::check(job, 1)?;
            let garment = job.cloth.garment();
            let set = set::of(job, garment, 0, &draped_points(garment))?;
            (Some((Drawn::of(job, &setup, &scene, &points)?, scene)), set)
        } else {
            (None, None)
        };
        check_stitches(job.filed().stitches())?;
        check_pages(&outputs, job.filed().stitches())?;
        if let Some((drawn, _)) = &pictures {
            let stitches = drawn.cloth(job).stitches();
            check_stitches(stitches)?;
            check_memory("a picture", stitches, drawn.bytes / 1e9, notes::remedy(job))?;
        }
        let sinks = sinks(&outputs, job, &setup, &job.cloth.garment().panels)?;
        Ok(Self { job, setup, outputs, points, pictures, set, sinks })
    }

    /// What a person may want to know before the work.
    fn notes(&self, jobs: &[Job<'_>]) -> Vec<String> {
        let drawn = self.pictures.as_ref().map(|(drawn, _)| drawn);
        let loupe = drawn.and_then(Drawn::loupe);
        let sizes = notes::sizes(self.job, jobs.len() > 1, drawn, &self.setup);
        let own = self.job.notes.iter().cloned();
        let ribbons = notes::ribbons(self.job, &self.outputs);
        // The files beside a picture at true gauge are a job of their own.
        let body = notes::unseen_body(self.job, &self.outputs).filter(|_| jobs.len() == 1);
        sizes
            .into_iter()
            .chain(own)
            .chain(ribbons)
            .chain(body)
            .chain(loupe.map(|loupe| loupe.note()))
            .collect()
    }

    /// Knits, draws and writes. `is_last` says that the report will have this job's numbers.
    fn knit(
        self,
        all: &mut Gathered,
        is_last: bool,
        clock: &mut Clock<'_>,
    ) -> Result<Summed<'a>, RunError> {
        let Self { job, setup, outputs, mut points, mut pictures, set, mut sinks } = self;
        let paths: Vec<_> = outputs
            .iter()
            .filter(|(_, format)| *format == Format::Png)
            .map(|(path, _)| path.as_path())
            .collect();
        let is_only_drawn = paths.len() == outputs.len();
        clock.begin(if is_last { Task::Strain } else { Task::Render }, 0.0);
        let cache = job.cache();
        let mut drawing = Pictures::new(set);
        let inset = match &pictures {
            Some((drawn, scene)) => drawn.inset(job, &setup, scene, &mut drawing, clock)?,
            None => None,
        };
        let receivers = Receivers {
            pictures: pictures.as_mut().map(|(drawn, scene)| (&*drawn, scene)),
            sinks: &mut sinks,
            is_only_drawn,
            is_last,
        };
        let radius = wants_clearance(job, &outputs).then_some(setup.section.radius);
        let mut strain = vec![StrainCounts::default(); job.cloth.garment().panels.len()];
        let (totals, draped) = lay(job, (&setup.options, radius), receivers, &mut strain, clock)?;
        cache.keep(job.cloth);
        let drawn = pictures.as_ref().map(|(drawn, _)| drawn);
        let drawn = drawn.filter(|_| is_only_drawn && job.part.is_none());
        let (is_averaged, is_in_view) =
            (drawn.is_some_and(Drawn::is_averaged), drawn.is_some_and(Drawn::is_part));
        // A part of the cloth can be without yarns while the whole has some.
        if job.part.is_none() && !is_in_view {
            check_laid(&totals)?;
        }
        // Some yarns that stand for all would tell too small a number.
        all.messages.warn(loss_warning(&totals).filter(|_| !is_averaged), clock);
        all.messages.warn(locked_warning(&strain, job.cloth.garment()), clock);
        clock.begin(Task::Write, 1.0);
        clock.divide(&totals.laying);
        all.files.extend(finished(sinks)?);
        if let Some((drawn, scene)) = &mut pictures {
            edges::add_threads(scene, job.threads, drawn.in_view());
            if job.is_swatch {
                points.clone_from(&scene.positions);
            }
            let inset = drawn.loupe().zip(inset.as_ref());
            let far = drawn.averaged().map(|(cloth, share)| {
                let mut threads = setup.scene(job);
                threads.extent = scene.extent;
                edges::add_threads(&mut threads, job.threads, None);
                FarLook { cloth, share: *share, threads }
            });
            let look = Look { scene, fibres: setup.fibres.as_ref(), far };
            drawing.draw(job, &look, (&points, inset), &paths, clock)?;
            all.add(drawing, job, drawn, clock);
        }
        let names: Vec<_> = outputs.iter().map(|(path, _)| path.display().to_string()).collect();
        let whole = (is_in_view || is_averaged).then(|| job.cloth.stitches());
        all.parts.push(Laid { totals, whole, is_averaged, files: names.join(" ") });
        Ok((job, setup, outputs, totals, draped))
    }
}

/// The files of a job. With a turntable, each picture becomes `turntable` numbered ones.
fn all_around(wanted: &[Wanted], turntable: Option<u32>) -> Vec<Wanted> {
    let Some(count) = turntable else { return wanted.to_vec() };
    let mut all = Vec::new();
    for (path, format) in wanted {
        match format {
            Format::Png => {
                let paths: Vec<PathBuf> = numbered(path, format.ending(), count);
                all.extend(paths.into_iter().map(|path| (path, *format)));
            }
            _ => all.push((path.clone(), *format)),
        }
    }
    all
}

/// The receivers of a job's yarns.
struct Receivers<'a, 'b, 'c> {
    /// What pictures show, and their scene. `None` without pictures.
    pictures: Option<(&'a Drawn<'c>, &'a mut Scene)>,
    /// Files that are written block by block.
    sinks: &'a mut [FileWriter<'b>],
    /// Whether all files are pictures.
    is_only_drawn: bool,
    /// Whether the report has this job's numbers.
    is_last: bool,
}

/// Lays the yarns block by block and gives each block to the receivers. With a radius, measures the
/// clearance of yarns drawn with it. Adds to `strain` the counts of each panel.
fn lay(
    job: &Job<'_>,
    (options, radius): (&drape::DrapeOptions, Option<f64>),
    receivers: Receivers<'_, '_, '_>,
    strain: &mut [StrainCounts],
    clock: &mut Clock<'_>,
) -> Result<(Totals, Option<BodyClearance>), RunError> {
    let Receivers { mut pictures, sinks, is_only_drawn, is_last } = receivers;
    // The closures below need the clock, and `drape::run` calls them in turn.
    let clock = RefCell::new(clock);
    let mut announce = |stage, done| {
        clock.borrow_mut().begin(if is_last { Task::from(stage) } else { Task::Render }, done);
    };
    // A tile of a picture has the light and shadows of the whole cloth, a close-up takes a part of
    // it, and pictures show uneven cloth: they then need other yarns than files.
    let is_uneven = job.options.evenness == Evenness::Uneven;
    if let Some((drawn, scene)) = pictures.take_if(|(drawn, _)| {
        job.part.is_some() || drawn.is_part() || drawn.is_averaged() || is_uneven
    }) {
        let laying = drawn.laying(job);
        let mut show = |blocks: &[Block]| -> Result<(), ExportError> {
            blocks.iter().for_each(|block| {
                strain[block.panel] += block.strain;
                drawn.add_to(scene, block);
            });
            Ok(())
        };
        if is_only_drawn && job.part.is_none() {
            return Ok((drape::run(drawn.cloth(job), &laying, &mut announce, &mut show)?, None));
        }
        // This time counts as rendering, so that it stays out of the files' own numbers.
        let mut announce = |_, _| clock.borrow_mut().begin(Task::Render, 0.0);
        drape::run(drawn.cloth(job), &laying, &mut announce, &mut show)?;
        strain.fill(StrainCounts::default());
    }
    let mut deliver = |blocks: &[Block]| -> Result<(), ExportError> {
        blocks.iter().for_each(|block| strain[block.panel] += block.strain);
        if let Some((_, scene)) = &mut pictures {
            blocks.iter().for_each(|block| cloth::add_to(scene, block));
        }
        sinks.iter_mut().try_for_each(|sink| sink.take(blocks))
    };
    let (cloth, announce) = (job.filed(), &mut announce);
    let Some(radius) = radius else {
        return Ok((drape::run(cloth, options, announce, &mut deliver)?, None));
    };
    let (totals, draped) = clearance::run(cloth, options, radius, announce, &mut deliver)?;
    Ok((totals, Some(draped)))
}

/// Whether to measure the clearance on the body: only for a report of the whole cloth, and not for
/// a swatch, because that has no body.
fn wants_clearance(job: &Job<'_>, outputs: &[Wanted]) -> bool {
    // A part lacks its neighbouring yarns, and one of them may be the nearest.
    let draped = !job.is_swatch && job.part.is_none();
    draped && outputs.iter().any(|(_, format)| *format == Format::Json)
}
