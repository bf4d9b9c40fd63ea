//! The folder of maps, as [`crate::photo::read_maps`] reads it.
//!
//! In: [`Developed`] and an [`OutputFolder`]. Out: the files of [`FILES`] in it, the sheet
//! excepted, which only the binary can make. Heights have 16 bits, all else 8. yarn.toml holds
//! lengths only where the scale is known: the reader then takes the fabric's own yarn for the
//! width.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write as _};

use image::{ImageError, ImageFormat};

use super::Developed;
use crate::export::{ExportError, OutputFolder};

/// All files of such a folder.
pub const FILES: [&str; 8] = [
    "base_color.png",
    "height.png",
    "normal.png",
    "roughness.png",
    "metallic.png",
    "ao.png",
    "yarn.toml",
    "sheet.png",
];

/// Writes the maps and yarn.toml.
///
/// # Errors
/// What the disk says.
pub fn save(yarn: &Developed, folder: &OutputFolder) -> Result<(), ExportError> {
    let surface = &yarn.surface;
    picture(folder, "base_color.png", &|file| yarn.base.write_to(file, ImageFormat::Png))?;
    picture(folder, "height.png", &|file| surface.height.write_to(file, ImageFormat::Png))?;
    picture(folder, "normal.png", &|file| {
        image::DynamicImage::from(surface.normal.clone())
            .into_rgb8()
            .write_to(file, ImageFormat::Png)
    })?;
    picture(folder, "roughness.png", &|file| surface.roughness.write_to(file, ImageFormat::Png))?;
    picture(folder, "metallic.png", &|file| surface.metallic.write_to(file, ImageFormat::Png))?;
    picture(folder, "ao.png", &|file| surface.occlusion.write_to(file, ImageFormat::Png))?;
    let io = |source| ExportError::Io { path: folder.target().join("yarn.toml"), source };
    fs::write(folder.file("yarn.toml"), toml(yarn)).map_err(io)
}

/// Writes a picture and hears whether there was room for its last bytes too, which
/// `ImageBuffer::save` doesn't.
fn picture(
    folder: &OutputFolder,
    name: &str,
    write: &dyn Fn(&mut BufWriter<File>) -> Result<(), ImageError>,
) -> Result<(), ExportError> {
    let io = |source| ExportError::Io { path: folder.target().join(name), source };
    let mut file = BufWriter::new(File::create(folder.file(name)).map_err(io)?);
    write(&mut file).map_err(|error| match error {
        ImageError::IoError(source) => io(source),
        other => io(io::Error::other(other)),
    })?;
    file.flush().map_err(io)
}

fn toml(yarn: &Developed) -> String {
    let mut text = String::from("# One repeat of a yarn, from a photo, by warpknit yarn.\n");
    let mut line = |key: &str, value: f64| {
        writeln!(text, "{key} = {value:.5}").expect("a string takes any text")
    };
    if let (Some(width), Some(length)) = (yarn.width(), yarn.length()) {
        line("width_mm", width);
        line("length_mm", length);
        line("repeat_mm", length);
        line("mapping_coefficient", 1.0 / length);
        text += "# Of these, width_mm and length_mm are read; the mapping coefficient follows.\n";
    }
    let mut line = |key: &str, value: f64| {
        writeln!(text, "{key} = {value:.5}").expect("a string takes any text")
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
