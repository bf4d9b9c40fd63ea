//! The yarns of one repeat: the data points of every lap and of the underlap that follows it.
//!
//! In: a fabric's bars and the [`WaleLattice`] of its control points. Out: a [`Repeat`], which
//! holds for each threaded guide (or weft) a yarn as a chain that continues in the next repeat.
//! Coordinates are mm from gap 0 of guide 0 in course 0. Cost: linear in the points, about 0.2 µs
//! each. Not promised: yarns that keep clear of each other, which is `relax`'s work.

use std::ops::Range;

use glam::DVec3;

use super::lattice::WaleLattice;
use super::stitch::{self, LapDirections, Layer};
use super::weft::{self, Loops};
use super::{Bed, PointKind, Tag};
use crate::fabric::lapping::Chain;
use crate::fabric::motif::Motif;
use crate::fabric::{Bar, Lay};
use crate::ids::index32;

/// All yarns of a repeat: structure of arrays.
#[derive(Clone, Debug, Default)]
pub(super) struct Repeat {
    pub(super) points: Vec<DVec3>,
    pub(super) tags: Vec<Tag>,
    /// First point of each stitch.
    pub(super) stitches: Vec<u32>,
    pub(super) yarns: Vec<RepeatYarn>,
}

/// One yarn of the repeat.
#[derive(Clone, Debug)]
pub(super) struct RepeatYarn {
    /// Its bar, front first.
    pub(super) bar: usize,
    /// The guide that leads it, a weft's course, or 0 for a laid strand.
    pub(super) guide: usize,
    /// The first stitch of each course (of each wale, for a weft), and the end of the last.
    pub(super) steps: Vec<u32>,
    /// From a point to the same point in the next repeat, mm.
    pub(super) period: DVec3,
}

impl Repeat {
    /// Adds the yarn that a guide of a bar leads over `steps` courses. For a weft `guide` is its
    /// course and `steps` counts wales.
    pub(super) fn add_yarn(
        &mut self,
        bar: &Bar,
        number: usize,
        layer: &Layer,
        lattice: &WaleLattice,
        [guide, steps]: [usize; 2],
    ) {
        let layout = YarnLayout { layer, lattice, guide: i64::from(index32(guide)) };
        let count = i64::from(index32(steps));
        let mut yarn = RepeatYarn {
            bar: number,
            guide,
            steps: Vec::with_capacity(steps + 1),
            period: layout.period(&bar.lay, count),
        };
        for step in 0..count {
            yarn.steps.push(index32(self.stitches.len()));
            match &bar.lay {
                Lay::Lapping(chain) => layout.add_lap(chain, step, self),
                Lay::Weft => layout.add_weft(step, self),
            }
        }
        yarn.steps.push(index32(self.stitches.len()));
        self.yarns.push(yarn);
    }

    /// Adds a course of a weft knit over `wales` wales, from a feeder's yarn.
    pub(super) fn add_course(
        &mut self,
        feeder: usize,
        motif: &Motif,
        loops: &Loops,
        course: usize,
        wales: usize,
    ) {
        let (first, end) = (index32(self.stitches.len()), i64::from(index32(wales)));
        let period = DVec3::X * (f64::from(index32(wales)) * loops.spacing.x);
        let points = loops.data_points(motif, i64::from(index32(course)), 0..end);
        for (wale, points) in (0..).zip(points.chunks_exact(weft::POINTS)) {
            self.begin_stitch();
            for (point, &place) in (1..).zip(points) {
                let course = i32::try_from(course).expect("repeats are limited");
                let (kind, bed) = (PointKind::WeftLoop, Bed::Front);
                self.push(place, Tag { course, wale, kind, bed, point });
            }
        }
        let steps = (first..=first + index32(wales)).collect();
        self.yarns.push(RepeatYarn { bar: feeder, guide: course, steps, period });
    }

