//! Point location: the flat triangle that holds each data point.
//!
//! In: a [`Panel`] and points in its axes. Out: a [`SurfacePoint`] for each, or none off the panel.
//! The depth of a point is ignored. Source: Liu, Kyosev and Jiang 2022, "Yarn-level modelling and
//! geometric simulation of warp-knitted clothing elements", section 3.1, equation 1, with its print
//! error corrected (see [`orient2d`]).
//!
//! The answer is a function of mesh and point alone. It is the first in the file of all triangles
//! that hold the point, edges and corners included. The orientation predicates are exact, so a
//! point within the panel's area is never lost in a crack between triangles.
//!
//! Method, from fast to slow:
//! 1. Successive points of a yarn mostly lie in one triangle or in the next. A walk goes along them;
//!    where triangles hold few points, several take turns (`walks`).
//! 2. A point farther away is found by a visibility walk over neighbours (Devillers, Pion and
//!    Teillaud 2002, "Walking in a triangulation"), from a triangle near it (`starts`).
//! 3. Where the walk cannot decide, a coarse grid tells whether the point is off the panel or near
//!    its border (`outline`). Near the border, a BVH over the triangles there gives all candidates
//!    (`bvh`).
//! 4. A BVH over all triangles serves panels that overlap themselves or have no outline, points on
//!    inner corners, and walks that are lost.
//!
//! Cost: 5 to 13 ns a point, on a machine where Embree's packets of rays take 23 to 35 ns
//! (`benches/against_peers.sh`); more where a triangle holds few points. Before the first point
//! some 0.1 µs a triangle, half of it for the order of triangles in memory, once a garment.

mod bvh;
pub mod covered;
pub mod orient2d;
mod outline;
pub mod overlap;
mod starts;
mod topology;
mod trace;
mod triangle;
mod walks;

use std::sync::OnceLock;

use glam::{DVec2, DVec3};
use obvhs::bvh2::Bvh2;

use crate::garment::Panel;
use crate::ids::FaceId;
use crate::number::double;
use bvh::{outer_box, tree, visit_boxes};
use orient2d::crosses;
use outline::{BorderSide, Outline};
use starts::Starts;
use topology::{BORDER, Topology, edge};
pub use trace::Traced;
use triangle::{BarycentricTriangle, Containment};

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

    /// Interpolates values of the three corners.
    #[must_use]
    pub fn blend(&self, corners: [DVec3; 3]) -> DVec3 {
        let [a, b, c] = self.weights();
        corners[0] * a + corners[1] * b + corners[2] * c
    }
}

/// A panel prepared for point location.
pub struct Locator<'a> {
    panel: &'a Panel,
    /// All triangles of the panel, prepared for tests.
    triangles: Vec<BarycentricTriangle>,
    /// Side of a square with the bounding box's area per triangle, mm.
    side: f64,
    /// Whether the panel is certain to cover no point twice, so that a walk may replace a search.
    embedded: bool,
    /// Steps after which a walk gives up.
    max_steps: usize,
    /// Where walks to places far away start.
    starts: Starts,
    /// `None` for a panel that overlaps itself or has too long a border.
    outline: Option<Outline>,
    /// A tree over the triangles near the border of a panel with an outline, and their indices.
    fringe: Option<(Bvh2, Vec<u32>)>,
    /// A tree over all triangles. Made on first use for a panel with an outline, which rarely needs
    /// it.
    bvh: OnceLock<Option<Bvh2>>,
    /// A tree over [`Panel::flipped`].
    flipped: Option<Bvh2>,
}

/// How a walk ended.
enum Walk {
    /// Strictly inside this triangle, or on an edge that it shares with a neighbour that comes
    /// later in the file.
    Found(u32),
    /// The walk cannot decide: it ended on a corner or on a border edge, off the panel, or too far
    /// away.
    Unknown,
}

