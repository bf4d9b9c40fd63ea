//! The files of a run and their writers.
//!
//! In: a [`Job`] and its prepared parts. Out: a [`FileWriter`] for each file that is written block by
//! block.

use std::path::PathBuf;
use std::sync::Arc;

use super::RunError;
use super::fibres::Fibres;
use super::job::{Job, Source};
use super::settings::{Settings, Wanted};
use super::setup::Setup;
use super::targets::check_distinct;
use super::textures::Textures;
use crate::export::{ClothInfo, Expected, ExportError, FileWriter, Format, Output, bcc, mtl};
use crate::garment::Panel;

/// The chosen files, or one picture that is named after the input.
pub(super) fn wanted(settings: &Settings, source: &Source) -> Vec<Wanted> {
    let mut wanted = settings.outputs.clone();
    if wanted.is_empty() {
        let mut name = source.stem.as_os_str().to_owned();
        // Not `with_extension`: a stem such as `shirt.v2` keeps its dot.
        name.push(".png");
        wanted.push((PathBuf::from(name), Format::Png));
    }
    if settings.centre_lines {
        wanted
            .iter_mut()
            .filter(|(_, format)| *format == Format::Obj)
            .for_each(|(_, format)| *format = Format::ObjLines);
    }
    wanted
}

/// Refuses files that would overwrite an input or each other. The `.mtl` and the textures beside an
/// `.obj` count too.
pub(super) fn check_places<'a>(
    job: &Job<'_>,
    outputs: impl Iterator<Item = &'a Wanted> + Clone,
    textures: &Textures,
) -> Result<(), RunError> {
    let companions: Vec<_> = outputs
        .clone()
        .flat_map(|(path, format)| match format {
            Format::Obj => mtl::paths(path, textures.count()),
            Format::ObjLines => mtl::paths(path, 0),
            Format::Bcc => vec![bcc::companion_path(path)],
            _ => Vec::new(),
        })
        .collect();
    check_distinct(
        job.source.inputs.iter().map(PathBuf::as_path),
        outputs.map(|(path, _)| path.as_path()).chain(companions.iter().map(PathBuf::as_path)),
    )
}

/// The facts about the cloth that writers need: its yarns, or their fibres if they were chosen. The
/// panels are those of the frame that is made.
fn cloth_info<'a>(job: &Job<'_>, setup: &Setup, panels: &'a [Panel]) -> ClothInfo<'a> {
    let cloth = job.filed();
    let info = match setup.fibres.as_ref().and_then(Fibres::in_files) {
        Some((bundles, section)) => ClothInfo::from_bundles(job.shown, bundles.to_vec(), section),
        None => ClothInfo {
            textures: Arc::clone(&setup.textures_in_files),
            ..ClothInfo::from_fabric(job.shown, setup.section)
        },
    };
    // Some formats begin with their number of blocks and yarns, before any yarn is laid.
    let expected = Expected { blocks: cloth.blocks(), yarns: cloth.yarns() };
    let facts = setup.facts.clone();
    let Settings { axes, glb, inp, npz, usd_curves, .. } = *job.settings;
    ClothInfo {
        expected: Some(expected),
        axes,
        facts,
        glb,
        inp,
        npz,
        usd_curves,
        ..info.on_panels(panels)
    }
}

/// The writers of all files that are written block by block, of yarns on these panels.
pub(super) fn sinks<'a>(
    outputs: &[Wanted],
    job: &Job<'_>,
    setup: &Setup,
    panels: &'a [Panel],
) -> Result<Vec<FileWriter<'a>>, ExportError> {
    let cloth = cloth_info(job, setup, panels);
    let mut sinks = Vec::new();
    for (path, format) in outputs {
        match format {
            // Pictures and reports are written at the end. Here their paths are checked, so that a
            // wrong one ends the run before the work.
            Format::Png | Format::Json => Output::check(path)?,
            format => sinks.push(FileWriter::create(path, *format, &cloth)?),
        }
    }
    Ok(sinks)
}

/// Ends all writers. Returns the complete files, each with the files beside it.
pub(super) fn finished(sinks: Vec<FileWriter<'_>>) -> Result<Vec<Output>, ExportError> {
    let mut outputs = Vec::new();
    for sink in sinks {
        outputs.extend(sink.finish()?);
    }
    Ok(outputs)
}
