//! One run of `drape` or `swatch`, or the pictures or the files of one, as data: its fabric, its cloth and its settings.

use std::path::PathBuf;

use super::densities::Gauge;
use super::settings::{Settings, Wanted};
use super::strain_cache::StrainCache;
use super::stretch::Stretched;
use crate::drape::{Cloth, DrapeOptions};
use crate::edges::{Edges, Thread};
use crate::fabric::Fabric;
use crate::garment::Garment;
use crate::map::Mapping;
use crate::tile::Tile;

/// One run: the fabric, the cloth that is knitted from it, and the settings.
pub(super) struct Job<'a> {
    pub(super) settings: &'a Settings,
    /// The fabric that was named. The report has its numbers.
    pub(super) fabric: &'a Fabric,
    /// The fabric at the densities at which it is drawn.
    pub(super) shown: &'a Fabric,
    /// The files to make of it.
    pub(super) outputs: Vec<Wanted>,
    /// Why it is drawn at these densities.
    pub(super) gauge: Gauge,
    /// Notes about how the cloth is shown. The report has them too.
    pub(super) notes: Vec<String>,
    pub(super) cloth: &'a Cloth<'a>,
    /// The edges of the garment, where they are finished.
    pub(super) edges: Option<&'a Edges>,
    /// The sewing threads of its finished edges.
    pub(super) threads: &'a [Thread],
    /// The part of the cloth that goes into files. `None` for the whole.
    pub(super) part: Option<(Tile, Cloth<'a>)>,
    /// Options of laying the yarns of pictures.
    pub(super) options: DrapeOptions,
    /// Flat area that is knitted, mm², with cloth that finished edges turn in.
    pub(super) area: f64,
    pub(super) source: &'a Source,
    /// Whether it is a swatch. A swatch has no body, and its numbers are always measured at the end.
    pub(super) is_swatch: bool,
    /// How the swatch is pulled.
    pub(super) stretched: Option<Stretched>,
}

/// The origin of a run's cloth, for the names of files and in messages.
#[derive(Clone, Debug, Default)]
pub struct Source {
    /// The fabric's name as the user gave it.
    pub fabric: String,
    /// Files that were read, and must not be overwritten.
    pub inputs: Vec<PathBuf>,
    /// Name of the output without its ending, if no output is named.
    pub stem: PathBuf,
}

impl Job<'_> {
    /// The garment as it was read, without the cloth that finished edges turn in.
    pub(super) fn unfinished_garment(&self) -> Garment {
        let mut garment = self.cloth.garment().clone();
        garment.panels.retain(|panel| panel.turned_in.is_none());
        garment
    }

    /// The part that is made. `None` for the whole.
    pub(super) fn tile(&self) -> Option<Tile> {
        self.part.as_ref().map(|(tile, _)| *tile)
    }

    /// The cache of the strained repeats, which are read here.
    pub(super) fn cache(&self) -> StrainCache {
        let wants_strain = self.options.mapping == Mapping::Relaxed;
        StrainCache::open(self.settings.cache.as_deref().filter(|_| wants_strain), self.cloth)
    }

    /// The cloth whose yarns go into files.
    pub(super) fn filed(&self) -> &Cloth<'_> {
        self.part.as_ref().map_or(self.cloth, |(_, part)| part)
    }
}
