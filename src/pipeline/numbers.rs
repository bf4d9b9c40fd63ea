//! A fabric at its true scale, measured.
//!
//! In: a fabric, however much it is drawn enlarged. Out: the numbers of the real cloth: at the
//! densities of its file or those that were chosen, with yarns as thick as their count says.

use crate::fabric::Fabric;
use crate::knit::Pattern;
use crate::knit::clearance::{self, Clearance};
use crate::knit::numbers::{self, Numbers};

/// A fabric at its true scale, measured.
#[derive(Clone, Debug)]
pub struct RealCloth {
    /// The fabric, not enlarged.
    pub fabric: Fabric,
    /// Run-in, mass, thickness and others.
    pub numbers: Numbers,
    /// How near its yarns come to each other.
    pub clearance: Clearance,
}

impl RealCloth {
    /// Knits a repeat and measures it.
    #[must_use]
    pub fn new(fabric: &Fabric) -> Self {
        let fabric = Fabric { enlargement: 1.0, ..fabric.clone() };
        let pattern = Pattern::new(&fabric);
        let clearance = clearance::measure(&fabric, &pattern, fabric.radius());
        Self { numbers: numbers::measure(&fabric, &pattern), clearance, fabric }
    }

    /// Measures a repeat that has been knitted already, with its clearance.
    #[must_use]
    pub fn from_pattern(fabric: &Fabric, pattern: &Pattern, clearance: Clearance) -> Self {
        let fabric = Fabric { enlargement: 1.0, ..fabric.clone() };
        Self { numbers: numbers::measure(&fabric, pattern), clearance, fabric }
    }
}
