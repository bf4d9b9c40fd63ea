//! Diagrams of fabrics: the bars of a warp knit on point paper, as textbooks draw them, the loops
//! of a weft knit as a chart, and laid cloth in plan. And sheets of garments.
//!
//! In: a [`Fabric`], or a [`Garment`]. Out: a [`Drawing`], a list of shapes that [`svg`] writes as
//! text and [`png`] paints. Of a fabric a row of dots is a course, the first at the bottom; of a
//! warp knit a dot is a needle; gaps are numbered below from the drive. Seen from the technical
//! back, each bar's path goes over the dots that it laps and between the rows where it lies under
//! them. One yarn a bar is drawn, that of its first threaded guide; where two bars or fewer leave
//! room, its neighbours too, lightly.
//!
//! Not promised: that a very large fabric is drawn whole ([`Drawing::notes`] says what is left
//! out).

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

pub use path::Piece;
use warpknit_core::fabric::yarn::Color;
use warpknit_core::fabric::{Fabric, Structure};
use warpknit_core::garment::Garment;

const INK: Color = Color([0x22, 0x26, 0x2b]);
const FAINT: Color = Color([0x6b, 0x72, 0x7a]);
const HAIR: Color = Color([0xd5, 0xd9, 0xde]);
/// Around a sheet, and for the words above its drawing, px.
const MARGIN: f64 = 24.0;
const HEADING: f64 = 58.0;
/// The most characters of a text.
const MOST_CHARACTERS: usize = 100;

/// What can be drawn, in px of the sheet, y down.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A line along pieces.
    Path {
        /// What it passes.
        pieces: Vec<Piece>,
        /// How wide it is drawn.
        width: f64,
    },
    /// What a line around pieces encloses, filled; each of its loops inside another one is a hole.
    Area {
        /// What the line passes.
        pieces: Vec<Piece>,
    },
    /// Pixels, two to a px.
    Picture {
        /// Its upper left corner.
        at: DVec2,
        /// What it shows.
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
        /// Where its baseline begins, is centred, or ends.
        at: DVec2,
        /// What it says.
        text: String,
        /// How large it is.
        size: TextSize,
        /// What of it stands at `at`.
        anchor: Anchor,
    },
    /// What the layer's lines are, told where a pointer rests within them. A PNG has no place for
    /// it.
    Title {
        /// One line.
        text: String,
    },
}

/// Sizes of text: those that the PNG's font comes in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextSize {
    /// Axis numbers and notes.
    Small,
    /// The legend.
    Normal,
    /// The fabric's name, bold.
    Title,
}

/// Which part of a text stands at its place.
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
pub struct Layer {
    /// What it is: `needles`, `bar-1` …; unique in a drawing.
    pub name: String,
    /// Colour of lines, areas, dots and text.
    pub color: Color,
    /// What is drawn, first below.
    pub shapes: Vec<Shape>,
}

/// A picture as shapes.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// Width and height, px.
    pub size: DVec2,
    /// First below.
    pub layers: Vec<Layer>,
    /// What is left out because the fabric is too large for a sheet, a line each.
    pub notes: Vec<String>,
}

/// The formats of a diagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Text that drawing programs edit.
    Svg,
    /// Pixels.
    Png,
}

impl Format {
    /// The format of a path, by its ending in any case.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "svg" => Some(Self::Svg),
            "png" => Some(Self::Png),
            _ => None,
        }
    }

    /// The ending that asks for it.
    #[must_use]
    pub fn ending(self) -> &'static str {
        match self {
            Self::Svg => ".svg",
            Self::Png => ".png",
        }
    }
}

impl Drawing {
    /// The lapping diagram of a warp knit, the chart of a weft knit, the plan of laid cloth. Cost:
    /// at most some thousand shapes, whatever the fabric.
    ///
    /// ```
    /// use warpknit::{chart::Drawing, fabric::Fabric};
    /// let drawing = Drawing::of(&Fabric::named("locknit").unwrap());
    /// assert!(drawing.layers.iter().any(|layer| layer.name == "bar-2") && drawing.notes.is_empty());
    /// ```
    #[must_use]
    pub fn of(fabric: &Fabric) -> Self {
        match &fabric.structure {
            Structure::Warp(knit) => lapping::draw(fabric, knit),
            Structure::Weft(knit) => motif::draw(fabric, &knit.motif),
            Structure::Laid(cloth) => laid::draw(fabric, cloth),
        }
    }

    /// The sheet of a garment: its flat panels with their grain at the left, at the right how it is
    /// stretched when draped. `title` says which garment it is. Cost: the maps have a fixed number
    /// of pixels, so only the outlines grow with the panels' edges.
    ///
    /// ```
    /// use warpknit::{chart::Drawing, garment::Garment};
    /// let drawing = Drawing::of_garment("square.obj", &Garment::rectangle(50.0, 50.0));
    /// assert!(drawing.layers.iter().any(|layer| layer.name == "panel-0"));
    /// ```
    #[must_use]
    pub fn of_garment(title: &str, garment: &Garment) -> Self {
        garment::draw(title, garment)
    }
}

fn label(at: DVec2, text: String, anchor: Anchor) -> Shape {
    Shape::Text { at, text, size: TextSize::Small, anchor }
}

/// A text that fits the sheet.
fn shortened(text: &str) -> String {
    cut(text, MOST_CHARACTERS)
}

fn cut(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    text.chars().take(most - 3).chain("...".chars()).collect()
}
