//! Tables as CSV, Markdown and LaTeX, with the machine, the version and the commit.
//!
//! In: tables. Out: text. CSV (RFC 4180) has all rows of all tables with the columns of all of them,
//! numbers in full and the runs of each row separated by blanks; pandas reads it as it is. Markdown
//! has a pipe table each and the runs below. LaTeX has a `tabular` with booktabs' rules each, and the
//! runs as comments.

use std::fmt::Write as _;

use super::files::{MachineInfo, commit};
use super::table::{Table, TableCell};

/// What the figures depend on: version, commit, machine.
fn circumstances() -> [String; 3] {
    let version = env!("CARGO_PKG_VERSION").to_owned();
    [version, commit().unwrap_or_default(), MachineInfo::here().line()]
}

/// The same as a line.
fn made_by() -> String {
    let [version, commit, machine] = circumstances();
    let commit = if commit.is_empty() { commit } else { format!(" ({commit})") };
    format!("warpknit {version}{commit} on {machine}")
}

/// All tables as CSV, the name of the table in the first column.
pub(super) fn csv(tables: &[Table]) -> String {
    let mut keys: Vec<&str> = Vec::new();
    for (key, _) in tables.iter().flat_map(|table| table.cells().0) {
        if !keys.contains(key) {
            keys.push(key);
        }
    }
    let own = ["warpknit", "commit", "machine"];
    let circumstances = circumstances().map(|text| csv_field(&text));
    let head: Vec<_> = ["table"].into_iter().chain(keys.iter().copied()).chain(own).collect();
    let mut text = head.join(",") + "\n";
    for table in tables {
        let (columns, rows) = table.cells();
        for row in rows {
            let cell = |key: &&str| {
                let at = columns.iter().position(|(own, _)| own == key);
                at.map_or_else(String::new, |at| csv_cell(&row[at]))
            };
            let cells = std::iter::once(table.key.to_owned()).chain(keys.iter().map(cell));
            let cells: Vec<_> = cells.chain(circumstances.iter().cloned()).collect();
            text += &(cells.join(",") + "\n");
        }
    }
    text
}

/// A cell as CSV: numbers in full.
fn csv_cell(cell: &TableCell) -> String {
    match cell {
        TableCell::Text(text) => csv_field(text),
        TableCell::Count(count) => count.to_string(),
        TableCell::Number(number, _) => number.to_string(),
        TableCell::Samples(times) => {
            times.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ")
        }
        TableCell::Missing => String::new(),
    }
}

/// A text as a field of CSV.
fn csv_field(text: &str) -> String {
    if text.contains([',', '"', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// All tables as Markdown.
pub(super) fn markdown(tables: &[Table]) -> String {
    let mut text = String::new();
    for table in tables {
        let shown = ShownTable::of(table);
        text += &format!("## {}\n\n", table.title);
        table.notes.iter().for_each(|note| text += &format!("- {note}\n"));
        text += &format!("- {}\n\n", made_by());
        let line = |cells: &[String]| {
            let cells: Vec<_> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        text += &line(&shown.headings);
        text += &format!("|{}\n", " ---: |".repeat(shown.headings.len()));
        shown.rows.iter().for_each(|row| text += &line(row));
        if !shown.samples.is_empty() {
            text += "\nAll runs, wall time in ms:\n\n";
            shown.samples.iter().for_each(|runs| text += &format!("- {runs}\n"));
        }
        text.push('\n');
    }
    text
}

/// All tables as LaTeX, for a document that uses booktabs.
pub(super) fn latex(tables: &[Table]) -> String {
    let mut text = format!("% {}\n% \\usepackage{{booktabs}}\n", made_by());
    for table in tables {
        let shown = ShownTable::of(table);
        let line = |cells: &[String]| {
            let cells: Vec<_> = cells.iter().map(|cell| latex_text(cell)).collect();
            format!("{} \\\\\n", cells.join(" & "))
        };
        let _written = write!(
            text,
            "\n% {}\n\\begin{{tabular}}{{{}}}\n\\toprule\n",
            table.title,
            "r".repeat(shown.headings.len())
        );
        text += &line(&shown.headings);
        text += "\\midrule\n";
        shown.rows.iter().for_each(|row| text += &line(row));
        text += "\\bottomrule\n\\end{tabular}\n";
        table.notes.iter().for_each(|note| text += &format!("% {note}\n"));
        shown.samples.iter().for_each(|runs| text += &format!("% runs, ms: {runs}\n"));
    }
    text
}

/// A text for LaTeX, its special characters escaped.
fn latex_text(text: &str) -> String {
    let mut escaped = String::new();
    for letter in text.chars() {
        match letter {
            '\\' => escaped += "\\textbackslash{}",
            '~' => escaped += "\\textasciitilde{}",
            '^' => escaped += "\\textasciicircum{}",
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => escaped.extend(['\\', letter]),
            _ => escaped.push(letter),
        }
    }
    escaped
}

/// What a table shows: headings and rows as text, and the runs of each row behind its labels.
struct ShownTable {
    headings: Vec<String>,
    rows: Vec<Vec<String>>,
    samples: Vec<String>,
}

impl ShownTable {
    fn of(table: &Table) -> Self {
        let (columns, rows) = table.cells();
        let shown = || (0..columns.len()).filter(|&at| !columns[at].1.is_empty());
        let headings = shown().map(|at| columns[at].1.replace('\n', " ")).collect();
        let samples = rows.iter().filter_map(|row| {
            let runs = row.iter().find(|cell| matches!(cell, TableCell::Samples(_)))?;
            let labels = row.iter().filter(|cell| matches!(cell, TableCell::Text(_)));
            let labels: Vec<_> = labels.map(TableCell::printed).collect();
            Some(format!("{}: {}", labels.join(" "), runs.printed()))
        });
        Self {
            headings,
            samples: samples.collect(),
            rows: rows.iter().map(|row| shown().map(|at| row[at].printed()).collect()).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tables() -> [Table; 2] {
        let mut one =
            Table::new("one", "One", &["how"], [("name", "of\ncloth"), ("ms", "ms"), ("s", "")]);
        one.push([
            TableCell::text("a, \"b\"_|"),
            TableCell::ms(1.234_567),
            TableCell::Samples(vec![1.0, 2.5]),
        ]);
        let mut two = Table::new("two", "Two", &[], [("ms", "ms")]);
        two.push([TableCell::Missing]);
        [one, two]
    }

    #[test]
    fn csv_has_every_column_of_every_table() {
        let text = csv(&tables());
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines[0], "table,name,ms,s,warpknit,commit,machine");
        assert!(lines[1].starts_with("one,\"a, \"\"b\"\"_|\",1.234567,1 2.5,"), "{text}");
        assert!(lines[2].starts_with("two,,,,") && lines.len() == 3, "{text}");
    }

    #[test]
    fn pages_and_papers_round_escape_and_list_the_runs() {
        let page = markdown(&tables());
        assert!(
            page.contains("| of cloth | ms |\n| ---: | ---: |\n| a, \"b\"_\\| | 1.23 |\n"),
            "{page}"
        );
        assert!(page.contains("\n- a, \"b\"_|: 1.000 2.500\n"), "{page}");
        let paper = latex(&tables());
        assert!(paper.contains("\\begin{tabular}{rr}\n\\toprule\nof cloth & ms \\\\\n"), "{paper}");
        assert!(paper.contains("a, \"b\"\\_| & 1.23 \\\\\n"), "{paper}");
    }
}
