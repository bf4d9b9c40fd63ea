//! The table of a panel: how the fabric lies on it.
//!
//! In: `[[panels]]` tables. Out: a [`PanelLayout`] each, and tables again. Whether the garment has
//! such a panel is checked when it is covered.

use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::source::{FileText, Limits, unplaced};
use crate::fabric::PanelLayout;
use crate::fabric::error::{FabricError, FabricFault};

const GRAIN: Limits = (-360.0, 360.0, "degrees");
const ORIGIN: Limits = (-1e5, 1e5, "mm");

/// A `[[panels]]` table.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PanelTable {
    panel: Spanned<usize>,
    #[serde(default, skip_serializing_if = "is_false")]
    turn: bool,
    #[serde(default = "nothing", skip_serializing_if = "is_nothing")]
    grain: Spanned<f64>,
    #[serde(default = "nowhere", skip_serializing_if = "is_nowhere")]
    origin: [Spanned<f64>; 2],
}

fn is_false(value: &bool) -> bool {
    !value
}

fn nothing() -> Spanned<f64> {
    unplaced(0.0)
}

fn is_nothing(number: &Spanned<f64>) -> bool {
    *number.get_ref() == 0.0
}

fn nowhere() -> [Spanned<f64>; 2] {
    [nothing(), nothing()]
}

fn is_nowhere(point: &[Spanned<f64>; 2]) -> bool {
    point.iter().all(is_nothing)
}

/// How panels are laid, each at most once.
pub(super) fn panels(
    tables: &[PanelTable],
    source: FileText<'_>,
) -> Result<Vec<PanelLayout>, FabricError> {
    let mut panels: Vec<PanelLayout> = Vec::new();
    for table in tables {
        let panel = *table.panel.get_ref();
        if panels.iter().any(|other| other.panel == panel) {
            return Err(FabricFault::PanelTwice(panel).at(source.0, table.panel.span()));
        }
        let grain_degrees = source.number(&format!("panel {panel}: grain"), &table.grain, GRAIN)?;
        let [x, y] = table
            .origin
            .each_ref()
            .map(|number| source.number(&format!("panel {panel}: origin"), number, ORIGIN));
        let origin = [x?, y?].into();
        panels.push(PanelLayout { panel, turn: table.turn, grain_degrees, origin });
    }
    Ok(panels)
}

impl From<&PanelLayout> for PanelTable {
    fn from(layout: &PanelLayout) -> Self {
        Self {
            panel: unplaced(layout.panel),
            turn: layout.turn,
            grain: unplaced(layout.grain_degrees),
            origin: layout.origin.to_array().map(unplaced),
        }
    }
}
