//! The folder of maps, as [`crate::photo::read_maps`] reads it.
//!
//! In: [`Developed`] and an [`OutputFolder`]. Out: the files of [`FILES`] in it, the sheet excepted, which only the binary can make. Heights have
//! 16 bits, all else 8. yarn.toml holds lengths only where the scale is known: the reader then takes the fabric's own yarn for the width.

use std::fmt::Write as _;
use std::fs;
use std::io;

use image::ImageError;

use super::Developed;
use crate::export::{ExportError, OutputFolder};

/// All files of such a folder.
pub const FILES: [&str; 8] =
    ["base_color.png", "height.png", "normal.png", "roughness.png", "metallic.png", "ao.png", "yarn.toml", "sheet.png"];

/// Writes the maps and yarn.toml.
///
/// # Errors
/// What the disk says.
pub fn save(yarn: &Developed, folder: &OutputFolder) -> Result<(), ExportError> {
    let surface = &yarn.surface;
    picture(folder, "base_color.png", &|path| yarn.base.save(path))?;
    picture(folder, "height.png", &|path| surface.height.save(path))?;
    picture(folder, "normal.png", &|path| image::DynamicImage::from(surface.normal.clone()).into_rgb8().save(path))?;
    picture(folder, "roughness.png", &|path| surface.roughness.save(path))?;
    picture(folder, "metallic.png", &|path| surface.metallic.save(path))?;
    picture(folder, "ao.png", &|path| surface.occlusion.save(path))?;
    let io = |source| ExportError::Io { path: folder.target().join("yarn.toml"), source };
    fs::write(folder.file("yarn.toml"), toml(yarn)).map_err(io)
}

fn picture(
    folder: &OutputFolder,
    name: &str,
    save: &dyn Fn(&std::path::Path) -> Result<(), ImageError>,
) -> Result<(), ExportError> {
    save(&folder.file(name)).map_err(|error| {
        let source = match error {
            ImageError::IoError(source) => source,
            other => io::Error::other(other),
        };
        ExportError::Io { path: folder.target().join(name), source }
    })
}

fn toml(yarn: &Developed) -> String {
    let mut text = String::from("# One repeat of a yarn, from a photo, by warpknit yarn.\n");
    let mut line = |key: &str, value: f64| writeln!(text, "{key} = {value:.5}").expect("a string takes any text");
    if let (Some(width), Some(length)) = (yarn.width(), yarn.length()) {
        line("width_mm", width);
        line("length_mm", length);
        line("repeat_mm", length);
        line("mapping_coefficient", 1.0 / length);
        text += "# Of these, width_mm and length_mm are read; the mapping coefficient follows.\n";
    }
    let mut line = |key: &str, value: f64| writeln!(text, "{key} = {value:.5}").expect("a string takes any text");
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
