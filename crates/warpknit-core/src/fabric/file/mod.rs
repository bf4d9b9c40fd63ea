//! The fabric file: its TOML tables, and the way from them to a checked [`Fabric`] and back. What
//! only some kinds of fabric have is in rooms of its own.
//!
//! Every value that can be out of its range is read with its span, so that what is found after
//! TOML's own checks is pointed at in the file as well. What is printed reads back as the same
//! fabric; comments and the numbering and tempi of a chain are not kept.

mod laid;
mod panel;
mod warp;
mod weft;
mod yarn;

use std::collections::BTreeMap;
use std::ops::Range;

use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::bar::BarKind;
use super::dimensions::{Dimensions, KEYS};
use super::error::{FabricError, Fault};
use super::motif::{Motif, Symbol};
use super::{Fabric, INCH_IN_CM};
use laid::StrandTable;
use panel::{PanelTable, panels};
use warp::{BarTable, stitch};
use weft::{FeederTable, motif};
use yarn::YarnTable;

/// From, to and the unit of what a number may be.
pub(super) type Limits = (f64, f64, &'static str);

pub(super) const DENSITY: Limits = (0.01, 1000.0, "per cm");
const GAUGE: Limits = (0.1, 1000.0, "needles an inch");

/// Refuses a value outside its limits (NaN included).
pub(super) fn in_range(what: &str, value: f64, (low, high, unit): Limits) -> Result<f64, Fault> {
    if (low..=high).contains(&value) {
        return Ok(value);
    }
    let range = format!("between {low} and {high} {unit}").trim_end().to_owned();
    Err(Fault::Range { what: what.to_owned(), value, range })
}

/// The fabric file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FabricFile {
    name: String,
    #[serde(default)]
    about: String,
    #[serde(default, skip_serializing_if = "is_default")]
    kind: Kind,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    wales_per_cm: Option<Spanned<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    gauge: Option<Spanned<f64>>,
    courses_per_cm: Spanned<f64>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    stitch: BTreeMap<Spanned<String>, Spanned<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    chart: Option<Spanned<String>>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    legend: BTreeMap<Spanned<String>, Spanned<String>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    bars: Vec<BarTable>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    feeders: Vec<FeederTable>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    strands: Vec<StrandTable>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    panels: Vec<PanelTable>,
}

/// How a fabric is knitted, or that its yarns are given as they lie.
#[derive(Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    #[default]
    Warp,
    Weft,
    Laid,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

fn full_set() -> Spanned<String> {
    unplaced("I".to_owned())
}

/// A value that comes from no text.
fn unplaced<T>(value: T) -> Spanned<T> {
    Spanned::new(0..0, value)
}

/// The text of the file, in which errors are pointed at.
#[derive(Clone, Copy)]
struct Source<'a>(&'a str);

impl Source<'_> {
    fn number(self, what: &str, number: &Spanned<f64>, limits: Limits) -> Result<f64, FabricError> {
        in_range(what, *number.get_ref(), limits).map_err(|fault| fault.at(self.0, number.span()))
    }

    /// Puts a fault at the bytes `within` a string, as far as the string stands in the file as it
    /// is and not in escapes.
    fn in_string(
        self,
        string: &Spanned<String>,
        within: Range<usize>,
        fault: Fault,
    ) -> FabricError {
        let literal = &self.0[string.span()];
        let start =
            literal.find(string.get_ref().as_str()).filter(|_| !string.get_ref().is_empty());
        let span = start.map_or(string.span(), |at| {
            let start = string.span().start + at;
            start + within.start..start + within.end
        });
        fault.at(self.0, span)
    }
}

/// Reads a fabric.
pub(super) fn parse(text: &str) -> Result<Fabric, FabricError> {
    let file: FabricFile = toml::from_str(text).map_err(|error| {
        let fault = Fault::Toml(error.message().replace('\n', " "));
        match error.span() {
            // An empty span at the start is what a missing key at the top has: it is nowhere.
            Some(span) if span != (0..0) && span != (0..text.len()) => fault.at(text, span),
            _ => fault.into(),
        }
    })?;
    file.into_fabric(Source(text))
}

