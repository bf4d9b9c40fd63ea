//! Cover factor and thickness of cloth, and what is seen of each bar: its yarns rasterised as solid
//! bodies.
//!
//! In: a fabric and its [`Pattern`]. Out: a [`MeasuredBody`]: the share of the flat area that yarns hide,
//! seen from the front, and the distance from the lowest to the highest yarn surface. And
//! [`visible_shares`].
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
/// [`SAMPLES_PER_STITCH`] of [`visible_shares`], which tell colours apart and need fewer.
const VISIBLE_SAMPLES_PER_STITCH: f64 = 48.0;
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
    let cell = cell(fabric);
    let raster = Raster::new(cell, pitch(fabric, cell, samples_per_stitch));
    let mut hidden = vec![false; raster.points()];
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    each_capsule(fabric, pattern, cell, |capsule, _| {
        if raster.each_point(capsule, |point, _, _| hidden[point] = true) {
            let Capsule { from, to, radius } = capsule;
            (low, high) = (low.min(from.z.min(to.z) - radius), high.max(from.z.max(to.z) + radius));
        }
    });
    let count = index32(hidden.iter().filter(|hidden| **hidden).count());
    let cover = f64::from(count) / f64::from(index32(hidden.len()));
    MeasuredBody { cover, thickness: (high - low).max(0.0) }
}

/// The share that each bar has of the yarn that is seen: from the front, and from the back. Cost: a
/// tenth of the cover factor's.
#[must_use]
pub fn visible_shares(fabric: &Fabric, pattern: &Pattern) -> [Vec<f64>; 2] {
    let cell = cell(fabric);
    let raster = Raster::new(cell, pitch(fabric, cell, VISIBLE_SAMPLES_PER_STITCH));
    // How far out the outermost yarn lies on the front and on the back of each point, and its bar.
    let mut outermost = vec![[(f64::NEG_INFINITY, 0); 2]; raster.points()];
    each_capsule(fabric, pattern, cell, |capsule, bar| {
        raster.each_point(capsule, |point, height, half| {
            for (side, out) in [height + half, half - height].into_iter().enumerate() {
                if out > outermost[point][side].0 {
                    outermost[point][side] = (out, bar);
                }
            }
        });
    });
    let bars = fabric.yarn_systems();
    [0, 1].map(|side| {
        let mut counts = vec![0_u32; bars];
        let seen = outermost.iter().map(|sides| sides[side]);
        for (_, bar) in seen.filter(|(height, _)| height.is_finite()) {
            counts[bar] += 1;
        }
        let all = f64::from(counts.iter().sum::<u32>().max(1));
        counts.into_iter().map(|count| f64::from(count) / all).collect()
    })
}

/// The part of the repeat that is measured, mm.
fn cell(fabric: &Fabric) -> DVec2 {
    let (wales, courses) =
        (fabric.threading_repeat().min(MAX_WALES), fabric.repeat().min(MAX_COURSES));
    let counts = DVec2::new(f64::from(index32(wales)), f64::from(index32(courses)));
    counts * DVec2::new(fabric.wale_spacing(), fabric.course_spacing())
}

/// Distance of the points of a raster of the cell, mm.
fn pitch(fabric: &Fabric, cell: DVec2, samples_per_stitch: f64) -> f64 {
    let shorter = fabric.wale_spacing().min(fabric.course_spacing());
    (shorter / samples_per_stitch).max((cell.element_product() / MAX_POINTS).sqrt())
}

/// A straight piece of yarn with round ends.
#[derive(Clone, Copy)]
struct Capsule {
    from: DVec3,
    to: DVec3,
    radius: f64,
}

/// Calls `take` with the straight pieces of all yarns in a cell or near it, and with their bar.
fn each_capsule(
    fabric: &Fabric,
    pattern: &Pattern,
    cell: DVec2,
    mut take: impl FnMut(Capsule, usize),
) {
    let spacing = DVec2::new(fabric.wale_spacing(), fabric.course_spacing());
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
                    take(Capsule { from, to, radius }, bar);
                    from = to;
                }
            }
        }
    }
}

/// Sample points of a repeat, each at the middle of its square, row after row.
struct Raster {
    /// Columns and rows.
    size: [usize; 2],
    /// Sides of a square, mm.
    pitch: DVec2,
}

impl Raster {
    fn new(cell: DVec2, pitch: f64) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "MAX_POINTS bounds it"
        )]
        let size = (cell / pitch).ceil().to_array().map(|count| count as usize);
        let pitch = cell / DVec2::new(f64::from(index32(size[0])), f64::from(index32(size[1])));
        Self { size, pitch }
    }

    fn points(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// Calls `take` with the number of each point behind a capsule, the height of its axis there, and
    /// half of its thickness. Returns whether its bounding box meets the raster.
    fn each_point(&self, capsule: Capsule, mut take: impl FnMut(usize, f64, f64)) -> bool {
        let Capsule { from, to, radius } = capsule;
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
                let half = radius * radius - (middle - along * share).length_squared();
                if half > 0.0 {
                    let height = from.z + share * (to.z - from.z);
                    take(row * self.size[0] + column, height, half.sqrt());
                }
            }
        }
        true
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

    /// The front sees the yarn that lies higher at a crossing, and the back the other.
    #[test]
    fn of_crossing_yarns_each_side_sees_the_outer_ones_whole() {
        let fabric = of_chains(&["0-0//", "weft"]);
        let [front, back] = visible_shares(&fabric, &Pattern::new(&fabric));
        let (x, y) = (
            2.0 * fabric.radius() / fabric.wale_spacing(),
            2.0 * fabric.radius() / fabric.course_spacing(),
        );
        let all = x + y - x * y;
        let mut heights = [0.0; 2];
        each_capsule(&fabric, &Pattern::new(&fabric), cell(&fabric), |capsule, bar| {
            heights[bar] = capsule.from.z;
        });
        let (inlay, weft) =
            if heights[0] > heights[1] { (front[0], back[1]) } else { (back[0], front[1]) };
        for (found, share) in [(inlay, x / all), (weft, y / all)] {
            assert!((found - share).abs() < 0.02, "{front:?} {back:?}, not {share}");
        }
        assert!((front[0] + front[1] - 1.0).abs() < 1e-12);
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
