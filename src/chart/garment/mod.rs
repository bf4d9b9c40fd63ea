//! The sheet of a garment: its flat panels as cut at the left, at the right the draped garment,
//! painted by how far it is stretched.
//!
//! In: a [`Garment`]. Out: a [`Drawing`] of one width, as high as the draped garment's shape asks
//! for. Panels are lines ([`pattern`]); the draped garment is pixels ([`body`]): as shapes, a mesh
//! of a hundred thousand triangles would be ten megabytes, and hidden ones would show wherever
//! triangles cross. [`colors`] says which stretch has which colour.
//!
//! ```text
//!   title, units
//!   +------+ +-----+      warp   front    back
//!   |  ^   | |  ^  |
//!   |  |   | |  |  |      weft   front    back
//!   +------+ +-----+
//!   scale bar             legend
//! ```

mod body;
mod colors;
mod pattern;

use glam::DVec2;
use image::{Rgba, RgbaImage};
use rayon::prelude::*;

use super::png::SCALE;
use super::{
    Anchor, Drawing, DrawingLayer, DrawingShape, FAINT, HEADING, INK, MARGIN, PathSegment,
    TextSize, label, shortened,
};
use crate::fabric::yarn::Color;
use crate::garment::stretch::{
    Percentiles, TriangleStretch, percentiles, stretch, triangle, triangles,
};
use crate::garment::{Facts, Garment, Panel};
use body::{GarmentView, views};
use colors::StretchColors;

/// What no stitch can lie on: told from both ends of the scale by every eye.
const DEFECT: Color = Color([0xff, 0xb0, 0x00]);
/// Width of the panels' part, and of each map, px.
const PATTERN: f64 = 760.0;
const MAP: f64 = 320.0;
/// The least and the greatest height of a map, px.
const MAP_HEIGHTS: (f64, f64) = (220.0, 430.0);
const GAP: f64 = 24.0;
/// Room above each row of maps for its caption, and below for the views' names.
const CAPTION: f64 = 24.0;
const NAMES: f64 = 20.0;
/// Room for the legend, and for the scale bar across from it.
const LEGEND: f64 = 84.0;
/// The bar of colours, px.
const BAR: DVec2 = DVec2::new(440.0, 14.0);
/// The share of the cloth on either side of the scale.
const BEYOND: f64 = 0.02;

pub(super) fn draw(title: &str, garment: &Garment) -> Drawing {
    let views = views(garment);
    let height = (MAP * views[0].aspect()).clamp(MAP_HEIGHTS.0, MAP_HEIGHTS.1).ceil();
    let maps = 2.0 * (CAPTION + height + NAMES);
    let top = MARGIN + HEADING;
    let size = DVec2::new(3.0 * MARGIN + PATTERN + 2.0 * MAP + GAP, top + maps + LEGEND + MARGIN);

    let line = |y: f64, text: &str, size| DrawingShape::Text {
        at: DVec2::new(MARGIN, y),
        text: shortened(text),
        size,
        anchor: Anchor::Start,
    };
    let mut layers = vec![
        layer("title", INK, vec![line(MARGIN + 14.0, title, TextSize::Title)]),
        layer("facts", FAINT, vec![line(MARGIN + 34.0, &facts(garment), TextSize::Small)]),
    ];
    layers.extend(pattern::draw(
        garment,
        DVec2::new(MARGIN, top),
        DVec2::new(PATTERN, maps),
        LEGEND,
    ));
    let colors = StretchColors::spanning(&spread(&garment.panels));
    let corner = DVec2::new(2.0 * MARGIN + PATTERN, top);
    layers.extend(maps_of(garment, &views, &colors, corner, DVec2::new(MAP, height)));
    layers.push(legend(&colors, garment.facts.flipped > 0, corner + DVec2::new(0.0, maps)));
    Drawing { size, layers, notes: Vec::new() }
}

fn layer(name: &str, color: Color, shapes: Vec<DrawingShape>) -> DrawingLayer {
    DrawingLayer { name: name.to_owned(), color, shapes }
}

/// What the garment's files hold, in a line.
fn facts(garment: &Garment) -> String {
    let Facts { triangles, unit, unit_guessed, uv_scale_mm, .. } = &garment.facts;
    let guessed = if *unit_guessed { " (guessed)" } else { "" };
    let panels = garment.panels.len();
    format!(
        "{triangles} triangles, {panels} panel{}, unit {unit}{guessed}, flat unit {uv_scale_mm:.3} mm",
        if panels == 1 { "" } else { "s" }
    )
}

/// The stretches between which nearly all of the cloth is, along wales and courses.
fn spread(panels: &[Panel]) -> [f64; 4] {
    let all = triangles(panels);
    let of = |value: fn(&TriangleStretch) -> f64| percentiles(&all, value, [BEYOND, 1.0 - BEYOND]);
    let ([a, b], [c, d]) = (of(|one| one.warp), of(|one| one.weft));
    [a, b, c, d]
}

