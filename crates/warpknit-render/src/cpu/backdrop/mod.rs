//! The set behind the yarns of a picture, with its light.
//!
//! In: a [`Set`], a camera and options. Out: [`Backdrop`], which tells what each pixel sees behind
//! the yarns, and how far away a body hides them. The sun and the sky are those of the yarns. What
//! they light is diffuse. The visibility of the sky is found beforehand, at the body's vertices and
//! in squares of the floor ([`floor`]): both change slowly. The sun's is found at each place of the
//! body, and in the floor's squares.
//!
//! Cost: a ray for each quarter of a pixel where there is a body, and two million rays or so
//! beforehand.

mod floor;

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::sample::{SampleDimension, SampleSequence, Sampler};
use super::to_f32;
use crate::light::Rig;
use crate::set::{Cove, Mesh, MeshHit, Set};
use crate::{Camera, RenderOptions};
use floor::FloorLight;

/// Places across and down in a pixel at which a body is looked for.
const PLACES: u32 = 2;
/// All of them.
pub(super) const QUARTERS: usize = (PLACES * PLACES) as usize;
/// Rays to the sun from each place of a body.
const SUN_RAYS: u32 = 4;
/// Rays into the sky from a vertex at most, and from all vertices together.
const SKY_RAYS: u32 = 192;
const MOST_SKY_RAYS: u32 = 4_000_000;
/// Base colour of a body, linear: a matt dummy of a warm grey. It is lighter than most skins and
/// darker than white cloth, so that sheer cloth of any colour can be told from it.
const BODY: Vec3 = Vec3::new(0.47, 0.40, 0.355);
/// Base colour of floor and wall, linear. A lighter one lets white cloth vanish.
const STUDIO: Vec3 = Vec3::new(0.60, 0.60, 0.605);
/// Distance from the cloth over which the studio's light falls to a half, in diagonals of the cloth's
/// box: lamps light the cloth, and not the hall.
const POOL: f32 = 3.2;
/// Share of the light of a free surface that comes from the surfaces that hide its sky.
const BOUNCE: f32 = 0.3;
/// Depth in a body up to which yarns are drawn on it, mm. Cloth lies in the skin of many bodies by a
/// millimetre or two. A larger depth would show the far side of thin limbs.
pub(super) const SKIN: f32 = 3.0;

/// What a pixel sees behind the yarns.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Behind {
    /// Its light, with coverage in w.
    pub(crate) light: Vec4,
    /// How far along the camera's axis each quarter of the pixel shows yarns, mm.
    pub(super) reach: [f32; QUARTERS],
}

impl Behind {
    /// A pixel with nothing behind its yarns.
    pub(super) const NOTHING: Self = Self { light: Vec4::ZERO, reach: [f32::INFINITY; QUARTERS] };
}

/// The set, lit for one camera.
#[derive(Debug)]
pub(crate) struct Backdrop<'a> {
    body: Option<LitBody<'a>>,
    studio: Option<(Cove, FloorLight)>,
    set: &'a Set,
    camera: &'a Camera,
    options: &'a RenderOptions,
    rig: Rig,
    ahead: Vec3,
}

/// A body, and the fraction of the sky that each of its vertices sees.
#[derive(Debug)]
struct LitBody<'a> {
    mesh: &'a Mesh,
    open: Vec<f32>,
}

impl<'a> Backdrop<'a> {
    /// Lights the set of a picture. `None` without one.
    pub(crate) fn new(camera: &'a Camera, options: &'a RenderOptions) -> Option<Self> {
        let set = options.set.as_deref().filter(|set| !set.is_empty())?;
        let rig = options.light.around(camera);
        let body = set.body.as_ref().map(|mesh| LitBody { mesh, open: sky_at_vertices(set, mesh) });
        let studio = set.studio.map(|bounds| {
            let cove = Cove::new(&bounds, camera);
            (cove, FloorLight::new(set, &cove, &rig, options.width))
        });
        let ahead = camera.to_world(Vec3::NEG_Z);
        Some(Self { body, studio, set, camera, options, rig, ahead })
    }

