//! How near yarns come to each other: the check that none cuts another.
//!
//! In: a [`Fabric`] and the radius at which it is drawn. Out: the least distance between centre lines over 2r, measured on one repeat against everything around it. Paths are
//! sampled 12 times a span and segments compared exactly. Parts of one strand nearer than 7 radii along it are neighbours, not
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
/// Parts of one strand that are nearer along it than so many radii don't count.
const NEIGHBOURHOOD: f64 = 7.0;

/// How close a fabric's yarns come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// Least distance between centre lines over twice the radius: under 1 yarns cut each other.
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
    let courses = i64::try_from(fabric.repeat()).expect("repeats are limited");
    let (width, height) = (fabric.wale_spacing() * across(fabric), fabric.course_spacing() * f64::from(index32(fabric.repeat())));
    let margin = 8.0 * radius;
    let mut segments = Vec::new();
    let mut strand = 0;
    for (bar, threads) in fabric.bars.iter().enumerate() {
        for guide in pattern.guides_across(bar, -margin..width + margin) {
            if threads.threading.carries(guide) {
                let mut knitted = Knitted::default();
                // Two courses more on both sides: their heads and feet reach into the repeat.
                pattern.lay(bar, guide, -2 - courses..2 * courses + 2, &mesh, &mut knitted);
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

/// Wales after which the threadings repeat together.
fn across(fabric: &Fabric) -> f64 {
    let repeats = fabric.bars.iter().map(|bar| bar.threading.repeat());
    f64::from(index32(repeats.product()))
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
    // Two segments within 4r of each other have their middles within this; 4r is far over any least distance that matters.
    let reach = 4.0 * radius + longest;
    let key = |p: DVec3| (p / reach).floor().as_i64vec3().to_array();
    let mut grid: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    for (at, s) in segments.iter().enumerate() {
        grid.entry(key((s.from + s.to) / 2.0)).or_default().push(index32(at));
    }
    let mut clearance = Clearance { min_over_2r: f64::INFINITY, pairs_below_1: 0 };
    for s in segments.iter().filter(|s| inside(s)) {
        let [x, y, z] = key((s.from + s.to) / 2.0);
        let around = (0..27).map(|n| [x + n % 3 - 1, y + n / 3 % 3 - 1, z + n / 9 - 1]);
        for t in around.filter_map(|cell| grid.get(&cell)).flatten().map(|&t| &segments[t as usize]) {
            if s.strand == t.strand && (s.along - t.along).abs() <= NEIGHBOURHOOD * radius {
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
