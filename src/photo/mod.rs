//! The pictures of a yarn: from files to [`Maps`].
//!
//! In: a folder of maps, or one picture of a yarn. Out: [`Maps`], whole, with what is missing made
//! up: flat normals, or those of a height map by Scharr's operator, the roughness of fibres, no
//! metal, no occlusion. Pictures of another size than the base colour's are scaled to it.
//!
//! | file | what it is |
//! |---|---|
//! | `base_color.png` | sRGB and alpha, x along the yarn; the one that must be there |
//! | `normal.png` | normals, OpenGL's way |
//! | `height.png` | grey, white half the width above black; read where there are no normals |
//! | `roughness.png`, `metallic.png`, `ao.png` | grey |
//! | `yarn.toml` | `width_mm` and `length_mm` of the picture, or `width_in_yarns`, its width over the yarn's without fuzz, each optional; what else it says is for people |
//!
//! [`develop`] makes such a folder of one photo.

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

use crate::render::maps::{MapKind, Maps, Mips};

/// Fewest and most pixels of a picture each way; graphics cards take no more.
const SIDES: (u32, u32) = (4, 16_384);
/// The largest size that is believed, mm.
const MOST_SIZE: f64 = 10_000.0;
/// Width of a yarn's picture, fuzz included, in thicknesses of the yarn, where nothing says it.
const FUZZY_WIDTH: f64 = 1.25;
/// Fibres are dull.
const ROUGHNESS: u8 = 191;
/// How far white lies above black in a height map, in widths of the picture: half as high as a
/// round yarn is wide.
const RELIEF: f32 = 0.5;

/// How many bytes of picture a byte of a file may hold: deflate reaches 1032, JPEG some 1200. A
/// file that claims more is cut short, and would take memory that its size doesn't bound.
const MOST_PACKED: u64 = 2048;
/// What decoding takes beside the picture, bytes.
const DECODER_BYTES: u64 = 16 << 20;

/// A map of heights or shares.
type Grey = ImageBuffer<Luma<u16>, Vec<u16>>;

/// Reads the folder or the picture at `path`. Where no file says how wide it is, it fits a yarn
/// that is `thickness` mm thick; `length`, mm of yarn that the picture shows, goes before what a
/// file says.
///
/// # Errors
/// [`PhotoError`] where there is no picture, or a file is not what its name says.
pub fn read_maps(path: &Path, thickness: f64, length: Option<f64>) -> Result<Maps, PhotoError> {
    let in_folder = path.is_dir();
    let base_path = if in_folder { path.join("base_color.png") } else { path.to_owned() };
    if in_folder && !base_path.is_file() {
        return Err(PhotoError::NoBaseColor { path: path.to_owned() });
    }
    let base = picture(&base_path)?.into_rgba8();
    let size = base.dimensions();
    // One picture has no companions: files that lie beside it belong to someone else.
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
    let surface = RgbaImage::from_fn(size.0, size.1, |x, y| {
        let at = |map: &Option<Grey>, missing| {
            map.as_ref().map_or(missing, |map| eight(map.get_pixel(x, y).0[0]))
        };
        Rgba([at(&occlusion, u8::MAX), at(&roughness, ROUGHNESS), at(&metallic, 0), u8::MAX])
    });
    Ok(Maps {
        base: Mips::new(base, MapKind::Color),
        normal: Mips::new(normal, MapKind::Normal),
        surface: Mips::new(surface, MapKind::Plain),
        length,
        width,
    })
}

/// Reads a photo for [`develop::develop`]; transparency is left out.
///
/// # Errors
/// [`PhotoError`] where it can't be read, or is too small or too large.
pub fn read_photo(path: &Path) -> Result<RgbImage, PhotoError> {
    let unfit = |reason| PhotoError::Photo { path: path.to_owned(), reason };
    Ok(decoded(path, |width, height| develop::check_size(width, height).map_err(unfit))?
        .into_rgb8())
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

/// Decodes a picture of whose sides `check` approves.
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
    // The sides are known to be bearable; what else a file may unpack to is bounded by its size.
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
    // Phones keep pictures as the chip lies and say how they are to be turned.
    let orientation = decoder.orientation().map_err(undecoded)?;
    let mut picture = DynamicImage::from_decoder(decoder).map_err(undecoded)?;
    picture.apply_orientation(orientation);
    Ok(picture)
}

/// Whether a JPEG has no end after the start of its last scan.
fn is_cut_short(bytes: &[u8]) -> bool {
    let last = |marker: u8| bytes.windows(2).rposition(|pair| pair == [0xFF, marker]);
    last(0xD9) < last(0xDA)
}

