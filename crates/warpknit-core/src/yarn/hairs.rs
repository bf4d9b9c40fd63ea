//! Hairs: fibres that stand off a spun yarn.
//!
//! In: the control points of a yarn and its [`Hairs`]. Out: polylines, one for each hair.
//!
//! Method: hairs are drawn from what hairiness testers measure. Their length in all is the hairiness
//! index of Uster's tester: mm of hair for each mm of yarn. Their lengths are distributed as sums of
//! two exponentials (A. Barella and A. Manich, Yarn hairiness: a further update, Textile Progress
//! 31(4), 2002): most are short, and few stand far off. Each leaves the yarn along its twist, leans
//! outward, bends and curls. A third are loops, which end in the yarn again.
//!
//! Cost: some forty multiplications a point. Hairs depend on their span of the yarn alone, so a part
//! of a yarn has the hairs that it has in the whole.
//!
//! Not promised: hairs that keep off other yarns.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3, Vec3A};

use super::fibres::{Bundle, FIBRE_RADIUS};
use super::random::SplitMix64;
use super::{curve, frame};
use crate::number::{double, narrow};

/// The largest hairiness: more than any yarn has.
pub const MOST_HAIRINESS: f64 = 50.0;
/// Mean lengths of short and long hairs, mm, and the share of long ones. A hairiness of 5 is then 17
/// hairs a mm, of which some 200 a metre reach over 1 mm from the yarn and 15 over 3 mm: about as
/// many as testers count on ring-spun cotton of 20 tex.
const SHORT: f64 = 0.27;
const LONG: f64 = 1.4;
const LONG_SHARE: f64 = 0.02;
/// Longest hair, in mean lengths of its kind: one of a thousand would be longer.
const LONGEST: f64 = 7.0;
/// Radius of a yarn of that cotton, mm. Thicker yarns are spun of longer and coarser fibres: length and
/// thickness of hairs grow with the root of the radius. So a woollen yarn of 170 tex has hairs of 19
/// micrometres.
const COTTON_YARN: f64 = 0.08;
/// The largest number of hairs between two data points. A stray point may make a span of metres.
const MOST_A_SPAN: f64 = 10_000.0;
/// Points of a hair.
pub const POINTS: u8 = 8;
/// Share of hairs that are loops: testers see about one for two ends.
const LOOPS: f64 = 0.33;
/// Share of hairs that lean against the yarn's direction.
const BACKWARD: f64 = 0.25;
/// Depth of a hair's root below the yarn's surface, in the yarn's radii. Grooves between plies, and
/// thin places, are no deeper.
const ROOT: f64 = 0.2;
/// Least and largest angle between a hair and the yarn's surface, radians.
const LEAN: [f64; 2] = [0.25, 1.1];
/// Largest turn of a hair over its length, radians, either way.
const BEND: f64 = 1.3;
/// How far a loop turns toward the yarn, in angles of its lean. At 2 it would only touch the surface.
const LOOP_TURN: f64 = 2.4;
/// Largest turn of a hair's waves, radians, and their length, mm: the crimp of cotton.
const CURL: f64 = 0.5;
const WAVE: f64 = 0.35;

/// The hairs of a yarn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hairs {
    /// Radius of the yarn, mm.
    pub yarn_radius: f64,
    /// Radius of a hair, mm.
    pub radius: f64,
    /// Mean number of hairs for each mm of yarn.
    pub per_mm: f64,
    /// Slope of the fibres against the axis, at the yarn's surface. Positive is S twist.
    pub slope: f64,
    /// How many times longer hairs are than those of cotton in life.
    pub scale: f64,
}

impl Hairs {
    /// The hairs of a yarn of this hairiness, whose fibres fill it as `bundle` says, in cloth that is
    /// drawn `enlargement` times larger than in life.
    ///
    /// ```
    /// use warpknit_core::yarn::fibres::Bundle;
    /// use warpknit_core::yarn::hairs::Hairs;
    /// let hairs = Hairs::of(5.0, &Bundle::filling(0.08, 0.6, 0.0045, 0.4), 1.0);
    /// assert!((hairs.per_mm - 17.1).abs() < 0.1);
    /// ```
    #[must_use]
    pub fn of(hairiness: f64, bundle: &Bundle, enlargement: f64) -> Self {
        let mean = SHORT * (1.0 - LONG_SHARE) + LONG * LONG_SHARE;
        let coarser = (bundle.radius / enlargement / COTTON_YARN).sqrt().max(1.0);
        let scale = coarser * enlargement;
        let hairs = Self {
            yarn_radius: bundle.radius,
            radius: FIBRE_RADIUS * scale,
            per_mm: hairiness / (mean * scale),
            slope: bundle.slope,
            scale,
        };
        // Whoever asks for thicker fibres gets fewer hairs too.
        hairs.at_least(bundle.fibre)
    }

