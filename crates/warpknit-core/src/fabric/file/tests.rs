//! Fabric files: faults are pointed at, and every printed fabric reads back as the same fabric.

use std::path::PathBuf;

use super::*;
use crate::fabric::builtin;
use crate::fabric::dimensions::KEYS;
use crate::fabric::lapping::{Chain, MAX_GAP, Numbering};
use crate::fabric::motif::Motif;
use crate::fabric::threading::Threading;
use crate::fabric::yarn::{Color, Yarn};
use crate::fabric::{Bar, Dimensions, Feeder, Finish, Lay, PanelLayout, WarpKnit, WeftKnit};
use proptest::prelude::*;

const FABRIC: &str = r##"name = "net"
wales_per_cm = 10
courses_per_cm = 12.5
stitch = { w1 = 0.2 }

[[bars]]
lapping = "2-3/1-0//"
threading = "I."
yarn = { count = "44 dtex", density = 1.38, packing = 0.65, color = "#e3d5bd", plies = 2 }

[[panels]]
panel = 1
"##;

/// The message, and the line with its carets, for the file with one text in place of another.
fn fault(from: &str, to: &str) -> (String, Option<String>) {
    assert!(FABRIC.contains(from), "{from}");
    let error = parse(&FABRIC.replacen(from, to, 1)).unwrap_err();
    (error.to_string(), error.place.map(|place| format!("{}: {place}", place.line)))
}

#[test]
fn faults_are_pointed_at() {
    let pointed = |from: &str, to: &str, message: &str, line: &str, carets: &str| {
        let (found, place) = fault(from, to);
        assert!(found.contains(message), "{found}");
        let place = place.unwrap_or_else(|| panic!("{found} has no place"));
        let (first, below) = place.split_once('\n').unwrap();
        assert!(first.starts_with(line), "{place}");
        let column = below.find('^').unwrap();
        let number = first.find(": ").unwrap() + 2;
        assert_eq!(
            first[number..].chars().skip(column).take(below.trim().len()).collect::<String>(),
            carets,
            "{place}"
        );
    };
    pointed(
        "2-3/1-0//",
        "2-3/1-9//",
        "bar 1, lapping \"2-3/1-9//\": an overlap over 8 needles",
        "7: ",
        "1-9",
    );
    pointed("\"2-3/1-0//\"", "\"\"\"\n2-3/x-0\"\"\"", "'x' is not a number", "8: ", "x");
    pointed("\"2-3/1-0//\"", "\"1-\\u0039\"", "an overlap over 8", "7: ", "\"1-\\u0039\"");
    pointed("\"2-3/1-0//\"", "\"\"", "the chain is empty", "7: ", "\"\"");
    pointed("I.", "I.x", "bar 1, threading \"I.x\": 'x' is no threading mark", "8: ", "x");
    pointed(
        "10",
        "0.0",
        "wales_per_cm is 0, but must be between 0.01 and 1000 per cm",
        "2: ",
        "0.0",
    );
    pointed("12.5", "nan", "courses_per_cm is NaN", "3: ", "nan");
    pointed("wales_per_cm", "gauge = 28\nwales_per_cm", "given twice", "2: ", "28");
    pointed(
        "0.65",
        "2.0",
        "bar 1: yarn.packing is 2, but must be between 0.01 and 1",
        "9: ",
        "2.0",
    );
    pointed("plies = 2", "plies = 99", "bar 1: yarn.plies is 99", "9: ", "99");
    pointed("plies = 2", "plies = 2.5", "expected a whole number", "9: ", "2.5");
    pointed("12.5", "'many'", "expected a number", "3: ", "'many'");
    pointed("plies = 2", "twist = 1e9", "yarn.twist is 1000000000", "9: ", "1e9");
    pointed(
        "plies = 2",
        "sheen = 1.5",
        "yarn.sheen is 1.5, but must be between 0 and 1",
        "9: ",
        "1.5",
    );
    pointed("plies = 2", "hairiness = 51", "must be between 0 and 50 mm/mm", "9: ", "51");
    pointed(
        "plies = 2",
        "draft = 0.5",
        "bar 1: yarn.draft is 0.5, but must be between 1 and 8",
        "9: ",
        "0.5",
    );
    pointed("44 dtex", "44 stone", "no yarn count", "9: ", "\"44 stone\"");
    pointed(
        "w1 = 0.2",
        "w1 = 0.9",
        "stitch.w1 is 0.9, but must be between 0.01 and 0.5 of the wale",
        "4: ",
        "0.9",
    );
    pointed("w1", "w9", "[stitch] has no w9: it takes w1 w2", "4: ", "w9");
    pointed(
        "wales_per_cm",
        "whales_per_cm",
        "unknown field `whales_per_cm`",
        "2: ",
        "whales_per_cm",
    );
    pointed("panel = 1", "panel = 1\n[[panels]]\npanel = 1", "panel 1 has two", "14: ", "1");
    pointed("panel = 1", "panel = -1", "invalid value", "12: ", "-1");
    pointed(
        "panel = 1",
        "panel = 1\norigin = [0, 1e9]",
        "panel 1: origin is 1000000000",
        "13: ",
        "1e9",
    );
    assert_eq!(fault("wales_per_cm = 10\n", "").1, None);
    assert_eq!(
        fault("courses_per_cm = 12.5\n", ""),
        ("missing field `courses_per_cm`".to_owned(), None)
    );
    assert!(matches!(
        parse("name = ''\ngauge = 1\ncourses_per_cm = 1").unwrap_err().fault,
        FabricFault::NoBars
    ));
}

