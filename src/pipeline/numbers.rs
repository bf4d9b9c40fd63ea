//! Measurements of the real cloth, at its true scale.
//!
//! In: a fabric, enlarged or not. Out: the numbers of the real cloth, at the densities of its file
//! or at the chosen ones, with yarns as thick as their count says.

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

    /// Measures a repeat that has been knitted already and whose clearance is known.
    #[must_use]
    pub fn from_pattern(fabric: &Fabric, pattern: &Pattern, clearance: Clearance) -> Self {
        let fabric = Fabric { enlargement: 1.0, ..fabric.clone() };
        Self { numbers: numbers::measure(&fabric, pattern), clearance, fabric }
    }
}
