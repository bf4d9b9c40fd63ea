//! Weft-knit loops: the points through which the yarn of a course passes, wale after wale.
//!
//! In: a [`Motif`] and the fabric's spacings. Out: a course's data points, [`POINTS`] a loop.
//!
//! Method: a loop has eight named places, and a cubic NURBS interpolates those of a whole course.
//! Every loop adds eight control points to it. The data points are the places and the points of the
//! curve halfway between them. All yarns are drawn as Catmull-Rom curves through their data points;
//! with these that path follows the NURBS to a tenth of the yarn's radius, in crossings to a fifth.
//! Cost: a banded linear system a course, linear in its loops.
//!
//! Source: the loop of nine control points of the paper on ribbon-based yarn models ("an innovative
//! three-dimensional ribbon-based yarn model simulation technique"), with other places, which
//! interlock (`docs/method.md`). The crossings of cables are this project's own. Not promised: that
//! loops of garter stitch and of cables keep clear of each other before they are relaxed.

use std::ops::Range;

use glam::{DVec2, DVec3};

use crate::fabric::motif::{ChartCell, Motif};
use crate::yarn::nurbs::{Nurbs, parameters};

/// Control points that each loop adds.
pub const CONTROL_POINTS: usize = 8;
/// Data points of a loop.
pub const POINTS: usize = 2 * CONTROL_POINTS;

/// The places of a face loop: x over W from the wale, y over C from the loop's middle, z over the
/// radius. In order: between the loops; left foot, leg and shoulder; head; right shoulder, leg,
/// foot.
const PLACES: [[f64; 3]; CONTROL_POINTS] = [
    [-0.5, -0.92, -0.70],
    [-0.15, -0.735, -0.38],
    [-0.25, 0.0, 1.68],
    [-0.35, 0.735, -0.38],
    [0.0, 0.92, -0.70],
    [0.35, 0.735, -0.38],
    [0.25, 0.0, 1.68],
    [0.15, -0.735, -0.38],
];
/// A crossing wale leans over one course, and this many more for each wale that it passes. With a
/// lower value it leans more steeply and presses its neighbours; with a higher one crossings of
/// successive rows run into each other.
const LEAN_COURSES: f64 = 1.2;
/// Height of a crossing's middle over the middle of the loops whose heads are carried, courses. The
/// heads that move lie in the upper half of their loops, so it is over 0; at 1 the next row's loops
/// would lean instead.
const CROSSING_HEIGHT: f64 = 0.4;
/// How far wales that cross rise in front of each other, and sink behind, where they are halfway,
/// radii: half the thickness of the cloth. Less lets their yarns cut each other; more lifts the
/// cable off the cloth.
const CROSSING_RISE: f64 = 2.4;
/// Loops before and behind a stretch of yarn with which its curve is solved. The influence of a
/// place on a cubic spline falls off by a factor of about four a place, so 32 places change nothing
/// that an `f64` holds. With fewer, stretches that are computed apart would not join exactly.
const MARGIN: i64 = 4;

/// Values that all loops of a fabric share.
#[derive(Clone, Copy, Debug)]
pub struct Loops {
    /// W and C, mm.
    pub spacing: DVec2,
    /// mm.
    pub radius: f64,
}

