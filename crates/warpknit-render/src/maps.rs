//! Textures of a yarn: base colour, normals, roughness, metal and occlusion, each with its mip
//! levels.
//!
//! In: pictures of one repeat of the yarn, x along it and y across it. Out: [`Maps`], which both
//! renderers sample: the GPU in hardware, the CPU by [`Maps::sample`].
//!
//! Lookups repeat along the yarn. Not promised: a seamless repeat. The picture's ends must match by
//! themselves.

use glam::{Vec3, Vec4, Vec4Swizzles};
use image::RgbaImage;

use super::mips::{MIN_WEIGHT, MapKind, Mips, decode, float};
use crate::shape::Shape;

/// Limit of anisotropic filtering: lookups along the longer side of a pixel's footprint on the
/// yarn. Footprints that are longer still are blurred across the yarn too. Each lookup costs the
/// same; hardware commonly allows 16.
const MAX_TAPS: f32 = 8.0;

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

/// The four texels around a place, in pictures of one size, and the place between them.
struct Cell {
    columns: [u32; 2],
    rows: [u32; 2],
    /// Fractions of the way to the right and down.
    x: f32,
    y: f32,
}

impl Cell {
    /// Columns wrap around along the yarn. Rows wrap around a tube and are clamped at a ribbon's edges.
    fn around(at: TexCoord, (width, height): (u32, u32)) -> Self {
        let (left, x) = before(at.v - floor(at.v), width);
        let (top, y) = before(at.u, height);
        let columns = [left, left + 1].map(|column| wrapped(column, width));
        let rows = [top, top + 1].map(|row| match at.shape {
            Shape::Tube => wrapped(row, height),
            Shape::Ribbon => clamped(row, height),
        });
        Self { columns, rows, x, y }
    }

    /// Bilinear interpolation between the texels of a picture.
    fn mean(&self, picture: &RgbaImage, kind: MapKind) -> Vec4 {
        let Self { columns: [left, right], rows: [upper, lower], x, y } = *self;
        let [a, b, c, d] = [(left, upper), (right, upper), (left, lower), (right, lower)]
            .map(|(column, row)| decode(*picture.get_pixel(column, row), kind));
        a.lerp(b, x).lerp(c.lerp(d, x), y)
    }
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
                let cell = Cell::around(at, self.base.levels[level].dimensions());
                base += cell.mean(&self.base.levels[level], MapKind::Color) * weight;
                normal += cell.mean(&self.normal.levels[level], MapKind::Normal) * weight;
                surface += cell.mean(&self.surface.levels[level], MapKind::Plain) * weight;
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
    /// 2024), and covers with its own alpha. `filter` is of the place's footprint; `random` gives numbers
    /// in 0..1, without 1.
    pub(crate) fn covers(
        &self,
        [u, v]: [f32; 2],
        filter: &Filter,
        shape: Shape,
        mut random: impl FnMut() -> f32,
    ) -> bool {
        let tap = if filter.taps > 1 { truncated(random() * float(filter.taps)) } else { 0 };
        let is_coarse = filter.share > 0.0 && random() < filter.share;
        let picture = &self.base.levels[filter.fine + usize::from(is_coarse)];
        let cell = Cell::around(filter.place([u, v], tap, shape), picture.dimensions());
        let (is_right, is_lower) = (random() < cell.x, random() < cell.y);
        let (column, row) = (cell.columns[usize::from(is_right)], cell.rows[usize::from(is_lower)]);
        f32::from(picture.get_pixel(column, row).0[3]) / 255.0 > random()
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
    pub(crate) fn filter(&self, footprint: [f32; 2]) -> Filter {
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
#[derive(Clone, Copy)]
pub(crate) struct Filter {
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
    use image::Rgba;

    use super::*;

    /// Grey stripes across the yarn, half of the rows transparent.
    fn stripes(width: u32, height: u32) -> RgbaImage {
        RgbaImage::from_fn(width, height, |x, y| {
            let grey = if x % 2 == 0 { 255 } else { 0 };
            Rgba([grey, 40, 200, if y < height / 2 { 255 } else { 0 }])
        })
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
                let (tries, filter) = (20_000_u16, maps.filter(footprint));
                let covered =
                    (0..tries).filter(|_| maps.covers(place, &filter, shape, &mut random));
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
