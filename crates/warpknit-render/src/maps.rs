//! Textures of a yarn: base colour, normals, roughness, metal and occlusion, each with its mip
//! levels.
//!
//! In: pictures of one repeat of the yarn, x along it and y across it. Out: [`Maps`], which both
//! renderers sample: the GPU in hardware, the CPU by [`Maps::sample`]. Mip levels (Williams 1983,
//! 'Pyramidal parametrics') are area means: of linear light and not of sRGB codes, of colours
//! weighted by alpha, of normals as vectors.
//!
//! Lookups repeat along the yarn. Not promised: a seamless repeat. The picture's ends must match by
//! themselves.

use std::sync::LazyLock;

use glam::{Vec3, Vec4, Vec4Swizzles};
use image::{Rgba, RgbaImage};
use rayon::prelude::*;

use super::tone;
use crate::shape::Shape;

/// Limit of anisotropic filtering: lookups along the longer side of a pixel's footprint on the
/// yarn. Footprints that are longer still are blurred across the yarn too. Each lookup costs the
/// same; hardware commonly allows 16.
const MAX_TAPS: f32 = 8.0;
/// Weight of a transparent texel in a mean of colours. With 0, a mip level without any yarn would
/// have no colour (0 / 0). Larger weights let the background's colour into the yarn's.
const MIN_WEIGHT: f32 = 1e-3;

/// A picture and its mip levels, each half the size of the one before, down to one pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mips {
    /// Level 0 is the picture itself, except for the colour of transparent texels.
    pub levels: Vec<RgbaImage>,
}

/// Textures of one yarn, all of one size.
#[derive(Clone, Debug, PartialEq)]
pub struct Maps {
    /// Base colour, sRGB, with straight alpha: the fuzz.
    pub base: Mips,
    /// Normal map in OpenGL's convention: x along the yarn, y toward the picture's top, z outward.
    pub normal: Mips,
    /// Red: ambient occlusion. Green: roughness. Blue: metal. This is glTF's packing.
    pub surface: Mips,
    /// Length of one repeat, mm.
    pub length: f32,
    /// Width of the picture across the yarn, fuzz included, mm.
    pub width: f32,
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

/// A yarn's surface at one place of its textures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texel {
    /// Base colour, linear RGB 0..1.
    pub albedo: Vec3,
    /// Fraction that yarn covers.
    pub alpha: f32,
    /// Unit normal: x along the yarn, y toward the picture's top, z outward.
    pub normal: Vec3,
    /// Perceived roughness 0..1.
    pub roughness: f32,
    /// 0 for fibres, 1 for metal.
    pub metallic: f32,
    /// Fraction of the ambient light that arrives.
    pub occlusion: f32,
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

    /// Bilinear interpolation between four texels of a level.
    fn bilinear(&self, level: usize, at: TexCoord, kind: MapKind) -> Vec4 {
        let Texels { texels, x, y } = self.cell(level, at);
        let [a, b, c, d] = texels.map(|texel| decode(*texel, kind));
        a.lerp(b, x).lerp(c.lerp(d, x), y)
    }

    /// The four texels of a level around a place. Columns wrap around along the yarn. Rows wrap around
    /// a tube and are clamped at a ribbon's edges.
    fn cell(&self, level: usize, at: TexCoord) -> Texels<'_> {
        let picture = &self.levels[level];
        let (width, height) = picture.dimensions();
        let (left, x) = before(at.v - floor(at.v), width);
        let (top, y) = before(at.u, height);
        let columns = [left, left + 1].map(|column| wrapped(column, width));
        let rows = [top, top + 1].map(|row| match at.shape {
            Shape::Tube => wrapped(row, height),
            Shape::Ribbon => clamped(row, height),
        });
        let texels =
            [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| picture.get_pixel(columns[i], rows[j]));
        Texels { texels, x, y }
    }
}

