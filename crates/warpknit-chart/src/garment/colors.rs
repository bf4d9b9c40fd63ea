//! The colour map of stretch: blue below 1, light grey at 1, red above.
//!
//! In: a stretch (draped over flat length). Out: a colour. The colours are the diverging map of
//! Moreland 2009, "Diverging color maps for scientific visualization". It is made for shaded
//! surfaces; its middle is visible on white paper, and colour-blind people can distinguish its
//! ends. The scale is logarithmic, so that half and double are equally far from 1.

use warpknit_core::fabric::yarn::Color;

/// Moreland's map at equal steps.
const MAP: [[u8; 3]; 9] = [
    [59, 76, 192],
    [98, 130, 234],
    [141, 176, 254],
    [184, 208, 249],
    [221, 221, 221],
    [245, 196, 173],
    [244, 154, 123],
    [222, 96, 77],
    [180, 4, 38],
];
/// Stretches at which a scale may end: round numbers, so that the legends of two garments are often
/// the same and can be compared.
const ENDS: [f64; 8] = [1.02, 1.05, 1.1, 1.2, 1.5, 2.0, 3.0, 5.0];

/// A symmetric colour scale around 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StretchColors {
    /// The stretch at its red end. The blue end is its reciprocal.
    end: f64,
}

impl StretchColors {
    /// The narrowest scale that contains all of these stretches, or the widest one there is.
    pub(super) fn spanning(stretches: &[f64]) -> Self {
        let contains_all =
            |end: &&f64| stretches.iter().all(|stretch| (1.0 / **end..=**end).contains(stretch));
        Self { end: *ENDS.iter().find(contains_all).unwrap_or(&ENDS[ENDS.len() - 1]) }
    }

    /// The colour of a stretch.
    pub(super) fn color_of(&self, stretch: f64) -> Color {
        self.at(stretch.ln() / self.end.ln())
    }

    /// The colour at a place on the scale, -1 to 1: piecewise linear between the map's colours.
    pub(super) fn at(&self, place: f64) -> Color {
        let steps = (MAP.len() - 1) as f64;
        // The stretch of a collapsed triangle is 0 and its logarithm minus infinity: the clamp
        // makes it the blue end.
        let along = (place.clamp(-1.0, 1.0) + 1.0) / 2.0 * steps;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within the map, as clamped above"
        )]
        let below = (along.floor() as usize).min(MAP.len() - 2);
        let share = along - below as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a mean of two bytes is a byte"
        )]
        let mixed = |channel: usize| {
            let [from, to] = [below, below + 1].map(|step| f64::from(MAP[step][channel]));
            (from + (to - from) * share).round() as u8
        };
        Color([mixed(0), mixed(1), mixed(2)])
    }

    /// The marks of the legend: places from -1 to 1, each with its stretch in words.
    pub(super) fn marks(&self) -> [(f64, String); 5] {
        [-1.0, -0.5, 0.0, 0.5, 1.0].map(|place| (place, format!("{:.3}", self.end.powf(place))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_grey_and_half_is_as_far_from_it_as_double() {
        let colors = StretchColors::spanning(&[0.6, 1.3]);
        assert_eq!(colors, StretchColors { end: 2.0 });
        assert_eq!(colors.color_of(1.0), Color(MAP[4]));
        assert_eq!([0.5, 0.1, 0.0].map(|stretch| colors.color_of(stretch)), [Color(MAP[0]); 3]);
        assert_eq!([2.0, 9.0].map(|stretch| colors.color_of(stretch)), [Color(MAP[8]); 2]);
        assert_eq!(colors.color_of(2.0_f64.sqrt()), Color(MAP[6]));
        assert_eq!(colors.marks()[3], (0.5, "1.414".to_owned()));
    }

    #[test]
    fn the_scale_is_as_narrow_as_the_cloth_allows() {
        assert_eq!(StretchColors::spanning(&[1.0]).end, 1.02);
        assert_eq!(StretchColors::spanning(&[0.985, 1.0]).end, 1.02);
        assert_eq!(StretchColors::spanning(&[0.97, 1.0]).end, 1.05);
        assert_eq!(StretchColors::spanning(&[0.0, 1.0]).end, 5.0);
    }
}
