//! The settings of a run: its files, densities, yarns and pictures.
//!
//! [`Settings::default`] has the defaults of the command's flags. The command fills the settings
//! from its flags, and a user of the library by hand.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::stretch::Stretch;
use crate::drape;
use crate::drape::evenness::Evenness;
use crate::drape::strands::Edge;
use crate::export::glb::GlbOptions;
use crate::export::npz::NpzOptions;
use crate::export::{Axes, Format, InpDialect, UsdCurves};
use crate::map::Mapping;
use crate::render::environment::Environment;
use crate::render::scene::Shape;
use crate::render::{Background, Camera, RendererChoice, View};
use crate::tile::Tile;
use crate::yarn::fibres::FIBRE_RADIUS;

/// A file and the format in which it is written.
pub type Wanted = (PathBuf, Format);

/// All settings of a run. The garment and the fabric are given beside them.
///
/// ```
/// use warpknit::export::Format;
/// use warpknit::pipeline::Settings;
/// let settings = Settings {
///     outputs: vec![("swatch.glb".into(), Format::Glb)],
///     radius: Some(0.1),
///     ..Settings::default()
/// };
/// assert_eq!(settings.picture.size, (1600, 1200));
/// ```
#[derive(Clone, Debug)]
pub struct Settings {
    /// The files to write. If there are none, one picture is written, named after the input.
    pub outputs: Vec<Wanted>,
    /// Wales and courses per cm.
    pub densities: Densities,
    /// How much larger than true the stitches of a garment are. `None` where nobody chose: pictures
    /// then show true gauge, and files, turntables and sequences have [`Enlarge::Auto`]. Chosen
    /// densities count for everything and leave it out.
    pub enlarge: Option<Enlarge>,
    /// How yarns lie on a garment.
    pub placement: Placement,
    /// How a swatch is pulled. By default not at all.
    pub stretch: Option<Stretch>,
    /// The folder in which strained repeats are kept from one run to the next. By default none; the
    /// command has [`super::cache_folder`].
    pub cache: Option<PathBuf>,
    /// The part of the run that this machine makes. `None` for the whole.
    pub tile: Option<Tile>,
    /// Segments of tube for each stitch (St). By default 10 in files and 40 in pictures.
    pub st: Option<u32>,
    /// Edges of a tube's section (Sr). By default 6 in files and 12 in pictures.
    pub sr: Option<u32>,
    /// Radius of the thickest yarn, mm. By default from its count.
    pub radius: Option<f64>,
    /// Width over height of the yarns' sections. By default it follows from contact with other
    /// yarns ([`crate::knit::spread`]) in uneven cloth, and is 1 in regular cloth.
    pub flatten: Option<f64>,
    /// Whether the tubes' ends are closed in files.
    pub caps: bool,
    /// Whether yarns are made of their fibres. By default captured cloth shows its fibres in
    /// pictures from near.
    pub fibres: Option<bool>,
    /// Radius of a fibre, mm.
    pub fibre_radius: f64,
    /// Whether an `.obj` has centre lines in place of tubes.
    pub centre_lines: bool,
    /// The curves of `.usda` and `.usdc`.
    pub usd_curves: UsdCurves,
    /// Whose keywords an `.inp` has.
    pub inp: InpDialect,
    /// Unit and upright axis of `.ply` and `.obj`.
    pub axes: Axes,
    /// How a `.glb` holds its meshes.
    pub glb: GlbOptions,
    /// How an `.npz` holds its arrays.
    pub npz: NpzOptions,
    /// How pictures are taken.
    pub picture: PictureSettings,
}

/// Wales and courses per cm. One alone scales the other. If both are missing, the fabric's own count,
/// and on a garment [`Settings::enlarge`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Densities {
    /// Wales per cm.
    pub wales_per_cm: Option<f64>,
    /// Courses per cm.
    pub courses_per_cm: Option<f64>,
}

/// How much larger than true the stitches of a garment are. Wales, courses and yarns grow alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Enlarge {
    /// As much as leaves about 12 000 stitches, and not at all where there are fewer.
    Auto,
    /// So many times. 1 is true gauge.
    Times(f64),
}

/// How yarns lie on a garment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Placement {
    /// Method that maps depth from the flat panel to the draped one.
    pub mapping: Mapping,
    /// Whether yarns that cut each other on the body are moved apart, with [`Mapping::Relaxed`]. By
    /// default up to a million stitches.
    pub sweeps: Option<bool>,
    /// Treatment of yarns at a panel's edge.
    pub edge: Edge,
}

