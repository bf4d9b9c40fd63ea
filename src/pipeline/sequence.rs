//! `warpknit drape` of a sequence: knitted and located once, shown on every frame.
//!
//! Files that hold one drape are numbered as the frames are and appear frame by frame, so what is
//! done stays done when a run of hours ends early; a `.usda` holds all frames and appears at the
//! end, as the report does.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use crate::drape::sequence::LocatedCloth;
use crate::drape::{Block, DrapeOptions};
use crate::export::usda_frames::UsdaFramesWriter;
use crate::export::{ClothInfo, Destination, ExportError, Format, Output, Sink};
use crate::garment::stretch::stretch;
use crate::garment::{Frames, Garment};
use crate::ids::index32;
use crate::render::cloth;
use crate::render::scene::Scene;
use crate::report::FrameReport;
use glam::{DVec3, Vec3};

use super::RunError;
use super::clock::{Clock, Message, Task};
use super::job::Job;
use super::limits::{check_laid, check_memory, check_request, loss_warning};
use super::pictures;
use super::settings::Wanted;
use super::setup::Setup;
use super::summary::{Done, RunSummary, say_warnings};
use super::targets::numbered;
use super::writers::{check_places, finished, sinks, wanted};

/// What a held stitch takes, GB: measured .94 kB.
const HELD_GB: f64 = 1e-6;

/// What a sequence needs besides its job, whose cloth is laid on the first frame.
pub struct Sequence<'a> {
    /// The first usable frame, and how the others are read.
    pub motion: &'a Motion,
    /// All frames, those before the first usable one included.
    pub paths: &'a [PathBuf],
    /// Whether frames that can't be read are left out.
    pub skip_bad: bool,
    /// Frames a second in a `.usda`.
    pub frames_per_second: f64,
}

/// A sequence whose first usable frame has been read.
#[derive(Debug)]
pub struct Motion {
    /// Reads the other frames.
    pub reader: Frames,
    /// The place of the first usable frame among all of them.
    pub first: usize,
    /// What is wrong with those before it.
    pub bad: Vec<String>,
}

/// The files of a sequence.
struct Files {
    /// Those that hold one drape, numbered: a frame an entry.
    numbered: Vec<(Vec<PathBuf>, Format)>,
    /// Those that hold all frames.
    whole: Vec<Wanted>,
}

/// What is made frame by frame.
struct Show<'a, 'b, 'c> {
    job: &'a Job<'a>,
    setup: &'a Setup,
    held: LocatedCloth,
    files: &'a Files,
    usda: Vec<UsdaFramesWriter<Output>>,
    scene: Option<Scene>,
    /// What the camera sees: the sequence's extent.
    seen: Vec<Vec3>,
    drawn_by: String,
    warnings: Vec<String>,
    clock: &'b mut Clock<'c>,
}

