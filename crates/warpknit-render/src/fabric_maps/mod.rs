//! One repeat of a fabric as maps: what a renderer of surfaces takes in place of yarns.
//!
//! In: a fabric, its [`Pattern`] and the looks of its yarns. Out: [`FabricMaps`]: for each side of
//! the cloth base colour, normal, height, alpha, roughness, metallic, occlusion and sheen. They
//! repeat without a seam, because they are drawn from endless cloth.
//!
//! Method: parallel rays straight through the cloth, [`RAYS`] a pixel, and the mean of what they
//! meet (a box filter). No light is involved. Occlusion is the share of the sky that a point sees
//! between other yarns (ambient occlusion). Where a pixel shows surfaces of several directions, its
//! normal is their mean, and its roughness grows by their spread, so that highlights stay as wide
//! as those of the yarns (Tokuyoshi and Kaplanyan 2019, 'Improved geometric specular
//! antialiasing'). Pixels without yarn have alpha 0, a normal that points at the viewer, and else
//! the mean of their neighbours, so that no rim shows when a renderer interpolates.
//!
//! The bytes depend on the arguments alone. Cost: about 0.1 ms a pixel of a map. Not promised: the
//! look of cloth from near at a slant, where yarns hide each other. Yarns are round tubes.

mod closed_path;
mod pixels;
mod plane;
mod yarns;

use std::sync::atomic::{AtomicU32, Ordering};

use glam::DVec2;
use image::{GrayImage, ImageBuffer, Luma, RgbImage};
use rayon::prelude::*;

use crate::cloth::repeat_size;
pub use crate::cpu::endless::Side;
use crate::cpu::endless::{EndlessCloth, PixelSums};
use crate::scene::Scene;
pub use plane::MappedPlane;
use warpknit_core::fabric::Fabric;
use warpknit_core::knit::Pattern;
use warpknit_core::number::whole_f64;
use yarns::{RepeatScene, TiledYarn, repeat_yarns};

/// Rays of a pixel. With a quarter of them occlusion is grainy: its noise is 3 % with this number.
pub const RAYS: u32 = 64;
/// The fewest and the most pixels of a map along either side.
pub const SIDES: (u32, u32) = (8, 16_384);
/// The most pixels of a map.
pub const MOST_PIXELS: u64 = 16_000_000;
/// mm in an inch.
const INCH: f64 = 25.4;

/// Why a fabric can't be drawn as maps.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FabricMapsError {
    /// The map would be too large.
    #[error(
        "its repeat of {:.1} x {:.1} mm has {} x {} pixels at {dpi} dpi, over the limit of {} a side and \
         {MOST_PIXELS} in all: lower --dpi",
        size.x, size.y, pixels[0], pixels[1], SIDES.1
    )]
    TooLarge {
        /// Width and height of the repeat, mm.
        size: DVec2,
        /// Width and height that the map would have.
        pixels: [u64; 2],
        /// Pixels per inch.
        dpi: f64,
    },
    /// The map would be too small.
    #[error(
        "its repeat of {:.2} x {:.2} mm has {} x {} pixels at {dpi} dpi, and {} a side are needed: raise \
         --dpi to {least:.0}",
        size.x, size.y, pixels[0], pixels[1], SIDES.0
    )]
    TooSmall {
        /// Width and height of the repeat, mm.
        size: DVec2,
        /// Width and height that the map would have.
        pixels: [u64; 2],
        /// Pixels per inch.
        dpi: f64,
        /// The lowest dpi that will do.
        least: f64,
    },
    /// The repeat has more yarns than looks can be numbered.
    #[error("its repeat has {yarns} yarns, over the limit of {}", u16::MAX)]
    TooManyYarns {
        /// The number of yarns.
        yarns: usize,
    },
}

/// The maps of one side, all of one size. Row 0 is the upper one.
#[derive(Clone, Debug, PartialEq)]
pub struct SideMaps {
    /// Base colour, sRGB, of the yarns alone.
    pub base_color: RgbImage,
    /// Normals: x to the right, y up (OpenGL's convention), z toward the viewer, -1..1 stored as
    /// 0..255.
    pub normal: RgbImage,
    /// Height toward the viewer: 0 the farthest and 65535 the nearest surface of the cloth, which
    /// are [`FabricMaps::depth`] apart. 0 without yarn.
    pub height: ImageBuffer<Luma<u16>, Vec<u16>>,
    /// Share of the pixel that yarns cover.
    pub alpha: GrayImage,
    /// Perceived roughness.
    pub roughness: GrayImage,
    /// 0 for fibres, 255 for metal.
    pub metallic: GrayImage,
    /// Share of the sky that is seen between other yarns.
    pub occlusion: GrayImage,
    /// Share of light that fibres reflect like a mirror.
    pub sheen: GrayImage,
}

/// The maps of one repeat.
#[derive(Clone, Debug, PartialEq)]
pub struct FabricMaps {
    /// Width and height of the repeat, mm.
    pub size: DVec2,
    /// Distance from the lowest to the highest surface, mm.
    pub depth: f64,
    /// The technical face.
    pub front: SideMaps,
    /// The technical back.
    pub back: SideMaps,
}