/// Four texels around a place, and the place between them.
struct Texels<'a> {
    /// The upper two, then the lower two.
    texels: [&'a Rgba<u8>; 4],
    /// Fractions of the way to the right and down.
    x: f32,
    y: f32,
}

/// Texture coordinates, 0..1 across (u) and along the yarn (v), and what they are wrapped around.
#[derive(Clone, Copy)]
struct TexCoord {
    u: f32,
    v: f32,
    shape: Shape,
}

impl Maps {
    /// Mean over about the rectangle of `footprint_u` by `footprint_v` around (u, v), all as
    /// fractions of the picture. u runs across the yarn from the picture's top, v along it. u wraps
    /// around a tube and ends at a ribbon's edges.
    #[must_use]
    pub fn sample(
        &self,
        u: f32,
        v: f32,
        footprint_u: f32,
        footprint_v: f32,
        shape: Shape,
    ) -> Texel {
        let filter = self.filter([footprint_u, footprint_v]);
        let [mut base, mut normal, mut surface] = [Vec4::ZERO; 3];
        for tap in 0..filter.taps {
            let at = filter.place([u, v], tap, shape);
            for (level, weight) in filter.levels() {
                let weight = weight / float(filter.taps);
                base += self.base.bilinear(level, at, MapKind::Color) * weight;
                normal += self.normal.bilinear(level, at, MapKind::Normal) * weight;
                surface += self.surface.bilinear(level, at, MapKind::Plain) * weight;
            }
        }
        let alpha = base.w.clamp(0.0, 1.0);
        Texel {
            albedo: base.xyz() / (base.w + MIN_WEIGHT),
            alpha,
            normal: normal.xyz().normalize_or(Vec3::Z),
            roughness: surface.y,
            metallic: surface.z,
            occlusion: surface.x,
        }
    }

    /// Whether yarn covers a place, at random with the probability of [`Self::sample`]'s alpha. One texel
    /// is taken, with its weight there as its probability ('stochastic texture filtering', Pharr et al.
    /// 2024), and covers with its own alpha. `random` gives numbers in 0..1, without 1.
    #[must_use]
    pub fn covers(
        &self,
        [u, v]: [f32; 2],
        footprint: [f32; 2],
        shape: Shape,
        mut random: impl FnMut() -> f32,
    ) -> bool {
        let filter = self.filter(footprint);
        let tap = if filter.taps > 1 { truncated(random() * float(filter.taps)) } else { 0 };
        let is_coarse = filter.share > 0.0 && random() < filter.share;
        let level = filter.fine + usize::from(is_coarse);
        let Texels { texels, x, y } = self.base.cell(level, filter.place([u, v], tap, shape));
        let (is_right, is_lower) = (random() < x, random() < y);
        let texel = texels[usize::from(is_right) + 2 * usize::from(is_lower)];
        f32::from(texel.0[3]) / 255.0 > random()
    }

    /// Mean colour of the yarn: that of the coarsest mip level.
    #[must_use]
    pub fn mean_albedo(&self) -> Vec3 {
        let mean = self
            .base
            .levels
            .last()
            .map_or(Vec4::ZERO, |level| decode(*level.get_pixel(0, 0), MapKind::Color));
        mean.xyz() / (mean.w + MIN_WEIGHT)
    }

    /// The lookups of a footprint's mean.
    fn filter(&self, footprint: [f32; 2]) -> Filter {
        let (width, height) = self.base.levels[0].dimensions();
        let (across, along) =
            (footprint[0].abs() * float(height), footprint[1].abs() * float(width));
        // Sides of the footprint in texels. One texel at least: magnification interpolates level 0.
        let (short, long) = (across.min(along).max(1.0), across.max(along).max(1.0));
        let taps = (long / short).ceil().clamp(1.0, MAX_TAPS);
        let top = float(u32::try_from(self.base.levels.len() - 1).unwrap_or(0));
        // The level whose texels are as large as the shorter side, or larger if the number of
        // lookups was limited.
        let level = (long / taps).max(short).log2().clamp(0.0, top);
        let longer = if across > along { [footprint[0], 0.0] } else { [0.0, footprint[1]] };
        Filter {
            taps: truncated(taps),
            longer,
            fine: whole(level),
            share: level - float(truncated(level)),
        }
    }
}

