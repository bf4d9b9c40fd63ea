//! Elliptic sections of yarns that lie flat in the cloth.
//!
//! In: the cloth's normal at a data point, and the ratio of a section's width to its height. Out: a
//! [`PackedPress`], from which renderers make an `Oval`: with it they draw an ellipse as if it were
//! a circle. Four bytes a point.
//!
//! Method: a vector q along the ellipse's longer axis says all. The map v - q (q . v) shrinks
//! space along q by 1 - |q|². With the ratio k of both axes, |q|² = 1 - 1 / k makes a circle of
//! the ellipse, whose radius is the shorter half-axis. Rays are straight there as here, and meet
//! a surface at the same distance, in units of their direction. q is the product of the yarn's
//! tangent and the cloth's normal. So where a yarn runs through the cloth, from one face to the
//! other, it is round.
//!
//! Not promised: more than two digits of a ratio.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// Bits of a component of a packed vector, and the largest number in them.
const BITS: u32 = 10;
const MOST: f32 = 511.0;
/// Marks sections that stand upright: they are higher than wide.
const UPRIGHT: u32 = 1 << 31;
/// Largest |q|²: that of the ratio 10. Beyond it, sections would be sheets.
const MOST_SHRINKING: f32 = 0.9;

/// How a yarn is pressed at a data point, packed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct PackedPress(u32);

/// How a yarn is pressed at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Press {
    /// Along the cloth's normal, with a length of |q| for a yarn that lies in the cloth.
    normal: Vec3,
    /// Whether the section is higher than wide.
    is_upright: bool,
}

/// The section of a yarn at a point: q.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Oval(Vec3);

/// An [`Oval`] in four bytes, as shaders read it: three signed numbers of ten bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub(crate) struct PackedOval(u32);

impl PackedPress {
    /// That of a section whose width is `ratio` times its height, from 0.1 to 10, in cloth with
    /// this unit normal.
    #[must_use]
    pub fn new(normal: Vec3, ratio: f32) -> Self {
        let is_upright = ratio < 1.0;
        let shrinking = 1.0 - if is_upright { ratio } else { ratio.recip() };
        let packed = pack(normal * shrinking.clamp(0.0, MOST_SHRINKING).sqrt());
        Self(packed | if is_upright { UPRIGHT } else { 0 })
    }

    pub(crate) fn unpack(self) -> Press {
        Press { normal: unpack(self.0), is_upright: self.0 & UPRIGHT != 0 }
    }
}

impl Press {
    /// That between two points of a yarn. Both stand upright or neither, unless one is round.
    pub(crate) fn lerp(self, other: Self, share: f32) -> Self {
        let is_upright = self.is_upright || other.is_upright;
        Self { normal: self.normal.lerp(other.normal, share), is_upright }
    }

    /// What is seen of the section, over the radius of the circle of the same area: half of its
    /// width, and how far it rises toward the viewer. The yarn runs `along`, and the viewer is in
    /// the direction `toward`, both of any length. The width is what [`Oval::reach`] gives, with
    /// fewer roots.
    #[inline]
    pub(crate) fn silhouette(self, along: Vec3, toward: Vec3) -> [f32; 2] {
        let per_length = along.length_squared().max(f32::MIN_POSITIVE).recip();
        let (normal_along, toward_along) = (self.normal.dot(along), toward.dot(along));
        let long2 = self.normal.length_squared() - normal_along * normal_along * per_length;
        // The squared product of q and the direction of the width, of which the part of `toward`
        // across the yarn has this squared length.
        let across2 = toward.length_squared() - toward_along * toward_along * per_length;
        let product = self.normal.dot(toward) - normal_along * toward_along * per_length;
        let facing2 = (product * product / across2.max(f32::MIN_POSITIVE)).min(long2);
        let wide2 = if self.is_upright { long2 - facing2 } else { facing2 };
        let shrinking = 1.0 - long2;
        // In units of the shorter half-axis squared.
        let width2 = 1.0 + (1.0 + shrinking) * wide2 / (shrinking * shrinking);
        let rise2 = (1.0 - (1.0 + shrinking) * (long2 - wide2)).recip();
        [(shrinking * width2).sqrt(), (shrinking * rise2).sqrt()]
    }

    /// The section of a yarn with this unit tangent.
    pub(crate) fn oval(self, tangent: Vec3) -> Oval {
        let across = tangent.cross(self.normal);
        Oval(if self.is_upright { across.cross(tangent) } else { across })
    }
}

impl PackedOval {
    pub(crate) fn unpack(self) -> Oval {
        Oval(unpack(self.0))
    }
}

impl Oval {
    /// A circle.
    pub(crate) const ROUND: Self = Self(Vec3::ZERO);

    /// That of a vector q.
    pub(crate) fn new(vector: Vec3) -> Self {
        Self(vector)
    }

    pub(crate) fn pack(self) -> PackedOval {
        PackedOval(pack(self.0))
    }

    /// The vector q.
    pub(crate) fn vector(self) -> Vec3 {
        self.0
    }

    pub(crate) fn is_round(self) -> bool {
        self.0 == Vec3::ZERO
    }

    /// 1 - |q|²: the shorter half-axis over the longer one.
    fn shrinking(self) -> f32 {
        1.0 - self.0.length_squared()
    }

    /// The shorter half-axis over the radius of a circle of the same area.
    pub(crate) fn height(self) -> f32 {
        self.shrinking().sqrt()
    }

    /// The longer half-axis over that radius.
    pub(crate) fn half_width(self) -> f32 {
        self.height().recip()
    }

