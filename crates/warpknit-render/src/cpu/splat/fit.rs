//! How much of the sky and of the sun the yarns of a scene leave visible, as functions of what is
//! cheap to know.
//!
//! In: the pieces, blocks and shadow map of a picture. Out: [`LightFit`]. At places in up to 256 tiles
//! of the picture, rays are traced against the yarns around, as the ray tracer does everywhere. The
//! idea is that of a control variate: a cheap estimate is wrong, but its mean error is measured.
//!
//! - Sky: a least-squares fit gives the visibility from two features of a place, its level in the
//!   cloth ([`crate::shade::sky_level`]) and the angle of its normal to the eye. A fixed fit to two
//!   fabrics was up to 17 % off seen from the front, and 59 % seen obliquely.
//! - Gaps: a factor on the mean light of yarns that hide the sky. What they reflect is traced there.
//! - Sun: a factor on what the shadow map says. The map's texels let light through between yarns,
//!   more from afar. Shadows of distant cloth are left out of the comparison.
//!
//! The places depend on the whole picture only. So single rows of it, and any number of threads,
//! give the same fit. Not promised: the visibility at a single place, which is off by about 0.15.

use std::ops::Range;

use glam::{DMat4, DVec4, Vec2, Vec3, Vec3Swizzles, Vec4};
use rayon::prelude::*;

use super::blocks::Blocks;
use super::layers::LayerDepths;
use super::masks::{HalfPlanes, places};
use super::pieces::{BLOCK, SplatPieces};
use super::screen::Screen;
use super::sun::ShadowMap;
use super::tiles::{SIDE, TileMemory};
use crate::cpu::raytrace::{Bounces, RayTracer};
use crate::cpu::sample::{SampleDimension, Sampler};
use crate::light::{Rig, SKY_REACH_RADII};
use crate::scene::{Bounds, Scene, YarnLook};
use crate::shade::SKY_FACING;
use crate::{Camera, RenderOptions};
use warpknit_core::ids::index32;

/// Tiles across and down whose light is traced. With 12, the sun's share is off by up to 2 %. More
/// take longer than they are worth: these take 0.2 to 0.3 CPU seconds.
const TRACED_TILES: u32 = 16;
/// Sets of 64 places in each tile, where the picture has all these tiles. With half of them, the sun's
/// share is off by up to 2 %.
const SETS: u32 = 4;
/// Sets of places in each tile at most, where the picture has fewer tiles. Yarns of a single tile tell
/// no more with more places.
const MOST_SETS: u32 = 16;
/// Sky rays at each place. More places with fewer rays tell more for the same time: from each, one
/// ray goes to the sun.
const SKY_RAYS: u32 = 4;
/// Side of the traced part in the middle of a tile, in radii of the thickest yarn: about a stitch. The
/// places of a tile are spread evenly over it.
pub(in crate::cpu) const PART_RADII: f32 = 16.0;
/// Limits of that side, cells. The tile must know the depths around it.
const PART_CELLS: [f32; 2] = [2.0, 8.0];
/// Size of a pixel for which the traced yarns are subdivided, radii: their bends are smooth.
const FINE_RADII: f32 = 0.5;
/// Limit of how much finer than the picture's that is.
const MAX_FINER: f32 = 64.0;
/// Weight of the fixed fit, in places. It decides where a picture shows hardly any yarn.
const PRIOR_PLACES: f64 = 8.0;
/// Limits of the factors. Beyond them are only fits to too few places.
const FACTORS: [f32; 2] = [0.5, 1.5];

/// The fit.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightFit {
    /// Weights of 1, level, cosine, and level times cosine.
    weights: Vec4,
    /// Radiance of the visible sky over that of the whole sky above the same surface.
    brightness: f32,
    /// The sun's light as traced over that by the shadow map.
    sunshine: f32,
    /// The light of gaps as traced over their mean light. It has a colour: each bounce adds that of the
    /// yarn.
    gaps: Vec3,
}

