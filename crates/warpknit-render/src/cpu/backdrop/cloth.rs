//! Averaged cloth in a picture.
//!
//! In: an [`AveragedCloth`], its light, and rays from the eye. Out: the light of the cloth's layers
//! along a ray. What cloth does not cover shows what is behind it. The cloth and a body cast the
//! sun's shadow on the cloth.
//!
//! Cost: a ray for each layer that is seen, and rays to the sun.

use glam::{Mat3, Vec3, Vec4};
use rayon::prelude::*;

use super::suns::{EVENLY_LIT, extremes, spread};
use super::triangles::{ALIKE, PictureTriangles};
use crate::averaged::{AveragedCloth, FLATTEST};
use crate::cpu::averaged::{Appearance, Averaged};
use crate::cpu::sample::{SampleDimension, Sampler};
use crate::cpu::to_f32;
use crate::light::Rig;
use crate::set::{LEAVE, MeshHit, MeshSurface, SKIN, Set, passed};
use crate::{Camera, RenderOptions};

/// Share of the view below which no farther layers are looked for: some steps of a pixel's value.
const LEAST_SEEN: f32 = 0.01;
/// Sides of triangles, in pixels, up to which the sun's light is interpolated between their
/// corners.
const SOFT_PIXELS: f32 = 16.0;
/// Difference of the sun's light around a triangle from which on its places need rays of their own.
/// A higher one loses the ends of shadows near what casts them.
const SHARP: f32 = 0.5;
/// Rays from a vertex to the sun where its shadow ends.
const VERTEX_RAYS: u32 = 64;
/// Cosine between normal and sun below which a mesh's triangles shade each other where the cloth
/// that they stand for does not.
const RAKING: f32 = 0.35;
/// How far behind its panel cloth counts that a finished edge turns in, mm. It lies on the rounded
/// surface, which coarse triangles leave by a millimetre or two.
const BEHIND: f32 = 3.0;
/// Distance from one layer to the next at least, mm.
const APART: f32 = 0.01;

/// Averaged cloth, lit.
pub(super) struct LitCloth<'a> {
    cloth: &'a AveragedCloth,
    appearance: Appearance<'a>,
    set: &'a Set,
    rig: Rig,
    eye: Vec3,
    triangles: PictureTriangles,
    /// Share of a layer that yarns cover, seen face on.
    cover: f32,
    /// The fraction of the sun's light at each vertex.
    suns: Vec<f32>,
    /// Whether the light on a triangle is interpolated between its corners.
    is_soft: Vec<bool>,
}

/// The nearest layer of the cloth on a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layer {
    pixel: [u32; 2],
    toward: Vec3,
    hit: MeshHit,
    surface: MeshSurface,
}

/// All layers on a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layers {
    /// Their light, with the share of the view that they cover in w. The sun's light on the nearest
    /// is not in it.
    pub(super) light: Vec4,
    /// Light that the sun adds to the nearest where nothing hides it.
    pub(super) sun: Vec3,
    /// The way along the ray behind which yarns are hidden, mm.
    pub(super) reach: f32,
}

impl Layer {
    /// Whether all rays of a pixel meet one stretch of cloth. `pixel_at` is the size of a pixel at
    /// a distance, mm.
    pub(super) fn are_one(nearest: &[Option<Self>], pixel_at: impl Fn(f32) -> f32) -> bool {
        let [Some(first), rest @ ..] = nearest else { return false };
        let apart = pixel_at(first.hit.distance) / FLATTEST;
        rest.iter().all(|other| {
            other.is_some_and(|other| {
                other.surface.normal.dot(first.surface.normal) > ALIKE
                    && (other.hit.distance - first.hit.distance).abs() < apart
            })
        })
    }
}

