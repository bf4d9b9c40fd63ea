//! The times of the parts of [`Stage::Lay`], in which a block is knitted, located and mapped before
//! its thread takes the next one.
//!
//! In: the moments between a block's parts. Out: [`LayTimes`], by which a program divides the time
//! that it measured for the whole stage. Blocks run beside each other, so the parts have no wall
//! time of their own. The pipeline itself does nothing with them.

use std::ops::AddAssign;
use std::time::{Duration, Instant};

use super::Stage;

/// The time of each part of [`Stage::Lay`], summed over all blocks. Zero where the system has no
/// clock, as in a browser.
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
    /// Each part with its share of the whole, 0 to 1. Without times all of it is knitting, so that
    /// nothing is lost.
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
        let whole = knit + locate + map;
        if whole.is_zero() {
            return [(Stage::Knit, 1.0), (Stage::Locate, 0.0), (Stage::Map, 0.0)];
        }
        [(Stage::Knit, knit), (Stage::Locate, locate), (Stage::Map, map)]
            .map(|(stage, time)| (stage, time.div_duration_f64(whole)))
    }
}

impl AddAssign for LayTimes {
    fn add_assign(&mut self, other: Self) {
        self.knit += other.knit;
        self.locate += other.locate;
        self.map += other.map;
    }
}

/// A stopwatch for the parts of a block's time.
pub(super) struct Lap(Option<Instant>);

impl Lap {
    pub(super) fn start() -> Self {
        let has_clock = !cfg!(all(target_arch = "wasm32", target_os = "unknown"));
        Self(has_clock.then(Instant::now))
    }

    /// The time since the start or since the last call.
    pub(super) fn split(&mut self) -> Duration {
        let Some(before) = self.0 else { return Duration::ZERO };
        let now = *self.0.insert(Instant::now());
        now - before
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_clock_nothing_is_lost() {
        assert_eq!(LayTimes::default().shares().map(|(_, share)| share), [1.0, 0.0, 0.0]);
        assert_eq!(Lap(None).split(), Duration::ZERO);
    }

    #[test]
    fn no_share_is_negative() {
        for (locate, map) in (1..60).flat_map(|locate| (1..60).map(move |map| (locate, map))) {
            let [locate, map] = [locate, map].map(Duration::from_nanos);
            let shares = LayTimes { knit: Duration::ZERO, locate, map }.shares();
            assert!(shares.iter().all(|(_, share)| *share >= 0.0), "{shares:?}");
        }
    }
}
