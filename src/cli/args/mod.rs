//! The command line: commands and their flags, with the help texts that people read.

mod bench;
mod photos;

use std::path::{Path, PathBuf};

use clap::error::ErrorKind;
use clap::{Args, CommandFactory as _, FromArgMatches as _, Parser, Subcommand};
use glam::DVec3;
use warpknit::chart;
use warpknit::export::Format;
use warpknit::garment::Unit;
use warpknit::render::Background;
use warpknit::tile::Tile;
use warpknit::yarn::fibres::FIBRE_RADIUS;

use bench::figures;
pub(crate) use bench::{BenchFormat, Subject};
pub(crate) use photos::{Capture, Yarn};

use super::config::{self, Trouble};
#[cfg(feature = "view")]
use super::values::picture;
use super::values::{
    EdgeArg, MappingArg, RendererArg, ShapeArg, SwitchArg, ViewArg, diagram, field_of_view, finite,
    flattening, output, positive, samples, size, vector,
};

/// The fabric where none is named.
pub(crate) const DEFAULT_FABRIC: &str = "tricot";

/// Knits warp-knit fabric, yarn by yarn, onto a garment from a pattern tool.
#[derive(Parser, Debug)]
#[command(version, propagate_version = true, arg_required_else_help = true)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Don't read warpknit.toml of this folder, which may hold other defaults
    #[arg(long, global = true)]
    no_config: bool,
}

impl Arguments {
    /// The arguments of this process; ends it where they are wrong usage.
    ///
    /// # Errors
    /// What is wrong with [`config::FILE`].
    pub(crate) fn of_process() -> anyhow::Result<Self> {
        let words: Vec<_> = std::env::args_os().collect();
        let matches = match config::matches(&Self::command(), Path::new(config::FILE), &words) {
            Ok(matches) => matches,
            Err(Trouble::Usage(error)) => error.exit(),
            Err(Trouble::File(error)) => return Err(error),
        };
        let arguments = Self::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
        arguments.check_chains();
        Ok(arguments)
    }

    /// Ends the process where marks and chains don't fit.
    fn check_chains(&self) {
        let chains = match &self.command {
            Command::Drape(drape) => Some(&drape.shared.chains),
            Command::Swatch(swatch) => Some(&swatch.shared.chains),
            Command::Inspect(inspect) => Some(&inspect.chains),
            #[cfg(feature = "view")]
            Command::View(view) => Some(&view.shared.chains),
            Command::Fabrics(_)
            | Command::Yarn(_)
            | Command::Capture(_)
            | Command::Bench(_)
            | Command::Completions(_)
            | Command::Man(_) => None,
        };
        if let Some(Chains { lapping, threading }) = chains
            && threading.len() > 1
            && threading.len() != lapping.len()
        {
            let message = format!(
                "--threading is given {} times and --lapping {} times: give one for each bar, or one for all",
                threading.len(),
                lapping.len()
            );
            Self::command().error(ErrorKind::WrongNumberOfValues, message).exit();
        }
        if let Command::Inspect(inspect) = &self.command
            && inspect.is_ambiguous()
        {
            let message = "-o draws a fabric's diagram or a garment's sheet: give it with one of them, or inspect both without -o";
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
  warpknit drape pattern.obj 'frames/*.obj' -o dance.png -o dance.usda
  warpknit drape pattern.obj frames/ --skip-bad-frames --fps 30 -o dance.usda")]
    Drape(Drape),
    /// Knit a flat piece of fabric
    #[command(after_help = "Examples:
  warpknit swatch --fabric locknit --view front -o face.png
  warpknit swatch --fabric locknit --view back -o back.png
  warpknit swatch --lapping 3-4/1-0// --lapping 1-0/1-2// -o satin.png")]
    Swatch(Swatch),
    /// Show a garment or a swatch in a window, and knit it again as you choose
    #[cfg(feature = "view")]
    #[command(
        after_help = "Left drag turns, right or middle drag moves, the wheel zooms; 1 to 6 look from the front, back, left, right, top
and a corner, F frames everything. The button saves view-001.png and so on into this folder, as high as --size says.

Examples:
  warpknit view meshes/skirt_flat.obj meshes/skirt_draped.obj
  warpknit view --fabric locknit --wales 8 --courses 9"
    )]
    View(Live),
    /// Say what meshes hold and whether they pair, and what a fabric's lapping is
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
  warpknit fabrics locknit > my.toml && warpknit swatch --fabric my.toml")]
    Fabrics(Fabrics),
    /// Turn a photo of a straight yarn on a plain ground into maps that tile
    #[command(
        after_help = "The folder is for --texture: base_color.png, height.png, normal.png, roughness.png, metallic.png, ao.png and yarn.toml.
sheet.png shows them with the photo and a swatch.

Examples:
  warpknit yarn photo.jpg --yarn-width-mm 0.15 -o my-yarn
  warpknit yarn scan.png --dpi 2400 --crop 200,0,3000,800 -v -o my-yarn
  warpknit swatch --fabric jersey --shape ribbon --texture my-yarn -o swatch.png"
    )]
    Yarn(Yarn),
    /// Turn a photo of a cloth into a fabric of its yarns and fibres
    #[command(
        after_help = "The folder gets cell.png, the mean of all copies of what repeats; grid3x3.png, nine of them with the segments of yarn drawn; texture.png, some cells as the
