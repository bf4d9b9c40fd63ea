//! The chart of a weft knit: a square a loop, as knitters draw it, seen from the technical face.
//!
//! In: a [`Motif`]. Out: a [`Drawing`]: legs that show are a V, reverse loops a dash, and the heads
//! of a crossing lines to where they go, those in front dark. Course 1 is below, wale 1 on the
//! left.

use std::ops::Range;

use glam::DVec2;

use super::path::Piece;
use super::{
    Anchor, Drawing, FAINT, HAIR, HEADING, INK, Layer, MARGIN, Shape, TextSize, label, shortened,
};
use warpknit_core::fabric::Fabric;
use warpknit_core::fabric::motif::{ChartCell, Motif};
use warpknit_core::ids::index32;

/// The most loops of a side that are drawn.
const MOST: usize = 100;
/// A square, px.
const SIDE: DVec2 = DVec2::new(20.0, 17.0);
/// Every so many wales and courses are numbered.
const NUMBERED: usize = 5;
const NUMBERS: f64 = 30.0;
const ROW: f64 = 20.0;
const SYMBOL: f64 = 1.8;
const VIEW: &str = "seen from the technical face, course 1 below";

struct Sheet<'a> {
    motif: &'a Motif,
    wales: usize,
    courses: usize,
    /// The chart's lower left corner.
    origin: DVec2,
}

pub(super) fn draw(fabric: &Fabric, motif: &Motif) -> Drawing {
    let (wales, courses) = (motif.wales().min(MOST), motif.courses().min(MOST));
    let legend: Vec<String> = [('k', "face".to_owned()), ('p', "reverse".to_owned())]
        .into_iter()
        .chain(motif.legend().iter().map(|(letter, symbol)| (*letter, symbol.to_string())))
        .filter(|(letter, _)| motif.rows().iter().any(|row| row.contains(*letter)))
        .map(|(letter, meaning)| format!("{letter}  {meaning}"))
        .collect();
    let notes: Vec<String> = (wales < motif.wales() || courses < motif.courses())
        .then(|| {
            format!(
                "{wales} by {courses} of {} by {} loops are drawn",
                motif.wales(),
                motif.courses()
            )
        })
        .into_iter()
        .collect();
    let words = [fabric.name.as_str(), VIEW]
        .into_iter()
        .chain(legend.iter().chain(&notes).map(String::as_str));
    let widest = words.map(|text| TextSize::Title.width(&shortened(text))).fold(0.0, f64::max);
    let chart = SIDE * DVec2::new(count(wales), count(courses));
    let bottom = MARGIN + HEADING + chart.y;
    let sheet = Sheet { motif, wales, courses, origin: DVec2::new(MARGIN + NUMBERS, bottom) };
    let lines = count(legend.len() + notes.len());
    let size = DVec2::new(
        (chart.x + NUMBERS).max(widest) + 2.0 * MARGIN,
        bottom + NUMBERS + lines * ROW + MARGIN,
    );

    let below = |line: usize| DVec2::new(MARGIN, bottom + NUMBERS + (count(line) + 0.5) * ROW);
    let text = |at: DVec2, text: &str, size| Shape::Text {
        at,
        text: shortened(text),
        size,
        anchor: Anchor::Start,
    };
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
    let layers = vec![
        Layer { name: "squares".to_owned(), color: HAIR, shapes: sheet.squares() },
        Layer {
            name: "behind".to_owned(),
            color: FAINT,
            shapes: sheet.symbols(|cell| cell.layer < 0),
        },
        Layer {
            name: "loops".to_owned(),
            color: INK,
            shapes: sheet.symbols(|cell| cell.layer >= 0),
        },
        Layer { name: "numbers".to_owned(), color: FAINT, shapes: faint },
        Layer { name: "text".to_owned(), color: INK, shapes: ink },
    ];
    Drawing { size, layers, notes }
}

impl Sheet<'_> {
    /// A place of the chart, wales to the right and courses up.
    fn at(&self, wale: f64, course: f64) -> DVec2 {
        self.origin + SIDE * DVec2::new(wale, -course)
    }

    fn line(from: DVec2, to: DVec2, width: f64) -> Shape {
        Shape::Path { pieces: vec![Piece::Move(from), Piece::Line(to)], width }
    }

    fn squares(&self) -> Vec<Shape> {
        let (wales, courses) = (count(self.wales), count(self.courses));
        let upright = (0..=self.wales)
            .map(|wale| Self::line(self.at(count(wale), 0.0), self.at(count(wale), courses), 1.0));
        let level = (0..=self.courses).map(|course| {
            Self::line(self.at(0.0, count(course)), self.at(wales, count(course)), 1.0)
        });
        upright.chain(level).collect()
    }

    fn symbols(&self, wanted: impl Fn(ChartCell) -> bool) -> Vec<Shape> {
        let of = |range: Range<usize>| range.map(|at| (at, i64::from(index32(at))));
        let mut shapes = Vec::new();
        for (course, row) in of(0..self.courses) {
            for (wale, column) in of(0..self.wales) {
                let cell = self.motif.cell(column, row);
                if wanted(cell) {
                    shapes.push(self.symbol(cell, count(wale), count(course)));
                }
            }
        }
        shapes
    }

    fn symbol(&self, cell: ChartCell, wale: f64, course: f64) -> Shape {
        let place = |x: f64, y: f64| self.at(wale + x, course + y);
        if cell.carried != 0 {
            return Self::line(place(0.5, 0.1), place(0.5 + f64::from(cell.carried), 0.9), SYMBOL);
        }
        if cell.reverse {
            return Self::line(place(0.25, 0.5), place(0.75, 0.5), SYMBOL);
        }
        let pieces = vec![
            Piece::Move(place(0.28, 0.78)),
            Piece::Line(place(0.5, 0.22)),
            Piece::Line(place(0.72, 0.78)),
        ];
        Shape::Path { pieces, width: SYMBOL }
    }

    fn numbers(&self) -> Vec<Shape> {
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
        let drawing = Drawing::of(&Fabric::named("cable").unwrap());
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
