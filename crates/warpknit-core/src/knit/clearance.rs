//! How near yarns come to each other: the check that none cuts another.
//!
//! In: paths of yarn and their radii ([`Paths`]), or a fabric's [`Pattern`] ([`measure`]): one
//! repeat against everything around it. Out: a [`Clearance`], the least distance between centre
//! lines over the sum of the two radii. Paths are sampled 12 times a span and segments compared
//! exactly. Parts of one strand nearer than 7 radii along it are neighbours, not contacts. Source:
//! the specification's knit page. Cost: a grid of cells finds candidates, about 1 µs a segment on
//! one thread; some milliseconds a repeat. Not promised: of repeats over 96 courses or 64 wales
//! only that much is looked at, and of heaps of yarns in one place only some.

use glam::{DVec2, DVec3, I64Vec2, I64Vec3};
use rayon::prelude::*;

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
/// Distances over this many times touching are of no interest, and not looked for.
const FARTHEST: f64 = 2.0;
/// Parts of one strand that are nearer along it than so many radii don't count.
const NEIGHBOURHOOD: f64 = 7.0;
/// Yarns this near to touching have settled.
const SETTLED: f64 = 0.98;
/// Laid yarns are squeezed where they cross, and are pushed apart to a little more than this.
const PRESSED: f64 = 0.55;
/// One segment that meets more others than this, or looks at more, lies in a heap of yarns; the
/// rest of the heap adds nothing.
const HEAP: usize = 1000;
const MOST_LOOKS: usize = 5 * HEAP;

/// How close yarns come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// Least distance between centre lines over the sum of their radii (2r for equal yarns): under
    /// 1 yarns cut each other. At most 2: farther neighbours are not looked for.
    pub min_over_2r: f64,
    /// Pairs of path segments nearer than twice touching.
    pub pairs: usize,
    /// Those nearer than touching.
    pub pairs_below_1: usize,
    /// Those nearer than 0.95 of touching.
    pub pairs_below_95: usize,
}

impl Clearance {
    /// Nothing near anything.
    pub const FREE: Self =
        Self { min_over_2r: FARTHEST, pairs: 0, pairs_below_1: 0, pairs_below_95: 0 };

    fn with(mut self, ratio: f64) -> Self {
        if ratio < FARTHEST {
            self.min_over_2r = self.min_over_2r.min(ratio);
            self.pairs += 1;
            self.pairs_below_1 += usize::from(ratio < 1.0);
            self.pairs_below_95 += usize::from(ratio < 0.95);
        }
        self
    }

    /// Both together.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            min_over_2r: self.min_over_2r.min(other.min_over_2r),
            pairs: self.pairs + other.pairs,
            pairs_below_1: self.pairs_below_1 + other.pairs_below_1,
            pairs_below_95: self.pairs_below_95 + other.pairs_below_95,
        }
    }
}

/// A piece of a sampled path.
#[derive(Clone, Copy, Debug)]
struct Segment {
    from: DVec3,
    to: DVec3,
    radius: f64,
    /// Yarn length up to its middle.
    along: f64,
    strand: u32,
}

impl Segment {
    fn middle(&self) -> DVec3 {
        self.from.midpoint(self.to)
    }

    fn half(&self) -> f64 {
        self.from.distance(self.to) / 2.0
    }

    /// Least distance to another over touching.
    fn ratio(&self, other: &Self) -> f64 {
        let (share, share_other) =
            curve::nearest_of_segments([self.from, self.to], [other.from, other.to]);
        self.from.lerp(self.to, share).distance(other.from.lerp(other.to, share_other))
            / (self.radius + other.radius)
    }
}

/// Paths of yarn, to be measured against each other.
#[derive(Clone, Debug, Default)]
pub struct Paths {
    segments: Vec<Segment>,
    strands: u32,
}

