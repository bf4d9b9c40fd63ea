//! From sums over rays to the pixels of maps.
//!
//! In: [`PixelSums`]s, row by row. Out: [`SideMaps`]. Pixels without yarn get the mean of the nearest
//! pixels with yarn, coarse to fine (pull-push, Gortler, Grzeszczuk, Szeliski and Cohen 1996, 'The
//! lumigraph'), around the edges of the map as it repeats. Cost: linear in the pixels.

use glam::Vec3;
use image::{GrayImage, ImageBuffer, Luma, Rgb, RgbImage};

use super::{Side, SideMaps};
use crate::cpu::endless::PixelSums;
use crate::tone;
use warpknit_core::ids::index32;
use warpknit_core::number::byte;

/// Largest growth of the squared width of highlights by the spread of normals (Tokuyoshi and
/// Kaplanyan 2019). Without a limit, pixels at the rims of yarns would become fully dull.
const MOST_SPREAD: f32 = 0.18;
/// Cover below which a pixel's values come from its neighbours too. A few rays say little of
/// occlusion: the rims of yarns would be speckled. Above an eighth, rims would blur.
const LEAST_COVER: f32 = 1.0 / 8.0;
/// The number of a texel's values that are filled in.
const VALUES: usize = 10;

/// A texel's values that are means over yarn, times its cover, and the cover.
#[derive(Clone, Copy, Default)]
struct TexelSums {
    values: [f32; VALUES],
    cover: f32,
}

impl SideMaps {
    /// The maps of a side of cloth whose surfaces lie between these depths, mm.
    pub(super) fn from_texels(
        texels: Vec<PixelSums>,
        size: [u32; 2],
        side: Side,
        depths: [f32; 2],
    ) -> Self {
        let covers: Vec<f32> = texels.iter().map(|texel| texel.cover).collect();
        let heights: Vec<f32> = texels.iter().map(|texel| texel.height).collect();
        let means = filled(texels.into_iter().map(TexelSums::from).collect(), size);
        let low = depths.map(|depth| side.height(depth)).into_iter().reduce(f32::min);
        let (low, depth) = (low.unwrap_or(0.0), (depths[1] - depths[0]).max(f32::MIN_POSITIVE));
        let height = covers.iter().zip(&heights).map(|(&cover, &height)| {
            if cover > 0.0 { word((height / cover - low) / depth) } else { 0 }
        });
        let normals = covers.iter().zip(&means).flat_map(|(&cover, mean)| {
            // A hole's own normal counts for nothing; that of a rim would tilt the whole of it.
            let unit = if cover > 0.0 { vector(mean, 3).normalize_or(Vec3::Z) } else { Vec3::Z };
            (unit * 127.5 + 127.5).to_array().map(byte)
        });
        Self {
            base_color: colors(size, &means),
            normal: picture(size, normals.collect()),
            height: picture(size, height.collect()),
            alpha: picture(size, covers.iter().map(|&cover| byte(255.0 * cover)).collect()),
            roughness: greys(size, &means, |mean| widened(mean[6], vector(mean, 3).length())),
            metallic: greys(size, &means, |mean| mean[7]),
            occlusion: greys(size, &means, |mean| mean[8]),
            sheen: greys(size, &means, |mean| mean[9]),
        }
    }
}

impl From<PixelSums> for TexelSums {
    fn from(texel: PixelSums) -> Self {
        let PixelSums { albedo, normal, roughness, metallic, occlusion, sheen, cover, .. } = texel;
        let ([r, g, b], [x, y, z]) = (albedo.to_array(), normal.to_array());
        Self { values: [r, g, b, x, y, z, roughness, metallic, occlusion, sheen], cover }
    }
}

impl TexelSums {
    fn plus(self, other: Self) -> Self {
        Self {
            values: std::array::from_fn(|at| self.values[at] + other.values[at]),
            cover: self.cover + other.cover,
        }
    }

    /// The means over yarn. 0 without any.
    fn means(self) -> [f32; VALUES] {
        self.values.map(|value| if self.cover > 0.0 { value / self.cover } else { 0.0 })
    }
}

/// The means of all texels. Those with little yarn or none have the mean of their neighbourhood, the
/// smallest that holds enough.
fn filled(texels: Vec<TexelSums>, [width, height]: [u32; 2]) -> Vec<[f32; VALUES]> {
    if texels.iter().all(|texel| texel.cover >= LEAST_COVER) || texels.len() == 1 {
        return texels.into_iter().map(TexelSums::means).collect();
    }
    let (width, height) = (width as usize, height as usize);
    let half = [width.div_ceil(2), height.div_ceil(2)];
    // Pull: sums over two by two texels. At an odd edge the last row or column counts twice.
    let coarse =
        (0..half[1]).flat_map(|y| (0..half[0]).map(move |x| [2 * x, 2 * y])).map(|[x, y]| {
            let rows = [y, (y + 1).min(height - 1)];
            let columns = [x, (x + 1).min(width - 1)];
            rows.into_iter()
                .flat_map(|y| columns.map(|x| texels[y * width + x]))
                .fold(TexelSums::default(), TexelSums::plus)
        });
    let coarse = Coarse { means: filled(coarse.collect(), half.map(index32)), size: half };
    let texel_means = texels.iter().enumerate().map(|(at, texel)| {
        let missing = LEAST_COVER - texel.cover;
        if missing <= 0.0 {
            return texel.means();
        }
        let near = coarse.around(at % width, at / width);
        std::array::from_fn(|value| (texel.values[value] + missing * near[value]) / LEAST_COVER)
    });
    texel_means.collect()
}

