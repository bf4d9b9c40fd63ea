//! Arguments of pictures: what stands around the cloth, and how it is drawn.

use std::path::PathBuf;

use clap::Args;

use crate::cli::values::{RendererArg, ShapeArg, SwitchArg, finite, samples};

/// Where the cloth of a picture stands.
#[derive(Args, Clone, Debug)]
pub(crate) struct StageArgs {
    /// Stand the cloth in a studio, on a floor that turns up into a wall [default: on for garments
    /// without --background and --environment]
    #[arg(long, value_enum, value_name = "on|off", num_args = 0..=1, default_missing_value = "on")]
    pub(crate) studio: Option<SwitchArg>,
    /// Light the cloth by this picture of everything around (.hdr or .exr, twice as wide as high),
    /// and show it behind, unless there is a --background
    #[arg(long, value_name = "FILE", conflicts_with = "sun")]
    pub(crate) environment: Option<PathBuf>,
    /// Turn the environment around the vertical, degrees, counter-clockwise as seen from above
    #[arg(long, value_name = "DEG", value_parser = finite, default_value_t = 0.0, requires = "environment", allow_negative_numbers = true)]
    pub(crate) environment_turn: f64,
}

/// How pictures are drawn.
#[derive(Args, Debug)]
pub(crate) struct DrawingArgs {
    /// The renderer: auto uses the graphics processor, or the CPU if there is none
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) renderer: RendererArg,
    /// Samples for each pixel
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=4096), allow_negative_numbers = true)]
    pub(crate) spp: u32,
    /// Samples for smooth edges in each pixel on the graphics processor: 1 or 4
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = samples, allow_negative_numbers = true)]
    pub(crate) samples: u32,
    /// Level of detail: draw yarns of few pixels more coarsely
    #[arg(long, value_enum, default_value = "on")]
    pub(crate) lod: SwitchArg,
    /// Draw yarns as tubes, or in pictures as flat ribbons
    #[arg(long, value_enum, default_value = "tube")]
    pub(crate) shape: ShapeArg,
    /// Draw all stitches alike, of even and round yarn, as they are measured [default: pictures show
    /// some unevenness]
    #[arg(long)]
    pub(crate) regular: bool,
    /// Maps of a yarn: a folder with base_color.png and others, or one image; x runs along the yarn
    #[arg(long, value_name = "DIR|IMAGE")]
    pub(crate) texture: Option<PathBuf>,
    /// Write N pictures from all around: NAME-001.png and so on
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=9999), allow_negative_numbers = true)]
    pub(crate) turntable: Option<u32>,
}
