//! Step 3, the woven hypothesis: a matrix of warp and weft on a lattice of crossings.
//!
//! In: a [`FitTarget`]. Out: [`LayoutFit`]s, two for each likely matrix: its floats alone, and its
//! floats with the stretches below others that gaps of loose cloth show.
//!
//! Method: exhaustive enumeration. The lattice of crossings is a finer one that has the cell's
//! lattice as a sublattice of index 2 to 8, and is nearly square. All matrices of up to four
//! crossings are tried. For larger ones a structure tensor (Bigün and Granlund 1987, *Optimal
//! orientation detection of linear symmetry*) says which yarn is on top at each crossing. All
//! weaves are rendered, and the few that correlate best with the cell are refined.
//!
//! Not promised: weaves of more than eight crossings a cell, and yarns that cross far from a right
//! angle.

use glam::{DMat2, DVec2};
use rayon::prelude::*;

use super::fit::{Hypothesis, LayoutFit, refine};
use super::lattice::{Lattice, hermite_forms};
use super::relief::rendered;
use super::segment::Segment;
use super::steps;
use super::target::FitTarget;
use super::visibility::{MIN_VISIBLE_GAP, visible_parts};
use crate::plane::double;

/// Positions along each yarn where the first crossing is tried: a refinement moves a segment by
/// more than half of an eighth, so that finer steps would find the same.
const OFFSETS: usize = 8;
/// Widths of yarns that are tried, as shares of their spacing. Deep holes look alike for a weave
/// whose holes lie elsewhere; a second width tells them apart.
const WIDTHS: [f64; 2] = [0.72, 0.88];
/// Lightness of a yarn where it lies below others, as a share of that of its floats.
const BELOW_LIGHT: f64 = 0.5;
/// Number of crossings in a cell up to which all matrices are tried: 2 to the power of it.
const MAX_ENUMERATED: usize = 4;
/// The largest number of crossings in a cell.
const MAX_INDEX: u8 = 8;
/// Weaves that are refined.
const MAX_REFINED: usize = 4;
/// Iterations of a refinement.
const ITERATIONS: usize = 12;
/// Largest cosine of the angle between warp and weft.
const MAX_COSINE: f64 = 0.3;
/// Largest ratio of the spacings of warp and weft.
const MAX_ASPECT: f64 = 2.5;

/// A layout that a weave may have.
struct Weave {
    /// The stretches of yarn that lie on top.
    floats: Vec<Segment>,
    /// For each float the stretch of its yarn below others up to the next float. Gaps of loose
    /// cloth show it.
    below: Vec<Segment>,
}

/// A crossing, in counts of weft and warp steps.
type Crossing = [i32; 2];

/// The likeliest weaves, refined with and without their stretches below others. Those whose floats
/// are not plausible are left out.
pub(super) fn fits(
    target: &FitTarget,
    ground: f64,
    top: f64,
) -> impl ParallelIterator<Item = LayoutFit> {
    let mut weaves = candidates(target, ground, top);
    weaves.truncate(MAX_REFINED);
    weaves.into_par_iter().flat_map_iter(move |Weave { floats, below }| {
        let dense = refine(target, Hypothesis::Woven, &floats, ground, ITERATIONS);
        let loose = dense.refit(target, &[&dense.segments[..], &below].concat(), ITERATIONS);
        [dense, loose].into_iter().filter(move |fit| is_weave(fit, floats.len(), &target.lattice))
    })
}

/// Whether the first segments of a fit, the floats, are visible and longer than wide. Without this
/// test nearly any cell could be explained by wide yarns on top of others.
fn is_weave(fit: &LayoutFit, floats: usize, lattice: &Lattice) -> bool {
    let visible = visible_parts(&fit.segments, lattice, MIN_VISIBLE_GAP);
    fit.segments[..floats].iter().enumerate().all(|(number, float)| {
        float.length > float.width && visible.iter().any(|(source, _)| *source == number)
    })
}

