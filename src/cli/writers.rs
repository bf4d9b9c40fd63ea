//! Which files a run writes, and who writes each.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Result;
use warpknit::export::{
    ClothInfo, Expected, ExportError, FileWriter, Format, Output, TextureSet, default_section, mtl,
};
use warpknit::render::scene::Shape;
use warpknit::yarn::tube::Section;

use super::args::Shared;
use super::choice::drawn_radius;
use super::job::{Fibres, Job, Setup};
use super::pictures::{self, Textures};
use super::targets::check_distinct;

/// A file and what is to be in it.
pub(super) type Wanted = (PathBuf, Format);

/// The files that were asked for, or a picture named after the input.
pub(super) fn wanted(job: &Job<'_>) -> Vec<Wanted> {
    let mut wanted = job.shared.outputs.clone();
    if wanted.is_empty() {
        let mut name = job.stem.as_os_str().to_owned();
        name.push(".png");
        wanted.push((PathBuf::from(name), Format::Png));
    }
    if job.shared.curves {
        wanted
            .iter_mut()
            .filter(|(_, format)| *format == Format::Obj)
            .for_each(|(_, format)| *format = Format::ObjLines);
    }
    wanted
}

/// Refuses files that are written twice, or over one that was read; those that come with others
/// count too.
pub(super) fn check_places<'a>(
    job: &Job<'_>,
    outputs: impl Iterator<Item = &'a Wanted> + Clone,
    textures: &Textures,
) -> Result<()> {
    let companions: Vec<_> = outputs
        .clone()
        .flat_map(|(path, format)| match format {
            Format::Obj => mtl::paths(path, textures.count()),
            Format::ObjLines => mtl::paths(path, 0),
            _ => Vec::new(),
        })
        .collect();
    check_distinct(
        job.inputs.iter().copied(),
        outputs.map(|(path, _)| path.as_path()).chain(companions.iter().map(PathBuf::as_path)),
    )
}

/// What files say of the cloth: its yarns, or their fibres where those were asked for.
pub(super) fn cloth_info<'a>(job: &Job<'a>, setup: &Setup) -> ClothInfo<'a> {
    let (cloth, panels) = (job.filed(), &job.cloth.garment().panels);
    let info = match &setup.fibres {
        Some(Fibres { bundles, filed: Some(section), .. }) => {
            ClothInfo::from_bundles(job.shown, bundles.clone(), *section)
        }
        _ => ClothInfo {
            textures: Arc::clone(&setup.textures_in_files),
            ..ClothInfo::from_fabric(job.shown, setup.section)
        },
    };
    let expected = Expected { blocks: cloth.blocks(), yarns: cloth.yarns() };
    ClothInfo { expected: Some(expected), ..info.on_panels(panels) }
}

/// Writers of everything that streams.
pub(super) fn sinks<'a>(
    outputs: &[Wanted],
    job: &Job<'a>,
    setup: &Setup,
) -> Result<Vec<FileWriter<'a>>, ExportError> {
    let cloth = cloth_info(job, setup);
    let mut sinks = Vec::new();
    for (path, format) in outputs {
        match format {
            // Made whole at the end. Whether they can be written is checked before the work.
            Format::Png | Format::Json => Output::check(path)?,
            format => sinks.push(FileWriter::create(path, *format, &cloth)?),
        }
    }
    Ok(sinks)
}

/// The whole files, and what comes with each.
pub(super) fn finished(sinks: Vec<FileWriter<'_>>) -> Result<Vec<Output>, ExportError> {
    let mut outputs = Vec::new();
    for sink in sinks {
        outputs.extend(sink.finish()?);
    }
    Ok(outputs)
}

/// The textures of these files, made ready where there is a file that holds some.
pub(super) fn textures_in_files(
    outputs: &[Wanted],
    job: &Job<'_>,
    radius: f64,
    textures: &Textures,
) -> Arc<TextureSet> {
    if !outputs.iter().any(|(_, format)| format.holds_textures()) {
        return Arc::default();
    }
    let scene = pictures::scene(Shape::Tube, job.shown, radius, textures);
    Arc::new(TextureSet::from_scene(&scene))
}

/// How fine and how thick tubes in files are.
pub(super) fn section(job: &Job<'_>) -> Result<Section> {
    let Shared { radius, flatten, caps, .. } = *job.shared;
    let default = default_section(drawn_radius(job.shown, radius)?);
    let st = job.shared.st.unwrap_or(default.st);
    let sr = job.shared.sr.unwrap_or(default.sr);
    Ok(Section { st, sr, flatten, caps, ..default })
}
