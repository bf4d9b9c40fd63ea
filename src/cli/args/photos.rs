//! Arguments of `yarn` and `capture`: a photo, and how to read it.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use warpknit::photo::capture::THICKNESS;

use super::Running;
use crate::cli::values::{brightness, contrast, positive, rectangle, two_vectors};

#[derive(Args, Debug)]
pub(crate) struct YarnArgs {
    /// A photo, .png or .jpg: one straight yarn on a plain ground, with ground on both sides
    #[arg(value_name = "PHOTO")]
    pub(crate) photo: PathBuf,
    /// The folder for the maps
    #[arg(short, long = "output", value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Use only this rectangle of the photo, pixels
    #[arg(long, value_name = "X,Y,W,H", value_parser = rectangle, allow_hyphen_values = true)]
    pub(crate) crop: Option<[u32; 4]>,
    /// Add this share of white, -1 to 1, instead of stretching the greys; the colours change too
    #[arg(long, value_name = "B", value_parser = brightness, allow_negative_numbers = true)]
    pub(crate) brightness: Option<f32>,
    /// Multiply the distance from middle grey by this, 0.1 to 10, instead of stretching the greys;
    /// the colours change too
    #[arg(long, value_name = "K", value_parser = contrast, allow_negative_numbers = true)]
    pub(crate) contrast: Option<f32>,
    /// The grey that separates yarn from ground, 1 to 254, after the levels [default: by Otsu's
    /// method]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u8).range(1..=254), allow_negative_numbers = true)]
    pub(crate) threshold: Option<u8>,
    /// Pixels per inch, for example of a scanner
    #[arg(long, value_name = "DPI", value_parser = positive, allow_negative_numbers = true, conflicts_with = "yarn_width_mm")]
    pub(crate) dpi: Option<f64>,
    /// Width of the yarn without its fuzz, mm; the size of a pixel follows from it
    #[arg(long, value_name = "MM", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) yarn_width_mm: Option<f64>,
    /// Print the decision of each step
    #[arg(short, long)]
    pub(crate) verbose: bool,
    #[command(flatten)]
    pub(crate) running: Running,
}

/// What a cloth in a photo is taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum CaptureAs {
    /// A warp knit or a weft knit: chains or a chart
    Knit,
    /// A warp knit: chains
    Warp,
    /// Woven or other cloth: strands, by segments that are seen
    #[value(alias = "weave")]
    Free,
}

#[derive(Args, Debug)]
pub(crate) struct Capture {
    /// A photo, .png or .jpg: the cloth fills it, is sharp and evenly lit, and its pattern repeats
    /// at least four times each way; of a warp knit, its technical back
    #[arg(value_name = "IMAGE")]
    pub(crate) photo: PathBuf,
    /// The folder for the cell, its layout and the fabric
    #[arg(short, long = "output", value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// A photo of the technical face of the same knit
    #[arg(long, value_name = "IMAGE", conflicts_with_all = ["cell", "layout"])]
    pub(crate) front: Option<PathBuf>,
    /// What the cloth is [default: whatever explains the photo best]
    #[arg(long, value_name = "KIND", value_enum)]
    pub(crate) structure: Option<CaptureAs>,
    /// The chain of a full bar of the knit, once a bar, front first: only its densities, yarns and
    /// colours are looked for
    #[arg(long, value_name = "CHAIN", conflicts_with_all = ["cell", "layout"])]
    pub(crate) lapping: Vec<String>,
    /// Write the best guess even if it leaves over 40 % unexplained, or if the repeat is too small
    /// to see yarns in
    #[arg(long)]
    pub(crate) anyway: bool,
    /// Both vectors of the repeating cell, pixels, y down, instead of finding them
    #[arg(long, value_name = "AX,AY,BX,BY", value_parser = two_vectors, allow_hyphen_values = true, conflicts_with = "layout")]
    pub(crate) cell: Option<[f64; 4]>,
    /// Thickness of the cloth, mm: the scale of its depth
    #[arg(long, value_name = "MM", value_parser = positive, allow_negative_numbers = true, default_value_t = THICKNESS)]
    pub(crate) thickness: f64,
    /// Pixels of the photo per mm [default: so many that a yarn is half as wide as the cloth is
    /// thick]
    #[arg(long, value_name = "N", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) pixels_per_mm: Option<f64>,
    /// Pixels of the photo per inch, for example of a scanner
    #[arg(long, value_name = "DPI", value_parser = positive, allow_negative_numbers = true, conflicts_with_all = ["pixels_per_mm", "width_mm"])]
    pub(crate) dpi: Option<f64>,
    /// How many mm of cloth the photo shows from left to right
    #[arg(long, value_name = "MM", value_parser = positive, allow_negative_numbers = true, conflicts_with = "pixels_per_mm")]
    pub(crate) width_mm: Option<f64>,
    /// A layout.toml, perhaps changed by hand: use its cell and segments instead of finding them
    #[arg(long, value_name = "FILE")]
    pub(crate) layout: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) running: Running,
}
