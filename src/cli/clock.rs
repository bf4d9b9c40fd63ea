//! A command's threads, and its time for people: how long each stage took, and a progress bar on a
//! terminal.

use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};
use rayon::ThreadPoolBuilder;
use warpknit::report::Timings;

use super::args::Running;

/// What time is spent on, as the report names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Task {
    Read,
    Knit,
    Index,
    Locate,
    Map,
    Surface,
    Develop,
    Measure,
    Render,
    /// Pictures, into files.
    Compress,
    Write,
}

const TASKS: usize = 11;

/// A stopwatch that is always running for exactly one task, or none.
#[derive(Debug)]
pub(crate) struct Clock {
    start: Instant,
    lap: Instant,
    running: Option<Task>,
    spent: [Duration; TASKS],
    bar: ProgressBar,
}

impl Clock {
    /// Starts a command: its threads, all cores where no number is given, and the clock.
    pub(crate) fn begin_command(running: &Running) -> Result<Self> {
        if let Some(threads) = running.threads {
            ThreadPoolBuilder::new()
                .num_threads(threads as usize)
                .build_global()
                .context("can't start the threads")?;
        }
        Ok(Self::start(running.quiet))
    }

    /// Starts. The bar shows itself on a terminal only.
    pub(crate) fn start(quiet: bool) -> Self {
        let bar = if quiet { ProgressBar::hidden() } else { ProgressBar::new(1000) };
        let style = ProgressStyle::with_template("{msg:10} {bar:40} {percent:>3} %")
            .expect("a fixed template");
        bar.set_style(style);
        let now = Instant::now();
        Self { start: now, lap: now, running: None, spent: [Duration::ZERO; TASKS], bar }
    }

    /// Ends the running task and begins another, of which a share is done.
    pub(crate) fn begin(&mut self, task: Task, done: f64) {
        self.stop();
        self.running = Some(task);
        self.bar.set_message(match task {
            Task::Read => "reading",
            Task::Develop => "developing",
            Task::Measure => "measuring",
            Task::Render => "rendering",
            Task::Compress | Task::Write => "writing",
            _ => "knitting",
        });
        show(&self.bar, done);
    }

    /// Ends the running task.
    pub(crate) fn stop(&mut self) {
        let now = Instant::now();
        if let Some(task) = self.running.take() {
            self.spent[task as usize] += now - self.lap;
        }
        self.lap = now;
    }

    /// Tells of progress from any thread.
    pub(crate) fn progress(&self) -> impl Fn(f32) + Sync + use<> {
        let bar = self.bar.clone();
        move |done| show(&bar, f64::from(done))
    }

    /// Says something on stderr that stays above the bar.
    pub(crate) fn aside(&self, message: &str) {
        self.bar.suspend(|| super::tell(false, message));
    }

    /// Removes the bar.
    pub(crate) fn clear(&self) {
        self.bar.finish_and_clear();
    }

    fn spent(&self, task: Task) -> f64 {
        1000.0 * self.spent[task as usize].as_secs_f64()
    }

    /// What all stages but drawing and its files took so far, ms.
    pub(crate) fn without_pictures(&self) -> f64 {
        1000.0 * self.spent.iter().sum::<Duration>().as_secs_f64()
            - self.spent(Task::Render)
            - self.spent(Task::Compress)
    }

    /// All stages, ms; building the search structures counts as location.
    pub(crate) fn timings(&self) -> Timings {
        Timings {
            read: self.spent(Task::Read),
            knit: self.spent(Task::Knit),
            locate: self.spent(Task::Index) + self.spent(Task::Locate),
            map: self.spent(Task::Map),
            surface: self.spent(Task::Surface),
            render: self.spent(Task::Render),
            write: self.spent(Task::Compress) + self.spent(Task::Write),
            total: 1000.0 * self.start.elapsed().as_secs_f64(),
        }
    }
}

fn show(bar: &ProgressBar, done: f64) {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share in thousandths"
    )]
    bar.set_position((1000.0 * done.clamp(0.0, 1.0)) as u64);
}
