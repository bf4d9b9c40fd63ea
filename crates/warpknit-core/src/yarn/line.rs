//! Centre lines of yarns: the middles of a tube's rings, St segments a stitch.
//!
//! In: the points of a strand and its stitches. Out: the points of its centre line, mm, in `f32`.
//! Method: the curve of [`super::curve`], sampled as tubes sample it. Cost: linear in the rings.

use std::ops::Range;

use glam::{DVec3, Vec3};

use super::steps::Steps;
use super::walk::SpanCursor;

/// Appends the centre line of one strand. `points` are two points or more in mm. `stitches` are
/// ranges of points that share their ends, from the first point on.
///
/// It appends as many points as [`super::tube::Tubes::add`] sets rings, at their middles.
///
/// ```
/// use glam::{DVec3, Vec3};
/// let mut line = Vec::new();
/// warpknit_core::yarn::line::add(&[DVec3::ZERO, DVec3::X, 2.0 * DVec3::X], [0..3], 4, &mut line);
/// assert_eq!(line, [0.0, 0.5, 1.0, 1.5, 2.0].map(|x| Vec3::X * x));
/// ```
pub fn add(
    points: &[DVec3],
    stitches: impl IntoIterator<Item = Range<usize>>,
    st: u32,
    line: &mut Vec<Vec3>,
) {
    let (mut cursor, mut steps) = (SpanCursor::new(points), Steps::default());
    // 1 from the second stitch on: its first ring is the last ring of the stitch before.
    let mut first = 0;
    for stitch in stitches {
        steps.fit(stitch.len() - 1, st);
        for (index, parameters) in stitch.zip(steps.per_span()) {
            let (span, _) = cursor.next();
            let start = points[index].as_vec3a();
            line.extend(parameters[first..].iter().map(|&t| Vec3::from(start + span.at(t))));
            first = 0;
        }
        first = 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::yarn::tube::{Section, Tubes};

    #[test]
    fn a_line_goes_through_the_middles_of_the_rings() {
        let points: Vec<_> =
            (0..13).map(f64::from).map(|i| DVec3::new(i.sin(), 0.3 * i, (1.7 * i).cos())).collect();
        let (section, mut tubes, mut line) = (
            Section { st: 7, sr: 6, radius: 0.1, flatten: 1.0, caps: false, texture_per_mm: 1.0 },
            Tubes::default(),
            Vec::new(),
        );
        let stitches = [0..5, 4..9, 8..13];
        tubes.add(&points, &[DVec3::Z; 13], stitches.clone(), &section);
        add(&points, stitches, section.st, &mut line);
        let rings = tubes.positions.chunks(7);
        assert_eq!(rings.len(), line.len());
        for (ring, middle) in rings.zip(line) {
            let mean = ring[..6].iter().sum::<Vec3>() / 6.0;
            assert!(mean.distance(middle) < 1e-6);
        }
    }
}
