//! Loops interlock: seen from the technical face, both legs of a new loop pass in front of the old
//! loop's head and its feet pass behind the old legs, for every pair of bars. Counted by signed
//! crossings in the plane.

use glam::{DVec2, DVec3};
use proptest::strategy::{Strategy, ValueTree};
use proptest::test_runner::TestRunner;
use rayon::prelude::*;
use warpknit::fabric::{Bar, Fabric};
use warpknit::knit::mesh::StructureMesh;
use warpknit::knit::{Knitted, Pattern, PointKind};
use warpknit::yarn::curve::span;

use crate::fabrics::NAMES;
use crate::relax::fabric;

const SAMPLES: usize = 14;

/// A path in the plane: for each sample the span it lies in, counted from S1, and where it is.
type Path = Vec<(i64, DVec3)>;

/// The yarn of a bar that loops on a wale in a course, if one does: from the underlap before its
/// loop to the one after it.
fn yarn_path(
    fabric: &Fabric,
    pattern: &Pattern,
    bar: usize,
    (wale, course): (i64, i64),
) -> Option<Path> {
    let bars = &fabric.warp_knit().expect("guide bars").bars;
    if !bars[bar].loops_on(wale, course) {
        return None;
    }
    let mesh = StructureMesh::anchored_at(fabric, DVec2::ZERO);
    let guides = (wale - 10..wale + 10).filter(|&guide| bars[bar].threading.carries(guide));
    let mut paths = guides.filter_map(|guide| {
        let mut knitted = Knitted::default();
        pattern.lay(bar, guide, course - 1..course + 2, &mesh, &mut knitted);
        let (before, first, next) = (
            knitted.stitches[0] as usize + 7,
            knitted.stitches[1] as usize,
            knitted.stitches[2] as usize,
        );
        let samples =
            (before..next).flat_map(|i| (0..SAMPLES).map(move |k| (i, k as f64 / SAMPLES as f64)));
        let path = samples
            .map(|(i, t)| (i as i64 - first as i64, span(&knitted.points, i).at(t)))
            .collect();
        let tag = knitted.tags[first];
        (tag.kind == PointKind::WarpLoop && i64::from(tag.wale) == wale).then_some(path)
    });
    let path = paths.next().expect("the bar loops there");
    assert!(paths.next().is_none(), "one loop a bar on each needle");
    Some(path)
}

/// Where two paths cross in the plane.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    /// The spans, of the old and of the new yarn.
    old: i64,
    new: i64,
    /// Whether the new yarn passes to the left of the old one's direction (1) or to its right (-1).
    sign: i32,
    /// How far in front of the old yarn the new one lies.
    depth: f64,
}

/// Crossings of two paths in the plane.
fn crossings(old: &Path, new: &Path) -> Vec<Crossing> {
    let mut found = Vec::new();
    for a in old.windows(2) {
        for b in new.windows(2) {
            let (p, r) = (a[0].1, a[1].1 - a[0].1);
            let (q, s) = (b[0].1, b[1].1 - b[0].1);
            let across = r.truncate().perp_dot(s.truncate());
            let (t, u) = (
                (q - p).truncate().perp_dot(s.truncate()) / across,
                (q - p).truncate().perp_dot(r.truncate()) / across,
            );
            if (0.0..1.0).contains(&t) && (0.0..1.0).contains(&u) {
                let depth = (q + s * u).z - (p + r * t).z;
                found.push(Crossing {
                    old: a[0].0,
                    new: b[0].0,
                    sign: across.signum() as i32,
                    depth,
                });
            }
        }
    }
    found
}

