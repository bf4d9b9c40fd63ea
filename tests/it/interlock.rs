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

/// The yarn that loops on wale 0 in a course: from the underlap before its loop to the one after it.
fn yarn_path(fabric: &Fabric, pattern: &Pattern, bar: usize, course: i64) -> Path {
    let mesh = StructureMesh::anchored_at(fabric, DVec2::ZERO);
    let mut paths = (-10..10).filter_map(|guide| {
        let mut knitted = Knitted::default();
        pattern.lay(bar, guide, course - 1..course + 2, &mesh, &mut knitted);
        let (before, first, next) =
            (knitted.stitches[0] as usize + 7, knitted.stitches[1] as usize, knitted.stitches[2] as usize);
        let samples = (before..next).flat_map(|i| (0..SAMPLES).map(move |k| (i, k as f64 / SAMPLES as f64)));
        let path = samples.map(|(i, t)| (i as i64 - first as i64, span(&knitted.points, i).at(t))).collect();
        let tag = knitted.tags[first];
        (tag.kind == PointKind::Loop && tag.wale == 0).then_some(path)
    });
    let path = paths.next().expect("a loop on every needle");
    assert!(paths.next().is_none(), "one loop a bar on each needle");
    path
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

#[test]
fn legs_pass_in_front_of_the_old_head_and_feet_behind_the_old_legs() {
    for name in builtin::names() {
        let fabric = Fabric::named(name).unwrap();
        let pattern = Pattern::new(&fabric);
        for old_bar in 0..fabric.bars.len() {
            for new_bar in 0..fabric.bars.len() {
                for course in 0..fabric.repeat() as i64 {
                    let old = yarn_path(&fabric, &pattern, old_bar, course);
                    let new = yarn_path(&fabric, &pattern, new_bar, course + 1);
                    // The loop proper is S2 to S7, spans 1 to 5; the rest are feet and underlaps.
                    let is_loop = |span: i64| (1..6).contains(&span);
                    let crossings: Vec<_> = crossings(&old, &new).into_iter().filter(|(of_old, ..)| is_loop(*of_old)).collect();
                    let place =
                        format!("{name}: bar {} through bar {}, course {course}: {crossings:?}", new_bar + 1, old_bar + 1);
                    type Crossings = Vec<(i64, i64, f64)>;
                    let (legs, feet): (Crossings, Crossings) = crossings.into_iter().partition(|(_, of_new, _)| is_loop(*of_new));
                    assert_eq!(legs.iter().filter(|(.., depth)| *depth > 0.0).count(), 2, "both legs in front, {place}");
                    assert!(feet.len() >= 2 && feet.iter().all(|(.., depth)| *depth < 0.0), "feet and underlaps behind, {place}");
                }
            }
        }
    }
}
