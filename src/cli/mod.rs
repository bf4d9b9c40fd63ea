//! The command line: one file for each command, and the parts that commands share.

mod args;
mod bench;
mod capture;
mod choice;
mod config;
mod contact;
mod cpu_time;
mod drapes;
mod fabrics;
mod facts;
mod inspect;
mod make;
mod numbers;
mod sheet;
mod shell;
#[cfg(unix)]
mod signals;
mod terminal;
mod tile;
mod values;
#[cfg(feature = "view")]
mod view;
mod yarn;

use std::io;

use anyhow::{Result, anyhow};

pub(crate) use args::Arguments;
use args::Command;
#[cfg(unix)]
pub(crate) use signals::clean_up_on_signals;

/// Runs the command that the arguments name.
pub(crate) fn run(arguments: Arguments) -> Result<()> {
    match arguments.command {
        Command::Drape(drape) => with_lost_files(drape.shared.outputs.len(), make::drape(&drape)),
        Command::Swatch(swatch) => {
            with_lost_files(swatch.shared.outputs.len(), make::swatch(&swatch))
        }
        #[cfg(feature = "view")]
        Command::View(live) => view::view(live),
        Command::Inspect(inspect) => inspect::inspect(&inspect),
        Command::Fabrics(fabrics) => fabrics::fabrics(&fabrics),
        Command::Tile(arguments) => tile::tile(&arguments),
        Command::Yarn(arguments) => yarn::yarn(&arguments),
        Command::Capture(arguments) => capture::capture(&arguments),
        Command::Bench(arguments) => bench::bench(&arguments),
        Command::Completions(arguments) => shell::completions(&arguments),
        Command::Man(arguments) => shell::man(&arguments),
    }
}

/// Whether the error is that a reader of our output has closed it. That ends a run, but is no fault.
pub(crate) fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error
        .chain()
        .filter_map(|cause| cause.downcast_ref::<io::Error>())
        .any(|cause| cause.kind() == io::ErrorKind::BrokenPipe)
}

/// Turns a closed output into an error if other outputs are lost with it.
fn with_lost_files(outputs: usize, made: Result<()>) -> Result<()> {
    match made {
        // The error text replaces the chain, so that `is_broken_pipe` no longer hides it.
        Err(error) if outputs > 1 && is_broken_pipe(&error) => {
            Err(anyhow!("{error:#}; no other file is written"))
        }
        made => made,
    }
}
