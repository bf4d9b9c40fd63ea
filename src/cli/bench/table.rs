//! Tables of figures: text with aligned columns for people, JSON with one record a row for scripts.
//!
//! In: rows of cells. Out: text, or a serialised table. JSON keeps numbers in full precision; text
//! rounds them. The keys of tables and columns are an interface for scripts.

use serde::ser::{Serialize, Serializer};

use super::measure::{Times, has_outliers};
use super::plot::Plot;

/// The text between two columns.
const GAP: &str = "  ";

/// One table of `warpknit bench`, with its plots.
#[derive(Debug)]
pub(super) struct Table {
    /// Its key in files.
    pub(super) key: &'static str,
    /// The subject of the measurement.
    pub(super) title: String,
    /// How it is measured, and where the published figures come from; one line each.
    pub(super) notes: Vec<String>,
    columns: Vec<Column>,
    rows: Vec<Vec<TableCell>>,
    pub(super) plots: Vec<Plot>,
}

/// A column's key in files, and its heading, which may have several lines. A column without a heading
/// is in files alone.
pub(super) type Column = (&'static str, &'static str);

/// The columns that [`times`] fills.
pub(super) const TIMES: [Column; 6] = [
    ("ms", "ms"),
    ("from", "from"),
    ("to", "to"),
    ("cpu_ms", "cpu ms"),
    ("samples_ms", ""),
    ("cpu_samples_ms", ""),
];
/// The columns that [`beside`] fills.
pub(super) const BESIDE: [Column; 2] =
    [("published", "published,\nother machine"), ("times", "times")];

/// One figure or word.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum TableCell {
    Text(String),
    Count(usize),
    /// A number, and the number of decimals in text.
    Number(f64, usize),
    /// The times of all runs, in turn, ms. Files have them.
    Samples(Vec<f64>),
    /// A figure that does not exist, or that the system does not give.
    Missing,
}

impl TableCell {
    pub(super) fn text(text: &str) -> Self {
        Self::Text(text.to_owned())
    }

    /// Milliseconds.
    pub(super) fn ms(ms: f64) -> Self {
        Self::Number(ms, 2)
    }

    /// A number that may not be known.
    pub(super) fn known(number: Option<f64>, decimals: usize) -> Self {
        number.map_or(Self::Missing, |number| Self::Number(number, decimals))
    }

    /// A ratio of two times, with one decimal where that says something.
    pub(super) fn times(ratio: Option<f64>) -> Self {
        Self::known(ratio, if ratio.is_some_and(|ratio| ratio < 9.95) { 1 } else { 0 })
    }

    /// The cell's text.
    pub(super) fn printed(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Count(count) => count.to_string(),
            Self::Number(number, decimals) => format!("{number:.decimals$}"),
            Self::Samples(times) => {
                times.iter().map(|ms| format!("{ms:.3}")).collect::<Vec<_>>().join(" ")
            }
            Self::Missing => "-".to_owned(),
        }
    }
}

impl Serialize for TableCell {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Text(text) => serializer.serialize_str(text),
            Self::Count(count) => serializer.serialize_u64(*count as u64),
            Self::Number(number, _) => serializer.serialize_f64(*number),
            Self::Samples(times) => serializer.collect_seq(times),
            Self::Missing => serializer.serialize_none(),
        }
    }
}

/// Median, fastest and slowest wall time, the median of the CPU time, and the times of all runs.
pub(super) fn times(times: &Times) -> [TableCell; 6] {
    let cpu = TableCell::known(times.cpu.map(|cpu| cpu.median), 2);
    let cpu_samples: Option<Vec<_>> = times.samples.iter().map(|sample| sample.cpu).collect();
    [
        TableCell::ms(times.wall.median),
        TableCell::ms(times.wall.least),
        TableCell::ms(times.wall.most),
        cpu,
        TableCell::Samples(times.samples.iter().map(|sample| sample.wall).collect()),
        cpu_samples.map_or(TableCell::Missing, TableCell::Samples),
    ]
}

/// The published time, ms, and its ratio to the time measured here: [`Times::for_ratio`], where the
/// processor does the work.
pub(super) fn beside(published: Option<f64>, ms: f64) -> [TableCell; 2] {
    [TableCell::known(published, 2), TableCell::times(published.map(|published| published / ms))]
}

impl Table {
    pub(super) fn new(
        key: &'static str,
        title: &str,
        notes: &[&str],
        columns: impl IntoIterator<Item = Column>,
    ) -> Self {
        let notes = notes.iter().map(|note| (*note).to_owned()).collect();
        Self {
            key,
            title: title.to_owned(),
            notes,
            columns: columns.into_iter().collect(),
            rows: Vec::new(),
            plots: Vec::new(),
        }
    }

