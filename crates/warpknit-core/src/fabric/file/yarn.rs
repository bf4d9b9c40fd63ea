//! The table of a yarn, which bars, feeders and strands have alike.
//!
//! In: a `yarn` table. Out: a [`Yarn`], and a table again.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::source::{FileText, Limits, unplaced};
use crate::fabric::error::FabricError;
use crate::fabric::yarn::{Color, Count, MOST_TWIST, Yarn};
use crate::yarn::hairs::MOST_HAIRINESS;

const FIBRE_DENSITY: Limits = (0.1, 25.0, "g/cm³");
const PACKING: Limits = (0.01, 1.0, "");
const PLIES: Limits = (1.0, 12.0, "");
const TWIST: Limits = (-MOST_TWIST, MOST_TWIST, "turns per metre");
/// Elastane is stretched to some five times its length before it breaks.
const DRAFT: Limits = (1.0, 8.0, "");
/// From soft elastane to carbon.
const MODULUS: Limits = (0.0001, 1000.0, "GPa");
const SHEEN: Limits = (0.0, 1.0, "");
const HAIRINESS: Limits = (0.0, MOST_HAIRINESS, "mm/mm");
const TEXTURE_LENGTH: Limits = (0.01, 10_000.0, "mm");

/// The `yarn` of a bar, a feeder or a strand.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct YarnTable {
    count: Count,
    density: Spanned<f64>,
    packing: Spanned<f64>,
    color: Color,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    draft: Option<Spanned<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    plies: Option<Spanned<u32>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    twist: Option<Spanned<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    modulus: Option<Spanned<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    sheen: Option<Spanned<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    hairiness: Option<Spanned<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    texture: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    texture_length: Option<Spanned<f64>>,
}

impl YarnTable {
    /// The yarn; `whose` names the bar, feeder or strand in errors.
    pub(super) fn into_yarn(self, whose: &str, source: FileText<'_>) -> Result<Yarn, FabricError> {
        let what = format!("{whose}: yarn");
        // TOML reads plies as integers; their range is checked like that of other numbers.
        if let Some(plies) = &self.plies {
            source.number(
                &format!("{what}.plies"),
                &Spanned::new(plies.span(), f64::from(*plies.get_ref())),
                PLIES,
            )?;
        }
        Ok(Yarn {
            count: self.count,
            density: source.number(&format!("{what}.density"), &self.density, FIBRE_DENSITY)?,
            packing: source.number(&format!("{what}.packing"), &self.packing, PACKING)?,
            color: self.color,
            draft: source.optional(&format!("{what}.draft"), self.draft.as_ref(), DRAFT)?,
            plies: self.plies.map(Spanned::into_inner),
            twist: source.optional(&format!("{what}.twist"), self.twist.as_ref(), TWIST)?,
            modulus: source.optional(&format!("{what}.modulus"), self.modulus.as_ref(), MODULUS)?,
            sheen: source.optional(&format!("{what}.sheen"), self.sheen.as_ref(), SHEEN)?,
            hairiness: source.optional(
                &format!("{what}.hairiness"),
                self.hairiness.as_ref(),
                HAIRINESS,
            )?,
            texture: self.texture,
            texture_length: source.optional(
                &format!("{what}.texture_length"),
                self.texture_length.as_ref(),
                TEXTURE_LENGTH,
            )?,
        })
    }
}

impl From<&Yarn> for YarnTable {
    fn from(yarn: &Yarn) -> Self {
        Self {
            count: yarn.count,
            density: unplaced(yarn.density),
            packing: unplaced(yarn.packing),
            color: yarn.color,
            draft: yarn.draft.map(unplaced),
            plies: yarn.plies.map(unplaced),
            twist: yarn.twist.map(unplaced),
            modulus: yarn.modulus.map(unplaced),
            sheen: yarn.sheen.map(unplaced),
            hairiness: yarn.hairiness.map(unplaced),
            texture: yarn.texture.clone(),
            texture_length: yarn.texture_length.map(unplaced),
        }
    }
}