impl<'a> Locator<'a> {
    /// Prepares a panel for walks and searches. Cost: about 0.1 µs a triangle.
    #[must_use]
    pub fn new(panel: &'a Panel) -> Self {
        let Topology { neighbours, embedded } = Topology::new(&panel.uv, &panel.triangles);
        let size = panel.size();
        let triangles: Vec<_> = (panel.triangles.iter().zip(neighbours))
            .map(|(corners, neighbours)| {
                let corners = corners.map(|v| panel.uv[v as usize]);
                BarycentricTriangle::new(corners, neighbours, size)
            })
            .collect();
        // A straight line through n even triangles passes about 2 sqrt(n) of them. Twice that and
        // some more is enough to cross a panel. A visibility walk may circle for ever in a
        // triangulation that is not Delaunay (Devillers, Pion and Teillaud 2002); the limit ends
        // it.
        let max_steps = 32 + 4 * triangles.len().isqrt();
        let outline = if embedded { outline_of(panel, &triangles) } else { None };
        let fringe = outline.as_ref().and_then(|outline| fringe_of(panel, outline));
        let bvh = if outline.is_some() {
            OnceLock::new()
        } else {
            OnceLock::from(boxes_bvh(&panel.uv, &panel.triangles))
        };
        Self {
            panel,
            side: (size.x * size.y / double(triangles.len())).sqrt(),
            triangles,
            embedded,
            max_steps,
            starts: Starts::new(panel.bounds(), &panel.uv, &panel.triangles),
            outline,
            fringe,
            bvh,
            flipped: boxes_bvh(&panel.uv, &panel.flipped),
        }
    }

    /// Locates each point, in order. Neighbouring points should follow each other, as those of a
    /// yarn do.
    ///
    /// ```
    /// use warpknit_core::garment::Garment;
    /// use warpknit_core::locate::Locator;
    /// use glam::DVec3;
    /// let garment = Garment::rectangle(10.0, 10.0);
    /// let points = [DVec3::new(2.0, 1.0, 0.0), DVec3::new(11.0, 1.0, 0.0)];
    /// let located = Locator::new(&garment.panels[0]).locate(&points);
    /// assert!(located[0].is_some() && located[1].is_none());
    /// ```
    #[must_use]
    pub fn locate(&self, points: &[DVec3]) -> Vec<Option<SurfacePoint>> {
        let mut located = Vec::new();
        self.locate_into(points, &mut located);
        located
    }

    /// [`Self::locate`] into memory that exists already. Earlier values in `located` are replaced.
    pub fn locate_into(&self, points: &[DVec3], located: &mut Vec<Option<SurfacePoint>>) {
        located.resize(points.len(), None);
        if self.embedded {
            return self.walk_along(points, located);
        }
        // What lies inside a triangle is certain only if no other triangle covers it.
        for (point, located) in points.iter().zip(located) {
            let p = point.truncate();
            *located = self.search(p).map(|found| self.point(found, p));
        }
    }

    /// Locates one point. `hint` is any triangle, at best one nearby.
    #[must_use]
    pub fn at(&self, p: DVec2, hint: u32) -> Option<SurfacePoint> {
        let mut triangle = hint;
        self.find(p, &mut triangle).map(|found| self.point(found, p))
    }

    /// The triangle that holds `p`. The walk starts from `triangle`, and leaves in it a good start
    /// for a point nearby.
    fn find(&self, p: DVec2, triangle: &mut u32) -> Option<u32> {
        if !self.embedded {
            return self.search(p);
        }
        if let Walk::Found(found) = self.walk(p, triangle) {
            return Some(found);
        }
        match self.outline.as_ref().map(|outline| outline.side(p)) {
            Some(BorderSide::Off) => None,
            Some(BorderSide::Border) => self.search_fringe(p),
            _ => {
                *triangle = self.starts.near(p);
                if let Walk::Found(found) = self.walk(p, triangle) {
                    return Some(found);
                }
                self.search(p)
            }
        }
    }

    /// A point on the panel is at least so far from the border, mm; 0 near the border.
    #[inline]
    #[must_use]
    pub fn room(&self, p: DVec2) -> f64 {
        self.outline.as_ref().map_or(0.0, |outline| outline.room(p))
    }

    /// Whether the straight path from a point on the panel is too short to reach the border.
    /// `false` near the border, whatever the path.
    #[inline]
    #[must_use]
    pub fn stays_inside(&self, from: DVec2, to: DVec2) -> bool {
        let room = self.room(from);
        from.distance_squared(to) < room * room
    }

