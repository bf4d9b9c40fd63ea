//! A triangle as location wants it: one line of cache that says how far a point lies from its
//! edges, and which triangle comes next.
//!
//! The paper's three products are linear in the point, and two of them over the triangle's area are
//! its barycentric coordinates. So they are taken from gradients that are worked out once a
//! triangle: four multiplications a point give the test and the coordinates at once, where the
//! three exact signs take twelve and as many differences. Rounding is bounded once a triangle too
//! ([`Cell::margin`]); a point nearer to an edge than that, some 1e-9 mm, is decided by exact
//! signs.

use glam::{DVec2, DVec3};

use super::SurfacePoint;

/// Points that are held against one triangle at a time. Measured on 8 million points: 8.9 ns a
/// point one by one, 6.7 by twos, 6.3 by fours, 6.6 by eights; wider registers (AVX2) gain nothing,
/// the points' way through memory does not let them.
const LANES: usize = 4;
/// Rounding of both coordinates and of their rest, over what is multiplied in them: fewer than six
/// roundings of 2^-53 each, and room for points as far off the panel as it is wide.
const ROUNDING: f64 = 16.0 * f64::EPSILON;
/// A triangle so thin that rounding may take more of it than this is always left to exact signs.
const MOST_MARGIN: f64 = 1e-3;

/// One triangle.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Cell {
    /// Its first corner, mm.
    corner: DVec2,
    /// Gradients of the weights of the second and the third corner, 1 over mm.
    b: DVec2,
    c: DVec2,
    /// Weights over this are surely positive, under its opposite surely negative. Holds for any
    /// point, however far off: what rounding does grows no faster with the distance than the
    /// weights do.
    margin: f32,
    /// Triangle across edge i (corner i to corner i + 1), or [`super::topology::BORDER`].
    pub(super) neighbours: [u32; 3],
}

/// Where a point lies: small enough to stay in a register, which on the way from triangle to
/// triangle counts.
#[derive(Clone, Copy)]
pub(super) enum Side {
    /// Within the triangle, its edges left out.
    Inside,
    /// On the far side of this edge.
    Beyond(usize),
    /// On an edge, or so near that only exact signs tell.
    Near,
}

impl Cell {
    /// The cell of a triangle on a panel of this size, mm.
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
        let margin = if margin < MOST_MARGIN { margin as f32 } else { f32::INFINITY };
        // An area too small for a float gives no gradients: all of such a triangle is its first
        // corner.
        let known = |gradient: DVec2| if gradient.is_finite() { gradient } else { DVec2::ZERO };
        Self { corner, b: known(b), c: known(c), margin, neighbours }
    }

    /// The weights of the second and the third corner at `p`.
    #[inline]
    fn weights(&self, p: DVec2) -> (f64, f64) {
        let d = p - self.corner;
        (self.b.x * d.x + self.b.y * d.y, self.c.x * d.x + self.c.y * d.y)
    }

    /// Whether it is thick enough for its gradients to tell anything.
    pub(super) fn is_sure(&self) -> bool {
        self.margin.is_finite()
    }

    /// `p` as a point of this triangle, whose index is given.
    #[inline]
    pub(super) fn point(&self, triangle: u32, p: DVec2) -> SurfacePoint {
        let (b, c) = self.weights(p);
        SurfacePoint { triangle, b, c }
    }

    /// Where `p` lies.
    #[inline]
    pub(super) fn side(&self, p: DVec2) -> Side {
        let (b, c) = self.weights(p);
        let a = 1.0 - b - c;
        // Each corner's weight is nothing on the edge that it faces.
        let (least, edge) = [(b, 2), (c, 0)]
            .into_iter()
            .fold((a, 1), |least, other| if other.0 < least.0 { other } else { least });
        let margin = f64::from(self.margin);
        if least > margin {
            Side::Inside
        } else if least < -margin {
            Side::Beyond(edge)
        } else {
            Side::Near
        }
    }

    /// Where `to` lies, seen by a way to it that comes through this triangle: beyond the only edge
    /// that it can leave through, if there is only one. For points no farther off the panel than it
    /// is wide; yarns' are.
    #[inline]
    pub(super) fn side_of_way(&self, to: DVec2) -> Side {
        let (b, c) = self.weights(to);
        let margin = f64::from(self.margin);
        let weights = [c, 1.0 - b - c, b];
        let sides = weights.map(|weight| (weight > margin, weight < -margin));
        match sides {
            [(true, _), (true, _), (true, _)] => Side::Inside,
            [(_, true), (true, _), (true, _)] => Side::Beyond(0),
            [(true, _), (_, true), (true, _)] => Side::Beyond(1),
            [(true, _), (true, _), (_, true)] => Side::Beyond(2),
            _ => Side::Near,
        }
    }

    /// How many of the first points lie within the triangle, its edges left out. They are written
    /// to `located`; what is there behind them is of no meaning. Up to three points at the end of
    /// `points` are not looked at.
    #[inline]
    pub(super) fn run(
        &self,
        triangle: u32,
        points: &[DVec3],
        located: &mut [Option<SurfacePoint>],
    ) -> usize {
        let margin = f64::from(self.margin);
        let mut count = 0;
        for (points, located) in
            points.as_chunks::<LANES>().0.iter().zip(located.as_chunks_mut::<LANES>().0)
        {
            let mut outside = 0_u32;
            for (lane, (point, located)) in points.iter().zip(located).enumerate() {
                let (b, c) = self.weights(point.truncate());
                let inside = (b > margin) & (c > margin) & (1.0 - b - c > margin);
                outside |= u32::from(!inside) << lane;
                *located = Some(SurfacePoint { triangle, b, c });
            }
            if outside != 0 {
                return count + outside.trailing_zeros() as usize;
            }
            count += LANES;
        }
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::locate::orient2d::crosses;

    /// Whatever a cell is sure of, exact signs say too; near an edge it is not sure.
    #[test]
    fn a_cell_is_never_wrong() {
        let size = DVec2::new(600.0, 800.0);
        let corners =
            [DVec2::new(-211.3, 17.9), DVec2::new(-204.7, 20.1), DVec2::new(-209.9, 26.3)];
        let cell = Cell::new(corners, [u32::MAX; 3], size);
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
            match cell.side(p) {
                Side::Inside => assert!(ab > 0.0 && bc > 0.0 && ca > 0.0),
                Side::Beyond(edge) => assert!([ab, bc, ca][edge] < 0.0),
                Side::Near => assert!(ab.abs().min(bc.abs()).min(ca.abs()) < 1e-8),
            }
            counts[match cell.side(p) {
                Side::Inside => 0,
                Side::Beyond(_) => 1,
                Side::Near => 2,
            }] += 1;
        }
        assert!(counts.iter().all(|&count| count > 300), "all sides are met: {counts:?}");
    }
}
