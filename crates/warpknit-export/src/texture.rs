//! The pictures of a yarn for files of tubes.
//!
//! In: [`Maps`] that fit a tube, x along the yarn and y round it. Out: PNG pictures turned to lie
//! as tubes' texture coordinates do, the first number round the yarn and the second one along it.
//! Turning swaps the two axes, so normals swap theirs: right of the turned picture is the old one's
//! bottom, and its top the old one's left.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, Rgb, RgbImage, RgbaImage};

use warpknit_render::maps::Maps;
use warpknit_render::scene::Scene;

/// One yarn's pictures.
#[derive(Debug)]
pub(super) struct Texture {
    /// PNG, one after the other: base colour, sRGB (tubes are solid, so there is no alpha);
    /// normals, OpenGL's way; and red: ambient occlusion, green: roughness, blue: metal.
    pub(super) pictures: [Vec<u8>; Self::PICTURES],
    /// The mean base colour, linear.
    pub(super) mean: [f32; 3],
}

/// The pictures that the bars of a fabric wear, made ready once for all files of a run. The default
/// is that of plain yarns.
#[derive(Debug, Default)]
pub struct Wardrobe {
    pub(super) textures: Vec<Texture>,
    /// Each bar's place in `textures`.
    of_bars: Vec<Option<usize>>,
    /// Repeats of its picture in a millimetre of each bar's yarn; 1 where it has none.
    per_mm: Vec<f32>,
}

impl Wardrobe {
    /// The pictures of a scene of tubes, whose looks are the fabric's bars. Cost: each picture is
    /// turned and compressed.
    #[must_use]
    pub fn of(dressed: &Scene) -> Self {
        let of_bars: Vec<_> = dressed.looks.iter().map(|look| look.maps.map(usize::from)).collect();
        let per_mm = dressed
            .looks
            .iter()
            .map(|look| dressed.maps_of(look).map_or(1.0, |maps| 1.0 / maps.length))
            .collect();
        Self { textures: dressed.maps.iter().map(Texture::of).collect(), of_bars, per_mm }
    }

    /// A bar's place in `textures`.
    pub(super) fn worn_by(&self, bar: usize) -> Option<usize> {
        self.of_bars.get(bar).copied().flatten()
    }

    /// By what the lengths in texture coordinates of a bar's tubes, mm, are to be multiplied.
    pub(super) fn per_mm(&self, bar: usize) -> f32 {
        self.per_mm.get(bar).copied().unwrap_or(1.0)
    }
}

impl Texture {
    /// Places in [`Texture::pictures`].
    pub(super) const BASE: usize = 0;
    pub(super) const NORMAL: usize = 1;
    pub(super) const SURFACE: usize = 2;
    pub(super) const PICTURES: usize = 3;

    fn of(maps: &Maps) -> Self {
        let turned_normal = |[x, y, z]: [u8; 3]| [u8::MAX - y, u8::MAX - x, z];
        Self {
            pictures: [
                encoded(&turned(&maps.base.levels[0], |color| color)),
                encoded(&turned(&maps.normal.levels[0], turned_normal)),
                encoded(&turned(&maps.surface.levels[0], |surface| surface)),
            ],
            mean: maps.mean_albedo().to_array(),
        }
    }
}

/// A picture whose rows are the old one's columns, its values changed by `of`.
fn turned(picture: &RgbaImage, of: impl Fn([u8; 3]) -> [u8; 3]) -> RgbImage {
    RgbImage::from_fn(picture.height(), picture.width(), |x, y| {
        let [r, g, b, _] = picture.get_pixel(y, x).0;
        Rgb(of([r, g, b]))
    })
}

fn encoded(picture: &RgbImage) -> Vec<u8> {
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
    fn a_turned_picture_runs_downward_along_the_yarn() {
        let picture = RgbaImage::from_fn(3, 2, |x, y| {
            Rgba([10 * u8::try_from(x).unwrap(), u8::try_from(y).unwrap(), 7, 0])
        });
        let turned = turned(&picture, |color| color);
        assert_eq!(turned.dimensions(), (2, 3));
        assert_eq!(turned.get_pixel(1, 2).0, [20, 1, 7]);
        assert_eq!(image::load_from_memory(&encoded(&turned)).unwrap().into_rgb8(), turned);
    }
}
