//! An orbit camera: yaw and pitch around a target, which stays upright like a turntable.
//!
//! In: drags and wheel travel, in pixels. Out: a [`Camera`]. The wheel changes the magnification
//! and not the distance, so that the near side of a garment can be inspected yarn by yarn without
//! the eye passing through it.

use glam::{DVec3, Vec3};
use warpknit::render::{Camera, View};

/// Rotation for each pixel of a drag, radians: 450 pixels are half a turn.
const TURN: f64 = std::f64::consts::PI / 450.0;
/// Largest pitch that a drag reaches, radians. Straight above or below, the direction alone does
/// not determine which way is up, and the picture would spin.
const STEEPEST: f64 = 89.0 * std::f64::consts::PI / 180.0;
/// Least and greatest magnification: from a speck to a single yarn of a coat.
const ZOOMS: (f64, f64) = (0.05, 2000.0);

/// A camera's position relative to a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Orbit {
    target: DVec3,
    distance: f64,
    /// Angle around the upright axis, 0 in front, radians.
    yaw: f64,
    /// Angle above the horizon, radians.
    pitch: f64,
    /// Vertical field of view, radians.
    fov: f64,
    zoom: f64,
}

impl Orbit {
    /// The orbit with its eye at a place, as [`Camera::look_at`].
    pub(super) fn at(eye: DVec3, target: DVec3, fov: f64, zoom: f64) -> Self {
        let offset = eye - target;
        let toward_eye = offset.try_normalize().unwrap_or(DVec3::Z);
        // Straight from above the direction has no yaw. It is set to 0, which puts the front at the
        // picture's bottom.
        let yaw = if toward_eye.y.abs() > STEEPEST.sin() {
            0.0
        } else {
            toward_eye.x.atan2(toward_eye.z)
        };
        Self {
            target,
            distance: offset.length(),
            yaw,
            pitch: toward_eye.y.clamp(-1.0, 1.0).asin(),
            fov,
            zoom,
        }
    }

    /// Frames `points` in a view, as [`Camera::view`] does, and orbits around the middle of the
    /// visible depths.
    pub(super) fn framing(view: View, points: &[Vec3], fov: f64, zoom: f64, aspect: f64) -> Self {
        Self::facing(view.toward_eye(), points, fov, zoom, aspect)
    }

    /// Frames `points` from the present direction.
    pub(super) fn framed(&self, points: &[Vec3], aspect: f64) -> Self {
        // Straight above, the yaw would be lost if it were computed from the direction again.
        Self { yaw: self.yaw, ..Self::facing(self.toward_eye(), points, self.fov, 1.0, aspect) }
    }

    /// Frames `points` from a direction.
    fn facing(toward_eye: DVec3, points: &[Vec3], fov: f64, zoom: f64, aspect: f64) -> Self {
        let eye = Camera::facing(toward_eye, points, fov, zoom, aspect).eye();
        // The camera's own target is centred in the picture's plane only. Orbiting needs a centre
        // in depth as well, or near parts would sweep through the picture.
        let depths = points
            .iter()
            .map(|point| (eye - point.as_dvec3()).dot(toward_eye))
            .filter(|depth| depth.is_finite());
        let (near, far) = depths.fold((f64::INFINITY, f64::NEG_INFINITY), |(near, far), depth| {
            (near.min(depth), far.max(depth))
        });
        let distance = if near <= far { f64::midpoint(near, far) } else { 1.0 };
        Self::at(eye, eye - toward_eye * distance, fov, zoom)
    }

    /// Turns the object with the pointer by a drag of so many pixels.
    pub(super) fn turn(&mut self, x: f32, y: f32) {
        self.yaw -= f64::from(x) * TURN;
        self.pitch = (self.pitch + f64::from(y) * TURN).clamp(-STEEPEST, STEEPEST);
    }

    /// Moves the picture by a drag of so many pixels in a picture of `height` pixels. What lies at
    /// the target's distance follows the pointer exactly.
    pub(super) fn shift(&mut self, x: f32, y: f32, height: f32) {
        let size = self.camera().pixel_size(self.distance, 1) / f64::from(height.max(1.0));
        self.target += self.camera().to_world(Vec3::new(-x, y, 0.0)).as_dvec3() * size;
    }

    /// Magnifies the picture around its middle.
    pub(super) fn magnify(&mut self, times: f64) {
        self.zoom = (self.zoom * times).clamp(ZOOMS.0, ZOOMS.1);
    }

    /// The camera at this position.
    pub(super) fn camera(&self) -> Camera {
        Camera::look_at(
            self.target + self.toward_eye() * self.distance,
            self.target,
            self.fov,
            self.zoom,
        )
    }

    /// The unit vector from the target to the eye: spherical coordinates with y upward.
    fn toward_eye(&self) -> DVec3 {
        let (up, level) = self.pitch.sin_cos();
        let (right, front) = self.yaw.sin_cos();
        DVec3::new(right * level, up, front * level)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINTS: [Vec3; 4] = [
        Vec3::ZERO,
        Vec3::new(40.0, 0.0, 6.0),
        Vec3::new(0.0, 90.0, -4.0),
        Vec3::new(30.0, 70.0, 20.0),
    ];

    fn framing(view: View) -> Orbit {
        Orbit::framing(view, &POINTS, 0.5, 1.0, 1.6)
    }

    #[test]
    fn framing_is_the_view_of_a_picture() {
        for view in [View::Front, View::Back, View::Left, View::Right, View::Top, View::Iso] {
            let (orbit, expected) =
                (framing(view).camera(), Camera::view(view, &POINTS, 0.5, 1.0, 1.6));
            for point in POINTS.map(Vec3::as_dvec3) {
                let [seen, wanted] =
                    [orbit, expected].map(|camera| camera.project(point, 1.6).unwrap());
                assert!(seen.distance(wanted) < 1e-6, "{view:?}: {seen} {wanted}");
            }
        }
    }

    #[test]
    fn turning_keeps_the_target_in_the_middle_and_upright() {
        let mut orbit = framing(View::Iso);
        for _ in 0..40 {
            orbit.turn(37.0, 21.0);
            let camera = orbit.camera();
            assert!(camera.project(orbit.target, 1.6).unwrap().length() < 1e-9);
            assert!(camera.to_world(Vec3::Y).y >= 0.0);
            assert!(((camera.eye() - orbit.target).length() - orbit.distance).abs() < 1e-9);
        }
    }

    #[test]
    fn a_shift_moves_the_picture_by_its_pixels() {
        let mut orbit = framing(View::Right);
        let held = orbit.target;
        orbit.magnify(3.0);
        orbit.shift(30.0, -50.0, 400.0);
        let seen = orbit.camera().project(held, 1.0).unwrap();
        assert!(
            (seen.x - 30.0 / 200.0).abs() < 1e-5 && (seen.y - 50.0 / 200.0).abs() < 1e-5,
            "{seen}"
        );
    }

    #[test]
    fn framing_again_keeps_the_direction() {
        let mut orbit = framing(View::Front);
        orbit.turn(100.0, 60.0);
        let before = orbit.toward_eye();
        orbit.shift(900.0, 900.0, 400.0);
        orbit.magnify(20.0);
        let orbit = orbit.framed(&POINTS, 1.6);
        assert!(orbit.toward_eye().distance(before) < 1e-9);
        assert!(POINTS.iter().all(|point| {
            orbit.camera().project(point.as_dvec3(), 1.6).unwrap().abs().max_element() < 1.0
        }));
    }
}
