//! `warpknit tile`: one repeat of a fabric as maps and materials.
//!
//! In: the arguments. Out: a folder, which appears only when it is complete, and a table of the
//! maps' numbers on standard output.

use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::{Result, anyhow};
use warpknit::export::OutputFolder;
use warpknit::export::material::UtcTime;
use warpknit::folder::fabric_maps::save;
use warpknit::pipeline::{Clock, Densities, Listener as _, Task, fabric_maps};

use super::args::TileArgs;
use super::choice::fabric_of;
use super::terminal::{Terminal, print, tell};

/// A time for files that shall have the same bytes whenever they are made, in seconds since 1970
/// (reproducible-builds.org).
const FIXED_TIME: &str = "SOURCE_DATE_EPOCH";

/// Draws a fabric into a folder of maps.
pub(crate) fn tile(arguments: &TileArgs) -> Result<()> {
    let TileArgs { fabric: asked, output, dpi, chains, running, .. } = arguments;
    let terminal = Terminal::begin_command(running)?;
    let mut clock = Clock::start(&terminal);
    // Wrong paths and times end the command here, before the work.
    let time = time()?;
    let densities = Densities {
        wales_per_cm: arguments.wales_per_cm,
        courses_per_cm: arguments.courses_per_cm,
    };
    let fabric = fabric_of(asked, chains, densities, running.quiet)?;
    let folder = OutputFolder::create(output)?;
    let mapped = fabric_maps(&fabric, chains.label(asked, &fabric), *dpi, &mut clock)?;
    terminal.begin(Task::Write, 1.0);
    // The name may be that of chains, or any text of a fabric file.
    let name = if fabric.name.is_empty() { stem(asked) } else { &fabric.name };
    let report = save(&mapped, name, *dpi, time, &folder)?;
    folder.publish()?;
    terminal.clear();
    tell(running.quiet, &format!("maps of one repeat: {}", output.display()));
    print(&report.table())
}

/// The time of the files: now, or that of [`FIXED_TIME`].
fn time() -> Result<UtcTime> {
    let seconds = match std::env::var_os(FIXED_TIME) {
        Some(fixed) => {
            let seconds = fixed.to_str().and_then(|fixed| fixed.parse().ok());
            seconds.ok_or_else(|| {
                anyhow!("{FIXED_TIME}: it must be a whole number of seconds since 1970")
            })?
        }
        None => SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs()),
    };
    Ok(UtcTime::from_unix(seconds))
}

/// The name of a file without its folder and its ending.
fn stem(path: &str) -> &str {
    Path::new(path).file_stem().and_then(|stem| stem.to_str()).unwrap_or(path)
}
