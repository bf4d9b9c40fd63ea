//! Small patches of a scene's cloth, traced to learn how much of the sky and of the sun the yarns of
//! cloth leave visible to each other.
//!
//! In: a scene, then one camera after another. Out: [`NearLight`], means over places that the camera
//! sees. The graphics card needs them from afar, where its maps of depths are coarser than yarns:
//! by them alone, oblique cloth had 1.5 times its light. `splat::fit` does the same for the processor's
//! far pictures, from what it has drawn already.
//!
//! Cost: the scene's points are looked at once, and a camera takes [`MOST_TRACED`] x [`PLACES`] places of
//! some 10 rays among a few stitches each. Not promised: the light of a single place.

use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

use glam::{DVec2, Vec3};
use rayon::prelude::*;

use super::raytrace::{Bounces, RayTracer};
use super::sample::{SampleDimension, Sampler};
use super::splat::fit::{LightSample, PART_RADII, factors, finely};
use super::to_f32;
use crate::light::{Light, Rig, SKY_REACH_RADII};
use crate::scene::{Bounds, Scene, Shape, YarnLook, drawable};
use crate::shade::SKY_FACING;
use crate::{Camera, RenderOptions, View};

/// Patches of a scene. With fewer, a camera that is nearer than the whole garment sees hardly any.
const PATCHES: usize = 256;
/// Patches that are traced for one camera. Fewer leave more noise in the means. With 24, two cores take
/// some 20 ms, which a window spends on each frame.
const MOST_TRACED: usize = 24;
/// Patches whose gaps are traced. Twice as many change the factors by a hundredth.
const GAP_PATCHES: usize = 8;
/// Size of their pictures. They are traced as finely as the yarns ask, whatever it is.
const GAP_PIXELS: u32 = 64;
/// Places in each patch.
const PLACES: u32 = 64;
/// Share of the patches by which their places are moved, in turn: the golden ratio. Places at equal
/// distances would lie in one course of a regular cloth.
const SHIFT: f64 = 0.618_033_988_75;
/// Points of a strand that are taken or left together.
const BLOCK: u32 = 16;
/// Weight of what is expected beforehand, in places. It decides where the camera sees no patch.
const PRIOR_PLACES: f32 = 8.0;

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
        LightSums::PRIOR.means()
    }
}

/// The patches of a scene.
#[derive(Debug)]
pub(crate) struct YarnPatches {
    patches: Vec<YarnPatch>,
    /// Radius of the cloth's thickest yarn, mm.
    thickest: f32,
    /// What [`Self::gap_factors`] found last.
    gap_factors: Mutex<Option<(Light, Vec3)>>,
}

/// The yarns around a place.
#[derive(Debug)]
struct YarnPatch {
    middle: Vec3,
    scene: Scene,
    bounds: Bounds,
}

impl YarnPatches {
    /// Takes patches all over a scene of tubes. Other scenes have none.
    pub(crate) fn new(scene: &Scene) -> Self {
        let (_, thickest) = scene.cloth_radii();
        let count = if scene.shape == Shape::Tube { PATCHES.min(scene.positions.len()) } else { 0 };
        let mut middles: Vec<Vec3> =
            (0..count).filter_map(|patch| middle(scene, patch, count)).collect();
        middles.sort_by(|one, other| one.x.total_cmp(&other.x));
        let looks = scene.looks.iter().map(|look| YarnLook { maps: None, ..*look });
        let bare = Scene { looks: looks.collect(), ..Scene::default() };
        let mut scenes = vec![bare; middles.len()];
        let reach = (PART_RADII / 2.0 + SKY_REACH_RADII + 2.0) * thickest;
        let strands = (0..scene.strands.len()).into_par_iter();
        let stretches: Vec<PatchRun> =
            strands.flat_map_iter(|strand| stretches(scene, strand, &middles, reach)).collect();
        for PatchRun { patch, strand, points } in stretches {
            scenes[patch].push_part(scene, strand, points);
        }
        let patches = middles.into_iter().zip(scenes).filter_map(|(middle, scene)| {
            Some(YarnPatch { middle, bounds: scene.bounds()?, scene })
        });
        Self { patches: patches.collect(), thickest, gap_factors: Mutex::default() }
    }

