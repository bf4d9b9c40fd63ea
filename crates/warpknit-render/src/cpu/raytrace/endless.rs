//! Rays straight through endless cloth, for the maps of one repeat.
//!
//! In: the [`YarnPaths`] of a repeat and its surroundings, and for each look the period of its yarn.
//! Out: [`PixelSums`]s: what the rays of a pixel meet, summed, without any light. Ambient occlusion is
//! the share of the sky that no yarn hides within [`SKY_REACH_RADII`], as in pictures.
//!
//! Plies and fibres repeat with the yarn. Its twist is closed beforehand (`fabric_maps/yarns.rs`).
//! The noise of its fibres has no period of its own: near the end of a repeat it fades into what
//! lies before the start. Yarns are tubes.

use std::f32::consts::TAU;

use glam::{DVec2, Vec3};

use super::ray::SceneRay;
use super::segments::Segments;
use super::trace::SegmentBvh;
use super::{ORIGIN_OFFSET, cosine_direction};
use crate::bvh::tree::Waiting;
use crate::cpu::lit::{ShadingPoint, textured_surface, yarn_sheen};
use crate::cpu::sample::{SampleDimension, Sampler};
use crate::cpu::{share, to_f32};
use crate::light::SKY_REACH_RADII;
use crate::paths::{YarnPaths, phase};
use crate::ply::{self, YarnPoint};
use crate::scene::{Scene, Shape, YarnLook};
use crate::shade::Surface;
use crate::sheen::Sheen;

/// Length over which the fibres at the end of a repeat fade into those at its start, radii: that of
/// two fibres. Over a shorter one a seam shows; over a longer one fibres look softer.
const FADE_RADII: f32 = 10.0;
/// Largest share of a repeat over which fibres fade.
const FADE_SHARE: f32 = 0.5;

/// A side of the cloth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The technical face, seen from +z with x to the right.
    Front,
    /// The technical back, seen from -z with x to the left.
    Back,
}

impl Side {
    /// A direction in the map's axes: right, up, toward the viewer.
    pub(crate) fn in_map_axes(self, direction: Vec3) -> Vec3 {
        match self {
            Self::Front => direction,
            // The back is turned about the upright axis.
            Self::Back => Vec3::new(-direction.x, direction.y, -direction.z),
        }
    }

    /// Both sides.
    pub const BOTH: [Self; 2] = [Self::Front, Self::Back];

    /// Its name: `front` or `back`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Front => "front",
            Self::Back => "back",
        }
    }

    /// Height toward the viewer of a place at depth z.
    pub(crate) fn height(self, z: f32) -> f32 {
        match self {
            Self::Front => z,
            Self::Back => -z,
        }
    }
}

/// One repeat of cloth, with all that its rays can meet.
pub(crate) struct EndlessCloth<'a> {
    bvh: SegmentBvh<'a>,
    /// Arc length of a repeat of each look's yarn, mm.
    periods: &'a [f32],
    /// Width and height of the repeat, mm; its lowest-left corner is the origin.
    cell: DVec2,
    /// Width and height of the map, pixels.
    size: [u32; 2],
}

/// What the rays of a pixel meet, summed over those that meet yarn.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PixelSums {
    /// Share of the rays that meet yarn.
    pub(crate) cover: f32,
    /// Sums over those rays, each divided by the number of all rays. Colours are linear.
    pub(crate) albedo: Vec3,
    pub(crate) normal: Vec3,
    /// Height, mm toward the viewer, counted from the middle of the cloth.
    pub(crate) height: f32,
    pub(crate) roughness: f32,
    pub(crate) metallic: f32,
    pub(crate) sheen: f32,
    /// Share of the sky that is seen.
    pub(crate) occlusion: f32,
}

impl<'a> EndlessCloth<'a> {
    /// Cloth of these yarns, of looks with these periods.
    pub(crate) fn new(
        scene: &'a Scene,
        paths: YarnPaths,
        periods: &'a [f32],
        cell: DVec2,
        size: [u32; 2],
    ) -> Self {
        Self { bvh: SegmentBvh::new(Segments::from_paths(scene, paths)), periods, cell, size }
    }

