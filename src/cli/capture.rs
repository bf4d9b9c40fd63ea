//! `warpknit capture`: photos of a cloth to a fabric: a knit that is recognised, or the yarns of its
//! repeat as they are seen.
//!
//! In: the arguments. Out: the folder of [`FILES`] or of [`recognised::FILES`], notes on standard
//! error, and a table on standard output. A knit that explains the photo is the answer; if none
//! does, the strands that the photo shows.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use glam::DVec2;
use image::RgbImage;
use warpknit::export::OutputFolder;
use warpknit::folder::captured::{FILES, save};
use warpknit::folder::recognised;
use warpknit::photo::capture::{
    CaptureSettings, Captured, GivenLayout, Hypothesis, LEAST_CELL, MeanRepeat,
};
use warpknit::photo::recognise::{
    Face, Kinds, MOST_UNEXPLAINED, RecogniseError, RecogniseSettings, Recognition, recognise,
};
use warpknit::photo::yarn::read_photo;

use super::args::{Capture, CaptureAs};
use super::terminal::{Terminal, print, tell};
use warpknit::pipeline::{Listener as _, Task, check_distinct};

/// Longest layout file, bytes. One of 64 segments has some thousands.
const MOST_BYTES: u64 = 1 << 20;

/// Captures a photo. The folder appears only when all of its files are whole.
pub(crate) fn capture(arguments: &Capture) -> Result<()> {
    let terminal = Terminal::begin_command(&arguments.running)?;
    terminal.begin(Task::Read, 0.0);
    let inputs = [Some(&arguments.photo), arguments.layout.as_ref(), arguments.front.as_ref()]
        .into_iter()
        .flatten()
        .map(PathBuf::as_path);
    let files = FILES.iter().chain(recognised::FILES.iter().filter(|file| !FILES.contains(file)));
    let outputs: Vec<PathBuf> = files.map(|file| arguments.output.join(file)).collect();
    check_distinct(inputs, outputs.iter().map(PathBuf::as_path))?;
    if arguments.structure == Some(CaptureAs::Free)
        && (arguments.front.is_some() || !arguments.lapping.is_empty())
    {
        bail!("--structure free takes one photo and no lapping: leave --front and --lapping out");
    }
    let folder = OutputFolder::create(&arguments.output)?;
    let layout = arguments.layout.as_deref().map(read_layout).transpose()?;
    let photo = read_photo(&arguments.photo)?;
    let front = arguments.front.as_deref().map(read_photo).transpose()?;
    terminal.begin(Task::Develop, 0.1);
    if must_knit(arguments) {
        let knit = recognised(arguments, &photo, front.as_ref())?;
        return save_knit(arguments, &knit, folder, &terminal);
    }
    let cell = arguments.cell.map(|[ax, ay, bx, by]| [DVec2::new(ax, ay), DVec2::new(bx, by)]);
    let is_given = layout.is_some();
    // An error in a person's layout names the layout's file and not the photo.
    let about = arguments.layout.as_ref().unwrap_or(&arguments.photo);
    let settings = CaptureSettings {
        thickness: arguments.thickness,
        pixels_per_mm: pixels_per_mm(arguments, &photo),
        cell,
        layout,
    };
    let mean = MeanRepeat::new(&photo, &settings);
    terminal.begin(Task::Develop, 0.2);
    // A weave that leaves less unexplained than a knit is the answer. Free strands explain any
    // cloth, so they come last, and where only they compete with a knit they are not looked for.
    let knit = may_knit(arguments).then(|| knit(arguments, &photo, mean.as_ref().ok())).flatten();
    if let Some(knit) = &knit {
        let weave = mean.as_ref().ok().and_then(MeanRepeat::unexplained_by_weave);
        if weave.is_none_or(|weave| knit.unexplained() < weave) {
            return save_knit(arguments, knit, folder, &terminal);
        }
    }
    terminal.begin(Task::Develop, 0.4);
    let may_refuse = !is_given && !arguments.anyway;
    if let Some(mean) = mean.as_ref().ok().filter(|_| may_refuse && knit.is_none()) {
        check_size(mean).with_context(|| about.display().to_string())?;
    }
    let found = mean.and_then(MeanRepeat::captured);
    let is_weave = found.as_ref().is_ok_and(|found| found.layout.hypothesis == Hypothesis::Woven);
    if let Some(knit) = knit.filter(|_| !is_weave) {
        return save_knit(arguments, &knit, folder, &terminal);
    }
    let found = found.with_context(|| about.display().to_string())?;
    if may_refuse {
        check_strands(&found).with_context(|| about.display().to_string())?;
    }
    terminal.begin(Task::Write, 0.9);
    save(&found, &folder)?;
    folder.publish()?;
    terminal.clear();
    let quiet = arguments.running.quiet;
    for note in found.warnings() {
        tell(quiet, &format!("note: {}: {note}", arguments.photo.display()));
    }
    if may_knit(arguments) {
        let photo = arguments.photo.display();
        tell(
            quiet,
            &format!(
                "note: {photo}: if the cloth is a knit, --structure knit and a photo of its face \
                 (--front) tell more than this photo alone"
            ),
        );
    }
    let count = found.layout.visible.len();
    let noun = if count == 1 { "segment" } else { "segments" };
    tell(quiet, &format!("{count} {noun}: {}", arguments.output.display()));
    print(&report(&found))
}

