//! Walks along points from triangle to triangle, several at a time where triangles are small.
//!
//! In: a [`Locator`] of a panel that covers no place twice, and points in order. Out: the location
//! of each.
//!
//! Method: successive points of a yarn mostly lie in one triangle or in the next. Four of them are
//! tested against the triangle of the last one, and the first outside tells across which edge the
//! next triangle lies (`triangle`). A step to the next triangle waits for the one before, some 40
//! cycles. Where triangles hold few points, that takes most of the time. There the points are cut
//! into stretches, and [`WALKS`] of them are walked along in turn, a step each: the processor works
//! at one while it waits for another. Such a step branches on where points lie only if it is stuck,
//! since no processor foretells that.
//!
//! Where a walk can't decide, or has gone on without a point, [`Locator::find`] finds the next one.

use glam::DVec3;

use super::topology::BORDER;
use super::triangle::{LANES, Side};
use super::{Locator, SurfacePoint};
use crate::number::double;

/// Walks that take turns. Fewer leave the processor waiting; with more, the last ones of a block
/// walk alone for longer.
const WALKS: usize = 4;
/// Successive points in a triangle from which on there is a single walk. At 3 points it would take
/// 1.3 times as long as [`WALKS`] in turn, at 7 and 9 as long, and at 17 it takes 0.87 times.
const MANY_POINTS: f64 = 7.0;
/// Steps between points that tell how near they lie to each other.
const SAMPLE: usize = 64;
/// Points of a stretch. Shorter ones spend more on their starts; of longer ones a block has too few
/// to keep all walks going to its end.
const STRETCH: usize = 512;
/// Triangles in succession without a point, after which the walk to the next point starts near it.
/// With fewer, walks start anew that were nearly done; with many more, the way from the end of one
/// yarn to the start of the next is walked.
const PATIENCE: usize = 4;

/// A walk along a stretch of points.
struct PointWalk<'p> {
    points: &'p [DVec3],
    located: &'p mut [Option<SurfacePoint>],
    /// Points that are located.
    at: usize,
    /// Where it is.
    triangle: u32,
    /// Triangles that it may still pass without a point.
    patience: usize,
}

impl PointWalk<'_> {
    /// Goes on in a triangle after a step that has located some points. False if too many steps in
    /// succession have located none.
    #[inline(always)]
    fn goes_on_in(&mut self, triangle: u32, located: usize) -> bool {
        self.triangle = triangle;
        self.patience = if located > 0 { PATIENCE } else { self.patience - 1 };
        self.patience > 0
    }
}

impl Locator<'_> {
    /// Locates points of a panel that covers no place twice.
    pub(super) fn walk_along(&self, points: &[DVec3], located: &mut [Option<SurfacePoint>]) {
        if self.points_a_triangle(points) > MANY_POINTS {
            return self.walk_on(&mut self.start((points, located)));
        }
        let mut stretches = points.chunks(STRETCH).zip(located.chunks_mut(STRETCH));
        let mut walks: Vec<_> =
            stretches.by_ref().take(WALKS).map(|stretch| self.start(stretch)).collect();
        while !walks.is_empty() {
            let mut turn = 0;
            while let Some(walk) = walks.get_mut(turn) {
                if self.step(walk) || self.next_point(walk) {
                    turn += 1;
                } else if let Some(stretch) = stretches.next() {
                    *walk = self.start(stretch);
                } else {
                    walks.swap_remove(turn);
                }
            }
        }
    }

    /// About how many successive points lie in a triangle, by the first of them. Not a number for
    /// a single point, which is as good as few.
    fn points_a_triangle(&self, points: &[DVec3]) -> f64 {
        let steps = points.array_windows().take(SAMPLE);
        let count = steps.len();
        let way: f64 = steps.map(|[a, b]| a.truncate().distance(b.truncate())).sum();
        self.side * double(count) / way
    }

    /// Walks along all points by itself.
    #[inline(never)]
    fn walk_on(&self, walk: &mut PointWalk<'_>) {
        while self.long_step(walk) || self.next_point(walk) {}
    }

    /// Locates the next points up to the last in the walk's triangle, and goes on to the triangle
    /// across the edge beyond which the next one lies. False if the walk is stuck.
    #[inline(always)]
    fn long_step(&self, walk: &mut PointWalk<'_>) -> bool {
        let current = &self.triangles[walk.triangle as usize];
        let (points, located) = (&walk.points[walk.at..], &mut walk.located[walk.at..]);
        let (run, side) = current.locate_run(walk.triangle, points, located);
        walk.at += run;
        let Some(Side { edge, is_certain: true }) = side else { return false };
        if current.neighbours[edge] == BORDER {
            return false;
        }
        walk.goes_on_in(current.neighbours[edge], run)
    }

    /// The walk along a stretch, before its first point.
    fn start<'p>(
        &self,
        (points, located): (&'p [DVec3], &'p mut [Option<SurfacePoint>]),
    ) -> PointWalk<'p> {
        let triangle = points.first().map_or(0, |p| self.starts.near(p.truncate()));
        PointWalk { points, located, at: 0, triangle, patience: PATIENCE }
    }

    /// Locates those of the next four points that lie in the walk's triangle, up to the first that
    /// doesn't, and goes on to the triangle across the edge beyond which that one lies. False if
    /// the walk is stuck.
    #[inline(always)]
    fn step(&self, walk: &mut PointWalk<'_>) -> bool {
        let current = &self.triangles[walk.triangle as usize];
        let (points, located) = (&walk.points[walk.at..], &mut walk.located[walk.at..]);
        let (Some(points), Some(located)) = (points.first_chunk(), located.first_chunk_mut())
        else {
            return false;
        };
        let run = current.locate_four(walk.triangle, points, located);
        walk.at += run;
        let stays = run == LANES;
        let Some(SurfacePoint { b, c, .. }) = located[run % LANES] else { return false };
        let side = current.side_of(b, c);
        let across = current.neighbours[side.edge];
        if !stays & (!side.is_certain | (across == BORDER)) {
            return false;
        }
        walk.goes_on_in(if stays { walk.triangle } else { across }, run)
    }

    /// Locates the next point by itself, with those behind it that are surely off the panel. False
    /// if there is none.
    #[inline(never)]
    fn next_point(&self, walk: &mut PointWalk<'_>) -> bool {
        let Some(point) = walk.points.get(walk.at) else { return false };
        let p = point.truncate();
        if walk.patience == 0 {
            walk.triangle = self.starts.near(p);
        }
        walk.patience = PATIENCE;
        let found = self.find(p, &mut walk.triangle).map(|found| self.point(found, p));
        walk.located[walk.at] = found;
        walk.at += 1;
        if found.is_none() {
            // Yarns are planned a little longer than the panel.
            walk.at += self.skip_off(&walk.points[walk.at..], &mut walk.located[walk.at..]);
        }
        true
    }

    /// Counts the points from the first on that are surely off the panel.
    fn skip_off(&self, points: &[DVec3], located: &mut [Option<SurfacePoint>]) -> usize {
        let Some(outline) = &self.outline else { return 0 };
        let off = points.iter().take_while(|p| outline.is_off(p.truncate())).count();
        located[..off].fill(None);
        off
    }
}
