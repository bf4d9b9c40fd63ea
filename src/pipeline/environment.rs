//! An environment from a file, `.hdr` (Radiance) or `.exr` (OpenEXR).
//!
//! In: a path. Out: an [`Environment`]. The content tells the format, and not the file's name. The
//! decoders are those of the crate `image`. Deep files, and files without channels R, G and B, are
//! refused.

use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::{Path, PathBuf};

use glam::Vec3;
use image::codecs::hdr::HdrDecoder;
use image::codecs::openexr::OpenExrDecoder;
use image::{DynamicImage, ImageDecoder, ImageError};

use crate::render::environment::{Environment, EnvironmentError};

/// Pixels at most, those of 8192 x 4096. They take 0.8 GB while they are read.
const MOST_PIXELS: u64 = 8192 * 4096;
/// How many times its length a file unpacks to at most. Deflate, which .exr files have, packs a
/// thousand bytes into one, and the runs of .hdr files fewer.
const MOST_PACKED: u64 = 1100;

/// An error in the file of an environment. Each message is one line.
#[derive(Debug, thiserror::Error)]
pub enum EnvironmentFileError {
    /// The file can't be opened.
    #[error("{}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// The file has another format.
    #[error("{}: this is no .hdr and no .exr, and an environment's light needs one of them", path.display())]
    Format {
        /// The file.
        path: PathBuf,
    },
    /// The file is broken, or of a kind that isn't read. The reason is a text: as a source, the
    /// decoder's error would be printed with its own sources twice.
    #[error("{}: it is broken, or of a kind that isn't read ({reason}): save it again as .hdr or .exr", path.display())]
    Decode {
        /// The file.
        path: PathBuf,
        /// The decoder's words.
        reason: String,
    },
    /// The file is shorter than its pixels can be.
    #[error("{}: it is too short for {width} x {height} pixels: fetch or save it again", path.display())]
    CutShort {
        /// The file.
        path: PathBuf,
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
    },
    /// Too many pixels.
    #[error("{}: {width} x {height} pixels are over the limit of 8192 x 4096: scale it down", path.display())]
    Size {
        /// The file.
        path: PathBuf,
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
    },
    /// The picture is no environment.
    #[error("{}", path.display())]
    Environment {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: EnvironmentError,
    },
}

/// Reads an environment, turned by so many radians around the vertical: what is at +x goes towards -z.
///
/// # Errors
/// A file that can't be read, and a picture that is no environment.
pub fn read_environment(path: &Path, turn: f64) -> Result<Environment, EnvironmentFileError> {
    let place = || path.to_owned();
    let open = |source| EnvironmentFileError::Open { path: place(), source };
    let mut file = BufReader::new(File::open(path).map_err(open)?);
    let mut head = Vec::new();
    file.by_ref().take(4).read_to_end(&mut head).map_err(open)?;
    file.rewind().map_err(open)?;
    let length = file.get_ref().metadata().map_err(open)?.len();
    let decode = |error: ImageError| broken(path, &error);
    let picture = match head[..] {
        [b'#', b'?', ..] => decoded(HdrDecoder::new_nonstrict(file).map_err(decode)?, path, length),
        [0x76, 0x2f, 0x31, 0x01] => {
            let without_alpha = OpenExrDecoder::with_alpha_preference(file, Some(false));
            decoded(without_alpha.map_err(decode)?, path, length)
        }
        _ => return Err(EnvironmentFileError::Format { path: place() }),
    }?;
    let [width, height] = [picture.width(), picture.height()].map(|side| side as usize);
    let pixels = picture.into_rgb32f().pixels().map(|pixel| Vec3::from(pixel.0)).collect();
    #[expect(clippy::cast_possible_truncation, reason = "an angle needs no more")]
    let environment = Environment::new([width, height], pixels, turn as f32);
    environment.map_err(|source| EnvironmentFileError::Environment { path: place(), source })
}

/// The picture of a decoder, unless it is too large, or larger than a file of this length can hold.
fn decoded(
    decoder: impl ImageDecoder,
    path: &Path,
    length: u64,
) -> Result<DynamicImage, EnvironmentFileError> {
    let (width, height) = decoder.dimensions();
    let path = || path.to_owned();
    if u64::from(width) * u64::from(height) > MOST_PIXELS {
        return Err(EnvironmentFileError::Size { path: path(), width, height });
    }
    if decoder.total_bytes() > length.saturating_mul(MOST_PACKED) {
        return Err(EnvironmentFileError::CutShort { path: path(), width, height });
    }
    DynamicImage::from_decoder(decoder).map_err(|error| broken(&path(), &error))
}

/// The error of a decoder.
fn broken(path: &Path, error: &ImageError) -> EnvironmentFileError {
    EnvironmentFileError::Decode { path: path.to_owned(), reason: error.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ImageFormat, Rgb, Rgb32FImage};
    use proptest::prelude::*;
    use std::io::Cursor;

    /// A small picture of a sky, in one of the formats.
    fn sky(format: ImageFormat) -> Vec<u8> {
        let sky = Rgb32FImage::from_fn(32, 16, |x, y| {
            Rgb([0.5, f32::from(x < 9), 1.0 / (1.0 + y as f32)])
        });
        let mut file = Cursor::new(Vec::new());
        DynamicImage::from(sky).write_to(&mut file, format).unwrap();
        file.into_inner()
    }

    fn read(bytes: &[u8]) -> Result<Environment, EnvironmentFileError> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        read_environment(file.path(), 0.0)
    }

    #[test]
    fn both_formats_hold_the_same_light() {
        let [hdr, exr] =
            [ImageFormat::Hdr, ImageFormat::OpenExr].map(|format| read(&sky(format)).unwrap());
        for at in [Vec3::X, Vec3::Y, Vec3::NEG_ONE] {
            let (one, other) = (hdr.radiance(at), exr.radiance(at));
            assert!(one.distance(other) < 0.02 * one.length(), "{one} {other}");
        }
    }

    proptest! {
        #[test]
        fn broken_files_are_errors_and_no_panics(
            is_exr in any::<bool>(),
            length in 0.0..1.0_f64,
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..8),
            garbage in prop::collection::vec(any::<u8>(), 0..300),
        ) {
            let mut bytes = sky(if is_exr { ImageFormat::OpenExr } else { ImageFormat::Hdr });
            let magic = bytes[..4].to_vec();
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a length")]
            let cut = (length * bytes.len() as f64) as usize;
            // Whatever it is, it must not end the program.
            let _ = read(&bytes[..cut]);
            let _ = read(&[&magic[..], &garbage[..]].concat());
            for (place, byte) in changes {
                let at = place.index(bytes.len());
                bytes[at] = byte;
            }
            let _ = read(&bytes);
        }
    }
}
