//! Pictures as PNG (ISO/IEC 15948, "Portable Network Graphics"), 8 bits a channel.
//!
//! Compression is the encoder's fast one: pictures of cloth are noisy, and a slower one makes them
//! hardly smaller.

use std::io;
use std::path::Path;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, RgbaImage};

use super::{ExportError, Output};

/// Writes a picture as PNG: whole, but still under its temporary name.
///
/// # Errors
/// As of [`Output::create`], and [`ExportError::Io`].
pub fn write(target: &Path, picture: &RgbaImage) -> Result<Output, ExportError> {
    let mut output = Output::create(target)?;
    output.write_with(|file| encode(picture, file))?;
    output.seal()
}

/// Writes a picture's bytes as PNG.
///
/// # Errors
/// What the target says.
///
/// ```
/// let mut bytes = Vec::new();
/// warpknit_export::png::encode(&image::RgbaImage::new(2, 3), &mut bytes)?;
/// assert_eq!(&bytes[1..4], b"PNG");
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn encode(picture: &RgbaImage, target: impl io::Write) -> io::Result<()> {
    let encoder = PngEncoder::new_with_quality(target, CompressionType::Fast, FilterType::Adaptive);
    let encoded = encoder.write_image(
        picture.as_raw(),
        picture.width(),
        picture.height(),
        ExtendedColorType::Rgba8,
    );
    encoded.map_err(|error| match error {
        image::ImageError::IoError(source) => source,
        other => io::Error::other(other),
    })
}
