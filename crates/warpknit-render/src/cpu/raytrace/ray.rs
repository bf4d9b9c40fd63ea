//! Rays: from the eye through pixels, and from a surface toward the light.
//!
//! In: a camera and a place in a pixel. Out: a [`SceneRay`], clipped to the bounding box of all
//! yarns. Rays from the eye are computed in `f64` and stored in `f32`, relative to the scene's
//! centre.

use glam::{DVec3, Vec3};

use crate::bvh::build::Box3;
use crate::bvh::tree::Ray;
use crate::cpu::to_f32;
use crate::{Camera, RenderOptions};

/// A ray with world directions; its origin is relative to the scene's centre.
#[derive(Clone, Copy, Debug)]
pub(super) struct SceneRay {
    pub(super) origin: Vec3,
    /// Of unit length.
    pub(super) direction: Vec3,
    /// Distance beyond which nothing is looked for, mm.
    pub(super) reach: f32,
    /// Size of a pixel where the ray may meet something, mm.
    pub(super) footprint: f32,
    /// Random bits that decide whether a partly transparent texel stops this ray.
    pub(super) random_bits: u32,
}

impl SceneRay {
    /// The ray without what only pictures need.
    pub(super) fn line(&self) -> Ray {
        Ray { origin: self.origin, direction: self.direction, reach: self.reach }
    }

    /// The point at a distance along the ray.
    pub(super) fn at(&self, distance: f32) -> Vec3 {
        self.origin + self.direction * distance
    }
}

/// The source of a picture's primary rays.
pub(super) struct CameraRays<'a> {
    pub(super) camera: &'a Camera,
    pub(super) options: &'a RenderOptions,
    /// The eye, relative to the scene's centre.
    position: DVec3,
    /// Bounding box of all yarns.
    bounds: Box3,
}

impl<'a> CameraRays<'a> {
    /// Rays of `camera` into a scene within `bounds`, which are relative to `centre`.
    pub(super) fn new(
        camera: &'a Camera,
        options: &'a RenderOptions,
        centre: DVec3,
        bounds: Box3,
    ) -> Self {
        Self { camera, options, position: camera.eye() - centre, bounds }
    }

    /// The ray through a place in a pixel. `None` where it misses the bounding box.
    ///
    /// The ray starts where it enters the box. The eye may stand metres away from yarns that are
    /// hundredths of a millimetre thick, and `f32` distances from the eye would be too coarse.
    pub(super) fn primary_ray(
        &self,
        pixel: [u32; 2],
        place: [f32; 2],
        random_bits: u32,
    ) -> Option<SceneRay> {
        let [across, up] = self.options.picture_point(pixel, place);
        let direction = self.camera.direction(across, up, self.options.aspect());
        let Box3 { min, max } = self.bounds;
        // Slab test (Kay and Kajiya 1986, 'Ray tracing complex scenes').
        let inverse = direction.recip();
        let (a, b) = (
            (Vec3::from(min).as_dvec3() - self.position) * inverse,
            (Vec3::from(max).as_dvec3() - self.position) * inverse,
        );
        // A ray that lies in the plane of a face gives 0 * infinity = NaN. `min` and `max` ignore
        // NaN, so it counts as inside.
        let (near, far) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
        if near > far {
            return None;
        }
        let origin = (self.position + direction * near).as_vec3();
        let footprint = to_f32(self.camera.pixel_size(near.midpoint(far), self.options.height));
        Some(SceneRay {
            origin,
            direction: direction.as_vec3(),
            reach: f32::INFINITY,
            footprint,
            random_bits,
        })
    }

    /// Size of a pixel at a point, mm.
    pub(super) fn pixel_at(&self, place: Vec3) -> f32 {
        to_f32(
            self.camera.pixel_size(place.as_dvec3().distance(self.position), self.options.height),
        )
    }
}