    /// Adds a strand of laid cloth. Its whole repeat counts as one stitch.
    pub(super) fn add_path(
        &mut self,
        strand: usize,
        path: impl Iterator<Item = DVec3>,
        period: DVec3,
    ) {
        let first = index32(self.stitches.len());
        self.begin_stitch();
        for (point, place) in (1..).zip(path) {
            let (kind, bed) = (PointKind::Inlay, Bed::Front);
            self.push(place, Tag { course: 0, wale: 0, kind, bed, point });
        }
        self.yarns.push(RepeatYarn {
            bar: strand,
            guide: 0,
            steps: vec![first, first + 1],
            period,
        });
    }

    /// Points of a yarn.
    pub(super) fn points_of(&self, yarn: &RepeatYarn) -> Range<usize> {
        self.points_of_steps(yarn, 0..yarn.steps.len() - 1)
    }

    /// Points of some steps of a yarn.
    pub(super) fn points_of_steps(&self, yarn: &RepeatYarn, steps: Range<usize>) -> Range<usize> {
        let [start, end] = [steps.start, steps.end].map(|step| {
            self.stitches
                .get(yarn.steps[step] as usize)
                .map_or(self.points.len(), |&point| point as usize)
        });
        start..end
    }

    /// A yarn's points over one repeat, with one before and two after. Spans 1 to the last but two
    /// belong to the repeat. The others only shape them: each span depends on a point before and a
    /// point after it.
    pub(super) fn unrolled(&self, yarn: &RepeatYarn) -> Vec<DVec3> {
        let points = &self.points[self.points_of(yarn)];
        let count = i64::from(index32(points.len()));
        (-1..count + 2)
            .map(|at| {
                let place = usize::try_from(at.rem_euclid(count));
                #[expect(clippy::cast_precision_loss, reason = "a repeat or two")]
                let image_shift = at.div_euclid(count) as f64;
                points[place.expect("a remainder is not negative")] + yarn.period * image_shift
            })
            .collect()
    }

    fn begin_stitch(&mut self) {
        self.stitches.push(index32(self.points.len()));
    }

    fn push(&mut self, point: DVec3, tag: Tag) {
        self.points.push(point);
        self.tags.push(tag);
    }
}

/// All that lays out one guide's yarn (or one weft).
struct YarnLayout<'a> {
    layer: &'a Layer,
    lattice: &'a WaleLattice,
    guide: i64,
}