/// A file with a bar that knits, an inlay and wefts, each with a line of its own, and with one of
/// finishing.
fn finished(finish: &str, knits: &str, inlay: &str, weft: &str) -> Result<Fabric, FabricError> {
    let yarn = r##"yarn = { count = "44 dtex", density = 1.2, packing = 0.9, color = "#ffffff" }"##;
    let bars = [("1-0/1-2", knits), ("0-0/1-1", inlay), ("weft", weft)]
        .map(|(lapping, key)| format!("[[bars]]\nlapping = \"{lapping}\"\n{key}\n{yarn}\n"));
    let bars = bars.concat();
    parse(&format!("name = \"f\"\ngauge = 28\ncourses_per_cm = 20\n[finish]\n{finish}\n{bars}"))
}

#[test]
fn run_ins_and_slacks_are_read_where_they_make_sense() {
    let fabric = finished("", "run_in_mm = 1240", "run_in_mm = 300", "slack = 0.05").unwrap();
    let bars = &fabric.warp_knit().unwrap().bars;
    let given: Vec<_> = bars.iter().map(|bar| (bar.run_in, bar.slack)).collect();
    assert_eq!(given, [(Some(1240.0), None), (Some(300.0), None), (None, Some(0.05))]);
    assert_round_trip(&fabric);
    for (keys, message) in [
        (["run_in_mm = 0", "", ""], "bar 1: run_in_mm is 0, but must be between 1 and 1000000 mm"),
        (["run_in_mm = inf", "", ""], "bar 1: run_in_mm is inf, but"),
        (["slack = 0.1", "", ""], "bar 1: slack is for yarns that are laid in, and this bar knits"),
        (["", "slack = 0.6", ""], "bar 2: slack is 0.6, but must be between 0 and 0.5 of the"),
        (["", "slack = 0.1\nrun_in_mm = 300", ""], "bar 2: its length is given twice"),
        (["", "", "run_in_mm = 300"], "bar 3: wefts have no run_in_mm"),
    ] {
        let [knits, inlay, weft] = keys;
        let error = finished("", knits, inlay, weft).unwrap_err();
        assert!(error.to_string().starts_with(message), "{keys:?}: {error}");
        let place = error.place.unwrap();
        assert!(keys.concat().contains(&place.text), "{keys:?}: {place}");
    }
}

#[test]
fn a_finish_gives_the_densities_of_the_machine() {
    let finish = "width_shrink = 0.25\nlength_shrink = 0.1\nthickness_mm = 0.4";
    let fabric = finished(finish, "", "", "").unwrap();
    assert_round_trip(&fabric);
    // A cloth of 100 needles is 100 / 28 inches wide on the machine, and three quarters of that in
    // the end.
    assert!((fabric.wale_spacing() - 0.75 * 25.4 / 28.0).abs() < 1e-12);
    let machine = fabric.machine().unwrap();
    assert!((machine.gauge - 28.0).abs() < 1e-12);
    assert!((machine.wales_per_cm - 28.0 / 2.54).abs() < 1e-12);
    assert!((machine.courses_per_cm - 18.0).abs() < 1e-12);
    assert_eq!((machine.width_shrink, machine.length_shrink), (0.25, 0.1));
    assert_eq!(fabric.finish.thickness, Some(0.4));
    let pressed = finished("thickness_mm = 0.4", "", "", "").unwrap();
    assert_eq!(pressed.machine(), None);
    assert_round_trip(&pressed);
    let along = finished("length_shrink = -0.1", "", "", "").unwrap().machine().unwrap();
    assert_eq!((along.width_shrink, along.length_shrink), (0.0, -0.1));
    for (finish, message) in [
        ("width_shrink = 0.9", "finish.width_shrink is 0.9, but must be between -1 and 0.8 of"),
        ("length_shrink = nan", "finish.length_shrink is NaN"),
        ("thickness_mm = 0", "finish.thickness_mm is 0, but must be between 0.01 and 100 mm"),
        ("thickness = 0.4", "unknown field `thickness`"),
    ] {
        let error = finished(finish, "", "", "").unwrap_err();
        assert!(error.to_string().starts_with(message), "{finish}: {error}");
        assert_eq!(error.place.unwrap().text, finish);
    }
}

