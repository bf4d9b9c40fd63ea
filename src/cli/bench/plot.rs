//! Plots of the tables, on one sheet.
//!
//! In: series of points. Out: a [`Drawing`], which the library writes as `.svg` or `.png` without
//! any font of the system. plotters lays out the axes; an axis is logarithmic where the figures
//! span more than a decade. Solid lines are measured here, dashed lines are published figures.

use std::ops::Range;

use anyhow::{Result, anyhow};
use glam::DVec2;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{AsRangedCoord, Ranged, ValueFormatter};
use plotters::prelude::*;
use warpknit::chart::Drawing;

use super::canvas::{NORMAL, PlotCanvas, SMALL, TITLE};

/// Size of a plot on the sheet, px.
const CELL: (u32, u32) = (600, 400);
/// Width of the legend at the right of a plot, px.
const LEGEND: u32 = 190;
/// Height of the heading above all plots, px.
const HEADING: u32 = 40;
/// Plots side by side.
const ACROSS: usize = 2;
/// Ratio of the largest to the smallest figure from which on an axis is logarithmic.
const DECADE: f64 = 10.0;
/// Ratio up to which a logarithmic axis has marks at 2 and 5 as well, since powers of ten alone
/// would be too few.
const FEW: f64 = 2000.0;
/// Lengths of a dash and of the gap after it, px.
const DASH: (u32, u32) = (7, 5);
const LINE_WIDTH: u32 = 2;
const DOT_RADIUS: u32 = 4;
const INK: RGBColor = RGBColor(0x22, 0x26, 0x2b);
const FAINT: RGBColor = RGBColor(0x6b, 0x72, 0x7a);
const HAIR: RGBColor = RGBColor(0xe3, 0xe6, 0xea);
/// The palette of Okabe and Ito 2008, "Color universal design", which colour-blind people can
/// distinguish, without its yellow, which is hardly visible on white.
const COLORS: [RGBColor; 6] = [
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0x56, 0xb4, 0xe9),
    RGBColor(0xe6, 0x9f, 0x00),
];

/// One line of a plot.
#[derive(Clone, Debug)]
pub(super) struct Series {
    name: String,
    /// Whether it was measured in this run, not published.
    ours: bool,
    points: Vec<(f64, f64)>,
}

impl Series {
    /// A series that is measured here.
    pub(super) fn ours(name: &str) -> Self {
        Self { name: name.to_owned(), ours: true, points: Vec::new() }
    }

    /// A series of published figures.
    pub(super) fn published(name: &str) -> Self {
        Self { ours: false, ..Self::ours(name) }
    }
}

/// A plot: series over a common x.
#[derive(Clone, Debug)]
pub(super) struct Plot {
    title: String,
    x: &'static str,
    y: &'static str,
    series: Vec<Series>,
}

type Area<'a> = DrawingArea<PlotCanvas<'a>, Shift>;

impl Plot {
    /// `x` and `y` are the axes' labels, with their units.
    pub(super) fn new(
        title: &str,
        x: &'static str,
        y: &'static str,
        series: impl IntoIterator<Item = Series>,
    ) -> Self {
        Self { title: title.to_owned(), x, y, series: series.into_iter().collect() }
    }

    /// Adds a point to each series.
    pub(super) fn push(&mut self, x: f64, values: impl IntoIterator<Item = f64>) {
        self.push_known(x, values.into_iter().map(Some));
    }

    /// Adds a point to each series whose value is known. A time too short to measure is left out,
    /// since a logarithmic axis has no zero.
    pub(super) fn push_known(&mut self, x: f64, values: impl IntoIterator<Item = Option<f64>>) {
        for (series, y) in self.series.iter_mut().zip(values) {
            series.points.extend(y.filter(|y| *y > 0.0).map(|y| (x, y)));
        }
    }

    /// Draws the plot into an area of the sheet.
    fn draw(&self, area: &Area<'_>) -> Result<()> {
        let (left, legend) = area.split_horizontally(CELL.0 - LEGEND);
        area.draw_text(&self.title, &text(TITLE, INK), (18, 16)).map_err(drawn)?;
        area.draw_text(self.y, &text(SMALL, FAINT), (18, 48)).map_err(drawn)?;
        self.draw_legend(&legend)?;
        let (Some(xs), Some(ys)) = (self.span(|point| point.0), self.span(|point| point.1)) else {
            return Ok(());
        };
        // The axes are types in plotters, so each combination is a call of its own.
        match (is_wide(&xs), is_wide(&ys)) {
            (true, true) => self.draw_lines(&left, logarithmic(&xs), logarithmic(&ys)),
            (true, false) => self.draw_lines(&left, logarithmic(&xs), from_zero(&ys)),
            (false, true) => self.draw_lines(&left, from_zero(&xs), logarithmic(&ys)),
            (false, false) => self.draw_lines(&left, from_zero(&xs), from_zero(&ys)),
        }
    }

