//! Hairs: fibres that stand off a spun yarn.
//!
//! In: the control points of a yarn and its [`Hairs`]. Out: polylines, one for each hair.
//!
//! Method: hairs are drawn from what hairiness testers measure. Their length in all is the hairiness
//! index of Uster's tester: mm of hair for each mm of yarn. Their lengths are distributed as sums of
//! two exponentials (A. Barella and A. Manich, Yarn hairiness: a further update, Textile Progress
//! 31(4), 2002): most are short, and few stand far off. Each leaves the yarn along its twist, leans
//! outward and bends as it goes. Some end in the yarn again: testers see about one loop for two ends.
//!
//! Cost: some forty multiplications a point. Hairs depend on their span of the yarn alone, so a part
//! of a yarn has the hairs that it has in the whole.
//!
//! Not promised: hairs that keep off other yarns.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3, Vec3A};

use super::random::SplitMix64;
use super::{curve, frame};
use crate::number::{double, narrow};

/// The largest hairiness: more than any yarn has.
pub const MOST_HAIRINESS: f64 = 50.0;
/// Mean lengths of short and long hairs, mm, and the share of long ones. A hairiness of 5 is then 16
/// hairs a mm, of which some 200 a metre reach over 1 mm from the yarn and 15 over 3 mm: about as
/// many as testers count on ring-spun cotton of 20 tex.
const SHORT: f64 = 0.3;
const LONG: f64 = 1.4;
const LONG_SHARE: f64 = 0.02;
/// The longest hair, in mean lengths of long ones: one of a thousand is longer.
const LONGEST: f64 = 7.0;
/// Points of a hair.
pub const POINTS: u8 = 7;
/// Share of hairs that end in the yarn again.
const LOOPS: f64 = 0.33;
/// Where hairs leave the yarn, in its radii. It is below the surface, as grooves between plies are.
const ROOT: f64 = 0.8;
/// Least and largest angle between a hair and the yarn's surface, radians.
const LEAN: [f64; 2] = [0.25, 1.1];
/// Largest turn of a hair over its length, radians, either way.
const BEND: f64 = 1.3;
/// Turn of a hair that ends in the yarn again, toward the axis, radians.
const LOOP_BEND: f64 = 2.2;

/// The hairs of a yarn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hairs {
    /// Radius of the yarn, mm.
    pub yarn: f64,
    /// Radius of a hair, mm.
    pub radius: f64,
    /// Mean number of hairs for each mm of yarn.
    pub per_mm: f64,
    /// Slope of the fibres against the axis, at the yarn's surface. Positive is S twist.
    pub slope: f64,
    /// How many times larger than in life the cloth is drawn.
    pub enlargement: f64,
}

impl Hairs {
    /// The hairs of a yarn of this hairiness. Radii are those of the enlarged cloth.
    ///
    /// ```
    /// use warpknit_core::yarn::hairs::Hairs;
    /// let hairs = Hairs::of(5.0, 0.08, 0.006, 0.4, 1.0);
    /// assert!((hairs.per_mm - 15.5).abs() < 0.1);
    /// ```
    #[must_use]
    pub fn of(hairiness: f64, yarn: f64, radius: f64, slope: f64, enlargement: f64) -> Self {
        let mean = SHORT * (1.0 - LONG_SHARE) + LONG * LONG_SHARE;
        Self { yarn, radius, per_mm: hairiness / (mean * enlargement), slope, enlargement }
    }

    /// Fewer and thicker hairs that hide as much, where hairs are thinner than `least` mm.
    #[must_use]
    pub fn at_least(self, least: f64) -> Self {
        let radius = self.radius.max(least);
        Self { radius, per_mm: self.per_mm * self.radius / radius, ..self }
    }
}

/// Calls `take` with each hair on the span from one control point of a yarn to the next, as points in
/// mm. `number` is that of the span, counted along the yarn, and `share` of all hairs are there.
///
/// # Panics
/// If the yarn has no such span.
pub fn for_each_hair(
    hairs: &Hairs,
    controls: &[DVec3],
    span: usize,
    (yarn, number): (u32, i64),
    share: f64,
    take: &mut impl FnMut(&[Vec3]),
) {
    let path = curve::span(controls, span);
    let mut random = SplitMix64::new(u64::from(yarn), number.cast_unsigned());
    let mut left = hairs.per_mm * path.length() + random.next_unit();
    while left >= 1.0 {
        left -= 1.0;
        // All numbers of a hair are drawn before it is left out, so that the others stay.
        let hair = Hair::drawn(&mut random);
        if hair.rank < share {
            take(&hair.points(hairs, path.at(hair.along), path.tangent(hair.along)));
        }
    }
}

/// What chance decides about a hair.
struct Hair {
    /// Where it leaves the yarn, as a share of its span.
    along: f64,
    /// Where it leaves the yarn, as an angle around it.
    around: f64,
    /// Its length in life, mm.
    length: f64,
    /// Its angle against the yarn's surface.
    lean: f64,
    /// How it turns, radians over its length: in the plane in which it leans, and out of it.
    bend: [f64; 2],
    /// Whether it turns back at its half, as an S.
    is_s: bool,
    /// Hairs of the lowest ranks are drawn where few are.
    rank: f64,
}

impl Hair {
    fn drawn(random: &mut SplitMix64) -> Self {
        let [along, around, sort, length, lean, up, side, s, rank] =
            std::array::from_fn(|_| random.next_unit());
        let mean = if sort < LONG_SHARE { LONG } else { SHORT };
        let is_loop = (sort - LONG_SHARE).rem_euclid(1.0) < LOOPS;
        let bend = |number: f64| BEND * (2.0 * number - 1.0);
        Self {
            along,
            around: TAU * around,
            length: mean * (-(1.0 - length).max(f64::MIN_POSITIVE).ln()).min(LONGEST),
            lean: LEAN[0] + (LEAN[1] - LEAN[0]) * lean,
            bend: [if is_loop { -LOOP_BEND } else { bend(up) }, bend(side)],
            is_s: !is_loop && s < 0.5,
            rank,
        }
    }

