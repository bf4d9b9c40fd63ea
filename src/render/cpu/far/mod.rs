//! Yarns thinner than pixels: each piece is brought to the few samples that it covers, instead of a tree of millions of pieces to each ray.
//!
//! In: a scene of tubes, a camera, a light. Out: [`Far`], which adds the light of a pixel's samples to a film. Depths in the picture say what a
//! sample sees, a map of depths from the sun what is lit, and the nearest layer's mean depth around a sample how much of the sky it
//! sees, as on the graphics processor (`shaders/cloth.wgsl`).

mod layers;
mod nearest;
mod outline;
mod pieces;
mod screen;
mod sun;

use glam::{Vec2, Vec3, Vec4};

use super::film::Splats;
use super::lit::{Sky, Spot, direct, mapped};
use super::sample::{Purpose, Sampler};
use super::{is_thin, narrow};
use crate::render::light::Rig;
use crate::render::shade::Surface;
use crate::render::{Camera, Options, ply};
use crate::scene::{Bounds, Scene, Shape};
use layers::Layers;
use nearest::Nearest;
use pieces::{Piece, Pieces};
use screen::Screen;
use sun::SunMap;

/// Most samples that are kept, 512 MB. Who wants more is better served by rays.
const MOST_SAMPLES: u64 = 1 << 25;

/// All that a pixel's colour depends on.
pub(super) struct Far<'a> {
    pieces: Pieces<'a>,
    screen: Screen,
    nearest: Nearest,
    layers: Layers,
    sun: SunMap,
    rig: Rig,
    options: &'a Options,
    /// Mean base colour of all yarns.
    albedo: Vec3,
}

impl<'a> Far<'a> {
    /// Makes ready to look at `scene`, which lies within `bounds`, if all of it is far enough, and the samples few enough.
    pub(super) fn new(scene: &'a Scene, bounds: &Bounds, camera: &Camera, options: &'a Options) -> Option<Self> {
        let samples = u64::from(options.width) * u64::from(options.height) * u64::from(options.spp.max(1));
        let centre = bounds.centre();
        let pieces = Pieces::new(scene, centre);
        let nearest = camera.eye().clamp(bounds.min.as_dvec3(), bounds.max.as_dvec3()).distance(camera.eye());
        let pixel = narrow(camera.pixel_size(nearest, options.height));
        if !options.lod || scene.shape != Shape::Tube || samples > MOST_SAMPLES || !is_thin(pixel, pieces.thickest()) {
            return None;
        }
        let (screen, rig) = (Screen::new(bounds, camera, options), options.light.around(camera));
        let nearest = Nearest::new(&pieces, &screen, options);
        let layers = Layers::of(&nearest, scene.thinnest());
        let sun = SunMap::new(&pieces, &screen, pixel, rig.toward_sun);
        Some(Self { pieces, screen, nearest, layers, sun, rig, options, albedo: scene.mean_albedo() })
    }

    /// Adds the samples of a pixel to its row.
    pub(super) fn pixel(&self, [x, y]: [u32; 2], splats: &mut Splats) {
        let sampler = Sampler::new(x, y, self.options.seed);
        let spp = self.options.spp.max(1);
        let suns = sampler.pairs(Purpose::Sun, spp);
        for index in 0..spp {
            let (place, piece) = self.nearest.seen([x, y], index);
            let light = piece.and_then(|piece| self.light(place, piece, suns.at(index)));
            let light = light.map_or(Vec4::ZERO, |light| if light.is_finite() { light.extend(1.0) } else { Vec4::W });
            splats.add(x, (place - Vec2::new(x as f32, y as f32)).to_array(), light);
        }
    }

    /// The light from the piece of yarn that starts at data point `first` to a place in the picture.
    fn light(&self, place: Vec2, first: u32, sun: [f32; 2]) -> Option<Vec3> {
        let strand = self.pieces.strand_of(first);
        let piece = self.pieces.piece(strand, first)?;
        let scene = self.pieces.scene;
        let look = &scene.looks[usize::from(scene.strands[strand].look)];
        let (share, aside) = self.screen.within(&piece, place)?;
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
                let spot = Spot { position, normal: outward, tangent, top: outward.cross(tangent), around: 0.0, along };
                mapped(maps, &spot, look.radius, footprint, Shape::Tube)
            }
            None => {
                let albedo = look.albedo * ply::mean_shade(look.plies);
                (Surface { normal: outward, albedo, roughness: look.roughness, metallic: look.metallic }, 1.0)
            }
        };
        surface.normal = ply::facing(surface.normal, toward_eye);
        let toward_sun = self.rig.sun_sample(sun);
        let in_sun = outward.dot(toward_sun) > 0.0 && self.sun.reaches(position, piece.radius, toward_sun);
        let from_sun = if in_sun { direct(&self.rig, &surface, toward_sun, toward_eye) } else { Vec3::ZERO };
        let sky = self.sky(&piece, place, position, &surface, outward.dot(toward_eye));
        Some(from_sun + sky.reflected(&self.rig, &surface, toward_eye) * occlusion)
    }

    /// What a place sees above it; `cosine` is that of its round surface with the direction to the eye.
    fn sky(&self, piece: &Piece, place: Vec2, position: Vec3, surface: &Surface, cosine: f32) -> Sky {
        let open = self.layers.open_sky(place, piece.radius, self.screen.depth(position), cosine);
        // The mean of a gradient over cosine-weighted directions is the gradient two thirds of the way to the normal.
        let above = self.rig.sky(surface.normal * (2.0 / 3.0));
        // What stops a ray is as often a piece of the same yarn as one of any other.
        let interior = self.rig.interior * surface.albedo.midpoint(self.albedo);
        Sky { light: above * open + interior * (1.0 - open), open }
    }
}
