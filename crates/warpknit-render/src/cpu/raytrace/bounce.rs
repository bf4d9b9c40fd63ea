//! Light from yarn to yarn: what yarns that hide the sky reflect themselves.
//!
//! In: the segments of a picture, then one hit of a sky ray after another. Out: the light that the
//! yarn there reflects ([`RayTracer::reflected_by`]). A yarn's light changes slowly along it and
//! around it, and only means of it are seen. So it is found once for each of four sides of a stretch
//! of yarn, when a ray first meets that side, and kept: an irradiance cache (Ward, Rubinstein and
//! Clear 1988, 'A ray tracing solution for diffuse interreflection'). Between the sides it is
//! interpolated as in an ambient cube (McTaggart 2004). What hides the sky from such a side has the
//! mean light of gaps ([`crate::light::Rig::gap_light`]), so that there are two bounces and an
//! estimate of all others.
//!
//! Stretches and random numbers follow from places alone. So a picture does not depend on the
//! number of threads, and hardly on how much of the cloth is there: where only what is seen was
//! knitted, yarns beyond the picture's rim lack what would hide the light from them.
//!
//! Memory: 4 bytes a point and 20 bytes a stretch. Time: one look at each point, and then a fifth of
//! a picture's, or nearly half where its yarns are two pixels wide.

use std::f32::consts::FRAC_1_PI;
use std::sync::atomic::{AtomicU32, Ordering};

use glam::{Vec3, Vec4};

use super::ray::{CameraRays, SceneRay};
use super::segments::Segments;
use super::sky::{SkyBlock, SkyRays};
use super::{ORIGIN_OFFSET, RayTracer, cosine_direction};
use crate::bvh::tree::{Hit, Waiting};
use crate::cpu::sample::{SampleDimension, Sampler};
use crate::cpu::share;
use crate::light::SKY_REACH_RADII;
use crate::oval::Oval;
use crate::ply::hash;
use warpknit_core::ids::index32;

/// Length of a stretch at least, pixels. Shorter ones cost more rays. In longer ones gaps turn dark: what
/// a place sees of a yarn is lighter than all of it. With 4, yarns two pixels wide take 0.9 of the time,
/// and a skirt in them is 0.4 of 255 darker.
const PIXELS: f32 = 2.0;
/// Sides of a stretch.
const SIDES: usize = 4;
/// Rays of a side for each ray of the pixels that show it. With twice as many the FLIP
/// beside a path tracer is the same.
const RAYS_A_PIXEL_RAY: f32 = 0.015;
/// Limits of the rays of a side into the sky. A single one has no others that tell how open its place
/// is. More than 16 cost more than they are worth in a mean over many sides.
const SKY_RAYS: [f32; 2] = [2.0, 16.0];
/// Rays into the sky for each one to the sun. Most of a side's light is the sun's, and one ray to it
/// is all or nothing.
const SKY_RAYS_A_SUN_RAY: u32 = 2;
/// Least light that is kept, so that no known light is 0.
const LEAST_LIGHT: f32 = 1e-9;
/// Most light that is kept, so that its exponent fits into a byte.
const MOST_LIGHT: f32 = 1e30;
/// Weights of sides below this count as none, so that no side is lit for hardly any light.
const LEAST_WEIGHT: f32 = 0.01;

/// The bits of an `f32` below its exponent.
const MANTISSA: u32 = 0x007F_FFFF;

/// The light that reaches sides of yarns, as far as it is known.
#[derive(Debug)]
pub(super) struct SideLights {
    /// The stretch of the segment that starts at each point.
    stretch_of: Vec<u32>,
    /// First segments of the stretches, and one more at the end.
    firsts: Vec<u32>,
    /// Packed irradiances over pi of each stretch's sides, or 0 where they are not known yet.
    lights: Vec<[AtomicU32; SIDES]>,
    /// The camera's direction back to itself. Sides lie right, left, before and behind, seen from there.
    toward_eye: Vec3,
}

