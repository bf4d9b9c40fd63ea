//! `warpknit inspect --fabric`: the sheet with which a designer checks a fabric. It has the chains as
//! a table and as a lapping diagram, or the chart of a weft knit.

use std::fmt::{self, Write as _};
use std::path::{Path, PathBuf};

use anyhow::Result;
use warpknit::chart::{ChartFormat, Drawing, png, svg};
use warpknit::export::{self, ExportError, Output};
use warpknit::fabric::lapping::Chain;
use warpknit::fabric::motif::Motif;
use warpknit::fabric::{Bar, Fabric, Lay, Structure};
use warpknit::knit::{Pattern, clearance, links, run_in};

use super::numbers::machine_text;
use warpknit::pipeline::check_distinct;

/// The most courses in the table. Longer chains are cut, with a line that says so.
const MOST_ROWS: usize = 200;

/// The text of the sheet: name, densities, chains, yarns, and the clearance of one knitted repeat.
pub(super) fn sheet(fabric: &Fabric) -> Result<String, fmt::Error> {
    let mut text = String::new();
    writeln!(
        text,
        "{}{}{}",
        fabric.name,
        if fabric.about.is_empty() { "" } else { ": " },
        fabric.about
    )?;
    writeln!(
        text,
        "  {} wales/cm, {} courses/cm; W {:.3} mm, C {:.3} mm",
        fabric.wales_per_cm,
        fabric.courses_per_cm,
        fabric.wale_spacing(),
        fabric.course_spacing()
    )?;
    if let Some(machine) = fabric.machine() {
        writeln!(text, "  machine: {}", machine_text(&machine))?;
    }
    if let Some(thickness) = fabric.finish.thickness {
        writeln!(text, "  pressed to {thickness} mm")?;
    }
    match &fabric.structure {
        Structure::Warp(knit) => text.push_str(&table(fabric, &knit.bars)),
        Structure::Weft(knit) => text.push_str(&chart(&knit.motif)),
        Structure::Laid(_) => {}
    }
    for (at, yarn) in fabric.yarns().enumerate() {
        writeln!(
            text,
            "  {}, yarn {}{}, diameter {:.3} mm",
            system(fabric, at),
            yarn.count,
            yarn.draft.map_or_else(String::new, |draft| format!(", draft {draft}")),
            yarn.diameter()
        )?;
    }
    if fabric.warp_knit().is_some() {
        let needles = fabric.needles();
        let most = if needles.most == needles.fewest {
            String::new()
        } else {
            format!(" to {}", needles.most)
        };
        writeln!(text, "  threads on a needle: {}{most}", needles.fewest)?;
    }
    let (pattern, radius) = (Pattern::new(fabric), fabric.radius());
    let clearance = clearance::measure(fabric, &pattern, radius);
    writeln!(text, "  nearest yarns: {:.2} of touching", clearance.min_over_2r)?;
    let links = links::measure(fabric, &pattern);
    let fault = run_in::check(fabric, &pattern).err().map(|fault| fault.to_string());
    for warning in fabric
        .warnings()
        .into_iter()
        .chain(fault)
        .chain(links.warning())
        .chain(clearance::warnings(fabric, &pattern, &clearance, radius))
    {
        writeln!(text, "  warning: {warning}")?;
    }
    Ok(text)
}

/// A yarn system with its number and its lapping.
fn system(fabric: &Fabric, at: usize) -> String {
    let (number, lapping) = (at + 1, fabric.lapping(at));
    match &fabric.structure {
        Structure::Warp(knit) => {
            let bar = &knit.bars[at];
            let drive = if bar.counts_from_left() { ", drive left" } else { "" };
            let threading = bar.written_threading();
            let run_in =
                bar.run_in.map_or_else(String::new, |mm| format!(", run-in {mm} mm a rack"));
            let slack = bar
                .slack
                .map_or_else(String::new, |slack| format!(", slack {:.1} %", 100.0 * slack));
            format!("bar {number}: chain {lapping}{drive}, threading {threading}{run_in}{slack}")
        }
        Structure::Weft(_) => format!("feeder {number}: {lapping}"),
        Structure::Laid(_) => format!("strand {number}: {lapping}"),
    }
}

/// The chart: one row for each course, the last course on top, and a legend of the letters.
fn chart(motif: &Motif) -> String {
    let rows = motif.rows().iter().zip((1..=motif.courses()).rev());
    let mut text: String = rows.map(|(row, course)| format!("  {course:6}  {row}\n")).collect();
    for (letter, symbol) in motif.legend() {
        text += &format!("          {letter} {symbol}\n");
    }
    text
}

/// The chains: one row for each course, the first course on top, and four columns for each bar.
fn table(fabric: &Fabric, bars: &[Bar]) -> String {
    let shown = fabric.repeat().min(MOST_ROWS);
    let columns = ["lap", "kind", "underlap", "needles"];
    // The cells of each bar, with the column names as its first row.
    let mut groups: Vec<Vec<[String; 4]>> = Vec::new();
    for bar in bars {
        let header = columns.map(str::to_owned);
        groups.push(
            std::iter::once(header)
                .chain((0_i64..).take(shown).map(|course| cells(bar, course)))
                .collect(),
        );
    }
    let mut lines = vec!["        ".to_owned(), "  course".to_owned()];
    lines.extend((1..=shown).map(|course| format!("  {course:6}")));
    for (group, number) in groups.iter().zip(1..) {
        let width =
            |column: usize| group.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths = [0, 1, 2, 3].map(width);
        let title = format!("bar {number}");
        // Three gaps of two spaces lie between the four columns.
        let all: usize = widths.iter().sum::<usize>() + 6;
        lines[0] += &format!("  | {title:all$}");
        for (line, row) in lines[1..].iter_mut().zip(group) {
            *line += "  |";
            for (column, (cell, width)) in row.iter().zip(widths).enumerate() {
                *line += &format!("{}{cell:width$}", if column == 0 { " " } else { "  " });
            }
        }
    }
    if shown < fabric.repeat() {
        lines.push(format!("  ... and {} more courses", fabric.repeat() - shown));
    }
    lines.iter().map(|line| format!("{}\n", line.trim_end())).collect()
}

