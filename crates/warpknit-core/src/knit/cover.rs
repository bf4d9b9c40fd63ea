//! Cover factor and thickness of cloth: its yarns rasterised as solid bodies.
//!
//! In: a fabric and its [`Pattern`]. Out: a [`MeasuredBody`]: the share of the flat area that yarns hide,
//! seen from the front, and the distance from the lowest to the highest yarn surface.
//!
//! Method: paths are sampled 12 times a span, and the capsules around their segments are rasterised
//! by point sampling, over one repeat with all yarns that reach into it. Cost: some 20 ms for a
//! common repeat, and a megabyte for a dozen stitches. With [`SAMPLES_PER_STITCH`] the share is
//! within 0.005. Repeats of over [`MAX_POINTS`] points get a coarser raster, where straight yarns
//! may add another 0.005.
//!
//! Not promised: repeats over 24 courses or 16 wales are measured only over that much of them.

use glam::{DVec2, DVec3, Vec3Swizzles};

use super::mesh::StructureMesh;
use super::{Knitted, Pattern};
use crate::fabric::Fabric;
use crate::ids::index32;
use crate::yarn::curve;

/// Raster points along the shorter of W and C. Half as many double the error of a straight yarn's
/// width; twice as many take four times the time.
const SAMPLES_PER_STITCH: f64 = 256.0;
/// The most points of a raster: 4 MB.
const MAX_POINTS: f64 = 4e6;
/// The most courses and wales that are measured.
const MAX_COURSES: usize = 24;
const MAX_WALES: usize = 16;
/// Segments of each span between data points. Fewer shorten bends visibly; more change the share by
/// less than the raster does.
const SAMPLES: u32 = 12;

/// Cloth as a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MeasuredBody {
    /// Share of the flat area that yarns hide.
    pub(super) cover: f64,
    /// From the lowest to the highest surface, mm.
    pub(super) thickness: f64,
}

/// Measures the fabric's yarns at the radius for which they are laid out.
pub(super) fn measure(fabric: &Fabric, pattern: &Pattern) -> MeasuredBody {
    measure_at(fabric, pattern, SAMPLES_PER_STITCH)
}

fn measure_at(fabric: &Fabric, pattern: &Pattern, samples_per_stitch: f64) -> MeasuredBody {
    let spacing = DVec2::new(fabric.wale_spacing(), fabric.course_spacing());
    let (wales, courses) =
        (fabric.threading_repeat().min(MAX_WALES), fabric.repeat().min(MAX_COURSES));
    let cell = spacing * DVec2::new(f64::from(index32(wales)), f64::from(index32(courses)));
    let pitch =
        (spacing.min_element() / samples_per_stitch).max((cell.x * cell.y / MAX_POINTS).sqrt());
    let mut raster = CoverRaster::new(cell, pitch);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    // No span between data points is much longer than a wale or a course.
    let reach = 1.5 * spacing.max_element() + fabric.radius();
    let mesh = StructureMesh::anchored_at(fabric, DVec2::ZERO);
    let mut knitted = Knitted::default();
    for (bar, thickness) in fabric.thickness().into_iter().enumerate() {
        let radius = fabric.radius() * thickness;
        let (beside, along, step) = if pattern.runs_across(bar) {
            (cell.y, cell.x, spacing.x)
        } else {
            (cell.x, cell.y, spacing.y)
        };
        // Two steps more at both ends: their heads and feet reach into the repeat. The curve's end
        // spans also differ in shape from inner spans, and must lie outside of it.
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
                let is_far = knitted.points[index..index + 2].iter().all(|point| {
                    let at = point.xy();
                    (at + reach).cmplt(DVec2::ZERO).any() || (at - reach).cmpgt(cell).any()
                });
                if is_far {
                    continue;
                }
                let span = curve::span(&knitted.points, index);
                let mut from = knitted.points[index];
                for step in 1..=SAMPLES {
                    let to = span.at(f64::from(step) / f64::from(SAMPLES));
                    if raster.add_capsule(from, to, radius) {
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
    MeasuredBody { cover: raster.hidden_share(), thickness: (high - low).max(0.0) }
}

/// Sample points of a repeat, each at the middle of its square.
struct CoverRaster {
    /// Columns and rows.
    size: [usize; 2],
    /// Sides of a square, mm.
    pitch: DVec2,
    /// Whether a yarn hides the point, row after row.
    hidden: Vec<bool>,
}

impl CoverRaster {
    fn new(cell: DVec2, pitch: f64) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "MAX_POINTS bounds it"
        )]
        let size = (cell / pitch).ceil().to_array().map(|count| count as usize);
        let pitch = cell / DVec2::new(f64::from(index32(size[0])), f64::from(index32(size[1])));
        Self { size, pitch, hidden: vec![false; size[0] * size[1]] }
    }

    /// Marks the points behind a capsule as hidden. Returns whether its bounding box meets the
    /// raster.
    fn add_capsule(&mut self, from: DVec3, to: DVec3, radius: f64) -> bool {
        let (p, q) = (from.xy(), to.xy());
        let (low, high) = ((p.min(q) - radius) / self.pitch, (p.max(q) + radius) / self.pitch);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "`as` saturates at 0, which clips at the raster's edge"
        )]
        let [columns, rows] = [0, 1].map(|axis| {
            low[axis].floor() as usize..(high[axis].ceil().max(0.0) as usize).min(self.size[axis])
        });
        if columns.is_empty() || rows.is_empty() {
            return false;
        }
        // A point is hidden if it lies within the radius of the segment's projection: its distance
        // to the nearest place on the segment. The ends are round, which closes the joints between
        // segments.
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

    fn hidden_share(&self) -> f64 {
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
            let (coarse, fine) = (
                measure(&fabric, &pattern),
                measure_at(&fabric, &pattern, 2.0 * SAMPLES_PER_STITCH),
            );
            assert!((coarse.cover - fine.cover).abs() < 0.005, "{name}: {coarse:?} {fine:?}");
            assert!(
                (coarse.thickness - fine.thickness).abs() < 0.01 * fine.thickness,
                "{name}: {coarse:?} {fine:?}"
            );
        }
    }

    #[test]
    fn repeats_that_are_not_relaxed_are_measured_too() {
        let fabric = of_chains(&["1-0/1-2", "1-2/1-0/1-0"]);
        let body = measure(&fabric, &Pattern::straight(&fabric, fabric.warp_knit().unwrap()));
        assert!(
            (0.5..1.0).contains(&body.cover) && body.thickness > 4.0 * fabric.radius(),
            "{body:?}"
        );
    }
}
