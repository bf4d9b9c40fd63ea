//! The set behind the yarns of a picture, with its light.
//!
//! In: a [`Set`], a camera and options. Out: [`Backdrop`], which tells what each pixel sees behind
//! the yarns, and how far away a body hides them. The sun and the sky are those of the yarns. What
//! they light is diffuse. The visibility of the sky is found beforehand, at the body's vertices and
//! in squares of the floor ([`floor`]): both change slowly. The sun's is found at each place of the
//! body, and in the floor's squares.
//!
//! Averaged cloth ([`cloth`]) counts as a body that covers a part of the view.
//!
//! Cost: a ray for each quarter of a pixel where there is a body, and four more where it is hit.
//! The floor takes up to a million rays into the sky, and rays to the sun where its shadow ends.

mod cloth;
mod floor;
mod suns;
mod triangles;

use std::cell::LazyCell;
use std::f32::consts::FRAC_1_PI;
use std::ops::Deref;
use std::sync::LazyLock;

use glam::{Vec2, Vec3, Vec4};

use super::film::Splats;
use super::sample::{SampleDimension, SampleSequence, Sampler};
use super::to_f32;
use crate::light::Rig;
use crate::set::{Cove, MeshSurface, Set};
use crate::{Camera, RenderOptions};
use cloth::{Layer, LitCloth};
use floor::FloorLight;
use suns::{BodySuns, SUN_RAYS, sunlit};

/// Places across and down in a pixel at which a body is looked for.
const PLACES: u32 = 2;
/// All of them.
pub(super) const QUARTERS: usize = (PLACES * PLACES) as usize;
/// Cover from which on what is behind a pixel's bodies counts as hidden.
const HIDDEN: f32 = 0.98;
/// Base colour of a body, linear: a matt dummy of a warm grey. It is lighter than most skins and
/// darker than white cloth, so that sheer cloth of any colour can be told from it.
const BODY: Vec3 = Vec3::new(0.47, 0.40, 0.355);
/// Base colour of floor and wall, linear. A lighter one lets white cloth vanish.
const STUDIO: Vec3 = Vec3::new(0.60, 0.60, 0.605);
/// Distance from the cloth over which the studio's light falls to a half, in diagonals of the
/// cloth's box: lamps light the cloth, and not the hall.
const POOL: f32 = 3.2;
/// Light of the surfaces that hide the sky from a free surface, as a fraction of the light on cloth.
const BOUNCE: f32 = 0.12;
/// Where nothing of the studio is met, its light is that at this distance, in the same diagonals.
const FARTHEST: f32 = 8.0;
/// Rays to the sun from each pixel of the floor where its shadow ends.
const FLOOR_RAYS: u32 = 32;

/// What a pixel sees behind the yarns.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Behind {
    /// The light of the studio or of the environment, with coverage in w.
    pub(crate) light: Vec4,
    /// Light of the body in each quarter of the pixel, with 1 in w where there is a body.
    pub(super) body: [Vec4; QUARTERS],
    /// How far along the camera's axis each quarter shows yarns, mm.
    pub(super) reach: [f32; QUARTERS],
}

impl Behind {
    /// A pixel with nothing behind its yarns.
    pub(super) const NOTHING: Self =
        Self { light: Vec4::ZERO, body: [Vec4::ZERO; QUARTERS], reach: [f32::INFINITY; QUARTERS] };

    /// Adds the body alone to a film row, as samples of pixel `x`.
    pub(super) fn add_body(&self, x: u32, splats: &mut Splats) {
        for (quarter, light) in (0..).zip(self.body) {
            splats.add(x, middle_of(quarter).to_array(), light);
        }
    }

    /// Light of the body at a place of the pixel, 0..1 across and down.
    pub(super) fn body_at(&self, place: [f32; 2]) -> Vec4 {
        self.body[quarter_of(place)]
    }

    /// How far along the camera's axis a place of the pixel shows yarns, mm.
    pub(super) fn reach_at(&self, place: [f32; 2]) -> f32 {
        self.reach[quarter_of(place)]
    }
}

/// The quarter that a place of the pixel lies in.
fn quarter_of([across, down]: [f32; 2]) -> usize {
    usize::from(across >= 0.5) + 2 * usize::from(down >= 0.5)
}