/// A lap as written, its kind, the underlap that follows (arrows as in the diagram), and the
/// needles on which guide 1 loops, in the order of the swing; needle 1 lies between gaps 0 and 1.
fn cells(bar: &Bar, course: i64) -> [String; 4] {
    match &bar.lay {
        Lay::Lapping(chain) => lap_cells(chain, course),
        Lay::Weft => {
            let weft = if bar.threading.carries(course) { "weft" } else { "none" };
            ["-", weft, "-", "-"].map(str::to_owned)
        }
    }
}

/// The four cells of a guide bar that laps.
fn lap_cells(chain: &Chain, course: i64) -> [String; 4] {
    let (chain, left) = (chain.as_written(), chain.counts_from_left());
    let (lap, underlap) = (chain.lap(course), chain.underlap(course));
    let two = (lap.to - lap.from).abs() > 1;
    let kind = match (lap.overlap(), chain.is_closed(course)) {
        (0, _) if chain.is_inlay() || underlap != 0 => "inlay",
        (0, _) => "miss",
        (_, true) if two => "two-needle closed",
        (_, false) if two => "two-needle open",
        (_, true) => "closed",
        (_, false) => "open",
    };
    let arrow = match underlap.unsigned_abs() {
        0 => "0".to_owned(),
        // Higher gaps of a right-hand drive lie to the left, seen from the technical back.
        needles if (underlap > 0) != left => format!("\u{2190} {needles}"),
        needles => format!("{needles} \u{2192}"),
    };
    let needle = lap.needle() + 1;
    let needles = match lap.to - lap.from {
        0 => "-".to_owned(),
        2 => format!("{needle} {}", needle + 1),
        -2 => format!("{} {needle}", needle + 1),
        _ => needle.to_string(),
    };
    [format!("{}-{}", lap.from, lap.to), kind.to_owned(), arrow, needles]
}

/// Draws the lapping diagram into complete files, still under their temporary names. Also returns
/// notes about parts that the diagram leaves out.
pub(super) fn diagrams(
    fabric: &Fabric,
    outputs: &[(PathBuf, ChartFormat)],
) -> Result<(Vec<Output>, Vec<String>)> {
    check_distinct([], outputs.iter().map(|(path, _)| path.as_path()))?;
    if outputs.is_empty() {
        return Ok((Vec::new(), Vec::new()));
    }
    let drawing = Drawing::from_fabric(fabric);
    let whole = outputs
        .iter()
        .map(|(path, format)| drawn(&drawing, path, *format))
        .collect::<Result<_, _>>()?;
    Ok((whole, drawing.notes))
}

/// Writes a drawing into a complete file, still under its temporary name.
pub(super) fn drawn(
    drawing: &Drawing,
    path: &Path,
    format: ChartFormat,
) -> Result<Output, ExportError> {
    match format {
        ChartFormat::Png => export::png::write(path, &png::paint(drawing)),
        ChartFormat::Svg => Output::create_whole(path, svg::text(drawing).as_bytes()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table_of(text: &str) -> String {
        let fabric = Fabric::parse(text).unwrap();
        table(&fabric, &fabric.warp_knit().unwrap().bars)
    }

    #[test]
    fn the_table_names_every_lap() {
        let text = Fabric::named("tricot").unwrap().to_string();
        let text = text.replacen("\"1-2/1-0//\"", "\"0-2/2-2/2-2/3-2/0-0/0-1/1-2//\"", 1);
        let table = table_of(&text);
        let column = |row: &str| {
            row.split('|')
                .nth(1)
                .unwrap()
                .split("  ")
                .map(str::trim)
                .filter(|c| !c.is_empty())
                .collect::<Vec<_>>()
                .join(",")
        };
        let rows: Vec<_> = table.lines().map(column).collect();
        assert_eq!(rows.len(), 2 + 14);
        assert_eq!(
            rows[1..9],
            [
                "lap,kind,underlap,needles",
                "0-2,two-needle open,0,1 2",
                "2-2,miss,0,-",
                "2-2,inlay,\u{2190} 1,-",
                "3-2,open,2 \u{2192},3",
                "0-0,miss,0,-",
                "0-1,open,0,1",
                "1-2,closed,2 \u{2192},2"
            ]
        );
    }

    #[test]
    fn a_long_chain_is_cut_with_a_word() {
        let chain = "1-0/1-2/".repeat(300);
        let text = Fabric::named("tricot").unwrap().to_string().replacen(
            "\"1-2/1-0//\"",
            &format!("\"{chain}\""),
            1,
        );
        let table = table_of(&text);
        assert_eq!(table.lines().count(), 2 + MOST_ROWS + 1);
        assert_eq!(table.lines().last(), Some("  ... and 400 more courses"));
    }
}
