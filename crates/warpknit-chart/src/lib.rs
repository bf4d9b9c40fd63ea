//! Diagrams of fabrics and sheets of garments.
//!
//! In: a [`Fabric`], or a [`Garment`]. Out: a [`Drawing`], a list of shapes that [`svg`] writes as
//! text and [`png`] rasterises. A warp knit becomes a lapping diagram on point paper, as textbooks
//! draw it; a weft knit becomes a chart of its loops; laid cloth is drawn in plan.
//!
//! In a lapping diagram a row of dots is a course, the first course at the bottom, and a dot is a
//! needle. The gaps between needles are numbered below, counted from the pattern drive. The view is
//! from the technical back: each bar's path goes over the dots that it laps, and the underlaps lie
//! between the rows. One yarn of each bar is drawn, that of its first threaded guide. With at most
//! two bars there is room for the bar's other yarns, in a pale colour.
//!
//! Not promised: a very large fabric is not drawn completely. [`Drawing::notes`] says what is left
//! out.

mod garment;
mod laid;
mod lapping;
mod motif;
mod path;
pub mod png;
pub mod svg;

use std::path::Path;

use glam::DVec2;
use image::RgbaImage;

pub use path::PathSegment;
use warpknit_core::fabric::yarn::Color;
use warpknit_core::fabric::{Fabric, Structure};
use warpknit_core::garment::Garment;

/// Text and symbols.
const INK: Color = Color([0x22, 0x26, 0x2b]);
/// Axis numbers and notes.
const FAINT: Color = Color([0x6b, 0x72, 0x7a]);
/// Grid lines.
const HAIR: Color = Color([0xd5, 0xd9, 0xde]);
/// Margin around a sheet, px.
const MARGIN: f64 = 24.0;
/// Height of the title and the line below it, px.
const HEADING: f64 = 58.0;
/// The most characters of a text.
const MOST_CHARACTERS: usize = 100;

/// A shape of a drawing. Lengths are px of the sheet, y points down.
#[derive(Clone, Debug, PartialEq)]
pub enum DrawingShape {
    /// A line.
    Path {
        /// Its course.
        segments: Vec<PathSegment>,
        /// Its width.
        width: f64,
    },
    /// A filled area (even-odd rule: a closed line inside another one is a hole).
    Area {
        /// Its outline.
        segments: Vec<PathSegment>,
    },
    /// Pixels, two to a px.
    Picture {
        /// Its upper left corner.
        at: DVec2,
        /// Its pixels.
        picture: RgbaImage,
    },
    /// A filled circle.
    Dot {
        /// Its centre.
        at: DVec2,
        /// Its radius.
        radius: f64,
    },
    /// A line of text.
    Text {
        /// The place of the anchor on its baseline.
        at: DVec2,
        /// The words.
        text: String,
        /// The size of the font.
        size: TextSize,
        /// The part of the text that stands at `at`.
        anchor: Anchor,
    },
    /// A tooltip for the layer: an SVG viewer shows it where the pointer rests. A PNG leaves it
    /// out.
    Title {
        /// One line.
        text: String,
    },
}

/// Sizes of text: those of the bitmap font that a PNG uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextSize {
    /// Axis numbers and notes.
    Small,
    /// The legend.
    Normal,
    /// The fabric's name, bold.
    Title,
}

/// The part of a text that stands at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// Its beginning.
    Start,
    /// Its middle.
    Middle,
    /// Its end.
    End,
}

/// Shapes of one kind and colour.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawingLayer {
    /// Its name: `needles`, `bar-1` …; unique in a drawing.
    pub name: String,
    /// Colour of lines, areas, dots and text.
    pub color: Color,
    /// The shapes in the order of drawing: later ones cover earlier ones.
    pub shapes: Vec<DrawingShape>,
}

/// A drawing as vector shapes.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// Width and height, px.
    pub size: DVec2,
    /// The layers in the order of drawing: later ones cover earlier ones.
    pub layers: Vec<DrawingLayer>,
    /// One line for each thing that is left out because the fabric is too large for a sheet.
    pub notes: Vec<String>,
}

/// The file formats of a drawing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChartFormat {
    /// Vector graphics, which drawing programs edit.
    Svg,
    /// Pixels.
    Png,
}

impl ChartFormat {
    /// The format that a path's extension asks for, in upper or lower case.
    #[must_use]
    pub fn from_path(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "svg" => Some(Self::Svg),
            "png" => Some(Self::Png),
            _ => None,
        }
    }

    /// The extension that asks for it.
    #[must_use]
    pub fn ending(self) -> &'static str {
        match self {
            Self::Svg => ".svg",
            Self::Png => ".png",
        }
    }
}

impl Drawing {
    /// The diagram of a fabric: a lapping diagram of a warp knit, a chart of a weft knit, a plan of
    /// laid cloth. Cost: at most some thousand shapes, whatever the fabric.
    ///
    /// ```
    /// use warpknit_chart::Drawing;
    /// use warpknit_core::fabric::Fabric;
    /// let drawing = Drawing::from_fabric(&Fabric::named("locknit").unwrap());
    /// assert!(drawing.layers.iter().any(|layer| layer.name == "bar-2"));
    /// assert!(drawing.notes.is_empty());
    /// ```
    #[must_use]
    pub fn from_fabric(fabric: &Fabric) -> Self {
        match &fabric.structure {
            Structure::Warp(knit) => lapping::draw(fabric, knit),
            Structure::Weft(knit) => motif::draw(fabric, &knit.motif),
            Structure::Laid(cloth) => laid::draw(fabric, cloth),
        }
    }

    /// The sheet of a garment: its flat panels with their grain at the left, maps of the draped
    /// garment's stretch at the right. `title` names the garment. Cost: the maps have a fixed
    /// number of pixels, so only the outlines grow with the panels' edges.
    ///
    /// ```
    /// use warpknit_chart::Drawing;
    /// use warpknit_core::garment::Garment;
    /// let drawing = Drawing::from_garment("square.obj", &Garment::rectangle(50.0, 50.0));
    /// assert!(drawing.layers.iter().any(|layer| layer.name == "panel-0"));
    /// ```
    #[must_use]
    pub fn from_garment(title: &str, garment: &Garment) -> Self {
        garment::draw(title, garment)
    }
}

/// A line of text that begins at a place, shortened so that it fits the sheet.
fn text(at: DVec2, text: &str, size: TextSize) -> DrawingShape {
    DrawingShape::Text { at, text: shortened(text), size, anchor: Anchor::Start }
}

/// A small text.
fn label(at: DVec2, text: String, anchor: Anchor) -> DrawingShape {
    DrawingShape::Text { at, text, size: TextSize::Small, anchor }
}

/// A text, shortened so that it fits the sheet.
fn shortened(text: &str) -> String {
    cut(text, MOST_CHARACTERS)
}

/// A text of at most so many characters, with an ellipsis where it was longer.
fn cut(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    text.chars().take(most - 3).chain("...".chars()).collect()
}