    /// The range of a coordinate over all points, if there are any.
    fn span(&self, of: impl Fn(&(f64, f64)) -> f64) -> Option<Range<f64>> {
        let all = || self.series.iter().flat_map(|series| &series.points).map(&of);
        let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
        (low <= high).then_some(low..high)
    }

    /// Draws axes, grid and series.
    fn draw_lines<X, Y>(&self, area: &Area<'_>, x: X, y: Y) -> Result<()>
    where
        X: AsRangedCoord<Value = f64>,
        Y: AsRangedCoord<Value = f64>,
        X::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
        Y::CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>,
    {
        let mut builder = ChartBuilder::on(area);
        builder.margin_top(66).margin_left(10).margin_right(20).margin_bottom(8);
        let mut chart = builder
            .x_label_area_size(42)
            .y_label_area_size(58)
            .build_cartesian_2d(x, y)
            .map_err(drawn)?;
        let mut mesh = chart.configure_mesh();
        mesh.x_labels(7).y_labels(7).max_light_lines(0).bold_line_style(HAIR).axis_style(FAINT);
        mesh.label_style(text(SMALL, INK)).axis_desc_style(text(SMALL, FAINT)).x_desc(self.x);
        mesh.x_label_formatter(&|x| short(*x)).y_label_formatter(&|y| short(*y));
        mesh.draw().map_err(drawn)?;
        // Each series is a line with a dot at each figure, so that single figures show too.
        for (series, color) in self.colored() {
            let line = color.stroke_width(LINE_WIDTH);
            let points = series.points.iter().copied();
            if series.ours {
                chart.draw_series(LineSeries::new(points.clone(), line)).map_err(drawn)?;
            } else {
                chart
                    .draw_series(DashedLineSeries::new(points.clone(), DASH.0, DASH.1, line))
                    .map_err(drawn)?;
            }
            chart
                .draw_series(points.map(|point| Circle::new(point, DOT_RADIUS, color.filled())))
                .map_err(drawn)?;
        }
        Ok(())
    }

    /// Draws the names of the series with samples of their lines.
    fn draw_legend(&self, area: &Area<'_>) -> Result<()> {
        for ((series, color), y) in self.colored().zip((84..).step_by(22)) {
            let piece =
                |from, to| PathElement::new([(from, y), (to, y)], color.stroke_width(LINE_WIDTH));
            let pieces =
                if series.ours { vec![piece(0, 30)] } else { vec![piece(0, 5), piece(25, 30)] };
            pieces.iter().try_for_each(|piece| area.draw(piece)).map_err(drawn)?;
            area.draw(&Circle::new((15, y), DOT_RADIUS, color.filled())).map_err(drawn)?;
            area.draw_text(&series.name, &text(SMALL, INK), (38, y - 3)).map_err(drawn)?;
        }
        Ok(())
    }

    /// The series that have points, each with its colour. Published series come after all measured
    /// ones, in the same order, and get the same colours.
    fn colored(&self) -> impl Iterator<Item = (&Series, RGBColor)> {
        // Colours repeat after the measured series, so the n-th published one matches the n-th
        // measured one.
        let ours = self.series.iter().filter(|series| series.ours).count().max(1);
        let color = move |(at, series): (usize, _)| (series, COLORS[at % ours % COLORS.len()]);
        self.series.iter().enumerate().map(color).filter(|(series, _)| !series.points.is_empty())
    }
}

/// All plots on one sheet, in rows, below a heading.
pub(super) fn sheet(heading: &str, plots: &[&Plot]) -> Result<Drawing> {
    let rows = plots.len().div_ceil(ACROSS).max(1);
    let across = plots.len().clamp(1, ACROSS);
    let pixels =
        |count: usize, each: u32| f64::from(each) * f64::from(warpknit::ids::index32(count));
    let size = DVec2::new(pixels(across, CELL.0), pixels(rows, CELL.1) + f64::from(HEADING));
    let mut drawing = Drawing { size, layers: Vec::new(), notes: Vec::new() };
    {
        let root = PlotCanvas::on(&mut drawing).into_drawing_area();
        root.draw_text(heading, &text(NORMAL, FAINT), (18, 12)).map_err(drawn)?;
        let (_, below) = root.split_vertically(HEADING);
        for (plot, area) in plots.iter().zip(below.split_evenly((rows, across))) {
            plot.draw(&area)?;
        }
        root.present().map_err(drawn)?;
    }
    Ok(drawing)
}

/// A style of text.
fn text(size: i32, color: RGBColor) -> TextStyle<'static> {
    ("monospace", size).into_font().color(&color)
}

