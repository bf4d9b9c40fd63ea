//! The text of `yarn.toml`, which lies beside the maps of a yarn.
//!
//! In: [`Developed`]. Out: TOML as [`crate::yarn::read_maps`] reads it. It holds lengths only where the scale is known:
//! the reader then takes the fabric's own yarn for the width.

use std::fmt::Write as _;

use super::Developed;

/// `yarn.toml` of a developed yarn.
#[must_use]
pub fn toml(yarn: &Developed) -> String {
    let mut text = String::from("# One repeat of a yarn, from a photo, by warpknit yarn.\n");
    let mut line = |key: &str, value: f64| {
        writeln!(text, "{key} = {value:.5}").expect("a string takes any text");
    };
    if let (Some(width), Some(length)) = (yarn.width(), yarn.length()) {
        line("width_mm", width);
        line("length_mm", length);
        line("repeat_mm", length);
        line("mapping_coefficient", 1.0 / length);
        text += "# Of these, width_mm and length_mm are read; the mapping coefficient follows.\n";
    }
    let mut line = |key: &str, value: f64| {
        writeln!(text, "{key} = {value:.5}").expect("a string takes any text");
    };
    if let Some(scale) = yarn.mm_per_pixel {
        line("yarn_width_mm", scale * yarn.yarn_width);
    }
    line("width_in_yarns", f64::from(yarn.base.height()) / yarn.yarn_width);
    line("yarn_width_px", yarn.yarn_width);
    line("repeat_px", yarn.repeat.length);
    line("threshold", f64::from(yarn.threshold));
    line("seam_error", f64::from(yarn.seam.error));
    if yarn.mm_per_pixel.is_none() {
        text += "# Lengths are unknown: give width_mm and length_mm, or develop the photo with --dpi or --yarn-width-mm.\n";
    }
    text
}