impl YarnLayout<'_> {
    /// From a point to the same point `steps` steps further, mm.
    #[expect(clippy::cast_precision_loss, reason = "repeats are limited to 10 000 courses")]
    fn period(&self, lay: &Lay, steps: i64) -> DVec3 {
        match lay {
            Lay::Lapping(_) => DVec3::new(0.0, steps as f64 * self.layer.course_spacing, 0.0),
            Lay::Weft => DVec3::new(steps as f64 * self.layer.wale_spacing, 0.0, 0.0),
        }
    }

    /// Adds the lap of a course: its loops or its inlay, and the underlap to the next course.
    fn add_lap(&self, chain: &Chain, course: i64, repeat: &mut Repeat) {
        let lap = chain.lap(course);
        if lap.overlap() == 0 {
            let points = self.inlay(chain, course);
            repeat.begin_stitch();
            (1u16..).zip(points).for_each(|(number, point)| {
                repeat.push(point, self.tag(course, lap.needle(), PointKind::Inlay, number));
            });
            return;
        }
        let needles = lap.needles().count();
        for (at, needle) in lap.needles().enumerate() {
            let points = self.loop_points(chain, course, at);
            repeat.begin_stitch();
            (1u16..).zip(points).for_each(|(number, point)| {
                repeat.push(point, self.tag(course, needle, PointKind::WarpLoop, number));
            });
            // The underlap joins this loop's exit foot (S8) to the next loop's entry foot (S1). An
            // overlap over two needles has such a stretch between its two loops as well.
            let next = if at + 1 < needles {
                self.loop_points(chain, course, at + 1)[0]
            } else {
                self.first_point(chain, course + 1)
            };
            let underlap = stitch::underlap_points(points[7], next, self.layer.wale_spacing);
            for (number, point) in (1u16..).zip(underlap) {
                repeat.push(point, self.tag(course, needle, PointKind::Underlap, number));
            }
        }
    }

    /// Adds a straight weft at one wale: a point behind the needle and one in the gap beside it.
    fn add_weft(&self, wale: i64, repeat: &mut Repeat) {
        let wales = i32::try_from(wale).expect("repeats are limited");
        repeat.begin_stitch();
        for (number, half) in [(1, 0.5), (2, 1.0)] {
            let course = i32::try_from(self.guide).expect("repeats are limited");
            let y = (f64::from(course) + 0.5) * self.layer.course_spacing;
            let point = self.lattice.between_wales(f64::from(wales) + half, y, -self.layer.depth);
            let (kind, bed) = (PointKind::Inlay, Bed::Front);
            repeat.push(point, Tag { course, wale: wales, kind, bed, point: number });
        }
    }

    /// The first point of the lap of a course.
    fn first_point(&self, chain: &Chain, course: i64) -> DVec3 {
        if chain.lap(course).overlap() == 0 {
            self.inlay(chain, course)[0]
        } else {
            self.loop_points(chain, course, 0)[0]
        }
    }

    /// S1 to S8 of the `at`th loop of a lap.
    fn loop_points(&self, chain: &Chain, course: i64, at: usize) -> [DVec3; 8] {
        let lap = chain.lap(course);
        let last = lap.needles().count() - 1;
        let needle = lap.needles().nth(at).expect("a lap has that loop");
        // Between the loops of one lap the yarn continues in the overlap's direction, as the
        // underlap of an open lap does.
        let underlap_before = if at == 0 { chain.underlap(course - 1) } else { lap.overlap() };
        let underlap_after = if at == last { chain.underlap(course) } else { lap.overlap() };
        let directions = LapDirections { overlap: lap.overlap(), underlap_before, underlap_after };
        let points = self.layer.loop_points(directions);
        points.map(|point| {
            self.lattice.on_wale(self.guide + i64::from(needle), course, point, self.layer)
        })
    }

    /// Points of an inlay from its gap to its gap in the next course.
    fn inlay(&self, chain: &Chain, course: i64) -> Vec<DVec3> {
        let (from, to) = (chain.lap(course).from, chain.lap(course + 1).from);
        #[expect(
            clippy::cast_precision_loss,
            reason = "guides and courses are counted in thousands"
        )]
        let (gap_0, bottom) = (self.guide as f64, course as f64 * self.layer.course_spacing);
        let run = self.layer.inlay_points(from, to);
        let last = run.len() - 1;
        let side = i64::from((to - from).signum());
        let mut points = Vec::with_capacity(run.len());
        for (at, (gap, y)) in run.into_iter().enumerate() {
            let (y, z) = (bottom + y, -self.layer.depth);
            // A moving inlay reverses at both ends of its run, close to the outermost wale that it
            // passes. Between them it crosses wales, whose bends it follows.
            points.push(match at {
                0 if last > 0 => {
                    self.lattice.beside_wale(self.wale_beside(from, side), -side, y, z)
                }
                _ if last > 0 && at == last => {
                    self.lattice.beside_wale(self.wale_beside(to, -side), side, y, z)
                }
                _ => self.lattice.between_wales(gap_0 + gap, y, z),
            });
        }
        points
    }

    /// The wale to the right (`side` 1) or to the left (-1) of one of the guide's gaps. Wale w
    /// stands between gaps w and w + 1.
    fn wale_beside(&self, gap: i32, side: i64) -> i64 {
        self.guide + i64::from(gap) + (side - 1) / 2
    }

    fn tag(&self, course: i64, needle: i32, kind: PointKind, point: u16) -> Tag {
        let course = i32::try_from(course).expect("repeats are limited");
        let wale = i32::try_from(self.guide).expect("threadings are limited") + needle;
        Tag { course, wale, kind, bed: Bed::Front, point }
    }
}
