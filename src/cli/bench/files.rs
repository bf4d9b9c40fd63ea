//! Files of a run: all figures as JSON, the plots as a picture.

use std::path::Path;

use anyhow::Result;
use serde::Serialize;
use serde::ser::Serializer;
use warpknit::chart::{png, svg};
use warpknit::export::{self, Output};

use super::super::args::Bench;
use super::super::system::{memory_gb, processor};
use super::super::targets::{check_distinct, text_file};
use super::plot::sheet;
use super::table::Table;

/// The formats of a run's files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BenchFormat {
    /// All figures.
    Json,
    /// Plots as text that drawing programs edit.
    Svg,
    /// Plots as pixels.
    Png,
}

impl BenchFormat {
    /// The format of a path, by its ending in any case.
    pub(crate) fn from_path(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "json" => Some(Self::Json),
            "svg" => Some(Self::Svg),
            "png" => Some(Self::Png),
            _ => None,
        }
    }
}

/// Everything about a run.
#[derive(Serialize)]
struct RunRecord<'a> {
    warpknit: &'static str,
    machine: Machine,
    /// Runs of each figure, after one that warms up; pictures may have fewer, as their tables'
    /// notes say.
    runs: u32,
    #[serde(serialize_with = "by_key")]
    tables: &'a [Table],
}

/// What the figures depend on.
#[derive(Serialize)]
struct Machine {
    system: &'static str,
    architecture: &'static str,
    /// Its name, where the system tells it.
    processor: Option<String>,
    memory_gb: Option<f64>,
    cores: usize,
    threads: usize,
}

impl Machine {
    fn here() -> Self {
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        Self {
            system: std::env::consts::OS,
            architecture: std::env::consts::ARCH,
            processor: processor(),
            memory_gb: memory_gb(),
            cores,
            threads: rayon::current_num_threads(),
        }
    }
}

fn by_key<S: Serializer>(tables: &[Table], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(tables.iter().map(|table| (table.key, table)))
}

/// Refuses, before anything is measured, files that can't be written, or that are inputs or named
/// twice.
pub(super) fn check(arguments: &Bench) -> Result<()> {
    let outputs = || arguments.outputs.iter().map(|(path, _)| path.as_path());
    check_distinct(arguments.meshes.iter().map(AsRef::as_ref), outputs())?;
    for path in outputs() {
        drop(Output::create(path)?);
    }
    Ok(())
}

/// Writes what was asked for. Files appear under their names only when all are whole.
pub(super) fn write(arguments: &Bench, tables: &[Table]) -> Result<()> {
    let outputs = arguments.outputs.iter().map(|(path, format)| {
        Ok(match format {
            BenchFormat::Json => {
                let record = RunRecord {
                    warpknit: env!("CARGO_PKG_VERSION"),
                    machine: Machine::here(),
                    runs: arguments.runs,
                    tables,
                };
                text_file(path, &(serde_json::to_string_pretty(&record)? + "\n"))?
            }
            BenchFormat::Svg => text_file(path, &svg::text(&plots(tables)?))?,
            BenchFormat::Png => export::png::write(path, &png::paint(&plots(tables)?))?,
        })
    });
    let whole = outputs.collect::<Result<Vec<_>>>()?;
    Ok(whole.into_iter().try_for_each(Output::publish)?)
}

fn plots(tables: &[Table]) -> Result<warpknit::chart::Drawing> {
    let Machine { system, architecture, processor, cores, threads, .. } = Machine::here();
    let processor = processor.as_deref().unwrap_or(architecture);
    let heading = format!(
        "warpknit {} bench on {system}, {processor}, {threads} threads on {cores} cores; dashed: published, other machine",
        env!("CARGO_PKG_VERSION")
    );
    sheet(&heading, &tables.iter().flat_map(|table| &table.plots).collect::<Vec<_>>())
}
