//! Ray tracing. Each sample of a pixel casts one ray at the yarns. From the hit, one shadow ray
//! goes to the sun and a few short ones into the sky (ambient occlusion).
//!
//! In: a scene and a camera. Out: [`RayTracer`], which adds the light of a pixel's samples to the
//! film. A sky ray that is blocked returns the light of the yarn that blocks it: for tubes what that
//! side of it reflects (`bounce`), for ribbons the mean light of gaps between yarns
//! ([`Rig::gap_light`]) times its colour. Yarns are tubes or ribbons, textured or with procedural
//! plies.
//!
//! Not computed: light transmitted through fibres.

mod bounce;
mod capsule;
pub(crate) mod endless;
pub(super) mod facets;
mod ovals;
mod ray;
pub(super) mod rays;
mod segments;
mod sky;
mod strip;
mod trace;

use std::f32::consts::TAU;

use glam::{Vec3, Vec4};

use super::backdrop::Behind;
use super::film::Splats;
use super::lit::{self, ShadingPoint, SkyLight, opaque_sample, sun_reflection, textured_surface};
use super::sample::{SampleDimension, Sampler};
use super::splat::fit::LightSample;
use super::{is_thin, to_f32};
use crate::bvh::tree::{Hit, Waiting};
use crate::light::{Rig, SKY_REACH_RADII};
use crate::ply::{self, YarnPoint};
use crate::scene::{Bounds, Scene, Shape, YarnLook};
use crate::set::{Mesh, SKIN};
use crate::shade::Surface;
use crate::sheen::Sheen;
use crate::{Camera, RenderOptions};
use bounce::SideLights;
use ray::{CameraRays, SceneRay};
use segments::Segments;
use sky::{SkyBlock, SkyRays};
use trace::SegmentBvh;

/// Offset of secondary rays' origins above the surface, radii. Too small an offset lets a ray hit
/// its own surface by rounding ('shadow acne'). Too large a one leaks light at contacts between
/// yarns.
const ORIGIN_OFFSET: f32 = 0.02;

/// Everything that a pixel's colour depends on.
pub(super) struct RayTracer<'a> {
    bvh: SegmentBvh<'a>,
    eye: CameraRays<'a>,
    rig: Rig,
    /// The light that yarns reflect to each other, where it is traced.
    side_lights: Option<SideLights>,
}

/// Where the light of yarns comes from that hide the sky.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Bounces {
    /// From rays that start there.
    Traced,
    /// From the mean light of gaps.
    Mean,
}

/// A yarn's surface where a ray hits it.
struct SurfaceHit {
    /// First point of the segment that is hit.
    start: u32,
    /// The point, relative to the scene's centre.
    position: Vec3,
    /// Normal of the tube or of the fabric. The normal of `surface` is tilted by plies, fibres or a
    /// texture.
    smooth_normal: Vec3,
    surface: Surface,
    /// Fraction of the sky's light that the yarn's own relief lets through.
    occlusion: f32,
    radius: f32,
    toward_eye: Vec3,
    /// Size of a pixel there, mm.
    footprint: f32,
    random_bits: u32,
    /// Whether the yarn is thinner than a pixel and level of detail is allowed.
    thin: bool,
}

impl<'a> RayTracer<'a> {
    /// Prepares a scene that lies within `bounds`. Ribbons have the mean light of gaps.
    pub(super) fn new(
        scene: &'a Scene,
        bounds: &Bounds,
        camera: &'a Camera,
        options: &'a RenderOptions,
        bounces: Bounces,
    ) -> Self {
        let segments = Segments::new(scene, bounds, camera, options);
        let eye = CameraRays::new(camera, options, segments.paths.centre, segments.bounds);
        let is_traced = bounces == Bounces::Traced && scene.shape == Shape::Tube;
        let side_lights = is_traced.then(|| SideLights::new(&segments, &eye));
        let rig = options.light.around(camera);
        Self { bvh: SegmentBvh::new(segments), eye, rig, side_lights }
    }

