//! Values of `bench`'s flags: subjects, and the formats of its files.

use std::path::{Path, PathBuf};

use clap::ValueEnum;

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
pub(super) fn figures(text: &str) -> Result<(PathBuf, BenchFormat), String> {
    let path = PathBuf::from(text);
    let format = BenchFormat::from_path(&path).ok_or(
        "figures can't be written with this ending; known are .json .csv .md .tex .svg .png",
    )?;
    Ok((path, format))
}
