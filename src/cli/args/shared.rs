//! Arguments of a run that makes cloth: its files, its yarns and its camera.

use std::path::PathBuf;

use clap::Args;
use glam::DVec3;
use warpknit::export::Format;
use warpknit::render::Background;
use warpknit::yarn::fibres::FIBRE_RADIUS;

use super::{Chains, DEFAULT_FABRIC, DrawingArgs, Running};
use crate::cli::values::{
    FileUnitArg, FloatArg, InpArg, NodesArg, PrecisionArg, SwitchArg, UpArg, UsdCurvesArg, ViewArg,
    field_of_view, flattening, output, positive, size, sun, vector,
};

/// Flags that `drape`, `swatch` and `view` share.
#[derive(Args, Debug)]
pub(crate) struct Shared {
    /// A file to write, by its ending: .png .html (a page to turn and zoom) .glb .obj .ply
    /// .usda .usdc .bcc .curves.txt .inp .npz .csv (data points) .json (report); may be repeated [default: a .png here, named after the drape
    /// or the fabric]
    #[arg(short, long = "output", value_name = "OUT", value_parser = output)]
    pub(crate) outputs: Vec<(PathBuf, Format)>,
    /// A built-in fabric or a fabric file
    #[arg(long, value_name = "NAME|FILE.toml", default_value = DEFAULT_FABRIC)]
    pub(crate) fabric: String,
    #[command(flatten)]
    pub(crate) chains: Chains,
    /// Wales per cm; yarns are drawn in proportion [default: the fabric's; on a garment, see
    /// --enlarge]
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) wales_per_cm: Option<f64>,
    /// Courses per cm [default: in proportion to the wales]
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) courses_per_cm: Option<f64>,
    /// Tube segments for each stitch [default: 10 in files, 40 in pictures]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=256), allow_negative_numbers = true)]
    pub(crate) st: Option<u32>,
    /// Edges of a tube's section [default: 6 in files, 12 in pictures]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(3..=64), allow_negative_numbers = true)]
    pub(crate) sr: Option<u32>,
    /// Draw yarns with this radius [default: from the yarn's count, as far as the loops leave room]
    #[arg(long, value_name = "MM", value_parser = positive, allow_negative_numbers = true)]
    pub(crate) radius: Option<f64>,
    /// Width over height of the yarns' section: over 1 it lies flat in the fabric's plane; its
    /// area is kept [default: as flat as the neighbours leave room, and 1 with --regular]
    #[arg(long, value_name = "K", value_parser = flattening, allow_negative_numbers = true)]
    pub(crate) flatten: Option<f64>,
    /// Close the tubes' ends
    #[arg(long)]
    pub(crate) caps: bool,
    /// Show yarns as their fibres, in files and in pictures [default: in pictures from near, fibres of
    /// captured cloth and hairs of spun yarns]
    #[arg(long, value_enum, value_name = "on|off")]
    pub(crate) fibres: Option<SwitchArg>,
    /// Radius of a fibre, mm; the thicker they are, the fewer a yarn has
    #[arg(long, value_name = "MM", value_parser = positive, default_value_t = FIBRE_RADIUS, allow_negative_numbers = true)]
    pub(crate) fibre_radius: f64,
    /// Write the yarns' centre lines, as l records, to .obj in place of tubes
    #[arg(long)]
    pub(crate) curves: bool,
    /// The curves of .usda and .usdc
    #[arg(long, value_enum, default_value = "bezier")]
    pub(crate) usd_curves: UsdCurvesArg,
    /// Whose keywords an .inp has
    #[arg(long, value_enum, default_value = "calculix")]
    pub(crate) inp: InpArg,
    /// Unit of .ply and .obj, which can't say theirs; Blender takes metres
    #[arg(long, value_enum, default_value = "mm")]
    pub(crate) file_unit: FileUnitArg,
    /// Upright axis of .ply and .obj; Blender takes z for .ply and y for .obj
    #[arg(long, value_enum, default_value = "y")]
    pub(crate) up: UpArg,
    /// Numbers of a .glb: 16 bits on a grid (KHR_mesh_quantization), or floats for readers without it
    #[arg(long, value_enum, default_value = "u16")]
    pub(crate) glb_precision: PrecisionArg,
    /// Compress a .glb (EXT_meshopt_compression), for viewers on the web; Blender doesn't read it
    #[arg(long)]
    pub(crate) glb_meshopt: bool,
    /// What has a node of its own in a .glb
    #[arg(long, value_enum, default_value = "bar")]
    pub(crate) nodes: NodesArg,
    /// Floats of an .npz
    #[arg(long, value_enum, default_value = "f64")]
    pub(crate) npz_precision: FloatArg,
    /// Compress an .npz
    #[arg(long)]
    pub(crate) npz_compress: bool,
    /// Size of the picture
    #[arg(long, value_name = "WxH", default_value = "1600x1200", value_parser = size, allow_hyphen_values = true)]
    pub(crate) size: (u32, u32),
    /// Side to look from; a swatch's front is its technical face
    #[arg(long, value_enum, default_value = "front")]
    pub(crate) view: ViewArg,
    /// Place the camera here instead of at a view, mm (with --look-at; `inspect` prints where a
    /// garment lies)
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, requires = "look_at", allow_hyphen_values = true)]
    pub(crate) eye: Option<DVec3>,
    /// Point the camera at this place, mm (with --eye)
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, requires = "eye", allow_hyphen_values = true)]
    pub(crate) look_at: Option<DVec3>,
    /// Vertical field of view
    #[arg(long, value_name = "DEG", default_value_t = 30.0, value_parser = field_of_view, allow_negative_numbers = true)]
    pub(crate) fov: f64,
    /// Magnify the middle of the picture
    #[arg(long, value_name = "K", default_value_t = 1.0, value_parser = positive, allow_negative_numbers = true)]
    pub(crate) zoom: f64,
    /// Colour behind the yarns: #rrggbb, white, black, grey or transparent [default: white for
    /// swatches and a studio for garments, unless there is an --environment]
    #[arg(long, value_name = "COLOR")]
    pub(crate) background: Option<Background>,
    /// Direction to the sun, degrees: to the right of the camera, and up; an --environment has its
    /// own [default: -38,35.5]
    #[arg(long, value_name = "AZ,EL", value_parser = sun, allow_hyphen_values = true)]
    pub(crate) sun: Option<DVec3>,
    #[command(flatten)]
    pub(crate) drawing: DrawingArgs,
    #[command(flatten)]
    pub(crate) running: Running,
}
