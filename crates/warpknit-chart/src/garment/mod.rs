//! The sheet of a garment: its flat panels at the left, maps of the draped garment's stretch at the
//! right.
//!
//! In: a [`Garment`]. Out: a [`Drawing`] of fixed width, whose height follows the draped garment's
//! aspect ratio. The panels are vector shapes ([`pattern`]). The draped garment is a picture
//! ([`body`]): as vector shapes, a mesh of a hundred thousand triangles would take ten megabytes,
//! and hidden triangles would show where triangles intersect. [`colors`] is the colour map.
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
    TextSize, label, text,
};
use body::{GarmentView, views};
use colors::StretchColors;
use warpknit_core::fabric::yarn::Color;
use warpknit_core::garment::stretch::{
    Percentiles, TriangleStretch, percentiles, stretch, triangle as stretch_of, triangles,
};
use warpknit_core::garment::{Garment, GarmentSummary, Panel};
use warpknit_core::locate::covered::covered_shares;

/// Colour of defects on which no stitch can lie. Every eye can distinguish it from both ends of the
/// colour scale.
const DEFECT: Color = Color([0xff, 0xb0, 0x00]);
/// Width of the part with the panels, px.
const PATTERN: f64 = 760.0;
/// Width of each map, px.
const MAP: f64 = 320.0;
/// The least and the greatest height of a map, px.
const MAP_HEIGHTS: (f64, f64) = (220.0, 430.0);
/// Space between two maps, px.
const GAP: f64 = 24.0;
/// Height of the caption above each row of maps, px.
const CAPTION: f64 = 24.0;
/// Height of the views' names below each row of maps, px.
const NAMES: f64 = 20.0;
/// Height of the legend, and of the scale bar beside it, px.
const LEGEND: f64 = 84.0;
/// Size of the legend's colour bar, px.
const BAR: DVec2 = DVec2::new(440.0, 14.0);
/// Share of the cloth that may lie beyond each end of the colour scale. A few extreme triangles
/// would otherwise flatten the colours of all others.
const BEYOND: f64 = 0.02;

/// Share of a triangle under other cloth from which on it is marked, all of it. Less would mark
/// cloth that lies flush and overlaps by the rounding of its file; more would leave a narrow strip
/// over large triangles unmarked.
const LEAST_COVERED: f64 = 1e-4;

/// Draws the sheet.
pub(super) fn draw(title: &str, garment: &Garment) -> Drawing {
    let covered = covered(garment);
    let views = views(garment);
    let height = (MAP * views[0].aspect()).clamp(MAP_HEIGHTS.0, MAP_HEIGHTS.1).ceil();
    let maps = 2.0 * (CAPTION + height + NAMES);
    let top = MARGIN + HEADING;
    let size = DVec2::new(3.0 * MARGIN + PATTERN + 2.0 * MAP + GAP, top + maps + LEGEND + MARGIN);

    let (first_line, second_line) =
        (DVec2::new(MARGIN, MARGIN + 14.0), DVec2::new(MARGIN, MARGIN + 34.0));
    let mut layers = vec![
        layer("title", INK, vec![text(first_line, title, TextSize::Title)]),
        layer("facts", FAINT, vec![text(second_line, &facts(garment), TextSize::Small)]),
    ];
    layers.extend(pattern::draw(
        garment,
        &covered,
        DVec2::new(MARGIN, top),
        DVec2::new(PATTERN, maps),
        LEGEND,
    ));
    // Both directions share one scale, so that warp and weft can be compared.
    let colors = StretchColors::spanning(&spread(&garment.panels));
    let corner = DVec2::new(2.0 * MARGIN + PATTERN, top);
    let color = |panel: usize, triangle: usize, of: fn(&TriangleStretch) -> f64| {
        if covered[panel].binary_search(&triangle).is_ok() {
            return DEFECT;
        }
        let panel = &garment.panels[panel];
        colors.color_of(of(&stretch_of(panel, panel.triangles[triangle])))
    };
    layers.extend(maps_of(garment, &views, &color, corner, DVec2::new(MAP, height)));
    let defects = match (garment.summary.flipped > 0, covered.iter().any(|own| !own.is_empty())) {
        (true, true) => Some("flipped or covered"),
        (true, false) => Some("flipped"),
        (false, true) => Some("under other cloth"),
        (false, false) => None,
    };
    layers.push(legend(&colors, defects, corner + DVec2::new(0.0, maps)));
    Drawing { size, layers, notes: Vec::new() }
}

