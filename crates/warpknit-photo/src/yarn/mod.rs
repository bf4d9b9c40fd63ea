//! Reads the pictures of a yarn into [`Maps`].
//!
//! In: a folder of maps, or one picture of a yarn. Out: complete [`Maps`]. Missing maps get
//! defaults: normals from the height map by Scharr's operator (Scharr 2000, "Optimale Operatoren in
//! der digitalen Bildverarbeitung"), or flat ones; the roughness of fibres; no metal; no occlusion.
//! Pictures of another size than the base colour are scaled to it.
//!
//! | file | content |
//! |---|---|
//! | `base_color.png` | sRGB and alpha, x along the yarn; the only file that is required |
//! | `normal.png` | tangent-space normals, OpenGL's convention (+Y up) |
//! | `height.png` | grey, white half the width above black; read where there are no normals |
//! | `roughness.png`, `metallic.png`, `ao.png` | grey |
//! | `yarn.toml` | `width_mm`, `length_mm`, `width_in_yarns`, each optional |
//!
//! `width_mm` and `length_mm` are the size of the picture; `width_in_yarns` is its width over that
//! of the yarn without fuzz. Other keys of yarn.toml are ignored. [`develop`] makes such a folder
//! from one photo.

pub mod develop;
mod error;

use std::fs;
use std::io::{self, Cursor};
use std::path::{Path, PathBuf};

use glam::Vec3;
use image::imageops::{FilterType, resize};
use image::{
    DynamicImage, ImageBuffer, ImageDecoder as _, ImageFormat, ImageReader, Limits, Luma, RgbImage,
    Rgba, RgbaImage,
};
use serde::Deserialize;

pub use error::PhotoError;

use warpknit_render::maps::Maps;
use warpknit_render::mips::{MapKind, Mips};

/// Fewest and most pixels of a picture each way. Graphics cards take no more.
const SIDES: (u32, u32) = (4, 16_384);
/// The largest size that is accepted, mm. A larger one is a mistake in the unit.
const MOST_SIZE: f64 = 10_000.0;
/// Width of a yarn's picture, fuzz included, in thicknesses of the yarn, where no file gives it.
const FUZZY_WIDTH: f64 = 1.25;
/// Default roughness, of 255: fibres are dull.
const ROUGHNESS: u8 = 191;
/// Height of white above black in a height map, in widths of the picture. A round yarn's radius is
/// half its width.
const RELIEF: f32 = 0.5;

/// Largest compression ratio that is accepted. Deflate reaches 1032, JPEG some 1200. A file that
/// claims more is truncated or malicious, and decoding it would take memory that its size doesn't
/// bound.
const MOST_PACKED: u64 = 2048;
/// Memory that decoding takes beside the picture, bytes.
const DECODER_BYTES: u64 = 16 << 20;

/// A map of heights or of values from 0 to 1, 16 bits each.
type Grey = ImageBuffer<Luma<u16>, Vec<u16>>;

/// Reads the folder or the picture at `path`. Where no file gives the width, the maps fit a yarn
/// that is `thickness` mm thick. `length`, the length of yarn that the picture shows in mm,
/// overrules yarn.toml.
///
/// # Errors
/// [`PhotoError`] where there is no picture, or a file does not hold what its name says.
pub fn read_maps(path: &Path, thickness: f64, length: Option<f64>) -> Result<Maps, PhotoError> {
    let in_folder = path.is_dir();
    let base_path = if in_folder { path.join("base_color.png") } else { path.to_owned() };
    if in_folder && !base_path.is_file() {
        return Err(PhotoError::NoBaseColor { path: path.to_owned() });
    }
    let base = picture(&base_path)?.into_rgba8();
    let size = base.dimensions();
    // A single picture has no companions: files beside it belong to something else.
    let companion = |name: &str| -> Result<Option<DynamicImage>, PhotoError> {
        let file = path.join(name);
        if in_folder && file.is_file() { picture(&file).map(Some) } else { Ok(None) }
    };
    let grey =
        |name: &str| Ok(companion(name)?.map(|picture| fitted(&picture.into_luma16(), size)));
    let (length, width) =
        lengths(in_folder.then(|| path.join("yarn.toml")), size, thickness, length)?;
    let normal = match (companion("normal.png")?, grey("height.png")?) {
        (Some(normal), _) => fitted_color(normal.into_rgba8(), size),
        (None, Some(height)) => normals(&height, length, width),
        (None, None) => RgbaImage::from_pixel(size.0, size.1, Rgba([128, 128, 255, 255])),
    };
    let (occlusion, roughness, metallic) =
        (grey("ao.png")?, grey("roughness.png")?, grey("metallic.png")?);
    // Channels as in glTF: occlusion, roughness, metalness.
    let surface = RgbaImage::from_fn(size.0, size.1, |x, y| {
        Rgba([
            value_at(&occlusion, x, y, u8::MAX),
            value_at(&roughness, x, y, ROUGHNESS),
            value_at(&metallic, x, y, 0),
            u8::MAX,
        ])
    });
    Ok(Maps {
        base: Mips::new(base, MapKind::Color),
        normal: Mips::new(normal, MapKind::Normal),
        surface: Mips::new(surface, MapKind::Plain),
        length,
        width,
    })
}

