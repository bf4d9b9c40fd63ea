//! Checks whether a garment is fit for use: nearly isometric, facing outward, outside the body.
//!
//! In: the flat pattern and the draped positions. Out: percentiles of the principal stretches, both
//! of each triangle pooled; the share of triangles whose normal points into the body; the depth of
//! the deepest vertex in the body. Method: the principal stretches are the singular values of the
//! linear map from a flat triangle to its draped one.
//!
//! Not promised: it does not find self-intersections of the cloth.

use glam::{DVec2, DVec3};

use crate::{body::Body, pattern::Garment};

/// The 5th, 50th and 95th percentile.
#[derive(Clone, Copy)]
pub(crate) struct Stretch {
    pub(crate) low: f64,
    pub(crate) median: f64,
    pub(crate) high: f64,
}

impl Stretch {
    /// The limits that the project sets itself: the median within 2 % of 1, the outer percentiles
    /// within 8 %.
    pub(crate) fn is_near_isometric(&self) -> bool {
        (self.median - 1.0).abs() <= 0.02 && self.low >= 0.92 && self.high <= 1.08
    }
}

/// The percentiles of a garment's principal stretches.
pub(crate) fn stretch(garment: &Garment, draped: &[DVec3]) -> Stretch {
    let mut all: Vec<f64> = Vec::with_capacity(2 * garment.triangles.len());
    for triangle in &garment.triangles {
        let flat = triangle.map(|vertex| garment.flat[vertex as usize]);
        all.extend(principal_stretches(flat, triangle.map(|vertex| draped[vertex as usize])));
    }
    all.sort_unstable_by(f64::total_cmp);
    let percentile = |percent: usize| all[(all.len() - 1) * percent / 100];
    Stretch { low: percentile(5), median: percentile(50), high: percentile(95) }
}

/// The singular values of the linear map that takes the flat triangle's edges to the draped
/// triangle's.
fn principal_stretches(flat: [DVec2; 3], draped: [DVec3; 3]) -> [f64; 2] {
    let (u, v) = (flat[1] - flat[0], flat[2] - flat[0]);
    let (p, q) = (draped[1] - draped[0], draped[2] - draped[0]);
    let determinant = u.perp_dot(v);
    let along_x = (p * v.y - q * u.y) / determinant;
    let along_y = (q * u.x - p * v.x) / determinant;
    // The squares of the singular values are the eigenvalues of the first fundamental form
    // [e f; f g].
    let (e, g, f) = (along_x.length_squared(), along_y.length_squared(), along_x.dot(along_y));
    let (mean, spread) = (0.5 * (e + g), (0.25 * (e - g) * (e - g) + f * f).sqrt());
    [(mean - spread).max(0.0).sqrt(), (mean + spread).sqrt()]
}

/// The depth of the deepest vertex in the body, cm; negative where all vertices are outside.
pub(crate) fn depth(body: &Body, draped: &[DVec3]) -> f64 {
    draped.iter().map(|&position| -body.touch(position).distance).fold(f64::NEG_INFINITY, f64::max)
}

/// The share of triangles whose normal points toward the body. Folds turn some triangles inwards,
/// so the check can only require that most face outward.
pub(crate) fn inward_share(garment: &Garment, draped: &[DVec3], body: &Body) -> f64 {
    let is_inward = |triangle: &&[u32; 3]| {
        let [a, b, c] = triangle.map(|vertex| draped[vertex as usize]);
        (b - a).cross(c - a).dot(body.touch((a + b + c) / 3.0).normal) < 0.0
    };
    garment.triangles.iter().filter(is_inward).count() as f64 / garment.triangles.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_and_stretched_triangle_has_the_stretches_it_was_given() {
        let flat = [DVec2::new(1.0, 1.0), DVec2::new(2.0, 1.2), DVec2::new(1.3, 2.0)];
        let turn = glam::DQuat::from_rotation_x(0.7) * glam::DQuat::from_rotation_z(0.3);
        let draped = flat.map(|point| turn * DVec3::new(1.05 * point.x, 0.9 * point.y, 3.0));
        let [low, high] = principal_stretches(flat, draped);
        assert!((low - 0.9).abs() < 1e-12 && (high - 1.05).abs() < 1e-12);
    }
}
