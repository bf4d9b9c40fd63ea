//! The pictures of yarns for files of tubes.
//!
//! In: [`Maps`] that fit a tube, x along the yarn and y round it. Out: PNG pictures, transposed as
//! tubes' texture coordinates are: the first goes round the yarn, the second along it. Transposing
//! swaps the axes of normals too. The right of the new picture is the bottom of the old one, and
//! its top is the old one's left, so both components change their sign.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, Rgb, RgbImage, RgbaImage};

use warpknit_render::maps::Maps;
use warpknit_render::scene::Scene;

/// One yarn's pictures.
#[derive(Debug)]
pub(super) struct Texture {
    /// PNG. First the base colour, sRGB; tubes are solid, so there is no alpha. Then normals with
    /// y up, as in OpenGL. Then the surface as glTF packs it: red is ambient occlusion, green
    /// roughness, blue metal.
    pub(super) pictures: [Vec<u8>; Self::PICTURES],
    /// The mean base colour, linear.
    pub(super) mean: [f32; 3],
}

/// The pictures of a fabric's yarns, encoded once for all files of a run. The default has none.
#[derive(Debug, Default)]
pub struct TextureSet {
    pub(super) textures: Vec<Texture>,
    /// Each bar's place in `textures`.
    places: Vec<Option<usize>>,
    /// Repeats of its picture in a millimetre of each bar's yarn; 1 where it has none.
    repeats_per_mm: Vec<f32>,
}

impl TextureSet {
    /// The pictures of a scene of tubes, whose looks are the fabric's bars. Cost: each picture is
    /// transposed and compressed.
    #[must_use]
    pub fn from_scene(scene: &Scene) -> Self {
        let looks = scene.looks.iter();
        let repeats_per_mm = looks
            .clone()
            .map(|look| scene.maps_of(look).map_or(1.0, |maps| 1.0 / maps.length))
            .collect();
        Self {
            textures: scene.maps.iter().map(Texture::from_maps).collect(),
            places: looks.map(|look| look.maps.map(usize::from)).collect(),
            repeats_per_mm,
        }
    }

    /// The place in `textures` of a bar's pictures, if it has any.
    pub(super) fn texture_of(&self, bar: usize) -> Option<usize> {
        self.places.get(bar).copied().flatten()
    }

    /// Factor from lengths along a bar's tubes, mm, to texture coordinates.
    pub(super) fn repeats_per_mm(&self, bar: usize) -> f32 {
        self.repeats_per_mm.get(bar).copied().unwrap_or(1.0)
    }
}

impl Texture {
    /// Places in [`Texture::pictures`].
    pub(super) const BASE: usize = 0;
    pub(super) const NORMAL: usize = 1;
    pub(super) const SURFACE: usize = 2;
    pub(super) const PICTURES: usize = 3;

    fn from_maps(maps: &Maps) -> Self {
        Self {
            pictures: [
                encode(&transpose(&maps.base.levels[0], unchanged)),
                encode(&transpose(&maps.normal.levels[0], transpose_normal)),
                encode(&transpose(&maps.surface.levels[0], unchanged)),
            ],
            mean: maps.mean_albedo().to_array(),
        }
    }
}

fn unchanged(pixel: [u8; 3]) -> [u8; 3] {
    pixel
}

/// A normal, stored as bytes around 128, in the transposed picture.
fn transpose_normal([x, y, z]: [u8; 3]) -> [u8; 3] {
    [u8::MAX - y, u8::MAX - x, z]
}

/// A picture whose rows are the old one's columns, its pixels changed by `change`.
fn transpose(picture: &RgbaImage, change: impl Fn([u8; 3]) -> [u8; 3]) -> RgbImage {
    RgbImage::from_fn(picture.height(), picture.width(), |x, y| {
        let [r, g, b, _] = picture.get_pixel(y, x).0;
        Rgb(change([r, g, b]))
    })
}

/// The bytes of a PNG. Compression is the default one: pictures stay in the file for good.
fn encode(picture: &RgbImage) -> Vec<u8> {
    let mut bytes = Vec::new();
    let encoder =
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive);
    let written = encoder.write_image(
        picture.as_raw(),
        picture.width(),
        picture.height(),
        ExtendedColorType::Rgb8,
    );
    written.expect("memory takes all bytes, and the picture is as large as it says");
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgba;

    #[test]
    fn a_transposed_picture_runs_downward_along_the_yarn() {
        let picture = RgbaImage::from_fn(3, 2, |x, y| {
            Rgba([10 * u8::try_from(x).unwrap(), u8::try_from(y).unwrap(), 7, 0])
        });
        let turned = transpose(&picture, unchanged);
        assert_eq!(turned.dimensions(), (2, 3));
        assert_eq!(turned.get_pixel(1, 2).0, [20, 1, 7]);
        assert_eq!(image::load_from_memory(&encode(&turned)).unwrap().into_rgb8(), turned);
    }
}
