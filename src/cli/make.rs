//! `warpknit drape` and `warpknit swatch`. In: arguments. Out: files, and a line about them.

use std::path::Path;

use anyhow::Result;
use warpknit::pipeline::{self, Body, Clock, Done, PictureSettings, Sequence, Settings, Task};

use super::args::{Drape, Swatch};
use super::choice::fabric;
use super::drapes::{Drapes, expanded};
use super::numbers;
use super::terminal::{Terminal, print, tell};
use super::values::SwitchArg;

/// Knits a fabric onto a garment.
pub(crate) fn drape(arguments: &Drape) -> Result<()> {
    let shared = &arguments.shared;
    let terminal = Terminal::begin_command(&shared.running)?;
    let mut clock = Clock::start(&terminal);
    clock.begin(Task::Read, 0.0);
    let fabric = fabric(shared)?;
    let drapes = Drapes::from_paths(&arguments.flat, &arguments.draped)?;
    let skip_bad = arguments.motion.skip_bad_frames;
    let (garment, motion) = drapes.open(&arguments.reading.options(), skip_bad)?;
    let inputs = drapes.inputs().map(Path::to_owned).collect();
    let source = shared.source(&fabric, inputs, drapes.stem());
    let shared_settings = shared.settings();
    let settings = Settings {
        enlarge: arguments.laying.enlarge,
        picture: PictureSettings {
            loupe: arguments.loupe.unwrap_or_default(),
            studio: arguments.stage.studio.map(SwitchArg::is_on),
            environment: arguments.stage.environment()?,
            body: body(arguments)?,
            edges: arguments.edges.map(Into::into),
            ..shared_settings.picture
        },
        placement: arguments.laying.placement(),
        cache: arguments.laying.cache(),
        tile: arguments.part.tile,
        ..shared_settings
    };
    let sequence = motion.as_ref().map(|motion| Sequence {
        motion,
        paths: &drapes.frames,
        skip_bad,
        frames_per_second: arguments.motion.fps,
    });
    let done = pipeline::drape(garment, sequence.as_ref(), &fabric, &source, &settings, clock)?;
    terminal.clear();
    tell_done(&done, shared.running.quiet);
    Ok(())
}

/// The body that a garment is shown on.
fn body(arguments: &Drape) -> Result<Body> {
    Ok(match &arguments.body {
        _ if arguments.body_cloth => Body::Lining,
        Some(path) => Body::Files(expanded(path)?),
        None => Body::None,
    })
}

/// Knits a flat piece of fabric, and prints its numbers.
pub(crate) fn swatch(arguments: &Swatch) -> Result<()> {
    let shared = &arguments.shared;
    let terminal = Terminal::begin_command(&shared.running)?;
    let clock = Clock::start(&terminal);
    let fabric = fabric(shared)?;
    // The name may be that of chains, or any text of a fabric file. A slash would make it a path.
    let is_path = fabric.name.is_empty() || fabric.name.contains(['/', '\\']);
    let stem = if is_path { "swatch" } else { &fabric.name };
    let source = shared.source(&fabric, Vec::new(), Path::new(stem));
    let shared_settings = shared.settings();
    let settings = Settings {
        tile: arguments.part.tile,
        stretch: arguments.stretch,
        picture: PictureSettings {
            studio: arguments.stage.studio.map(SwitchArg::is_on),
            environment: arguments.stage.environment()?,
            ..shared_settings.picture
        },
        ..shared_settings
    };
    let size = [arguments.wales, arguments.courses];
    let done = pipeline::swatch(size, &fabric, &source, &settings, clock)?;
    terminal.clear();
    tell_done(&done, shared.running.quiet);
    let numbers = done.real.iter().map(numbers::table);
    let stretched = done.stretched.iter().map(numbers::stretched);
    print(&numbers.chain(stretched).collect::<String>())
}

/// Prints the counts and the names of the files.
fn tell_done(done: &Done, quiet: bool) {
    let frames =
        done.frames.map_or_else(String::new, |(made, all)| format!("{made} of {all} frames, "));
    for part in &done.parts {
        let (stitches, yarns) = (part.totals.losses.stitches, part.totals.yarns);
        let counts = match part.whole {
            Some(whole) if part.is_averaged => format!("{whole} stitches, drawn as averaged cloth"),
            Some(whole) => format!("{stitches} stitches in view of {whole}, {yarns} yarns"),
            None => format!("{stitches} stitches, {yarns} yarns"),
        };
        tell(quiet, &format!("{frames}{counts}: {}", part.files));
    }
}