impl FabricFile {
    fn into_fabric(self, source: Source<'_>) -> Result<Fabric, FabricError> {
        let (wales_per_cm, gauge) = match (&self.wales_per_cm, &self.gauge) {
            (Some(wales), None) => (source.number("wales_per_cm", wales, DENSITY)?, None),
            (None, Some(gauge)) => {
                let gauge = source.number("gauge", gauge, GAUGE)?;
                (gauge / INCH_IN_CM, Some(gauge))
            }
            (Some(_), Some(gauge)) => return Err(Fault::TwoGauges.at(source.0, gauge.span())),
            (None, None) => return Err(Fault::NoGauge.into()),
        };
        let courses_per_cm = source.number("courses_per_cm", &self.courses_per_cm, DENSITY)?;
        self.check_kind()?;
        let stitch = stitch(&self.stitch, source)?;
        let motif =
            self.chart.as_ref().map(|chart| motif(chart, &self.legend, source)).transpose()?;
        if self.kind == Kind::Weft && motif.is_none() {
            return Err(Fault::NoFeeders.into());
        }
        if self.kind == Kind::Laid && self.strands.is_empty() {
            return Err(Fault::NoStrands.into());
        }
        let laid =
            self.strands.into_iter().zip(1..).map(|(table, number)| table.into_bar(number, source));
        let (strands, paths): (Vec<_>, Vec<_>) =
            laid.collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
        let guides =
            self.bars.into_iter().zip(1..).map(|(table, number)| table.into_bar(number, source));
        let feeders =
            self.feeders.into_iter().zip(1..).map(|(table, number)| table.into_bar(number, source));
        let fabric = Fabric {
            name: self.name,
            about: self.about,
            wales_per_cm,
            gauge,
            courses_per_cm,
            stitch,
            bars: guides
                .chain(feeders)
                .chain(strands.into_iter().map(Ok))
                .collect::<Result<_, _>>()?,
            motif,
            paths,
            panels: panels(&self.panels, source)?,
            enlargement: 1.0,
        };
        fabric.check_repeats()?;
        Ok(fabric)
    }

    /// Refuses keys that a fabric of this kind doesn't have.
    fn check_kind(&self) -> Result<(), Fault> {
        let bars = [("[[bars]]", !self.bars.is_empty()), ("[stitch]", !self.stitch.is_empty())];
        let weft = [
            ("chart", self.chart.is_some()),
            ("legend", !self.legend.is_empty()),
            ("[[feeders]]", !self.feeders.is_empty()),
        ];
        let strands = [("[[strands]]", !self.strands.is_empty())];
        let (kind, instead, others) = match self.kind {
            Kind::Warp => (
                "warp knit",
                "it has [[bars]], kind = \"weft\" a chart and [[feeders]], and kind = \"laid\" [[strands]]",
                [&weft[..], &strands].concat(),
            ),
            Kind::Weft => {
                ("weft knit", "it has a chart and [[feeders]]", [&bars[..], &strands].concat())
            }
            Kind::Laid => ("laid cloth", "it has [[strands]]", [&bars[..], &weft].concat()),
        };
        match others.into_iter().find(|(_, given)| *given) {
            Some((key, _)) => Err(Fault::OtherKind { kind, key, instead }),
            None => Ok(()),
        }
    }
}