    /// A vector in the space where the section is a circle.
    pub(crate) fn shrunk(self, v: Vec3) -> Vec3 {
        v - self.0 * self.0.dot(v)
    }

    /// The vector that [`Self::shrunk`] makes this one of.
    pub(crate) fn grown(self, v: Vec3) -> Vec3 {
        v + self.0 * (self.0.dot(v) / self.shrinking())
    }

    /// How far the ellipse reaches in a unit direction across the yarn, over its shorter half-axis:
    /// sqrt(1 + (k² - 1) cos²).
    pub(crate) fn reach(self, direction: Vec3) -> f32 {
        self.reach_of_cosine(self.0.dot(direction))
    }

    /// The same along each axis.
    pub(crate) fn reaches(self) -> Vec3 {
        Vec3::from_array(self.0.to_array().map(|component| self.reach_of_cosine(component)))
    }

    /// The same in a direction that has this product with q.
    fn reach_of_cosine(self, product: f32) -> f32 {
        let shrinking = self.shrinking();
        // (k² - 1) / |q|² = (2 - |q|²) / (1 - |q|²)².
        (1.0 + (1.0 + shrinking) * (product / shrinking).powi(2)).sqrt()
    }

    /// Where the surface faces a unit direction across the yarn, from the axis, over the shorter
    /// half-axis.
    pub(crate) fn place_facing(self, normal: Vec3) -> Vec3 {
        if self.is_round() {
            return normal;
        }
        self.grown(self.grown(normal).normalize_or(normal))
    }
}

/// Three numbers from -1 to 1 in ten bits each.
fn pack(v: Vec3) -> u32 {
    let parts = (v * MOST).round().clamp(Vec3::splat(-MOST), Vec3::splat(MOST)).as_ivec3();
    let [x, y, z] = parts.to_array().map(|part| part.cast_unsigned() & ((1 << BITS) - 1));
    x | y << BITS | z << (2 * BITS)
}

/// The reverse of [`pack`].
fn unpack(packed: u32) -> Vec3 {
    let part = |shift: u32| {
        // The sign bit is moved to the top and back down.
        let part = (packed << (u32::BITS - BITS - shift)).cast_signed() >> (u32::BITS - BITS);
        part as f32 / MOST
    };
    Vec3::new(part(0), part(BITS), part(2 * BITS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn unit() -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(-1.0_f32..1.0)
            .prop_filter_map("no direction", |v| Vec3::from_array(v).try_normalize())
    }

    /// The section of a yarn along x in cloth that faces +z.
    fn along_x(ratio: f32) -> Oval {
        PackedPress::new(Vec3::Z, ratio).unpack().oval(Vec3::X).pack().unpack()
    }

    #[test]
    fn sections_are_as_wide_and_as_high_as_their_ratio_says() {
        for (ratio, [wide, high]) in [(4.0, [2.0, 0.5]), (0.25, [0.5, 2.0]), (1.0, [1.0, 1.0])] {
            let oval = along_x(ratio);
            let reach = |direction| oval.reach(direction) * oval.height();
            let off = [reach(Vec3::Y) - wide, reach(Vec3::Z) - high].map(f32::abs);
            assert!(off[0] < 0.01 && off[1] < 0.01, "{ratio}: {off:?}");
            assert!((reach(Vec3::X) - oval.height()).abs() < 1e-6);
        }
        assert!(along_x(1.0).is_round());
        let through = PackedPress::new(Vec3::Z, 4.0).unpack().oval(Vec3::Z);
        assert!(through.is_round(), "a yarn that runs through the cloth is round");
    }

    proptest! {
        #[test]
        fn packed_vectors_come_back(v in prop::array::uniform3(-1.0_f32..=1.0)) {
            let v = Vec3::from_array(v);
            prop_assert!((unpack(pack(v)) - v).abs().max_element() <= 0.5 / MOST + 1e-6);
        }

        /// The farthest point of the ellipse in a direction is the one that faces it.
        #[test]
        fn no_place_of_the_surface_reaches_farther(
            ratio in 0.1_f32..10.0, turn in 0.0_f32..6.3, other in 0.0_f32..6.3, seen in unit(),
        ) {
            let oval = along_x(ratio);
            let direction = |turn: f32| Vec3::new(0.0, turn.cos(), turn.sin());
            let here = oval.place_facing(direction(turn));
            prop_assert!((oval.shrunk(here).length() - 1.0).abs() < 1e-4, "on the surface");
            prop_assert!((here.dot(direction(turn)) - oval.reach(direction(turn))).abs() < 1e-3);
            let there = oval.place_facing(direction(other));
            prop_assert!(there.dot(direction(turn)) <= oval.reach(direction(turn)) + 1e-3);
            let back = oval.shrunk(oval.grown(seen));
            prop_assert!(back.distance(seen) < 1e-4);
        }

        /// The short way gives what the long one does.
        #[test]
        fn silhouettes_are_those_of_the_section(
            ratio in 0.1_f32..10.0, normal in unit(), along in unit(), toward in unit(),
        ) {
            prop_assume!(along.cross(toward).length() > 0.1);
            let press = PackedPress::new(normal, ratio).unpack();
            let oval = press.oval(along);
            let width = along.cross(toward).normalize();
            let rise = oval.shrunk(width.cross(along)).length_recip();
            let long = [oval.reach(width), rise];
            for (short, long) in press.silhouette(along * 3.0, toward * 0.2).into_iter().zip(long) {
                prop_assert!((short - long * oval.height()).abs() < 0.01 * short, "{} {}", short, long);
            }
        }
    }
}
