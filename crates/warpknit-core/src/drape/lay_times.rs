//! The times of the parts of [`Stage::Lay`], in which a block is knitted, located and mapped before
//! its thread takes the next one.
//!
//! In: the same moments of all blocks. Out: [`LayTimes`], by which a program divides the time that
//! it measured for the whole stage. Blocks run beside each other, so the parts have no wall time of
//! their own.

use std::ops::AddAssign;
use std::time::{Duration, Instant};

use super::Stage;

/// The time of each part of [`Stage::Lay`], summed over blocks. Zero where the system has no clock,
/// as in a browser.
#[derive(Clone, Copy, Debug, Default)]
pub struct LayTimes {
    /// Data points on the flat fabric.
    pub knit: Duration,
    /// The triangle of each data point, and clipping at the panel's edge.
    pub locate: Duration,
    /// Draped positions.
    pub map: Duration,
}

impl LayTimes {
    /// Each part with its share of the whole, 0 to 1.
    ///
    /// ```
    /// use std::time::Duration;
    /// use warpknit_core::drape::{LayTimes, Stage};
    /// let [knit, locate, map] = [10, 20, 10].map(Duration::from_millis);
    /// let shares = LayTimes { knit, locate, map }.shares();
    /// assert_eq!(shares[1], (Stage::Locate, 0.5));
    /// ```
    #[must_use]
    pub fn shares(&self) -> [(Stage, f64); 3] {
        let Self { knit, locate, map } = *self;
        let whole = (knit + locate + map).as_secs_f64().max(f64::MIN_POSITIVE);
        [(Stage::Knit, knit), (Stage::Locate, locate), (Stage::Map, map)]
            .map(|(stage, time)| (stage, time.as_secs_f64() / whole))
    }
}

impl AddAssign for LayTimes {
    fn add_assign(&mut self, other: Self) {
        self.knit += other.knit;
        self.locate += other.locate;
        self.map += other.map;
    }
}

/// Measures parts of a block's time, one after the other.
pub(super) struct Lap(Option<Instant>);

impl Lap {
    pub(super) fn start() -> Self {
        Self((!cfg!(target_family = "wasm")).then(Instant::now))
    }

    /// The time since the start or since the last call.
    pub(super) fn next(&mut self) -> Duration {
        let Some(before) = self.0 else { return Duration::ZERO };
        let now = *self.0.insert(Instant::now());
        now - before
    }
}
