//! How near yarns come to each other: the check that none cuts another.
//!
//! In: a [`Fabric`] and the radius at which it is drawn. Out: the least distance between centre lines over 2r, measured on one repeat against everything around it. Paths are
//! sampled 12 times a span and segments compared exactly; of repeats over 96 courses or 64 wales only that much is looked at. Parts of one strand nearer than 7 radii along it are neighbours, not
//! contacts. Source: the specification's knit page. Cost: a grid of cells finds candidates, milliseconds a repeat.

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use super::mesh::StructureMesh;
use super::{Knitted, Pattern};
use crate::fabric::Fabric;
use crate::ids::index32;
use crate::yarn::curve;

/// Samples of each span between data points.
const SAMPLES: u32 = 12;
/// The most courses and wales that are looked at.
const MOST_COURSES: usize = 96;
const MOST_WALES: usize = 64;
/// Distances over this many times 2r are of no interest, and not looked for.
const FARTHEST: f64 = 2.0;
/// Parts of one strand that are nearer along it than so many radii don't count.
const NEIGHBOURHOOD: f64 = 7.0;

/// How close a fabric's yarns come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// Least distance between centre lines over twice the radius: under 1 yarns cut each other. At most 2: farther neighbours are
    /// not looked for.
    pub min_over_2r: f64,
    /// Pairs of path segments nearer than 2r, of those with one in the repeat.
    pub pairs_below_1: usize,
}

/// A piece of a sampled path.
#[derive(Clone, Copy)]
struct Segment {
    from: DVec3,
    to: DVec3,
    strand: u32,
    radius: f64,
    /// Yarn length up to its middle.
    along: f64,
}

/// Measures a fabric's pattern, whose thickest yarns are drawn with `radius` mm.
///
/// ```
/// use warpknit::{fabric::Fabric, knit::{Pattern, clearance}};
/// let tricot = Fabric::named("tricot").unwrap();
/// assert!(clearance::measure(&tricot, &Pattern::new(&tricot), tricot.radius()).min_over_2r > 0.98);
/// ```
#[must_use]
pub fn measure(fabric: &Fabric, pattern: &Pattern, radius: f64) -> Clearance {
    let mesh = StructureMesh::anchored_at(fabric, DVec2::ZERO);
    let (wales, courses) = (fabric.threading_repeat().min(MOST_WALES), fabric.repeat().min(MOST_COURSES));
    let cell =
        DVec2::new(fabric.wale_spacing() * f64::from(index32(wales)), fabric.course_spacing() * f64::from(index32(courses)));
    // Yarns thicker than two wales cut everything around them; there is no need to look further for the least distance.
    let margin = (8.0 * radius).min(2.0 * fabric.wale_spacing());
    // Four steps more at both ends: their heads and feet reach into the repeat.
    let ends = 4.0 * fabric.wale_spacing().max(fabric.course_spacing());
    let mut segments = Vec::new();
    let mut strand = 0;
    for (bar, thickness) in fabric.thickness().into_iter().enumerate() {
        let (beside, along) = if pattern.runs_across(bar) { (cell.y, cell.x) } else { (cell.x, cell.y) };
        for number in pattern.yarns_over(bar, -margin..beside + margin) {
            let mut knitted = Knitted::default();
            pattern.lay(bar, number, pattern.steps_along(bar, -ends..along + ends), &mesh, &mut knitted);
            sample(&knitted.points, strand, radius * thickness, &mut segments);
            strand += 1;
        }
    }
    let inside = |s: &Segment| {
        let middle = ((s.from + s.to) / 2.0).truncate();
        middle.cmpge(DVec2::ZERO).all() && middle.cmplt(cell).all()
    };
    least(&segments, inside, radius)
}

