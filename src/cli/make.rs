//! `warpknit drape` and `warpknit swatch`: from arguments to files.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use warpknit::drape::clearance::Gauge;
use warpknit::drape::strands::Losses;
use warpknit::drape::{self, Block, Cloth, Stage, Totals, picture};
use warpknit::export::bcc::BccWriter;
use warpknit::export::csv::CsvWriter;
use warpknit::export::curves::CurvesWriter;
use warpknit::export::glb::GlbWriter;
use warpknit::export::inp::InpWriter;
use warpknit::export::npz::NpzWriter;
use warpknit::export::obj::ObjWriter;
use warpknit::export::ply::PlyWriter;
use warpknit::export::usda::UsdaWriter;
use warpknit::export::{ExportError, Format, Output, Sink};
use warpknit::fabric::{Fabric, FabricError};
use warpknit::garment::{Garment, Panel, ReadOptions, read};
use warpknit::ids::index32;
use warpknit::knit::clearance::{self, Clearance};
use warpknit::scene::{Scene, Shape};
use warpknit::tile::Tile;
use warpknit::yarn::tube::Section;

use super::args::{Chains, Drape, Laying, Reading, Shared, Swatch};
use super::clock::{Clock, Task};
use super::job::{Facts, Job};
use super::numbers::RealCloth;
use super::pictures::{self, Textures};
use super::system::available_memory_gb;
use super::targets::{check_distinct, text_file};
use super::{print, tell};

/// The most stitches that a garment is given unasked. A picture of 1600 x 1200 shows no more of them one by one.
const PICTURED_STITCHES: f64 = 12_000.0;
/// The most stitches that are taken on: beyond them 32 bits no longer number the data points, and any garment at its true gauge has far
/// fewer.
pub(super) const MOST_STITCHES: u64 = 200_000_000;
/// The most stitches whose clearance on the body is measured: some 20 kB each, were they all on one panel.
const MEASURED_STITCHES: u64 = 50_000;
/// The most that a picture takes for each stitch, GB: measured 1.7 kB where a million are traced piece by piece. Far ones take a quarter of it,
/// but how far they are is not known before they are knitted.
const PICTURE_GB: f64 = 1.7e-6;
/// St and Sr of tubes in files, where nobody asks for others.
const FILE_ST: u32 = 10;
const FILE_SR: u32 = 6;
/// The texture's real length where there is none: v counts millimetres.
const TEXTURE_PER_MM: f64 = 1.0;

/// Knits a fabric onto a garment.
pub(crate) fn drape(arguments: &Drape) -> Result<()> {
    let shared = &arguments.shared;
    let mut clock = Clock::begin_command(&shared.running)?;
    clock.begin(Task::Read, 0.0);
    let fabric = fabric(shared)?;
    let mut garment = read(&arguments.flat, arguments.draped.as_deref(), &arguments.reading.options())?;
    turn_grains(&mut garment, &fabric);
    clock.stop();
    let area = garment.panels.iter().map(Panel::area).sum();
    let (shown, enlarged) = pictured(&fabric, area, shared)?;
    let cloth = Cloth::cover(&garment, &shown).with_context(|| shared.chains.label(&shared.fabric, &fabric).to_owned())?;
    let options = arguments.laying.options();
    let stem = arguments.draped.as_ref().unwrap_or(&arguments.flat).file_stem().unwrap_or_default();
    let inputs = std::iter::once(arguments.flat.as_path()).chain(arguments.draped.as_deref()).collect();
    let part = arguments.part.tile.map(|tile| (tile, cloth.part(tile)));
    let (fabric, shown, cloth, stem) = (&fabric, &shown, &cloth, Path::new(stem));
    make(&Job { shared, fabric, shown, enlarged, cloth, part, options, area, inputs, stem, tells_numbers: false }, clock)
}

/// Knits a flat piece of fabric.
pub(crate) fn swatch(arguments: &Swatch) -> Result<()> {
    let shared = &arguments.shared;
    let clock = Clock::begin_command(&shared.running)?;
    let fabric = fabric(shared)?;
    let panel = drape::swatch_panel(&fabric, arguments.wales, arguments.courses);
    let cloth = Cloth::swatch(&panel, &fabric, arguments.wales, arguments.courses);
    let options = drape::Options::default();
    let area = f64::from(arguments.wales) * fabric.wale_spacing() * f64::from(arguments.courses) * fabric.course_spacing();
    // A fabric of chains is named by them, and a file may name its fabric anything.
    let stem = if fabric.name.is_empty() || fabric.name.contains(['/', '\\']) { "swatch" } else { &fabric.name };
    let part = arguments.part.tile.map(|tile| (tile, cloth.part(tile)));
    let (fabric, cloth, stem) = (&fabric, &cloth, Path::new(stem));
    let (enlarged, inputs) = (None, Vec::new());
    make(&Job { shared, fabric, shown: fabric, enlarged, cloth, part, options, area, inputs, stem, tells_numbers: true }, clock)
}

