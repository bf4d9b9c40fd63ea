//! The text of `yarn.toml`, which lies beside the maps of a yarn.
//!
//! In: [`Developed`]. Out: TOML as [`crate::yarn::read_maps`] reads it. It holds lengths only where
//! the scale is known: the reader then takes the fabric's own yarn for the width.

use std::fmt::Write as _;

use super::Developed;

/// The text of `yarn.toml` of a developed yarn.
#[must_use]
pub fn toml(yarn: &Developed) -> String {
    let mut text = String::from("# One repeat of a yarn, from a photo, by warpknit yarn.\n");
    if let (Some(width), Some(length)) = (yarn.width(), yarn.length()) {
        line(&mut text, "width_mm", width);
        line(&mut text, "length_mm", length);
        line(&mut text, "repeat_mm", length);
        line(&mut text, "mapping_coefficient", 1.0 / length);
        text += "# Of these, width_mm and length_mm are read; the mapping coefficient follows.\n";
    }
    if let Some(scale) = yarn.mm_per_pixel {
        line(&mut text, "yarn_width_mm", scale * yarn.yarn_width);
    }
    line(&mut text, "width_in_yarns", f64::from(yarn.base.height()) / yarn.yarn_width);
    line(&mut text, "yarn_width_px", yarn.yarn_width);
    line(&mut text, "repeat_px", yarn.repeat.length);
    line(&mut text, "threshold", f64::from(yarn.threshold));
    line(&mut text, "seam_error", f64::from(yarn.seam.error));
    if yarn.mm_per_pixel.is_none() {
        text += "# Lengths are unknown: give width_mm and length_mm, or develop the photo with \
                 --dpi or --yarn-width-mm.\n";
    }
    text
}

/// Adds a key with a number.
fn line(text: &mut String, key: &str, value: f64) {
    writeln!(text, "{key} = {value:.5}").expect("a string takes any text");
}