    /// What a ray through a place of the picture meets, in pixels, and the light that arrives
    /// there.
    pub(super) fn light_sample(&self, [x, y]: [f32; 2]) -> Option<LightSample> {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rounded down")]
        let pixel = [x as u32, y as u32];
        let sampler = Sampler::new(pixel[0], pixel[1], self.eye.options.seed);
        let mut waiting = Waiting::new();
        let ray = self.eye.primary_ray(pixel, [x.fract(), y.fract()], sampler.random_bits(0))?;
        let mut here = self.surface_hit(&ray, self.bvh.nearest(&ray, &mut waiting)?);
        // Plies tilt the normal to all sides alike.
        here.surface.normal = here.smooth_normal;
        let sky = self.sky_rays(&here, &sampler, 0, &mut waiting);
        let sky = sky.means(&self.rig, here.surface.normal.dot(self.rig.toward_sun));
        let toward_sun = self.rig.toward_sun;
        let cosine = here.smooth_normal.dot(toward_sun);
        let in_sun = cosine > 0.0 && {
            let ray = here.secondary_ray(toward_sun, here.radius * SKY_REACH_RADII);
            self.bvh.occluder(&ray, here.start, &mut waiting).is_none()
        };
        Some(LightSample {
            position: here.position + self.bvh.segments.paths.centre.as_vec3(),
            normal: here.smooth_normal,
            cosine: here.smooth_normal.dot(here.toward_eye),
            radius: here.radius,
            open: sky.open,
            light: sky.visible.y,
            gap: sky.hidden,
            mean_gap: sky.mean_hidden,
            sun: if in_sun { cosine } else { 0.0 },
        })
    }

    /// Adds the samples of one pixel to its film row, before what is behind it.
    pub(super) fn pixel(&self, [x, y]: [u32; 2], behind: &Behind, splats: &mut Splats) {
        let spp = self.eye.options.spp.max(1);
        let sampler = Sampler::new(x, y, self.eye.options.seed);
        let (mut shared, mut waiting) = (None, Waiting::new());
        for index in 0..spp {
            let place = sampler.pair(SampleDimension::Pixel, index, spp);
            let ray = self.eye.primary_ray([x, y], place, sampler.random_bits(index));
            let light = ray.map_or(Vec4::ZERO, |mut ray| {
                ray.reach =
                    self.reach_to_body(&ray).min(self.reach_to_averaged(&ray, behind, place));
                self.sample(&ray, index, &sampler, &mut shared, &mut waiting)
            });
            splats.add(x, place, if light.w > 0.0 { light } else { behind.body_at(place) });
        }
    }

    /// The set's body.
    fn body(&self) -> Option<&Mesh> {
        self.eye.options.set.as_ref()?.body.as_ref()
    }

    /// A place of the scene in the world, where sets are.
    fn in_world(&self, place: Vec3) -> Vec3 {
        place + self.bvh.segments.paths.centre.as_vec3()
    }

    /// Distance along a primary ray up to which yarns are seen: to the body, and through its skin.
    /// It is negative where the body stands before the box that the ray starts from.
    fn reach_to_body(&self, ray: &SceneRay) -> f32 {
        let (eye, start) = (self.eye.camera.eye().as_vec3(), self.in_world(ray.origin));
        let reach = self.body().and_then(|body| body.reach_through_skin(eye, ray.direction));
        reach.map_or(f32::INFINITY, |reach| reach - start.distance(eye))
    }

    /// Distance along a primary ray up to which yarns are seen before averaged cloth.
    fn reach_to_averaged(&self, ray: &SceneRay, behind: &Behind, place: [f32; 2]) -> f32 {
        if self.eye.options.averaged.is_none() {
            return f32::INFINITY;
        }
        let ahead = self.eye.camera.to_world(Vec3::NEG_Z);
        let start = self.in_world(ray.origin).distance(self.eye.camera.eye().as_vec3());
        behind.reach_at(place) / ray.direction.dot(ahead) - start
    }

    /// Whether the body blocks a ray, beyond its skin.
    fn is_body_before(&self, ray: &SceneRay) -> bool {
        let from = self.in_world(ray.origin);
        self.body().is_some_and(|body| body.blocks(from, ray.direction, [SKIN, ray.reach]))
    }

    /// Light along a sample's ray, with w = 1 where it meets yarn and w = 0 where it does not.
    ///
    /// Where yarns are thinner than a pixel, two samples share one sky ray, by way of `shared`.
    /// Sharing it among four samples, and one sun ray between two, takes five sixths of the time.
    /// But then the cloth looks grainy, and its colour is off by 3 %.
    fn sample(
        &self,
        ray: &SceneRay,
        index: u32,
        sampler: &Sampler,
        shared: &mut Option<SkyLight>,
        waiting: &mut Waiting,
    ) -> Vec4 {
        let Some(hit) = self.bvh.nearest(ray, waiting) else { return Vec4::ZERO };
        let here = self.surface_hit(ray, hit);
        let sky = match shared.take() {
            Some(sky) if here.thin => sky,
            _ => *shared.insert(self.sky_light(&here, sampler, index, waiting)),
        };
        let light = self.sun_light(&here, sampler, index, waiting)
            + sky.reflected(&self.rig, &here.surface, here.toward_eye) * here.occlusion;
        opaque_sample(light)
    }