    /// The border's edges by their vertices, with the panel to their left, and their triangles.
    pub(crate) fn border(&self) -> impl Iterator<Item = ([u32; 2], u32)> {
        border_of(self.panel, &self.triangles)
    }

    /// Whether `p` lies in a triangle with the opposite orientation of its panel, where nothing can
    /// be knitted.
    #[must_use]
    pub fn is_defect(&self, p: DVec2) -> bool {
        let Panel { uv, flipped, .. } = self.panel;
        let Some(bvh) = &self.flipped else { return false };
        let mut found = false;
        for_candidates(bvh, p, |triangle| {
            found |= holds(crosses_of(uv, flipped[triangle as usize], p));
        });
        found
    }

    /// The visibility walk: from triangle to triangle towards `p`, each time through the edge
    /// beyond which it lies farthest (in barycentric coordinates).
    fn walk(&self, p: DVec2, triangle: &mut u32) -> Walk {
        for _ in 0..self.max_steps {
            let current = &self.triangles[*triangle as usize];
            let out = match current.containment(p) {
                Containment::Inside => return Walk::Found(*triangle),
                Containment::Beyond(edge) => edge,
                Containment::Uncertain => match self.beyond(*triangle, p) {
                    Ok(edge) => edge,
                    Err(walk) => return walk,
                },
            };
            // At the border the point may still lie on the panel, round a notch or across a hole.
            // Only a search can tell.
            if current.neighbours[out] == BORDER {
                return Walk::Unknown;
            }
            *triangle = current.neighbours[out];
        }
        Walk::Unknown
    }

    /// By exact predicates: the edge beyond which `p` lies, or how the walk ends on this triangle.
    /// Rarely called, and kept out of the walk's loop so that its code stays small.
    #[cold]
    fn beyond(&self, triangle: u32, p: DVec2) -> Result<usize, Walk> {
        let t = self.crosses_of(triangle, p);
        if let Some(out) = (0..3).find(|&i| t[i] < 0.0) {
            return Ok(out);
        }
        let neighbours = self.triangles[triangle as usize].neighbours;
        Err(match t.map(|t| t == 0.0) {
            [false, false, false] if t.iter().all(|&t| t > 0.0) => Walk::Found(triangle),
            // On one inner edge: only its two triangles hold the point.
            [true, false, false] => self.first_of(triangle, neighbours[0]),
            [false, true, false] => self.first_of(triangle, neighbours[1]),
            [false, false, true] => self.first_of(triangle, neighbours[2]),
            // On a corner: any number of triangles may hold it.
            _ => Walk::Unknown,
        })
    }

    /// Of two triangles that hold a point, the one that comes first in the file.
    fn first_of(&self, triangle: u32, neighbour: u32) -> Walk {
        let triangle_first = neighbour == BORDER || self.face(triangle) < self.face(neighbour);
        Walk::Found(if triangle_first { triangle } else { neighbour })
    }

    /// Searches all triangles for those that hold `p`, and gives the first in the file.
    fn search(&self, p: DVec2) -> Option<u32> {
        let Panel { uv, triangles, .. } = self.panel;
        let bvh = self.bvh.get_or_init(|| apart(|| boxes_bvh(uv, triangles))).as_ref()?;
        self.first_candidate(bvh, p, |triangle| triangle)
    }

    /// The same for a place in a cell of the outline that the border passes.
    fn search_fringe(&self, p: DVec2) -> Option<u32> {
        let (bvh, indices) = self.fringe.as_ref()?;
        self.first_candidate(bvh, p, |number| indices[number as usize])
    }

    /// Of the triangles in a tree that hold `p`, the first in the file.
    fn first_candidate(
        &self,
        bvh: &Bvh2,
        p: DVec2,
        triangle_of: impl Fn(u32) -> u32,
    ) -> Option<u32> {
        let mut first: Option<u32> = None;
        for_candidates(bvh, p, |candidate| {
            let triangle = triangle_of(candidate);
            if first.is_none_or(|first| self.face(triangle) < self.face(first))
                && holds(self.crosses_of(triangle, p))
            {
                first = Some(triangle);
            }
        });
        first
    }

