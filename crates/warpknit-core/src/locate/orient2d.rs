//! On which side of a line a point lies: exact, for any finite coordinates.
//!
//! The location test of the source paper compares signs of cross products. In floating point those
//! signs are wrong for points next to an edge, which opens cracks between triangles; a yarn that
//! meets one is cut. Shewchuk's adaptive predicate (`robust::orient2d`) gives the true sign; the
//! filter in front of it settles nearly all calls with one comparison.

use glam::DVec2;

/// The paper's `PA x PB`: twice the area of the triangle P, A, B, positive when it runs
/// counter-clockwise. The sign is exact; the value is good to rounding.
#[inline]
#[must_use]
pub fn cross(p: DVec2, a: DVec2, b: DVec2) -> f64 {
    /// Shewchuk's first bound, (3 + 16 eps) eps: beyond it the rounded difference has the right
    /// sign.
    const BOUND: f64 = 3.330_669_062_177_372e-16;
    let left = (a.x - p.x) * (b.y - p.y);
    let right = (a.y - p.y) * (b.x - p.x);
    let area = left - right;
    if area.abs() > BOUND * (left.abs() + right.abs()) {
        return area;
    }
    let coord = |v: DVec2| robust::Coord { x: v.x, y: v.y };
    robust::orient2d(coord(p), coord(a), coord(b))
}

/// The three products `PA x PB`, `PB x PC`, `PC x PA` of a point and a triangle.
///
/// P is inside when no two of them have opposite signs. The paper prints the second as `PA x PC`,
/// whose sign is the opposite of `PC x PA`: taken so, no interior point would ever pass.
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
