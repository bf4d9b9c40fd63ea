//! Densities of the cloth as it is drawn: the chosen ones, those that suit chosen yarn counts, true
//! gauge, or lower ones at which a garment has few stitches.
//!
//! In: a fabric, the flat area of a garment, yarn counts, [`Densities`] and [`Enlarge`]. Out: the
//! fabric as pictures and files show it, and a warning if its yarns don't suit its densities.

use std::borrow::Cow;

use super::RunError;
use super::settings::{Densities, Enlarge, Settings, Wanted};
use crate::export::Format;
use crate::fabric::yarn::Count;
use crate::fabric::{Fabric, FabricError};
use crate::garment::Garment;

/// Stitches of a garment's cloth where it is enlarged unasked. A file of so many opens in other
/// programs, and a picture of 1600 x 1200 pixels still shows each. With far fewer, loops look like
/// rope.
pub(super) const PICTURED_STITCHES: f64 = 12_000.0;

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

/// Stitches of a fabric on `area` mm² of garment.
pub(super) fn stitches_on(fabric: &Fabric, area: f64) -> f64 {
    let cells = area / (fabric.wale_spacing() * fabric.course_spacing());
    fabric.structure.stitches_per_cell() * cells
}

impl Enlarge {
    /// The enlargement of a fabric on `area` mm² of garment.
    fn times(self, fabric: &Fabric, area: f64) -> f64 {
        match self {
            Self::Times(times) => times,
            // Stitches are counted by area, so their number falls with the square of the enlargement.
            Self::Auto => (stitches_on(fabric, area) / PICTURED_STITCHES).sqrt().max(1.0),
        }
    }

    /// The fabric, enlarged together with its yarns for `area` mm² of garment.
    ///
    /// # Errors
    /// [`RunError::TooLargeGarment`] or [`RunError::Enlarged`] where its densities would be outside
    /// the limits of a fabric.
    ///
    /// ```
    /// use warpknit::fabric::Fabric;
    /// use warpknit::pipeline::Enlarge;
    /// let tricot = Fabric::named("tricot")?;
    /// let square_metre = 1e6;
    /// let drawn = Enlarge::Auto.of_fabric(&tricot, square_metre)?;
    /// let stitches = 2.0 * square_metre / (drawn.wale_spacing() * drawn.course_spacing());
    /// assert!((stitches - 12_000.0).abs() < 1e-6);
    /// assert_eq!(Enlarge::Times(1.0).of_fabric(&tricot, square_metre)?, tricot);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn of_fabric(self, fabric: &Fabric, area: f64) -> Result<Fabric, RunError> {
        let times = self.times(fabric, area);
        if times == 1.0 {
            return Ok(fabric.clone());
        }
        let (wales, courses) = (fabric.wales_per_cm / times, fabric.courses_per_cm / times);
        fabric.clone().at_densities(wales, courses).map_err(|source| match self {
            Self::Auto => RunError::TooLargeGarment { source },
            Self::Times(times) => RunError::Enlarged { times, source },
        })
    }
}

/// Files of a run, and the fabric that they show.
#[derive(Clone, Debug)]
pub(super) struct Shown<'a> {
    pub(super) fabric: Cow<'a, Fabric>,
    pub(super) outputs: Vec<Wanted>,
    /// Why the fabric is as large as it is.
    pub(super) gauge: Gauge,
}

/// Why cloth is drawn as large as it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Gauge {
    /// Someone chose it, or there are few stitches anyway.
    Chosen,
    /// A picture is at true gauge unless something else is chosen.
    True,
    /// It is enlarged so that about [`PICTURED_STITCHES`] remain.
    Enlarged,
}

