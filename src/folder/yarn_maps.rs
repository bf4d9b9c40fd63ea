//! The folder of a yarn's maps, as [`crate::photo::yarn::read_maps`] reads it.
//!
//! In: [`Developed`] and an [`OutputFolder`]. Out: the files of [`FILES`], except the contact
//! sheet, which the command makes. Heights have 16 bits, all other maps 8.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write as _};

use image::{ImageError, ImageFormat};

use crate::export::{ExportError, OutputFolder};
use crate::photo::yarn::develop::{Developed, toml};

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
    ExportError::Io { path: Some(folder.target().join(name)), source }
}