impl Laying {
    /// What the library takes; surfaces are for those who write them.
    pub(super) fn options(&self) -> drape::Options {
        drape::Options { mapping: self.mapping.into(), edge: self.edge.into(), surface: None }
    }
}

impl Reading {
    /// What the library takes.
    pub(super) fn options(&self) -> ReadOptions {
        ReadOptions { unit: self.unit, uv_scale: self.uv_scale, grain: self.grain.to_radians(), turn: self.turn }
    }
}

/// Turns the panels whose layout in the fabric says so.
pub(super) fn turn_grains(garment: &mut Garment, fabric: &Fabric) {
    for layout in &fabric.panels {
        garment.turn_grain(layout.panel, layout.grain_degrees.to_radians());
    }
}

/// The built-in fabric of a name, or the one in a file.
pub(super) fn named_fabric(name: &str) -> Result<Fabric> {
    if Path::new(name).extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml")) {
        Fabric::read(Path::new(name)).map_err(|error| in_file(name, error))
    } else {
        Ok(Fabric::named(name)?)
    }
}

impl Chains {
    /// The fabric with these bars, if there are any.
    pub(super) fn on(&self, fabric: Fabric) -> Result<Fabric> {
        if self.lapping.is_empty() { Ok(fabric) } else { Ok(fabric.with_chains(&self.lapping, &self.threading)?) }
    }

    /// What messages call the fabric: as it was asked for, or by its chains.
    pub(super) fn label<'a>(&self, asked: &'a str, fabric: &'a Fabric) -> &'a str {
        if self.lapping.is_empty() { asked } else { &fabric.name }
    }
}

/// The fabric that was named, at the densities that were given.
pub(super) fn fabric(shared: &Shared) -> Result<Fabric> {
    let fabric = shared.chains.on(named_fabric(&shared.fabric)?)?;
    let name = shared.chains.label(&shared.fabric, &fabric);
    for warning in fabric.warnings() {
        tell(shared.running.quiet, &format!("warning: {name}: {warning}"));
    }
    match (shared.wales_per_cm, shared.courses_per_cm) {
        (None, None) => Ok(fabric),
        (wales, courses) => {
            // One density alone scales the other, so that loops keep their shape.
            let aspect = fabric.courses_per_cm / fabric.wales_per_cm;
            let wales = wales.or(courses.map(|courses| courses / aspect)).unwrap_or(fabric.wales_per_cm);
            Ok(fabric.at_densities(wales, courses.unwrap_or(wales * aspect))?)
        }
    }
}

/// An error in a fabric file, with its name and line in front.
fn in_file(name: &str, error: FabricError) -> anyhow::Error {
    let place = match &error.place {
        Some(place) => format!("{name}:{}", place.line),
        None => name.to_owned(),
    };
    anyhow::Error::new(error).context(place)
}

/// The fabric for `area` mm² of garment, enlarged where nobody chose densities and its loops would be too many and too small to see.
pub(super) fn pictured(fabric: &Fabric, area: f64, shared: &Shared) -> Result<(Fabric, Option<String>)> {
    if shared.wales_per_cm.is_some() || shared.courses_per_cm.is_some() {
        Ok((fabric.clone(), None))
    } else {
        enlarged(fabric, area)
    }
}

/// The same whoever chose densities; and what was done, in words.
pub(super) fn enlarged(fabric: &Fabric, area: f64) -> Result<(Fabric, Option<String>)> {
    let bars = f64::from(index32(fabric.bars.len()));
    let stitches = bars * area / (fabric.wale_spacing() * fabric.course_spacing());
    if stitches <= PICTURED_STITCHES {
        return Ok((fabric.clone(), None));
    }
    let times = (stitches / PICTURED_STITCHES).sqrt();
    let (wales, courses) = (fabric.wales_per_cm, fabric.courses_per_cm);
    let note = format!(
        "{stitches:.0} stitches at true gauge would be too small to see, so the cloth is drawn {times:.1} times enlarged; \
         --wales-per-cm {wales} --courses-per-cm {courses} knits it at true gauge (a picture then takes up to {:.0} GB)",
        stitches * PICTURE_GB
    );
    let enlarged = fabric.clone().at_densities(wales / times, courses / times);
    Ok((enlarged.context("the garment is too large for any density: check --unit")?, Some(note)))
}