/// Knits once, and draws and writes every frame.
pub(super) fn make(
    job: &Job<'_>,
    sequence: &Sequence<'_>,
    mut clock: Clock<'_>,
) -> Result<Done, RunError> {
    let files = Files::of(wanted(job), index32(sequence.paths.len()));
    let wants_picture = files.numbered.iter().any(|(_, format)| *format == Format::Png);
    check(job, sequence, wants_picture)?;
    let setup = Setup::new(job, &files.all())?;
    check_places(job, files.all().iter(), &setup.textures)?;
    let mut warnings = setup.first_warnings(job);
    warnings.extend(sequence.motion.bad.iter().map(|what| format!("left out: {what}")));

    let wants_extent = wants_picture && job.settings.picture.eye.is_none();
    let seen = if wants_extent { seen(sequence, job, &mut clock)? } else { Vec::new() };
    let usda = files.whole.iter().filter(|(_, format)| *format == Format::Usda);
    let info = ClothInfo::from_fabric(job.shown, setup.section);
    let usda = usda.map(|(path, _)| {
        UsdaFramesWriter::create(Destination::create(path)?, &info, sequence.frames_per_second)
    });
    let usda = usda.collect::<Result<Vec<_>, ExportError>>()?;
    let reports = files.whole.iter().filter(|(_, format)| *format == Format::Json);
    reports.into_iter().try_for_each(|(path, _)| Output::check(path))?;
    let held = LocatedCloth::locate(job.cloth, &setup.options, &mut |stage, done| {
        clock.begin(Task::from(stage), done);
    });
    check_laid(held.totals())?;
    warnings.extend(loss_warning(held.totals()));
    say_warnings(job, &mut warnings, &clock);

    let scene = wants_picture.then(|| setup.scene(job));
    let drawn_by = String::new();
    let mut show = Show {
        job,
        setup: &setup,
        held,
        files: &files,
        usda,
        scene,
        seen,
        drawn_by,
        warnings,
        clock: &mut clock,
    };
    let frames = show.all(sequence)?;
    let Show { held, usda, drawn_by, warnings, .. } = show;
    clock.begin(Task::Write, 1.0);
    let usda = usda.into_iter().map(|writer| Box::new(writer).finish());
    let mut finished = usda.collect::<Result<Vec<_>, _>>()?;
    clock.stop();
    let shown = frames.iter().filter(|frame| frame.skipped.is_none()).count();
    let totals = *held.totals();
    let summary =
        RunSummary { setup: &setup, totals: &totals, draped: None, warnings, drawn_by, frames };
    finished.extend(summary.files(job, &files.whole, &clock)?.0);
    finished.into_iter().try_for_each(Output::publish)?;
    let frames = Some((shown, sequence.paths.len()));
    Ok(Done { totals, files: files.names(), frames, real: None })
}

/// Refuses what can't be done, before any work.
fn check(job: &Job<'_>, sequence: &Sequence<'_>, wants_picture: bool) -> Result<(), RunError> {
    check_request(job, wants_picture)?;
    if job.settings.picture.turntable.is_some() || job.part.is_some() {
        return Err(RunError::NotOfSequence { frames: sequence.paths.len() });
    }
    if job.settings.fibres == Some(true)
        && wanted(job).iter().any(|(_, format)| *format == Format::Usda)
    {
        return Err(RunError::FibresOfSequence);
    }
    check_memory(
        "a drape sequence",
        job.cloth.stitches(),
        HELD_GB,
        "lower the densities, or drape the frames one by one",
    )
}

impl Files {
    fn of(wanted: Vec<Wanted>, count: u32) -> Self {
        let (whole, single): (Vec<_>, Vec<_>) = wanted
            .into_iter()
            .partition(|(_, format)| matches!(format, Format::Usda | Format::Json));
        let numbered = single
            .into_iter()
            .map(|(path, format)| (numbered(&path, format.ending(), count), format))
            .collect();
        Self { numbered, whole }
    }

    fn all(&self) -> Vec<Wanted> {
        let numbered = self
            .numbered
            .iter()
            .flat_map(|(paths, format)| paths.iter().map(|path| (path.clone(), *format)));
        numbered.chain(self.whole.iter().cloned()).collect()
    }

    /// Those of one frame.
    fn of_frame(&self, number: usize) -> Vec<Wanted> {
        self.numbered.iter().map(|(paths, format)| (paths[number].clone(), *format)).collect()
    }

    /// What they are called, in a line.
    fn names(&self) -> String {
        let series = |(paths, _): &(Vec<PathBuf>, Format)| {
            format!("{} to {}", paths[0].display(), paths[paths.len() - 1].display())
        };
        let whole = self.whole.iter().map(|(path, _)| path.display().to_string());
        self.numbered.iter().map(series).chain(whole).collect::<Vec<_>>().join(", ")
    }
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

impl Show<'_, '_, '_> {
    /// Makes the files of all frames; says of each what there is to be told.
    fn all(&mut self, sequence: &Sequence<'_>) -> Result<Vec<FrameReport>, RunError> {
        let Sequence { motion, paths, .. } = sequence;
        let mut garment = self.job.cloth.garment().clone();
        let mut frames: Vec<_> =
            paths.iter().zip(&motion.bad).map(|(path, what)| left_out(path, what)).collect();
        for (number, path) in paths.iter().enumerate().skip(motion.first) {
            self.clock.begin(Task::Read, 0.0);
            if number > motion.first {
                match motion.reader.pose(&mut garment, path) {
                    Ok(odd) => odd.into_iter().for_each(|odd| self.warn(odd)),
                    Err(error) if sequence.skip_bad => {
                        self.warn(format!("left out: {error}"));
                        frames.push(left_out(path, &error.to_string()));
                        continue;
                    }
                    Err(error) => return Err(error.into()),
                }
            }
            self.frame(&garment, number)?;
            let before: f64 = frames.iter().map(|frame: &FrameReport| frame.ms).sum();
            let (stretch_warp, stretch_weft) = stretch(&garment);
            let ms = self.clock.without_pictures() - before;
            frames.push(FrameReport {
                file: path.display().to_string(),
                skipped: None,
                ms,
                stretch_warp,
                stretch_weft,
            });
        }
        Ok(frames)
    }

