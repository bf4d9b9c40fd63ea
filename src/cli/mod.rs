//! The commands, one file each, and what they share.

mod args;
mod bench;
mod choice;
mod clock;
mod config;
mod contact;
mod drapes;
mod fabrics;
mod inspect;
mod job;
mod make;
mod numbers;
mod pictures;
mod sequence;
mod sheet;
mod shell;
#[cfg(unix)]
mod signals;
mod system;
mod targets;
mod values;
#[cfg(feature = "view")]
mod view;
mod writers;
mod yarn;

use std::io::{self, Write};

use anyhow::Result;

pub(crate) use args::Arguments;
use args::Command;
#[cfg(unix)]
pub(crate) use signals::clean_up_on_signals;

/// Runs the command that was asked for.
pub(crate) fn run(arguments: Arguments) -> Result<()> {
    match arguments.command {
        Command::Drape(drape) => make::drape(&drape),
        Command::Swatch(swatch) => make::swatch(&swatch),
        #[cfg(feature = "view")]
        Command::View(live) => view::view(live),
        Command::Inspect(inspect) => inspect::inspect(&inspect),
        Command::Fabrics(fabrics) => fabrics::fabrics(&fabrics),
        Command::Yarn(arguments) => yarn::yarn(&arguments),
        Command::Bench(arguments) => bench::bench(&arguments),
        Command::Completions(arguments) => shell::completions(&arguments),
        Command::Man(arguments) => shell::man(&arguments),
    }
}

/// Prints data to stdout; a closed pipe is an error that `main` takes for the end.
fn print(text: &str) -> Result<()> {
    let mut stdout = io::stdout().lock();
    stdout.write_all(text.as_bytes())?;
    Ok(stdout.flush()?)
}

/// Tells a person something, on stderr.
fn tell(quiet: bool, message: &str) {
    if !quiet {
        // Nothing is lost if nobody listens.
        let _unheard = writeln!(io::stderr(), "{message}");
    }
}