    /// What a pixel sees.
    pub(crate) fn pixel(&self, pixel: [u32; 2]) -> Behind {
        let studio = self.studio_light(self.direction(pixel, Vec2::splat(0.5)));
        let Some(body) = &self.body else { return Behind { light: studio, ..Behind::NOTHING } };
        let suns = Sampler::new(pixel[0], pixel[1], self.options.seed)
            .pairs(SampleDimension::Sun, SUN_RAYS * PLACES * PLACES);
        let (mut light, mut reach) = (Vec4::ZERO, [f32::INFINITY; QUARTERS]);
        for (quarter, reach) in (0..).zip(&mut reach) {
            let place = Vec2::new((quarter % PLACES) as f32, (quarter / PLACES) as f32) + 0.5;
            let toward = self.direction(pixel, place / PLACES as f32);
            light += match body.mesh.nearest(self.eye(), toward) {
                None => studio,
                Some(hit) => {
                    *reach = (hit.distance + SKIN) * toward.dot(self.ahead);
                    self.body_light(body, &hit, toward, &suns, quarter * SUN_RAYS).extend(1.0)
                }
            };
        }
        Behind { light: light / QUARTERS as f32, reach }
    }

    fn eye(&self) -> Vec3 {
        self.camera.eye().as_vec3()
    }

    /// The direction through a place of a pixel, 0..1 across and down.
    fn direction(&self, [x, y]: [u32; 2], place: Vec2) -> Vec3 {
        let size = [self.options.width, self.options.height].map(f64::from);
        let across = (f64::from(x) + f64::from(place.x)) / size[0] * 2.0 - 1.0;
        let up = 1.0 - (f64::from(y) + f64::from(place.y)) / size[1] * 2.0;
        self.camera.direction(across, up, self.options.aspect()).as_vec3()
    }

    /// The studio's light in a direction, or nothing where there is none.
    fn studio_light(&self, toward: Vec3) -> Vec4 {
        let Some((cove, floor)) = &self.studio else { return Vec4::ZERO };
        let Some((place, normal)) = cove.hit(self.eye(), toward) else { return Vec4::ZERO };
        let [sun, open] = floor.at(place);
        let far = place.distance(cove.foot) / (POOL * cove.size);
        let light = self.reflected(STUDIO, normal, sun, open) / (1.0 + far * far);
        light.extend(1.0)
    }

    /// The light that the body reflects where a ray meets it.
    fn body_light(
        &self,
        body: &LitBody<'_>,
        hit: &MeshHit,
        toward: Vec3,
        suns: &SampleSequence,
        first: u32,
    ) -> Vec3 {
        let (_, normals) = body.mesh.vertices();
        let normal = body.mesh.interpolate(hit, |vertex| normals[vertex]).normalize_or(-toward);
        let open = body.mesh.interpolate(hit, |vertex| Vec3::splat(body.open[vertex])).x;
        let place = self.eye() + toward * hit.distance;
        // Bodies are closed, and what is seen of them is their outside, however they are wound.
        let normal = if normal.dot(toward) > 0.0 { -normal } else { normal };
        let lit = |ray: u32| {
            let toward_sun = self.rig.sun_sample(suns.at(first + ray));
            if normal.dot(toward_sun) > 0.0 { self.set.passes(place, toward_sun) } else { 0.0 }
        };
        let sun = (0..SUN_RAYS).map(lit).sum::<f32>() / SUN_RAYS as f32;
        self.reflected(BODY, normal, sun, open)
    }

    /// The light of a matt surface that these fractions of the sun's and the sky's light reach.
    fn reflected(&self, albedo: Vec3, normal: Vec3, sun: f32, open: f32) -> Vec3 {
        let cosine = normal.dot(self.rig.toward_sun).max(0.0);
        // The sky is linear in height, see `splat/light.rs`.
        let above = self.rig.sky(normal * (2.0 / 3.0));
        let hidden = self.rig.interior * BOUNCE;
        albedo * (self.rig.sun() * (cosine * sun * FRAC_1_PI) + above.lerp(hidden, 1.0 - open))
    }
}

/// The fraction of the sky that each vertex of the body sees.
fn sky_at_vertices(set: &Set, body: &Mesh) -> Vec<f32> {
    let (positions, normals) = body.vertices();
    let count = warpknit_core::ids::index32(positions.len()).max(1);
    let rays = (MOST_SKY_RAYS / count).clamp(16, SKY_RAYS);
    let vertices = positions.par_iter().zip(normals);
    vertices.map(|(place, normal)| open_sky(set, *place, *normal, rays)).collect()
}

