//! A triangle prepared for location: the gradients of its barycentric coordinates in one cache
//! line.
//!
//! In: a triangle's corners and neighbours. Out: a [`BarycentricTriangle`]. It tells whether a
//! point lies inside or beyond an edge, gives the point's barycentric coordinates, and knows the
//! triangle across each edge.
//!
//! Method: the three cross products of the location test (Liu, Kyosev and Jiang 2022, section 3.1,
//! equation 1) are linear in the point. Two of them, divided by their sum, are barycentric
//! coordinates. Their gradients are computed once a triangle. Four multiplications a point then
//! give the test and the coordinates together, where three exact orientation predicates take
//! twelve. This is a floating-point filter in the sense of Shewchuk 1997: a bound on rounding is
//! computed once a triangle as well ([`BarycentricTriangle::margin`]). A point nearer to an edge
//! than that, some 1e-9 mm, is left to the exact predicates.
//!
//! Cost: about 2 ns a point, and 30 ns where the next one lies in another triangle. Not promised: an
//! answer for points next to an edge ([`Containment::Uncertain`]).

use glam::{DVec2, DVec3};

use super::SurfacePoint;

/// Points that are tested against one triangle at a time. Measured on 8 million points with all of
/// location: 8.9 ns a point one by one, 6.7 by twos, 6.3 by fours, 6.6 by eights. Wider registers (AVX2) gain nothing,
/// since the ways through memory, of points and from triangle to triangle, limit the speed.
pub(super) const LANES: usize = 4;
/// Bound of the rounding of a coordinate, over the magnitude of its terms. A coordinate has fewer
/// than six roundings of 2^-53 each. The rest is room for points as far off the panel as it is
/// wide. A smaller bound could take a wrong side; a larger one sends more points to the exact
/// predicates.
const ROUNDING: f64 = 16.0 * f64::EPSILON;
/// Largest margin. Triangles so thin that their margin is larger are always left to the exact
/// predicates: a margin near 1/3 would leave no inside at all.
const MAX_MARGIN: f64 = 1e-3;

/// One triangle, as large as a cache line: a walk loads one line a step.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct BarycentricTriangle {
    /// Its first corner, mm.
    corner: DVec2,
    /// Gradient of the second corner's barycentric coordinate, 1/mm.
    b: DVec2,
    /// Gradient of the third corner's barycentric coordinate, 1/mm.
    c: DVec2,
    /// A coordinate over this is surely positive, one under its opposite surely negative. This
    /// holds for any point, however far off: its rounding error grows no faster with the distance
    /// than the coordinate does.
    margin: f32,
    /// Triangle across edge i (corner i to corner i + 1), or [`super::topology::BORDER`].
    pub(super) neighbours: [u32; 3],
}

/// Whether a triangle contains a point. Small enough to stay in a register, which counts in a walk
/// from triangle to triangle.
#[derive(Clone, Copy)]
pub(super) enum Containment {
    /// Within the triangle, its edges left out.
    Inside,
    /// On the far side of this edge.
    Beyond(usize),
    /// On an edge, or so near that only the exact predicates decide.
    Uncertain,
}

/// The side of a triangle on which a point lies that isn't inside.
#[derive(Clone, Copy)]
pub(super) struct Side {
    /// The edge beyond which it lies farthest.
    pub(super) edge: usize,
    /// Whether it surely lies beyond it. If not, only the exact predicates decide.
    pub(super) is_certain: bool,
}

