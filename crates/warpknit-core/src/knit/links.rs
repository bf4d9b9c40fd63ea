//! The check that loops interlock: is every new loop drawn through the old loops of its needle?
//!
//! In: a fabric's [`Pattern`]. Out: [`Links`], counted over one repeat.
//!
//! Method: the linking number of closed curves (Gauss 1833), counted as signed crossings in the
//! plane of the cloth. An old loop is closed far below its feet. A leg of the new loop is closed
//! from its head far above, round the back and into its foot from behind. The new loop is drawn
//! through the old one where both legs, each walked from foot to head, have the same linking number
//! with it, 1 or -1. Only crossings at which the leg lies over the old loop count, since the curve's
//! way back lies under everything. Cost: some microseconds a pair of loops.
//!
//! Not promised: anything of yarns that make no loops there; the clearance tells whether those cut
//! each other.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::repeat::RepeatYarn;
use super::{Pattern, PointKind};
use crate::ids::index32;
use crate::yarn::curve;

/// Segments of each span between data points.
const SAMPLES: u32 = 6;
/// Data points of a warp knit's loop.
const LOOP_POINTS: usize = 8;
/// How far curves are closed beyond their loops, courses: out of reach of either.
const FAR: f64 = 50.0;

/// How a repeat's loops interlock.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Links {
    /// Pairs of a new loop and an old one on the same needle.
    pub checked: usize,
    /// Pairs of which the new loop is not drawn through the old one.
    pub wrong: usize,
    /// The first of them.
    pub first_wrong: Option<WrongLink>,
}

/// A new loop that is not drawn through an old one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WrongLink {
    /// Wale of the needle in the repeat, from 0.
    pub wale: usize,
    /// Course of the old loop in the repeat, from 0.
    pub course: usize,
    /// Bar of the old loop, front first, from 0.
    pub old_bar: usize,
    /// Bar of the new loop.
    pub new_bar: usize,
}

/// A loop as a sampled curve from foot to foot.
struct LoopCurve {
    bar: usize,
    points: Vec<DVec3>,
}

/// The loops of each needle and course of a repeat.
type Loops = BTreeMap<[usize; 2], Vec<LoopCurve>>;

/// Checks one repeat.
///
/// ```
/// use warpknit_core::{fabric::Fabric, knit::{Pattern, links}};
/// let found = links::measure(&Pattern::new(&Fabric::named("locknit").unwrap()));
/// // In each course two loops are drawn through two old ones; the repeat has two courses.
/// assert_eq!((found.checked, found.wrong), (8, 0));
/// ```
#[must_use]
pub fn measure(pattern: &Pattern) -> Links {
    let [wales, courses] = pattern.size;
    let period = pattern.spacing * DVec2::new(0.0, f64::from(index32(courses)));
    let far = DVec3::Y * (FAR * pattern.spacing.y);
    let loops = pattern.loops([wales, courses]);
    let mut links = Links::default();
    for (&[wale, course], old_loops) in &loops {
        let next = (course + 1) % courses;
        let shift = if next == 0 { period.extend(0.0) } else { DVec3::ZERO };
        let Some(new_loops) = loops.get(&[wale, next]) else { continue };
        for old in old_loops {
            let closed = closed_below(&old.points, far);
            for new in new_loops {
                links.checked += 1;
                if !is_drawn_through(&new.points, &closed, shift, far) {
                    links.wrong += 1;
                    links.first_wrong.get_or_insert(WrongLink {
                        wale,
                        course,
                        old_bar: old.bar,
                        new_bar: new.bar,
                    });
                }
            }
        }
    }
    links
}

/// The curve of an old loop with both feet led down out of reach. The two ends need no joint:
/// nothing passes there.
fn closed_below(points: &[DVec3], far: DVec3) -> Vec<DVec3> {
    let mut closed = Vec::with_capacity(points.len() + 2);
    closed.push(points[0] - far);
    closed.extend(points);
    closed.push(points[points.len() - 1] - far);
    closed
}

