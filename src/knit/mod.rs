//! From lapping to data points: the yarns of a fabric on a flat panel.
//!
//! In: a [`Fabric`] and where its [`StructureMesh`] lies. Out: [`Knitted`] data points, course after course, eight a loop, in panel
//! axes (x across the wales, y along them, z towards the technical face), mm. A garment is never seen here.
//!
//! A lap's points depend on its bar and its place in the chain alone, so [`Pattern`] works them out once a repeat and laying a yarn is
//! an addition a point (about 5 ns). Source: Liu, Kyosev, Jiang 2022, section 2; the specification's knit page.
//! Not promised: overlaps over two needles are refused ([`KnitError`]); wales stay straight, no yarn is relaxed.

pub mod clearance;
pub mod mesh;
pub mod numbers;
mod stitch;

use std::ops::Range;

use glam::{DVec2, DVec3};

use crate::fabric::{Bar, Fabric};
use crate::ids::index32;
use mesh::StructureMesh;
use stitch::{Layer, Turns};

/// What a data point is part of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointKind {
    /// S1 to S8 of a loop.
    Loop,
    /// A point of a yarn that is laid in.
    Inlay,
    /// Where a long underlap leaves one loop or reaches the next.
    Turn,
}

/// Where a data point belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tag {
    /// Course, counted from the panel's lowest.
    pub course: i32,
    /// Wale, counted from the panel's leftmost.
    pub wale: i32,
    /// Loop, inlay or turn.
    pub kind: PointKind,
    /// 1 to 8 in a loop; counted from 1 within other kinds.
    pub point: u16,
}

/// Data points of some yarns, in the order in which the yarns run.
#[derive(Clone, Debug, Default)]
pub struct Knitted {
    /// Positions on the flat panel, mm; z is the depth.
    pub points: Vec<DVec3>,
    /// What each point is.
    pub tags: Vec<Tag>,
    /// Index of the first point of each stitch (a lap with the underlap that follows it).
    pub stitches: Vec<u32>,
}

impl Knitted {
    /// Forgets all points but keeps the memory.
    pub fn clear(&mut self) {
        self.points.clear();
        self.tags.clear();
        self.stitches.clear();
    }
}

/// Why a fabric can't be knitted.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum KnitError {
    /// A two-needle overlap.
    #[error("bar {bar}, course {course}: overlaps over two needles are not knitted yet; lap over one, such as 1-0")]
    TwoNeedles {
        /// The bar, front bar 1.
        bar: usize,
        /// The course, first course 1.
        course: usize,
    },
}

/// One lap with the underlap that follows it, relative to its guide's gap 0 and its course.
#[derive(Clone, Debug)]
struct LapPoints {
    points: Vec<DVec3>,
    /// Tags of guide 0 in course 0.
    tags: Vec<Tag>,
}

/// One bar's repeat.
#[derive(Clone, Debug)]
struct BarPattern {
    laps: Vec<LapPoints>,
    /// Lowest and highest point of the repeat relative to guide 0, course 0: x, y.
    bounds: (DVec2, DVec2),
}

/// The repeat of a fabric as data points.
#[derive(Clone, Debug)]
pub struct Pattern {
    bars: Vec<BarPattern>,
    wale_spacing: f64,
    course_spacing: f64,
}

impl Pattern {
    /// Works out the repeat of a fabric. Cost: microseconds, proportional to the chains' lengths.
    ///
    /// # Errors
    /// [`KnitError`] for laps that can't be knitted.
    ///
    /// ```
    /// use warpknit::{fabric::Fabric, knit::Pattern};
    /// let pattern = Pattern::new(&Fabric::named("tricot").unwrap()).unwrap();
    /// assert_eq!(pattern.points_per_repeat(0), 20); // two loops of eight points, two underlaps of two turns
    /// ```
    pub fn new(fabric: &Fabric) -> Result<Self, KnitError> {
        let radius = fabric.radius();
        let nesting: Vec<_> = (0..fabric.bars.len()).map(|bar| knitting_bars_behind(fabric, bar)).collect();
        let inlays = fabric.bars.iter().map(|bar| bar.chain.is_inlay());
        let depths = stitch::layer_depths(&inlays.zip(nesting.iter().copied()).collect::<Vec<_>>());
        let bars = fabric.bars.iter().enumerate().map(|(at, bar)| {
            let layer = Layer {
                wale_spacing: fabric.wale_spacing(),
                course_spacing: fabric.course_spacing(),
                radius,
                nesting: f64::from(nesting[at]),
                depth: depths[at] * radius,
            };
            BarPattern::new(bar, &layer, at + 1)
        });
        let bars = bars.collect::<Result<_, _>>()?;
        Ok(Self { bars, wale_spacing: fabric.wale_spacing(), course_spacing: fabric.course_spacing() })
    }

