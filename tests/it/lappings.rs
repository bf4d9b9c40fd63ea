//! Lappings that the trade has a name for: every loop drawn through, and the bars' layers on the
//! technical back in the order of the bars.

use glam::{DVec2, DVec3};
use warpknit::fabric::Fabric;
use warpknit::knit::mesh::StructureMesh;
use warpknit::knit::{Knitted, Pattern, PointKind, clearance, links};
use warpknit::yarn::curve::span;

use crate::fabrics::NAMES;

/// Names and chains, front bar first.
const NAMED: [(&str, &[&str]); 22] = [
    ("tricot, both bars parallel", &["1-0/1-2", "1-0/1-2"]),
    ("tricot, both bars open", &["0-1/2-1", "2-1/0-1"]),
    ("locknit, open front bar", &["3-2/0-1", "1-0/1-2"]),
    ("locknit, bars parallel", &["2-3/1-0", "1-2/1-0"]),
    ("reverse locknit, open", &["1-2/1-0", "0-1/3-2"]),
    ("sharkskin, bars parallel", &["1-2/1-0", "3-4/1-0"]),
    ("four-needle sharkskin", &["1-2/1-0", "1-0/4-5"]),
    ("satin, bars parallel", &["3-4/1-0", "1-2/1-0"]),
    ("satin, open", &["4-3/0-1", "1-0/1-2"]),
    ("short queenscord", &["1-0/0-1", "1-0/2-3"]),
    ("short queenscord, closed pillars", &["1-0/1-0", "1-0/2-3"]),
    ("long queenscord", &["1-0/0-1", "1-0/4-5"]),
    ("raised loop", &["5-6/1-0", "1-0/1-2"]),
    ("double atlas of four courses", &["1-0/1-2/2-3/2-1", "2-3/2-1/1-0/1-2"]),
    ("pillars over an atlas", &["1-0/0-1", "1-0/1-2/2-3/2-1"]),
    ("laid-in pillars", &["1-0/0-1", "0-0/3-3"]),
    ("tricot over an inlay", &["1-0/1-2", "0-0/2-2"]),
    ("tricot, tricot and cord", &["1-2/1-0", "1-0/1-2", "2-3/1-0"]),
    ("locknit over a tricot", &["2-3/1-0", "1-0/1-2", "1-0/1-2"]),
    ("pillars, locknit and tricot", &["1-0/0-1", "1-0/2-3", "1-2/1-0"]),
    ("satin, locknit and tricot", &["1-0/3-4", "1-0/2-3", "1-2/1-0"]),
    ("queenscord of two floats", &["1-0/0-1", "3-4/1-0", "1-0/3-4"]),
];

/// Segments of each span.
const SAMPLES: u32 = 6;
/// Wales and courses around the repeat from which yarns reach into it.
const AROUND: i64 = 8;

/// A straight piece of a yarn on the technical back.
#[derive(Clone, Copy)]
struct Piece {
    bar: usize,
    ends: [DVec3; 2],
}

/// The underlaps and inlays of all yarns of some guides over some courses.
fn pieces(fabric: &Fabric, pattern: &Pattern, around: i64) -> Vec<Piece> {
    let mesh = StructureMesh::anchored_at(fabric, DVec2::ZERO);
    let (wales, courses) = (fabric.threading_repeat() as i64, fabric.repeat() as i64);
    let mut pieces = Vec::new();
    for bar in 0..fabric.yarn_systems() {
        if pattern.runs_across(bar) {
            continue;
        }
        for guide in -around..wales + around {
            let mut knitted = Knitted::default();
            pattern.lay(bar, guide, -around - 1..courses + around + 1, &mesh, &mut knitted);
            for at in (0..knitted.points.len()).filter(|&at| is_behind(&knitted, at)) {
                let span = span(&knitted.points, at);
                pieces.extend((0..SAMPLES).map(|step| {
                    let ends =
                        [step, step + 1].map(|step| span.at(f64::from(step) / f64::from(SAMPLES)));
                    Piece { bar, ends }
                }));
            }
        }
    }
    pieces
}

/// Whether the span that starts at a point belongs to an underlap or an inlay. The way from one
/// needle to the next within an overlap is no underlap.
fn is_behind(knitted: &Knitted, at: usize) -> bool {
    let tags = &knitted.tags;
    let Some(next) = tags.get(at + 1) else { return false };
    if [tags[at].kind, next.kind].contains(&PointKind::Inlay) {
        return true;
    }
    let leads = tags[at + 1..].iter().find(|tag| tag.kind != PointKind::Underlap);
    let is_underlap = tags[at].kind == PointKind::Underlap || tags[at].point == 8;
    is_underlap && leads.is_some_and(|tag| tag.course != tags[at].course)
}

/// How far in front of `one` another piece lies where they cross in the plane.
fn in_front(one: &Piece, other: &Piece) -> Option<f64> {
    let [(from, to), (start, end)] = [one, other].map(|piece| (piece.ends[0], piece.ends[1]));
    let (along, across, between) =
        ((to - from).truncate(), (end - start).truncate(), (start - from).truncate());
    let turn = along.perp_dot(across);
    let shares = [between.perp_dot(across) / turn, between.perp_dot(along) / turn];
    let cross = shares.iter().all(|share| (0.0..1.0).contains(share));
    cross.then(|| start.lerp(end, shares[1]).z - from.lerp(to, shares[0]).z)
}

/// Crossings of underlaps and inlays of two bars: all, and those where the front bar isn't outermost.
fn layers(fabric: &Fabric, pattern: &Pattern) -> [usize; 2] {
    let (inner, all) = (pieces(fabric, pattern, 0), pieces(fabric, pattern, AROUND));
    let mut found = [0, 0];
    for one in &inner {
        for other in all.iter().filter(|other| other.bar > one.bar) {
            if let Some(height) = in_front(one, other) {
                found[0] += 1;
                found[1] += usize::from(height < 0.0);
            }
        }
    }
    found
}

#[test]
fn named_lappings_are_linked_and_their_bars_lie_in_order() {
    for (name, chains) in NAMED {
        let chains: Vec<_> = chains.iter().map(|chain| (*chain).to_owned()).collect();
        let fabric = Fabric::named("tricot").unwrap().with_chains(&chains, &[]).unwrap();
        let pattern = Pattern::new(&fabric);
        let found = links::measure(&fabric, &pattern);
        assert!(found.checked > 0 && found.wrong == 0, "{name}: {found:?}");
        let [crossings, wrong] = layers(&fabric, &pattern);
        assert_eq!(wrong, 0, "{name}: of {crossings}");
        let near = clearance::measure(&fabric, &pattern, fabric.radius());
        assert!(near.min_over_2r >= 0.98, "{name}: {near:?}");
    }
}

#[test]
fn the_bars_of_built_in_fabrics_lie_in_order_on_the_back() {
    let mut all = 0;
    for name in NAMES {
        let fabric = Fabric::named(name).unwrap();
        let [crossings, wrong] = layers(&fabric, &Pattern::new(&fabric));
        assert_eq!(wrong, 0, "{name}: of {crossings}");
        all += crossings;
    }
    assert!(all > 500, "{all}");
}