impl SideLights {
    /// Cuts yarns into stretches: the segments that start in one cell of a grid.
    pub(super) fn new(segments: &Segments<'_>, eye: &CameraRays<'_>) -> Self {
        let points = &segments.paths.points;
        let (mut stretch_of, mut firsts) = (Vec::with_capacity(points.len()), Vec::new());
        let mut last = None;
        for (number, point) in (0..).zip(points) {
            let cell = (point.w > 0.0).then(|| Cell::of(*point, eye));
            if cell.is_some() && cell != last {
                firsts.push(number);
            }
            stretch_of.push(index32(firsts.len()).saturating_sub(1));
            last = cell;
        }
        let lights = firsts.iter().map(|_| Default::default()).collect();
        firsts.push(index32(points.len()));
        Self { stretch_of, firsts, lights, toward_eye: eye.camera.to_world(Vec3::Z) }
    }
}

/// A cube of a grid.
#[derive(Clone, Copy, PartialEq)]
struct Cell {
    place: Vec3,
    side: f32,
}

impl Cell {
    /// The one around a point of a yarn, with its radius in w.
    fn of(point: Vec4, eye: &CameraRays<'_>) -> Self {
        let place = point.truncate();
        let length = point.w.max(PIXELS * eye.pixel_at(place));
        // The next power of two, so that neighbours share a grid.
        let side = f32::from_bits((length.to_bits() + MANTISSA) & !MANTISSA);
        Self { place: (place / side).floor(), side }
    }

    /// A number that hardly any other cell has.
    fn hash(self) -> u32 {
        let parts = self.place.extend(self.side).to_array();
        parts.into_iter().fold(0, |bits, part| hash(bits ^ part.to_bits()))
    }
}

