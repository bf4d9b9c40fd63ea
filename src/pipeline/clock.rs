//! The time of a run, task by task, and the listener that follows its progress.
//!
//! In: tasks as they begin and end. Out: [`Timings`] for the report. A [`Listener`] receives each
//! task and each message. The command's listener draws a progress bar. The library itself prints
//! nothing.

use std::time::{Duration, Instant};

use crate::drape::{LayTimes, Stage};
use crate::report::Timings;

/// A part of a run whose time is measured. [`Clock::timings`] maps tasks to the report's keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// Reading meshes and photos.
    Read,
    /// The relaxation of one repeat.
    Relax,
    /// Knitting, locating and mapping, until [`Clock::divide`] gives each its time.
    Lay,
    /// Data points on the flat fabric.
    Knit,
    /// Building the trees that location searches in.
    Index,
    /// The triangle of each data point.
    Locate,
    /// Solving the repeat for the strains of the garment.
    Strain,
    /// Draped positions.
    Map,
    /// Moving yarns apart on the body.
    Sweep,
    /// Tubes.
    Surface,
    /// The clearance of the yarns on the body.
    Clearance,
    /// Maps or yarns of a photo.
    Develop,
    /// A benchmark.
    Measure,
    /// Pictures.
    Render,
    /// Compressing pictures and writing their files.
    Compress,
    /// All other files.
    Write,
}

/// Number of variants of [`Task`].
const TASKS: usize = 16;

impl From<Stage> for Task {
    fn from(stage: Stage) -> Self {
        match stage {
            Stage::Index => Self::Index,
            Stage::Lay => Self::Lay,
            Stage::Knit => Self::Knit,
            Stage::Locate => Self::Locate,
            Stage::Strain => Self::Strain,
            Stage::Map => Self::Map,
            Stage::Sweep => Self::Sweep,
            Stage::Clearance => Self::Clearance,
            Stage::Surface => Self::Surface,
            Stage::Deliver => Self::Write,
        }
    }
}

/// A message for a person during a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Message<'a> {
    /// A fault in the input or in the result.
    Warning(&'a str),
    /// A fact that the person may want to know.
    Note(&'a str),
}

/// Receives the progress of a run, from any thread. `()` ignores it.
pub trait Listener: Sync {
    /// A task begins. A share of it, from 0 to 1, may already be done.
    fn begin(&self, task: Task, done: f64);
    /// The finished share of the running task, from 0 to 1.
    fn progress(&self, done: f64);
    /// A message for a person.
    fn say(&self, message: Message<'_>);
}

impl Listener for () {
    fn begin(&self, _task: Task, _done: f64) {}
    fn progress(&self, _done: f64) {}
    fn say(&self, _message: Message<'_>) {}
}

/// A stopwatch for tasks. It measures one task at a time, or none.
pub struct Clock<'a> {
    start: Instant,
    lap: Instant,
    running: Option<Task>,
    spent: [Duration; TASKS],
    listener: &'a dyn Listener,
}

impl<'a> Clock<'a> {
    /// Starts the clock. The total of [`Clock::timings`] counts from here.
    #[must_use]
    pub fn start(listener: &'a dyn Listener) -> Self {
        let now = Instant::now();
        Self { start: now, lap: now, running: None, spent: [Duration::ZERO; TASKS], listener }
    }

    /// Ends the running task and begins another. A share of it, from 0 to 1, may already be done.
    pub fn begin(&mut self, task: Task, done: f64) {
        self.stop();
        self.running = Some(task);
        self.listener.begin(task, done);
    }

    /// Ends the running task.
    pub fn stop(&mut self) {
        let now = Instant::now();
        // The same task may begin many times, once for each block of yarns: its times add up.
        if let Some(task) = self.running.take() {
            self.spent[task as usize] += now - self.lap;
        }
        self.lap = now;
    }

    /// Divides the time of [`Task::Lay`], which has ended, among its parts.
    pub fn divide(&mut self, laying: &LayTimes) {
        let laid = std::mem::take(&mut self.spent[Task::Lay as usize]);
        for (stage, share) in laying.shares() {
            self.spent[Task::from(stage) as usize] += laid.mul_f64(share);
        }
    }

    /// The listener of this run.
    #[must_use]
    pub fn listener(&self) -> &'a dyn Listener {
        self.listener
    }

    /// Time of a task so far, ms.
    fn spent(&self, task: Task) -> f64 {
        1000.0 * self.spent[task as usize].as_secs_f64()
    }

    /// The time so far of all tasks except drawing pictures and writing them, ms.
    #[must_use]
    pub fn without_pictures(&self) -> f64 {
        1000.0 * self.spent.iter().sum::<Duration>().as_secs_f64()
            - self.spent(Task::Render)
            - self.spent(Task::Compress)
    }

    /// The times of all tasks, ms. Building the search trees counts as location.
    #[must_use]
    pub fn timings(&self) -> Timings {
        // The total is wall time and so is larger than the sum: it includes the time between tasks.
        Timings {
            read: self.spent(Task::Read),
            relax: self.spent(Task::Relax),
            knit: self.spent(Task::Knit),
            locate: self.spent(Task::Index) + self.spent(Task::Locate),
            strain: self.spent(Task::Strain),
            map: self.spent(Task::Map),
            sweep: self.spent(Task::Sweep),
            surface: self.spent(Task::Surface),
            render: self.spent(Task::Render),
            write: self.spent(Task::Compress) + self.spent(Task::Write),
            total: 1000.0 * self.start.elapsed().as_secs_f64(),
            clearance: self.spent(Task::Clearance),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_of_laying_is_divided_among_its_parts() {
        let mut clock = Clock::start(&());
        clock.begin(Task::Lay, 0.0);
        clock.stop();
        clock.spent[Task::Lay as usize] = Duration::from_millis(80);
        let [knit, locate, map] = [1, 2, 1].map(Duration::from_millis);
        clock.divide(&LayTimes { knit, locate, map });
        let timings = clock.timings();
        assert_eq!([timings.knit, timings.locate, timings.map], [20.0, 40.0, 20.0]);
        assert_eq!(clock.spent(Task::Lay), 0.0);
    }
}
