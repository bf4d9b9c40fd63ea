//! Conversion of a yarn's texture for tubes.
//!
//! In: [`Maps`] of a yarn seen from one side, with its fuzz and the background beside it. Out: maps
//! that wrap around a tube. They show the yarn alone: from its centre line over one flank to the
//! back, and over the other flank back to the centre line. The back repeats the front. A texture
//! that is yarn from edge to edge shows a surface and not a view of a yarn, and stays as it is.
//! Cost: one pass over the pictures.
//!
//! Not promised: the true appearance of the back. A photo has only one side.

use std::f32::consts::TAU;
use std::ops::Range;

use glam::{Vec3, Vec4, Vec4Swizzles};
use image::{Rgba, RgbaImage};

use super::maps::Maps;
use super::mips::{MapKind, Mips};
use super::tone::byte;
use crate::shape::Shape;

/// Fraction of the yarn's half width that is used. Near the outlines a photo has little yarn and
/// much fuzz; at 1, the flanks of tubes would show the background.
const SHOWN_WIDTH: f32 = 0.88;
/// Coverage from which a row belongs to the yarn, as a fraction of the best row's. Lower values
/// take fuzz for yarn; higher ones cut the flanks.
const MIN_COVERAGE: f32 = 0.6;
/// Limit of the slopes of normals. Steeper ones come from noise at the outlines.
const MAX_SLOPE: f32 = 1.0;

impl Maps {
    /// The textures for yarns of this shape: unchanged for ribbons, wrapped around for tubes.
    #[must_use]
    pub fn for_shape(self, shape: Shape) -> Self {
        let rows = yarn_rows(&self.base.levels[0]);
        let height = self.base.levels[0].height();
        if shape == Shape::Ribbon || rows == (0..height) {
            return self;
        }
        // All three maps share one mapping, so that they stay aligned.
        let around = TubeMapping::new(&rows, height);
        let lean = mean_slopes(&self.normal.levels[0]);
        let base = around.remap(&self.base.levels[0], |color, _, _| color.xyz().extend(1.0));
        let normal = around.remap(&self.normal.levels[0], |normal, row, side| {
            without_slope(normal, lean[row as usize], side)
        });
        let surface = around.remap(&self.surface.levels[0], |value, _, _| value);
        Self {
            base: Mips::new(base, MapKind::Color),
            normal: Mips::new(normal, MapKind::Normal),
            surface: Mips::new(surface, MapKind::Plain),
            ..self
        }
    }
}

/// An encoded normal without the mean slope `lean` across the yarn of its row. The tube is round
/// already, so the roundness that a photo shows must not count twice. `side` is the row's
/// orientation.
fn without_slope(normal: Vec4, lean: f32, side: f32) -> Vec4 {
    let normal = normal.xyz() * 2.0 - 1.0;
    let slopes = normal.truncate() / normal.z.max(1e-3);
    let across = side * (slopes.y - lean);
    let slopes = glam::Vec2::new(slopes.x, across)
        .clamp(glam::Vec2::splat(-MAX_SLOPE), glam::Vec2::splat(MAX_SLOPE));
    (slopes.extend(1.0).normalize() * 0.5 + Vec3::splat(0.5)).extend(1.0)
}

/// Rows that show yarn, from the first to the last that is covered well enough.
fn yarn_rows(base: &RgbaImage) -> Range<u32> {
    let rows: Vec<f32> = (0..base.height())
        .map(|row| (0..base.width()).map(|x| f32::from(base.get_pixel(x, row).0[3])).sum())
        .collect();
    // Relative to the best row, because a loose yarn covers no row fully.
    let least = MIN_COVERAGE * rows.iter().copied().fold(0.0, f32::max);
    let mut yarn = (0..base.height()).filter(|row| rows[*row as usize] >= least);
    let first = yarn.next().unwrap_or(0);
    let last = yarn.next_back().unwrap_or(first);
    if rows.is_empty() { first..base.height() } else { first..last + 1 }
}

/// Mean slope across the yarn in each row of normals.
fn mean_slopes(normals: &RgbaImage) -> Vec<f32> {
    let mut means = Vec::new();
    for row in 0..normals.height() {
        // The mean slope of a row is the yarn's roundness there.
        let slopes = (0..normals.width()).map(|x| slope_across(*normals.get_pixel(x, row)));
        means.push(slopes.sum::<f32>() / normals.width() as f32);
    }
    means
}

