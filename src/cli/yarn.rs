//! `warpknit yarn`: from a photo of a yarn to a folder of maps, with a contact sheet.
//!
//! In: the flags and the photo. Out: the folder, and a report on standard output. The folder
//! appears only when it is complete.

use std::fmt::Write as _;

use anyhow::{Context, Result, bail};
use warpknit::export::{OutputFolder, png};
use warpknit::folder::yarn_maps::{FILES, save};
use warpknit::photo::yarn::develop::{Developed, PixelScale, Step, YarnPhotoSettings, develop};
use warpknit::photo::yarn::{read_maps, read_photo};

use super::args::YarnArgs;
use super::contact::{self, SWATCH_YARN_WIDTH};
use super::terminal::{Terminal, print, tell};
use warpknit::pipeline::{Listener as _, Task};

/// Accepted sizes of maps, mm. A size outside comes from a mistake in a flag.
const SIZES: std::ops::RangeInclusive<f64> = 0.001..=10_000.0;
/// Number of files in the folder that are not maps: yarn.toml and the contact sheet.
const OTHER_FILES: usize = 2;
/// Share of the progress bar for the steps. The sheet's swatch has the rest.
const STEPS_SHARE: f32 = 0.6;

/// Develops a photo into a folder of maps.
pub(crate) fn yarn(arguments: &YarnArgs) -> Result<()> {
    let terminal = Terminal::begin_command(&arguments.running)?;
    terminal.begin(Task::Read, 0.0);
    // Wrong paths end the command here, before the work.
    check_names(arguments)?;
    let folder = OutputFolder::create(&arguments.output)?;
    let photo = read_photo(&arguments.photo)?;
    let mut steps = 0;
    terminal.begin(Task::Develop, 0.0);
    let mut decided = |step: Step, decision: &str| {
        steps += 1;
        if arguments.verbose {
            terminal.aside(&format!("{:9}{decision}", step.name()));
        }
        terminal.begin(
            Task::Develop,
            f64::from(STEPS_SHARE) * f64::from(steps) / Step::ALL.len() as f64,
        );
    };
    let yarn = develop(&photo, &arguments.settings(), &mut decided)
        .with_context(|| arguments.photo.display().to_string())?;
    check_size(&yarn)?;
    terminal.begin(Task::Write, f64::from(STEPS_SHARE));
    save(&yarn, &folder)?;
    // The swatch uses the maps as read back from the files: it shows what other programs will see.
    let maps = read_maps(&folder.file(""), SWATCH_YARN_WIDTH, None)?;
    terminal.begin(Task::Render, f64::from(STEPS_SHARE));
    let swatch = contact::swatch(maps, &yarn, &|done| {
        terminal.progress(f64::from(STEPS_SHARE + (1.0 - STEPS_SHARE) * done));
    })?;
    terminal.begin(Task::Write, 1.0);
    png::write(&folder.file("sheet.png"), &contact::sheet(&photo, &yarn, &swatch))?.publish()?;
    folder.publish()?;
    terminal.clear();
    // Notes go to standard error, so that the report can be parsed.
    notes(&yarn).iter().for_each(|note| {
        tell(arguments.running.quiet, &format!("note: {}: {note}", arguments.photo.display()));
    });
    tell(
        arguments.running.quiet,
        &format!("{} maps: {}", FILES.len() - OTHER_FILES, arguments.output.display()),
    );
    print(&report(&yarn))
}

impl YarnArgs {
    /// The library's settings. --dpi and --yarn-width-mm exclude each other.
    fn settings(&self) -> YarnPhotoSettings {
        let scale = match (self.dpi, self.yarn_width_mm) {
            (Some(dpi), _) => PixelScale::Dpi(dpi),
            (None, Some(width)) => PixelScale::YarnWidth(width),
            (None, None) => PixelScale::Unknown,
        };
        let Self { crop, brightness, contrast, threshold, .. } = *self;
        YarnPhotoSettings { crop, brightness, contrast, threshold, scale }
    }
}

/// Refuses an output folder in which a file would overwrite the photo.
fn check_names(arguments: &YarnArgs) -> Result<()> {
    let photo = arguments.photo.canonicalize().ok();
    for file in FILES {
        let target = arguments.output.join(file);
        if photo.is_some() && target.canonicalize().ok() == photo {
            bail!(
                "{}: this is the photo, and it would be overwritten; name another folder with -o",
                target.display()
            );
        }
    }
    Ok(())
}

/// Refuses sizes that no yarn has, before anything is written.
fn check_size(yarn: &Developed) -> Result<()> {
    if let Some((width, length)) = yarn.width().zip(yarn.length())
        && !(SIZES.contains(&width) && SIZES.contains(&length))
    {
        // In exponents: such sizes are often off by powers of ten.
        bail!(
            "the maps would be {width:.3e} mm wide and {length:.3e} mm long: \
             check --yarn-width-mm or --dpi"
        );
    }
    Ok(())
}

/// Notes for the user of the maps.
fn notes(yarn: &Developed) -> Vec<String> {
    let mut notes = Vec::new();
    if yarn.mm_per_pixel.is_none() {
        notes.push(
            "nothing says how large the yarn is, so it is taken to be as thick as the fabric's; \
             give --yarn-width-mm or --dpi"
                .to_owned(),
        );
    }
    if !yarn.repeat.is_found {
        let correlation = yarn.repeat.correlation;
        notes.push(format!(
            "no repeat was found (correlation {correlation:.2}); the maps show a stretch that fits \
             itself, which is as good for spun yarns"
        ));
    }
    notes
}

/// The report: one line for each figure, its name first.
fn report(yarn: &Developed) -> String {
    let (width, height) = yarn.base.dimensions();
    let rows = [
        ("yarn", yarn.orientation.to_string()),
        ("threshold", format!("{:.1} of 255", yarn.threshold)),
        ("yarn width", format!("{:.2} pixels{}", yarn.yarn_width, in_mm(yarn, yarn.yarn_width))),
        ("repeat", format!("{}{}", yarn.repeat, in_mm(yarn, yarn.repeat.length))),
        ("seam", format!("{}, gradient energy {:.2} of the rest's", yarn.seam, yarn.seam.energy)),
        ("maps", format!("{width} x {height} texels, {} wide with the fuzz", wide(yarn))),
        (
            "e",
            yarn.mapping_coefficient()
                .map_or_else(|| "-".to_owned(), |e| format!("{e:.4} repeats a mm")),
        ),
    ];
    rows.iter().fold(String::new(), |mut text, (name, value)| {
        writeln!(text, "{name:12}{value}").expect("a string takes any text");
        text
    })
}

/// A length in mm, as an addition to one in pixels; nothing where the scale is unknown.
fn in_mm(yarn: &Developed, pixels: f64) -> String {
    yarn.mm_per_pixel.map_or_else(String::new, |scale| format!(", {:.4} mm", pixels * scale))
}

/// The width of the maps, in mm if it is known, else in widths of the yarn.
fn wide(yarn: &Developed) -> String {
    yarn.width().map_or_else(
        || format!("{:.2} yarns", f64::from(yarn.base.height()) / yarn.yarn_width),
        |mm| format!("{mm:.4} mm"),
    )
}