impl RayTracer<'_> {
    /// Light that the yarn reflects where a ray meets it, as radiance.
    pub(super) fn reflected_by(
        &self,
        sides: &SideLights,
        ray: &SceneRay,
        hit: Hit,
        waiting: &mut Waiting,
    ) -> Vec3 {
        let (start, end) = self.bvh.segments.ends(hit.shape);
        // Sides count by the surface's normal, which is that of a circle where it is shrunk.
        let oval = self.bvh.segments.oval(hit.shape);
        let from = oval.shrunk(oval.shrunk(ray.at(hit.distance) - start.truncate()));
        let along = (end - start).truncate();
        let length2 = along.length_squared();
        // The sides of the straight segment, not of length 1: roots would take as long as all the rest.
        let to_right = along.cross(sides.toward_eye);
        let (right, front) = (from.dot(to_right), from.dot(to_right.cross(along)));
        let [right2, front2] = [right * right * length2, front * front];
        let share = weight(right2 / (right2 + front2).max(f32::MIN_POSITIVE));
        let stretch = sides.stretch_of[hit.shape as usize];
        let mut light = Vec3::ZERO;
        for (outward, axis, weight) in [(right, 0, share), (front, 1, 1.0 - share)] {
            if weight > 0.0 {
                let side = 2 * axis + usize::from(outward < 0.0);
                light += weight * self.side_light(sides, stretch, side, waiting);
            }
        }
        light * self.occluder_albedo(hit.shape)
    }

    /// Irradiance over pi of a stretch's side.
    fn side_light(
        &self,
        sides: &SideLights,
        stretch: u32,
        side: usize,
        waiting: &mut Waiting,
    ) -> Vec3 {
        let kept = &sides.lights[stretch as usize][side];
        match kept.load(Ordering::Relaxed) {
            0 => {
                // Two threads may find it at once; both find the same.
                let [first, end] = [0, 1].map(|next| sides.firsts[stretch as usize + next]);
                let packed = pack(self.trace_side(sides, [first, end], side, waiting));
                kept.store(packed, Ordering::Relaxed);
                unpack(packed)
            }
            packed => unpack(packed),
        }
    }

    /// Irradiance over pi of one side of a stretch of yarn, traced.
    fn trace_side(
        &self,
        sides: &SideLights,
        [first, end]: [u32; 2],
        side: usize,
        waiting: &mut Waiting,
    ) -> Vec3 {
        let segments = &self.bvh.segments;
        let points = &segments.paths.points[first as usize..end as usize];
        let count = index32(points.iter().take_while(|point| point.w > 0.0).count());
        let seed = Cell::of(points[0], &self.eye).hash();
        let sampler = Sampler::new(seed, index32(side) * 4, self.eye.options.seed);
        let rays = self.rays_of_side(points[0]);
        let suns = rays.div_ceil(SKY_RAYS_A_SUN_RAY);
        let is_sunny = self.rig.sun() != Vec3::ZERO;
        let (mut sky, mut sun, mut cosines) = (SkyRays::default(), 0.0, 0.0);
        for index in 0..rays {
            let [along, _] = sampler.pair(SampleDimension::Pixel, index, rays);
            let here = self.place_on_side(sides, side, first, along * count as f32);
            let toward =
                cosine_direction(here.normal, sampler.pair(SampleDimension::Sky, index, rays));
            let cosine = here.normal.dot(self.rig.toward_sun);
            let ray = here.ray(toward, here.radius * SKY_REACH_RADII);
            let hidden_by = match self.bvh.nearest_occluder(&ray, here.start, waiting) {
                Some(hit) => Some(hit.shape),
                None => self.is_body_before(&ray).then_some(here.start),
            };
            let block = hidden_by.map_or(SkyBlock::None, |start| SkyBlock::Hidden {
                albedo: self.occluder_albedo(start),
            });
            sky.add(&block, self.rig.sky(toward));
            cosines += cosine;
            if index < suns && cosine > 0.0 && is_sunny {
                let toward = self.rig.sun_sample(sampler.pair(SampleDimension::Sun, index, suns));
                let ray = here.ray(toward, f32::INFINITY);
                let is_hidden = self.is_body_before(&ray)
                    || self.bvh.occluder(&ray, here.start, waiting).is_some();
                sun += if is_hidden { 0.0 } else { cosine };
            }
        }
        let means = sky.means(&self.rig, cosines * share(1, rays));
        means.visible + means.hidden + self.rig.sun() * (FRAC_1_PI * sun * share(1, suns))
    }

    /// Number of rays into the sky from a side of the yarn at a point: the more pixels show it, the
    /// more.
    fn rays_of_side(&self, point: Vec4) -> u32 {
        let options = self.eye.options;
        let radius = point.w / self.eye.pixel_at(point.truncate());
        let rays = options.spp.max(1).saturating_mul(options.sky_rays.saturating_add(2));
        let wanted = radius * radius.max(PIXELS) * rays as f32 * RAYS_A_PIXEL_RAY;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let count = wanted.clamp(SKY_RAYS[0], SKY_RAYS[1]) as u32;
        count
    }

    /// The middle of a side so many segments from the one that starts at point `first`.
    fn place_on_side(&self, sides: &SideLights, side: usize, first: u32, along: f32) -> SidePlace {
        let segments = &self.bvh.segments;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rounded down")]
        let start = first + along as u32;
        let (from, to) = segments.ends(start);
        let (tangent, _) = segments.directions(start, along.fract());
        let right = tangent.cross(sides.toward_eye).try_normalize();
        let right = right.unwrap_or_else(|| tangent.any_orthonormal_vector());
        let front = right.cross(tangent);
        SidePlace {
            start,
            position: from.lerp(to, along.fract()).truncate(),
            normal: [right, -right, front, -front][side],
            radius: from.w / segments.oval(start).height(),
            oval: segments.oval(start),
            footprint: self.eye.pixel_at(from.truncate()),
        }
    }
}

/// A place on the middle of a yarn's side.
struct SidePlace {
    /// First point of its segment.
    start: u32,
    /// The point of the axis there.
    position: Vec3,
    normal: Vec3,
    radius: f32,
    oval: Oval,
    /// Size of a pixel, mm.
    footprint: f32,
}

impl SidePlace {
    fn ray(&self, direction: Vec3, reach: f32) -> SceneRay {
        let outward = self.oval.place_facing(self.normal);
        let half_height = self.radius * self.oval.height();
        let origin = self.position + outward * (half_height * (1.0 + ORIGIN_OFFSET));
        SceneRay { origin, direction, reach, footprint: self.footprint, random_bits: 0 }
    }
}

/// A weight of 0..1, where hardly any is none, and nearly all of them are all.
fn weight(share: f32) -> f32 {
    if share < LEAST_WEIGHT {
        0.0
    } else if share > 1.0 - LEAST_WEIGHT {
        1.0
    } else {
        share
    }
}

