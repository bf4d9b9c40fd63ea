//! The table of finishing: shrinkages and thickness.
//!
//! In: a `[finish]` table. Out: a [`Finish`], and a table again.

use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::source::{FileText, Limits, unplaced};
use crate::fabric::Finish;
use crate::fabric::error::FabricError;

/// Nets are stretched on the stenter, to at most twice their width. Nothing shrinks to a fifth.
const SHRINK: Limits = (-1.0, 0.8, "of the size on the machine");
const THICKNESS: Limits = (0.01, 100.0, "mm");

/// The `[finish]` table.
#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FinishTable {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    width_shrink: Option<Spanned<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    length_shrink: Option<Spanned<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    thickness_mm: Option<Spanned<f64>>,
}

impl FinishTable {
    /// Checks the table.
    pub(super) fn into_finish(self, source: FileText<'_>) -> Result<Finish, FabricError> {
        let number = |key: &str, value: Option<&Spanned<f64>>, limits| {
            source.optional(&format!("finish.{key}"), value, limits)
        };
        Ok(Finish {
            width_shrink: number("width_shrink", self.width_shrink.as_ref(), SHRINK)?,
            length_shrink: number("length_shrink", self.length_shrink.as_ref(), SHRINK)?,
            thickness: number("thickness_mm", self.thickness_mm.as_ref(), THICKNESS)?,
        })
    }

    /// The table of a fabric; `None` where it would be empty.
    pub(super) fn of(finish: &Finish) -> Option<Self> {
        (*finish != Finish::default()).then(|| Self {
            width_shrink: finish.width_shrink.map(unplaced),
            length_shrink: finish.length_shrink.map(unplaced),
            thickness_mm: finish.thickness.map(unplaced),
        })
    }
}