impl Loops {
    /// The eight places of a loop, mm from gap 0 and course 0 of the motif.
    fn places(&self, motif: &Motif, wale: i64, course: i64) -> [DVec3; CONTROL_POINTS] {
        let (before, cell) = (motif.cell(wale - 1, course), motif.cell(wale, course));
        #[expect(
            clippy::cast_precision_loss,
            reason = "wales and courses are counted in thousands"
        )]
        let home = (DVec2::new(wale as f64, course as f64) + 0.5) * self.spacing;
        std::array::from_fn(|at| {
            let [x, y, z] = PLACES[at];
            let (z, moved) = match at {
                // Between two loops the yarn belongs to both, so it takes the mean of their depths.
                // Between a face and a reverse loop it passes through the middle of the fabric.
                0 => (
                    z * (side(before) + side(cell)) / 2.0,
                    leaning(motif, wale - 1, course, y).midpoint(leaning(motif, wale, course, y)),
                ),
                _ => (z * side(cell), leaning(motif, wale, course, y)),
            };
            (home + DVec2::new(x + moved.x, y) * self.spacing).extend((z + moved.y) * self.radius)
        })
    }

    /// The curve of a course over some wales, from gap to gap: `8 wales + 1` control points.
    ///
    /// It has the ends of a yarn that ends there. [`Self::data_points`] serves for a yarn that
    /// continues.
    ///
    /// # Panics
    /// Without any wale.
    #[must_use]
    pub fn course(&self, motif: &Motif, course: i64, wales: Range<i64>) -> Nurbs {
        let points = self.through(motif, course, wales);
        Nurbs::through(&points, &parameters(&points))
    }

    /// Data points of a course over some wales of a fabric that continues beyond them, [`POINTS`] a
    /// loop.
    #[must_use]
    pub fn data_points(&self, motif: &Motif, course: i64, wales: Range<i64>) -> Vec<DVec3> {
        let points = self.through(motif, course, wales.start - MARGIN..wales.end + MARGIN);
        let at = parameters(&points);
        let curve = Nurbs::through(&points, &at);
        let first = CONTROL_POINTS * usize::try_from(MARGIN).expect("a few loops");
        let shown = first..points.len() - 1 - first;
        shown
            .flat_map(|index| [points[index], curve.at(at[index].midpoint(at[index + 1]))])
            .collect()
    }

    /// The places of a course over some wales, and the first place of the next loop.
    fn through(&self, motif: &Motif, course: i64, wales: Range<i64>) -> Vec<DVec3> {
        let end = self.places(motif, wales.end, course)[0];
        wales.flat_map(|wale| self.places(motif, wale, course)).chain([end]).collect()
    }
}

/// 1 for a face loop, -1 for a reverse loop.
fn side(cell: ChartCell) -> f64 {
    if cell.reverse { -1.0 } else { 1.0 }
}

