//! Ray-capsule intersection, eight capsules at a time. A capsule is a sphere swept along a straight
//! axis; yarns are chains of them.
//!
//! In: a ray and a [`Leaf`], up to eight consecutive capsules of one yarn in plain arrays. Out: the
//! distances at which the ray enters them. The test solves the quadratic of the infinite cylinder,
//! then the sphere at the nearer end if the cylinder is entered beyond an end (Ericson 2005,
//! 'Real-Time Collision Detection', section 5.3.7).
//!
//! Yarns are hundredths of a millimetre thick and the eye stands metres away. In `f32`, the
//! quadratic of such a ray would cancel all digits of the radius. So the ray's origin is first
//! moved beside the capsule. Rays that start inside a capsule do not meet it.

use glam::{Vec3, Vec4};

use super::lanes::{Eight, LANES, Lanes, Lanes3};
use warpknit_core::ids::index32;

/// Up to eight consecutive segments of one yarn.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(super) struct Leaf {
    /// Coordinates of the points. Each segment ends where the next one starts.
    points: [[f32; LANES + 1]; 3],
    radii: [f32; LANES],
    /// First point of the first segment.
    pub(super) first: u32,
    /// Bit i is set if there is an i-th segment.
    used: u32,
}

/// A ray, each of its numbers eight times.
#[derive(Clone, Copy)]
pub(super) struct LaneRay<S> {
    pub(super) simd: S,
    pub(super) origin: Lanes3<S>,
    pub(super) direction: Lanes3<S>,
}

impl<S: Eight> LaneRay<S> {
    #[inline(always)]
    pub(super) fn new(simd: S, origin: Vec3, direction: Vec3) -> Self {
        Self {
            simd,
            origin: Lanes3::all(simd, origin.to_array()),
            direction: Lanes3::all(simd, direction.to_array()),
        }
    }
}

impl Leaf {
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
        if place <= index32(LANES) { !((0b111 << place) >> 2) } else { u32::MAX }
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
    /// [`Self::distances`] needs to go on.
    #[inline(always)]
    pub(super) fn near<S: Eight>(&self, ray: &LaneRay<S>) -> (u32, Beside<S>) {
        let simd = ray.simd;
        let (a, b) = self.ends(simd);
        // Move the origin beside the capsule. With an origin at 4000 mm, |o|^2 - r^2 would have no
        // digit left for a radius of 0.03 mm (Haines et al. 2019, 'Precision Improvements for
        // Ray/Sphere Intersection').
        let middle = (a + b) * Lanes::all(simd, 0.5);
        let beside = (middle - ray.origin).dot(ray.direction);
        let from_a = (ray.origin - a) + ray.direction * beside;
        let ab = b - a;
        // Early out: most capsules in a leaf of the hierarchy are missed. The distance between the
        // ray's line and the axis' line is |missed| / |normal|. Comparing its square needs neither a
        // root nor a division. The factor 1.0001 covers rounding; below 1 + 1e-6 it would reject
        // grazing hits, and a larger one would only reject fewer misses early.
        let normal = ray.direction.cross(ab);
        let missed = from_a.dot(normal);
        let radius = Lanes::new(simd, self.radii);
        let radius2 = radius * radius;
        let most = radius2 * Lanes::all(simd, 1.000_1) * normal.dot(normal);
        let near = simd.bits((missed * missed).at_most(most));
        (near & self.used, Beside { beside, from_a, ab, radius2 })
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
    radius2: Lanes<S>,
}

impl<S: Eight> Beside<S> {
    /// Distances along the ray to its entry into the capsules; infinite where it misses.
    #[inline(always)]
    pub(super) fn distances(&self, ray: &LaneRay<S>) -> Lanes<S> {
        let (simd, direction) = (ray.simd, ray.direction);
        let &Self { beside, from_a, ab, radius2 } = self;
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
        let distance = beside + on_cylinder.where_set(on_side, on_end);
        let ahead = simd.and_m32s(meets, zero.at_most(distance));
        distance.where_set(ahead, infinity)
    }
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