/// One place of the fabric: what is wrong with a new loop's way through an old one.
///
/// A leg that lies along the old one may cross it to and fro: signed, such crossings cancel.
fn check(old: &Path, new: &Path) -> Result<(), String> {
    // The loop proper is S2 to S7, spans 1 to 5, with the head's span in the middle; the rest are
    // feet and underlaps.
    let is_loop = |span: i64| (1..6).contains(&span);
    let crossings: Vec<_> =
        crossings(old, new).into_iter().filter(|crossing| is_loop(crossing.old)).collect();
    let net = |leg: &dyn Fn(i64) -> bool, in_front: bool| -> i32 {
        let counted = |c: &&Crossing| leg(c.new) && is_loop(c.new) && (c.depth > 0.0) == in_front;
        crossings.iter().filter(counted).map(|crossing| crossing.sign).sum()
    };
    let (entry, exit) = (net(&|span| span <= 3, true), net(&|span| span > 3, true));
    let behind = net(&|span| span <= 3, false) != 0 || net(&|span| span > 3, false) != 0;
    // As a rule one foot and one underlap a side; of a closed pillar only the underlap crosses the
    // old loop.
    let feet: Vec<_> = crossings.iter().filter(|crossing| !is_loop(crossing.new)).collect();
    let wrong = if entry.abs() != 1 || exit != -entry {
        "a leg is not in front"
    } else if behind {
        "a leg is behind"
    } else if feet.is_empty() || feet.iter().any(|crossing| crossing.depth >= 0.0) {
        "a foot or an underlap is not behind"
    } else {
        return Ok(());
    };
    Err(format!("{wrong}: {crossings:?}"))
}

/// Every loop of a fabric through every loop of the course before on its needle: how many there
/// are, or what is wrong.
fn check_all(fabric: &Fabric) -> Result<usize, String> {
    let pattern = Pattern::new(fabric);
    let (wales, courses) = (fabric.threading_repeat() as i64, fabric.repeat() as i64);
    let (mut places, bars) = (0, fabric.yarn_systems());
    for (wale, course) in (0..wales).flat_map(|wale| (0..courses).map(move |course| (wale, course)))
    {
        for (old_bar, new_bar) in (0..bars).flat_map(|old| (0..bars).map(move |new| (old, new))) {
            let old = yarn_path(fabric, &pattern, old_bar, (wale, course));
            let new = yarn_path(fabric, &pattern, new_bar, (wale, course + 1));
            if let (Some(old), Some(new)) = (old, new) {
                let place = || {
                    format!(
                        "bar {} through bar {}, wale {wale}, course {course}",
                        new_bar + 1,
                        old_bar + 1
                    )
                };
                check(&old, &new).map_err(|wrong| format!("{}: {wrong}", place()))?;
                places += 1;
            }
        }
    }
    Ok(places)
}

#[test]
fn legs_pass_in_front_of_the_old_head_and_feet_behind_the_old_legs() {
    for name in NAMES {
        let places = check_all(&Fabric::named(name).unwrap())
            .unwrap_or_else(|wrong| panic!("{name}: {wrong}"));
        assert!(places > 0, "{name}");
    }
}

#[test]
fn random_fabrics_of_two_bars_interlock() {
    let mut runner = TestRunner::deterministic();
    // Laps over one needle in every course; how loops of a lap over two needles lie is another
    // matter.
    let is_plain = |bar: &Bar| {
        bar.chain().is_some_and(|chain| chain.laps().iter().all(|lap| lap.needles().count() == 1))
    };
    let plain = |fabric: &Fabric| {
        let bars = &fabric.warp_knit().unwrap().bars;
        bars.len() <= 2 && bars.iter().all(is_plain)
    };
    let fabrics = std::iter::repeat_with(|| fabric().new_tree(&mut runner).unwrap().current())
        .filter(plain)
        .take(100);
    let fabrics: Vec<_> = fabrics.collect();
    let slipped: Vec<_> = fabrics
        .par_iter()
        .filter_map(|fabric| Some(format!("{}\nin\n{fabric}", check_all(fabric).err()?)))
        .collect();
    assert!(slipped.len() <= 5, "{}", slipped.join("\n"));
}
