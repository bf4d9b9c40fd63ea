//! The camera of a picture, and of each picture of a turntable.
//!
//! In: points of the cloth and [`PictureSettings`]. Out: a [`Camera`] that stands where the settings
//! put it, or far enough away that all of the cloth is in the picture.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3};

use super::settings::PictureSettings;
use crate::render::Camera;
use crate::render::scene::Bounds;

/// Points on each rim of the drum around a scene. A turntable's camera must see the whole drum.
/// With 64 points the largest gap between circle and polygon is 0.12 % of the radius; with 8 points
/// it is 8 %, and cloth at the border could leave the picture.
const RIM: u32 = 64;

/// The camera of picture number `frame`. It sees all of `points`.
///
/// All pictures of a turntable have the same distance, because each camera sees the same drum. Only
/// the angle differs.
pub(super) fn camera(
    points: &[Vec3],
    settings: &PictureSettings,
    aspect: f64,
    frame: u32,
) -> Camera {
    let fov = settings.fov;
    let Some(count) = settings.turntable else { return still(settings, points, fov, aspect) };
    // Cloth without yarns has no bounding box. Its picture is the background alone.
    let Some(bounds) = Bounds::around(points) else { return still(settings, &[], fov, aspect) };
    let angle = TAU * f64::from(frame) / f64::from(count);
    still(settings, &drum(points, &bounds), fov, aspect)
        .turned_about(bounds.centre().as_dvec3(), angle)
}

/// A camera at the place in the settings, or where it sees all of `points`.
fn still(settings: &PictureSettings, points: &[Vec3], fov: f64, aspect: f64) -> Camera {
    match settings.eye {
        Some((eye, target)) => Camera::look_at(eye, target, fov, settings.zoom),
        None => Camera::view(settings.view, points, fov, settings.zoom, aspect),
    }
}

/// The two rims of the upright cylinder that holds all points at every angle of a turntable.
fn drum(points: &[Vec3], bounds: &Bounds) -> Vec<Vec3> {
    let centre = bounds.centre();
    let farthest = points
        .iter()
        .map(|point| (*point - centre).with_y(0.0).length_squared())
        // One bad vertex must not move the camera to infinity.
        .filter(|length| length.is_finite());
    let radius = f64::from(farthest.fold(0.0, f32::max).sqrt());
    // The farthest point decides the radius, not the corner of the bounding box: that would be up
    // to 1.4 times as far, and the cloth would be drawn that much smaller.
    rim(centre.with_y(bounds.min.y), radius)
        .chain(rim(centre.with_y(bounds.max.y), radius))
        .collect()
}

/// Points on a level circle.
fn rim(centre: Vec3, radius: f64) -> impl Iterator<Item = Vec3> {
    (0..RIM).map(move |step| {
        let (sin, cos) = (TAU * f64::from(step) / f64::from(RIM)).sin_cos();
        let around = DVec3::new(cos, 0.0, sin) * radius;
        centre + around.as_vec3()
    })
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
