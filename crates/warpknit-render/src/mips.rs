//! Mip levels of a picture (Williams 1983, 'Pyramidal parametrics').
//!
//! In: a picture and what its numbers mean. Out: [`Mips`], each level half as wide and high as the one
//! before. Means are of areas: of linear light and not of sRGB codes, of colours weighted by alpha,
//! of normals as vectors. Cost: 1.33 times the picture in memory; rows are worked on in parallel.
//!
//! Not promised: means across the picture's ends. These must match by themselves.

use std::sync::LazyLock;

use glam::{Vec3, Vec4, Vec4Swizzles};
use image::{Rgba, RgbaImage};
use rayon::prelude::*;

use super::tone;

/// Weight of a transparent texel in a mean of colours. With 0, a mip level without any yarn would
/// have no colour (0 / 0). Larger weights let the background's colour into the yarn's.
pub(super) const MIN_WEIGHT: f32 = 1e-3;

/// A picture and its mip levels, each half the size of the one before, down to one pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mips {
    /// Level 0 is the picture itself, except for the colour of transparent texels.
    pub levels: Vec<RgbaImage>,
}

/// Meaning of a picture's numbers. It decides how their mean is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MapKind {
    /// sRGB with straight alpha.
    Color,
    /// Unit vectors, stored as 0..1 for -1..1.
    Normal,
    /// Plain numbers.
    Plain,
}

impl Mips {
    /// `picture` with its mip levels. Transparent texels take the colour of the yarn beside them:
    /// hardware filters colours without regard to alpha, and would otherwise mix a photo's
    /// background into the edges.
    #[must_use]
    pub fn new(picture: RgbaImage, kind: MapKind) -> Self {
        let mut levels = vec![picture];
        while let Some(smaller) = levels.last().and_then(|level| downsample(level, kind)) {
            levels.push(smaller);
        }
        // From coarse to fine ('push-pull', Gortler et al. 1996, 'The lumigraph'): each level fills
        // its holes from the next coarser one, which has no holes left.
        if kind == MapKind::Color {
            for fine in (0..levels.len() - 1).rev() {
                let (finer, coarser) = levels.split_at_mut(fine + 1);
                fill_transparent(&mut finer[fine], &coarser[0]);
            }
        }
        Self { levels }
    }
}

/// The next coarser mip level; `None` below one pixel.
fn downsample(picture: &RgbaImage, kind: MapKind) -> Option<RgbaImage> {
    let (width, height) = picture.dimensions();
    if width.max(height) <= 1 || width.min(height) == 0 {
        return None;
    }
    let mut half = RgbaImage::new((width / 2).max(1), (height / 2).max(1));
    let (columns, rows) = (box_weights(width, half.width()), box_weights(height, half.height()));
    let row_bytes = half.width() as usize * 4;
    half.as_mut().par_chunks_mut(row_bytes).zip(&rows).for_each(|(bytes, row)| {
        for (texel, column) in bytes.chunks_exact_mut(4).zip(&columns) {
            let mut mean = Vec4::ZERO;
            for (y, down) in (row.first..).zip(row.weights) {
                for (x, across) in (column.first..).zip(column.weights) {
                    if across * down > 0.0 {
                        mean += decode(*picture.get_pixel(x, y), kind) * (across * down);
                    }
                }
            }
            texel.copy_from_slice(&encode_mean(mean, kind));
        }
    });
    Some(half)
}

/// Gives transparent texels the colour that the next coarser level has there.
fn fill_transparent(picture: &mut RgbaImage, smaller: &RgbaImage) {
    for (x, y, texel) in picture.enumerate_pixels_mut().filter(|(_, _, texel)| texel.0[3] == 0) {
        let Rgba([r, g, b, _]) =
            *smaller.get_pixel((x / 2).min(smaller.width() - 1), (y / 2).min(smaller.height() - 1));
        *texel = Rgba([r, g, b, 0]);
    }
}

/// Weights of a box filter: the texels of a row that one texel of a coarser row covers.
struct BoxWeights {
    first: u32,
    /// Weights of three texels from `first` on. They add up to 1.
    weights: [f32; 3],
}

/// Box filter from `large` to `small` texels. Each covers two, or parts of three where the number
/// is odd: dropping the last column instead would shift the texture.
fn box_weights(large: u32, small: u32) -> Vec<BoxWeights> {
    let size = float(large) / float(small);
    (0..small)
        .map(|index| {
            let (start, end) = (float(index) * size, float(index + 1) * size);
            let first =
                (u64::from(index) * u64::from(large) / u64::from(small)).try_into().unwrap_or(0);
            let weights = [first, first + 1, first + 2].map(|texel| {
                // Rounding may leave a trace of weight on a texel beyond the last.
                if texel < large { overlap(texel, start, end) / size } else { 0.0 }
            });
            BoxWeights { first, weights }
        })
        .collect()
}