fn fitted(map: &Grey, (width, height): (u32, u32)) -> Grey {
    if map.dimensions() == (width, height) {
        map.clone()
    } else {
        resize(map, width, height, FilterType::Triangle)
    }
}

fn fitted_color(map: RgbaImage, (width, height): (u32, u32)) -> RgbaImage {
    if map.dimensions() == (width, height) {
        map
    } else {
        resize(&map, width, height, FilterType::Triangle)
    }
}

/// What yarn.toml says; it may say more, which is for others.
#[derive(Default, Deserialize)]
struct YarnFile {
    width_mm: Option<f64>,
    length_mm: Option<f64>,
    /// The picture's width over that of the yarn without its fuzz.
    width_in_yarns: Option<f64>,
}

/// Length and width of the picture, mm: the `known` length, else as the file says, else as wide as
/// fits a yarn of that thickness, and the rest by the picture's shape.
fn lengths(
    file: Option<PathBuf>,
    (along, across): (u32, u32),
    thickness: f64,
    known: Option<f64>,
) -> Result<(f32, f32), PhotoError> {
    let path = file.unwrap_or_default();
    let said = if path.is_file() { read_toml(&path)? } else { YarnFile::default() };
    let checked = |key, value: f64| {
        if value > 0.0 && value <= MOST_SIZE {
            return Ok(value);
        }
        Err(PhotoError::Size { path: path.clone(), key, value, most: MOST_SIZE })
    };
    let aspect = f64::from(along) / f64::from(across);
    let width = said.width_mm.map(|value| checked("width_mm", value)).transpose()?;
    let length = said.length_mm.map(|value| checked("length_mm", value)).transpose()?;
    let length = known.or(length);
    let in_yarns = said
        .width_in_yarns
        .map(|value| checked("width_in_yarns", value))
        .transpose()?
        .unwrap_or(FUZZY_WIDTH);
    let width = width.or(length.map(|length| length / aspect)).unwrap_or(in_yarns * thickness);
    #[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
    let (length, width) = (length.unwrap_or(width * aspect) as f32, width as f32);
    Ok((length, width))
}

fn read_toml(path: &Path) -> Result<YarnFile, PhotoError> {
    let text = fs::read_to_string(path)
        .map_err(|reason| PhotoError::Read { path: path.to_owned(), reason })?;
    toml::from_str(&text)
        .map_err(|reason| PhotoError::Toml { path: path.to_owned(), reason: Box::new(reason) })
}

/// Normals of a height map, by Scharr's 3 x 3 operator; the picture repeats along the yarn and ends
/// across it.
fn normals(height: &Grey, length: f32, width: f32) -> RgbaImage {
    let (columns, rows) = height.dimensions();
    // Height of white, in texels along and across.
    let (per_column, per_row) = (RELIEF * width / length * float(columns), RELIEF * float(rows));
    RgbaImage::from_fn(columns, rows, |x, y| {
        let at = |dx: u32, dy: u32| {
            let row = (y + dy).saturating_sub(1).min(rows - 1);
            f32::from(height.get_pixel((x + columns + dx - 1) % columns, row).0[0])
                / f32::from(u16::MAX)
        };
        let rise = |from: [f32; 3], to: [f32; 3]| {
            (3.0 * (to[0] - from[0]) + 10.0 * (to[1] - from[1]) + 3.0 * (to[2] - from[2])) / 32.0
        };
        let right = rise([at(0, 0), at(0, 1), at(0, 2)], [at(2, 0), at(2, 1), at(2, 2)]);
        let up = rise([at(0, 2), at(1, 2), at(2, 2)], [at(0, 0), at(1, 0), at(2, 0)]);
        let normal = Vec3::new(-right * per_column, -up * per_row, 1.0).normalize();
        let [r, g, b] = normal.to_array().map(|part| byte(part * 0.5 + 0.5));
        Rgba([r, g, b, u8::MAX])
    })
}

/// The upper of two bytes, rounded.
fn eight(value: u16) -> u8 {
    u8::try_from((u32::from(value) + 128) / 257).unwrap_or(u8::MAX)
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to 0..=255")]
fn byte(share: f32) -> u8 {
    (share.clamp(0.0, 1.0) * 255.0).round() as u8
}

#[expect(clippy::cast_precision_loss, reason = "sides of pictures are far under 2^24")]
fn float(count: u32) -> f32 {
    count as f32
}
