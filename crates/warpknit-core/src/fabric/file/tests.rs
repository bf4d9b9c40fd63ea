//! Fabric files: faults are pointed at, and every printed fabric reads back as the same fabric.

use std::path::PathBuf;

use super::*;
use crate::fabric::builtin;
use crate::fabric::dimensions::KEYS;
use crate::fabric::lapping::{Chain, MAX_GAP, Numbering};
use crate::fabric::motif::Motif;
use crate::fabric::threading::Threading;
use crate::fabric::yarn::{Color, Yarn};
use crate::fabric::{Bar, Dimensions, Feeder, Lay, PanelLayout, WarpKnit, WeftKnit};
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
    pointed("plies = 2", "plies = 2.5", "expected u32", "9: ", "2.5");
    pointed("plies = 2", "twist = 1e9", "yarn.twist is 1000000000", "9: ", "1e9");
    pointed(
        "plies = 2",
        "sheen = 1.5",
        "yarn.sheen is 1.5, but must be between 0 and 1",
        "9: ",
        "1.5",
    );
    pointed("44 dtex", "44 stone", "no yarn count", "9: ", "\"44 stone\"");
    pointed(
        "w1 = 0.2",
        "w1 = 0.9",
        "stitch.w1 is 0.9, but must be between 0.01 and 0.5 of the wale",
        "4: ",
        "0.9",
    );
    pointed("w1", "w9", "[stitch] has no w9: it takes w1 w1x", "4: ", "w9");
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
    );
    let texture = (prop::option::of(".{0,12}"), prop::option::of(0.01..10_000.0));
    (count, 0.1..25.0, 0.01..1.0, prop::array::uniform3(0_u8..), look, texture).prop_map(
        |(count, density, packing, rgb, (plies, twist, sheen), (texture, texture_length))| Yarn {
            plies,
            twist,
            sheen,
            texture: texture.map(PathBuf::from),
            texture_length,
            ..Yarn::plain(count, density, packing, Color(rgb))
        },
    )
}

fn bars() -> impl Strategy<Value = Bar> {
    (chains(), "[I.]{0,4}I[I.]{0,4}", yarns(), 0..3).prop_map(|(chain, marks, yarn, what)| {
        let threading = Threading::parse(&marks).unwrap();
        let lay = match what {
            0 => Lay::Weft,
            1 => Lay::Lapping(chain.mirrored()),
            _ => Lay::Lapping(chain),
        };
        Bar { lay, threading, yarn }
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

fn fabrics() -> impl Strategy<Value = Fabric> {
    let panels = prop::collection::btree_map(
        0..40_usize,
        (-360.0..360.0, prop::array::uniform2(-1e5..1e5)),
        0..4,
    );
    let texts = (".{0,20}", "\\PC{0,40}|[\"'\\\\\n]{0,9}");
    let densities = (any::<bool>(), 0.1..1000.0, 0.01..1000.0);
    (texts, densities, stitches(), prop::collection::vec(bars(), 1..4), panels).prop_map(
        |((name, about), (by_gauge, wales, courses_per_cm), stitch, bars, panels)| Fabric {
            name,
            about,
            wales_per_cm: if by_gauge { wales / INCH_IN_CM } else { wales },
            gauge: by_gauge.then_some(wales),
            courses_per_cm,
            structure: Structure::Warp(WarpKnit { bars, stitch }),
            panels: panels
                .into_iter()
                .map(|(panel, (grain_degrees, origin))| PanelLayout {
                    panel,
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
