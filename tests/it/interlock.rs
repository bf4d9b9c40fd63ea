//! Loops interlock: seen from the technical face, both legs of a new loop pass in front of the old loop's head and its feet pass
//! behind the old legs, for every pair of bars. Counted by signed crossings in the plane.

use glam::{DVec2, DVec3};
use warpknit::fabric::{Fabric, builtin};
use warpknit::knit::mesh::StructureMesh;
use warpknit::knit::{Knitted, Pattern, PointKind};
use warpknit::yarn::curve::span;

const SAMPLES: usize = 14;

/// The path S1 to S8 of the loop that a bar puts on wale 0 in a course, with the span each sample lies in.
fn loop_path(fabric: &Fabric, pattern: &Pattern, bar: usize, course: i32) -> Vec<(usize, DVec3)> {
    let mesh = StructureMesh::anchored_at(fabric, DVec2::ZERO);
    let mut knitted = Knitted::default();
    for guide in -10..10 {
        pattern.lay(bar, guide, i64::from(course)..i64::from(course) + 1, &mesh, &mut knitted);
    }
    let on_wale = |i: &usize| knitted.tags[*i].kind == PointKind::Loop && knitted.tags[*i].wale == 0;
    let points: Vec<_> = (0..knitted.points.len()).filter(on_wale).map(|i| knitted.points[i]).collect();
    assert_eq!(points.len(), 8, "one loop a bar on each needle");
    let samples = (0..7).flat_map(|i| (0..SAMPLES).map(move |k| (i, k)));
    let mut path: Vec<_> = samples.map(|(i, k)| (i, span(&points, i).at(k as f64 / SAMPLES as f64))).collect();
    path.push((6, points[7]));
    path
}

/// Crossings of two paths in the plane: the spans that cross, and the depth of the second over the first.
fn crossings(first: &[(usize, DVec3)], second: &[(usize, DVec3)]) -> Vec<(usize, usize, f64)> {
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
        let pattern = Pattern::new(&fabric).unwrap();
        let mut feet = 0;
        for old_bar in 0..fabric.bars.len() {
            for new_bar in 0..fabric.bars.len() {
                for course in 0..fabric.repeat() as i32 {
                    let old = loop_path(&fabric, &pattern, old_bar, course);
                    let new = loop_path(&fabric, &pattern, new_bar, course + 1);
                    // The loop proper of the old stitch is S2 to S7; its feet cross nothing of the next course.
                    let crossings: Vec<_> = crossings(&old, &new).into_iter().filter(|(of_old, ..)| (1..6).contains(of_old)).collect();
                    let place = format!("{name}: bar {} through bar {}, course {course}: {crossings:?}", new_bar + 1, old_bar + 1);
                    let is_foot = |of_new: usize| of_new == 0 || of_new == 6;
                    let legs: Vec<_> = crossings.iter().filter(|(_, of_new, _)| !is_foot(*of_new)).collect();
                    assert_eq!(legs.iter().filter(|(.., depth)| *depth > 0.0).count(), 2, "both legs in front, {place}");
                    feet += crossings.len() - legs.len();
                    assert!(crossings.iter().all(|(_, of_new, depth)| !is_foot(*of_new) || *depth < 0.0), "feet behind, {place}");
                }
            }
        }
        // Feet of a loop nested in another stand between its legs and cross neither; the outer ones do.
        assert!(feet > 0, "{name}: some feet pass behind old legs");
    }
}
