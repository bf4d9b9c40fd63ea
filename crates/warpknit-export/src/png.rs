//! Pictures.

use std::path::Path;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, RgbaImage};

use super::{ExportError, Output};

/// Writes a picture as PNG: whole, but still under its temporary name.
///
/// # Errors
/// What the disk says.
pub fn write(target: &Path, picture: &RgbaImage) -> Result<Output, ExportError> {
    let mut output = Output::create(target)?;
    output.write_with(|file| {
        let encoder =
            PngEncoder::new_with_quality(file, CompressionType::Fast, FilterType::Adaptive);
        let encoded = encoder.write_image(
            picture.as_raw(),
            picture.width(),
            picture.height(),
            ExtendedColorType::Rgba8,
        );
        encoded.map_err(|error| match error {
            image::ImageError::IoError(source) => source,
            other => std::io::Error::other(other),
        })
    })?;
    output.seal()
}
