//! Which flat triangle holds a data point.
//!
//! In: a [`Panel`] and points in its axes. Out: a [`SurfacePoint`] each, or none off the panel. Source: Liu, Kyosev, Jiang 2022,
//! section 3.1, equation 1, with its print error mended (see [`sign`]).
//!
//! The answer is a function of mesh and point alone: of all triangles that hold the point, edges and corners included, the one with
//! the smallest index. Signs are exact, so a point within the panel's area is never lost in a crack. How it is found is
//! another matter: yarns run on from point to point, so a walk over neighbours from the last triangle mostly arrives within a few
//! steps; where it doesn't, or where the panel overlaps itself, a BVH gives all candidates. That is 45 ns a point in all, on yarns over a gore of
//! 4600 triangles (`cargo bench`, 2026-11). The depth of a point plays no part.

pub mod sign;
mod topology;
mod trace;

use glam::{DVec2, DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

use crate::garment::Panel;
use sign::crosses;
use topology::{BORDER, Topology};
pub use trace::Traced;

/// A point on a panel, whatever shape the panel takes: a triangle and two barycentric coordinates in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Index into [`Panel::triangles`].
    pub triangle: u32,
    /// Weight of the triangle's second corner.
    pub b: f64,
    /// Weight of the triangle's third corner; the first has the rest.
    pub c: f64,
}

impl SurfacePoint {
    /// From the three cross products of the point and its triangle.
    fn from_crosses(triangle: u32, [ab, bc, ca]: [f64; 3]) -> Self {
        let area = ab + bc + ca;
        Self { triangle, b: ca / area, c: ab / area }
    }

    /// Weights of the three corners.
    #[must_use]
    pub fn weights(&self) -> [f64; 3] {
        [1.0 - self.b - self.c, self.b, self.c]
    }

    /// What the corners hold, blended.
    #[must_use]
    pub fn blend(&self, corners: [DVec3; 3]) -> DVec3 {
        let [a, b, c] = self.weights();
        corners[0] * a + corners[1] * b + corners[2] * c
    }
}

/// Steps after which a walk gives up: beyond them the BVH is as quick (0.06 % of coherent points get here).
const MAX_WALK: usize = 32;

/// A panel made ready for questions.
pub struct Locator<'a> {
    uv: &'a [DVec2],
    triangles: &'a [[u32; 3]],
    topology: Topology,
    bvh: Option<Bvh2>,
    flipped: Option<(&'a [[u32; 3]], Bvh2)>,
}

/// Where a walk ended.
enum Walk {
    /// Strictly inside this triangle, or on an edge that it shares with a neighbour of higher index.
    Found(SurfacePoint),
    /// On an edge or corner whose triangles the walk doesn't all know, off the panel, or too far.
    Ask,
}

impl<'a> Locator<'a> {
    /// Builds the search structures. Cost: about 0.5 µs a triangle.
    #[must_use]
    pub fn new(panel: &'a Panel) -> Self {
        let flipped = boxes_bvh(&panel.uv, &panel.flipped).map(|bvh| (panel.flipped.as_slice(), bvh));
        Self {
            uv: &panel.uv,
            triangles: &panel.triangles,
            topology: Topology::new(&panel.uv, &panel.triangles),
            bvh: boxes_bvh(&panel.uv, &panel.triangles),
            flipped,
        }
    }

    /// The triangle that holds each point, in order. Neighbouring points should follow each other, as a yarn's do.
    ///
    /// ```
    /// use warpknit::garment::Garment;
    /// use warpknit::locate::Locator;
    /// use glam::DVec3;
    /// let garment = Garment::rectangle(10.0, 10.0);
    /// let located = Locator::new(&garment.panels[0]).locate(&[DVec3::new(2.0, 1.0, 0.0), DVec3::new(11.0, 1.0, 0.0)]);
    /// assert!(located[0].is_some() && located[1].is_none());
    /// ```
    #[must_use]
    pub fn locate(&self, points: &[DVec3]) -> Vec<Option<SurfacePoint>> {
        let mut located = Vec::with_capacity(points.len());
        self.locate_into(points, &mut located);
        located
    }

    /// [`Self::locate`] into memory that is there already.
    pub fn locate_into(&self, points: &[DVec3], located: &mut Vec<Option<SurfacePoint>>) {
        let mut last = 0;
        for point in points {
            let at = self.at(point.truncate(), last);
            last = at.map_or(last, |at| at.triangle);
            located.push(at);
        }
    }

    /// The triangle that holds `p`; `hint` is any triangle, best one nearby.
    #[must_use]
    pub fn at(&self, p: DVec2, hint: u32) -> Option<SurfacePoint> {
        if self.topology.embedded
            && let Walk::Found(at) = self.walk(p, hint)
        {
            return Some(at);
        }
        self.search(p)
    }

