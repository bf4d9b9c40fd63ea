//! The light of averaged cloth.
//!
//! In: an [`AveragedCloth`] and a [`Rig`]. Out: [`Appearance`], which says how much of the view a
//! place of the cloth covers, and which light it has toward an eye.
//!
//! Method: the cloth's flat piece is traced as in pictures (`raytrace/facets`), for directions to
//! the eye and to the sun on a grid in the cloth's axes. What lies between is interpolated. Only
//! directions that a picture needs are traced, when they are needed first. The piece, the places of
//! rays and the grid are fixed. So a place has the same light whichever thread asks first.
//!
//! Cost: half a millisecond for each direction to the eye, and 0.03 ms for each pair of directions;
//! a picture of a garment needs some hundred and some thousand.

use std::sync::OnceLock;

use glam::{Mat3, Vec2, Vec3};

use super::raytrace::facets::{Facets, PARTS};
use super::raytrace::{Bounces, RayTracer};
use crate::averaged::{AveragedCloth, FLATTEST};
use crate::light::Rig;

/// Directions along a side of the grid of half of all directions: eleven degrees from one to the
/// next.
const SIDE: usize = 13;
/// Neighbouring rows of directions begin with different parts of the facets.
const _: () = assert!(SIDE % PARTS == 1, "directions around a place have all parts of the facets");
/// Directions of a half.
const HALF: usize = SIDE * SIDE;
/// Directions around a direction between them.
const AROUND: usize = 4;

/// How averaged cloth looks in a light.
pub(super) struct Appearance<'a> {
    cloth: &'a AveragedCloth,
    tracer: RayTracer<'a>,
    rig: Rig,
    views: Vec<OnceLock<EyeLook>>,
}

/// Cloth that is seen from one direction.
struct EyeLook {
    facets: Facets,
    /// Sunlight from each direction.
    sunlight: Vec<OnceLock<Vec3>>,
}

/// What a place of averaged cloth shows.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Averaged {
    /// Share of the view that yarns cover.
    pub(super) cover: f32,
    /// Light from the sky and from the yarns around, as a mean over what is covered and what is
    /// not.
    pub(super) sky: Vec3,
    /// That of the sun, where nothing but this cloth hides it.
    pub(super) sun: Vec3,
}

impl<'a> Appearance<'a> {
    pub(super) fn new(cloth: &'a AveragedCloth, rig: &Rig) -> Option<Self> {
        let tracer = RayTracer::new(
            &cloth.piece,
            &cloth.piece.bounds()?,
            &cloth.camera,
            &cloth.options,
            Bounces::Mean,
        );
        let views = (0..2 * HALF).map(|_| OnceLock::new()).collect();
        Some(Self { cloth, tracer, rig: *rig, views })
    }

    /// What cloth shows whose wales, courses and technical face point along these unit axes: right,
    /// up and out of the face.
    pub(super) fn of(&self, axes: &Mat3, toward_eye: Vec3, is_front: bool) -> Averaged {
        let [mut eye, sun, zenith] = [toward_eye, self.rig.toward_sun, self.rig.zenith]
            .map(|direction| axes.transpose() * direction);
        // Along the outline roundings would decide which side is seen.
        eye.z = eye.z.abs() * if is_front { 1.0 } else { -1.0 };
        let suns = around(sun);
        // In the plane of the cloth the sun lights nothing.
        let raised = (sun.z.abs() / FLATTEST).min(1.0);
        let mut all = Averaged::default();
        for (view, weight) in around(eye) {
            let seen = self.views[view].get_or_init(|| self.seen_from(view));
            all.cover += weight * seen.facets.cover;
            all.sky += weight * seen.facets.sky.light(zenith);
            for (sun, share) in suns {
                let light = seen.sunlight[sun].get_or_init(|| self.sunlight(&seen.facets, sun));
                all.sun += weight * share * raised * *light;
            }
        }
        all
    }

    fn seen_from(&self, view: usize) -> EyeLook {
        let facets = self.tracer.facets(direction(view), self.cloth.area, &self.rig);
        EyeLook { facets, sunlight: (0..2 * HALF).map(|_| OnceLock::new()).collect() }
    }

    fn sunlight(&self, facets: &Facets, sun: usize) -> Vec3 {
        self.tracer.sunlight(
            facets,
            sun % PARTS,
            &self.rig.seen_from(direction(sun), self.rig.zenith),
        )
    }
}

/// Direction number `index` of the grid: those of the front half first, then those of the back.
/// Each half lies on a square, as on one side of an octahedron (Meyer et al. 2010, 'On
/// floating-point normal vectors').
fn direction(index: usize) -> Vec3 {
    let (half, index) = (index / HALF, index % HALF);
    let [u, v] =
        [index % SIDE, index / SIDE].map(|step| 2.0 * step as f32 / (SIDE - 1) as f32 - 1.0);
    let [x, y] = [0.5 * (u + v), 0.5 * (u - v)];
    let out = Vec3::new(x, y, 1.0 - x.abs() - y.abs()).normalize();
    // Rays along the cloth would leave its piece.
    let level = out.truncate().normalize_or_zero() * (1.0 - FLATTEST * FLATTEST).sqrt();
    let raised = if out.z < FLATTEST { level.extend(FLATTEST) } else { out };
    Vec3::new(raised.x, raised.y, if half == 0 { raised.z } else { -raised.z })
}