/// Refuses a repeat that is too small to show strands, before they are looked for.
fn check_size(mean: &MeanRepeat<'_>) -> Result<()> {
    let lattice = mean.lattice();
    if lattice.shorter() < LEAST_CELL && !mean.is_clearly_woven() {
        let [a, b] = [lattice.a, lattice.b].map(vector);
        bail!(
            "the cell of {a} and {b} pixels shows no clear weave, and is too small to see yarns in \
             ({LEAST_CELL} pixels each way are needed): take the cloth nearer, or give --anyway to \
             write a guess"
        );
    }
    Ok(())
}

/// Refuses strands that explain too little.
fn check_strands(found: &Captured) -> Result<()> {
    let (lattice, unexplained) = (&found.unit.lattice, found.layout.error);
    let [a, b] = [lattice.a, lattice.b].map(vector);
    if unexplained > MOST_UNEXPLAINED {
        bail!(
            "the strands that were found leave {} of the cell unexplained (at most {} may): the \
             lattice is {a} and {b} pixels; give --cell or --layout, --structure knit for a knit, or \
             --anyway to write them all the same",
            percent(unexplained),
            percent(MOST_UNEXPLAINED)
        );
    }
    Ok(())
}

/// Whether nothing but a knit is wanted.
fn must_knit(arguments: &Capture) -> bool {
    let is_named = matches!(arguments.structure, Some(CaptureAs::Knit | CaptureAs::Warp));
    may_knit(arguments) && (arguments.front.is_some() || !arguments.lapping.is_empty() || is_named)
}

/// Whether the cloth may be a knit.
fn may_knit(arguments: &Capture) -> bool {
    arguments.cell.is_none()
        && arguments.layout.is_none()
        && arguments.structure != Some(CaptureAs::Free)
}

/// Pixels of the photo per mm, if the photo's scale is given.
fn pixels_per_mm(arguments: &Capture, photo: &RgbImage) -> Option<f64> {
    let by_width = arguments.width_mm.map(|width| f64::from(photo.width()) / width);
    arguments.pixels_per_mm.or(arguments.dpi.map(|dpi| dpi / 25.4)).or(by_width)
}

/// The knit that explains a photo well enough, if any does. Beside a clear weave only known ones are
/// tried: others are far less likely than that weave, and a search through them would take a third of
/// the time.
fn knit(
    arguments: &Capture,
    photo: &RgbImage,
    mean: Option<&MeanRepeat<'_>>,
) -> Option<Recognition> {
    let settings = RecogniseSettings {
        only_known: mean.is_some_and(MeanRepeat::is_clearly_woven),
        pixels_per_mm: pixels_per_mm(arguments, photo),
        ..RecogniseSettings::default()
    };
    let found = recognise(&[(photo, Face::Back)], &settings).ok();
    found.filter(|knit| knit.unexplained() <= MOST_UNEXPLAINED)
}

/// The knit that the photos show, where nothing but a knit is wanted.
fn recognised(
    arguments: &Capture,
    photo: &RgbImage,
    front: Option<&RgbImage>,
) -> Result<Recognition> {
    let mut photos = vec![(photo, Face::Back)];
    photos.extend(front.map(|front| (front, Face::Front)));
    let kinds = if arguments.structure == Some(CaptureAs::Warp) { Kinds::Warp } else { Kinds::All };
    let settings = RecogniseSettings {
        kinds,
        lapping: arguments.lapping.clone(),
        pixels_per_mm: pixels_per_mm(arguments, photo),
        ..RecogniseSettings::default()
    };
    let found = recognise(&photos, &settings)
        .map_err(|error| anyhow!("{}: {error}", blamed(arguments, &error).display()))?;
    if found.unexplained() > MOST_UNEXPLAINED && !arguments.anyway {
        let [wale, course] = found.frames[0].map(DVec2::from);
        bail!(
            "{}: no knit explains enough: {} is the best and leaves {} of the repeat unexplained (at \
             most {} may); a wale is {} and a course {} pixels; give {}--anyway to write it all the same",
            arguments.photo.display(),
            found.ranked.first().map_or("none", |best| &best.fabric.name),
            percent(found.unexplained()),
            percent(MOST_UNEXPLAINED),
            vector(wale),
            vector(course),
            if arguments.lapping.is_empty() { "--lapping, or " } else { "" }
        );
    }
    Ok(found)
}

