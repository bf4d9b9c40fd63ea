//! Step 3, the woven hypothesis: a matrix of warp and weft on a lattice of crossings.
//!
//! In: a [`Target`]. Out: [`Fit`]s, two a matrix: floats alone, and with what gaps of loose cloth
//! show. The crossings' lattice has the cell's as a part of index 2 to 8, and goes nearly squarely
//! along both yarns. Of small matrices all are tried; of larger ones the one whose yarns run as the
//! picture does at each crossing.

use glam::{DMat2, DVec2};
use rayon::prelude::*;

use super::fit::{Fit, Hypothesis, refine};
use super::lattice::{Lattice, hermite};
use super::segment::{Segment, drawn};
use super::steps;
use super::target::Target;
use super::visibility::{LEAST_GAP, trimmed};
use crate::plane::double;

/// Places along each yarn where the first crossing is tried, and how wide yarns are tried, as
/// shares of their distance: where holes are deep, they tell nothing of a weave whose holes lie
/// beside them.
const OFFSETS: usize = 8;
const WIDTHS: [f64; 2] = [0.72, 0.88];
/// How light a yarn is where it lies below others, as a share of how light its floats are.
const SUNKEN: f64 = 0.5;
/// Crossings of a cell up to which all matrices are tried.
const TRIED: usize = 4;
/// Weaves that are refined.
const REFINED: usize = 4;

/// A layout that a weave may have.
struct Weave {
    /// What lies above.
    floats: Vec<Segment>,
    /// After each of them its yarn up to the next float, which gaps of loose cloth show.
    sunken: Vec<Segment>,
}

/// The likeliest weaves that the cell may be, refined, each dense and loose; without those whose
/// floats are none.
pub(super) fn fits(target: &Target, ground: f64, top: f64) -> impl ParallelIterator<Item = Fit> {
    let mut weaves = candidates(target, ground, top);
    weaves.truncate(REFINED);
    weaves.into_par_iter().flat_map_iter(move |Weave { floats, sunken }| {
        let dense = refine(target, Hypothesis::Woven, &floats, ground, 12);
        let loose = dense.with(target, &[&dense.segments[..], &sunken].concat(), 12);
        [dense, loose].into_iter().filter(move |fit| is_weave(fit, floats.len(), &target.lattice))
    })
}

/// Whether a weave's first segments, so many floats, are as floats are in cloth: seen, and longer
/// than wide. Whatever a cell shows, yarns above others can be made to look like it.
fn is_weave(fit: &Fit, floats: usize, lattice: &Lattice) -> bool {
    let seen = trimmed(&fit.segments, lattice, LEAST_GAP);
    let is_float = |(number, float): (usize, &Segment)| {
        float.length > float.width && seen.iter().any(|(of, _)| *of == number)
    };
    fit.segments[..floats].iter().enumerate().all(is_float)
}

/// Weaves that the cell may be, the likeliest first.
fn candidates(target: &Target, ground: f64, top: f64) -> Vec<Weave> {
    let tensor = Tensor::of(target);
    let grids: Vec<Crossings> = (2_u8..=8)
        .flat_map(|index| hermite(index.into()).map(move |form| (index.into(), form)))
        .filter_map(|(index, form)| Crossings::new(&target.lattice, index, form))
        .collect();
    let mut found: Vec<(f64, Weave)> = grids
        .into_par_iter()
        .flat_map_iter(|grid| {
            let tensor = &tensor;
            (0..OFFSETS * OFFSETS).flat_map(move |number| {
                let share = |part: usize| double(part) / double(OFFSETS);
                let origin =
                    grid.weft * share(number % OFFSETS) + grid.warp * share(number / OFFSETS);
                let matrices = grid.matrices(origin, tensor, target);
                let layouts = matrices.iter().flat_map(|ups| {
                    WIDTHS.map(|width| grid.weave(origin, ups, width, top - ground))
                });
                let left = |weave: &Weave| {
                    target.left_scaled(&drawn(&weave.floats, 0.0, &target.lattice, &target.places))
                };
                layouts.flatten().map(|weave| (left(&weave), weave)).collect::<Vec<_>>()
            })
        })
        .collect();
    found.sort_by(|p, q| p.0.total_cmp(&q.0));
    found.into_iter().map(|(_, weave)| weave).collect()
}

/// How much each place changes along which directions: the structure tensor in pixels.
struct Tensor(Vec<[f64; 3]>);

impl Tensor {
    fn of(target: &Target) -> Self {
        let [columns, rows] = target.size;
        let inverse =
            DMat2::from_cols(target.lattice.a / double(columns), target.lattice.b / double(rows))
                .inverse()
                .transpose();
        let light = |x: usize, y: usize| target.light[(y % rows) * columns + x % columns];
        let of = |at: usize| {
            let (x, y) = (at % columns + columns, at / columns + rows);
            let steps =
                DVec2::new(light(x + 1, y) - light(x - 1, y), light(x, y + 1) - light(x, y - 1))
                    * 0.5;
            let g = inverse * steps;
            [g.x * g.x, g.x * g.y, g.y * g.y]
        };
        Self((0..columns * rows).map(of).collect())
    }

    /// How much it changes along `way` around a place.
    fn along(&self, target: &Target, place: DVec2, radius: f64, way: DVec2) -> f64 {
        let way = way.normalize();
        let mut sum = 0.0;
        for (other, [xx, xy, yy]) in target.places.iter().zip(&self.0) {
            let near = target.lattice.nearest(*other - place);
            let weight = (-0.5 * near.length_squared() / (radius * radius)).exp();
            sum += weight * (xx * way.x * way.x + 2.0 * xy * way.x * way.y + yy * way.y * way.y);
        }
        sum
    }
}

