//! Densities of the cloth as it is drawn: the chosen ones, those that suit chosen yarn counts, or
//! lower ones at which loops are visible.
//!
//! In: a fabric, the flat area of a garment, yarn counts and [`Densities`]. Out: the fabric as it is
//! drawn, and a note for the user if it was enlarged or if its yarns don't suit its densities.

use super::RunError;
use super::settings::Densities;
use crate::fabric::yarn::Count;
use crate::fabric::{Fabric, FabricError};
use crate::garment::Garment;
use crate::ids::index32;

/// The most stitches of a garment whose densities nobody chose. With more, a picture of 1600 x 1200
/// pixels no longer shows single stitches. With far fewer, loops look like rope.
const PICTURED_STITCHES: f64 = 12_000.0;
/// The most memory that a picture needs for each stitch, GB. Measured: 1.7 kB with a million ray
/// traced stitches.
pub(crate) const PICTURE_GB: f64 = 1.7e-6;
/// The same where all yarns are thinner than pixels. Measured: 0.18 to 0.19 kB with 3.6 and 5.1 million
/// stitches; a third more is left for fabrics with more points.
pub(crate) const FAR_PICTURE_GB: f64 = 0.25e-6;

/// Yarn cover over that of the fabric as it is named. Within these limits no warning is given.
/// Below them the cloth is a net that its lapping doesn't mean. Above them loops have no room.
const FITTING_COVER: (f64, f64) = (0.5, 1.2);

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

    /// The fabric of yarns of other counts, front first, at these densities. Yarns are drawn as thick
    /// as they are: whoever names a count asks for real cloth.
    ///
    /// Without chosen densities, those of the fabric change with the diameter of its thickest yarn,
    /// so that the cloth keeps its cover. Run-ins of its file change in the same proportion. Chosen
    /// densities stay. A warning says if the yarns then cover much more or less than in the fabric
    /// as it is. Without counts it is [`Densities::of_fabric`].
    ///
    /// # Errors
    /// [`FabricError`] if there are too many counts, or a density is outside the limits of a fabric.
    ///
    /// ```
    /// use warpknit::fabric::Fabric;
    /// use warpknit::pipeline::Densities;
    /// let locknit = Fabric::named("locknit")?;
    /// // Four times the count is twice the diameter.
    /// let counts = ["176 dtex".parse().unwrap()];
    /// let (coarse, warning) = Densities::default().of_counts(locknit.clone(), &counts)?;
    /// assert!((coarse.wales_per_cm - locknit.wales_per_cm / 2.0).abs() < 1e-9);
    /// assert_eq!((coarse.enlargement, warning), (1.0, None));
    /// # Ok::<(), warpknit::fabric::FabricError>(())
    /// ```
    pub fn of_counts(
        self,
        fabric: Fabric,
        counts: &[Count],
    ) -> Result<(Fabric, Option<String>), FabricError> {
        if counts.is_empty() {
            return Ok((self.of_fabric(fabric)?, None));
        }
        let changed = fabric.clone().with_counts(counts)?;
        if !self.are_chosen() {
            let times = changed.true_radius() / fabric.true_radius();
            return Ok((changed.at_scale(times)?, None));
        }
        let changed = Fabric { enlargement: 1.0, ..self.of_fabric(changed)? };
        let warning = misfit(&changed, &fabric);
        Ok((changed, warning))
    }
}

/// A warning if the yarns of `changed` cover much more or less than those of `fabric`.
fn misfit(changed: &Fabric, fabric: &Fabric) -> Option<String> {
    let ratio = changed.yarn_cover() / fabric.yarn_cover();
    let (least, most) = FITTING_COVER;
    if (least..=most).contains(&ratio) {
        return None;
    }
    // Length in an area grows with the densities, if their proportion stays.
    let (wales, courses) = (changed.wales_per_cm / ratio, changed.courses_per_cm / ratio);
    Some(format!(
        "at {} x {} per cm, yarns of these counts cover {ratio:.2} times what the fabric's own yarns \
         cover at its own densities; --wales-per-cm {wales:.2} --courses-per-cm {courses:.2} keeps \
         its cover, and without both flags the densities follow the yarn",
        short(changed.wales_per_cm),
        short(changed.courses_per_cm)
    ))
}

/// A density that a person can read: four decimals are enough to knit the same cloth.
fn short(density: f64) -> f64 {
    (1e4 * density).round() / 1e4
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
         {times:.1} times enlarged; --wales-per-cm {} --courses-per-cm {} knits it at true \
         gauge (a picture of all of it then takes about {:.1} GB)",
        short(wales),
        short(courses),
        stitches * FAR_PICTURE_GB
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

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(text: &str) -> Vec<Count> {
        vec![text.parse().unwrap()]
    }

    #[test]
    fn a_count_scales_the_cloth_and_keeps_its_cover() {
        for name in ["locknit", "power-net", "tricot-inlay", "jersey"] {
            let fabric = Fabric::named(name).unwrap();
            let all: Vec<_> = fabric.yarns().map(|yarn| 2.0 * yarn.count.tex()).collect();
            let all: Vec<_> = all.iter().map(|tex| format!("{tex} tex").parse().unwrap()).collect();
            let (thick, warning) = Densities::default().of_counts(fabric.clone(), &all).unwrap();
            assert!((thick.yarn_cover() / fabric.yarn_cover() - 1.0).abs() < 1e-9, "{name}");
            let spacing = thick.wale_spacing() / fabric.wale_spacing();
            assert!((spacing - 2.0_f64.sqrt()).abs() < 1e-9, "{name}");
            assert_eq!((thick.enlargement, warning), (1.0, None));
        }
    }

    #[test]
    fn chosen_densities_stay_and_a_cover_far_from_the_fabrics_is_told() {
        let fabric = Fabric::named("locknit").unwrap();
        let own = Densities {
            wales_per_cm: Some(fabric.wales_per_cm),
            courses_per_cm: Some(fabric.courses_per_cm),
        };
        // The cover goes with the square root of the count: limits at 11 and 63.4 dtex.
        for (count, told) in [
            ("44 dtex", None),
            ("12 dtex", None),
            ("63 dtex", None),
            ("10 dtex", Some("cover 0.48 times")),
            ("78 dtex", Some("--wales-per-cm 10.97 --courses-per-cm 16.33 keeps")),
        ] {
            let (changed, warning) = own.of_counts(fabric.clone(), &counts(count)).unwrap();
            assert_eq!(changed.wales_per_cm, fabric.wales_per_cm);
            assert_eq!(changed.enlargement, 1.0);
            match told {
                None => assert_eq!(warning, None, "{count}"),
                Some(words) => assert!(warning.unwrap().contains(words), "{count}"),
            }
        }
        // What the warning names keeps the cover.
        let named = Densities { wales_per_cm: Some(10.97), courses_per_cm: Some(16.33) };
        let (kept, warning) = named.of_counts(fabric.clone(), &counts("78 dtex")).unwrap();
        assert!((kept.yarn_cover() / fabric.yarn_cover() - 1.0).abs() < 1e-3);
        assert_eq!((kept.radius(), warning), (kept.true_radius(), None));
        // Without a count, densities are those of a picture, and nothing is said.
        let coarse = Densities { wales_per_cm: Some(2.0), courses_per_cm: None };
        let (coarse, warning) = coarse.of_counts(fabric, &[]).unwrap();
        assert!((coarse.enlargement - 7.3).abs() < 1e-9 && warning.is_none());
    }
}