/// The fabrics that a run's files show on `area` mm² of garment: one for all files, or that of
/// pictures and then that of the others. `is_moving` says whether pictures are those of a sequence.
/// The caller has already applied chosen densities to the fabric. They are never changed here.
pub(super) fn shown<'a>(
    fabric: &'a Fabric,
    area: f64,
    settings: &Settings,
    outputs: Vec<Wanted>,
    is_moving: bool,
) -> Result<Vec<Shown<'a>>, RunError> {
    let at = |fabric, outputs, gauge| Shown { fabric, outputs, gauge };
    if settings.densities.are_chosen() {
        return Ok(vec![at(Cow::Borrowed(fabric), outputs, Gauge::Chosen)]);
    }
    let enlarged = settings.enlarge.unwrap_or(Enlarge::Auto).of_fabric(fabric, area)?;
    if matches!(settings.enlarge, Some(Enlarge::Times(_))) || enlarged == *fabric {
        return Ok(vec![at(Cow::Owned(enlarged), outputs, Gauge::Chosen)]);
    }
    // Many pictures at true gauge would take hours.
    let are_many = is_moving || settings.picture.turntable.is_some();
    if settings.enlarge.is_some() || are_many {
        return Ok(vec![at(Cow::Owned(enlarged), outputs, Gauge::Enlarged)]);
    }
    let (pictures, files): (Vec<_>, Vec<_>) =
        outputs.into_iter().partition(|(_, format)| *format == Format::Png);
    let all = [
        at(Cow::Borrowed(fabric), pictures, Gauge::True),
        at(Cow::Owned(enlarged), files, Gauge::Enlarged),
    ];
    Ok(all.into_iter().filter(|shown| !shown.outputs.is_empty()).collect())
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

/// Turns panels over and their wale directions as the fabric's layout of them says.
pub fn turn_panels(garment: &mut Garment, fabric: &Fabric) {
    for layout in &fabric.panels {
        if layout.turn {
            garment.turn_over(layout.panel);
        }
        garment.turn_grain(layout.panel, layout.grain_degrees.to_radians());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drape::Cloth;

    fn counts(text: &str) -> Vec<Count> {
        vec![text.parse().unwrap()]
    }

    #[test]
    fn stitches_are_foretold_for_empty_guides_too() {
        let garment = Garment::rectangle(200.0, 300.0);
        for name in ["tricot", "power-net", "square-net", "tricot-inlay", "jersey", "cable"] {
            let fabric = Fabric::named(name).unwrap();
            let planned = Cloth::cover(&garment, &fabric).unwrap().stitches();
            #[expect(clippy::cast_precision_loss, reason = "some hundred thousand")]
            let ratio = planned as f64 / stitches_on(&fabric, 200.0 * 300.0);
            // Yarns that only touch the edges are planned too, most of them by a cable's wide motif.
            assert!((0.95..1.25).contains(&ratio), "{name}: {ratio}");
        }
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

    /// The enlargement of each part of a run's files, with their number.
    fn parts(settings: &Settings, names: &[&str], is_moving: bool) -> Vec<(f64, usize)> {
        let fabric = Fabric::named("tricot").unwrap();
        let outputs =
            names.iter().map(|name| (name.into(), Format::from_path(name.as_ref()).unwrap()));
        let shown = shown(&fabric, 1e6, settings, outputs.collect(), is_moving).unwrap();
        shown.iter().map(|part| (part.fabric.enlargement, part.outputs.len())).collect()
    }

    #[test]
    fn pictures_show_true_gauge_and_files_are_enlarged() {
        let all = ["a.glb", "a.png", "a.json", "b.png"];
        let unasked = Settings::default();
        let [(picture, pictures), (file, files)] = parts(&unasked, &all, false)[..] else {
            panic!("two parts")
        };
        assert_eq!((picture, pictures, files), (1.0, 2, 2));
        assert!(file > 10.0);
        assert_eq!(parts(&unasked, &["a.png"], false), [(1.0, 1)]);
        assert_eq!(parts(&unasked, &["a.glb"], false), [(file, 1)]);
        // Many pictures, and whatever is asked for, are of one cloth.
        assert_eq!(parts(&unasked, &all, true), [(file, 4)]);
        let mut turned = Settings::default();
        turned.picture.turntable = Some(3);
        assert_eq!(parts(&turned, &all, false), [(file, 4)]);
        for (enlarge, times) in
            [(Enlarge::Auto, file), (Enlarge::Times(1.0), 1.0), (Enlarge::Times(3.0), 3.0)]
        {
            let settings = Settings { enlarge: Some(enlarge), ..Settings::default() };
            let [(found, 4)] = parts(&settings, &all, false)[..] else { panic!("one part") };
            assert!((found - times).abs() < 1e-9, "{enlarge:?}");
        }
        let densities = Densities { wales_per_cm: Some(15.0), courses_per_cm: None };
        let settings = Settings { densities, ..Settings::default() };
        assert_eq!(parts(&settings, &all, false), [(1.0, 4)]);
        // Small garments are never enlarged.
        let fabric = Fabric::named("tricot").unwrap();
        let small = shown(&fabric, 100.0, &unasked, vec![("a.glb".into(), Format::Glb)], false);
        assert_eq!(small.unwrap()[0].gauge, Gauge::Chosen);
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
