//! Splatting of yarns thinner than pixels. Each piece of yarn is rasterised into the few samples
//! that it covers, instead of each ray searching a tree of millions of pieces.
//!
//! In: a scene of tubes, a camera, a light. Out: [`Splatter`], which adds the light of a pixel's
//! samples to the film. A visibility buffer stores which piece each sample sees (Burns and Hunt
//! 2013, 'The visibility buffer'). A shadow map decides what the sun lights (Williams 1978,
//! 'Casting curved shadows on curved surfaces'). The mean depth of the nearest layer around a
//! sample gives the visibility of the sky, as in the GPU renderer (`shaders/cloth.wgsl`).
//!
//! Cost: some hundred ns for each piece and for each sample. A large picture is done in parts of
//! [`VisibilityBuffer::max_rows`] rows, and each part goes through all pieces again.
//!
//! Not promised: the exact outlines of the ray tracer. Bends between data points are straight here.

mod layers;
mod nearest;
mod outline;
mod pieces;
mod screen;
mod sun;

use std::ops::Range;

use glam::{Vec2, Vec3, Vec4};

use super::film::Splats;
use super::lit::{self, ShadingPoint, SkyLight, opaque_sample, textured_surface};
use super::sample::{SampleDimension, Sampler};
use super::{is_thin, rows_to_sample, to_f32};
use crate::light::Rig;
use crate::scene::{Bounds, Scene, Shape};
use crate::shade::Surface;
use crate::sheen::Sheen;
use crate::{Camera, RenderOptions, ply};
use layers::LayerDepths;
use nearest::VisibilityBuffer;
use pieces::SplatPieces;
use screen::Screen;
use sun::ShadowMap;

/// Largest length of a piece over its distance from the eye. A piece is interpolated linearly in
/// the picture. Along a longer one, perspective would make that wrong, and yarns are traced
/// instead.
const MAX_PIECE_ANGLE: f32 = 0.05;
/// Extra rows above and below the prepared ones, whose depths count for the sky of these. It must
/// cover the reach of [`LayerDepths::sky_visibility`], two squares of pixels; otherwise parts of a
/// picture would show seams.
const SKY_MARGIN_ROWS: u32 = 4;

/// Everything that a pixel's colour depends on.
pub(super) struct Splatter<'a> {
    pieces: SplatPieces<'a>,
    screen: Screen,
    shadows: ShadowMap,
    rig: Rig,
    options: &'a RenderOptions,
    /// Mean base colour of all yarns.
    albedo: Vec3,
    visible: Option<VisibleRows>,
}

/// The visible pieces in some rows of the picture.
struct VisibleRows {
    rows: Range<u32>,
    buffer: VisibilityBuffer,
    layers: LayerDepths,
}

impl<'a> Splatter<'a> {
    /// Prepares a scene that lies within `bounds`, if splatting suits it: tubes only, and all of
    /// them far enough away. 'Far enough' is decided by the bounding sphere and not by the view, so
    /// that all pictures of a turntable use the same method.
    pub(super) fn new(
        scene: &'a Scene,
        bounds: &Bounds,
        camera: &Camera,
        options: &'a RenderOptions,
    ) -> Option<Self> {
        let centre = bounds.centre();
        let nearest = camera.eye().distance(centre.as_dvec3())
            - f64::from(bounds.min.distance(bounds.max)) / 2.0;
        let pixel = to_f32(camera.pixel_size(nearest, options.height));
        let (_, thickest) = scene.radii();
        if !options.lod || scene.shape != Shape::Tube || !is_thin(pixel, thickest) {
            return None;
        }
        let pieces = SplatPieces::new(scene, centre);
        if pieces.longest() > MAX_PIECE_ANGLE * to_f32(nearest) || !pieces.are_in_order() {
            return None;
        }
        let (screen, rig) = (Screen::new(bounds, camera, options), options.light.around(camera));
        let shadows = ShadowMap::new(&pieces, &screen, pixel, rig.toward_sun);
        Some(Self {
            pieces,
            screen,
            shadows,
            rig,
            options,
            albedo: scene.mean_albedo(),
            visible: None,
        })
    }

