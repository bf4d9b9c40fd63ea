//! Tiles of a picture: each is drawn at once, so that textures stay small.
//!
//! In: the picture's size, and how finely its yarns must be drawn. Out: [`PictureTile`]s with their uniforms.
//! Each has a margin of one pixel, so that the filter at its border has the texels of the next tile. Cost:
//! a tile's textures, and a plan of its yarns.

use glam::{Mat4, Vec2};

use super::data::ViewUniform;
use super::device::Gpu;
use super::frame::FrameSetup;
use crate::RenderOptions;

/// Largest side of a tile on a card, texels. With four samples, its light and depths take 235 MB.
/// Smaller tiles need more passes.
const CARD_TEXELS: u32 = 2048;
/// Largest side of a tile in software, texels. It takes 60 MB.
const SOFTWARE_TEXELS: u32 = 1024;
/// Limit of supersampling, texels a pixel each way.
const MAX_SUPERSAMPLING: u32 = 8;

/// A part of a picture that is drawn at once.
#[derive(Clone, Copy, Debug)]
pub(super) struct PictureTile {
    /// Its first pixel.
    pub(super) corner: [u32; 2],
    /// Pixels.
    pub(super) size: [u32; 2],
    /// Texels a pixel each way.
    pub(super) scale: u32,
}

impl PictureTile {
    /// Texels, with one more pixel on every side, because the reconstruction filter reaches into the
    /// next tiles.
    pub(super) fn texels(self) -> [u32; 2] {
        self.size.map(|pixels| (pixels + 2) * self.scale)
    }

    /// Uniforms of this tile.
    pub(super) fn view(self, frame: &FrameSetup, options: &RenderOptions) -> ViewUniform {
        let scale = self.scale as f32;
        let corner = Vec2::from(self.corner.map(|pixels| pixels as f32)) - 1.0;
        let [tile_width, tile_height] = self.texels().map(|texels| texels as f32);
        let part = crop(options, corner, Vec2::new(tile_width, tile_height) / scale);
        ViewUniform {
            clip_from_world: part * frame.camera.clip_from_world,
            tile_width,
            tile_height,
            corner_x: corner.x * scale,
            corner_y: corner.y * scale,
            depth_scale: frame.view.depth_scale / scale,
            ..frame.view
        }
    }
}

/// The tiles of a picture, row by row, of at most so many texels a side with their margin. These are at
/// least three pixels.
pub(super) fn tiles(
    options: &RenderOptions,
    scale: u32,
    texels: u32,
) -> impl Iterator<Item = PictureTile> {
    let side = texels / scale - 2;
    let (width, height) = (options.width, options.height);
    let corners = (0..height)
        .step_by(side as usize)
        .flat_map(move |y| (0..width).step_by(side as usize).map(move |x| [x, y]));
    corners.map(move |corner| {
        let size = [side.min(width - corner[0]), side.min(height - corner[1])];
        PictureTile { corner, size, scale }
    })
}

/// Largest side of a tile on a device, texels.
pub(super) fn most_texels(gpu: &Gpu) -> u32 {
    let texels = if gpu.is_software { SOFTWARE_TEXELS } else { CARD_TEXELS };
    texels.min(gpu.device.limits().max_texture_dimension_2d)
}

/// Texels a pixel each way: for the samples that are wanted beyond those of multisampling, and with
/// multisampling for yarns that are thinner than pixels and need so many.
pub(super) fn scale(needed: u32, options: &RenderOptions) -> u32 {
    let wanted = (options.spp / options.samples.max(1)).isqrt();
    let needed = if options.samples > 1 { needed } else { 1 };
    wanted.max(needed).clamp(1, MAX_SUPERSAMPLING)
}

/// Matrix that enlarges the picture to what its tiles show of the yarns: a pixel more on every side.
pub(super) fn with_margin(options: &RenderOptions) -> Mat4 {
    let whole = Vec2::new(options.width as f32, options.height as f32);
    crop(options, Vec2::NEG_ONE, whole + 2.0)
}

/// Matrix that enlarges a part of the picture to all of clip space: `size` pixels from `corner` on.
fn crop(options: &RenderOptions, corner: Vec2, size: Vec2) -> Mat4 {
    let whole = Vec2::new(options.width as f32, options.height as f32);
    let scale = whole / size;
    // The part's centre in clip coordinates, y up.
    let middle = ((corner + size / 2.0) / whole * 2.0 - 1.0) * Vec2::new(1.0, -1.0);
    Mat4::from_translation((-middle * scale).extend(0.0)) * Mat4::from_scale(scale.extend(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_each_pixel_once_and_fit_their_textures() {
        for (width, height, scale, texels) in
            [(70, 33, 1, 18), (70, 33, 2, 36), (5, 7, 8, 1024), (1, 1, 1, 3)]
        {
            let options = RenderOptions { width, height, ..RenderOptions::default() };
            let mut drawn = vec![0; (width * height) as usize];
            for tile in tiles(&options, scale, texels) {
                assert!(tile.texels().iter().all(|&side| side <= texels), "{tile:?}");
                let [x, y] = tile.corner;
                for row in y..y + tile.size[1] {
                    let start = (row * width + x) as usize;
                    let pixels = &mut drawn[start..start + tile.size[0] as usize];
                    pixels.iter_mut().for_each(|count| *count += 1);
                }
            }
            assert!(drawn.iter().all(|&count| count == 1), "{width} x {height}");
        }
    }

    #[test]
    fn thin_yarns_and_wanted_samples_need_texels() {
        let options = |samples, spp| RenderOptions { samples, spp, ..RenderOptions::default() };
        for (needed, samples, spp, expected) in
            [(1, 4, 4, 1), (3, 4, 4, 3), (3, 1, 1, 1), (1, 4, 64, 4), (99, 4, 4, 8), (1, 1, 9, 3)]
        {
            let found = scale(needed, &options(samples, spp));
            assert_eq!(found, expected, "{needed} {samples} {spp}");
        }
    }
}