    /// Adds columns at the right. Only allowed while there are no rows.
    pub(super) fn add_columns(&mut self, columns: impl IntoIterator<Item = Column>) {
        self.columns.extend(columns);
    }

    /// Adds a row with a cell for each column.
    pub(super) fn push(&mut self, row: impl IntoIterator<Item = TableCell>) {
        let row: Vec<_> = row.into_iter().collect();
        assert_eq!(row.len(), self.columns.len(), "a cell a column");
        self.rows.push(row);
    }

    /// Columns, and rows with a cell for each.
    pub(super) fn cells(&self) -> (&[Column], &[Vec<TableCell>]) {
        (&self.columns, &self.rows)
    }

    /// How many rows have a run that took far longer or shorter than the others, and how many have
    /// runs at all.
    pub(super) fn outlying(&self) -> (usize, usize) {
        let walls = self.rows.iter().filter_map(|row| {
            row.iter().find_map(|cell| match cell {
                TableCell::Samples(times) => Some(has_outliers(times)),
                _ => None,
            })
        });
        walls.fold((0, 0), |(odd, all), is_odd| (odd + usize::from(is_odd), all + 1))
    }

    /// Title, notes and rows.
    pub(super) fn text(&self) -> String {
        let notes: String = self.notes.iter().map(|note| format!("  {note}\n")).collect();
        format!("{}\n{notes}{}", self.title, self.body())
    }

    /// Headings and rows only.
    pub(super) fn body(&self) -> String {
        let shown: Vec<usize> =
            (0..self.columns.len()).filter(|&column| !self.columns[column].1.is_empty()).collect();
        let headings: Vec<Vec<&str>> =
            shown.iter().map(|&column| self.columns[column].1.lines().collect()).collect();
        let height = headings.iter().map(Vec::len).max().unwrap_or(0);
        let mut lines: Vec<Vec<String>> = Vec::new();
        for line in 0..height {
            // A heading of fewer lines is aligned at the bottom, right above its figures.
            let cell = |heading: &Vec<&str>| {
                (line + heading.len()).checked_sub(height).map_or("", |at| heading[at]).to_owned()
            };
            lines.push(headings.iter().map(cell).collect());
        }
        let printed =
            |row: &Vec<TableCell>| shown.iter().map(|&column| row[column].printed()).collect();
        lines.extend(self.rows.iter().map(printed));
        // Characters, not bytes: labels may hold letters outside ASCII.
        let widths: Vec<usize> = (0..shown.len())
            .map(|column| lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0))
            .collect();
        lines.iter().map(|line| aligned(line, &widths)).collect()
    }
}

/// A line of text: cells aligned at the right of columns of these widths.
fn aligned(line: &[String], widths: &[usize]) -> String {
    let cells: Vec<_> =
        line.iter().zip(widths).map(|(cell, &width)| format!("{cell:>width$}")).collect();
    cells.join(GAP).trim_end().to_owned() + "\n"
}

impl Serialize for Table {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeStruct as _;
        let records: Vec<_> =
            self.rows.iter().map(|row| RowRecord { columns: &self.columns, row }).collect();
        let mut table = serializer.serialize_struct("Table", 3)?;
        table.serialize_field("title", &self.title)?;
        table.serialize_field("notes", &self.notes)?;
        table.serialize_field("rows", &records)?;
        table.end()
    }
}

/// A row with its columns' keys, for serialisation in the columns' order.
struct RowRecord<'a> {
    columns: &'a [Column],
    row: &'a [TableCell],
}

impl Serialize for RowRecord<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.columns.iter().map(|(key, _)| key).zip(self.row))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up_and_records_keep_their_order() {
        let mut table = Table::new(
            "k",
            "Title",
            &["how"],
            [("name", "cloth"), ("ms", "two\nlines"), ("x", "x")],
        );
        table.push([TableCell::text("tricot"), TableCell::ms(1.234_567), TableCell::Missing]);
        assert_eq!(
            table.text(),
            "Title\n  how\n          two\n cloth  lines  x\ntricot   1.23  -\n"
        );
        let json = serde_json::to_string(&table).unwrap();
        assert_eq!(
            json,
            r#"{"title":"Title","notes":["how"],"rows":[{"name":"tricot","ms":1.234567,"x":null}]}"#
        );
    }

    #[test]
    fn ratios_have_a_decimal_where_it_says_something() {
        assert_eq!(
            [0.5, 9.94, 9.96, 123.4].map(|ratio| TableCell::times(Some(ratio)).printed()),
            ["0.5", "9.9", "10", "123"]
        );
    }
}
