//! Tracing rays: each sample of a pixel sends one to the yarns, one from there to the sun and a few
//! short ones to the sky.
//!
//! In: a scene and a camera. Out: [`Near`], which adds the light of a pixel's samples to a film. A
//! sky ray that is stopped brings the colour of the yarn that stopped it. Yarns are tubes or
//! ribbons, with maps or plies.

mod capsule;
mod ray;
mod segments;
mod strip;
mod trace;

use std::f32::consts::TAU;

use glam::{Vec3, Vec4};

use super::film::Splats;
use super::lit::{self, Sky, Spot, direct, mapped, opaque};
use super::sample::{Purpose, Sampler};
use super::{is_thin, narrow, share};
use crate::light::Rig;
use crate::ply::{self, Place};
use crate::scene::{Bounds, Scene, Shape, YarnLook};
use crate::shade::Surface;
use crate::sheen::Sheen;
use crate::{Camera, Options};
use ray::{Eye, Hit, Path};
use segments::Segments;
use trace::Tracer;

/// How far a sky ray looks for yarns in its way, in radii of the yarn it starts from: about a wale
/// in common fabrics.
const SKY_REACH: f32 = 24.0;
/// Secondary rays start this share of the radius above the surface.
const LIFT: f32 = 0.02;

/// All that a pixel's colour depends on.
pub(super) struct Near<'a> {
    tracer: Tracer<'a>,
    eye: Eye<'a>,
    rig: Rig,
}

/// A yarn's surface where a ray met it.
struct Meeting {
    /// First point of the segment.
    start: u32,
    /// On the yarn, relative to the scene's middle.
    position: Vec3,
    /// Normal of the tube or the fabric; the surface's own is tilted by plies and fibres.
    smooth_normal: Vec3,
    surface: Surface,
    /// Share of the sky's light that the yarn's own relief lets through.
    occlusion: f32,
    radius: f32,
    toward_eye: Vec3,
    /// Size of a pixel there, mm.
    footprint: f32,
    chance: u32,
    /// Whether a pixel is wider than the yarn, and the difference may be used.
    thin: bool,
}

impl<'a> Near<'a> {
    /// Makes ready to look at `scene`, which lies within `bounds`.
    pub(super) fn new(
        scene: &'a Scene,
        bounds: &Bounds,
        camera: &'a Camera,
        options: &'a Options,
    ) -> Self {
        let segments = Segments::of(scene, bounds, camera, options);
        let eye = Eye::new(camera, options, segments.paths.centre, segments.bounds);
        Self { tracer: Tracer::new(segments), eye, rig: options.light.around(camera) }
    }

    /// Adds the samples of a pixel to its row.
    pub(super) fn pixel(&self, [x, y]: [u32; 2], splats: &mut Splats) {
        let spp = self.eye.options.spp.max(1);
        let sampler = Sampler::new(x, y, self.eye.options.seed);
        let mut shared = None;
        for index in 0..spp {
            let place = sampler.pair(Purpose::Pixel, index, spp);
            let path = self.eye.path([x, y], place, sampler.chance(index));
            splats.add(
                x,
                place,
                path.map_or(Vec4::ZERO, |path| self.sample(&path, index, &sampler, &mut shared)),
            );
        }
    }

    /// The light that a sample sees along its ray, and in w 1 where yarn is and 0 where none is.
    ///
    /// Where yarns are thinner than a pixel, two samples share one sky ray by way of `shared`. Four
    /// would, and two one sun ray, at five sixths of the time, but cloth then grows grainy and its
    /// colour is off by 3 %.
    fn sample(&self, path: &Path, index: u32, sampler: &Sampler, shared: &mut Option<Sky>) -> Vec4 {
        let Some(hit) = self.tracer.nearest(path) else { return Vec4::ZERO };
        let met = self.meet(path, hit);
        let sky = match shared.take() {
            Some(sky) if met.thin => sky,
            _ => *shared.insert(self.sky(&met, sampler, index)),
        };
        let light = self.sunlight(&met, sampler, index)
            + sky.reflected(&self.rig, &met.surface, met.toward_eye) * met.occlusion;
        opaque(light)
    }

    fn meet(&self, path: &Path, hit: Hit) -> Meeting {
        let scene = self.tracer.segments.scene;
        let spot = match scene.shape {
            Shape::Tube => self.on_tube(path, hit),
            Shape::Ribbon => self.on_ribbon(path, hit),
        };
        let toward_eye = -path.direction;
        let footprint = self.eye.pixel_at(spot.position);
        let look = &scene.looks[usize::from(self.tracer.segments.look(hit.start))];
        let (mut surface, occlusion) = match scene.maps_of(look) {
            Some(maps) => {
                let girth = look.radius * if scene.shape == Shape::Tube { TAU } else { 2.0 };
                mapped(maps, &spot, [footprint / girth, footprint / maps.length], scene.shape)
            }
            None => (self.plied(look, &spot, toward_eye, footprint), 1.0),
        };
        surface.normal = ply::facing(surface.normal, toward_eye);
        surface.sheen = lit::sheen(look, spot.tangent);
        Meeting {
            start: hit.start,
            position: spot.position,
            smooth_normal: spot.normal,
            surface,
            occlusion,
            radius: look.radius,
            toward_eye,
            footprint,
            chance: path.chance,
            thin: self.eye.options.lod && is_thin(footprint, look.radius),
        }
    }

