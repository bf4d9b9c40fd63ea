//! The check that given run-ins can be knitted: is there a state of the cloth with yarns of these
//! lengths?
//!
//! In: a [`Fabric`] with run-ins, and its [`Pattern`]. Out: nothing, or a [`RunInError`] with the
//! range that is possible. Method: the repeat is relaxed again with the yarns of one bar under
//! tension, which gives its least run-in, and with its yarns as long as their neighbours allow,
//! which gives its largest. Cost: nothing where the pattern converged, two relaxations a bar where
//! it did not. Not promised: that every value in the range can be had together with the run-ins of
//! the other bars.

use super::relax::YarnLength;
use super::{Pattern, links, numbers};
use crate::fabric::{Fabric, Structure};

/// Difference of a run-in from the one that is given, as a share of it, below which it holds.
const TOLERANCE: f64 = 0.005;
/// Clearance of cloth that is knitted well enough to be called possible.
const MIN_CLEARANCE: f64 = 0.98;

/// A run-in that can't be knitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "bar {bar}: a run-in of {wanted} mm a rack can't be knitted at {wales} wales and {courses} \
     courses per cm: its loops take {least:.0} to {most:.0} mm"
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
    let Structure::Warp(knit) = &fabric.structure else { return Ok(()) };
    for (bar, table) in knit.bars.iter().enumerate() {
        let (Some(wanted), Some(drawn)) = (table.run_in, fabric.drawn_run_in(bar)) else {
            continue;
        };
        let Some(got) = pattern.run_in(bar) else { continue };
        if (got / drawn - 1.0).abs() <= TOLERANCE && pattern.is_knitted(fabric) {
            continue;
        }
        let [least, most] = [YarnLength::Taut, YarnLength::Loose].map(|length| {
            let pattern = Pattern::with_length(fabric, knit, bar, length);
            pattern.run_in(bar).unwrap_or(drawn) / fabric.enlargement
        });
        if wanted < least || wanted > most {
            let (wales, courses) = (fabric.wales_per_cm, fabric.courses_per_cm);
            return Err(RunInError { bar: bar + 1, wanted, least, most, wales, courses });
        }
    }
    Ok(())
}

impl Pattern {
    /// The run-in of a bar's yarns, mm a rack as drawn; none where no yarn runs along the wales.
    fn run_in(&self, bar: usize) -> Option<f64> {
        let lengths = self.lengths_per_step(bar);
        let (sum, count) = lengths
            .iter()
            .flatten()
            .fold((0.0, 0.0), |(sum, count), length| (sum + length, count + 1.0));
        (count > 0.0).then(|| numbers::RACK * sum / count)
    }

    /// Whether the relaxation ended with yarns that don't cut each other, all loops still linked.
    fn is_knitted(&self, fabric: &Fabric) -> bool {
        self.relaxation.is_none_or(|relaxation| relaxation.nearest >= MIN_CLEARANCE)
            && links::measure(fabric, self).wrong == 0
    }
}