photo has them, which tile; layout.toml, the cell and its segments, to be changed by hand and given back with --layout; layout.svg, which of them is which; depth.png;
fabric.toml, for --fabric; fibres.usda, the fibres of a cell; preview.png; report.json.

Examples:
  warpknit capture linen.jpg -o linen
  warpknit drape meshes/tshirt.obj --fabric linen/fabric.toml -o shirt.png
  warpknit capture linen.jpg --layout linen/layout.toml -o mine
  warpknit capture twill.png --cell 24,0,0,18 -o twill"
    )]
    Capture(Capture),
    /// Time the work here, beside what the papers published
    #[command(
        after_help = "Times are medians of several runs, with the fastest and the slowest. Published figures are those of the papers' machines; `times` says how many
times as long they are. --brute runs the source paper's own algorithm here, as the fair baseline.

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
    /// Print the manual page, of the program or of a command
    #[command(after_help = "Examples:
  warpknit man | man -l -
  warpknit man drape > ~/.local/share/man/man1/warpknit-drape.1")]
    Man(Man),
}

#[derive(Args, Debug)]
pub(crate) struct Drape {
    /// The flat pattern; or one file whose positions are draped and whose vt is the flat pattern,
    /// or a folder of frames of which the first is such a file
    #[arg(value_name = "FLAT.obj|GARMENT.obj")]
    pub(crate) flat: PathBuf,
    /// The same faces, draped; or the frames of a drape sequence: files, folders of them, or
    /// patterns such as 'frames/*.obj'
    #[arg(value_name = "DRAPED.obj")]
    pub(crate) draped: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: Reading,
    #[command(flatten)]
    pub(crate) laying: Laying,
    #[command(flatten)]
    pub(crate) motion: MotionArgs,
    #[command(flatten)]
    pub(crate) part: Part,
    #[command(flatten)]
    pub(crate) shared: Shared,
}

#[derive(Args, Debug)]
pub(crate) struct Swatch {
    /// Yarns a full bar
    #[arg(long, value_name = "N", default_value_t = 14, value_parser = clap::value_parser!(u32).range(1..=20_000))]
    pub(crate) wales: u32,
    /// Courses
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=20_000))]
    pub(crate) courses: u32,
    #[command(flatten)]
    pub(crate) part: Part,
    #[command(flatten)]
    pub(crate) shared: Shared,
}

