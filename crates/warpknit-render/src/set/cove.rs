//! The cove of a studio: a floor that turns up into a wall, without an edge between them.
//!
//! In: the box around what stands in it, and the camera. Out: [`Cove`], which tells where a ray meets
//! it. In the upright plane of the camera's view it is a straight floor, a quarter of a circle, and a
//! straight wall:
//!
//! ```text
//!                                |
//!                                |  wall
//!       cloth                   /
//!   ______|___________________/   bend
//!   floor
//! ```

use std::f32::consts::FRAC_PI_2;

use glam::{Vec2, Vec3};

use crate::Camera;
use crate::scene::Bounds;

/// Distance of the bend's beginning behind the middle of the cloth, in diagonals of its box. Nearer
/// ones show the bend behind the cloth's shadow. Farther ones show a horizon behind the cloth.
const BEND: f32 = 0.8;
/// Radius of the bend, in the same diagonals.
const RADIUS: f32 = 1.2;

/// Floor, bend and wall.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cove {
    /// The point of the floor under the middle of what stands on it.
    pub(crate) foot: Vec3,
    /// Diagonal of the box around what stands on it, mm.
    pub(crate) size: f32,
    /// Level unit vector from the cloth toward the wall.
    away: Vec3,
}

impl Cove {
    pub(crate) fn new(bounds: &Bounds, camera: &Camera) -> Self {
        let size = bounds.min.distance(bounds.max).max(1.0);
        // Where the camera looks straight down, its upper edge is away from it.
        let away = [Vec3::NEG_Z, Vec3::Y].map(|axis| camera.to_world(axis).with_y(0.0));
        let away = away[0].try_normalize().or(away[1].try_normalize()).unwrap_or(Vec3::NEG_Z);
        Self { foot: bounds.centre().with_y(bounds.min.y), size, away }
    }

    /// Where a ray first meets it, and its normal there. `None` for a ray from below the floor, and
    /// for one that leads away from the wall.
    pub(crate) fn hit(&self, from: Vec3, toward: Vec3) -> Option<(Vec3, Vec3)> {
        let start = Vec2::new((from - self.foot).dot(self.away), from.y - self.foot.y);
        let rise = Vec2::new(toward.dot(self.away), toward.y);
        if start.y <= 0.0 {
            return None;
        }
        let (distance, normal) = self.in_plane(start, rise)?;
        Some((from + toward * distance, self.away * normal.x + Vec3::Y * normal.y))
    }

    /// The same in the upright plane: distance along the ray, and the normal.
    fn in_plane(&self, start: Vec2, rise: Vec2) -> Option<(f32, Vec2)> {
        let (bend, radius) = (BEND * self.size, RADIUS * self.size);
        if rise.y < 0.0 {
            let distance = start.y / -rise.y;
            if start.x + rise.x * distance <= bend {
                return Some((distance, Vec2::Y));
            }
        }
        if rise.x <= 0.0 {
            return None;
        }
        let distance = (bend + radius - start.x) / rise.x;
        if distance > 0.0 && start.y + rise.y * distance >= radius {
            return Some((distance, Vec2::NEG_X));
        }
        // The far side of the circle that the bend is a quarter of.
        let from_centre = start - Vec2::new(bend, radius);
        let (a, b) = (rise.length_squared(), from_centre.dot(rise));
        let root = b * b - a * (from_centre.length_squared() - radius * radius);
        let distance = (root.max(0.0).sqrt() - b) / a;
        (root >= 0.0 && distance > 0.0)
            .then(|| (distance, eased(-(from_centre + rise * distance) / radius)))
    }
}

/// A normal of the bend that begins and ends to turn gradually. On a circle light would change its
/// slope where the bend begins, which looks like a horizon.
fn eased(normal: Vec2) -> Vec2 {
    let share = (-normal.x).atan2(normal.y).clamp(0.0, FRAC_PI_2) / FRAC_PI_2;
    let angle = share * share * (3.0 - 2.0 * share) * FRAC_PI_2;
    Vec2::new(-angle.sin(), angle.cos())
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn cove() -> Cove {
        let bounds =
            Bounds { min: Vec3::new(-30.0, 10.0, -40.0), max: Vec3::new(30.0, 10.0, 40.0) };
        let eye = DVec3::new(0.0, 60.0, 500.0);
        Cove::new(&bounds, &Camera::look_at(eye, DVec3::new(0.0, 60.0, 0.0), 0.5, 1.0))
    }

    #[test]
    fn it_goes_on_without_an_edge_from_floor_to_wall() {
        let (cove, eye) = (cove(), Vec3::new(0.0, 60.0, 500.0));
        let mut last: Option<(Vec3, Vec3)> = None;
        let mut turned = 0.0;
        for step in 0_u16..=4000 {
            let angle = -1.2 + f32::from(step) * 5e-4;
            let toward = Vec3::new(0.0, angle.sin(), -angle.cos());
            let (place, normal) = cove.hit(eye, toward).unwrap();
            assert!((normal.length() - 1.0).abs() < 1e-4 && place.y >= 9.99);
            if let Some((before, other)) = last {
                // A plane through the point before would be met this far from it.
                let step = 5e-4 * place.distance(eye) / normal.dot(toward).abs();
                assert!(place.distance(before) < 1.5 * step && normal.distance(other) < 0.06);
                turned += normal.angle_between(other);
            }
            last = Some((place, normal));
        }
        assert!((turned - FRAC_PI_2).abs() < 0.01, "{turned}");
    }

    #[test]
    fn nothing_is_met_from_below_and_before_it() {
        let cove = cove();
        assert!(cove.hit(Vec3::new(0.0, 0.0, 500.0), Vec3::NEG_Z).is_none());
        assert!(cove.hit(Vec3::new(0.0, 60.0, 0.0), Vec3::Z).is_none());
    }

    #[test]
    fn a_camera_from_above_has_a_floor() {
        let bounds = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
        let camera = Camera::look_at(DVec3::Y * 50.0, DVec3::ZERO, 0.5, 1.0);
        let (place, normal) = Cove::new(&bounds, &camera).hit(Vec3::Y * 50.0, Vec3::NEG_Y).unwrap();
        assert_eq!((place, normal), (Vec3::ZERO, Vec3::Y));
    }
}
