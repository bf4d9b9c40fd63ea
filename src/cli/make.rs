//! `warpknit drape` and `warpknit swatch`: from arguments to files.

use std::cell::RefCell;
use std::path::Path;

use anyhow::{Context, Result, bail};
use warpknit::drape::clearance::Gauge;
use warpknit::drape::strands::Losses;
use warpknit::drape::{self, Block, Cloth, Stage, Totals};
use warpknit::export::{ExportError, FileWriter, Format, Output};
use warpknit::garment::Panel;
use warpknit::knit::clearance::Clearance;
use warpknit::render::cloth;
use warpknit::render::scene::Scene;
use warpknit::tile::Tile;

use super::args::{Drape, Swatch};
use super::choice::{PICTURE_GB, fabric, pictured, turn_grains};
use super::clock::{Clock, Task};
use super::drapes::Drapes;
use super::job::{Facts, Job};
use super::pictures;
use super::sequence::{self, Sequence};
use super::system::available_memory_gb;
use super::targets::numbered;
use super::writers::{Wanted, check_places, finished, sinks, wanted};
use super::{print, tell};

/// The most stitches that are taken on: beyond them 32 bits no longer number the data points, and
/// any garment at its true gauge has far fewer.
pub(super) const MOST_STITCHES: u64 = 200_000_000;
/// The most stitches whose clearance on the body is measured: some 20 kB each, were they all on one
/// panel.
const MEASURED_STITCHES: u64 = 50_000;

/// Knits a fabric onto a garment.
pub(crate) fn drape(arguments: &Drape) -> Result<()> {
    let shared = &arguments.shared;
    let mut clock = Clock::begin_command(&shared.running)?;
    clock.begin(Task::Read, 0.0);
    let fabric = fabric(shared)?;
    let drapes = Drapes::of(&arguments.flat, &arguments.draped)?;
    let skip_bad = arguments.motion.skip_bad_frames;
    let (mut garment, motion) = drapes.open(&arguments.reading.options(), skip_bad)?;
    turn_grains(&mut garment, &fabric);
    clock.stop();
    let area = garment.panels.iter().map(Panel::area).sum();
    let (shown, enlarged) = pictured(&fabric, area, shared)?;
    let cloth = Cloth::cover(&garment, &shown)
        .with_context(|| shared.chains.label(&shared.fabric, &fabric).to_owned())?;
    let options = arguments.laying.options();
    let part = arguments.part.tile.map(|tile| (tile, cloth.part(tile)));
    let (inputs, stem) = (drapes.inputs().collect(), drapes.stem());
    let (fabric, shown, cloth) = (&fabric, &shown, &cloth);
    let job = Job {
        shared,
        fabric,
        shown,
        enlarged,
        cloth,
        part,
        options,
        area,
        inputs,
        stem,
        tells_numbers: false,
    };
    match &motion {
        None => make(&job, clock),
        Some(motion) => {
            let frames_per_second = arguments.motion.fps;
            sequence::make(
                &job,
                &Sequence { motion, paths: &drapes.frames, skip_bad, frames_per_second },
                clock,
            )
        }
    }
}

/// Knits a flat piece of fabric.
pub(crate) fn swatch(arguments: &Swatch) -> Result<()> {
    let shared = &arguments.shared;
    let clock = Clock::begin_command(&shared.running)?;
    let fabric = fabric(shared)?;
    let panel = drape::swatch_panel(&fabric, arguments.wales, arguments.courses);
    let cloth = Cloth::swatch(&panel, &fabric, arguments.wales, arguments.courses);
    let options = drape::Options::default();
    let area = f64::from(arguments.wales)
        * fabric.wale_spacing()
        * f64::from(arguments.courses)
        * fabric.course_spacing();
    // A fabric of chains is named by them, and a file may name its fabric anything.
    let stem = if fabric.name.is_empty() || fabric.name.contains(['/', '\\']) {
        "swatch"
    } else {
        &fabric.name
    };
    let part = arguments.part.tile.map(|tile| (tile, cloth.part(tile)));
    let (fabric, cloth, stem) = (&fabric, &cloth, Path::new(stem));
    let (enlarged, inputs) = (None, Vec::new());
    make(
        &Job {
            shared,
            fabric,
            shown: fabric,
            enlarged,
            cloth,
            part,
            options,
            area,
            inputs,
            stem,
            tells_numbers: true,
        },
        clock,
    )
}