impl Paths {
    /// Adds one uninterrupted strand through `points`, mm, with its radius; only where it is `near`
    /// something of interest.
    pub fn add(&mut self, points: &[DVec3], radius: f64, near: impl Fn(DVec3) -> bool) {
        let mut along = 0.0;
        for index in 0..points.len().saturating_sub(1) {
            if !near(points[index]) && !near(points[index + 1]) {
                // Far away, its length is of no interest either: both of its ends are off by the
                // same.
                along += points[index].distance(points[index + 1]);
                continue;
            }
            let span = curve::span(points, index);
            let mut from = points[index];
            for step in 1..=SAMPLES {
                let to = span.at(f64::from(step) / f64::from(SAMPLES));
                let length = from.distance(to);
                self.segments.push(Segment {
                    from,
                    to,
                    radius,
                    along: along + length / 2.0,
                    strand: self.strands,
                });
                along += length;
                from = to;
            }
        }
        self.strands += 1;
    }

    /// Compares each segment with all others nearby; a pair counts once.
    ///
    /// `repeat` says in which repeat a place lies: only segments of repeat (0, 0) are compared with
    /// others. A pair of two repeats is met again one repeat further, from the other's side, and so
    /// counts from one side alone.
    pub fn clearance(&self, repeat: impl Fn(DVec3) -> I64Vec2 + Sync) -> Clearance {
        let longest = self.segments.iter().map(|s| s.from.distance(s.to)).fold(0.0, f64::max);
        let thickest = self.segments.iter().map(|s| s.radius).fold(0.0, f64::max);
        // Two segments that near have their middles within this.
        let grid = Grid::new(&self.segments, 2.0 * FARTHEST * thickest + longest);
        let of_segment = |at: usize| {
            let s = &self.segments[at];
            let mut clearance = Clearance::FREE;
            if repeat(s.middle()) == I64Vec2::ZERO {
                let reach = FARTHEST * s.radius + s.half();
                for other in grid.around(s.middle()).take(MOST_LOOKS) {
                    let t = &self.segments[other.at as usize];
                    // Most are farther than their spheres reach, which is a tenth of the work to
                    // see. A pair within is met from both sides.
                    let far =
                        other.middle.distance_squared(s.middle()) > (reach + other.reach).powi(2);
                    let neighbours = s.strand == t.strand
                        && (s.along - t.along).abs() <= NEIGHBOURHOOD * s.radius;
                    let there = repeat(other.middle);
                    let is_met_elsewhere = if there == I64Vec2::ZERO {
                        (other.at as usize) < at
                    } else {
                        (there.y, there.x) < (0, 0)
                    };
                    if far || neighbours || is_met_elsewhere {
                        continue;
                    }
                    clearance = clearance.with(s.ratio(t));
                    if clearance.pairs > HEAP {
                        break;
                    }
                }
            }
            clearance
        };
        (0..self.segments.len())
            .into_par_iter()
            .with_min_len(1024)
            .map(of_segment)
            .reduce(|| Clearance::FREE, Clearance::and)
    }
}

/// A segment in the grid: what is needed to see that it is too far away.
#[derive(Clone, Copy, Default)]
struct Entry {
    at: u32,
    cell: I64Vec3,
    middle: DVec3,
    reach: f64,
}

/// Segments by the cell of space in which their middles lie: buckets of a hash, each in the
/// segments' order.
struct Grid {
    size: f64,
    starts: Vec<u32>,
    entries: Vec<Entry>,
}

impl Grid {
    fn new(segments: &[Segment], size: f64) -> Self {
        let starts = vec![0; segments.len().next_power_of_two() + 1];
        let mut grid = Self { size, starts, entries: vec![Entry::default(); segments.len()] };
        let cells: Vec<_> = segments.iter().map(|s| grid.cell(s.middle())).collect();
        for &cell in &cells {
            let bucket = grid.bucket(cell);
            grid.starts[bucket + 1] += 1;
        }
        for bucket in 1..grid.starts.len() {
            grid.starts[bucket] += grid.starts[bucket - 1];
        }
        let mut next = grid.starts.clone();
        for (at, (segment, cell)) in (0u32..).zip(segments.iter().zip(cells)) {
            let slot = &mut next[grid.bucket(cell)];
            let reach = FARTHEST * segment.radius + segment.half();
            grid.entries[*slot as usize] = Entry { at, cell, middle: segment.middle(), reach };
            *slot += 1;
        }
        grid
    }

