//! How much of the sun reaches what a pixel shows.
//!
//! In: the nearest layers of averaged cloth in the quarters of a pixel, and places of the sun. Out:
//! the fractions of the sun's light that reach the layers.

use super::QUARTERS;
use super::cloth::{Layer, LitCloth};
use crate::cpu::sample::{SampleDimension, SampleSequence, Sampler};
use warpknit_core::ids::index32;

/// Rays to the sun from each place of a body.
pub(super) const SUN_RAYS: u32 = 4;
/// Difference of the fractions of sunlight within a pixel up to which a ray a quarter tells them.
pub(super) const EVENLY_LIT: f32 = 0.05;

/// Places of the sun to which rays go from each quarter of a pixel.
pub(super) struct BodySuns(SampleSequence);

impl BodySuns {
    pub(super) fn new(sampler: &Sampler) -> Self {
        Self(sampler.pairs(SampleDimension::Sun, SUN_RAYS * index32(QUARTERS)))
    }

    /// One of a quarter.
    pub(super) fn at(&self, quarter: usize, ray: u32) -> [f32; 2] {
        self.0.at(index32(quarter) * SUN_RAYS + ray)
    }

    /// All of a quarter.
    pub(super) fn of(&self, quarter: usize) -> impl Iterator<Item = [f32; 2]> + Clone {
        (0..SUN_RAYS).map(move |ray| self.at(quarter, ray))
    }
}

/// The fraction of the sun's light that reaches the nearest cloth in each quarter of a pixel. Where
/// its vertices don't tell, there are rays. In a pixel of one stretch of cloth, a ray for each
/// quarter goes to the rim of the sun first, to another side of it. Where these differ, the shadow
/// ends, and more are needed.
pub(super) fn sunlit(
    cloth: &LitCloth<'_>,
    nearest: &[Option<Layer>; QUARTERS],
    is_even: bool,
    suns: &BodySuns,
) -> [f32; QUARTERS] {
    let soft = nearest.map(|layer| layer.map_or(Some(0.0), |layer| cloth.interpolated_sun(&layer)));
    let traced =
        |at: usize| nearest[at].as_ref().map_or(0.0, |layer| cloth.mean_sun(layer, suns.of(at)));
    if !is_even || soft.iter().all(Option::is_some) {
        return std::array::from_fn(|at| soft[at].unwrap_or_else(|| traced(at)));
    }
    let rim = std::array::from_fn(|at| {
        let sun = [1.0, at as f32 / QUARTERS as f32];
        nearest[at].as_ref().map_or(0.0, |layer| cloth.sun_at(layer, sun))
    });
    let own: [f32; QUARTERS] =
        if spread(rim) > EVENLY_LIT { std::array::from_fn(traced) } else { rim };
    [own.iter().sum::<f32>() / QUARTERS as f32; QUARTERS]
}

/// The least and the largest of some fractions.
pub(super) fn extremes<const COUNT: usize>(of: [f32; COUNT]) -> [f32; 2] {
    of.into_iter().fold([1.0, 0.0], |[least, most], one| [one.min(least), one.max(most)])
}

/// Their difference.
pub(super) fn spread<const COUNT: usize>(of: [f32; COUNT]) -> f32 {
    let [least, most] = extremes(of);
    most - least
}
