//! Densities of cloth as it is drawn: those that were chosen, or so few that loops can be seen.
//!
//! In: a fabric, the flat area of a garment and [`Densities`]. Out: the fabric as it is drawn, and
//! a note that says what was done.

use super::RunError;
use super::settings::Densities;
use crate::fabric::{Fabric, FabricError};
use crate::garment::Garment;
use crate::ids::index32;

/// The most stitches that a garment is given unasked. A picture of 1600 x 1200 pixels shows no more
/// of them one by one; with fewer, loops look like rope.
const PICTURED_STITCHES: f64 = 12_000.0;
/// The most memory that a picture takes for each stitch, GB: measured 1.7 kB where a million are
/// ray traced. Far ones take a quarter of it, but how far they are is not known before they are
/// knitted.
pub(crate) const PICTURE_GB: f64 = 1.7e-6;

impl Densities {
    /// Whether someone chose a density.
    #[must_use]
    pub fn are_chosen(self) -> bool {
        self.wales_per_cm.is_some() || self.courses_per_cm.is_some()
    }

    /// The fabric at these densities. One density alone scales the other, so that loops keep their
    /// shape.
    ///
    /// # Errors
    /// A density that no fabric has.
    ///
    /// ```
    /// use warpknit::fabric::Fabric;
    /// use warpknit::pipeline::Densities;
    /// let fabric = Fabric::named("tricot")?;
    /// let half = Densities { wales_per_cm: Some(fabric.wales_per_cm / 2.0), courses_per_cm: None };
    /// let (wide, courses) = (half.of_fabric(fabric.clone())?, fabric.courses_per_cm / 2.0);
    /// assert!((wide.courses_per_cm - courses).abs() < 1e-9);
    /// # Ok::<(), warpknit::fabric::FabricError>(())
    /// ```
    pub fn of_fabric(self, fabric: Fabric) -> Result<Fabric, FabricError> {
        if !self.are_chosen() {
            return Ok(fabric);
        }
        let aspect = fabric.courses_per_cm / fabric.wales_per_cm;
        let from_courses = self.courses_per_cm.map(|courses| courses / aspect);
        let wales = self.wales_per_cm.or(from_courses).unwrap_or(fabric.wales_per_cm);
        fabric.at_densities(wales, self.courses_per_cm.unwrap_or(wales * aspect))
    }
}

/// The fabric for `area` mm² of garment. Where nobody chose densities and its loops would be too
/// many and too small to see, it is enlarged, yarns and all, and a note says by how much.
///
/// # Errors
/// [`RunError::TooLargeGarment`].
pub fn enlarged(fabric: &Fabric, area: f64) -> Result<(Fabric, Option<String>), RunError> {
    let bars = f64::from(index32(fabric.yarn_systems()));
    let stitches = bars * area / (fabric.wale_spacing() * fabric.course_spacing());
    if stitches <= PICTURED_STITCHES {
        return Ok((fabric.clone(), None));
    }
    let times = (stitches / PICTURED_STITCHES).sqrt();
    let (wales, courses) = (fabric.wales_per_cm, fabric.courses_per_cm);
    let note = format!(
        "{stitches:.0} stitches at true gauge would be too small to see, so the cloth is drawn {times:.1} times enlarged; \
         --wales-per-cm {wales} --courses-per-cm {courses} knits it at true gauge (a picture then takes up to {:.0} GB)",
        stitches * PICTURE_GB
    );
    let enlarged = fabric
        .clone()
        .at_densities(wales / times, courses / times)
        .map_err(|source| RunError::TooLargeGarment { source })?;
    Ok((enlarged, Some(note)))
}

/// The radius that was chosen, if the fabric has room for it, or else the fabric's, mm.
///
/// # Errors
/// [`RunError::TooThick`].
pub fn drawn_radius(fabric: &Fabric, chosen: Option<f64>) -> Result<f64, RunError> {
    let wale_spacing = fabric.wale_spacing();
    match chosen {
        Some(radius) if radius > wale_spacing => Err(RunError::TooThick { radius, wale_spacing }),
        Some(radius) => Ok(radius),
        None => Ok(fabric.radius()),
    }
}

/// Turns the panels whose layout in the fabric says so.
pub fn turn_grains(garment: &mut Garment, fabric: &Fabric) {
    for layout in &fabric.panels {
        garment.turn_grain(layout.panel, layout.grain_degrees.to_radians());
    }
}