/// The middle of a quarter of a pixel.
fn middle_of(quarter: u32) -> Vec2 {
    let place = Vec2::new((quarter % PLACES) as f32, (quarter / PLACES) as f32);
    (place + 0.5) / PLACES as f32
}

/// The set, lit for one camera.
pub(crate) struct Backdrop<'a> {
    studio: Option<(Cove, FloorLight)>,
    cloth: Option<LitCloth<'a>>,
    set: &'a Set,
    camera: &'a Camera,
    options: &'a RenderOptions,
    rig: Rig,
    ahead: Vec3,
}

impl<'a> Backdrop<'a> {
    /// Lights the set of a picture. `None` without one.
    pub(crate) fn new(camera: &'a Camera, options: &'a RenderOptions) -> Option<Self> {
        static NOTHING: LazyLock<Set> = LazyLock::new(Set::default);
        let set = options.set.as_deref().filter(|set| !set.is_empty());
        if set.is_none() && options.averaged.is_none() {
            return None;
        }
        let set = set.unwrap_or(&NOTHING);
        let rig = options.light.around(camera);
        let cloth = options.averaged.as_deref();
        let cloth = cloth.and_then(|cloth| LitCloth::new(cloth, set, &rig, (camera, options)));
        let studio = set.studio.map(|bounds| {
            let cove = Cove::new(&bounds, camera);
            (cove, FloorLight::new(set, &cove, &rig, options.width))
        });
        let ahead = camera.to_world(Vec3::NEG_Z);
        Some(Self { studio, cloth, set, camera, options, rig, ahead })
    }

    /// What a pixel sees.
    pub(crate) fn pixel(&self, pixel: [u32; 2]) -> Behind {
        let sampler = Sampler::new(pixel[0], pixel[1], self.options.seed);
        let mut behind = Behind::NOTHING;
        let suns = BodySuns::new(&sampler);
        let middle = self.direction(pixel, Vec2::splat(0.5));
        let quarters =
            LazyCell::new(|| [0, 1, 2, 3].map(|quarter| self.direction(pixel, middle_of(quarter))));
        if let Some(body) = &self.set.body {
            for (at, toward) in quarters.into_iter().enumerate() {
                let Some(hit) = body.nearest(self.eye(), toward) else { continue };
                let surface = body.surface(&hit, self.eye(), toward);
                behind.reach[at] = body.skin_reach(&hit, toward) * toward.dot(self.ahead);
                let open = body.interpolate(&hit, |vertex| Vec3::splat(self.set.sky[vertex])).x;
                let sun = self.sun_at(&surface, |ray| suns.at(at, ray));
                behind.body[at] = self.reflected(BODY, surface.normal, sun, open).extend(1.0);
            }
        }
        if let Some(cloth) = &self.cloth {
            self.add_cloth(cloth, (pixel, middle, &quarters), &mut behind, &suns);
        }
        let is_hidden = behind.body.iter().all(|light| light.w > HIDDEN);
        behind.light = self.far_light((middle, &quarters), &sampler, is_hidden);
        behind
    }

    /// Puts averaged cloth before what a pixel sees. Where a pixel shows one stretch of cloth, its
    /// middle or its first quarter stands for all. `middle` and `quarters` are the directions there.
    fn add_cloth(
        &self,
        cloth: &LitCloth<'_>,
        (pixel, middle, quarters): ([u32; 2], Vec3, &impl Deref<Target = [Vec3; QUARTERS]>),
        behind: &mut Behind,
        suns: &BodySuns,
    ) {
        let pixel_at = |distance| self.pixel_at(distance);
        // A quarter with another body behind it shows that.
        let is_free = behind.reach.iter().all(|reach| reach.is_infinite());
        let one = is_free.then(|| cloth.nearest_of_all(pixel, middle, pixel_at)).flatten();
        let directions = if one.is_some() { [middle; QUARTERS] } else { **quarters };
        let cosines = directions.map(|toward| toward.dot(self.ahead));
        let reach: [f32; QUARTERS] = std::array::from_fn(|at| behind.reach[at] / cosines[at]);
        let nearest: [Option<Layer>; QUARTERS] = match one {
            Some(_) => [one; QUARTERS],
            None => {
                std::array::from_fn(|at| cloth.nearest(pixel, directions[at], [0.0, reach[at]]))
            }
        };
        let is_even = is_free && Layer::are_one(&nearest, pixel_at);
        let lit = sunlit(cloth, &nearest, is_even, suns);
        let mut first = None;
        for (at, layer) in nearest.iter().enumerate() {
            let Some(layer) = layer else { continue };
            let seen = match first {
                Some(first) if is_even => first,
                _ => *first.insert(cloth.behind(layer, reach[at], suns.of(at))),
            };
            let light = seen.light + (seen.sun * lit[at]).extend(0.0);
            behind.body[at] = light + behind.body[at] * (1.0 - seen.light.w);
            behind.reach[at] = seen.reach * cosines[at];
        }
    }