/// For each panel the triangles that lie under other cloth of it, ascending.
fn covered(garment: &Garment) -> Vec<Vec<usize>> {
    let under = |shares: Vec<f64>| {
        (0..shares.len()).filter(|&triangle| shares[triangle] > LEAST_COVERED).collect()
    };
    covered_shares(garment).into_iter().map(under).collect()
}

/// A layer of the drawing.
fn layer(name: &str, color: Color, shapes: Vec<DrawingShape>) -> DrawingLayer {
    DrawingLayer { name: name.to_owned(), color, shapes }
}

/// One line about the garment's files.
fn facts(garment: &Garment) -> String {
    let GarmentSummary { triangles, unit, unit_guessed, uv_scale_mm, .. } = &garment.summary;
    let guessed = if *unit_guessed { " (guessed)" } else { "" };
    let panels = garment.panels.len();
    format!(
        "{triangles} triangles, {panels} panel{}, unit {unit}{guessed}, \
         flat unit {uv_scale_mm:.3} mm",
        if panels == 1 { "" } else { "s" }
    )
}

/// The stretches between which nearly all of the cloth lies, along wales and along courses.
fn spread(panels: &[Panel]) -> [f64; 4] {
    let all = triangles(panels);
    let ends = [BEYOND, 1.0 - BEYOND];
    let [a, b] = percentiles(&all, |one| one.warp, ends);
    let [c, d] = percentiles(&all, |one| one.weft, ends);
    [a, b, c, d]
}

/// A direction of the cloth whose stretch is shown.
struct Direction {
    name: &'static str,
    meaning: &'static str,
    of: fn(&TriangleStretch) -> f64,
    percentiles: Percentiles,
}

/// The maps: a row for each direction, with both views of the draped garment. `color` is that of a
/// panel's triangle by one of its stretches.
fn maps_of(
    garment: &Garment,
    views: &[GarmentView; 2],
    color: &(dyn Fn(usize, usize, fn(&TriangleStretch) -> f64) -> Color + Sync),
    corner: DVec2,
    size: DVec2,
) -> Vec<DrawingLayer> {
    let (warp, weft) = stretch(&garment.panels);
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
    // The four maps are independent and the costly part of the sheet.
    let paint = |map: usize| {
        let (row, side) = (map / 2, map % 2);
        let Direction { name, of, .. } = rows[row];
        let own = |panel, triangle| color(panel, triangle, of);
        let picture = views[side].paint(garment, pixels, &own, DEFECT);
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

/// The colour bar with its marks, and the names of what has the colour of defects, if there is any.
fn legend(colors: &StretchColors, defects: Option<&str>, corner: DVec2) -> DrawingLayer {
    let at = corner + DVec2::new(20.0, 22.0);
    let pixels = (BAR * SCALE).as_uvec2();
    let middle = |x: u32| (f64::from(x) + 0.5) / f64::from(pixels.x);
    let bar = RgbaImage::from_fn(pixels.x, pixels.y, |x, _| {
        let [r, g, b] = colors.at(2.0 * middle(x) - 1.0).0;
        Rgba([r, g, b, 255])
    });
    let words = "draped over flat length, 1 is unstretched; the ends stand for all beyond; \
                 darker where the cloth turns away";
    let mut shapes = vec![
        label(corner + DVec2::new(0.0, 12.0), words.to_owned(), Anchor::Start),
        DrawingShape::Picture { at, picture: bar },
    ];
    for (place, stretch) in colors.marks() {
        let below = at + DVec2::new((place + 1.0) / 2.0 * BAR.x, BAR.y + 14.0);
        shapes.push(label(below, stretch, Anchor::Middle));
    }
    if let Some(defects) = defects {
        let [r, g, b] = DEFECT.0;
        let at = at + DVec2::new(BAR.x + 40.0, 0.0);
        shapes.push(DrawingShape::Picture {
            at,
            picture: RgbaImage::from_pixel(28, pixels.y, Rgba([r, g, b, 255])),
        });
        shapes.push(label(at + DVec2::new(20.0, 11.0), defects.to_owned(), Anchor::Start));
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