    /// Lowest and highest place of any yarn's surface, mm.
    pub(crate) fn depths(&self) -> [f32; 2] {
        let points = &self.bvh.segments.paths.points;
        let yarn = (0..).zip(points).filter(|(_, point)| point.w > 0.0);
        yarn.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], (start, point)| {
            let reach = point.w * self.bvh.segments.oval(start).reaches().z;
            [low.min(point.z - reach), high.max(point.z + reach)]
        })
    }

    /// What `rays` rays, a power of two, through pixel (x, y) of a side's map meet. Row 0 is the upper
    /// one.
    pub(crate) fn texel(&self, [x, y]: [u32; 2], side: Side, rays: u32) -> PixelSums {
        let sampler = Sampler::new(x, y, side as u32);
        let mut waiting = Waiting::new();
        let mut sum = PixelSums::default();
        for index in 0..rays {
            let within = sampler.pair(SampleDimension::Pixel, index, rays);
            let ray = self.ray([x, y], within, side);
            let Some(hit) = self.bvh.nearest(&ray, &mut waiting) else { continue };
            let look = self.bvh.segments.look(hit.shape);
            let point = self.bvh.segments.point_on_tube(&ray, hit);
            let (surface, relief) = self.surface(look, &point, -ray.direction);
            let toward = cosine_direction(
                surface.normal,
                sampler.pair(SampleDimension::Sky, scattered(index, rays), rays),
            );
            let is_open = point.normal.dot(toward) > 0.0 && {
                let sky = self.sky_ray(&point, toward, look);
                self.bvh.occluder(&sky, hit.shape, &mut waiting).is_none()
            };
            sum.cover += 1.0;
            sum.albedo += surface.albedo;
            sum.normal += side.in_map_axes(surface.normal);
            sum.height += side.height(point.position.z);
            sum.roughness += surface.roughness;
            sum.metallic += surface.metallic;
            sum.sheen += surface.sheen.share;
            sum.occlusion += if is_open { relief } else { 0.0 };
        }
        sum.scaled(share(1, rays))
    }

    /// The ray into the cloth at a place within a pixel.
    fn ray(&self, [x, y]: [u32; 2], [right, down]: [f32; 2], side: Side) -> SceneRay {
        let [width, height] = self.size.map(f64::from);
        let across = (f64::from(x) + f64::from(right)) / width;
        let up = 1.0 - (f64::from(y) + f64::from(down)) / height;
        // The back is seen from behind, where x runs to the left.
        let place = match side {
            Side::Front => DVec2::new(across, up),
            Side::Back => DVec2::new(1.0 - across, up),
        } * self.cell;
        let bounds = &self.bvh.segments.bounds;
        let (from, direction) = match side {
            Side::Front => (bounds.max.z, Vec3::NEG_Z),
            Side::Back => (bounds.min.z, Vec3::Z),
        };
        let place = place - self.bvh.segments.paths.centre.truncate();
        let (reach, footprint) = (f32::INFINITY, self.pixel());
        let origin = place.as_vec2().extend(from);
        SceneRay { origin, direction, reach, footprint, random_bits: 0 }
    }

    /// The yarn's surface at a point, and how much of the sky its own relief lets through.
    fn surface(&self, look: u16, point: &ShadingPoint, toward_eye: Vec3) -> (Surface, f32) {
        let period = self.periods[usize::from(look)];
        let yarn = self.look(look);
        let along = point.along.rem_euclid(period);
        let (mut surface, relief) = match self.bvh.segments.scene.maps_of(yarn) {
            Some(maps) => {
                // As many whole pictures as fit, so that they meet at the repeat's end.
                let pictures = (period / maps.length).round().max(1.0);
                let along = along / period * pictures * maps.length;
                let footprint = [self.pixel() / (TAU * yarn.radius), self.pixel() / maps.length];
                textured_surface(maps, &ShadingPoint { along, ..*point }, footprint, Shape::Tube)
            }
            None => (self.untextured_surface(look, point, along, toward_eye), 1.0),
        };
        surface.normal = ply::face_eye(surface.normal, toward_eye);
        surface.sheen = yarn_sheen(yarn, point.tangent);
        (surface, relief)
    }

    /// The surface of a yarn without a texture, `along` mm after the start of its repeat.
    fn untextured_surface(
        &self,
        look: u16,
        point: &ShadingPoint,
        along: f32,
        toward_eye: Vec3,
    ) -> Surface {
        let (period, yarn) = (self.periods[usize::from(look)], self.look(look));
        let start = to_f32(phase(u32::from(look)));
        let here = YarnPoint {
            normal: point.normal,
            toward_eye,
            tangent: point.tangent,
            around: point.around,
            along: start + along,
            radius: yarn.radius,
            footprint: self.pixel(),
            plies: to_f32(f64::from(yarn.plies)),
            twist_slope: yarn.twist_slope,
        };
        let (mut normal, mut shade) = ply::detail(&here);
        let fade = (FADE_RADII * yarn.radius).min(FADE_SHARE * period);
        let faded = (along + fade - period) / fade;
        if faded > 0.0 {
            // What lies before the start continues at the start, which is where the next repeat
            // begins.
            let (before, its_shade) =
                ply::detail(&YarnPoint { along: here.along - period, ..here });
            normal = normal.lerp(before, faded).normalize_or(normal);
            shade += (its_shade - shade) * faded;
        }
        Surface {
            normal,
            albedo: yarn.albedo * shade,
            roughness: yarn.roughness,
            metallic: yarn.metallic,
            sheen: Sheen::NONE,
        }
    }

    /// The larger side of a pixel, mm.
    fn pixel(&self) -> f32 {
        let [width, height] = self.size.map(f64::from);
        to_f32((self.cell / DVec2::new(width, height)).max_element())
    }

    /// A ray from a point into the sky.
    fn sky_ray(&self, point: &ShadingPoint, direction: Vec3, look: u16) -> SceneRay {
        let radius = self.look(look).radius;
        SceneRay {
            origin: point.position + point.normal * (radius * ORIGIN_OFFSET),
            direction,
            reach: radius * SKY_REACH_RADII,
            footprint: self.pixel(),
            random_bits: 0,
        }
    }

    fn look(&self, look: u16) -> &YarnLook {
        &self.bvh.segments.scene.looks[usize::from(look)]
    }
}

/// The index of the sky direction that goes with place `index` of `count`, a power of two: its bits in
/// reverse. Places and directions come from one sequence. With one index, a place would always look
/// the same way, and more rays would not make occlusion any better.
fn scattered(index: u32, count: u32) -> u32 {
    index.reverse_bits().checked_shr(count.leading_zeros() + 1).unwrap_or(0)
}

impl PixelSums {
    /// All sums times a number.
    fn scaled(self, by: f32) -> Self {
        Self {
            cover: self.cover * by,
            albedo: self.albedo * by,
            normal: self.normal * by,
            height: self.height * by,
            roughness: self.roughness * by,
            metallic: self.metallic * by,
            sheen: self.sheen * by,
            occlusion: self.occlusion * by,
        }
    }
}