    /// Size of a pixel at a distance from the eye, mm.
    fn pixel_at(&self, distance: f32) -> f32 {
        to_f32(self.camera.pixel_size(f64::from(distance), self.options.height))
    }

    fn eye(&self) -> Vec3 {
        self.camera.eye().as_vec3()
    }

    /// The direction through a place of a pixel, 0..1 across and down.
    fn direction(&self, pixel: [u32; 2], place: Vec2) -> Vec3 {
        let [across, up] = self.options.picture_point(pixel, place.to_array());
        self.camera.direction(across, up, self.options.aspect()).as_vec3()
    }

    /// The light of the studio, or else of the environment. Nothing where there is neither. Where
    /// bodies hide it, it may be coarse: little of it comes through the filter from the next pixel.
    fn far_light(
        &self,
        (middle, quarters): (Vec3, &impl Deref<Target = [Vec3; QUARTERS]>),
        sampler: &Sampler,
        is_hidden: bool,
    ) -> Vec4 {
        if let Some((cove, floor)) = &self.studio {
            return self.studio_light((cove, floor), middle, (sampler, is_hidden));
        }
        let Some(environment) = &self.set.environment else { return Vec4::ZERO };
        let light = quarters.iter().map(|toward| environment.radiance(*toward));
        (light.sum::<Vec3>() / QUARTERS as f32).extend(1.0)
    }

    /// The studio's light in a direction. Nothing below its floor.
    fn studio_light(
        &self,
        (cove, floor): (&Cove, &FloorLight),
        toward: Vec3,
        (sampler, is_hidden): (&Sampler, bool),
    ) -> Vec4 {
        if self.eye().y <= cove.foot.y {
            return Vec4::ZERO;
        }
        let Some((place, normal)) = cove.hit(self.eye(), toward) else {
            return self.studio_reflects(-toward, FARTHEST, [1.0; 2]);
        };
        let ([sun, open], is_sharp) = floor.at(place);
        let sun = if is_sharp && !is_hidden {
            let suns = sampler.pairs(SampleDimension::Sun, FLOOR_RAYS);
            sun_on_floor(self.set, &self.rig, place, &suns, FLOOR_RAYS)
        } else {
            sun
        };
        self.studio_reflects(normal, place.distance(cove.foot) / cove.size, [sun, open])
    }

    /// The light of floor or wall so far from the cloth's foot, in diagonals of its box, which
    /// these fractions of the sun's and the sky's light reach.
    fn studio_reflects(&self, normal: Vec3, away: f32, [sun, open]: [f32; 2]) -> Vec4 {
        let far = away.min(FARTHEST) / POOL;
        (self.reflected(STUDIO, normal, sun, open) / (1.0 + far * far)).extend(1.0)
    }

    /// The fraction of the sun's light that reaches a place of the body.
    fn sun_at(&self, surface: &MeshSurface, suns: impl Fn(u32) -> [f32; 2]) -> f32 {
        let lit = |ray: u32| {
            let toward_sun = self.rig.sun_sample(suns(ray));
            let faces = surface.normal.dot(toward_sun) > 0.0;
            if faces { self.set.passes(surface.place, toward_sun) } else { 0.0 }
        };
        (0..SUN_RAYS).map(lit).sum::<f32>() / SUN_RAYS as f32
    }

    /// The light of a matt surface that these fractions of the sun's and the sky's light reach.
    fn reflected(&self, albedo: Vec3, normal: Vec3, sun: f32, open: f32) -> Vec3 {
        let cosine = normal.dot(self.rig.toward_sun).max(0.0);
        // The sky is linear in height, see `splat/light.rs`.
        let above = self.rig.sky(normal * (2.0 / 3.0));
        let hidden = self.rig.on_cloth * BOUNCE;
        albedo * (self.rig.sun() * (cosine * sun * FRAC_1_PI) + above.lerp(hidden, 1.0 - open))
    }
}

