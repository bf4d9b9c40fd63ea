//! From one photo of a cloth to its yarns.
//!
//! In: one evenly lit photo of a knit or woven cloth, and [`CaptureSettings`] that may overrule the
//! results of single steps. Out: [`Captured`]: the cell that repeats, its mean, a texture that
//! tiles, and the yarn segments in the cell. No training data: every step is analysis.
//!
//! Source: Wu, Chen, Zhang, Zhou and Zhao, *Modeling yarn-level geometry from a single
//! micro-image*. The steps:
//!
//! ```text
//!   photo ─▶ view ─▶ lattice ─▶ register ─▶ cell ─▶ layout ─▶ depth ─▶ shape ─▶ strands ─▶ cloth
//!            size    repeat     where each  mean    woven,    color    mm       joined     fabric
//!                               copy lies   cell    cover,                      upright      ▲
//!                                   │               fit                                      │
//!                                   ├─────▶ quilt: a texture                                 │
//!                                   ╰─────▶ fibres: twist ───────────────────────────────────╯
//! ```
//!
//! `plane` and `correlogram` hold image filters and the autocorrelation. `target` is the mean cell
//! as the fits see it. `sheet` draws results for a person to check.
//!
//! Cost: about 1 s for the repeat and its mean, up to 8 s for the layout, on two cores; 160 MB for
//! a photo of 4 megapixels. The same photo gives the same bytes for any number of threads.
//!
//! Not promised: a scale. A photo doesn't say how large anything is. A person does, by the
//! thickness of the cloth or by the number of pixels per mm.

mod cell;
mod cloth;
mod color;
mod correlogram;
mod depth;
mod error;
mod fibres;
mod fit;
mod greedy_cover;
mod joining;
pub(crate) mod lattice;
mod layout;
mod layout_file;
mod least_squares;
pub(crate) mod plane;
mod quilt;
pub(crate) mod register;
mod relief;
mod report;
mod segment;
mod shape;
mod sheet;
mod strands;
mod target;
mod upright;
mod view;
mod visibility;
mod warnings;
mod woven;

use glam::DVec2;
use image::{RgbImage, RgbaImage};

use crate::plane::{Plane, double, float, narrow};
use cell::Cell;
use cloth::SegmentYarns;
use color::SegmentColors;
use depth::Depth;
use fibres::{PhotoRegistration, twists};
use layout::Targets;
use plane::{normalized_contrast, without_shading};
use quilt::quilt;
use register::{DisplacementField, register};
use shape::PhotoScale;
use view::PhotoView;
use warpknit_core::fabric::Fabric;

pub use error::CaptureError;
pub use fibres::Twist;
pub use fit::Hypothesis;
pub use lattice::{CERTAIN, Lattice, UnitCell};
pub use layout::Layout;
pub use layout_file::{GivenLayout, GivenLayoutError};
pub use segment::Segment;
pub use shape::CylinderShape;
pub use warnings::LEAST_CELL;

/// Length of a cell's shorter vector from which on a view is large enough, pixels. In smaller cells
/// a yarn is under four pixels wide, and a larger view is tried.
const MIN_CELL: f64 = 8.0;
/// The least length of the vectors that a person gives, pixels.
const MIN_GIVEN_VECTOR: f64 = 3.0;
/// How often the vectors that a person gives fit into the photo, at least.
const MIN_GIVEN_COPIES: f64 = 3.0;
/// Variance of the lightness below which a photo is blank.
const BLANK_VARIANCE: f32 = 1e-5;
/// Area of a cell as a share of the product of its sides, below which its vectors are parallel.
const MIN_SINE: f64 = 0.1;

/// Thickness of the cloth, mm, where nobody gives one.
pub const THICKNESS: f64 = 0.5;
/// Thickness of the cloth in thicknesses of a yarn: two yarns lie over each other where they cross.
const LAYERS: f64 = 2.0;

/// What overrules the steps' own decisions.
#[derive(Clone, Debug)]
pub struct CaptureSettings {
    /// Thickness of the cloth, mm: the scale of depth.
    pub thickness: f64,
    /// Pixels of the photo per mm. Without it, a yarn is taken to be half as wide as the cloth is
    /// thick.
    pub pixels_per_mm: Option<f64>,
    /// Both vectors of the cell, pixels of the photo.
    pub cell: Option<[DVec2; 2]>,
    /// The cell and its segments.
    pub layout: Option<GivenLayout>,
}

impl Default for CaptureSettings {
    fn default() -> Self {
        Self { thickness: THICKNESS, pixels_per_mm: None, cell: None, layout: None }
    }
}