/// A map's value at a pixel in 8 bits, or the default where there is no map.
fn value_at(map: &Option<Grey>, x: u32, y: u32, default: u8) -> u8 {
    map.as_ref().map_or(default, |map| upper_byte(map.get_pixel(x, y).0[0]))
}

/// Reads a photo for [`develop::develop`]. Its transparency is ignored.
///
/// # Errors
/// [`PhotoError`] where it can't be read, or is too small or too large.
pub fn read_photo(path: &Path) -> Result<RgbImage, PhotoError> {
    let photo = decoded(path, |width, height| {
        develop::check_size(width, height)
            .map_err(|reason| PhotoError::Photo { path: path.to_owned(), reason })
    })?;
    Ok(photo.into_rgb8())
}

/// Decodes a picture whose sides are within [`SIDES`].
fn picture(path: &Path) -> Result<DynamicImage, PhotoError> {
    let (least, most) = SIDES;
    decoded(path, |width, height| {
        if width.min(height) < least {
            return Err(PhotoError::TooSmall { path: path.to_owned(), width, height, least });
        }
        if width.max(height) > most {
            return Err(PhotoError::TooLarge { path: path.to_owned(), width, height, most });
        }
        Ok(())
    })
}

/// Decodes a picture. `check` may refuse its size before anything is decoded.
fn decoded(
    path: &Path,
    check: impl Fn(u32, u32) -> Result<(), PhotoError>,
) -> Result<DynamicImage, PhotoError> {
    let unread = |reason: io::Error| PhotoError::Read { path: path.to_owned(), reason };
    let undecoded = |reason| PhotoError::NotAnImage { path: path.to_owned(), reason };
    let known =
        ImageReader::open(path).and_then(ImageReader::with_guessed_format).map_err(unread)?;
    let (width, height) = known.into_dimensions().map_err(undecoded)?;
    check(width, height)?;
    let bytes = fs::read(path).map_err(unread)?;
    let mut reader = ImageReader::new(Cursor::new(&bytes)).with_guessed_format().map_err(unread)?;
    let holds = MOST_PACKED.saturating_mul(bytes.len() as u64);
    // `check` has bounded the pixels. Whatever else a file may unpack to (metadata, palettes) is
    // bounded by the size of the file.
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(holds.saturating_add(DECODER_BYTES));
    reader.limits(limits);
    if reader.format() == Some(ImageFormat::Jpeg) && is_cut_short(&bytes) {
        return Err(PhotoError::CutShort { path: path.to_owned() });
    }
    let mut decoder = reader.into_decoder().map_err(undecoded)?;
    if decoder.total_bytes() > holds {
        return Err(PhotoError::CutShort { path: path.to_owned() });
    }
    // Phones store pictures in the sensor's orientation and say in EXIF how to turn them.
    let orientation = decoder.orientation().map_err(undecoded)?;
    let mut picture = DynamicImage::from_decoder(decoder).map_err(undecoded)?;
    picture.apply_orientation(orientation);
    Ok(picture)
}

/// Whether a JPEG lacks its end marker (EOI, D9) after the start of its last scan (SOS, DA).
fn is_cut_short(bytes: &[u8]) -> bool {
    let [end, scan] =
        [0xD9, 0xDA].map(|marker: u8| bytes.windows(2).rposition(|pair| pair == [0xFF, marker]));
    end < scan
}

/// A grey map scaled to a size.
fn fitted(map: &Grey, (width, height): (u32, u32)) -> Grey {
    if map.dimensions() == (width, height) {
        map.clone()
    } else {
        resize(map, width, height, FilterType::Triangle)
    }
}

/// A colour map scaled to a size.
fn fitted_color(map: RgbaImage, (width, height): (u32, u32)) -> RgbaImage {
    if map.dimensions() == (width, height) {
        map
    } else {
        resize(&map, width, height, FilterType::Triangle)
    }
}

