//! Geometry of a frame: the camera's and the sun's projections, and the sizes of the depth maps.
//!
//! In: a camera, a light, and the chunks of yarn in view. Out: [`FrameSetup`], matrices, sizes and
//! the light between neighbouring yarns for all passes, relative to the scene's centre. The sun's
//! map covers only what the camera sees, so that a close-up has fine shadows (as light-space
//! perspective methods aim for, here by a tight bounding box).

use bytemuck::Zeroable;
use glam::{Mat4, Vec2, Vec3, Vec4};

use super::Yarns;
use super::data;
use super::lod::{Chunks, Frustum};
use super::pages::{ChunkBounds, Page};
use super::tiles;
use crate::cpu::patches::NearLight;
use crate::light::GAP_LIGHT;
use crate::scene::Shape;
use crate::shade::LAYER_RADII;
use crate::{Camera, RenderOptions};

/// Limit of the sun's map, texels a side: 256 MiB with both of its filtered copies.
const MAX_SUN_TEXELS: f32 = 2048.0;
/// Size of a texel of the sun's map, radii of the thinnest yarn, where the picture can show it.
/// With larger texels, neighbouring yarns merge in the map.
const SUN_TEXEL_RADII: f32 = 0.2;
/// Lower limit of that size, in pixels of the picture. Finer texels than the picture can show cost
/// time only.
const SUN_TEXEL_PIXELS: f32 = 0.35;
/// Standard deviation of the shadow filter, radii of the thinnest yarn. With less, shadow edges
/// alias; with more, shadows of single yarns vanish.
const PENUMBRA_RADII: f32 = 0.2;
/// Depth bias of the sun's map, radii of the thinnest yarn. Without it, yarns shadow themselves;
/// with a large one, contact shadows vanish.
const SUN_BIAS_RADII: f32 = 0.1;
/// Standard deviation of the filter of the eye's depth map, radii of the thinnest yarn. Of 3, 5 and
/// 8, 3 predicted best how much sky the rays of the CPU renderer see: root mean square errors of
/// 0.127, 0.132 and 0.139 by the mean depth alone.
const DEPTH_RADII: f32 = 3.0;
/// Limit of the eye's depth map, texels a side.
const MAX_DEPTH_TEXELS: f32 = 2048.0;
/// Standard deviation of that filter in texels, which sets the map's resolution. With fewer, the
/// Gaussian is badly sampled.
const DEPTH_TEXELS: f32 = 2.5;
/// Texels of a picture across the thinnest yarn. With fewer, cloth at true gauge has noise. More take
/// longer and show nothing more.
const TEXELS_A_YARN: f32 = 1.0;
/// Sizes of a pixel, radii of the thickest yarn, between which means take the place of what depth maps
/// say of neighbouring yarns. In smaller pixels the maps are right, in larger ones they are noise.
const FAR_PIXELS: [f32; 2] = [2.5, 6.0];
/// Squares across and down in which the nearest depths are known.
const SQUARES: usize = 64;
/// How much deeper than the nearest chunk of its square a place may be and still belong to the same
/// layer, as a fraction of the depth: as cloth that is seen at 70 degrees is in a square.
const LAYER_DEPTH: f32 = 0.03;
/// The near and far planes lie this factor beyond the yarns, against rounding.
const PLANE_MARGIN: f32 = 1.001;

/// A map of filtered depths.
#[derive(Clone, Copy, Debug)]
pub(super) struct DepthMap {
    pub(super) frustum: Frustum,
    /// Width and height, texels.
    pub(super) size: [u32; 2],
    /// Standard deviation of the filter, texels.
    pub(super) sigma: f32,
    pub(super) near: f32,
    pub(super) far: f32,
    /// Thickness of the nearest layer, mm, if only that layer is averaged.
    pub(super) layer: Option<f32>,
}

/// Geometry of all passes of a frame.
#[derive(Clone, Debug)]
pub(super) struct FrameSetup {
    pub(super) camera: Frustum,
    /// The chunks that the picture's tiles may show.
    pub(super) visible: Chunks,
    pub(super) sun: DepthMap,
    /// Depths around the eye.
    pub(super) depth: DepthMap,
    /// Uniforms that all tiles share.
    pub(super) view: data::ViewUniform,
    /// Texels a pixel each way with which the thinnest yarn is wide enough.
    pub(super) scale: u32,
}

/// Smallest and largest distance of the yarns along a direction, from a point.
fn range(pages: &[Page], along: Vec3, from: f32) -> [f32; 2] {
    let chunk_bounds = pages.iter().flat_map(|page| &page.chunk_bounds);
    chunk_bounds.fold([f32::INFINITY, f32::NEG_INFINITY], |[near, far], bounds| {
        let depth = bounds.centre.dot(along) - from;
        [near.min(depth - bounds.reach), far.max(depth + bounds.reach)]
    })
}

