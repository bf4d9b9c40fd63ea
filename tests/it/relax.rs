//! The relaxation: no yarn cuts another, yarns keep their lengths, and everything stays finite.

use glam::DVec3;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use rayon::prelude::*;
use warpknit::drape::{self, Cloth};
use warpknit::fabric::{Fabric, builtin};
use warpknit::knit::{Knitted, Pattern};
use warpknit::knit::{clearance, links};
use warpknit::yarn::curve;

use crate::feed::least_bend;

#[test]
fn every_built_in_fabric_keeps_its_own_yarns_clear() {
    for name in builtin::names() {
        let fabric = Fabric::named(name).unwrap();
        assert!(
            (fabric.radius() - fabric.true_radius()).abs() < 1e-12,
            "{name} is drawn with its own yarn"
        );
        let pattern = Pattern::new(&fabric);
        let found = clearance::measure(&fabric, &pattern, fabric.radius());
        assert!(found.min_over_2r >= 0.98, "{name}: {found:?}");
        let relaxation = pattern.relaxation().unwrap();
        assert!(relaxation.stretch < 0.02, "{name}: {relaxation:?}");
    }
}

/// Least distance of two segments over a fine grid of places on both: no formula in common with the
/// library's.
fn distance(s: [DVec3; 2], t: [DVec3; 2]) -> f64 {
    // The distance is convex along both, so narrowing a grid around its best place finds the least.
    let (mut low, mut high) = ([0.0_f64; 2], [1.0_f64; 2]);
    let mut best = f64::INFINITY;
    for _ in 0..12 {
        let step = [0, 1].map(|i| (high[i] - low[i]) / 8.0);
        let mut at = [0.0; 2];
        for (i, j) in (0..=8).flat_map(|i| (0..=8).map(move |j| (f64::from(i), f64::from(j)))) {
            let shares = [low[0] + i * step[0], low[1] + j * step[1]];
            let found = s[0].lerp(s[1], shares[0]).distance(t[0].lerp(t[1], shares[1]));
            if found < best {
                (best, at) = (found, shares);
            } else if found <= best + 1e-15 {
                at = shares;
            }
        }
        for i in 0..2 {
            (low[i], high[i]) = ((at[i] - step[i]).max(0.0), (at[i] + step[i]).min(1.0));
        }
    }
    best
}

/// The middle of a swatch, yarn by yarn: every pair of segments compared, nothing periodic, no
/// grid.
fn brute_force(fabric: &Fabric) -> f64 {
    const SAMPLES: u32 = 12;
    let (wales, courses) = (fabric.threading_repeat() as u32 + 12, fabric.repeat() as u32 + 6);
    let panel = drape::swatch_panel(fabric, wales, courses);
    let cloth = Cloth::swatch(&panel, fabric, wales, courses);
    let thickness = fabric.thickness();
    let mut segments = Vec::new();
    let mut collect = |blocks: &[drape::Block]| {
        for block in blocks {
            for strand in &block.strands.strands {
                let points =
                    &block.strands.flat[strand.points.start as usize..strand.points.end as usize];
                let mut along = 0.0;
                for at in 0..points.len() - 1 {
                    let span = curve::span(points, at);
                    for step in 0..SAMPLES {
                        let ends = [step, step + 1]
                            .map(|step| span.at(f64::from(step) / f64::from(SAMPLES)));
                        let length = ends[0].distance(ends[1]);
                        let radius = fabric.radius() * thickness[block.bar];
                        segments.push((ends, radius, strand.yarn, along + length / 2.0));
                        along += length;
                    }
                }
            }
        }
        Ok::<_, std::io::Error>(())
    };
    drape::run(&cloth, &drape::DrapeOptions::default(), &mut |_, _| {}, &mut collect).unwrap();
    // One repeat in the swatch's middle against all of it.
    let size = panel.panels[0].size();
    let (width, height) =
        (f64::from(fabric.threading_repeat() as u32), f64::from(fabric.repeat() as u32));
    let half = [width * fabric.wale_spacing() / 2.0, height * fabric.course_spacing() / 2.0];
    let inside =
        |p: DVec3| (p.x - size.x / 2.0).abs() <= half[0] && (p.y - size.y / 2.0).abs() <= half[1];
    let least = |(ends, radius, yarn, along): &([DVec3; 2], f64, _, f64)| {
        let middle = ends[0].midpoint(ends[1]);
        let mut least = f64::INFINITY;
        if !inside(middle) {
            return least;
        }
        for (others, other_radius, other_yarn, other_along) in &segments {
            let touching = radius + other_radius;
            let near = middle.distance(others[0].midpoint(others[1])) < 1.5 * touching + 0.3;
            if near && (yarn != other_yarn || (along - other_along).abs() > 7.0 * radius) {
                least = least.min(distance(*ends, *others) / touching);
            }
        }
        least
    };
    segments.par_iter().map(least).reduce(|| f64::INFINITY, f64::min)
}

#[test]
fn the_clearance_is_what_brute_force_finds() {
    for name in [
        "tricot",
        "locknit",
        "satin-lap",
        "hex-net-3",
        "marquisette",
        "weft-inserted",
        "jersey",
        "rib-1x1",
        "garter",
    ] {
        let fabric = Fabric::named(name).unwrap();
        let measured =
            clearance::measure(&fabric, &Pattern::new(&fabric), fabric.radius()).min_over_2r;
        let brute = brute_force(&fabric);
        // A swatch cuts yarns at its border; its middle may hold a little more than the repeat.
        assert!(
            (measured - brute).abs() < 1e-3,
            "{name}: measured {measured}, brute force {brute}"
        );
        assert!(brute >= 0.98, "{name}: {brute}");
    }
}

