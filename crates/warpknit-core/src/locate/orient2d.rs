//! The orientation predicate: on which side of a line a point lies, exact for finite coordinates.
//!
//! In: three points of the plane. Out: twice the signed area of their triangle, with an exact sign.
//!
//! The location test of Liu, Kyosev and Jiang 2022, "Yarn-level modelling and geometric simulation
//! of warp-knitted clothing elements" (section 3.1, equation 1) compares signs of cross products.
//! In floating point those signs are wrong for some points next to an edge. That opens cracks
//! between triangles, and a yarn that meets a crack is cut. The exact sign comes from the adaptive
//! predicate of Shewchuk 1997, "Adaptive precision floating-point arithmetic and fast robust
//! geometric predicates" (`robust::orient2d`). The filter in front of it decides nearly all calls
//! with one comparison.
//!
//! Cost: four multiplications, and many times that where the filter fails. Not promised: an exact
//! value (only its sign is exact), nor a right sign where products overflow or underflow.

use glam::DVec2;

/// The paper's `PA x PB`: twice the area of the triangle P, A, B, positive when it runs
/// counter-clockwise. The sign is exact, the value within rounding.
#[inline]
#[must_use]
pub fn cross(p: DVec2, a: DVec2, b: DVec2) -> f64 {
    /// Shewchuk's first bound, (3 + 16 eps) eps with eps = 2^-53: beyond it the rounded difference
    /// has the right sign. Any smaller bound would let wrong signs pass; a larger one sends more
    /// calls to the slow predicate.
    const FILTER_BOUND: f64 = 3.330_669_062_177_372e-16;
    let left = (a.x - p.x) * (b.y - p.y);
    let right = (a.y - p.y) * (b.x - p.x);
    let area = left - right;
    // Each product carries the rounding of two differences and of itself, the result that of one
    // more difference. Where the result is larger than all of it, its sign is certain.
    if area.abs() > FILTER_BOUND * (left.abs() + right.abs()) {
        return area;
    }
    robust::orient2d(coord(p), coord(a), coord(b))
}

#[inline]
fn coord(v: DVec2) -> robust::Coord<f64> {
    robust::Coord { x: v.x, y: v.y }
}

/// The three products `PA x PB`, `PB x PC`, `PC x PA` of a point and a triangle.
///
/// P is inside when no two of them have opposite signs. The paper prints a product `PA x PC`, whose
/// sign is the opposite of `PC x PA`. With that sign no interior point would ever pass.
///
/// ```
/// use glam::DVec2;
/// use warpknit_core::locate::orient2d::crosses;
/// let [a, b, c] = [DVec2::ZERO, DVec2::X, DVec2::Y];
/// assert!(crosses(DVec2::splat(0.25), a, b, c).iter().all(|&t| t > 0.0));
/// assert!(crosses(DVec2::splat(0.75), a, b, c).iter().any(|&t| t < 0.0));
/// ```
#[inline]
#[must_use]
pub fn crosses(p: DVec2, a: DVec2, b: DVec2, c: DVec2) -> [f64; 3] {
    [cross(p, a, b), cross(p, b, c), cross(p, c, a)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_as_printed_finds_no_interior_point() {
        let [a, b, c] = [DVec2::new(0.0, 0.0), DVec2::new(4.0, 0.0), DVec2::new(1.0, 3.0)];
        for p in [DVec2::new(1.0, 1.0), DVec2::new(2.0, 0.5), DVec2::new(1.1, 2.0)] {
            let printed = [cross(p, a, b), cross(p, a, c), cross(p, b, c)];
            assert!(printed.iter().any(|&t| t > 0.0) && printed.iter().any(|&t| t < 0.0));
            assert!(crosses(p, a, b, c).iter().all(|&t| t > 0.0));
        }
    }

    #[test]
    fn signs_hold_where_floating_point_rounds_away() {
        // Three points on a line but for one unit in the last place.
        let (a, b) = (DVec2::new(12.0, 12.0), DVec2::new(24.0, 24.0));
        for step in 1..64 {
            let up = 0.5 + f64::from(step) * 2f64.powi(-53);
            assert!(cross(DVec2::new(0.5, up), a, b) > 0.0);
            assert!(cross(DVec2::new(up, 0.5), a, b) < 0.0);
            assert!(cross(DVec2::new(up, up), a, b) == 0.0);
        }
    }
}
