//! Sheets on which a person checks the layout: nine copies of the mean cell, with the segments
//! drawn over each.
//!
//! In: a [`Cell`] and segments. Out: the picture of `grid3x3.png`, with the visible segments, and
//! the drawing of `layout.svg`, with all segments of `layout.toml` and their numbers.

use glam::DVec2;
use image::{Rgba, RgbaImage};
use tiny_skia::{Color, Paint, PathBuilder, Pixmap, Stroke, Transform};

use super::cell::Cell;
use super::layout::Layout;
use super::segment::Segment;
use crate::plane::{Plane, byte, double, side};
use warpknit_chart::{Anchor, Drawing, DrawingLayer, DrawingShape, PathSegment, TextSize};
use warpknit_core::fabric::yarn;

/// Pixels of the longer vector in the picture.
const PICTURE_CELL: f64 = 240.0;
/// The same in the drawing, where each number needs its place.
const DRAWING_CELL: f64 = 320.0;
/// Pixels of the drawing's picture per px of the drawing, for sharp display.
const PIXELS_PER_PX: f64 = 2.0;
/// Points along each edge of an outline.
const EDGE_POINTS: usize = 9;
/// Points of an outline: along one edge, and back along the other.
const OUTLINE_POINTS: usize = 2 * EDGE_POINTS;
/// Colours of segments, in turn: the palette of Okabe and Ito 2008, *Color universal design*, which
/// people with a red-green deficiency can tell apart too.
const COLORS: [[u8; 3]; 6] =
    [[213, 94, 0], [0, 114, 178], [240, 228, 66], [0, 158, 115], [204, 121, 167], [86, 180, 233]];

/// A plane's values as greys, from the darkest to the lightest.
pub(super) fn grey(plane: &Plane) -> RgbaImage {
    let (low, high) =
        plane.values.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), value| {
            (low.min(*value), high.max(*value))
        });
    let scale = 255.0 / (high - low).max(f32::MIN_POSITIVE);
    RgbaImage::from_fn(side(plane.width), side(plane.height), |x, y| {
        let grey = byte((plane.at(x as usize, y as usize) - low) * scale);
        Rgba([grey, grey, grey, u8::MAX])
    })
}

/// A segment's outline in each of the nine cells. The fifth is in the middle.
fn outlines(segment: &Segment, cell: &Cell) -> [[DVec2; OUTLINE_POINTS]; 9] {
    // A person may have given any copy of the segment.
    let home = cell.lattice.wrap_to_cell(segment.centre);
    let outline: [DVec2; OUTLINE_POINTS] = std::array::from_fn(|at| {
        let (step, side) =
            if at < EDGE_POINTS { (at, -0.5) } else { (OUTLINE_POINTS - 1 - at, 0.5) };
        let along = (double(step) / double(EDGE_POINTS - 1) - 0.5) * segment.length;
        segment.offset_point(along, side * segment.width) - segment.centre
    });
    [0_u8, 1, 2, 3, 4, 5, 6, 7, 8].map(|copy| {
        let cells = DVec2::new(f64::from(copy % 3), f64::from(copy / 3));
        let centre = home + cell.lattice.matrix() * cells;
        outline.map(|off| centre + off)
    })
}

/// Draws the grid with the visible segments, which are in the cell's own pixels.
pub(super) fn grid(cell: &Cell, layout: &Layout) -> RgbaImage {
    let scale = PICTURE_CELL / cell.lattice.longer();
    let (plane, corner) = cell.grid(scale);
    let picture = grey(&plane);
    let (width, height) = picture.dimensions();
    let mut canvas = Pixmap::new(width, height).expect("a picture has pixels");
    // The canvas wants premultiplied alpha. No pixel is transparent, so that it makes no
    // difference.
    canvas.data_mut().copy_from_slice(picture.as_raw());
    let stroke = Stroke { width: 2.0, ..Stroke::default() };
    for (segment, [red, green, blue]) in layout.visible.iter().zip(COLORS.into_iter().cycle()) {
        let mut paint = Paint::default();
        paint.set_color(Color::from_rgba8(red, green, blue, u8::MAX));
        for outline in outlines(segment, cell) {
            let corners = outline.map(|place| ((place - corner) * scale).as_vec2());
            let mut path = PathBuilder::new();
            path.move_to(corners[0].x, corners[0].y);
            corners[1..].iter().for_each(|corner| path.line_to(corner.x, corner.y));
            path.close();
            if let Some(path) = path.finish() {
                canvas.stroke_path(&path, &paint, &stroke, Transform::identity(), None);
            }
        }
    }
    RgbaImage::from_raw(width, height, canvas.take()).expect("four bytes a pixel")
}