/// Where yarns cross: a lattice of which the cell's is a part.
struct Crossings {
    /// From a crossing to the next along a weft yarn, and along a warp yarn.
    weft: DVec2,
    warp: DVec2,
    /// Crossings in a cell.
    index: usize,
    /// Counts of both to counts of the cell's vectors.
    to_cell: DMat2,
}

impl Crossings {
    fn new(cell: &Lattice, index: usize, [p, q, r]: [i32; 3]) -> Option<Self> {
        let finer = cell.matrix()
            * DMat2::from_cols(
                DVec2::new(f64::from(p), 0.0),
                DVec2::new(f64::from(q), f64::from(r)),
            )
            .inverse();
        let reduced = Lattice::reduced(finer.x_axis, finer.y_axis);
        let cosine = reduced.a.dot(reduced.b).abs() / (reduced.a.length() * reduced.b.length());
        if cosine > 0.3 || reduced.longer() > 2.5 * reduced.shorter() {
            return None;
        }
        Some(Self {
            weft: reduced.a,
            warp: reduced.b,
            index,
            to_cell: cell.matrix().inverse() * reduced.matrix(),
        })
    }

    /// One crossing for each of the cell: counts of weft and warp.
    fn crossings(&self) -> Vec<[i32; 2]> {
        let mut crossings: Vec<[i32; 2]> = Vec::with_capacity(self.index);
        let reach = steps(double(self.index));
        for j in 0..reach {
            for i in 0..reach {
                if crossings.len() < self.index
                    && !crossings.iter().any(|&other| self.same(other, [i, j]))
                {
                    crossings.push([i, j]);
                }
            }
        }
        crossings
    }

    fn same(&self, [i, j]: [i32; 2], [k, l]: [i32; 2]) -> bool {
        let off = self.to_cell * DVec2::new(f64::from(k - i), f64::from(l - j));
        (off - off.round()).abs().max_element() < 1e-6
    }

    fn at(&self, [i, j]: [i32; 2]) -> DVec2 {
        self.weft * f64::from(i) + self.warp * f64::from(j)
    }

    /// Matrices that may be the weave's: all of small ones, else the one that the picture's
    /// directions say.
    fn matrices(
        &self,
        origin: DVec2,
        tensor: &Tensor,
        target: &Target,
    ) -> Vec<Vec<([i32; 2], bool)>> {
        if self.index > TRIED {
            return vec![self.ups(origin, tensor, target)];
        }
        let crossings = self.crossings();
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

    /// Whether the warp is above at each crossing: the picture changes more across it than along
    /// it.
    fn ups(&self, origin: DVec2, tensor: &Tensor, target: &Target) -> Vec<([i32; 2], bool)> {
        let radius = 0.28 * self.weft.length().min(self.warp.length());
        let up = |crossing: [i32; 2]| {
            let place = origin + self.at(crossing);
            tensor.along(target, place, radius, self.warp.perp())
                > tensor.along(target, place, radius, self.weft.perp())
        };
        self.crossings().into_iter().map(|crossing| (crossing, up(crossing))).collect()
    }

    /// Both yarns, so wide and so much lighter than the ground, without those that never go down;
    /// nothing where one of both never comes up.
    fn weave(
        &self,
        origin: DVec2,
        ups: &[([i32; 2], bool)],
        width: f64,
        top: f64,
    ) -> Option<Weave> {
        let is_up = |crossing: [i32; 2]| {
            ups.iter().find(|(other, _)| self.same(*other, crossing)).is_some_and(|(_, up)| *up)
        };
        let (mut floats, mut sunken) = (Vec::new(), Vec::new());
        for (step, way, across, above) in
            [([0, 1], self.warp, self.weft, true), ([1, 0], self.weft, self.warp, false)]
        {
            let width =
                width * across.length() * (across.normalize().perp_dot(way.normalize())).abs();
            let is_above = |crossing: [i32; 2], n: i32| {
                is_up([crossing[0] + n * step[0], crossing[1] + n * step[1]]) == above
            };
            let stretch = |crossing: [i32; 2], [first, end]: [i32; 2], top: f64| {
                let centre = origin + self.at(crossing) + way * (0.5 * f64::from(first + end - 1));
                Segment::straight(
                    centre,
                    way.to_angle(),
                    width,
                    way.length() * (f64::from(end - first) + 0.25),
                    top,
                )
            };
            for &(crossing, _) in ups
                .iter()
                .filter(|(crossing, _)| is_above(*crossing, 0) && !is_above(*crossing, -1))
            {
                let down = (1..=8).find(|n| !is_above(crossing, *n))?;
                let up = (down + 1..=down + 8).find(|n| is_above(crossing, *n))?;
                floats.push(Segment { sag: 0.35 * top, ..stretch(crossing, [0, down], top) });
                sunken.push(Segment { sag: 0.0, ..stretch(crossing, [down, up], SUNKEN * top) });
            }
        }
        let [warps, wefts] = [true, false].map(|above| ups.iter().any(|(_, up)| *up == above));
        (warps && wefts && floats.len() >= 2).then_some(Weave { floats, sunken })
    }
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
        assert_eq!([counts(&weave.floats, warp), counts(&weave.sunken, warp)], [[2.0], [1.0]]);
        assert_eq!([counts(&weave.floats, weft), counts(&weave.sunken, weft)], [[1.0], [2.0]]);
        for (float, sunken) in weave.floats.iter().zip(&weave.sunken) {
            assert!(
                float.centre.distance(sunken.centre) == 15.0 && sunken.top < float.top,
                "{float:?} {sunken:?}"
            );
        }
    }
}
