//! The files of a bench run: all figures as JSON, the plots as SVG or PNG.
//!
//! In: the tables. Out: files that appear under their names only when all of them are complete.

use anyhow::Result;
use serde::Serialize;
use serde::ser::Serializer;
use warpknit::chart::{png, svg};
use warpknit::export::{self, Output};

use super::super::args::Bench;
use super::super::args::BenchFormat;
use super::plot::sheet;
use super::table::Table;
use warpknit::pipeline::check_distinct;
use warpknit::system::{memory_gb, processor};

/// The JSON file: the run, the machine, the tables. Its field names are an interface for scripts.
#[derive(Serialize)]
struct RunRecord<'a> {
    warpknit: &'static str,
    machine: MachineInfo,
    /// Runs of each figure after the warm-up run. Pictures may have fewer; their tables' notes say
    /// so.
    runs: u32,
    #[serde(serialize_with = "by_key")]
    tables: &'a [Table],
}

/// The machine that the figures depend on.
#[derive(Serialize)]
struct MachineInfo {
    system: &'static str,
    architecture: &'static str,
    /// Its name, where the system gives it.
    processor: Option<String>,
    memory_gb: Option<f64>,
    cores: usize,
    threads: usize,
}

impl MachineInfo {
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

/// Serialises tables as a map from their keys.
fn by_key<S: Serializer>(tables: &[Table], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(tables.iter().map(|table| (table.key, table)))
}

/// Checks the output files before anything is measured. Refuses files that can't be written, that
/// are inputs too, or that are named twice.
pub(super) fn check(arguments: &Bench) -> Result<()> {
    let outputs = || arguments.outputs.iter().map(|(path, _)| path.as_path());
    check_distinct(arguments.meshes.iter().map(AsRef::as_ref), outputs())?;
    // Creating an output fails where writing would; dropping it leaves nothing behind.
    for path in outputs() {
        drop(Output::create(path)?);
    }
    Ok(())
}

/// Writes the files that were asked for. They appear under their names only when all are complete.
pub(super) fn write(arguments: &Bench, tables: &[Table]) -> Result<()> {
    let outputs = arguments.outputs.iter().map(|(path, format)| {
        Ok(match format {
            BenchFormat::Json => {
                let record = RunRecord {
                    warpknit: env!("CARGO_PKG_VERSION"),
                    machine: MachineInfo::here(),
                    runs: arguments.runs,
                    tables,
                };
                Output::create_whole(
                    path,
                    (serde_json::to_string_pretty(&record)? + "\n").as_bytes(),
                )?
            }
            BenchFormat::Svg => Output::create_whole(path, svg::text(&plots(tables)?).as_bytes())?,
            BenchFormat::Png => export::png::write(path, &png::paint(&plots(tables)?))?,
        })
    });
    let complete = outputs.collect::<Result<Vec<_>>>()?;
    Ok(complete.into_iter().try_for_each(Output::publish)?)
}

/// The sheet of all plots.
fn plots(tables: &[Table]) -> Result<warpknit::chart::Drawing> {
    let MachineInfo { system, architecture, processor, cores, threads, .. } = MachineInfo::here();
    let processor = processor.as_deref().unwrap_or(architecture);
    let plural = if threads == 1 { "" } else { "s" };
    let heading = format!(
        "warpknit {} bench on {system}, {processor}, {threads} thread{plural} on {cores} cores; \
         dashed: published, other machine",
        env!("CARGO_PKG_VERSION")
    );
    sheet(&heading, &tables.iter().flat_map(|table| &table.plots).collect::<Vec<_>>())
}