    /// What a camera sees of them, where cloth further away does not hide them.
    pub(crate) fn light(
        &self,
        camera: &Camera,
        options: &RenderOptions,
        is_visible: impl Fn(Vec3) -> bool,
    ) -> NearLight {
        let in_sight = |patch: &&YarnPatch| {
            let place = camera.project(patch.middle.as_dvec3(), options.aspect());
            place.is_some_and(|place| place.abs().max_element() < 1.0) && is_visible(patch.middle)
        };
        let seen: Vec<&YarnPatch> = self.patches.iter().filter(in_sight).collect();
        let some = seen.par_iter().step_by(seen.len().div_ceil(MOST_TRACED).max(1));
        let sums: Vec<LightSums> =
            some.map(|patch| patch.sums(self.thickest, camera, options, Bounces::Mean)).collect();
        // In order, so that the result does not depend on the number of threads.
        sums.into_iter().fold(LightSums::PRIOR, LightSums::with).means()
    }
}

/// The light that yarns reflect to each other.
impl YarnPatches {
    /// Their light where they hide the sky, over the mean light of gaps. It is the mean of some patches
    /// that are seen from the front, whichever the camera, so that it is found once for each light.
    pub(crate) fn gap_factors(&self, light: &Light) -> Vec3 {
        let known = *self.known_gaps();
        if let Some((_, factors)) = known.filter(|(of, _)| of == light) {
            return factors;
        }
        let found = self.trace_gaps(light);
        *self.known_gaps() = Some((*light, found));
        found
    }

    fn known_gaps(&self) -> MutexGuard<'_, Option<(Light, Vec3)>> {
        self.gap_factors.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The same, traced.
    fn trace_gaps(&self, light: &Light) -> Vec3 {
        let options = RenderOptions {
            width: GAP_PIXELS,
            height: GAP_PIXELS,
            light: *light,
            ..RenderOptions::default()
        };
        let patches =
            self.patches.par_iter().step_by(self.patches.len().div_ceil(GAP_PATCHES).max(1));
        let sums: Vec<LightSums> = patches
            .map(|patch| {
                let around =
                    [-1.0, 1.0].map(|side| patch.middle + side * PART_RADII * self.thickest);
                let camera =
                    Camera::view(View::Front, &around, Camera::DEFAULT_FOV, 1.0, options.aspect());
                patch.sums(self.thickest, &camera, &options, Bounces::Traced)
            })
            .collect();
        let sums = sums.into_iter().fold(LightSums::default(), LightSums::with);
        factors(sums.gap, sums.mean_gap)
    }
}

/// The middle of one of so many patches: a point of the scene.
fn middle(scene: &Scene, patch: usize, count: usize) -> Option<Vec3> {
    let points = scene.positions.len();
    let (first, end) = (patch * points / count, (patch + 1) * points / count);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "less than the points"
    )]
    #[expect(clippy::cast_precision_loss, reason = "any point of them will do")]
    let shift = ((SHIFT * patch as f64).fract() * (end - first) as f64) as usize;
    let middle = scene.positions[first + shift];
    drawable(middle).then_some(middle)
}

/// Consecutive points of a strand that lie near a patch.
struct PatchRun {
    patch: usize,
    strand: usize,
    points: Range<u32>,
}

/// The parts of a strand that lie within `reach` of places along each axis. The places rise in x.
fn stretches(scene: &Scene, strand: usize, middles: &[Vec3], reach: f32) -> Vec<PatchRun> {
    let mut found: Vec<PatchRun> = Vec::new();
    if scene.radius(&scene.strands[strand]).is_none() {
        return found;
    }
    let all = scene.strands[strand].points.clone();
    for first in all.clone().step_by(BLOCK as usize) {
        let end = all.end.min(first + BLOCK);
        let block = &scene.positions[first as usize..end as usize];
        let Some(bounds) = Bounds::around(block) else { continue };
        let (low, high) = (bounds.min - reach, bounds.max + reach);
        let from = middles.partition_point(|middle| middle.x < low.x);
        let near =
            middles.iter().enumerate().skip(from).take_while(|(_, middle)| middle.x <= high.x);
        for (patch, _) in
            near.filter(|(_, middle)| middle.cmpge(low).all() && middle.cmple(high).all())
        {
            let last = found.iter_mut().rev().find(|stretch| stretch.patch == patch);
            match last.filter(|stretch| stretch.points.end == first) {
                Some(stretch) => stretch.points.end = end,
                None => found.push(PatchRun { patch, strand, points: first..end }),
            }
        }
    }
    found
}

