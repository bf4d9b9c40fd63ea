//! Arguments of `bench`: what it measures, and the formats of its files.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::{Reading, Running};
use crate::cli::values::{RendererArg, size};

#[derive(Args, Debug)]
pub(crate) struct Bench {
    /// Your own garment in place of ours, for plane-curved, mapping, yarn-length, total and growth:
    /// the flat pattern and the same faces draped, or one file with vt
    #[arg(value_name = "GARMENT", num_args = 0..=2)]
    pub(crate) meshes: Vec<PathBuf>,
    /// What to measure; may be repeated [default: plane-curved, total, st-sr, textures]
    #[arg(long, value_enum, value_name = "NAME")]
    pub(crate) only: Vec<Subject>,
    /// The same as --only weft: plain weft knits from 20 x 20 to 100 x 100 loops, from their motif
    /// to tubes (the ribbon paper's table)
    #[arg(long)]
    pub(crate) weft: bool,
    /// In plane-curved, also run the paper's own algorithm once: it tests every triangle in turn
    /// for each point
    #[arg(long)]
    pub(crate) brute: bool,
    /// The fabric of yarn-length, a built-in one or a file [default: tricot]
    #[arg(long, value_name = "NAME|FILE.toml")]
    pub(crate) fabric: Option<String>,
    /// A file to write, by its ending: .json .csv (all figures) .md .tex (tables) .svg .png (plots); may
    /// be repeated
    #[arg(short, long = "output", value_name = "OUT", value_parser = figures)]
    pub(crate) outputs: Vec<(PathBuf, BenchFormat)>,
    #[command(flatten)]
    pub(crate) reading: Reading,
    /// The renderer of the pictures that are timed
    #[arg(long, value_enum, default_value = "cpu")]
    pub(crate) renderer: RendererArg,
    /// Size of the timed pictures; with a small one three pictures of every row take minutes and not
    /// an hour
    #[arg(long, value_name = "WxH", default_value = "640x480", value_parser = size, allow_hyphen_values = true)]
    pub(crate) size: (u32, u32),
    /// Edges of the tubes' section in weft
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(3..=64), allow_negative_numbers = true)]
    pub(crate) sr: u32,
    /// Timed runs of each, after one run to warm up; pictures have three at most
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = clap::value_parser!(u32).range(1..=1000), allow_negative_numbers = true)]
    pub(crate) runs: u32,
    #[command(flatten)]
    pub(crate) running: Running,
}

/// The subjects that can be measured. The comments are the command's help texts.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Subject {
    /// Table 2: coordinates on the plane fabric and on the curved one
    PlaneCurved,
    /// The ways from the flat fabric to the body: plane, frame, smooth, relaxed
    Mapping,
    /// How much yarn each stitch gains or loses on the body, by mapping
    YarnLength,
    /// Table 3: total with rendering
    Total,
    /// Figure 14: render time over St, Sr and the fabric's size
    StSr,
    /// Figure 15: render time over the size of the yarn's texture
    Textures,
    /// Plain weft knits, the ribbon paper's table
    Weft,
    /// How long garments of 2000 to 2 million triangles take to read
    Reading,
    /// Time and memory from a thousand to 4.4 million stitches and from 2000 to 2 million
    /// triangles: a minute or two, 1 GB
    Growth,
}

/// The formats of a run's files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BenchFormat {
    /// All figures.
    Json,
    /// All figures, for spreadsheets and data frames.
    Csv,
    /// The tables, for a page.
    Markdown,
    /// The tables, for a paper.
    Latex,
    /// Plots as vector graphics, which drawing programs edit.
    Svg,
    /// Plots as pixels.
    Png,
}

impl BenchFormat {
    /// The format of a path by its extension, in upper or lower case.
    pub(crate) fn from_path(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "json" => Some(Self::Json),
            "csv" => Some(Self::Csv),
            "md" => Some(Self::Markdown),
            "tex" => Some(Self::Latex),
            "svg" => Some(Self::Svg),
            "png" => Some(Self::Png),
            _ => None,
        }
    }
}

/// Parses the path of a file of figures.
fn figures(text: &str) -> Result<(PathBuf, BenchFormat), String> {
    let path = PathBuf::from(text);
    let format = BenchFormat::from_path(&path).ok_or(
        "figures can't be written with this ending; known are .json .csv .md .tex .svg .png",
    )?;
    Ok((path, format))
}
