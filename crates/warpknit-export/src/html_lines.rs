//! The yarns of a page: quantised centre lines, and how they lie in the page's data.
//!
//! In: blocks of draped yarns. Out: a [`PageGrid`] and bytes. A page draws a yarn as the curve of
//! [`warpknit_core::yarn::curve`] through its data points, so these are all that it needs: 8 a
//! stitch of a warp knit and 16 of a weft knit.
//!
//! Coordinates are whole numbers of 16 bits on a grid of cubes. The cubes are as large as the cloth
//! demands, or a 64th of the thinnest yarn's radius where that is more: finer ones would be noise
//! that doesn't compress. A coordinate is off by at most half a cube.
//!
//! The data, before compression, are planes of bytes, one for each number of a point:
//!
//! - x, y and z, each as all low bytes and then all high bytes of the differences from one point to
//!   the next, which are small; their signs are in the lowest bit (zigzag coding, as in Google's
//!   protocol buffers).
//! - height: where the point lies in the thickness of the flat cloth, 0 at the back and 255 at the
//!   technical face. Pages darken what lies deep.
//! - the cloth's normal beneath the point, octahedral ([`PackedUnit`]), two signed bytes.
//!
//! Heights and normals are differences too. Before the planes stand the numbers of points of all
//! strands, 4 bytes each.
//!
//! Not promised: a size. Cloth whose stitches are alike is compressed to a tenth of cloth that a
//! body shapes.

use std::io::{self, Write};

use glam::Vec3;

use warpknit_core::drape::Block;
use warpknit_core::ids::index32;
use warpknit_core::number::{byte, narrow};
use warpknit_render::octahedral::PackedUnit;

/// Cubes of the grid on a radius of the thinnest yarn, at the most.
const CUBES_PER_RADIUS: f32 = 64.0;

/// Centre lines, strand after strand.
#[derive(Debug, Default)]
pub(super) struct CentreLines {
    /// mm, from the garment's origin.
    points: Vec<Vec3>,
    /// Depth in the flat cloth, mm.
    heights: Vec<f32>,
    normals: Vec<[u8; 2]>,
    /// Points of each strand.
    strands: Vec<u32>,
    /// Bar and number of strands of successive blocks of one bar.
    runs: Vec<(usize, usize)>,
}

/// The grid on which coordinates lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PageGrid {
    /// Its lowest corner, mm.
    pub(super) low: Vec3,
    /// Length of its cubes, mm.
    pub(super) step: f32,
    /// Depth of the bytes 0 and 255, mm.
    pub(super) heights: [f32; 2],
}

impl CentreLines {
    /// Number of points.
    pub(super) fn points(&self) -> usize {
        self.points.len()
    }

    /// Number of strands.
    pub(super) fn strands(&self) -> usize {
        self.strands.len()
    }

    /// Bar and number of strands, of each run of strands of one bar.
    pub(super) fn runs(&self) -> &[(usize, usize)] {
        &self.runs
    }

    /// Appends the strands of a block.
    pub(super) fn add(&mut self, block: &Block) {
        for strand in &block.strands.strands {
            let range = strand.range();
            self.points.extend(block.draped.positions[range.clone()].iter().map(|p| p.as_vec3()));
            let mut height = 0.0;
            for &source in &block.strands.sources[range.clone()] {
                // A cut end has no data point, and lies about as deep as the point before.
                height = match block.knitted.points.get(source as usize) {
                    Some(point) => narrow(point.z),
                    None => height,
                };
                self.heights.push(height);
            }
            let normals = &block.draped.normals[range.clone()];
            self.normals.extend(normals.iter().map(|normal| octahedral(normal.as_vec3())));
            self.strands.push(index32(range.len()));
        }
        let strands = block.strands.strands.len();
        match self.runs.last_mut() {
            Some((bar, count)) if *bar == block.bar => *count += strands,
            _ => self.runs.push((block.bar, strands)),
        }
    }

