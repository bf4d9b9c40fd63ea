//! The tables of a warp knit: its guide bars, and the dimensions of its stitches.
//!
//! In: tables as TOML has them. Out: a [`WarpKnit`], and tables again. A bar with its drive on the
//! left is mirrored, so that the rest of the program counts gaps from one side only.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::full_set;
use super::source::{FileText, Limits, unplaced};
use super::yarn::YarnTable;
use crate::fabric::WarpKnit;
use crate::fabric::bar::{self, Bar, Lay, RUN_IN};
use crate::fabric::dimensions::{Dimensions, KEYS};
use crate::fabric::error::{FabricError, FabricFault};
use crate::fabric::lapping::Numbering;

/// An inlay that is half as long again as its way would hang out of the cloth in loops.
const SLACK: Limits = (0.0, 0.5, "of the straight length");

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
    #[serde(default, skip_serializing_if = "Option::is_none")]
    run_in_mm: Option<Spanned<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    slack: Option<Spanned<f64>>,
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

/// The warp knit of a file.
pub(super) fn warp_knit(
    stitch: &BTreeMap<Spanned<String>, Spanned<f64>>,
    bars: Vec<BarTable>,
    source: FileText<'_>,
) -> Result<WarpKnit, FabricError> {
    let stitch = dimensions(stitch, source)?;
    let bars = bars.into_iter().zip(1..).map(|(table, number)| table.into_bar(number, source));
    Ok(WarpKnit { bars: bars.collect::<Result<_, _>>()?, stitch })
}

/// The dimensions that differ from their defaults, as the file has them.
pub(super) fn stitch_table(stitch: &Dimensions) -> BTreeMap<Spanned<String>, Spanned<f64>> {
    let (mut stitch, mut default) = (*stitch, Dimensions::default());
    let changed = KEYS.iter().filter_map(|key| {
        let value = *(key.field)(&mut stitch);
        (value != *(key.field)(&mut default))
            .then(|| (unplaced(key.name.to_owned()), unplaced(value)))
    });
    changed.collect()
}

/// Reads the `[stitch]` table.
fn dimensions(
    table: &BTreeMap<Spanned<String>, Spanned<f64>>,
    source: FileText<'_>,
) -> Result<Dimensions, FabricError> {
    let mut stitch = Dimensions::default();
    for (name, value) in table {
        let Some(key) = KEYS.iter().find(|key| key.name == name.get_ref()) else {
            return Err(
                FabricFault::UnknownDimension(name.get_ref().clone()).at(source.0, name.span())
            );
        };
        *(key.field)(&mut stitch) =
            source.number(&format!("stitch.{}", key.name), value, key.range)?;
    }
    Ok(stitch)
}

impl BarTable {
    /// The bar; `number` names it in errors.
    fn into_bar(self, number: usize, source: FileText<'_>) -> Result<Bar, FabricError> {
        let lay = bar::read_lapping(
            &format!("bar {number}, lapping"),
            self.lapping.get_ref(),
            self.numbering,
        )
        .map_err(|fault| source.in_string(&self.lapping, fault.span(), fault))?;
        let threading =
            bar::read_threading(&format!("bar {number}, threading"), self.threading.get_ref())
                .map_err(|fault| source.in_string(&self.threading, fault.span(), fault))?;
        // Gaps and guides are both counted from the drive. The marks of wefts are courses.
        let (lay, threading) = match (lay, self.drive) {
            (Lay::Lapping(chain), Drive::Left) => {
                (Lay::Lapping(chain.mirrored()), threading.mirrored())
            }
            (lay @ (Lay::Lapping(_) | Lay::Weft), _) => (lay, threading),
        };
        let whose = format!("bar {number}");
        let bar = Bar {
            lay,
            threading,
            run_in: source.optional(
                &format!("{whose}: run_in_mm"),
                self.run_in_mm.as_ref(),
                RUN_IN,
            )?,
            slack: source.optional(&format!("{whose}: slack"), self.slack.as_ref(), SLACK)?,
            yarn: self.yarn.into_yarn(&whose, source)?,
        };
        match bar.contradiction() {
            Some(why) => {
                let key = self.slack.or(self.run_in_mm);
                let span = key.map_or(0..0, |key| key.span());
                Err(FabricFault::Bar { number, why }.at(source.0, span))
            }
            None => Ok(bar),
        }
    }
}

impl From<&Bar> for BarTable {
    fn from(bar: &Bar) -> Self {
        Self {
            lapping: unplaced(bar.lapping()),
            numbering: Numbering::Tricot,
            drive: if bar.counts_from_left() { Drive::Left } else { Drive::Right },
            threading: unplaced(bar.written_threading().to_string()),
            run_in_mm: bar.run_in.map(unplaced),
            slack: bar.slack.map(unplaced),
            yarn: YarnTable::from(&bar.yarn),
        }
    }
}
