//! A plane with the maps of a fabric, in the light that yarns are drawn in.
//!
//! In: the maps of a side and a [`Light`]. Out: a picture of cloth that faces the viewer, as any
//! renderer of surfaces would draw it: each texel reflects sun and sky by its own normal and
//! material, and its occlusion dims both.
//!
//! The maps lie in a plane, so nothing casts a shadow. What reaches a texel of the sun follows from
//! the share of the sky that it sees, to the power of [`SUN_EXPONENT`]. Renderers that dim only the
//! sky show cloth up to 30 % lighter than its yarns are. Cost: linear in the texels, and in the pixels. Not promised: the
//! picture of the yarns themselves, whose relief hides and shades.

use glam::{DVec2, DVec3, Vec3, Vec4};
use image::{Rgba, RgbaImage};
use rayon::prelude::*;

use super::{FabricMaps, Side, SideMaps};
use crate::cpu::lit::{SkyLight, sun_reflection};
use crate::light::Rig;
use crate::shade::Surface;
use crate::sheen::Sheen;
use crate::{Background, Camera, Light, tone};
use warpknit_core::number::{double, narrow, whole_f64};

/// Exponent of the sky's share that stands for the sun's. Our sun stands higher than the mean of the
/// sky, so less of it is hidden. Fitted to the mean light of the yarns on both sides of eight fabrics:
/// with 0.7 it is within 9 %. With 0 it is up to 32 % too much, with 1 up to 11 % too little.
const SUN_EXPONENT: f32 = 0.7;

/// A plane of endless cloth that faces the viewer.
#[derive(Debug)]
pub struct MappedPlane {
    /// Light that each texel reflects times its cover, and its cover in w.
    texels: Vec<Vec4>,
    /// Width and height of the maps, texels.
    size: [usize; 2],
    /// Width and height of a texel, mm.
    texel: DVec2,
}

impl MappedPlane {
    /// A side of a fabric in this light.
    #[must_use]
    pub fn new(maps: &FabricMaps, side: Side, light: &Light) -> Self {
        let own = maps.side(side);
        // From far away all of the cloth is seen along one direction.
        let rig = light.around(&Camera::look_at(DVec3::Z, DVec3::ZERO, 1.0, 1.0));
        let pixels = maps.pixels();
        let size = pixels.map(|side| side as usize);
        let texels =
            (0..size[0] * size[1]).into_par_iter().map(|at| lit_texel(own, at, &rig)).collect();
        Self { texels, size, texel: maps.size / DVec2::from(pixels.map(f64::from)) }
    }

    /// A picture of `pixels` pixels of `pixel` mm each, of the cloth from the lower left corner of a
    /// repeat on.
    #[must_use]
    pub fn picture(
        &self,
        [width, height]: [u32; 2],
        pixel: f64,
        background: Background,
    ) -> RgbaImage {
        let rows: Vec<Vec<[u8; 4]>> = (0..height)
            .into_par_iter()
            .map(|y| {
                let low = f64::from(height - 1 - y) * pixel;
                let row = (0..width).map(|x| DVec2::new(f64::from(x) * pixel, low));
                row.map(|corner| tone::pixel(self.mean(corner, pixel), Vec4::ZERO, 1.0, background))
                    .collect()
            })
            .collect();
        RgbaImage::from_fn(width, height, |x, y| Rgba(rows[y as usize][x as usize]))
    }

    /// Mean of the texels over a square of `side` mm with this lower left corner.
    fn mean(&self, corner: DVec2, side: f64) -> Vec4 {
        let [(columns, across), (rows, up)] = [0, 1].map(|axis| {
            let (first, end) =
                (corner[axis] / self.texel[axis], (corner[axis] + side) / self.texel[axis]);
            overlaps(first, end, self.size[axis])
        });
        let sum = rows.iter().zip(&up).fold(Vec4::ZERO, |sum, (&row, &tall)| {
            // Row 0 is the upper one.
            let row = (self.size[1] - 1 - row) * self.size[0];
            let in_row = columns.iter().zip(&across);
            sum + in_row.map(|(&column, &wide)| self.texels[row + column] * wide).sum::<Vec4>()
                * tall
        });
        sum / (across.iter().sum::<f32>() * up.iter().sum::<f32>()).max(f32::MIN_POSITIVE)
    }
}

/// The texels of a line of `count`, which repeats, between two places in texels, and how much of each
/// lies there.
fn overlaps(first: f64, end: f64, count: usize) -> (Vec<usize>, Vec<f32>) {
    let from = first.floor();
    let texels = whole_f64((end.ceil() - from).max(1.0));
    (0..texels)
        .map(|step| {
            let low = from + double(step);
            let at = whole_f64(low.rem_euclid(double(count))).min(count - 1);
            (at, narrow((end.min(low + 1.0) - first.max(low)).max(0.0)))
        })
        .unzip()
}

/// Light that a texel reflects to the viewer times its cover, and its cover.
fn lit_texel(maps: &SideMaps, at: usize, rig: &Rig) -> Vec4 {
    let share = |picture: &image::GrayImage| f32::from(picture.as_raw()[at]) / 255.0;
    let three = |picture: &image::RgbImage| {
        Vec3::from_array([0, 1, 2].map(|axis| f32::from(picture.as_raw()[3 * at + axis]) / 255.0))
    };
    let code = three(&maps.base_color);
    let normal = (three(&maps.normal) * 2.0 - 1.0).normalize_or(Vec3::Z);
    let surface = Surface {
        normal,
        albedo: Vec3::from_array(code.to_array().map(tone::linear)),
        roughness: share(&maps.roughness),
        metallic: share(&maps.metallic),
        sheen: Sheen::NONE,
    };
    let open = share(&maps.occlusion);
    // The sky is brightest in one direction; the mean over a hemisphere follows the normal two
    // thirds as much as a single direction does.
    let sky = rig.sky(normal * (2.0 / 3.0));
    let gaps = rig.gap_light(open, normal.dot(rig.toward_sun)) * surface.albedo;
    let light = sky * open + gaps * (1.0 - open);
    let reflected = SkyLight { light, open }.reflected(rig, &surface, Vec3::Z)
        + sun_reflection(rig, &surface, rig.toward_sun, Vec3::Z) * open.powf(SUN_EXPONENT);
    (reflected * share(&maps.alpha)).extend(share(&maps.alpha))
}