/// What `view` takes: a mesh as `drape` does, or the size of a swatch.
#[cfg(feature = "view")]
#[derive(Args, Debug)]
pub(crate) struct Live {
    /// The flat pattern, or one file whose positions are draped and whose vt is the flat pattern
    /// [default: a swatch]
    #[arg(value_name = "FLAT.obj|GARMENT.obj")]
    pub(crate) flat: Option<PathBuf>,
    /// The same faces, draped
    #[arg(value_name = "DRAPED.obj")]
    pub(crate) draped: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: Reading,
    #[command(flatten)]
    pub(crate) laying: Laying,
    /// Yarns a full bar of a swatch
    #[arg(long, value_name = "N", default_value_t = 14, conflicts_with = "flat", value_parser = clap::value_parser!(u32).range(1..=20_000))]
    pub(crate) wales: u32,
    /// Courses of a swatch
    #[arg(long, value_name = "N", default_value_t = 16, conflicts_with = "flat", value_parser = clap::value_parser!(u32).range(1..=20_000))]
    pub(crate) courses: u32,
    /// Write a picture of the window to this file as soon as the cloth is drawn, and close
    #[arg(long, value_name = "OUT.png", value_parser = picture)]
    pub(crate) screenshot: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) shared: Shared,
}

#[derive(Args, Debug)]
pub(crate) struct Inspect {
    /// One garment with vt, or the flat mesh and one or more drapes of it
    #[arg(value_name = "OBJ", required_unless_present_any = ["fabric", "lapping"])]
    pub(crate) meshes: Vec<PathBuf>,
    /// A built-in fabric or a fabric file: its chain as a table, threads on the needles, warnings
    #[arg(long, value_name = "NAME|FILE.toml")]
    pub(crate) fabric: Option<String>,
    #[command(flatten)]
    pub(crate) chains: Chains,
    /// A file by its ending, .svg .png: of meshes a sheet of flat panels and stretch, of more than
    /// one drape OUT-001 and so on; of a fabric its lapping diagram; may be repeated
    #[arg(short, long = "output", value_name = "OUT", value_parser = diagram)]
    pub(crate) outputs: Vec<(PathBuf, chart::ChartFormat)>,
    #[command(flatten)]
    pub(crate) reading: Reading,
}

impl Inspect {
    /// Whether a fabric is asked for.
    pub(crate) fn has_fabric(&self) -> bool {
        self.fabric.is_some() || !self.chains.lapping.is_empty()
    }

    /// Whether files are asked for that could be of the fabric or of the meshes.
    fn is_ambiguous(&self) -> bool {
        self.has_fabric() && !self.meshes.is_empty() && !self.outputs.is_empty()
    }
}

#[derive(Args, Debug)]
pub(crate) struct Fabrics {
    /// The fabric to print: a built-in one as its file is written, or a fabric file as it was
    /// understood
    #[arg(value_name = "NAME|FILE.toml")]
    pub(crate) name: Option<String>,
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

#[derive(Args, Debug)]
pub(crate) struct Bench {
    /// A garment of your own in place of ours: the flat pattern and the same faces draped, or one
    /// file with vt; for plane-curved, total and growth
    #[arg(value_name = "OBJ", num_args = 0..=2)]
    pub(crate) meshes: Vec<PathBuf>,
    /// What to measure; may be repeated [default: plane-curved, total, st-sr, textures]
    #[arg(long, value_enum, value_name = "NAME")]
    pub(crate) only: Vec<Subject>,
    /// Plain weft knits from 20 x 20 to 100 x 100 loops, from their motif to tubes (the ribbon
    /// paper's table): --only weft
    #[arg(long)]
    pub(crate) weft: bool,
    /// Also the paper's own algorithm in plane-curved: every triangle in turn for each point, run
    /// once
    #[arg(long)]
    pub(crate) brute: bool,
    /// A file to write, by its ending: .json (all figures) .svg .png (plots); may be repeated
    #[arg(short, long = "output", value_name = "OUT", value_parser = figures)]
    pub(crate) outputs: Vec<(PathBuf, BenchFormat)>,
    #[command(flatten)]
    pub(crate) reading: Reading,
    /// What draws the pictures that are timed
    #[arg(long, value_enum, default_value = "cpu")]
    pub(crate) renderer: RendererArg,
    /// Edges of the tubes' section in weft
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(3..=64))]
    pub(crate) sr: u32,
    /// Runs of each, after one that warms up; of pictures three at most
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) runs: u32,
    #[command(flatten)]
    pub(crate) running: Running,
}

