//! Densities of the cloth as it is drawn: the chosen ones, or lower ones at which loops are visible.
//!
//! In: a fabric, the flat area of a garment and [`Densities`]. Out: the fabric as it is drawn, and
//! a note for the user if it was enlarged.

use super::RunError;
use super::settings::Densities;
use crate::fabric::{Fabric, FabricError};
use crate::garment::Garment;
use crate::ids::index32;

/// The most stitches of a garment whose densities nobody chose. With more, a picture of 1600 x 1200
/// pixels no longer shows single stitches. With far fewer, loops look like rope.
const PICTURED_STITCHES: f64 = 12_000.0;
/// The most memory that a picture needs for each stitch, GB. Measured: 1.7 kB with a million ray
/// traced stitches. Distant cloth needs a quarter of it, but the distance is unknown before the
/// cloth is knitted.
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
    /// [`FabricError`] if a density is outside the limits of a fabric.
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
        // Courses for each wale. It is kept, so that one flag alone doesn't stretch the loops.
        let aspect = fabric.courses_per_cm / fabric.wales_per_cm;
        let from_courses = self.courses_per_cm.map(|courses| courses / aspect);
        let wales = self.wales_per_cm.or(from_courses).unwrap_or(fabric.wales_per_cm);
        fabric.at_densities(wales, self.courses_per_cm.unwrap_or(wales * aspect))
    }
}

/// The fabric for `area` mm² of garment, where nobody chose densities. A fabric of too many stitches
/// is enlarged together with its yarns, and a note says by how much.
///
/// # Errors
/// [`RunError::TooLargeGarment`].
pub fn enlarged(fabric: &Fabric, area: f64) -> Result<(Fabric, Option<String>), RunError> {
    let bars = f64::from(index32(fabric.yarn_systems()));
    let stitches = bars * area / (fabric.wale_spacing() * fabric.course_spacing());
    if stitches <= PICTURED_STITCHES {
        return Ok((fabric.clone(), None));
    }
    // Stitches are counted by area, so their number falls with the square of the enlargement.
    let times = (stitches / PICTURED_STITCHES).sqrt();
    let (wales, courses) = (fabric.wales_per_cm, fabric.courses_per_cm);
    let note = format!(
        "{stitches:.0} stitches at true gauge would be too small to see, so the cloth is drawn \
         {times:.1} times enlarged; --wales-per-cm {wales} --courses-per-cm {courses} knits it at true \
         gauge (a picture then takes up to {:.0} GB)",
        stitches * PICTURE_GB
    );
    let enlarged = fabric
        .clone()
        .at_densities(wales / times, courses / times)
        .map_err(|source| RunError::TooLargeGarment { source })?;
    Ok((enlarged, Some(note)))
}

/// The radius with which yarns are drawn, mm: the chosen one, or else the fabric's.
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

/// Turns the wale direction of each panel by the angle that the fabric's layout gives it.
pub fn turn_grains(garment: &mut Garment, fabric: &Fabric) {
    for layout in &fabric.panels {
        garment.turn_grain(layout.panel, layout.grain_degrees.to_radians());
    }
}
