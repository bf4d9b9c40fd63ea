//! The straight path across a panel from one point to another: whether it stays on the panel, and
//! where it leaves.
//!
//! In: two points of the plane, and the triangle of the first. Out: [`Traced`]. Yarns are cut where
//! they leave their panel, so that place must be exact to rounding. A yarn must not jump over a
//! slit or a notch either, since its two sides may lie far apart on the body.
//!
//! Method: a straight walk through the triangulation (Devillers, Pion and Teillaud 2002, "Walking
//! in a triangulation"). In each triangle the path leaves through the edge whose ends lie on
//! opposite sides of it. Cost: a few multiplications for each triangle passed. Not promised: an
//! answer for paths of over [`MAX_STEPS`] triangles, which end where they are.

use glam::DVec2;

use super::orient2d::cross;
use super::topology::{BORDER, edge};
use super::triangle::Containment;
use super::{Locator, SurfacePoint};

/// Triangles after which a path ends where it is. No two neighbouring data points are that far
/// apart, so it only bounds walks that circle around a corner.
const MAX_STEPS: usize = 4096;

/// How a path ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Traced {
    /// The path to the target is on the panel.
    Arrived,
    /// The panel ends before the target.
    Left {
        /// The last point on the panel.
        at: SurfacePoint,
        /// Share of the path up to there, 0..=1.
        share: f64,
    },
}

impl Locator<'_> {
    /// Follows the straight path from `from`, whose triangle is that of `start`, to `to`.
    ///
    /// Cost: a few multiplications for each triangle passed, and six exact predicates where the
    /// path passes near a corner.
    #[must_use]
    pub fn trace(&self, from: DVec2, start: SurfacePoint, to: DVec2) -> Traced {
        let mut triangle = start.triangle;
        let mut last = None;
        for _ in 0..MAX_STEPS {
            let exit = match self.triangles[triangle as usize].exit_towards(to) {
                Containment::Inside => return Traced::Arrived,
                Containment::Beyond(edge) => edge,
                Containment::Uncertain => {
                    let beyond = self.crosses_of(triangle, to);
                    if beyond.iter().all(|&t| t >= 0.0) {
                        return Traced::Arrived;
                    }
                    match self.exit(triangle, from, to, beyond) {
                        Some(edge) => edge,
                        // No edge passes the exact test: the start lies beyond this triangle by a
                        // rounding. The path ends where it came in.
                        None => break,
                    }
                }
            };
            last = Some((triangle, exit));
            match self.triangles[triangle as usize].neighbours[exit] {
                BORDER => break,
                next => triangle = next,
            }
        }
        last.map_or(Traced::Left { at: start, share: 0.0 }, |(triangle, exit)| {
            self.left(triangle, exit, from, to)
        })
    }

    /// The point at which the path from `from` to `to` crosses an edge of a triangle.
    fn left(&self, triangle: u32, exit: usize, from: DVec2, to: DVec2) -> Traced {
        let (a, b) = self.ends(triangle, exit);
        // Distances of both points from the edge, times its length: their ratio is the share. A
        // start on the edge may come out a rounding beyond it, and counts as on it.
        let (inside, beyond) = (cross(from, a, b).max(0.0), cross(to, a, b));
        let share = inside / (inside - beyond);
        Traced::Left { at: self.point(triangle, from.lerp(to, share)), share }
    }

    /// The edge through which the path from `from` to `to` leaves a triangle, by exact predicates.
    fn exit(&self, triangle: u32, from: DVec2, to: DVec2, beyond: [f64; 3]) -> Option<usize> {
        (0..3).filter(|&i| beyond[i] < 0.0).find(|&i| {
            let (a, b) = self.ends(triangle, i);
            // Looking along the path, the exit edge of a counter-clockwise triangle runs from right
            // to left.
            cross(from, to, a) <= 0.0 && cross(from, to, b) >= 0.0
        })
    }

    /// The ends of an edge.
    fn ends(&self, triangle: u32, i: usize) -> (DVec2, DVec2) {
        let (a, b) = edge(self.panel.triangles[triangle as usize], i);
        (self.panel.uv[a as usize], self.panel.uv[b as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::garment::Garment;

    #[test]
    fn a_way_off_a_square_is_cut_at_its_edge() {
        let garment = Garment::rectangle(4.0, 2.0);
        let locator = Locator::new(&garment.panels[0]);
        for (from, to, share) in [
            ((1.0, 1.0), (7.0, 1.0), 0.5),
            ((3.0, 1.0), (3.0, -3.0), 0.25),
            ((4.0, 1.0), (5.0, 1.0), 0.0),
        ] {
            let (from, to) = (DVec2::from(from), DVec2::from(to));
            let start = locator.at(from, 0).unwrap();
            let Traced::Left { at, share: found } = locator.trace(from, start, to) else {
                panic!("left the square")
            };
            assert!((found - share).abs() < 1e-12);
            let corners = garment.panels[0].triangles[at.triangle as usize]
                .map(|v| garment.panels[0].uv[v as usize].extend(0.0));
            assert!((at.blend(corners).truncate() - from.lerp(to, share)).length() < 1e-12);
        }
    }

    #[test]
    fn a_way_within_a_square_arrives_also_through_corners_and_along_edges() {
        let garment = Garment::rectangle(2.0, 2.0);
        let locator = Locator::new(&garment.panels[0]);
        for (from, to) in [
            ((0.0, 0.0), (2.0, 2.0)),
            ((0.5, 1.5), (1.5, 0.5)),
            ((0.0, 2.0), (2.0, 0.0)),
            ((0.0, 0.0), (2.0, 0.0)),
        ] {
            let (from, to) = (DVec2::from(from), DVec2::from(to));
            let start = locator.at(from, 0).unwrap();
            assert_eq!(locator.trace(from, start, to), Traced::Arrived);
        }
    }
}
