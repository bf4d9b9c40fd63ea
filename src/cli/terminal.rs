//! A command's threads, and its output on the terminal: data on stdout, the progress bar and messages
//! on stderr.

use std::io::{self, Write};

use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};
use rayon::ThreadPoolBuilder;
use warpknit::pipeline::{Listener, Message, Task};

use super::args::Running;

/// The listener of a run that shows a progress bar and messages on stderr.
#[derive(Debug)]
pub(crate) struct Terminal {
    bar: ProgressBar,
    quiet: bool,
}

impl Terminal {
    /// Starts a command: its threads, by default one for each core, and the progress bar.
    pub(crate) fn begin_command(running: &Running) -> Result<Self> {
        // 0 stands for all cores. Started here and not at the first use, where a system without room
        // for them would end the program with a panic.
        ThreadPoolBuilder::new()
            .num_threads(running.threads.unwrap_or(0) as usize)
            .build_global()
            .context("can't start the threads")?;
        Ok(Self::new(running.quiet))
    }

    /// A progress bar. It is visible only if stderr is a terminal.
    pub(crate) fn new(quiet: bool) -> Self {
        let bar = if quiet { ProgressBar::hidden() } else { ProgressBar::new(1000) };
        let style = ProgressStyle::with_template("{msg:10} {bar:40} {percent:>3} %")
            .expect("a fixed template");
        bar.set_style(style);
        Self { bar, quiet }
    }

    /// Prints a message on stderr above the bar, also with `--quiet`.
    pub(crate) fn aside(&self, message: &str) {
        self.bar.suspend(|| tell(false, message));
    }

    /// Removes the bar.
    pub(crate) fn clear(&self) {
        self.bar.finish_and_clear();
    }
}

impl Listener for Terminal {
    fn begin(&self, task: Task, done: f64) {
        self.bar.set_message(match task {
            Task::Read => "reading",
            Task::Develop => "developing",
            Task::Measure | Task::Clearance => "measuring",
            Task::Render => "rendering",
            Task::Compress | Task::Write => "writing",
            Task::Relax | Task::Strain => "relaxing",
            Task::Lay
            | Task::Knit
            | Task::Index
            | Task::Locate
            | Task::Map
            | Task::Sweep
            | Task::Surface => "knitting",
        });
        self.progress(done);
    }

    fn progress(&self, done: f64) {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share in thousandths"
        )]
        self.bar.set_position((1000.0 * done.clamp(0.0, 1.0)) as u64);
    }

    fn say(&self, message: Message<'_>) {
        if !self.quiet {
            self.aside(&match message {
                Message::Warning(text) => format!("warning: {text}"),
                Message::Note(text) => format!("note: {text}"),
            });
        }
    }
}

/// Prints data to stdout. A closed stdout is no error, so that the files are still written.
pub(super) fn print(text: &str) -> Result<()> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        printed => Ok(printed?),
    }
}

/// Prints a message on stderr, unless `quiet`.
pub(super) fn tell(quiet: bool, message: &str) {
    if !quiet {
        // A closed stderr must not end the work.
        let _closed = writeln!(io::stderr(), "{message}");
    }
}