/// Whether both legs of a new loop, moved by `shift`, pass through the closed curve of an old one.
fn is_drawn_through(new: &[DVec3], old: &[DVec3], shift: DVec3, far: DVec3) -> bool {
    let half = new.len().div_ceil(2);
    let moved = |points: &mut dyn Iterator<Item = &DVec3>| -> Vec<DVec3> {
        let mut leg: Vec<_> = points.map(|&point| point + shift).collect();
        leg.push(leg[leg.len() - 1] + far);
        leg
    };
    let legs = [moved(&mut new.iter().take(half)), moved(&mut new.iter().rev().take(half))];
    let [one, other] = legs.map(|leg| crossings_over(&leg, old));
    one == other && one.abs() == 1
}

/// Signed crossings, seen from the front, at which the first curve lies over the second.
fn crossings_over(over: &[DVec3], under: &[DVec3]) -> i32 {
    over.windows(2)
        .flat_map(|one| under.windows(2).map(move |other| crossing_over(one, other)))
        .sum()
}

/// The sign of a crossing of two segments in the plane; 0 where they do not cross, or the first
/// one lies behind.
fn crossing_over(one: &[DVec3], other: &[DVec3]) -> i32 {
    let [from, to, start, end] = [one[0], one[1], other[0], other[1]].map(DVec3::truncate);
    if from.max(to).cmplt(start.min(end)).any() || start.max(end).cmplt(from.min(to)).any() {
        return 0;
    }
    let (along, across, between) = (to - from, end - start, start - from);
    let turn = along.perp_dot(across);
    let (share, share_other) = (between.perp_dot(across) / turn, between.perp_dot(along) / turn);
    if !(0.0..1.0).contains(&share) || !(0.0..1.0).contains(&share_other) {
        return 0;
    }
    let heights = [
        one[0].z + share * (one[1].z - one[0].z),
        other[0].z + share_other * (other[1].z - other[0].z),
    ];
    match heights[0] > heights[1] {
        true if turn > 0.0 => 1,
        true => -1,
        false => 0,
    }
}

impl Pattern {
    /// All loops of the repeat, moved into it, by needle and course.
    fn loops(&self, size: [usize; 2]) -> Loops {
        let mut loops = Loops::new();
        for yarn in &self.repeat.yarns {
            self.add_loops(yarn, size, &mut loops);
        }
        loops
    }

    /// Adds the loops of one yarn.
    fn add_loops(&self, yarn: &RepeatYarn, [wales, courses]: [usize; 2], loops: &mut Loops) {
        let points = self.repeat.unrolled(yarn);
        let range = self.repeat.points_of(yarn);
        for (at, tag) in (0..).zip(&self.repeat.tags[range]) {
            if tag.kind != PointKind::WarpLoop || tag.point != 1 {
                continue;
            }
            // The unrolled points start one before the yarn's first.
            let mut sampled = Vec::with_capacity(7 * SAMPLES as usize + 1);
            let repeats = i64::from(tag.wale).div_euclid(as_i64(wales));
            #[expect(clippy::cast_precision_loss, reason = "a repeat or two")]
            let home = DVec3::X * (repeats as f64 * f64::from(index32(wales)) * self.spacing.x);
            for span in at + 1..at + LOOP_POINTS {
                let span = curve::span(&points, span);
                let shares = (0..SAMPLES).map(|step| f64::from(step) / f64::from(SAMPLES));
                sampled.extend(shares.map(|share| span.at(share) - home));
            }
            sampled.push(points[at + LOOP_POINTS] - home);
            let place = [(tag.wale, wales), (tag.course, courses)].map(|(at, size)| {
                usize::try_from(i64::from(at).rem_euclid(as_i64(size)))
                    .expect("a remainder is not negative")
            });
            loops.entry(place).or_default().push(LoopCurve { bar: yarn.bar, points: sampled });
        }
    }
}

fn as_i64(count: usize) -> i64 {
    i64::from(index32(count))
}
