//! What flat cloth shows to a distant eye: the places of its yarns that parallel rays meet.
//!
//! In: a [`RayTracer`] of a flat piece of cloth, and directions in the cloth's axes. Out:
//! [`Facets`], the places that an eye sees, and the light that they reflect toward it, as means
//! over the area of the cloth. Rays and shading are those of pictures. Yarns that hide the sky have
//! the mean light of gaps, as the sun is not known yet.
//!
//! Sky light is linear in the direction to the brightest sky. So it is found once for each
//! direction to the eye ([`SkyResponse`]), and then holds for a cloth that is turned in any way.

use glam::{Mat3, Vec2, Vec3};

use super::ray::SceneRay;
use super::sky::SkyRays;
use super::{RayTracer, SurfaceHit};
use crate::bvh::tree::Waiting;
use crate::cpu::lit::{SkyLight, sun_reflection};
use crate::cpu::sample::{SampleDimension, Sampler};
use crate::cpu::share;
use crate::light::Rig;
use warpknit_core::ids::index32;

/// Rays for each direction to the eye. With half as many, some cloth is two percent too dark.
const RAYS: u32 = 512;
/// Parts of the facets, of which the sun lights one for each of its directions. Light from between
/// directions with different parts is a mean of them all, weighted as they are. The picture of
/// README's skirt is off by 0.1 to 0.3 of 255 more than with all facets for each direction.
pub(in crate::cpu) const PARTS: usize = 3;

/// The cosine of the angle between the sun and the normals that an eye sees, on average: the sun's place
/// is not known yet. Between 0 and 0.6 the light of gaps changes by a fifth.
const MEAN_COSINE: f32 = 0.3;

/// The places of a cloth that a distant eye sees.
pub(in crate::cpu) struct Facets {
    hits: Vec<SurfaceHit>,
    /// Share of the cloth's area that yarns cover, seen from there.
    pub(in crate::cpu) cover: f32,
    pub(in crate::cpu) sky: SkyResponse,
}

/// Light of the sky that cloth reflects toward an eye, as a mean over its area.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::cpu) struct SkyResponse {
    /// That of a sky whose bright half lies nowhere.
    mean: Vec3,
    /// What the unit directions to the brightest sky add, one a column.
    slopes: Mat3,
}

impl SkyResponse {
    /// The light where the brightest sky is in this direction, in the cloth's axes.
    pub(in crate::cpu) fn light(&self, zenith: Vec3) -> Vec3 {
        self.mean + self.slopes * zenith
    }
}

impl RayTracer<'_> {
    /// The places seen of a flat cloth that faces +z, from far away in the direction `toward_eye`.
    /// Rays are spread over an area between two corners, mm. The light's colours are those of
    /// `rig`.
    pub(in crate::cpu) fn facets(&self, toward_eye: Vec3, area: [Vec2; 2], rig: &Rig) -> Facets {
        let sampler = Sampler::new(0, 0, 0);
        let mut waiting = Waiting::new();
        let rigs = probes(rig);
        let (mut hits, mut sums) = (Vec::with_capacity(RAYS as usize), [Vec3::ZERO; 4]);
        for index in 0..RAYS {
            let ray = self.distant_ray(
                toward_eye,
                area,
                sampler.pair(SampleDimension::Pixel, index, RAYS),
            );
            let Some(hit) = self.bvh.nearest(&ray, &mut waiting) else { continue };
            let here = self.surface_hit(&ray, hit);
            let skies = self.sky_of_rigs(&here, &rigs, (&sampler, index), &mut waiting);
            for (sum, (sky, rig)) in sums.iter_mut().zip(skies.iter().zip(&rigs)) {
                *sum += sky.reflected(rig, &here.surface, toward_eye) * here.occlusion;
            }
            hits.push(here);
        }
        let [right, left, up, toward] = sums.map(|sum| sum * share(1, RAYS));
        let mean = (right + left) * 0.5;
        let slopes = Mat3::from_cols((right - left) * 0.5, up - mean, toward - mean);
        let cover = share(index32(hits.len()), RAYS);
        Facets { hits, cover, sky: SkyResponse { mean, slopes } }
    }

    /// The sun's light that facets reflect toward their eye, as a mean over the cloth's area, where
    /// the sun stands as in `rig`, in the cloth's axes. Part number `part` of the facets stands for
    /// all.
    pub(in crate::cpu) fn sunlight(&self, facets: &Facets, part: usize, rig: &Rig) -> Vec3 {
        let sampler = Sampler::new(0, 0, 0);
        let mut waiting = Waiting::new();
        let (mut sum, mut count) = (Vec3::ZERO, 0);
        for (index, here) in (0..).zip(&facets.hits).skip(part).step_by(PARTS) {
            count += 1;
            let toward = rig.sun_sample(sampler.pair(SampleDimension::Sun, index, RAYS));
            if here.surface.normal.dot(toward) <= 0.0 || here.smooth_normal.dot(toward) <= 0.0 {
                continue;
            }
            let ray = here.secondary_ray(toward, f32::INFINITY);
            if self.bvh.occluder(&ray, here.start, &mut waiting).is_none() {
                sum += sun_reflection(rig, &here.surface, toward, here.toward_eye);
            }
        }
        sum * share(index32(facets.hits.len()), RAYS * u32::max(count, 1))
    }

    /// The ray from a distant eye to a place of the area, 0..1 along both sides.
    fn distant_ray(&self, toward_eye: Vec3, [low, high]: [Vec2; 2], place: [f32; 2]) -> SceneRay {
        let centre = self.bvh.segments.paths.centre.as_vec3();
        let bounds = &self.bvh.segments.bounds;
        let middle = 0.5 * (bounds.min.z + bounds.max.z);
        let at = (low + (high - low) * Vec2::from(place) - centre.truncate()).extend(middle);
        let height = bounds.max.z - middle;
        let origin = at + toward_eye * (height / toward_eye.z.abs());
        let footprint = self.eye.pixel_at(at);
        SceneRay { origin, direction: -toward_eye, reach: f32::INFINITY, footprint, random_bits: 0 }
    }

    /// The sky's light at a hit, for each of some rigs.
    fn sky_of_rigs(
        &self,
        here: &SurfaceHit,
        rigs: &[Rig; 4],
        (sampler, index): (&Sampler, u32),
        waiting: &mut Waiting,
    ) -> [SkyLight; 4] {
        let count = self.eye.options.sky_rays.max(1);
        let mut skies = [(); 4].map(|()| SkyRays::default());
        for ray in 0..count {
            let (toward, block) =
                self.sky_ray(here, (sampler, index * count + ray, RAYS * count), waiting);
            for (sky, rig) in skies.iter_mut().zip(rigs) {
                sky.add(&block, rig.sky(toward));
            }
        }
        std::array::from_fn(|probe| skies[probe].means(&rigs[probe], MEAN_COSINE).light())
    }
}

/// Rigs with the light of `rig`, and the brightest sky to the right, to the left, up the wales, and
/// out of the face.
fn probes(rig: &Rig) -> [Rig; 4] {
    [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::Z].map(|zenith| rig.seen_from(rig.toward_sun, zenith))
}
