//! Strained cloth: where the yarns of a repeat lie when the cloth is stretched or sheared.
//!
//! In: a fabric and its relaxed [`Pattern`]. Out: a [`StrainTable`], which tells for any in-plane
//! [`Strain`] of the cloth by how much each data point moves within it.
//!
//! Yarn hardly stretches. When cloth is pulled its loops open, their legs straighten and underlaps
//! turn. A repeat is solved over a grid of strains (`grid`): each span keeps its length, yarns keep
//! apart, and bends yield (`solver`, `contacts`). Where loops leave their old ones the cloth is
//! locked (`link_check`). Linear equations are solved by their profile
//! (`profile`). The table interpolates between the solved knots (`table`).
//!
//! Source: Sperl, Narain and Wojtan 2021, "Mechanics-aware deformation of yarn pattern geometry".
//! Nothing here knows of garments. Cost: some twenty milliseconds a knot for two bars. Not promised:
//! yarn's friction, or the history of how the cloth was pulled.

mod contacts;
mod grid;
mod link_check;
mod profile;
pub mod pull;
mod rest;
mod solver;
mod spans;
mod stored;
mod table;

use std::collections::BTreeSet;

use glam::{DMat2, DVec2};

use super::chain::ControlChain;
use super::making::yarn_length;
use super::relax::YarnLength;
use super::repeat::RepeatYarn;
use super::{Pattern, as_vec};
use crate::fabric::{Fabric, Structure};
use link_check::LinkCheck;
use rest::{Rest, RestYarn};
pub(crate) use spans::RepeatSpans;
pub use table::{Lookup, StrainTable};

/// Weights of the pull towards the flat shape. Without it the same strain reached in two ways gives
/// shapes that lie half a radius apart; above 0.6 yarn lengths suffer. Loops of weft knits are so
/// free that a tenth of it serves.
const WARP_PULL: f64 = 0.4;
const WEFT_PULL: f64 = 0.05;
/// How far points are moved aside before a strain is solved, in radii. Loops of weft knits are their
/// own mirror images, and pulled cloth would stay so: the solver stopped at a saddle, where jersey
/// pulled by a tenth along courses stretches its yarn by 2 %. With 0.02 and less it still may; 0.03 to
/// 0.1 serve. Lappings lean by themselves.
const WARP_NUDGE: f64 = 0.0;
const WEFT_NUDGE: f64 = 0.05;

/// A strain of the cloth within its plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strain {
    /// Ratio of strained to flat length along the courses: across the wales.
    pub courses: f64,
    /// The same along the wales.
    pub wales: f64,
    /// Sine of the angle by which courses and wales leave the right angle.
    pub shear: f64,
}

impl Strain {
    /// Flat cloth.
    pub const NONE: Self = Self { courses: 1.0, wales: 1.0, shear: 0.0 };

    /// The map from flat places to strained ones. Courses stay along x.
    fn map(self) -> DMat2 {
        let upright = (1.0 - self.shear * self.shear).sqrt();
        DMat2::from_cols(
            DVec2::new(self.courses, 0.0),
            self.wales * DVec2::new(self.shear, upright),
        )
    }

    /// The largest of the differences along each axis.
    fn distance(self, other: Self) -> f64 {
        let apart =
            [self.courses - other.courses, self.wales - other.wales, self.shear - other.shear];
        apart.into_iter().map(f64::abs).fold(0.0, f64::max)
    }

    /// A share of the way to another strain.
    fn towards(self, other: Self, share: f64) -> Self {
        let mix = |from: f64, to: f64| from + share * (to - from);
        Self {
            courses: mix(self.courses, other.courses),
            wales: mix(self.wales, other.wales),
            shear: mix(self.shear, other.shear),
        }
    }
}

impl StrainTable {
    /// The table of a fabric's repeat, nothing of it solved yet. Nothing where the repeat was not
    /// relaxed, or is laid cloth.
    ///
    /// ```
    /// use warpknit_core::fabric::Fabric;
    /// use warpknit_core::knit::{Pattern, strain::{Strain, StrainTable}};
    /// let jersey = Fabric::named("jersey").unwrap();
    /// let table = StrainTable::new(&jersey, &Pattern::new(&jersey)).unwrap();
    /// // Flat cloth is met exactly.
    /// assert_eq!(table.at(Strain::NONE).offset(0).length(), 0.0);
    /// let pulled = Strain { courses: 1.15, ..Strain::NONE };
    /// assert!(table.at(pulled).offset(0).length() > 0.0 && !table.at(pulled).is_locked());
    /// ```
    #[must_use]
    pub fn new(fabric: &Fabric, pattern: &Pattern) -> Option<Self> {
        let yarns = pattern.repeat.yarns.iter();
        let elastic: BTreeSet<_> =
            yarns.filter(|yarn| is_elastic(fabric, yarn)).map(|yarn| yarn.bar).collect();
        let rest = rest_of(fabric, pattern)?;
        let links = LinkCheck::new(fabric, pattern);
        Some(Self::of(rest, links, elastic.into_iter().collect()))
    }
}

/// The repeat at rest. Nothing where it can't be strained.
fn rest_of(fabric: &Fabric, pattern: &Pattern) -> Option<Rest> {
    let (pull, nudge) = match &fabric.structure {
        Structure::Warp(_) => (WARP_PULL, WARP_NUDGE),
        Structure::Weft(_) => (WEFT_PULL, WEFT_NUDGE),
        Structure::Laid(_) => return None,
    };
    pattern.relaxation()?;
    let thickness = fabric.thickness();
    let yarns = pattern.repeat.yarns.iter().map(|yarn| RestYarn {
        chain: ControlChain {
            points: pattern.repeat.points_of(yarn),
            period: yarn.period,
            radius: thickness[yarn.bar] * fabric.radius(),
        },
        is_elastic: is_elastic(fabric, yarn),
    });
    let cell = pattern.spacing * as_vec(pattern.size[0], pattern.size[1]);
    let points = pattern.repeat.points.clone();
    Some(Rest { nudge, ..Rest::new(points, yarns.collect(), cell, pull) })
}

/// Whether a yarn may change its length: elastane stretches with the cloth, and slack is yarn to
/// spare.
fn is_elastic(fabric: &Fabric, yarn: &RepeatYarn) -> bool {
    fabric.yarn(yarn.bar).draft.is_some()
        || matches!(yarn_length(fabric, yarn), YarnLength::Slack(_))
}