/// Knits, draws and writes. Files appear under their names only when all are whole.
fn make(job: &Job<'_>, mut clock: Clock) -> Result<()> {
    let mut warnings = job.cloth.garment().facts.warnings.clone();
    let outputs = outputs(job)?;
    let wants_picture = outputs.iter().any(|(_, format)| *format == Format::Png);
    check_request(job, wants_picture)?;
    let section = section(job)?;
    let near = clearance::measure(job.shown, job.cloth.pattern(), section.radius);
    warnings.extend(clearance::warnings(job.shown, job.cloth.pattern(), &near, section.radius));
    let mut sinks = sinks(&outputs, job, &section)?;
    let wants_surface = outputs.iter().any(|(_, format)| format.holds_tubes());
    let options = drape::Options { surface: wants_surface.then_some(section), ..job.options };
    let looks = picture::looks(job.shown, section.radius);
    let textures = Textures::of(job.shared, job.shown)?;
    let mut scene = pictures::scene(job.shared.drawing.shape.into(), looks, &textures, job.shown.enlargement);
    if scene.shape == Shape::Ribbon {
        warnings.extend(textures.misfit(job.shown));
    }

    let gauge = wants_gauge(job, &outputs).then(|| Gauge::new(job.cloth, section.radius));
    let takers = Takers { scene: wants_picture.then_some(&mut scene), sinks: &mut sinks, gauge };
    let (totals, draped) = lay(job, &options, takers, &mut clock)?;
    // A part may well have no yarn.
    if job.part.is_none() {
        check_laid(&totals)?;
    }
    warnings.extend(loss_warning(&totals));
    tell_warnings(job, &mut warnings);

    clock.begin(Task::Write, 1.0);
    let mut whole: Vec<Output> = sinks.into_iter().map(Sink::finish).collect::<Result<_, _>>()?;
    let mut drawn_by = String::new();
    if wants_picture {
        let paths: Vec<_> = outputs.iter().filter(|(_, format)| *format == Format::Png).map(|(path, _)| path.as_path()).collect();
        let pictures = pictures::draw(&scene, job.shared, job.tile(), &paths, &mut clock)?;
        warnings.extend(pictures.notice);
        whole.extend(pictures.files);
        drawn_by = pictures.drawn_by;
    }
    clock.stop();
    let facts = Facts { section: &section, totals: &totals, near, draped, warnings, drawn_by };
    let reports: Vec<_> = outputs.iter().filter(|(_, format)| *format == Format::Json).collect();
    // What is shown with its own yarns is the real cloth, and need not be knitted again.
    let shown = (job.fabric == job.shown && job.fabric.enlargement == 1.0 && section.radius == job.fabric.radius())
        .then(|| (job.cloth.pattern(), near));
    let real = (job.tells_numbers || !reports.is_empty()).then(|| RealCloth::of(job.fabric, shown));
    if let Some(real) = &real {
        for (path, _) in reports {
            whole.push(text_file(path, &facts.report(job, real, &clock).to_json())?);
        }
    }
    whole.into_iter().try_for_each(Output::publish)?;
    clock.clear();
    let names: Vec<_> = outputs.iter().map(|(path, _)| path.display().to_string()).collect();
    tell(job.shared.running.quiet, &format!("{} stitches, {} yarns: {}", totals.losses.stitches, totals.yarns, names.join(" ")));
    match real {
        Some(real) if job.tells_numbers => print(&real.table()),
        _ => Ok(()),
    }
}

