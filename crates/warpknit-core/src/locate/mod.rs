//! Which flat triangle holds a data point.
//!
//! In: a [`Panel`] and points in its axes. Out: a [`SurfacePoint`] each, or none off the panel.
//! Source: Liu, Kyosev, Jiang 2022, section 3.1, equation 1, with its print error mended (see
//! [`orient2d`]).
//!
//! The answer is a function of mesh and point alone: of all triangles that hold the point, edges
//! and corners included, the one that comes first in the file. Signs are exact, so a point within
//! the panel's area is never lost in a crack. How it is found is another matter. Yarns run on from
//! point to point, so four points at a time are held against the triangle of the last one (`cell`);
//! the first that is not in it is looked for by a walk over neighbours; where that can't tell, or
//! where the panel overlaps itself, a BVH gives all candidates, and it is built when first asked.
//! The depth of a point plays no part.
//!
//! Cost, on a machine where Embree's packets of rays take 50 to 140 ns a point
//! (`benches/against_peers.sh`): 10 to 20 ns a point, more where a triangle holds few of them, and
//! some 0.2 µs a triangle before the first, half of which puts triangles in their place in memory,
//! once a garment.

mod bvh;
mod cell;
pub mod orient2d;
pub mod overlap;
mod topology;
mod trace;

use std::sync::OnceLock;

use glam::{DVec2, DVec3};
use obvhs::bvh2::Bvh2;

use crate::garment::Panel;
use crate::ids::FaceId;
use bvh::{outer_box, tree, visit_boxes};
use cell::{Cell, Side};
use orient2d::crosses;
use topology::{BORDER, Topology};
pub use trace::Traced;

/// A point on a panel, whatever shape the panel takes: a triangle and two barycentric coordinates
/// in it.
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

/// A panel made ready for questions.
pub struct Locator<'a> {
    panel: &'a Panel,
    /// One a triangle.
    cells: Vec<Cell>,
    /// Whether the panel is certain to cover no point twice, so that a walk may stand in for a
    /// search.
    embedded: bool,
    /// Steps after which a walk gives up: enough to cross a panel, and in the rare mesh where it
    /// would go round in a circle soon over.
    most_steps: usize,
    /// Built when first asked: on a panel whose yarns all stay within it no one does.
    bvh: OnceLock<Option<Bvh2>>,
    /// The same over [`Panel::flipped`].
    flipped: OnceLock<Option<Bvh2>>,
}

/// Where a walk ended.
enum Walk {
    /// Strictly inside this triangle, or on an edge that it shares with a neighbour that comes
    /// later in the file.
    Found(u32),
    /// On an edge or corner whose triangles the walk doesn't all know, off the panel, or too far.
    Ask,
}

impl<'a> Locator<'a> {
    /// Builds what a walk needs. Cost: about 0.1 µs a triangle, as much again once a search is
    /// needed.
    #[must_use]
    pub fn new(panel: &'a Panel) -> Self {
        let Topology { neighbours, embedded } = Topology::new(&panel.uv, &panel.triangles);
        let size = panel.size();
        let cell = |(corners, neighbours): (&[u32; 3], [u32; 3])| {
            Cell::new(corners.map(|v| panel.uv[v as usize]), neighbours, size)
        };
        let cells: Vec<_> = panel.triangles.iter().zip(neighbours).map(cell).collect();
        let most_steps = 32 + 4 * cells.len().isqrt();
        Self { panel, cells, embedded, most_steps, bvh: OnceLock::new(), flipped: OnceLock::new() }
    }

    /// The triangle that holds each point, in order. Neighbouring points should follow each other,
    /// as a yarn's do.
    ///
    /// ```
    /// use warpknit_core::garment::Garment;
    /// use warpknit_core::locate::Locator;
    /// use glam::DVec3;
    /// let garment = Garment::rectangle(10.0, 10.0);
    /// let located = Locator::new(&garment.panels[0]).locate(&[DVec3::new(2.0, 1.0, 0.0), DVec3::new(11.0, 1.0, 0.0)]);
    /// assert!(located[0].is_some() && located[1].is_none());
    /// ```
    #[must_use]
    pub fn locate(&self, points: &[DVec3]) -> Vec<Option<SurfacePoint>> {
        let mut located = Vec::new();
        self.locate_into(points, &mut located);
        located
    }

    /// [`Self::locate`] into memory that is there already: what `located` held is forgotten.
    pub fn locate_into(&self, points: &[DVec3], located: &mut Vec<Option<SurfacePoint>>) {
        located.resize(points.len(), None);
        let (mut triangle, mut at) = (0, 0);
        while at < points.len() {
            if self.embedded {
                at +=
                    self.cells[triangle as usize].run(triangle, &points[at..], &mut located[at..]);
            }
            if let Some(point) = points.get(at) {
                let p = point.truncate();
                located[at] = self.find(p, &mut triangle).map(|found| self.point(found, p));
                at += 1;
            }
        }
    }

    /// The triangle that holds `p`; `hint` is any triangle, best one nearby.
    #[must_use]
    pub fn at(&self, p: DVec2, hint: u32) -> Option<SurfacePoint> {
        let mut triangle = hint;
        self.find(p, &mut triangle).map(|found| self.point(found, p))
    }

