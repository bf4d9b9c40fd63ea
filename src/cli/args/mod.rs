//! The command line: commands and their flags.
//!
//! The doc comments of commands and flags are the help texts of the program.

mod bench;
mod cloth;
mod photos;
mod pictures;
mod shared;
mod tile;

use std::path::{Path, PathBuf};

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Args, CommandFactory as _, FromArgMatches as _, Parser, Subcommand};
use warpknit::fabric;
use warpknit::pipeline::{LoupeChoice, Stretch};
use warpknit::tile::Tile;

pub(crate) use bench::{Bench, BenchFormat, Subject};
pub(crate) use cloth::{Chains, Laying, Reading};
pub(crate) use photos::{Capture, CaptureAs, YarnArgs};
pub(crate) use pictures::{DrawingArgs, StageArgs};
pub(crate) use shared::Shared;
pub(crate) use tile::TileArgs;

use super::config::{self, Trouble};
#[cfg(feature = "view")]
use super::values::picture;
use super::values::{EdgesArg, FactsFormat, diagram, loupe, positive, stretch};

/// The fabric, unless one is named.
pub(crate) const DEFAULT_FABRIC: &str = "tricot";

/// Says where cloth is pulled, if someone asks it of another command than `swatch`.
fn with_hint(mut error: clap::Error) -> clap::Error {
    const HINT: &str = "the draped mesh says how far a garment is stretched; `warpknit swatch \
                        --stretch` pulls flat cloth";
    let asked = ContextValue::String("--stretch".to_owned());
    if error.get(ContextKind::InvalidArg) == Some(&asked) {
        // Both speak of `--sr`, whose name is like it.
        error.remove(ContextKind::SuggestedArg);
        error.remove(ContextKind::Usage);
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![HINT.into()]));
    }
    error
}

/// Knits warp-knit fabric, yarn by yarn, onto a garment from a pattern tool.
#[derive(Parser, Debug)]
#[command(version, propagate_version = true, arg_required_else_help = true)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Don't read defaults from warpknit.toml in this folder
    #[arg(long, global = true)]
    no_config: bool,
}

impl Arguments {
    /// Parses the arguments of this process. Wrong usage ends the process with status 2.
    ///
    /// # Errors
    /// A fault in [`config::FILE`].
    pub(crate) fn from_process() -> anyhow::Result<Self> {
        let words: Vec<_> = std::env::args_os().collect();
        let matches = match config::matches(&Self::command(), Path::new(config::FILE), &words) {
            Ok(matches) => matches,
            Err(Trouble::Usage(error)) => with_hint(error).exit(),
            Err(Trouble::File(error)) => return Err(error),
        };
        let arguments = Self::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
        arguments.check_chains();
        Ok(arguments)
    }

    /// Ends the process if flags contradict each other in a way that clap can't express.
    fn check_chains(&self) {
        let chains = match &self.command {
            Command::Drape(drape) => Some(&drape.shared.chains),
            Command::Swatch(swatch) => Some(&swatch.shared.chains),
            Command::Inspect(inspect) => Some(&inspect.chains),
            #[cfg(feature = "view")]
            Command::View(view) => Some(&view.shared.chains),
            Command::Fabrics(fabrics) => Some(&fabrics.chains),
            Command::Tile(maps) => Some(&maps.chains),
            Command::Yarn(_)
            | Command::Capture(_)
            | Command::Bench(_)
            | Command::Completions(_)
            | Command::Man(_) => None,
        };
        if let Some(Chains { lapping, threading, .. }) = chains
            && threading.len() > 1
            && threading.len() != fabric::chains(lapping).count()
        {
            let chains = match fabric::chains(lapping).count() {
                1 => "one chain".to_owned(),
                count => format!("{count} chains"),
            };
            let message = format!(
                "--threading is given {} times for {chains}: give one for each bar, or one for all",
                threading.len()
            );
            Self::command().error(ErrorKind::WrongNumberOfValues, message).exit();
        }
        if let Command::Inspect(inspect) = &self.command
            && inspect.is_ambiguous()
        {
            let message = "-o draws a fabric's diagram or a garment's sheet: give it with one of \
                           them, or inspect both without -o";
            Self::command().error(ErrorKind::ArgumentConflict, message).exit();
        }
    }
}

