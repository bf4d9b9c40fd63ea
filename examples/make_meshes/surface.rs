//! The surface of a body as a mesh.
//!
//! In: a [`Body`]. Out: vertices in cm and quadrilaterals, counter-clockwise from outside.
//!
//! Method: naive surface nets (Gibson 1998, "Constrained elastic surface nets"). Each cell of a grid
//! that the surface crosses has one vertex, the mean of its crossings with the cell's edges. Each edge
//! of the grid that it crosses has the quadrilateral of the four cells around.

use std::collections::{HashMap, HashSet};

use glam::{DVec3, IVec3};

use crate::body::Body;

/// Side of the grid's cells, cm.
const SPACING: f64 = 1.5;
/// Half the side of the grid, cells, around the origin.
const REACH: i32 = 70;
/// Grids that are tried, and the shift from one to the next, cells: powers of the plastic number's
/// inverse, which spread points evenly.
const GRIDS: u32 = 32;
const SHIFT: DVec3 = DVec3::new(0.819_17, 0.671_04, 0.549_70);

/// Vertices, and the corners of quadrilaterals.
pub(crate) struct Surface {
    pub(crate) vertices: Vec<DVec3>,
    pub(crate) quads: Vec<[u32; 4]>,
}

impl Surface {
    /// The surface on the first of some shifted grids on which it is closed. A cell that two sheets
    /// cross joins them.
    pub(crate) fn of(body: &Body) -> Self {
        let shifts = (1..=GRIDS).map(|grid| (f64::from(grid) * SHIFT).fract());
        let mut surfaces = shifts.map(|shift| Self::on(Grid(shift), body));
        surfaces.find(Self::is_closed).expect("one of the grids suits each of our bodies")
    }

    fn on(grid: Grid, body: &Body) -> Self {
        // Far from the surface the distance says how many cells can be left out.
        let near = |cell: IVec3| body.touch(grid.at(cell)).distance.abs() < 3.0 * SPACING;
        let range = || -REACH..REACH;
        let cells = range()
            .flat_map(|z| range().flat_map(move |y| range().map(move |x| IVec3::new(x, y, z))));
        let mut surface = Self { vertices: Vec::new(), quads: Vec::new() };
        let mut numbers = HashMap::new();
        let is_inside = |cell: IVec3| body.touch(grid.at(cell)).distance < 0.0;
        for cell in cells.filter(|cell| near(*cell)) {
            for (axis, across, up) in [
                (IVec3::X, IVec3::Y, IVec3::Z),
                (IVec3::Y, IVec3::Z, IVec3::X),
                (IVec3::Z, IVec3::X, IVec3::Y),
            ] {
                let (here, there) = (is_inside(cell), is_inside(cell + axis));
                if here == there {
                    continue;
                }
                let around = [cell, cell - across, cell - across - up, cell - up];
                let mut quad = around.map(|cell| {
                    *numbers.entry(cell).or_insert_with(|| {
                        surface.vertices.push(middle_of_crossings(grid, body, cell));
                        u32::try_from(surface.vertices.len() - 1).expect("some thousand vertices")
                    })
                });
                if !here {
                    quad.reverse();
                }
                surface.quads.push(quad);
            }
        }
        surface
    }
}

impl Surface {
    /// Whether each edge has one quadrilateral on either side.
    fn is_closed(&self) -> bool {
        let mut sides = HashSet::new();
        let edges = self.quads.iter().flat_map(|&[a, b, c, d]| [[a, b], [b, c], [c, d], [d, a]]);
        edges.clone().all(|edge| sides.insert(edge))
            && edges.clone().all(|[a, b]| sides.contains(&[b, a]))
    }
}

/// The mean of the points at which the surface crosses the edges of a cell.
fn middle_of_crossings(grid: Grid, body: &Body, cell: IVec3) -> DVec3 {
    let corners = [IVec3::ZERO, IVec3::X, IVec3::Y, IVec3::Z, IVec3::ONE - IVec3::X]
        .into_iter()
        .chain([IVec3::ONE - IVec3::Y, IVec3::ONE - IVec3::Z, IVec3::ONE]);
    let corners: Vec<(IVec3, f64)> =
        corners.map(|corner| (corner, body.touch(grid.at(cell + corner)).distance)).collect();
    let (mut sum, mut count) = (DVec3::ZERO, 0.0);
    for (one, here) in &corners {
        for (other, there) in &corners {
            let is_edge = (*other - *one).element_sum() == 1 && (*other - *one).min_element() == 0;
            if is_edge && (*here < 0.0) != (*there < 0.0) {
                sum += grid.at(cell + *one).lerp(grid.at(cell + *other), here / (here - there));
                count += 1.0;
            }
        }
    }
    sum / count
}

/// A grid, shifted by shares of a cell.
#[derive(Clone, Copy)]
struct Grid(DVec3);

impl Grid {
    /// The lowest corner of a cell, cm.
    fn at(self, cell: IVec3) -> DVec3 {
        (cell.as_dvec3() + self.0) * SPACING
    }
}
