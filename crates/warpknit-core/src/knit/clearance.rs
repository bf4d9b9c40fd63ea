//! The clearance of yarns: the check that no yarn cuts another.
//!
//! In: paths of yarn and their radii ([`SampledPaths`]), or a fabric's [`Pattern`] ([`measure`]),
//! one repeat against everything around it. Out: a [`Clearance`], the least distance between centre
//! lines over the sum of the two radii.
//!
//! Method: paths are sampled 12 times a span. A spatial hash finds pairs of segments that may be
//! near, and their distances are exact. Parts of one strand nearer than 7 radii along it are not
//! compared. Cost: about 1 µs a segment on one thread, some milliseconds a repeat.
//!
//! Not promised: repeats over 96 courses or 64 wales are measured only over that much of them. Of
//! many yarns in one place only some are compared.

use glam::{DVec2, DVec3, I64Vec2};
use rayon::prelude::*;

use super::mesh::StructureMesh;
use super::{Knitted, MAX_RELAXED_LAPS, Pattern};
use crate::fabric::Fabric;
use crate::ids::index32;
use crate::spatial_hash::{SpatialHash, Sphere};
use crate::yarn::curve;

/// Segments of each span between data points. With fewer, the chords cut the corners of bends and
/// the clearance comes out too small; more take time with the square of their number.
const SAMPLES: u32 = 12;
/// The most courses and wales that are measured.
const MAX_COURSES: usize = 96;
const MAX_WALES: usize = 64;
/// Cutoff of the search, over the sum of the radii. A smaller one would report less about loose
/// cloth; the number of candidates grows with its cube.
const CUTOFF: f64 = 2.0;
/// Parts of one strand that are nearer than this along it, in radii, are not compared. Smaller
/// values count the inside of tight bends as cuts; beyond some ten, cuts between the two legs of a
/// narrow loop are missed. It is a little over the relaxation's 6, so that what that solver leaves
/// alone is not reported.
pub(crate) const SAME_STRAND_RADII: f64 = 7.0;
/// Relaxed yarns keep at least this clearance. Under 1, since samples of the relaxation and of this
/// check lie at different places of the curve.
pub(crate) const MIN_RELAXED: f64 = 0.98;
/// Least clearance of laid yarns, which are squeezed flat where they cross. The relaxation pushes
/// them apart to a little more than this (0.6 of their radii).
const MIN_SQUEEZED: f64 = 0.55;
/// Cloth that is thicker than its press says by more than this factor gets a warning.
const MAX_THICKER: f64 = 1.02;
/// Limits for one segment, of pairs that it forms and of candidates that it checks. Regular cloth
/// has a few dozen. Beyond, whole yarns lie in one place; the rest of them adds nothing to the
/// answer, and the work would grow with the square of their number.
const MAX_PAIRS: usize = 1000;
pub(crate) const MAX_CANDIDATES: usize = 5 * MAX_PAIRS;

/// The distances between yarns, in figures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// Least distance between centre lines over the sum of their radii (2r for equal yarns). Under
    /// 1 yarns cut each other. It is 2 at most, since the search ends there.
    pub min_over_2r: f64,
    /// Pairs of path segments nearer than twice touching.
    pub pairs: usize,
    /// Pairs nearer than touching.
    pub pairs_below_1: usize,
    /// Pairs nearer than 0.95 of touching.
    pub pairs_below_95: usize,
}

impl Clearance {
    /// No yarn is near another.
    pub const FREE: Self =
        Self { min_over_2r: CUTOFF, pairs: 0, pairs_below_1: 0, pairs_below_95: 0 };

    /// Adds a pair at a distance over the sum of its radii.
    fn with(mut self, ratio: f64) -> Self {
        if ratio < CUTOFF {
            self.min_over_2r = self.min_over_2r.min(ratio);
            self.pairs += 1;
            self.pairs_below_1 += usize::from(ratio < 1.0);
            self.pairs_below_95 += usize::from(ratio < 0.95);
        }
        self
    }

    /// The clearance of two sets of pairs together.
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

/// A segment of a sampled path.
#[derive(Clone, Copy, Debug)]
struct SampledSegment {
    from: DVec3,
    to: DVec3,
    radius: f64,
    /// Yarn length from the start of the strand to its middle.
    along: f64,
    strand: u32,
}

impl SampledSegment {
    fn middle(&self) -> DVec3 {
        self.from.midpoint(self.to)
    }

    /// Its bounding sphere, grown by its share of the cutoff.
    fn sphere(&self) -> Sphere {
        Sphere {
            middle: self.middle().as_vec3(),
            reach: rounded_up(CUTOFF * self.radius + self.from.distance(self.to) / 2.0),
        }
    }