/// Weaves that the cell may show, the likeliest first.
fn candidates(target: &FitTarget, ground: f64, top: f64) -> Vec<Weave> {
    let tensor = StructureTensor::new(target);
    let grids: Vec<Crossings> = (2..=MAX_INDEX)
        .flat_map(|index| hermite_forms(index.into()).map(move |form| (index.into(), form)))
        .filter_map(|(index, form)| Crossings::new(&target.lattice, index, form))
        .collect();
    let mut found: Vec<(f64, Weave)> = grids
        .into_par_iter()
        .flat_map_iter(|grid| {
            let tensor = &tensor;
            (0..OFFSETS * OFFSETS)
                .flat_map(move |number| grid.weaves(number, tensor, target, top - ground))
        })
        .collect();
    found.sort_by(|p, q| p.0.total_cmp(&q.0));
    found.into_iter().map(|(_, weave)| weave).collect()
}

/// The structure tensor of each sample point before it is averaged: the outer product of the
/// gradient, as xx, xy and yy, in pixels.
struct StructureTensor(Vec<[f64; 3]>);

impl StructureTensor {
    fn new(target: &FitTarget) -> Self {
        let [columns, rows] = target.size;
        // The grid runs along the cell's vectors. The inverse transpose turns differences on the
        // grid into a gradient in pixels, which is a covector.
        let to_pixels =
            DMat2::from_cols(target.lattice.a / double(columns), target.lattice.b / double(rows))
                .inverse()
                .transpose();
        let light = |x: usize, y: usize| target.light[(y % rows) * columns + x % columns];
        Self(
            (0..columns * rows)
                .map(|at| {
                    let (x, y) = (at % columns + columns, at / columns + rows);
                    let differences = DVec2::new(
                        light(x + 1, y) - light(x - 1, y),
                        light(x, y + 1) - light(x, y - 1),
                    ) * 0.5;
                    let g = to_pixels * differences;
                    [g.x * g.x, g.x * g.y, g.y * g.y]
                })
                .collect(),
        )
    }

    /// Mean squared derivative along `direction` around a place, in a Gaussian window.
    fn along(&self, target: &FitTarget, place: DVec2, radius: f64, direction: DVec2) -> f64 {
        let direction = direction.normalize();
        let mut sum = 0.0;
        for (other, [xx, xy, yy]) in target.samples.points.iter().zip(&self.0) {
            let near = target.lattice.nearest(*other - place);
            let weight = (-0.5 * near.length_squared() / (radius * radius)).exp();
            sum += weight
                * (xx * direction.x * direction.x
                    + 2.0 * xy * direction.x * direction.y
                    + yy * direction.y * direction.y);
        }
        sum
    }
}

/// The lattice on which yarns cross. The cell's lattice is a sublattice of it.
struct Crossings {
    /// From a crossing to the next one along a weft yarn.
    weft: DVec2,
    /// From a crossing to the next one along a warp yarn.
    warp: DVec2,
    /// Crossings in a cell.
    index: usize,
    /// Counts of weft and warp steps to counts of the cell's vectors.
    to_cell: DMat2,
}

impl Crossings {
    /// The lattice whose sublattice by a Hermite normal form is the cell's; `None` where it is far
    /// from square.
    fn new(cell: &Lattice, index: usize, [p, q, r]: [i32; 3]) -> Option<Self> {
        let finer = cell.matrix()
            * DMat2::from_cols(
                DVec2::new(f64::from(p), 0.0),
                DVec2::new(f64::from(q), f64::from(r)),
            )
            .inverse();
        let reduced = Lattice::reduced(finer.x_axis, finer.y_axis);
        let cosine = reduced.a.dot(reduced.b).abs() / (reduced.a.length() * reduced.b.length());
        if cosine > MAX_COSINE || reduced.longer() > MAX_ASPECT * reduced.shorter() {
            return None;
        }
        Some(Self {
            weft: reduced.a,
            warp: reduced.b,
            index,
            to_cell: cell.matrix().inverse() * reduced.matrix(),
        })
    }