/// The chain of a bar: gaps within reach of each other, most laps over one needle.
fn chain() -> impl Strategy<Value = String> {
    let courses = prop::sample::select(vec![1_usize, 2, 2, 3, 4, 6, 12]);
    let overlap =
        prop_oneof![3 => Just(0), 1 => Just(2), 1 => Just(-2), 8 => Just(1), 7 => Just(-1)];
    let course = (overlap, -6..=6_i32);
    (0..4_i32, courses.prop_flat_map(move |courses| prop::collection::vec(course.clone(), courses)))
        .prop_map(|(start, laps)| {
            let mut gap = start;
            let text = laps.into_iter().map(|(overlap, underlap)| {
                let to = (gap + overlap).max(0);
                let text = format!("{gap}-{to}");
                // Overlaps begin in gaps 0 to 5, so that no underlap passes more than seven wales,
                // the last one back to the first neither.
                gap = (to + underlap).clamp(0, 5);
                text
            });
            text.collect::<Vec<_>>().join("/")
        })
}

/// Fabrics of one to four bars.
pub(crate) fn fabric() -> impl Strategy<Value = Fabric> {
    let threading = prop::sample::select(vec!["I", "I", "I", "I.", ".I", "II.", "I.."]);
    let count = prop::sample::select(vec!["22 dtex", "33 dtex", "44 dtex", "44 dtex"]);
    prop::collection::vec((chain(), threading, count), 1..=4).prop_map(|bars| {
        let bar = |(chain, threading, count): (String, &str, &str)| {
            let yarn = format!(
                "{{ count = \"{count}\", density = 1.38, packing = 0.65, color = \"#ffffff\" }}"
            );
            format!("[[bars]]\nlapping = \"{chain}\"\nthreading = \"{threading}\"\nyarn = {yarn}\n")
        };
        let bars: String = bars.into_iter().map(bar).collect();
        Fabric::parse(&format!(
            "name = \"random\"\nwales_per_cm = 14.6\ncourses_per_cm = 21.74\n{bars}"
        ))
        .unwrap()
    })
}

#[test]
fn random_fabrics_relax() {
    let mut runner = TestRunner::deterministic();
    let fabrics: Vec<_> =
        (0..300).map(|_| fabric().new_tree(&mut runner).unwrap().current()).collect();
    let clear = fabrics.par_iter().map(|fabric| {
        let pattern = Pattern::new(fabric);
        let relaxation = pattern.relaxation().unwrap();
        assert!(relaxation.stretch < 0.1, "{relaxation:?} in\n{fabric}");
        let links = links::measure(fabric, &pattern);
        assert_eq!(links.wrong, 0, "{links:?} in\n{fabric}");
        let mesh = warpknit::knit::mesh::StructureMesh::anchored_at(fabric, glam::DVec2::ZERO);
        let mut knitted = Knitted::default();
        for bar in 0..fabric.yarn_systems() {
            (0..fabric.threading_repeat() as i64)
                .for_each(|guide| pattern.lay(bar, guide, 0..12, &mesh, &mut knitted));
        }
        assert!(
            !knitted.points.is_empty() && knitted.points.iter().all(|point| point.is_finite()),
            "in\n{fabric}"
        );
        let found = clearance::measure(fabric, &pattern, fabric.radius());
        let warned = !clearance::warnings(fabric, &pattern, &found, fabric.radius()).is_empty();
        assert_eq!(warned, found.min_over_2r < 0.98, "{found:?} in\n{fabric}");
        if fabric.yarn_systems() <= 3 {
            let bend = least_bend(fabric, &pattern);
            assert!(bend >= 0.8, "{bend} in\n{fabric}");
        }
        usize::from(found.min_over_2r >= 0.95)
    });
    let clear: usize = clear.sum();
    assert!(clear >= 292, "only {clear} of 300 reach 0.95");
}

#[test]
fn yarns_that_nothing_can_keep_apart_are_warned_of() {
    let thick = Fabric::named("locknit").unwrap().to_string().replace("44 dtex", "400 dtex");
    let fabric = Fabric::parse(&thick).unwrap();
    let pattern = Pattern::new(&fabric);
    let found = clearance::measure(&fabric, &pattern, fabric.radius());
    let warnings = clearance::warnings(&fabric, &pattern, &found, fabric.radius());
    assert!(
        warnings
            .iter()
            .any(|warning| warning.contains("too thick for 14.6 wales and 21.74 courses per cm")),
        "{warnings:?}"
    );
    assert!(fabric.radius() < fabric.true_radius());
}

#[test]
fn two_runs_and_any_number_of_threads_give_the_same() {
    let fabric = Fabric::named("hex-net-3").unwrap();
    let lay = || {
        let mesh = warpknit::knit::mesh::StructureMesh::anchored_at(&fabric, glam::DVec2::ZERO);
        let mut knitted = Knitted::default();
        Pattern::new(&fabric).lay(0, 0, 0..24, &mesh, &mut knitted);
        knitted.points
    };
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(lay);
    assert_eq!(alone, lay());
}
