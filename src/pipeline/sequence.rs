//! `warpknit drape` of a drape sequence. The fabric is knitted and located once, then mapped onto
//! every frame.
//!
//! In: [`Job`]s on the first frame, and a [`Sequence`]. Out: files and [`Done`]. Most formats have
//! one file for each frame. These are numbered like the frames and appear frame by frame, so they
//! stay if a run of hours ends early. A `.usda` or `.usdc` has all frames and appears at the end,
//! as the report does. Pictures with finished edges are a job of their own, and are made first.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use crate::drape::sequence::LocatedCloth;
use crate::drape::{Block, DrapeOptions, Totals};
use crate::edges::{Finished, Thread};
use crate::export::usda_frames::UsdaFramesWriter;
use crate::export::usdc::UsdcWriter;
use crate::export::{ClothInfo, Destination, ExportError, Format, Output, Sink};
use crate::garment::Garment;
use crate::garment::stretch::stretch;
use crate::ids::index32;
use crate::map::relaxed::StrainCounts;
use crate::render::cloth;
use crate::render::scene::Scene;
use crate::report::FrameReport;
use glam::Vec3;

use super::RunError;
use super::clock::{Clock, Task};
use super::edges;
use super::estimates::float;
use super::job::Job;
use super::limits::{check_laid, check_memory, check_stitches, locked_warning, loss_warning};
use super::messages::Messages;
use super::motion::Sequence;
use super::notes;
use super::pictures::{Look, Pictures};
use super::set;
use super::settings::Wanted;
use super::setup::Setup;
use super::summary::{Done, Laid, RunSummary};
use super::targets::numbered;
use super::writers::{check_places, finished, sinks};

/// Memory of a located stitch, which is kept for all frames, GB. Measured: 0.94 kB.
const LOCATED_GB: f64 = 1e-6;
/// The most that a picture of one needs, GB. Measured: 1.7 kB with a million ray traced stitches.
const PICTURE_GB: f64 = 1.7e-6;

/// The files of a sequence.
struct Files {
    /// Formats with one file for each frame, and the paths of these files.
    numbered: Vec<(Vec<PathBuf>, Format)>,
    /// Files of all frames.
    whole: Vec<Wanted>,
}

/// A job that may be made.
struct PreparedSequence<'a> {
    job: &'a Job<'a>,
    files: Files,
    setup: Setup,
    wants_picture: bool,
}

/// What the jobs of a run have in common.
struct SequenceRun<'a> {
    messages: Messages,
    /// Name of the renderer. Empty without a picture.
    drawn_by: String,
    clock: Clock<'a>,
    /// Whether the report has the present job's numbers. The time of pictures stays out of those of
    /// files that are made after them.
    is_last: bool,
}

/// The state of a job from frame to frame.
struct Show<'a, 'b, 'c> {
    job: &'a Job<'a>,
    setup: &'a Setup,
    located: LocatedCloth,
    files: &'a Files,
    usd: Vec<Moving>,
    /// The scene for pictures, cleared for each frame. `None` without pictures.
    scene: Option<Scene>,
    /// Points around all frames, for a camera that does not move. Empty if it has its own place.
    extent: Vec<Vec3>,
    /// Points of all frames where the cloth is strained too far, panel by panel.
    panels: Vec<StrainCounts>,
    strain: StrainCounts,
    common: &'b mut SequenceRun<'c>,
}

