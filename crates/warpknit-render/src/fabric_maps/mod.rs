//! One repeat of a fabric as maps: what a renderer of surfaces takes in place of yarns.
//!
//! In: a fabric, its [`Pattern`] and the looks of its yarns. Out: [`FabricMaps`]: for each side of the
//! cloth base colour, normal, height, alpha, roughness, metallic, occlusion and sheen. They repeat
//! without a seam, because they are drawn from endless cloth.
//!
//! Method: parallel rays straight through the cloth, [`RAYS`] a pixel, and the mean of what they meet
//! (a box filter). No light is involved. Occlusion is the share of the sky that a point sees between
//! other yarns (ambient occlusion). Where a pixel shows surfaces of several directions, its normal
//! is their mean, and its roughness grows by their spread, so that highlights stay as wide as those
//! of the yarns (Tokuyoshi and Kaplanyan 2019, 'Improved geometric specular antialiasing'). Pixels
//! without yarn have alpha 0, a normal that points at the viewer, and else the mean of their
//! neighbours, so that no rim shows when a renderer interpolates.
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

pub use crate::cpu::endless::Side;
use crate::cpu::endless::{EndlessCloth, Texel};
use crate::scene::Scene;
pub use plane::MappedPlane;
use warpknit_core::fabric::Fabric;
use warpknit_core::knit::Pattern;
use warpknit_core::number::whole_f64;
use yarns::{RepeatScene, RepeatYarn, repeat_size, repeat_yarns};

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
    /// Draws one repeat of a fabric, near `dpi` pixels per inch: a repeat has whole pixels, so that the
    /// maps tile. `bars` has the look of each bar and no yarns. `progress` gets the share that is done,
    /// from any thread.
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
        Self::of_yarns(&yarns, size, pixels, bars, progress)
    }

    /// Draws a repeat of `size` mm of these yarns.
    fn of_yarns(
        yarns: &[RepeatYarn],
        size: DVec2,
        pixels: [u32; 2],
        bars: &Scene,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Self, FabricMapsError> {
        let pixel = (size / DVec2::from(pixels.map(f64::from))).min_element();
        let RepeatScene { scene, paths, periods } = RepeatScene::new(yarns, size, bars, pixel)?;
        let cloth = EndlessCloth::new(&scene, paths, &periods, size, pixels);
        let depths = cloth.depths();
        let [front, back] = [(Side::Front, 0.0), (Side::Back, 0.5)].map(|(side, before)| {
            let texels = texels(&cloth, side, pixels, &|done| progress(before + done / 2.0));
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
    progress: &(dyn Fn(f64) + Sync),
) -> Vec<Texel> {
    let rows = AtomicU32::new(0);
    (0..height)
        .into_par_iter()
        .flat_map_iter(|y| {
            let done = rows.fetch_add(1, Ordering::Relaxed);
            progress(f64::from(done) / f64::from(height));
            (0..width).map(move |x| cloth.texel([x, y], side, RAYS))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloth;
    use warpknit_core::fabric::builtin;
    use warpknit_core::knit::numbers;

    /// Values of a pixel as numbers, the normal of yarn among them.
    fn values(maps: &SideMaps, x: u32, y: u32) -> [f64; 9] {
        let cover = f64::from(maps.alpha.get_pixel(x, y).0[0]) / 255.0;
        let [r, g, b] = maps.base_color.get_pixel(x, y).0;
        let [nx, ny, nz] = maps.normal.get_pixel(x, y).0;
        let height = f64::from(maps.height.get_pixel(x, y).0[0]) / 257.0;
        let greys = [&maps.roughness, &maps.occlusion].map(|map| map.get_pixel(x, y).0[0]);
        let bytes = [r, g, b, nx, ny, nz, greys[0], greys[1]].map(|byte| cover * f64::from(byte));
        let mut all = [255.0 * cover + height; 9];
        all[..8].copy_from_slice(&bytes);
        all
    }

    /// Sums of squared differences over a column of pixels and the one to its right, and over a row
    /// and the one below it.
    fn energies(maps: &SideMaps, [column, row]: [u32; 2]) -> [f64; 2] {
        let (width, height) = maps.alpha.dimensions();
        let apart = |a: [u32; 2], b: [u32; 2]| -> f64 {
            let (a, b) = (values(maps, a[0], a[1]), values(maps, b[0], b[1]));
            a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum()
        };
        let next = |at: u32, count: u32| (at + 1) % count;
        [
            (0..height).map(|y| apart([column, y], [next(column, width), y])).sum(),
            (0..width).map(|x| apart([x, row], [x, next(row, height)])).sum(),
        ]
    }

    /// The maps of a fabric some hundred pixels wide, and the same begun elsewhere: `moved` pixels to
    /// the right and up.
    fn begun_at(fabric: &Fabric, moved: [u32; 2]) -> FabricMaps {
        let size = repeat_size(fabric);
        let pixels = FabricMaps::pixels_at(fabric, 60.0 * INCH / size.min_element()).unwrap();
        let bars = Scene { looks: cloth::looks(fabric, fabric.radius()), ..Scene::default() };
        let mut yarns = repeat_yarns(fabric, &Pattern::new(fabric));
        let way = DVec2::from(moved.map(f64::from)) * size / DVec2::from(pixels.map(f64::from));
        for point in yarns.iter_mut().flat_map(|yarn| &mut yarn.points) {
            *point -= way.extend(0.0);
        }
        FabricMaps::of_yarns(&yarns, size, pixels, &bars, &|_| ()).unwrap()
    }

    /// At the seam the maps change as much as at the same place of cloth that begins elsewhere, where
    /// there is no seam.
    #[test]
    fn no_built_in_fabric_has_a_seam() {
        let mut all = [[0.0_f64; 2]; 2];
        for name in builtin::names() {
            let fabric = Fabric::named(name).unwrap();
            let maps = begun_at(&fabric, [0, 0]);
            let [width, height] = maps.pixels();
            let moved = [width / 2, height / 2];
            let elsewhere = begun_at(&fabric, moved);
            let place = [width - 1 - moved[0], moved[1] - 1];
            for side in Side::BOTH {
                let seam = energies(maps.side(side), [width - 1, height - 1]);
                // The back runs to the left.
                let column = if side == Side::Front { place[0] } else { moved[0] - 1 };
                let inside = energies(elsewhere.side(side), [column, place[1]]);
                for axis in 0..2 {
                    let ratio = seam[axis] / inside[axis];
                    assert!((ratio - 1.0).abs() < 0.2, "{name} {side:?} axis {axis}: {ratio:.3}");
                    all[0][axis] += seam[axis].sqrt();
                    all[1][axis] += inside[axis].sqrt();
                }
            }
        }
        for axis in 0..2 {
            let ratio = all[0][axis] / all[1][axis];
            assert!((ratio - 1.0).abs() < 0.05, "axis {axis}: {ratio:.4}");
        }
    }

    #[test]
    fn alpha_is_the_cover_of_the_yarns() {
        for name in ["tricot", "locknit", "hex-net-5", "marquisette", "jersey", "weft-inserted"] {
            let fabric = Fabric::named(name).unwrap();
            let cover = numbers::measure(&fabric, &Pattern::new(&fabric)).cover;
            let maps = begun_at(&fabric, [0, 0]);
            for side in Side::BOTH {
                let alpha = maps.side(side).alpha.as_raw();
                let mean =
                    alpha.iter().copied().map(f64::from).sum::<f64>() / 255.0 / alpha.len() as f64;
                assert!((mean - cover).abs() < 0.01, "{name} {side:?}: {mean} {cover}");
            }
        }
    }

    #[test]
    fn sizes_out_of_range_are_refused_and_say_what_to_do() {
        let fabric = Fabric::named("locknit").unwrap();
        let message = |dpi| FabricMaps::pixels_at(&fabric, dpi).unwrap_err().to_string();
        assert!(message(100.0).contains("raise --dpi to 297"), "{}", message(100.0));
        assert!(FabricMaps::pixels_at(&fabric, 297.0).is_ok());
        assert!(message(1e6).contains("lower --dpi"), "{}", message(1e6));
        assert!(message(1e300).contains("lower --dpi"));
    }
}