/// What is traced at a place.
pub(in crate::cpu) struct LightSample {
    /// In the world.
    pub(in crate::cpu) position: Vec3,
    pub(in crate::cpu) normal: Vec3,
    /// Cosine of the angle between the normal and the direction to the eye.
    pub(in crate::cpu) cosine: f32,
    pub(in crate::cpu) radius: f32,
    /// Visible fraction of the sky.
    pub(in crate::cpu) open: f32,
    /// Green light from there.
    pub(in crate::cpu) light: f32,
    /// Light of the yarns that hide the rest.
    pub(in crate::cpu) gap: Vec3,
    /// The same by the mean light of gaps.
    #[cfg_attr(
        not(feature = "gpu"),
        expect(dead_code, reason = "the graphics card's patches alone read it")
    )]
    pub(in crate::cpu) mean_gap: Vec3,
    /// Cosine of the angle between normal and sun, where neither is hidden. Otherwise 0.
    pub(in crate::cpu) sun: f32,
}

/// A sample and the cheap estimates.
struct Observed {
    level: f32,
    /// The sun's light by the shadow map, or `None` in the shadow of distant cloth.
    sun: Option<f32>,
    sample: LightSample,
}

/// What a picture is made from.
#[derive(Clone, Copy)]
pub(super) struct Picture<'a> {
    pub(super) pieces: &'a SplatPieces<'a>,
    pub(super) screen: &'a Screen,
    pub(super) planes: &'a HalfPlanes,
    pub(super) blocks: &'a Blocks,
    pub(super) shadows: &'a ShadowMap,
    pub(super) toward_sun: Vec3,
    pub(super) camera: &'a Camera,
    pub(super) options: &'a RenderOptions,
    pub(super) split: u32,
}

impl LightFit {
    /// Traces places of a picture and fits them.
    pub(super) fn new(picture: Picture<'_>, rig: &Rig) -> Self {
        let [columns, rows] = picture.screen.size.map(|side| spread(side.div_ceil(SIDE)));
        let tiles = rows.flat_map(|row| columns.clone().map(move |column| [column, row]));
        let tiles: Vec<_> = tiles.collect();
        let sets = SETS * (TRACED_TILES * TRACED_TILES) / index32(tiles.len()).max(1);
        let sets = sets.clamp(SETS, MOST_SETS);
        let observed: Vec<Vec<Observed>> = tiles
            .into_par_iter()
            .map_init(TileMemory::new, |memory, tile| {
                observe(picture, memory, tile, sets).unwrap_or_default()
            })
            .collect();
        Self::of(rig, picture.pieces.scene.mean_albedo(), observed.iter().flatten())
    }

    /// The least-squares fit.
    fn of<'a>(
        rig: &Rig,
        albedo: Vec3,
        observed: impl Iterator<Item = &'a Observed> + Clone,
    ) -> Self {
        let prior = Vec4::new(0.0, SKY_FACING[0], 0.0, SKY_FACING[1]);
        let mut matrix = DMat4::from_diagonal(DVec4::splat(PRIOR_PLACES));
        let mut vector = DVec4::ZERO;
        let (mut light, mut expected) = (0.0, 0.0);
        let (mut sun, mut mapped) = (0.0, 0.0);
        for Observed { level, sun: by_map, sample } in observed.clone() {
            let own = features(*level, sample.cosine);
            let error = f64::from(sample.open - own.dot(prior));
            let own = own.as_dvec4();
            matrix += DMat4::from_cols(own * own.x, own * own.y, own * own.z, own * own.w);
            vector += own * error;
            if let Some(by_map) = by_map {
                sun += sample.sun;
                mapped += by_map;
            }
            light += sample.light;
            expected += rig.sky(sample.normal * (2.0 / 3.0)).y * sample.open;
        }
        // The prior's places make the matrix positive definite.
        let weights = prior + (matrix.inverse() * vector).as_vec4();
        let (brightness, sunshine) = (factor(light, expected), factor(sun, mapped));
        let fit = Self { weights, brightness, sunshine, gaps: Vec3::ONE };
        let gaps = fit.traced_gaps(rig, albedo, observed);
        Self { gaps, ..fit }
    }

    /// The factor on the mean light of gaps, where the sky is open as fitted.
    fn traced_gaps<'a>(
        &self,
        rig: &Rig,
        albedo: Vec3,
        observed: impl Iterator<Item = &'a Observed>,
    ) -> Vec3 {
        let (mut traced, mut mean) = (Vec3::ZERO, Vec3::ZERO);
        for Observed { level, sample, .. } in observed {
            let open = self.open(*level, sample.cosine);
            let gap = rig.gap_light(open, sample.normal.dot(rig.toward_sun)) * albedo;
            traced += sample.gap;
            mean += gap * (1.0 - open);
        }
        factors(traced, mean)
    }

    /// Visible fraction of the sky.
    pub(super) fn open(&self, level: f32, cosine: f32) -> f32 {
        features(level, cosine).dot(self.weights).clamp(0.0, 1.0)
    }

    /// See the field.
    pub(super) fn brightness(&self) -> f32 {
        self.brightness
    }

    /// See the field.
    pub(super) fn sunshine(&self) -> f32 {
        self.sunshine
    }

    /// See the field.
    pub(super) fn gaps(&self) -> Vec3 {
        self.gaps
    }
}

