//! The tables of a warp knit: its guide bars, and the dimensions of its stitches.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::{Source, YarnTable, full_set, unplaced};
use crate::fabric::bar::{self, Bar, BarKind};
use crate::fabric::dimensions::{Dimensions, KEYS};
use crate::fabric::error::{FabricError, Fault};
use crate::fabric::lapping::Numbering;

/// A `[[bars]]` table.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BarTable {
    lapping: Spanned<String>,
    #[serde(default)]
    numbering: Numbering,
    #[serde(default)]
    drive: Drive,
    #[serde(default = "full_set")]
    threading: Spanned<String>,
    yarn: YarnTable,
}

/// The side of the machine from which gaps are counted, for somebody in front of it, who sees the
/// technical back.
#[derive(Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Drive {
    #[default]
    Right,
    Left,
}

/// Reads the `[stitch]` table.
pub(super) fn stitch(
    table: &BTreeMap<Spanned<String>, Spanned<f64>>,
    source: Source<'_>,
) -> Result<Dimensions, FabricError> {
    let mut stitch = Dimensions::default();
    for (name, value) in table {
        let Some(key) = KEYS.iter().find(|key| key.name == name.get_ref()) else {
            return Err(Fault::UnknownDimension(name.get_ref().clone()).at(source.0, name.span()));
        };
        *(key.of)(&mut stitch) =
            source.number(&format!("stitch.{}", key.name), value, key.range)?;
    }
    Ok(stitch)
}

impl BarTable {
    pub(super) fn into_bar(self, number: usize, source: Source<'_>) -> Result<Bar, FabricError> {
        let (kind, chain) = bar::read_lapping(
            &format!("bar {number}, lapping"),
            self.lapping.get_ref(),
            self.numbering,
        )
        .map_err(|fault| source.in_string(&self.lapping, fault.span(), fault))?;
        let threading =
            bar::read_threading(&format!("bar {number}, threading"), self.threading.get_ref())
                .map_err(|fault| source.in_string(&self.threading, fault.span(), fault))?;
        // Both gaps and guides are counted from the drive; a weft's marks are courses.
        let mirrored = self.drive == Drive::Left && kind == BarKind::Guide;
        let (chain, threading) =
            if mirrored { (chain.mirrored(), threading.mirrored()) } else { (chain, threading) };
        Ok(Bar {
            chain,
            threading,
            yarn: self.yarn.into_yarn(&format!("bar {number}"), source)?,
            kind,
        })
    }
}

impl From<&Bar> for BarTable {
    fn from(bar: &Bar) -> Self {
        let left = bar.counts_from_left();
        Self {
            lapping: unplaced(bar.lapping()),
            numbering: Numbering::Tricot,
            drive: if left { Drive::Left } else { Drive::Right },
            threading: unplaced(
                if left { bar.threading.mirrored() } else { bar.threading.clone() }.to_string(),
            ),
            yarn: YarnTable::from(&bar.yarn),
        }
    }
}