/// The offset of a wale at `y` courses from the middle of a loop: x over W (sideways), y in radii
/// (towards the face). Cable crossings in the rows around make wales lean.
fn leaning(motif: &Motif, wale: i64, course: i64, y: f64) -> DVec2 {
    let reach = i64::from(motif.reach());
    let mut sum = DVec2::ZERO;
    if reach == 0 {
        return sum;
    }
    // Only crossings in rows nearer than half the longest lean, and a loop, reach this one.
    #[expect(clippy::cast_possible_truncation, reason = "some rows")]
    let reached = (0.5 * (1.0 + LEAN_COURSES * f64::from(motif.reach()))).ceil() as i64 + 1;
    for rows in -reached..=reached {
        // A crossing above moves the heads that stand on this wale now. A crossing below moved the
        // heads that came to this wale from another one.
        let row = course + rows;
        let cell = if rows >= 0 {
            motif.cell(wale, row)
        } else {
            let from = (wale - reach..=wale + reach)
                .find(|&from| from + i64::from(motif.cell(from, row).carried) == wale);
            motif.cell(from.unwrap_or(wale), row)
        };
        if cell.carried == 0 {
            continue;
        }
        let carried = f64::from(cell.carried);
        #[expect(clippy::cast_precision_loss, reason = "a few rows")]
        let above = y - rows as f64 - CROSSING_HEIGHT;
        let t = (above / (1.0 + LEAN_COURSES * carried.abs()) + 0.5).clamp(0.0, 1.0);
        // Smoothstep (the cubic Hermite blend): the wale leaves its place and reaches the new one
        // without a kink. The rise in front, 4 s (1 - s), is 1 where it is halfway.
        let share = t * t * (3.0 - 2.0 * t);
        // Above the crossing, places are counted from the new wale, so only the rest is missing.
        let gone = if rows >= 0 { 0.0 } else { 1.0 };
        sum += DVec2::new(
            carried * (share - gone),
            f64::from(cell.layer) * CROSSING_RISE * 4.0 * share * (1.0 - share),
        );
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::yarn::curve::span;
    use std::collections::BTreeMap;

    fn loops() -> Loops {
        Loops { spacing: DVec2::new(1.0, 0.77), radius: 0.1 }
    }

    fn motif(chart: &str) -> Motif {
        Motif::parse(chart, &BTreeMap::from([('C', "cable 2/2 left".parse().unwrap())])).unwrap()
    }

    #[test]
    fn control_points_are_counted_as_in_the_paper() {
        let plain = motif("k");
        for (wales, courses, expected) in [(20, 20, 3220), (50, 50, 20_050), (100, 100, 80_100)] {
            let count = |course| loops().course(&plain, course, 0..wales).control.len();
            assert_eq!((0..courses).map(count).sum::<usize>(), expected);
        }
    }

    #[test]
    fn the_loop_is_as_long_as_munden_says() {
        let points = loops().data_points(&motif("k"), 0, 0..1);
        assert_eq!(points.len(), POINTS);
        let curve = loops().course(&motif("k"), 0, -6..7);
        let end = parameters(&loops().through(&motif("k"), 0, -6..7)).pop().unwrap();
        let at = |step: u32| curve.at(end * f64::from(step) / 130_000.0);
        // The middle one of thirteen loops.
        let length: f64 = (60_000..70_000).map(|step| at(step).distance(at(step + 1))).sum();
        // Loop length times wales per length: 4.1 in relaxed plain knit (Munden 1959, "The geometry
        // and dimensional properties of plain-knit fabrics"); these places give 4.07.
        assert!((length - 4.1).abs() < 0.05, "{length}");
    }

    #[test]
    fn the_path_that_is_drawn_follows_the_curve() {
        for (chart, share) in [("k", 0.1), ("kp", 0.1), ("kkkkpp\nkCCCCp", 0.2)] {
            let (motif, loops) = (motif(chart), loops());
            let through = loops.through(&motif, 0, -6..9);
            let at = parameters(&through);
            let curve = Nurbs::through(&through, &at);
            let points = loops.data_points(&motif, 0, -6..9);
            // The third loop from the middle on, where neither has an end near: points and those
            // halfway, by turns.
            let farthest = (6 * CONTROL_POINTS..9 * CONTROL_POINTS)
                .flat_map(|place| (0..16).map(move |step| (place, f64::from(step) / 16.0)));
            let off = farthest.map(|(place, t)| {
                let drawn = span(&points, 2 * place + usize::from(t >= 0.5)).at((2.0 * t).fract());
                let near = (0..=400).map(|step| {
                    curve.at(at[place] + (at[place + 1] - at[place]) * f64::from(step) / 400.0)
                });
                near.map(|point| point.distance(drawn)).fold(f64::MAX, f64::min)
            });
            let most = off.fold(0.0, f64::max);
            assert!(
                most < share * loops.radius,
                "{chart}: {most} mm off, of a radius of {}",
                loops.radius
            );
        }
    }

    #[test]
    fn data_points_repeat_with_the_motif_and_do_not_depend_on_where_one_begins() {
        for chart in ["k", "kp", "kkkkpp\nkCCCCp"] {
            let motif = motif(chart);
            let repeat = i64::try_from(motif.wales()).unwrap();
            let all = loops().data_points(&motif, 0, 0..3 * repeat);
            let one = loops().data_points(&motif, 0, repeat..2 * repeat);
            for (index, point) in one.iter().enumerate() {
                let shift = DVec3::X * f64::from(u32::try_from(repeat).unwrap());
                assert!(
                    (all[index] + shift).distance(*point) < 1e-6
                        && all[index + one.len()].distance(*point) < 1e-6,
                    "{chart}"
                );
            }
        }
    }

    #[test]
    fn purl_loops_are_face_loops_from_behind() {
        let (face, purl) =
            (loops().data_points(&motif("k"), 0, 0..2), loops().data_points(&motif("p"), 0, 0..2));
        assert!(
            face.iter()
                .zip(&purl)
                .all(|(a, b)| (*a - *b * DVec3::new(1.0, 1.0, -1.0)).length() < 1e-12)
        );
        let rib = loops().data_points(&motif("kp"), 0, 0..2);
        assert!(rib[0].z.abs() < 1e-12 && rib[4].z > 0.0 && rib[POINTS + 4].z < 0.0);
    }

    #[test]
    fn heads_of_a_cable_stand_on_other_wales() {
        let motif = motif("CCCC");
        let points = loops().data_points(&motif, 0, 0..4);
        // Each course of this motif crosses anew: the feet lean with the heads in which they hang.
        let heads: Vec<f64> = points.iter().skip(8).step_by(POINTS).map(|head| head.x).collect();
        for (head, expected) in heads.iter().zip([2.5, 3.5, 0.5, 1.5]) {
            assert!((head - expected).abs() < 0.1, "{heads:?}");
        }
        // The front ones, from the right, pass in front where wales cross.
        assert!(points[2 * POINTS + 6].z > points[6].z + 2.0 * loops().radius);
    }
}
