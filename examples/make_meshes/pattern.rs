//! Pattern cutting: outlines of named sides, divided into equal segments and triangulated; then
//! panels are laid out in the plane, placed in space and sewn.
//!
//! In: curves in the plane, in cm, y along the grain. Out: a [`Garment`]: the flat pattern, its
//! triangles, each vertex's first position in space, and the pairs of vertices that are sewn
//! together.
//!
//! Not promised: panels may overlap in the plane; the recipe chooses their places.

use std::{f64::consts::FRAC_PI_2, ops::Range};

use glam::{DVec2, DVec3};

use crate::triangulate::triangulate;

/// A polyline along a curve, dense enough to measure and divide it.
pub(crate) type Curve = Vec<DVec2>;

/// Segments of a traced curve.
const CURVE_STEPS: u32 = 200;

/// The polyline of a curve over the parameter 0..1.
fn trace(at: impl Fn(f64) -> DVec2) -> Curve {
    (0..=CURVE_STEPS).map(|step| at(f64::from(step) / f64::from(CURVE_STEPS))).collect()
}

/// A straight line.
pub(crate) fn line(a: DVec2, b: DVec2) -> Curve {
    vec![a, b]
}

/// An arc about `centre`. Angles are measured from straight down, positive to the right, so a hem
/// runs from negative to positive.
pub(crate) fn arc(centre: DVec2, radius: f64, from: f64, to: f64) -> Curve {
    trace(|t| centre + radius * DVec2::from_angle(from + t * (to - from) - FRAC_PI_2))
}

/// A cubic Bézier curve through the first and the last of the four points.
pub(crate) fn bezier([a, b, c, d]: [DVec2; 4]) -> Curve {
    trace(|t| {
        let s = 1.0 - t;
        s * s * s * a + 3.0 * s * s * t * b + 3.0 * s * t * t * c + t * t * t * d
    })
}

/// The same curve mirrored, x to -x, and run backwards, so that the outline stays
/// counter-clockwise.
pub(crate) fn mirrored(curve: &[DVec2]) -> Curve {
    curve.iter().rev().map(|point| DVec2::new(-point.x, point.y)).collect()
}

/// The length of a curve.
pub(crate) fn length(curve: &[DVec2]) -> f64 {
    curve.windows(2).map(|pair| pair[0].distance(pair[1])).sum()
}

/// The number of segments of about `spacing` in a length, at least one.
pub(crate) fn segments(length: f64, spacing: f64) -> u32 {
    DVec2::splat(length / spacing).round().as_uvec2().x.max(1)
}

/// The start of each of `count` parts of equal arc length. The curve's end belongs to the next
/// side.
fn divide(curve: &[DVec2], count: u32) -> Vec<DVec2> {
    let total = length(curve);
    let mut points = Vec::new();
    let (mut piece, mut passed) = (0, 0.0);
    for index in 0..count {
        let arc = total * f64::from(index) / f64::from(count);
        while piece + 2 < curve.len() && passed + curve[piece].distance(curve[piece + 1]) < arc {
            passed += curve[piece].distance(curve[piece + 1]);
            piece += 1;
        }
        let part = (arc - passed) / curve[piece].distance(curve[piece + 1]);
        points.push(curve[piece].lerp(curve[piece + 1], part));
    }
    points
}

/// One side of a panel's outline. Sides that are sewn together have the same number of segments.
pub(crate) struct Side {
    pub(crate) name: &'static str,
    pub(crate) curve: Curve,
    pub(crate) segments: u32,
}

impl Side {
    pub(crate) fn new(name: &'static str, curve: Curve, spacing: f64) -> Self {
        let segments = segments(length(&curve), spacing);
        Self { name, curve, segments }
    }
}

