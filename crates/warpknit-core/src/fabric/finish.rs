//! Finishing: what becomes of a knit between the machine and the finished cloth.
//!
//! In: shrinkages and a thickness, as a fabric file gives them. Out: the densities on the machine
//! ([`Fabric::machine`]). The densities of a [`Fabric`] are those of the finished cloth, and all
//! its numbers count for them. A shrinkage is a share of the machine's width or length:
//!
//! ```text
//! finished width = machine width · (1 - width_shrink)
//! wales_per_cm (machine) = wales_per_cm (finished) · (1 - width_shrink)
//! ```
//!
//! Courses and length follow in the same way. No yarn gets longer or shorter by it, so the run-in
//! of a rack is that of the machine. Not promised: the shrinkage of a cloth from its yarns.

use super::{Fabric, INCH_IN_CM};

/// What finishing does to a knit. What is `None` isn't given.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Finish {
    /// Share of the machine width that is lost; under 0 where the cloth was stretched.
    pub width_shrink: Option<f64>,
    /// Share of the length on the machine that is lost; under 0 where the cloth was stretched.
    pub length_shrink: Option<f64>,
    /// Thickness of the finished cloth, pressed between two planes, mm.
    pub thickness: Option<f64>,
}

/// A knit on its machine, before finishing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Machine {
    /// Wales per centimetre on the machine: one for each needle.
    pub wales_per_cm: f64,
    /// Needles an inch.
    pub gauge: f64,
    /// Courses per centimetre on the machine, as its take-up draws them off.
    pub courses_per_cm: f64,
    /// Share of the machine width that is lost; 0 where it isn't given.
    pub width_shrink: f64,
    /// Share of the length that is lost; 0 where it isn't given.
    pub length_shrink: f64,
}

impl Finish {
    /// Wales per centimetre of the finished cloth that a machine of this gauge knits, needles an
    /// inch. Each needle forms a wale.
    pub(super) fn wales_per_cm(&self, gauge: f64) -> f64 {
        gauge / INCH_IN_CM / (1.0 - self.width_shrink.unwrap_or(0.0))
    }
}

impl Fabric {
    /// The fabric on its machine; `None` where no shrinkage is given.
    ///
    /// ```
    /// use warpknit_core::fabric::Fabric;
    /// let mut locknit = Fabric::named("locknit")?;
    /// locknit.finish.width_shrink = Some(0.25);
    /// let machine = locknit.machine().unwrap();
    /// assert!((machine.gauge - 14.6 * 0.75 * 2.54).abs() < 1e-9);
    /// assert_eq!(machine.courses_per_cm, locknit.courses_per_cm);
    /// # Ok::<(), warpknit_core::fabric::FabricError>(())
    /// ```
    #[must_use]
    pub fn machine(&self) -> Option<Machine> {
        let Finish { width_shrink, length_shrink, .. } = self.finish;
        width_shrink.or(length_shrink)?;
        let (width_shrink, length_shrink) =
            (width_shrink.unwrap_or(0.0), length_shrink.unwrap_or(0.0));
        let wales_per_cm = self.wales_per_cm * (1.0 - width_shrink);
        Some(Machine {
            wales_per_cm,
            gauge: wales_per_cm * INCH_IN_CM,
            courses_per_cm: self.courses_per_cm * (1.0 - length_shrink),
            width_shrink,
            length_shrink,
        })
    }
}