    /// Data points of one yarn of a bar in one repeat of its chain.
    #[must_use]
    pub fn points_per_repeat(&self, bar: usize) -> usize {
        self.bars[bar].laps.iter().map(|lap| lap.points.len()).sum()
    }

    /// The guides of a bar whose yarns may touch `x` (mm from gap 0 of guide 0).
    #[must_use]
    pub fn guides_across(&self, bar: usize, x: Range<f64>) -> Range<i64> {
        let (low, high) = self.bars[bar].bounds;
        let first = ((x.start - high.x) / self.wale_spacing).floor();
        let last = ((x.end - low.x) / self.wale_spacing).ceil();
        whole(first)..whole(last) + 1
    }

    /// The x that a guide's yarn covers, mm from gap 0 of guide 0.
    #[must_use]
    pub fn strip(&self, bar: usize, guide: i64) -> Range<f64> {
        let (low, high) = self.bars[bar].bounds;
        #[expect(clippy::cast_precision_loss, reason = "guides are counted in thousands")]
        let x = guide as f64 * self.wale_spacing;
        x + low.x..x + high.x
    }

    /// The courses of a bar whose points may touch `y` (mm from course 0).
    #[must_use]
    pub fn courses_along(&self, bar: usize, y: Range<f64>) -> Range<i64> {
        let (low, high) = self.bars[bar].bounds;
        whole(((y.start - high.y) / self.course_spacing).floor())..whole(((y.end - low.y) / self.course_spacing).ceil()) + 1
    }

    /// Lays one yarn: the data points of a guide in `courses`, appended to `knitted`.
    ///
    /// # Panics
    /// If `bar` is not one of the fabric's.
    pub fn lay(&self, bar: usize, guide: i64, courses: Range<i64>, mesh: &StructureMesh, knitted: &mut Knitted) {
        let laps = &self.bars[bar].laps;
        let repeat = i64::try_from(laps.len()).expect("a chain is far shorter than 2^63");
        let guide = i32::try_from(guide).expect("a panel has fewer wales than 2^31");
        let gap_0 = DVec2::new(-self.wale_spacing / 2.0, 0.0);
        for course in courses {
            let lap = &laps[usize::try_from(course.rem_euclid(repeat)).expect("a remainder is not negative")];
            let course = i32::try_from(course).expect("a panel has fewer courses than 2^31");
            let at = (mesh.vertex(guide, course) + gap_0).extend(0.0);
            knitted.stitches.push(index32(knitted.points.len()));
            knitted.points.extend(lap.points.iter().map(|&point| point + at));
            knitted.tags.extend(lap.tags.iter().map(|tag| Tag { course, wale: tag.wale + guide, ..*tag }));
        }
    }
}

/// A coordinate over a spacing as a whole number; panels are metres and spacings over a micrometre, so it fits.
fn whole(steps: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "rounded by the caller, and `as` saturates")]
    let whole = steps as i64;
    whole
}

/// How many knitting bars behind this one ever put their loop on a needle in the same course as it does.
fn knitting_bars_behind(fabric: &Fabric, bar: usize) -> u32 {
    let along = i64::try_from(fabric.repeat()).expect("repeats are limited");
    let across = i64::try_from(fabric.threading_repeat()).expect("repeats are limited");
    let meets = |other: &&Bar| (0..along).any(|c| (0..across).any(|w| fabric.bars[bar].loops_on(w, c) && other.loops_on(w, c)));
    index32(fabric.bars[bar + 1..].iter().filter(meets).count())
}

impl BarPattern {
    fn new(bar: &Bar, layer: &Layer, number: usize) -> Result<Self, KnitError> {
        let chain = &bar.chain;
        let courses = i64::try_from(chain.laps().len()).expect("a chain is far shorter than 2^63");
        if let Some(at) = chain.laps().iter().position(|lap| (lap.to - lap.from).abs() > 1) {
            return Err(KnitError::TwoNeedles { bar: number, course: at + 1 });
        }
        let laps: Vec<_> = (0..courses).map(|course| LapPoints::new(bar, layer, course)).collect();
        let points = || laps.iter().flat_map(|lap| &lap.points).map(|point| point.truncate());
        let low = points().fold(DVec2::INFINITY, DVec2::min);
        let high = points().fold(DVec2::NEG_INFINITY, DVec2::max);
        Ok(Self { laps, bounds: (low, high) })
    }
}

impl LapPoints {
    fn new(bar: &Bar, layer: &Layer, course: i64) -> Self {
        let lap = bar.chain.lap(course);
        let tag = |kind| move |point: u16| Tag { course: 0, wale: lap.needle(), kind, point };
        let points = lap_points(bar, layer, course);
        let kind = if lap.overlap() == 0 { PointKind::Inlay } else { PointKind::Loop };
        let mut tags: Vec<_> = (1..=u16::MAX).take(points.len()).map(tag(kind)).collect();
        let next: Vec<_> = lap_points(bar, layer, course + 1);
        let next_first = next[0] + DVec3::new(0.0, layer.course_spacing, 0.0);
        let turns = if kind == PointKind::Loop { turns(points[points.len() - 1], next_first, layer.wale_spacing) } else { None };
        tags.extend((1..).take(turns.map_or(0, |turns| turns.len())).map(tag(PointKind::Turn)));
        let points: Vec<_> = points.into_iter().chain(turns.into_iter().flatten()).collect();
        debug_assert_eq!(points.len(), tags.len(), "an inlay has at most MAX_GAP + 2 points");
        Self { points, tags }
    }
}