/// A triangulated panel in its own coordinates.
pub(crate) struct Panel {
    pub(crate) name: String,
    pub(crate) points: Vec<DVec2>,
    pub(crate) triangles: Vec<[u32; 3]>,
    sides: Vec<(&'static str, Vec<u32>)>,
}

impl Panel {
    /// Cuts a panel. The sides follow one another counter-clockwise, each beginning where the one
    /// before it ends.
    pub(crate) fn cut(name: &str, outline: &[Side], spacing: f64, seed: u64) -> Self {
        let points: Vec<DVec2> =
            outline.iter().flat_map(|side| divide(&side.curve, side.segments)).collect();
        let count = u32::try_from(points.len()).expect("an outline has few points");
        let mut first = 0;
        let mut sides = Vec::new();
        for side in outline {
            sides.push((
                side.name,
                (first..=first + side.segments).map(|index| index % count).collect(),
            ));
            first += side.segments;
        }
        let (points, triangles) = triangulate(&points, spacing, seed);
        Self { name: name.to_owned(), points, triangles, sides }
    }
}

/// A panel's ranges of vertices and triangles in the garment.
pub(crate) struct PanelRange {
    pub(crate) name: String,
    pub(crate) vertices: Range<usize>,
    pub(crate) triangles: Range<usize>,
    sides: Vec<(&'static str, Vec<u32>)>,
}

/// The whole pattern: the vertices and triangles of all panels one after the other, and the pairs
/// of vertices to be sewn.
#[derive(Default)]
pub(crate) struct Garment {
    pub(crate) flat: Vec<DVec2>,
    pub(crate) start: Vec<DVec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) pieces: Vec<PanelRange>,
    pub(crate) seams: Vec<[u32; 2]>,
}

impl Garment {
    /// Adds a panel: `offset` places it in the flat layout, `place` in space. Returns its number,
    /// for [`Garment::sew`].
    pub(crate) fn add(
        &mut self,
        panel: Panel,
        offset: DVec2,
        place: impl Fn(DVec2) -> DVec3,
    ) -> usize {
        let first = u32::try_from(self.flat.len()).expect("a garment has few vertices");
        let vertices = self.flat.len()..self.flat.len() + panel.points.len();
        let triangles = self.triangles.len()..self.triangles.len() + panel.triangles.len();
        self.flat.extend(panel.points.iter().map(|&point| point + offset));
        self.start.extend(panel.points.iter().map(|&point| place(point)));
        self.triangles
            .extend(panel.triangles.iter().map(|triangle| triangle.map(|corner| corner + first)));
        let shift = |(name, side): (_, Vec<u32>)| {
            (name, side.into_iter().map(|vertex| vertex + first).collect())
        };
        let sides = panel.sides.into_iter().map(shift).collect();
        self.pieces.push(PanelRange { name: panel.name, vertices, triangles, sides });
        self.pieces.len() - 1
    }

    /// The vertices of a side, in the outline's direction.
    pub(crate) fn side(&self, piece: usize, name: &str) -> &[u32] {
        let side = self.pieces[piece].sides.iter().find(|side| side.0 == name);
        &side.expect("the recipe names a side that it has cut").1
    }

    /// Sews two sides. All panels are seen from outside and run counter-clockwise, so two partners
    /// run in opposite directions.
    pub(crate) fn sew(&mut self, a: (usize, &str), b: (usize, &str)) {
        let (a, b) = (self.side(a.0, a.1), self.side(b.0, b.1));
        assert_eq!(a.len(), b.len(), "sewn sides have the same number of vertices");
        let pairs: Vec<[u32; 2]> = a.iter().zip(b.iter().rev()).map(|(&a, &b)| [a, b]).collect();
        self.seams.extend(pairs);
    }

    /// Numbers the particles that remain when all seams are closed. Returns the particle of each
    /// vertex, and the number of particles.
    pub(crate) fn welded(&self) -> (Vec<u32>, usize) {
        let mut lowest: Vec<u32> =
            (0..u32::try_from(self.flat.len()).expect("a garment has few vertices")).collect();
        // Where several seams meet, a vertex has several partners; repeat until the lowest number
        // has reached them all.
        let mut changed = true;
        while changed {
            changed = false;
            for &[a, b] in &self.seams {
                let low = lowest[a as usize].min(lowest[b as usize]);
                changed |= lowest[a as usize] != low || lowest[b as usize] != low;
                lowest[a as usize] = low;
                lowest[b as usize] = low;
            }
        }
        let mut particle_of = Vec::with_capacity(lowest.len());
        let mut count = 0;
        for (vertex, &low) in lowest.iter().enumerate() {
            let own = low as usize == vertex;
            particle_of.push(if own { count } else { particle_of[low as usize] });
            count += u32::from(own);
        }
        (particle_of, count as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(name: &str) -> Panel {
        let corners =
            [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)].map(|(x, y)| DVec2::new(x, y));
        let names = ["bottom", "right", "top", "left"];
        let side = |i: usize| Side::new(names[i], line(corners[i], corners[(i + 1) % 4]), 0.5);
        Panel::cut(name, &[side(0), side(1), side(2), side(3)], 0.5, 1)
    }

    #[test]
    fn sewn_vertices_become_one_particle() {
        let mut garment = Garment::default();
        let place = |point: DVec2| point.extend(0.0);
        let a = garment.add(square("a"), DVec2::ZERO, place);
        let b = garment.add(square("b"), DVec2::new(4.0, 0.0), place);
        garment.sew((a, "right"), (b, "left"));
        let (particle_of, count) = garment.welded();
        assert_eq!(count, garment.flat.len() - 9);
        for &[i, j] in &garment.seams {
            assert_eq!(particle_of[i as usize], particle_of[j as usize]);
            assert!(garment.flat[i as usize].distance(garment.flat[j as usize]) < 1e-12);
        }
    }

    #[test]
    fn a_quarter_arc_has_its_length_and_is_divided_evenly() {
        let curve = arc(DVec2::ZERO, 10.0, 0.0, FRAC_PI_2);
        assert!((length(&curve) - 10.0 * FRAC_PI_2).abs() < 1e-3);
        let points = divide(&curve, 10);
        assert!(points.windows(2).all(|pair| (pair[0].distance(pair[1]) - 1.5692).abs() < 1e-3));
    }
}