/// Knits, draws and writes. Files appear under their names only when all are whole.
fn make(job: &Job<'_>, mut clock: Clock) -> Result<()> {
    let outputs = all_around(wanted(job), job.shared.drawing.turntable);
    let pictures: Vec<_> = outputs
        .iter()
        .filter(|(_, format)| *format == Format::Png)
        .map(|(path, _)| path.as_path())
        .collect();
    check_request(job, !pictures.is_empty())?;
    let setup = job.setup(&outputs)?;
    check_places(job, outputs.iter(), &setup.textures)?;
    let mut warnings = job.first_warnings(&setup);
    let mut sinks = sinks(&outputs, job, &setup)?;
    let mut scene = job.scene(&setup);

    let gauge = wants_gauge(job, &outputs).then(|| Gauge::new(job.cloth, setup.section.radius));
    let takers =
        Takers { scene: (!pictures.is_empty()).then_some(&mut scene), sinks: &mut sinks, gauge };
    let (totals, draped) = lay(job, &setup.options, takers, &mut clock)?;
    // A part may well have no yarn.
    if job.part.is_none() {
        check_laid(&totals)?;
    }
    warnings.extend(loss_warning(&totals));
    tell_warnings(job, &mut warnings);

    clock.begin(Task::Write, 1.0);
    let mut whole = finished(sinks)?;
    let mut drawn_by = String::new();
    if !pictures.is_empty() {
        let pictures = pictures::draw(
            &scene,
            setup.fibres.as_ref(),
            job.shared,
            job.tile(),
            None,
            &pictures,
            &mut clock,
        )?;
        if let Some(notice) = pictures.notice {
            tell(job.shared.running.quiet, &format!("note: {notice}"));
            warnings.push(notice);
        }
        whole.extend(pictures.files);
        drawn_by = pictures.drawn_by;
    }
    clock.stop();
    let facts =
        Facts { setup: &setup, totals: &totals, draped, warnings, drawn_by, frames: Vec::new() };
    let (reports, real) = facts.files(job, &outputs, &clock)?;
    whole.into_iter().chain(reports).try_for_each(Output::publish)?;
    clock.clear();
    let names: Vec<_> = outputs.iter().map(|(path, _)| path.display().to_string()).collect();
    tell(
        job.shared.running.quiet,
        &format!(
            "{} stitches, {} yarns: {}",
            totals.losses.stitches,
            totals.yarns,
            names.join(" ")
        ),
    );
    match real {
        Some(real) if job.tells_numbers => print(&real.table()),
        _ => Ok(()),
    }
}

/// The files, with as many pictures as are to be taken all around in place of each one.
fn all_around(wanted: Vec<Wanted>, turntable: Option<u32>) -> Vec<Wanted> {
    let Some(count) = turntable else { return wanted };
    let turned = |(path, format): Wanted| match format {
        Format::Png => {
            numbered(&path, format.ending(), count).into_iter().map(|path| (path, format)).collect()
        }
        _ => vec![(path, format)],
    };
    wanted.into_iter().flat_map(turned).collect()
}

/// Says what is amiss, and adds what is none but a script should know as well.
pub(super) fn tell_warnings(job: &Job<'_>, warnings: &mut Vec<String>) {
    for warning in &*warnings {
        tell(job.shared.running.quiet, &format!("warning: {warning}"));
    }
    if let Some(note) = &job.enlarged {
        tell(job.shared.running.quiet, &format!("note: {note}"));
        warnings.push(note.clone());
    }
}

/// What a run's yarns are handed to.
struct Takers<'a, 'b> {
    /// Where they are to be drawn from.
    scene: Option<&'a mut Scene>,
    sinks: &'a mut [FileWriter<'b>],
    gauge: Option<Gauge>,
}