/// A lapping of one's own.
#[derive(Args, Debug)]
pub(crate) struct Chains {
    /// A bar's chain, such as 1-0/1-2//, or weft; a bar each, front first. They take the place of
    /// the fabric's bars, and take their yarns
    #[arg(long, value_name = "CHAIN")]
    pub(crate) lapping: Vec<String>,
    /// Which guides of a --lapping carry a yarn: I threaded, . empty, repeated across; one for each
    /// --lapping, or one for all [default: I]
    #[arg(long, value_name = "MARKS", requires = "lapping")]
    pub(crate) threading: Vec<String>,
}

/// What of a run's outputs is made.
#[derive(Args, Debug)]
pub(crate) struct Part {
    /// Make the I-th of N parts, for N machines: files hold a part of the yarns, and pictures a
    /// band of rows, which together are the whole
    #[arg(long, value_name = "I/N")]
    pub(crate) tile: Option<Tile>,
}

/// How a drape sequence is taken.
#[derive(Args, Debug)]
pub(crate) struct MotionArgs {
    /// Leave out frames of a drape sequence that can't be read, with a warning, in place of ending
    /// there
    #[arg(long)]
    pub(crate) skip_bad_frames: bool,
    /// Frames a second, for a .usda of a drape sequence
    #[arg(long, value_name = "N", default_value_t = 24.0, value_parser = positive)]
    pub(crate) fps: f64,
}

/// How yarns are laid on a garment.
#[derive(Args, Debug)]
pub(crate) struct Laying {
    /// What happens to yarns at a panel's edge
    #[arg(long, value_enum, default_value = "clip")]
    pub(crate) edge: EdgeArg,
    /// How depth is carried from the flat panel to the draped one
    #[arg(long, value_enum, default_value = "smooth")]
    pub(crate) mapping: MappingArg,
}

/// How meshes are read.
#[derive(Args, Debug)]
pub(crate) struct Reading {
    /// What one unit of the draped mesh is: mm, cm, dm, m or in [default: guessed from its size]
    #[arg(long, value_name = "UNIT")]
    pub(crate) unit: Option<Unit>,
    /// What one unit of the flat mesh is, mm [default: from the areas]
    #[arg(long, value_name = "MM", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) uv_scale: Option<f64>,
    /// Turn the wale direction, counter-clockwise seen from the technical face
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true, value_parser = finite)]
    pub(crate) grain: f64,
    /// Turn the cloth over: technical face inside
    #[arg(long)]
    pub(crate) turn: bool,
}