    /// The grid that holds all points, where the thinnest yarn has that radius.
    pub(super) fn grid(&self, radius: f32) -> PageGrid {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for point in &self.points {
            (low, high) = (low.min(*point), high.max(*point));
        }
        if self.points.is_empty() {
            (low, high) = (Vec3::ZERO, Vec3::ZERO);
        }
        let [mut back, mut face] = [f32::INFINITY, f32::NEG_INFINITY];
        for height in &self.heights {
            (back, face) = (back.min(*height), face.max(*height));
        }
        let heights = if back < face { [back, face] } else { [-radius, radius] };
        let step =
            ((high - low).max_element() / f32::from(u16::MAX)).max(radius / CUBES_PER_RADIUS);
        PageGrid { low, step, heights }
    }

    /// Writes the data on that grid.
    pub(super) fn write(&self, grid: &PageGrid, target: &mut impl Write) -> io::Result<()> {
        for count in &self.strands {
            target.write_all(&count.to_le_bytes())?;
        }
        let mut plane = Vec::with_capacity(self.points.len());
        for axis in 0..3 {
            let mut last = 0;
            let coded: Vec<u16> = (self.points.iter())
                .map(|point| {
                    let place = grid.place(point[axis], axis);
                    zigzag(place.wrapping_sub(std::mem::replace(&mut last, place)))
                })
                .collect();
            for shift in [0, 8] {
                plane.clear();
                plane.extend(coded.iter().map(|number| (number >> shift).to_le_bytes()[0]));
                target.write_all(&plane)?;
            }
        }
        let [back, face] = grid.heights;
        let heights =
            self.heights.iter().map(|height| byte(255.0 * (height - back) / (face - back)));
        write_differences(heights, &mut plane, target)?;
        for part in 0..2 {
            let parts = self.normals.iter().map(|normal| normal[part]);
            write_differences(parts, &mut plane, target)?;
        }
        Ok(())
    }
}

impl PageGrid {
    /// The nearest place of a coordinate.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
    fn place(&self, coordinate: f32, axis: usize) -> u16 {
        ((coordinate - self.low[axis]) / self.step).round() as u16
    }
}

/// Writes a plane of bytes as differences from each to the next.
fn write_differences(
    bytes: impl Iterator<Item = u8>,
    plane: &mut Vec<u8>,
    target: &mut impl Write,
) -> io::Result<()> {
    let mut last = 0;
    plane.clear();
    plane.extend(bytes.map(|byte| byte.wrapping_sub(std::mem::replace(&mut last, byte))));
    target.write_all(plane)
}

/// A difference of either sign as a small number: 0, -1, 1, -2 become 0, 1, 2, 3.
fn zigzag(difference: u16) -> u16 {
    let sign = if difference >> 15 == 1 { u16::MAX } else { 0 };
    difference << 1 ^ sign
}

/// A unit vector as two signed bytes.
fn octahedral(normal: Vec3) -> [u8; 2] {
    let parts: [i16; 2] = bytemuck::cast(PackedUnit::new(normal));
    // From 32 767 to 127 for 1, rounded.
    parts.map(|part| {
        let byte = (i32::from(part) * 127 + 16_383 * i32::from(part).signum()) / 32_767;
        byte.to_le_bytes()[0]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zigzag_numbers_are_small_for_small_differences() {
        let differences = [0_i16, -1, 1, -2, 2, i16::MAX, i16::MIN];
        let coded = differences.map(|difference| zigzag(difference.cast_unsigned()));
        assert_eq!(coded, [0, 1, 2, 3, 4, 65_534, 65_535]);
    }

    #[test]
    fn an_octahedral_normal_is_near() {
        for v in [Vec3::Z, Vec3::NEG_Z, Vec3::new(0.3, -0.5, 0.2), Vec3::new(-0.3, 0.5, -0.9)] {
            let [x, y] = octahedral(v).map(|part| f32::from(part.cast_signed()) / 127.0);
            let z = 1.0 - x.abs() - y.abs();
            let fold = (-z).max(0.0);
            let back = Vec3::new(x - fold.copysign(x), y - fold.copysign(y), z);
            assert!(back.angle_between(v) < 0.02, "{v} became {back}");
        }
    }
}
