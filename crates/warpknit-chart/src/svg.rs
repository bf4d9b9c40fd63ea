//! Writes a drawing as SVG 1.1: one group for each layer, text as text. Pictures are embedded as
//! base64-encoded PNG.
//!
//! In: a [`Drawing`]. Out: the text of a file that drawing programs can edit. Cost: linear in
//! shapes and pixels.

use std::fmt::{self, Write};

use glam::DVec2;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, RgbaImage};

use super::png::SCALE;
use super::{Anchor, Drawing, DrawingLayer, DrawingShape, PathSegment, TextSize};

/// The text of an `.svg` file.
///
/// ```
/// use warpknit_chart::{Drawing, svg};
/// use warpknit_core::fabric::Fabric;
/// let text = svg::text(&Drawing::from_fabric(&Fabric::named("tricot").unwrap()));
/// assert!(text.starts_with("<svg") && text.contains(r#"<g id="bar-1""#));
/// ```
#[must_use]
pub fn text(drawing: &Drawing) -> String {
    let mut text = String::new();
    write(&mut text, drawing).expect("a string takes everything");
    text
}

/// Writes the file.
fn write(out: &mut String, drawing: &Drawing) -> fmt::Result {
    let (width, height) = (Px(drawing.size.x), Px(drawing.size.y));
    writeln!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" \
         font-family=\"'Noto Sans Mono', 'DejaVu Sans Mono', monospace\">"
    )?;
    writeln!(out, "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>")?;
    for layer in drawing.layers.iter().filter(|layer| !layer.shapes.is_empty()) {
        group(out, layer)?;
    }
    writeln!(out, "</svg>")
}

/// Writes a layer as a group whose attributes hold for all its shapes.
fn group(out: &mut String, layer: &DrawingLayer) -> fmt::Result {
    let DrawingLayer { name, color, shapes } = layer;
    let lines = shapes
        .iter()
        .all(|shape| matches!(shape, DrawingShape::Path { .. } | DrawingShape::Title { .. }));
    // The tooltip is to appear inside a closed line as well, although the inside isn't filled.
    let pointer_events = if shapes.iter().any(|shape| matches!(shape, DrawingShape::Title { .. })) {
        " pointer-events=\"all\""
    } else {
        ""
    };
    let paint = if lines {
        format!(
            "fill=\"none\" stroke=\"{color}\" stroke-linecap=\"round\" \
             stroke-linejoin=\"round\"{pointer_events}"
        )
    } else {
        format!("fill=\"{color}\"")
    };
    writeln!(out, "<g id=\"{name}\" {paint}>")?;
    for shape in shapes {
        match shape {
            DrawingShape::Title { text } => writeln!(out, "<title>{}</title>", Escaped(text))?,
            DrawingShape::Path { segments, width } => writeln!(
                out,
                "<path stroke-width=\"{}\" d=\"{}\"/>",
                Px(*width),
                PathData(segments)
            )?,
            DrawingShape::Area { segments } => {
                writeln!(out, "<path fill-rule=\"evenodd\" d=\"{}\"/>", PathData(segments))?;
            }
            DrawingShape::Picture { at, picture: pixels } => picture(out, *at, pixels)?,
            DrawingShape::Dot { at, radius } => {
                writeln!(
                    out,
                    "<circle cx=\"{}\" cy=\"{}\" r=\"{}\"/>",
                    Px(at.x),
                    Px(at.y),
                    Px(*radius)
                )?;
            }
            DrawingShape::Text { at, text, size, anchor } => {
                let place = match anchor {
                    Anchor::Start => "",
                    Anchor::Middle => " text-anchor=\"middle\"",
                    Anchor::End => " text-anchor=\"end\"",
                };
                let weight = if *size == TextSize::Title { " font-weight=\"bold\"" } else { "" };
                let (x, y, size) = (Px(at.x), Px(at.y), Px(size.px()));
                // `xml:space` keeps runs of spaces, which align the legend's columns.
                let text = Escaped(text);
                writeln!(
                    out,
                    "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\"{place}{weight} \
                     xml:space=\"preserve\">{text}</text>"
                )?;
            }
        }
    }
    writeln!(out, "</g>")
}