/// Knits once, then draws and writes every frame.
pub(super) fn make(
    jobs: &[Job<'_>],
    sequence: &Sequence<'_>,
    clock: Clock<'_>,
) -> Result<Done, RunError> {
    let prepared = jobs.iter().map(|job| PreparedSequence::new(job, sequence));
    let prepared = prepared.collect::<Result<Vec<_>, _>>()?;
    let mut common = SequenceRun {
        messages: Messages::default(),
        drawn_by: String::new(),
        clock,
        is_last: false,
    };
    let (mut parts, mut frames) = (Vec::new(), None);
    for (number, one) in prepared.iter().enumerate() {
        common.is_last = number + 1 == prepared.len();
        let (laid, shown) = one.make(sequence, &mut common)?;
        parts.push(laid);
        frames = Some((shown, sequence.paths.len()));
    }
    Ok(Done { parts, frames, real: None, stretched: None })
}

impl<'a> PreparedSequence<'a> {
    /// Prepares a job, or refuses it.
    fn new(job: &'a Job<'a>, sequence: &Sequence<'_>) -> Result<Self, RunError> {
        let files = Files::new(job.outputs.clone(), index32(sequence.paths.len()));
        let wants_picture = files.numbered.iter().any(|(_, format)| *format == Format::Png);
        check(job, sequence, wants_picture)?;
        let setup = Setup::new(job, &files.all())?;
        check_places(job, files.all().iter(), &setup.textures)?;
        files.first().try_for_each(Output::check)?;
        Ok(Self { job, files, setup, wants_picture })
    }

    /// Makes the files of all frames. Returns what was laid, and the number of frames.
    fn make(
        &self,
        sequence: &Sequence<'_>,
        common: &mut SequenceRun<'_>,
    ) -> Result<(Laid, usize), RunError> {
        let Self { job, files, setup, wants_picture } = self;
        let mut warnings = setup.first_warnings(job);
        let sizes = notes::sizes(job, false, None, setup);
        warnings.extend(sequence.motion.bad.iter().map(|what| format!("left out: {what}")));
        let wants_extent = *wants_picture && job.settings.picture.eye.is_none();
        let extent =
            if wants_extent { sequence.extent(job, &mut common.clock)? } else { Vec::new() };
        let info = ClothInfo {
            usd_curves: job.settings.usd_curves,
            ..ClothInfo::from_fabric(job.shown, setup.section)
        };
        let usd = files.whole.iter().filter_map(|wanted| Moving::create(wanted, &info, sequence));
        let usd = usd.collect::<Result<Vec<_>, ExportError>>()?;
        let located = self.locate(common);
        check_laid(located.totals())?;
        warnings.extend(loss_warning(located.totals()));
        common.messages.warn(warnings, &common.clock);
        common.messages.note(sizes.into_iter().chain(job.notes.iter().cloned()), &common.clock);

        common.begin(Task::Strain, 0.0);
        let cache = job.cache();
        let mut show = Show {
            job,
            setup,
            located,
            files,
            usd,
            scene: wants_picture.then(|| setup.scene(job)),
            extent,
            panels: vec![StrainCounts::default(); job.cloth.garment().panels.len()],
            strain: StrainCounts::default(),
            common,
        };
        let frames = show.all(sequence)?;
        if let Some(locked) = locked_warning(&show.panels, job.cloth.garment()) {
            show.warn(locked);
        }
        cache.keep(job.cloth);
        let Show { located, usd, strain, common, .. } = show;
        common.begin(Task::Write, 1.0);
        let usd = usd.into_iter().map(Moving::finish);
        let mut finished = usd.collect::<Result<Vec<_>, _>>()?;
        common.clock.stop();
        let shown = frames.iter().filter(|frame| frame.skipped.is_none()).count();
        let totals = Totals { strain, ..*located.totals() };
        let summary = RunSummary {
            setup,
            totals: &totals,
            draped: None,
            messages: common.messages.clone(),
            drawn_by: common.drawn_by.clone(),
            picture: None,
            frames,
        };
        finished.extend(summary.files(job, &files.whole, &common.clock)?.0);
        finished.into_iter().try_for_each(Output::publish)?;
        Ok((Laid { totals, whole: None, is_averaged: false, files: files.names() }, shown))
    }

    /// Knits and locates the yarns. Location is the same for all frames, because it only depends on
    /// the flat panels.
    fn locate(&self, common: &mut SequenceRun<'_>) -> LocatedCloth {
        // Pictures that are made with other files show the yarns of these, so their stitches are
        // regular.
        let is_only_drawn = self.files.all().iter().all(|(_, format)| *format == Format::Png);
        let options = if is_only_drawn { &self.job.options } else { &self.setup.options };
        let located = LocatedCloth::locate(self.job.cloth, options, &mut |stage, done| {
            common.begin(Task::from(stage), done);
        });
        common.clock.stop();
        common.clock.divide(&located.totals().laying);
        located
    }
}

impl SequenceRun<'_> {
    /// Begins a task of the present job.
    fn begin(&mut self, task: Task, done: f64) {
        self.clock.begin(if self.is_last { task } else { Task::Render }, done);
    }
}