    /// `p` as a point of a triangle. In a triangle too thin for gradients its weights come from the
    /// cross products.
    fn point(&self, triangle: u32, p: DVec2) -> SurfacePoint {
        let prepared = &self.triangles[triangle as usize];
        if prepared.is_sure() {
            return prepared.point(triangle, p);
        }
        let [ab, bc, ca] = self.crosses_of(triangle, p);
        let area = ab + bc + ca;
        SurfacePoint { triangle, b: ca / area, c: ab / area }
    }

    /// The place of a triangle in the file.
    fn face(&self, triangle: u32) -> FaceId {
        self.panel.faces[triangle as usize]
    }

    fn crosses_of(&self, triangle: u32, p: DVec2) -> [f64; 3] {
        crosses_of(&self.panel.uv, self.panel.triangles[triangle as usize], p)
    }
}

/// The paper's rule, edges and corners included: no two of the products have opposite signs.
/// Triangles of a panel are counter-clockwise, flipped ones clockwise, so both signs occur.
#[inline]
fn holds(t: [f64; 3]) -> bool {
    t[0] >= 0.0 && t[1] >= 0.0 && t[2] >= 0.0 || t[0] <= 0.0 && t[1] <= 0.0 && t[2] <= 0.0
}

#[inline]
fn crosses_of(uv: &[DVec2], [a, b, c]: [u32; 3], p: DVec2) -> [f64; 3] {
    crosses(p, uv[a as usize], uv[b as usize], uv[c as usize])
}

/// The border's edges by their vertices, with the panel to their left, and their triangles.
fn border_of(
    panel: &Panel,
    triangles: &[BarycentricTriangle],
) -> impl Iterator<Item = ([u32; 2], u32)> {
    let all = (0..).zip(&panel.triangles).zip(triangles);
    all.flat_map(|((triangle, &corners), BarycentricTriangle { neighbours, .. })| {
        let border = (0..3).filter(|&i| neighbours[i] == BORDER);
        border.map(move |i| (edge(corners, i).into(), triangle))
    })
}

/// The outline of a panel that covers no place twice, if it has one.
fn outline_of(panel: &Panel, triangles: &[BarycentricTriangle]) -> Option<Outline> {
    let place = |vertex: u32| panel.uv[vertex as usize];
    let border: Vec<_> = border_of(panel, triangles).map(|(edge, _)| edge.map(place)).collect();
    Outline::new(panel.bounds(), triangles.len(), &border)
}

/// The tree over the triangles that may hold a place in a cell that the border passes, and their
/// indices.
fn fringe_of(panel: &Panel, outline: &Outline) -> Option<(Bvh2, Vec<u32>)> {
    let Panel { uv, triangles, .. } = panel;
    let is_near = |corners: &[u32; 3]| outline.may_reach_border(corners.map(|v| uv[v as usize]));
    let near = (0..).zip(triangles).filter(|(_, corners)| is_near(corners));
    let (indices, corners): (Vec<u32>, Vec<_>) = near.unzip();
    boxes_bvh(uv, &corners).map(|bvh| (bvh, indices))
}

/// Does work on a thread of its own, and all of it there.
///
/// The builder of trees works on all threads of a pool. One that waits for the others may begin
/// another piece of work, here one that needs the tree that it is building: it would wait for itself.
fn apart<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    match rayon::ThreadPoolBuilder::new().num_threads(1).build() {
        // A thread of another pool would take up its work while it waits for `install`.
        Ok(pool) => std::thread::scope(|scope| {
            scope.spawn(|| pool.install(work)).join().expect("the work doesn't panic")
        }),
        // The system gives no thread; so there are no others to wait for either.
        Err(_) => work(),
    }
}

/// The BVH over triangles, or none if there are no triangles.
fn boxes_bvh(uv: &[DVec2], triangles: &[[u32; 3]]) -> Option<Bvh2> {
    let boxes: Vec<_> =
        triangles.iter().map(|t| outer_box(t.iter().map(|&v| uv[v as usize]))).collect();
    (!boxes.is_empty()).then(|| tree(&boxes))
}

/// Calls `visit` for every triangle whose box holds `p`.
fn for_candidates(bvh: &Bvh2, p: DVec2, visit: impl FnMut(u32)) {
    visit_boxes(bvh, outer_box(std::iter::once(p)), visit);
}
