//! Ray tracing on the processor: what a machine without a graphics driver gets.
//!
//! In: the same as every renderer's. Out: the picture. Each sample of a pixel sends one ray to the yarns, one from there to the
//! sun and a few short ones to the sky; a sky ray that is stopped brings the colour of the yarn that stopped it. Yarns are tubes or ribbons, with
//! maps or plies. Rows are traced in
//! parallel and no sample depends on another, so that any number of threads gives the same bytes.

mod film;
mod sample;
mod segments;
mod strip;
mod trace;

use crate::ids::index32;
use crate::render::light::Rig;
use crate::render::maps::Maps;
use crate::render::ply::{self, Place};
use crate::render::shade::{Surface, schlick_rough};
use crate::render::{Camera, Options, tone};
use crate::scene::{Scene, Shape, YarnLook};
use film::Splats;
use glam::{Vec3, Vec4};
use image::RgbaImage;
use rayon::prelude::*;
use sample::{Purpose, Sampler};
use segments::Segments;
use std::f32::consts::TAU;
use std::sync::atomic::{AtomicU32, Ordering};
use trace::{Hit, Path, Tracer};

/// How far a sky ray looks for yarns in its way, in radii of the yarn it starts from: about a wale in common fabrics.
const SKY_REACH: f32 = 24.0;
/// Secondary rays start this share of the radius above the surface.
const LIFT: f32 = 0.02;
/// Rows that are traced before their pixels are written: enough to share among threads, few enough to take little memory.
const BAND: usize = 64;
/// Pixels that are traced one after another lie in squares of so many, whose rays meet the same yarns while these are in the cache.
const TILE: u32 = 8;

/// See [`crate::render::render`].
#[must_use]
pub fn render(scene: &Scene, camera: &Camera, options: &Options, progress: &(dyn Fn(f32) + Sync)) -> RgbaImage {
    let (width, height) = (options.width, options.height);
    let mut picture = RgbaImage::new(width, height);
    let view = scene.bounds().map(|bounds| View {
        tracer: Tracer::new(Segments::of(scene, &bounds, camera, options), scene),
        rig: options.light.around(camera),
        scene,
        camera,
        options,
    });
    let done = AtomicU32::new(0);
    let trace = |first: u32| {
        let mut rows: Vec<_> = (first..height.min(first.saturating_add(TILE))).map(|y| (y, Splats::new(width))).collect();
        for left in (0..width).step_by(TILE as usize) {
            for (y, splats) in rows.iter_mut().filter(|_| view.is_some()) {
                if let Some(view) = &view {
                    (left..width.min(left.saturating_add(TILE))).for_each(|x| view.pixel(x, *y, splats));
                }
            }
        }
        for _ in &rows {
            progress(share(done.fetch_add(1, Ordering::Relaxed) + 1, height));
        }
        rows.into_iter().map(|(_, splats)| splats).collect::<Vec<_>>()
    };
    // A pixel needs the rows next to its own, so the last two rows of a band wait for the next one.
    let mut rows = vec![Splats::new(width)];
    let row_bytes = (width as usize * 4).max(1);
    let mut unwritten = picture.as_mut();
    for band in (0..height).step_by(BAND) {
        let end = height.min(band.saturating_add(index32(BAND)));
        let tiles: Vec<_> = (band..end).into_par_iter().step_by(TILE as usize).map(&trace).collect();
        rows.extend(tiles.into_iter().flatten());
        if end == height {
            rows.push(Splats::new(width));
        }
        let (written, rest) = unwritten.split_at_mut((rows.len() - 2) * width as usize * 4);
        written.par_chunks_mut(row_bytes).zip(rows.par_windows(3)).for_each(|(pixels, rows)| {
            for (x, pixel) in pixels.chunks_exact_mut(4).enumerate() {
                pixel.copy_from_slice(&tone::pixel(Splats::pixel(rows, x), options.exposure, options.background));
            }
        });
        unwritten = rest;
        rows.drain(..rows.len() - 2);
    }
    picture
}

/// All that a pixel's colour depends on.
struct View<'a> {
    tracer: Tracer<'a>,
    rig: Rig,
    scene: &'a Scene,
    camera: &'a Camera,
    options: &'a Options,
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