/// A writer of all frames.
enum Moving {
    Text(Box<UsdaFramesWriter<Output>>),
    Crate(Box<UsdcWriter<Output>>),
}

impl Moving {
    /// The writer of a file, if its format holds all frames.
    fn create(
        (path, format): &Wanted,
        info: &ClothInfo<'_>,
        sequence: &Sequence<'_>,
    ) -> Option<Result<Self, ExportError>> {
        let speed = sequence.frames_per_second;
        let target = || Destination::create(path);
        match format {
            Format::Usda => Some(target().and_then(|target| {
                Ok(Self::Text(Box::new(UsdaFramesWriter::create(target, info, speed)?)))
            })),
            Format::Usdc => Some(target().and_then(|target| {
                Ok(Self::Crate(Box::new(UsdcWriter::create_moving(target, info, speed)?)))
            })),
            _ => None,
        }
    }

    fn begin_frame(&mut self, code: u32) -> Result<(), ExportError> {
        match self {
            Self::Text(writer) => writer.begin_frame(code),
            Self::Crate(writer) => writer.begin_frame(code),
        }
    }

    fn take(&mut self, blocks: &[Block]) -> Result<(), ExportError> {
        match self {
            Self::Text(writer) => writer.take(blocks),
            Self::Crate(writer) => writer.take(blocks),
        }
    }

    fn finish(self) -> Result<Output, ExportError> {
        match self {
            Self::Text(writer) => writer.finish(),
            Self::Crate(writer) => writer.finish(),
        }
    }
}

/// Refuses settings that a sequence can't have, before any work.
fn check(job: &Job<'_>, sequence: &Sequence<'_>, wants_picture: bool) -> Result<(), RunError> {
    let stitches = job.cloth.stitches();
    check_stitches(stitches)?;
    if job.settings.picture.turntable.is_some() || job.part.is_some() {
        return Err(RunError::NotOfSequence { frames: sequence.paths.len() });
    }
    if job.settings.fibres == Some(true)
        && job.outputs.iter().any(|(_, format)| format.holds_sequences())
    {
        return Err(RunError::FibresOfSequence);
    }
    if wants_picture {
        set::check(job, sequence.paths.len())?;
    }
    let gb_a_stitch = LOCATED_GB + if wants_picture { PICTURE_GB } else { 0.0 };
    check_memory(
        "a drape sequence",
        stitches,
        gb_a_stitch * float(stitches),
        "lower the densities, or drape the frames one by one",
    )
}

impl Files {
    /// The files for `count` frames: stages of USD and a report have all frames, other formats one
    /// each.
    fn new(wanted: Vec<Wanted>, count: u32) -> Self {
        let (whole, single): (Vec<_>, Vec<_>) = wanted
            .into_iter()
            .partition(|(_, format)| format.holds_sequences() || *format == Format::Json);
        let numbered = single
            .into_iter()
            .map(|(path, format)| (numbered(&path, format.ending(), count), format))
            .collect();
        Self { numbered, whole }
    }

    /// All files of the run.
    fn all(&self) -> Vec<Wanted> {
        let numbered = self
            .numbered
            .iter()
            .flat_map(|(paths, format)| paths.iter().map(|path| (path.clone(), *format)));
        numbered.chain(self.whole.iter().cloned()).collect()
    }

    /// The first file of each format. The others lie beside it.
    fn first(&self) -> impl Iterator<Item = &Path> {
        let numbered = self.numbered.iter().filter_map(|(paths, _)| paths.first());
        numbered.chain(self.whole.iter().map(|(path, _)| path)).map(PathBuf::as_path)
    }

    /// The files of one frame.
    fn of_frame(&self, number: usize) -> Vec<Wanted> {
        self.numbered.iter().map(|(paths, format)| (paths[number].clone(), *format)).collect()
    }