#[derive(Subcommand, Debug)]
pub(crate) enum Command {
    /// Knit a fabric onto a garment
    #[command(after_help = "Examples:
  warpknit drape meshes/skirt_flat.obj meshes/skirt_draped.obj -o skirt.png -o skirt.glb
  warpknit drape meshes/tshirt.obj --fabric locknit --view iso -o tshirt.png -o tshirt.json
  warpknit drape meshes/tshirt.obj --loupe 0.35,0.4 -o shoulder.png
  warpknit drape meshes/tshirt.obj --enlarge auto -o large-loops.png
  warpknit drape pattern.obj 'frames/*.obj' -o dance.png -o dance.usda
  warpknit drape pattern.obj frames/ --skip-bad-frames --fps 30 -o dance.usda")]
    Drape(Drape),
    /// Knit a flat piece of fabric
    #[command(after_help = "Examples:
  warpknit swatch --fabric locknit --view front -o face.png
  warpknit swatch --fabric locknit --view back -o back.png
  warpknit swatch --lapping 3-4/1-0// --lapping 1-0/1-2// -o satin.png
  warpknit swatch --fabric locknit --count '78 dtex' -o heavy.png
  warpknit swatch --fabric locknit --run-in 1714 --run-in 1360 -o tight.png
  warpknit swatch --fabric locknit --stretch 1.2,free -o pulled.png")]
    Swatch(Swatch),
    /// Show a garment or a swatch in a window, and knit it again as you choose
    #[cfg(feature = "view")]
    #[command(
        after_help = "Left drag turns, right or middle drag moves, the wheel zooms. Keys 1 to 6 look from the front, back, left, right, top
and a corner; F shows everything. The button saves view-001.png and so on in this folder, as high as --size says.

Examples:
  warpknit view meshes/skirt_flat.obj meshes/skirt_draped.obj
  warpknit view --fabric locknit --wales 8 --courses 9"
    )]
    View(Live),
    /// Check meshes and whether they match, and show a fabric's lapping
    #[command(after_help = "Examples:
  warpknit inspect --fabric locknit -o lapping.svg -o lapping.png
  warpknit inspect --lapping 3-4/1-0// --lapping 1-0/1-2//
  warpknit inspect meshes/tshirt.obj -o tshirt.png
  warpknit inspect meshes/skirt_flat.obj meshes/skirt_draped.obj -o skirt.svg
  warpknit inspect FLAT.obj FRAME_1.obj FRAME_2.obj -o frame.png")]
    Inspect(Inspect),
    /// List the built-in fabrics, or print one as TOML
    #[command(after_help = "Examples:
  warpknit fabrics
  warpknit fabrics locknit > my.toml && warpknit swatch --fabric my.toml
  warpknit fabrics locknit --count '78 dtex' > thick.toml
  warpknit fabrics --lapping 3-4/1-0// --lapping 1-0/1-2// > satin.toml")]
    Fabrics(Fabrics),
    /// Turn one repeat of a fabric into maps that tile, for fashion and rendering tools
    #[command(after_help = "Files in the folder, NAME being the fabric's:
  textures/     front_ and back_ base_color, normal, height, alpha, roughness, metallic,
                occlusion and sheen, as PNG of the true size
  NAME.u3m      Unified 3D Material, for Browzwear and other fashion tools
  NAME.u3ma     the same in one file
  NAME.mtlx     MaterialX with OpenPBR surfaces
  NAME.glb      glTF: a plane with a material on each side
  NAME.usda     USD preview materials on such a plane
  preview.png   face and back in the light of warpknit's pictures
  report.json   sizes in mm and pixels, g/m², thickness, cover

