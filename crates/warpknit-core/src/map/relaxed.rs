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
//! Cost: 40 ns a point over the smooth map, up to 75 where loops are as large as triangles and each
//! point has a strain of its own.

use std::array::from_fn;

use glam::DVec3;
use rayon::prelude::*;

use super::Draped;
use super::surface::{LaneVec, PatchPart, SmoothSurface, SurfaceFrames, part_of};
use crate::garment::Panel;
use crate::knit::strain::{Lookup, Strain, StrainTable};
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

/// Points that are mapped at a time. The same coordinate of four points lies side by side, so the
/// compiler computes two at a time (SSE2).
const LANES: usize = 4;

/// What yarn is mapped to: a panel whose cloth is strained.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StrainedPanel<'a> {
    pub(crate) panel: &'a Panel,
    pub(crate) surface: &'a SmoothSurface,
    pub(crate) table: &'a StrainTable,
}

impl StrainedPanel<'_> {
    /// Maps located points. `origin` tells of which point of the repeat each is a copy.
    pub(crate) fn map(
        &self,
        flat: &[DVec3],
        located: &[SurfacePoint],
        origin: impl Fn(usize) -> u32,
        draped: &mut Draped,
    ) -> StrainCounts {
        draped.positions.clear();
        draped.normals.clear();
        draped.is_overstrained.clear();
        let mut run = Run {
            table: self.table,
            lookup: None,
            counts: StrainCounts { points: flat.len(), ..StrainCounts::default() },
            draped,
        };
        let mut at = 0;
        for in_triangle in located.chunk_by(|one, next| one.triangle == next.triangle) {
            let patch = self.surface.patch(self.panel, in_triangle[0].triangle as usize);
            let part = |point: &SurfacePoint| part_of(point.b, point.c);
            for in_part in in_triangle.chunk_by(|one, next| part(one) == part(next)) {
                let surface = patch.part(part(&in_part[0]));
                let (groups, last) = in_part.as_chunks::<LANES>();
                for group in groups {
                    run.map(&surface, group, from_fn(|k| flat[at + k].z), |k| origin(at + k));
                    at += LANES;
                }
                // The same code with one lane, so a point has the same bits wherever it lies.
                for point in last {
                    run.map(&surface, &[*point], [flat[at].z], |_| origin(at));
                    at += 1;
                }
            }
        }
        run.counts
    }

    /// Strains of the cloth all over the panel, at both of its sides.
    pub(crate) fn strains(self) -> impl ParallelIterator<Item = Strain> {
        let depths = self.table.depths();
        (0..self.panel.triangles.len()).into_par_iter().flat_map_iter(move |triangle| {
            let patch = self.surface.patch(self.panel, triangle);
            let mut all = Vec::with_capacity(2 * PLACES.len());
            for (b, c) in PLACES {
                let frames = patch.part(part_of(b, c)).at([b; 2], [c; 2]);
                all.extend(strained(&frames, &depths).1);
            }
            all
        })
    }
}

/// A run of points that are being mapped.
struct Run<'a> {
    table: &'a StrainTable,
    /// The place in the table of the last point, near which the next one's is. None before the
    /// first: knots that nothing asks for are not solved.
    lookup: Option<Lookup<'a>>,
    counts: StrainCounts,
    draped: &'a mut Draped,
}

impl Run<'_> {
    /// Maps points of one part of a patch.
    #[inline]
    fn map<const N: usize>(
        &mut self,
        surface: &PatchPart<'_>,
        located: &[SurfacePoint; N],
        depths: [f64; N],
        origin: impl Fn(usize) -> u32,
    ) {
        let frames = surface.at::<N>(from_fn(|k| located[k].b), from_fn(|k| located[k].c));
        let (slopes, strains) = strained(&frames, &depths);
        let mut offsets = [[0.0; N]; 3];
        for (k, strain) in strains.into_iter().enumerate() {
            let lookup = self.lookup.get_or_insert_with(|| self.table.at(strain));
            lookup.move_to(self.table, strain);
            let (offset, is_locked) = lookup.offset_and_lock(origin(k) as usize);
            let is_outside = lookup.is_outside();
            self.counts.outside += usize::from(is_outside);
            self.counts.locked += usize::from(is_locked);
            self.draped.is_overstrained.push(is_outside || is_locked);
            (0..3).for_each(|axis| offsets[axis][k] = offset[axis]);
        }
        let positions = placed(&frames, &slopes, &depths, &offsets);
        self.draped.positions.extend(vectors(&positions));
        self.draped.normals.extend(vectors(&frames.normal));
    }
}