/// Turns an error of plotters into ours. The backend can't fail, so the only cause is a plot
/// without room for its axes.
fn drawn<E: std::error::Error + Send + Sync>(error: DrawingAreaErrorKind<E>) -> anyhow::Error {
    anyhow!("can't draw the plots: {error}")
}

/// Whether figures span more than a decade.
fn is_wide(span: &Range<f64>) -> bool {
    span.end > DECADE * span.start
}

/// A logarithmic axis with a margin at both ends. Its marks are powers of ten, and 2 and 5 times
/// those where they would be few.
fn logarithmic(
    span: &Range<f64>,
) -> impl AsRangedCoord<Value = f64, CoordDescType: Ranged<ValueType = f64> + ValueFormatter<f64>> {
    // Half as much again at both ends keeps the points off the frame.
    let room = span.start / 1.5..span.end * 1.5;
    let between: &[f64] = if room.end / room.start < FEW { &[1.0, 2.0, 5.0] } else { &[1.0] };
    #[expect(
        clippy::cast_possible_truncation,
        reason = "an exponent of ten of a 64-bit float has three digits"
    )]
    let exponents = room.start.log10().floor() as i32..=room.end.log10().ceil() as i32;
    let marks = exponents
        .flat_map(|exponent| between.iter().map(move |step| step * 10.0_f64.powi(exponent)));
    let marks = marks.filter(|mark| room.contains(mark)).collect();
    room.log_scale().with_key_points(marks)
}

/// A linear axis from 0 with a margin at the upper end.
fn from_zero(span: &Range<f64>) -> Range<f64> {
    0.0..span.end * 1.1
}

/// A number on an axis: 0.05, 20, 3k, 4.4M.
fn short(number: f64) -> String {
    let (number, unit) = match number.abs() {
        size if size >= 999_999.5 => (number / 1e6, "M"),
        size if size >= 999.95 => (number / 1e3, "k"),
        _ => (number, ""),
    };
    let text = if number.abs() < 1.0 { format!("{number:.3}") } else { format!("{number:.1}") };
    format!("{}{unit}", text.trim_end_matches('0').trim_end_matches('.'))
}

#[cfg(test)]
mod tests {
    use super::*;
    use warpknit::chart::DrawingShape;

    #[test]
    fn numbers_on_axes_are_short() {
        assert_eq!(
            [0.0, 0.05, 20.0, 999.0, 1000.0, 26_180.0, 4.4e6].map(short),
            ["0", "0.05", "20", "999", "1k", "26.2k", "4.4M"]
        );
    }

    #[test]
    fn a_sheet_holds_axes_points_and_names() {
        let mut plot = Plot::new(
            "Times",
            "stitches",
            "ms",
            [Series::ours("here"), Series::published("published")],
        );
        for (x, y) in [(576.0, 2.0), (3500.0, 5.0), (26_180.0, 60.0)] {
            plot.push(x, [y, 20.0 * y]);
        }
        let empty = Plot::new("Nothing", "x", "y", [Series::ours("nothing")]);
        let drawing = sheet("words", &[&plot, &empty, &plot]).unwrap();
        let shapes: Vec<_> = drawing.layers.iter().flat_map(|layer| &layer.shapes).collect();
        let has = |wanted: &str| {
            shapes
                .iter()
                .any(|shape| matches!(shape, DrawingShape::Text { text, .. } if text == wanted))
        };
        for wanted in
            ["words", "Times", "stitches", "ms", "here", "published", "10k", "500", "Nothing"]
        {
            assert!(has(wanted), "{wanted}: {shapes:?}");
        }
        let dots = shapes.iter().filter(|shape| matches!(shape, DrawingShape::Dot { .. })).count();
        assert_eq!(dots, 2 * (2 * 3 + 2));
    }
}
