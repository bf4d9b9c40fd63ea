//! Lighting: one sun and a sky.
//!
//! In: a [`Light`] and the camera. Out: a [`Rig`] in world axes. By default it is the light of a
//! product photograph, placed relative to the camera. The sun stands to the upper left. It makes
//! about 40 degrees with a cloth that faces the camera, so that loops show relief from every side
//! of a garment. The sky is a linear gradient, brightest above and behind the camera. A light fixed
//! in the world leaves the back of a garment in the dark. That of an environment is fixed.

use crate::camera::Camera;
use glam::{DVec3, Quat, Vec3};
use std::f32::consts::{FRAC_1_PI, FRAC_1_SQRT_2, PI};

/// Light of the gaps between yarns, as fractions of the light on the cloth.
pub(super) struct GapLight {
    /// Where all of the sky is hidden.
    pub(super) hidden: f32,
    /// What is added where all of it is open.
    pub(super) open: f32,
    /// What is added where the sun stands over the place: the yarns around it turn their dark sides
    /// to it.
    pub(super) to_sun: f32,
}

/// Fitted by least squares to traced light (`cpu/raytrace/bounce.rs`) at places of ten fabrics. By fabric
/// its mean is off by up to a sixth, for which pictures have factors (`cpu/splat/fit.rs`).
pub(super) const GAP_LIGHT: GapLight = GapLight { hidden: 0.21, open: 0.28, to_sun: -0.11 };

/// Length of sky rays, in radii of the yarn that they start from: about a wale in common fabrics.
/// Shorter rays miss the neighbouring wale, and the cloth's relief flattens. Longer ones let
/// distant folds darken the cloth and cost more.
pub const SKY_REACH_RADII: f32 = 24.0;

/// The axes that a light's directions are in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightAxes {
    /// The camera's right, up and back axes.
    #[default]
    Camera,
    /// Those of the scene.
    World,
}

/// Sun and sky, linear RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// The axes of its directions.
    pub axes: LightAxes,
    /// Direction to the sun; any length but zero.
    pub sun_direction: Vec3,
    /// Irradiance of the sun on a surface that faces it.
    pub sun: Vec3,
    /// Angular radius of the sun, radians. Larger is softer.
    pub sun_half_angle: f32,
    /// Direction to the brightest sky; any length but zero.
    pub sky_direction: Vec3,
    /// Radiance of the sky there.
    pub sky_above: Vec3,
    /// Radiance of the sky opposite.
    pub sky_below: Vec3,
}

impl Default for Light {
    fn default() -> Self {
        Self {
            axes: LightAxes::Camera,
            sun_direction: Vec3::new(-0.50, 0.58, 0.64),
            sun: Vec3::new(3.05, 2.95, 2.80),
            sun_half_angle: 0.06,
            // Tilted toward the camera: pure 'up' would leave the middle of a cloth that faces the
            // camera dull.
            sky_direction: Vec3::new(0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2),
            sky_above: Vec3::new(0.57, 0.59, 0.62),
            sky_below: Vec3::new(0.22, 0.215, 0.21),
        }
    }
}

/// Direction to a sun so many degrees to the right of the camera and above its level, along the
/// camera's right, up and back axes. `None` for over 360 degrees around, or over 90 up or down.
#[must_use]
pub fn toward_sun([around, up]: [f64; 2]) -> Option<DVec3> {
    let is_angle = around.abs() <= 360.0 && up.abs() <= 90.0;
    let ((side, ahead), (high, level)) = (around.to_radians().sin_cos(), up.to_radians().sin_cos());
    is_angle.then(|| DVec3::new(side * level, high, ahead * level))
}

/// A [`Light`] in world axes.
#[derive(Clone, Copy, Debug)]
pub struct Rig {
    /// Unit vector to the sun's centre.
    pub toward_sun: Vec3,
    /// Radiance of white cloth that nothing hides: the sky's mean, and the sun's irradiance over pi.
    pub(super) on_cloth: Vec3,
    pub(super) light: Light,
    /// Radius of the sun's disc at distance 1.
    sun_radius: f32,
    /// Unit vector to the brightest sky.
    pub(super) zenith: Vec3,
}