/// The grid with numbered segments. Segments are in pixels of the photo; `scale` is the cell's
/// pixels per pixel of the photo.
pub(super) fn drawing(cell: &Cell, segments: &[Segment], scale: f64) -> Drawing {
    let finer = DRAWING_CELL / cell.lattice.longer();
    let (plane, corner) = cell.grid(finer);
    let picture = grey(&plane);
    let size = DVec2::new(f64::from(picture.width()), f64::from(picture.height())) / PIXELS_PER_PX;
    let px = |place: DVec2| (place - corner) * (finer / PIXELS_PER_PX);
    let drawn: Vec<[[DVec2; OUTLINE_POINTS]; 9]> = segments
        .iter()
        .map(|segment| outlines(&segment.scaled(scale), cell).map(|outline| outline.map(px)))
        .collect();
    let middles: Vec<DVec2> = drawn
        .iter()
        .map(|copies| {
            copies[4][EDGE_POINTS / 2].midpoint(copies[4][OUTLINE_POINTS - 1 - EDGE_POINTS / 2])
        })
        .collect();
    let dots = middles.iter().map(|&at| DrawingShape::Dot { at, radius: 8.0 }).collect();
    let numbers = (1..).zip(&middles).map(|(number, &middle)| DrawingShape::Text {
        at: middle + DVec2::new(0.0, 3.5),
        text: format!("{number}"),
        size: TextSize::Small,
        anchor: Anchor::Middle,
    });
    let layer = |name: &str, color: [u8; 3], shapes: Vec<DrawingShape>| DrawingLayer {
        name: name.to_owned(),
        color: yarn::Color(color),
        shapes,
    };
    let mut layers = vec![
        layer("grid", [0; 3], vec![DrawingShape::Picture { at: DVec2::ZERO, picture }]),
        layer("dots", [20; 3], dots),
        layer("numbers", [255; 3], numbers.collect()),
    ];
    for (((number, segment), copies), color) in
        (1..).zip(segments).zip(&drawn).zip(COLORS.into_iter().cycle())
    {
        let title = DrawingShape::Title { text: title(number, segment) };
        let lines = copies.iter().map(|outline| {
            let ahead =
                outline[1..].iter().chain([&outline[0]]).map(|place| PathSegment::Line(*place));
            DrawingShape::Path {
                segments: [PathSegment::Move(outline[0])].into_iter().chain(ahead).collect(),
                width: 1.5,
            }
        });
        layers.push(layer(
            &format!("segment-{number}"),
            color,
            [title].into_iter().chain(lines).collect(),
        ));
    }
    Drawing { size, layers, notes: Vec::new() }
}

/// A segment's position and size as `layout.toml` has them.
fn title(number: usize, segment: &Segment) -> String {
    let Segment { centre, width, length, bow, sway, .. } = segment;
    let degrees = segment.degrees_text();
    format!(
        "{number}: center {:.2}, {:.2}; angle_deg {degrees}; width {width:.2}; \
         length {length:.2}; bow {bow:.2}; sway {sway:.2}",
        centre.x, centre.y
    )
}

#[cfg(test)]
mod tests {
    use super::super::lattice::Lattice;
    use super::*;

    #[test]
    fn a_segment_is_drawn_in_each_cell_whichever_copy_is_given() {
        let lattice = Lattice { a: DVec2::new(20.0, 0.0), b: DVec2::new(0.0, 10.0) };
        let cell = Cell {
            lattice,
            plane: Plane::from_fn(20, 10, |x, _| f32::from(u8::try_from(x).unwrap())),
        };
        let segment = Segment::straight(DVec2::new(65.0, -7.0), 0.0, 4.0, 12.0, 1.0);
        let copies = outlines(&segment, &cell);
        let near = |place: DVec2, x: f64, y: f64| place.distance(DVec2::new(x, y)) < 1e-9;
        assert!(
            near(copies[4][0], 19.0, 11.0) && near(copies[4][EDGE_POINTS], 31.0, 15.0),
            "{:?}",
            copies[4]
        );
        assert!(
            near(copies[0][0] - copies[4][0], -20.0, -10.0)
                && near(copies[8][0] - copies[4][0], 20.0, 10.0)
        );
        // The photo has half as many pixels; the drawing has 8 px for each of the cell's.
        let drawing = drawing(&cell, &[segment.scaled(0.5)], 2.0);
        assert_eq!(drawing.size, DVec2::new(480.0, 240.0));
        let DrawingShape::Path { segments, .. } = &drawing.layers[3].shapes[5] else {
            panic!("{:?}", drawing.layers[3].shapes[5])
        };
        let (PathSegment::Move(first), PathSegment::Line(second)) =
            (segments[0], segments[EDGE_POINTS - 1])
        else {
            panic!("{segments:?}")
        };
        assert!(
            near(first, 19.0 * 8.0, 11.0 * 8.0) && near(second, 31.0 * 8.0, 11.0 * 8.0),
            "{segments:?}"
        );
        assert_eq!(
            drawing.layers[3].shapes[0],
            DrawingShape::Title {
                text: "1: center 32.50, -3.50; angle_deg 0.0; width 2.00; length 6.00; bow 0.00; \
                       sway 0.00"
                    .to_owned()
            }
        );
    }
}
