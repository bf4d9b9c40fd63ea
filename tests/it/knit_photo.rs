//! Photos of knits whose lappings are known, for recognising: drawn by our own renderer, then turned,
//! sheared, bent, blurred, unevenly lit and full of noise.

use std::f32::consts::FRAC_1_PI;

use glam::{DMat2, DVec2, DVec3, Vec3, Vec4};
use image::{Rgb, RgbImage};
use warpknit::drape::{Cloth, swatch_panel};
use warpknit::fabric::Fabric;
use warpknit::fabric::yarn::Count;
use warpknit::photo::recognise::Face;
use warpknit::render::{Background, Camera, Light, RenderOptions, cloth, render, tone};

use super::cloth::{Random, byte, whole};

/// What a photo does to a knit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Taking {
    /// Deviation of the blur, pixels.
    pub(crate) blur: f64,
    /// Deviation of the noise, as a share of white.
    pub(crate) noise: f64,
    /// By how many pixels the cloth is bent.
    pub(crate) bend: f64,
    /// How much lighter a side is.
    pub(crate) light: f64,
    pub(crate) ground: Ground,
    /// Whether its yarns are spread, or round.
    pub(crate) is_spread: bool,
}

/// What lies behind the cloth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Ground {
    /// Something of this least and most light, 255 for white, however the cloth is lit.
    Dark([f64; 2]),
    /// Paper that reflects this least and most share of the light, in the light of the cloth.
    Paper([f64; 2]),
}

impl Ground {
    /// One of its colours, as the camera sees it face to face.
    fn color(self, random: &mut Random, camera: &Camera, light: &Light) -> [u8; 3] {
        match self {
            Self::Dark([darkest, lightest]) => [byte(random.within(darkest, lightest)); 3],
            Self::Paper([least, most]) => {
                let rig = light.around(camera);
                let normal = camera.to_world(Vec3::Z);
                // The sky is linear in height, so that its mean over a hemisphere is that value.
                let sky = rig.sky(normal * (2.0 / 3.0));
                let sun = rig.sun() * normal.dot(rig.toward_sun).max(0.0) * FRAC_1_PI;
                let reflected = (sky + sun) * random.within(least, most) as f32;
                let [r, g, b, _] =
                    tone::pixel(reflected.extend(1.0), Vec4::ZERO, 1.0, Background::Transparent);
                [r, g, b]
            }
        }
    }
}

/// As a person with a phone takes it who takes care.
pub(crate) const FAIR: Taking = Taking {
    blur: 1.0,
    noise: 0.05,
    bend: 0.0,
    light: 0.3,
    ground: Ground::Dark([8.0, 40.0]),
    is_spread: false,
};
/// The same on paper.
pub(crate) const ON_PAPER: Taking = Taking { ground: Ground::Paper([0.75, 0.9]), ..FAIR };

/// Pixels that are drawn, and pixels of the photo.
const DRAWN: u32 = 420;
const SIDE: u32 = 300;

/// The fabric as another mill makes it: one colour, courses up to 15 % and counts up to 30 % off.
pub(crate) fn varied(fabric: &Fabric, seed: u64) -> Fabric {
    let mut random = Random::new(seed);
    let (courses, count) = (random.within(0.85, 1.15), random.within(0.7, 1.3));
    let mut varied =
        fabric.clone().at_densities(fabric.wales_per_cm, fabric.courses_per_cm * courses).unwrap();
    let color = varied.yarn(0).color;
    for yarn in varied.structure.yarns_mut() {
        yarn.count = Count::from_tex(yarn.count.tex() * count);
        yarn.color = color;
    }
    varied
}

