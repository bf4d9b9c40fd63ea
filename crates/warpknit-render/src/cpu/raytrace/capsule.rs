//! Ray-capsule intersection, eight capsules at a time. A capsule is a sphere swept along a straight
//! axis; yarns are chains of them.
//!
//! In: a ray and a [`SegmentLeaf`], up to eight consecutive capsules of one yarn in plain arrays.
//! Out: the distances at which the ray enters them. The test solves the quadratic of the infinite
//! cylinder, then the sphere at the nearer end if the cylinder is entered beyond an end (Ericson
//! 2005, 'Real-Time Collision Detection', section 5.3.7).
//!
//! Yarns are hundredths of a millimetre thick and the eye stands metres away. In `f32`, the
//! quadratic of such a ray would cancel all digits of the radius. So the ray's origin is first
//! moved beside the capsule. Rays that start inside a capsule do not meet it.

use glam::Vec4;

use crate::bvh::lanes::{Eight, LANES, LaneRay, Lanes, Lanes3};
use crate::bvh::tree;
use warpknit_core::ids::index32;

/// Up to eight consecutive segments of one yarn.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(super) struct SegmentLeaf {
    /// Coordinates of the points. Each segment ends where the next one starts.
    points: [[f32; LANES + 1]; 3],
    radii: [f32; LANES],
    /// First point of the first segment.
    pub(super) first: u32,
    /// Bit i is set if there is an i-th segment.
    used: u32,
}

impl tree::Leaf for SegmentLeaf {
    #[inline(always)]
    fn shape(&self, lane: usize) -> u32 {
        self.first + index32(lane)
    }
}

impl SegmentLeaf {
    /// The segments between consecutive points, at most eight. Each has the radius in `w` of its
    /// first point; `first` is that point's number.
    pub(super) fn new(points: &[Vec4], first: u32, radius: impl Fn(u32) -> f32) -> Self {
        let segments = points.len() - 1;
        let last = points[segments];
        let at = |index: usize| points.get(index).copied().unwrap_or(last);
        Self {
            points: std::array::from_fn(|axis| std::array::from_fn(|index| at(index)[axis])),
            radii: std::array::from_fn(|lane| {
                if lane < segments { radius(first + index32(lane)) } else { 0.0 }
            }),
            first,
            used: (1 << segments) - 1,
        }
    }

    /// The lanes of segments other than `own` and its two neighbours, as bits.
    #[inline(always)]
    pub(super) fn others(&self, own: u32) -> u32 {
        // Three bits, the middle one at `own`, moved down by one so that none is lost at lane 0.
        let place = own.wrapping_sub(self.first).wrapping_add(1);
        if place <= index32(LANES) + 1 { !((0b111 << place) >> 2) } else { u32::MAX }
    }

    /// Coordinates of the segments' starts and ends.
    #[inline(always)]
    fn ends<S: Eight>(&self, simd: S) -> (Lanes3<S>, Lanes3<S>) {
        let [x, y, z] = &self.points;
        let start = |values: &[f32; LANES + 1]| {
            let [a, b, c, d, e, f, g, h, _] = *values;
            Lanes::new(simd, [a, b, c, d, e, f, g, h])
        };
        let end = |values: &[f32; LANES + 1]| {
            let [_, b, c, d, e, f, g, h, i] = *values;
            Lanes::new(simd, [b, c, d, e, f, g, h, i])
        };
        (
            Lanes3 { x: start(x), y: start(y), z: start(z) },
            Lanes3 { x: end(x), y: end(y), z: end(z) },
        )
    }

    /// The segments whose infinite cylinders the ray's line meets, as bits, and what
    /// [`Beside::distances`] needs to go on. `ovals` are the vectors of flattened sections
    /// ([`crate::oval`]), for which the radii are shorter half-axes.
    #[inline(always)]
    pub(super) fn near<S: Eight>(
        &self,
        ray: &LaneRay<S>,
        ovals: Option<Lanes3<S>>,
    ) -> (u32, Beside<S>) {
        let simd = ray.simd;
        let (a, b) = self.ends(simd);
        // Move the origin beside the capsule. With an origin at 4000 mm, |o|^2 - r^2 would have no
        // digit left for a radius of 0.03 mm (Haines et al. 2019, 'Precision Improvements for
        // Ray/Sphere Intersection').
        let middle = (a + b) * Lanes::all(simd, 0.5);
        let beside = (middle - ray.origin).dot(ray.direction);
        let from_a = (ray.origin - a) + ray.direction * beside;
        let ab = b - a;
        let one = Lanes::all(simd, 1.0);
        let (from_a, ab, direction, unit) = match ovals {
            None => (from_a, ab, ray.direction, one),
            Some(q) => {
                let direction = shrunk(ray.direction, q);
                let unit = one / direction.dot(direction).sqrt();
                (shrunk(from_a, q), shrunk(ab, q), direction * unit, unit)
            }
        };
        // Early out: most capsules in a leaf of the hierarchy are missed. The distance between the
        // ray's line and the axis' line is |missed| / |normal|. Comparing its square needs neither a
        // root nor a division. The factor 1.0001 covers rounding; below 1 + 1e-6 it would reject
        // grazing hits, and a larger one would only reject fewer misses early.
        let normal = direction.cross(ab);
        let missed = from_a.dot(normal);
        let radius = Lanes::new(simd, self.radii);
        let radius2 = radius * radius;
        let most = radius2 * Lanes::all(simd, 1.000_1) * normal.dot(normal);
        let near = simd.bits((missed * missed).at_most(most));
        (near & self.used, Beside { beside, from_a, ab, direction, unit, radius2 })
    }
}