impl<'a> LitCloth<'a> {
    /// The cloth in a set, as a camera sees it. `None` for cloth without yarns.
    pub(super) fn new(
        cloth: &'a AveragedCloth,
        set: &'a Set,
        rig: &Rig,
        (camera, options): (&Camera, &RenderOptions),
    ) -> Option<Self> {
        let appearance = Appearance::new(cloth, rig)?;
        let cover = appearance.of(&Mat3::IDENTITY, Vec3::Z, true).cover;
        let eye = camera.eye().as_vec3();
        let (suns, is_soft) = (Vec::new(), Vec::new());
        let triangles = PictureTriangles::new(&cloth.surface, camera, options, |triangle| {
            if cloth.is_turned_in(triangle) { BEHIND } else { 0.0 }
        });
        let lit = Self { cloth, appearance, set, rig: *rig, eye, triangles, cover, suns, is_soft };
        let middle = cloth.surface.bounds().centre();
        let pixel = camera.pixel_size(f64::from(eye.distance(middle)), options.height);
        let suns = lit.suns_at_vertices();
        let is_soft = lit.softly_lit(&suns, SOFT_PIXELS * to_f32(pixel));
        Some(Self { suns, is_soft, ..lit })
    }

    /// The fraction of the sun's light at each vertex.
    fn suns_at_vertices(&self) -> Vec<f32> {
        let (places, normals) = self.cloth.surface.vertices();
        let suns = Sampler::new(0, 0, 0).pairs(SampleDimension::Sun, VERTEX_RAYS);
        let at = |place: Vec3, normal: Vec3| {
            // The side of the cloth that the sun is on.
            let side = normal.dot(self.rig.toward_sun).signum();
            let from = place + normal * (side * LEAVE);
            let sun = |sun: [f32; 2]| self.sun_from(from, normal, self.rig.sun_sample(sun));
            let rim = [0.0, 0.25, 0.5, 0.75].map(|turn| sun([1.0, turn]));
            if spread(rim) > EVENLY_LIT {
                (0..VERTEX_RAYS).map(|ray| sun(suns.at(ray))).sum::<f32>() / VERTEX_RAYS as f32
            } else {
                rim.iter().sum::<f32>() / rim.len() as f32
            }
        };
        places.par_iter().zip(normals).map(|(place, normal)| at(*place, *normal)).collect()
    }

    /// Whether the sun's light on each triangle is interpolated: where it has sides up to `longest`
    /// mm, and where the light is much the same at all vertices next to its corners.
    fn softly_lit(&self, suns: &[f32], longest: f32) -> Vec<bool> {
        let surface = &self.cloth.surface;
        let (places, _) = surface.vertices();
        let mut around: Vec<[f32; 2]> = suns.iter().map(|sun| [*sun; 2]).collect();
        for corners in surface.triangles() {
            let lit = corners.map(|vertex| suns[vertex as usize]);
            let [least, most] = extremes(lit);
            for vertex in corners {
                let [low, high] = &mut around[*vertex as usize];
                (*low, *high) = (low.min(least), high.max(most));
            }
        }
        let is_soft = |corners: &[u32; 3]| {
            let corners = corners.map(|vertex| vertex as usize);
            let [a, b, c] = corners.map(|vertex| places[vertex]);
            let sides = [a.distance(b), b.distance(c), c.distance(a)];
            let near = corners.map(|vertex| around[vertex]);
            let [least, _] = extremes(near.map(|[low, _]| low));
            let [_, most] = extremes(near.map(|[_, high]| high));
            most - least < SHARP && sides.iter().all(|side| *side < longest)
        };
        surface.triangles().par_iter().map(is_soft).collect()
    }

    /// The fraction of the sun's light on a layer, where it is interpolated.
    pub(super) fn interpolated_sun(&self, layer: &Layer) -> Option<f32> {
        let at = |vertex: usize| Vec3::splat(self.suns[vertex]);
        let is_soft = self.is_soft[layer.hit.triangle];
        is_soft.then(|| self.cloth.surface.interpolate(&layer.hit, at).x)
    }

    /// The nearest layer along a ray from the eye through a place of a pixel, within these
    /// distances.
    pub(super) fn nearest(&self, pixel: [u32; 2], toward: Vec3, within: [f32; 2]) -> Option<Layer> {
        let hit = self.triangles.nearest(pixel, toward, within)?;
        Some(self.layer(pixel, toward, hit))
    }

    fn layer(&self, pixel: [u32; 2], toward: Vec3, hit: MeshHit) -> Layer {
        let surface = self.cloth.surface.surface(&hit, self.eye, toward);
        Layer { pixel, toward, hit, surface }
    }

