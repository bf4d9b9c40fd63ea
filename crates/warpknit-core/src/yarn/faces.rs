//! Which vertices of a tube its triangles join: known from its section and length alone, so that
//! files that hold triangles behind all vertices need not keep them until then.
//!
//! In: a [`Section`] and the vertices of a strand's tube. Out: its triangles, as
//! [`Tubes::add`](super::tube::Tubes::add) sets them: those between rings from the first ring on,
//! then those of the caps.

use std::ops::Range;

use super::tube::Section;

/// How many triangles a tube of these vertices has.
#[must_use]
pub fn count(section: &Section, vertices: &Range<u32>) -> usize {
    let (sr, rings) = (section.sr as usize, vertices.len() / (section.sr as usize + 1));
    // A cap has the vertices of a ring and half the triangles between two.
    if section.caps {
        2 * sr * rings.saturating_sub(3) + 2 * sr
    } else {
        2 * sr * rings.saturating_sub(1)
    }
}

/// Hands over the triangles of a tube whose vertices are numbered `vertices`.
///
/// ```
/// use glam::DVec3;
/// use warpknit_core::yarn::{faces, tube::{Section, Tubes}};
/// let section = Section { st: 10, sr: 5, radius: 0.1, flatten: 1.0, caps: true, texture_per_mm: 1.0 };
/// let mut tubes = Tubes::default();
/// tubes.add(&[DVec3::ZERO, DVec3::X, DVec3::ONE], &[DVec3::Z; 3], [0..3], &section);
/// let vertices = tubes.strands[0].0.clone();
/// assert_eq!(faces::count(&section, &vertices), tubes.triangles.len());
/// let mut made = Vec::new();
/// faces::each(&section, vertices, |triangle| made.push(triangle));
/// assert_eq!(made, tubes.triangles);
/// ```
pub fn each(section: &Section, vertices: Range<u32>, mut take: impl FnMut([u32; 3])) {
    let Section { sr, caps, .. } = *section;
    let ring = sr + 1;
    // A cap has a middle and a rim of its own: one ring's worth of vertices.
    let ends =
        if caps { [vertices.end - 2 * ring, vertices.end - ring] } else { [vertices.end; 2] };
    for before in (vertices.start..ends[0].saturating_sub(ring)).step_by(ring as usize) {
        for a in before..before + sr {
            take([a, a + 1, a + ring]);
            take([a + 1, a + ring + 1, a + ring]);
        }
    }
    for (middle, ahead) in ends.into_iter().zip([false, true]).filter(|_| caps) {
        for s in 0..sr {
            let (p, q) = (middle + 1 + s, middle + 1 + (s + 1) % sr);
            take(if ahead { [middle, p, q] } else { [middle, q, p] });
        }
    }
}
