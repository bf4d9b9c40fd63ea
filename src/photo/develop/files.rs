//! Writes the folder of maps that [`crate::photo::read_maps`] reads.
//!
//! In: [`Developed`] and an [`OutputFolder`]. Out: the files of [`FILES`], except the contact
//! sheet, which the command makes. Heights have 16 bits, all other maps 8. yarn.toml holds lengths
//! in mm only where the scale is known. Without them the reader fits the maps to the fabric's own
//! yarn.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write as _};

use image::{ImageError, ImageFormat};

use super::Developed;
use crate::export::{ExportError, OutputFolder};

/// All files of a folder of maps.
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
/// [`ExportError`] where a file can't be written.
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
    fs::write(folder.file("yarn.toml"), toml(yarn))
        .map_err(|source| io_error(folder, "yarn.toml", source))
}

/// Writes a picture. It flushes the file and reports an error of the last bytes, which
/// `ImageBuffer::save` would ignore on a full disk.
fn picture(
    folder: &OutputFolder,
    name: &str,
    write: &dyn Fn(&mut BufWriter<File>) -> Result<(), ImageError>,
) -> Result<(), ExportError> {
    let file = File::create(folder.file(name)).map_err(|source| io_error(folder, name, source))?;
    let mut file = BufWriter::new(file);
    write(&mut file).map_err(|error| match error {
        ImageError::IoError(source) => io_error(folder, name, source),
        other => io_error(folder, name, io::Error::other(other)),
    })?;
    file.flush().map_err(|source| io_error(folder, name, source))
}

/// An error of a file, under the name that it will have when the folder is complete.
fn io_error(folder: &OutputFolder, name: &str, source: io::Error) -> ExportError {
    ExportError::Io { path: folder.target().join(name), source }
}

/// The text of yarn.toml.
fn toml(yarn: &Developed) -> String {
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
