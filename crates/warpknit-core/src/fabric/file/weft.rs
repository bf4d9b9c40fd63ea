//! The tables of a weft knit: its chart, its legend and its feeders.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::{Source, YarnTable, full_set, unplaced};
use crate::fabric::bar::{self, Bar};
use crate::fabric::error::{FabricError, Fault};
use crate::fabric::motif::{Motif, SymbolError};

/// A `[[feeders]]` table.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FeederTable {
    #[serde(default = "full_set")]
    courses: Spanned<String>,
    yarn: YarnTable,
}

/// Reads a chart by its legend.
pub(super) fn motif(
    chart: &Spanned<String>,
    legend: &BTreeMap<Spanned<String>, Spanned<String>>,
    source: Source<'_>,
) -> Result<Motif, FabricError> {
    let mut symbols = BTreeMap::new();
    for (letter, symbol) in legend {
        let mut letters = letter.get_ref().chars();
        let (Some(only), None) =
            (letters.next().filter(|letter| !letter.is_whitespace()), letters.next())
        else {
            return Err(Fault::Legend(format!("{:?} is not one letter", letter.get_ref()))
                .at(source.0, letter.span()));
        };
        let symbol = symbol.get_ref().parse().map_err(|why: SymbolError| {
            Fault::Legend(why.to_string()).at(source.0, symbol.span())
        })?;
        symbols.insert(only, symbol);
    }
    Motif::parse(chart.get_ref(), &symbols).map_err(|why| {
        let fault = Fault::Chart(why);
        source.in_string(chart, fault.span(), fault)
    })
}

impl FeederTable {
    pub(super) fn into_bar(self, number: usize, source: Source<'_>) -> Result<Bar, FabricError> {
        let courses =
            bar::read_threading(&format!("feeder {number}, courses"), self.courses.get_ref())
                .map_err(|fault| source.in_string(&self.courses, fault.span(), fault))?;
        Ok(Bar::feeder(courses, self.yarn.into_yarn(&format!("feeder {number}"), source)?))
    }
}

impl From<&Bar> for FeederTable {
    fn from(feeder: &Bar) -> Self {
        Self {
            courses: unplaced(feeder.threading.to_string()),
            yarn: YarnTable::from(&feeder.yarn),
        }
    }
}
