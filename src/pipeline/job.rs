//! One run of `drape` or `swatch`: what is knitted, onto what, and what it needs before its first yarn.

use std::path::PathBuf;
use std::sync::Arc;

use super::RunError;
use super::fibres::Fibres;
use super::settings::{Settings, Wanted};
use super::textures::{self, Textures};
use super::writers::{section, textures_in_files};
use crate::drape::{self, Cloth};
use crate::export::TextureSet;
use crate::fabric::Fabric;
use crate::knit::clearance::{self, Clearance};
use crate::render::scene::{Scene, Shape};
use crate::tile::Tile;
use crate::yarn::tube::Section;

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
    pub(super) options: drape::DrapeOptions,
    /// Flat area that is knitted, mm².
    pub(super) area: f64,
    pub(super) source: &'a Source,
    /// Whether it is a swatch: it has no body, and its numbers are wanted at the end whatever the files.
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

/// What a run's files make and draw with.
pub(super) struct Setup {
    pub(super) section: Section,
    pub(super) textures: Textures,
    /// The same as files hold them.
    pub(super) textures_in_files: Arc<TextureSet>,
    /// The yarns' fibres, where they are to be seen.
    pub(super) fibres: Option<Fibres>,
    /// How yarns are laid, with surfaces where a file holds them.
    pub(super) options: drape::DrapeOptions,
    /// How near yarns come to each other on the flat fabric.
    pub(super) near: Clearance,
}

impl Job<'_> {
    /// What the run needs before its first yarn; `wanted` are its files.
    pub(super) fn setup(&self, wanted: &[Wanted]) -> Result<Setup, RunError> {
        let section = section(self)?;
        let near = clearance::measure(self.shown, self.cloth.pattern(), section.radius);
        let wants_surface = wanted.iter().any(|(_, format)| format.holds_tubes());
        let options =
            drape::DrapeOptions { surface: wants_surface.then_some(section), ..self.options };
        let textures = Textures::read(self.settings.picture.texture.as_deref(), self.shown)?;
        let textures_in_files = textures_in_files(wanted, self, section.radius, &textures);
        let fibres = Fibres::new(self, wanted, &section)?;
        Ok(Setup { section, textures, textures_in_files, fibres, options, near })
    }

    /// What is to be said of the garment and of how the fabric is drawn, before any yarn is laid.
    pub(super) fn first_warnings(&self, setup: &Setup) -> Vec<String> {
        let mut warnings = self.cloth.garment().summary.warnings.clone();
        warnings.extend(clearance::warnings(
            self.shown,
            self.cloth.pattern(),
            &setup.near,
            setup.section.radius,
        ));
        if self.settings.picture.shape == Shape::Ribbon {
            warnings.extend(setup.textures.misfit(self.shown));
        }
        warnings
    }

    /// The scene that its yarns are drawn in.
    pub(super) fn scene(&self, setup: &Setup) -> Scene {
        textures::scene(
            self.settings.picture.shape,
            self.shown,
            setup.section.radius,
            &setup.textures,
        )
    }

    /// The part that is made, if it isn't the whole.
    pub(super) fn tile(&self) -> Option<Tile> {
        self.part.as_ref().map(|(tile, _)| *tile)
    }

    /// The yarns that files hold.
    pub(super) fn filed(&self) -> &Cloth<'_> {
        self.part.as_ref().map_or(self.cloth, |(_, part)| part)
    }
}
