//! `warpknit capture`: a photo of a cloth to the yarns of its repeat.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use glam::DVec2;
use warpknit::export::OutputFolder;
use warpknit::folder::captured::{FILES, save};
use warpknit::photo::capture::{Captured, GivenLayout, Settings, capture as captured};
use warpknit::photo::yarn::read_photo;

use super::args::Capture;
use super::clock::{Clock, Task};
use super::targets::check_distinct;
use super::{print, tell};

/// A layout file that is longer is none.
const MOST_BYTES: u64 = 1 << 20;
/// Captures a photo. The folder is seen only when all of it is whole.
pub(crate) fn capture(arguments: &Capture) -> Result<()> {
    let mut clock = Clock::begin_command(&arguments.running)?;
    clock.begin(Task::Read, 0.0);
    let inputs = [Some(&arguments.photo), arguments.layout.as_ref()]
        .into_iter()
        .flatten()
        .map(PathBuf::as_path);
    let outputs = FILES.map(|file| arguments.output.join(file));
    check_distinct(inputs, outputs.iter().map(PathBuf::as_path))?;
    let folder = OutputFolder::create(&arguments.output)?;
    let layout = arguments.layout.as_deref().map(given).transpose()?;
    let cell = arguments.cell.map(|[ax, ay, bx, by]| [DVec2::new(ax, ay), DVec2::new(bx, by)]);
    let photo = read_photo(&arguments.photo)?;
    clock.begin(Task::Develop, 0.2);
    // What is wrong with a person's layout is told with its file.
    let about = arguments.layout.as_ref().unwrap_or(&arguments.photo);
    let &Capture { thickness, pixels_per_mm, .. } = arguments;
    let found = captured(&photo, &Settings { thickness, pixels_per_mm, cell, layout })
        .with_context(|| about.display().to_string())?;
    clock.begin(Task::Write, 0.9);
    save(&found, &folder)?;
    folder.publish()?;
    clock.stop();
    clock.clear();
    let quiet = arguments.running.quiet;
    found
        .warnings()
        .iter()
        .for_each(|note| tell(quiet, &format!("note: {}: {note}", arguments.photo.display())));
    tell(quiet, &format!("{} segments: {}", found.layout.seen.len(), arguments.output.display()));
    print(&report(&found))
}

/// Reads a layout that a person gives.
fn given(path: &Path) -> Result<GivenLayout> {
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

/// A line a number, its name first, then a row a segment.
fn report(found: &Captured) -> String {
    let Captured { unit, layout, fabric, pixel, scale, .. } = found;
    let vector = |vector: DVec2| format!("{:.2},{:.2}", vector.x, vector.y);
    let share = |share: f64| format!("{:.1} %", 100.0 * share);
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
            format!("{}, by what is seen {}", share(layout.error), share(layout.seen_error)),
        ),
        ("overlap", share(layout.overlap)),
        ("blank", share(layout.blank)),
    ];
    let mut text = String::new();
    let mut line = |words: String| writeln!(text, "{words}").expect("a string takes any text");
    rows.iter().for_each(|(name, value)| line(format!("{name:12}{value}")));
    line(format!(
        "{:>7} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}",
        "segment", "x", "y", "degrees", "width", "length", "width mm", "twist"
    ));
    for ((number, segment), (shape, twist)) in layout
        .numbers
        .iter()
        .map(|number| number + 1)
        .zip(&layout.seen)
        .zip(found.shapes.iter().zip(&found.twists))
    {
        let (centre, degrees) = (segment.centre, segment.angle.to_degrees().rem_euclid(360.0));
        let sizes = format!("{:9.2} {:9.2} {:9.3}", segment.width, segment.length, shape.width);
        let mark = if twist.is_guess { "?" } else { "" };
        line(format!(
            "{number:7} {:9.2} {:9.2} {degrees:9.1} {sizes} {:9.1}{mark}",
            centre.x, centre.y, twist.degrees
        ));
    }
    text
}
