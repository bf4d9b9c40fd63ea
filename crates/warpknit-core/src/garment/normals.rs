//! Area vectors of triangles, and normals of vertices.
//!
//! In: draped positions and triangles. Out: unit vertex normals. Cost: linear, shared among
//! threads; the sums are in the order of the triangles for any number of them.

use glam::DVec3;
use rayon::prelude::*;

/// Triangles whose shares are computed before they are summed. They fit in the L2 cache.
const BLOCK: usize = 1 << 12;

/// Twice the area vector of a triangle: its length is twice the area, its direction the normal.
#[inline]
pub(super) fn cross([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

/// Unit vertex normals, each triangle weighted by its angle at the vertex (Thürmer and Wüthrich,
/// Computing vertex normals from polygonal facets, 1998). With these weights the normals don't
/// depend on how the cloth was triangulated.
///
/// A vertex that has collapsed triangles only gets the panel's mean normal. Where that vanishes too
/// (a closed or collapsed panel) it gets +z.
pub(super) fn normals(draped: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; draped.len()];
    let mut mean = DVec3::ZERO;
    let mut shares = Vec::new();
    for block in triangles.chunks(BLOCK * rayon::current_num_threads()) {
        block
            .par_iter()
            .with_min_len(BLOCK / 4)
            .map(|triangle| Share::new(triangle.map(|vertex| draped[vertex as usize])))
            .collect_into_vec(&mut shares);
        for (triangle, share) in block.iter().zip(&shares) {
            mean += share.area;
            for (&vertex, &angle) in triangle.iter().zip(&share.angles) {
                sums[vertex as usize] += share.normal * angle;
            }
        }
    }
    let fallback = mean.normalize_or(DVec3::Z);
    sums.into_par_iter().map(|sum| sum.normalize_or(fallback)).collect()
}

/// What a triangle adds to the normals of its corners.
struct Share {
    area: DVec3,
    normal: DVec3,
    angles: [f64; 3],
}

impl Share {
    fn new(corners: [DVec3; 3]) -> Self {
        let area = cross(corners);
        let angles = std::array::from_fn(|i| {
            let (to_next, to_last) =
                (corners[(i + 1) % 3] - corners[i], corners[(i + 2) % 3] - corners[i]);
            // atan2 is exact for angles near 0 and 180 degrees, where acos of a dot product is not.
            to_next.cross(to_last).length().atan2(to_next.dot(to_last))
        });
        Self { area, normal: area.normalize_or_zero(), angles }
    }
}
