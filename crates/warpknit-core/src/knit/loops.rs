//! The loops of a repeat as sampled curves.
//!
//! In: a fabric and its [`Pattern`]. Out: a [`LoopCurve`] for each loop, and the width of each bar's
//! loops ([`Pattern::loop_widths`]). Cost: some microseconds a loop. Not promised: loops of a width
//! where legs are not upright, such as those of a wale that leans; the width is then that of the
//! slanting pair.

use std::ops::RangeInclusive;

use glam::DVec3;

use super::repeat::RepeatYarn;
use super::{Pattern, PointKind, as_i64, wrap};
use crate::fabric::motif::ChartCell;
use crate::fabric::{Fabric, Structure};
use crate::yarn::curve;

/// Segments of each span between data points.
const SAMPLES: u32 = 6;

/// A loop as a sampled curve from foot to foot.
pub(super) struct LoopCurve {
    pub(super) bar: usize,
    /// Wale and course of its needle, in the repeat.
    pub(super) needle: [usize; 2],
    /// The wale on whose needle its head hangs, in the repeat. Cables carry it to another one.
    pub(super) head: usize,
    /// How many repeats to the right that needle is.
    pub(super) repeats: i32,
    /// Whether it is drawn through the old loop from the face to the back, as purl stitches are.
    pub(super) is_reverse: bool,
    pub(super) points: Vec<DVec3>,
}

impl LoopCurve {
    /// Distance of its two legs at half of its height, mm.
    fn width(&self) -> Option<f64> {
        let (first, last) = (self.points.first()?, self.points.last()?);
        let top = self.points.iter().map(|point| point.y).fold(f64::NEG_INFINITY, f64::max);
        let half = first.midpoint(*last).y.midpoint(top);
        let legs = [
            crossing(self.points.iter().copied(), half)?,
            crossing(self.points.iter().rev().copied(), half)?,
        ];
        Some(legs[0].distance(legs[1]))
    }
}

/// The first place at which a curve rises to a height.
fn crossing(mut points: impl Iterator<Item = DVec3>, height: f64) -> Option<DVec3> {
    let mut from = points.next()?;
    points.find_map(|to| {
        let start = std::mem::replace(&mut from, to);
        let share = (height - start.y) / (to.y - start.y);
        (start.y < height && to.y >= height).then(|| start.lerp(to, share))
    })
}

impl Pattern {
    /// Mean width of each bar's (or feeder's) loops, between the middles of their legs at half of
    /// their height, mm. Bars that make no loops have none.
    pub(super) fn loop_widths(&self, fabric: &Fabric) -> Vec<Option<f64>> {
        let mut sums = vec![(0.0, 0_u32); self.bars.len()];
        for one in self.loops(fabric) {
            if let Some(width) = one.width() {
                let (sum, count) = &mut sums[one.bar];
                *sum += width;
                *count += 1;
            }
        }
        sums.into_iter().map(|(sum, count)| (count > 0).then(|| sum / f64::from(count))).collect()
    }

    /// All loops of the repeat, moved into it.
    pub(super) fn loops(&self, fabric: &Fabric) -> Vec<LoopCurve> {
        let mut loops = Vec::new();
        for yarn in &self.repeat.yarns {
            self.add_loops(fabric, yarn, &mut loops);
        }
        loops
    }

    /// Adds the loops of one yarn.
    fn add_loops(&self, fabric: &Fabric, yarn: &RepeatYarn, loops: &mut Vec<LoopCurve>) {
        let points = self.repeat.unrolled(yarn);
        for (at, tag) in (0..).zip(&self.repeat.tags[self.repeat.points_of(yarn)]) {
            let Some(feet) = feet(tag.kind).filter(|_| tag.point == 1) else { continue };
            let [wale, course] = [tag.wale, tag.course].map(i64::from);
            let [home, home_course] = self.in_repeat(*tag);
            #[expect(clippy::cast_precision_loss, reason = "a repeat or two")]
            let shift = DVec3::X * ((wale - as_i64(home)) as f64 * self.spacing.x);
            let cell = chart_cell(fabric, wale, course);
            let carried = cell.map_or(0, |cell| i64::from(cell.carried));
            let hangs_on = as_i64(home) + carried;
            let repeats = hangs_on.div_euclid(as_i64(self.size[0]));
            loops.push(LoopCurve {
                bar: yarn.bar,
                needle: [home, home_course],
                head: wrap(hangs_on, self.size[0]),
                repeats: i32::try_from(repeats).expect("cables reach over some wales"),
                is_reverse: cell.is_some_and(|cell| cell.reverse),
                // The unrolled points start one before the yarn's first, so point n of this loop
                // has index `at + n`.
                points: sampled(&points, at + feet.start()..=at + feet.end(), shift),
            });
        }
    }
}

/// The points of a loop that are its feet; `None` for what is no loop.
fn feet(kind: PointKind) -> Option<RangeInclusive<usize>> {
    match kind {
        PointKind::WarpLoop => Some(1..=8),
        // The first place of a weft-knit loop lies between two loops; each is followed by a place
        // halfway to the next.
        PointKind::WeftLoop => Some(3..=15),
        PointKind::Inlay | PointKind::Underlap => None,
    }
}

/// What the chart of a weft knit says of a loop.
fn chart_cell(fabric: &Fabric, wale: i64, course: i64) -> Option<ChartCell> {
    match &fabric.structure {
        Structure::Weft(knit) => Some(knit.motif.cell(wale, course)),
        Structure::Warp(_) | Structure::Laid(_) => None,
    }
}

/// The curve through `points` from the first to the last of a range of them, less `shift`.
fn sampled(points: &[DVec3], range: RangeInclusive<usize>, shift: DVec3) -> Vec<DVec3> {
    let (first, last) = range.into_inner();
    let mut curve = Vec::with_capacity((last - first) * SAMPLES as usize + 1);
    for span in first..last {
        let span = curve::span(points, span);
        let shares = (0..SAMPLES).map(|step| f64::from(step) / f64::from(SAMPLES));
        curve.extend(shares.map(|share| span.at(share) - shift));
    }
    curve.push(points[last] - shift);
    curve
}