/// The directions of the grid around a unit direction, and their weights.
fn around(toward: Vec3) -> [(usize, f32); AROUND] {
    let sum = toward.abs().element_sum();
    let [x, y] = [toward.x / sum, toward.y / sum];
    let place = (Vec2::new(x + y, x - y) + 1.0) * (0.5 * (SIDE - 1) as f32);
    let low = place.floor().clamp(Vec2::ZERO, Vec2::splat((SIDE - 2) as f32));
    let share = (place - low).clamp(Vec2::ZERO, Vec2::ONE);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the grid")]
    let [column, row] = [low.x as usize, low.y as usize];
    let first = row * SIDE + column + if toward.z.is_sign_negative() { HALF } else { 0 };
    [
        (first, (1.0 - share.x) * (1.0 - share.y)),
        (first + 1, share.x * (1.0 - share.y)),
        (first + SIDE, (1.0 - share.x) * share.y),
        (first + SIDE + 1, share.x * share.y),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::averaged::AveragedCloth;
    use crate::scene::Scene;
    use crate::{Camera, RenderOptions, View, cloth, cpu, tone};
    use image::{GenericImageView, RgbaImage};
    use std::ops::Range;
    use std::sync::Arc;
    use warpknit_core::drape::{Cloth, swatch_panel};
    use warpknit_core::fabric::Fabric;
    use warpknit_core::knit::Pattern;

    /// Wales and courses of the cloth of these tests.
    const WALES: u32 = 60;

    /// A square of a fabric in a picture of so many pixels, as averaged cloth or as traced yarns.
    fn drawn(fabric: &str, size: u32, view: View, is_averaged: bool) -> RgbaImage {
        drawn_rows(fabric, size, view, (is_averaged, None))
    }

    /// Some rows of it.
    fn drawn_rows(
        fabric: &str,
        size: u32,
        view: View,
        (is_averaged, rows): (bool, Option<Range<u32>>),
    ) -> RgbaImage {
        let fabric = Fabric::named(fabric).unwrap();
        let panel = swatch_panel(&fabric, WALES, WALES);
        let pattern = Pattern::new(&fabric);
        let looks = Scene { looks: cloth::looks(&fabric, fabric.radius()), ..Scene::default() };
        let averaged = AveragedCloth::new(&panel, &fabric, &pattern, &looks).unwrap();
        let laid = Cloth::swatch_with(&panel, &fabric, pattern, [WALES; 2]);
        let yarns = cloth::from_cloth(&laid, &fabric);
        let camera = Camera::view(view, &yarns.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
        let options = RenderOptions { width: size, height: size, rows, ..RenderOptions::default() };
        let far = RenderOptions { averaged: Some(Arc::new(averaged)), ..options.clone() };
        let (scene, options) = if is_averaged { (Scene::default(), far) } else { (yarns, options) };
        cpu::render(&scene, &camera, &options, &|_| ())
    }

    /// Mean light of the middle of a picture, as a code.
    fn middle(picture: &RgbaImage) -> Vec3 {
        let size = picture.width();
        let middle = picture.view(size * 3 / 8, size * 3 / 8, size / 4, size / 4);
        let light = |[r, g, b, _]: [u8; 4]| {
            Vec3::from([r, g, b].map(|code| tone::linear(f32::from(code) / 255.0)))
        };
        let sum: Vec3 = middle.pixels().map(|(_, _, pixel)| light(pixel.0)).sum();
        Vec3::from(tone::encode(sum / (size / 4).pow(2) as f32).map(f32::from))
    }

    #[test]
    fn averaged_cloth_is_as_light_as_its_yarns_from_near() {
        for fabric in ["jersey", "locknit", "marquisette"] {
            for view in [View::Front, View::Back, View::Iso] {
                let averaged = middle(&drawn(fabric, 48, view, true));
                let near = middle(&drawn(fabric, 480, view, false));
                let apart = (averaged - near).abs().max_element();
                assert!(apart < 4.0, "{fabric} {view:?}: {averaged} {near}");
            }
        }
    }

    #[test]
    fn threads_and_rows_do_not_change_averaged_cloth() {
        let draw = |threads: usize, rows: Option<Range<u32>>| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| drawn_rows("jersey", 40, View::Iso, (true, rows)))
        };
        let whole = draw(1, None);
        assert!(whole == draw(3, None));
        assert!(draw(2, Some(13..29)).as_raw()[..] == whole.as_raw()[13 * 160..29 * 160]);
    }

    #[test]
    fn directions_of_the_grid_are_around_themselves() {
        for index in 0..2 * HALF {
            let own = direction(index);
            assert!((own.length() - 1.0).abs() < 1e-5);
            if own.z.abs() > FLATTEST + 1e-3 {
                let around = around(own);
                let weight: f32 =
                    around.iter().filter(|(at, _)| *at == index).map(|(_, weight)| weight).sum();
                assert!(weight > 0.999, "{index}: {weight}");
            }
        }
    }
}
