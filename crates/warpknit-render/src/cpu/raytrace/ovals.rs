//! The sections of flattened yarns, as lanes take them.
//!
//! In: [`YarnPaths`] with sections. Out: [`Ovals`], the vectors of eight consecutive pieces at a
//! time. Memory: 12 bytes a point.

use glam::Vec3;

use super::strip::eight;
use crate::bvh::lanes::{Eight, LANES, Lanes3};
use crate::oval::Oval;
use crate::paths::YarnPaths;

/// Coordinates of the vectors of sections ([`crate::oval`]), an array for each, so that lanes take
/// eight of them as they lie.
#[derive(Debug)]
pub(super) struct Ovals([Vec<f32>; 3]);

impl Ovals {
    /// The sections of pieces. `None` where all are round.
    pub(super) fn new(paths: &YarnPaths) -> Option<Self> {
        if paths.ovals.is_empty() {
            return None;
        }
        // Lanes also load what lies behind the last pieces.
        let vectors = paths.ovals.iter().map(|oval| oval.unpack().vector());
        let padded = vectors.chain([Vec3::ZERO; LANES]);
        Some(Self([0, 1, 2].map(|axis| padded.clone().map(|vector| vector[axis]).collect())))
    }

    /// The section of the piece that starts at point `start`.
    pub(super) fn of(&self, start: u32) -> Oval {
        Oval::new(Vec3::from_array([0, 1, 2].map(|axis| self.0[axis][start as usize])))
    }

    /// The vectors of the eight pieces that start at the points from `first` on.
    #[inline(always)]
    pub(super) fn lanes<S: Eight>(&self, first: u32, simd: S) -> Lanes3<S> {
        let [x, y, z] = &self.0;
        Lanes3 { x: eight(simd, x, first), y: eight(simd, y, first), z: eight(simd, z, first) }
    }
}