impl BarycentricTriangle {
    /// Prepares a triangle of a panel of this size, mm.
    #[inline]
    pub(super) fn new(
        [corner, second, third]: [DVec2; 3],
        neighbours: [u32; 3],
        size: DVec2,
    ) -> Self {
        let (ab, ac) = (second - corner, third - corner);
        let area = ab.perp_dot(ac);
        let (b, c) = (DVec2::new(ac.y, -ac.x) / area, DVec2::new(-ab.y, ab.x) / area);
        let margin = ROUNDING * (b.abs() + c.abs()).dot(size);
        #[expect(
            clippy::cast_possible_truncation,
            reason = "a bound may be rough; what it rounds away is far below its room"
        )]
        let margin = if margin < MAX_MARGIN { margin as f32 } else { f32::INFINITY };
        Self { corner, b: finite_or_zero(b), c: finite_or_zero(c), margin, neighbours }
    }

    /// The barycentric coordinates of the second and the third corner at `p`.
    #[inline]
    fn weights(&self, p: DVec2) -> (f64, f64) {
        let d = p - self.corner;
        (self.b.x * d.x + self.b.y * d.y, self.c.x * d.x + self.c.y * d.y)
    }

    /// Whether it is thick enough for its gradients to be of use.
    pub(super) fn is_sure(&self) -> bool {
        self.margin.is_finite()
    }

    /// `p` as a point of this triangle, whose index is given.
    #[inline]
    pub(super) fn point(&self, triangle: u32, p: DVec2) -> SurfacePoint {
        let (b, c) = self.weights(p);
        SurfacePoint { triangle, b, c }
    }

    /// Whether the triangle contains `p`, or beyond which edge it lies farthest.
    #[inline]
    pub(super) fn containment(&self, p: DVec2) -> Containment {
        let (b, c) = self.weights(p);
        let margin = f64::from(self.margin);
        match self.side_of(b, c) {
            Side { edge, is_certain: true } => Containment::Beyond(edge),
            _ if b > margin && c > margin && 1.0 - b - c > margin => Containment::Inside,
            _ => Containment::Uncertain,
        }
    }

    /// On which side of it a point with these coordinates of the second and the third corner lies,
    /// if it isn't inside.
    #[inline(always)]
    pub(super) fn side_of(&self, b: f64, c: f64) -> Side {
        let a = 1.0 - b - c;
        // Each corner's coordinate is zero on the opposite edge. The most negative one names the
        // edge to leave through: the point lies farthest beyond it, which keeps walks short.
        let (is_b, less) = (b < a, if b < a { b } else { a });
        let (is_c, least) = (c < less, if c < less { c } else { less });
        // The edge opposite to the first corner is 1, to the second 2, to the third 0.
        let edge = (1 + usize::from(is_b)) * usize::from(!is_c);
        Side { edge, is_certain: least < -f64::from(self.margin) }
    }

    /// Where a straight path to `to` leaves this triangle: beyond an edge only if it is the only
    /// one through which the path can leave. For points no farther off the panel than it is wide,
    /// as all points of yarns are.
    #[inline]
    pub(super) fn exit_towards(&self, to: DVec2) -> Containment {
        let (b, c) = self.weights(to);
        let margin = f64::from(self.margin);
        let weights = [c, 1.0 - b - c, b];
        let sides = weights.map(|weight| (weight > margin, weight < -margin));
        // Beyond two edges at once the exit depends on where the path came from. That is left to
        // the exact predicates, like a point near an edge.
        match sides {
            [(true, _), (true, _), (true, _)] => Containment::Inside,
            [(_, true), (true, _), (true, _)] => Containment::Beyond(0),
            [(true, _), (_, true), (true, _)] => Containment::Beyond(1),
            [(true, _), (true, _), (_, true)] => Containment::Beyond(2),
            _ => Containment::Uncertain,
        }
    }

    /// Counts those of four points, from the first on, that lie within the triangle, its edges left
    /// out, and writes them to `located`. The value behind them has the coordinates of the first
    /// point that isn't inside; later ones have no meaning.
    #[inline(always)]
    pub(super) fn locate_four(
        &self,
        triangle: u32,
        points: &[DVec3; LANES],
        located: &mut [Option<SurfacePoint>; LANES],
    ) -> usize {
        // The lowest set bit is the first point that is not inside. No processor foretells where a
        // short run ends, so there is no branch.
        (self.outside(triangle, points, located) | 1 << LANES).trailing_zeros() as usize
    }

    /// The same for any number of points, of which many are expected to lie within. Also tells on
    /// which side the next one lies. Up to three points at the end are not tested: there is no side
    /// then.
    #[inline]
    pub(super) fn locate_run(
        &self,
        triangle: u32,
        points: &[DVec3],
        located: &mut [Option<SurfacePoint>],
    ) -> (usize, Option<Side>) {
        let mut count = 0;
        for (points, located) in points.as_chunks().0.iter().zip(located.as_chunks_mut().0) {
            let outside = self.outside(triangle, points, located);
            if outside != 0 {
                let run = outside.trailing_zeros() as usize;
                let side = located[run].map(|SurfacePoint { b, c, .. }| self.side_of(b, c));
                return (count + run, side);
            }
            count += LANES;
        }
        (count, None)
    }

    /// Writes four points to `located` as points of the triangle. Bit i is set if the i-th doesn't
    /// surely lie within.
    #[inline(always)]
    fn outside(
        &self,
        triangle: u32,
        points: &[DVec3; LANES],
        located: &mut [Option<SurfacePoint>; LANES],
    ) -> u32 {
        let margin = f64::from(self.margin);
        // All four are computed and written: a test and exit a point can't be vectorised.
        let mut outside = 0;
        for (lane, (point, located)) in points.iter().zip(located).enumerate() {
            let (b, c) = self.weights(point.truncate());
            let inside = (b > margin) & (c > margin) & (1.0 - b - c > margin);
            outside |= u32::from(!inside) << lane;
            *located = Some(SurfacePoint { triangle, b, c });
        }
        outside
    }
}