    /// Whether `p` lies in a triangle that is wound against its panel, where nothing can be knitted.
    #[must_use]
    pub fn is_defect(&self, p: DVec2) -> bool {
        let Some((triangles, bvh)) = &self.flipped else { return false };
        let mut found = false;
        for_candidates(bvh, p, |triangle| found |= holds(crosses_of(self.uv, triangles[triangle as usize], p)));
        found
    }

    /// From triangle to triangle towards `p`, through the first edge that has it outside.
    fn walk(&self, p: DVec2, hint: u32) -> Walk {
        let mut triangle = hint;
        for _ in 0..MAX_WALK {
            let t = crosses_of(self.uv, self.triangles[triangle as usize], p);
            let neighbours = self.topology.neighbours[triangle as usize];
            if let Some(out) = (0..3).find(|&i| t[i] < 0.0) {
                if neighbours[out] == BORDER {
                    return Walk::Ask;
                }
                triangle = neighbours[out];
                continue;
            }
            return match t.map(|t| t == 0.0) {
                [false, false, false] => Walk::Found(SurfacePoint::from_crosses(triangle, t)),
                // On one inner edge: its two triangles are all that hold the point.
                [true, false, false] => self.lower_of(triangle, neighbours[0], p, t),
                [false, true, false] => self.lower_of(triangle, neighbours[1], p, t),
                [false, false, true] => self.lower_of(triangle, neighbours[2], p, t),
                _ => Walk::Ask,
            };
        }
        Walk::Ask
    }

    fn lower_of(&self, triangle: u32, neighbour: u32, p: DVec2, t: [f64; 3]) -> Walk {
        if neighbour > triangle {
            return Walk::Found(SurfacePoint::from_crosses(triangle, t));
        }
        let t = crosses_of(self.uv, self.triangles[neighbour as usize], p);
        Walk::Found(SurfacePoint::from_crosses(neighbour, t))
    }

    /// The lowest of all triangles that hold `p`, by the BVH.
    fn search(&self, p: DVec2) -> Option<SurfacePoint> {
        let mut lowest: Option<SurfacePoint> = None;
        for_candidates(self.bvh.as_ref()?, p, |triangle| {
            if lowest.is_some_and(|at| at.triangle <= triangle) {
                return;
            }
            let t = crosses_of(self.uv, self.triangles[triangle as usize], p);
            if holds(t) {
                lowest = Some(SurfacePoint::from_crosses(triangle, t));
            }
        });
        lowest
    }
}

/// The paper's rule, edges and corners included: no two of the products have opposite signs. Panels are counter-clockwise and
/// without degenerate triangles, so a triangle that holds a point has no negative product.
#[inline]
fn holds(t: [f64; 3]) -> bool {
    t[0] >= 0.0 && t[1] >= 0.0 && t[2] >= 0.0 || t[0] <= 0.0 && t[1] <= 0.0 && t[2] <= 0.0
}

#[inline]
fn crosses_of(uv: &[DVec2], [a, b, c]: [u32; 3], p: DVec2) -> [f64; 3] {
    crosses(p, uv[a as usize], uv[b as usize], uv[c as usize])
}

/// A box in `f32` that holds all of the points: rounded outward, since the BVH knows no `f64`.
fn outer_box(points: impl Iterator<Item = DVec2> + Clone) -> Aabb {
    #[expect(clippy::cast_possible_truncation, reason = "rounded outward right after")]
    let (down, up) = (|x: f64| (x as f32).next_down(), |x: f64| (x as f32).next_up());
    let low = points.clone().fold(DVec2::INFINITY, DVec2::min);
    let high = points.fold(DVec2::NEG_INFINITY, DVec2::max);
    Aabb::new(Vec3A::new(down(low.x), down(low.y), 0.0), Vec3A::new(up(high.x), up(high.y), 0.0))
}

fn boxes_bvh(uv: &[DVec2], triangles: &[[u32; 3]]) -> Option<Bvh2> {
    let boxes: Vec<_> = triangles.iter().map(|t| outer_box(t.iter().map(|&v| uv[v as usize]))).collect();
    let mut build_time = std::time::Duration::ZERO;
    (!boxes.is_empty()).then(|| build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut build_time))
}

/// Calls `visit` for every triangle whose box holds `p`.
fn for_candidates(bvh: &Bvh2, p: DVec2, mut visit: impl FnMut(u32)) {
    bvh.aabb_traverse(outer_box(std::iter::once(p)), |bvh, node| {
        let node = &bvh.nodes[node as usize];
        for slot in node.first_index..node.first_index + node.prim_count {
            visit(bvh.primitive_indices[slot as usize]);
        }
        true
    });
}
