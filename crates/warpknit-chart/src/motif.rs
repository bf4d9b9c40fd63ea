//! The chart of a weft knit: one square for each loop, as knitters draw it, from the technical
//! face.
//!
//! In: a [`Motif`]. Out: a [`Drawing`]. A face loop is a V, a reverse loop a dash. The loops of a
//! cable crossing are lines to the wale they move to; those in front are dark, those behind pale.
//! Course 1 is at the bottom, wale 1 on the left. Cost: one shape a loop, for at most [`MOST`]
//! loops each way.

use glam::DVec2;

use super::path::PathSegment;
use super::{
    Anchor, Drawing, DrawingLayer, DrawingShape, FAINT, HAIR, HEADING, INK, MARGIN, TextSize,
    label, shortened, text,
};
use warpknit_core::fabric::Fabric;
use warpknit_core::fabric::motif::{ChartCell, Motif};
use warpknit_core::ids::index32;

/// The most wales and courses that are drawn.
const MOST: usize = 100;
/// Size of a square, px. Loops are a little wider than high.
const SIDE: DVec2 = DVec2::new(20.0, 17.0);
/// Step between numbered wales and courses.
const NUMBERED: usize = 5;
/// Room for the numbers, px.
const NUMBERS: f64 = 30.0;
/// Height of a line of the legend, px.
const ROW: f64 = 20.0;
/// Line width of the symbols, px.
const SYMBOL: f64 = 1.8;
const VIEW: &str = "seen from the technical face, course 1 below";

/// The layout of the chart.
struct WeftChart<'a> {
    motif: &'a Motif,
    wales: usize,
    courses: usize,
    /// The chart's lower left corner.
    origin: DVec2,
}

/// Draws the chart of a motif.
pub(super) fn draw(fabric: &Fabric, motif: &Motif) -> Drawing {
    let (wales, courses) = (motif.wales().min(MOST), motif.courses().min(MOST));
    let legend = legend(motif);
    let notes = notes(motif, wales, courses);
    let words = [fabric.name.as_str(), VIEW]
        .into_iter()
        .chain(legend.iter().chain(&notes).map(String::as_str));
    let widest = words.map(|text| TextSize::Title.width(&shortened(text))).fold(0.0, f64::max);
    let chart = SIDE * DVec2::new(count(wales), count(courses));
    let bottom = MARGIN + HEADING + chart.y;
    let sheet = WeftChart { motif, wales, courses, origin: DVec2::new(MARGIN + NUMBERS, bottom) };
    let lines = count(legend.len() + notes.len());
    let size = DVec2::new(
        (chart.x + NUMBERS).max(widest) + 2.0 * MARGIN,
        bottom + NUMBERS + lines * ROW + MARGIN,
    );

    // Legend and notes follow one another below the chart.
    let below = |line: usize| DVec2::new(MARGIN, bottom + NUMBERS + (count(line) + 0.5) * ROW);
    let mut ink = vec![text(DVec2::new(MARGIN, MARGIN + 14.0), &fabric.name, TextSize::Title)];
    ink.extend(
        legend.iter().enumerate().map(|(line, words)| text(below(line), words, TextSize::Normal)),
    );
    let mut faint = sheet.numbers();
    faint.push(text(DVec2::new(MARGIN, MARGIN + 34.0), VIEW, TextSize::Small));
    faint.extend(
        notes
            .iter()
            .zip(legend.len()..)
            .map(|(note, line)| text(below(line), note, TextSize::Small)),
    );
    // Loops behind a crossing are drawn first, those in front over them.
    let layers = vec![
        DrawingLayer { name: "squares".to_owned(), color: HAIR, shapes: sheet.squares() },
        DrawingLayer {
            name: "behind".to_owned(),
            color: FAINT,
            shapes: sheet.symbols(|cell| cell.layer < 0),
        },
        DrawingLayer {
            name: "loops".to_owned(),
            color: INK,
            shapes: sheet.symbols(|cell| cell.layer >= 0),
        },
        DrawingLayer { name: "numbers".to_owned(), color: FAINT, shapes: faint },
        DrawingLayer { name: "text".to_owned(), color: INK, shapes: ink },
    ];
    Drawing { size, layers, notes }
}