/// A drawing of a face of a fabric, larger than the photo of it that is taken.
fn drawn(fabric: &Fabric, face: Face, taking: Taking, seed: u64) -> RgbImage {
    let mut random = Random::new(seed ^ 0x5eed);
    let wale = random.within(16.0, 22.0);
    let scale = fabric.wale_spacing() / wale;
    let side = f64::from(DRAWN);
    let count = |spacing: f64| u32::try_from(whole(1.25 * side * scale / spacing)).unwrap() + 4;
    let [wales, courses] = [fabric.wale_spacing(), fabric.course_spacing()].map(count);
    let panel = swatch_panel(fabric, wales, courses);
    let laid = Cloth::swatch(&panel, fabric, wales, courses);
    let laid =
        if taking.is_spread { laid.with_spread_yarns(fabric, fabric.radius()) } else { laid };
    let mut scene = cloth::from_cloth(&laid, fabric);
    let shade = random.within(0.3, 0.7) as f32;
    scene.looks.iter_mut().for_each(|look| look.albedo = Vec3::splat(shade));
    let centre = scene.bounds().unwrap().centre().as_dvec3().with_z(0.0)
        + DVec3::new(random.within(-0.5, 0.5), random.within(-0.5, 0.5), 0.0)
            * fabric.wale_spacing();
    let far = 40.0 * side * scale;
    let eye = match face {
        Face::Front => far,
        Face::Back => -far,
    };
    let camera = Camera::look_at(
        centre + DVec3::new(0.0, 0.0, eye),
        centre,
        2.0 * (0.5 * side * scale / far).atan(),
        1.0,
    );
    let turn = random.within(0.0, std::f64::consts::TAU);
    let sun = Vec3::new(0.7 * turn.cos() as f32, 0.7 * turn.sin() as f32, 0.7);
    let light = Light { sun_direction: sun, ..Light::default() };
    let background = Background::Color(taking.ground.color(&mut random, &camera, &light));
    let options = RenderOptions {
        width: DRAWN,
        height: DRAWN,
        spp: 4,
        sky_rays: 4,
        background,
        light,
        ..RenderOptions::default()
    };
    let picture = render(&scene, &camera, &options, &|_| ()).unwrap();
    RgbImage::from_fn(DRAWN, DRAWN, |x, y| {
        let [r, g, b, _] = picture.get_pixel(x, y).0;
        Rgb([r, g, b])
    })
}

/// A photo of a face of a fabric.
pub(crate) fn taken(fabric: &Fabric, face: Face, taking: Taking, seed: u64) -> RgbImage {
    let drawn = drawn(fabric, face, taking, seed);
    let mut random = Random::new(seed ^ 0xca3e4a);
    let side = f64::from(SIDE);
    let turn = random.within(-6.0, 6.0).to_radians();
    let shear = random.within(-0.05, 0.05);
    let matrix = DMat2::from_angle(turn) * DMat2::from_cols(DVec2::X, DVec2::new(shear, 1.0));
    let waves: Vec<(DVec2, f64, DVec2)> = (0..4)
        .map(|_| {
            let wave = DVec2::from_angle(random.within(0.0, std::f64::consts::TAU))
                * (std::f64::consts::TAU / (random.within(0.3, 1.0) * side));
            let way = DVec2::from_angle(random.within(0.0, std::f64::consts::TAU));
            (wave, random.within(0.0, std::f64::consts::TAU), way)
        })
        .collect();
    let moved = |p: DVec2| {
        let bend: DVec2 =
            waves.iter().map(|(wave, phase, way)| *way * (wave.dot(p) + phase).sin()).sum();
        p + bend * (taking.bend / 2.0_f64.sqrt())
    };
    let gamma = random.within(0.75, 1.3);
    let gradient = DVec2::new(random.within(-1.0, 1.0), random.within(-1.0, 1.0)) * taking.light;
    let blurred = image::imageops::fast_blur(&drawn, taking.blur as f32);
    let middle = 0.5 * (f64::from(DRAWN) - 1.0);
    RgbImage::from_fn(SIDE, SIDE, |x, y| {
        let p = DVec2::new(f64::from(x), f64::from(y)) - 0.5 * (side - 1.0);
        let light = 1.0 + gradient.dot(p) / side;
        let at = moved(matrix * p) + middle;
        let noise = 255.0 * taking.noise * random_at(seed, x, y);
        Rgb(sample(&blurred, at)
            .map(|value| byte(255.0 * (value / 255.0).powf(gamma) * light + noise)))
    })
}

/// Normal noise of a pixel.
fn random_at(seed: u64, x: u32, y: u32) -> f64 {
    Random::new(seed.wrapping_mul(0x1_0001) ^ (u64::from(y) << 32 | u64::from(x))).bell()
}

fn sample(picture: &RgbImage, at: DVec2) -> [f64; 3] {
    let last = f64::from(picture.width() - 1);
    let at = at.clamp(DVec2::ZERO, DVec2::splat(last - 1e-6));
    let (low, part) = (at.floor(), at.fract());
    let [x, y] = low.to_array().map(|at| u32::try_from(whole(at)).unwrap());
    let pixel = |x: u32, y: u32| picture.get_pixel(x, y).0.map(f64::from);
    let [a, b, c, d] = [pixel(x, y), pixel(x + 1, y), pixel(x, y + 1), pixel(x + 1, y + 1)];
    std::array::from_fn(|channel| {
        let upper = a[channel] + (b[channel] - a[channel]) * part.x;
        let lower = c[channel] + (d[channel] - c[channel]) * part.x;
        upper + (lower - upper) * part.y
    })
}
