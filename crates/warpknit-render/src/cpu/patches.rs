//! Small patches of a scene's cloth, traced to learn how much of the sky and of the sun the yarns of
//! cloth leave visible to each other.
//!
//! In: a scene, then one camera after another. Out: [`NearLight`], means over places that the camera
//! sees. The graphics card needs them from afar, where its maps of depths are coarser than yarns:
//! by them alone, oblique cloth had 1.5 times its light. `splat::fit` does the same for the processor's
//! far pictures, from what it has drawn already.
//!
//! Cost: the scene's points are looked at once, and a camera takes [`PATCHES`] x [`PLACES`] places of
//! some 18 rays among a few stitches each. Not promised: the light of a single place.

use glam::{DVec2, Vec3};
use rayon::prelude::*;

use super::raytrace::RayTracer;
use super::sample::{SampleDimension, Sampler};
use super::to_f32;
use crate::light::SKY_REACH_RADII;
use crate::scene::{Bounds, Scene, YarnLook};
use crate::shade::SKY_FACING;
use crate::{Camera, RenderOptions};

/// Patches of a scene. Fewer leave more noise in the means.
const PATCHES: usize = 48;
/// Places in each patch.
const PLACES: u32 = 32;
/// Sky rays at each place.
const SKY_RAYS: u32 = 16;
/// Side of the traced part of a patch, in radii of the thickest yarn: a few stitches.
const PART_RADII: f32 = 64.0;
/// Points of a strand that are taken or left together.
const BLOCK: usize = 16;
/// Size of a pixel for which patches are subdivided, radii: their bends are smooth.
const FINE_RADII: f64 = 0.5;
/// Limit of how much finer than the picture's that is.
const MOST_FINE: f64 = 64.0;
/// Weight of what is expected beforehand, in places. It decides where the camera sees no patch.
const PRIOR_PLACES: f32 = 8.0;
/// What is expected: half of the cloth's depth above a place, and half of the sun's light.
const PRIOR: NearLight =
    NearLight { open: [0.5 * SKY_FACING[0], 0.5 * SKY_FACING[1]], brightness: 1.0, sunshine: 0.5 };

/// What the yarns of cloth leave visible to each other, on average over the places that a camera sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NearLight {
    /// Visible fraction of the sky: a constant, and a factor on the cosine of the angle between normal
    /// and eye.
    pub(crate) open: [f32; 2],
    /// Radiance of the visible sky over that of the whole sky above the same surface.
    pub(crate) brightness: f32,
    /// Fraction of the sun's light on the surfaces that face it.
    pub(crate) sunshine: f32,
}

impl Default for NearLight {
    fn default() -> Self {
        PRIOR
    }
}

/// The patches of a scene.
#[derive(Debug)]
pub(crate) struct Patches {
    patches: Vec<Patch>,
    /// Radius of the thickest yarn, mm.
    thickest: f32,
}

/// The yarns around a place.
#[derive(Debug)]
struct Patch {
    middle: Vec3,
    scene: Scene,
    bounds: Bounds,
}

impl Patches {
    /// Takes patches all over a scene.
    pub(crate) fn new(scene: &Scene) -> Self {
        let (_, thickest) = scene.radii();
        let reach = (PART_RADII / 2.0 + SKY_REACH_RADII + 2.0) * thickest;
        let points = scene.positions.len();
        let mut middles: Vec<Vec3> = (0..PATCHES.min(points))
            .map(|patch| scene.positions[(2 * patch + 1) * points / (2 * PATCHES.min(points))])
            .filter(|middle| middle.is_finite())
            .collect();
        middles.sort_by(|one, other| one.x.total_cmp(&other.x));
        let looks = scene.looks.iter().map(|look| YarnLook { maps: None, ..*look });
        let looks: Vec<_> = looks.collect();
        let mut scenes: Vec<Scene> =
            middles.iter().map(|_| Scene { looks: looks.clone(), ..Scene::default() }).collect();
        for Run { patch, strand, points } in runs(scene, &middles, reach) {
            scenes[patch].push_part(scene, strand, points);
        }
        let patches = middles
            .into_iter()
            .zip(scenes)
            .filter_map(|(middle, scene)| Some(Patch { middle, bounds: scene.bounds()?, scene }));
        Self { patches: patches.collect(), thickest }
    }

