//! How far a garment is stretched along its wales and courses, triangle by triangle.

use glam::{DMat2, DVec2};

use super::{Garment, Panel};

/// The 5th, 50th and 95th percentile by flat area; 1 is unstretched.
pub type Percentiles = [f64; 3];

/// Stretch of a garment's usable triangles: (warp, along v; weft, along u).
///
/// ```
/// use warpknit::garment::{Garment, stretch::stretch};
/// assert_eq!(stretch(&Garment::rectangle(10.0, 10.0)), ([1.0; 3], [1.0; 3]));
/// ```
#[must_use]
pub fn stretch(garment: &Garment) -> (Percentiles, Percentiles) {
    let (mut warp, mut weft) = (Vec::new(), Vec::new());
    for panel in &garment.panels {
        for corners in &panel.triangles {
            let (area, along_u, along_v) = triangle_stretch(panel, *corners);
            weft.push((along_u, area));
            warp.push((along_v, area));
        }
    }
    (percentiles(warp), percentiles(weft))
}

/// Flat area, and lengths of the draped unit vectors along u and v.
fn triangle_stretch(panel: &Panel, corners: [u32; 3]) -> (f64, f64, f64) {
    let [a, b, c] = corners.map(|v| panel.uv[v as usize]);
    let [p, q, r] = corners.map(|v| panel.draped[v as usize]);
    let flat = DMat2::from_cols(b - a, c - a);
    let inverse = flat.inverse();
    let draped = |direction: DVec2| {
        let share = inverse * direction;
        ((q - p) * share.x + (r - p) * share.y).length()
    };
    (flat.determinant() / 2.0, draped(DVec2::X), draped(DVec2::Y))
}

fn percentiles(mut values: Vec<(f64, f64)>) -> Percentiles {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = values.iter().map(|(_, area)| area).sum();
    [0.05, 0.5, 0.95].map(|share| {
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

    #[test]
    fn a_stretched_square() {
        let mut garment = Garment::rectangle(4.0, 3.0);
        for p in &mut garment.panels[0].draped {
            *p *= glam::DVec3::new(1.25, 0.5, 1.0);
        }
        assert_eq!(stretch(&garment), ([0.5; 3], [1.25; 3]));
    }
}
