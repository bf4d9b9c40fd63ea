//! The plan of laid cloth: its strands in 3 x 3 cells, seen from the technical face.
//!
//! In: a laid [`Fabric`]. Out: a [`Drawing`]. Each strand is as wide as its yarn and straight from
//! point to point. The parts above the cloth's middle plane are drawn over those below it, with
//! dark edges.
//!
//! Not promised: the order of two strands that both lie above the middle is that of the bars, not
//! of their heights.

use glam::{DVec2, DVec3};

use super::path::PathSegment;
use super::{
    Drawing, DrawingLayer, DrawingShape, FAINT, HAIR, HEADING, INK, MARGIN, TextSize, shortened,
    text,
};
use warpknit_core::fabric::yarn::Color;
use warpknit_core::fabric::{Fabric, LaidCloth, StrandDirection};
use warpknit_core::number::byte;

/// Cells each way.
const CELLS: u8 = 3;
/// The longer side of a cell, px.
const SIDE: f64 = 110.0;
const VIEW: &str = "seen from the technical face";
/// Drawn width of a yarn over its real one: less than 1, so that a gap shows between neighbours.
const SHOWN: f64 = 0.85;
/// Brightness of the edges of upper strands, as a factor of the yarn's colour.
const EDGE: f32 = 0.4;
/// Brightness of lower strands, as a factor of the yarn's colour.
const UNDER: f32 = 0.7;

/// Draws the plan.
pub(super) fn draw(fabric: &Fabric, cloth: &LaidCloth) -> Drawing {
    let spacing = DVec2::new(fabric.wale_spacing(), fabric.course_spacing());
    let scale = SIDE / spacing.max_element();
    let cell = spacing * scale;
    let sheet = cell * f64::from(CELLS);
    let origin = DVec2::new(MARGIN, MARGIN + HEADING + sheet.y);

    let sides = (0..=CELLS).map(f64::from).flat_map(|count| {
        let line = |from: DVec2, to: DVec2| {
            let place = |at: DVec2| origin + at * cell * DVec2::new(1.0, -1.0);
            DrawingShape::Path {
                segments: vec![PathSegment::Move(place(from)), PathSegment::Line(place(to))],
                width: 1.0,
            }
        };
        let last = f64::from(CELLS);
        [
            line(DVec2::new(count, 0.0), DVec2::new(count, last)),
            line(DVec2::new(0.0, count), DVec2::new(last, count)),
        ]
    });
    let mut layers =
        vec![DrawingLayer { name: "cells".to_owned(), color: HAIR, shapes: sides.collect() }];
    // Painter's algorithm with two levels: first everything below the middle plane, then above it.
    for (name, above) in [("under", false), ("over", true)] {
        for (number, (strand, thickness)) in (1..).zip(cloth.strands.iter().zip(fabric.thickness()))
        {
            let width = SHOWN * 2.0 * thickness * fabric.radius() * scale;
            let lines = |width: f64| {
                let place = |at| origin + at * cell * DVec2::new(1.0, -1.0);
                lines(&strand.path, strand.direction, above, place, width)
            };
            let color = strand.yarn.color;
            // A wider dark line below an upper strand shows where it crosses over others.
            if above {
                layers.push(DrawingLayer {
                    name: format!("strand-{number}-edge"),
                    color: shaded(color, EDGE),
                    shapes: lines(width + 2.0),
                });
            }
            let color = if above { color } else { shaded(color, UNDER) };
            layers.push(DrawingLayer {
                name: format!("strand-{number}-{name}"),
                color,
                shapes: lines(width),
            });
        }
    }
    let faint = vec![text(DVec2::new(MARGIN, MARGIN + 34.0), VIEW, TextSize::Small)];
    let ink = vec![text(DVec2::new(MARGIN, MARGIN + 14.0), &fabric.name, TextSize::Title)];
    layers.push(DrawingLayer { name: "notes".to_owned(), color: FAINT, shapes: faint });
    layers.push(DrawingLayer { name: "text".to_owned(), color: INK, shapes: ink });
    let widest = [(fabric.name.as_str(), TextSize::Title), (VIEW, TextSize::Small)]
        .map(|(words, size)| size.width(&shortened(words)));
    let width = widest.into_iter().fold(sheet.x, f64::max);
    Drawing { size: DVec2::new(width + 2.0 * MARGIN, origin.y + MARGIN), layers, notes: Vec::new() }
}

/// A darker colour.
fn shaded(Color(bytes): Color, share: f32) -> Color {
    Color(bytes.map(|value| byte(f32::from(value) * share)))
}

/// The spans of a strand that lie above the cloth's middle plane, or below it, in all cells. A span
/// that leaves the sheet is left out.
fn lines(
    path: &[DVec3],
    direction: StrandDirection,
    above: bool,
    place: impl Fn(DVec2) -> DVec2,
    width: f64,
) -> Vec<DrawingShape> {
    // The strand is periodic: its last point leads to its first one in the next cell.
    let period = direction.step().truncate();
    let ends: Vec<_> = path.iter().map(|point| (point.truncate(), point.z)).collect();
    let next = ends.iter().skip(1).copied().chain([(ends[0].0 + period, ends[0].1)]);
    let spans: Vec<_> = ends
        .iter()
        .copied()
        .zip(next)
        .filter(|((_, low), (_, high))| (low + high > 0.0) == above)
        .collect();
    let cells = (0..CELLS).flat_map(|row| {
        (0..CELLS).map(move |column| DVec2::new(f64::from(column), f64::from(row)))
    });
    cells
        .flat_map(|cell| spans.iter().map(move |((from, _), (to, _))| (cell + from, cell + to)))
        .filter(|(from, to)| is_on_sheet(*from) && is_on_sheet(*to))
        .map(|(from, to)| DrawingShape::Path {
            segments: vec![PathSegment::Move(place(from)), PathSegment::Line(place(to))],
            width,
        })
        .collect()
}

/// Whether a place, in cells, is on the sheet.
fn is_on_sheet(at: DVec2) -> bool {
    at.min_element() >= 0.0 && at.max_element() <= f64::from(CELLS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_strand_is_over_where_it_is_above_the_middle() {
        let path = vec![
            glam::DVec3::new(0.5, 0.1, 0.2),
            glam::DVec3::new(0.5, 0.4, 0.2),
            glam::DVec3::new(0.5, 0.7, -0.3),
        ];
        let of = |above| lines(&path, StrandDirection::Along, above, |at| at, 1.0);
        // One span of three is above; of those that go on, the topmost row's leave the sheet.
        assert_eq!((of(true).len(), of(false).len()), (9, 9 + 6));
    }
}