    /// Finds the visible pieces of some rows, and of as many rows after them as memory allows. Only
    /// these rows have samples then.
    pub(super) fn prepare_rows(&mut self, rows: &Range<u32>) {
        if self
            .visible
            .as_ref()
            .is_some_and(|visible| visible.rows.start <= rows.start && rows.end <= visible.rows.end)
        {
            return;
        }
        // Free the old buffer first, because both may not fit into memory.
        self.visible = None;
        let height = self.options.height;
        let end = rows.end.max(
            rows_to_sample(self.options)
                .end
                .min(rows.start.saturating_add(VisibilityBuffer::max_rows(self.options))),
        );
        let around = rows.start.saturating_sub(SKY_MARGIN_ROWS)..height.min(end + SKY_MARGIN_ROWS);
        let buffer = VisibilityBuffer::new(&self.pieces, &self.screen, self.options, around);
        let layers = LayerDepths::new(&buffer, self.pieces.scene.radii().0);
        self.visible = Some(VisibleRows { rows: rows.start..end, buffer, layers });
    }

    /// Adds the samples of one pixel to its film row.
    pub(super) fn pixel(&self, [x, y]: [u32; 2], splats: &mut Splats) {
        let Some(visible) = &self.visible else { return };
        let sampler = Sampler::new(x, y, self.options.seed);
        let spp = self.options.spp.max(1);
        let suns = sampler.pairs(SampleDimension::Sun, spp);
        for index in 0..spp {
            let (place, piece) = visible.buffer.sample([x, y], index);
            let light =
                piece.and_then(|piece| self.light(&visible.layers, place, piece, suns.at(index)));
            let light = light.map_or(Vec4::ZERO, opaque_sample);
            splats.add(x, (place - Vec2::new(x as f32, y as f32)).to_array(), light);
        }
    }

    /// Light from the piece that starts at data point `first`, toward the eye, at a place in the
    /// picture.
    fn light(&self, layers: &LayerDepths, place: Vec2, first: u32, sun: [f32; 2]) -> Option<Vec3> {
        let strand = self.pieces.strand_of(first);
        let piece = self.pieces.piece(strand, first)?;
        let scene = self.pieces.scene;
        let look = &scene.looks[usize::from(scene.strands[strand].look)];
        let (share, aside) = self.screen.locate(&piece, place)?;
        let axis = piece.ends[0].lerp(piece.ends[1], share);
        let toward_eye = (self.screen.eye - axis).normalize();
        let tangent = self.pieces.tangent(strand, first, share);
        // A tangent frame for the visible half of the tube: `width` across the yarn and the
        // direction to the eye, `front` across the yarn toward the eye. `side` runs from -1 to 1
        // between the outlines.
        let width = tangent.cross(toward_eye).normalize_or(self.screen.right);
        let front = width.cross(tangent);
        let side = aside.dot(width).clamp(-1.0, 1.0);
        let outward = width * side + front * (1.0 - side * side).sqrt();
        let position = axis + outward * piece.radius;
        let footprint = self.screen.pixel_at(axis);
        let (mut surface, occlusion) = match scene.maps_of(look) {
            Some(maps) => {
                let along = self.pieces.along(strand, first, share);
                let point = ShadingPoint {
                    position,
                    normal: outward,
                    tangent,
                    top: outward.cross(tangent),
                    around: 0.0,
                    along,
                };
                // The pixel is wider than the yarn, so the texture is averaged over the yarn's full
                // height. That includes the hidden half, whose mean differs little.
                textured_surface(maps, &point, [1.0, footprint / maps.length], Shape::Tube)
            }
            None => {
                let albedo = look.albedo * ply::mean_shade(look.plies);
                let (roughness, metallic) = (look.roughness, look.metallic);
                (Surface { normal: outward, albedo, roughness, metallic, sheen: Sheen::NONE }, 1.0)
            }
        };
        surface.normal = ply::face_eye(surface.normal, toward_eye);
        surface.sheen = lit::yarn_sheen(look, tangent);
        let from_sun = self.sun_light(
            &surface,
            outward,
            axis,
            piece.radius,
            self.rig.sun_sample(sun),
            toward_eye,
        );
        let cosine = outward.dot(toward_eye);
        let open = layers.sky_visibility(place, piece.radius, self.screen.depth(position), cosine);
        Some(
            from_sun
                + self.sky_light(&surface, open).reflected(&self.rig, &surface, toward_eye)
                    * occlusion,
        )
    }

    /// The sun's light reflected toward the eye from the side of a yarn that faces `outward`. The
    /// sheen is the mean over the visible width, and its shadow is looked up at the brightest line.
    /// Samples of a pixel would give the same mean, but with more noise.
    fn sun_light(
        &self,
        surface: &Surface,
        outward: Vec3,
        axis: Vec3,
        radius: f32,
        toward_sun: Vec3,
        toward_eye: Vec3,
    ) -> Vec3 {
        let mut light = Vec3::ZERO;
        if outward.dot(toward_sun) > 0.0
            && self.shadows.is_lit(axis + outward * radius, radius, toward_sun)
        {
            light = surface.base_brdf(toward_sun, toward_eye)
                * self.rig.sun()
                * surface.normal.dot(toward_sun).max(0.0);
        }
        let sheen = &surface.sheen;
        if sheen.share > 0.0 {
            // The shadow of the brightest line stands for that of the whole highlight.
            let brightest = axis + sheen.highlight_normal(toward_sun, toward_eye) * radius;
            if self.shadows.is_lit(brightest, radius, toward_sun) {
                light += surface.sheen_color()
                    * self.rig.sun()
                    * sheen.mean_over_width(toward_sun, toward_eye);
            }
        }
        light
    }

