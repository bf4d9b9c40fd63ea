//! A warp knit's repeat on straight wales, and how its wales would bend.
//!
//! In: a [`Fabric`] of guide bars. Out: a [`Pattern`] whose stitches stand upright, and the places
//! of the bent wales' control points. On straight wales a stitch of a fully threaded bar depends on
//! its own lap and the next one alone, so that programs which try many lappings can draw each
//! stitch once. Cost: that of a draft without the lattice, and that of the lattice.
//!
//! Not promised: yarns that keep clear of each other.

use glam::DVec2;

use super::Pattern;
use super::lattice::WaleLattice;
use super::making::DRAFT_RADIUS;
use super::stitch::StitchLayout;
use crate::fabric::Fabric;

impl Pattern {
    /// The repeat of a warp knit as laid out on straight wales, its yarns not relaxed. `None` for
    /// other fabrics.
    ///
    /// ```
    /// use warpknit_core::{fabric::Fabric, knit::Pattern};
    /// assert!(Pattern::upright(&Fabric::named("tricot").unwrap()).is_some());
    /// assert!(Pattern::upright(&Fabric::named("jersey").unwrap()).is_none());
    /// ```
    #[must_use]
    pub fn upright(fabric: &Fabric) -> Option<Self> {
        let knit = fabric.warp_knit()?;
        let lattice = WaleLattice::straight(fabric, fabric.threading_repeat(), fabric.repeat());
        let layout = StitchLayout::new(fabric, knit, DRAFT_RADIUS * fabric.radius());
        let mut pattern = Self::laid_out(fabric, knit, &layout, &lattice);
        pattern.measure_bounds();
        Some(pattern)
    }
}

/// By how much each wale of the repeat is bent in each course, mm, wale after wale: the places of
/// [`Pattern::draft`] less those of [`Pattern::upright`]. Empty for fabrics without guide bars.
///
/// ```
/// use warpknit_core::{fabric::Fabric, knit::upright::leans};
/// let leans = leans(&Fabric::named("tricot-closed").unwrap());
/// // The underlaps of its one bar pull the wale to and fro.
/// assert!((leans[0] + leans[1]).length() < 1e-3 && leans[0].x.abs() > 0.01);
/// ```
#[must_use]
pub fn leans(fabric: &Fabric) -> Vec<DVec2> {
    let Some(knit) = fabric.warp_knit() else { return Vec::new() };
    let straight = WaleLattice::straight(fabric, fabric.threading_repeat(), fabric.repeat());
    WaleLattice::relaxed(fabric, knit).moved_from(&straight)
}