    /// Weaves whose first crossing is at one of the offsets, and what each leaves unexplained.
    fn weaves(
        &self,
        offset: usize,
        tensor: &StructureTensor,
        target: &FitTarget,
        top: f64,
    ) -> Vec<(f64, Weave)> {
        let share = |part: usize| double(part) / double(OFFSETS);
        let origin = self.weft * share(offset % OFFSETS) + self.warp * share(offset / OFFSETS);
        let mut weaves = Vec::new();
        for matrix in self.matrices(origin, tensor, target) {
            for width in WIDTHS {
                if let Some(weave) = self.weave(origin, &matrix, width, top) {
                    let model = rendered(&weave.floats, 0.0, &target.lattice, &target.samples);
                    weaves.push((target.residual_scaled(&model), weave));
                }
            }
        }
        weaves
    }

    /// One crossing for each of the cell.
    fn crossings(&self) -> Vec<Crossing> {
        let mut crossings: Vec<Crossing> = Vec::with_capacity(self.index);
        let reach = steps(double(self.index));
        for j in 0..reach {
            for i in 0..reach {
                if crossings.len() < self.index
                    && !crossings.iter().any(|&other| self.is_same(other, [i, j]))
                {
                    crossings.push([i, j]);
                }
            }
        }
        crossings
    }

    /// Whether two crossings are copies of each other.
    fn is_same(&self, [i, j]: Crossing, [k, l]: Crossing) -> bool {
        let offset = self.to_cell * DVec2::new(f64::from(k - i), f64::from(l - j));
        (offset - offset.round()).abs().max_element() < 1e-6
    }

    fn at(&self, [i, j]: Crossing) -> DVec2 {
        self.weft * f64::from(i) + self.warp * f64::from(j)
    }

    /// Matrices that the weave may have, each as its crossings with whether the warp is on top: all
    /// of small ones, else the one that the structure tensor says.
    fn matrices(
        &self,
        origin: DVec2,
        tensor: &StructureTensor,
        target: &FitTarget,
    ) -> Vec<Vec<(Crossing, bool)>> {
        if self.index > MAX_ENUMERATED {
            return vec![self.matrix_from_tensor(origin, tensor, target)];
        }
        let crossings = self.crossings();
        // All bit patterns but the two without any warp or without any weft on top.
        (1..(1 << self.index) - 1)
            .map(|bits: u32| {
                crossings
                    .iter()
                    .enumerate()
                    .map(|(n, crossing)| (*crossing, bits >> n & 1 == 1))
                    .collect()
            })
            .collect()
    }

    /// The matrix whose warp is on top where the picture changes more across the warp than across
    /// the weft: the edges of a yarn run along it.
    fn matrix_from_tensor(
        &self,
        origin: DVec2,
        tensor: &StructureTensor,
        target: &FitTarget,
    ) -> Vec<(Crossing, bool)> {
        // A quarter of the spacing: a wider window would reach the edges of the next crossing.
        let radius = 0.28 * self.weft.length().min(self.warp.length());
        self.crossings()
            .into_iter()
            .map(|crossing| {
                let place = origin + self.at(crossing);
                let is_warp_up = tensor.along(target, place, radius, self.warp.perp())
                    > tensor.along(target, place, radius, self.weft.perp());
                (crossing, is_warp_up)
            })
            .collect()
    }