    fn cell(&self, at: DVec3) -> I64Vec3 {
        (at / self.size).floor().as_i64vec3()
    }

    /// Odd multipliers spread neighbouring cells (Teschner et al. 2003).
    fn bucket(&self, cell: I64Vec3) -> usize {
        let hash = cell.x.wrapping_mul(73_856_093)
            ^ cell.y.wrapping_mul(19_349_663)
            ^ cell.z.wrapping_mul(83_492_791);
        let buckets = i64::from(index32(self.starts.len() - 1));
        usize::try_from(hash.rem_euclid(buckets)).expect("a remainder is not negative")
    }

    /// All segments whose middles may lie within a cell's size of `at`.
    fn around(&self, at: DVec3) -> impl Iterator<Item = &Entry> {
        let home = self.cell(at);
        let cells = (0..27).map(move |n| home + I64Vec3::new(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1));
        cells.flat_map(move |cell| {
            let bucket = self.bucket(cell);
            let entries =
                &self.entries[self.starts[bucket] as usize..self.starts[bucket + 1] as usize];
            // Other cells may share the bucket.
            entries.iter().filter(move |entry| entry.cell == cell)
        })
    }
}

/// Measures a fabric's pattern, whose thickest yarns are drawn with `radius` mm.
///
/// ```
/// use warpknit_core::{fabric::Fabric, knit::{Pattern, clearance}};
/// let tricot = Fabric::named("tricot").unwrap();
/// assert!(clearance::measure(&tricot, &Pattern::new(&tricot), tricot.radius()).min_over_2r > 0.98);
/// ```
#[must_use]
pub fn measure(fabric: &Fabric, pattern: &Pattern, radius: f64) -> Clearance {
    let mesh = StructureMesh::anchored_at(fabric, DVec2::ZERO);
    let (wales, courses) =
        (fabric.threading_repeat().min(MOST_WALES), fabric.repeat().min(MOST_COURSES));
    let spacing = DVec2::new(fabric.wale_spacing(), fabric.course_spacing());
    let cell = spacing * DVec2::new(f64::from(index32(wales)), f64::from(index32(courses)));
    // Yarns thicker than two wales cut everything around them; there is no need to look further for
    // the least distance.
    let margin = (8.0 * radius).min(2.0 * spacing.x);
    // No span between data points is much longer than a wale or a course.
    let reach = 1.5 * spacing.max_element() + 2.0 * FARTHEST * radius;
    let near = |p: DVec3| {
        (p.truncate() + reach).cmpge(DVec2::ZERO).all() && (p.truncate() - reach).cmple(cell).all()
    };
    let mut paths = Paths::default();
    let mut knitted = Knitted::default();
    for (bar, thickness) in fabric.thickness().into_iter().enumerate() {
        let (beside, along, step) = if pattern.runs_across(bar) {
            (cell.y, cell.x, spacing.x)
        } else {
            (cell.x, cell.y, spacing.y)
        };
        // Four steps more at both ends: their heads and feet reach into the repeat.
        let ends = 4.0 * step;
        for number in pattern.yarns_over(bar, -margin..beside + margin) {
            knitted.clear();
            pattern.lay(
                bar,
                number,
                pattern.steps_along(bar, -ends..along + ends),
                &mesh,
                &mut knitted,
            );
            paths.add(&knitted.points, radius * thickness, near);
        }
    }
    paths.clearance(|p| (p.truncate() / cell).floor().as_i64vec2())
}

