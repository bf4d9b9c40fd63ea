//! Rasterises a drawing: two pixels to a px of the drawing, on white.
//!
//! In: a [`Drawing`]. Out: an opaque picture. `tiny-skia` paints lines, areas and dots. Text comes
//! from `noto-sans-mono-bitmap`, which has rasterised glyphs in the sizes that are used, so that a
//! machine without any font writes the same file. Cost: linear in the pixels.

use glam::DVec2;
use image::RgbaImage;
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use tiny_skia::{FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, Stroke, Transform};

use super::{Anchor, Drawing, DrawingShape, PathSegment, TextSize};
use warpknit_core::fabric::yarn::Color;

/// Pixels to a px of the drawing, each way.
pub(super) const SCALE: f64 = 2.0;
/// The baseline's distance from the top of a glyph's raster, over the raster's height.
const BASELINE: f64 = 0.79;

impl TextSize {
    /// Weight and height of the bitmap font.
    fn font(self) -> (FontWeight, RasterHeight) {
        match self {
            Self::Small => (FontWeight::Regular, RasterHeight::Size20),
            Self::Normal => (FontWeight::Regular, RasterHeight::Size24),
            Self::Title => (FontWeight::Bold, RasterHeight::Size32),
        }
    }

    /// The font size in an SVG at which a character is as wide as in the PNG. A character of a
    /// monospaced font is 0.6 of the font size wide.
    #[must_use]
    pub fn px(self) -> f64 {
        self.width("0") / 0.6
    }

    /// Width of a text, px.
    #[must_use]
    pub fn width(self, text: &str) -> f64 {
        let (weight, height) = self.font();
        let characters = u32::try_from(text.chars().count() * get_raster_width(weight, height))
            .unwrap_or(u32::MAX);
        f64::from(characters) / SCALE
    }
}

/// Rasterises a drawing.
///
/// # Panics
/// If the drawing is over 16 000 px wide or high, which no drawing of this module is.
#[must_use]
pub fn paint(drawing: &Drawing) -> RgbaImage {
    let (width, height) = (pixels(drawing.size.x), pixels(drawing.size.y));
    let mut sheet = Pixmap::new(width, height)
        .expect("a sheet is limited in its needles, courses and bars, or of one size");
    sheet.fill(tiny_skia::Color::WHITE);
    for layer in &drawing.layers {
        let [r, g, b] = layer.color.0;
        let mut paint = Paint { anti_alias: true, ..Paint::default() };
        paint.set_color_rgba8(r, g, b, 255);
        for shape in &layer.shapes {
            match shape {
                DrawingShape::Path { segments, width } => {
                    line(&mut sheet, segments, *width, &paint);
                }
                DrawingShape::Area { segments } => area(&mut sheet, segments, &paint),
                DrawingShape::Picture { at, picture } => overlay(&mut sheet, *at, picture),
                DrawingShape::Dot { at, radius } => dot(&mut sheet, *at, *radius, &paint),
                DrawingShape::Text { at, text, size, anchor } => {
                    write(&mut sheet, *at, text, *size, *anchor, layer.color);
                }
                DrawingShape::Title { .. } => {}
            }
        }
    }
    // The sheet is opaque, so premultiplied pixels are plain ones.
    RgbaImage::from_raw(width, height, sheet.take()).expect("a sheet holds four bytes a pixel")
}

/// A length of the drawing in whole pixels, at least one.
fn pixels(length: f64) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "`as` saturates, and a sheet is no larger"
    )]
    let pixels = (length * SCALE).ceil() as u32;
    pixels.max(1)
}

/// A place of the drawing in pixels.
fn device(at: DVec2) -> (f32, f32) {
    let at = (at * SCALE).as_vec2();
    (at.x, at.y)
}

/// Segments as a path of tiny-skia; `None` of no segments.
fn path(segments: &[PathSegment]) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for segment in segments {
        match *segment {
            PathSegment::Move(end) => {
                let (x, y) = device(end);
                builder.move_to(x, y);
            }
            PathSegment::Line(end) => {
                let (x, y) = device(end);
                builder.line_to(x, y);
            }
            PathSegment::Curve(a, b, end) => {
                let ((ax, ay), (bx, by), (x, y)) = (device(a), device(b), device(end));
                builder.cubic_to(ax, ay, bx, by, x, y);
            }
        }
    }
    builder.finish()
}

/// Strokes a line with round caps and joins.
fn line(sheet: &mut Pixmap, segments: &[PathSegment], width: f64, paint: &Paint<'_>) {
    let (width, _) = device(DVec2::splat(width));
    let stroke =
        Stroke { width, line_cap: LineCap::Round, line_join: LineJoin::Round, ..Stroke::default() };
    if let Some(path) = path(segments) {
        sheet.stroke_path(&path, paint, &stroke, Transform::identity(), None);
    }
}

/// Fills an area.
fn area(sheet: &mut Pixmap, segments: &[PathSegment], paint: &Paint<'_>) {
    if let Some(path) = path(segments) {
        sheet.fill_path(&path, paint, FillRule::EvenOdd, Transform::identity(), None);
    }
}

/// Composites a picture over the sheet, pixel on pixel.
fn overlay(sheet: &mut Pixmap, at: DVec2, picture: &RgbaImage) {
    let at = at * SCALE;
    #[expect(clippy::cast_possible_truncation, reason = "a place on the sheet, in whole pixels")]
    let (left, top) = (at.x.round() as i64, at.y.round() as i64);
    for (x, y, pixel) in picture.enumerate_pixels() {
        let [r, g, b, cover] = pixel.0;
        blend(sheet, left + i64::from(x), top + i64::from(y), Color([r, g, b]), cover);
    }
}