    /// The floats of a matrix, `width` of their spacing wide and lighter than the ground by `top`,
    /// and the stretches below others. `None` if a yarn never goes down, or warp or weft never
    /// comes up.
    fn weave(
        &self,
        origin: DVec2,
        matrix: &[(Crossing, bool)],
        width: f64,
        top: f64,
    ) -> Option<Weave> {
        let (mut floats, mut below) = (Vec::new(), Vec::new());
        for system in [self.warp_yarns(), self.weft_yarns()] {
            let width = width
                * system.across.length()
                * (system.across.normalize().perp_dot(system.along.normalize())).abs();
            let stretch = |crossing: Crossing, [first, end]: [i32; 2], top: f64| {
                let centre =
                    origin + self.at(crossing) + system.along * (0.5 * f64::from(first + end - 1));
                // A quarter of a step longer than its crossings: a yarn goes down between two.
                let length = system.along.length() * (f64::from(end - first) + 0.25);
                Segment::straight(centre, system.along.to_angle(), width, length, top)
            };
            for &(crossing, _) in matrix {
                // A float begins where its yarn comes up.
                let begins = self.is_above(matrix, &system, crossing, 0)
                    && !self.is_above(matrix, &system, crossing, -1);
                if !begins {
                    continue;
                }
                let down = (1..=8).find(|n| !self.is_above(matrix, &system, crossing, *n))?;
                let up =
                    (down + 1..=down + 8).find(|n| self.is_above(matrix, &system, crossing, *n))?;
                floats.push(Segment { sag: 0.35 * top, ..stretch(crossing, [0, down], top) });
                below
                    .push(Segment { sag: 0.0, ..stretch(crossing, [down, up], BELOW_LIGHT * top) });
            }
        }
        let [warps, wefts] = [true, false].map(|above| matrix.iter().any(|(_, up)| *up == above));
        (warps && wefts && floats.len() >= 2).then_some(Weave { floats, below })
    }

    fn warp_yarns(&self) -> YarnSystem {
        YarnSystem { step: [0, 1], along: self.warp, across: self.weft, is_warp: true }
    }

    fn weft_yarns(&self) -> YarnSystem {
        YarnSystem { step: [1, 0], along: self.weft, across: self.warp, is_warp: false }
    }

    /// Whether a yarn is on top at the crossing that is `n` steps along it from another one.
    fn is_above(
        &self,
        matrix: &[(Crossing, bool)],
        system: &YarnSystem,
        crossing: Crossing,
        n: i32,
    ) -> bool {
        let [i, j] = crossing;
        let there = [i + n * system.step[0], j + n * system.step[1]];
        let entry = matrix.iter().find(|(other, _)| self.is_same(*other, there));
        entry.is_some_and(|(_, is_warp_up)| *is_warp_up) == system.is_warp
    }
}

/// The yarns of warp or of weft.
struct YarnSystem {
    /// From a crossing to the next one along such a yarn, in counts.
    step: Crossing,
    /// The same in pixels.
    along: DVec2,
    /// From such a yarn to the next one, pixels.
    across: DVec2,
    is_warp: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_yarn_goes_on_below_from_float_to_float() {
        // A twill: the warp over two of three.
        let cell = Lattice { a: DVec2::new(30.0, 0.0), b: DVec2::new(10.0, 10.0) };
        let grid = Crossings {
            weft: DVec2::X * 10.0,
            warp: DVec2::Y * 10.0,
            index: 3,
            to_cell: cell.matrix().inverse() * 10.0,
        };
        let ups: Vec<([i32; 2], bool)> = grid
            .crossings()
            .into_iter()
            .map(|at| (at, (at[0] - at[1]).rem_euclid(3) < 2))
            .collect();
        let weave = grid.weave(DVec2::ZERO, &ups, 0.8, 1.0).unwrap();
        let counts = |segments: &[Segment], angle: f64| -> Vec<f64> {
            segments
                .iter()
                .filter(|s| (s.angle - angle).abs() < 0.1)
                .map(|s| (s.length / 10.0).floor())
                .collect()
        };
        let (warp, weft) = (DVec2::Y.to_angle(), 0.0);
        assert_eq!([counts(&weave.floats, warp), counts(&weave.below, warp)], [[2.0], [1.0]]);
        assert_eq!([counts(&weave.floats, weft), counts(&weave.below, weft)], [[1.0], [2.0]]);
        for (float, below) in weave.floats.iter().zip(&weave.below) {
            assert!(
                float.centre.distance(below.centre) == 15.0 && below.top < float.top,
                "{float:?} {below:?}"
            );
        }
    }
}