    fn on_tube(&self, path: &Path, hit: Hit) -> Spot {
        let met = path.at(hit.distance);
        let axis = self.tracer.segments.axis_point(hit.start, met);
        let outward = met - axis.position;
        // The capsule's normal with the curve's tangent taken out of it: smooth where two capsules
        // join.
        let normal =
            (outward - axis.tangent * outward.dot(axis.tangent)).normalize_or(-path.direction);
        Spot {
            position: axis.position + outward.normalize_or(normal) * axis.radius,
            normal,
            tangent: axis.tangent,
            top: normal.cross(axis.tangent),
            around: normal.dot(axis.tangent.cross(axis.across)).atan2(normal.dot(axis.across)),
            along: axis.along,
        }
    }

    fn on_ribbon(&self, path: &Path, hit: Hit) -> Spot {
        let segments = &self.tracer.segments;
        let crossing =
            segments.strip(hit.start).crossing(path.origin.into(), path.direction.into());
        let (u, v) = crossing.map_or((0.5, 0.5), |crossing| (crossing.u, crossing.v));
        let (tangent, normal) = segments.directions(hit.start, v);
        let front = normal.normalize_or(-path.direction);
        // Cloth has two right sides: the back is lit as the front is.
        let normal = if front.dot(path.direction) > 0.0 { -front } else { front };
        let (top, along) = (front.cross(tangent).normalize_or_zero(), segments.along(hit.start, v));
        Spot { position: path.at(hit.distance), normal, tangent, top, around: u * TAU, along }
    }

    /// The surface of a yarn of which there is no photo, without its sheen.
    fn plied(&self, look: &YarnLook, spot: &Spot, toward_eye: Vec3, footprint: f32) -> Surface {
        let (normal, shade) = match self.tracer.segments.scene.shape {
            Shape::Ribbon => (spot.normal, 1.0),
            Shape::Tube => ply::detail(&Place {
                normal: spot.normal,
                toward_eye,
                tangent: spot.tangent,
                around: spot.around,
                along: spot.along,
                radius: look.radius,
                footprint,
                plies: narrow(f64::from(look.plies)),
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

    /// What a yarn that stops a sky ray is coloured like.
    fn albedo(&self, start: u32) -> Vec3 {
        let scene = self.tracer.segments.scene;
        scene.albedo_of(&scene.looks[usize::from(self.tracer.segments.look(start))])
    }

    fn sunlight(&self, met: &Meeting, sampler: &Sampler, index: u32) -> Vec3 {
        let toward =
            self.rig.sun_sample(sampler.pair(Purpose::Sun, index, self.eye.options.spp.max(1)));
        if met.surface.normal.dot(toward) <= 0.0 || met.smooth_normal.dot(toward) <= 0.0 {
            return Vec3::ZERO;
        }
        if self.tracer.occluder(&met.path(toward, f32::INFINITY), met.start).is_some() {
            return Vec3::ZERO;
        }
        direct(&self.rig, &met.surface, toward, met.toward_eye)
    }

    /// What cosine-distributed rays see of the sky, or of the yarns in front of it.
    fn sky(&self, met: &Meeting, sampler: &Sampler, index: u32) -> Sky {
        let rays = if met.thin { 1 } else { self.eye.options.sky_rays.max(1) };
        let (mut light, mut open) = (Vec3::ZERO, 0);
        for ray in 0..rays {
            let u =
                sampler.pair(Purpose::Sky, index * rays + ray, self.eye.options.spp.max(1) * rays);
            let toward = cosine_direction(met.surface.normal, u);
            let stopped = if met.smooth_normal.dot(toward) <= 0.0 {
                Some(met.start)
            } else {
                self.tracer.occluder(&met.path(toward, met.radius * SKY_REACH), met.start)
            };
            light += match stopped {
                Some(start) => self.rig.interior * self.albedo(start),
                None => self.rig.sky(toward),
            };
            open += u32::from(stopped.is_none());
        }
        Sky { light: light * share(1, rays), open: share(open, rays) }
    }
}

impl Meeting {
    fn path(&self, direction: Vec3, reach: f32) -> Path {
        let origin = self.position + self.smooth_normal * (self.radius * LIFT);
        // Another number than the eye's ray had: what let that one through must not let all
        // through.
        let chance = ply::hash(self.chance ^ direction.x.to_bits());
        Path { origin, direction, reach, footprint: self.footprint, chance }
    }
}

/// A direction around `normal` with density proportional to the cosine.
fn cosine_direction(normal: Vec3, u: [f32; 2]) -> Vec3 {
    let (across, up) = normal.any_orthonormal_pair();
    let (sin, cos) = (TAU * u[1]).sin_cos();
    let r = u[0].sqrt();
    across * (cos * r) + up * (sin * r) + normal * (1.0 - u[0]).max(0.0).sqrt()
}
