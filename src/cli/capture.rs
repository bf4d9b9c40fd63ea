//! `warpknit capture`: a photo of a cloth to the yarns of its repeat.
//!
//! In: the arguments. Out: the folder of [`FILES`], notes on standard error, and a table of the
//! segments on standard output.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use glam::DVec2;
use warpknit::export::OutputFolder;
use warpknit::folder::captured::{FILES, save};
use warpknit::photo::capture::{CaptureSettings, Captured, GivenLayout, capture as captured};
use warpknit::photo::yarn::read_photo;

use super::args::Capture;
use super::terminal::{Terminal, print, tell};
use warpknit::pipeline::{Listener as _, Task, check_distinct};

/// Longest layout file, bytes. One of 64 segments has some thousands.
const MOST_BYTES: u64 = 1 << 20;

/// Captures a photo. The folder appears only when all of its files are whole.
pub(crate) fn capture(arguments: &Capture) -> Result<()> {
    let terminal = Terminal::begin_command(&arguments.running)?;
    terminal.begin(Task::Read, 0.0);
    let inputs = [Some(&arguments.photo), arguments.layout.as_ref()]
        .into_iter()
        .flatten()
        .map(PathBuf::as_path);
    let outputs = FILES.map(|file| arguments.output.join(file));
    check_distinct(inputs, outputs.iter().map(PathBuf::as_path))?;
    let folder = OutputFolder::create(&arguments.output)?;
    let layout = arguments.layout.as_deref().map(read_layout).transpose()?;
    let cell = arguments.cell.map(|[ax, ay, bx, by]| [DVec2::new(ax, ay), DVec2::new(bx, by)]);
    let photo = read_photo(&arguments.photo)?;
    terminal.begin(Task::Develop, 0.2);
    // An error in a person's layout names the layout's file and not the photo.
    let about = arguments.layout.as_ref().unwrap_or(&arguments.photo);
    let &Capture { thickness, pixels_per_mm, .. } = arguments;
    let found = captured(&photo, &CaptureSettings { thickness, pixels_per_mm, cell, layout })
        .with_context(|| about.display().to_string())?;
    terminal.begin(Task::Write, 0.9);
    save(&found, &folder)?;
    folder.publish()?;
    terminal.clear();
    let quiet = arguments.running.quiet;
    for note in found.warnings() {
        tell(quiet, &format!("note: {}: {note}", arguments.photo.display()));
    }
    let count = found.layout.visible.len();
    let noun = if count == 1 { "segment" } else { "segments" };
    tell(quiet, &format!("{count} {noun}: {}", arguments.output.display()));
    print(&report(&found))
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