    /// What a camera sees of them, where cloth further away does not hide them.
    pub(crate) fn light(
        &self,
        camera: &Camera,
        options: &RenderOptions,
        is_visible: impl Fn(Vec3) -> bool + Sync,
    ) -> NearLight {
        let seen = self.patches.par_iter().filter(|patch| is_visible(patch.middle));
        let sums: Vec<Sums> =
            seen.map(|patch| patch.sums(self.thickest, camera, options)).collect();
        // In order, so that the result does not depend on the number of threads.
        sums.into_iter().fold(Sums::PRIOR, Sums::with).means()
    }
}

/// Consecutive points of a strand that lie near a patch.
struct Run {
    patch: usize,
    strand: usize,
    points: std::ops::Range<u32>,
}

/// The parts of strands that lie within `reach` of places along each axis. The places rise in x.
fn runs(scene: &Scene, middles: &[Vec3], reach: f32) -> Vec<Run> {
    let of_strand = |strand: usize| {
        let all = scene.strands[strand].points.clone();
        let mut runs: Vec<Run> = Vec::new();
        for first in all.clone().step_by(BLOCK) {
            let end = all.end.min(first + BLOCK as u32);
            let block = &scene.positions[first as usize..end as usize];
            let Some(bounds) = Bounds::around(block) else { continue };
            let (low, high) = (bounds.min - reach, bounds.max + reach);
            let from = middles.partition_point(|middle| middle.x < low.x);
            for (patch, middle) in middles.iter().enumerate().skip(from) {
                if middle.x > high.x {
                    break;
                }
                if middle.cmpge(low).all() && middle.cmple(high).all() {
                    let last = runs.iter_mut().rev().find(|run| run.patch == patch);
                    match last.filter(|run| run.points.end == first) {
                        Some(run) => run.points.end = end,
                        None => runs.push(Run { patch, strand, points: first..end }),
                    }
                }
            }
        }
        runs
    };
    let strands = (0..scene.strands.len()).into_par_iter();
    strands
        .filter(|strand| scene.radius(&scene.strands[*strand]).is_some())
        .flat_map_iter(of_strand)
        .collect()
}

impl Patch {
    /// Sums over the places of this patch that the camera sees.
    fn sums(&self, thickest: f32, camera: &Camera, options: &RenderOptions) -> Sums {
        let mut sums = Sums::default();
        let middle = self.middle.as_dvec3();
        let Some(place) = camera.project(middle, options.aspect()) else { return sums };
        if place.abs().max_element() >= 1.0 {
            return sums;
        }
        let pixel = camera.pixel_size(camera.eye().distance(middle), options.height);
        let finer = (pixel / (FINE_RADII * f64::from(thickest))).ceil().clamp(1.0, MOST_FINE);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small")]
        let whole = finer as u32;
        let (width, height) =
            (options.width.saturating_mul(whole), options.height.saturating_mul(whole));
        let fine = RenderOptions {
            width,
            height,
            sky_rays: SKY_RAYS,
            seed: 0,
            spp: 1,
            lod: false,
            ..options.clone()
        };
        let tracer = RayTracer::without_bounces(&self.scene, &self.bounds, camera, &fine);
        let rig = options.light.around(camera);
        let size = DVec2::new(f64::from(width), f64::from(height));
        let at = (place * DVec2::new(0.5, -0.5) + 0.5) * size;
        let side = f64::from(PART_RADII * thickest) / pixel * finer;
        let places = Sampler::new(0, 0, 0).pairs(SampleDimension::Pixel, PLACES);
        for index in 0..PLACES {
            let [across, down] = places.at(index).map(f64::from);
            let place = at + (DVec2::new(across, down) - 0.5) * side;
            if place.cmplt(DVec2::ZERO).any() || place.cmpge(size).any() {
                continue;
            }
            if let Some(sample) = tracer.light_sample([to_f32(place.x), to_f32(place.y)]) {
                sums.count += 1.0;
                sums.cosine += sample.cosine;
                sums.cosine_squared += sample.cosine * sample.cosine;
                sums.open += sample.open;
                sums.open_cosine += sample.open * sample.cosine;
                sums.sun += sample.sun;
                sums.facing += sample.normal.dot(rig.toward_sun).max(0.0);
                sums.light += sample.light;
                sums.unhidden += rig.sky(sample.normal * (2.0 / 3.0)).y * sample.open;
            }
        }
        sums
    }
}

