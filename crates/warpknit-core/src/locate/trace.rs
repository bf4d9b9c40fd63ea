//! Straight across a panel from a point to another: does the way stay on the panel, and where does
//! it leave?
//!
//! Yarns are cut where they leave their panel, so the place must be exact to rounding, and a yarn
//! must not jump a slit or a notch whose two sides lie far apart on the body.

use glam::DVec2;

use super::cell::Side;
use super::orient2d::cross;
use super::topology::{BORDER, edge};
use super::{Locator, SurfacePoint};

/// Triangles after which a trace ends where it is: no two neighbouring data points are that far
/// apart, so it only bounds walks around a corner in which rounding lets no edge win.
const MAX_STEPS: usize = 4096;

/// How a trace ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Traced {
    /// The way to the target is on the panel.
    Arrived,
    /// The panel ends on the way.
    Left {
        /// The last point on the panel.
        at: SurfacePoint,
        /// How far along the way it lies, 0..=1.
        share: f64,
    },
}

impl Locator<'_> {
    /// Goes straight from `from`, which `start` holds, to `to`.
    ///
    /// Cost: a few multiplications for each triangle passed; six exact signs more where the way
    /// passes near a corner.
    #[must_use]
    pub fn trace(&self, from: DVec2, start: SurfacePoint, to: DVec2) -> Traced {
        let mut triangle = start.triangle;
        let mut last = None;
        for _ in 0..MAX_STEPS {
            let exit = match self.cells[triangle as usize].side_of_way(to) {
                Side::Inside => return Traced::Arrived,
                Side::Beyond(edge) => edge,
                Side::Near => {
                    let beyond = self.crosses_of(triangle, to);
                    if beyond.iter().all(|&t| t >= 0.0) {
                        return Traced::Arrived;
                    }
                    match self.exit(triangle, from, to, beyond) {
                        Some(edge) => edge,
                        // Rounding lets no edge win: the way ends where it came in.
                        None => break,
                    }
                }
            };
            last = Some((triangle, exit));
            match self.cells[triangle as usize].neighbours[exit] {
                BORDER => break,
                next => triangle = next,
            }
        }
        last.map_or(Traced::Left { at: start, share: 0.0 }, |(triangle, exit)| {
            self.left(triangle, exit, from, to)
        })
    }

    /// Where the way from `from` to `to` crosses an edge of a triangle.
    fn left(&self, triangle: u32, exit: usize, from: DVec2, to: DVec2) -> Traced {
        let (a, b) = self.ends(triangle, exit);
        let (inside, beyond) = (cross(from, a, b).max(0.0), cross(to, a, b));
        let share = inside / (inside - beyond);
        Traced::Left { at: self.point(triangle, from.lerp(to, share)), share }
    }

    /// The edge through which the way from `from` to `to` leaves a triangle, by exact signs.
    fn exit(&self, triangle: u32, from: DVec2, to: DVec2, beyond: [f64; 3]) -> Option<usize> {
        (0..3).filter(|&i| beyond[i] < 0.0).find(|&i| {
            let (a, b) = self.ends(triangle, i);
            // Looking along the way, a counter-clockwise triangle's exit edge runs from right to
            // left.
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
