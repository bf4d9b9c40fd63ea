//! Four vectors at a time: structures of arrays in registers.
//!
//! In: four vectors. Out: [`Vectors`], whose sums, products and roots take one instruction for all
//! four. Dot products need no sum across a register.

use std::ops::{Add, Mul, Sub};

use glam::{Mat4, Vec3A, Vec4};

/// Vectors in a group.
pub(super) const LANES: usize = 4;

/// Four vectors, one coordinate a register.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Vectors {
    x: Vec4,
    y: Vec4,
    z: Vec4,
}

impl Vectors {
    #[inline]
    pub(super) fn new(vectors: [Vec3A; LANES]) -> Self {
        let [a, b, c, d] = vectors.map(|vector| vector.extend(0.0));
        let rows = Mat4::from_cols(a, b, c, d).transpose();
        Self { x: rows.x_axis, y: rows.y_axis, z: rows.z_axis }
    }

    #[inline]
    pub(super) fn to_array(self) -> [Vec3A; LANES] {
        let Mat4 { x_axis, y_axis, z_axis, w_axis } =
            Mat4::from_cols(self.x, self.y, self.z, Vec4::ZERO).transpose();
        [x_axis, y_axis, z_axis, w_axis].map(Vec3A::from_vec4)
    }

    /// Each vector's predecessor, with that of the first one given.
    #[inline]
    pub(super) fn before(self, first: Vec3A) -> Self {
        let shift = |lanes: Vec4, first: f32| Vec4::new(first, lanes.x, lanes.y, lanes.z);
        Self { x: shift(self.x, first.x), y: shift(self.y, first.y), z: shift(self.z, first.z) }
    }

    #[inline]
    pub(super) fn dot(self, other: Self) -> Vec4 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    #[inline]
    pub(super) fn length_squared(self) -> Vec4 {
        self.dot(self)
    }

    /// Two unit vectors that are perpendicular to each unit vector and to each other, and
    /// right-handed with it (Duff, Burgess, Christensen, Hery, Kensler, Liani and Villemin 2017,
    /// "Building an orthonormal basis, revisited").
    #[inline]
    pub(super) fn perpendicular_pairs(self) -> [Self; 2] {
        let sign = Vec4::ONE.copysign(self.z);
        let a = -(sign + self.z).recip();
        let b = self.x * self.y * a;
        [
            Self { x: 1.0 + sign * self.x * self.x * a, y: sign * b, z: -sign * self.x },
            Self { x: b, y: sign + self.y * self.y * a, z: -self.y },
        ]
    }
}

impl Add for Vectors {
    type Output = Self;

    #[inline]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl Sub for Vectors {
    type Output = Self;

    #[inline]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl Mul<Vec4> for Vectors {
    type Output = Self;

    #[inline]
    fn mul(self, factors: Vec4) -> Self {
        Self { x: self.x * factors, y: self.y * factors, z: self.z * factors }
    }
}

/// The inverse of each number, and 0 of 0.
#[inline]
pub(super) fn inverse_or_zero(numbers: Vec4) -> Vec4 {
    Vec4::select(numbers.cmpeq(Vec4::ZERO), Vec4::ZERO, numbers.recip())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_perpendicular_and_right_handed_in_any_direction() {
        for step in 0..1000_u16 {
            let angle = f32::from(step);
            let unit = |k: f32| {
                Vec3A::new((angle + k).cos(), (1.7 * angle).sin(), (0.3 * angle * k).cos() - 0.5)
                    .normalize()
            };
            let units = [unit(1.0), unit(2.0), -Vec3A::Z, Vec3A::Z];
            let [first, second] = Vectors::new(units).perpendicular_pairs().map(Vectors::to_array);
            for ((unit, one), other) in units.into_iter().zip(first).zip(second) {
                assert!(unit.cross(one).distance(other) < 1e-6, "{unit}: {one}, {other}");
                assert!((one.length() - 1.0).abs() < 1e-6 && one.dot(unit).abs() < 1e-6);
            }
        }
    }
}