/// Says what is amiss, and adds what is none but a script should know as well.
fn tell_warnings(job: &Job<'_>, warnings: &mut Vec<String>) {
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
    sinks: &'a mut [Box<dyn Sink + 'b>],
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
        // A part of a picture has the light and the shadows of the whole, whose knitting is no part of what is told of the part.
        let mut announce = |_, _| clock.borrow_mut().begin(Task::Render, 0.0);
        let mut show = |blocks: &[Block]| -> Result<(), ExportError> {
            blocks.iter().for_each(|block| picture::add_to(whole, block));
            Ok(())
        };
        drape::run(job.cloth, &job.options, &mut announce, &mut show)?;
        scene = None;
    }
    let mut announce = |stage, done| clock.borrow_mut().begin(task(stage), done);
    let mut deliver = |blocks: &[Block]| -> Result<(), ExportError> {
        if let Some(scene) = &mut scene {
            blocks.iter().for_each(|block| picture::add_to(scene, block));
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

/// The files that were asked for, or a picture named after the input.
///
/// No file may be written twice, or over one that was read.
fn outputs(job: &Job<'_>) -> Result<Vec<(PathBuf, Format)>> {
    let mut wanted = job.shared.outputs.clone();
    if wanted.is_empty() {
        let mut name = job.stem.as_os_str().to_owned();
        name.push(".png");
        wanted.push((PathBuf::from(name), Format::Png));
    }
    let outputs: Vec<_> = (wanted.into_iter())
        .flat_map(|(path, format)| {
            let turntable = job.shared.drawing.turntable.filter(|_| format == Format::Png);
            pictures::frames(&path, turntable).into_iter().map(move |path| (path, format))
        })
        .collect();
    check_distinct(job.inputs.iter().copied(), outputs.iter().map(|(path, _)| path.as_path()))?;
    Ok(outputs)
}

/// Whether clearance is to be measured on the body: for a report of the whole alone, and not on a swatch, which has none.
fn wants_gauge(job: &Job<'_>, outputs: &[(PathBuf, Format)]) -> bool {
    // Of a part the yarns beside it are missing, which may be the nearest.
    let draped = !job.inputs.is_empty() && job.part.is_none();
    draped && outputs.iter().any(|(_, format)| *format == Format::Json) && job.cloth.stitches() <= MEASURED_STITCHES
}

/// Writers of everything that streams.
fn sinks<'a>(outputs: &[(PathBuf, Format)], job: &Job<'a>, section: &Section) -> Result<Vec<Box<dyn Sink + 'a>>, ExportError> {
    let mut sinks: Vec<Box<dyn Sink + 'a>> = Vec::new();
    for (path, format) in outputs {
        match format {
            Format::Glb => sinks.push(Box::new(GlbWriter::create(path, job.shown, job.filed().blocks(), job.filed().yarns())?)),
            Format::Obj => sinks.push(Box::new(ObjWriter::create(path)?)),
            Format::Ply => sinks.push(Box::new(PlyWriter::create(path, job.shown, section)?)),
            Format::Usda => sinks.push(Box::new(UsdaWriter::create(path, job.shown, section)?)),
            Format::Bcc => sinks.push(Box::new(BccWriter::create(path, section.st)?)),
            Format::Curves => sinks.push(Box::new(CurvesWriter::create(path, job.shown, section)?)),
            Format::Inp => sinks.push(Box::new(InpWriter::create(path, job.shown, section)?)),
            Format::Npz => sinks.push(Box::new(NpzWriter::create(path, job.shown, job.cloth.garment(), section)?)),
            Format::Csv => sinks.push(Box::new(CsvWriter::create(path, job.cloth.garment())?)),
            // Made whole at the end; that they can be written is asked before the work and not after it.
            Format::Png | Format::Json => drop(Output::create(path)?),
        }
    }
    Ok(sinks)
}

fn section(job: &Job<'_>) -> Result<Section> {
    let Shared { radius, flatten, caps, .. } = *job.shared;
    let (st, sr) = (job.shared.st.unwrap_or(FILE_ST), job.shared.sr.unwrap_or(FILE_SR));
    let radius = drawn_radius(job.shown, radius)?;
    Ok(Section { st, sr, radius, flatten, caps, texture_per_mm: TEXTURE_PER_MM })
}

/// The radius that was chosen, if the fabric has room for it, or else the fabric's.
pub(super) fn drawn_radius(fabric: &Fabric, chosen: Option<f64>) -> Result<f64> {
    let wale_spacing = fabric.wale_spacing();
    if let Some(radius) = chosen.filter(|radius| *radius > wale_spacing) {
        bail!("a radius of {radius} mm is over the wale spacing of {wale_spacing:.3} mm: yarns would fill each other's place");
    }
    Ok(chosen.unwrap_or(fabric.radius()))
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
fn check_request(job: &Job<'_>, wants_picture: bool) -> Result<()> {
    let stitches = if wants_picture { job.cloth.stitches() } else { job.filed().stitches() };
    if stitches > MOST_STITCHES {
        bail!("{stitches} stitches are over the limit of {MOST_STITCHES}: lower --wales-per-cm and --courses-per-cm");
    }
    if job.shared.drawing.turntable.is_some() && !wants_picture {
        bail!("--turntable turns pictures, and none is asked for: name one, such as -o all-around.png");
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
    if wants_picture { check_memory(stitches, PICTURE_GB, "lower the densities, or write no .png") } else { Ok(()) }
}

/// Refuses a picture that would not fit the memory at so many GB a stitch, before the work and not in the middle of it.
pub(super) fn check_memory(stitches: u64, gb_a_stitch: f64, remedy: &str) -> Result<()> {
    #[expect(clippy::cast_precision_loss, reason = "an estimate")]
    let needed = stitches as f64 * gb_a_stitch;
    match available_memory_gb() {
        Some(free) if needed > free => {
            bail!("a picture of {stitches} stitches takes about {needed:.0} GB of memory and {free:.0} GB are free: {remedy}")
        }
        _ => Ok(()),
    }
}

/// Refuses cloth of which nothing can be seen.
pub(super) fn check_laid(totals: &Totals) -> Result<()> {
    if totals.strands == 0 {
        bail!("no yarn lies on the garment: its panels are smaller than a stitch; raise --wales-per-cm and --courses-per-cm");
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
