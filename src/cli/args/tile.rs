//! Arguments of `tile`: a fabric, and how finely its maps are drawn.

use std::path::PathBuf;

use clap::Args;

use super::{Chains, DEFAULT_FABRIC, Running};
use crate::cli::values::positive;

#[derive(Args, Debug)]
pub(crate) struct TileArgs {
    /// A built-in fabric or a fabric file, such as that of a captured cloth
    #[arg(long, value_name = "NAME|FILE.toml", default_value = DEFAULT_FABRIC)]
    pub(crate) fabric: String,
    /// The folder for the maps and the materials
    #[arg(short, long = "output", value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Pixels per inch; a repeat gets a whole number of pixels, so the true figure may differ a
    /// little
    #[arg(long, value_name = "DPI", default_value_t = 600.0, value_parser = positive, allow_negative_numbers = true)]
    pub(crate) dpi: f64,
    /// Wales per cm [default: the fabric's]
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) wales_per_cm: Option<f64>,
    /// Courses per cm [default: in proportion to the wales]
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) courses_per_cm: Option<f64>,
    #[command(flatten)]
    pub(crate) chains: Chains,
    #[command(flatten)]
    pub(crate) running: Running,
}