fn assert_round_trip(fabric: &Fabric) {
    let text = fabric.to_string();
    let again = parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    assert_eq!(&again, fabric, "{text}");
    assert_eq!(again.to_string(), text);
}

#[test]
fn what_is_printed_reads_back() {
    for name in builtin::names() {
        assert_round_trip(&Fabric::named(name).unwrap());
    }
    assert_round_trip(&parse(FABRIC).unwrap());
}

fn chains() -> impl Strategy<Value = Chain> {
    let laps = prop::collection::vec((0..=MAX_GAP, -2..=2), 1..12);
    laps.prop_map(|laps: Vec<(i32, i32)>| {
        let laps: Vec<_> =
            laps.iter().map(|&(a, by)| format!("{a}-{}", (a + by).clamp(0, MAX_GAP))).collect();
        Chain::parse(&laps.join("/"), Numbering::Tricot).unwrap()
    })
}

fn yarns() -> impl Strategy<Value = Yarn> {
    let count = (0.01..9999.0, prop::sample::select(vec!["tex", "dtex", "den", "Nm"]));
    let count = count.prop_filter_map("too fine", |(value, unit): (f64, &str)| {
        format!("{value} {unit}").parse().ok()
    });
    let look = (
        prop::option::of(1..=12_u32),
        prop::option::of(-5000.0..5000.0),
        prop::option::of(0.0..=1.0),
        prop::option::of(1.0..=8.0),
        prop::option::of(0.0..=50.0),
    );
    let texture = (prop::option::of(".{0,12}"), prop::option::of(0.01..10_000.0));
    (count, 0.1..25.0, 0.01..1.0, prop::array::uniform3(0_u8..), look, texture).prop_map(
        |(
            count,
            density,
            packing,
            rgb,
            (plies, twist, sheen, draft, hairiness),
            (texture, texture_length),
        )| Yarn {
            draft,
            plies,
            twist,
            sheen,
            hairiness,
            texture: texture.map(PathBuf::from),
            texture_length,
            ..Yarn::plain(count, density, packing, Color(rgb))
        },
    )
}

fn bars() -> impl Strategy<Value = Bar> {
    let lengths = (prop::option::of(1.0..=1e6), prop::option::of(0.0..=0.5));
    let all = (chains(), "[I.]{0,4}I[I.]{0,4}", lengths, yarns(), 0..3);
    all.prop_map(|(chain, marks, (run_in, slack), yarn, what)| {
        let threading = Threading::parse(&marks).unwrap();
        let lay = match what {
            0 => Lay::Weft,
            1 => Lay::Lapping(chain.mirrored()),
            _ => Lay::Lapping(chain),
        };
        let mut bar = Bar { lay, threading, run_in: None, slack: None, yarn };
        // A bar that knits has no slack, a weft no run-in, and no bar both.
        if bar.is_inlay() {
            bar.slack = slack;
        }
        if bar.chain().is_some() && bar.slack.is_none() {
            bar.run_in = run_in;
        }
        bar
    })
}

fn stitches() -> impl Strategy<Value = Dimensions> {
    prop::collection::vec(prop::option::of(0.0..=1.0), KEYS.len()).prop_map(
        |shares: Vec<Option<f64>>| {
            let mut stitch = Dimensions::default();
            for (key, share) in KEYS.iter().zip(shares) {
                let (low, high, _) = key.range;
                let value = (key.field)(&mut stitch);
                *value =
                    share.map_or(*value, |share| (low + share * (high - low)).clamp(low, high));
            }
            stitch
        },
    )
}

fn finishes() -> impl Strategy<Value = Finish> {
    let shrink = || prop::option::of(-1.0..=0.8);
    (shrink(), shrink(), prop::option::of(0.01..=100.0)).prop_map(
        |(width_shrink, length_shrink, thickness)| Finish {
            width_shrink,
            length_shrink,
            thickness,
        },
    )
}

