//! The folder of a yarn's maps, as [`crate::photo::yarn::read_maps`] reads it.
//!
//! In: [`Developed`] and an [`OutputFolder`]. Out: the files of [`FILES`] in it, but for the contact sheet, which the
//! command makes. Heights have 16 bits, all else 8.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write as _};

use image::{ImageError, ImageFormat};

use crate::export::{ExportError, OutputFolder};
use crate::photo::yarn::develop::{Developed, toml};

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
    let io = |source| ExportError::Io { path: Some(folder.target().join("yarn.toml")), source };
    fs::write(folder.file("yarn.toml"), toml(yarn)).map_err(io)
}

/// Writes a picture and hears whether there was room for its last bytes too, which
/// `ImageBuffer::save` doesn't.
fn picture(
    folder: &OutputFolder,
    name: &str,
    write: &dyn Fn(&mut BufWriter<File>) -> Result<(), ImageError>,
) -> Result<(), ExportError> {
    let io = |source| ExportError::Io { path: Some(folder.target().join(name)), source };
    let mut file = BufWriter::new(File::create(folder.file(name)).map_err(io)?);
    write(&mut file).map_err(|error| match error {
        ImageError::IoError(source) => io(source),
        other => io(io::Error::other(other)),
    })?;
    file.flush().map_err(io)
}
