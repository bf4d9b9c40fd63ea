//! A frame that moves along a yarn without twist.
//!
//! In: one point of a curve after another, with its derivative. Out: [`TangentFrame`], a unit tangent
//! and a direction across the yarn, of a rotation-minimising frame by double reflection
//! ([`warpknit_core::yarn::frame`]). For ribbons that direction follows the fabric's normal.

use glam::{DVec3, Vec3A};

use warpknit_core::yarn::frame;

/// Smallest sine of the angle between a yarn and the fabric's normal at which their cross product
/// defines a ribbon's width. Below it, rounding decides the direction.
const MIN_SINE: f32 = 1e-3;

/// A rotation-minimising frame that moves along a yarn.
#[derive(Clone, Copy, Default)]
pub(super) struct TangentFrame {
    position: DVec3,
    pub(super) tangent: Vec3A,
    pub(super) across: Vec3A,
}

impl TangentFrame {
    /// Moves the frame to `position`, where the curve has this derivative. Returns the distance
    /// moved, 0 for the first point.
    pub(super) fn advance(&mut self, position: DVec3, derivative: DVec3) -> f64 {
        let first = self.tangent == Vec3A::ZERO;
        let tangent =
            derivative.as_vec3a().normalize_or(if first { Vec3A::X } else { self.tangent });
        let chord = position - self.position;
        // Double reflection transports the direction across the yarn without twist about the
        // tangent. A Frenet frame would flip at inflections.
        let (across, moved) = if first {
            (frame::perpendicular_unit(Vec3A::Z, tangent), 0.0)
        } else {
            (
                frame::double_reflection(self.across, chord.as_vec3a(), self.tangent, tangent),
                chord.length(),
            )
        };
        *self = Self { position, tangent, across };
        moved
    }

    /// The normal that a ribbon uses where the fabric's is `normal`. Where the yarn runs along the
    /// normal, their cross product is undefined. There the normal is tilted slightly, so that the
    /// ribbon's width keeps its last direction.
    pub(super) fn ribbon_normal(&mut self, normal: Vec3A) -> Vec3A {
        // The width's squared length is the squared sine of the angle between yarn and normal.
        let width = self.tangent.cross(normal);
        if width.length_squared() >= MIN_SINE * MIN_SINE {
            self.across = frame::perpendicular_unit(normal, self.tangent);
            return normal;
        }
        // Here `across` is the last normal as `advance` transported it.
        normal + self.across * (10.0 * MIN_SINE)
    }
}