impl Light {
    /// The light around `camera`.
    #[must_use]
    pub fn around(&self, camera: &Camera) -> Rig {
        let to_world = |direction: Vec3| {
            let direction = direction.try_normalize().unwrap_or(Vec3::Z);
            match self.axes {
                LightAxes::Camera => camera.to_world(direction),
                LightAxes::World => direction,
            }
        };
        let (toward_sun, zenith) = (to_world(self.sun_direction), to_world(self.sky_direction));
        let on_cloth = (self.sky_above + self.sky_below) * 0.5 + self.sun * FRAC_1_PI;
        Rig { toward_sun, on_cloth, light: *self, sun_radius: self.sun_half_angle.tan(), zenith }
    }
}

/// Lights of an environment.
impl Light {
    /// So many times as bright.
    pub(super) fn scaled(self, scale: f32) -> Self {
        let [sun, sky_above, sky_below] =
            [self.sun, self.sky_above, self.sky_below].map(|color| color * scale);
        Self { sun, sky_above, sky_below, ..self }
    }

    /// Turned, in the world's axes.
    pub(super) fn turned(self, rotation: Quat) -> Self {
        debug_assert_eq!(self.axes, LightAxes::World, "a light around a camera turns with it");
        let [sun_direction, sky_direction] =
            [self.sun_direction, self.sky_direction].map(|axis| (rotation * axis).normalize());
        Self { sun_direction, sky_direction, ..self }
    }

    /// The irradiance of a ball, on average over its surface, as luminance. Half of it is turned
    /// away from the sun, and the rest gets half of its light.
    pub(super) fn mean_irradiance(&self) -> f32 {
        let sky = (self.sky_above + self.sky_below) * (0.5 * PI);
        luminance(sky + self.sun * 0.25)
    }
}

impl Rig {
    /// Irradiance of the sun on a surface that faces it.
    #[must_use]
    pub fn sun(&self) -> Vec3 {
        self.light.sun
    }

    /// Radiance, on average, of white yarns that hide a part of the sky from a place of the cloth.
    /// Multiply it by the yarns' albedo. The rest of the sky is open by a fraction `open`; the place's
    /// normal and the direction to the sun have the cosine `sun_cosine`.
    #[must_use]
    pub fn gap_light(&self, open: f32, sun_cosine: f32) -> Vec3 {
        let gap = &GAP_LIGHT;
        self.on_cloth * (gap.hidden + gap.open * open + gap.to_sun * sun_cosine)
    }

    /// A uniformly distributed direction within the sun's disc, from two uniform numbers in 0..1.
    #[must_use]
    pub fn sun_sample(&self, u: [f32; 2]) -> Vec3 {
        let (across, up) = self.toward_sun.any_orthonormal_pair();
        let (sin, cos) = (std::f32::consts::TAU * u[1]).sin_cos();
        // The square root makes the density uniform per area of the disc.
        let r = self.sun_radius * u[0].sqrt();
        (self.toward_sun + (across * cos + up * sin) * r).normalize()
    }

    /// The same light with the sun and the brightest sky in these unit directions, in other axes
    /// than the world's.
    pub(super) fn seen_from(&self, toward_sun: Vec3, zenith: Vec3) -> Self {
        Self { toward_sun, zenith, ..*self }
    }

    /// Radiance of the sky in a unit direction.
    #[must_use]
    pub fn sky(&self, direction: Vec3) -> Vec3 {
        let height = 0.5 + 0.5 * direction.dot(self.zenith);
        self.light.sky_below.lerp(self.light.sky_above, height)
    }
}

/// Luminance of linear RGB (ITU-R BT.709).
pub(crate) fn luminance(color: Vec3) -> f32 {
    color.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn the_sun_is_up_left_of_every_camera_and_rakes() {
        for eye in [DVec3::Z, DVec3::NEG_Z, DVec3::new(3.0, 1.0, -2.0)] {
            let camera = Camera::look_at(eye * 100.0, DVec3::ZERO, 0.5, 1.0);
            let sun = Light::default().around(&camera).toward_sun.as_dvec3();
            let seen = camera.project(sun, 1.0).unwrap();
            assert!(seen.x < 0.0 && seen.y > 0.0);
            let above_the_cloth = 90.0 - sun.angle_between(eye).to_degrees();
            assert!((35.0..=45.0).contains(&above_the_cloth), "{above_the_cloth}");
        }
    }

    #[test]
    fn samples_stay_in_the_disc() {
        let rig = Light::default().around(&Camera::look_at(DVec3::Z, DVec3::ZERO, 0.5, 1.0));
        for step in 0_u8..=20 {
            let u = f32::from(step) / 20.0;
            assert!(rig.sun_sample([u, 1.0 - u]).angle_between(rig.toward_sun) <= 0.0601);
        }
    }
}
