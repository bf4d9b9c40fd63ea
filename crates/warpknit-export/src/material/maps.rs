//! Maps as PNG pictures (ISO/IEC 15948) with their true size, and the means of their pixels.
//!
//! All are RGB, greys with three equal channels: readers of U3M need not take grey pictures. Heights
//! have 16 bits a channel. Base colours are marked as sRGB; all others hold plain numbers.

use image::{GrayImage, RgbImage};

use warpknit_core::number::{double, narrow};
use warpknit_render::fabric_maps::{Side, SideMaps};
use warpknit_render::tone;

/// Inches in a metre.
const INCHES: f64 = 39.370_078_740_157_48;

/// What a map says of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Base colour.
    BaseColor,
    /// Normals.
    Normal,
    /// Heights.
    Height,
    /// Cover.
    Alpha,
    /// Perceived roughness.
    Roughness,
    /// Metal.
    Metallic,
    /// Ambient occlusion.
    Occlusion,
    /// Sheen.
    Sheen,
}

impl Role {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::BaseColor,
        Self::Normal,
        Self::Height,
        Self::Alpha,
        Self::Roughness,
        Self::Metallic,
        Self::Occlusion,
        Self::Sheen,
    ];

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::BaseColor => "base_color",
            Self::Normal => "normal",
            Self::Height => "height",
            Self::Alpha => "alpha",
            Self::Roughness => "roughness",
            Self::Metallic => "metallic",
            Self::Occlusion => "occlusion",
            Self::Sheen => "sheen",
        }
    }

    /// Its file in the material's folder.
    #[must_use]
    pub fn path(self, side: Side) -> String {
        format!("textures/{}_{}.png", side.name(), self.name())
    }
}

/// Means of a side's maps over its yarn. Numbers that a program takes which takes no pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Means {
    /// Base colour, linear RGB.
    pub base_color: [f64; 3],
    /// Share of the area that yarn covers.
    pub alpha: f64,
    /// Perceived roughness.
    pub roughness: f64,
    /// Metal.
    pub metallic: f64,
    /// Share of the sky that is seen.
    pub occlusion: f64,
    /// Sheen.
    pub sheen: f64,
    /// Height over the lowest surface, as a share of the cloth's depth.
    pub height: f64,
}

impl Means {
    /// Those of a side.
    #[must_use]
    pub fn of(maps: &SideMaps) -> Self {
        let alpha = maps.alpha.as_raw();
        Self {
            base_color: [0, 1, 2].map(|channel| {
                over_yarn(maps, |at| light(maps.base_color.as_raw()[3 * at + channel]))
            }),
            alpha: alpha.iter().copied().map(share).sum::<f64>() / double(alpha.len()),
            roughness: mean_over_yarn(maps, &maps.roughness),
            metallic: mean_over_yarn(maps, &maps.metallic),
            occlusion: mean_over_yarn(maps, &maps.occlusion),
            sheen: mean_over_yarn(maps, &maps.sheen),
            height: over_yarn(maps, |at| f64::from(maps.height.as_raw()[at]) / 65_535.0),
        }
    }
}

/// The mean of pixels' values, weighted by the yarn in them.
fn over_yarn(maps: &SideMaps, value: impl Fn(usize) -> f64) -> f64 {
    let weights = maps.alpha.as_raw().iter().copied().map(f64::from);
    let (sum, weight) = weights
        .enumerate()
        .fold((0.0, 0.0), |(sum, all), (at, weight)| (sum + weight * value(at), all + weight));
    if weight > 0.0 { sum / weight } else { 0.0 }
}

/// The same of a grey picture.
fn mean_over_yarn(maps: &SideMaps, picture: &GrayImage) -> f64 {
    over_yarn(maps, |at| share(picture.as_raw()[at]))
}

/// Linear light of an sRGB code.
fn light(code: u8) -> f64 {
    f64::from(tone::linear(narrow(share(code))))
}