/// A gradient, or zero where the triangle's area is too small for a float. All of such a triangle
/// is its first corner.
fn finite_or_zero(gradient: DVec2) -> DVec2 {
    if gradient.is_finite() { gradient } else { DVec2::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::locate::orient2d::crosses;

    /// Wherever the filter is certain, the exact predicates agree. It is uncertain near an edge
    /// only.
    #[test]
    fn the_filter_is_never_wrong() {
        let size = DVec2::new(600.0, 800.0);
        let corners =
            [DVec2::new(-211.3, 17.9), DVec2::new(-204.7, 20.1), DVec2::new(-209.9, 26.3)];
        let triangle = BarycentricTriangle::new(corners, [u32::MAX; 3], size);
        let mut counts = [0; 3];
        for step in 0..30_000_u32 {
            let share = |k: u32| {
                f64::from(step.wrapping_mul(2_654_435_761).rotate_left(k) >> 8) / f64::from(1 << 24)
            };
            // A third anywhere around, a third on the line through an edge, a third within some
            // roundings of it.
            let along = corners[0].lerp(corners[1], 2.0 * share(0) - 0.5);
            let p = match step % 3 {
                0 => corners[0] + DVec2::new(share(0) - 0.5, share(9) - 0.5) * 20.0,
                1 => along,
                _ => along + DVec2::new(0.0, (share(9) - 0.5) * 1e-12),
            };
            let [ab, bc, ca] = crosses(p, corners[0], corners[1], corners[2]);
            match triangle.containment(p) {
                Containment::Inside => assert!(ab > 0.0 && bc > 0.0 && ca > 0.0),
                Containment::Beyond(edge) => assert!([ab, bc, ca][edge] < 0.0),
                Containment::Uncertain => assert!(ab.abs().min(bc.abs()).min(ca.abs()) < 1e-8),
            }
            counts[match triangle.containment(p) {
                Containment::Inside => 0,
                Containment::Beyond(_) => 1,
                Containment::Uncertain => 2,
            }] += 1;
        }
        assert!(counts.iter().all(|&count| count > 300), "all sides are met: {counts:?}");
    }
}
