//! Work in a thread of its own, while Python's looks for Ctrl-C and tells how far the work is.
//!
//! In: work that looks at a [`Watch`]. Out: its result, or Python's exception. Cost: a thread, and a
//! look every 50 ms.
//!
//! Not promised: that work which nobody waits for ends at once. It goes on to its next stage or block
//! of yarns and takes cores and memory until then. Its result is dropped.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;
use warpknit::drape::Stage;
use warpknit::pipeline::RunError;

use crate::error;

/// How often Ctrl-C is looked for.
const LOOK: Duration = Duration::from_millis(50);

/// An error in the work, or its end because nobody waits for it.
pub(crate) enum Fault {
    Run(RunError),
    Stopped,
}

/// The work was stopped.
pub(crate) struct Stopped;

impl From<RunError> for Fault {
    fn from(error: RunError) -> Self {
        Self::Run(error)
    }
}

impl From<Stopped> for Fault {
    fn from(_: Stopped) -> Self {
        Self::Stopped
    }
}

/// What work and its waiter tell each other.
#[derive(Default)]
pub(crate) struct Watch {
    is_unwanted: Arc<AtomicBool>,
    reached: Mutex<Option<(Stage, f64)>>,
}

impl Watch {
    /// Ends work that nobody waits for, before its next stage or block.
    pub(crate) fn check_wanted(&self) -> Result<(), Stopped> {
        if self.is_unwanted.load(Ordering::Relaxed) { Err(Stopped) } else { Ok(()) }
    }

    /// What becomes true when nobody waits any longer.
    pub(crate) fn unwanted(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.is_unwanted)
    }

    /// Notes how far the work is: a stage, and the share of it or of the blocks that is done.
    pub(crate) fn reach(&self, stage: Stage, share: f64) {
        *self.reached.lock().unwrap_or_else(PoisonError::into_inner) = Some((stage, share));
    }

    /// What was noted since the last time, as Python is told it.
    fn take_reached(&self) -> Option<(&'static str, f64)> {
        let (stage, share) = self.reached.lock().unwrap_or_else(PoisonError::into_inner).take()?;
        Some((if stage == Stage::Strain { "strain" } else { "yarns" }, share))
    }
}

/// The result of work in a thread of its own. `progress` is called with a stage and its share while the
/// work goes on. Ctrl-C or an exception of `progress` ends the wait.
pub(crate) fn awaited<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Watch) -> Result<T, Fault> + Send + 'static,
) -> PyResult<T> {
    let watch = Arc::new(Watch::default());
    let (sender, mut receiver) = channel();
    let watched = Arc::clone(&watch);
    // Nobody may be left to take the result.
    let run = move || drop(sender.send(work(&watched)));
    let worker = thread::Builder::new().name("warpknit".to_owned()).spawn(run)?;
    let tell = |reached: Option<(&'static str, f64)>| match (progress, reached) {
        (Some(progress), Some(reached)) => progress.call1(reached).map(drop),
        _ => Ok(()),
    };
    loop {
        let (kept, result) = py.detach(move || {
            let result = receiver.recv_timeout(LOOK);
            (receiver, result)
        });
        receiver = kept;
        match result {
            Ok(Ok(done)) => {
                tell(Some(("yarns", 1.0)))?;
                return Ok(done);
            }
            Ok(Err(Fault::Run(error))) => return Err(error::of_run(&error)),
            Err(RecvTimeoutError::Timeout) => {
                if let Err(end) = py.check_signals().and_then(|()| tell(watch.take_reached())) {
                    watch.is_unwanted.store(true, Ordering::Relaxed);
                    return Err(end);
                }
            }
            // `Stopped` can't come here: who sets the flag returns. So the work panicked.
            Ok(Err(Fault::Stopped)) | Err(RecvTimeoutError::Disconnected) => {
                let panic = worker.join().expect_err("work without a result panicked");
                resume_unwind(panic)
            }
        }
    }
}
