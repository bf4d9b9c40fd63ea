//! Whole numbers in place of floats in a `.glb` (Khronos Group, extension `KHR_mesh_quantization`).
//!
//! In: positions in m, and the box of the panel that they lie on. Out: a [`Grid`] of cubes with
//! their places in 16 bits, and normals in 8. A node's translation and scale lead back to metres. A
//! place is off by at most half a cube.
//!
//! The grid is known before the first yarn is laid: it is that of the panel, with a margin for yarn
//! that lies on it. What comes out of the margin starts a grid of its own, in a node of its own.

use glam::{U16Vec3, Vec3};

/// The name of the extension, without which such a file can't be read.
pub(super) const QUANTIZATION: &str = "KHR_mesh_quantization";

/// The greatest share of the yarn's radius by which a place may be off. With a 32nd the cubes can't
/// be made out in close-ups; with an 8th tubes look dented.
const MOST_OFF: f32 = 1.0 / 32.0;
/// Radii of yarn that the grid goes on beyond the panel.
const MARGIN: f32 = 12.0;

/// A grid of cubes of 2^16 places a side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid {
    /// Its lowest corner, m.
    pub(super) low: Vec3,
    /// Length of its cubes, m.
    pub(super) step: f32,
}

impl Grid {
    /// The grid around a panel, if it is known, and around some positions, for yarn of that radius.
    /// `None` where it would be too coarse.
    pub(super) fn around(panel: Option<&[Vec3; 2]>, own: [Vec3; 2], radius: f32) -> Option<Self> {
        let margin = Vec3::splat(MARGIN * radius);
        let [mut low, mut high] = own;
        if let Some(panel) = panel {
            (low, high) = (low.min(panel[0] - margin), high.max(panel[1] + margin));
        }
        // A little more than needed, since the places of the highest corner are rounded.
        let step = (high - low).max_element() / 65_534.0;
        let is_fine = step > 0.0 && 0.5 * step <= MOST_OFF * radius;
        is_fine.then_some(Self { low, step })
    }

    /// Whether it holds a box.
    pub(super) fn holds(&self, [low, high]: [Vec3; 2]) -> bool {
        let end = self.low + Vec3::splat(65_535.0 * self.step);
        low.cmpge(self.low).all() && high.cmple(end).all()
    }

    /// The place of a position, padded to a multiple of four bytes as the extension wants it.
    pub(super) fn place(&self, position: Vec3) -> [u16; 4] {
        let [x, y, z] = self.rounded(position).to_array();
        [x, y, z, 0]
    }

    /// The same in whole numbers of `f32`, for bounds.
    pub(super) fn corner(&self, position: Vec3) -> Vec3 {
        self.rounded(position).as_vec3()
    }

    /// The nearest place. Half more without its fraction: `f32::round` is the call of a function
    /// where processors lack the instruction for it.
    fn rounded(&self, position: Vec3) -> U16Vec3 {
        ((position - self.low) / self.step + Vec3::splat(0.5)).as_u16vec3()
    }
}

/// A unit normal in 8 bits a coordinate, padded to four bytes.
pub(super) fn quantised_normal(normal: Vec3) -> [i8; 4] {
    // The nearest whole number, as in `Grid::rounded`. Those below 0 are moved beyond it and back.
    let [x, y, z] = (normal * 127.0 + Vec3::splat(128.5)).as_u8vec3().to_array();
    [x, y, z, 128].map(|number| (number ^ 128).cast_signed())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_lead_back_to_their_positions() {
        let panel = [Vec3::new(-0.3, 0.5, -0.1), Vec3::new(0.4, 1.3, 0.2)];
        let grid = Grid::around(Some(&panel), panel, 4e-4).unwrap();
        for share in [0.0, 0.123, 0.5, 0.98, 1.0] {
            let position = panel[0].lerp(panel[1], share);
            let [x, y, z, _] = grid.place(position).map(f32::from);
            let back = grid.low + grid.step * Vec3::new(x, y, z);
            assert!((back - position).abs().max_element() <= 0.5 * grid.step + 1e-7);
        }
        assert!(grid.holds(panel) && !grid.holds([panel[0], panel[1] + Vec3::splat(0.1)]));
    }

    #[test]
    fn a_grid_too_coarse_for_its_yarn_is_none() {
        let panel = [Vec3::ZERO, Vec3::ONE];
        assert_eq!(Grid::around(Some(&panel), panel, 1e-4), None);
        assert_eq!(Grid::around(None, [Vec3::ZERO; 2], 1e-4), None);
    }

    #[test]
    fn a_normal_keeps_its_direction() {
        let normal = Vec3::new(0.3, -0.8, 0.5).normalize();
        let [x, y, z, _] = quantised_normal(normal).map(f32::from);
        assert!(Vec3::new(x, y, z).angle_between(normal) < 0.01);
    }
}