fn fabrics() -> impl Strategy<Value = Fabric> {
    let panels = prop::collection::btree_map(
        0..40_usize,
        (any::<bool>(), -360.0..360.0, prop::array::uniform2(-1e5..1e5)),
        0..4,
    );
    let texts = (".{0,20}", "\\PC{0,40}|[\"'\\\\\n]{0,9}");
    let densities = (any::<bool>(), 0.1..1000.0, 0.01..1000.0, finishes());
    (texts, densities, stitches(), prop::collection::vec(bars(), 1..4), panels).prop_map(
        |((name, about), (by_gauge, wales, courses_per_cm, finish), stitch, bars, panels)| Fabric {
            name,
            about,
            wales_per_cm: if by_gauge { finish.wales_per_cm(wales) } else { wales },
            gauge: by_gauge.then_some(wales),
            courses_per_cm,
            finish,
            structure: Structure::Warp(WarpKnit { bars, stitch }),
            panels: panels
                .into_iter()
                .map(|(panel, (turn, grain_degrees, origin))| PanelLayout {
                    panel,
                    turn,
                    grain_degrees,
                    origin: origin.into(),
                })
                .collect(),
            enlargement: 1.0,
        },
    )
}

/// Charts of plain loops and crossings, knitted by one feeder.
fn weft_knits() -> impl Strategy<Value = Fabric> {
    let row = prop::collection::vec(prop::sample::select(vec!["k", "p", "xx", "CCCCC", "é"]), 1..9);
    (row.clone(), row, yarns(), "[I.]{0,3}I[I.]{0,3}").prop_map(|(one, other, yarn, marks)| {
        let legend = [('x', "cable 1/1 left"), ('C', "cable 3/2 right"), ('é', "reverse")];
        let legend = legend.map(|(letter, symbol)| (letter, symbol.parse().unwrap())).into();
        let (one, other) = (one.concat(), other.concat());
        let wales = one.chars().count().max(other.chars().count());
        let filled = |row: &str| {
            row.chars().chain("k".repeat(wales).chars()).take(wales).collect::<String>()
        };
        let chart = format!("{}\n{}", filled(&one), filled(&other));
        let courses = Threading::parse(&marks).unwrap();
        let others: String =
            marks.chars().map(|mark| if mark == 'I' { '.' } else { 'I' }).collect();
        let mut feeders = vec![Feeder { courses, yarn: yarn.clone() }];
        feeders.extend(Threading::parse(&others).map(|courses| Feeder { courses, yarn }));
        let motif = Motif::parse(&chart, &legend).unwrap();
        Fabric {
            structure: Structure::Weft(WeftKnit { motif, feeders }),
            panels: Vec::new(),
            ..parse(FABRIC).unwrap()
        }
    })
}

#[test]
fn a_weft_knit_and_a_warp_knit_have_keys_of_their_own() {
    let weft = Fabric::named("cable").unwrap().to_string();
    let fault = |text: &str| parse(text).unwrap_err().to_string();
    assert!(fault(&weft.replace("kind = \"weft\"", "")).contains("a warp knit has no chart"));
    assert!(
        fault(&FABRIC.replace("name = \"net\"", "kind = \"weft\"\nname = \"net\""))
            .contains("a weft knit has no [[bars]]")
    );
    assert!(fault(&weft.replace("\"I\"", "\"I.\"")).contains("course 2 is knitted by 0 feeders"));
    let error = parse(&weft.replacen("ppkkkkkk", "ppkk?kkk", 1)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "chart: '?' stands for nothing: k is face, p reverse, and other letters need a line in \
         [legend]"
    );
    assert!(error.place.unwrap().to_string().contains("ppkk?kkk"));
    let error = parse(&weft.replacen("cable 3/3 left", "cable 3/3 up", 1)).unwrap_err();
    assert!(
        error.to_string().starts_with("legend: \"cable 3/3 up\" is no loop")
            && error.place.is_some()
    );
}

proptest! {
    #[test]
    fn every_weft_knit_reads_back(fabric in weft_knits()) {
        assert_round_trip(&fabric);
    }

    #[test]
    fn every_fabric_reads_back(fabric in fabrics()) {
        prop_assume!(fabric.check_repeats().is_ok());
        assert_round_trip(&fabric);
    }

    #[test]
    fn no_text_panics(text in "(?s).{0,200}|[\\[\\]{}a-z\"'= \n0-9.#]{0,80}") {
        if let Err(error) = parse(&text) {
            prop_assert!(!error.to_string().contains('\n'));
        }
    }

    #[test]
    fn no_damage_panics(
        from in 0..FABRIC.len(),
        length in 0..40_usize,
        patch in "(?s)[\\[\\]{}\"'=\n0-9-]{0,6}|.{0,3}",
    ) {
        let mut text = FABRIC.to_owned();
        text.replace_range(from..(from + length).min(FABRIC.len()), &patch);
        if let Err(error) = parse(&text) {
            prop_assert!(!error.to_string().is_empty());
            prop_assert!(error.place.is_none_or(|place| place.line <= text.lines().count() + 1));
        }
    }
}