/// Lays the yarns, and says what was laid and how near they come to each other.
fn lay(
    job: &Job<'_>,
    options: &drape::Options,
    takers: Takers<'_, '_>,
    clock: &mut Clock,
) -> Result<(Totals, Option<Clearance>)> {
    let Takers { mut scene, sinks, mut gauge } = takers;
    let clock = RefCell::new(clock);
    if let (Some(whole), true) = (&mut scene, job.part.is_some()) {
        // A part of a picture has the light and the shadows of the whole, whose knitting is no part
        // of what is told of the part.
        let mut announce = |_, _| clock.borrow_mut().begin(Task::Render, 0.0);
        let mut show = |blocks: &[Block]| -> Result<(), ExportError> {
            blocks.iter().for_each(|block| cloth::add_to(whole, block));
            Ok(())
        };
        drape::run(job.cloth, &job.options, &mut announce, &mut show)?;
        scene = None;
    }
    let mut announce = |stage, done| clock.borrow_mut().begin(task(stage), done);
    let mut deliver = |blocks: &[Block]| -> Result<(), ExportError> {
        if let Some(scene) = &mut scene {
            blocks.iter().for_each(|block| cloth::add_to(scene, block));
        }
        sinks.iter_mut().try_for_each(|sink| sink.take(blocks))?;
        if let Some(gauge) = &mut gauge {
            // Measuring is no stage of making cloth: its time counts in the total alone.
            clock.borrow_mut().stop();
            gauge.take(blocks);
        }
        Ok(())
    };
    let totals = drape::run(job.filed(), options, &mut announce, &mut deliver)?;
    Ok((totals, gauge.map(Gauge::finish)))
}

/// Whether clearance is to be measured on the body: for a report of the whole alone, and not on a
/// swatch, which has none.
fn wants_gauge(job: &Job<'_>, outputs: &[Wanted]) -> bool {
    // Of a part the yarns beside it are missing, which may be the nearest.
    let draped = !job.inputs.is_empty() && job.part.is_none();
    draped
        && outputs.iter().any(|(_, format)| *format == Format::Json)
        && job.cloth.stitches() <= MEASURED_STITCHES
}

pub(super) fn task(stage: Stage) -> Task {
    match stage {
        Stage::Index => Task::Index,
        Stage::Knit => Task::Knit,
        Stage::Locate => Task::Locate,
        Stage::Map => Task::Map,
        Stage::Surface => Task::Surface,
        Stage::Deliver => Task::Write,
    }
}

/// Refuses what can't be done, before any work.
pub(super) fn check_request(job: &Job<'_>, wants_picture: bool) -> Result<()> {
    let stitches = if wants_picture { job.cloth.stitches() } else { job.filed().stitches() };
    if stitches > MOST_STITCHES {
        bail!(
            "{stitches} stitches are over the limit of {MOST_STITCHES}: lower --wales-per-cm and --courses-per-cm"
        );
    }
    if job.shared.drawing.turntable.is_some() && !wants_picture {
        bail!(
            "--turntable turns pictures, and none is asked for: name one, such as -o all-around.png"
        );
    }
    if wants_picture && job.shared.eye.is_some() && job.shared.eye == job.shared.look_at {
        bail!("--eye and --look-at are the same point: there is no direction to look in");
    }
    if let (true, Some([number, of])) = (wants_picture, job.tile().map(Tile::numbers))
        && of > job.shared.size.1
    {
        bail!(
            "--tile {number}/{of}: a picture of {} rows can't be cut into {of} parts; raise --size, or ask for fewer",
            job.shared.size.1
        );
    }
    if wants_picture {
        check_memory("a picture", stitches, PICTURE_GB, "lower the densities, or write no .png")
    } else {
        Ok(())
    }
}

/// Refuses what would not fit the memory at so many GB a stitch, before the work and not in the
/// middle of it.
pub(super) fn check_memory(
    what: &str,
    stitches: u64,
    gb_a_stitch: f64,
    remedy: &str,
) -> Result<()> {
    #[expect(clippy::cast_precision_loss, reason = "an estimate")]
    let needed = stitches as f64 * gb_a_stitch;
    match available_memory_gb() {
        Some(free) if needed > free => {
            bail!(
                "{what} of {stitches} stitches takes about {needed:.0} GB of memory and {free:.0} GB are free: {remedy}"
            )
        }
        _ => Ok(()),
    }
}

/// Refuses cloth of which nothing can be seen.
pub(super) fn check_laid(totals: &Totals) -> Result<()> {
    if totals.strands == 0 {
        bail!(
            "no yarn lies on the garment: its panels are smaller than a stitch; raise --wales-per-cm and --courses-per-cm"
        );
    }
    Ok(())
}

pub(super) fn loss_warning(totals: &Totals) -> Option<String> {
    let Losses { in_defects, .. } = totals.losses;
    #[expect(clippy::cast_precision_loss, reason = "a percentage of three digits")]
    let percent = 100.0 * in_defects as f64 / (totals.data_points + in_defects).max(1) as f64;
    (in_defects > 0)
        .then(|| format!("{in_defects} data points ({percent:.3} %) lie in triangles that can't be knitted and are lost"))
}
