//! The built-in fabrics: all of the table in docs/fabrics.md, each what its name says; and what
//! docs/method.md says of the stitch.

use warpknit::fabric::{Bar, Fabric, Lay, builtin};
use warpknit::knit::{Pattern, numbers};

/// The guide bars of a warp knit.
fn bars(fabric: &Fabric) -> &[Bar] {
    &fabric.warp_knit().unwrap().bars
}

/// The fabrics of the table in docs/fabrics.md.
pub(crate) const NAMES: [&str; 41] = [
    "tricot",
    "locknit",
    "reverse-locknit",
    "satin",
    "velour",
    "sharkskin",
    "queenscord",
    "double-cord",
    "double-atlas",
    "pillar-tricot",
    "three-bar-tricot",
    "three-bar-locknit",
    "pillar-locknit",
    "three-bar-satin",
    "three-bar-queenscord",
    "plush",
    "elastic-locknit",
    "ticking",
    "four-bar-tricot",
    "pinstripe",
    "elastic-satin",
    "pillar-open",
    "pillar-closed",
    "tricot-closed",
    "tricot-open",
    "cord",
    "satin-lap",
    "velvet-lap",
    "atlas-4",
    "atlas",
    "tulle-3",
    "tulle-5",
    "marquisette",
    "marquisette-3",
    "square-net",
    "atlas-net",
    "hex-net-3",
    "hex-net-5",
    "power-net",
    "tricot-inlay",
    "weft-inserted",
];

/// The weft knits that come with the program.
pub(crate) const WEFT_KNITS: [&str; 5] = ["jersey", "rib-1x1", "rib-2x2", "garter", "cable"];

#[test]
fn every_fabric_of_the_table_is_there_and_serves_every_needle() {
    assert_eq!(builtin::names().collect::<Vec<_>>(), [&NAMES[..], &WEFT_KNITS].concat());
    for name in builtin::names() {
        let fabric = Fabric::named(name).unwrap();
        assert_eq!(fabric.name, name);
        assert_eq!(fabric.warnings(), Vec::<String>::new(), "{name}");
        assert!(
            !fabric.about.is_empty() && fabric.about.len() < 110 && !fabric.about.contains('\n'),
            "{name}: {}",
            fabric.about
        );
        let mut colours: Vec<_> = fabric.yarns().map(|yarn| yarn.color.0).collect();
        colours.sort_unstable();
        colours.dedup();
        assert_eq!(
            colours.len(),
            fabric.yarn_systems(),
            "{name}: bars of one colour can't be told apart"
        );
    }
}

#[test]
fn laps_are_open_or_closed_as_their_names_say() {
    let closed = |name: &str| {
        let chain = bars(&Fabric::named(name).unwrap())[0].chain().unwrap().clone();
        let courses = 0..chain.laps().len() as i64;
        courses.map(|course| chain.is_closed(course)).collect::<Vec<_>>()
    };
    for (name, laps) in [
        ("pillar-open", &[false, false][..]),
        ("pillar-closed", &[true, true]),
        ("tricot-closed", &[true, true]),
        ("tricot-open", &[false, false]),
        ("cord", &[true, true]),
        ("satin-lap", &[true, true]),
        ("velvet-lap", &[true, true]),
        // Closed where the zigzag turns, open on the way: after 1-0/1-2 the bar goes on in the
        // direction of its overlap.
        ("atlas-4", &[true, false, true, false]),
    ] {
        assert_eq!(closed(name), laps, "{name}");
    }
}

#[test]
fn nets_are_half_set_and_their_bars_never_share_a_needle() {
    for name in ["atlas-net", "hex-net-3", "hex-net-5", "power-net"] {
        let fabric = Fabric::named(name).unwrap();
        assert_eq!(fabric.threading_repeat(), 2);
        for (wale, course) in
            (0..2).flat_map(|wale| (0..fabric.repeat() as i64).map(move |course| (wale, course)))
        {
            let loops = fabric.structure.threads_on(wale, course);
            assert_eq!(loops, 1, "{name}: wale {wale}, course {course}");
        }
    }
}

#[test]
fn inlays_and_wefts_knit_nothing() {
    for (name, inlays) in [
        ("marquisette", 1),
        ("marquisette-3", 2),
        ("power-net", 2),
        ("ticking", 1),
        ("elastic-satin", 2),
        ("tulle-3", 1),
        ("weft-inserted", 1),
    ] {
        let fabric = Fabric::named(name).unwrap();
        assert_eq!(bars(&fabric).iter().filter(|bar| bar.is_inlay()).count(), inlays, "{name}");
    }
    assert_eq!(bars(&Fabric::named("weft-inserted").unwrap())[1].lay, Lay::Weft);
}

#[test]
fn the_documentation_tells_the_truth() {
    let text = std::fs::read_to_string(
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/fabrics.md"),
    )
    .unwrap();
    let example = text.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let fabric = Fabric::parse(example).unwrap();
    assert_eq!(fabric.warnings(), Vec::<String>::new());
    assert_eq!(
        bars(&fabric)[0].lay,
        bars(&Fabric::named("power-net").unwrap())[0].lay,
        "raschel numbers are halved"
    );
    for name in NAMES {
        let about = Fabric::named(name).unwrap().about;
        let row = text
            .lines()
            .find(|line| line.starts_with(&format!("| `{name}` |")))
            .unwrap_or_else(|| panic!("{name}"));
        assert!(row.contains(&about), "{row}");
    }
}

#[test]
fn the_method_has_the_dimensions_of_the_stitch() {
    let text = std::fs::read_to_string(
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/method.md"),
    )
    .unwrap();
    let d = Fabric::named("tricot").unwrap().warp_knit().unwrap().stitch;
    for (name, value) in [
        ("w1", d.w1),
        ("w2", d.w2),
        ("w3", d.w3),
        ("w4", d.w4),
        ("h1", d.h1),
        ("h2", d.h2),
        ("h3", d.h3),
    ] {
        let row = text
            .lines()
            .find(|line| line.starts_with(&format!("| `{name}` |")))
            .unwrap_or_else(|| panic!("{name}"));
        // Key, meaning, unit, default, range.
        let default = row.split('|').nth(4).unwrap().trim().parse::<f64>().unwrap();
        assert_eq!(default, value, "{row}");
    }
}

/// The yarn cover of the relaxed cloth: g/m² over g/km is km/m², and times the diameter in mm a share.
fn measured(fabric: &Fabric) -> f64 {
    let numbers = numbers::measure(fabric, &Pattern::new(fabric));
    let yarns = numbers.bar_mass.iter().zip(fabric.yarns());
    yarns.map(|(mass, yarn)| mass / yarn.tex_in_cloth() * yarn.diameter()).sum()
}

#[test]
fn ratios_of_yarn_cover_are_near_those_of_relaxed_cloth() {
    // Fabrics whose run-in is not given: one that is given doesn't follow the densities.
    for name in ["tricot", "locknit", "satin", "atlas-net", "tricot-inlay", "jersey"] {
        let fabric = Fabric::named(name).unwrap();
        let fine = fabric.clone().with_counts(&["20 dtex".parse().unwrap()]).unwrap();
        let coarse = Fabric {
            wales_per_cm: 0.7 * fabric.wales_per_cm,
            courses_per_cm: 0.8 * fabric.courses_per_cm,
            ..fabric.clone()
        };
        for other in [fine, coarse] {
            let ratio = other.yarn_cover() / fabric.yarn_cover();
            let exact = measured(&other) / measured(&fabric);
            assert!((ratio / exact - 1.0).abs() < 0.15, "{name}: {ratio} {exact}");
        }
    }
}