impl FabricMaps {
    /// Draws one repeat of a fabric, near `dpi` pixels per inch: a repeat has whole pixels, so that
    /// the maps tile. `bars` has the look of each bar and no yarns. `progress` gets the share that
    /// is done, from any thread.
    ///
    /// # Errors
    /// [`FabricMapsError`], before the work.
    ///
    /// ```
    /// use warpknit_core::{fabric::Fabric, knit::Pattern};
    /// use warpknit_render::{cloth, fabric_maps::FabricMaps, scene::Scene};
    /// let fabric = Fabric::named("tricot")?;
    /// let bars = Scene { looks: cloth::looks(&fabric, fabric.radius()), ..Scene::default() };
    /// let maps = FabricMaps::draw(&fabric, &Pattern::new(&fabric), &bars, 600.0, &|_| ())?;
    /// // A wale and two courses.
    /// assert_eq!(maps.size.x, fabric.wale_spacing());
    /// assert!((maps.dpi()[0] / 600.0 - 1.0).abs() < 0.05);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn draw(
        fabric: &Fabric,
        pattern: &Pattern,
        bars: &Scene,
        dpi: f64,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Self, FabricMapsError> {
        let (size, pixels) = (repeat_size(fabric), Self::pixels_at(fabric, dpi)?);
        let yarns = repeat_yarns(fabric, pattern);
        Self::of_yarns(&yarns, size, pixels, bars, (RAYS, progress))
    }

    /// Draws a repeat of `size` mm of these yarns, by so many rays a pixel.
    fn of_yarns(
        yarns: &[TiledYarn],
        size: DVec2,
        pixels: [u32; 2],
        bars: &Scene,
        (rays, progress): (u32, &(dyn Fn(f64) + Sync)),
    ) -> Result<Self, FabricMapsError> {
        let pixel = (size / DVec2::from(pixels.map(f64::from))).min_element();
        let RepeatScene { scene, paths, periods } = RepeatScene::new(yarns, size, bars, pixel)?;
        let cloth = EndlessCloth::new(&scene, paths, &periods, size, pixels);
        let depths = cloth.depths();
        let [front, back] = [(Side::Front, 0.0), (Side::Back, 0.5)].map(|(side, before)| {
            let texels = texels(&cloth, side, pixels, rays, &|done| progress(before + done / 2.0));
            SideMaps::from_texels(texels, pixels, side, depths)
        });
        Ok(Self { size, depth: f64::from(depths[1] - depths[0]), front, back })
    }

    /// Width and height of the maps of a fabric near `dpi` pixels per inch: whole pixels a repeat.
    ///
    /// # Errors
    /// [`FabricMapsError::TooLarge`], [`FabricMapsError::TooSmall`].
    pub fn pixels_at(fabric: &Fabric, dpi: f64) -> Result<[u32; 2], FabricMapsError> {
        pixels_of(repeat_size(fabric), dpi)
    }

    /// The maps of a side.
    #[must_use]
    pub fn side(&self, side: Side) -> &SideMaps {
        match side {
            Side::Front => &self.front,
            Side::Back => &self.back,
        }
    }

    /// Width and height of the maps, pixels.
    #[must_use]
    pub fn pixels(&self) -> [u32; 2] {
        self.front.alpha.dimensions().into()
    }

    /// Pixels per inch across and up: those of whole pixels a repeat.
    #[must_use]
    pub fn dpi(&self) -> [f64; 2] {
        let [width, height] = self.pixels().map(f64::from);
        [width / self.size.x * INCH, height / self.size.y * INCH]
    }
}

/// Width and height of the map of a repeat of `size` mm, pixels: the nearest whole numbers.
fn pixels_of(size: DVec2, dpi: f64) -> Result<[u32; 2], FabricMapsError> {
    let pixels: [u64; 2] =
        (size / INCH * dpi).to_array().map(|pixels| whole_f64(pixels.round()) as u64);
    let (least, most) = SIDES;
    if pixels.iter().any(|&side| side > u64::from(most)) || pixels[0] * pixels[1] > MOST_PIXELS {
        return Err(FabricMapsError::TooLarge { size, pixels, dpi });
    }
    if pixels.iter().any(|&side| side < u64::from(least)) {
        let least = (f64::from(least) * INCH / size.min_element()).ceil();
        return Err(FabricMapsError::TooSmall { size, pixels, dpi, least });
    }
    Ok(pixels.map(|side| u32::try_from(side).expect("checked before")))
}

/// All texels of a side, row by row.
fn texels(
    cloth: &EndlessCloth<'_>,
    side: Side,
    [width, height]: [u32; 2],
    rays: u32,
    progress: &(dyn Fn(f64) + Sync),
) -> Vec<PixelSums> {
    let rows = AtomicU32::new(0);
    (0..height)
        .into_par_iter()
        .flat_map_iter(|y| {
            let done = rows.fetch_add(1, Ordering::Relaxed);
            progress(f64::from(done) / f64::from(height));
            (0..width).map(move |x| cloth.texel([x, y], side, rays))
        })
        .collect()
}

#[cfg(test)]
mod tests;
