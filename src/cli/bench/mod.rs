//! `warpknit bench`: run times on this machine, beside those that the papers published.
//!
//! In: the flags. Out: tables on standard output, and as JSON, SVG or PNG where asked for. Each
//! subject is a file and gives one or two tables: Table 2 of Liu, Kyosev and Jiang 2022
//! ([`plane_curved`], with [`brute`] as its baseline), its Table 3 ([`total`]), its Figures 14 and
//! 15 ([`st_sr`], [`textures`]), the table of the ribbon paper ([`weft`](mod@weft)), the ways to
//! the body ([`mapping`](mod@mapping)), what they do to the yarn
//! ([`yarn_length`](mod@yarn_length)), [`reading`](mod@reading), and [`growth`](mod@growth) with the
//! size. Times are medians of several runs after a warm-up run; `from` and `to` are the fastest and
//! the slowest run.

mod brute;
mod canvas;
mod files;
mod garments;
mod growth;
mod mapping;
mod measure;
mod panel;
mod picture;
mod plane_curved;
mod plot;
mod reading;
mod st_sr;
mod table;
mod textures;
mod total;
mod weft;
mod written;
mod yarn_length;

use anyhow::{Result, bail};
use clap::ValueEnum;

use super::args::{Bench, Subject};
use super::terminal::{Terminal, print, tell};
use garments::Garments;
use table::Table;
use warpknit::pipeline::{Listener as _, Task};

/// The default subjects: the source paper's tables and figures.
const PAPER: [Subject; 4] =
    [Subject::PlaneCurved, Subject::Total, Subject::StSr, Subject::Textures];
/// The subjects that the user's own garment can be measured in.
const ON_GARMENTS: [Subject; 5] =
    [Subject::PlaneCurved, Subject::Mapping, Subject::YarnLength, Subject::Total, Subject::Growth];

/// Measures the subjects, prints their tables and writes them to files.
pub(crate) fn bench(arguments: &Bench) -> Result<()> {
    let subjects = subjects(arguments);
    check(arguments, &subjects)?;
    files::check(arguments)?;
    let terminal = Terminal::begin_command(&arguments.running)?;
    let garments = Garments::from_arguments(arguments)?;
    let mut tables = Vec::new();
    for (at, subject) in subjects.iter().enumerate() {
        let mut progress =
            |done: f64| terminal.begin(Task::Measure, (at as f64 + done) / subjects.len() as f64);
        tables.extend(measure(*subject, arguments, &garments, &mut progress)?);
    }
    files::write(arguments, &tables)?;
    terminal.clear();
    if let Some(warning) = files::busy(&tables) {
        tell(arguments.running.quiet, &format!("warning: {warning}"));
    }
    // Scripts parse the one table that `--weft` has always printed, and expect no title above it.
    let bare = subjects == [Subject::Weft];
    let texts: Vec<_> =
        tables.iter().map(|table| if bare { table.body() } else { table.text() }).collect();
    print(&texts.join("\n"))
}

/// Refuses the baseline and a garment where no subject takes them.
fn check(arguments: &Bench, subjects: &[Subject]) -> Result<()> {
    if arguments.brute && !subjects.contains(&Subject::PlaneCurved) {
        bail!("--brute is part of plane-curved, which is not measured: add --only plane-curved");
    }
    if arguments.fabric.is_some() && subjects != [Subject::YarnLength] {
        bail!("--fabric is for yarn-length alone: add --only yarn-length, and no other subject");
    }
    if !arguments.meshes.is_empty() && !subjects.iter().any(|subject| ON_GARMENTS.contains(subject))
    {
        bail!(
            "a garment of your own is measured in plane-curved, mapping, yarn-length, total \
             and growth: name one of them with --only, or no garment"
        );
    }
    Ok(())
}

/// The subjects that the flags ask for, each once and in the papers' order.
fn subjects(arguments: &Bench) -> Vec<Subject> {
    let unasked: &[Subject] =
        if arguments.meshes.is_empty() { &PAPER } else { &[Subject::PlaneCurved, Subject::Total] };
    let asked = |subject: &Subject| {
        arguments.only.contains(subject) || (arguments.weft && *subject == Subject::Weft)
    };
    let chosen: Vec<_> = Subject::value_variants().iter().copied().filter(asked).collect();
    if chosen.is_empty() { unasked.to_vec() } else { chosen }
}

/// Measures one subject.
fn measure(
    subject: Subject,
    arguments: &Bench,
    garments: &Garments,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<Table>> {
    let table = match subject {
        Subject::PlaneCurved => plane_curved::plane_curved(arguments, garments, progress),
        Subject::Mapping => mapping::mapping(arguments, garments, progress),
        Subject::YarnLength => yarn_length::yarn_length(arguments, garments, progress),
        Subject::Total => total::total(arguments, garments, progress),
        Subject::StSr => st_sr::st_sr(arguments, progress),
        Subject::Textures => textures::textures(arguments, progress),
        Subject::Weft => weft::weft(arguments, progress),
        Subject::Reading => reading::reading(arguments, progress),
        Subject::Growth => return growth::growth(arguments, garments, progress),
    };
    Ok(vec![table?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::args::{Arguments, Command};
    use clap::Parser as _;

    fn chosen(flags: &[&str]) -> Vec<Subject> {
        let arguments =
            Arguments::try_parse_from([&["warpknit", "bench"], flags].concat()).unwrap();
        let Command::Bench(arguments) = arguments.command else { panic!("another command") };
        subjects(&arguments)
    }

    #[test]
    fn growth_and_weft_are_measured_only_where_they_are_asked_for() {
        assert_eq!(chosen(&[]), PAPER);
        assert_eq!(chosen(&["own.obj", "--unit", "cm"]), [Subject::PlaneCurved, Subject::Total]);
        assert_eq!(chosen(&["--weft", "--only", "weft"]), [Subject::Weft]);
        assert_eq!(
            chosen(&["--only", "growth", "--only", "total", "own.obj"]),
            [Subject::Total, Subject::Growth]
        );
    }
}
