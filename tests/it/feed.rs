//! Yarn that is fed: run-ins, slack, tension and the press are inputs, and bends keep the yarn's
//! radius.

use glam::{DVec2, DVec3};
use warpknit::fabric::{Fabric, builtin};
use warpknit::knit::mesh::StructureMesh;
use warpknit::knit::{Knitted, Pattern, clearance, links, numbers, run_in};
use warpknit::yarn::curve;

/// A built-in fabric with a line added to the table of one of its bars.
fn with_line(name: &str, bar: usize, line: &str) -> Fabric {
    let text = Fabric::named(name).unwrap().to_string();
    let mut tables: Vec<_> = text.split("[[bars]]").map(str::to_owned).collect();
    tables[bar + 1] = format!("\n{line}{}", tables[bar + 1]);
    Fabric::parse(&tables.join("[[bars]]")).unwrap()
}

/// mm a rack of a bar, as it lies.
fn run_in_of(fabric: &Fabric, bar: usize) -> f64 {
    numbers::measure(fabric, &Pattern::new(fabric)).run_in[bar].unwrap()
}

#[test]
fn loops_take_the_yarn_that_is_fed() {
    let plain = Fabric::named("locknit").unwrap();
    let own_numbers = numbers::measure(&plain, &Pattern::new(&plain));
    let (own, mass, width) = (
        own_numbers.run_in[0].unwrap(),
        own_numbers.bar_mass[0],
        own_numbers.loop_width[0].unwrap(),
    );
    for share in [0.95, 1.05] {
        let fabric = with_line("locknit", 0, &format!("run_in_mm = {:.1}", share * own));
        let pattern = Pattern::new(&fabric);
        run_in::check(&fabric, &pattern).unwrap();
        let found = numbers::measure(&fabric, &pattern);
        assert!((found.run_in[0].unwrap() / (share * own) - 1.0).abs() < 0.005, "{found:?}");
        assert!((found.bar_mass[0] / (share * mass) - 1.0).abs() < 0.005, "{found:?}");
        let wider = found.loop_width[0].unwrap() / width;
        assert!((wider > 1.0) == (share > 1.0), "{share}: {wider} as wide");
        assert_eq!(links::measure(&fabric, &pattern).wrong, 0);
        let clear = clearance::measure(&fabric, &pattern, fabric.radius()).min_over_2r;
        assert!(clear >= 0.98, "{share}: {clear}");
    }
}

#[test]
fn an_impossible_run_in_is_refused_with_its_range() {
    let fabric = with_line("locknit", 1, "run_in_mm = 700.0");
    let fault = run_in::check(&fabric, &Pattern::new(&fabric)).unwrap_err();
    assert_eq!((fault.bar, fault.wanted), (2, 700.0));
    let own = run_in_of(&Fabric::named("locknit").unwrap(), 1);
    assert!(700.0 < fault.least && fault.least < own && own < fault.most, "{fault}");
}

#[test]
fn slack_lengthens_an_inlay_and_tension_straightens_it() {
    let taut = run_in_of(&Fabric::named("tricot-inlay").unwrap(), 1);
    let slack = [0.0, 0.1]
        .map(|slack| run_in_of(&with_line("tricot-inlay", 1, &format!("slack = {slack:.1}")), 1));
    assert!(taut <= slack[0] * 1.01, "{taut} {slack:?}");
    assert!((slack[1] / slack[0] - 1.1).abs() < 0.01, "{slack:?}");
}

#[test]
fn elastane_lies_straight_in_the_ribs_of_a_power_net() {
    let fabric = Fabric::named("power-net").unwrap();
    let pattern = Pattern::new(&fabric);
    let run_in = numbers::measure(&fabric, &pattern).run_in;
    let straight = 480.0 * fabric.course_spacing();
    for elastane in [2, 3] {
        assert_eq!(fabric.warp_knit().unwrap().bars[elastane].run_in, None);
        let longer = run_in[elastane].unwrap() / straight;
        assert!((1.0..1.05).contains(&longer), "{longer}");
    }
}

#[test]
fn a_press_makes_the_cloth_as_thin_as_it_says() {
    let text = Fabric::named("locknit").unwrap().to_string();
    let thick = numbers::measure(
        &Fabric::named("locknit").unwrap(),
        &Pattern::new(&Fabric::named("locknit").unwrap()),
    )
    .thickness;
    let wanted = 0.9 * thick;
    let fabric = Fabric::parse(&format!("{text}\n[finish]\nthickness_mm = {wanted:.3}\n")).unwrap();
    let pattern = Pattern::new(&fabric);
    let found = numbers::measure(&fabric, &pattern).thickness;
    assert!(found < wanted * 1.02, "{found} over {wanted}");
    assert_eq!(links::measure(&fabric, &pattern).wrong, 0);
    assert!(clearance::measure(&fabric, &pattern, fabric.radius()).min_over_2r >= 0.98);
}