impl YarnPatch {
    /// Sums over the places of this patch that the camera sees.
    fn sums(
        &self,
        thickest: f32,
        camera: &Camera,
        options: &RenderOptions,
        bounces: Bounces,
    ) -> LightSums {
        let mut sums = LightSums::default();
        let middle = self.middle.as_dvec3();
        let Some(place) = camera.project(middle, options.aspect()) else { return sums };
        let pixel = camera.pixel_size(camera.eye().distance(middle), options.height);
        let (finer, fine) = finely(options, to_f32(pixel) / thickest);
        let tracer = RayTracer::new(&self.scene, &self.bounds, camera, &fine, bounces);
        let rig = options.light.around(camera);
        let size = DVec2::new(f64::from(fine.width), f64::from(fine.height));
        let at = (place * DVec2::new(0.5, -0.5) + 0.5) * size;
        let side = f64::from(PART_RADII * thickest) / pixel * f64::from(finer);
        // Each patch has places of its own.
        let number = self.middle.x.to_bits() ^ self.middle.y.to_bits();
        let places =
            Sampler::new(number & 0xFFFF, number >> 16, 0).pairs(SampleDimension::Pixel, PLACES);
        for index in 0..PLACES {
            let place = at + (DVec2::from(places.at(index).map(f64::from)) - 0.5) * side;
            if place.cmplt(DVec2::ZERO).any() || place.cmpge(size).any() {
                continue;
            }
            let sample = tracer.light_sample([to_f32(place.x), to_f32(place.y)]);
            // Farther away, on oblique cloth, the patch lacks yarns that hide light.
            let is_inside = |sample: &LightSample| {
                (sample.position - self.middle).abs().max_element() <= PART_RADII / 2.0 * thickest
            };
            if let Some(sample) = sample.filter(is_inside) {
                sums.add(&sample, &rig);
            }
        }
        sums
    }
}

/// Sums over places, for means and a fitted line.
#[derive(Clone, Copy, Default)]
struct LightSums {
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
    /// Light of the yarns that hide the sky, and the same by the mean light of gaps.
    gap: Vec3,
    mean_gap: Vec3,
}

impl LightSums {
    /// What is expected: half of the cloth's depth above a place, and half of the sun's light. Half of
    /// the places are seen head-on and half of them along the cloth.
    const PRIOR: Self = Self {
        count: PRIOR_PLACES,
        cosine: PRIOR_PLACES / 2.0,
        cosine_squared: PRIOR_PLACES / 2.0,
        open: PRIOR_PLACES / 2.0 * (SKY_FACING[0] + SKY_FACING[1] / 2.0),
        open_cosine: PRIOR_PLACES / 2.0 * (SKY_FACING[0] + SKY_FACING[1]) / 2.0,
        sun: PRIOR_PLACES / 2.0,
        facing: PRIOR_PLACES,
        light: PRIOR_PLACES,
        unhidden: PRIOR_PLACES,
        gap: Vec3::ZERO,
        mean_gap: Vec3::ZERO,
    };