/// A ray whose origin is moved beside each capsule of a leaf.
#[derive(Clone, Copy)]
pub(super) struct Beside<S> {
    /// Distance by which the origin was moved.
    beside: Lanes<S>,
    /// The moved origin, relative to the capsule's start.
    from_a: Lanes3<S>,
    /// The capsule's axis.
    ab: Lanes3<S>,
    /// The ray's direction where the capsule is round, and the distance along the ray that a unit
    /// of it stands for.
    direction: Lanes3<S>,
    unit: Lanes<S>,
    radius2: Lanes<S>,
}

impl<S: Eight> Beside<S> {
    /// Distances along the ray to its entry into the capsules; infinite where it misses.
    #[inline(always)]
    pub(super) fn distances(&self, ray: &LaneRay<S>) -> Lanes<S> {
        let simd = ray.simd;
        let &Self { beside, from_a, ab, direction, unit, radius2 } = self;
        let (zero, infinity) = (Lanes::all(simd, 0.0), Lanes::all(simd, f32::INFINITY));
        let length = ab.dot(ab).sqrt();
        let per_length = (Lanes::all(simd, 1.0) / length).where_set(zero.less_than(length), zero);
        let axis = ab * per_length;
        let (slope, height) = (direction.dot(axis), from_a.dot(axis));
        // Components across the axis, in which the cylinder is a circle:
        // |apart + t across| = radius.
        let (across, apart) = (direction - axis * slope, from_a - axis * height);
        // The quadratic qa t^2 + 2 qb t + qc = 0, with half of the usual linear coefficient.
        let (qa, qb) = (across.dot(across), across.dot(apart));
        let qc = apart.dot(apart) - radius2;
        let discriminant = qb * qb - qa * qc;
        let meets = zero.at_most(discriminant);
        // `qa` is the squared sine of the angle to the axis. Below about 1e-7, rounding makes the
        // root meaningless; the end's sphere gives the same entry then.
        let slanted = Lanes::all(simd, 1e-7).less_than(qa);
        let on_cylinder = (zero - qb - discriminant.max(zero).sqrt()) / qa;
        let entry = height + on_cylinder * slope;
        let on_side =
            simd.and_m32s(slanted, simd.and_m32s(zero.at_most(entry), entry.at_most(length)));
        // Beyond an end, only the sphere there can be met. A ray parallel to the axis can only
        // enter through the end that it meets first: its place before the start stands for it.
        let place = entry.where_set(slanted, zero - slope);
        let end = from_a.where_set(place.less_than(zero), from_a - ab);
        let on_end = ball(simd, end, direction, radius2);
        let distance = beside + on_cylinder.where_set(on_side, on_end) * unit;
        let ahead = simd.and_m32s(meets, zero.at_most(distance));
        distance.where_set(ahead, infinity)
    }
}

/// Vectors in the spaces where sections are circles, as of [`crate::oval::Oval::shrunk`].
#[inline(always)]
fn shrunk<S: Eight>(v: Lanes3<S>, q: Lanes3<S>) -> Lanes3<S> {
    v - q * q.dot(v)
}

