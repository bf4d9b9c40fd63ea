//! Stretch of a garment, triangle by triangle: along the wales, along the courses, and the largest
//! and smallest stretch in any direction.
//!
//! In: panels. Out: a [`TriangleStretch`] for each triangle, or [`Percentiles`] by flat area.
//!
//! Method: the map from a flat triangle to the draped one is linear. The singular values of its 3 x
//! 2 matrix are the principal stretches: the largest and the smallest ratio of draped to flat
//! length over all directions. Their directions are at right angles in the flat triangle. Both are
//! 1 where draping kept all lengths (an isometry), and their product is the ratio of the areas.
//!
//! Cost: linear in the triangles, plus a sort for each set of percentiles.

use glam::{DMat2, DVec2, DVec3};

use super::Panel;

/// The 5th, 50th and 95th percentile by flat area; 1 is unstretched.
pub type Percentiles = [f64; 3];

/// The shares of the flat area at which [`Percentiles`] are taken.
const SHARES: [f64; 3] = [0.05, 0.5, 0.95];

/// Ratios of draped to flat length of one triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleStretch {
    /// Flat area, mm².
    pub area: f64,
    /// Along v, the wales.
    pub warp: f64,
    /// Along u, the courses.
    pub weft: f64,
    /// The larger principal stretch.
    pub largest: f64,
    /// The smaller principal stretch, at right angles to the larger one.
    pub smallest: f64,
}

/// Percentiles that tell how close draping is to an isometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Isometry {
    /// Smaller principal stretch.
    pub smallest: Percentiles,
    /// Larger principal stretch.
    pub largest: Percentiles,
    /// Ratio of draped to flat area.
    pub area: Percentiles,
}

/// Stretch of the usable triangles of some panels: (warp, along v; weft, along u).
///
/// ```
/// use warpknit_core::garment::{Garment, stretch::stretch};
/// assert_eq!(stretch(&Garment::rectangle(10.0, 10.0).panels), ([1.0; 3], [1.0; 3]));
/// ```
#[must_use]
pub fn stretch(panels: &[Panel]) -> (Percentiles, Percentiles) {
    let all = triangles(panels);
    (percentiles(&all, |one| one.warp, SHARES), percentiles(&all, |one| one.weft, SHARES))
}

/// Principal stretches and area ratios of the usable triangles of some panels.
///
/// ```
/// use warpknit_core::garment::{Garment, stretch::isometry};
/// assert_eq!(isometry(&Garment::rectangle(10.0, 10.0).panels).largest, [1.0; 3]);
/// ```
#[must_use]
pub fn isometry(panels: &[Panel]) -> Isometry {
    let all = triangles(panels);
    Isometry {
        smallest: percentiles(&all, |one| one.smallest, SHARES),
        largest: percentiles(&all, |one| one.largest, SHARES),
        area: percentiles(&all, |one| one.smallest * one.largest, SHARES),
    }
}

/// All usable triangles, panel after panel.
#[must_use]
pub fn triangles(panels: &[Panel]) -> Vec<TriangleStretch> {
    panels
        .iter()
        .flat_map(|panel| panel.triangles.iter().map(|corners| triangle(panel, *corners)))
        .collect()
}

/// The stretch of one triangle of [`Panel::triangles`].
#[must_use]
pub fn triangle(panel: &Panel, corners: [u32; 3]) -> TriangleStretch {
    let [a, b, c] = corners.map(|v| panel.uv[v as usize]);
    let [p, q, r] = corners.map(|v| panel.draped[v as usize]);
    let flat = DMat2::from_cols(b - a, c - a);
    let inverse = flat.inverse();
    // The columns of the linear map: a flat unit vector is written in the basis of the flat
    // triangle's edges, and the same combination of the draped edges is its image.
    let [along_u, along_v] = [DVec2::X, DVec2::Y].map(|direction| {
        let coordinates = inverse * direction;
        (q - p) * coordinates.x + (r - p) * coordinates.y
    });
    let (largest, smallest) = singular_values(along_u, along_v);
    TriangleStretch {
        area: flat.determinant() / 2.0,
        warp: along_v.length(),
        weft: along_u.length(),
        largest,
        smallest,
    }
}