/// What `drape` and `swatch` share.
#[derive(Args, Debug)]
pub(crate) struct Shared {
    /// A file to write, by its ending: .png .glb .obj .ply .usda .bcc .curves.txt .inp .npz .csv
    /// (data points) .json (report); may be repeated [default: a .png here, named after the drape
    /// or the fabric]
    #[arg(short, long = "output", value_name = "OUT", value_parser = output)]
    pub(crate) outputs: Vec<(PathBuf, Format)>,
    /// A built-in fabric or a fabric file
    #[arg(long, value_name = "NAME|FILE.toml", default_value = DEFAULT_FABRIC)]
    pub(crate) fabric: String,
    #[command(flatten)]
    pub(crate) chains: Chains,
    /// Wales per cm; yarns are drawn in proportion [default: the fabric's, or fewer where a garment
    /// would hold over 12000 stitches]
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) wales_per_cm: Option<f64>,
    /// Courses per cm [default: in proportion to the wales]
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) courses_per_cm: Option<f64>,
    /// Tube segments a stitch [default: 10 in files, 40 in pictures]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=256))]
    pub(crate) st: Option<u32>,
    /// Edges of a tube's section [default: 6 in files, 12 in pictures]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(3..=64))]
    pub(crate) sr: Option<u32>,
    /// Draw yarns with this radius [default: from the yarn's count, as far as the loops leave room]
    #[arg(long, value_name = "MM", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) radius: Option<f64>,
    /// Width over height of the tubes' section in files: over 1 lies flat in the fabric's plane,
    /// its area kept
    #[arg(long, value_name = "K", default_value_t = 1.0, value_parser = flattening)]
    pub(crate) flatten: f64,
    /// Close the tubes' ends
    #[arg(long)]
    pub(crate) caps: bool,
    /// Yarns as their fibres, in files and in pictures [default: in pictures from near, of captured
    /// cloth]
    #[arg(long, value_enum, value_name = "on|off")]
    pub(crate) fibres: Option<SwitchArg>,
    /// Radius of a fibre, mm; thicker ones are fewer
    #[arg(long, value_name = "MM", value_parser = positive, default_value_t = FIBRE_RADIUS)]
    pub(crate) fibre_radius: f64,
    /// Write the yarns' centre lines, as l records, to .obj in place of tubes
    #[arg(long)]
    pub(crate) curves: bool,
    /// Size of the picture
    #[arg(long, value_name = "WxH", default_value = "1600x1200", value_parser = size)]
    pub(crate) size: (u32, u32),
    /// From where to look: a swatch's front is its technical face
    #[arg(long, value_enum, default_value = "front")]
    pub(crate) view: ViewArg,
    /// Stand here instead of at a view, mm (with --look-at; `inspect` prints where a garment lies)
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, requires = "look_at", allow_hyphen_values = true)]
    pub(crate) eye: Option<DVec3>,
    /// Look at this point, mm (with --eye)
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, requires = "eye", allow_hyphen_values = true)]
    pub(crate) look_at: Option<DVec3>,
    /// Vertical field of view
    #[arg(long, value_name = "DEG", default_value_t = 30.0, value_parser = field_of_view)]
    pub(crate) fov: f64,
    /// Magnify the middle of the picture
    #[arg(long, value_name = "K", default_value_t = 1.0, value_parser = positive, allow_negative_numbers = true)]
    pub(crate) zoom: f64,
    /// Colour behind the yarns: #rrggbb, white, black, grey or transparent [default: white]
    #[arg(long, value_name = "COLOR")]
    pub(crate) background: Option<Background>,
    #[command(flatten)]
    pub(crate) drawing: Drawing,
    #[command(flatten)]
    pub(crate) running: Running,
}

/// How a command runs.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Running {
    /// Threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) threads: Option<u32>,
    /// Say nothing but errors and the numbers that were asked for
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// How pictures are drawn.
#[derive(Args, Debug)]
pub(crate) struct Drawing {
    /// What draws: auto takes the graphics processor, or the processor where there is none
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) renderer: RendererArg,
    /// Samples a pixel
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub(crate) spp: u32,
    /// Samples of each pixel's edges on the graphics processor: 1 or 4
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = samples)]
    pub(crate) samples: u32,
    /// Whether yarns of few pixels are drawn more coarsely
    #[arg(long, value_enum, default_value = "on")]
    pub(crate) lod: SwitchArg,
    /// Draw yarns as tubes, or in pictures as flat ribbons
    #[arg(long, value_enum, default_value = "tube")]
    pub(crate) shape: ShapeArg,
    /// A yarn's pictures: a folder with base_color.png and others, or one image; x runs along the
    /// yarn
    #[arg(long, value_name = "DIR|IMAGE")]
    pub(crate) texture: Option<PathBuf>,
    /// Write N pictures from all around, NAME-001.png and so on
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=9999))]
    pub(crate) turntable: Option<u32>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_holds_together() {
        Arguments::command().debug_assert();
    }
}
