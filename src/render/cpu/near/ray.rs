//! Rays: from the eye, and from a surface toward what may light it.

use glam::{DVec3, Vec3};
use obvhs::aabb::Aabb;

use crate::render::cpu::to_f32;
use crate::render::{Camera, RenderOptions};

/// A ray in world directions, its origin relative to the scene's middle.
#[derive(Clone, Copy, Debug)]
pub(super) struct SceneRay {
    pub(super) origin: Vec3,
    /// Of unit length.
    pub(super) direction: Vec3,
    pub(super) reach: f32,
    /// Size of a pixel where the ray may meet something, mm.
    pub(super) footprint: f32,
    /// By which it is decided what half-covered places let through.
    pub(super) random_bits: u32,
}

/// The nearest segment along a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hit {
    /// First point of the segment.
    pub(super) start: u32,
    /// Distance from the ray's origin.
    pub(super) distance: f32,
}

impl SceneRay {
    /// The place at a distance along the ray.
    pub(super) fn at(&self, distance: f32) -> Vec3 {
        self.origin + self.direction * distance
    }
}

/// Where the rays of a picture come from.
pub(super) struct CameraRays<'a> {
    pub(super) camera: &'a Camera,
    pub(super) options: &'a RenderOptions,
    /// Relative to the scene's middle.
    position: DVec3,
    /// Around all yarns.
    bounds: Aabb,
}

impl<'a> CameraRays<'a> {
    /// An eye before yarns within `bounds`, which are relative to `centre`.
    pub(super) fn new(
        camera: &'a Camera,
        options: &'a RenderOptions,
        centre: DVec3,
        bounds: Aabb,
    ) -> Self {
        Self { camera, options, position: camera.eye() - centre, bounds }
    }

    /// The ray through a place in pixel (x, y), cut to where it may meet something; `None` where it
    /// passes all yarns by. Yarns are hundredths of a millimetre thick and eyes metres away, so it
    /// starts where it enters the box around them.
    pub(super) fn primary_ray(
        &self,
        [x, y]: [u32; 2],
        place: [f32; 2],
        random_bits: u32,
    ) -> Option<SceneRay> {
        let (width, height) = (self.options.width, self.options.height);
        let across = (f64::from(x) + f64::from(place[0])) / f64::from(width) * 2.0 - 1.0;
        let up = 1.0 - (f64::from(y) + f64::from(place[1])) / f64::from(height) * 2.0;
        let direction = self.camera.direction(across, up, self.options.aspect());
        let Aabb { min, max } = self.bounds;
        let inverse = direction.recip();
        let (a, b) = (
            (Vec3::from(min).as_dvec3() - self.position) * inverse,
            (Vec3::from(max).as_dvec3() - self.position) * inverse,
        );
        // 0 * infinity, for a ray within a face's plane, counts as inside.
        let (near, far) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
        if near > far {
            return None;
        }
        let origin = (self.position + direction * near).as_vec3();
        let footprint = to_f32(self.camera.pixel_size(near.midpoint(far), height));
        Some(SceneRay {
            origin,
            direction: direction.as_vec3(),
            reach: f32::INFINITY,
            footprint,
            random_bits,
        })
    }

    /// Size of a pixel at a place, mm.
    pub(super) fn pixel_at(&self, place: Vec3) -> f32 {
        to_f32(
            self.camera.pixel_size(place.as_dvec3().distance(self.position), self.options.height),
        )
    }
}