/// A direction in which stretch is shown.
struct Direction {
    name: &'static str,
    meaning: &'static str,
    of: fn(&TriangleStretch) -> f64,
    percentiles: Percentiles,
}

/// A row of maps for each direction: both sides of the draped garment.
fn maps_of(
    garment: &Garment,
    views: &[GarmentView; 2],
    colors: &StretchColors,
    corner: DVec2,
    size: DVec2,
) -> Vec<DrawingLayer> {
    let (warp, weft) = stretch(garment);
    let rows = [
        Direction {
            name: "warp",
            meaning: "along the wales",
            of: |one| one.warp,
            percentiles: warp,
        },
        Direction {
            name: "weft",
            meaning: "along the courses",
            of: |one| one.weft,
            percentiles: weft,
        },
    ];
    // The upper left corner of a row's caption.
    let place = |row: usize| corner + DVec2::new(0.0, row as f64 * (CAPTION + size.y + NAMES));
    let pixels = (size * SCALE).as_uvec2();
    let paint = |map: usize| {
        let (row, side) = (map / 2, map % 2);
        let Direction { name, of, .. } = rows[row];
        let color = |panel: &Panel, corners| colors.color_of(of(&triangle(panel, corners)));
        let picture = views[side].paint(garment, pixels, &color, DEFECT);
        let at = place(row) + DVec2::new(side as f64 * (MAP + GAP), CAPTION);
        layer(
            &format!("{name}-{}", views[side].name),
            INK,
            vec![DrawingShape::Picture { at, picture }],
        )
    };
    let mut layers: Vec<DrawingLayer> = (0..2 * rows.len()).into_par_iter().map(paint).collect();
    let (mut captions, mut names) = (Vec::new(), Vec::new());
    for (row, Direction { name, meaning, percentiles: [low, middle, high], .. }) in
        rows.iter().enumerate()
    {
        let at = place(row) + DVec2::new(0.0, 12.0);
        let text = format!(
            "stretch {meaning} ({name}); 5/50/95 % of the cloth: {low:.3} {middle:.3} {high:.3}"
        );
        captions.push(DrawingShape::Text {
            at,
            text,
            size: TextSize::Normal,
            anchor: Anchor::Start,
        });
        for (side, view) in views.iter().enumerate() {
            let below = at
                + DVec2::new((side as f64 + 0.5) * MAP + side as f64 * GAP, CAPTION + size.y + 2.0);
            names.push(label(below, view.name.to_owned(), Anchor::Middle));
        }
    }
    layers.extend([layer("captions", INK, captions), layer("views", FAINT, names)]);
    layers
}

/// The colours with their stretches below them.
fn legend(colors: &StretchColors, defects: bool, corner: DVec2) -> DrawingLayer {
    let at = corner + DVec2::new(20.0, 22.0);
    let pixels = (BAR * SCALE).as_uvec2();
    let middle = |x: u32| (f64::from(x) + 0.5) / f64::from(pixels.x);
    let bar = RgbaImage::from_fn(pixels.x, pixels.y, |x, _| {
        let [r, g, b] = colors.at(2.0 * middle(x) - 1.0).0;
        Rgba([r, g, b, 255])
    });
    let words = "draped over flat length, 1 is unstretched; the ends stand for all beyond; darker where the cloth turns away";
    let mut shapes = vec![
        label(corner + DVec2::new(0.0, 12.0), words.to_owned(), Anchor::Start),
        DrawingShape::Picture { at, picture: bar },
    ];
    for (place, stretch) in colors.marks() {
        let below = at + DVec2::new((place + 1.0) / 2.0 * BAR.x, BAR.y + 14.0);
        shapes.push(label(below, stretch, Anchor::Middle));
    }
    if defects {
        let [r, g, b] = DEFECT.0;
        let at = at + DVec2::new(BAR.x + 40.0, 0.0);
        shapes.push(DrawingShape::Picture {
            at,
            picture: RgbaImage::from_pixel(28, pixels.y, Rgba([r, g, b, 255])),
        });
        shapes.push(label(at + DVec2::new(20.0, 11.0), "flipped".to_owned(), Anchor::Start));
    }
    layer("legend", INK, shapes)
}

/// A closed line through points.
fn closed(points: &[DVec2]) -> Vec<PathSegment> {
    let mut segments: Vec<PathSegment> =
        points.iter().map(|&point| PathSegment::Line(point)).collect();
    if let Some(first) = points.first() {
        segments[0] = PathSegment::Move(*first);
        segments.push(PathSegment::Line(*first));
    }
    segments
}
