//! The triangles of a tube, computed from its section and its vertex range.
//!
//! In: a [`Section`] and the vertex range of a strand's tube. Out: its triangles, exactly those of
//! [`Tubes::add`](super::tube::Tubes::add): first those between rings, from the first ring on, then
//! those of the caps. A writer whose format wants all vertices before the first triangle need not
//! keep the triangles until then. Cost: a few additions a triangle, no memory.

use std::ops::Range;

use super::tube::Section;

/// The number of triangles of a tube with these vertices.
#[must_use]
pub fn count(section: &Section, vertices: &Range<u32>) -> usize {
    let (sr, rings) = (section.sr as usize, vertices.len() / (section.sr as usize + 1));
    // A cap has as many vertices as a ring (a middle and a rim of its own), and half as many
    // triangles as lie between two rings. So two of the "rings" counted above are caps.
    if section.caps {
        2 * sr * rings.saturating_sub(3) + 2 * sr
    } else {
        2 * sr * rings.saturating_sub(1)
    }
}

/// Calls `take` with each triangle of a tube whose vertices are numbered `vertices`.
///
/// ```
/// use glam::DVec3;
/// use warpknit_core::yarn::{faces, tube::{Section, Tubes}};
/// let section =
///     Section { st: 10, sr: 5, radius: 0.1, flatten: 1.0, caps: true, texture_per_mm: 1.0 };
/// let mut tubes = Tubes::default();
/// tubes.add(&[DVec3::ZERO, DVec3::X, DVec3::ONE], &[DVec3::Z; 3], [0..3], &section);
/// let vertices = tubes.strands[0].0.clone();
/// assert_eq!(faces::count(&section, &vertices), tubes.triangles.len());
/// let mut made = Vec::new();
/// faces::for_each(&section, vertices, |triangle| made.push(triangle));
/// assert_eq!(made, tubes.triangles);
/// ```
pub fn for_each(section: &Section, vertices: Range<u32>, mut take: impl FnMut([u32; 3])) {
    let Section { sr, caps, .. } = *section;
    let ring = sr + 1;
    // The caps' vertices are the last of the tube: a middle and a rim each, as many as a ring has.
    let ends =
        if caps { [vertices.end - 2 * ring, vertices.end - ring] } else { [vertices.end; 2] };
    for before in (vertices.start..ends[0].saturating_sub(ring)).step_by(ring as usize) {
        // A ring repeats its first vertex at the seam, so no index wraps around here.
        for a in before..before + sr {
            take([a, a + 1, a + ring]);
            take([a + 1, a + ring + 1, a + ring]);
        }
    }
    for (middle, ahead) in ends.into_iter().zip([false, true]).filter(|_| caps) {
        // A cap's rim has no second seam vertex, so here the last edge returns to the first vertex.
        for s in 0..sr {
            let (p, q) = (middle + 1 + s, middle + 1 + (s + 1) % sr);
            take(if ahead { [middle, p, q] } else { [middle, q, p] });
        }
    }
}
