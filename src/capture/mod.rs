//! From one photo of a cloth to its yarns.
//!
//! In: one photo, evenly lit, of a knit or woven cloth, and [`Settings`] that may overrule what is found. Out: [`Captured`]: the cell that repeats, its mean, and the yarn
//! segments in it. No training data: every step is analysis. Source: Wu, Chen, Zhang, Zhou and Zhao 2017, *Modeling yarn-level geometry from a single micro-image*. The steps so far:
//!
//! ```text
//!   photo ─▶ view ─▶ lattice ─▶ register ─▶ cell ─▶ layout ─────────────▶ fibres ─▶ files
//!            size    repeat     where each  mean    woven ╮  ╭ fit,       twist
//!                               copy lies   cell    cover ┴──╯ segment
//! ```
//!
//! `plane` and `correlogram` are what pictures are asked by, `target` is the mean cell as fits see it, `sheet` draws. Cost: about a second for the repeat and its mean, up to
//! ten for the layout, on two cores; 140 MB. The same photo gives the same bytes for any number of threads.
//!
//! Not promised: a scale. A photo doesn't say how large anything is, and lengths are its pixels.

mod cell;
mod correlogram;
mod cover;
mod error;
mod fibres;
mod files;
mod fit;
mod lattice;
mod layout;
mod plane;
mod register;
mod segment;
mod sheet;
mod target;
mod view;
mod woven;

use glam::DVec2;
use image::RgbImage;

use crate::plane::{Plane, double, float, narrow};
use cell::Cell;
use fibres::{Sight, twists};
use plane::{evened, without_shading};
use register::register;
use view::View;

pub use error::CaptureError;
pub use fibres::Twist;
pub use files::{FILES, GivenLayout, LayoutError, save};
pub use lattice::{CERTAIN, Lattice, UnitCell};
pub use layout::{Hypothesis, Layout};
pub use segment::Segment;

/// A cell's shorter vector, pixels, from which on a view is large enough.
const ENOUGH: f64 = 8.0;
/// Vectors that a person gives are at least so long, pixels, and fit the photo so often.
const GIVEN: (f64, f64) = (3.0, 3.0);
/// Lightness that differs by less is blank.
const BLANK: f32 = 1e-5;

/// What overrules the steps' own decisions.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// Both vectors of the cell, pixels of the photo.
    pub cell: Option<[DVec2; 2]>,
    /// The cell and its segments.
    pub layout: Option<GivenLayout>,
}

/// What a photo says. Lengths are pixels of the photo, y down.
#[derive(Clone, Debug)]
pub struct Captured {
    /// The repeat.
    pub unit: UnitCell,
    /// Where the corner of a cell is in the photo.
    pub corner: DVec2,
    /// The segments of a cell, relative to its corner.
    pub layout: Layout,
    /// The twist of each segment in [`Layout::seen`].
    pub twists: Vec<Twist>,
    /// Pixels of the picture that was worked on for each of the photo's.
    pub scale: f64,
    /// The mean cell, in pixels of that picture.
    cell: Cell,
}

/// Captures a photo's yarns.
///
/// # Errors
/// [`CaptureError`]: what the photo lacks.
pub fn capture(photo: &RgbImage, settings: &Settings) -> Result<Captured, CaptureError> {
    let Repeating { scale, corner, lightness, even, unit } = repeat(photo, settings)?;
    let warp = register(&even, &unit.lattice);
    let cell = Cell::folded(&evened(&lightness, narrow(1.5 * unit.lattice.longer())), &warp, &unit.lattice);
    let layout = match &settings.layout {
        Some(given) => {
            let layout = layout::given(&cell, given.segments.iter().map(|segment| segment.scaled(scale)).collect(), given.ground);
            if !layout.is_valid() {
                let Layout { overlap, blank, .. } = layout;
                return Err(CaptureError::Invalid {
                    overlap,
                    blank,
                    most_overlap: Layout::MOST_OVERLAP,
                    most_blank: Layout::MOST_BLANK,
                });
            }
            layout
        }
        None => layout::find(&cell).ok_or(CaptureError::NoYarns)?,
    };
    let view = DVec2::new(double(lightness.width), double(lightness.height));
    let sight = Sight { photo, warp: &warp, lattice: &unit.lattice, view, scale, corner };
    let twists = twists(&sight, &layout.seen);
    let photos = 1.0 / scale;
    let lattice = Lattice { a: unit.lattice.a * photos, b: unit.lattice.b * photos };
    let unit = UnitCell { lattice, ..unit };
    Ok(Captured { unit, corner, layout: layout.scaled(photos), twists, scale, cell })
}

/// A view of the photo with a repeat in it.
struct Repeating {
    /// Its pixels for each of the photo's.
    scale: f64,
    /// Its corner in the photo.
    corner: DVec2,
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
            Some([a, b]) => Some(UnitCell { lattice: Lattice { a: a * scale, b: b * scale }, confidence: 1.0 }),
            None => lattice::find(&even),
        };
        let Some(unit) = found else { continue };
        let is_enough = unit.confidence >= CERTAIN && unit.lattice.shorter() >= ENOUGH;
        let is_better = best.as_ref().is_none_or(|Repeating { unit: other, .. }| {
            unit.confidence >= other.confidence || other.lattice.shorter() < ENOUGH && unit.confidence >= CERTAIN
        });
        if is_better {
            best = Some(Repeating { scale, corner, lightness, even, unit });
        }
        if is_enough {
            break;
        }
    }
    if let (Some([a, b]), Some(Repeating { scale, unit, .. })) = (given, &best) {
        let side = f64::from(photo.width().min(photo.height()));
        let is_flat = unit.lattice.area() < 0.1 * unit.lattice.shorter() * unit.lattice.longer();
        let shorter = unit.lattice.shorter() / scale;
        if is_flat || shorter.is_nan() || shorter < GIVEN.0 || unit.lattice.longer() / scale * GIVEN.1 > side {
            return Err(CaptureError::Cell { cell: [a.x, a.y, b.x, b.y] });
        }
    }
    let confidence = best.as_ref().map_or(0.0, |best| best.unit.confidence);
    best.filter(|best| best.unit.confidence >= CERTAIN).ok_or(CaptureError::NoRepeat { confidence, least: CERTAIN })
}

/// Whole steps of a lag or a count, which are some thousands at most.
fn steps(count: f64) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "`as` saturates")]
    let steps = count as i32;
    steps
}