Examples:
  warpknit tile --fabric locknit -o locknit
  warpknit tile --fabric hex-net-5 --dpi 1200 -o net
  warpknit tile --lapping 3-4/1-0// --lapping 1-0/1-2// -o satin
  warpknit tile --fabric linen/fabric.toml -o linen-maps")]
    Tile(TileArgs),
    /// Turn a photo of a straight yarn on a plain ground into maps that tile
    #[command(
        after_help = "The folder is for --texture: base_color.png, height.png, normal.png, roughness.png, metallic.png, ao.png and yarn.toml.
sheet.png shows them with the photo and a swatch.

Examples:
  warpknit yarn photo.jpg --yarn-width-mm 0.15 -o my-yarn
  warpknit yarn scan.png --dpi 2400 --crop 200,0,3000,800 -v -o my-yarn
  warpknit swatch --fabric jersey --shape ribbon --texture my-yarn -o swatch.png"
    )]
    Yarn(YarnArgs),
    /// Turn a photo of a cloth into a fabric of its yarns and fibres
    #[command(after_help = "Files in the folder:
  cell.png      the repeating cell, as the mean of all its copies
  grid3x3.png   nine cells with the segments of yarn drawn
  texture.png   some cells cut from the photo; they tile
  layout.toml   the cell and its segments, to change by hand and give back with --layout
  layout.svg    the segments with their numbers
  depth.png     the height of the yarns
  fabric.toml   the fabric, for --fabric
  fibres.usda   the fibres of a cell
  preview.png   a picture of the draped cloth
  report.json   all numbers

A knit that is recognised has only fabric.toml, with its chains or its chart, preview.png,
report.json, and back.png (and front.png): the photo's mean repeat and, beside it, the drawn one.

Examples:
  warpknit capture linen.jpg -o linen
  warpknit capture back.jpg --front face.jpg --dpi 600 -o knit
  warpknit drape meshes/tshirt.obj --fabric linen/fabric.toml -o shirt.png
  warpknit capture linen.jpg --layout linen/layout.toml -o mine
  warpknit capture twill.png --cell 24,0,0,18 -o twill")]
    Capture(Capture),
    /// Time the work on this machine, beside the papers' published times
    #[command(
        after_help = "Times are medians of several runs, with the fastest and the slowest. Published times come from the papers' machines; `times` is the
published time divided by the CPU time here. --brute runs the source paper's own algorithm on this machine, as a fair baseline.

Examples:
  warpknit bench
  warpknit bench --only plane-curved --brute --threads 1
  warpknit bench -o bench.json -o bench.svg
  warpknit bench FLAT.obj DRAPED.obj --unit cm
  warpknit bench --only growth -o growth.png
  warpknit bench --weft --threads 1 --runs 21"
    )]
    Bench(Bench),
    /// Print a shell's completion script
    #[command(after_help = "Examples:
  warpknit completions bash > ~/.local/share/bash-completion/completions/warpknit
  warpknit completions zsh > ~/.zfunc/_warpknit
  warpknit completions fish > ~/.config/fish/completions/warpknit.fish")]
    Completions(Completions),
    /// Print the manual page of the program or of a command
    #[command(after_help = "Examples:
  warpknit man | man -l -
  warpknit man drape > ~/.local/share/man/man1/warpknit-drape.1")]
    Man(Man),
}