/// Writes pixels as an image with a data URL. `xlink:href` is deprecated in SVG 2, but unlike
/// `href` every program knows it.
fn picture(out: &mut String, at: DVec2, pixels: &RgbaImage) -> fmt::Result {
    let mut file = Vec::new();
    let encoder =
        PngEncoder::new_with_quality(&mut file, CompressionType::Default, FilterType::Adaptive);
    encoder
        .write_image(pixels.as_raw(), pixels.width(), pixels.height(), ExtendedColorType::Rgba8)
        .expect("memory takes any picture");
    let [width, height] = [pixels.width(), pixels.height()].map(|side| Px(f64::from(side) / SCALE));
    let (x, y) = (Px(at.x), Px(at.y));
    write!(
        out,
        "<image x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" \
         xmlns:xlink=\"http://www.w3.org/1999/xlink\" "
    )?;
    write!(out, "xlink:href=\"data:image/png;base64,")?;
    base64(out, &file);
    writeln!(out, "\"/>")
}

/// Base64 (RFC 4648): each three bytes become four characters.
fn base64(out: &mut String, bytes: &[u8]) {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for three in bytes.chunks(3) {
        // Missing bytes of the last group count as 0; `=` marks the characters that they would
        // fill.
        let [a, b, c] = [0, 1, 2].map(|at| three.get(at).map_or(0, |&byte| u32::from(byte)));
        let bits = a << 16 | b << 8 | c;
        for (digit, shift) in [18, 12, 6, 0].into_iter().enumerate() {
            out.push(if digit <= three.len() {
                char::from(DIGITS[(bits >> shift & 63) as usize])
            } else {
                '='
            });
        }
    }
}

/// A length with at most two decimals and no trailing zeros.
struct Px(f64);

impl fmt::Display for Px {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Adding 0 turns a rounded -0 into 0, which would be printed as -0.
        write!(f, "{}", (self.0 * 100.0).round() / 100.0 + 0.0)
    }
}

/// The `d` attribute of a path.
struct PathData<'a>(&'a [PathSegment]);

impl fmt::Display for PathData<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, segment) in self.0.iter().enumerate() {
            f.write_str(if at == 0 { "" } else { " " })?;
            match *segment {
                PathSegment::Move(end) => write!(f, "M{}", point(end))?,
                PathSegment::Line(end) => write!(f, "L{}", point(end))?,
                PathSegment::Curve(a, b, end) => {
                    write!(f, "C{} {} {}", point(a), point(b), point(end))?;
                }
            }
        }
        Ok(())
    }
}

/// A point of a path.
fn point(p: DVec2) -> String {
    format!("{} {}", Px(p.x), Px(p.y))
}

/// Text with XML's markup escaped. Characters that XML 1.0 forbids become U+FFFD.
struct Escaped<'a>(&'a str);

impl fmt::Display for Escaped<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.chars().try_for_each(|c| match c {
            '&' => f.write_str("&amp;"),
            '<' => f.write_str("&lt;"),
            '>' => f.write_str("&gt;"),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => f.write_char('\u{fffd}'),
            c => f.write_char(c),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_text_is_escaped() {
        assert_eq!(
            [1.0, -0.001, 2.345, 10.5].map(|px| Px(px).to_string()),
            ["1", "0", "2.35", "10.5"]
        );
        let encoded = |text: &str| {
            let mut out = String::new();
            base64(&mut out, text.as_bytes());
            out
        };
        assert_eq!(
            ["", "f", "fo", "foo", "foob"].map(encoded),
            ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg=="]
        );
        assert_eq!(Escaped("a<b & \u{1}c>").to_string(), "a&lt;b &amp; \u{fffd}c&gt;");
    }
}
