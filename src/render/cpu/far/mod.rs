//! Yarns thinner than pixels: each piece is brought to the few samples that it covers, instead of a
//! tree of millions of pieces to each ray.
//!
//! In: a scene of tubes, a camera, a light. Out: [`Splatter`], which adds the light of a pixel's samples
//! to a film. Depths in the picture say what a sample sees, a map of depths from the sun what is
//! lit, and the nearest layer's mean depth around a sample how much of the sky it sees, as on the
//! graphics processor (`shaders/cloth.wgsl`). Cost: pieces and samples each once, some hundred ns,
//! and pieces again for each [`VisibilityBuffer::max_rows`] of a large picture.

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
use crate::render::light::Rig;
use crate::render::shade::Surface;
use crate::render::sheen::Sheen;
use crate::render::{Camera, RenderOptions, ply};
use crate::scene::{Bounds, Scene, Shape};
use layers::LayerDepths;
use nearest::VisibilityBuffer;
use pieces::SplatPieces;
use screen::Screen;
use sun::ShadowMap;

/// Longest piece over its distance from the eye: along a longer one perspective would bend what is
/// taken for straight.
const MAX_PIECE_ANGLE: f32 = 0.05;
/// Rows beside those that are looked at whose depths count for the sky of these.
const SKY_MARGIN_ROWS: u32 = 4;

/// All that a pixel's colour depends on.
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

/// What is seen in some rows of the picture.
struct VisibleRows {
    rows: Range<u32>,
    buffer: VisibilityBuffer,
    layers: LayerDepths,
}

impl<'a> Splatter<'a> {
    /// Makes ready to look at `scene`, which lies within `bounds`, if it is one of tubes and all of
    /// it far enough from whatever side, so that a turntable's pictures are all of one kind.
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

    /// Finds what is seen in some rows, and in as many after them as memory allows. Only these have
    /// colours then.
    pub(super) fn prepare_rows(&mut self, rows: &Range<u32>) {
        if self
            .visible
            .as_ref()
            .is_some_and(|visible| visible.rows.start <= rows.start && rows.end <= visible.rows.end)
        {
            return;
        }
        // What was seen before goes first, since both may not fit.
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

    /// Adds the samples of a pixel to its row.
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

    /// The light from the piece of yarn that starts at data point `first` to a place in the
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
        // Across the yarn and the way to the eye, and what of the yarn faces the eye.
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
                // The pixel is wider than the yarn and sees it from edge to edge; what is hidden
                // behind is not much different.
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

    /// The sun's light toward the eye from the side of a yarn that looks `outward`. The sheen is
    /// that of all the width that is seen, in the sun where the brightest of it is: other samples
    /// of the pixel would find it on the average, but with more noise.
    fn sun_light(
        &self,
        surface: &Surface,
        outward: Vec3,
        axis: Vec3,
        radius: f32,
        toward_sun: Vec3,
        toward_eye: Vec3,
    ) -> Vec3 {
        let reaches =
            |outward: Vec3| self.shadows.is_lit(axis + outward * radius, radius, toward_sun);
        let mut light = Vec3::ZERO;
        if outward.dot(toward_sun) > 0.0 && reaches(outward) {
            light = surface.base_brdf(toward_sun, toward_eye)
                * self.rig.sun()
                * surface.normal.dot(toward_sun).max(0.0);
        }
        let sheen = &surface.sheen;
        if sheen.share > 0.0 && reaches(sheen.highlight_normal(toward_sun, toward_eye)) {
            light += surface.sheen_color()
                * self.rig.sun()
                * sheen.mean_over_width(toward_sun, toward_eye);
        }
        light
    }

    /// What a place sees above it, of which yarns leave some share open.
    fn sky_light(&self, surface: &Surface, open: f32) -> SkyLight {
        // The mean of a gradient over cosine-weighted directions is the gradient two thirds of the
        // way to the normal.
        let above = self.rig.sky(surface.normal * (2.0 / 3.0));
        // What stops a ray is as often a piece of the same yarn as one of any other.
        let interior = self.rig.interior * surface.albedo.midpoint(self.albedo);
        SkyLight { light: above * open + interior * (1.0 - open), open }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::View;
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
        ribbons.normals.resize(ribbons.positions.len(), crate::unit::PackedUnit::new(Vec3::Z));
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
