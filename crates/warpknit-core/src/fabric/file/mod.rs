//! The fabric file: its TOML tables, and the conversions from them to a checked [`Fabric`] and
//! back. The tables of each kind of fabric, of yarns and of panels have files of their own.
//!
//! In: TOML. Out: a [`Fabric`], or an error with its place in the text: every value that can be out
//! of its range is read with its span. A printed fabric reads back as the same fabric. Not kept:
//! comments, and the numbering and tempi of a chain.

mod finish;
mod laid;
mod panel;
mod source;
mod warp;
mod weft;
mod yarn;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::error::{FabricError, FabricFault};
use super::{Fabric, Structure};
use finish::FinishTable;
use laid::{StrandTable, laid_cloth};
use panel::{PanelTable, panels};
use source::{FileText, GAUGE, unplaced};
use warp::{BarTable, stitch_table, warp_knit};
use weft::{FeederTable, legend_table, weft_knit};

pub(super) use source::{DENSITY, Limits, in_range};

/// The fabric file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FabricFile {
    name: String,
    #[serde(default)]
    about: String,
    #[serde(default, skip_serializing_if = "is_default")]
    kind: FabricKind,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    wales_per_cm: Option<Spanned<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    gauge: Option<Spanned<f64>>,
    courses_per_cm: Spanned<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    finish: Option<FinishTable>,
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

/// The kind of a fabric: which tables the file has. [`Structure`] holds what they say.
#[derive(Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum FabricKind {
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

/// Reads a fabric.
pub(super) fn parse(text: &str) -> Result<Fabric, FabricError> {
    let file: FabricFile = toml::from_str(text).map_err(|error| {
        let fault = FabricFault::Toml(plain(error.message()));
        match error.span() {
            // A missing key of the outermost table has no place: its span is empty, or everything.
            Some(span) if span != (0..0) && span != (0..text.len()) => fault.at(text, span),
            _ => fault.into(),
        }
    })?;
    file.into_fabric(FileText(text))
}

/// A message of the TOML reader in one line, with words in place of the types of this program.
fn plain(message: &str) -> String {
    let types = [("f64", "a number"), ("u32", "a whole number"), ("usize", "a whole number")];
    types.iter().fold(message.replace('\n', " "), |text, (name, words)| {
        text.replace(&format!("expected {name}"), &format!("expected {words}"))
    })
}

impl FabricFile {
    fn into_fabric(self, source: FileText<'_>) -> Result<Fabric, FabricError> {
        self.check_kind()?;
        let finish = self.finish.unwrap_or_default().into_finish(source)?;
        let (wales_per_cm, gauge) = match (&self.wales_per_cm, &self.gauge) {
            (Some(wales), None) => (source.number("wales_per_cm", wales, DENSITY)?, None),
            (None, Some(gauge)) => {
                let gauge = source.number("gauge", gauge, GAUGE)?;
                (finish.wales_per_cm(gauge), Some(gauge))
            }
            (Some(_), Some(gauge)) => return Err(FabricFault::TwoGauges.at(source.0, gauge.span())),
            (None, None) => return Err(FabricFault::NoGauge.into()),
        };
        let courses_per_cm = source.number("courses_per_cm", &self.courses_per_cm, DENSITY)?;
        let structure = match self.kind {
            FabricKind::Warp => Structure::Warp(warp_knit(&self.stitch, self.bars, source)?),
            FabricKind::Weft => {
                let chart = self.chart.ok_or(FabricFault::NoFeeders)?;
                Structure::Weft(weft_knit(&chart, &self.legend, self.feeders, source)?)
            }
            FabricKind::Laid => Structure::Laid(laid_cloth(self.strands, source)?),
        };
        let fabric = Fabric {
            name: self.name,
            about: self.about,
            wales_per_cm,
            gauge,
            courses_per_cm,
            finish,
            structure,
            panels: panels(&self.panels, source)?,
            enlargement: 1.0,
        };
        fabric.check_repeats()?;
        Ok(fabric)
    }

    /// Refuses keys that a fabric of this kind doesn't have.
    fn check_kind(&self) -> Result<(), FabricFault> {
        let bars = [("[[bars]]", !self.bars.is_empty()), ("[stitch]", !self.stitch.is_empty())];
        let weft = [
            ("chart", self.chart.is_some()),
            ("legend", !self.legend.is_empty()),
            ("[[feeders]]", !self.feeders.is_empty()),
        ];
        let strands = [("[[strands]]", !self.strands.is_empty())];
        let finish = [("[finish]", self.finish.is_some())];
        let (kind, instead, others) = match self.kind {
            FabricKind::Warp => (
                "warp knit",
                "it has [[bars]], kind = \"weft\" a chart and [[feeders]], and kind = \"laid\" \
                 [[strands]]",
                [&weft[..], &strands].concat(),
            ),
            FabricKind::Weft => {
                ("weft knit", "it has a chart and [[feeders]]", [&bars[..], &strands].concat())
            }
            FabricKind::Laid => {
                ("laid cloth", "it has [[strands]]", [&bars[..], &weft, &finish].concat())
            }
        };
        match others.into_iter().find(|(_, given)| *given) {
            Some((key, _)) => Err(FabricFault::OtherKind { kind, key, instead }),
            None => Ok(()),
        }
    }
}

impl From<&Fabric> for FabricFile {
    fn from(fabric: &Fabric) -> Self {
        // The keys that all kinds have; those of one kind are filled in below.
        let mut file = Self {
            name: fabric.name.clone(),
            about: fabric.about.clone(),
            kind: FabricKind::Warp,
            wales_per_cm: fabric.gauge.is_none().then(|| unplaced(fabric.wales_per_cm)),
            gauge: fabric.gauge.map(unplaced),
            courses_per_cm: unplaced(fabric.courses_per_cm),
            finish: FinishTable::of(&fabric.finish),
            stitch: BTreeMap::new(),
            chart: None,
            legend: BTreeMap::new(),
            bars: Vec::new(),
            feeders: Vec::new(),
            strands: Vec::new(),
            panels: fabric.panels.iter().map(PanelTable::from).collect(),
        };
        match &fabric.structure {
            Structure::Warp(knit) => {
                file.stitch = stitch_table(&knit.stitch);
                file.bars = knit.bars.iter().map(BarTable::from).collect();
            }
            Structure::Weft(knit) => {
                file.kind = FabricKind::Weft;
                file.chart = Some(unplaced(format!("\n{}\n", knit.motif.rows().join("\n"))));
                file.legend = legend_table(&knit.motif);
                file.feeders = knit.feeders.iter().map(FeederTable::from).collect();
            }
            Structure::Laid(cloth) => {
                file.kind = FabricKind::Laid;
                file.strands = cloth.strands.iter().map(StrandTable::from).collect();
            }
        }
        file
    }
}

#[cfg(test)]
mod tests;
