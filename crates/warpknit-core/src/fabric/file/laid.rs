//! The tables of laid cloth: its strands, each with the path of its yarn.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::{Limits, Source, YarnTable, unplaced};
use crate::fabric::bar::{Bar, BarKind};
use crate::fabric::error::{FabricError, Fault};
use crate::fabric::{MAX_PATH, Path};

const ACROSS: Limits = (-100.0, 100.0, "cells");
const DEPTH: Limits = (-1000.0, 1000.0, "mm");
/// Points nearer to each other than this are one.
const APART: f64 = 1e-9;

/// A `[[strands]]` table.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StrandTable {
    runs: Runs,
    path: Spanned<Vec<[Spanned<f64>; 3]>>,
    yarn: YarnTable,
}

/// Where a strand goes on.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Runs {
    Along,
    Across,
}

impl StrandTable {
    /// The strand, and the path of its yarn.
    pub(super) fn into_bar(
        self,
        number: usize,
        source: Source<'_>,
    ) -> Result<(Bar, Path), FabricError> {
        let refuse = |why| Fault::Path { number, why }.at(source.0, self.path.span());
        let places = self.path.get_ref();
        if !(2..=MAX_PATH).contains(&places.len()) {
            return Err(refuse("has too few or too many points: 2 to 1000 are taken"));
        }
        let mut path = Path::with_capacity(places.len());
        for [x, y, z] in places {
            let place =
                |name: &str, number: &Spanned<f64>, limits| source.number(name, number, limits);
            let what = format!("strand {number}: path");
            path.push(DVec3::new(
                place(&what, x, ACROSS)?,
                place(&what, y, ACROSS)?,
                place(&what, z, DEPTH)?,
            ));
        }
        let (kind, period) = match self.runs {
            Runs::Along => (BarKind::LaidAlong, DVec3::Y),
            Runs::Across => (BarKind::LaidAcross, DVec3::X),
        };
        let next = path.iter().copied().skip(1).chain([path[0] + period]);
        if path.iter().zip(next).any(|(point, next)| point.distance(next) < APART) {
            return Err(refuse(
                "has two points in a row in one place; it goes on into the next cell, so the last is not the first again",
            ));
        }
        Ok((Bar::laid(kind, self.yarn.into_yarn(&format!("strand {number}"), source)?), path))
    }

    pub(super) fn of(bar: &Bar, path: &Path) -> Self {
        let runs = if bar.kind == BarKind::LaidAcross { Runs::Across } else { Runs::Along };
        let path = path.iter().map(|point| point.to_array().map(unplaced)).collect();
        Self { runs, path: unplaced(path), yarn: YarnTable::from(&bar.yarn) }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use crate::fabric::Fabric;

    const PLAIN: &str = r##"name = "plain"
kind = "laid"
wales_per_cm = 8
courses_per_cm = 10

[[strands]]
runs = "along"
path = [[0.5, 0.0, 0.1], [0.5, 0.5, -0.1]]
yarn = { count = "20 tex", density = 1.5, packing = 0.6, color = "#c8b090" }

[[strands]]
runs = "across"
path = [[0.0, 0.25, 0.0], [0.5, 0.25, 0.0]]
yarn = { count = "20 tex", density = 1.5, packing = 0.6, color = "#907050" }
"##;

    #[test]
    fn laid_cloth_reads_back_and_has_no_bars() {
        let fabric = Fabric::parse(PLAIN).unwrap();
        assert!(
            fabric.is_laid()
                && fabric.warnings().is_empty()
                && (fabric.repeat(), fabric.threading_repeat()) == (1, 1)
        );
        assert_eq!(Fabric::parse(&fabric.to_string()).unwrap(), fabric);
        let chained = fabric.with_chains(&["1-0/1-2".to_owned()], &[]).unwrap();
        assert!(!chained.is_laid());
    }

    #[test]
    fn faults_are_pointed_at() {
        for (from, to, message, carets) in [
            (
                "[0.5, 0.5, -0.1]",
                "[0.5, 1e9, -0.1]",
                "strand 1: path is 1000000000, but must be between -100 and 100 cells",
                "^^^",
            ),
            ("[0.5, 0.5, -0.1]", "[0.5, nan, -0.1]", "strand 1: path is NaN", "^^^"),
            (
                ", [0.5, 0.5, -0.1]",
                "",
                "strand 1: its path has too few or too many points: 2 to 1000 are taken",
                "^^^^",
            ),
            ("[0.5, 0.5, -0.1]", "[0.5, 1.0, 0.1]", "has two points in a row in one place", "^^^^"),
            ("\"along\"", "\"up\"", "unknown variant `up`", "^^^^"),
            ("[0.5, 0.5, -0.1]", "[0.5, 0.5]", "invalid length 2", "^^^^"),
        ] {
            let error = Fabric::parse(&PLAIN.replacen(from, to, 1)).unwrap_err();
            assert!(error.to_string().contains(message), "{to}: {error}");
            assert!(error.place.unwrap().to_string().contains(carets), "{to}");
        }
        let fault = |text: &str| Fabric::parse(text).unwrap_err().to_string();
        assert_eq!(
            fault(&PLAIN[..PLAIN.find("[[").unwrap()]),
            "laid cloth needs at least one [[strands]] table"
        );
        assert!(
            fault(&PLAIN.replace("kind = \"laid\"\n", ""))
                .starts_with("a warp knit has no [[strands]]")
        );
        assert!(
            fault(&PLAIN.replace("10\n", "10\nchart = \"k\"\n"))
                .starts_with("a laid cloth has no chart: it has [[strands]]")
        );
    }

    proptest! {
        #[test]
        fn every_path_reads_back(points in prop::collection::vec((-100.0..100.0, -100.0..100.0, -1000.0..1000.0), 2..9), across in any::<bool>()) {
            let mut fabric = Fabric::parse(PLAIN).unwrap();
            fabric.bars.swap(0, usize::from(across));
            fabric.paths[0] = points.into_iter().map(glam::DVec3::from).collect();
            prop_assert_eq!(Fabric::parse(&fabric.to_string()).unwrap(), fabric);
        }

        #[test]
        fn no_damage_panics(from in 0..PLAIN.len(), length in 0..40_usize, patch in "(?s)[\\[\\]{}\"'=\n0-9-]{0,6}|.{0,3}") {
            let mut text = PLAIN.to_owned();
            text.replace_range(from..(from + length).min(PLAIN.len()), &patch);
            if let Err(error) = Fabric::parse(&text) {
                prop_assert!(!error.to_string().is_empty());
            }
        }
    }
}
