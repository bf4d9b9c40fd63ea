//! Which vertices of a tube its triangles join: known from its section and length alone, so that files that hold triangles behind all vertices
//! need not keep them until then.
//!
//! In: a [`Section`] and the vertices of a strand's tube. Out: its triangles, as [`Tubes::add`](super::tube::Tubes::add) sets them: those between rings from the
//! first ring on, then those of the caps.

use std::ops::Range;

use super::tube::Section;

/// The triangles of a tube whose vertices are numbered `vertices`.
///
/// ```
/// use glam::DVec3;
/// use warpknit::yarn::{faces, tube::{Section, Tubes}};
/// let section = Section { st: 10, sr: 5, radius: 0.1, flatten: 1.0, caps: true, texture_per_mm: 1.0 };
/// let mut tubes = Tubes::default();
/// tubes.add(&[DVec3::ZERO, DVec3::X, DVec3::ONE], &[DVec3::Z; 3], [0..3], &section);
/// assert!(faces::triangles(&section, tubes.strands[0].0.clone()).eq(tubes.triangles));
/// ```
pub fn triangles(section: &Section, vertices: Range<u32>) -> impl Iterator<Item = [u32; 3]> {
    let Section { sr, caps, .. } = *section;
    let ring = sr + 1;
    // A cap has a middle and a rim of its own.
    let ends = if caps { [vertices.end - 2 * ring, vertices.end - ring] } else { [vertices.end; 2] };
    let sides = (vertices.start..ends[0].saturating_sub(ring))
        .step_by(ring as usize)
        .flat_map(move |before| (before..before + sr).flat_map(move |a| [[a, a + 1, a + ring], [a + 1, a + ring + 1, a + ring]]));
    let cap = move |middle: u32, ahead: bool| {
        (0..sr).map(move |s| {
            let (p, q) = (middle + 1 + s, middle + 1 + (s + 1) % sr);
            if ahead { [middle, p, q] } else { [middle, q, p] }
        })
    };
    let caps = ends.into_iter().zip([false, true]).filter(move |_| caps).flat_map(move |(middle, ahead)| cap(middle, ahead));
    sides.chain(caps)
}