impl FrameSetup {
    /// Computes the geometry of a frame. `None` if the camera sees no yarn.
    pub(super) fn new(yarns: &Yarns, camera: &Camera, options: &RenderOptions) -> Option<Self> {
        let Yarns { ref pages, centre, thinnest, .. } = *yarns;
        let eye = (camera.eye() - centre).as_vec3();
        let ahead = -camera.to_world(Vec3::Z);
        let [near, far] = range(pages, ahead, eye.dot(ahead));
        // All yarns lie behind the eye.
        if far <= 0.0 {
            return None;
        }
        // A depth buffer of 32 bits resolves a thousandth of the distance to the eye and everything
        // beyond. A smaller near plane would cost precision where the yarns are.
        let (near, far) = ((near / PLANE_MARGIN).max(far * 1e-3), far * PLANE_MARGIN);
        #[expect(clippy::cast_possible_truncation, reason = "a pixel's size")]
        let pixel = camera.pixel_size(1.0, options.height) as f32;
        let clip_from_world = camera.clip_from_world(centre, options.aspect(), near, far);
        let frustum = Frustum { clip_from_world, eye: eye.extend(1.0), pixel };
        let shown = tiles::with_margin(options) * clip_from_world;
        let chunks = Chunks::inside(pages, &Frustum { clip_from_world: shown, ..frustum });
        let in_picture = chunks.within(pages, &frustum);
        let visible = in_picture.bounds(pages);
        // The mean position of the visible chunks. The pixel's size there sets the resolution of
        // the maps.
        let count = visible.clone().count().max(1) as f32;
        let middle = visible.clone().map(|bounds| bounds.centre).sum::<Vec3>() / count;
        let pixel_there = pixel * (middle - eye).dot(ahead).max(near);
        let rig = options.light.around(camera);
        let sun = sun_map(pages, visible.clone(), rig.toward_sun, thinnest, pixel_there)?;
        let depth = depth_map(frustum, thinnest, pixel_there, near, far, options);
        let texel = sun.0.frustum.pixel;
        let (thinnest_yarn, thickest_yarn) = yarns.yarn_radii;
        let farness = farness(yarns.shape, pixel_there / thickest_yarn);
        let near_light =
            (farness > 0.0).then(|| near_light(yarns, visible, &frustum, camera, options));
        let NearLight { open, brightness, sunshine } = near_light.unwrap_or_default();
        let view = data::ViewUniform {
            clip_from_world,
            sun_from_world: sun.1,
            eye: frustum.eye,
            toward_sun: rig.toward_sun,
            pixel,
            sun: rig.light.sun,
            zenith: rig.zenith,
            sky_above: rig.light.sky_above,
            depth_scale: depth.size[0] as f32 / options.width.max(1) as f32,
            sky_below: rig.light.sky_below,
            on_cloth: rig.on_cloth * yarns.albedo * yarns.patches.gap_factors(&options.light),
            layer: LAYER_RADII * thinnest,
            sun_bias: (SUN_BIAS_RADII * thinnest).max(0.5 * texel),
            near_open: open.into(),
            near_brightness: brightness,
            near_sunshine: sunshine,
            farness,
            depth_texel: depth.frustum.pixel,
            depth_sigma: depth.sigma,
            gap_light: Vec2::new(GAP_LIGHT.hidden, GAP_LIGHT.open),
            gap_to_sun: GAP_LIGHT.to_sun,
            ..data::ViewUniform::zeroed()
        };
        let scale = texels(TEXELS_A_YARN * pixel_there / (2.0 * thinnest_yarn));
        Some(Self { camera: frustum, sun: sun.0, depth, view, scale, visible: chunks })
    }
}

/// How far depth maps are too coarse for single yarns, 0..1, for a pixel of so many radii. Ribbons have no
/// means that could take their place.
fn farness(shape: Shape, pixel: f32) -> f32 {
    let [near, far] = FAR_PIXELS;
    match shape {
        Shape::Tube if pixel.is_finite() => ((pixel - near) / (far - near)).clamp(0.0, 1.0),
        Shape::Tube | Shape::Ribbon => 0.0,
    }
}

/// What yarns leave visible to each other where the camera sees them.
fn near_light<'a>(
    yarns: &Yarns,
    visible: impl Iterator<Item = &'a ChunkBounds>,
    frustum: &Frustum,
    camera: &Camera,
    options: &RenderOptions,
) -> NearLight {
    let centre = yarns.centre.as_vec3();
    let nearest = NearestDepths::new(visible, frustum);
    yarns.patches.light(camera, options, |place| nearest.is_visible(place - centre))
}

/// The nearest depths of chunks in squares of the picture.
struct NearestDepths {
    clip_from_world: Mat4,
    squares: Vec<f32>,
}