/// Distances to balls' surfaces, for a ray whose origin is relative to their centres; infinite where
/// it misses.
#[inline(always)]
fn ball<S: Eight>(simd: S, origin: Lanes3<S>, direction: Lanes3<S>, radius2: Lanes<S>) -> Lanes<S> {
    let zero = Lanes::all(simd, 0.0);
    let closest = zero - origin.dot(direction);
    // The squared distance of the line from the centre, computed from the closest point and not as
    // b^2 - c, which cancels.
    let missed = origin + direction * closest;
    let half2 = radius2 - missed.dot(missed);
    (closest - half2.max(zero).sqrt())
        .where_set(zero.at_most(half2), Lanes::all(simd, f32::INFINITY))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::lanes::{Instructions, Kernel};
    use glam::{DVec3, Vec3};
    use proptest::prelude::*;

    /// A ray at a leaf, whose capsules have the vector of one section if they are flattened.
    struct One<'a>(&'a SegmentLeaf, Vec3, Vec3, Option<Vec3>);

    impl Kernel for One<'_> {
        type Output = [f32; LANES];

        #[inline(always)]
        fn run<S: Eight>(self, simd: S) -> [f32; LANES] {
            let ray = LaneRay::new(simd, self.1, self.2);
            let ovals = self.3.map(|q| Lanes3::all(simd, q.to_array()));
            let (near, beside) = self.0.near(&ray, ovals);
            let distances = beside.distances(&ray).array();
            std::array::from_fn(
                |lane| {
                    if near >> lane & 1 == 1 { distances[lane] } else { f32::INFINITY }
                },
            )
        }
    }

    /// Distance to the capsule from `a` to `b`, which is alone in its leaf.
    fn capsule(origin: Vec3, direction: Vec3, a: Vec3, b: Vec3, radius: f32) -> f32 {
        let leaf = SegmentLeaf::new(&[a.extend(radius), b.extend(0.0)], 0, |_| radius);
        let [distance, others @ ..] = Instructions::best().run(One(&leaf, origin, direction, None));
        assert_eq!(others, [f32::INFINITY; LANES - 1], "absent capsules are never hit");
        distance
    }

    /// The same by halving in f64. Along a line, the distance to a convex body falls to its least
    /// value and rises again, so its way in lies between the ray's start and that least value.
    /// Rays that start inside miss it.
    fn by_halving(origin: DVec3, direction: DVec3, a: DVec3, b: DVec3, radius: f64) -> f64 {
        let gap = |t: f64| {
            let p = origin + direction * t;
            let s = ((p - a).dot(b - a) / (b - a).length_squared().max(1e-30)).clamp(0.0, 1.0);
            p.distance(a + (b - a) * s) - radius
        };
        if gap(0.0) < 0.0 {
            return f64::INFINITY;
        }
        let (mut from, mut to) = (0.0, origin.distance(a) + origin.distance(b));
        for _ in 0..200 {
            let (low, high) = (from + (to - from) / 3.0, to - (to - from) / 3.0);
            if gap(low) < gap(high) { to = high } else { from = low }
        }
        let (mut outside, mut inside) = (0.0, from);
        if gap(inside) > 0.0 {
            return f64::INFINITY;
        }
        for _ in 0..100 {
            let half = f64::midpoint(outside, inside);
            if gap(half) > 0.0 { outside = half } else { inside = half }
        }
        inside
    }

    #[test]
    fn capsules_agree_with_halving_in_f64_from_everywhere() {
        let ends = [
            (DVec3::ZERO, DVec3::X),
            (DVec3::new(0.3, 0.2, -0.1), DVec3::new(0.3, 0.2, -0.1)),
            (DVec3::Z, DVec3::new(0.1, -0.4, 0.2)),
        ];
        for (a, b) in ends {
            for step in 0_u8..200 {
                let angle = f64::from(step) * 0.71;
                let origin = DVec3::new(
                    angle.cos() * 3.0,
                    (angle * 1.3).sin() * 2.0 + 1.5,
                    angle.sin() * 3.0,
                );
                let aim = a.lerp(b, f64::from(step % 7) / 5.0 - 0.1)
                    + DVec3::new(0.0, f64::from(step % 5) * 0.04, 0.0);
                let direction = (aim - origin).normalize();
                let expected = by_halving(origin, direction, a, b, 0.1);
                let [o, d, p, q] = [origin, direction, a, b].map(|v| v.as_vec3());
                let found = f64::from(capsule(o, d, p, q, 0.1));
                let grazing = expected.is_infinite() != found.is_infinite();
                assert!(
                    !grazing && (found == expected || (found - expected).abs() < 1e-5),
                    "{step}: {found} {expected}"
                );
            }
        }
    }

    #[test]
    fn rays_along_the_axis_meet_the_end() {
        let t = capsule(Vec3::NEG_X, Vec3::X, Vec3::ZERO, Vec3::X, 0.1);
        assert!((t - 0.9).abs() < 1e-6);
        let back = capsule(Vec3::X * 3.0, Vec3::NEG_X, Vec3::ZERO, Vec3::X, 0.1);
        assert!((back - 1.9).abs() < 1e-6);
    }

    #[test]
    fn rays_from_inside_miss() {
        for direction in [Vec3::X, Vec3::Y, Vec3::new(0.6, 0.8, 0.0)] {
            let t = capsule(Vec3::X * 0.5, direction, Vec3::ZERO, Vec3::X, 0.1);
            assert!(t.is_infinite());
        }
    }

    #[test]
    fn a_thin_yarn_is_hit_exactly_from_metres_away() {
        for offset in [0.0_f32, 0.01, 0.025, 0.0299] {
            let t = capsule(Vec3::new(0.2, offset, 4000.0), Vec3::NEG_Z, Vec3::ZERO, Vec3::X, 0.03);
            let expected = 4000.0 - (0.03_f64.powi(2) - f64::from(offset).powi(2)).sqrt();
            assert!(
                (f64::from(t) - expected).abs() < 3e-4,
                "half a unit in the last place of 4000 is 1.2e-4: {t}"
            );
        }
        let beside = Vec3::new(0.2, 0.0301, 4000.0);
        assert!(capsule(beside, Vec3::NEG_Z, Vec3::ZERO, Vec3::X, 0.03).is_infinite());
    }

    #[test]
    fn own_segment_and_its_neighbours_are_left_out() {
        let points: Vec<Vec4> = (0_u8..9).map(|x| Vec4::new(f32::from(x), 0.0, 0.0, 1.0)).collect();
        let leaf = SegmentLeaf::new(&points, 100, |_| 1.0);
        for own in 90..120_u32 {
            for lane in 0..8_u32 {
                let other = leaf.others(own) >> lane & 1 == 1;
                assert_eq!(other, (100 + lane).abs_diff(own) > 1, "{own} {lane}");
            }
        }
    }

    /// A coordinate that is often the same in two points.
    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![Just(0.0_f32), Just(1.0), -2.0..2.0_f32]
    }

    fn point() -> impl Strategy<Value = Vec3> {
        [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from)
    }

    proptest! {
        #[test]
        fn both_sets_of_instructions_give_the_same_bits(
            points in prop::collection::vec(point(), 2..=9), origin in point(), aim in point(),
        ) {
            let points: Vec<Vec4> = points.iter().map(|point| point.extend(0.2)).collect();
            let leaf = SegmentLeaf::new(&points, 0, |start| 0.1 + start as f32 * 0.05);
            let direction = (aim - origin).normalize_or(Vec3::X);
            let [best, plain] = [Instructions::best(), Instructions::plain()]
                .map(|set| set.run(One(&leaf, origin, direction, None)).map(f32::to_bits));
            prop_assert_eq!(best, plain);
        }

        /// A flattened capsule is a round one in a space that is shrunk along its width.
        #[test]
        fn flattened_capsules_are_met_where_halving_in_f64_says(
            a in point(), b in point(), origin in point(), aim in point(), q in point(),
        ) {
            let direction = (aim - origin).normalize_or(Vec3::X);
            let q = q.clamp_length_max(0.9);
            let leaf = SegmentLeaf::new(&[a.extend(0.25), b.extend(0.0)], 0, |_| 0.25);
            let ray = One(&leaf, origin, direction, Some(q));
            let found = f64::from(Instructions::best().run(ray)[0]);
            let q = q.as_dvec3();
            let shrunk = |v: Vec3| v.as_dvec3() - q * q.dot(v.as_dvec3());
            let [o, d, p, e] = [origin, direction, a, b].map(shrunk);
            // Distances along the ray are in units of its direction.
            let by = |radius: f64| by_halving(o, d.normalize(), p, e, radius) / d.length();
            let (nearest, farthest) = (by(0.250_01), by(0.249_99));
            prop_assume!(nearest.is_finite() == farthest.is_finite());
            let expected = by(0.25);
            let slack = if expected.is_finite() { farthest - nearest + 1e-4 } else { 0.0 };
            prop_assert!(
                found == expected || (found - expected).abs() <= slack, "{} {}", found, expected
            );
        }

        /// Capsules of no length, rays along the axis, grazing ones and origins inside included.
        #[test]
        fn any_ray_agrees_with_halving_in_f64(a in point(), b in point(), origin in point(), aim in point()) {
            let direction = (aim - origin).normalize_or(Vec3::X);
            let found = f64::from(capsule(origin, direction, a, b, 0.25));
            let [o, d, p, q] = [origin, direction, a, b].map(|v| v.as_dvec3());
            // Where a slightly thicker or thinner capsule decides otherwise, rounding may, too.
            let nearest = by_halving(o, d, p, q, 0.250_01);
            let farthest = by_halving(o, d, p, q, 0.249_99);
            prop_assume!(nearest.is_finite() == farthest.is_finite());
            let expected = by_halving(o, d, p, q, 0.25);
            let slack = if expected.is_finite() { farthest - nearest + 1e-5 } else { 0.0 };
            prop_assert!(
                found == expected || (found - expected).abs() <= slack, "{} {}", found, expected
            );
        }
    }
}
