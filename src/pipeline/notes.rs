//! What a person is told of a garment's cloth before it is knitted: how many stitches, how large, and
//! what that takes.
//!
//! In: a [`Job`] and its prepared parts. Out: a note for each job, or none where there is nothing to
//! know. Sizes are estimates ([`super::estimates`]).

use super::densities::{Gauge, PICTURED_STITCHES, stitches_on};
use super::drawn::Drawn;
use super::estimates::{file_bytes, float, size_text};
use super::fibres::Fibres;
use super::job::Job;
use super::settings::Wanted;
use super::setup::Setup;
use crate::export::{Format, html};
use crate::render::scene::Shape;

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
    let stitches = if drawn.is_part() {
        let shown = float(drawn.cloth(job).stitches());
        format!("{} of {}", count_text(shown), count_text(stitches_on(job.fabric, job.area)))
    } else {
        count_text(stitches_on(job.fabric, job.area))
    };
    let (_, shows) = subject(job, ["shows", "show"]);
    let hems = if job.threads.is_empty() { "" } else { " with its hems and seams" };
    format!(
        "{shows} true gauge: about {stitches} stitches{hems} and {} of memory; --enlarge auto draws \
         about {} larger ones",
        size_text(drawn.bytes),
        count_text(PICTURED_STITCHES)
    )
}

/// Cloth that is enlarged because there are too many stitches.
fn enlarged(job: &Job<'_>, is_one_of_two: bool, setup: &Setup) -> String {
    let (planned, all) = (float(job.cloth.stitches()).max(1.0), stitches_on(job.fabric, job.area));
    let times = job.shown.enlargement / job.fabric.enlargement;
    let (is_single, have) = subject(job, ["has", "have"]);
    let files = files(job, setup);
    let full = |file: &EstimatedFile| file.bytes * all / planned;
    let (opens, sizes) = match (listed(&files, |file| file.bytes), listed(&files, full)) {
        (Some(now), Some(then)) => {
            let it = if is_single { "it" } else { "them" };
            let too_large =
                files.iter().any(|file| file.format == Format::Glb && full(file) > MOST_OF_GLB);
            let parts = if too_large { ", in parts by --tile" } else { "" };
            let opens = format!(", so that other programs can open {it}");
            (opens, format!(": about {now}, where true gauge would take {then}{parts}"))
        }
        _ => (String::new(), String::new()),
    };
    let is_page = job.outputs.iter().any(|(_, format)| *format == Format::Html);
    let truest = if is_page && all > float(html::MOST_STITCHES) {
        format!("--enlarge {:.1} has all that a page holds", enlarged_for_page(all))
    } else {
        "--enlarge 1 keeps true gauge".to_owned()
    };
    let again = if is_one_of_two { ". For this the cloth is knitted a second time" } else { "" };
    format!(
        "{have} about {} stitches in place of {}, {times:.1} times enlarged{opens}{sizes}; \
         {truest}{again}",
        count_text(stitches_on(job.shown, job.area)),
        count_text(all),
    )
}

/// How many times a cloth must be enlarged, to a tenth, so that a page holds it. Yarns that panels cut
/// are some percent of stitches more than the cloth's area has.
fn enlarged_for_page(stitches: f64) -> f64 {
    (10.0 * (1.05 * stitches / float(html::MOST_STITCHES)).sqrt()).ceil() / 10.0
}

/// Files that hold tubes although ribbons were chosen, which are for pictures alone.
pub(super) fn ribbons(job: &Job<'_>, outputs: &[Wanted]) -> Option<String> {
    if job.settings.picture.shape != Shape::Ribbon {
        return None;
    }
    let tubes = outputs.iter().filter(|(_, format)| format.holds_tubes());
    let names: Vec<_> = tubes.map(|(path, _)| path.display().to_string()).collect();
    let hold = if names.len() == 1 { "holds" } else { "hold" };
    let text = format!("{} {hold} tubes: --shape ribbon is for pictures", names.join(" and "));
    (!names.is_empty()).then_some(text)
}

/// A body where there is no picture to show it.
pub(super) fn unseen_body(job: &Job<'_>, outputs: &[Wanted]) -> Option<String> {
    let has_picture = outputs.iter().any(|(_, format)| *format == Format::Png);
    (job.settings.picture.has_body() && !has_picture)
        .then(|| "no .png is written: a body is for pictures".to_owned())
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
struct EstimatedFile {
    name: String,
    format: Format,
    bytes: f64,
}

/// The files of a job whose sizes can be estimated.
fn files(job: &Job<'_>, setup: &Setup) -> Vec<EstimatedFile> {
    // Files of fibres have limits of their own.
    if setup.fibres.as_ref().and_then(Fibres::in_files).is_some() {
        return Vec::new();
    }
    let file = |(path, format): &(std::path::PathBuf, Format)| {
        let bytes = file_bytes(*format, job.filed(), job.shown, &setup.section, job.settings)?;
        Some(EstimatedFile { name: path.display().to_string(), format: *format, bytes })
    };
    job.outputs.iter().filter_map(file).collect()
}

/// The sizes of files in a line: the size alone of a single one. `None` without files.
fn listed(files: &[EstimatedFile], size: impl Fn(&EstimatedFile) -> f64) -> Option<String> {
    match files {
        [] => None,
        [only] => Some(size_text(size(only))),
        all => {
            let all = all.iter().map(|file| format!("{} for {}", size_text(size(file)), file.name));
            Some(all.collect::<Vec<_>>().join(", "))
        }
    }
}

/// The names of a job's files with a verb that goes with one or with several, and whether it is one. A
/// report is not named: Python asks for one in a folder of its own.
fn subject(job: &Job<'_>, [one, several]: [&str; 2]) -> (bool, String) {
    let name = |(path, _): &Wanted| path.display().to_string();
    match &job.outputs[..] {
        [(_, Format::Json)] => (true, format!("the report {one}")),
        [only] => (true, format!("{} {one}", name(only))),
        [file, (_, Format::Json)] | [(_, Format::Json), file] => {
            (false, format!("{} and the report {several}", name(file)))
        }
        [first, second] => (false, format!("{} and {} {several}", name(first), name(second))),
        _ => (false, format!("the files {several}")),
    }
}

/// A count with two digits that matter: `12000`, `950000`, `5.2 million`.
fn count_text(count: f64) -> String {
    if count >= 1e6 {
        let decimals = usize::from(count < 9.95e6);
        return format!("{:.decimals$} million", count / 1e6);
    }
    let step = 10_f64.powf((count.max(1.0).log10().floor() - 1.0).max(0.0));
    format!("{:.0}", (count / step).round() * step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_read_at_a_glance() {
        for (count, text) in [
            (7.0, "7"),
            (12_004.0, "12000"),
            (953_900.0, "950000"),
            (5_172_743.0, "5.2 million"),
            (25_172_743.0, "25 million"),
        ] {
            assert_eq!(count_text(count), text);
        }
    }

    #[test]
    fn a_cloth_enlarged_for_a_page_fits_it() {
        for stitches in [510_000.0, 5_127_350.0, 1e9] {
            let drawn = stitches / enlarged_for_page(stitches).powi(2);
            assert!((0.7..0.96).contains(&(drawn / float(html::MOST_STITCHES))), "{stitches}");
        }
    }
}