/// Places in a triangle where strain is looked at: corners, middles of edges, the middle, and about
/// half of the way from it to each corner.
const PLACES: [(f64, f64); 10] = [
    (0.0, 0.0),
    (1.0, 0.0),
    (0.0, 1.0),
    (0.5, 0.0),
    (0.0, 0.5),
    (0.5, 0.5),
    (1.0 / 3.0, 1.0 / 3.0),
    (0.15, 0.15),
    (0.7, 0.15),
    (0.15, 0.7),
];

/// Places at some depths over the surface, moved by offsets in the axes of the flat cloth.
#[inline]
fn placed<const N: usize>(
    frames: &SurfaceFrames<N>,
    [u, v]: &[LaneVec<N>; 2],
    depths: &[f64; N],
    offsets: &LaneVec<N>,
) -> LaneVec<N> {
    let [along, across, out] = offsets;
    from_fn(|axis| {
        from_fn(|k| {
            frames.place[axis][k]
                + u[axis][k] * along[k]
                + v[axis][k] * across[k]
                + frames.normal[axis][k] * (depths[k] + out[k])
        })
    })
}

/// The vectors of lanes, one after another.
#[inline]
fn vectors<const N: usize>(lanes: &LaneVec<N>) -> impl Iterator<Item = DVec3> {
    (0..N).map(|k| DVec3::new(lanes[0][k], lanes[1][k], lanes[2][k]))
}

/// The slopes of layers at some depths over the surface, and the strains of cloth placed with them.
#[inline]
fn strained<const N: usize>(
    frames: &SurfaceFrames<N>,
    depths: &[f64; N],
) -> ([LaneVec<N>; 2], [Strain; N]) {
    let slopes: [LaneVec<N>; 2] = from_fn(|way| {
        let (slope, bend) = (&frames.slope[way], &frames.bend[way]);
        from_fn(|axis| from_fn(|k| slope[axis][k] + bend[axis][k] * depths[k]))
    });
    let dot = |one: &LaneVec<N>, other: &LaneVec<N>| -> [f64; N] {
        from_fn(|k| one[0][k] * other[0][k] + one[1][k] * other[1][k] + one[2][k] * other[2][k])
    };
    let [u, v] = &slopes;
    let (courses, wales) = (dot(u, u).map(f64::sqrt), dot(v, v).map(f64::sqrt));
    let across = dot(u, v);
    let strains = from_fn(|k| {
        let shear = across[k] / (courses[k] * wales[k]);
        // A side of a fold that has no length has no direction.
        let shear = if shear.is_finite() { shear } else { 0.0 };
        Strain { courses: courses[k], wales: wales[k], shear }
    });
    (slopes, strains)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fabric::Fabric;
    use crate::garment::Garment;
    use crate::ids::index32;
    use crate::knit::Pattern;

    /// Gives a test two triangles that share the edge from vertex 0 to 2, stretched unlike.
    fn on_bent_cloth(test: impl FnOnce(StrainedPanel<'_>)) {
        let fabric = Fabric::named("tricot").unwrap();
        let table = StrainTable::new(&fabric, &Pattern::new(&fabric)).unwrap();
        let mut panel = Garment::rectangle(4.0, 3.0).panels.remove(0);
        panel.draped[1] += DVec3::new(0.5, -0.1, 0.6);
        panel.draped[3] += DVec3::new(0.1, 0.3, -0.4);
        let surface = SmoothSurface::new(&panel);
        test(StrainedPanel { panel: &panel, surface: &surface, table: &table });
    }

    #[test]
    fn a_point_has_the_same_bits_alone_and_among_others() {
        on_bent_cloth(|strained| {
            // Six points in one part of a triangle, of which four are mapped together.
            let shares = (0..6).map(|k| 0.3 + 0.05 * f64::from(k));
            let located: Vec<_> =
                shares.map(|b| SurfacePoint { triangle: 0, b, c: 0.65 - b / 2.0 }).collect();
            assert!(located.iter().all(|at| part_of(at.b, at.c) == 0));
            let flat: Vec<_> = (0..6).map(|k| DVec3::new(0.0, 0.0, 0.03 * f64::from(k))).collect();
            let (mut all, mut alone) = (Draped::default(), Draped::default());
            strained.map(&flat, &located, index32, &mut all);
            for k in 0..6 {
                let own = |_| index32(k);
                strained.map(&flat[k..=k], &located[k..=k], own, &mut alone);
                assert_eq!(alone.positions[0], all.positions[k], "{k}");
                assert_eq!(alone.normals[0], all.normals[k], "{k}");
            }
        });
    }

    #[test]
    fn nothing_jumps_at_the_edge_of_two_triangles() {
        on_bent_cloth(|strained| {
            let shared = [strained.panel.triangles[0], strained.panel.triangles[1]];
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
                    strained.map(&flat, &[at], |_| 3, &mut draped);
                    draped.positions[0]
                });
                assert!(sides[0].distance(sides[1]) < 1e-9, "{share}: {sides:?}");
            }
        });
    }
}