/// What a designer should know of how a fabric's yarns fit, a line each; nothing where all is well.
///
/// `radius` is that of the thickest yarn as drawn, `clearance` what [`measure`] found with it.
#[must_use]
pub fn warnings(
    fabric: &Fabric,
    pattern: &Pattern,
    clearance: &Clearance,
    radius: f64,
) -> Vec<String> {
    let mut warnings = Vec::new();
    let true_radius = fabric.true_radius() * fabric.enlargement;
    let (wales, courses) = (fabric.wales_per_cm, fabric.courses_per_cm);
    if fabric.radius() < true_radius {
        warnings.push(format!(
            "the thickest yarn, {:.3} mm by its count, is too thick for {wales} wales and {courses} courses per cm: loops hold {:.3} mm \
             at most, and so it is drawn; take a finer yarn or lower densities",
            2.0 * true_radius,
            2.0 * fabric.radius()
        ));
    }
    if pattern.settled().is_none() {
        warnings.push(
            "the repeat is too large to be relaxed: yarns lie as laid out, which takes some more of them and may let them cut each other"
                .to_owned(),
        );
    }
    if fabric.is_laid() {
        if clearance.min_over_2r < PRESSED {
            warnings.push(format!(
                "laid yarns cut each other: the nearest lie at {:.2} of their thickness, and {PRESSED} is what yarns stand that are squeezed flat \
                 where they cross; move their paths, or take finer yarns",
                clearance.min_over_2r
            ));
        }
    } else if clearance.min_over_2r < SETTLED {
        warnings.push(format!(
            "yarns drawn {:.3} mm thick cut each other: {} pairs of path segments in a repeat are nearer than their thickness, the \
             nearest at {:.2} of it; thinner yarns, lower densities or another lapping give them room",
            2.0 * radius,
            clearance.pairs_below_1,
            clearance.min_over_2r
        ));
    }
    warnings
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
            radius: 0.5,
            along: 0.0,
        };
        let x = segment((0.0, 0.0, 0.0), (1.0, 0.0, 0.0));
        for (other, expected) in [
            (segment((0.5, -1.0, 2.0), (0.5, 1.0, 2.0)), 2.0),
            (segment((0.0, 3.0, 0.0), (1.0, 3.0, 0.0)), 3.0),
            (segment((2.0, 0.0, 0.0), (3.0, 0.0, 0.0)), 1.0),
            (segment((4.0, 4.0, 0.0), (4.0, 4.0, 0.0)), 5.0),
        ] {
            assert!((x.ratio(&other) - expected).abs() < 1e-12);
            assert!((other.ratio(&x) - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn a_repeat_written_twice_holds_twice_the_pairs() {
        let count = |times: usize| {
            let chains = ["1-2/1-0/", "1-0/1-2/"].map(|chain| chain.repeat(times));
            let fabric = Fabric::named("tricot").unwrap().with_chains(&chains, &[]).unwrap();
            let found = measure(
                &fabric,
                &Pattern::straight(&fabric, fabric.warp_knit().unwrap()),
                fabric.radius(),
            );
            (found.pairs, found.pairs_below_1)
        };
        let (once, twice) = (count(1), count(2));
        assert!(once.1 > 0);
        assert_eq!((2 * once.0, 2 * once.1), twice);
    }

    #[test]
    fn least_distances_of_the_specification() {
        // Before any relaxation. The prototype behind the specification's table, at C/W = .70 with
        // r/W = .042 and .60 with .036. (The table itself has the least of all two-bar fabrics:
        // 1.05 and 1.00.)
        for name in ["tricot", "locknit"] {
            for (course, radius, expected) in [(0.70, 0.042, 1.054), (0.60, 0.036, 1.027)] {
                let mut fabric =
                    Fabric::named(name).unwrap().at_densities(10.0, 10.0 / course).unwrap();
                fabric.enlargement = radius / fabric.true_radius();
                let found = measure(
                    &fabric,
                    &Pattern::straight(&fabric, fabric.warp_knit().unwrap()),
                    radius,
                )
                .min_over_2r;
                assert!(
                    (found - expected).abs() < 0.01,
                    "{name} at C {course}: {found}, the prototype has {expected}"
                );
            }
        }
    }
}