/// Where on a yarn a ray met it, before anything is known of its colour.
struct Spot {
    position: Vec3,
    normal: Vec3,
    tangent: Vec3,
    /// Across the yarn to where its picture has its top.
    top: Vec3,
    /// Angle around a tube, radians; on a ribbon 0..TAU from edge to edge.
    around: f32,
    along: f32,
}

impl View<'_> {
    /// Adds the samples of a pixel to its row.
    fn pixel(&self, x: u32, y: u32, splats: &mut Splats) {
        let spp = self.options.spp.max(1);
        let sampler = Sampler::new(x, y, self.options.seed);
        let mut shared = None;
        for index in 0..spp {
            let place = sampler.pair(Purpose::Pixel, index, spp);
            let across = (f64::from(x) + f64::from(place[0])) / f64::from(self.options.width) * 2.0 - 1.0;
            let up = 1.0 - (f64::from(y) + f64::from(place[1])) / f64::from(self.options.height) * 2.0;
            splats.add(x, place, self.sample(across, up, index, &sampler, &mut shared));
        }
    }

    /// The light that comes from picture point (across, up), and in w 1 where yarn is and 0 where none is.
    ///
    /// Where yarns are thinner than a pixel, two samples share one sky ray by way of `shared`. Four would, and two one sun ray, at five sixths
    /// of the time, but cloth then grows grainy and its colour is off by 3 %.
    fn sample(&self, across: f64, up: f64, index: u32, sampler: &Sampler, shared: &mut Option<Sky>) -> Vec4 {
        let direction = self.camera.direction(across, up, self.options.aspect());
        let entered = self.tracer.enter(self.camera, self.options.height, direction, sampler.chance(index));
        let Some(path) = entered else { return Vec4::ZERO };
        let Some(hit) = self.tracer.nearest(&path) else { return Vec4::ZERO };
        let met = self.meet(&path, hit);
        let sky = match shared.take() {
            Some(sky) if met.thin => sky,
            _ => *shared.insert(self.sky(&met, sampler, index)),
        };
        let light = self.sunlight(&met, sampler, index) + self.skylight(&met, sky);
        if light.is_finite() { light.extend(1.0) } else { Vec4::W }
    }

    fn meet(&self, path: &Path, hit: Hit) -> Meeting {
        let spot = match self.scene.shape {
            Shape::Tube => self.on_tube(path, hit),
            Shape::Ribbon => self.on_ribbon(path, hit),
        };
        let toward_eye = -path.direction;
        let distance = (spot.position.as_dvec3() + self.tracer.segments.paths.centre).distance(self.camera.eye());
        let footprint = narrow(self.camera.pixel_size(distance, self.options.height));
        let look = &self.scene.looks[usize::from(self.tracer.segments.look(hit.start))];
        let (mut surface, occlusion) = match self.scene.maps_of(look) {
            Some(maps) => mapped(maps, &spot, look.radius, footprint, self.scene.shape),
            None => (self.plied(look, &spot, toward_eye, footprint), 1.0),
        };
        surface.normal = ply::facing(surface.normal, toward_eye);
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
            thin: self.options.lod && footprint > 2.0 * look.radius,
        }
    }

    fn on_tube(&self, path: &Path, hit: Hit) -> Spot {
        let met = path.origin + path.direction * hit.distance;
        let axis = self.tracer.segments.axis_point(hit.start, met);
        let outward = met - axis.position;
        // The capsule's normal with the curve's tangent taken out of it: smooth where two capsules join.
        let normal = (outward - axis.tangent * outward.dot(axis.tangent)).normalize_or(-path.direction);
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
        let crossing = segments.strip(hit.start).crossing(path.origin.into(), path.direction.into());
        let (u, v) = crossing.map_or((0.5, 0.5), |crossing| (crossing.u, crossing.v));
        let (tangent, normal) = segments.directions(hit.start, v);
        let front = normal.normalize_or(-path.direction);
        // Cloth has two right sides: the back is lit as the front is.
        let normal = if front.dot(path.direction) > 0.0 { -front } else { front };
        let (top, along) = (front.cross(tangent).normalize_or_zero(), segments.along(hit.start, v));
        Spot { position: path.origin + path.direction * hit.distance, normal, tangent, top, around: u * TAU, along }
    }

    /// The surface of a yarn of which there is no photo.
    fn plied(&self, look: &YarnLook, spot: &Spot, toward_eye: Vec3, footprint: f32) -> Surface {
        let (normal, shade) = match self.scene.shape {
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
        Surface { normal, albedo: look.albedo * shade, roughness: look.roughness, metallic: look.metallic }
    }

    /// What a yarn that stops a sky ray is coloured like.
    fn albedo(&self, start: u32) -> Vec3 {
        self.scene.mean_albedo(&self.scene.looks[usize::from(self.tracer.segments.look(start))])
    }

    fn sunlight(&self, met: &Meeting, sampler: &Sampler, index: u32) -> Vec3 {
        let toward = self.rig.sun_sample(sampler.pair(Purpose::Sun, index, self.options.spp.max(1)));
        let cosine = met.surface.normal.dot(toward);
        if cosine <= 0.0 || met.smooth_normal.dot(toward) <= 0.0 {
            return Vec3::ZERO;
        }
        let reflected = met.surface.brdf(toward, met.toward_eye) * self.rig.sun() * cosine;
        if self.tracer.occluder(&met.path(toward, f32::INFINITY), met.start).is_some() { Vec3::ZERO } else { reflected }
    }

    /// What cosine-distributed rays see of the sky, or of the yarns in front of it.
    fn sky(&self, met: &Meeting, sampler: &Sampler, index: u32) -> Sky {
        let rays = if met.thin { 1 } else { self.options.sky_rays.max(1) };
        let (mut light, mut open) = (Vec3::ZERO, 0);
        for ray in 0..rays {
            let u = sampler.pair(Purpose::Sky, index * rays + ray, self.options.spp.max(1) * rays);
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

    /// The sky's diffuse light, and its mirror image dimmed by how much of it is to be seen.
    fn skylight(&self, met: &Meeting, sky: Sky) -> Vec3 {
        let normal = met.surface.normal;
        let mirrored = schlick_rough(met.surface.f0(), normal.dot(met.toward_eye), met.surface.roughness);
        let mirror = (normal * (2.0 * normal.dot(met.toward_eye)) - met.toward_eye).normalize_or(normal);
        (met.surface.diffuse(mirrored) * sky.light + mirrored * self.rig.sky(mirror) * sky.open) * met.occlusion
    }
}

/// What a point sees above it.
#[derive(Clone, Copy)]
struct Sky {
    /// Mean radiance, by the cosine.
    light: Vec3,
    /// Share that no yarn stops.
    open: f32,
}

impl Meeting {
    fn path(&self, direction: Vec3, reach: f32) -> Path {
        let origin = self.position + self.smooth_normal * (self.radius * LIFT);
        // Another number than the eye's ray had: what let that one through must not let all through.
        let chance = ply::hash(self.chance ^ direction.x.to_bits());
        Path { origin, direction, reach, footprint: self.footprint, chance }
    }
}

/// The surface of a yarn at a place of its photo, and its occlusion.
fn mapped(maps: &Maps, spot: &Spot, radius: f32, footprint: f32, shape: Shape) -> (Surface, f32) {
    let girth = match shape {
        Shape::Tube => TAU * radius,
        Shape::Ribbon => 2.0 * radius,
    };
    let (u, v) = (spot.around / TAU, spot.along / maps.length);
    let texel = maps.sample(u, v, footprint / girth, footprint / maps.length, shape);
    let tilt = texel.normal;
    let normal = (spot.tangent * tilt.x + spot.top * tilt.y + spot.normal * tilt.z).normalize_or(spot.normal);
    (Surface { normal, albedo: texel.albedo, roughness: texel.roughness, metallic: texel.metallic }, texel.occlusion)
}

/// A direction around `normal` with density proportional to the cosine.
fn cosine_direction(normal: Vec3, u: [f32; 2]) -> Vec3 {
    let (across, up) = normal.any_orthonormal_pair();
    let (sin, cos) = (TAU * u[1]).sin_cos();
    let r = u[0].sqrt();
    across * (cos * r) + up * (sin * r) + normal * (1.0 - u[0]).max(0.0).sqrt()
}

/// `part / whole`.
fn share(part: u32, whole: u32) -> f32 {
    narrow(f64::from(part) / f64::from(whole))
}

#[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
fn narrow(value: f64) -> f32 {
    value as f32
}