impl From<&Fabric> for FabricFile {
    fn from(fabric: &Fabric) -> Self {
        let (mut stitch, mut default) = (fabric.stitch, Dimensions::default());
        let changed = KEYS.iter().filter_map(|key| {
            let value = *(key.of)(&mut stitch);
            (value != *(key.of)(&mut default))
                .then(|| (unplaced(key.name.to_owned()), unplaced(value)))
        });
        // Of a knit there are no paths, and of laid cloth as many as bars.
        let knitting = fabric.bars.iter().skip(fabric.paths.len());
        let knitted_by = |feeder: bool| {
            knitting.clone().filter(move |bar| (bar.kind == BarKind::Feeder) == feeder)
        };
        let legend = |motif: &Motif| {
            let written = |(letter, symbol): (&char, &Symbol)| {
                (unplaced(letter.to_string()), unplaced(symbol.to_string()))
            };
            motif.legend().iter().map(written).collect::<Vec<_>>()
        };
        Self {
            name: fabric.name.clone(),
            about: fabric.about.clone(),
            wales_per_cm: fabric.gauge.is_none().then(|| unplaced(fabric.wales_per_cm)),
            gauge: fabric.gauge.map(unplaced),
            courses_per_cm: unplaced(fabric.courses_per_cm),
            stitch: changed.collect(),
            kind: match &fabric.motif {
                Some(_) => Kind::Weft,
                None if fabric.is_laid() => Kind::Laid,
                None => Kind::Warp,
            },
            chart: fabric
                .motif
                .as_ref()
                .map(|motif| unplaced(format!("\n{}\n", motif.rows().join("\n")))),
            legend: fabric.motif.iter().flat_map(legend).collect(),
            bars: knitted_by(false).map(BarTable::from).collect(),
            feeders: knitted_by(true).map(FeederTable::from).collect(),
            strands: fabric
                .bars
                .iter()
                .zip(&fabric.paths)
                .map(|(bar, path)| StrandTable::of(bar, path))
                .collect(),
            panels: fabric.panels.iter().map(PanelTable::from).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::fabric::PanelLayout;
    use crate::fabric::bar::Bar;
    use crate::fabric::builtin;
    use crate::fabric::lapping::{Chain, MAX_GAP, Numbering};
    use crate::fabric::threading::Threading;
    use crate::fabric::yarn::{Color, Yarn};
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
            Fault::NoBars
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
            |(count, density, packing, rgb, (plies, twist, sheen), (texture, texture_length))| {
                Yarn {
                    plies,
                    twist,
                    sheen,
                    texture: texture.map(PathBuf::from),
                    texture_length,
                    ..Yarn::plain(count, density, packing, Color(rgb))
                }
            },
        )
    }

    fn bars() -> impl Strategy<Value = Bar> {
        (chains(), "[I.]{0,4}I[I.]{0,4}", yarns(), 0..3).prop_map(|(chain, marks, yarn, what)| {
            let threading = Threading::parse(&marks).unwrap();
            let kind = if what == 0 { BarKind::Weft } else { BarKind::Guide };
            let chain = match what {
                0 => Chain::parse("0-0//", Numbering::Tricot).unwrap(),
                1 => chain.mirrored(),
                _ => chain,
            };
            Bar { chain, threading, yarn, kind }
        })
    }

    fn stitches() -> impl Strategy<Value = Dimensions> {
        prop::collection::vec(prop::option::of(0.0..=1.0), KEYS.len()).prop_map(
            |shares: Vec<Option<f64>>| {
                let mut stitch = Dimensions::default();
                for (key, share) in KEYS.iter().zip(shares) {
                    let (low, high, _) = key.range;
                    let value = (key.of)(&mut stitch);
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
                stitch,
                bars,
                motif: None,
                paths: Vec::new(),
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
        let row =
            prop::collection::vec(prop::sample::select(vec!["k", "p", "xx", "CCCCC", "é"]), 1..9);
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
            let mut bars = vec![Bar::feeder(courses, yarn.clone())];
            bars.extend(Threading::parse(&others).map(|courses| Bar::feeder(courses, yarn)));
            Fabric {
                motif: Some(Motif::parse(&chart, &legend).unwrap()),
                bars,
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
        assert!(
            fault(&weft.replace("\"I\"", "\"I.\"")).contains("course 2 is knitted by 0 feeders")
        );
        let error = parse(&weft.replacen("ppkkkkkk", "ppkk?kkk", 1)).unwrap_err();
        assert_eq!(
            error.to_string(),
            "chart: '?' stands for nothing: k is face, p reverse, and other letters need a line in [legend]"
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
            let panels = Vec::new();
            assert_round_trip(&Fabric { panels, stitch: Dimensions::default(), ..fabric });
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
        fn no_damage_panics(from in 0..FABRIC.len(), length in 0..40_usize, patch in "(?s)[\\[\\]{}\"'=\n0-9-]{0,6}|.{0,3}") {
            let mut text = FABRIC.to_owned();
            text.replace_range(from..(from + length).min(FABRIC.len()), &patch);
            if let Err(error) = parse(&text) {
                prop_assert!(!error.to_string().is_empty());
                prop_assert!(error.place.is_none_or(|place| place.line <= text.lines().count() + 1));
            }
        }
    }
}