/// Sums over places, for means and a fitted line.
#[derive(Clone, Copy, Default)]
struct Sums {
    count: f32,
    /// Cosines of the angle between normal and eye.
    cosine: f32,
    cosine_squared: f32,
    /// Visible fractions of the sky.
    open: f32,
    open_cosine: f32,
    /// Cosines of the angle between normal and sun, where neither is hidden, and everywhere.
    sun: f32,
    facing: f32,
    /// The sky's green light, and the same where visible sky is as bright as all of it.
    light: f32,
    unhidden: f32,
}

impl Sums {
    /// As many places as the prior weighs, half of them seen head-on and half of them along the cloth.
    const PRIOR: Self = Self {
        count: PRIOR_PLACES,
        cosine: PRIOR_PLACES / 2.0,
        cosine_squared: PRIOR_PLACES / 2.0,
        open: PRIOR_PLACES * (PRIOR.open[0] + PRIOR.open[1] / 2.0),
        open_cosine: PRIOR_PLACES * (PRIOR.open[0] + PRIOR.open[1]) / 2.0,
        sun: PRIOR_PLACES * PRIOR.sunshine,
        facing: PRIOR_PLACES,
        light: PRIOR_PLACES * PRIOR.brightness,
        unhidden: PRIOR_PLACES,
    };

    fn with(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            cosine: self.cosine + other.cosine,
            cosine_squared: self.cosine_squared + other.cosine_squared,
            open: self.open + other.open,
            open_cosine: self.open_cosine + other.open_cosine,
            sun: self.sun + other.sun,
            facing: self.facing + other.facing,
            light: self.light + other.light,
            unhidden: self.unhidden + other.unhidden,
        }
    }

    /// The line by least squares, and the share of sunshine. The prior keeps both denominators
    /// positive.
    fn means(self) -> NearLight {
        let Self { count, cosine, cosine_squared, open, open_cosine, .. } = self;
        let slope =
            (count * open_cosine - cosine * open) / (count * cosine_squared - cosine * cosine);
        NearLight {
            open: [(open - slope * cosine) / count, slope],
            brightness: self.light / self.unhidden,
            sunshine: self.sun / self.facing,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::View;
    use crate::cloth::swatch;
    use warpknit_core::fabric::Fabric;

    #[test]
    fn without_places_the_expected_light_stays() {
        let NearLight { open, brightness, sunshine } = Sums::PRIOR.means();
        assert!((open[0] - PRIOR.open[0]).abs() < 1e-6 && (open[1] - PRIOR.open[1]).abs() < 1e-6);
        assert_eq!([brightness, sunshine], [1.0, 0.5]);
        let empty = Patches::new(&Scene::default());
        let camera = Camera::view(View::Front, &[Vec3::ZERO, Vec3::ONE], 0.3, 1.0, 1.0);
        assert_eq!(empty.light(&camera, &RenderOptions::default(), |_| true), Sums::PRIOR.means());
    }

    #[test]
    fn patches_hold_all_yarns_around_their_middles() {
        let scene = swatch(&Fabric::named("locknit").unwrap(), 30, 30);
        let patches = Patches::new(&scene);
        assert_eq!(patches.patches.len(), PATCHES);
        let reach = (PART_RADII / 2.0 + SKY_REACH_RADII) * patches.thickest;
        for Patch { middle, scene: part, .. } in &patches.patches {
            let near = |point: &&Vec3| (**point - *middle).abs().max_element() < reach;
            for point in scene.positions.iter().filter(near) {
                assert!(part.positions.contains(point), "{point} near {middle}");
            }
            assert!(part.positions.len() < scene.positions.len());
        }
    }

    #[test]
    fn light_is_the_same_for_any_number_of_threads_and_less_where_cloth_is_dense() {
        let light = |name: &str, threads: usize| {
            let scene = swatch(&Fabric::named(name).unwrap(), 40, 40);
            let camera = Camera::view(View::Front, &scene.positions, 0.3, 1.0, 1.0);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let options = RenderOptions { width: 64, height: 64, ..RenderOptions::default() };
            pool.install(|| Patches::new(&scene).light(&camera, &options, |_| true))
        };
        let (dense, sheer) = (light("locknit", 1), light("marquisette", 1));
        assert_eq!(dense, light("locknit", 3));
        let head_on = |light: &NearLight| light.open[0] + light.open[1];
        assert!(head_on(&dense) < head_on(&sheer), "{dense:?} {sheer:?}");
        assert!(dense.sunshine < sheer.sunshine && sheer.sunshine <= 1.0, "{dense:?} {sheer:?}");
    }
}
