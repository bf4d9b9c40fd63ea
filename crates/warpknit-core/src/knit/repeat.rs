//! The yarns of one repeat: the data points of every lap and of the underlap that follows it.
//!
//! In: a fabric's bars and the [`WaleLattice`] of its control points. Out: a [`Repeat`], which
//! holds for each threaded guide (or weft) a yarn as a chain that continues in the next repeat.
//! Coordinates are mm from gap 0 of guide 0 in course 0. Cost: linear in the points, about 0.2 µs
//! each. Not promised: yarns that keep clear of each other, which is `relax`'s work.

use std::ops::Range;

use glam::{DVec2, DVec3};

use super::lattice::WaleLattice;
use super::stitch::{LoopPlace, StitchLayout};
use super::weft::{self, Loops};
use super::{Bed, PointKind, Tag};
use crate::fabric::lapping::{Chain, Lap};
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
        layout: &StitchLayout<'_>,
        lattice: &WaleLattice,
        [guide, steps]: [usize; 2],
    ) {
        let layout = YarnLayout { bar: number, layout, lattice, guide: i64::from(index32(guide)) };
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
    bar: usize,
    layout: &'a StitchLayout<'a>,
    lattice: &'a WaleLattice,
    guide: i64,
}

impl YarnLayout<'_> {
    /// From a point to the same point `steps` steps further, mm.
    #[expect(clippy::cast_precision_loss, reason = "repeats are limited to 10 000 courses")]
    fn period(&self, lay: &Lay, steps: i64) -> DVec3 {
        let spacing = self.layout.spacing();
        match lay {
            Lay::Lapping(_) => DVec3::new(0.0, steps as f64 * spacing.y, 0.0),
            Lay::Weft => DVec3::new(steps as f64 * spacing.x, 0.0, 0.0),
        }
    }

    /// Adds the lap of a course: its loops or its inlay, and the underlap to the next course.
    fn add_lap(&self, chain: &Chain, course: i64, repeat: &mut Repeat) {
        let lap = chain.lap(course);
        if lap.overlap() == 0 {
            self.add_inlay(chain, course, repeat);
            return;
        }
        let needles = lap.needles().count();
        for (at, needle) in lap.needles().enumerate() {
            let points = self.loop_points(lap, course, at);
            repeat.begin_stitch();
            self.push(repeat, points, self.tag(course, needle, PointKind::WarpLoop));
            // The underlap joins this loop's exit foot (S8) to the next loop's entry foot (S1). An
            // overlap over two needles has such a stretch between its two loops as well.
            let underlap = if at + 1 < needles {
                let next = self.loop_points(lap, course, at + 1)[0];
                self.layout.underlap_points(points[7], next, 1).collect()
            } else {
                self.underlap(chain, course, points[7])
            };
            self.push(repeat, underlap, self.tag(course, needle, PointKind::Underlap));
        }
    }

    /// Adds the inlay of a course, and the yarn's way up to the next loop if one follows.
    fn add_inlay(&self, chain: &Chain, course: i64, repeat: &mut Repeat) {
        let (lap, next) = (chain.lap(course), chain.lap(course + 1));
        let gaps = [lap, next].map(|lap| self.guide + i64::from(lap.from));
        let points = self.layout.inlay_points(self.bar, gaps, course);
        repeat.begin_stitch();
        self.push(repeat, points, self.tag(course, lap.needle(), PointKind::Inlay));
        if next.overlap() != 0 {
            let foot = self.loop_points(next, course + 1, 0)[0];
            let turn = self.layout.turn(foot, -1.0);
            self.push(repeat, [turn], self.tag(course, lap.needle(), PointKind::Underlap));
        }
    }

    /// Inner points of the underlap that leaves the last loop of a course at `foot`.
    fn underlap(&self, chain: &Chain, course: i64, foot: DVec3) -> Vec<DVec3> {
        let (lap, next) = (chain.lap(course), chain.lap(course + 1));
        let last = lap.needles().last().expect("only laps that knit have underlaps");
        let from = self.layout.turn(foot, 1.0);
        // Wales from the last needle to the next one, and the place where the yarn arrives.
        let (wales, to) = if let Some(needle) = next.needles().next() {
            let foot = self.loop_points(next, course + 1, 0)[0];
            (needle.abs_diff(last), self.layout.turn(foot, -1.0))
        } else {
            let gap = self.guide + i64::from(next.from);
            let to = self.layout.turn_into_gap(self.bar, gap, course + 1);
            // The gap beside the needle is half a wale away.
            (next.from.abs_diff(last).min(next.from.abs_diff(last + 1)), to)
        };
        let mut points = vec![from];
        points.extend(self.layout.underlap_points(from, to, wales));
        points.push(to);
        points
    }

    /// Adds a straight weft at one wale: a point behind the needle and one in the gap beside it.
    fn add_weft(&self, wale: i64, repeat: &mut Repeat) {
        let [course, wales] =
            [self.guide, wale].map(|count| i32::try_from(count).expect("repeats are limited"));
        let spacing = self.layout.spacing();
        let points = [0.5, 1.0].map(|half| {
            let place = DVec2::new(f64::from(wales) + half, f64::from(course) + 0.5);
            (place * spacing).extend(-self.layout.depth(self.bar))
        });
        let (kind, bed) = (PointKind::Inlay, Bed::Front);
        repeat.begin_stitch();
        self.push(repeat, points, Tag { course, wale: wales, kind, bed, point: 0 });
    }

    /// S1 to S8 of the `at`th loop of a lap, on straight wales.
    fn loop_points(&self, lap: Lap, course: i64, at: usize) -> [DVec3; 8] {
        self.layout.loop_points(self.bar, lap, LoopPlace { guide: self.guide, course, at })
    }

    /// Adds points of one kind, bent with their wales and numbered from 1.
    fn push(&self, repeat: &mut Repeat, points: impl IntoIterator<Item = DVec3>, tag: Tag) {
        for (point, place) in (1..).zip(points) {
            repeat.push(self.lattice.bend(place), Tag { point, ..tag });
        }
    }

    fn tag(&self, course: i64, needle: i32, kind: PointKind) -> Tag {
        let course = i32::try_from(course).expect("repeats are limited");
        let wale = i32::try_from(self.guide).expect("threadings are limited") + needle;
        Tag { course, wale, kind, bed: Bed::Front, point: 0 }
    }
}
