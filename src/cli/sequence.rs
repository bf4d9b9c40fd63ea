//! `warpknit drape` of a sequence: knitted and located once, shown on every frame.
//!
//! Files that hold one drape are numbered as the frames are and appear frame by frame, so what is done stays done when a run of hours ends early; a `.usda` holds all
//! frames and appears at the end, as the report does.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use glam::{DVec3, Vec3};
use warpknit::drape::held::Held;
use warpknit::drape::{Block, Options, picture};
use warpknit::export::usda_frames::UsdaFramesWriter;
use warpknit::export::{ExportError, Format, Output, Sink};
use warpknit::garment::Garment;
use warpknit::garment::stretch::stretch;
use warpknit::ids::index32;
use warpknit::report::FrameReport;
use warpknit::scene::Scene;

use super::clock::{Clock, Task};
use super::drapes::Motion;
use super::job::{Facts, Job, Setup};
use super::make::{check_laid, check_request, loss_warning, task, tell_warnings};
use super::pictures;
use super::targets::numbered;
use super::tell;
use super::writers::{Wanted, check_places, finished, sinks, wanted};

/// What a sequence needs besides its job, whose cloth is laid on the first frame.
pub(super) struct Sequence<'a> {
    pub(super) motion: &'a Motion,
    /// All frames, those before the first usable one included.
    pub(super) paths: &'a [PathBuf],
    pub(super) skip_bad: bool,
    pub(super) frames_per_second: f64,
}

/// What is made frame by frame.
struct Show<'a, 'b> {
    job: &'a Job<'a>,
    setup: &'a Setup,
    held: Held,
    /// Each numbered file, a frame an entry.
    numbered: Vec<(Vec<PathBuf>, Format)>,
    usda: Vec<UsdaFramesWriter>,
    scene: Option<Scene>,
    /// What the camera sees: the sequence's extent.
    seen: Vec<Vec3>,
    drawn_by: String,
    clock: &'b mut Clock,
}

/// Knits once, and draws and writes every frame.
pub(super) fn make(job: &Job<'_>, sequence: &Sequence<'_>, mut clock: Clock) -> Result<()> {
    let Sequence { motion, paths, .. } = sequence;
    let files = wanted(job);
    let wants_picture = files.iter().any(|(_, format)| *format == Format::Png);
    check_request(job, wants_picture)?;
    if job.shared.drawing.turntable.is_some() || job.part.is_some() {
        bail!("--turntable and --tile are for one drape, and these are {} frames", paths.len());
    }
    let setup = job.setup(&files)?;
    let (whole, single): (Vec<_>, Vec<_>) =
        files.iter().cloned().partition(|(_, format)| matches!(format, Format::Usda | Format::Json));
    let count = index32(paths.len());
    let numbered: Vec<_> = single.iter().map(|(path, format)| (numbered(path, format.ending(), count), *format)).collect();
    let all: Vec<Wanted> = numbered
        .iter()
        .flat_map(|(paths, format)| paths.iter().map(|path| (path.clone(), *format)))
        .chain(whole.clone())
        .collect();
    check_places(job, all.iter(), &setup.textures)?;
    motion.tell_bad(job.shared.running.quiet);
    let mut warnings = job.first_warnings(&setup);
    warnings.extend(motion.bad.iter().map(|what| format!("left out: {what}")));

    let mut garment = job.cloth.garment().clone();
    let seen = if wants_picture && job.shared.eye.is_none() {
        seen(sequence, &garment, job.shown.wale_spacing(), &mut clock)?
    } else {
        Vec::new()
    };
    let usda = whole.iter().filter(|(_, format)| *format == Format::Usda);
    let usda = usda.map(|(path, _)| UsdaFramesWriter::create(path, job.shown, &setup.section, sequence.frames_per_second));
    let usda = usda.collect::<Result<Vec<_>, _>>()?;
    whole.iter().filter(|(_, format)| *format == Format::Json).try_for_each(|(path, _)| Output::create(path).map(drop))?;
    let held = Held::lay(job.cloth, &setup.options, &mut |stage, done| clock.begin(task(stage), done));
    check_laid(held.totals())?;
    warnings.extend(loss_warning(held.totals()));
    tell_warnings(job, &mut warnings);

    let scene = wants_picture.then(|| job.scene(&setup));
    let mut show = Show { job, setup: &setup, held, numbered, usda, scene, seen, drawn_by: String::new(), clock: &mut clock };
    let mut frames: Vec<_> = paths.iter().zip(&motion.bad).map(|(path, what)| left_out(path, what)).collect();
    for (number, path) in paths.iter().enumerate().skip(motion.first) {
        show.clock.begin(Task::Read, 0.0);
        if number > motion.first {
            match motion.reader.pose(&mut garment, path) {
                Ok(odd) => warnings.extend(odd.inspect(|odd| show.clock.aside(&format!("warning: {odd}")))),
                Err(error) if sequence.skip_bad => {
                    let what = error.to_string();
                    show.clock.aside(&format!("warning: left out: {what}"));
                    frames.push(left_out(path, &what));
                    warnings.push(format!("left out: {what}"));
                    continue;
                }
                Err(error) => return Err(error.into()),
            }
        }
        show.frame(&garment, number)?;
        let before: f64 = frames.iter().map(|frame: &FrameReport| frame.ms).sum();
        let (stretch_warp, stretch_weft) = stretch(&garment);
        let ms = show.clock.without_pictures() - before;
        frames.push(FrameReport { file: path.display().to_string(), skipped: None, ms, stretch_warp, stretch_weft });
    }
    let Show { held, usda, drawn_by, .. } = show;
    clock.begin(Task::Write, 1.0);
    let mut finished = finished(usda.into_iter().map(Box::new).collect())?;
    clock.stop();
    let shown = frames.iter().filter(|frame| frame.skipped.is_none()).count();
    let facts = Facts { setup: &setup, totals: held.totals(), draped: None, warnings, drawn_by, frames };
    let (reports, _) = facts.files(job, &whole, &clock)?;
    finished.extend(reports);
    finished.into_iter().try_for_each(Output::publish)?;
    clock.clear();
    let totals = held.totals();
    let names: Vec<_> = files.iter().map(|(path, _)| path.display().to_string()).collect();
    let what =
        format!("{shown} of {count} frames, {} stitches, {} yarns: {}", totals.losses.stitches, totals.yarns, names.join(" "));
    tell(job.shared.running.quiet, &what);
    Ok(())
}

