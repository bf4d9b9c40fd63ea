//! The camera of a picture, and of each picture of a turntable.
//!
//! In: a scene and [`PictureSettings`]. Out: a [`Camera`] that sees all of the cloth, or stands
//! where it was put.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3};

use super::settings::PictureSettings;
use crate::render::Camera;
use crate::render::scene::{Bounds, Scene};

/// Points on each rim of the drum around a scene, which a camera on a turntable must see whole.
const RIM: u32 = 64;

/// The camera of a frame.
pub(super) fn camera(
    scene: &Scene,
    seen: Option<&[Vec3]>,
    settings: &PictureSettings,
    aspect: f64,
    frame: u32,
) -> Camera {
    let fov = settings.fov;
    let Some(count) = settings.turntable else {
        return still(settings, seen.unwrap_or(&scene.positions), fov, aspect);
    };
    let Some(bounds) = scene.bounds() else { return still(settings, &[], fov, aspect) };
    let angle = TAU * f64::from(frame) / f64::from(count);
    still(settings, &drum(&scene.positions, &bounds), fov, aspect)
        .turned_about(bounds.centre().as_dvec3(), angle)
}

/// A camera that stands where the arguments say, or where it sees all of `points`.
fn still(settings: &PictureSettings, points: &[Vec3], fov: f64, aspect: f64) -> Camera {
    match settings.eye {
        Some((eye, target)) => Camera::look_at(eye, target, fov, settings.zoom),
        None => Camera::view(settings.view, points, fov, settings.zoom, aspect),
    }
}

/// The rims of the upright drum around all points: what a turning scene sweeps.
fn drum(points: &[Vec3], bounds: &Bounds) -> Vec<Vec3> {
    let centre = bounds.centre();
    let farthest = points
        .iter()
        .map(|point| (*point - centre).with_y(0.0).length_squared())
        .filter(|length| length.is_finite());
    let radius = f64::from(farthest.fold(0.0, f32::max).sqrt());
    let rim = |height: f32| {
        (0..RIM).map(move |step| {
            let (sin, cos) = (TAU * f64::from(step) / f64::from(RIM)).sin_cos();
            let around = DVec3::new(cos, 0.0, sin) * radius;
            centre.with_y(height) + around.as_vec3()
        })
    };
    rim(bounds.min.y).chain(rim(bounds.max.y)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_drum_holds_all_that_turns() {
        let points = [Vec3::new(3.0, -1.0, 0.0), Vec3::new(-1.0, 5.0, 2.0)];
        let bounds = Bounds { min: Vec3::new(-1.0, -1.0, 0.0), max: Vec3::new(3.0, 5.0, 2.0) };
        let drum = drum(&points, &bounds);
        let centre = bounds.centre();
        for point in points {
            let reach = (point - centre).with_y(0.0).length();
            assert!(drum.iter().all(|rim| (*rim - centre).with_y(0.0).length() > reach - 1e-4));
        }
    }
}