    /// Least distance to another, over the sum of the radii.
    fn ratio(&self, other: &Self) -> f64 {
        let (share, share_other) =
            curve::nearest_of_segments([self.from, self.to], [other.from, other.to]);
        self.from.lerp(self.to, share).distance(other.from.lerp(other.to, share_other))
            / (self.radius + other.radius)
    }
}

/// A length in single precision, never shorter than it was. The share of growth is a hundred times
/// the rounding of places and lengths on a repeat.
#[expect(clippy::cast_possible_truncation, reason = "rounding is what the growth is for")]
fn rounded_up(length: f64) -> f32 {
    (length * (1.0 + 1e-5)) as f32
}

/// Paths of yarn as segments, to be measured against each other.
#[derive(Clone, Debug, Default)]
pub struct SampledPaths {
    segments: Vec<SampledSegment>,
    strands: u32,
}

impl SampledPaths {
    /// Adds one uninterrupted strand through `points`, mm, with its radius. Spans with neither end
    /// `near` the place of interest are left out.
    pub fn add(&mut self, points: &[DVec3], radius: f64, near: impl Fn(DVec3) -> bool) {
        let mut along = 0.0;
        for index in 0..points.len().saturating_sub(1) {
            if !near(points[index]) && !near(points[index + 1]) {
                // The chord stands for the span's length, which is a little more. Lengths along the
                // strand are compared only within a few radii, so an error far away cancels.
                along += points[index].distance(points[index + 1]);
                continue;
            }
            let span = curve::span(points, index);
            let mut from = points[index];
            for step in 1..=SAMPLES {
                let to = span.at(f64::from(step) / f64::from(SAMPLES));
                let length = from.distance(to);
                self.segments.push(SampledSegment {
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

    /// Compares each segment with all others nearby. A pair counts once.
    ///
    /// `repeat` gives the repeat in which a place lies. Only segments of repeat (0, 0) are compared
    /// with others. A pair across two repeats appears again one repeat further, seen from its other
    /// segment, so only one of the two sides counts.
    pub fn clearance(&self, repeat: impl Fn(DVec3) -> I64Vec2 + Sync) -> Clearance {
        let longest = self.segments.iter().map(|s| s.from.distance(s.to)).fold(0.0, f64::max);
        let thickest = self.segments.iter().map(|s| s.radius).fold(0.0, f64::max);
        // Two segments within the cutoff have their middles within this distance, so the cells
        // around a segment hold all its partners.
        let mut hash = SpatialHash::default();
        hash.fill(
            self.segments.iter().map(SampledSegment::sphere),
            rounded_up(2.0 * CUTOFF * thickest + longest),
        );
        (0..self.segments.len())
            .into_par_iter()
            .with_min_len(1024)
            .map_init(Vec::new, |found, at| self.clearance_of(at, &hash, found, &repeat))
            .reduce(|| Clearance::FREE, Clearance::and)
    }

    /// Compares one segment with all others nearby, if it lies in repeat (0, 0). `found` is memory
    /// that is used again.
    fn clearance_of(
        &self,
        at: usize,
        hash: &SpatialHash,
        found: &mut Vec<u32>,
        repeat: impl Fn(DVec3) -> I64Vec2,
    ) -> Clearance {
        let s = &self.segments[at];
        let mut clearance = Clearance::FREE;
        if repeat(s.middle()) != I64Vec2::ZERO {
            return clearance;
        }
        // Bounding spheres reject most candidates for a tenth of the work of a distance.
        hash.around(s.sphere(), MAX_CANDIDATES, found);
        for &other in &*found {
            let other = other as usize;
            let t = &self.segments[other];
            let same_strand =
                s.strand == t.strand && (s.along - t.along).abs() <= SAME_STRAND_RADII * s.radius;
            // Each pair comes from both of its sides. Within the repeat the lower index counts it;
            // across a border, the side that finds its partner above or to the right.
            let there = repeat(t.middle());
            let counts_elsewhere =
                if there == I64Vec2::ZERO { other < at } else { (there.y, there.x) < (0, 0) };
            if same_strand || counts_elsewhere {
                continue;
            }
            clearance = clearance.with(s.ratio(t));
            if clearance.pairs > MAX_PAIRS {
                break;
            }
        }
        clearance
    }
}

/// Measures a fabric's pattern, whose thickest yarns are drawn with `radius` mm.
///
/// ```
/// use warpknit_core::{fabric::Fabric, knit::{Pattern, clearance}};
/// let tricot = Fabric::named("tricot").unwrap();
/// let found = clearance::measure(&tricot, &Pattern::new(&tricot), tricot.radius());
/// assert!(found.min_over_2r > 0.98);
/// ```
#[must_use]
pub fn measure(fabric: &Fabric, pattern: &Pattern, radius: f64) -> Clearance {
    let mesh = StructureMesh::anchored_at(fabric, DVec2::ZERO);
    let (wales, courses) =
        (fabric.threading_repeat().min(MAX_WALES), fabric.repeat().min(MAX_COURSES));
    let spacing = DVec2::new(fabric.wale_spacing(), fabric.course_spacing());
    let cell = spacing * DVec2::new(f64::from(index32(wales)), f64::from(index32(courses)));
    // Yarns thicker than two wales cut everything around them. The least distance is then found
    // within two wales, and a wider margin would only take time.
    let margin = (8.0 * radius).min(2.0 * spacing.x);
    // No span between data points is much longer than a wale or a course.
    let reach = 1.5 * spacing.max_element() + 2.0 * CUTOFF * radius;
    let near = |p: DVec3| {
        (p.truncate() + reach).cmpge(DVec2::ZERO).all() && (p.truncate() - reach).cmple(cell).all()
    };
    let mut paths = SampledPaths::default();
    let mut knitted = Knitted::default();
    for (bar, thickness) in fabric.thickness().into_iter().enumerate() {
        let (beside, along, step) = if pattern.runs_across(bar) {
            (cell.y, cell.x, spacing.x)
        } else {
            (cell.x, cell.y, spacing.y)
        };
        // Four steps more at both ends: their heads and feet reach into the repeat, and beyond them
        // yarns have to continue as in endless cloth.
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

/// Warns the designer of yarns that do not fit into the fabric, a line each. There is none where
/// all is well.
///
/// `radius` is the radius of the thickest yarn as drawn, `clearance` the answer of [`measure`] for
/// it.
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
            "the thickest yarn, {:.3} mm by its count, is too thick for {wales} wales and \
             {courses} courses per cm: loops hold {:.3} mm at most, and so it is drawn; take a \
             finer yarn or lower densities",
            2.0 * true_radius,
            2.0 * fabric.radius()
        ));
    }
    if pattern.relaxation().is_none() {
        warnings.push(format!(
            "the repeat of over {MAX_RELAXED_LAPS} laps is too large to be relaxed: yarns lie as \
             laid out, and may cut each other"
        ));
    }
    let wanted = fabric.finish.thickness;
    if let (Some(wanted), Some(relaxation)) = (wanted, pattern.relaxation())
        && relaxation.thickness > MAX_THICKER * wanted
    {
        warnings.push(format!(
            "the press can't make the cloth {wanted:.3} mm thick: its yarns move aside to {:.3} mm \
             and no further",
            relaxation.thickness
        ));
    }
    if fabric.is_laid() {
        if clearance.min_over_2r < MIN_SQUEEZED {
            warnings.push(format!(
                "laid yarns cut each other: the nearest lie at {:.2} of their thickness, and \
                 {MIN_SQUEEZED} is what yarns stand that are squeezed flat where they cross; move \
                 their paths, or take finer yarns",
                clearance.min_over_2r
            ));
        }
    } else if clearance.min_over_2r < MIN_RELAXED {
        let place = pattern.tightest().map_or_else(String::new, |(bar, tag)| {
            let [wale, course] = pattern.in_repeat(tag);
            format!(", bar {} on needle {} in course {},", bar + 1, wale + 1, course + 1)
        });
        // Cloth of yarns that are finer by a share has as much more room; so has cloth of lower
        // densities, in both directions.
        let room = clearance.min_over_2r.max(0.1);
        warnings.push(format!(
            "yarns drawn {:.3} mm thick cut each other: {} pairs of path segments in a repeat are \
             nearer than their thickness, the nearest{place} at {:.2} of it; yarns of {:.0} % of \
             their count would fit, or {:.1} wales and {:.1} courses per cm, or fewer loops on a \
             needle",
            2.0 * radius,
            clearance.pairs_below_1,
            clearance.min_over_2r,
            100.0 * room * room,
            room * wales,
            room * courses
        ));
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_in_closed_form() {
        let segment = |from: (f64, f64, f64), to: (f64, f64, f64)| SampledSegment {
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
            let found = measure(&fabric, &Pattern::unrelaxed(&fabric), fabric.radius());
            (found.pairs, found.pairs_below_1)
        };
        let (once, twice) = (count(1), count(2));
        assert!(once.1 > 0);
        assert_eq!((2 * once.0, 2 * once.1), twice);
    }
}
