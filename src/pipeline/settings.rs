//! What a person may choose of a run: its files, densities, yarns and pictures.
//!
//! In: nothing; [`Settings::default`] is what the command does unasked. The command fills these
//! from its flags, a library user by hand.

use std::path::PathBuf;

use glam::DVec3;

use crate::drape;
use crate::drape::strands::Edge;
use crate::export::Format;
use crate::map::Mapping;
use crate::render::scene::Shape;
use crate::render::{Background, Camera, RendererChoice, View};
use crate::tile::Tile;
use crate::yarn::fibres::FIBRE_RADIUS;

/// A file and the format in which it is written.
pub type Wanted = (PathBuf, Format);

/// Everything that a run can be told, but for the garment and the fabric.
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
    /// The files to write. Without any, a picture is written that is named after the input.
    pub outputs: Vec<Wanted>,
    /// Wales and courses per cm.
    pub densities: Densities,
    /// How yarns lie on a garment.
    pub placement: Placement,
    /// One machine's part of the run.
    pub tile: Option<Tile>,
    /// Segments of tube a stitch (St); 10 in files and 40 in pictures where none are chosen.
    pub st: Option<u32>,
    /// Edges of a tube's section (Sr); 6 in files and 12 in pictures where none are chosen.
    pub sr: Option<u32>,
    /// Radius of the thickest yarn, mm; from its count where none is chosen.
    pub radius: Option<f64>,
    /// Width over height of the tubes' section in files.
    pub flatten: f64,
    /// Whether the tubes' ends are closed in files.
    pub caps: bool,
    /// Whether yarns are made of their fibres; where nobody chooses, captured cloth shows them in
    /// pictures from near.
    pub fibres: Option<bool>,
    /// Radius of a fibre, mm.
    pub fibre_radius: f64,
    /// Whether an `.obj` holds centre lines in place of tubes.
    pub centre_lines: bool,
    /// How pictures are taken.
    pub picture: PictureSettings,
}

/// Wales and courses per cm; one alone scales the other. Without any, a garment of too many
/// stitches is enlarged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Densities {
    /// Wales per cm.
    pub wales_per_cm: Option<f64>,
    /// Courses per cm.
    pub courses_per_cm: Option<f64>,
}

/// How yarns lie on a garment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Placement {
    /// How depth is carried from the flat panel to the draped one.
    pub mapping: Mapping,
    /// What happens at a panel's edge.
    pub edge: Edge,
}

impl From<Placement> for drape::DrapeOptions {
    /// Without surfaces, which are for those who write them.
    fn from(placement: Placement) -> Self {
        Self { mapping: placement.mapping, edge: placement.edge, surface: None }
    }
}

/// How pictures are taken.
#[derive(Clone, Debug)]
pub struct PictureSettings {
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// From where the camera looks, if it has no place of its own.
    pub view: View,
    /// The camera's own place and the point that it looks at, mm.
    pub eye: Option<(DVec3, DVec3)>,
    /// Vertical field of view, radians.
    pub fov: f64,
    /// Magnifies the middle of the picture.
    pub zoom: f64,
    /// The background; white where none is chosen.
    pub background: Option<Background>,
    /// The renderer.
    pub renderer: RendererChoice,
    /// Samples a pixel.
    pub spp: u32,
    /// Samples of each pixel's edges on a graphics card: 1 or 4.
    pub samples: u32,
    /// Whether yarns of few pixels are drawn more coarsely.
    pub lod: bool,
    /// Tubes or ribbons.
    pub shape: Shape,
    /// The maps of all yarns, a folder or an image; without it, those that the fabric names.
    pub texture: Option<PathBuf>,
    /// Pictures from all around in place of each one.
    pub turntable: Option<u32>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            outputs: Vec::new(),
            densities: Densities::default(),
            placement: Placement::default(),
            tile: None,
            st: None,
            sr: None,
            radius: None,
            flatten: 1.0,
            caps: false,
            fibres: None,
            fibre_radius: FIBRE_RADIUS,
            centre_lines: false,
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
            renderer: RendererChoice::Auto,
            spp: 4,
            samples: 4,
            lod: true,
            shape: Shape::Tube,
            texture: None,
            turntable: None,
        }
    }
}
