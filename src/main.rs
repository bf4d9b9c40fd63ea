//! The `warpknit` command: reads its arguments, runs one of the library's jobs, prints what a
//! person wants to know.
//!
//! Data go to stdout, all else to stderr. Exit status: 0 done, 1 failed, 2 wrong usage; a signal
//! that ends it does so after the temporary files are removed.

mod cli;

use std::io::{self, Write};
use std::process::ExitCode;

use warpknit::fabric::FabricError;

fn main() -> ExitCode {
    #[cfg(unix)]
    if let Err(error) = cli::clean_up_on_signals() {
        // Cloth can be made without; only an interrupted run then leaves its temporary files to the
        // next one.
        let _unheard = writeln!(io::stderr(), "warning: signals can't be heard: {error}");
    }
    match cli::Arguments::of_process().and_then(cli::run) {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever read our output has seen enough.
        Err(error) if cli::is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            // Nothing is left to be done if even stderr is closed.
            let _unheard = writeln!(io::stderr(), "error: {error:#}{}", caret(&error));
            ExitCode::FAILURE
        }
    }
}

/// Where an error is about a place in a fabric: its line, and carets below that place.
fn caret(error: &anyhow::Error) -> String {
    let place = error.downcast_ref::<FabricError>().and_then(|error| error.place.as_ref());
    place.map_or_else(String::new, |place| format!("\n{place}").replace('\n', "\n  "))
}