/// Means of two by two texels each.
struct Coarse {
    means: Vec<[f32; VALUES]>,
    size: [usize; 2],
}

impl Coarse {
    /// Push: what the four coarse texels nearest to a fine one have, interpolated, around the edges
    /// of the map.
    fn around(&self, x: usize, y: usize) -> [f32; VALUES] {
        let [width, height] = self.size;
        let columns = [x / 2, x / 2, x / 2, beside(x, width)];
        let rows = [y / 2, y / 2, y / 2, beside(y, height)];
        let mut mean = [0.0; VALUES];
        for place in rows.into_iter().flat_map(|row| columns.map(|column| row * width + column)) {
            mean.iter_mut().zip(&self.means[place]).for_each(|(mean, near)| *mean += near / 16.0);
        }
        mean
    }
}

/// The second nearest of `count` coarse texels in a line to a fine one.
fn beside(at: usize, count: usize) -> usize {
    if at % 2 == 1 { (at / 2 + 1) % count } else { (at / 2 + count - 1) % count }
}

/// A roughness that is widened by the spread of normals whose mean has this length. The spread is
/// the variance of their slopes, (1 - length²) / length² for small ones.
fn widened(roughness: f32, length: f32) -> f32 {
    let length2 = (length * length).clamp(f32::MIN_POSITIVE, 1.0);
    let spread = ((1.0 - length2) / length2 / 2.0).min(MOST_SPREAD);
    let a = roughness * roughness;
    // Beckmann's a², the mean of squared slopes, grows by twice the variance.
    (a * a + 2.0 * spread).min(1.0).sqrt().sqrt()
}

fn vector(mean: &[f32; VALUES], at: usize) -> Vec3 {
    Vec3::new(mean[at], mean[at + 1], mean[at + 2])
}

/// The base colours, sRGB.
fn colors(size: [u32; 2], means: &[[f32; VALUES]]) -> RgbImage {
    picture::<Rgb<u8>>(size, means.iter().flat_map(|mean| tone::encode(vector(mean, 0))).collect())
}

fn greys(
    size: [u32; 2],
    means: &[[f32; VALUES]],
    grey: impl Fn(&[f32; VALUES]) -> f32,
) -> GrayImage {
    picture::<Luma<u8>>(size, means.iter().map(|mean| byte(255.0 * grey(mean))).collect())
}

fn picture<P: image::Pixel>(
    [width, height]: [u32; 2],
    numbers: Vec<P::Subpixel>,
) -> ImageBuffer<P, Vec<P::Subpixel>> {
    ImageBuffer::from_raw(width, height, numbers).expect("one texel a pixel")
}

/// A share of 0 to 1 in 16 bits.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
fn word(share: f32) -> u16 {
    (share * 65_535.0 + 0.5) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texel(cover: f32, albedo: f32) -> PixelSums {
        PixelSums {
            cover,
            albedo: Vec3::splat(albedo * cover),
            normal: Vec3::Z * cover,
            ..PixelSums::default()
        }
    }

    #[test]
    fn pixels_without_yarn_take_their_neighbours_colour() {
        let size = [7, 5];
        let texels = (0..35).map(|at| texel(if at % 7 < 2 { 0.0 } else { 0.5 }, 0.3)).collect();
        let maps = SideMaps::from_texels(texels, size, Side::Front, [-0.1, 0.1]);
        let color = maps.base_color.get_pixel(3, 0);
        assert!(maps.base_color.pixels().all(|pixel| pixel == color));
        assert_eq!(maps.alpha.get_pixel(0, 0).0, [0]);
        assert_eq!(maps.alpha.get_pixel(3, 0).0, [128]);
        assert!(maps.normal.pixels().all(|pixel| pixel.0 == [128, 128, 255]));
    }

    #[test]
    fn heights_reach_from_the_lowest_to_the_highest_surface() {
        for (side, z, height) in
            [(Side::Front, 0.3, 65_535), (Side::Back, 0.3, 0), (Side::Back, -0.1, 65_535)]
        {
            let one = PixelSums { height: side.height(z) * 0.5, ..texel(0.5, 1.0) };
            let maps = SideMaps::from_texels(vec![one], [1, 1], side, [-0.1, 0.3]);
            assert_eq!(maps.height.get_pixel(0, 0).0, [height], "{side:?} {z}");
        }
    }

    #[test]
    fn a_spread_of_normals_widens_highlights() {
        assert!((widened(0.5, 1.0) - 0.5).abs() < 1e-6);
        assert!(widened(0.5, 0.95) > 0.55 && widened(0.9, 0.1) <= 1.0);
    }
}
