//! Millimetres: what one unit of the draped mesh is, and what one unit of the flat pattern is.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

/// The unit of a draped mesh's coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Millimetres.
    Mm,
    /// Centimetres.
    Cm,
    /// Decimetres (MakeHuman).
    Dm,
    /// Metres.
    M,
    /// Inches.
    Inch,
}

/// A name that is no unit.
#[derive(Debug, Error, PartialEq, Eq)]
#[error("there is no unit {0:?}: use mm, cm, dm, m or in")]
pub struct UnknownUnit(pub String);

impl Unit {
    /// Every unit, smallest first.
    pub const ALL: [Self; 5] = [Self::Mm, Self::Cm, Self::Inch, Self::Dm, Self::M];

    /// How long it is, in mm.
    #[must_use]
    pub fn millimetres(self) -> f64 {
        match self {
            Self::Mm => 1.0,
            Self::Cm => 10.0,
            Self::Dm => 100.0,
            Self::M => 1000.0,
            Self::Inch => 25.4,
        }
    }

    /// Its name, as `--unit` takes it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Mm => "mm",
            Self::Cm => "cm",
            Self::Dm => "dm",
            Self::M => "m",
            Self::Inch => "in",
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Unit {
    type Err = UnknownUnit;

    fn from_str(name: &str) -> Result<Self, UnknownUnit> {
        Self::ALL
            .into_iter()
            .find(|unit| unit.name() == name)
            .ok_or_else(|| UnknownUnit(name.to_owned()))
    }
}

/// A garment's largest dimension lies between these, mm: a sock or a swatch, and a gown with a
/// train.
pub(super) const GARMENT_SIZE: (f64, f64) = (80.0, 2500.0);

/// The unit in which `extent` is a garment's size, and whether it really is; if none is, the
/// nearest one.
///
/// Inches are no candidate: whatever could be inches could be centimetres two and a half times as
/// large, and no tool's default is inches, so guessing them would only ever take centimetres for
/// something else. Ties go to the larger unit.
pub(super) fn guess(extent: f64) -> (Unit, bool) {
    let (least, most) = GARMENT_SIZE;
    let misfit = |unit: Unit| {
        let size = extent * unit.millimetres();
        (least / size).max(size / most).max(1.0)
    };
    let mut best = Unit::M;
    for unit in [Unit::Dm, Unit::Cm, Unit::Mm] {
        if misfit(unit) < misfit(best) {
            best = unit;
        }
    }
    (best, misfit(best) == 1.0)
}

/// A FLAT file's scale this near to a unit's length is taken to be in that unit, and the rest to be
/// the fabric's stretch.
const PLAIN: f64 = 0.15;
/// Panels whose own scale is off the garment's by more than this take their own.
const DISAGREE: f64 = 0.05;

/// Draped area (mm²) over flat area (flat units²) of one triangle; the weight is its flat area.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch {
    pub(super) ratio: f64,
    pub(super) weight: f64,
}

/// The scale that makes a flat piece as large as it is draped: the square root of the area-weighted
/// median of area ratios.
///
/// The median, because a few stretched or crumpled triangles say nothing about the unit. Where over
/// half of the area has collapsed the median is 0 and the total areas are taken instead.
pub(super) fn scale(stretches: &mut [Stretch]) -> f64 {
    stretches.sort_by(|a, b| a.ratio.total_cmp(&b.ratio));
    let total: f64 = stretches.iter().map(|s| s.weight).sum();
    let mut below = 0.0;
    let median = stretches.iter().find(|s| {
        below += s.weight;
        2.0 * below >= total
    });
    match median {
        Some(s) if s.ratio > 0.0 => s.ratio.sqrt(),
        _ => (stretches.iter().map(|s| s.ratio * s.weight).sum::<f64>() / total).sqrt(),
    }
}

/// mm per flat unit: the garment's, and each panel's.
#[derive(Debug)]
pub(super) struct Scales {
    pub(super) garment: f64,
    pub(super) panels: Vec<f64>,
    /// Panels that take their own scale.
    pub(super) differing: Vec<usize>,
}

/// Settles the scales from the garment's own estimate and each panel's.
///
/// A FLAT file (`plain`) is nearly always in one of the plain units. Taken exactly, a garment
/// draped as it was cut comes out as the identity, and a fabric stretched by 2 % stays stretched;
/// there a panel must be off by [`PLAIN`] to count as another unit. `vt` has no unit, so a panel
/// that disagrees by [`DISAGREE`] takes its own: atlases scale their islands freely.
pub(super) fn choose_scales(estimate: f64, own: &[f64], plain: bool) -> Scales {
    let unit = Unit::ALL
        .into_iter()
        .map(Unit::millimetres)
        .find(|&mm| plain && (estimate / mm - 1.0).abs() <= PLAIN);
    let garment = unit.unwrap_or(estimate);
    let tolerance = if unit.is_some() { PLAIN } else { DISAGREE };
    let differing: Vec<usize> =
        (0..own.len()).filter(|&i| (own[i] / garment - 1.0).abs() > tolerance).collect();
    let mut panels = vec![garment; own.len()];
    for &i in &differing {
        panels[i] = own[i];
    }
    Scales { garment, panels, differing }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_that_fits_two_units_takes_the_larger() {
        assert_eq!(guess(1.5), (Unit::M, true));
        assert_eq!(guess(20.0), (Unit::Dm, true), "20 dm is a long gown, 20 cm a sock");
        assert_eq!(guess(150.0), (Unit::Cm, true));
        assert_eq!(guess(1500.0), (Unit::Mm, true));
        assert_eq!(guess(0.09), (Unit::M, true));
        assert_eq!(guess(0.07), (Unit::M, false), "70 mm is nearest to 80");
        assert_eq!(guess(90_000.0), (Unit::Mm, false));
    }

    #[test]
    fn the_median_ignores_a_wild_triangle() {
        let mut stretches = vec![Stretch { ratio: 4.0, weight: 1.0 }; 9];
        stretches.push(Stretch { ratio: 1e9, weight: 1.0 });
        assert_eq!(scale(&mut stretches), 2.0);
        let mut collapsed =
            [Stretch { ratio: 0.0, weight: 3.0 }, Stretch { ratio: 16.0, weight: 1.0 }];
        assert_eq!(scale(&mut collapsed), 2.0);
    }

    #[test]
    fn a_flat_file_keeps_its_unit_and_vt_does_not() {
        assert_eq!(choose_scales(10.2, &[10.2, 11.0], true).panels, [10.0, 10.0]);
        assert_eq!(choose_scales(10.2, &[10.2, 11.0], false).panels, [10.2, 11.0]);
        assert_eq!(choose_scales(13.0, &[13.0], true).panels, [13.0]);
        assert_eq!(choose_scales(10.2, &[10.2, 20.4], true).differing, [1]);
    }

    #[test]
    fn units_read_back() {
        for unit in Unit::ALL {
            assert_eq!(unit.to_string().parse(), Ok(unit));
        }
        assert_eq!("ell".parse::<Unit>(), Err(UnknownUnit("ell".into())));
    }
}