fn share(byte: u8) -> f64 {
    f64::from(byte) / 255.0
}

/// A side's map as PNG.
pub(super) fn png(maps: &SideMaps, role: Role, dpi: [f64; 2]) -> Vec<u8> {
    let [width, height] = [maps.alpha.width(), maps.alpha.height()];
    let data: Vec<u8> = match role {
        Role::BaseColor => maps.base_color.as_raw().clone(),
        Role::Normal => maps.normal.as_raw().clone(),
        Role::Height => {
            let heights = maps.height.as_raw().iter();
            heights.flat_map(|value| [value.to_be_bytes(); 3]).flatten().collect()
        }
        Role::Alpha => grey_as_rgb(&maps.alpha),
        Role::Roughness => grey_as_rgb(&maps.roughness),
        Role::Metallic => grey_as_rgb(&maps.metallic),
        Role::Occlusion => grey_as_rgb(&maps.occlusion),
        Role::Sheen => grey_as_rgb(&maps.sheen),
    };
    let depth = if role == Role::Height { png::BitDepth::Sixteen } else { png::BitDepth::Eight };
    let picture = PngPicture { width, height, color: png::ColorType::Rgb, depth, data: &data };
    picture.encode(Some(dpi), role == Role::BaseColor)
}

/// A grey picture with three equal channels.
fn grey_as_rgb(picture: &GrayImage) -> Vec<u8> {
    picture.as_raw().iter().flat_map(|&value| [value; 3]).collect()
}

/// The base colour with its alpha, PNG.
pub(super) fn base_with_alpha(maps: &SideMaps) -> Vec<u8> {
    let pixels = maps.base_color.pixels().zip(maps.alpha.pixels());
    let rgba = pixels.flat_map(|(color, alpha)| {
        let [r, g, b] = color.0;
        [r, g, b, alpha.0[0]]
    });
    let data: Vec<u8> = rgba.collect();
    let (width, height) = maps.alpha.dimensions();
    let (color, depth) = (png::ColorType::Rgba, png::BitDepth::Eight);
    PngPicture { width, height, color, depth, data: &data }.encode(None, true)
}

/// Occlusion, roughness and metal in red, green and blue, as glTF packs them, PNG.
pub(super) fn surface(maps: &SideMaps) -> Vec<u8> {
    rgb(&RgbImage::from_fn(maps.alpha.width(), maps.alpha.height(), |x, y| {
        image::Rgb([&maps.occlusion, &maps.roughness, &maps.metallic].map(|map| map[(x, y)].0[0]))
    }))
}

/// A picture of plain numbers as PNG.
pub(super) fn rgb(picture: &RgbImage) -> Vec<u8> {
    let (width, height) = picture.dimensions();
    let (color, depth) = (png::ColorType::Rgb, png::BitDepth::Eight);
    PngPicture { width, height, color, depth, data: picture.as_raw() }.encode(None, false)
}

/// A picture to encode.
struct PngPicture<'a> {
    width: u32,
    height: u32,
    color: png::ColorType,
    depth: png::BitDepth,
    data: &'a [u8],
}

impl PngPicture<'_> {
    /// Its PNG, with its size on paper if it has one.
    fn encode(&self, dpi: Option<[f64; 2]>, is_srgb: bool) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(self.color);
        encoder.set_depth(self.depth);
        if let Some(dpi) = dpi {
            let [xppu, yppu] = dpi.map(|dpi| pixels_per_metre(dpi * INCHES));
            let unit = png::Unit::Meter;
            encoder.set_pixel_dims(Some(png::PixelDimensions { xppu, yppu, unit }));
        }
        if is_srgb {
            encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        }
        let mut writer = encoder.write_header().expect("memory takes all bytes");
        writer.write_image_data(self.data).expect("the picture is as large as it says");
        writer.finish().expect("memory takes all bytes");
        bytes
    }
}

/// The nearest whole number.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
fn pixels_per_metre(number: f64) -> u32 {
    number.round() as u32
}
