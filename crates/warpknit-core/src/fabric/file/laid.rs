//! The tables of laid cloth: its strands, each with the path of its yarn.
//!
//! In: `[[strands]]` tables. Out: a [`LaidCloth`], and tables again. A path must move from each
//! point to the next, or its yarn would have no direction there.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::source::{FileText, Limits, unplaced};
use super::yarn::YarnTable;
use crate::fabric::error::{FabricError, FabricFault};
use crate::fabric::{LaidCloth, LaidStrand, MAX_PATH, StrandDirection};

const ACROSS: Limits = (-100.0, 100.0, "cells");
const DEPTH: Limits = (-1000.0, 1000.0, "mm");
/// Points nearer to each other than this are one.
const APART: f64 = 1e-9;

/// A `[[strands]]` table.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StrandTable {
    runs: StrandDirection,
    path: Spanned<Vec<[Spanned<f64>; 3]>>,
    yarn: YarnTable,
}

/// The laid cloth of a file.
pub(super) fn laid_cloth(
    strands: Vec<StrandTable>,
    source: FileText<'_>,
) -> Result<LaidCloth, FabricError> {
    let strands = strands.into_iter().zip(1..);
    let strands: Vec<_> = strands
        .map(|(table, number)| table.into_strand(number, source))
        .collect::<Result<_, _>>()?;
    if strands.is_empty() { Err(FabricFault::NoStrands.into()) } else { Ok(LaidCloth { strands }) }
}

impl StrandTable {
    /// The strand; `number` names it in errors.
    fn into_strand(self, number: usize, source: FileText<'_>) -> Result<LaidStrand, FabricError> {
        let path = self.points(number, source)?;
        // The path goes on into the next cell, so its last span ends at the first point there.
        let next = path.iter().copied().skip(1).chain([path[0] + self.runs.step()]);
        if path.iter().zip(next).any(|(point, next)| point.distance(next) < APART) {
            let why = "has two points in a row in one place; it goes on into the next cell, so the \
                       last is not the first again";
            return Err(FabricFault::Path { number, why }.at(source.0, self.path.span()));
        }
        let yarn = self.yarn.into_yarn(&format!("strand {number}"), source)?;
        Ok(LaidStrand { path, direction: self.runs, yarn })
    }

    /// The points of its path, each within its limits.
    fn points(&self, number: usize, source: FileText<'_>) -> Result<Vec<DVec3>, FabricError> {
        let points = self.path.get_ref();
        if !(2..=MAX_PATH).contains(&points.len()) {
            let why = "has too few or too many points: 2 to 1000 are taken";
            return Err(FabricFault::Path { number, why }.at(source.0, self.path.span()));
        }
        let what = format!("strand {number}: path");
        let mut path = Vec::with_capacity(points.len());
        for [x, y, z] in points {
            path.push(DVec3::new(
                source.number(&what, x, ACROSS)?,
                source.number(&what, y, ACROSS)?,
                source.number(&what, z, DEPTH)?,
            ));
        }
        Ok(path)
    }
}

impl From<&LaidStrand> for StrandTable {
    fn from(strand: &LaidStrand) -> Self {
        let path = strand.path.iter().map(|point| point.to_array().map(unplaced)).collect();
        Self { runs: strand.direction, path: unplaced(path), yarn: YarnTable::from(&strand.yarn) }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use crate::fabric::{Fabric, Structure};

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
        fn every_path_reads_back(
            points in prop::collection::vec(
                (-100.0..100.0, -100.0..100.0, -1000.0..1000.0),
                2..9,
            ),
            across in any::<bool>(),
        ) {
            let mut fabric = Fabric::parse(PLAIN).unwrap();
            let Structure::Laid(cloth) = &mut fabric.structure else { unreachable!() };
            cloth.strands.swap(0, usize::from(across));
            cloth.strands[0].path = points.into_iter().map(glam::DVec3::from).collect();
            prop_assert_eq!(Fabric::parse(&fabric.to_string()).unwrap(), fabric);
        }

        #[test]
        fn no_damage_panics(
            from in 0..PLAIN.len(),
            length in 0..40_usize,
            patch in "(?s)[\\[\\]{}\"'=\n0-9-]{0,6}|.{0,3}",
        ) {
            let mut text = PLAIN.to_owned();
            text.replace_range(from..(from + length).min(PLAIN.len()), &patch);
            if let Err(error) = Fabric::parse(&text) {
                prop_assert!(!error.to_string().is_empty());
            }
        }
    }
}
