//! From one photo of a cloth to its yarns.
//!
//! In: one photo, evenly lit, of a knit or woven cloth, and [`Settings`] that may overrule what is
//! found. Out: [`Captured`]: the cell that repeats, its mean, a texture that tiles, and the yarn
//! segments in the cell. No training data: every step is analysis. Source: Wu, Chen, Zhang, Zhou
//! and Zhao 2017, *Modeling yarn-level geometry from a single micro-image*. The steps:
//!
//! ```text
//!   photo ─▶ view ─▶ lattice ─▶ register ─▶ cell ─▶ layout ─────────▶ depth ─▶ shape ─▶ strands ─▶ cloth
//!            size    repeat     where each  mean    woven ╮  ╭ fit,   color    mm       joined     fabric
//!                               copy lies   cell    cover ┴──╯ segment                  upright      ▲
//!                                   ╰─────▶ quilt: a texture            ╰────▶ fibres: twist ────────╯
//! ```
//!
//! `plane` and `correlogram` are what pictures are asked by, `target` is the mean cell as fits see
//! it, `sheet` draws. Cost: about a second for the repeat and its mean, up to fifteen for the
//! layout, on two cores; 160 MB for a photo of 4 megapixels. The same photo gives the same bytes
//! for any number of threads.
//!
//! Not promised: a scale. A photo doesn't say how large anything is; a person does, by how thick
//! the cloth is or how many pixels are a mm.

mod cell;
mod cloth;
mod color;
mod correlogram;
mod depth;
mod error;
mod fibres;
mod files;
mod fit;
mod greedy_cover;
mod lattice;
mod layout;
mod plane;
mod quilt;
mod register;
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
use cloth::Yarns;
use color::Colors;
use depth::Depth;
use fibres::{Sight, twists};
use plane::{evened, without_shading};
use quilt::quilt;
use register::{Warp, register};
use shape::Scale;
use view::View;
use warpknit_core::fabric::Fabric;

pub use error::CaptureError;
pub use fibres::Twist;
pub use files::{GivenLayout, LayoutError};
pub use fit::Hypothesis;
pub use lattice::{CERTAIN, Lattice, UnitCell};
pub use layout::Layout;
pub use segment::Segment;
pub use shape::Shape;

/// A cell's shorter vector, pixels, from which on a view is large enough.
const ENOUGH: f64 = 8.0;
/// Vectors that a person gives are at least so long, pixels, and fit the photo so often.
const GIVEN: (f64, f64) = (3.0, 3.0);
/// Lightness that differs by less is blank.
const BLANK: f32 = 1e-5;

/// How thick cloth is taken to be, mm, where nobody says it.
pub const THICKNESS: f64 = 0.5;
/// Yarns that lie over each other where two cross: as many times as thick as a yarn is the cloth.
const LAYERS: f64 = 2.0;

/// What overrules the steps' own decisions.
#[derive(Clone, Debug)]
pub struct Settings {
    /// How thick the cloth is, mm: the scale of depth.
    pub thickness: f64,
    /// How many pixels of the photo are a mm; if nobody says it, as many as make a yarn half as
    /// wide as the cloth is thick.
    pub pixels_per_mm: Option<f64>,
    /// Both vectors of the cell, pixels of the photo.
    pub cell: Option<[DVec2; 2]>,
    /// The cell and its segments.
    pub layout: Option<GivenLayout>,
}

impl Default for Settings {
    fn default() -> Self {
        Self { thickness: THICKNESS, pixels_per_mm: None, cell: None, layout: None }
    }
}

/// What a photo says. Lengths are pixels of the photo, y down, if no other unit is given.
#[derive(Clone, Debug)]
pub struct Captured {
    /// The repeat.
    pub unit: UnitCell,
    /// Where the corner of a cell is in the photo, the middle of whose first pixel is at 0.
    pub corner: DVec2,
    /// The segments of a cell, relative to its corner.
    pub layout: Layout,
    /// The twist of each segment in [`Layout::seen`].
    pub twists: Vec<Twist>,
    /// Each segment of the layout that is seen as a curved cylinder, mm.
    pub shapes: Vec<Shape>,
    /// The cloth as it can be draped.
    pub fabric: Fabric,
    /// mm a pixel of the photo.
    pub pixel: f64,
    /// Pixels of the picture that was worked on for each of the photo's.
    pub scale: f64,
    /// Heights over the mean cell.
    depth: Depth,
    /// Where the cloth lies in that picture.
    warp: Warp,
    /// The mean cell, in pixels of that picture.
    cell: Cell,
    /// Some cells as the photo has them, so joined that they tile.
    texture: RgbaImage,
}