    /// The surface at a hit: geometry, then texture or plies, then sheen.
    fn surface_hit(&self, ray: &SceneRay, hit: Hit) -> SurfaceHit {
        let scene = self.bvh.segments.scene;
        let point = match scene.shape {
            Shape::Tube => self.bvh.segments.point_on_tube(ray, hit),
            Shape::Ribbon => self.point_on_ribbon(ray, hit),
        };
        let toward_eye = -ray.direction;
        let footprint = self.eye.pixel_at(point.position);
        let look = &scene.looks[usize::from(self.bvh.segments.look(hit.shape))];
        let (mut surface, occlusion) = match scene.maps_of(look) {
            Some(maps) => {
                let girth = look.radius * if scene.shape == Shape::Tube { TAU } else { 2.0 };
                textured_surface(
                    maps,
                    &point,
                    [footprint / girth, footprint / maps.length],
                    scene.shape,
                )
            }
            None => (self.untextured_surface(look, &point, toward_eye, footprint), 1.0),
        };
        surface.normal = ply::face_eye(surface.normal, toward_eye);
        surface.albedo *= self.bvh.segments.shade(hit.shape);
        surface.sheen = lit::yarn_sheen(look, point.tangent);
        SurfaceHit {
            start: hit.shape,
            position: point.position,
            smooth_normal: point.normal,
            surface,
            occlusion,
            radius: look.radius,
            toward_eye,
            footprint,
            random_bits: ray.random_bits,
            thin: self.eye.options.lod && is_thin(footprint, look.radius),
        }
    }

    /// The shading point of a hit on a ribbon.
    fn point_on_ribbon(&self, ray: &SceneRay, hit: Hit) -> ShadingPoint {
        let segments = &self.bvh.segments;
        let [u, v] = self.bvh.place_on_strip(hit.shape, ray).unwrap_or([0.5; 2]);
        let (tangent, normal) = segments.directions(hit.shape, v);
        let front = normal.normalize_or(-ray.direction);
        // Both sides of the cloth are right sides: the back is shaded like the front.
        let normal = if front.dot(ray.direction) > 0.0 { -front } else { front };
        let (top, along) = (front.cross(tangent).normalize_or_zero(), segments.along(hit.shape, v));
        ShadingPoint {
            position: ray.at(hit.distance),
            normal,
            tangent,
            top,
            around: u * TAU,
            along,
        }
    }

    /// The surface of a yarn without a texture, without its sheen.
    fn untextured_surface(
        &self,
        look: &YarnLook,
        point: &ShadingPoint,
        toward_eye: Vec3,
        footprint: f32,
    ) -> Surface {
        let (normal, shade) = match self.bvh.segments.scene.shape {
            Shape::Ribbon => (point.normal, 1.0),
            Shape::Tube => ply::detail(&YarnPoint {
                normal: point.normal,
                toward_eye,
                tangent: point.tangent,
                around: point.around,
                along: point.along,
                radius: look.radius,
                footprint,
                plies: to_f32(f64::from(look.plies)),
                twist_slope: look.twist_slope,
            }),
        };
        Surface {
            normal,
            albedo: look.albedo * shade,
            roughness: look.roughness,
            metallic: look.metallic,
            sheen: Sheen::NONE,
        }
    }

    /// Colour of the yarn that blocks a sky ray.
    fn occluder_albedo(&self, start: u32) -> Vec3 {
        let scene = self.bvh.segments.scene;
        let look = &scene.looks[usize::from(self.bvh.segments.look(start))];
        scene.albedo_of(look) * self.bvh.segments.shade(start)
    }

