//! Rays against yarns without a picture, for measurements and for benches.
//!
//! In: a scene and the picture for which yarns are subdivided. Out: [`YarnRays`], which tells how
//! far away a ray meets a yarn, and whether anything blocks it. It is what pictures are traced with,
//! but lookups of one ray at a time clear a list that a picture's rays share.

use glam::{DVec3, Vec4};

use super::ray::SceneRay;
use super::segments::Segments;
use super::trace::SegmentBvh;
use crate::bvh::tree::Waiting;
use crate::scene::Scene;
use crate::{Camera, RenderOptions};

/// Yarns, prepared for rays.
///
/// ```
/// use glam::DVec3;
/// use warpknit_render::cpu::YarnRays;
/// use warpknit_render::scene::{Scene, YarnLook};
/// use warpknit_render::{Camera, RenderOptions, View};
/// let mut scene = Scene::default();
/// scene.looks.push(YarnLook::plain(glam::Vec3::splat(0.5), 0.7, 0.1));
/// scene.push_strand([glam::Vec3::NEG_X, glam::Vec3::X], 0);
/// let camera = Camera::view(View::Front, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
/// let rays = YarnRays::new(&scene, &camera, &RenderOptions::default()).expect("one yarn");
/// let distance = rays.nearest(DVec3::Z, DVec3::NEG_Z).expect("a hit");
/// assert!((distance - 0.9).abs() < 1e-6);
/// assert!(!rays.is_blocked(DVec3::Z, DVec3::Z));
/// ```
#[derive(Debug)]
pub struct YarnRays<'a>(SegmentBvh<'a>);

impl<'a> YarnRays<'a> {
    /// Yarns as a picture of these options traces them. `None` where there are none.
    #[must_use]
    pub fn new(scene: &'a Scene, camera: &Camera, options: &RenderOptions) -> Option<Self> {
        let segments = Segments::new(scene, &scene.bounds()?, camera, options);
        Some(Self(SegmentBvh::new(segments)))
    }

    /// Distance from `origin` to the nearest yarn in a direction of unit length, mm. A yarn in
    /// which the ray starts does not count.
    #[must_use]
    pub fn nearest(&self, origin: DVec3, direction: DVec3) -> Option<f32> {
        let hit = self.0.nearest(&self.ray(origin, direction), &mut Waiting::new());
        hit.map(|hit| hit.distance)
    }

    /// Whether any yarn lies in a direction of unit length.
    #[must_use]
    pub fn is_blocked(&self, origin: DVec3, direction: DVec3) -> bool {
        self.0.occluder(&self.ray(origin, direction), u32::MAX, &mut Waiting::new()).is_some()
    }

    /// Both ends of each straight piece of yarn, relative to the scene's centre, with its radius in
    /// w of the first.
    pub fn pieces(&self) -> impl Iterator<Item = [Vec4; 2]> {
        let points = &self.0.segments.paths.points;
        points.windows(2).filter(|ends| ends[0].w > 0.0).map(|ends| [ends[0], ends[1]])
    }

    fn ray(&self, origin: DVec3, direction: DVec3) -> SceneRay {
        SceneRay {
            origin: (origin - self.0.segments.paths.centre).as_vec3(),
            direction: direction.as_vec3(),
            reach: f32::INFINITY,
            footprint: 0.0,
            random_bits: 0,
        }
    }
}