/// Captures a photo's yarns.
///
/// # Errors
/// [`CaptureError`]: what the photo lacks.
pub fn capture(photo: &RgbImage, settings: &Settings) -> Result<Captured, CaptureError> {
    let Repeating { scale, corner, picture, lightness, even, unit } = repeat(photo, settings)?;
    let warp = register(&even, &unit.lattice);
    let hues = Plane::channels(&picture).map(|plane| Cell::folded(&plane, &warp, &unit.lattice));
    let cell = Cell::folded(
        &evened(&lightness, narrow(1.5 * unit.lattice.longer())),
        &warp,
        &unit.lattice,
    );
    let cell = color::levelled(cell, &hues);
    let layout = match &settings.layout {
        Some(given) => layout::given(
            &cell,
            given.segments.iter().map(|segment| segment.scaled(scale)).collect(),
            given.ground,
        )?,
        None => layout::find(&cell).ok_or(CaptureError::NoYarns)?,
    };
    let colors = Colors::of(&hues, &layout.seen);
    let depth = Depth::of(&cell, &layout, &colors.groups, settings.thickness);
    let view = DVec2::new(double(lightness.width), double(lightness.height));
    let twists = twists(
        &Sight { photo, warp: &warp, lattice: &unit.lattice, view, scale, corner },
        &layout.seen,
    );
    let texture = quilt(&picture, &warp, &unit.lattice);
    let photos = 1.0 / scale;
    let lattice = Lattice { a: unit.lattice.a * photos, b: unit.lattice.b * photos };
    let unit = UnitCell { lattice, ..unit };
    let layout = layout.scaled(photos);
    let width =
        layout.seen.iter().map(|segment| segment.width).sum::<f64>() / double(layout.seen.len());
    let pixel = settings.pixels_per_mm.map_or(settings.thickness / LAYERS / width, f64::recip);
    let shapes: Vec<Shape> = layout
        .seen
        .iter()
        .map(|segment| Shape::of(segment, Scale { pixel, light: depth.scale }))
        .collect();
    let yarns = Yarns { shapes: &shapes, twists: &twists, colors: &colors };
    let fabric = cloth::fabric(&lattice, &layout, &yarns, pixel);
    Fabric::parse(&fabric.to_string())
        .map_err(|error| CaptureError::Unreal { why: error.to_string() })?;
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
        warp,
        cell,
        texture,
    })
}

impl Captured {
    /// Correlation of the light with the heights of the cylinders: under .2 light says little of
    /// the depth.
    #[must_use]
    pub fn correlation(&self) -> f64 {
        self.depth.correlation
    }

    /// Counts of both vectors of the cell at a pixel of the photo.
    #[must_use]
    pub fn count(&self, pixel: DVec2) -> DVec2 {
        self.warp.count((pixel - self.corner) * self.scale)
    }

    /// How high the cloth lies over its deepest ground at counts of both vectors, mm.
    #[must_use]
    pub fn height(&self, count: DVec2) -> f64 {
        f64::from(self.depth.cell.at(count))
    }
}

/// A view of the photo with a repeat in it.
struct Repeating {
    /// Its pixels for each of the photo's.
    scale: f64,
    /// The middle of its first pixel in the photo.
    corner: DVec2,
    picture: RgbImage,
    lightness: Plane,
    /// The same without slow shading.
    even: Plane,
    /// In the view's pixels.
    unit: UnitCell,
}

/// The view in which the repeat is seen best.
fn repeat(photo: &RgbImage, settings: &Settings) -> Result<Repeating, CaptureError> {
    let given = settings.layout.as_ref().map(|layout| layout.cell).or(settings.cell);
    let mut best: Option<Repeating> = None;
    for View { picture, scale, corner } in View::all(photo) {
        let lightness = Plane::lightness(&picture);
        let mean = lightness.values.iter().sum::<f32>() / float(lightness.values.len());
        if lightness.map(|value| value - mean).power() < BLANK {
            return Err(CaptureError::Blank);
        }
        let even = without_shading(&lightness);
        let found = match given {
            Some([a, b]) => {
                Some(UnitCell { lattice: Lattice { a: a * scale, b: b * scale }, confidence: 1.0 })
            }
            None => lattice::find(&even),
        };
        let Some(unit) = found else { continue };
        let is_enough = unit.confidence >= CERTAIN && unit.lattice.shorter() >= ENOUGH;
        let is_better = best.as_ref().is_none_or(|Repeating { unit: other, .. }| {
            unit.confidence >= other.confidence
                || other.lattice.shorter() < ENOUGH && unit.confidence >= CERTAIN
        });
        if is_better {
            best = Some(Repeating { scale, corner, picture, lightness, even, unit });
        }
        if is_enough {
            break;
        }
    }
    if let (Some([a, b]), Some(Repeating { scale, unit, .. })) = (given, &best) {
        let side = f64::from(photo.width().min(photo.height()));
        let is_flat = unit.lattice.area() < 0.1 * unit.lattice.shorter() * unit.lattice.longer();
        let shorter = unit.lattice.shorter() / scale;
        if is_flat
            || shorter.is_nan()
            || shorter < GIVEN.0
            || unit.lattice.longer() / scale * GIVEN.1 > side
        {
            return Err(CaptureError::Cell { cell: [a.x, a.y, b.x, b.y] });
        }
    }
    let confidence = best.as_ref().map_or(0.0, |best| best.unit.confidence);
    best.filter(|best| best.unit.confidence >= CERTAIN)
        .ok_or(CaptureError::NoRepeat { confidence, least: CERTAIN })
}

/// Whole steps of a lag or a count, which are some thousands at most.
fn steps(count: f64) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "`as` saturates")]
    let steps = count as i32;
    steps
}
