//! Cloth that lies under other cloth of its own panel: its place in the pattern belongs to two
//! triangles, and one of them gets no stitches.
//!
//! In: a [`Garment`]. Out: the share of each triangle that is covered, and the loss in the garment's
//! summary. Method and cost are those of [`overlap`](super::overlap), for one panel at a time.

use std::path::Path;

use super::orient2d::cross;
use super::overlap::{AREA_TOLERANCE, FlatTriangle, MAX_PAIRS, PlaneLayout, embedded};
use crate::garment::{Garment, GarmentError, Panel};

/// Counts the cloth that lies under other cloth of its own panel as lost
/// ([`crate::garment::Loss::covered`]), and warns of it. Of two triangles the one that comes first
/// in the file takes the stitches. `flat` is the file to name in an error. A place under two others
/// counts twice, but no triangle loses more than it has. After four million pairs of triangles the
/// search ends, and the area is a lower bound.
///
/// Cost: 60 ns a triangle, and more where there are such.
///
/// # Errors
/// [`GarmentError::Loss`], if the garment loses over [`crate::garment::MOST_LOSS`] with it and that
/// isn't `allowed`.
///
/// ```
/// # use std::path::Path;
/// use warpknit_core::{garment::Garment, locate::covered::count_covered};
/// let mut garment = Garment::rectangle(10.0, 10.0);
/// count_covered(&mut garment, Path::new("flat.obj"), false).unwrap();
/// assert_eq!(garment.summary.loss.covered, 0.0);
/// ```
pub fn count_covered(
    garment: &mut Garment,
    flat: &Path,
    allowed: bool,
) -> Result<(), GarmentError> {
    let (mut covered, mut first) = (0.0, None);
    for (number, (panel, shares)) in garment.panels.iter().zip(covered_shares(garment)).enumerate()
    {
        let own: f64 = (panel.triangles.iter().zip(&shares))
            .map(|(triangle, share)| share * draped_area(panel, triangle))
            .sum();
        if own > AREA_TOLERANCE * panel.area() {
            covered += own;
            first = first.or(Some(number));
        }
    }
    match first {
        Some(panel) => garment.summary.note_covered(covered, panel, flat, allowed),
        None => Ok(()),
    }
}

/// The share of each triangle, 0 to 1, that lies under other cloth of its own panel: of two
/// triangles, the one that comes later in the file lies under the other. Nothing is listed for a
/// panel that surely doesn't lie over itself. [`count_covered`] tells the limits.
///
/// ```
/// use warpknit_core::{garment::Garment, locate::covered::covered_shares};
/// assert_eq!(covered_shares(&Garment::rectangle(10.0, 10.0)), [[0.0; 0]]);
/// ```
#[must_use]
pub fn covered_shares(garment: &Garment) -> Vec<Vec<f64>> {
    let embedded = embedded(&garment.panels);
    let mut left = Some(MAX_PAIRS);
    let mut all = vec![Vec::new(); garment.panels.len()];
    for (number, panel) in garment.panels.iter().enumerate().filter(|(i, _)| !embedded[*i]) {
        let layout = PlaneLayout::of(panel, number);
        let mut shares: Vec<f64> = vec![0.0; panel.triangles.len()];
        let mut add = |[one, other]: [&FlatTriangle; 2], area| {
            let faces = [one, other].map(|flat| panel.faces[flat.index as usize]);
            let under = if faces[0] < faces[1] { other } else { one };
            let [a, b, c] = under.corners;
            shares[under.index as usize] += 2.0 * area / cross(a, b, c);
        };
        left = left.and_then(|left| layout.measure(&embedded, left, &mut add));
        shares.iter_mut().for_each(|share| *share = share.min(1.0));
        all[number] = shares;
    }
    all
}

/// Draped area of a panel's triangle, mm².
fn draped_area(panel: &Panel, triangle: &[u32; 3]) -> f64 {
    let [a, b, c] = triangle.map(|vertex| panel.draped[vertex as usize]);
    0.5 * (b - a).cross(c - a).length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec2, DVec3};

    #[test]
    fn cloth_under_its_own_panel_is_lost() {
        // A square of side 2, and one of which a quarter lies under it, twice as wide on the body.
        let square = |low: f64| {
            let high = low + 2.0;
            [(low, low), (low, high), (high, low), (high, high)].map(DVec2::from)
        };
        let uv = [square(0.0), square(1.0)].concat();
        let draped: Vec<_> = (uv[..4].iter().map(|p| p.extend(0.0)))
            .chain(uv[4..].iter().map(|p| DVec3::new(2.0 * p.x, p.y, 9.0)))
            .collect();
        let squares = [[0, 2, 3], [0, 3, 1], [4, 6, 7], [4, 7, 5]];
        let made = || {
            let mut garment = Garment::from_arrays(&uv, &draped, &squares).unwrap();
            // One panel, as a strip of a pattern would make it that comes back to itself.
            let second = garment.panels.remove(1);
            let first = &mut garment.panels[0];
            let place = |panel: &Panel, uv: &DVec2| {
                panel.flat_from_panel.transform_point3(uv.extend(0.0)).truncate()
            };
            let moved = first.flat_from_panel.translation.truncate();
            first.uv.extend(second.uv.iter().map(|uv| place(&second, uv) - moved));
            first.draped.extend(&second.draped);
            first.normals.extend(&second.normals);
            first.triangles.extend(second.triangles.iter().map(|t| t.map(|vertex| vertex + 4)));
            first.faces.extend(&second.faces);
            garment
        };
        let mut garment = made();
        let refused = count_covered(&mut garment, Path::new("flat.obj"), false).unwrap_err();
        let refused = refused.to_string();
        assert!(refused.contains("16.667 % of the draped area"), "{refused}");
        assert!(refused.contains("under other cloth of their panel"), "{refused}");
        let mut garment = made();
        count_covered(&mut garment, Path::new("flat.obj"), true).unwrap();
        assert!((garment.summary.loss.covered - 2.0).abs() < 1e-9, "{:?}", garment.summary.loss);
        assert!(garment.summary.warnings[0].contains("(first panel 0)"));
    }
}