/// The keys of yarn.toml that are read. It may have more.
#[derive(Default, Deserialize)]
struct YarnFile {
    width_mm: Option<f64>,
    length_mm: Option<f64>,
    /// The picture's width over that of the yarn without its fuzz.
    width_in_yarns: Option<f64>,
}

/// Length and width of the picture, mm. The length is the `known` one, else the file's. The width
/// is the file's, else it fits a yarn of that thickness. Where one of the two is missing, it
/// follows from the other by the picture's aspect ratio.
fn lengths(
    file: Option<PathBuf>,
    (along, across): (u32, u32),
    thickness: f64,
    known: Option<f64>,
) -> Result<(f32, f32), PhotoError> {
    let path = file.unwrap_or_default();
    let yarn_file = if path.is_file() { read_toml(&path)? } else { YarnFile::default() };
    let aspect = f64::from(along) / f64::from(across);
    let width = checked_size(&path, "width_mm", yarn_file.width_mm)?;
    let length = checked_size(&path, "length_mm", yarn_file.length_mm)?;
    let length = known.or(length);
    let in_yarns =
        checked_size(&path, "width_in_yarns", yarn_file.width_in_yarns)?.unwrap_or(FUZZY_WIDTH);
    let width = width.or(length.map(|length| length / aspect)).unwrap_or(in_yarns * thickness);
    #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
    let (length, width) = (length.unwrap_or(width * aspect) as f32, width as f32);
    Ok((length, width))
}

/// Refuses a size from yarn.toml that no yarn has.
fn checked_size(
    path: &Path,
    key: &'static str,
    value: Option<f64>,
) -> Result<Option<f64>, PhotoError> {
    match value {
        Some(value) if !(value > 0.0 && value <= MOST_SIZE) => {
            Err(PhotoError::Size { path: path.to_owned(), key, value, most: MOST_SIZE })
        }
        _ => Ok(value),
    }
}

/// Reads yarn.toml.
fn read_toml(path: &Path) -> Result<YarnFile, PhotoError> {
    let text = fs::read_to_string(path)
        .map_err(|reason| PhotoError::Read { path: path.to_owned(), reason })?;
    toml::from_str(&text)
        .map_err(|reason| PhotoError::Toml { path: path.to_owned(), reason: Box::new(reason) })
}

/// Normals of a height map by Scharr's 3 x 3 operator, whose weights 3, 10, 3 make the gradient's
/// direction nearly independent of the grid's (Sobel's 1, 2, 1 do not). The picture repeats along
/// the yarn and its border continues across the yarn.
fn normals(height: &Grey, length: f32, width: f32) -> RgbaImage {
    let (columns, rows) = height.dimensions();
    // Height of white over the size of a texel, along and across the yarn: it turns differences of
    // map values into slopes.
    let (per_column, per_row) = (RELIEF * width / length * float(columns), RELIEF * float(rows));
    RgbaImage::from_fn(columns, rows, |x, y| {
        let at = |dx: u32, dy: u32| {
            let row = (y + dy).saturating_sub(1).min(rows - 1);
            f32::from(height.get_pixel((x + columns + dx - 1) % columns, row).0[0])
                / f32::from(u16::MAX)
        };
        let right = scharr([at(0, 0), at(0, 1), at(0, 2)], [at(2, 0), at(2, 1), at(2, 2)]);
        let up = scharr([at(0, 2), at(1, 2), at(2, 2)], [at(0, 0), at(1, 0), at(2, 0)]);
        // The normal of z = h(x, y) is (-∂h/∂x, -∂h/∂y, 1). Rows go down, so +Y is against them.
        let normal = Vec3::new(-right * per_column, -up * per_row, 1.0).normalize();
        let [r, g, b] = normal.to_array().map(|part| byte(part * 0.5 + 0.5));
        Rgba([r, g, b, u8::MAX])
    })
}

/// Scharr's derivative between two lines of three values that lie two texels apart.
fn scharr(from: [f32; 3], to: [f32; 3]) -> f32 {
    (3.0 * (to[0] - from[0]) + 10.0 * (to[1] - from[1]) + 3.0 * (to[2] - from[2])) / 32.0
}

/// 16 bits as 8, rounded.
fn upper_byte(value: u16) -> u8 {
    u8::try_from((u32::from(value) + 128) / 257).unwrap_or(u8::MAX)
}

/// A value from 0 to 1 as a byte.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to 0..=255")]
fn byte(share: f32) -> u8 {
    (share.clamp(0.0, 1.0) * 255.0).round() as u8
}

#[expect(clippy::cast_precision_loss, reason = "sides of pictures are far under 2^24")]
fn float(count: u32) -> f32 {
    count as f32
}
