//! The check that loops interlock: is every new loop drawn through the old loops of its needle?
//!
//! In: a fabric and its [`Pattern`]. Out: [`Links`], counted over one repeat.
//!
//! Method: the linking number of closed curves (Gauss 1833), counted as signed crossings in the
//! plane of the cloth. An old loop is closed far below its feet. A leg of the new loop is closed
//! from its head far above, round the back and into its foot from behind. The new loop is drawn
//! through the old one where both legs, each walked from foot to head, have the same linking number
//! with it, 1 or -1. Only crossings at which the leg lies over the old loop count, since the curve's
//! way back lies under everything. Reverse loops of weft knits are drawn through from the front, so
//! they are looked at from the back. Cost: some microseconds a pair of loops.
//!
//! Not promised: anything of yarns that make no loops there; the clearance tells whether those cut
//! each other.

use std::collections::BTreeMap;

use glam::DVec3;

use super::Pattern;
use super::loops::LoopCurve;
use crate::fabric::Fabric;
use crate::ids::index32;

/// How far curves are closed beyond their loops, courses: out of reach of either.
const FAR: f64 = 50.0;

/// How a repeat's loops interlock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Links {
    /// Pairs of a new loop and an old one on the same needle.
    pub checked: usize,
    /// Pairs of which the new loop is not drawn through the old one.
    pub wrong: usize,
    /// The first of them.
    pub first_wrong: Option<WrongLink>,
    /// Loops that no loop of the next course is drawn through, since their needle gets none there.
    /// The needle holds such a loop over, or drops it.
    pub held: usize,
}

/// A new loop that is not drawn through an old one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WrongLink {
    /// Wale of the needle in the repeat, from 0.
    pub wale: usize,
    /// Course of the new loop in the repeat, from 0.
    pub new_course: usize,
    /// Bar or feeder of the old loop, front first, from 0.
    pub old_bar: usize,
    /// Bar or feeder of the new loop.
    pub new_bar: usize,
}

impl Links {
    /// Tells the designer of loops that are not drawn through; `None` where all are.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        let WrongLink { wale, new_course, old_bar, new_bar } = self.first_wrong?;
        Some(format!(
            "{} of {} loops are not drawn through the old loop of their needle; the first is that \
             of bar {} on needle {} in course {}, with the old loop of bar {}: thinner yarns, lower \
             densities or fewer loops on a needle give them room",
            self.wrong,
            self.checked,
            new_bar + 1,
            wale + 1,
            new_course + 1,
            old_bar + 1
        ))
    }
}