/// The fraction of the sun's light that reaches a place of the floor, by so many rays.
fn sun_on_floor(set: &Set, rig: &Rig, place: Vec3, suns: &SampleSequence, rays: u32) -> f32 {
    let passed = (0..rays).map(|ray| set.passes(place, rig.sun_sample(suns.at(ray))));
    passed.sum::<f32>() / rays as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::render;
    use crate::scene::{Bounds, Scene, YarnLook};
    use crate::set::Mesh;
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
        Set::new(None, Some(body), None)
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
            // Before the body, and in its skin, yarns are drawn, and as bright.
            let [before, within] = [-6.0, 1.0].map(|z| {
                let drawn = picture(&scene, with_body(plate(8.0, z)), size);
                assert!(mean(&drawn, 0, half) > mean(&drawn, 2, half), "{radius} {z}");
                mean(&drawn, 0, half)
            });
            assert!((within / before - 1.0).abs() < 0.1, "{radius}: {within} {before}");
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
            let shaded = mean(&picture(&scene, with_body(shade), size), 0, half);
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
        let light = Backdrop::new(&camera, &options).unwrap().pixel([4, 4]).body[0];
        let rig = options.light.around(&camera);
        let expected =
            BODY * (rig.sun() * rig.toward_sun.z * FRAC_1_PI + rig.sky(Vec3::Z * (2.0 / 3.0)));
        assert!(light.truncate().distance(expected) < 1e-3 && light.w == 1.0, "{light} {expected}");
    }

    #[test]
    fn sheer_cloth_dims_the_light_below_it() {
        let cloth = Some((plate(100.0, 10.0), 0.4));
        let set = Set::new(None, Some(plate(100.0, 0.0)), cloth);
        let at = Vec3::new(1.0, 2.0, 0.0);
        assert!((set.passes(at, Vec3::Z) - 0.6).abs() < 1e-5);
        let oblique = Vec3::new(1.0, 0.0, 1.0).normalize();
        assert!((set.passes(at, oblique) - 0.6_f32.powf(2.0_f32.sqrt())).abs() < 1e-3);
        assert_eq!(set.passes(Vec3::new(1.0, 2.0, -5.0), Vec3::Z), 0.0);
        let open = set.open_sky(at, Vec3::Z, 512);
        // The integral of 0.6^(1/c) 2 c over c from 0 to 1.
        assert!((open - 0.436).abs() < 0.02, "{open}");
    }

    #[test]
    fn the_floor_is_dark_under_cloth_and_light_far_away() {
        let bounds = Bounds { min: Vec3::new(-50.0, 0.0, -50.0), max: Vec3::new(50.0, 80.0, 50.0) };
        let roof = [(-50.0, -50.0), (50.0, -50.0), (50.0, 50.0), (-50.0, 50.0)];
        let places = roof.map(|(x, z)| Vec3::new(x, 80.0, z)).to_vec();
        let roof = Mesh::new(places, vec![Vec3::Y; 4], &[[0, 1, 2], [0, 2, 3]]);
        let set = Set::new(Some(bounds), roof, None);
        let camera =
            Camera::look_at(glam::DVec3::new(0.0, 60.0, 900.0), glam::DVec3::ZERO, 0.4, 1.0);
        let cove = Cove::new(&bounds, &camera);
        let rig = RenderOptions::default().light.around(&camera);
        let floor = FloorLight::new(&set, &cove, &rig, 1600);
        let ([sun, open], _) = floor.at(Vec3::ZERO);
        // A square of ±50 at 80 above hides this share of the sky, weighted by the cosine.
        assert!((open - 0.671).abs() < 0.04, "{open}");
        assert!(sun == 1.0 || sun == 0.0);
        assert_eq!(floor.at(Vec3::new(0.0, 0.0, 900.0)), ([1.0; 2], false));
        let shadowed =
            (-200..200_i16).map(f32::from).map(|x| floor.at(Vec3::new(x, 0.0, -60.0)).0[0]);
        assert!(shadowed.fold(1.0, f32::min) < 0.1, "the roof's shadow lies behind it");
    }

    #[test]
    fn threads_and_rows_do_not_change_a_set() {
        let scene = curtain(0.05);
        let bounds = scene.bounds().unwrap();
        let set = || Set::new(Some(bounds), Some(plate(8.0, -2.0)), None);
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