/// A sum that was traced over the same by an estimate.
fn factor(traced: f32, estimated: f32) -> f32 {
    let [least, most] = FACTORS;
    if estimated > 0.0 { (traced / estimated).clamp(least, most) } else { 1.0 }
}

/// The same for each channel.
pub(in crate::cpu) fn factors(traced: Vec3, estimated: Vec3) -> Vec3 {
    Vec3::from_array([0, 1, 2].map(|channel| factor(traced[channel], estimated[channel])))
}

fn features(level: f32, cosine: f32) -> Vec4 {
    Vec4::new(1.0, level, cosine, level * cosine)
}

/// Some of `count` columns or rows of tiles, spread evenly.
fn spread(count: u32) -> impl Iterator<Item = u32> + Clone {
    let some = count.min(TRACED_TILES);
    (0..some).map(move |index| (2 * index + 1) * count / (2 * some))
}

/// Traces some sets of places in the middle of a tile.
fn observe(
    picture: Picture<'_>,
    memory: &mut TileMemory,
    [column, row]: [u32; 2],
    sets: u32,
) -> Option<Vec<Observed>> {
    let Picture { pieces, screen, planes, blocks, camera, options, split, .. } = picture;
    let corner = [column * SIDE, row * SIDE];
    let tile = memory.tile((pieces, screen, planes), corner, blocks.of(column, row));
    let nearest = blocks.of(column, row).iter().fold(f32::INFINITY, |a, b| a.min(b.nearest));
    let (thinnest, thickest) = pieces.scene.cloth_radii();
    let layers = LayerDepths::of_tile(&tile, [column, row], thinnest, split);
    let radius = screen.radius(thickest, nearest.max(thickest));
    let side = (PART_RADII * radius).clamp(PART_CELLS[0], PART_CELLS[1]);
    let middle = Vec2::new(corner[0] as f32, corner[1] as f32) + SIDE as f32 / 2.0;
    let around = side / 2.0 + (SKY_REACH_RADII + 2.0) * radius;
    let scene = yarns_near(pieces, screen, blocks, [middle - around, middle + around]);
    let bounds = scene.bounds()?;
    let (finer, fine) = finely(options, split as f32 / radius);
    let tracer = RayTracer::new(&scene, &bounds, camera, &fine, Bounces::Traced);
    let scale = finer as f32 / split as f32;
    let shifts = Sampler::new(4 * column, 4 * row, 0).pairs(SampleDimension::Pixel, sets);
    let set = |set| places().map(|place| (place + Vec2::from(shifts.at(set))).fract());
    let observed = (0..sets).flat_map(set).filter_map(|place| {
        let place = middle + (place - 0.5) * side;
        let sample = tracer.light_sample((place * scale).to_array())?;
        let position = sample.position - pieces.centre;
        let level = layers.sky_level(place, sample.radius, screen.depth(position));
        let cosine = sample.normal.dot(picture.toward_sun).max(0.0);
        let lit = picture.shadows.lit_by_near(position, sample.radius);
        Some(Observed { level, sun: lit.map(|lit| if lit { cosine } else { 0.0 }), sample })
    });
    Some(observed.collect())
}

