//! Which files a run writes, and who writes each.

use std::path::PathBuf;
use std::sync::Arc;

use crate::export::bcc::BccWriter;
use crate::export::csv::CsvWriter;
use crate::export::curves::CurvesWriter;
use crate::export::fibres::SpunWriter;
use crate::export::glb::GlbWriter;
use crate::export::inp::InpWriter;
use crate::export::npz::NpzWriter;
use crate::export::obj::ObjWriter;
use crate::export::obj_lines::ObjLinesWriter;
use crate::export::ply::PlyWriter;
use crate::export::usda::UsdaWriter;
use crate::export::{ExportError, Format, Output, Sink, Wardrobe, mtl};
use crate::render::scene::Shape;
use crate::yarn::tube::Section;

use super::RunError;
use super::densities::drawn_radius;
use super::job::{Job, Setup};
use super::settings::{Settings, Wanted};
use super::targets::check_distinct;
use super::textures::{self, Textures};

/// St and Sr of tubes in files, where nobody asks for others.
const FILE_ST: u32 = 10;
const FILE_SR: u32 = 6;
/// The texture's real length where there is none: v counts millimetres.
const TEXTURE_PER_MM: f64 = 1.0;

/// The files that were asked for, or a picture named after the input.
pub(super) fn wanted(job: &Job<'_>) -> Vec<Wanted> {
    let mut wanted = job.settings.outputs.clone();
    if wanted.is_empty() {
        let mut name = job.source.stem.as_os_str().to_owned();
        name.push(".png");
        wanted.push((PathBuf::from(name), Format::Png));
    }
    if job.settings.centre_lines {
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
) -> Result<(), RunError> {
    let companions: Vec<_> = outputs
        .clone()
        .flat_map(|(path, format)| match format {
            Format::Obj => mtl::companions(path, textures.count()),
            Format::ObjLines => mtl::companions(path, 0),
            _ => Vec::new(),
        })
        .collect();
    check_distinct(
        job.source.inputs.iter().map(PathBuf::as_path),
        outputs.map(|(path, _)| path.as_path()).chain(companions.iter().map(PathBuf::as_path)),
    )
}

/// Writers of everything that streams.
pub(super) fn sinks<'a>(
    outputs: &[Wanted],
    job: &Job<'a>,
    setup: &Setup,
) -> Result<Vec<Box<dyn Sink + 'a>>, ExportError> {
    let filed = setup
        .fibres
        .as_ref()
        .and_then(|fibres| fibres.filed.as_ref().map(|filed| (&fibres.bundles, filed)));
    let (fabric, section) =
        filed.map_or((job.shown, &setup.section), |(_, (fabric, section))| (fabric, section));
    // Fibres wear no pictures of yarns.
    let wardrobe = || if filed.is_some() { Arc::default() } else { Arc::clone(&setup.wardrobe) };
    let cloth = job.filed();
    let mut sinks: Vec<Box<dyn Sink + 'a>> = Vec::new();
    for (path, format) in outputs {
        match format {
            Format::Glb => sinks.push(Box::new(GlbWriter::create(
                path,
                fabric,
                wardrobe(),
                cloth.blocks(),
                cloth.yarns(),
            )?)),
            Format::Obj => sinks.push(Box::new(ObjWriter::create(path, fabric, wardrobe())?)),
            Format::ObjLines => {
                sinks.push(Box::new(ObjLinesWriter::create(path, fabric, section.st)?));
            }
            Format::Ply => sinks.push(Box::new(PlyWriter::create(path, fabric, section)?)),
            Format::Usda => sinks.push(Box::new(UsdaWriter::create(path, fabric, section)?)),
            Format::Bcc => sinks.push(Box::new(BccWriter::create(path, section.st)?)),
            Format::Curves => sinks.push(Box::new(CurvesWriter::create(path, fabric, section)?)),
            Format::Inp => sinks.push(Box::new(InpWriter::create(path, fabric, section)?)),
            Format::Npz => {
                sinks.push(Box::new(NpzWriter::create(
                    path,
                    fabric,
                    job.cloth.garment(),
                    section,
                )?));
            }
            Format::Csv => sinks.push(Box::new(CsvWriter::create(path, job.cloth.garment())?)),
            // Made whole at the end; that they can be written is asked before the work and not
            // after it.
            Format::Png | Format::Json => Output::check(path)?,
        }
    }
    let Some((bundles, (_, section))) = filed else { return Ok(sinks) };
    let surface = setup.options.surface.map(|_| *section);
    Ok(sinks
        .into_iter()
        .map(|sink| -> Box<dyn Sink + 'a> {
            Box::new(SpunWriter::new(sink, bundles.clone(), surface))
        })
        .collect())
}

/// The whole files, and what comes with each.
pub(super) fn finished<S: Sink + ?Sized>(sinks: Vec<Box<S>>) -> Result<Vec<Output>, ExportError> {
    Ok(sinks
        .into_iter()
        .map(Sink::finish)
        .collect::<Result<Vec<_>, _>>()?
        .into_iter()
        .flatten()
        .collect())
}

/// What the yarns of these files wear, made ready where there is a file that holds pictures.
pub(super) fn wardrobe(
    outputs: &[Wanted],
    job: &Job<'_>,
    radius: f64,
    textures: &Textures,
) -> Arc<Wardrobe> {
    let holds_pictures =
        outputs.iter().any(|(_, format)| matches!(format, Format::Glb | Format::Obj));
    let dressed = holds_pictures.then(|| textures::scene(Shape::Tube, job.shown, radius, textures));
    Arc::new(dressed.as_ref().map(Wardrobe::of).unwrap_or_default())
}

/// How fine and how thick tubes in files are.
pub(super) fn section(job: &Job<'_>) -> Result<Section, RunError> {
    let Settings { radius, flatten, caps, .. } = *job.settings;
    let (st, sr) = (job.settings.st.unwrap_or(FILE_ST), job.settings.sr.unwrap_or(FILE_SR));
    let radius = drawn_radius(job.shown, radius)?;
    Ok(Section { st, sr, radius, flatten, caps, texture_per_mm: TEXTURE_PER_MM })
}