fn dot(sheet: &mut Pixmap, at: DVec2, radius: f64, paint: &Paint<'_>) {
    let ((x, y), (radius, _)) = (device(at), device(DVec2::splat(radius)));
    if let Some(path) = PathBuilder::from_circle(x, y, radius) {
        sheet.fill_path(&path, paint, FillRule::Winding, Transform::identity(), None);
    }
}

/// Composites the glyphs of a text over the sheet. Characters that the font lacks become `?`.
fn write(sheet: &mut Pixmap, at: DVec2, text: &str, size: TextSize, anchor: Anchor, color: Color) {
    let before = match anchor {
        Anchor::Start => 0.0,
        Anchor::Middle => size.width(text) / 2.0,
        Anchor::End => size.width(text),
    };
    let (weight, height) = size.font();
    let start = (at - DVec2::new(before, 0.0)) * SCALE
        - DVec2::new(0.0, BASELINE * f64::from(height_of(height)));
    #[expect(clippy::cast_possible_truncation, reason = "a place on the sheet, in whole pixels")]
    let (mut left, top) = (start.x.round() as i64, start.y.round() as i64);
    // Glyphs are bitmaps, so they are placed on whole pixels; all have the same advance.
    for character in text.chars() {
        let glyph =
            get_raster(character, weight, height).or_else(|| get_raster('?', weight, height));
        let Some(glyph) = glyph else { continue };
        for (row, y) in glyph.rows().zip(top..) {
            for (&cover, x) in row.iter().zip(left..) {
                blend(sheet, x, y, color, cover);
            }
        }
        left += i64::try_from(glyph.width()).expect("a glyph is some pixels wide");
    }
}

fn height_of(height: RasterHeight) -> u32 {
    u32::try_from(height.val()).expect("a glyph is some pixels high")
}

/// Composites a colour with the coverage `cover` of 255 over a pixel; outside the sheet nothing is
/// done.
fn blend(sheet: &mut Pixmap, x: i64, y: i64, color: Color, cover: u8) {
    let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y)) else { return };
    if cover == 0 || x >= sheet.width() || y >= sheet.height() {
        return;
    }
    // Porter and Duff's "over" in integers, rounded. The sheet's alpha stays 255.
    let first = 4 * (y as usize * sheet.width() as usize + x as usize);
    for (byte, ink) in sheet.data_mut()[first..].iter_mut().zip(color.0) {
        let mixed =
            (u16::from(*byte) * u16::from(255 - cover) + u16::from(ink) * u16::from(cover) + 127)
                / 255;
        *byte = u8::try_from(mixed).expect("a mean of two bytes is a byte");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use warpknit_core::fabric::Fabric;

    #[test]
    fn every_bar_is_in_the_picture_in_its_colour() {
        let drawing = Drawing::from_fabric(&Fabric::named("locknit").unwrap());
        let picture = paint(&drawing);
        for layer in drawing.layers.iter().filter(|layer| !layer.shapes.is_empty()) {
            let [r, g, b] = layer.color.0;
            assert!(picture.pixels().any(|pixel| pixel.0 == [r, g, b, 255]), "{}", layer.name);
        }
        assert_eq!(picture.get_pixel(0, 0).0, [255; 4]);
    }

    #[test]
    fn areas_have_holes_and_pictures_lie_pixel_on_pixel() {
        let square = |low: f64, high: f64| {
            let [a, b, c, d] =
                [(low, low), (high, low), (high, high), (low, high)].map(DVec2::from);
            [
                PathSegment::Move(a),
                PathSegment::Line(b),
                PathSegment::Line(c),
                PathSegment::Line(d),
                PathSegment::Line(a),
            ]
        };
        let segments = [square(0.0, 10.0), square(4.0, 6.0)].concat();
        let mut picture = RgbaImage::from_pixel(2, 2, image::Rgba([0, 200, 0, 255]));
        picture.put_pixel(0, 0, image::Rgba([0, 200, 0, 0]));
        let shapes = vec![
            DrawingShape::Area { segments },
            DrawingShape::Picture { at: DVec2::new(12.0, 3.0), picture },
        ];
        let layer = super::super::DrawingLayer { name: "a".into(), color: Color([9; 3]), shapes };
        let painted = paint(&Drawing {
            size: DVec2::new(20.0, 10.0),
            layers: vec![layer],
            notes: Vec::new(),
        });
        let [cloth, hole, clear, green, beyond] =
            [(3, 3), (10, 10), (24, 6), (25, 6), (26, 7)].map(|(x, y)| painted.get_pixel(x, y).0);
        assert_eq!((cloth, hole, clear), ([9, 9, 9, 255], [255; 4], [255; 4]));
        assert_eq!((green, beyond), ([0, 200, 0, 255], [255; 4]));
    }

    #[test]
    fn text_outside_the_sheet_or_the_font_is_no_fault() {
        let text = |x: f64| DrawingShape::Text {
            at: DVec2::new(x, 5.0),
            text: "日本 ab".to_owned(),
            size: TextSize::Title,
            anchor: Anchor::Middle,
        };
        let layer = super::super::DrawingLayer {
            name: "t".into(),
            color: Color([0; 3]),
            shapes: vec![text(-5.0), text(400.0), text(20.0)],
        };
        let drawing =
            Drawing { size: DVec2::new(40.0, 20.0), layers: vec![layer], notes: Vec::new() };
        assert!(paint(&drawing).pixels().any(|pixel| pixel.0 == [0, 0, 0, 255]));
    }
}
