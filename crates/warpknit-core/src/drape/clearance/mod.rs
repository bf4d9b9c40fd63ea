//! Clearance of draped yarns: how near they come to each other on the body.
//!
//! In: a [`Cloth`] and the radius of its yarns. Out: the [`BodyClearance`] of the whole garment.
//!
//! Method: each panel is cut into square patches (`patch`), and the yarns of each patch and of a
//! margin around it are measured together (`measure`). Yarns are cut into short segments (`arcs`)
//! and compared where they are near (`nearest`), once on the body and, where the flat cloth itself
//! has near yarns, once flat. Swept yarns are measured while [`run`] holds those of a whole panel
//! (`swept`). Others are knitted, located and mapped once more, patch by patch, by the stages that
//! [`super::run`] uses (`relaid`). So memory does not grow with the stitches beyond what the run
//! itself takes, and any mapping is measured.
//!
//! - Only neighbours of the flat cloth are compared. Cloth that lies on cloth is left out: that is
//!   the drape's doing and not the yarns'. Yarns of two panels at a seam are left out as well.
//! - Stitches cut by the panel's edge are left out, since the rest of a stitch bends differently
//!   from a whole one.
//! - A share of yarn length counts each yarn by its length in the flat cloth. What is too near flat
//!   already is left out of it, since the mapping is not the cause.
//!
//! Cost: 19 to 26 µs a stitch on one thread, twice that where the flat cloth is looked at too, and
//! some 20 MB for each thread. Patches do not depend on threads, and their results are added in
//! order, so the answer is the same for any number of them.
//!
//! Not promised: all cuts where a drape has torn its cloth. Of over 5000 arcs around one only some
//! are compared.

mod arcs;
mod measure;
mod nearest;
mod patch;
mod relaid;
mod swept;

use super::{Block, Cloth, DrapeOptions, Stage, Totals, run_with};
use measure::Measure;
use relaid::RelaidYarns;
use swept::PanelStrands;

/// The distances between draped yarns, in figures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyClearance {
    /// Least distance between centre lines over the sum of their radii (2r for equal yarns). Under
    /// 1 yarns cut each other. It is 1.02 at most, since the search ends there.
    pub min_over_2r: f64,
    /// Pairs of path segments nearer than 1.02 of touching.
    pub pairs: u64,
    /// Pairs nearer than touching.
    pub pairs_below_1: u64,
    /// Length of all yarns that were measured, mm of flat cloth.
    pub yarn_length: f64,
    /// Length that has another yarn nearer than 0.98 of touching in the flat cloth already, mm.
    pub near_flat: f64,
    /// Length that has another yarn nearer than 0.95 of touching on the body but isn't near one
    /// flat, mm.
    pub below_95: f64,
}

impl BodyClearance {
    /// No yarn at all.
    pub const FREE: Self = Self {
        min_over_2r: 1.02,
        pairs: 0,
        pairs_below_1: 0,
        yarn_length: 0.0,
        near_flat: 0.0,
        below_95: 0.0,
    };

    /// The clearance of two sets of yarns together.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            min_over_2r: self.min_over_2r.min(other.min_over_2r),
            pairs: self.pairs + other.pairs,
            pairs_below_1: self.pairs_below_1 + other.pairs_below_1,
            yarn_length: self.yarn_length + other.yarn_length,
            near_flat: self.near_flat + other.near_flat,
            below_95: self.below_95 + other.below_95,
        }
    }

    /// Share of the yarn length that has another yarn nearer than 0.95 of touching. What is near
    /// another in the flat cloth already counts neither above nor below the line.
    #[must_use]
    pub fn share_below_95(&self) -> f64 {
        share(self.below_95, self.yarn_length - self.near_flat)
    }

    /// Share of the yarn length that is left out of [`Self::share_below_95`].
    #[must_use]
    pub fn share_near_flat(&self) -> f64 {
        share(self.near_flat, self.yarn_length)
    }
}

/// A part of a whole; 0 where there is nothing.
fn share(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { 0.0 }
}

/// Measures a cloth whose thickest yarns are drawn with `radius` mm. `progress` gets the share that
/// is done, from 0 to 1.
///
/// ```
/// use warpknit_core::{drape::{self, clearance}, fabric::Fabric};
/// let fabric = Fabric::named("tricot")?;
/// let panel = drape::swatch_panel(&fabric, 8, 10);
/// let cloth = drape::Cloth::swatch(&panel, &fabric, 8, 10);
/// let options = drape::DrapeOptions::default();
/// let found = clearance::measure(&cloth, &options, fabric.radius(), &mut |_done| ());
/// assert!(found.min_over_2r > 0.98 && found.share_below_95() == 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn measure(
    cloth: &Cloth<'_>,
    options: &DrapeOptions,
    radius: f64,
    progress: &mut dyn FnMut(f64),
) -> BodyClearance {
    if !cloth.is_swept(options) {
        return RelaidYarns::new(cloth, *options, radius).measure(progress);
    }
    let options = DrapeOptions { surface: None, ..*options };
    let deliver = &mut |_: &[Block]| Ok::<_, std::convert::Infallible>(());
    let Ok((_, clearance)) = run(cloth, &options, radius, &mut |_, done| progress(done), deliver);
    clearance
}

/// Runs the pipeline as [`super::run`] does, and measures the yarns that it delivers. They are drawn
/// with `radius` mm where they are thickest.
///
/// # Errors
/// The first error of `deliver`. Nothing is delivered or measured after it.
pub fn run<E>(
    cloth: &Cloth<'_>,
    options: &DrapeOptions,
    radius: f64,
    announce: &mut dyn FnMut(Stage, f64),
    deliver: &mut dyn FnMut(&[Block]) -> Result<(), E>,
) -> Result<(Totals, BodyClearance), E> {
    if !cloth.is_swept(options) {
        let totals = super::run(cloth, options, announce, deliver)?;
        announce(Stage::Clearance, 0.0);
        let progress = &mut |done| announce(Stage::Clearance, done);
        return Ok((totals, RelaidYarns::new(cloth, *options, radius).measure(progress)));
    }
    let measure = Measure::new(cloth, radius);
    let mut clearance = BodyClearance::FREE;
    let mut look = |blocks: &[Block], announce: &mut dyn FnMut(Stage)| {
        announce(Stage::Clearance);
        clearance = clearance.and(PanelStrands::new(&measure, blocks).measure());
    };
    let totals = run_with(cloth, options, announce, &mut look, deliver)?;
    Ok((totals, clearance))
}