#[derive(Args, Debug)]
pub(crate) struct Drape {
    /// The flat pattern; or one file whose positions are draped and whose vt is the flat pattern;
    /// or a folder of frames whose first file is such a file
    #[arg(value_name = "FLAT|GARMENT")]
    pub(crate) flat: PathBuf,
    /// The same faces, draped; or the frames of a drape sequence: files, folders of them, or
    /// patterns such as 'frames/*.obj'
    #[arg(value_name = "DRAPED")]
    pub(crate) draped: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: Reading,
    #[command(flatten)]
    pub(crate) laying: Laying,
    #[command(flatten)]
    pub(crate) motion: MotionArgs,
    #[command(flatten)]
    pub(crate) part: PartArgs,
    #[command(flatten)]
    pub(crate) stage: StageArgs,
    /// The body in the cloth, a mesh in the draped axes: it hides yarns and casts shadows. A pattern
    /// or a folder gives each frame of a sequence its own
    #[arg(long, value_name = "MESH", conflicts_with = "body_cloth")]
    pub(crate) body: Option<PathBuf>,
    /// Line the cloth with an opaque surface, made from the garment itself, in place of a body
    #[arg(long)]
    pub(crate) body_cloth: bool,
    /// How the garment's edges are finished in pictures [default: hemmed in a picture at true gauge;
    /// else raw]
    #[arg(long, value_enum, value_name = "hemmed|raw")]
    pub(crate) edges: Option<EdgesArg>,
    /// Magnify the place X,Y of the picture in a round inset until loops can be seen; 0,0 is the top
    /// left corner and 1,1 the bottom right one. Turntables and sequences have none [default: cloth
    /// near the middle, where stitches are under 4 pixels wide]
    #[arg(long, value_name = "X,Y|off", value_parser = loupe, allow_hyphen_values = true)]
    pub(crate) loupe: Option<LoupeChoice>,
    #[command(flatten)]
    pub(crate) shared: Shared,
}

#[derive(Args, Debug)]
pub(crate) struct Swatch {
    /// Yarns a full bar
    #[arg(long, value_name = "N", default_value_t = 14, value_parser = clap::value_parser!(u32).range(1..=20_000), allow_negative_numbers = true)]
    pub(crate) wales: u32,
    /// Courses
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=20_000), allow_negative_numbers = true)]
    pub(crate) courses: u32,
    /// Pull the cloth to X times its length along the courses (across the wales) and Y times along
    /// the wales, each 0.5 to 2; `free` for Y is the length that it takes by itself, with a table of
    /// it over the pull, for X of 1 to 1.25 [default for Y: 1]
    #[arg(long, value_name = "X[,Y|free]", value_parser = stretch, allow_hyphen_values = true)]
    pub(crate) stretch: Option<Stretch>,
    #[command(flatten)]
    pub(crate) part: PartArgs,
    #[command(flatten)]
    pub(crate) stage: StageArgs,
    #[command(flatten)]
    pub(crate) shared: Shared,
}

/// What `view` takes: a mesh as `drape` does, or the size of a swatch.
#[cfg(feature = "view")]
#[derive(Args, Debug)]
pub(crate) struct Live {
    /// The flat pattern, or one file whose positions are draped and whose vt is the flat pattern
    /// [default: a swatch]
    #[arg(value_name = "FLAT|GARMENT")]
    pub(crate) flat: Option<PathBuf>,
    /// The same faces, draped
    #[arg(value_name = "DRAPED")]
    pub(crate) draped: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: Reading,
    #[command(flatten)]
    pub(crate) laying: Laying,
    /// Yarns a full bar of a swatch
    #[arg(long, value_name = "N", default_value_t = 14, conflicts_with = "flat", value_parser = clap::value_parser!(u32).range(1..=20_000), allow_negative_numbers = true)]
    pub(crate) wales: u32,
    /// Courses of a swatch
    #[arg(long, value_name = "N", default_value_t = 16, conflicts_with = "flat", value_parser = clap::value_parser!(u32).range(1..=20_000), allow_negative_numbers = true)]
    pub(crate) courses: u32,
    /// How the garment's edges are finished [default: hemmed at true gauge; else raw]
    #[arg(long, value_enum, value_name = "hemmed|raw", requires = "flat")]
    pub(crate) edges: Option<EdgesArg>,
    /// Write a picture of the window to this file as soon as the cloth is drawn, and close
    #[arg(long, value_name = "OUT.png", value_parser = picture)]
    pub(crate) screenshot: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) shared: Shared,
}