/// What was captured of a photo. Lengths are pixels of the photo, y down, if no other unit is
/// given.
#[derive(Clone, Debug)]
pub struct Captured {
    /// The repeat.
    pub unit: UnitCell,
    /// Where the corner of a cell lies in the photo. The centre of the photo's first pixel is at 0.
    pub corner: DVec2,
    /// The segments of a cell, relative to its corner.
    pub layout: Layout,
    /// The twist of each segment in [`Layout::visible`].
    pub twists: Vec<Twist>,
    /// Each visible segment of the layout as a curved cylinder, mm.
    pub shapes: Vec<CylinderShape>,
    /// The cloth as it can be draped.
    pub fabric: Fabric,
    /// Size of a pixel of the photo, mm.
    pub pixel: f64,
    /// Pixels of the view that was worked on, per pixel of the photo.
    pub scale: f64,
    /// Heights over the mean cell.
    depth: Depth,
    /// Displacement of the cloth in that view.
    field: DisplacementField,
    /// The mean cell, in pixels of that view.
    cell: Cell,
    /// Some cells as the photo has them, joined so that they tile.
    texture: RgbaImage,
}

/// Captures a photo's yarns.
///
/// # Errors
/// [`CaptureError`]: what the photo lacks.
pub fn capture(photo: &RgbImage, settings: &CaptureSettings) -> Result<Captured, CaptureError> {
    MeanRepeat::new(photo, settings)?.captured()
}

/// The mean of what repeats in a photo. Its yarns are not laid out yet, but for those of a weave.
pub struct MeanRepeat<'a> {
    photo: &'a RgbImage,
    settings: &'a CaptureSettings,
    view: RepeatView,
    field: DisplacementField,
    /// Its mean cell in red, green and blue, linear light.
    channels: [Cell; 3],
    /// The same in lightness, without shading, both of two colours as light.
    cell: Cell,
    targets: Targets,
    /// The likeliest weave and its cost, unless a layout is given.
    weave: Option<(f64, Layout)>,
}

impl<'a> MeanRepeat<'a> {
    /// Finds what repeats, its mean, and the weave that it may be.
    ///
    /// # Errors
    /// [`CaptureError`]: what the photo lacks.
    pub fn new(photo: &'a RgbImage, settings: &'a CaptureSettings) -> Result<Self, CaptureError> {
        let (view, light) = repeat(photo, settings)?;
        let lattice = &view.unit.lattice;
        let field = register(&light.even, lattice);
        let channels = Plane::channels(&view.picture)
            .map(|plane| Cell::mean_of_copies(&plane, &field, lattice));
        let cell = Cell::mean_of_copies(
            &normalized_contrast(&light.lightness, narrow(1.5 * lattice.longer())),
            &field,
            lattice,
        );
        let cell = color::level_colors(cell, &channels);
        let targets = Targets::new(&cell);
        let weave = if settings.layout.is_none() { targets.weave() } else { None };
        Ok(Self { photo, settings, view, field, channels, cell, targets, weave })
    }

    /// The share of its variance that the likeliest weave leaves unexplained, if any is plausible.
    #[must_use]
    pub fn unexplained_by_weave(&self) -> Option<f64> {
        self.weave.as_ref().map(|(_, layout)| layout.error)
    }

    /// Whether it shows a weave so clearly that no other strands are looked for.
    #[must_use]
    pub fn is_clearly_woven(&self) -> bool {
        self.weave.as_ref().is_some_and(|(cost, _)| layout::is_clear(*cost))
    }

    /// Its vectors, pixels of the photo.
    #[must_use]
    pub fn lattice(&self) -> Lattice {
        self.view.unit.lattice.scaled(self.view.scale.recip())
    }

    /// Its yarns.
    ///
    /// # Errors
    /// [`CaptureError`]: what the photo or a given layout lacks.
    pub fn captured(self) -> Result<Captured, CaptureError> {
        let Self { photo, settings, view, field, channels, cell, targets, weave } = self;
        let RepeatView { scale, corner, picture, unit } = view;
        let layout = match &settings.layout {
            Some(given) => layout::given(
                &cell,
                given.segments.iter().map(|segment| segment.scaled(scale)).collect(),
                given.ground,
            )?,
            None => targets.layout(weave).ok_or(CaptureError::NoYarns)?,
        };
        let colors = SegmentColors::new(&channels, &layout.visible);
        let depth = Depth::new(&cell, &layout, &colors.groups, settings.thickness);
        let view = DVec2::new(f64::from(picture.width()), f64::from(picture.height()));
        let twists = twists(
            &PhotoRegistration {
                photo,
                field: &field,
                lattice: &unit.lattice,
                view,
                scale,
                corner,
            },
            &layout.visible,
        );
        let texture = quilt(&picture, &field, &unit.lattice);
        // From here on lengths are pixels of the photo instead of the view.
        let to_photo = 1.0 / scale;
        let lattice = unit.lattice.scaled(to_photo);
        let unit = UnitCell { lattice, ..unit };
        let layout = layout.scaled(to_photo);
        let width = layout.visible.iter().map(|segment| segment.width).sum::<f64>()
            / double(layout.visible.len());
        let pixel = settings.pixels_per_mm.map_or(settings.thickness / LAYERS / width, f64::recip);
        let shapes: Vec<CylinderShape> = layout
            .visible
            .iter()
            .map(|segment| CylinderShape::new(segment, PhotoScale { pixel, light: depth.scale }))
            .collect();
        let yarns = SegmentYarns { shapes: &shapes, twists: &twists, colors: &colors };
        let fabric = cloth::fabric(&lattice, &layout, &yarns, pixel);
        // The reader of fabric files has limits that a photo knows nothing of. Better an error now
        // than a file that `drape` refuses.
        Fabric::parse(&fabric.to_string())
            .map_err(|error| CaptureError::InvalidFabric { why: error.to_string() })?;
        Ok(Captured {
            unit,
            corner,
            layout,
            twists,
            shapes,
            fabric,
            pixel,
            scale,
            depth,
            field,
            cell,
            texture,
        })
    }
}