/// Checks one repeat. Repeats that are too large to be relaxed are not checked.
///
/// ```
/// use warpknit_core::{fabric::Fabric, knit::{Pattern, links}};
/// let locknit = Fabric::named("locknit").unwrap();
/// let found = links::measure(&locknit, &Pattern::new(&locknit));
/// // In each course two loops are drawn through two old ones; the repeat has two courses.
/// assert_eq!((found.checked, found.wrong), (8, 0));
/// ```
#[must_use]
pub fn measure(fabric: &Fabric, pattern: &Pattern) -> Links {
    let mut links = Links::default();
    if pattern.relaxation.is_none() {
        return links;
    }
    let courses = pattern.size[1];
    let period = DVec3::Y * (f64::from(index32(courses)) * pattern.spacing.y);
    let width = DVec3::X * (f64::from(index32(pattern.size[0])) * pattern.spacing.x);
    let far = DVec3::Y * (FAR * pattern.spacing.y);
    let loops = pattern.loops(fabric);
    let mut by_needle: BTreeMap<[usize; 2], Vec<&LoopCurve>> = BTreeMap::new();
    for new in &loops {
        by_needle.entry(new.needle).or_default().push(new);
    }
    for old in &loops {
        let course = old.needle[1];
        let next = (course + 1) % courses;
        let up = if next == 0 { period } else { DVec3::ZERO };
        let shift = up + width * f64::from(old.repeats);
        let closed = closed_below(&old.points, far);
        let new_loops = by_needle.get(&[old.head, next]);
        links.held += usize::from(new_loops.is_none());
        for new in new_loops.into_iter().flatten() {
            links.checked += 1;
            let new_points: Vec<_> = new.points.iter().map(|&point| point + shift).collect();
            if !is_drawn_through(&new_points, &closed, far, new.is_reverse) {
                links.wrong += 1;
                links.first_wrong.get_or_insert(WrongLink {
                    wale: old.head,
                    new_course: next,
                    old_bar: old.bar,
                    new_bar: new.bar,
                });
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

/// Whether both legs of a new loop pass through the closed curve of an old one, from behind or, for
/// a reverse loop, from the front.
fn is_drawn_through(new: &[DVec3], old: &[DVec3], far: DVec3, is_reverse: bool) -> bool {
    if !is_reverse {
        return passes_through(new, old, far);
    }
    let mirrored = |points: &[DVec3]| -> Vec<DVec3> {
        points.iter().map(|&point| point * DVec3::new(1.0, 1.0, -1.0)).collect()
    };
    passes_through(&mirrored(new), &mirrored(old), far)
}

/// Whether both legs of a new loop pass through the closed curve of an old one from behind.
fn passes_through(new: &[DVec3], old: &[DVec3], far: DVec3) -> bool {
    let half = new.len().div_ceil(2);
    let mut legs: [Vec<DVec3>; 2] =
        [new.iter().take(half).copied().collect(), new.iter().rev().take(half).copied().collect()];
    legs.iter_mut().for_each(|leg| leg.push(leg[leg.len() - 1] + far));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_knits_are_linked_everywhere() {
        for name in crate::fabric::builtin::names() {
            let fabric = Fabric::named(name).unwrap();
            let links = measure(&fabric, &Pattern::new(&fabric));
            assert_eq!((links.wrong, links.warning()), (0, None), "{name}");
            assert!(links.checked > 0, "{name}");
        }
    }

    #[test]
    fn a_loop_beside_the_old_one_is_found() {
        let fabric = Fabric::named("tricot").unwrap();
        let mut pattern = Pattern::new(&fabric);
        // The front bar's loops lie in front of everything else: nothing holds them.
        let front = pattern.repeat.points_of(&pattern.repeat.yarns[0]);
        pattern.repeat.points[front].iter_mut().for_each(|point| point.z += 10.0);
        let links = measure(&fabric, &pattern);
        assert_eq!((links.checked, links.wrong), (8, 2));
        let wrong = links.first_wrong.unwrap();
        assert_eq!((wrong.old_bar, wrong.new_bar), (0, 1));
        assert!(links.warning().unwrap().contains("bar 2 on needle 1"));
    }

    #[test]
    fn a_loop_drawn_through_to_the_wrong_side_is_found() {
        let fabric = Fabric::named("jersey").unwrap();
        let pattern = Pattern::new(&fabric);
        let face = measure(&fabric, &pattern);
        assert_eq!((face.checked, face.wrong), (1, 0));
        // The same loops, called reverse ones.
        let purl = fabric.to_string().replace("\nk\n", "\np\n");
        let links = measure(&Fabric::parse(&purl).unwrap(), &pattern);
        assert_eq!((links.checked, links.wrong), (1, 1));
    }

    #[test]
    fn loops_that_are_held_over_are_counted() {
        let chains = ["1-0/1-2//".to_owned()];
        let fabric = Fabric::named("tricot").unwrap().with_chains(&chains, &[]).unwrap();
        assert_eq!(measure(&fabric, &Pattern::new(&fabric)).held, 0);
        let half = fabric.to_string().replace("threading = \"I\"", "threading = \"I.\"");
        let half = Fabric::parse(&half).unwrap();
        // Its yarns go to and fro between two needles, so each needle gets a loop in every other
        // course.
        let links = measure(&half, &Pattern::new(&half));
        assert_eq!((links.checked, links.held), (0, 2));
    }
}
