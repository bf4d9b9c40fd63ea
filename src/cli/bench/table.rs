//! Tables of figures: text with aligned columns for people, a record a row for scripts.

use serde::ser::{Serialize, Serializer};

use super::measure::Times;
use super::plot::Plot;

/// What is between two columns.
const GAP: &str = "  ";

/// One table of `warpknit bench`, and what is plotted of it.
#[derive(Debug)]
pub(super) struct Table {
    /// Its key in files.
    pub(super) key: &'static str,
    /// What is measured.
    pub(super) title: String,
    /// How, and what the published figures stand for; a line each.
    pub(super) notes: Vec<String>,
    columns: Vec<Column>,
    rows: Vec<Vec<TableCell>>,
    pub(super) plots: Vec<Plot>,
}

/// A column's name in files and its heading, which may have several lines.
pub(super) type Column = (&'static str, &'static str);

/// What [`times`] and [`beside`] fill.
pub(super) const TIMES: [Column; 4] =
    [("ms", "ms"), ("from", "from"), ("to", "to"), ("cpu_ms", "cpu ms")];
pub(super) const BESIDE: [Column; 2] =
    [("published", "published,\nother machine"), ("times", "times")];

/// One figure or word.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum TableCell {
    Text(String),
    Count(usize),
    /// A number, and with how many decimals it is printed; files have all of it.
    Number(f64, usize),
    /// There is no such figure.
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

    /// How many times as long one took as the other; whole where decimals say nothing.
    pub(super) fn times(ratio: Option<f64>) -> Self {
        Self::known(ratio, if ratio.is_some_and(|ratio| ratio < 9.95) { 1 } else { 0 })
    }

    fn printed(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Count(count) => count.to_string(),
            Self::Number(number, decimals) => format!("{number:.decimals$}"),
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
            Self::Missing => serializer.serialize_none(),
        }
    }
}

/// The median, the fastest and the slowest, and the median of the CPU time.
pub(super) fn times(times: &Times) -> [TableCell; 4] {
    let cpu = TableCell::known(times.cpu.map(|cpu| cpu.median), 2);
    [
        TableCell::ms(times.wall.median),
        TableCell::ms(times.wall.least),
        TableCell::ms(times.wall.most),
        cpu,
    ]
}

/// What was published, ms, and how many times as long that is.
pub(super) fn beside(published: Option<f64>, times: &Times) -> [TableCell; 2] {
    [
        TableCell::known(published, 2),
        TableCell::times(published.map(|published| published / times.wall.median)),
    ]
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

    /// Adds columns at the right, before any row is there.
    pub(super) fn add_columns(&mut self, columns: impl IntoIterator<Item = Column>) {
        self.columns.extend(columns);
    }

    /// Adds a row, which has a cell for each column.
    pub(super) fn push(&mut self, row: impl IntoIterator<Item = TableCell>) {
        let row: Vec<_> = row.into_iter().collect();
        debug_assert_eq!(row.len(), self.columns.len(), "a cell a column");
        self.rows.push(row);
    }

    /// Title, notes, and below them the rows.
    pub(super) fn text(&self) -> String {
        let notes: String = self.notes.iter().map(|note| format!("  {note}\n")).collect();
        format!("{}\n{notes}{}", self.title, self.body())
    }

    /// Headings and rows alone, as scripts split them.
    pub(super) fn body(&self) -> String {
        let headings: Vec<Vec<&str>> =
            self.columns.iter().map(|(_, heading)| heading.lines().collect()).collect();
        let height = headings.iter().map(Vec::len).max().unwrap_or(0);
        // Headings of fewer lines stand right above their figures.
        let line = |line: usize| -> Vec<String> {
            let of = |heading: &Vec<&str>| {
                (line + heading.len()).checked_sub(height).map_or("", |at| heading[at]).to_owned()
            };
            headings.iter().map(of).collect()
        };
        let mut lines: Vec<Vec<String>> = (0..height).map(line).collect();
        lines.extend(self.rows.iter().map(|row| row.iter().map(TableCell::printed).collect()));
        let width = |column: usize| {
            lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<_> = (0..self.columns.len()).map(width).collect();
        let aligned = |line: &Vec<String>| {
            let cells: Vec<_> =
                line.iter().zip(&widths).map(|(cell, &width)| format!("{cell:>width$}")).collect();
            cells.join(GAP).trim_end().to_owned() + "\n"
        };
        lines.iter().map(aligned).collect()
    }
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

/// A row with its columns' names, in their order.
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