    /// Its points, from within the yarn to its end, where the yarn is at `axis` and runs along
    /// `tangent`.
    fn points(&self, hairs: &Hairs, axis: DVec3, tangent: DVec3) -> [Vec3; POINTS as usize] {
        let tangent = Vec3A::from(tangent.as_vec3()).normalize_or(Vec3A::X);
        let normal = frame::perpendicular_unit(Vec3A::Z, tangent);
        let (sin, cos) = self.around.sin_cos();
        let out = (normal * narrow(cos) + tangent.cross(normal) * narrow(sin)).as_dvec3();
        let tangent = tangent.as_dvec3();
        // S twist runs clockwise as it goes away from the eye.
        let across = out.cross(tangent);
        let surface = (tangent + across * hairs.slope).normalize();
        let aside = out.cross(surface);
        // The frame of the hair's own direction turns with it.
        let (mut point, mut rise, mut sway) = (axis + out * (ROOT * hairs.yarn), self.lean, 0.0);
        let pieces = f64::from(POINTS - 1);
        let step = self.length * hairs.enlargement / pieces;
        std::array::from_fn(|piece| {
            let here = point.as_vec3();
            let level = surface * f64::cos(sway) + aside * f64::sin(sway);
            point += (level * f64::cos(rise) + out * f64::sin(rise)) * step;
            let turns_back = self.is_s && double(2 * piece) >= pieces;
            let turn = if turns_back { -1.0 } else { 1.0 } / pieces;
            rise += self.bend[0] * turn;
            sway += self.bend[1] * turn;
            here
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENGTH: usize = 200;

    fn straight() -> Vec<DVec3> {
        (0..=LENGTH).map(|at| DVec3::Y * double(at)).collect()
    }

    fn all(hairs: &Hairs, yarn: u32, share: f64) -> Vec<Vec<Vec3>> {
        let (controls, mut all) = (straight(), Vec::new());
        for span in 0..LENGTH {
            let number = (yarn, i64::try_from(span).unwrap());
            for_each_hair(hairs, &controls, span, number, share, &mut |hair| {
                all.push(hair.to_vec());
            });
        }
        all
    }

    fn length(hair: &[Vec3]) -> f64 {
        hair.windows(2).map(|ends| f64::from(ends[0].distance(ends[1]))).sum()
    }

    #[test]
    fn their_length_in_all_is_the_hairiness() {
        for (hairiness, enlargement) in [(5.0, 1.0), (8.0, 3.0)] {
            let hairs = Hairs::of(hairiness, 0.08, 0.006, 0.4, enlargement);
            let sum: f64 = all(&hairs, 1, 1.0).iter().map(|hair| length(hair)).sum();
            let measured = sum / double(LENGTH);
            assert!((measured / hairiness - 1.0).abs() < 0.1, "{measured} for {hairiness}");
        }
    }

    #[test]
    fn few_stand_far_off() {
        let hairs = Hairs::of(5.0, 0.08, 0.006, 0.4, 1.0);
        let reach = |hair: &[Vec3]| {
            let off = hair.iter().map(|point| point.x.hypot(point.z)).fold(0.0, f32::max);
            f64::from(off) - hairs.yarn
        };
        let yarns = 0..20;
        let metres = 0.001 * double(LENGTH * yarns.len());
        let reaches: Vec<f64> =
            yarns.flat_map(|yarn| all(&hairs, yarn, 1.0)).map(|hair| reach(&hair)).collect();
        let over = |least: f64| double(reaches.iter().filter(|reach| **reach > least).count());
        // Hairs a metre, of ring-spun cotton.
        let [one, three] = [1.0, 3.0].map(|least| over(least) / metres);
        println!("{one} hairs a metre over 1 mm, {three} over 3 mm");
        assert!((100.0..250.0).contains(&one) && (3.0..20.0).contains(&three), "{one} {three}");
    }

    #[test]
    fn they_leave_along_the_twist_from_within_the_yarn() {
        for slope in [0.5, -0.5] {
            let hairs = Hairs::of(5.0, 0.08, 0.006, slope, 1.0);
            let mut across = 0.0;
            for hair in all(&hairs, 3, 1.0) {
                let (root, next) = (hair[0], hair[1]);
                assert!(f64::from(root.x.hypot(root.z)) < hairs.yarn);
                assert!(next.y > root.y);
                // Seen from outside, S runs from the upper left to the lower right: up and to the left.
                let left = Vec3::Y.cross(Vec3::new(root.x, 0.0, root.z)).normalize();
                across += f64::from((next - root).dot(-left) / (next - root).length());
            }
            assert!(across * slope > 0.0, "{across} for {slope}");
        }
    }

    #[test]
    fn fewer_of_them_are_some_of_the_same() {
        let hairs = Hairs::of(5.0, 0.08, 0.006, 0.4, 1.0);
        let (every, some) = (all(&hairs, 4, 1.0), all(&hairs, 4, 0.3));
        let share = double(some.len()) / double(every.len());
        assert!((0.25..0.35).contains(&share), "{share}");
        assert!(some.iter().all(|hair| every.contains(hair)));
        assert!(all(&hairs, 5, 1.0) != every);
        let thick = hairs.at_least(0.012);
        assert!((thick.per_mm * thick.radius - hairs.per_mm * hairs.radius).abs() < 1e-12);
    }
}
