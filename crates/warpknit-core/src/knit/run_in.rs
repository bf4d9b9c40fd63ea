//! The check that given run-ins can be knitted: is there a state of the cloth with yarns of these
//! lengths?
//!
//! In: a [`Fabric`] with run-ins, and its [`Pattern`]. Out: nothing, or a [`RunInError`] with the
//! range that is possible, or warnings. Method: the repeat is relaxed again and again with other
//! run-ins of one bar, and the border between those that hold and those that do not is bisected.
//! Cost: nothing where the pattern holds, a dozen relaxations a bar where it does not. Not promised:
//! the range of several bars together; those of the other bars are kept as they are given.

use super::{Pattern, links, numbers};
use crate::fabric::{Fabric, Structure};

/// Difference of a run-in from the one that is given, as a share of it, below which it holds.
const TOLERANCE: f64 = 0.005;
/// Shares of a bar's own run-in between which the limits are looked for.
const NARROWEST: f64 = 0.4;
const WIDEST: f64 = 2.0;
/// Halvings of the interval: to a hundredth of the run-in.
const BISECTIONS: usize = 6;
/// Clearance of cloth that is knitted well enough to be called possible.
const MIN_CLEARANCE: f64 = 0.98;

/// A run-in that can't be knitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "bar {bar}: a run-in of {wanted:.0} mm a rack can't be knitted at {wales:.2} wales and \
     {courses:.2} courses per cm: its yarns take {least:.0} to {most:.0} mm"
)]
pub struct RunInError {
    /// Number of the bar, front first, from 1.
    pub bar: usize,
    /// The run-in that is given, mm a rack.
    pub wanted: f64,
    /// The least run-in that its yarns can have, mm a rack.
    pub least: f64,
    /// The largest.
    pub most: f64,
    /// Wales per cm of the fabric.
    pub wales: f64,
    /// Courses per cm.
    pub courses: f64,
}

/// Checks the run-ins of a fabric whose repeat is `pattern`.
///
/// # Errors
/// The first bar whose run-in can't be had.
///
/// ```
/// use warpknit_core::{fabric::Fabric, knit::{Pattern, run_in}};
/// let mut fabric = Fabric::named("locknit").unwrap();
/// let text = fabric.to_string().replacen("[[bars]]", "[[bars]]\nrun_in_mm = 900.0", 1);
/// fabric = Fabric::parse(&text).unwrap();
/// let fault = run_in::check(&fabric, &Pattern::new(&fabric)).unwrap_err();
/// assert!(fault.bar == 1 && fault.least > 900.0);
/// ```
pub fn check(fabric: &Fabric, pattern: &Pattern) -> Result<(), RunInError> {
    if given(fabric, pattern).next().is_none()
        || missed(fabric, pattern).is_empty() && pattern.is_knitted(fabric)
    {
        return Ok(());
    }
    for (bar, wanted, _) in given(fabric, pattern) {
        // Where the cloth doesn't hold with this bar's own length either, it is not this bar's
        // fault.
        let Some(own) = knitted(fabric, bar, None) else { continue };
        let holds = |run_in: f64| {
            knitted(fabric, bar, Some(run_in)).is_some_and(|got| is_near(got, run_in))
        };
        if holds(wanted) {
            continue;
        }
        let [least, most] = [NARROWEST, WIDEST].map(|share| {
            let (mut good, mut bad) = (own, share * own);
            for _ in 0..BISECTIONS {
                let middle = good.midpoint(bad);
                *(if holds(middle) { &mut good } else { &mut bad }) = middle;
            }
            good
        });
        if !(least..=most).contains(&wanted) {
            let (wales, courses) = (fabric.wales_per_cm, fabric.courses_per_cm);
            return Err(RunInError { bar: bar + 1, wanted, least, most, wales, courses });
        }
    }
    Ok(())
}

/// Warns of run-ins that the cloth did not take as they are given.
#[must_use]
pub fn missed(fabric: &Fabric, pattern: &Pattern) -> Vec<String> {
    let missed = given(fabric, pattern).filter(|(_, wanted, got)| !is_near(*got, *wanted));
    let warnings = missed.map(|(bar, wanted, got)| {
        format!(
            "bar {}: the run-in is {got:.0} mm a rack, not the {wanted:.0} mm that are given: \
             with the other bars' yarns there is no room for it",
            bar + 1
        )
    });
    warnings.collect()
}

/// The bars with a given run-in: which, what is wanted, and what the pattern has. There are none in
/// a repeat that is too large to be relaxed.
fn given(fabric: &Fabric, pattern: &Pattern) -> impl Iterator<Item = (usize, f64, f64)> {
    let bars = fabric.warp_knit().map_or(&[][..], |knit| &knit.bars);
    let relaxed = bars.iter().enumerate().filter(|_| pattern.relaxation.is_some());
    relaxed.filter_map(|(at, bar)| Some((at, bar.run_in?, pattern.run_in(at)?)))
}

/// The run-in of a bar in the same cloth with that run-in given, or none; `None` where that cloth
/// can't be knitted.
fn knitted(fabric: &Fabric, bar: usize, run_in: Option<f64>) -> Option<f64> {
    let mut fabric = fabric.clone();
    let Structure::Warp(knit) = &mut fabric.structure else { return None };
    knit.bars[bar].run_in = run_in;
    let pattern = Pattern::new(&fabric);
    pattern.run_in(bar).filter(|_| pattern.is_knitted(&fabric))
}

/// Whether a run-in is as wanted.
fn is_near(got: f64, wanted: f64) -> bool {
    (got / wanted - 1.0).abs() <= TOLERANCE
}

impl Pattern {
    /// The run-in of a bar's yarns, mm a rack; none where no yarn runs along the wales.
    fn run_in(&self, bar: usize) -> Option<f64> {
        numbers::run_in(&self.lengths_per_step(bar))
    }

    /// Whether the relaxation ended with yarns that don't cut each other, all loops still linked.
    fn is_knitted(&self, fabric: &Fabric) -> bool {
        self.relaxation.is_none_or(|relaxation| relaxation.nearest >= MIN_CLEARANCE)
            && links::measure(fabric, self).wrong == 0
    }
}