    /// The names of all files in one line.
    fn names(&self) -> String {
        // A range for each format: a sequence may have thousands of frames.
        let series = self.numbered.iter().map(|(paths, _)| {
            format!("{} to {}", paths[0].display(), paths[paths.len() - 1].display())
        });
        let whole = self.whole.iter().map(|(path, _)| path.display().to_string());
        series.chain(whole).collect::<Vec<_>>().join(", ")
    }
}

/// The report's entry for a frame that was left out.
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
    /// Makes the files of all frames. Returns the report's entry for each frame.
    fn all(&mut self, sequence: &Sequence<'_>) -> Result<Vec<FrameReport>, RunError> {
        let Sequence { motion, paths, .. } = sequence;
        let mut garment = self.job.unfinished_garment();
        let mut frames: Vec<_> =
            paths.iter().zip(&motion.bad).map(|(path, what)| left_out(path, what)).collect();
        for (number, path) in paths.iter().enumerate().skip(motion.first) {
            self.common.begin(Task::Read, 0.0);
            // The garment is the first usable frame already.
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
            match self.job.edges {
                Some(edges) => {
                    let Finished { garment, threads } = edges.finish(&garment);
                    self.frame(&garment, &threads, number)?;
                }
                None => self.frame(&garment, &[], number)?,
            }
            // The clock runs through, so a frame's time is what the frames before it leave.
            let before: f64 = frames.iter().map(|frame: &FrameReport| frame.ms).sum();
            let (stretch_warp, stretch_weft) = stretch(&garment.panels);
            let ms = self.common.clock.without_pictures() - before;
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

    /// Tells the listener a warning and keeps it for the report.
    fn warn(&mut self, what: String) {
        self.common.messages.warn([what], &self.common.clock);
    }

    /// Makes a frame's files. `threads` are those of the garment's finished edges.
    fn frame(
        &mut self,
        garment: &Garment,
        threads: &[Thread],
        number: usize,
    ) -> Result<(), RunError> {
        let Self { job, setup, located, files, usd, scene, panels, strain, common, .. } = self;
        let own = files.of_frame(number);
        let mut sinks = sinks(&own, job, setup, &garment.panels)?;
        usd.iter_mut().try_for_each(|usd| usd.begin_frame(index32(number + 1)))?;
        if let Some(scene) = scene {
            scene.clear();
        }
        let common = RefCell::new(common);
        let mut deliver = |blocks: &[Block]| -> Result<(), ExportError> {
            blocks.iter().for_each(|block| panels[block.panel] += block.strain);
            if let Some(scene) = scene {
                blocks.iter().for_each(|block| cloth::add_to(scene, block));
            }
            usd.iter_mut().try_for_each(|usd| usd.take(blocks))?;
            sinks.iter_mut().try_for_each(|sink| sink.take(blocks))
        };
        let options: &DrapeOptions = &setup.options;
        *strain += located.run_frame(
            garment,
            options,
            &mut |stage, done| common.borrow_mut().begin(Task::from(stage), done),
            &mut deliver,
        )?;
        self.common.begin(Task::Write, 1.0);
        let mut whole = finished(sinks)?;
        let paths: Vec<_> = own
            .iter()
            .filter(|(_, format)| *format == Format::Png)
            .map(|(path, _)| path.as_path())
            .collect();
        if let (Some(scene), false) = (&mut self.scene, paths.is_empty()) {
            edges::add_threads(scene, threads, None);
            // A camera with a place of its own needs none.
            let extent = self.extent.as_slice();
            let fibres = self.setup.fibres.as_ref();
            let set = set::of(self.job, garment, number, extent)?;
            let mut pictures = Pictures::new(set);
            let clock = &mut self.common.clock;
            let look = Look { scene, fibres, far: None };
            pictures.draw(self.job, &look, (extent, None), &paths, clock)?;
            whole.extend(pictures.files);
            self.common.drawn_by = pictures.drawn_by;
            self.common.messages.note(pictures.notice, &self.common.clock);
        }
        self.common.clock.stop();
        // The files of this frame are complete: they appear now, whatever happens to later frames.
        Ok(whole.into_iter().try_for_each(Output::publish)?)
    }
}
