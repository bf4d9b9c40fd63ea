//! What renderers draw at all: points that are near enough, and radii above 0.

use glam::Vec3;

/// Largest coordinate that renderers accept, mm: ten kilometres. Beyond it, `f32` has a spacing of
/// a millimetre, and whole stitches coincide.
pub const MAX_COORDINATE: f32 = 1e7;

/// Whether renderers accept `point` as a point of a yarn: finite, and not beyond
/// [`MAX_COORDINATE`].
#[must_use]
pub fn drawable(point: Vec3) -> bool {
    point.abs().cmple(Vec3::splat(MAX_COORDINATE)).all()
}

/// Whether renderers draw yarns of this radius: above 0 and below [`MAX_COORDINATE`].
pub(crate) fn is_drawable_radius(radius: f32) -> bool {
    radius > 0.0 && radius < MAX_COORDINATE
}