/// Anisotropic filtering (McCormack et al. 1999, 'Feline: fast elliptical lines for anisotropic
/// texture mapping'): several trilinear lookups along the footprint's longer side. Their mip level
/// suits the shorter side.
struct Filter {
    taps: u32,
    /// The longer side, in u and in v.
    longer: [f32; 2],
    fine: usize,
    /// Weight of the next coarser level.
    share: f32,
}

impl Filter {
    /// The place of a lookup.
    fn place(&self, [u, v]: [f32; 2], tap: u32, shape: Shape) -> TexCoord {
        let aside = (float(tap) + 0.5) / float(self.taps) - 0.5;
        TexCoord { u: u + aside * self.longer[0], v: v + aside * self.longer[1], shape }
    }

    /// Levels and their weights. The first level always counts. The second may not exist where its
    /// weight is 0.
    fn levels(&self) -> impl Iterator<Item = (usize, f32)> {
        let second = (self.share > 0.0).then_some((self.fine + 1, self.share));
        [(self.fine, 1.0 - self.share)].into_iter().chain(second)
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
fn decode(Rgba(bytes): Rgba<u8>, kind: MapKind) -> Vec4 {
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

/// The texel to the left of (or above) the place `share` of a side, and the fraction of the way to
/// the next texel.
fn before(share: f32, size: u32) -> (i64, f32) {
    // Texel centres lie at half-integers.
    let place = share * float(size) - 0.5;
    let first = floor(place);
    #[expect(clippy::cast_possible_truncation, reason = "it has no fraction")]
    (first as i64, place - first)
}

/// The largest whole number that isn't larger, of numbers up to 2^31. Without the instruction for it,
/// which not every processor has, `f32::floor` calls a function.
fn floor(number: f32) -> f32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        reason = "the whole part of an f32 is one"
    )]
    let whole = number as i32 as f32;
    if whole > number { whole - 1.0 } else { whole }
}

/// Index with repeat addressing.
fn wrapped(index: i64, size: u32) -> u32 {
    // Most lie within, and a division takes longer than all else here.
    match u32::try_from(index) {
        Ok(index) if index < size => index,
        _ => u32::try_from(index.rem_euclid(i64::from(size))).unwrap_or(0),
    }
}

/// Index with clamp-to-edge addressing.
fn clamped(index: i64, size: u32) -> u32 {
    u32::try_from(index.clamp(0, i64::from(size) - 1)).unwrap_or(0)
}

#[expect(clippy::cast_precision_loss, reason = "sides of pictures are far under 2^24")]
fn float(count: u32) -> f32 {
    count as f32
}

/// A small number from 0 up, without its fraction.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a small number from 0 up"
)]
fn truncated(number: f32) -> u32 {
    number as u32
}

