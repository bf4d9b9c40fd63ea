//! What a person is told of a garment's cloth before it is knitted: how many stitches, how large, and
//! what that takes.
//!
//! In: a [`Job`] and its prepared parts. Out: a note for each job, or none where there is nothing to
//! know. Sizes are estimates ([`super::estimates`]).

use super::densities::{Gauge, PICTURED_STITCHES, stitches_on};
use super::drawn::Drawn;
use super::estimates::{file_bytes, float, size_text};
use super::job::Job;
use super::setup::Setup;
use crate::export::Format;

/// Files and pictures of which the size is told although someone chose the cloth, bytes.
const LARGE: f64 = 1e9;
/// What a `.glb` holds at most, bytes.
const MOST_OF_GLB: f64 = 4.29e9;

/// What to do where a picture does not fit the memory.
pub(super) fn remedy(job: &Job<'_>) -> &'static str {
    match job.gauge {
        Gauge::True => "--enlarge auto draws fewer and larger stitches",
        Gauge::Chosen | Gauge::Enlarged => "lower the densities, or write no .png",
    }
}

/// The note about a job's stitches and what they take. `is_one_of_two` says that the cloth is knitted
/// twice.
pub(super) fn sizes(
    job: &Job<'_>,
    is_one_of_two: bool,
    drawn: Option<&Drawn<'_>>,
    setup: &Setup,
) -> Option<String> {
    if job.is_swatch {
        return chosen(job, drawn, setup);
    }
    match (job.gauge, drawn) {
        (Gauge::True, Some(drawn)) => Some(true_gauge(job, drawn)),
        (Gauge::Enlarged, _) => Some(enlarged(job, is_one_of_two, setup)),
        (Gauge::True | Gauge::Chosen, _) => chosen(job, drawn, setup),
    }
}

/// A picture at true gauge that nobody asked for.
fn true_gauge(job: &Job<'_>, drawn: &Drawn<'_>) -> String {
    let (whole, shown) = (job.cloth.stitches(), drawn.cloth(job).stitches());
    let stitches =
        if drawn.is_part() { format!("{shown} of {whole}") } else { format!("all {whole}") };
    format!(
        "{} shows true gauge and takes about {} of memory for {stitches} stitches; --enlarge auto \
         draws about {PICTURED_STITCHES} that are large enough to see",
        names(job),
        size_text(drawn.bytes),
    )
}

/// Cloth that is enlarged because there are too many stitches.
fn enlarged(job: &Job<'_>, is_one_of_two: bool, setup: &Setup) -> String {
    let stitches = job.cloth.stitches();
    let all = stitches_on(job.fabric, job.area);
    let times = job.shown.enlargement / job.fabric.enlargement;
    let again = if is_one_of_two { "the cloth is knitted a second time for " } else { "" };
    let verb = if is_one_of_two { ": " } else { " holds " };
    let of = if is_one_of_two { "" } else { "the cloth as " };
    let files = files(job, setup);
    let now = listed(&files, |file| file.bytes);
    let true_gauge = listed(&files, |file| file.bytes * all / float(stitches).max(1.0));
    let full = match (now, true_gauge) {
        (Some(now), Some(then)) => {
            let parts = files.iter().any(|file| {
                file.format == Format::Glb
                    && file.bytes * all / float(stitches).max(1.0) > MOST_OF_GLB
            });
            let parts = if parts { ", in parts by --tile" } else { "" };
            format!(
                "; that takes about {now}. --enlarge 1 keeps true gauge and all {all:.0} stitches, and \
                 takes about {then}{parts}"
            )
        }
        _ => format!("; --enlarge 1 keeps true gauge and all {all:.0} stitches"),
    };
    format!(
        "{again}{}{verb}{of}{stitches} stitches, {times:.1} times enlarged, so that other programs can \
         open it{full}",
        names(job)
    )
}

/// Large files and pictures of cloth that someone chose.
fn chosen(job: &Job<'_>, drawn: Option<&Drawn<'_>>, setup: &Setup) -> Option<String> {
    let mut parts: Vec<String> = files(job, setup)
        .iter()
        .filter(|file| file.bytes > LARGE)
        .map(|file| format!("{} takes about {}", file.name, size_text(file.bytes)))
        .collect();
    if let Some(drawn) = drawn.filter(|drawn| drawn.bytes > LARGE) {
        parts.push(format!("the picture takes about {} of memory", size_text(drawn.bytes)));
    }
    (!parts.is_empty()).then(|| parts.join(", and "))
}

/// A file whose size is estimated.
struct File {
    name: String,
    format: Format,
    bytes: f64,
}

/// The files of a job whose sizes can be estimated.
fn files(job: &Job<'_>, setup: &Setup) -> Vec<File> {
    // Files of fibres have limits of their own.
    if setup.fibres.as_ref().is_some_and(|fibres| fibres.filed.is_some()) {
        return Vec::new();
    }
    let file = |(path, format): &(std::path::PathBuf, Format)| {
        let bytes = file_bytes(*format, job.filed(), job.shown, &setup.section)?;
        Some(File { name: path.display().to_string(), format: *format, bytes })
    };
    job.outputs.iter().filter_map(file).collect()
}

/// The sizes of files in a line: the size alone of a single one. `None` without files.
fn listed(files: &[File], size: impl Fn(&File) -> f64) -> Option<String> {
    match files {
        [] => None,
        [only] => Some(size_text(size(only))),
        all => {
            let all = all.iter().map(|file| format!("{} for {}", size_text(size(file)), file.name));
            Some(all.collect::<Vec<_>>().join(", "))
        }
    }
}

/// The names of a job's files in a line.
fn names(job: &Job<'_>) -> String {
    let names: Vec<_> = job.outputs.iter().map(|(path, _)| path.display().to_string()).collect();
    names.join(" ")
}