    /// The triangle that holds `p`, from `triangle` on, which becomes a good one to start from for
    /// a point nearby.
    fn find(&self, p: DVec2, triangle: &mut u32) -> Option<u32> {
        if self.embedded
            && let Walk::Found(found) = self.walk(p, triangle)
        {
            *triangle = found;
            return Some(found);
        }
        self.search(p)
    }

    /// Whether `p` lies in a triangle that is wound against its panel, where nothing can be
    /// knitted.
    #[must_use]
    pub fn is_defect(&self, p: DVec2) -> bool {
        let Panel { uv, flipped, .. } = self.panel;
        let Some(bvh) = self.flipped.get_or_init(|| boxes_bvh(uv, flipped)) else { return false };
        let mut found = false;
        for_candidates(bvh, p, |triangle| {
            found |= holds(crosses_of(uv, flipped[triangle as usize], p));
        });
        found
    }

    /// From triangle to triangle towards `p`, through the edge that it lies farthest beyond.
    fn walk(&self, p: DVec2, triangle: &mut u32) -> Walk {
        for _ in 0..self.most_steps {
            let cell = &self.cells[*triangle as usize];
            let out = match cell.side(p) {
                Side::Inside => return Walk::Found(*triangle),
                Side::Beyond(edge) => edge,
                Side::Near => match self.beyond(*triangle, p) {
                    Ok(edge) => edge,
                    Err(walk) => return walk,
                },
            };
            if cell.neighbours[out] == BORDER {
                return Walk::Ask;
            }
            *triangle = cell.neighbours[out];
        }
        Walk::Ask
    }

    /// By exact signs: the edge beyond which `p` lies, or how the walk ends on this triangle.
    #[cold]
    fn beyond(&self, triangle: u32, p: DVec2) -> Result<usize, Walk> {
        let t = self.crosses_of(triangle, p);
        if let Some(out) = (0..3).find(|&i| t[i] < 0.0) {
            return Ok(out);
        }
        let cell = &self.cells[triangle as usize];
        Err(match t.map(|t| t == 0.0) {
            [false, false, false] if t.iter().all(|&t| t > 0.0) => Walk::Found(triangle),
            // On one inner edge: its two triangles are all that hold the point.
            [true, false, false] => self.first_of(triangle, cell.neighbours[0]),
            [false, true, false] => self.first_of(triangle, cell.neighbours[1]),
            [false, false, true] => self.first_of(triangle, cell.neighbours[2]),
            _ => Walk::Ask,
        })
    }

    fn first_of(&self, triangle: u32, neighbour: u32) -> Walk {
        let triangle_first = neighbour == BORDER || self.face(triangle) < self.face(neighbour);
        Walk::Found(if triangle_first { triangle } else { neighbour })
    }

    /// The first in the file of all triangles that hold `p`, by the BVH.
    fn search(&self, p: DVec2) -> Option<u32> {
        let bvh =
            self.bvh.get_or_init(|| boxes_bvh(&self.panel.uv, &self.panel.triangles)).as_ref()?;
        let mut first: Option<u32> = None;
        for_candidates(bvh, p, |triangle| {
            if first.is_none_or(|first| self.face(triangle) < self.face(first))
                && holds(self.crosses_of(triangle, p))
            {
                first = Some(triangle);
            }
        });
        first
    }

    /// `p` as a point of a triangle. One too thin for gradients takes its weights from the exact
    /// products.
    fn point(&self, triangle: u32, p: DVec2) -> SurfacePoint {
        let cell = &self.cells[triangle as usize];
        if cell.is_sure() {
            return cell.point(triangle, p);
        }
        let [ab, bc, ca] = self.crosses_of(triangle, p);
        let area = ab + bc + ca;
        SurfacePoint { triangle, b: ca / area, c: ab / area }
    }

    /// Where a triangle comes in the file.
    fn face(&self, triangle: u32) -> FaceId {
        self.panel.faces[triangle as usize]
    }

    fn crosses_of(&self, triangle: u32, p: DVec2) -> [f64; 3] {
        crosses_of(&self.panel.uv, self.panel.triangles[triangle as usize], p)
    }
}

/// The paper's rule, edges and corners included: no two of the products have opposite signs. Panels
/// are counter-clockwise and without degenerate triangles, so a triangle that holds a point has no
/// negative product.
#[inline]
fn holds(t: [f64; 3]) -> bool {
    t[0] >= 0.0 && t[1] >= 0.0 && t[2] >= 0.0 || t[0] <= 0.0 && t[1] <= 0.0 && t[2] <= 0.0
}

#[inline]
fn crosses_of(uv: &[DVec2], [a, b, c]: [u32; 3], p: DVec2) -> [f64; 3] {
    crosses(p, uv[a as usize], uv[b as usize], uv[c as usize])
}

/// Nothing where there are no triangles.
fn boxes_bvh(uv: &[DVec2], triangles: &[[u32; 3]]) -> Option<Bvh2> {
    let boxes: Vec<_> =
        triangles.iter().map(|t| outer_box(t.iter().map(|&v| uv[v as usize]))).collect();
    (!boxes.is_empty()).then(|| tree(&boxes))
}

/// Calls `visit` for every triangle whose box holds `p`.
fn for_candidates(bvh: &Bvh2, p: DVec2, visit: impl FnMut(u32)) {
    visit_boxes(bvh, outer_box(std::iter::once(p)), visit);
}