impl NearestDepths {
    fn new<'a>(visible: impl Iterator<Item = &'a ChunkBounds>, frustum: &Frustum) -> Self {
        let mut nearest = Self {
            clip_from_world: frustum.clip_from_world,
            squares: vec![f32::INFINITY; SQUARES * SQUARES],
        };
        for bounds in visible {
            if let Some((square, depth)) = nearest.place(bounds.centre) {
                nearest.squares[square] = nearest.squares[square].min(depth);
            }
        }
        nearest
    }

    /// The square of a point in the picture, and its depth, mm.
    fn place(&self, point: Vec3) -> Option<(usize, f32)> {
        let clip = self.clip_from_world * point.extend(1.0);
        let at = (clip.truncate().truncate() / clip.w * 0.5 + 0.5) * SQUARES as f32;
        let is_inside = clip.w > 0.0 && at.cmpge(Vec2::ZERO).all();
        let [x, y] = at.as_uvec2().to_array().map(|index| index as usize);
        (is_inside && x < SQUARES && y < SQUARES).then_some((y * SQUARES + x, clip.w))
    }

    /// Whether no cloth lies far before a point.
    fn is_visible(&self, point: Vec3) -> bool {
        self.place(point)
            .is_some_and(|(square, depth)| depth <= self.squares[square] * (1.0 + LAYER_DEPTH))
    }
}

/// The sun's depth map over the visible chunks, and the matrix from world coordinates to its
/// texels.
fn sun_map<'a>(
    pages: &[Page],
    visible: impl Iterator<Item = &'a ChunkBounds>,
    toward_sun: Vec3,
    thinnest: f32,
    pixel: f32,
) -> Option<(DepthMap, Mat4)> {
    let (across, up) = toward_sun.any_orthonormal_pair();
    let (low, high) = visible.fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(low, high), bounds| {
        let at = Vec2::new(across.dot(bounds.centre), up.dot(bounds.centre));
        (low.min(at - bounds.reach), high.max(at + bounds.reach))
    });
    if low.x >= high.x {
        return None;
    }
    // All yarns may cast shadows into the view, not only the visible ones.
    let [near, far] = range(pages, -toward_sun, 0.0);
    let size_mm = high - low;
    // As fine as the yarns need, but no finer than the picture shows or the limit allows.
    let texel = (SUN_TEXEL_RADII * thinnest)
        .max(SUN_TEXEL_PIXELS * pixel)
        .max(size_mm.max_element() / MAX_SUN_TEXELS);
    let size = (size_mm / texel).ceil().max(Vec2::ONE);
    let size_mm = size * texel;
    let distance = -toward_sun;
    // Orthographic projection with the sun's rays along z.
    let clip_from_world = affine(
        (across * 2.0 / size_mm.x).extend(-1.0 - 2.0 * low.x / size_mm.x),
        (up * 2.0 / size_mm.y).extend(-1.0 - 2.0 * low.y / size_mm.y),
        (distance / (far - near)).extend(-near / (far - near)),
    );
    // Rows of texels count from the top. z stays in mm, because the moments are kept in mm.
    let texels_from_world = affine(
        (across / texel).extend(-low.x / texel),
        (-up / texel).extend((low.y + size_mm.y) / texel),
        distance.extend(0.0),
    );
    let frustum = Frustum { clip_from_world, eye: toward_sun.extend(0.0), pixel: texel };
    // At least 0.6 texels: a narrower Gaussian would alias on the texel grid.
    let sigma = (PENUMBRA_RADII * thinnest / texel).max(0.6);
    Some((
        DepthMap { frustum, size: size.as_uvec2().to_array(), sigma, near, far, layer: None },
        texels_from_world,
    ))
}

/// The depth map around the eye, as coarse as its filter allows.
fn depth_map(
    camera: Frustum,
    thinnest: f32,
    pixel: f32,
    near: f32,
    far: f32,
    options: &RenderOptions,
) -> DepthMap {
    let largest = options.width.max(options.height).max(1) as f32;
    // Not finer than the filter needs, than half of the picture, or than the limit.
    let scale =
        (DEPTH_TEXELS * pixel / (DEPTH_RADII * thinnest)).min(0.5).min(MAX_DEPTH_TEXELS / largest);
    let sigma = (DEPTH_RADII * thinnest * scale / pixel).max(0.6);
    let frustum = Frustum { pixel: camera.pixel / scale, ..camera };
    DepthMap {
        frustum,
        size: [options.width, options.height].map(|pixels| texels(pixels as f32 * scale)),
        sigma,
        near,
        far,
        layer: Some(LAYER_RADII * thinnest),
    }
}

/// A whole number of texels, at least one.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn texels(size: f32) -> u32 {
    (size.ceil() as u32).max(1)
}

/// An affine matrix by its upper three rows.
fn affine(x: Vec4, y: Vec4, z: Vec4) -> Mat4 {
    Mat4::from_cols(x, y, z, Vec4::W).transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_come_in_gradually_and_for_tubes_only() {
        let tubes = [0.0, 2.5, 4.25, 6.0, 1e9].map(|pixel| farness(Shape::Tube, pixel));
        assert_eq!(tubes, [0.0, 0.0, 0.5, 1.0, 1.0]);
        assert_eq!([farness(Shape::Ribbon, 9.0), farness(Shape::Tube, f32::INFINITY)], [0.0; 2]);
    }

    #[test]
    fn sizes_are_whole_texels() {
        assert_eq!([0.0, 1.0, 1.1, f32::INFINITY].map(texels), [1, 1, 2, u32::MAX]);
    }
}