/// The photo that an error is about.
fn blamed<'a>(arguments: &'a Capture, error: &RecogniseError) -> &'a Path {
    match error {
        RecogniseError::NoFrame { photo: 1.. } | RecogniseError::Stripes { photo: 1.. } => {
            arguments.front.as_ref().unwrap_or(&arguments.photo)
        }
        _ => &arguments.photo,
    }
}

/// Writes a recognised knit.
fn save_knit(
    arguments: &Capture,
    found: &Recognition,
    folder: OutputFolder,
    terminal: &Terminal,
) -> Result<()> {
    terminal.begin(Task::Write, 0.9);
    recognised::save(found, &folder)?;
    folder.publish()?;
    terminal.clear();
    let quiet = arguments.running.quiet;
    for note in recognised::warnings(found) {
        tell(quiet, &format!("note: {}: {note}", arguments.photo.display()));
    }
    tell(quiet, &format!("a knit: {}", arguments.output.display()));
    let Recognition { fabric, ranked, .. } = found;
    let mut lines = vec![
        format!("{:12}{}", "cloth", ranked.first().map_or("", |best| &best.fabric.name)),
        format!(
            "{:12}{:.2} wales and {:.2} courses a cm",
            "densities", fabric.wales_per_cm, fabric.courses_per_cm
        ),
        format!("{:12}{}", "unexplained", percent(found.unexplained())),
    ];
    // Where a person has named the lapping, nothing competes with it.
    lines.extend((ranked.len() > 1).then(|| format!("{:12}{}", "margin", percent(found.margin()))));
    lines.extend((0..fabric.yarn_systems()).map(|system| {
        let name = if fabric.warp_knit().is_some() { "bar" } else { "feeder" };
        format!(
            "{:12}{} {} {}",
            format!("{name} {}", system + 1),
            fabric.lapping(system),
            fabric.yarn(system).count,
            fabric.yarn(system).color
        )
    }));
    lines.extend(ranked.iter().skip(1).map(|other| {
        format!("{:12}{} explains {}", "or", other.fabric.name, percent(other.explained_of_common))
    }));
    print(&(lines.join("\n") + "\n"))
}

/// Reads a layout that a person gives.
fn read_layout(path: &Path) -> Result<GivenLayout> {
    let size = std::fs::metadata(path)
        .with_context(|| format!("{}: can't be read", path.display()))?
        .len();
    if size > MOST_BYTES {
        bail!("{}: is no layout of capture: {size} bytes are too many", path.display());
    }
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("{}: can't be read", path.display()))?;
    GivenLayout::parse(&text)
        .map_err(|error| anyhow!("{}:{}: {}", path.display(), error.line, error.what))
}

/// The printed report: a line for each number, with its name first, then a table of segments.
fn report(found: &Captured) -> String {
    let Captured { unit, layout, fabric, pixel, scale, .. } = found;
    let rows = [
        (
            "cell",
            format!(
                "{} and {} pixels, confidence {:.2}",
                vector(unit.lattice.a),
                vector(unit.lattice.b),
                unit.confidence
            ),
        ),
        (
            "laid",
            format!(
                "cell of {:.3} x {:.3} mm, {} strands",
                fabric.wale_spacing(),
                fabric.course_spacing(),
                fabric.yarn_systems()
            ),
        ),
        ("scale", format!("{:.2} pixels a mm", pixel.recip())),
        ("seen at", format!("{scale:.2} of the photo's size")),
        (
            "unexplained",
            format!("{}, by what is seen {}", percent(layout.error), percent(layout.visible_error)),
        ),
        ("overlap", percent(layout.overlap)),
        ("blank", percent(layout.blank)),
    ];
    let mut lines: Vec<String> =
        rows.iter().map(|(name, value)| format!("{name:12}{value}")).collect();
    lines.push(format!(
        "{:>7} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}",
        "segment", "x", "y", "degrees", "width", "length", "width mm", "twist"
    ));
    for (index, source) in layout.sources.iter().enumerate() {
        let (segment, twist) = (&layout.visible[index], &found.twists[index]);
        // A twist that is a guess has a question mark.
        let mark = if twist.is_guess { "?" } else { "" };
        lines.push(format!(
            "{:7} {:9.2} {:9.2} {:>9} {:9.2} {:9.2} {:9.3} {:9.1}{mark}",
            source + 1,
            segment.centre.x,
            segment.centre.y,
            segment.degrees_text(),
            segment.width,
            segment.length,
            found.shapes[index].width,
            twist.degrees
        ));
    }
    lines.join("\n") + "\n"
}

fn vector(vector: DVec2) -> String {
    format!("{:.2},{:.2}", vector.x, vector.y)
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}