    /// Fewer and thicker hairs that hide as much, where hairs are thinner than `radius` mm.
    #[must_use]
    pub fn at_least(self, radius: f64) -> Self {
        let thick = self.radius.max(radius);
        Self { radius: thick, per_mm: self.per_mm * self.radius / thick, ..self }
    }

    /// The mean number of hairs between two data points, `length` mm of yarn apart.
    #[must_use]
    pub fn between(&self, length: f64) -> f64 {
        (self.per_mm * length).min(MOST_A_SPAN)
    }
}

/// Calls `take` with each hair on the span from one control point of a yarn to the next, as points in
/// mm. `number` is that of the span, counted along the yarn. Of all hairs, `share` are handed out.
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
    let mut left = hairs.between(path.length()) + random.next_unit();
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
    /// Its length in cotton, mm.
    length: f64,
    /// Its angle against the yarn's surface.
    lean: f64,
    /// Whether it leans against the yarn's direction.
    is_backward: bool,
    /// How it turns, radians over its length: in the plane in which it leans, and out of it.
    bend: [f64; 2],
    /// Whether both of its ends are in the yarn.
    is_loop: bool,
    /// Where its waves begin, as an angle.
    wave: f64,
    /// Hairs of the lowest ranks are drawn where few are.
    rank: f64,
}

