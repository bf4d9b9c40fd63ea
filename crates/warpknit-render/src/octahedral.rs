//! Unit vectors in four bytes, by octahedral encoding.
//!
//! In: a unit vector. Out: its octahedral projection in two signed 16-bit numbers, as a shader's
//! `unpack2x16snorm` reads them.
//!
//! Method: the vector is projected onto the octahedron |x| + |y| + |z| = 1. Its lower half is
//! folded outward, so that the whole octahedron covers a square (Meyer, Süßmuth, Sußner, Stamminger
//! and Greiner, On floating-point normal vectors, 2010). The error is below 0.01 degrees. Cost: one
//! division to pack, one square root and one division to unpack.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec2Swizzles, Vec3, Vec3Swizzles};

/// A packed unit vector.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct PackedUnit(u32);

impl PackedUnit {
    /// Packs the direction of `v`. A vector without a direction becomes +z.
    ///
    /// ```
    /// use glam::Vec3;
    /// let v = Vec3::new(-0.6, 0.0, -0.8);
    /// assert!(warpknit_render::octahedral::PackedUnit::new(v).unpack().angle_between(v) < 1e-4);
    /// ```
    #[must_use]
    pub fn new(v: Vec3) -> Self {
        // Central projection onto the octahedron: division by the 1-norm.
        let sum = v.abs().element_sum();
        let v = if sum > 0.0 && sum.is_finite() { v / sum } else { Vec3::Z };
        let flat = if v.z >= 0.0 { v.xy() } else { fold(v.xy()) };
        // Signed normalised integers: -32767 to 32767 for -1 to 1. Rounding, not truncation: that
        // would double the error.
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
        // On the octahedron |x| + |y| + |z| = 1. Below 0 the point lies in a folded corner.
        let z = 1.0 - flat.x.abs() - flat.y.abs();
        let flat = if z >= 0.0 { flat } else { fold(flat) };
        flat.extend(z).normalize()
    }
}

/// Folds the lower half of the octahedron outward, over the corners of the square. It is its own
/// inverse.
fn fold(v: Vec2) -> Vec2 {
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
