//! The time of a run, task by task, and who hears of its progress.
//!
//! In: tasks as they begin and end. Out: [`Timings`] for the report. A [`Listener`] hears of each
//! task and message; the command draws a progress bar with it, and the library prints nothing by
//! itself.

use std::time::{Duration, Instant};

use crate::drape::Stage;
use crate::report::Timings;

/// What time is spent on, as the report names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// Reading meshes and photos.
    Read,
    /// Data points on the flat fabric.
    Knit,
    /// Building the trees that location searches in.
    Index,
    /// The triangle of each data point.
    Locate,
    /// Draped positions.
    Map,
    /// Tubes.
    Surface,
    /// Maps or yarns of a photo.
    Develop,
    /// A benchmark.
    Measure,
    /// Pictures.
    Render,
    /// Pictures, into files.
    Compress,
    /// All other files.
    Write,
}

const TASKS: usize = 11;

impl From<Stage> for Task {
    fn from(stage: Stage) -> Self {
        match stage {
            Stage::Index => Self::Index,
            Stage::Knit => Self::Knit,
            Stage::Locate => Self::Locate,
            Stage::Map => Self::Map,
            Stage::Surface => Self::Surface,
            Stage::Deliver => Self::Write,
        }
    }
}

/// What a run says to a person while it goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Message<'a> {
    /// Something is amiss.
    Warning(&'a str),
    /// Something is worth knowing.
    Note(&'a str),
}

/// Hears how a run goes on, from any thread. `()` ignores it all.
pub trait Listener: Sync {
    /// A task begins, with the share of it that is done, from 0 to 1.
    fn begin(&self, task: Task, done: f64);
    /// The share of the running task that is done, from 0 to 1.
    fn progress(&self, done: f64);
    /// A message for a person.
    fn say(&self, message: Message<'_>);
}

impl Listener for () {
    fn begin(&self, _task: Task, _done: f64) {}
    fn progress(&self, _done: f64) {}
    fn say(&self, _message: Message<'_>) {}
}

/// A stopwatch that is always running for exactly one task, or none.
pub struct Clock<'a> {
    start: Instant,
    lap: Instant,
    running: Option<Task>,
    spent: [Duration; TASKS],
    listener: &'a dyn Listener,
}

impl<'a> Clock<'a> {
    /// Starts; the total of [`Clock::timings`] counts from here.
    #[must_use]
    pub fn start(listener: &'a dyn Listener) -> Self {
        let now = Instant::now();
        Self { start: now, lap: now, running: None, spent: [Duration::ZERO; TASKS], listener }
    }

    /// Ends the running task and begins another, of which a share is done.
    pub fn begin(&mut self, task: Task, done: f64) {
        self.stop();
        self.running = Some(task);
        self.listener.begin(task, done);
    }

    /// Ends the running task.
    pub fn stop(&mut self) {
        let now = Instant::now();
        if let Some(task) = self.running.take() {
            self.spent[task as usize] += now - self.lap;
        }
        self.lap = now;
    }

    /// Who hears of this run.
    #[must_use]
    pub fn listener(&self) -> &'a dyn Listener {
        self.listener
    }

    fn spent(&self, task: Task) -> f64 {
        1000.0 * self.spent[task as usize].as_secs_f64()
    }

    /// The time of all tasks but drawing and its files so far, ms.
    #[must_use]
    pub fn without_pictures(&self) -> f64 {
        1000.0 * self.spent.iter().sum::<Duration>().as_secs_f64()
            - self.spent(Task::Render)
            - self.spent(Task::Compress)
    }

    /// The times of all tasks, ms; building the search trees counts as location.
    #[must_use]
    pub fn timings(&self) -> Timings {
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
