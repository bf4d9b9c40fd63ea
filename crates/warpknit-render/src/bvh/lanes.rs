//! Eight numbers at a time.
//!
//! In: arrays of eight `f32`. Out: [`Lanes`] with the usual operators, and masks as bits. The crate
//! `pulp` offers the processor's instructions without unsafe code, and chooses them when the program
//! runs: AVX2 where there is some, else plain loops, which a compiler turns into what the target has.
//! The crate `wide` would choose when the program is compiled.
//!
//! Both ways give the same bits. Each operation is one of IEEE 754, and none is fused: the
//! rounding of a fused multiplication and addition differs.

use std::ops::{Add, Div, Mul, Sub};

use bytemuck::cast;
use glam::Vec3;
use pulp::{Scalar256b, Simd, f32x8, m32x8};

/// Lanes of a register.
pub(crate) const LANES: usize = 8;

/// Instructions on eight lanes.
pub(crate) trait Eight: Simd<f32s = f32x8, m32s = m32x8> {
    /// The mask as bits, the first lane in the lowest.
    fn bits(self, mask: m32x8) -> u32;
}

impl Eight for Scalar256b {
    #[inline(always)]
    fn bits(self, mask: m32x8) -> u32 {
        let lanes: [u32; LANES] = cast(mask);
        (0..).zip(lanes).map(|(lane, set)| (set & 1) << lane).sum()
    }
}

#[cfg(target_arch = "x86_64")]
impl Eight for pulp::x86::V3 {
    #[inline(always)]
    fn bits(self, mask: m32x8) -> u32 {
        self.avx._mm256_movemask_ps(cast(mask)).cast_unsigned()
    }
}

/// Code that is compiled once for each set of instructions. All that it calls on lanes must be
/// `#[inline(always)]`, or it is compiled without them. A closure cannot be.
pub(crate) trait Kernel {
    type Output;
    fn run<S: Eight>(self, simd: S) -> Self::Output;
}

/// The instructions that this processor has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Instructions {
    #[cfg(target_arch = "x86_64")]
    avx2: Option<pulp::x86::V3>,
}

impl Instructions {
    /// The best that the processor has.
    pub(crate) fn best() -> Self {
        Self {
            #[cfg(target_arch = "x86_64")]
            avx2: pulp::x86::V3::try_new(),
        }
    }

    /// Those that every processor of the target has.
    #[cfg(test)]
    pub(crate) fn plain() -> Self {
        Self {
            #[cfg(target_arch = "x86_64")]
            avx2: None,
        }
    }

    /// Runs a kernel with these instructions.
    #[inline]
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = self.avx2 {
            return avx2.vectorize(WithAvx2 { avx2, kernel });
        }
        kernel.run(Scalar256b)
    }
}

#[cfg(target_arch = "x86_64")]
struct WithAvx2<K> {
    avx2: pulp::x86::V3,
    kernel: K,
}

#[cfg(target_arch = "x86_64")]
impl<K: Kernel> pulp::NullaryFnOnce for WithAvx2<K> {
    type Output = K::Output;

    #[inline(always)]
    fn call(self) -> K::Output {
        self.kernel.run(self.avx2)
    }
}

/// Eight numbers.
#[derive(Clone, Copy)]
pub(crate) struct Lanes<S> {
    simd: S,
    value: f32x8,
}

impl<S: Eight> Lanes<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, value: [f32; LANES]) -> Self {
        Self { simd, value: cast(value) }
    }

    /// The same number eight times.
    #[inline(always)]
    pub(crate) fn all(simd: S, value: f32) -> Self {
        Self { simd, value: simd.splat_f32s(value) }
    }

    #[inline(always)]
    pub(crate) fn array(self) -> [f32; LANES] {
        cast(self.value)
    }

    /// The smaller of two numbers, neither of which may be NaN.
    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        Self { value: self.simd.min_f32s(self.value, other.value), ..self }
    }

    /// The larger of two numbers, neither of which may be NaN.
    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        Self { value: self.simd.max_f32s(self.value, other.value), ..self }
    }

    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        Self { value: self.simd.sqrt_f32s(self.value), ..self }
    }

    #[inline(always)]
    pub(crate) fn at_most(self, other: Self) -> m32x8 {
        self.simd.less_than_or_equal_f32s(self.value, other.value)
    }

    #[inline(always)]
    pub(crate) fn less_than(self, other: Self) -> m32x8 {
        self.simd.less_than_f32s(self.value, other.value)
    }

    /// This number where the mask is set, else the other one.
    #[inline(always)]
    pub(crate) fn where_set(self, mask: m32x8, other: Self) -> Self {
        Self { value: self.simd.select_f32s(mask, self.value, other.value), ..self }
    }
}

macro_rules! operator {
    ($operator: ident, $function: ident, $instruction: ident) => {
        impl<S: Eight> $operator for Lanes<S> {
            type Output = Self;

            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self { value: self.simd.$instruction(self.value, other.value), ..self }
            }
        }
    };
}

operator!(Add, add, add_f32s);
operator!(Sub, sub, sub_f32s);
operator!(Mul, mul, mul_f32s);
operator!(Div, div, div_f32s);

/// Eight points or directions.
#[derive(Clone, Copy)]
pub(crate) struct Lanes3<S> {
    pub(crate) x: Lanes<S>,
    pub(crate) y: Lanes<S>,
    pub(crate) z: Lanes<S>,
}

impl<S: Eight> Lanes3<S> {
    /// The same vector eight times.
    #[inline(always)]
    pub(crate) fn all(simd: S, [x, y, z]: [f32; 3]) -> Self {
        Self { x: Lanes::all(simd, x), y: Lanes::all(simd, y), z: Lanes::all(simd, z) }
    }

    #[inline(always)]
    pub(crate) fn dot(self, other: Self) -> Lanes<S> {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    #[inline(always)]
    pub(crate) fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - self.z * other.y,
            y: self.z * other.x - self.x * other.z,
            z: self.x * other.y - self.y * other.x,
        }
    }

    /// This vector where the mask is set, else the other one.
    #[inline(always)]
    pub(crate) fn where_set(self, mask: m32x8, other: Self) -> Self {
        Self {
            x: self.x.where_set(mask, other.x),
            y: self.y.where_set(mask, other.y),
            z: self.z.where_set(mask, other.z),
        }
    }
}

impl<S: Eight> Add for Lanes3<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl<S: Eight> Sub for Lanes3<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl<S: Eight> Mul<Lanes<S>> for Lanes3<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: Lanes<S>) -> Self {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }
}

/// A ray, each of its numbers eight times.
#[derive(Clone, Copy)]
pub(crate) struct LaneRay<S> {
    pub(crate) simd: S,
    pub(crate) origin: Lanes3<S>,
    pub(crate) direction: Lanes3<S>,
}

impl<S: Eight> LaneRay<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, origin: Vec3, direction: Vec3) -> Self {
        Self {
            simd,
            origin: Lanes3::all(simd, origin.to_array()),
            direction: Lanes3::all(simd, direction.to_array()),
        }
    }
}
