//! Measurements of the real cloth, at its true scale.
//!
//! In: a fabric, enlarged or not. Out: the numbers of the real cloth, at the densities of its file
//! or at the chosen ones, with yarns as thick as their count says.

use super::job::Job;
use crate::fabric::Fabric;
use crate::knit::Pattern;
use crate::knit::clearance::{self, Clearance};
use crate::knit::numbers::{self, Numbers};

/// A fabric at its true scale, with its measurements.
#[derive(Clone, Debug)]
pub struct RealCloth {
    /// The fabric, not enlarged.
    pub fabric: Fabric,
    /// Run-in, mass, thickness and others.
    pub numbers: Numbers,
    /// Smallest distances between its yarns.
    pub clearance: Clearance,
}

impl RealCloth {
    /// Knits a repeat and measures it.
    #[must_use]
    pub fn new(fabric: &Fabric) -> Self {
        // An enlarged fabric has thicker yarns: without this, mass and thickness would be too large.
        let fabric = Fabric { enlargement: 1.0, ..fabric.clone() };
        let pattern = Pattern::new(&fabric);
        let clearance = clearance::measure(&fabric, &pattern, fabric.radius());
        Self { numbers: numbers::measure(&fabric, &pattern), clearance, fabric }
    }

    /// Measures the real cloth of a job, whose yarns are drawn with that radius and are so near each
    /// other.
    pub(super) fn of_job(job: &Job<'_>, radius: f64, near: Clearance) -> Self {
        // Cloth that is drawn at its true scale is the real cloth. Its repeat is knitted already,
        // and relaxing it again would take as long as before.
        let shown_is_real = job.fabric == job.shown
            && job.fabric.enlargement == 1.0
            && radius == job.fabric.radius();
        if shown_is_real {
            Self::from_pattern(job.fabric, job.cloth.pattern(), near)
        } else {
            Self::new(job.fabric)
        }
    }

    /// Measures a repeat that has been knitted already and whose clearance is known.
    #[must_use]
    pub fn from_pattern(fabric: &Fabric, pattern: &Pattern, clearance: Clearance) -> Self {
        let fabric = Fabric { enlargement: 1.0, ..fabric.clone() };
        Self { numbers: numbers::measure(&fabric, pattern), clearance, fabric }
    }
}
