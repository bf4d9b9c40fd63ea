//! The `warpknit` command: it parses its arguments, runs one command, and prints the result.
//!
//! Data go to stdout, everything else to stderr. Exit status: 0 done, 1 failed, 2 wrong usage. A
//! signal ends the program after the temporary files are removed.

mod cli;

use std::io::{self, Write};
use std::process::ExitCode;

use warpknit::fabric::FabricError;

fn main() -> ExitCode {
    #[cfg(unix)]
    if let Err(error) = cli::clean_up_on_signals() {
        // The work is possible without. Only the temporary files of an interrupted run then stay
        // until the next run.
        let _closed = writeln!(io::stderr(), "warning: can't listen for signals: {error}");
    }
    match cli::Arguments::from_process().and_then(cli::run) {
        Ok(()) => ExitCode::SUCCESS,
        // A reader such as `head` has closed our output on purpose.
        Err(error) if cli::is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            // If stderr is closed too, there is no other place for the message.
            let _closed = writeln!(io::stderr(), "error: {error:#}{}", caret(&error));
            ExitCode::FAILURE
        }
    }
}

/// The line of the fabric file that an error is about, with carets below the place. Empty for other
/// errors.
fn caret(error: &anyhow::Error) -> String {
    let place = error.downcast_ref::<FabricError>().and_then(|error| error.place.as_ref());
    place.map_or_else(String::new, |place| format!("\n{place}").replace('\n', "\n  "))
}