fn sample(points: &[DVec3], strand: u32, radius: f64, segments: &mut Vec<Segment>) {
    let mut along = 0.0;
    for index in 0..points.len() - 1 {
        let span = curve::span(points, index);
        for step in 0..SAMPLES {
            let at = |step: u32| span.at(f64::from(step) / f64::from(SAMPLES));
            let (from, to) = (at(step), at(step + 1));
            let length = from.distance(to);
            segments.push(Segment { from, to, strand, radius, along: along + length / 2.0 });
            along += length;
        }
    }
}

/// Compares each segment that is `inside` with all others nearby.
fn least(segments: &[Segment], inside: impl Fn(&Segment) -> bool, thickest: f64) -> Clearance {
    let longest = segments.iter().map(|s| s.from.distance(s.to)).fold(0.0, f64::max);
    // Two segments that near have their middles within this.
    let reach = 2.0 * FARTHEST * thickest + longest;
    let key = |p: DVec3| (p / reach).floor().as_i64vec3().to_array();
    let mut grid: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    for (at, s) in segments.iter().enumerate() {
        grid.entry(key((s.from + s.to) / 2.0)).or_default().push(index32(at));
    }
    let mut clearance = Clearance { min_over_2r: FARTHEST, pairs_below_1: 0 };
    for (at, s) in (0u32..).zip(segments).filter(|(_, s)| inside(s)) {
        let [x, y, z] = key((s.from + s.to) / 2.0);
        let around = (0..27).map(|n| [x + n % 3 - 1, y + n / 3 % 3 - 1, z + n / 9 - 1]);
        for &other in around.filter_map(|cell| grid.get(&cell)).flatten() {
            let t = &segments[other as usize];
            let neighbours = s.strand == t.strand && (s.along - t.along).abs() <= NEIGHBOURHOOD * s.radius;
            // A pair within the repeat is met from both sides and counts once.
            if neighbours || (other < at && inside(t)) {
                continue;
            }
            let ratio = distance(s, t) / (s.radius + t.radius);
            clearance.min_over_2r = clearance.min_over_2r.min(ratio);
            clearance.pairs_below_1 += usize::from(ratio < 1.0);
        }
    }
    clearance
}

/// Least distance of two segments.
fn distance(s: &Segment, t: &Segment) -> f64 {
    let (share_s, share_t) = curve::nearest_of_segments([s.from, s.to], [t.from, t.to]);
    s.from.lerp(s.to, share_s).distance(t.from.lerp(t.to, share_t))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_in_closed_form() {
        let segment = |from: (f64, f64, f64), to: (f64, f64, f64)| Segment {
            from: from.into(),
            to: to.into(),
            strand: 0,
            radius: 1.0,
            along: 0.0,
        };
        let x = segment((0.0, 0.0, 0.0), (1.0, 0.0, 0.0));
        for (other, expected) in [
            (segment((0.5, -1.0, 2.0), (0.5, 1.0, 2.0)), 2.0),
            (segment((0.0, 3.0, 0.0), (1.0, 3.0, 0.0)), 3.0),
            (segment((2.0, 0.0, 0.0), (3.0, 0.0, 0.0)), 1.0),
            (segment((4.0, 4.0, 0.0), (4.0, 4.0, 0.0)), 5.0),
        ] {
            assert!((distance(&x, &other) - expected).abs() < 1e-12);
            assert!((distance(&other, &x) - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn least_distances_of_the_specification() {
        // Before any relaxation. The prototype behind the specification's table, at C/W = .70 with r/W = .042 and .60 with .036. (The table itself has
        // the least of all two-bar fabrics: 1.05 and 1.00.)
        for name in ["tricot", "locknit"] {
            for (course, radius, expected) in [(0.70, 0.042, 1.054), (0.60, 0.036, 1.027)] {
                let mut fabric = Fabric::named(name).unwrap().at_densities(10.0, 10.0 / course).unwrap();
                fabric.enlargement = radius / fabric.true_radius();
                let found = measure(&fabric, &Pattern::straight(&fabric), radius).min_over_2r;
                assert!((found - expected).abs() < 0.01, "{name} at C {course}: {found}, the prototype has {expected}");
            }
        }
    }
}
