//! What cloth hides and how thick it is: the yarns of a repeat as bodies.
//!
//! In: a fabric and its [`Pattern`]. Out: a [`Body`]: the share of the flat area that yarns hide,
//! seen from the front, and the distance from the lowest to the highest yarn surface. Paths are
//! sampled 12 times a span and drawn as capsules onto a grid of points, one repeat of it with
//! everything that reaches in from around. Cost: some 20 ms for a common repeat, a megabyte a dozen
//! stitches. The grid has [`FINENESS`] points along the shorter side of a stitch, which keeps the
//! share within .005; repeats of over [`MOST_POINTS`] points get a coarser grid, where straight
//! yarns may add another .005. Of repeats over 24 courses or 16 wales only that much is looked at.

use glam::{DVec2, DVec3, Vec3Swizzles};

use super::mesh::StructureMesh;
use super::{Knitted, Pattern};
use crate::fabric::Fabric;
use crate::ids::index32;
use crate::yarn::curve;

/// Grid points along the shorter of W and C.
const FINENESS: f64 = 256.0;
/// The most points of a grid: 4 MB.
const MOST_POINTS: f64 = 4e6;
/// The most courses and wales that are looked at.
const MOST_COURSES: usize = 24;
const MOST_WALES: usize = 16;
/// Samples of each span between data points.
const SAMPLES: u32 = 12;

/// Cloth as a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Body {
    /// Share of the flat area that yarns hide.
    pub(super) cover: f64,
    /// From the lowest to the highest surface, mm.
    pub(super) thickness: f64,
}

/// Measures the fabric's yarns at the radius for which they are laid out.
pub(super) fn measure(fabric: &Fabric, pattern: &Pattern) -> Body {
    measure_at(fabric, pattern, FINENESS)
}

fn measure_at(fabric: &Fabric, pattern: &Pattern, fineness: f64) -> Body {
    let spacing = DVec2::new(fabric.wale_spacing(), fabric.course_spacing());
    let (wales, courses) =
        (fabric.threading_repeat().min(MOST_WALES), fabric.repeat().min(MOST_COURSES));
    let cell = spacing * DVec2::new(f64::from(index32(wales)), f64::from(index32(courses)));
    let mut grid = Grid::new(
        cell,
        (spacing.min_element() / fineness).max((cell.x * cell.y / MOST_POINTS).sqrt()),
    );
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    // No span between data points is much longer than a wale or a course.
    let reach = 1.5 * spacing.max_element() + fabric.radius();
    let is_far =
        |at: DVec2| (at + reach).cmplt(DVec2::ZERO).any() || (at - reach).cmpgt(cell).any();
    let mesh = StructureMesh::anchored_at(fabric, DVec2::ZERO);
    let mut knitted = Knitted::default();
    for (bar, thickness) in fabric.thickness().into_iter().enumerate() {
        let radius = fabric.radius() * thickness;
        let (beside, along, step) = if pattern.runs_across(bar) {
            (cell.y, cell.x, spacing.x)
        } else {
            (cell.x, cell.y, spacing.y)
        };
        // Two steps more at both ends: their heads and feet reach into the repeat, and a path's
        // ends are bent otherwise than its inside.
        let ends = 2.0 * step;
        for number in pattern.yarns_over(bar, -radius..beside + radius) {
            knitted.clear();
            pattern.lay(
                bar,
                number,
                pattern.steps_along(bar, -ends..along + ends),
                &mesh,
                &mut knitted,
            );
            for index in 0..knitted.points.len().saturating_sub(1) {
                if knitted.points[index..index + 2].iter().all(|point| is_far(point.xy())) {
                    continue;
                }
                let span = curve::span(&knitted.points, index);
                let mut from = knitted.points[index];
                for step in 1..=SAMPLES {
                    let to = span.at(f64::from(step) / f64::from(SAMPLES));
                    if grid.add(from, to, radius) {
                        (low, high) = (
                            low.min(from.z.min(to.z) - radius),
                            high.max(from.z.max(to.z) + radius),
                        );
                    }
                    from = to;
                }
            }
        }
    }
    Body { cover: grid.share(), thickness: (high - low).max(0.0) }
}