/// The same as an index.
pub(crate) fn whole(number: f32) -> usize {
    truncated(number) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Grey stripes across the yarn, half of the rows transparent.
    fn stripes(width: u32, height: u32) -> RgbaImage {
        RgbaImage::from_fn(width, height, |x, y| {
            let grey = if x % 2 == 0 { 255 } else { 0 };
            Rgba([grey, 40, 200, if y < height / 2 { 255 } else { 0 }])
        })
    }

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

    fn maps(base: RgbaImage) -> Maps {
        let (width, height) = base.dimensions();
        let normal = RgbaImage::from_pixel(width, height, Rgba([128, 128, 255, 255]));
        let surface = RgbaImage::from_pixel(width, height, Rgba([255, 191, 0, 255]));
        Maps {
            base: Mips::new(base, MapKind::Color),
            normal: Mips::new(normal, MapKind::Normal),
            surface: Mips::new(surface, MapKind::Plain),
            length: 1.0,
            width: 1.0,
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
        let levels = Mips::new(stripes(4, 4), MapKind::Color).levels;
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

    #[test]
    fn a_place_is_covered_as_often_as_its_alpha_says() {
        let maps = maps(RgbaImage::from_fn(32, 16, |x, y| {
            Rgba([90, 90, 90, ((x * 37 + y * 91) % 256).to_le_bytes()[0]])
        }));
        let mut bits = 0_u32;
        let mut random = || {
            bits = bits.wrapping_add(1);
            crate::cpu::sample::unit(crate::ply::hash(bits))
        };
        for (place, footprint) in
            [([0.31, 0.47], [0.0, 0.0]), ([0.01, 0.99], [0.1, 0.03]), ([0.62, 0.20], [0.02, 0.3])]
        {
            for shape in [Shape::Tube, Shape::Ribbon] {
                let [u, v] = place;
                let alpha = maps.sample(u, v, footprint[0], footprint[1], shape).alpha;
                let tries = 20_000_u16;
                let covered =
                    (0..tries).filter(|_| maps.covers(place, footprint, shape, &mut random));
                let share = covered.count() as f32 / f32::from(tries);
                // Three standard deviations.
                assert!((share - alpha).abs() < 0.011, "{share} of {alpha}");
            }
        }
    }

    #[test]
    fn the_middles_of_texels_give_texels_and_far_looks_give_the_mean() {
        let maps = maps(stripes(8, 4));
        for column in 0..8_u8 {
            let texel =
                maps.sample(0.125, (f32::from(column) + 0.5) / 8.0, 0.0, 0.0, Shape::Ribbon);
            let red = if column % 2 == 0 { 1.0 } else { 0.0 };
            assert!(
                (texel.albedo.x - red).abs() < 1e-5 && (texel.alpha - 1.0).abs() < 1e-5,
                "{texel:?}"
            );
            assert!(
                (texel.roughness - 0.749).abs() < 1e-3
                    && texel.metallic == 0.0
                    && texel.normal.z > 0.999
            );
        }
        let far = maps.sample(0.3, 0.3, 50.0, 50.0, Shape::Tube);
        assert!((far.albedo.x - 0.5).abs() < 0.01 && (far.alpha - 0.5).abs() < 0.01);
        assert!(far.albedo.distance(maps.mean_albedo()) < 1e-5);
    }

    #[test]
    fn a_long_trace_is_averaged_along_itself_alone() {
        let maps = maps(stripes(16, 16));
        let along = maps.sample(0.25, 0.5, 1.0 / 16.0, 0.5, Shape::Ribbon);
        assert!((along.albedo.x - 0.5).abs() < 0.05 && along.alpha > 0.99, "{along:?}");
    }

    #[test]
    fn lookups_wrap_along_the_yarn_and_around_tubes_and_end_at_a_ribbons_edges() {
        let maps = maps(stripes(8, 4));
        let at = |u: f32, v: f32, shape| maps.sample(u, v, 0.0, 0.0, shape);
        for (u, v) in [(0.1, 0.0), (0.4, 0.97), (0.2, 0.51)] {
            assert!(
                (at(u, v, Shape::Ribbon).albedo - at(u, v + 3.0, Shape::Ribbon).albedo).length()
                    < 1e-4
            );
            assert!((at(u, v, Shape::Tube).alpha - at(u + 1.0, v, Shape::Tube).alpha).abs() < 1e-4);
        }
        assert!(
            (at(0.2, 0.0, Shape::Tube).albedo.x - 0.5).abs() < 1e-4,
            "halfway between the last column and the first"
        );
        assert!(
            (at(0.0, 0.3, Shape::Tube).alpha - 0.5).abs() < 1e-4,
            "halfway between the lowest row and the top one"
        );
        assert!(
            at(0.0, 0.3, Shape::Ribbon).alpha > 0.999 && at(1.0, 0.3, Shape::Ribbon).alpha < 0.001
        );
    }
}
