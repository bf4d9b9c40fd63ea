//! Step 6, fibres: how wide they are in a photo, and by how much they are twisted around their
//! yarn.
//!
//! In: the photo and where each copy of the cell lies in it ([`Sight`]), and the segments that are
//! seen. Out: a [`Twist`] a segment. All copies of a segment have fibres of their own and the same
//! twist, so they are traced apart and judged together:
//!
//! ```text
//!   photo ─▶ patches ──▶ orientation ─▶ sticks ──▶ trace ─▶ twist
//!            one a copy  where fibres   spread     joined   one angle that
//!                        run            over it             explains them
//! ```
//!
//! The photo's own pixels are looked at, whatever the size at which its repeat was found. Source:
//! Wu et al. 2017, section 5, with a structure tensor in place of Gabor filters. Cost: 0.1 s a
//! segment on two cores; [`MOST_PIXELS`] bounds it.
//!
//! Not promised: plied yarns, of which the angle is that of what is seen, fibres in plies or plies;
//! fibres under [`Twist::LEAST_PX`] pixels, whose twist is a guess and says so. A fibre's width
//! comes from how far apart fibres are, as if six tenths of a yarn were fibre.

mod orientation;
mod patches;
mod sticks;
mod trace;
mod twist;

use glam::DVec2;
use image::RgbImage;
use rayon::prelude::*;

use super::lattice::Lattice;
use super::register::Warp;
use super::segment::Segment;
use crate::plane::{Plane, double, narrow};
use orientation::Orientation;
use sticks::Stick;

pub use twist::Twist;

/// Pixels of a segment's copies that are looked at, and copies.
const MOST_PIXELS: f64 = 400_000.0;
const MOST_COPIES: usize = 48;
/// The part of a segment's length and width that is looked at: beyond, other yarns begin and sides
/// hide their fibres.
const LOOKED_AT: DVec2 = DVec2::new(0.85, 0.8);
/// Fibres across a yarn, at least; fewer are plies, or nothing.
const LEAST_ACROSS: f64 = 5.0;
/// Length of a stick and the distance that is left between sticks, in the spacing of fibres.
const STICK: f64 = 1.2;
const APART: f64 = 0.4;

/// A photo, and where its cells lie.
pub(super) struct Sight<'a> {
    pub(super) photo: &'a RgbImage,
    /// The view's pixels to counts of the lattice, which is in those pixels too.
    pub(super) warp: &'a Warp,
    pub(super) lattice: &'a Lattice,
    /// Sides of the view, its pixels for each of the photo's, and where the middle of its first one
    /// is in the photo.
    pub(super) view: DVec2,
    pub(super) scale: f64,
    pub(super) corner: DVec2,
}

/// The twist of each segment; they are in the view's pixels.
pub(super) fn twists(sight: &Sight, segments: &[Segment]) -> Vec<Twist> {
    segments.iter().map(|segment| twist(sight, segment)).collect()
}

fn twist(sight: &Sight, segment: &Segment) -> Twist {
    let whole = DVec2::new(segment.length, segment.width) / sight.scale;
    // Of a very large segment the middle is enough.
    let size = DVec2::new(whole.x.min((MOST_PIXELS / whole.y).max(0.5 * whole.y)), whole.y);
    if size.y < LEAST_ACROSS * Twist::LEAST_PX {
        return Twist::guess(size.y / LEAST_ACROSS);
    }
    let mut frames = patches::frames(sight, segment);
    frames.truncate(MOST_COPIES.min(patches::bounded(MOST_PIXELS / (size.x * size.y))));
    let details = patches::details(sight.photo, &frames, &segment.scaled(1.0 / sight.scale), size);
    let Some(across) = orientation::spacing(&details, size.y) else { return Twist::guess(0.0) };
    let fibres: Vec<Vec<Vec<Stick>>> =
        details.par_iter().map(|detail| fibres(detail, across, LOOKED_AT * size)).collect();
    Twist::of(&fibres.concat(), across, whole)
}

/// The fibres that are traced in one copy, from its middle.
fn fibres(detail: &Plane, spacing: f64, size: DVec2) -> Vec<Vec<Stick>> {
    let orientation = Orientation::of(detail, narrow(spacing));
    let middle = 0.5 * DVec2::new(double(detail.width - 1), double(detail.height - 1));
    let off = |x: usize, y: usize| DVec2::new(double(x), double(y)) - middle;
    let mask = Plane::from_fn(detail.width, detail.height, |x, y| {
        let is_in = off(x, y).abs().cmple(0.5 * size).all() && orientation.is_clear(x, y);
        f32::from(u8::from(is_in))
    });
    let from_middle = |stick: Stick| Stick { middle: stick.middle - middle, ..stick };
    let sticks =
        sticks::filled(&mask, |x, y| orientation.way(x, y), STICK * spacing, APART * spacing);
    trace::traced(&sticks.into_iter().map(from_middle).collect::<Vec<_>>(), STICK * spacing)
}