#[derive(Args, Debug)]
pub(crate) struct Inspect {
    /// One garment with vt, or the flat mesh and one or more drapes of it
    #[arg(value_name = "GARMENT", required_unless_present_any = ["fabric", "lapping", "count", "run_in"])]
    pub(crate) meshes: Vec<PathBuf>,
    /// A built-in fabric or a fabric file: its chain as a table, threads on the needles, warnings
    #[arg(long, value_name = "NAME|FILE.toml")]
    pub(crate) fabric: Option<String>,
    #[command(flatten)]
    pub(crate) chains: Chains,
    /// A file to write, by its ending: .svg .png; for meshes a sheet of flat panels and stretch
    /// (OUT-001 and so on for several drapes), for a fabric its lapping diagram; .json for the facts
    /// of meshes; may be repeated
    #[arg(short, long = "output", value_name = "OUT", value_parser = diagram)]
    pub(crate) outputs: Vec<(PathBuf, FactsFormat)>,
    #[command(flatten)]
    pub(crate) reading: Reading,
}

impl Inspect {
    /// Whether a fabric is to be shown.
    pub(crate) fn has_fabric(&self) -> bool {
        self.fabric.is_some() || self.chains.is_given()
    }

    /// Whether an output could be meant for the fabric or for the meshes.
    fn is_ambiguous(&self) -> bool {
        self.has_fabric() && !self.meshes.is_empty() && !self.outputs.is_empty()
    }
}

#[derive(Args, Debug)]
pub(crate) struct Fabrics {
    /// The fabric to print: the file of a built-in one, or a fabric file as the program
    /// understands it
    #[arg(value_name = "NAME|FILE.toml")]
    pub(crate) name: Option<String>,
    #[command(flatten)]
    pub(crate) chains: Chains,
}

#[derive(Args, Debug)]
pub(crate) struct Completions {
    /// The shell
    pub(crate) shell: clap_complete::Shell,
}

#[derive(Args, Debug)]
pub(crate) struct Man {
    /// The command [default: the program as a whole]
    pub(crate) command: Option<String>,
}

/// The part of a run's outputs that is made.
#[derive(Args, Debug)]
pub(crate) struct PartArgs {
    /// Make the I-th of N parts, for N machines: files get a part of the yarns, and pictures a
    /// band of rows; together the parts are the whole
    #[arg(long, value_name = "I/N", allow_hyphen_values = true)]
    pub(crate) tile: Option<Tile>,
}

/// How a drape sequence is read and written.
#[derive(Args, Debug)]
pub(crate) struct MotionArgs {
    /// Leave out frames of a drape sequence that can't be read, with a warning, instead of failing
    #[arg(long)]
    pub(crate) skip_bad_frames: bool,
    /// Frames a second, for a .usda or .usdc of a drape sequence
    #[arg(long, value_name = "N", default_value_t = 24.0, value_parser = positive, allow_negative_numbers = true)]
    pub(crate) fps: f64,
}

/// How a command runs.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Running {
    /// Threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024), allow_negative_numbers = true)]
    pub(crate) threads: Option<u32>,
    /// Print only errors and the requested numbers
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names of values that are numbers.
    const NUMBERS: [&str; 17] = [
        "N",
        "X",
        "MM",
        "DEG",
        "DPI",
        "K",
        "T",
        "B",
        "X[,Y|free]",
        "WxH",
        "K|auto",
        "X,Y|off",
        "I/N",
        "X,Y,Z",
        "AZ,EL",
        "X,Y,W,H",
        "AX,AY,BX,BY",
    ];

    #[test]
    fn the_definition_holds_together() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn flags_of_numbers_allow_a_minus() {
        let command = Arguments::command();
        for subcommand in command.get_subcommands().chain([&command]) {
            for flag in subcommand.get_arguments().filter(|flag| flag.get_long().is_some()) {
                let names = flag.get_value_names().unwrap_or_default();
                let takes_numbers = flag.get_action().takes_values()
                    && names.iter().any(|name| NUMBERS.contains(&name.as_str()));
                let takes_minus =
                    flag.is_allow_negative_numbers_set() || flag.is_allow_hyphen_values_set();
                assert!(takes_minus || !takes_numbers, "{} {flag}", subcommand.get_name());
            }
        }
    }
}
