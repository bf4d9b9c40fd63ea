//! How near yarns come to each other: the check that none cuts another.
//!
//! In: a [`Fabric`] and the radius at which it is drawn. Out: the least distance between centre lines over 2r, measured on one repeat against everything around it. Paths are
//! sampled 12 times a span and segments compared exactly; of repeats over 96 courses or 64 wales only that much is looked at. Parts of one strand nearer than 7 radii along it are neighbours, not
//! contacts. Source: the specification's knit page. Cost: a grid of cells finds candidates, milliseconds a repeat.

use std::collections::HashMap;

use glam::DVec3;

use super::mesh::StructureMesh;
use super::{KnitError, Knitted, Pattern};
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
    /// Yarn length up to its middle.
    along: f64,
}

/// Measures the layout of a fabric whose yarns are drawn with `radius` mm.
///
/// # Errors
/// Laps that can't be knitted.
///
/// ```
/// use warpknit::{fabric::Fabric, knit::clearance};
/// let tricot = Fabric::named("tricot").unwrap();
/// assert!(clearance::measure(&tricot, tricot.radius()).unwrap().min_over_2r > 0.98);
/// ```
pub fn measure(fabric: &Fabric, radius: f64) -> Result<Clearance, KnitError> {
    let pattern = Pattern::new(fabric)?;
    let mesh = StructureMesh::anchored_at(fabric, glam::DVec2::ZERO);
    let (wales, courses) = (fabric.threading_repeat().min(MOST_WALES), fabric.repeat().min(MOST_COURSES));
    let (width, height) =
        (fabric.wale_spacing() * f64::from(index32(wales)), fabric.course_spacing() * f64::from(index32(courses)));
    let courses = i64::try_from(courses).expect("limited");
    // Yarns thicker than two wales cut everything around them; there is no need to look further for the least distance.
    let margin = (8.0 * radius).min(2.0 * fabric.wale_spacing());
    let mut segments = Vec::new();
    let mut strand = 0;
    for (bar, threads) in fabric.bars.iter().enumerate() {
        for guide in pattern.guides_across(bar, -margin..width + margin) {
            if threads.threading.carries(guide) {
                let mut knitted = Knitted::default();
                // Four courses more on both sides: their heads and feet reach into the repeat.
                pattern.lay(bar, guide, -4..courses + 4, &mesh, &mut knitted);
                sample(&knitted.points, strand, &mut segments);
                strand += 1;
            }
        }
    }
    let inside = |s: &Segment| {
        let middle = (s.from + s.to) / 2.0;
        (0.0..width).contains(&middle.x) && (0.0..height).contains(&middle.y)
    };
    Ok(least(&segments, inside, radius))
}

fn sample(points: &[DVec3], strand: u32, segments: &mut Vec<Segment>) {
    let mut along = 0.0;
    for index in 0..points.len() - 1 {
        let span = curve::span(points, index);
        for step in 0..SAMPLES {
            let at = |step: u32| span.at(f64::from(step) / f64::from(SAMPLES));
            let (from, to) = (at(step), at(step + 1));
            let length = from.distance(to);
            segments.push(Segment { from, to, strand, along: along + length / 2.0 });
            along += length;
        }
    }
}

/// Compares each segment that is `inside` with all others nearby.
fn least(segments: &[Segment], inside: impl Fn(&Segment) -> bool, radius: f64) -> Clearance {
    let longest = segments.iter().map(|s| s.from.distance(s.to)).fold(0.0, f64::max);
    // Two segments that near have their middles within this.
    let reach = 2.0 * FARTHEST * radius + longest;
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
            let neighbours = s.strand == t.strand && (s.along - t.along).abs() <= NEIGHBOURHOOD * radius;
            // A pair within the repeat is met from both sides and counts once.
            if neighbours || (other < at && inside(t)) {
                continue;
            }
            let ratio = distance(s, t) / (2.0 * radius);
            clearance.min_over_2r = clearance.min_over_2r.min(ratio);
            clearance.pairs_below_1 += usize::from(ratio < 1.0);
        }
    }
    clearance
}

/// Least distance of two segments (Ericson 2005, Real-Time Collision Detection, 5.1.9).
fn distance(s: &Segment, t: &Segment) -> f64 {
    let (d1, d2, r) = (s.to - s.from, t.to - t.from, s.from - t.from);
    let (a, e, f) = (d1.length_squared(), d2.length_squared(), d2.dot(r));
    if a == 0.0 || e == 0.0 {
        // A segment without length: the other one's nearest point to it.
        let (point, from, along) = if a == 0.0 { (s.from, t.from, d2) } else { (t.from, s.from, d1) };
        let share = if along == DVec3::ZERO { 0.0 } else { ((point - from).dot(along) / along.length_squared()).clamp(0.0, 1.0) };
        return point.distance(from + along * share);
    }
    let (b, c) = (d1.dot(d2), d1.dot(r));
    let denominator = a * e - b * b;
    let u = if denominator > 1e-14 * a * e { ((b * f - c * e) / denominator).clamp(0.0, 1.0) } else { 0.0 };
    let v = (b * u + f) / e;
    let u = if v < 0.0 {
        (-c / a).clamp(0.0, 1.0)
    } else if v > 1.0 {
        ((b - c) / a).clamp(0.0, 1.0)
    } else {
        u
    };
    (s.from + d1 * u).distance(t.from + d2 * v.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_in_closed_form() {
        let segment =
            |from: (f64, f64, f64), to: (f64, f64, f64)| Segment { from: from.into(), to: to.into(), strand: 0, along: 0.0 };
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
        // The prototype behind the specification's table, at C/W = .70 with r/W = .042 and .60 with .036. (The table itself has
        // the least of all two-bar fabrics: 1.05 and 1.00.)
        for name in ["tricot", "locknit"] {
            for (course, radius, expected) in [(0.70, 0.042, 1.054), (0.60, 0.036, 1.027)] {
                let fabric = Fabric::named(name).unwrap().at_densities(10.0, 10.0 / course).unwrap();
                assert!((fabric.radius() - radius).abs() < 1e-9, "the layout's limit is what the table measures");
                let found = measure(&fabric, fabric.radius()).unwrap().min_over_2r;
                assert!((found - expected).abs() < 0.01, "{name} at C {course}: {found}, the prototype has {expected}");
            }
        }
    }
}
