//! The knitting thread, which keeps the window responsive.
//!
//! In: [`Recipe`]s, as fast as a slider is dragged. Out: cloth, or an error. The newest recipe
//! wins: older ones that were not begun are dropped. A cloth that is being knitted when a newer one
//! is wanted may use [`PATIENCE`] to finish and is then abandoned, so that a drag still shows some
//! of the cloths it passes.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow};

use super::cloth_source::{ClothSource, KnittedScene, Recipe};

/// Time that a cloth may take although a newer one is wanted. With none, a drag would show nothing
/// until it ends; with much more, the last cloth would come late.
const PATIENCE: Duration = Duration::from_millis(400);

/// A recipe and its number.
type NumberedRecipe = (u64, Recipe);

/// The window's end of the knitting thread. When it is dropped, the thread ends after its present
/// cloth.
pub(super) struct Worker {
    orders: Sender<NumberedRecipe>,
    done: Receiver<(u64, Result<KnittedScene>)>,
    newest: Arc<AtomicU64>,
    /// The number of the last recipe that was answered.
    answered: u64,
}

impl Worker {
    /// Starts the thread. It calls `announce` whenever a cloth or an error is ready.
    pub(super) fn start(
        source: Arc<ClothSource>,
        announce: impl Fn() + Send + 'static,
    ) -> Result<Self> {
        let (orders, incoming) = channel::<NumberedRecipe>();
        let (outgoing, done) = channel();
        let newest = Arc::new(AtomicU64::new(0));
        let wanted = Arc::clone(&newest);
        let work = move || {
            while let Ok(order) = incoming.recv() {
                // The newest waiting recipe replaces all older ones.
                let (number, recipe) = incoming.try_iter().last().unwrap_or(order);
                let start = Instant::now();
                let superseded =
                    || start.elapsed() > PATIENCE && wanted.load(Ordering::Relaxed) != number;
                let Some(result) = source.knit(recipe, &superseded).transpose() else { continue };
                if outgoing.send((number, result)).is_err() {
                    return;
                }
                announce();
            }
        };
        thread::Builder::new()
            .name("knitting".to_owned())
            .spawn(work)
            .context("can't start the knitting thread")?;
        Ok(Self { orders, done, newest, answered: 0 })
    }

    /// Orders a cloth in place of all earlier orders.
    pub(super) fn order(&self, recipe: Recipe) {
        let number = self.newest.fetch_add(1, Ordering::Relaxed) + 1;
        // If the thread has ended, `take` reports it.
        let _gone = self.orders.send((number, recipe));
    }

    /// Whether the newest order is not answered yet.
    pub(super) fn is_busy(&self) -> bool {
        self.answered < self.newest.load(Ordering::Relaxed)
    }

    /// The newest answer, if there is one.
    pub(super) fn take(&mut self) -> Option<Result<KnittedScene>> {
        let mut newest = None;
        loop {
            match self.done.try_recv() {
                Ok((number, result)) => {
                    self.answered = number;
                    newest = Some(result);
                }
                Err(TryRecvError::Disconnected) if self.is_busy() => {
                    self.answered = u64::MAX;
                    return Some(Err(anyhow!("knitting has stopped: open the window again")));
                }
                Err(_nothing) => return newest,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::*;
    use crate::cli::args::{Arguments, Command};

    fn source() -> Arc<ClothSource> {
        let arguments = Arguments::parse_from([
            "warpknit",
            "view",
            "--quiet",
            "--no-cache",
            "--wales",
            "3",
            "--courses",
            "4",
        ]);
        let Command::View(live) = arguments.command else { panic!("it was asked to view") };
        Arc::new(ClothSource::from_arguments(&live).unwrap())
    }

    /// All that is heard until the newest order is answered.
    fn answers(worker: &mut Worker) -> Vec<Result<KnittedScene>> {
        let mut heard = Vec::new();
        while worker.is_busy() {
            heard.extend(worker.take());
            thread::sleep(Duration::from_millis(1));
        }
        heard
    }

    #[test]
    fn the_newest_order_is_knitted_and_the_waiting_ones_are_not() {
        let source = source();
        let first = source.recipe(0);
        let mut worker = Worker::start(source, || ()).unwrap();
        for wales in 0..200 {
            worker.order(Recipe { wales_per_cm: 5.0 + f64::from(wales) / 100.0, ..first });
        }
        let heard = answers(&mut worker);
        assert!(heard.len() < 200);
        let last = heard.into_iter().last().unwrap().unwrap();
        assert!((last.enlargement - first.wales_per_cm / 6.99).abs() < 1e-9);
        assert_eq!(last.totals.losses.stitches, 2 * 3 * 4);
    }

    #[test]
    fn what_cannot_be_knitted_is_said_and_the_next_cloth_comes() {
        let source = source();
        let first = source.recipe(0);
        let mut worker = Worker::start(source, || ()).unwrap();
        worker.order(Recipe { radius: Some(50.0), ..first });
        let error = answers(&mut worker).pop().unwrap().err().unwrap().to_string();
        assert!(error.contains("over the wale spacing"), "{error}");
        worker.order(first);
        assert!(answers(&mut worker).pop().unwrap().is_ok());
    }
}