#[test]
fn locknit_weighs_what_is_published() {
    // Spencer 2001: nylon locknit at gauge 28 with 37 wales an inch. The courses are ours.
    for (count, courses, published) in
        [("20 den", 10.0, 30.0), ("40 den", 17.0, 82.0), ("70 den", 17.0, 152.0)]
    {
        let fabric = Fabric::named("locknit").unwrap();
        let mut fabric = fabric.with_counts(&[count.parse().unwrap()]).unwrap();
        (fabric.wales_per_cm, fabric.courses_per_cm) = (37.0 / 2.54, courses);
        fabric.finish.width_shrink = Some(1.0 - 28.0 / 37.0);
        let mass = numbers::measure(&fabric, &Pattern::new(&fabric)).mass;
        assert!(
            (mass / published - 1.0).abs() < 0.1,
            "{count}: {mass} g/m², {published} published"
        );
        let machine = fabric.machine().unwrap();
        assert!((machine.gauge - 28.0).abs() < 1e-9 && (0.2..0.3).contains(&machine.width_shrink));
    }
}

/// Least radius of the circles through three consecutive samples of a path, over `radius`.
fn tightest_bend(points: &[DVec3], radius: f64) -> f64 {
    let spans = (1..points.len() - 2).map(|at| curve::span(points, at));
    let bends = spans.flat_map(|span| {
        let samples: Vec<_> = (0..=24).map(|step| span.at(f64::from(step) / 24.0)).collect();
        let bends = samples.windows(3).map(|three| {
            let (u, v) = (three[1] - three[0], three[2] - three[1]);
            u.length() * v.length() * (u + v).length() / (2.0 * u.cross(v).length()).max(1e-30)
        });
        bends.collect::<Vec<_>>()
    });
    bends.fold(f64::INFINITY, f64::min) / radius
}

/// Least radius of the bends of a fabric's yarns, each over its yarn's radius.
pub(crate) fn least_bend(fabric: &Fabric, pattern: &Pattern) -> f64 {
    let mesh = StructureMesh::anchored_at(fabric, DVec2::ZERO);
    let mut least = f64::INFINITY;
    for (bar, thickness) in fabric.thickness().into_iter().enumerate() {
        let (numbers, steps) = if pattern.runs_across(bar) {
            (fabric.repeat(), fabric.threading_repeat())
        } else {
            (fabric.threading_repeat(), fabric.repeat())
        };
        for number in 0..numbers as i64 {
            let mut knitted = Knitted::default();
            pattern.lay(bar, number, 0..3 * steps as i64 + 2, &mesh, &mut knitted);
            if knitted.points.len() > 4 {
                least = least.min(tightest_bend(&knitted.points, fabric.radius() * thickness));
            }
        }
    }
    least
}

#[test]
fn no_yarn_of_a_built_in_fabric_is_pinched() {
    for name in builtin::names() {
        let fabric = Fabric::named(name).unwrap();
        let bend = least_bend(&fabric, &Pattern::new(&fabric));
        assert!(bend >= 0.95, "{name}: {bend}");
    }
}

#[test]
fn a_repeat_of_thousands_of_laps_is_relaxed() {
    // A wale that wanders: no part of the repeat is like another.
    let chain = |seed: usize| {
        let mut gap = 4_usize;
        let laps = (0..1100).map(|course| {
            let random = (seed + course) * 2_654_435_761 % 4_294_967_296 / 65_536;
            gap =
                (gap + random % 3).clamp(1, 8) - usize::from(!random.is_multiple_of(3) && gap > 1);
            if random.is_multiple_of(2) {
                format!("{gap}-{}", gap + 1)
            } else {
                format!("{}-{gap}", gap + 1)
            }
        });
        laps.collect::<Vec<_>>().join("/")
    };
    let fabric =
        Fabric::named("tricot").unwrap().with_chains(&[chain(1), chain(7001)], &[]).unwrap();
    let mut shares = Vec::new();
    let pattern = Pattern::with_progress(&fabric, &mut |done| shares.push(done));
    assert!(pattern.relaxation().is_some_and(|relaxation| relaxation.grown == 1.0));
    let found = links::measure(&fabric, &pattern);
    assert_eq!((found.checked, found.wrong), (4400, 0));
    assert!(shares.len() > 5 && shares.iter().all(|share| (0.0..=1.0).contains(share)));
}