/// The meaning of each letter that the motif uses.
fn legend(motif: &Motif) -> Vec<String> {
    [('k', "face".to_owned()), ('p', "reverse".to_owned())]
        .into_iter()
        .chain(motif.legend().iter().map(|(letter, symbol)| (*letter, symbol.to_string())))
        .filter(|(letter, _)| motif.rows().iter().any(|row| row.contains(*letter)))
        .map(|(letter, meaning)| format!("{letter}  {meaning}"))
        .collect()
}

/// A note where the motif is larger than the chart.
fn notes(motif: &Motif, wales: usize, courses: usize) -> Vec<String> {
    if wales == motif.wales() && courses == motif.courses() {
        return Vec::new();
    }
    vec![format!(
        "{wales} by {courses} of {} by {} loops are drawn",
        motif.wales(),
        motif.courses()
    )]
}

impl WeftChart<'_> {
    /// A place of the chart on the sheet. Wales count to the right, courses upward.
    fn at(&self, wale: f64, course: f64) -> DVec2 {
        self.origin + SIDE * DVec2::new(wale, -course)
    }

    fn line(from: DVec2, to: DVec2, width: f64) -> DrawingShape {
        DrawingShape::Path { segments: vec![PathSegment::Move(from), PathSegment::Line(to)], width }
    }

    /// The grid.
    fn squares(&self) -> Vec<DrawingShape> {
        let (wales, courses) = (count(self.wales), count(self.courses));
        let upright = (0..=self.wales)
            .map(|wale| Self::line(self.at(count(wale), 0.0), self.at(count(wale), courses), 1.0));
        let level = (0..=self.courses).map(|course| {
            Self::line(self.at(0.0, count(course)), self.at(wales, count(course)), 1.0)
        });
        upright.chain(level).collect()
    }

    /// The symbols of the loops for which `wanted` holds.
    fn symbols(&self, wanted: impl Fn(ChartCell) -> bool) -> Vec<DrawingShape> {
        let mut shapes = Vec::new();
        for course in 0..self.courses {
            for wale in 0..self.wales {
                let cell = self.motif.cell(i64::from(index32(wale)), i64::from(index32(course)));
                if wanted(cell) {
                    shapes.push(self.symbol(cell, count(wale), count(course)));
                }
            }
        }
        shapes
    }

    /// The symbol of the loop at a wale and a course.
    fn symbol(&self, cell: ChartCell, wale: f64, course: f64) -> DrawingShape {
        let place = |x: f64, y: f64| self.at(wale + x, course + y);
        // A loop that a crossing carries to another wale slants from its own square to that wale.
        if cell.carried != 0 {
            return Self::line(place(0.5, 0.1), place(0.5 + f64::from(cell.carried), 0.9), SYMBOL);
        }
        if cell.reverse {
            return Self::line(place(0.25, 0.5), place(0.75, 0.5), SYMBOL);
        }
        let segments = vec![
            PathSegment::Move(place(0.28, 0.78)),
            PathSegment::Line(place(0.5, 0.22)),
            PathSegment::Line(place(0.72, 0.78)),
        ];
        DrawingShape::Path { segments, width: SYMBOL }
    }

    /// The numbers of some wales and courses.
    fn numbers(&self) -> Vec<DrawingShape> {
        let numbered =
            |end: usize| (1..=end).filter(move |&number| number == 1 || number % NUMBERED == 0);
        let wales = numbered(self.wales).map(|wale| {
            label(
                self.at(count(wale) - 0.5, 0.0) + DVec2::Y * 16.0,
                wale.to_string(),
                Anchor::Middle,
            )
        });
        let courses = numbered(self.courses).map(|course| {
            label(
                self.at(0.0, count(course) - 0.5) + DVec2::new(-6.0, 4.0),
                course.to_string(),
                Anchor::End,
            )
        });
        wales.chain(courses).collect()
    }
}

fn count(number: usize) -> f64 {
    f64::from(index32(number))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_loop_has_a_symbol_and_every_letter_a_line() {
        let drawing = Drawing::from_fabric(&Fabric::named("cable").unwrap());
        let layer = |name: &str| drawing.layers.iter().find(|layer| layer.name == name).unwrap();
        let (behind, loops) = (layer("behind").shapes.len(), layer("loops").shapes.len());
        assert_eq!(behind + loops, 32 * 36);
        assert!(behind > 0 && drawing.notes.is_empty());
        let text = format!("{:?}", layer("text").shapes);
        for line in ["k  face", "p  reverse", "L  cable 3/3 left", "r  cable 2/2 right"] {
            assert!(text.contains(line), "{line}");
        }
    }
}