/// Options of pictures that are traced so finely that bends are smooth, where a pixel is so many radii
/// wide, and how much finer than the given ones they are.
pub(in crate::cpu) fn finely(options: &RenderOptions, pixel: f32) -> (u32, RenderOptions) {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small")]
    let finer = (pixel / FINE_RADII).ceil().clamp(1.0, MAX_FINER) as u32;
    let fine = RenderOptions {
        width: options.width.saturating_mul(finer),
        height: options.height.saturating_mul(finer),
        sky_rays: SKY_RAYS,
        // Far yarns have no noise, and so no seed.
        seed: 0,
        spp: 1,
        lod: false,
        ..options.clone()
    };
    (finer, fine)
}

/// The yarns of the blocks that meet a part of the picture, without textures.
fn yarns_near(
    pieces: &SplatPieces<'_>,
    screen: &Screen,
    blocks: &Blocks,
    [low, high]: [Vec2; 2],
) -> Scene {
    let [columns, rows] = [0, 1].map(|axis| tiles(low[axis], high[axis], screen.size[axis]));
    let tiles = rows.flat_map(|row| columns.clone().map(move |column| [column, row]));
    let mut firsts: Vec<u32> = tiles
        .flat_map(|[column, row]| blocks.of(column, row))
        .map(|block| block.first)
        .filter(|first| meets(pieces, screen, *first, [low, high]))
        .collect();
    firsts.sort_unstable();
    firsts.dedup();
    let looks = pieces.scene.looks.iter().map(|look| YarnLook { maps: None, ..*look });
    // Places relative to the whole's centre do not depend on how much of a tile's yarn is there.
    let extent = Some(Bounds { min: pieces.centre, max: pieces.centre });
    let mut scene = Scene { looks: looks.collect(), extent, ..Scene::default() };
    let mut runs = firsts.chunk_by(|one, next| {
        // Blocks of a strand in a row; another strand's first block starts before the end of 16.
        *next == one + BLOCK && pieces.strand_of(*one) == pieces.strand_of(*next)
    });
    runs.by_ref().for_each(|run| {
        scene.push_part(
            pieces.scene,
            pieces.strand_of(run[0]),
            run[0]..run[run.len() - 1] + BLOCK + 1,
        );
    });
    scene
}

/// Whether a block meets a part of the picture.
fn meets(pieces: &SplatPieces<'_>, screen: &Screen, first: u32, [low, high]: [Vec2; 2]) -> bool {
    let mut met = false;
    pieces.for_each_in_block(first, screen, |_, ends, _| {
        met |= ends.iter().any(|end| end.xy().cmpge(low).all() && end.xy().cmple(high).all());
    });
    met
}

