//! Units: the unit of the draped mesh, and the scale of the flat pattern.
//!
//! In: the size of the draped garment, and the ratio of draped to flat area of each triangle. Out:
//! a [`Unit`] and [`Scales`] in mm per flat unit.
//!
//! Method: a heuristic on the garment's size for the unit, and an area-weighted median for the
//! scale. Not promised: that a guess is right. A garment that fits in two units gets the larger
//! one, and [`GarmentSummary::unit_guessed`](super::GarmentSummary) is set.

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

/// The error for a name that is no unit.
#[derive(Debug, Error, PartialEq, Eq)]
#[error("there is no unit {0:?}: use mm, cm, dm, m or in")]
pub struct UnknownUnit(pub String);

impl Unit {
    /// Every unit, smallest first.
    pub const ALL: [Self; 5] = [Self::Mm, Self::Cm, Self::Inch, Self::Dm, Self::M];

    /// Length of the unit, mm.
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

    /// The name of the unit, as `--unit` takes it.
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

/// The range of a garment's largest dimension, mm: from a sock or a swatch to a gown with a train.
/// A wider range would leave more garments that fit two units; a narrower one would refuse real
/// ones.
pub(super) const GARMENT_SIZE: (f64, f64) = (80.0, 2500.0);

/// The unit in which `extent` is in the range of garment sizes, and true. If there is none, the
/// unit in which it is nearest to that range, and false.
///
/// Ties go to the larger unit. Inches are no candidate: sizes in inches and in centimetres overlap,
/// and no tool's default is inches, so a guess of inches would mostly be wrong.
pub(super) fn guess(extent: f64) -> (Unit, bool) {
    // From large to small, and only a strictly better unit replaces the last: ties keep the larger.
    let mut best = Unit::M;
    for unit in [Unit::Dm, Unit::Cm, Unit::Mm] {
        if misfit(extent, unit) < misfit(extent, best) {
            best = unit;
        }
    }
    (best, misfit(extent, best) == 1.0)
}

/// Whether garments of this extent in that unit are in the range of garment sizes.
pub(super) fn fits(extent: f64, unit: Unit) -> bool {
    misfit(extent, unit) == 1.0
}

/// The factor by which a garment of this extent misses the range of garment sizes in a unit: 1
/// within the range.
fn misfit(extent: f64, unit: Unit) -> f64 {
    let (least, most) = GARMENT_SIZE;
    let size = extent * unit.millimetres();
    (least / size).max(size / most).max(1.0)
}

/// Relative tolerance within which the scale of a FLAT file is taken for the length of a unit. The
/// deviation then counts as the fabric's stretch. With a smaller tolerance a stretched garment
/// would lose its stretch to the scale; a larger one would take more arbitrary scales for a unit.
/// Units are a factor of 2.5 or more apart.
const UNIT_TOLERANCE: f64 = 0.15;
/// Relative difference from the garment's scale above which a panel takes its own. A smaller
/// difference counts as stretch, which must not be removed; a larger one as a panel that an atlas
/// has scaled.
const PANEL_TOLERANCE: f64 = 0.05;

/// The area ratio of one triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct AreaRatio {
    /// Draped area, mm², over flat area, flat units².
    pub(super) ratio: f64,
    /// Flat area, in any unit.
    pub(super) weight: f64,
}

/// The scale at which a flat piece is as large as it is draped, in mm per flat unit: the square
/// root of the area-weighted median of area ratios.
///
/// A median and not a mean, because a few strongly stretched or crumpled triangles must not change
/// the unit. Where over half of the area has collapsed the median is 0, and the ratio of the total
/// areas is used instead.
pub(super) fn scale(stretches: &mut [AreaRatio]) -> f64 {
    let total: f64 = stretches.iter().map(|s| s.weight).sum();
    let mean: f64 = stretches.iter().map(|s| s.ratio * s.weight).sum::<f64>() / total;
    let median = weighted_median(stretches, 0.5 * total);
    // Ratios are of areas, scales are of lengths.
    if median > 0.0 { median.sqrt() } else { mean.sqrt() }
}

/// The smallest ratio up to which the weights reach `half`, or the largest ratio. The order of the
/// entries changes.
///
/// Method: quickselect (Hoare, Algorithm 65: Find, 1961) with the weights on either side of the
/// pivot. Linear on average, where a sort of two million takes 0.3 s.
fn weighted_median(mut stretches: &mut [AreaRatio], half: f64) -> f64 {
    let mut below = 0.0;
    while stretches.len() > 1 {
        let middle = (stretches.len() - 1) / 2;
        stretches.select_nth_unstable_by(middle, |a, b| a.ratio.total_cmp(&b.ratio));
        let (low, high) = stretches.split_at_mut(middle + 1);
        let reached = below + low.iter().map(|s| s.weight).sum::<f64>();
        if reached >= half {
            stretches = low;
        } else {
            below = reached;
            stretches = high;
        }
    }
    stretches.first().map_or(0.0, |s| s.ratio)
}

/// The scales of the garment and of each panel, mm per flat unit.
#[derive(Debug)]
pub(super) struct Scales {
    pub(super) garment: f64,
    pub(super) panels: Vec<f64>,
    /// Indices of the panels that take their own scale.
    pub(super) differing: Vec<usize>,
}

/// Chooses the scales from the garment's estimate and the panels' own estimates.
///
/// A FLAT file (`has_unit`) is nearly always in one of the units. Its exact length is used then, so
/// that a garment draped as it was cut is mapped by the identity, and a fabric stretched by 2 %
/// stays stretched. A panel must differ by [`UNIT_TOLERANCE`] to count as being in another unit.
/// `vt` has no unit, and atlases scale their islands freely. So there a panel that differs by
/// [`PANEL_TOLERANCE`] takes its own scale.
pub(super) fn choose_scales(estimate: f64, own: &[f64], has_unit: bool) -> Scales {
    // At most one unit is within the tolerance.
    let unit = Unit::ALL
        .into_iter()
        .map(Unit::millimetres)
        .find(|&mm| has_unit && (estimate / mm - 1.0).abs() <= UNIT_TOLERANCE);
    let garment = unit.unwrap_or(estimate);
    let tolerance = if unit.is_some() { UNIT_TOLERANCE } else { PANEL_TOLERANCE };
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
        let mut stretches = vec![AreaRatio { ratio: 4.0, weight: 1.0 }; 9];
        stretches.push(AreaRatio { ratio: 1e9, weight: 1.0 });
        assert_eq!(scale(&mut stretches), 2.0);
        let mut collapsed =
            [AreaRatio { ratio: 0.0, weight: 3.0 }, AreaRatio { ratio: 16.0, weight: 1.0 }];
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