    fn warn(&mut self, what: String) {
        self.clock.listener().say(Message::Warning(&what));
        self.warnings.push(what);
    }

    /// Makes a frame's files.
    fn frame(&mut self, garment: &Garment, number: usize) -> Result<(), RunError> {
        let Self { job, setup, held, files, usda, scene, clock, .. } = self;
        let own = files.of_frame(number);
        let mut sinks = sinks(&own, job, setup)?;
        usda.iter_mut().try_for_each(|usda| usda.begin_frame(index32(number + 1)))?;
        if let Some(scene) = scene {
            scene.clear();
        }
        let clock = RefCell::new(clock);
        let mut deliver = |blocks: &[Block]| -> Result<(), ExportError> {
            if let Some(scene) = scene {
                blocks.iter().for_each(|block| cloth::add_to(scene, block));
            }
            usda.iter_mut().try_for_each(|usda| usda.take(blocks))?;
            sinks.iter_mut().try_for_each(|sink| sink.take(blocks))
        };
        let options: &DrapeOptions = &setup.options;
        held.run_frame(
            garment,
            options,
            &mut |stage, done| clock.borrow_mut().begin(Task::from(stage), done),
            &mut deliver,
        )?;
        self.clock.begin(Task::Write, 1.0);
        let mut whole = finished(sinks)?;
        let paths: Vec<_> = own
            .iter()
            .filter(|(_, format)| *format == Format::Png)
            .map(|(path, _)| path.as_path())
            .collect();
        if let (Some(scene), false) = (&self.scene, paths.is_empty()) {
            let seen = (!self.seen.is_empty()).then_some(self.seen.as_slice());
            let pictures = pictures::draw(
                scene,
                self.setup.fibres.as_ref(),
                self.job.settings,
                None,
                seen,
                &paths,
                self.clock,
            )?;
            whole.extend(pictures.files);
            self.drawn_by = pictures.drawn_by;
            // What draws is the same for all frames, and so is what there is to be said of it.
            if let Some(notice) = pictures.notice.filter(|notice| !self.warnings.contains(notice)) {
                self.clock.listener().say(Message::Note(&notice));
                self.warnings.push(notice);
            }
        }
        self.clock.stop();
        Ok(whole.into_iter().try_for_each(Output::publish)?)
    }
}

/// Points around all frames, which the camera is to see: the outermost one in each of 26
/// directions, frame by frame, and a stitch beyond it.
fn seen(
    sequence: &Sequence<'_>,
    job: &Job<'_>,
    clock: &mut Clock<'_>,
) -> Result<Vec<Vec3>, RunError> {
    clock.begin(Task::Render, 0.0);
    let (mut garment, reach) = (job.cloth.garment().clone(), job.shown.wale_spacing());
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
    let points: Vec<DVec3> =
        garment.panels.iter().flat_map(|panel| panel.draped.iter().copied()).collect();
    let steps = || [-1.0, 0.0, 1.0].into_iter();
    let directions =
        steps().flat_map(|x| steps().flat_map(move |y| steps().map(move |z| DVec3::new(x, y, z))));
    let beyond = |toward: DVec3| {
        let farthest =
            points.iter().copied().max_by(|a, b| a.dot(toward).total_cmp(&b.dot(toward)));
        farthest.map(|point| (point + reach * toward.normalize_or_zero()).as_vec3())
    };
    directions.filter_map(beyond).collect()
}