/// Points of a repeat, each at the middle of its square.
struct Grid {
    size: [usize; 2],
    pitch: DVec2,
    hidden: Vec<bool>,
}

impl Grid {
    fn new(cell: DVec2, pitch: f64) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "MOST_POINTS bounds it"
        )]
        let size = (cell / pitch).ceil().to_array().map(|count| count as usize);
        let pitch = cell / DVec2::new(f64::from(index32(size[0])), f64::from(index32(size[1])));
        Self { size, pitch, hidden: vec![false; size[0] * size[1]] }
    }

    /// Hides the points behind a capsule; whether its box meets the grid.
    fn add(&mut self, from: DVec3, to: DVec3, radius: f64) -> bool {
        let (p, q) = (from.xy(), to.xy());
        let (low, high) = ((p.min(q) - radius) / self.pitch, (p.max(q) + radius) / self.pitch);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "`as` saturates at 0, which is what is meant"
        )]
        let range = |axis: usize| {
            low[axis].floor() as usize..(high[axis].ceil().max(0.0) as usize).min(self.size[axis])
        };
        let (columns, rows) = (range(0), range(1));
        if columns.is_empty() || rows.is_empty() {
            return false;
        }
        let along = q - p;
        let scale = if along == DVec2::ZERO { 0.0 } else { along.length_squared().recip() };
        for row in rows {
            for column in columns.clone() {
                let middle = (DVec2::new(f64::from(index32(column)), f64::from(index32(row)))
                    + 0.5)
                    * self.pitch
                    - p;
                let share = (middle.dot(along) * scale).clamp(0.0, 1.0);
                self.hidden[row * self.size[0] + column] |=
                    (middle - along * share).length_squared() < radius * radius;
            }
        }
        true
    }

    fn share(&self) -> f64 {
        f64::from(index32(self.hidden.iter().filter(|hidden| **hidden).count()))
            / f64::from(index32(self.hidden.len()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_chains(chains: &[&str]) -> Fabric {
        let chains: Vec<_> = chains.iter().map(|chain| (*chain).to_owned()).collect();
        Fabric::named("tricot").unwrap().with_chains(&chains, &[]).unwrap()
    }

    #[test]
    fn straight_inlays_hide_their_width_and_are_as_thick_as_they_are() {
        let fabric = of_chains(&["0-0//"]);
        let body = measure(&fabric, &Pattern::new(&fabric));
        let (share, diameter) =
            (2.0 * fabric.radius() / fabric.wale_spacing(), 2.0 * fabric.radius());
        assert!((body.cover - share).abs() < 0.005, "{} {share}", body.cover);
        assert!((body.thickness - diameter).abs() < 1e-9);
    }

    #[test]
    fn crossing_yarns_hide_their_crossing_once() {
        let fabric = of_chains(&["0-0//", "weft"]);
        let body = measure(&fabric, &Pattern::new(&fabric));
        let (x, y) = (
            2.0 * fabric.radius() / fabric.wale_spacing(),
            2.0 * fabric.radius() / fabric.course_spacing(),
        );
        assert!((body.cover - (x + y - x * y)).abs() < 0.005, "{} {x} {y}", body.cover);
    }

    #[test]
    fn a_finer_grid_says_the_same() {
        for name in ["locknit", "marquisette", "hex-net-3"] {
            let fabric = Fabric::named(name).unwrap();
            let pattern = Pattern::new(&fabric);
            let (coarse, fine) =
                (measure(&fabric, &pattern), measure_at(&fabric, &pattern, 2.0 * FINENESS));
            assert!((coarse.cover - fine.cover).abs() < 0.005, "{name}: {coarse:?} {fine:?}");
            assert!(
                (coarse.thickness - fine.thickness).abs() < 0.01 * fine.thickness,
                "{name}: {coarse:?} {fine:?}"
            );
        }
    }

    #[test]
    fn repeats_that_are_not_relaxed_are_measured_too() {
        let fabric = of_chains(&[&"1-0/1-2/".repeat(1500), &"1-2/1-0/".repeat(1500)]);
        let body = measure(&fabric, &Pattern::new(&fabric));
        assert!(
            (0.5..1.0).contains(&body.cover) && body.thickness > 4.0 * fabric.radius(),
            "{body:?}"
        );
    }
}