/// The points of a lap without its underlap, relative to gap 0 of the guide and to the course.
fn lap_points(bar: &Bar, layer: &Layer, course: i64) -> Vec<DVec3> {
    let lap = bar.chain.lap(course);
    if lap.overlap() == 0 {
        return layer.inlay_points(lap.from, bar.chain.lap(course + 1).from);
    }
    let turns = Turns { overlap: lap.overlap(), before: bar.chain.underlap(course - 1), after: bar.chain.underlap(course) };
    let control_point = DVec3::new((f64::from(lap.needle()) + 0.5) * layer.wale_spacing, 0.0, 0.0);
    layer.loop_points(turns).map(|point| point + control_point).to_vec()
}

/// The two turns of an underlap that is longer than .57 W, .22 W from its ends: without them long spans bulge in depth.
fn turns(from: DVec3, to: DVec3, wale_spacing: f64) -> Option<[DVec3; 2]> {
    let length = (to - from).truncate().length();
    let inset = 0.22 * wale_spacing / length;
    (length > 0.57 * wale_spacing).then(|| [from.lerp(to, inset), to.lerp(from, inset)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tricot_yarn(guide: i64) -> Knitted {
        let fabric = Fabric::named("tricot").unwrap();
        let mesh = StructureMesh::anchored_at(&fabric, DVec2::ZERO);
        let mut knitted = Knitted::default();
        Pattern::new(&fabric).unwrap().lay(1, guide, 0..4, &mesh, &mut knitted);
        knitted
    }

    #[test]
    fn loops_stand_on_the_structure_mesh() {
        let fabric = Fabric::named("tricot").unwrap();
        let mesh = StructureMesh::anchored_at(&fabric, DVec2::ZERO);
        let knitted = tricot_yarn(3);
        assert_eq!(knitted.stitches, [0, 10, 20, 30]);
        for (course, &first) in (0..).zip(&knitted.stitches) {
            let first = first as usize;
            let tag = knitted.tags[first];
            assert_eq!((tag.wale, tag.course), (3 + course % 2, course), "1-0/1-2 laps needles 0 and 1 in turn");
            let head = (knitted.points[first + 3] + knitted.points[first + 4]) / 2.0;
            assert!((head.x - mesh.vertex(tag.wale, tag.course).x).abs() < 1e-12);
        }
    }

    #[test]
    fn bounds_hold_every_point() {
        let fabric = Fabric::named("locknit").unwrap();
        let pattern = Pattern::new(&fabric).unwrap();
        let mesh = StructureMesh::anchored_at(&fabric, DVec2::ZERO);
        for bar in 0..2 {
            let mut knitted = Knitted::default();
            pattern.lay(bar, 5, 7..9, &mesh, &mut knitted);
            let strip = pattern.strip(bar, 5);
            for point in &knitted.points {
                assert!(strip.start - 1e-12 <= point.x && point.x <= strip.end + 1e-12);
                assert!(pattern.guides_across(bar, point.x..point.x).contains(&5));
                assert!(pattern.courses_along(bar, point.y..point.y).start <= 8);
                assert!(pattern.courses_along(bar, point.y..point.y).end > 7);
            }
        }
    }

    #[test]
    fn every_point_of_a_very_long_inlay_has_its_tag() {
        let text = Fabric::named("tricot").unwrap().to_string().replace("\"1-2/1-0//\"", "\"0-0/4096-4096//\"");
        let fabric = Fabric::parse(&text).unwrap();
        let mesh = StructureMesh::anchored_at(&fabric, DVec2::ZERO);
        let mut knitted = Knitted::default();
        Pattern::new(&fabric).unwrap().lay(0, 0, 0..2, &mesh, &mut knitted);
        assert_eq!(knitted.points.len(), 2 * 4098);
        assert_eq!(knitted.tags.len(), knitted.points.len());
        assert_eq!(knitted.tags[4097].point, 4098);
    }

    #[test]
    fn two_needle_overlaps_are_refused_by_place() {
        let text = Fabric::named("tricot").unwrap().to_string().replace("\"1-2/1-0//\"", "\"1-2/2-0//\"");
        let error = Pattern::new(&Fabric::parse(&text).unwrap()).unwrap_err();
        assert_eq!(error, KnitError::TwoNeedles { bar: 1, course: 2 });
    }
}
