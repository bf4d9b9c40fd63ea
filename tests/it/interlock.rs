//! Loops interlock: seen from the technical face, both legs of a new loop pass in front of the old loop's head and its feet pass
//! behind the old legs, for every pair of bars. Counted by signed crossings in the plane.

use glam::{DVec2, DVec3};
use warpknit::fabric::{Fabric, builtin};
use warpknit::knit::mesh::StructureMesh;
use warpknit::knit::{Knitted, Pattern, PointKind};
use warpknit::yarn::curve::span;

const SAMPLES: usize = 14;

/// A path in the plane: for each sample the span it lies in, counted from S1, and where it is.
type Path = Vec<(i64, DVec3)>;

/// The yarn of a bar that loops on a wale in a course, if one does: from the underlap before its loop to the one after it.
fn yarn_path(fabric: &Fabric, pattern: &Pattern, bar: usize, (wale, course): (i64, i64)) -> Option<Path> {
    if !fabric.bars[bar].loops_on(wale, course) {
        return None;
    }
    let mesh = StructureMesh::anchored_at(fabric, DVec2::ZERO);
    let guides = (wale - 10..wale + 10).filter(|&guide| fabric.bars[bar].threading.carries(guide));
    let mut paths = guides.filter_map(|guide| {
        let mut knitted = Knitted::default();
        pattern.lay(bar, guide, course - 1..course + 2, &mesh, &mut knitted);
        let (before, first, next) =
            (knitted.stitches[0] as usize + 7, knitted.stitches[1] as usize, knitted.stitches[2] as usize);
        let samples = (before..next).flat_map(|i| (0..SAMPLES).map(move |k| (i, k as f64 / SAMPLES as f64)));
        let path = samples.map(|(i, t)| (i as i64 - first as i64, span(&knitted.points, i).at(t))).collect();
        let tag = knitted.tags[first];
        (tag.kind == PointKind::Loop && i64::from(tag.wale) == wale).then_some(path)
    });
    let path = paths.next().expect("the bar loops there");
    assert!(paths.next().is_none(), "one loop a bar on each needle");
    Some(path)
}

/// Crossings of two paths in the plane: the spans that cross, and the depth of the second over the first.
fn crossings(first: &Path, second: &Path) -> Vec<(i64, i64, f64)> {
    let mut found = Vec::new();
    for a in first.windows(2) {
        for b in second.windows(2) {
            let (p, r) = (a[0].1, a[1].1 - a[0].1);
            let (q, s) = (b[0].1, b[1].1 - b[0].1);
            let across = r.truncate().perp_dot(s.truncate());
            let (t, u) = ((q - p).truncate().perp_dot(s.truncate()) / across, (q - p).truncate().perp_dot(r.truncate()) / across);
            if (0.0..1.0).contains(&t) && (0.0..1.0).contains(&u) {
                found.push((a[0].0, b[0].0, (q + s * u).z - (p + r * t).z));
            }
        }
    }
    found
}

/// One place of the fabric: a new loop through an old one.
fn assert_interlocked(old: &Path, new: &Path, place: &str) {
    // The loop proper is S2 to S7, spans 1 to 5; the rest are feet and underlaps.
    let is_loop = |span: i64| (1..6).contains(&span);
    let crossings: Vec<_> = crossings(old, new).into_iter().filter(|(of_old, ..)| is_loop(*of_old)).collect();
    let place = format!("{place}: {crossings:?}");
    type Crossings = Vec<(i64, i64, f64)>;
    let (legs, feet): (Crossings, Crossings) = crossings.into_iter().partition(|(_, of_new, _)| is_loop(*of_new));
    assert_eq!(legs.iter().filter(|(.., depth)| *depth > 0.0).count(), 2, "both legs in front, {place}");
    // As a rule one foot and one underlap a side; of a closed pillar only the underlap crosses the old loop.
    assert!(!feet.is_empty() && feet.iter().all(|(.., depth)| *depth < 0.0), "feet and underlaps behind, {place}");
}

#[test]
fn legs_pass_in_front_of_the_old_head_and_feet_behind_the_old_legs() {
    for name in builtin::names() {
        let fabric = Fabric::named(name).unwrap();
        let pattern = Pattern::new(&fabric);
        let (wales, courses) = (fabric.threading_repeat() as i64, fabric.repeat() as i64);
        for (wale, course) in (0..wales).flat_map(|wale| (0..courses).map(move |course| (wale, course))) {
            for (old_bar, new_bar) in (0..fabric.bars.len()).flat_map(|old| (0..fabric.bars.len()).map(move |new| (old, new))) {
                let old = yarn_path(&fabric, &pattern, old_bar, (wale, course));
                let new = yarn_path(&fabric, &pattern, new_bar, (wale, course + 1));
                if let (Some(old), Some(new)) = (old, new) {
                    let place = format!("{name}: bar {} through bar {}, wale {wale}, course {course}", new_bar + 1, old_bar + 1);
                    assert_interlocked(&old, &new, &place);
                }
            }
        }
    }
}
