//! The map of yarn that keeps its length: loops move within the cloth as it is strained.
//!
//! In: located points, the smooth surface of their panel, and the table of strained repeats. Out:
//! draped positions and normals.
//!
//! Method: Sperl, Narain and Wojtan 2021, "Mechanics-aware deformation of yarn pattern geometry". The
//! strain of the cloth at a point is that of the map that places it: the slope of the surface, and
//! at a depth what the turning of the normal adds to it. The table tells for this strain by how much
//! the point of the repeat moves within the cloth. So a fold of 4 mm, whose inner side is shorter,
//! needs no table of its own.
//!
//! Cost: some 60 ns a point over the smooth map.

use glam::DVec3;

use super::Draped;
use super::surface::{Slope, SmoothSurface, SurfaceFrame};
use crate::garment::Panel;
use crate::knit::strain::{Strain, StrainTable};
use crate::locate::SurfacePoint;

/// How many points lie where the cloth is strained too far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StrainCounts {
    /// All points.
    pub points: usize,
    /// Points where the strain lies beyond the table.
    pub outside: usize,
    /// Points where loops can't follow: the cloth is locked, and yarn would have to stretch.
    pub locked: usize,
}

impl std::ops::AddAssign for StrainCounts {
    fn add_assign(&mut self, other: Self) {
        self.points += other.points;
        self.outside += other.outside;
        self.locked += other.locked;
    }
}

/// Maps located points. `origins` are their points in the repeat.
pub(crate) fn map_relaxed(
    panel: &Panel,
    surface: &SmoothSurface,
    table: &StrainTable,
    flat: &[DVec3],
    located: &[SurfacePoint],
    origins: &[u32],
    draped: &mut Draped,
) -> StrainCounts {
    draped.positions.clear();
    draped.normals.clear();
    let mut counts = StrainCounts { points: flat.len(), ..StrainCounts::default() };
    let mut at = 0;
    for run in located.chunk_by(|one, next| one.triangle == next.triangle) {
        let patch = surface.patch(panel, run[0].triangle as usize);
        for point in run {
            let frame = patch.at(point.b, point.c);
            let depth = flat[at].z;
            let slope = slope_at(&frame, depth);
            let lookup = table.at(strain_of(&slope));
            let offset = lookup.offset(origins[at] as usize);
            counts.outside += usize::from(lookup.is_outside);
            counts.locked += usize::from(lookup.is_locked);
            draped.positions.push(
                frame.place
                    + slope[0] * offset.x
                    + slope[1] * offset.y
                    + frame.normal * (depth + offset.z),
            );
            draped.normals.push(frame.normal);
            at += 1;
        }
    }
    counts
}

/// The slope of the layer at a depth over the surface.
#[inline]
fn slope_at(frame: &SurfaceFrame, depth: f64) -> Slope {
    std::array::from_fn(|axis| frame.slope[axis] + frame.bend[axis] * depth)
}

/// The strain of cloth that is placed with this slope.
#[inline]
fn strain_of([u, v]: &Slope) -> Strain {
    let (courses, wales) = (u.length(), v.length());
    let shear = u.dot(*v) / (courses * wales);
    // A side of a fold that has no length has no direction.
    Strain { courses, wales, shear: if shear.is_finite() { shear } else { 0.0 } }
}

/// Strains of the cloth all over a panel, at both of its sides.
pub(crate) fn strains<'a>(
    panel: &'a Panel,
    surface: &'a SmoothSurface,
    depths: [f64; 2],
) -> impl Iterator<Item = Strain> + 'a {
    // Corners, middles of edges and of the three parts.
    const PLACES: [(f64, f64); 9] = [
        (0.0, 0.0),
        (1.0, 0.0),
        (0.0, 1.0),
        (0.5, 0.0),
        (0.0, 0.5),
        (0.5, 0.5),
        (1.0 / 3.0, 1.0 / 3.0),
        (0.15, 0.15),
        (0.7, 0.15),
    ];
    (0..panel.triangles.len()).flat_map(move |triangle| {
        let patch = surface.patch(panel, triangle);
        PLACES.into_iter().flat_map(move |(b, c)| {
            let frame = patch.at(b, c);
            depths.map(|depth| strain_of(&slope_at(&frame, depth)))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fabric::Fabric;
    use crate::garment::Garment;
    use crate::knit::Pattern;

    #[test]
    fn nothing_jumps_at_the_edge_of_two_triangles() {
        let fabric = Fabric::named("tricot").unwrap();
        let table = StrainTable::new(&fabric, &Pattern::new(&fabric)).unwrap();
        // Two triangles that share the edge from vertex 0 to 2, stretched unlike.
        let mut panel = Garment::rectangle(4.0, 3.0).panels.remove(0);
        panel.draped[1] += DVec3::new(0.5, -0.1, 0.6);
        panel.draped[3] += DVec3::new(0.1, 0.3, -0.4);
        let surface = SmoothSurface::new(&panel);
        let shared = [panel.triangles[0], panel.triangles[1]];
        let edge: Vec<_> = shared[0].into_iter().filter(|v| shared[1].contains(v)).collect();
        for share in [0.0, 0.2, 0.5, 0.9] {
            let sides = [0, 1].map(|triangle: u32| {
                let weight = |corner: usize| {
                    let vertex = shared[triangle as usize][corner];
                    if vertex == edge[0] {
                        1.0 - share
                    } else if vertex == edge[1] {
                        share
                    } else {
                        0.0
                    }
                };
                let at = SurfacePoint { triangle, b: weight(1), c: weight(2) };
                let flat = [DVec3::new(0.0, 0.0, 0.15)];
                let mut draped = Draped::default();
                map_relaxed(&panel, &surface, &table, &flat, &[at], &[3], &mut draped);
                draped.positions[0]
            });
            assert!(sides[0].distance(sides[1]) < 1e-9, "{share}: {sides:?}");
        }
    }
}
