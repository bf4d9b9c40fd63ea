//! The files of a bench run: all figures as JSON or CSV, tables for pages and papers, plots.
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
use super::written;
use warpknit::pipeline::check_distinct;
use warpknit::system::{memory_gb, processor};

/// The JSON file: the run, the machine, the tables. Its field names are an interface for scripts.
#[derive(Serialize)]
struct RunRecord<'a> {
    warpknit: &'static str,
    /// The commit of the source, where it is known: see [`commit`].
    commit: Option<String>,
    machine: MachineInfo,
    /// Runs of each figure after the warm-up run. Pictures may have fewer; their tables' notes say
    /// so.
    runs: u32,
    /// What makes these figures doubtful, one line each.
    warnings: Vec<String>,
    #[serde(serialize_with = "by_key")]
    tables: &'a [Table],
}

/// The machine that the figures depend on.
#[derive(Serialize)]
pub(super) struct MachineInfo {
    system: &'static str,
    architecture: &'static str,
    /// Its name, where the system gives it.
    processor: Option<String>,
    memory_gb: Option<f64>,
    cores: usize,
    threads: usize,
}

/// The commit of the program's source: the one that its build was told by `WARPKNIT_COMMIT`, as
/// releases are, or else that of the checkout where it was built, as it is now, with `-dirty` where
/// files differ from it.
pub(super) fn commit() -> Option<String> {
    if let Some(commit) = option_env!("WARPKNIT_COMMIT") {
        return Some(commit.to_owned());
    }
    let git = std::process::Command::new("git")
        .args(["-C", env!("CARGO_MANIFEST_DIR"), "describe", "--always", "--dirty", "--abbrev=12"])
        .output();
    // Without git or a checkout nothing is known.
    let told = git.ok().filter(|output| output.status.success())?;
    let commit = String::from_utf8(told.stdout).ok()?.trim().to_owned();
    (!commit.is_empty()).then_some(commit)
}

impl MachineInfo {
    /// The machine in a line.
    pub(super) fn line(&self) -> String {
        let processor = self.processor.as_deref().unwrap_or(self.architecture);
        let plural = if self.threads == 1 { "" } else { "s" };
        let Self { system, threads, cores, .. } = self;
        format!("{system}, {processor}, {threads} thread{plural} on {cores} cores")
    }

    pub(super) fn here() -> Self {
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

/// The warning about a machine that did other work meanwhile, if runs tell of it.
pub(super) fn busy(tables: &[Table]) -> Option<String> {
    let counts = tables.iter().map(Table::outlying);
    let (odd, all) = counts.fold((0, 0), |sum, own| (sum.0 + own.0, sum.1 + own.1));
    (odd > 0).then(|| {
        format!(
            "{odd} of {all} rows have outlying runs: the machine is busy; compare cpu ms, or measure \
             again when it is idle, with more --runs"
        )
    })
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
                    commit: commit(),
                    machine: MachineInfo::here(),
                    runs: arguments.runs,
                    warnings: busy(tables).into_iter().collect(),
                    tables,
                };
                Output::create_whole(
                    path,
                    (serde_json::to_string_pretty(&record)? + "\n").as_bytes(),
                )?
            }
            BenchFormat::Csv => Output::create_whole(path, written::csv(tables).as_bytes())?,
            BenchFormat::Markdown => {
                Output::create_whole(path, written::markdown(tables).as_bytes())?
            }
            BenchFormat::Latex => Output::create_whole(path, written::latex(tables).as_bytes())?,
            BenchFormat::Svg => Output::create_whole(path, svg::text(&plots(tables)?).as_bytes())?,
            BenchFormat::Png => export::png::write(path, &png::paint(&plots(tables)?))?,
        })
    });
    let complete = outputs.collect::<Result<Vec<_>>>()?;
    Ok(complete.into_iter().try_for_each(Output::publish)?)
}

/// The sheet of all plots.
fn plots(tables: &[Table]) -> Result<warpknit::chart::Drawing> {
    let heading = format!(
        "warpknit {} bench on {}; dashed: published, other machine",
        env!("CARGO_PKG_VERSION"),
        MachineInfo::here().line()
    );
    sheet(&heading, &tables.iter().flat_map(|table| &table.plots).collect::<Vec<_>>())
}
