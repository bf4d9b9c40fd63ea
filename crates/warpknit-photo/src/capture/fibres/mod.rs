//! Step 6, fibres: how wide they are in a photo, and how much they are twisted around their yarn.
//!
//! In: the photo and the position of each copy of the cell in it ([`PhotoRegistration`]), and the
//! visible segments. Out: a [`Twist`] for each segment. Copies of a segment have different fibres
//! and the same twist, so they are traced separately and fitted together:
//!
//! ```text
//!   photo ─▶ patches ──▶ orientation ─▶ sticks ──▶ trace ─▶ twist
//!            one a copy  where fibres   spread     joined   one angle that
//!                        run            over it             explains them
//! ```
//!
//! The photo's own pixels are used, whatever the size of the view in which the repeat was found.
//!
//! Source: Wu et al., *Modeling yarn-level geometry from a single micro-image*, section 5,
//! with a structure tensor in place of Gabor filters. Cost: 0.1 s a segment on two cores;
//! [`MAX_PIXELS`] bounds it.
//!
//! Not promised: plied yarns, where the angle is that of the plies or of the fibres in them,
//! whichever is visible. Fibres under [`Twist::LEAST_PX`] pixels get a twist that is marked as a
//! guess. A fibre's width follows from the spacing of fibres, as if six tenths of a yarn were
//! fibre.

mod orientation;
mod patches;
mod sticks;
mod trace;
mod twist;

use glam::DVec2;
use image::RgbImage;
use rayon::prelude::*;

use super::lattice::Lattice;
use super::register::DisplacementField;
use super::segment::Segment;
use crate::plane::{Plane, double, narrow};
use orientation::Orientation;
use sticks::Stick;

pub use twist::Twist;

/// Pixels of a segment's copies that are used, at most. The fit has enough fibres then.
const MAX_PIXELS: f64 = 400_000.0;
/// Copies of a segment that are used, at most.
const MAX_COPIES: usize = 48;
/// The part of a segment's length and width that is used. Beyond, other yarns begin, and fibres
/// turn away at the sides.
const INNER_PART: DVec2 = DVec2::new(0.85, 0.8);
/// Fibres across a yarn, at least. Fewer are plies, or nothing.
const MIN_FIBRES_ACROSS: f64 = 5.0;
/// Length of a stick, in spacings of fibres. Longer ones don't follow a helix; shorter ones don't
/// fill a fibre.
const STICK_LENGTH: f64 = 1.2;
/// Distance that is left between sticks, in spacings of fibres.
const STICK_DISTANCE: f64 = 0.4;

/// A photo, and the positions of its cells.
pub(super) struct PhotoRegistration<'a> {
    pub(super) photo: &'a RgbImage,
    /// Pixels of the view to cell coordinates of the lattice, which is in those pixels too.
    pub(super) field: &'a DisplacementField,
    pub(super) lattice: &'a Lattice,
    /// Width and height of the view.
    pub(super) view: DVec2,
    /// Pixels of the view per pixel of the photo.
    pub(super) scale: f64,
    /// The centre of the view's first pixel in the photo.
    pub(super) corner: DVec2,
}

/// The twist of each segment. Segments are in the view's pixels.
pub(super) fn twists(registration: &PhotoRegistration, segments: &[Segment]) -> Vec<Twist> {
    segments.iter().map(|segment| twist(registration, segment)).collect()
}

fn twist(registration: &PhotoRegistration, segment: &Segment) -> Twist {
    let whole = DVec2::new(segment.length, segment.width) / registration.scale;
    // The middle of a very large segment is enough.
    let size = DVec2::new(whole.x.min((MAX_PIXELS / whole.y).max(0.5 * whole.y)), whole.y);
    if size.y < MIN_FIBRES_ACROSS * Twist::LEAST_PX {
        return Twist::guess(size.y / MIN_FIBRES_ACROSS);
    }
    let mut frames = patches::frames(registration, segment);
    frames.truncate(MAX_COPIES.min(patches::bounded(MAX_PIXELS / (size.x * size.y))));
    let in_photo = segment.scaled(1.0 / registration.scale);
    let details = patches::details(registration.photo, &frames, &in_photo, size);
    let Some(spacing) = orientation::spacing(&details, size.y) else { return Twist::guess(0.0) };
    let fibres: Vec<Vec<Vec<Stick>>> =
        details.par_iter().map(|detail| fibres(detail, spacing, INNER_PART * size)).collect();
    Twist::from_fibres(&fibres.concat(), spacing, whole)
}

/// The fibres that are traced in one copy, relative to its middle.
fn fibres(detail: &Plane, spacing: f64, size: DVec2) -> Vec<Vec<Stick>> {
    let orientation = Orientation::new(detail, narrow(spacing));
    let middle = 0.5 * DVec2::new(double(detail.width - 1), double(detail.height - 1));
    // Sticks only go where the orientation is clear: elsewhere it is that of noise.
    let mask = Plane::from_fn(detail.width, detail.height, |x, y| {
        let offset = DVec2::new(double(x), double(y)) - middle;
        let is_in = offset.abs().cmple(0.5 * size).all() && orientation.is_clear(x, y);
        f32::from(u8::from(is_in))
    });
    let sticks: Vec<Stick> = sticks::filled(
        &mask,
        |x, y| orientation.direction(x, y),
        STICK_LENGTH * spacing,
        STICK_DISTANCE * spacing,
    )
    .into_iter()
    .map(|stick| Stick { middle: stick.middle - middle, ..stick })
    .collect();
    trace::traced(&sticks, STICK_LENGTH * spacing)
}