fn left_out(path: &Path, what: &str) -> FrameReport {
    FrameReport {
        file: path.display().to_string(),
        skipped: Some(what.to_owned()),
        ms: 0.0,
        stretch_warp: [0.0; 3],
        stretch_weft: [0.0; 3],
    }
}

impl Show<'_, '_> {
    /// Makes a frame's files.
    fn frame(&mut self, garment: &Garment, number: usize) -> Result<()> {
        let Self { job, setup, held, numbered, usda, scene, clock, .. } = self;
        let own: Vec<Wanted> = numbered.iter().map(|(paths, format)| (paths[number].clone(), *format)).collect();
        let mut sinks = sinks(&own, job, setup)?;
        usda.iter_mut().try_for_each(|usda| usda.begin_frame(index32(number + 1)))?;
        if let Some(scene) = scene {
            scene.clear();
        }
        let clock = RefCell::new(clock);
        let mut deliver = |blocks: &[Block]| -> Result<(), ExportError> {
            if let Some(scene) = scene {
                blocks.iter().for_each(|block| picture::add_to(scene, block));
            }
            usda.iter_mut().try_for_each(|usda| usda.take(blocks))?;
            sinks.iter_mut().try_for_each(|sink| sink.take(blocks))
        };
        let options: &Options = &setup.options;
        held.show(garment, options, &mut |stage, done| clock.borrow_mut().begin(task(stage), done), &mut deliver)?;
        self.clock.begin(Task::Write, 1.0);
        let mut whole = finished(sinks)?;
        let paths: Vec<_> = own.iter().filter(|(_, format)| *format == Format::Png).map(|(path, _)| path.as_path()).collect();
        if let (Some(scene), false) = (&self.scene, paths.is_empty()) {
            let seen = (!self.seen.is_empty()).then_some(self.seen.as_slice());
            let pictures = pictures::draw(scene, self.job.shared, None, seen, &paths, self.clock)?;
            whole.extend(pictures.files);
            self.drawn_by = pictures.drawn_by;
        }
        self.clock.stop();
        Ok(whole.into_iter().try_for_each(Output::publish)?)
    }
}

/// Points around all frames, which the camera is to see: the outermost one in each of 26 directions, frame by frame, and `reach` mm beyond it.
fn seen(sequence: &Sequence<'_>, first: &Garment, reach: f64, clock: &mut Clock) -> Result<Vec<Vec3>> {
    clock.begin(Task::Read, 0.0);
    let mut garment = first.clone();
    let mut seen = outermost(&garment, reach);
    for path in &sequence.paths[sequence.motion.first + 1..] {
        match sequence.motion.reader.pose(&mut garment, path) {
            Ok(_odd) => seen.extend(outermost(&garment, reach)),
            // Told of when its turn comes.
            Err(_bad) if sequence.skip_bad => {}
            Err(error) => return Err(error.into()),
        }
    }
    Ok(seen)
}

fn outermost(garment: &Garment, reach: f64) -> Vec<Vec3> {
    let points: Vec<DVec3> = garment.panels.iter().flat_map(|panel| panel.draped.iter().copied()).collect();
    let steps = || [-1.0, 0.0, 1.0].into_iter();
    let directions = steps().flat_map(|x| steps().flat_map(move |y| steps().map(move |z| DVec3::new(x, y, z))));
    let beyond = |toward: DVec3| {
        let farthest = points.iter().copied().max_by(|a, b| a.dot(toward).total_cmp(&b.dot(toward)));
        farthest.map(|point| (point + reach * toward.normalize_or_zero()).as_vec3())
    };
    directions.filter_map(beyond).collect()
}
