//! The yarns of one repeat: every lap's data points, with the underlap that follows.
//!
//! In: a fabric's bars and the [`Lattice`] of its control points. Out: a [`Repeat`], each threaded
//! guide's (or weft's) yarn as a chain that goes on into the next repeat. Coordinates are mm from
//! gap 0 of guide 0 in course 0. Cost: linear in the points, about 0.2 µs each.

use std::ops::Range;

use glam::DVec3;

use super::lattice::Lattice;
use super::stitch::{self, Layer, Turns};
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
    pub(super) yarns: Vec<Yarn>,
}

/// One yarn of the repeat.
#[derive(Clone, Debug)]
pub(super) struct Yarn {
    /// Its bar, front first.
    pub(super) bar: usize,
    /// The guide that leads it, or a weft's course; 0 of a laid strand.
    pub(super) guide: usize,
    /// The first stitch of each course (of each wale, for a weft), and the end of the last.
    pub(super) steps: Vec<u32>,
    /// From a point to the same one in the next repeat, mm.
    pub(super) period: DVec3,
}

impl Repeat {
    /// Lays out the yarn that a guide of a bar leads over `steps` courses (for a weft: the one of a
    /// course, over `steps` wales).
    pub(super) fn add_yarn(
        &mut self,
        bar: &Bar,
        number: usize,
        layer: &Layer,
        lattice: &Lattice,
        [guide, steps]: [usize; 2],
    ) {
        let laying = Laying { layer, lattice, guide: i64::from(index32(guide)) };
        let count = i64::from(index32(steps));
        let period = laying.period(&bar.lay, count);
        let mut yarn = Yarn { bar: number, guide, steps: Vec::with_capacity(steps + 1), period };
        for step in 0..count {
            yarn.steps.push(index32(self.stitches.len()));
            match &bar.lay {
                Lay::Lapping(chain) => laying.add_lap(chain, step, self),
                Lay::Weft => laying.add_weft(step, self),
            }
        }
        yarn.steps.push(index32(self.stitches.len()));
        self.yarns.push(yarn);
    }

    /// Lays out a course of a weft knit, which a feeder brings, over `wales` wales.
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
        self.yarns.push(Yarn { bar: feeder, guide: course, steps, period });
    }

    /// Lays out a strand of laid cloth, one stitch of it a cell.
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
        self.yarns.push(Yarn { bar: strand, guide: 0, steps: vec![first, first + 1], period });
    }

    /// Points of a yarn.
    pub(super) fn points_of(&self, yarn: &Yarn) -> Range<usize> {
        self.points_of_steps(yarn, 0..yarn.steps.len() - 1)
    }

    /// Points of some steps of a yarn.
    pub(super) fn points_of_steps(&self, yarn: &Yarn, steps: Range<usize>) -> Range<usize> {
        let start = |step: usize| {
            self.stitches
                .get(yarn.steps[step] as usize)
                .map_or(self.points.len(), |&point| point as usize)
        };
        start(steps.start)..start(steps.end)
    }

    /// A yarn's points over one repeat, with one before and two after: the spans from 1 to the last
    /// but two are the repeat's.
    pub(super) fn unrolled(&self, yarn: &Yarn) -> Vec<DVec3> {
        let points = &self.points[self.points_of(yarn)];
        let count = i64::from(index32(points.len()));
        let image = |at: i64| {
            let place = usize::try_from(at.rem_euclid(count)).expect("a remainder is not negative");
            #[expect(clippy::cast_precision_loss, reason = "a repeat or two")]
            let turns = at.div_euclid(count) as f64;
            points[place] + yarn.period * turns
        };
        (-1..count + 2).map(image).collect()
    }

    fn begin_stitch(&mut self) {
        self.stitches.push(index32(self.points.len()));
    }

    fn push(&mut self, point: DVec3, tag: Tag) {
        self.points.push(point);
        self.tags.push(tag);
    }
}

/// One guide's yarn while it is laid out.
struct Laying<'a> {
    layer: &'a Layer,
    lattice: &'a Lattice,
    guide: i64,
}

impl Laying<'_> {
    #[expect(clippy::cast_precision_loss, reason = "repeats are limited to 10 000 courses")]
    fn period(&self, lay: &Lay, steps: i64) -> DVec3 {
        match lay {
            Lay::Lapping(_) => DVec3::new(0.0, steps as f64 * self.layer.course_spacing, 0.0),
            Lay::Weft => DVec3::new(steps as f64 * self.layer.wale_spacing, 0.0, 0.0),
        }
    }

    /// The lap of a course: its loops or its inlay, and the underlap to the next course.
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
            let next = if at + 1 < needles {
                self.loop_points(chain, course, at + 1)[0]
            } else {
                self.first_point(chain, course + 1)
            };
            for (number, turn) in
                (1u16..).zip(stitch::turns(points[7], next, self.layer.wale_spacing))
            {
                repeat.push(turn, self.tag(course, needle, PointKind::Turn, number));
            }
        }
    }

    /// A straight weft at one wale: behind the needle, and in the gap beside it.
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

    /// Where the lap of a course begins.
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
        // Between the loops of one lap the yarn goes on in the overlap's direction, as an underlap
        // of an open lap does.
        let before = if at == 0 { chain.underlap(course - 1) } else { lap.overlap() };
        let after = if at == last { chain.underlap(course) } else { lap.overlap() };
        let points = self.layer.loop_points(Turns { overlap: lap.overlap(), before, after });
        points.map(|point| {
            self.lattice.on_wale(self.guide + i64::from(needle), course, point, self.layer)
        })
    }

    /// An inlay on its way to the next course's first gap.
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
        // Wale w stands between gaps w and w + 1.
        let wale_after = |gap: i32, side: i64| self.guide + i64::from(gap) + (side - 1) / 2;
        let place = |(at, (gap, y)): (usize, (f64, f64))| {
            let (y, z) = (bottom + y, -self.layer.depth);
            match at {
                0 if last > 0 => self.lattice.beside_wale(wale_after(from, side), -side, y, z),
                _ if last > 0 && at == last => {
                    self.lattice.beside_wale(wale_after(to, -side), side, y, z)
                }
                _ => self.lattice.between_wales(gap_0 + gap, y, z),
            }
        };
        run.into_iter().enumerate().map(place).collect()
    }

    fn tag(&self, course: i64, needle: i32, kind: PointKind, point: u16) -> Tag {
        let course = i32::try_from(course).expect("repeats are limited");
        let wale = i32::try_from(self.guide).expect("threadings are limited") + needle;
        Tag { course, wale, kind, bed: Bed::Front, point }
    }
}