    /// The sun's light reflected toward the eye. One random direction within the sun's disc per
    /// sample gives soft shadows.
    fn sun_light(
        &self,
        here: &SurfaceHit,
        sampler: &Sampler,
        index: u32,
        waiting: &mut Waiting,
    ) -> Vec3 {
        let toward = self.rig.sun_sample(sampler.pair(
            SampleDimension::Sun,
            index,
            self.eye.options.spp.max(1),
        ));
        // Below either horizon no light arrives, and no ray is needed.
        if here.surface.normal.dot(toward) <= 0.0 || here.smooth_normal.dot(toward) <= 0.0 {
            return Vec3::ZERO;
        }
        let ray = here.secondary_ray(toward, f32::INFINITY);
        if self.is_body_before(&ray) || self.bvh.occluder(&ray, here.start, waiting).is_some() {
            return Vec3::ZERO;
        }
        sun_reflection(&self.rig, &here.surface, toward, here.toward_eye)
    }

    /// Cosine-weighted light from the sky, or from the yarns in front of it.
    fn sky_light(
        &self,
        here: &SurfaceHit,
        sampler: &Sampler,
        index: u32,
        waiting: &mut Waiting,
    ) -> SkyLight {
        let cosine = here.surface.normal.dot(self.rig.toward_sun);
        self.sky_rays(here, sampler, index, waiting).means(&self.rig, cosine).light()
    }

    /// What rays into the sky meet.
    fn sky_rays(
        &self,
        here: &SurfaceHit,
        sampler: &Sampler,
        index: u32,
        waiting: &mut Waiting,
    ) -> SkyRays {
        let count = if here.thin { 1 } else { self.eye.options.sky_rays.max(1) };
        let mut rays = SkyRays::default();
        for ray in 0..count {
            let places = (index * count + ray, self.eye.options.spp.max(1) * count);
            let (toward, block) = self.sky_ray(here, (sampler, places.0, places.1), waiting);
            rays.add(&block, self.rig.sky(toward));
        }
        rays
    }

    /// Direction number `index` of `count` into the sky, and what blocks it.
    fn sky_ray(
        &self,
        here: &SurfaceHit,
        (sampler, index, count): (&Sampler, u32, u32),
        waiting: &mut Waiting,
    ) -> (Vec3, SkyBlock) {
        let u = sampler.pair(SampleDimension::Sky, index, count);
        // Importance sampling: the density of directions is the cosine over pi, so all rays weigh
        // the same.
        let toward = cosine_direction(here.surface.normal, u);
        // A direction below the smooth surface points into the yarn itself.
        if here.smooth_normal.dot(toward) <= 0.0 {
            return (toward, SkyBlock::Hidden { albedo: self.occluder_albedo(here.start) });
        }
        let ray = here.sky_ray(toward);
        let block = match &self.side_lights {
            // The nearest reflects its light toward the place, whichever the tree would find first.
            Some(sides) => {
                self.bvh.nearest_occluder(&ray, here.start, waiting).map(|hit| SkyBlock::Lit {
                    light: self.reflected_by(sides, &ray, hit, waiting),
                    albedo: self.occluder_albedo(hit.shape),
                })
            }
            None => {
                let occluder = self.bvh.occluder(&ray, here.start, waiting);
                occluder.map(|start| SkyBlock::Hidden { albedo: self.occluder_albedo(start) })
            }
        };
        let block = block.unwrap_or_else(|| {
            if self.is_body_before(&ray) {
                SkyBlock::Hidden { albedo: self.occluder_albedo(here.start) }
            } else {
                SkyBlock::None
            }
        });
        (toward, block)
    }
}

impl SurfaceHit {
    /// A ray into the sky, as long as neighbouring yarns count.
    fn sky_ray(&self, direction: Vec3) -> SceneRay {
        self.secondary_ray(direction, self.radius * SKY_REACH_RADII)
    }

    /// A ray from the hit in this direction.
    fn secondary_ray(&self, direction: Vec3, reach: f32) -> SceneRay {
        let origin = self.position + self.smooth_normal * (self.radius * ORIGIN_OFFSET);
        // Not the primary ray's random bits. Otherwise the strips that let the primary ray through
        // would let all of its secondary rays through as well.
        let random_bits = ply::hash(self.random_bits ^ direction.x.to_bits());
        SceneRay { origin, direction, reach, footprint: self.footprint, random_bits }
    }
}

/// A random direction around `normal`, with a density proportional to the cosine (Malley's method:
/// a uniform point of the disc, projected up to the hemisphere).
fn cosine_direction(normal: Vec3, u: [f32; 2]) -> Vec3 {
    let (across, up) = normal.any_orthonormal_pair();
    let (sin, cos) = (TAU * u[1]).sin_cos();
    let r = u[0].sqrt();
    across * (cos * r) + up * (sin * r) + normal * (1.0 - u[0]).max(0.0).sqrt()
}