/// Length of a texel that lies between `start` and `end`, texels.
fn overlap(texel: u32, start: f32, end: f32) -> f32 {
    ((float(texel) + 1.0).min(end) - float(texel).max(start)).max(0.0)
}

/// A texel as numbers that may be averaged: linear light premultiplied by alpha, vectors, or plain
/// numbers.
pub(super) fn decode(Rgba(bytes): Rgba<u8>, kind: MapKind) -> Vec4 {
    let plain = Vec4::from_array(bytes.map(f32::from)) / 255.0;
    match kind {
        MapKind::Color => {
            let [r, g, b, _] = bytes.map(|byte| LINEAR[usize::from(byte)]);
            (Vec3::new(r, g, b) * (plain.w + MIN_WEIGHT)).extend(plain.w)
        }
        MapKind::Normal => (plain.xyz() * 2.0 - 1.0).extend(plain.w),
        MapKind::Plain => plain,
    }
}

/// The texel of such a mean.
fn encode_mean(mean: Vec4, kind: MapKind) -> [u8; 4] {
    let alpha = tone::byte(mean.w);
    let [r, g, b] = match kind {
        MapKind::Color => tone::encode(mean.xyz() / (mean.w + MIN_WEIGHT)),
        MapKind::Normal => {
            (mean.xyz().normalize_or(Vec3::Z) * 0.5 + 0.5).to_array().map(tone::byte)
        }
        MapKind::Plain => mean.xyz().to_array().map(tone::byte),
    };
    [r, g, b, alpha]
}

/// Table from sRGB bytes to linear light.
pub static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|byte| {
        tone::linear(f32::from(u8::try_from(byte).unwrap_or(u8::MAX)) / 255.0)
    })
});

#[expect(clippy::cast_precision_loss, reason = "sides of pictures are far under 2^24")]
pub(super) fn float(count: u32) -> f32 {
    count as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transparent_texels_take_the_colour_beside_them_and_stay_transparent() {
        // A yarn two texels wide on a green ground.
        let picture = RgbaImage::from_fn(9, 7, |_, y| {
            if y / 2 == 1 { Rgba([200, 90, 40, 255]) } else { Rgba([0, 255, 0, 0]) }
        });
        for level in Mips::new(picture, MapKind::Color).levels {
            for texel in level.pixels() {
                let mut colours = texel.0.into_iter().zip([200, 90, 40]);
                assert!(colours.all(|(found, wanted)| found.abs_diff(wanted) <= 8), "{texel:?}");
            }
        }
    }

    #[test]
    fn levels_halve_down_to_one_pixel_and_keep_the_mean() {
        for (width, height) in [(8, 8), (12, 5), (31, 2), (1, 7)] {
            let noise = RgbaImage::from_fn(width, height, |x, y| {
                Rgba([x, y, x * y, 7].map(|n| (n * 97 % 251).to_le_bytes()[0]))
            });
            let levels = Mips::new(noise, MapKind::Plain).levels;
            assert_eq!(levels.last().unwrap().dimensions(), (1, 1));
            let mean = |level: &RgbaImage| {
                let sum: Vec4 = level.pixels().map(|&texel| decode(texel, MapKind::Plain)).sum();
                sum / float(level.width() * level.height()) * 255.0
            };
            for pair in levels.windows(2) {
                let sides = |level: &RgbaImage| [level.width(), level.height()];
                assert_eq!(sides(&pair[1]), sides(&pair[0]).map(|side| (side / 2).max(1)));
                assert!(mean(&pair[0]).distance(mean(&pair[1])) < 1.1, "{width} x {height}");
            }
        }
    }

    #[test]
    fn means_are_of_light_weighed_by_alpha_and_of_unit_normals() {
        // White and black columns, half of the rows transparent.
        let stripes = RgbaImage::from_fn(4, 4, |x, y| {
            let red = if x % 2 == 0 { 255 } else { 0 };
            Rgba([red, 40, 200, if y < 2 { 255 } else { 0 }])
        });
        let levels = Mips::new(stripes, MapKind::Color).levels;
        // Half of the light is 188 in sRGB; a transparent texel's colour hardly counts.
        assert_eq!(levels[2].get_pixel(0, 0).0, [188, 40, 200, 128]);
        let tilted = RgbaImage::from_fn(2, 2, |x, _| {
            if x == 0 { Rgba([218, 128, 218, 255]) } else { Rgba([38, 128, 218, 255]) }
        });
        assert_eq!(
            Mips::new(tilted, MapKind::Normal).levels[1].get_pixel(0, 0).0,
            [128, 128, 255, 255]
        );
    }
}