    fn add(&mut self, sample: &LightSample, rig: &Rig) {
        self.count += 1.0;
        self.cosine += sample.cosine;
        self.cosine_squared += sample.cosine * sample.cosine;
        self.open += sample.open;
        self.open_cosine += sample.open * sample.cosine;
        self.sun += sample.sun;
        self.facing += sample.normal.dot(rig.toward_sun).max(0.0);
        self.gap += sample.gap;
        self.mean_gap += sample.mean_gap;
        // Over the mean sky, so that the prior weighs as much under any light.
        let sky = rig.sky(Vec3::ZERO).y;
        if sky > 0.0 {
            self.light += sample.light / sky;
            self.unhidden += rig.sky(sample.normal * (2.0 / 3.0)).y * sample.open / sky;
        }
    }

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
            gap: self.gap + other.gap,
            mean_gap: self.mean_gap + other.mean_gap,
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
        let NearLight { open, brightness, sunshine } = NearLight::default();
        let expected = SKY_FACING.map(|term| term / 2.0);
        assert!((open[0] - expected[0]).abs() < 1e-6 && (open[1] - expected[1]).abs() < 1e-6);
        assert_eq!([brightness, sunshine], [1.0, 0.5]);
        let empty = YarnPatches::new(&Scene::default());
        let camera = Camera::view(View::Front, &[Vec3::ZERO, Vec3::ONE], 0.3, 1.0, 1.0);
        assert_eq!(empty.light(&camera, &RenderOptions::default(), |_| true), NearLight::default());
    }

    #[test]
    fn patches_hold_all_yarns_around_their_middles() {
        let scene = swatch(&Fabric::named("locknit").unwrap(), 30, 30);
        let patches = YarnPatches::new(&scene);
        assert_eq!(patches.patches.len(), PATCHES);
        assert!(
            YarnPatches::new(&Scene { shape: Shape::Ribbon, ..scene.clone() }).patches.is_empty()
        );
        let reach = (PART_RADII / 2.0 + SKY_REACH_RADII) * patches.thickest;
        for YarnPatch { middle, scene: part, .. } in &patches.patches {
            let near = |point: &&Vec3| (**point - *middle).abs().max_element() < reach;
            for point in scene.positions.iter().filter(near) {
                assert!(part.positions.contains(point), "{point} near {middle}");
            }
            assert!(part.positions.len() < scene.positions.len());
        }
    }

    /// What a camera before a swatch sees, under a sky so many times as bright.
    fn before(fabric: &str, sky: f32) -> NearLight {
        let scene = swatch(&Fabric::named(fabric).unwrap(), 40, 40);
        let camera = Camera::view(View::Front, &scene.positions, 0.3, 1.0, 1.0);
        let mut options = RenderOptions { width: 64, height: 64, ..RenderOptions::default() };
        options.light.sky_above *= sky;
        options.light.sky_below *= sky;
        YarnPatches::new(&scene).light(&camera, &options, |_| true)
    }

    #[test]
    fn light_is_less_where_cloth_is_dense_and_no_matter_of_brightness_and_threads() {
        let (dense, sheer) = (before("locknit", 1.0), before("marquisette", 1.0));
        let head_on = |light: &NearLight| light.open[0] + light.open[1];
        assert!(head_on(&dense) < head_on(&sheer), "{dense:?} {sheer:?}");
        assert!(dense.sunshine < sheer.sunshine && sheer.sunshine <= 1.0, "{dense:?} {sheer:?}");
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        assert_eq!(pool.install(|| before("locknit", 1.0)), dense);
        let dim = before("locknit", 0.01);
        assert!((dim.brightness - dense.brightness).abs() < 1e-3, "{dim:?} {dense:?}");
    }

    #[test]
    fn what_gaps_reflect_has_the_colour_of_the_cloth_once_more() {
        let mut scene = swatch(&Fabric::named("jersey").unwrap(), 40, 40);
        scene.looks.iter_mut().for_each(|look| look.albedo = Vec3::new(0.8, 0.4, 0.2));
        let patches = YarnPatches::new(&scene);
        let usual = Light::default();
        let factors = patches.gap_factors(&usual);
        assert!(factors.x > factors.y && factors.y > factors.z, "{factors}");
        assert_eq!(patches.gap_factors(&usual), factors);
        let low = Light { sun_direction: Vec3::new(-1.0, 0.0, 0.1), ..usual };
        assert_ne!(patches.gap_factors(&low), factors);
        assert_eq!(patches.gap_factors(&usual), factors);
        assert_eq!(YarnPatches::new(&Scene::default()).gap_factors(&usual), Vec3::ONE);
    }
}
