//! Conversion of arguments into the library's types.
//!
//! In: parsed arguments. Out: the named fabric, the options of reading a garment, and a run's
//! settings.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Result;
use warpknit::drape::evenness::Evenness;
use warpknit::export::Axes;
use warpknit::export::glb::GlbOptions;
use warpknit::export::npz::NpzOptions;
use warpknit::fabric::{Fabric, FabricError};
use warpknit::garment::ReadOptions;
use warpknit::pipeline::{
    Densities, PictureSettings, Placement, Settings, Source, cache_folder, read_environment,
};
use warpknit::render::environment::Environment;

use super::args::{Chains, DrawingArgs, Laying, Reading, Shared, StageArgs};
use super::terminal::tell;
use super::values::{FloatArg, RunIn, SwitchArg};

impl Laying {
    /// The placement of yarns on a garment.
    pub(super) fn placement(&self) -> Placement {
        Placement {
            mapping: self.mapping.into(),
            sweeps: self.sweeps.map(SwitchArg::is_on),
            edge: self.edge.into(),
        }
    }

    /// The folder in which strained repeats are kept.
    pub(super) fn cache(&self) -> Option<PathBuf> {
        if self.no_cache { None } else { cache_folder() }
    }
}

impl DrawingArgs {
    /// Whether pictures show stitches that are copies of each other.
    pub(super) fn evenness(&self) -> Evenness {
        if self.regular { Evenness::Regular } else { Evenness::Uneven }
    }
}

impl StageArgs {
    /// The environment, read from its file.
    pub(super) fn environment(&self) -> Result<Option<Arc<Environment>>> {
        let turn = self.environment_turn.to_radians();
        let read = |path: &PathBuf| read_environment(path, turn).map(Arc::new);
        Ok(self.environment.as_ref().map(read).transpose()?)
    }
}

impl Reading {
    /// The options of reading a garment, with angles in radians.
    pub(super) fn options(&self) -> ReadOptions {
        ReadOptions {
            unit: self.unit,
            uv_scale: self.uv_scale,
            grain: self.grain.to_radians(),
            turn: self.turn,
            allow_loss: self.allow_loss,
        }
    }
}

impl Shared {
    /// The settings of a run. `placement` and `tile` keep their defaults, because not all commands
    /// have flags for them.
    pub(super) fn settings(&self) -> Settings {
        Settings {
            outputs: self.outputs.clone(),
            densities: self.densities(),
            st: self.st,
            sr: self.sr,
            radius: self.radius,
            flatten: self.flatten,
            caps: self.caps,
            fibres: self.fibres.map(SwitchArg::is_on),
            fibre_radius: self.fibre_radius,
            centre_lines: self.curves,
            usd_curves: self.usd_curves.into(),
            inp: self.inp.into(),
            axes: Axes { unit: self.file_unit.into(), up: self.up.into() },
            glb: GlbOptions {
                precision: self.glb_precision.into(),
                nodes: self.nodes.into(),
                is_compressed: self.glb_meshopt,
            },
            npz: NpzOptions {
                is_single: matches!(self.npz_precision, FloatArg::F32),
                is_compressed: self.npz_compress,
            },
            picture: self.picture(),
            ..Settings::default()
        }
    }

    /// The chosen densities.
    pub(super) fn densities(&self) -> Densities {
        Densities { wales_per_cm: self.wales_per_cm, courses_per_cm: self.courses_per_cm }
    }

    /// The settings of pictures, with angles in radians.
    fn picture(&self) -> PictureSettings {
        let DrawingArgs { renderer, spp, samples, lod, shape, regular: _, ref texture, turntable } =
            self.drawing;
        PictureSettings {
            size: self.size,
            view: self.view.into(),
            // clap requires --eye and --look-at together.
            eye: self.eye.zip(self.look_at),
            fov: self.fov.to_radians(),
            zoom: self.zoom,
            background: self.background,
            sun: self.sun,
            renderer: renderer.into(),
            spp,
            samples,
            lod: lod.is_on(),
            shape: shape.into(),
            texture: texture.clone(),
            turntable,
            evenness: self.drawing.evenness(),
            ..PictureSettings::default()
        }
    }

    /// The origin of a run's cloth, for names and messages.
    pub(super) fn source(&self, fabric: &Fabric, inputs: Vec<PathBuf>, stem: &Path) -> Source {
        let fabric = self.chains.label(&self.fabric, fabric).to_owned();
        Source { fabric, inputs, stem: stem.to_owned() }
    }
}

/// A built-in fabric, or the fabric of a file. A file's name ends in `.toml`.
pub(super) fn named_fabric(name: &str) -> Result<Fabric> {
    if Path::new(name).extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml")) {
        Fabric::read(Path::new(name)).map_err(|error| in_file(name, error))
    } else {
        Ok(Fabric::named(name)?)
    }
}

impl Chains {
    /// The fabric with these bars, counts and run-ins in place of its own, as far as they are given,
    /// at the chosen densities. Also returns a warning about counts that don't suit the densities.
    pub(super) fn on(
        &self,
        fabric: Fabric,
        densities: Densities,
    ) -> Result<(Fabric, Option<String>)> {
        let fabric = if self.lapping.is_empty() {
            fabric
        } else {
            fabric.with_chains(&self.lapping, &self.threading)?
        };
        let (fabric, warning) = densities.of_counts(fabric, &self.count)?;
        // Given run-ins count for the chosen densities, so they come after them.
        let run_ins: Vec<_> = self.run_in.iter().map(|RunIn(length)| *length).collect();
        Ok((fabric.with_run_ins(&run_ins)?, warning))
    }

    /// The fabric's name in messages: the name given with `--fabric`, or else its chains.
    pub(super) fn label<'a>(&self, asked: &'a str, fabric: &'a Fabric) -> &'a str {
        if self.lapping.is_empty() { asked } else { &fabric.name }
    }
}

/// The chosen fabric at the chosen densities. Its warnings are printed.
pub(super) fn fabric(shared: &Shared) -> Result<Fabric> {
    fabric_of(&shared.fabric, &shared.chains, shared.densities(), shared.running.quiet)
}

/// The fabric of that name with these chains, at these densities. Its warnings are printed unless
/// `quiet`.
pub(super) fn fabric_of(
    asked: &str,
    chains: &Chains,
    densities: Densities,
    quiet: bool,
) -> Result<Fabric> {
    let (fabric, misfit) = chains.on(named_fabric(asked)?, densities)?;
    let name = chains.label(asked, &fabric);
    for warning in fabric.warnings().into_iter().chain(misfit) {
        tell(quiet, &format!("warning: {name}: {warning}"));
    }
    Ok(fabric)
}

/// An error in a fabric file, with the file's name and line in front.
fn in_file(name: &str, error: FabricError) -> anyhow::Error {
    let place = match &error.place {
        Some(place) => format!("{name}:{}", place.line),
        None => name.to_owned(),
    };
    anyhow::Error::new(error).context(place)
}