/// Slope across the yarn of an encoded normal.
fn slope_across(normal: Rgba<u8>) -> f32 {
    let [_, y, z, _] = normal.0.map(|byte| f32::from(byte) / 127.5 - 1.0);
    y / z.max(0.1)
}

/// Source row of each row of the tube's texture.
struct TubeMapping {
    /// The row, and its orientation: 1, or -1 where it is mirrored.
    rows: Vec<(u32, f32)>,
}

impl TubeMapping {
    /// Orthographic projection of a cylinder: the row at angle t around the tube shows the photo's
    /// row at sin t.
    fn new(yarn: &Range<u32>, height: u32) -> Self {
        // Centre line and usable half width of the yarn, rows.
        let (middle, half) = (
            0.5 * (yarn.start + yarn.end) as f32,
            0.5 * SHOWN_WIDTH * (yarn.end - yarn.start) as f32,
        );
        let mut rows = Vec::new();
        for row in 0..height {
            let (sin, cos) = (TAU * (row as f32 + 0.5) / height as f32).sin_cos();
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "within the yarn's rows"
            )]
            let source = (middle + half * sin) as u32;
            // The back repeats the front, mirrored.
            rows.push((source.min(height - 1), if cos < 0.0 { -1.0 } else { 1.0 }));
        }
        Self { rows }
    }

    /// The texture around the tube. `convert` changes each value; it receives the source row and
    /// its orientation.
    fn remap(&self, picture: &RgbaImage, convert: impl Fn(Vec4, u32, f32) -> Vec4) -> RgbaImage {
        RgbaImage::from_fn(picture.width(), picture.height(), |x, y| {
            let (row, side) = self.rows[y as usize];
            let value =
                Vec4::from_array(picture.get_pixel(x, row).0.map(|byte| f32::from(byte) / 255.0));
            Rgba(convert(value, row, side).to_array().map(byte))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A round yarn in the middle half of 32 rows, darker at its upper flank, with a step along it.
    fn maps() -> Maps {
        let base = RgbaImage::from_fn(16, 32, |_, y| {
            Rgba([
                if y < 14 { 90 } else { 200 },
                80,
                60,
                if (8..24).contains(&y) { 255 } else { 20 },
            ])
        });
        let normal = RgbaImage::from_fn(16, 32, |x, y| {
            let across = (15.5 - y as f32) / 8.0;
            let round = Vec3::new(if x == 4 { -0.5 } else { 0.0 }, across.clamp(-0.7, 0.7), 1.0)
                .normalize();
            let [r, g, b] = (round * 0.5 + 0.5).to_array().map(byte);
            Rgba([r, g, b, 255])
        });
        let surface = RgbaImage::from_pixel(16, 32, Rgba([255, 190, 0, 255]));
        let (base, normal, surface) = (
            Mips::new(base, MapKind::Color),
            Mips::new(normal, MapKind::Normal),
            Mips::new(surface, MapKind::Plain),
        );
        Maps { base, normal, surface, length: 1.0, width: 0.5 }
    }

    #[test]
    fn a_tube_wears_the_yarn_without_its_ground_and_closes() {
        let tube = maps().for_shape(Shape::Tube);
        let base = &tube.base.levels[0];
        assert!(base.pixels().all(|pixel| pixel.0[3] == 255 && pixel.0[1] == 80));
        // From the middle over the lower flank to the back's middle, and over the upper one home.
        let red: Vec<u8> = (0..32).map(|y| base.get_pixel(3, y).0[0]).collect();
        assert_eq!((red[0], red[8], red[15], red[24], red[31]), (200, 200, 200, 90, 200));
        assert!((1..15).all(|y| red[y] == red[15 - y]), "the back is the front: {red:?}");
    }

    #[test]
    fn roundness_is_the_tubes_own_and_what_stands_along_stays() {
        let tube = maps().for_shape(Shape::Tube);
        for y in 0..32 {
            let [x, y, _, _] = tube.normal.levels[0].get_pixel(9, y).0;
            assert!(x.abs_diff(128) < 2 && y.abs_diff(128) < 12, "{x} {y}");
        }
        assert!(tube.normal.levels[0].get_pixel(4, 0).0[0] < 90);
    }

    #[test]
    fn ribbons_and_pictures_of_a_whole_surface_stay() {
        assert_eq!(maps().for_shape(Shape::Ribbon), maps());
        let whole = Maps {
            base: Mips::new(RgbaImage::from_pixel(16, 32, Rgba([9, 9, 9, 255])), MapKind::Color),
            ..maps()
        };
        assert_eq!(whole.clone().for_shape(Shape::Tube), whole);
    }
}