/// Three numbers with a common exponent (Ward 1991, 'Real pixels'): a byte for each and one for the
/// exponent, which is never 0.
fn pack(light: Vec3) -> u32 {
    let most = light.max_element().clamp(LEAST_LIGHT, MOST_LIGHT);
    // The exponent of `most` as `f32` keeps it, between 1/2 and 1 times a power of two.
    let exponent = (most.to_bits() >> 23) + 1;
    let scale = 256.0 / f32::from_bits(exponent << 23);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let [x, y, z] = light.to_array().map(|number| (number * scale + 0.5) as u8);
    #[expect(clippy::cast_possible_truncation, reason = "limited light has a small exponent")]
    u32::from_le_bytes([x, y, z, exponent as u8])
}

/// The reverse of [`pack`].
fn unpack(packed: u32) -> Vec3 {
    let [x, y, z, exponent] = packed.to_le_bytes();
    let scale = f32::from_bits(u32::from(exponent) << 23) / 256.0;
    Vec3::from_array([x, y, z].map(f32::from)) * scale
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloth::swatch;
    use crate::cpu::raytrace::Bounces;
    use crate::scene::{Scene, YarnLook};
    use crate::{Camera, Light, RenderOptions, View};
    use glam::DVec3;
    use proptest::prelude::*;
    use warpknit_core::fabric::Fabric;

    proptest! {
        #[test]
        fn kept_light_is_off_by_a_256th_of_its_largest_channel(
            light in prop::array::uniform3(0.0_f32..1.0),
            scale in -20..20,
        ) {
            let light = Vec3::from_array(light) * 2.0_f32.powi(scale);
            let packed = pack(light);
            prop_assert_ne!(packed, 0);
            let off = (unpack(packed) - light).abs().max_element();
            prop_assert!(off <= light.max_element().max(LEAST_LIGHT) / 256.0, "{} {}", off, light);
        }
    }

    /// Options and camera for a picture of two yarns along y, from far up the z axis.
    fn view() -> (Camera, RenderOptions) {
        let camera = Camera::look_at(DVec3::Z * 100.0, DVec3::ZERO, 0.1, 1.0);
        let light = Light { sun_direction: Vec3::new(1.0, 0.0, 1.0), ..Light::default() };
        let options =
            RenderOptions { width: 100, height: 100, sky_rays: 64, light, ..Default::default() };
        (camera, options)
    }

    /// Light that a yarn's flank gets from a second yarn beside it, with others that are out of reach of
    /// its sky rays.
    fn from_neighbour(color: Vec3, others: &[[Vec3; 2]]) -> Vec3 {
        let mut scene = Scene::default();
        scene.looks.push(YarnLook::plain(Vec3::splat(0.5), 0.5, 1.0));
        scene.looks.push(YarnLook::plain(color, 0.5, 1.0));
        let straight = |x: f32| (-8_i8..=8).map(move |y| Vec3::new(x, f32::from(y), 0.0));
        scene.push_strand(straight(1.1), 0);
        scene.push_strand(straight(-1.1), 1);
        others.iter().for_each(|ends| scene.push_strand(*ends, 0));
        let (camera, options) = view();
        let bounds = scene.bounds().unwrap();
        let tracer = RayTracer::new(&scene, &bounds, &camera, &options, Bounces::Traced);
        // A place on the flank of the right yarn that faces the left one: 10 mm are 100 pixels.
        tracer.light_sample([50.0 + 4.0, 50.0]).unwrap().gap
    }

    #[test]
    fn yarns_reflect_the_light_that_reaches_them_in_their_colour() {
        let white = from_neighbour(Vec3::ONE, &[]);
        let red = from_neighbour(Vec3::new(1.0, 0.1, 0.1), &[]);
        assert!(red.y < 0.2 * red.x && red.x > 0.8 * white.x, "{red} {white}");
        // A roof far toward the sun, beyond the reach of rays into the sky.
        let roof = (-40_i8..=40).map(|i| {
            let middle = Vec3::new(40.0, 0.0, 40.0) + Vec3::new(0.7, 0.0, -0.7) * f32::from(i);
            [middle - Vec3::Y * 40.0, middle + Vec3::Y * 40.0]
        });
        let shaded = from_neighbour(Vec3::ONE, &roof.collect::<Vec<_>>());
        assert!(shaded.x < 0.7 * white.x, "{shaded} {white}");
    }

    #[test]
    fn sides_that_face_the_light_are_lighter_and_rays_meet_the_side_they_come_to() {
        let mut scene = Scene::default();
        scene.looks.push(YarnLook::plain(Vec3::ONE, 0.5, 1.0));
        scene.push_strand((-8_i8..=8).map(|y| Vec3::Y * f32::from(y)), 0);
        // A ball has no direction, and a yarn along the view no right and left.
        scene.push_strand([Vec3::X * 9.0], 0);
        scene.push_strand([Vec3::new(-9.0, 0.0, -1.0), Vec3::new(-9.0, 0.0, 1.0)], 0);
        let (camera, options) = view();
        let bounds = scene.bounds().unwrap();
        let tracer = RayTracer::new(&scene, &bounds, &camera, &options, Bounces::Traced);
        let sides = tracer.side_lights.as_ref().unwrap();
        let from = |direction: Vec3, axis: Vec3| {
            let mut waiting = Waiting::new();
            let origin = axis - direction * 3.0 - bounds.centre();
            let ray = SceneRay { origin, direction, reach: 9.0, footprint: 0.1, random_bits: 0 };
            let hit = tracer.bvh.nearest(&ray, &mut waiting).unwrap();
            tracer.reflected_by(sides, &ray, hit, &mut waiting).y
        };
        let [right, left, front, behind] = [Vec3::NEG_X, Vec3::X, Vec3::NEG_Z, Vec3::Z]
            .map(|direction| from(direction, Vec3::ZERO));
        // The sun stands to the right and before; the sky is brightest above and before.
        assert!(right > 1.5 * left && front > 1.5 * behind, "{right} {left} {front} {behind}");
        let between = from(Vec3::new(-1.0, 0.0, -1.0).normalize(), Vec3::ZERO);
        assert!((between - (right + front) / 2.0).abs() < 0.01 * between, "{between}");
        for axis in [Vec3::X * 9.0, Vec3::X * -9.0] {
            assert!(from(Vec3::NEG_Z, axis).is_finite() && from(Vec3::Y, axis) > 0.0);
        }
    }

    #[test]
    fn light_of_many_colours_is_the_same_for_any_number_of_threads() {
        let mut scene = swatch(&Fabric::named("locknit").unwrap(), 5, 6);
        scene.looks[0].albedo = Vec3::new(0.9, 0.1, 0.1);
        scene.looks[1].albedo = Vec3::new(0.1, 0.1, 0.9);
        let camera = Camera::view(View::Front, &scene.positions, 0.3, 1.0, 1.0);
        let options = RenderOptions { width: 120, height: 120, ..RenderOptions::default() };
        let draw = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| crate::cpu::render(&scene, &camera, &options, &|_| ()))
        };
        assert!(draw(1) == draw(3));
    }

    #[test]
    fn a_stretch_lies_in_one_cell_and_holds_neighbours() {
        let mut scene = Scene::default();
        scene.looks.push(YarnLook::plain(Vec3::ONE, 0.5, 0.4));
        let bent = |y: f32| {
            (0_u8..90).map(move |i| Vec3::new(f32::from(i) * 0.1, y + f32::from(i).sin(), 0.0))
        };
        [0.0, 1.0].into_iter().for_each(|y| scene.push_strand(bent(y), 0));
        let (camera, options) = view();
        let bounds = scene.bounds().unwrap();
        let tracer = RayTracer::new(&scene, &bounds, &camera, &options, Bounces::Traced);
        let points = &tracer.bvh.segments.paths.points;
        let sides = tracer.side_lights.as_ref().unwrap();
        assert_eq!(sides.firsts.len(), sides.lights.len() + 1);
        let starts = (0..points.len()).filter(|&point| points[point].w > 0.0);
        let mut last = (u32::MAX, usize::MAX);
        for point in starts {
            let stretch = sides.stretch_of[point];
            let first = sides.firsts[stretch as usize] as usize;
            assert!(Cell::of(points[point], &tracer.eye) == Cell::of(points[first], &tracer.eye));
            assert!((first..sides.firsts[stretch as usize + 1] as usize).contains(&point));
            // A yarn's stretches follow each other, and another yarn has others.
            let follows = point == last.1.wrapping_add(1);
            assert!(if follows { stretch <= last.0 + 1 } else { stretch != last.0 });
            last = (stretch, point);
        }
        assert!(sides.lights.len() > 20 && sides.lights.len() < points.len() / 2);
    }
}