/// Singular values of the matrix with columns `a` and `b`, the larger first: square roots of the
/// eigenvalues of its 2 x 2 Gram matrix, in closed form.
fn singular_values(a: DVec3, b: DVec3) -> (f64, f64) {
    let (aa, bb, ab) = (a.length_squared(), b.length_squared(), a.dot(b));
    let largest = (0.5 * (aa + bb) + (0.5 * (aa - bb)).hypot(ab)).sqrt();
    // The product of both is the area of the parallelogram. The closed form with a minus sign would
    // cancel the digits of a small value, and a collapsed triangle would get a negative square.
    let smallest = if largest > 0.0 { a.cross(b).length() / largest } else { 0.0 };
    (largest, smallest)
}

/// Percentiles weighted by flat area. All are 1 where there is no triangle.
#[must_use]
pub fn percentiles<const N: usize>(
    triangles: &[TriangleStretch],
    value: impl Fn(&TriangleStretch) -> f64,
    shares: [f64; N],
) -> [f64; N] {
    let mut values: Vec<_> = triangles.iter().map(|one| (value(one), one.area)).collect();
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = values.iter().map(|(_, area)| area).sum();
    shares.map(|share| {
        let mut below = 0.0;
        let at = values.iter().find(|(_, area)| {
            below += area;
            below >= share * total
        });
        at.or(values.last()).map_or(1.0, |(value, _)| *value)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::garment::Garment;

    /// A rectangle whose draped positions are moved.
    fn draped(place: impl Fn(DVec3) -> DVec3) -> Garment {
        let mut garment = Garment::rectangle(4.0, 3.0);
        garment.panels[0].draped.iter_mut().for_each(|p| *p = place(*p));
        garment
    }

    #[test]
    fn a_stretched_square() {
        let garment = draped(|p| p * DVec3::new(1.25, 0.5, 1.0));
        assert_eq!(stretch(&garment.panels), ([0.5; 3], [1.25; 3]));
        let expected = Isometry { smallest: [0.5; 3], largest: [1.25; 3], area: [0.625; 3] };
        assert_eq!(isometry(&garment.panels), expected);
    }

    #[test]
    fn a_sheared_square_keeps_its_area_and_no_length() {
        // Simple shear by s: the principal stretches are (sqrt(s² + 4) ± s) / 2.
        let garment = draped(|p| DVec3::new(p.x + 1.5 * p.y, p.y, 7.0));
        let Isometry { smallest, largest, area } = isometry(&garment.panels);
        for share in 0..3 {
            assert!(
                (largest[share] - 2.0).abs() < 1e-12 && (smallest[share] - 0.5).abs() < 1e-12,
                "{largest:?} {smallest:?}"
            );
            assert!((area[share] - 1.0).abs() < 1e-12);
        }
        let (warp, weft) = stretch(&garment.panels);
        assert!((warp[1] - 1.5_f64.hypot(1.0)).abs() < 1e-12 && (weft[1] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_turned_and_a_collapsed_square() {
        let turned = draped(|p| DVec3::new(p.y, 0.0, -p.x));
        assert_eq!(
            isometry(&turned.panels),
            Isometry { smallest: [1.0; 3], largest: [1.0; 3], area: [1.0; 3] }
        );
        let collapsed = isometry(&draped(|_| DVec3::ONE).panels);
        assert_eq!((collapsed.largest, collapsed.smallest), ([0.0; 3], [0.0; 3]));
    }

    #[test]
    fn percentiles_go_by_area() {
        let one =
            |area, warp| TriangleStretch { area, warp, weft: 1.0, largest: 1.0, smallest: 1.0 };
        let all = [one(90.0, 1.0), one(6.0, 3.0), one(4.0, 2.0)];
        assert_eq!(
            percentiles(&all, |one| one.warp, [0.05, 0.5, 0.91, 0.95]),
            [1.0, 1.0, 2.0, 3.0]
        );
    }
}