impl Hair {
    fn drawn(random: &mut SplitMix64) -> Self {
        let [along, around, sort, length, lean, back, kind, up, side, wave, rank] =
            std::array::from_fn(|_| random.next_unit());
        let mean = if sort < LONG_SHARE { LONG } else { SHORT };
        let lean = LEAN[0] + (LEAN[1] - LEAN[0]) * lean;
        let is_loop = kind < LOOPS;
        // An end turns outward or back until it is level, but not into the yarn. A loop lies along the
        // yarn: across it, the surface would fall away below.
        let bend = if is_loop {
            [-LOOP_TURN * lean, 0.0]
        } else {
            [(BEND + lean) * up - lean, BEND * (2.0 * side - 1.0)]
        };
        Self {
            along,
            around: TAU * around,
            length: mean * (-(1.0 - length).max(f64::MIN_POSITIVE).ln()).min(LONGEST),
            lean,
            is_backward: back < BACKWARD,
            bend,
            is_loop,
            wave: TAU * wave,
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
        let slope = if self.is_loop { 0.0 } else { hairs.slope };
        let helix = (tangent + out.cross(tangent) * slope).normalize();
        let level = if self.is_backward { -helix } else { helix };
        let aside = out.cross(level);
        let pieces = f64::from(POINTS - 2);
        let step = self.length * hairs.scale / pieces;
        let mut point = axis + out * hairs.yarn_radius;
        std::array::from_fn(|index| {
            let Some(piece) = index.checked_sub(1) else {
                // The root lies below the place where the hair leaves the surface.
                return (point - out * (ROOT * hairs.yarn_radius)).as_vec3();
            };
            let here = point.as_vec3();
            // Half way through the piece, so that a loop's two halves are alike.
            let share = (double(piece) + 0.5) / pieces;
            let wave = CURL * (self.wave + TAU * share * self.length / WAVE).sin();
            let rise = self.lean + self.bend[0] * share;
            let sway = self.bend[1] * share + wave;
            let flat = level * sway.cos() + aside * sway.sin();
            point += (flat * rise.cos() + out * rise.sin()) * step;
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

    /// Hairs of a yarn of this radius, mm.
    fn hairs(hairiness: f64, radius: f64, slope: f64, enlargement: f64) -> Hairs {
        let bundle = Bundle::filling(radius, 0.6, FIBRE_RADIUS * enlargement, slope);
        Hairs::of(hairiness, &bundle, enlargement)
    }

    #[test]
    fn their_length_in_all_is_the_hairiness() {
        for (hairiness, radius, enlargement) in
            [(5.0, 0.08, 1.0), (15.0, 0.34, 1.0), (8.0, 0.24, 3.0)]
        {
            let hairs = hairs(hairiness, radius, 0.4, enlargement);
            // What lies outside the yarn: roots don't count, nor do ends of loops.
            let is_outside = |point: Vec3| f64::from(point.x.hypot(point.z)) > radius;
            let outside = |hair: &Vec<Vec3>| -> f64 {
                let pieces = hair[1..].windows(2);
                let seen = pieces.filter(|ends| is_outside(ends[0].midpoint(ends[1])));
                seen.map(length).sum()
            };
            let sum: f64 = all(&hairs, 1, 1.0).iter().map(outside).sum();
            let measured = sum / double(LENGTH);
            assert!((measured / hairiness - 1.0).abs() < 0.1, "{measured} for {hairiness}");
        }
    }

    #[test]
    fn few_stand_far_off_and_loops_end_in_the_yarn() {
        let hairs = hairs(5.0, 0.08, 0.4, 1.0);
        let off = |point: &Vec3| f64::from(point.x.hypot(point.z)) - hairs.yarn_radius;
        let yarns = 0..20;
        let metres = 0.001 * double(LENGTH * yarns.len());
        let grown: Vec<_> = yarns.flat_map(|yarn| all(&hairs, yarn, 1.0)).collect();
        let over = |least: f64| {
            let far = grown.iter().filter(|hair| hair.iter().map(off).fold(0.0, f64::max) > least);
            double(far.count()) / metres
        };
        // Hairs a metre, of ring-spun cotton.
        let [one, three] = [1.0, 3.0].map(over);
        assert!((150.0..250.0).contains(&one) && (8.0..22.0).contains(&three), "{one} {three}");
        let loops = grown.iter().filter(|hair| off(&hair[usize::from(POINTS) - 1]) < 0.0).count();
        let share = double(loops) / double(grown.len());
        assert!((0.25..0.38).contains(&share), "{share}");
    }

    #[test]
    fn they_leave_along_the_twist_from_within_the_yarn() {
        for slope in [0.5, -0.5] {
            let hairs = hairs(5.0, 0.08, slope, 1.0);
            let (mut across, mut forward) = (0.0, 0);
            let all = all(&hairs, 3, 1.0);
            for hair in &all {
                let root = hair[0];
                assert!(f64::from(root.x.hypot(root.z)) < hairs.yarn_radius);
                // Seen from outside, S runs from the upper left to the lower right: up and to the left.
                let left = Vec3::Y.cross(Vec3::new(root.x, 0.0, root.z)).normalize();
                let way = (hair[2] - hair[1]).normalize();
                across -= f64::from(way.dot(left) * way.y.signum());
                forward += usize::from(way.y > 0.0);
            }
            assert!(across * slope > 0.0, "{across} for {slope}");
            let share = double(forward) / double(all.len());
            assert!((0.68..0.82).contains(&share), "{share}");
        }
    }

    #[test]
    fn neighbouring_yarns_and_stray_points_have_hairs_of_their_own() {
        let hairs = hairs(5.0, 0.08, 0.4, 1.0);
        let one: Vec<_> = (0..12).map(|yarn| all(&hairs, yarn, 1.0)).collect();
        for (yarn, other) in one.iter().zip(&one[1..]) {
            assert!(yarn.iter().all(|hair| !other.contains(hair)));
        }
        assert!(hairs.between(f64::INFINITY) <= MOST_A_SPAN);
        assert!(hairs.between(1e9) <= MOST_A_SPAN);
    }

    #[test]
    fn fewer_of_them_are_some_of_the_same() {
        let hairs = hairs(5.0, 0.08, 0.4, 1.0);
        let (every, some) = (all(&hairs, 4, 1.0), all(&hairs, 4, 0.3));
        let share = double(some.len()) / double(every.len());
        assert!((0.25..0.35).contains(&share), "{share}");
        assert!(some.iter().all(|hair| every.contains(hair)));
        assert!(all(&hairs, 5, 1.0) != every);
        let thick = hairs.at_least(0.012);
        assert!((thick.per_mm * thick.radius - hairs.per_mm * hairs.radius).abs() < 1e-12);
    }
}