    /// The sky's light at a point where yarns leave the fraction `open` of the sky visible.
    fn sky_light(&self, surface: &Surface, open: f32) -> SkyLight {
        // The sky is linear in the direction's height. So its cosine-weighted mean over the
        // hemisphere is its value two thirds of the way from the horizontal to the normal.
        let above = self.rig.sky(surface.normal * (2.0 / 3.0));
        // An occluder is about as often the same yarn as another one.
        let interior = self.rig.interior * surface.albedo.midpoint(self.albedo);
        SkyLight { light: above * open + interior * (1.0 - open), open }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::View;
    use crate::scene::YarnLook;
    use glam::DVec3;

    /// Ten straight yarns a millimetre apart, of two looks in turn.
    pub(super) fn mat() -> Scene {
        let look = |albedo: f32| YarnLook::plain(Vec3::splat(albedo), 0.7, 0.1);
        let mut scene = Scene { looks: vec![look(0.5), look(0.2)], ..Scene::default() };
        for line in 0_u8..10 {
            scene.push_strand(
                (0_u8..=20).map(|i| Vec3::new(f32::from(i) * 0.5, f32::from(line), 0.0)),
                u16::from(line % 2),
            );
        }
        scene
    }

    /// Whether a scene is drawn and not traced.
    fn is_splatted(scene: &Scene, options: &RenderOptions) -> bool {
        let camera = Camera::view(View::Front, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
        Splatter::new(scene, &scene.bounds().unwrap(), &camera, options).is_some()
    }

    #[test]
    fn tubes_thinner_than_pixels_are_drawn_and_nothing_else() {
        let far = RenderOptions { width: 30, height: 30, ..RenderOptions::default() };
        assert!(is_splatted(&mat(), &far));
        assert!(!is_splatted(&mat(), &RenderOptions { lod: false, ..far.clone() }));
        assert!(!is_splatted(&mat(), &RenderOptions { width: 300, height: 300, ..far.clone() }));
        let mut ribbons = Scene { shape: Shape::Ribbon, ..mat() };
        ribbons
            .normals
            .resize(ribbons.positions.len(), crate::octahedral::PackedUnit::new(Vec3::Z));
        assert!(!is_splatted(&ribbons, &far));
        let mut long = mat();
        long.push_strand([Vec3::ZERO, Vec3::X * 9.0], 0);
        assert!(!is_splatted(&long, &far), "perspective along its piece");
        let mut crossed = mat();
        crossed.strands.swap(2, 5);
        assert!(!is_splatted(&crossed, &far), "strands are looked up by their order");
        let (scene, inside) =
            (mat(), Camera::look_at(DVec3::new(5.0, 5.0, 0.0), DVec3::ZERO, 0.5, 1.0));
        assert!(Splatter::new(&scene, &scene.bounds().unwrap(), &inside, &far).is_none());
    }

    #[test]
    fn rows_looked_at_apart_are_as_those_looked_at_together() {
        let (scene, options) =
            (mat(), RenderOptions { width: 30, height: 30, spp: 5, ..RenderOptions::default() });
        let camera = Camera::view(View::Iso, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
        let pixels = |parts: &[Range<u32>]| {
            let mut far =
                Splatter::new(&scene, &scene.bounds().unwrap(), &camera, &options).unwrap();
            let mut rows = Vec::new();
            for part in parts {
                // As if memory held no more rows.
                far.visible = None;
                far.prepare_rows(part);
                for y in part.clone() {
                    let mut splats = [(); 3].map(|()| Splats::new(30));
                    (0..30).for_each(|x| far.pixel([x, y], &mut splats[1]));
                    rows.push((0..30).map(|x| Splats::pixel(&splats, x)).collect::<Vec<_>>());
                }
            }
            rows
        };
        let whole = pixels(std::slice::from_ref(&(0..30)));
        assert!(
            whole.iter().flatten().any(|light| light.w > 0.0)
                && whole.iter().flatten().any(|light| light.w == 0.0)
        );
        assert_eq!(pixels(&[0..8, 8..9, 9..30]), whole);
    }
}
