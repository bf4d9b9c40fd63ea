//! The tables of a weft knit: its chart, its legend and its feeders.
//!
//! In: tables as TOML has them. Out: a [`WeftKnit`], and tables again. The motif checks the chart;
//! that each course has one feeder is checked once the fabric is whole.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::full_set;
use super::source::{FileText, unplaced};
use super::yarn::YarnTable;
use crate::fabric::bar;
use crate::fabric::error::{FabricError, FabricFault};
use crate::fabric::motif::{Motif, SymbolError};
use crate::fabric::{Feeder, WeftKnit};

/// A `[[feeders]]` table.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FeederTable {
    #[serde(default = "full_set")]
    courses: Spanned<String>,
    yarn: YarnTable,
}

/// The weft knit of a file.
pub(super) fn weft_knit(
    chart: &Spanned<String>,
    legend: &BTreeMap<Spanned<String>, Spanned<String>>,
    feeders: Vec<FeederTable>,
    source: FileText<'_>,
) -> Result<WeftKnit, FabricError> {
    let motif = motif(chart, legend, source)?;
    let feeders = feeders.into_iter().zip(1..);
    let feeders = feeders.map(|(table, number)| table.into_feeder(number, source));
    Ok(WeftKnit { motif, feeders: feeders.collect::<Result<_, _>>()? })
}

/// The legend of a motif as the file has it.
pub(super) fn legend_table(motif: &Motif) -> BTreeMap<Spanned<String>, Spanned<String>> {
    let legend = motif.legend().iter();
    legend
        .map(|(letter, symbol)| [letter.to_string(), symbol.to_string()].map(unplaced))
        .map(|[letter, symbol]| (letter, symbol))
        .collect()
}

/// Reads a chart by its legend.
fn motif(
    chart: &Spanned<String>,
    legend: &BTreeMap<Spanned<String>, Spanned<String>>,
    source: FileText<'_>,
) -> Result<Motif, FabricError> {
    let mut symbols = BTreeMap::new();
    for (letter, symbol) in legend {
        let mut letters = letter.get_ref().chars();
        let (Some(only), None) =
            (letters.next().filter(|letter| !letter.is_whitespace()), letters.next())
        else {
            return Err(FabricFault::Legend(format!("{:?} is not one letter", letter.get_ref()))
                .at(source.0, letter.span()));
        };
        let symbol = symbol.get_ref().parse().map_err(|why: SymbolError| {
            FabricFault::Legend(why.to_string()).at(source.0, symbol.span())
        })?;
        symbols.insert(only, symbol);
    }
    Motif::parse(chart.get_ref(), &symbols).map_err(|why| {
        let fault = FabricFault::Chart(why);
        source.in_string(chart, fault.span(), fault)
    })
}

impl FeederTable {
    /// The feeder; `number` names it in errors.
    fn into_feeder(self, number: usize, source: FileText<'_>) -> Result<Feeder, FabricError> {
        let courses =
            bar::read_threading(&format!("feeder {number}, courses"), self.courses.get_ref())
                .map_err(|fault| source.in_string(&self.courses, fault.span(), fault))?;
        Ok(Feeder { courses, yarn: self.yarn.into_yarn(&format!("feeder {number}"), source)? })
    }
}

impl From<&Feeder> for FeederTable {
    fn from(feeder: &Feeder) -> Self {
        Self { courses: unplaced(feeder.courses.to_string()), yarn: YarnTable::from(&feeder.yarn) }
    }
}