impl Captured {
    /// Correlation of the light with the heights of the cylinders. Below 0.2 the light says little
    /// about the depth.
    #[must_use]
    pub fn correlation(&self) -> f64 {
        self.depth.correlation
    }

    /// Cell coordinates of a pixel of the photo: counts of both vectors of the cell.
    #[must_use]
    pub fn cell_coordinates(&self, pixel: DVec2) -> DVec2 {
        self.field.cell_coordinates((pixel - self.corner) * self.scale)
    }

    /// Height of the cloth over its deepest ground at cell coordinates, mm.
    #[must_use]
    pub fn height(&self, coordinates: DVec2) -> f64 {
        f64::from(self.depth.cell.at(coordinates))
    }
}

/// A view of the photo in which something repeats.
struct RepeatView {
    /// Its pixels per pixel of the photo.
    scale: f64,
    /// The centre of its first pixel in the photo.
    corner: DVec2,
    picture: RgbImage,
    /// The repeat, in pixels of the view.
    unit: UnitCell,
}

/// The light of a view. It takes nearly three times the picture's memory, and nothing but its mean
/// cell is kept.
struct ViewLight {
    lightness: Plane,
    /// The same without slow shading.
    even: Plane,
}

/// The view in which the repeat is clearest, and its light.
fn repeat(
    photo: &RgbImage,
    settings: &CaptureSettings,
) -> Result<(RepeatView, ViewLight), CaptureError> {
    let given = settings.layout.as_ref().map(|layout| layout.cell).or(settings.cell);
    let mut best: Option<(RepeatView, ViewLight)> = None;
    for PhotoView { picture, scale, corner } in PhotoView::all(photo) {
        let lightness = Plane::lightness(&picture);
        let mean = lightness.values.iter().sum::<f32>() / float(lightness.values.len());
        if lightness.map(|value| value - mean).mean_square() < BLANK_VARIANCE {
            return Err(CaptureError::Blank);
        }
        let even = without_shading(&lightness);
        let found = match given {
            Some([a, b]) => {
                Some(UnitCell { lattice: Lattice { a, b }.scaled(scale), confidence: 1.0 })
            }
            None => lattice::find(&even),
        };
        let Some(unit) = found else { continue };
        let is_enough = unit.confidence >= CERTAIN && unit.lattice.shorter() >= MIN_CELL;
        // Of two certain repeats the one in more pixels is better, even if it is less certain.
        let is_better = best.as_ref().is_none_or(|(RepeatView { unit: other, .. }, _)| {
            unit.confidence >= other.confidence
                || other.lattice.shorter() < MIN_CELL && unit.confidence >= CERTAIN
        });
        if is_better {
            let view = RepeatView { scale, corner, picture, unit };
            best = Some((view, ViewLight { lightness, even }));
        }
        if is_enough {
            break;
        }
    }
    if let (Some(vectors), Some((view, _))) = (given, &best) {
        check_given(vectors, view, photo)?;
    }
    let confidence = best.as_ref().map_or(0.0, |(best, _)| best.unit.confidence);
    best.filter(|(best, _)| best.unit.confidence >= CERTAIN)
        .ok_or(CaptureError::NoRepeat { confidence, least: CERTAIN })
}

/// Checks that vectors which a person gave span a cell that the photo shows a few times.
fn check_given(
    [a, b]: [DVec2; 2],
    view: &RepeatView,
    photo: &RgbImage,
) -> Result<(), CaptureError> {
    let (lattice, scale) = (&view.unit.lattice, view.scale);
    let side = f64::from(photo.width().min(photo.height()));
    let is_flat = lattice.area() < MIN_SINE * lattice.shorter() * lattice.longer();
    let shorter = lattice.shorter() / scale;
    if is_flat
        || shorter.is_nan()
        || shorter < MIN_GIVEN_VECTOR
        || lattice.longer() / scale * MIN_GIVEN_COPIES > side
    {
        return Err(CaptureError::Cell { cell: [a.x, a.y, b.x, b.y] });
    }
    Ok(())
}

/// A lag or a count as an integer. They are some thousands at most.
fn steps(count: f64) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "`as` saturates")]
    let steps = count as i32;
    steps
}