impl From<Placement> for drape::DrapeOptions {
    /// Options without surfaces. A run adds them if a file needs them.
    fn from(placement: Placement) -> Self {
        let Placement { mapping, sweeps, edge } = placement;
        Self { mapping, sweeps, edge, ..Self::default() }
    }
}

/// How pictures are taken.
#[derive(Clone, Debug)]
pub struct PictureSettings {
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// Side from which the camera looks, unless `eye` is given.
    pub view: View,
    /// The camera's own place and the point that it looks at, mm.
    pub eye: Option<(DVec3, DVec3)>,
    /// Vertical field of view, radians.
    pub fov: f64,
    /// Magnifies the middle of the picture.
    pub zoom: f64,
    /// The background. By default white, where there is neither studio nor environment.
    pub background: Option<Background>,
    /// Whether the cloth stands in a studio, before floor and wall. By default a garment does, unless
    /// a background or an environment is chosen.
    pub studio: Option<bool>,
    /// What lights the cloth from all around, and is seen behind it unless a background is chosen.
    pub environment: Option<Arc<Environment>>,
    /// The body in the cloth of a garment.
    pub body: Body,
    /// Direction to the sun along the camera's right, up and back axes. By default that of
    /// [`crate::render::Light`]. An environment has its own.
    pub sun: Option<DVec3>,
    /// The renderer.
    pub renderer: RendererChoice,
    /// Samples for each pixel.
    pub spp: u32,
    /// Samples of each pixel's edges on a graphics card: 1 or 4.
    pub samples: u32,
    /// Level of detail: whether yarns of few pixels are drawn more coarsely.
    pub lod: bool,
    /// Tubes or ribbons.
    pub shape: Shape,
    /// The maps of all yarns, a folder or an image. By default those that the fabric names.
    pub texture: Option<PathBuf>,
    /// Number of pictures from all around that replace each picture.
    pub turntable: Option<u32>,
    /// Whether stitches are copies of each other. Whatever is measured, and files, are regular.
    pub evenness: Evenness,
    /// How the edges of a garment are finished. By default they are hemmed where a picture shows true
    /// gauge unasked. Files have raw edges.
    pub edges: Option<EdgeFinish>,
    /// The inset that magnifies a place. Swatches, turntables and sequences have none.
    pub loupe: LoupeChoice,
}

/// The body in the cloth of a garment. It hides the yarns behind it and casts shadows on others.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Body {
    /// There is none.
    #[default]
    None,
    /// A mesh in the draped axes and the unit of the garment; of a sequence one, or one a frame.
    Files(Vec<PathBuf>),
    /// A lining, made from the garment itself.
    Lining,
}

/// How the edges of a garment are finished.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EdgeFinish {
    /// Cloth ends where its panel does.
    Raw,
    /// Open edges are hemmed, and sewn ones have seam allowances.
    Hemmed,
}

/// Where the loupe of a picture looks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum LoupeChoice {
    /// At cloth near the middle that faces the camera, if a wale is under 4 pixels wide there.
    #[default]
    Auto,
    /// There is none.
    Off,
    /// At this place, as shares of the picture's width and height from its top left corner.
    At(DVec2),
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            outputs: Vec::new(),
            densities: Densities::default(),
            enlarge: None,
            placement: Placement::default(),
            stretch: None,
            cache: None,
            tile: None,
            st: None,
            sr: None,
            radius: None,
            flatten: None,
            caps: false,
            fibres: None,
            fibre_radius: FIBRE_RADIUS,
            centre_lines: false,
            usd_curves: UsdCurves::default(),
            inp: InpDialect::default(),
            axes: Axes::default(),
            glb: GlbOptions::default(),
            npz: NpzOptions::default(),
            picture: PictureSettings::default(),
        }
    }
}

impl Default for PictureSettings {
    fn default() -> Self {
        Self {
            size: (1600, 1200),
            view: View::Front,
            eye: None,
            fov: Camera::DEFAULT_FOV,
            zoom: 1.0,
            background: None,
            studio: None,
            environment: None,
            body: Body::default(),
            sun: None,
            renderer: RendererChoice::Auto,
            spp: 4,
            samples: 4,
            lod: true,
            shape: Shape::Tube,
            texture: None,
            turntable: None,
            evenness: Evenness::Uneven,
            edges: None,
            loupe: LoupeChoice::default(),
        }
    }
}
