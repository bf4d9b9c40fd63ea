//! Arguments of the cloth: its chains, how a garment is read, and how yarns are laid on it.

use clap::Args;
use warpknit::fabric::yarn::Count;
use warpknit::garment::Unit;
use warpknit::pipeline::Enlarge;

use crate::cli::values::{
    EdgeArg, MappingArg, RunIn, SwitchArg, enlarge, finite, positive, run_in,
};

/// A lapping, yarns and run-ins of one's own.
#[derive(Args, Debug)]
pub(crate) struct Chains {
    /// A bar's chain, such as 1-0/1-2//, or weft; one for each bar, front first, or
    /// several in one with ' + ' between. These bars replace the fabric's bars and use their yarns
    #[arg(long, value_name = "CHAIN")]
    pub(crate) lapping: Vec<String>,
    /// Which guides of a --lapping carry a yarn: I threaded, . empty, repeated across the bar; one
    /// for each chain, or one for all [default: I]
    #[arg(long, value_name = "MARKS", requires = "lapping")]
    pub(crate) threading: Vec<String>,
    /// Yarn count, such as "78 dtex" or "40 den", in place of the fabric's; one for each bar,
    /// front first, the last for all further bars. Densities follow the thickest yarn, unless they
    /// are given
    #[arg(long, value_name = "COUNT")]
    pub(crate) count: Vec<Count>,
    /// Yarn that a bar is fed, mm a rack of 480 courses; one for each bar, front first; - leaves a
    /// bar's as it is
    #[arg(long, value_name = "MM", value_parser = run_in, allow_negative_numbers = true)]
    pub(crate) run_in: Vec<RunIn>,
}

impl Chains {
    /// Whether any of its flags is given.
    pub(crate) fn is_given(&self) -> bool {
        let Self { lapping, threading: _, count, run_in } = self;
        !(lapping.is_empty() && count.is_empty() && run_in.is_empty())
    }
}

/// How meshes are read.
#[derive(Args, Debug)]
pub(crate) struct Reading {
    /// Length of one unit of the draped mesh: mm, cm, dm, m or in [default: guessed from its size]
    #[arg(long, value_name = "UNIT")]
    pub(crate) unit: Option<Unit>,
    /// Length of one unit of the flat mesh, mm [default: from the areas]
    #[arg(long, value_name = "MM", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) uv_scale: Option<f64>,
    /// Turn the wale direction, counter-clockwise seen from the technical face
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true, value_parser = finite)]
    pub(crate) grain: f64,
    /// Turn the cloth over: technical face inside
    #[arg(long)]
    pub(crate) turn: bool,
    /// Knit a garment although over 10 % of its draped area can't take stitches
    #[arg(long)]
    pub(crate) allow_loss: bool,
}

/// How yarns are laid on a garment.
#[derive(Args, Debug)]
pub(crate) struct Laying {
    /// Draw stitches K times larger than true, and K² times fewer; 1 is true gauge, and auto leaves
    /// about 12000 stitches [default: 1 in a picture; auto in other files, turntables, sequences and
    /// `view`]
    #[arg(long, value_name = "K|auto", value_parser = enlarge, allow_negative_numbers = true, conflicts_with_all = ["wales_per_cm", "courses_per_cm"])]
    pub(crate) enlarge: Option<Enlarge>,
    /// What happens to yarns at a panel's edge
    #[arg(long, value_enum, default_value = "clip")]
    pub(crate) edge: EdgeArg,
    /// How yarns are mapped from the flat panel to the draped one
    #[arg(long, value_enum, default_value = "relaxed")]
    pub(crate) mapping: MappingArg,
    /// Move yarns apart that cut each other on the body [default: up to a million stitches, with
    /// the mapping `relaxed`; not in a picture that shows true gauge unasked]
    #[arg(long, value_enum, value_name = "on|off")]
    pub(crate) sweeps: Option<SwitchArg>,
    /// Don't keep strained repeats for the next run, nor use those that are kept
    #[arg(long)]
    pub(crate) no_cache: bool,
}
