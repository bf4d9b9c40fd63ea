//! What a person is told of a fabric's repeat: run-ins that it misses, loops that are not drawn through
//! each other, yarns that cut each other.
//!
//! In: a fabric and its relaxed pattern. Out: warnings, each in one line. Cost: that of the measurements,
//! some milliseconds a repeat.

use crate::drape::Cloth;
use crate::fabric::Fabric;
use crate::knit::clearance::{self, Clearance};
use crate::knit::links::{self, Links};
use crate::knit::{Pattern, run_in};

/// The warnings about a cloth's repeat, its thickest yarn drawn with a radius in mm. A run gives them to its
/// listener; callers that lay yarns themselves ask for them here.
#[must_use]
pub fn cloth_warnings(cloth: &Cloth<'_>, fabric: &Fabric, radius: f64) -> Vec<String> {
    let pattern = cloth.pattern();
    let near = clearance::measure(fabric, pattern, radius);
    let links = links::measure(fabric, pattern);
    measured_warnings(fabric, pattern, radius, &near, &links)
}

/// The same where the clearance and the loops are measured already.
pub(super) fn measured_warnings(
    fabric: &Fabric,
    pattern: &Pattern,
    radius: f64,
    near: &Clearance,
    links: &Links,
) -> Vec<String> {
    let mut warnings = loop_warnings(fabric, pattern, links);
    warnings.extend(clearance::warnings(fabric, pattern, near, radius));
    warnings
}

/// The warnings about its loops alone: run-ins and links.
pub(super) fn loop_warnings(fabric: &Fabric, pattern: &Pattern, links: &Links) -> Vec<String> {
    let mut warnings = run_in::missed(fabric, pattern);
    warnings.extend(links.warning());
    warnings
}