    /// The nearest layer on the ray through a pixel's middle, if it is the nearest on all rays
    /// through the pixel. `pixel_at` is the size of a pixel at a distance, mm.
    ///
    /// The sun's rays start there too. So the edge of a shadow is less smooth if what casts it lies
    /// within some pixels. On skirt and T-shirt no pixel changes by more than 5 of 255.
    pub(super) fn nearest_of_all(
        &self,
        pixel: [u32; 2],
        toward: Vec3,
        pixel_at: impl Fn(f32) -> f32,
    ) -> Option<Layer> {
        // Layers that cross in the pixel are no farther apart in its middle.
        let apart = |distance: f32| 2.0 * pixel_at(distance) / FLATTEST;
        let hit = self.triangles.nearest_of_all(pixel, toward, apart)?;
        Some(self.layer(pixel, toward, hit))
    }

    /// The layers on a ray, from the nearest one to `reach`. Rays go to these places of the sun
    /// from those behind the nearest.
    pub(super) fn behind(
        &self,
        nearest: &Layer,
        reach: f32,
        suns: impl Iterator<Item = [f32; 2]> + Clone,
    ) -> Layers {
        let toward = nearest.toward;
        let seen = self.averaged(nearest);
        let (mut light, mut left) = (seen.sky, 1.0 - seen.cover);
        let mut least = nearest.hit.distance + APART;
        while left > LEAST_SEEN {
            let Some(layer) = self.nearest(nearest.pixel, toward, [least, reach]) else { break };
            least = layer.hit.distance + APART;
            let seen = self.averaged(&layer);
            let lit = self
                .interpolated_sun(&layer)
                .unwrap_or_else(|| self.mean_sun(&layer, suns.clone()));
            light += (seen.sky + seen.sun * lit) * left;
            left *= 1.0 - seen.cover;
        }
        let steep = nearest.surface.normal.dot(toward).abs().max(FLATTEST);
        let reach = nearest.hit.distance + self.cloth.half_depth / steep;
        Layers { light: light.extend(1.0 - left), sun: seen.sun, reach }
    }

    /// The fraction of the light from some places of the sun that reaches a layer.
    pub(super) fn mean_sun(&self, layer: &Layer, suns: impl Iterator<Item = [f32; 2]>) -> f32 {
        let lit = suns.map(|sun| self.sun_at(layer, sun));
        let (sum, count) = lit.fold((0.0, 0.0), |(sum, count), lit| (sum + lit, count + 1.0));
        sum / count
    }

    /// The fraction of the light from a place of the sun that reaches a layer.
    pub(super) fn sun_at(&self, layer: &Layer, sun: [f32; 2]) -> f32 {
        let toward = self.rig.sun_sample(sun);
        let is_through = layer.surface.normal.dot(toward) < 0.0;
        // Light that comes through the layer starts behind it.
        let at = self.eye + layer.toward * layer.hit.distance;
        let from = if is_through { at } else { layer.surface.place };
        self.sun_from(from, layer.surface.normal, toward)
    }

    /// The fraction of the sun's light in a direction that reaches a place of the cloth with this
    /// normal. Where the sun rakes, triangles would block it for the cloth beside them, which is
    /// round. Cloth that is turned in lies so near that it would do the same.
    fn sun_from(&self, from: Vec3, normal: Vec3, toward: Vec3) -> f32 {
        let body = self.set.body.as_ref();
        if body.is_some_and(|body| body.blocks(from, toward, [SKIN, f32::INFINITY])) {
            return 0.0;
        }
        let rakes = normal.dot(toward).abs() < RAKING;
        let leave = if rakes { LEAVE.max(self.cloth.side) } else { LEAVE };
        self.cloth.surface.passes(from, toward, leave, |triangle, cosine| {
            if self.cloth.is_turned_in(triangle) { 1.0 } else { passed(self.cover, cosine) }
        })
    }

    /// What a layer shows of its cloth.
    fn averaged(&self, Layer { toward, hit, surface, .. }: &Layer) -> Averaged {
        let is_front = self.cloth.surface.is_front(hit, *toward);
        let out = if is_front { surface.normal } else { -surface.normal };
        let wale = self.cloth.surface.interpolate(hit, |vertex| self.cloth.wales[vertex]);
        let up = (wale - out * wale.dot(out)).normalize_or(out.any_orthonormal_vector());
        self.appearance.of(&Mat3::from_cols(up.cross(out), up, out), -*toward, is_front)
    }
}