/// The fraction of the sky's light that reaches a place of the set. The directions are the same
/// everywhere, so that neighbouring places differ by what they see, and not by chance.
fn open_sky(set: &Set, place: Vec3, normal: Vec3, rays: u32) -> f32 {
    let directions = Sampler::new(0, 0, 0).pairs(SampleDimension::Sky, rays);
    let passed = (0..rays).map(|ray| {
        set.passes(place, super::raytrace::cosine_direction(normal, directions.at(ray)))
    });
    passed.sum::<f32>() / to_f32(f64::from(rays))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::render;
    use crate::scene::{Bounds, Scene, YarnLook};
    use crate::{Background, View};
    use image::RgbaImage;
    use std::sync::Arc;

    /// A square across the z axis, with corners at ±half.
    fn plate(half: f32, z: f32) -> Mesh {
        let corners = [(-half, -half), (half, -half), (half, half), (-half, half)];
        let places = corners.map(|(x, y)| Vec3::new(x, y, z)).to_vec();
        Mesh::new(places, vec![Vec3::Z; 4], &[[0, 1, 2], [0, 2, 3]]).unwrap()
    }

    /// Thirty upright yarns side by side, of this radius.
    fn curtain(radius: f32) -> Scene {
        let looks = vec![YarnLook::plain(Vec3::new(0.8, 0.1, 0.1), 0.7, radius)];
        let mut scene = Scene { looks, ..Scene::default() };
        for line in 0_u8..30 {
            let x = f32::from(line) - 14.5;
            scene.push_strand((0_u8..=60).map(|i| Vec3::new(x, f32::from(i) / 2.0 - 15.0, 0.0)), 0);
        }
        scene
    }

    fn picture(scene: &Scene, set: Set, size: u32) -> RgbaImage {
        // The curtain's, so that all pictures show the same place.
        let camera = Camera::view(View::Front, &curtain(0.05).positions, 0.4, 1.0, 1.0);
        let options = RenderOptions {
            width: size,
            height: size,
            background: Background::Color([0, 0, 255]),
            set: Some(Arc::new(set)),
            ..RenderOptions::default()
        };
        render(scene, &camera, &options, &|_| ())
    }

    fn with_body(body: Mesh) -> Set {
        Set { body: Some(body), ..Set::default() }
    }

    /// Mean of a channel over a square around the middle.
    fn mean(picture: &RgbaImage, channel: usize, half: u32) -> f64 {
        let middle = picture.width() / 2;
        let all = middle - half..middle + half;
        let sum: u32 = all
            .clone()
            .flat_map(|y| all.clone().map(move |x| (x, y)))
            .map(|(x, y)| u32::from(picture.get_pixel(x, y)[channel]))
            .sum();
        f64::from(sum) / f64::from(4 * half * half)
    }

    #[test]
    fn a_body_hides_what_is_behind_it_with_both_methods() {
        // Masks for thin yarns, rays for thick ones.
        for (radius, size) in [(0.05, 60), (0.45, 120)] {
            let scene = curtain(radius);
            let behind = picture(&scene, with_body(plate(8.0, 6.0)), size);
            let plain = picture(&Scene::default(), with_body(plate(8.0, 6.0)), size);
            let half = size / 8;
            assert_eq!(mean(&behind, 0, half), mean(&behind, 0, half / 2), "one colour");
            assert!(mean(&plain, 2, half) < 255.0);
            // Before the body, and in its skin, yarns are drawn.
            for z in [-6.0, 1.0] {
                let before = picture(&scene, with_body(plate(8.0, z)), size);
                assert!(mean(&before, 0, half) > mean(&before, 2, half), "{radius} {z}");
            }
        }
    }

    #[test]
    fn a_body_casts_its_shadow_on_yarns_with_both_methods() {
        for (radius, size) in [(0.05, 60), (0.45, 120)] {
            let scene = curtain(radius);
            // Beside the picture's middle toward the sun.
            let sun = RenderOptions::default().light.sun_direction.normalize();
            let away = 40.0;
            let middle = sun / sun.z * away;
            let corners = [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)];
            let places = corners.map(|(x, y)| middle + Vec3::new(x, y, 0.0)).to_vec();
            let shade = Mesh::new(places, vec![Vec3::Z; 4], &[[0, 1, 2], [0, 2, 3]]).unwrap();
            let half = size / 12;
            let lit = mean(&picture(&scene, with_body(plate(20.0, -5.0)), size), 0, half);
            let mut set = with_body(shade);
            set.cloth = None;
            let shaded = mean(&picture(&scene, set, size), 0, half);
            assert!(shaded < 0.75 * lit, "{radius}: {shaded} {lit}");
        }
    }

    #[test]
    fn a_plate_has_the_light_of_its_closed_form() {
        let camera = Camera::look_at(glam::DVec3::Z * 300.0, glam::DVec3::ZERO, 0.2, 1.0);
        let options = RenderOptions {
            width: 8,
            height: 8,
            set: Some(Arc::new(with_body(plate(100.0, 0.0)))),
            ..RenderOptions::default()
        };
        let light = Backdrop::new(&camera, &options).unwrap().pixel([4, 4]).light;
        let rig = options.light.around(&camera);
        let expected =
            BODY * (rig.sun() * rig.toward_sun.z * FRAC_1_PI + rig.sky(Vec3::Z * (2.0 / 3.0)));
        assert!(light.truncate().distance(expected) < 1e-3 && light.w == 1.0, "{light} {expected}");
    }

    #[test]
    fn sheer_cloth_dims_the_light_below_it() {
        let mut set = with_body(plate(100.0, 0.0));
        set.cloth = Some((plate(100.0, 10.0), 0.4));
        let at = Vec3::new(1.0, 2.0, 0.0);
        assert!((set.passes(at, Vec3::Z) - 0.6).abs() < 1e-5);
        let oblique = Vec3::new(1.0, 0.0, 1.0).normalize();
        assert!((set.passes(at, oblique) - 0.6_f32.powf(2.0_f32.sqrt())).abs() < 1e-3);
        assert_eq!(set.passes(Vec3::new(1.0, 2.0, -5.0), Vec3::Z), 0.0);
        let open = open_sky(&set, at, Vec3::Z, 512);
        // The integral of 0.6^(1/c) 2 c over c from 0 to 1.
        assert!((open - 0.436).abs() < 0.02, "{open}");
    }

    #[test]
    fn the_floor_is_dark_under_cloth_and_light_far_away() {
        let bounds = Bounds { min: Vec3::new(-50.0, 0.0, -50.0), max: Vec3::new(50.0, 80.0, 50.0) };
        let roof = [(-50.0, -50.0), (50.0, -50.0), (50.0, 50.0), (-50.0, 50.0)];
        let places = roof.map(|(x, z)| Vec3::new(x, 80.0, z)).to_vec();
        let roof = Mesh::new(places, vec![Vec3::Y; 4], &[[0, 1, 2], [0, 2, 3]]);
        let set = Set { studio: Some(bounds), body: roof, cloth: None };
        let camera =
            Camera::look_at(glam::DVec3::new(0.0, 60.0, 900.0), glam::DVec3::ZERO, 0.4, 1.0);
        let cove = Cove::new(&bounds, &camera);
        let rig = RenderOptions::default().light.around(&camera);
        let floor = FloorLight::new(&set, &cove, &rig, 1600);
        let [sun, open] = floor.at(Vec3::ZERO);
        // A square of ±50 at 80 above hides this share of the sky, weighted by the cosine.
        assert!((open - 0.671).abs() < 0.04, "{open}");
        assert!(sun == 1.0 || sun == 0.0);
        assert_eq!(floor.at(Vec3::new(0.0, 0.0, 900.0)), [1.0; 2]);
        let shadowed =
            (-200..200_i16).map(f32::from).map(|x| floor.at(Vec3::new(x, 0.0, -60.0))[0]);
        assert!(shadowed.fold(1.0, f32::min) < 0.1, "the roof's shadow lies behind it");
    }

    #[test]
    fn threads_and_rows_do_not_change_a_set() {
        let scene = curtain(0.05);
        let bounds = scene.bounds().unwrap();
        let set = || Set { studio: Some(bounds), body: Some(plate(8.0, -2.0)), cloth: None };
        let draw = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| picture(&scene, set(), 60))
        };
        let whole = draw(1);
        assert!(whole == draw(3));
        let camera = Camera::view(View::Front, &scene.positions, 0.4, 1.0, 1.0);
        let options = RenderOptions {
            width: 60,
            height: 60,
            rows: Some(20..37),
            background: Background::Color([0, 0, 255]),
            set: Some(Arc::new(set())),
            ..RenderOptions::default()
        };
        let part = render(&scene, &camera, &options, &|_| ());
        assert!(part.as_raw()[..] == whole.as_raw()[20 * 60 * 4..37 * 60 * 4]);
    }
}