/// Columns or rows of tiles from `low` to `high`.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturates, as it should"
)]
fn tiles(low: f32, high: f32, size: u32) -> Range<u32> {
    let side = SIDE as f32;
    ((low / side) as u32)..((high / side) as u32 + 1).min(size.div_ceil(SIDE))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::View;
    use crate::cloth::swatch;
    use warpknit_core::fabric::Fabric;

    /// Places all over a grid of levels and cosines, with the light of an exact law.
    fn lawful(rig: &Rig, law: Vec4) -> Vec<Observed> {
        let grid = (0_u8..80).flat_map(|a| (0_u8..80).map(move |b| [a, b]));
        let observed = grid.map(|at| {
            let [level, cosine] = at.map(|at| f32::from(at) / 80.0);
            let (normal, open) = (Vec3::Z, features(level, cosine).dot(law));
            let light = 0.8 * rig.sky(normal * (2.0 / 3.0)).y * open;
            let position = Vec3::ZERO;
            let is_near = level < 0.5;
            let sun = if is_near { 0.7 } else { 0.1 };
            let mean_gap = rig.gap_light(open, normal.dot(rig.toward_sun)) * (1.0 - open);
            let gap = mean_gap * Vec3::new(1.2, 1.1, 1.0);
            let sample = LightSample {
                position,
                normal,
                cosine,
                radius: 1.0,
                open,
                light,
                gap,
                mean_gap,
                sun,
            };
            Observed { level, sun: is_near.then_some(1.0), sample }
        });
        observed.collect()
    }

    #[test]
    fn a_law_is_found_and_nothing_is_guessed_without_places() {
        let options = RenderOptions::default();
        let camera = Camera::view(View::Front, &[Vec3::ZERO, Vec3::ONE], 0.3, 1.0, 1.0);
        let rig = options.light.around(&camera);
        let law = Vec4::new(0.1, 0.4, 0.2, 0.25);
        let mut observed = lawful(&rig, law);
        let fit = LightFit::of(&rig, Vec3::ONE, observed.iter());
        for (level, cosine) in [(0.1, 0.9), (0.5, 0.5), (0.9, 0.2)] {
            let expected = features(level, cosine).dot(law);
            assert!((fit.open(level, cosine) - expected).abs() < 0.02, "{fit:?}");
        }
        assert!((fit.brightness() - 0.8).abs() < 1e-3, "{fit:?}");
        assert!((fit.sunshine() - 0.7).abs() < 1e-3, "distant shadows do not count: {fit:?}");
        assert!(fit.gaps().abs_diff_eq(Vec3::new(1.2, 1.1, 1.0), 0.01), "{fit:?}");
        observed.iter_mut().for_each(|place| place.sample.sun = 9.0);
        assert_eq!(LightFit::of(&rig, Vec3::ONE, observed.iter()).sunshine(), FACTORS[1]);
        let none = LightFit::of(&rig, Vec3::ONE, [].iter());
        assert_eq!((none.brightness(), none.sunshine(), none.gaps()), (1.0, 1.0, Vec3::ONE));
        assert_eq!(none.weights, Vec4::new(0.0, SKY_FACING[0], 0.0, SKY_FACING[1]));
    }

    #[test]
    fn the_mean_of_what_is_traced_is_kept() {
        for (name, view) in [("tricot", View::Front), ("marquisette", View::Back)] {
            let scene = swatch(&Fabric::named(name).unwrap(), 60, 60);
            let bounds = scene.bounds().unwrap();
            let camera = Camera::view(view, &scene.positions, 0.3, 1.0, 1.0);
            let options = RenderOptions { width: 64, height: 64, ..RenderOptions::default() };
            let screen = Screen::new(&bounds, &camera, &options, 1);
            let pieces = SplatPieces::new(&scene, bounds.centre());
            let blocks = Blocks::new(&pieces, &screen, 0..4);
            let (planes, rig) = (HalfPlanes::new(), options.light.around(&camera));
            let shadows = ShadowMap::new(&pieces, &screen, 1.0, rig.toward_sun);
            let picture = Picture {
                pieces: &pieces,
                screen: &screen,
                planes: &planes,
                blocks: &blocks,
                shadows: &shadows,
                toward_sun: rig.toward_sun,
                camera: &camera,
                options: &options,
                split: 1,
            };
            let fit = LightFit::new(picture, &rig);
            let tiles = (0..4).flat_map(|row| (0..4).map(move |column| [column, row]));
            let observed: Vec<_> = tiles
                .filter_map(|tile| observe(picture, &mut TileMemory::new(), tile, SETS))
                .flatten()
                .collect();
            let mean = |open: &dyn Fn(&Observed) -> f32| {
                observed.iter().map(open).sum::<f32>() / observed.len() as f32
            };
            let traced = mean(&|place| place.sample.open);
            let fitted = mean(&|place| fit.open(place.level, place.sample.cosine));
            assert!(observed.len() > 200, "{name}: {} places", observed.len());
            assert!((0.2..0.9).contains(&traced), "{name}: {traced}");
            assert!((fitted / traced - 1.0).abs() < 0.03, "{name}: {fitted} for {traced}");
        }
    }
}
