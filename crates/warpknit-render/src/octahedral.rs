//! Directions in four bytes.
//!
//! In: a unit vector. Out: its octahedral projection (Meyer et al. 2010, On floating-point normal
//! vectors) in two 16-bit numbers, which is what a shader's `unpack2x16snorm` takes apart. A
//! direction comes back within .01 degrees.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec2Swizzles, Vec3, Vec3Swizzles};

/// A unit vector, packed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct PackedUnit(u32);

impl PackedUnit {
    /// Packs the direction of `v`; +z for a vector without one.
    ///
    /// ```
    /// use glam::Vec3;
    /// let v = Vec3::new(-0.6, 0.0, -0.8);
    /// assert!(warpknit_render::octahedral::PackedUnit::new(v).unpack().angle_between(v) < 1e-4);
    /// ```
    #[must_use]
    pub fn new(v: Vec3) -> Self {
        let sum = v.abs().element_sum();
        let v = if sum > 0.0 && sum.is_finite() { v / sum } else { Vec3::Z };
        let flat = if v.z >= 0.0 { v.xy() } else { folded(v.xy()) };
        let [x, y] = (flat * 32_767.0)
            .round()
            .as_i16vec2()
            .to_array()
            .map(|part| u32::from(part.cast_unsigned()));
        Self(x | y << 16)
    }

    /// The unit vector.
    #[must_use]
    pub fn unpack(self) -> Vec3 {
        let [x, y, ..] =
            bytemuck::cast::<u32, [i16; 2]>(self.0.to_le()).map(i16::from_le).map(f32::from);
        let flat = Vec2::new(x, y) / 32_767.0;
        let z = 1.0 - flat.x.abs() - flat.y.abs();
        let flat = if z >= 0.0 { flat } else { folded(flat) };
        flat.extend(z).normalize()
    }
}

/// The lower half of the octahedron folded outward over the corners of the square, and back.
fn folded(v: Vec2) -> Vec2 {
    (Vec2::ONE - v.yx().abs()) * Vec2::new(1_f32.copysign(v.x), 1_f32.copysign(v.y))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_direction_comes_back() {
        for step in 0_u16..2000 {
            let (turn, height) = (f32::from(step) * 2.399_963, f32::from(step) / 999.5 - 1.0);
            let around = (1.0 - height * height).max(0.0).sqrt();
            let v = Vec3::new(turn.cos() * around, turn.sin() * around, height);
            assert!(PackedUnit::new(v).unpack().distance(v) < 1.5e-4, "{v}");
        }
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            assert_eq!(
                (PackedUnit::new(axis).unpack(), PackedUnit::new(-axis).unpack()),
                (axis, -axis)
            );
        }
        assert_eq!(PackedUnit::new(Vec3::NAN).unpack(), Vec3::Z);
    }
}
