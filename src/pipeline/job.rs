//! One run of `drape` or `swatch`: what is knitted, and onto what.

use std::path::PathBuf;

use super::settings::Settings;
use crate::drape::{Cloth, DrapeOptions};
use crate::fabric::Fabric;
use crate::tile::Tile;

/// One run: what is knitted, onto what, and how it is shown.
pub(super) struct Job<'a> {
    pub(super) settings: &'a Settings,
    /// The fabric as named, whose numbers are reported.
    pub(super) fabric: &'a Fabric,
    /// The fabric at the densities at which it is drawn.
    pub(super) shown: &'a Fabric,
    /// How much larger that is, if it is; said in the report too.
    pub(super) enlarged: Option<String>,
    pub(super) cloth: &'a Cloth<'a>,
    /// The part that files hold, if it isn't the whole.
    pub(super) part: Option<(Tile, Cloth<'a>)>,
    pub(super) options: DrapeOptions,
    /// Flat area that is knitted, mm².
    pub(super) area: f64,
    pub(super) source: &'a Source,
    /// Whether it is a swatch: it has no body, and its numbers are wanted at the end whatever the
    /// files.
    pub(super) is_swatch: bool,
}

/// Where a run's cloth comes from, for the names of its files and messages.
#[derive(Clone, Debug, Default)]
pub struct Source {
    /// The fabric as it was asked for.
    pub fabric: String,
    /// Files that were read, and must not be overwritten.
    pub inputs: Vec<PathBuf>,
    /// What an output is called if none is named.
    pub stem: PathBuf,
}

impl Job<'_> {
    /// The part that is made, if it isn't the whole.
    pub(super) fn tile(&self) -> Option<Tile> {
        self.part.as_ref().map(|(tile, _)| *tile)
    }

    /// The yarns that files hold.
    pub(super) fn filed(&self) -> &Cloth<'_> {
        self.part.as_ref().map_or(self.cloth, |(_, part)| part)
    }
}
