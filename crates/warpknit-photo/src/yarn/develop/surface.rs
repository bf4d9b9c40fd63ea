//! Step 7, maps: height, normal, roughness, metalness and ambient occlusion of the unit.
//!
//! In: the unit's colours, the yarn's width and middle row. Out: [`SurfaceMaps`] of the unit's
//! size, which tile along the yarn.
//!
//! Method, a heuristic ("dark is deep"): the heights are those of a round yarn, an ellipse between
//! the flanks of each column, and the brightness of the flattened colours adds the relief of plies
//! and fibres, since hollows receive less light. Normals follow from the heights by Scharr's
//! operator, the same one that [`crate::yarn::read_maps`] uses. Ambient occlusion is approximated
//! by the depth of a place below the blurred heights around it, at several scales (Luft, Colditz
//! and Deussen 2006, "Image enhancement by unsharp masking the depth buffer"). Fibres are dull,
//! grooves a little duller than ridges, and nothing is metal.
//!
//! Cost: some thirty passes, 20 bytes a texel.
//!
//! Not promised: real heights, which a photo does not contain. Dark patterns in the colour become
//! hollows.

use image::{GrayImage, Luma, RgbaImage};

use super::super::{Grey, normals};
use crate::plane::{Plane, byte, float, narrow, percentile, side, whole};

/// Share of a round yarn's height that the relief of plies and fibres takes. With much more the
/// yarn stops being round; with much less its plies do not show in the light.
const RELIEF: f32 = 0.3;
/// Radius of the smoothing before brightness becomes height, in widths of the yarn. Less leaves the
/// camera's noise as bumps, more removes the fibres.
const SMOOTHING_RADIUS: f64 = 0.015;
/// Percentiles of the yarn's brightness that become the lowest and the highest relief.
const RELIEF_PERCENTILES: (f32, f32) = (0.03, 0.97);
/// Radii of the two means along a flank, in widths of the yarn.
const FLANK_RADII: [f64; 2] = [0.02, 0.1];
/// Scales of occlusion: the radius of each blur in widths of the yarn, and its strength. They cover
/// hollows between fibres, between plies and beside the whole yarn.
const OCCLUSION_SCALES: [(f64, f32); 3] = [(0.04, 1.5), (0.1, 1.2), (0.25, 0.8)];
/// Least share of the light that arrives anywhere: yarns scatter light into their hollows.
const LEAST_LIGHT: f32 = 0.25;
/// Roughness of fibres, and by how much grooves are rougher and ridges smoother, of 255.
const ROUGHNESS: (f32, f32) = (191.0, 20.0);

/// The maps beside the base colour.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceMaps {
    /// White lies half the picture's width above black.
    pub height: Grey,
    /// Tangent-space normals, OpenGL's convention (+Y up).
    pub normal: RgbaImage,
    /// Perceived roughness.
    pub roughness: GrayImage,
    /// Share of metal.
    pub metallic: GrayImage,
    /// Share of the sky's light that arrives.
    pub occlusion: GrayImage,
}

/// The maps of a unit whose yarn is `width` wide around row `middle`.
pub(super) fn surface(unit: &RgbaImage, middle: f64, width: f64) -> SurfaceMaps {
    let relief = relief(unit, width);
    let columns = unit.width() as usize;
    let rows = unit.height() as usize;
    let flanks = flanks(unit, middle, width);
    let shape = Plane::from_fn(columns, rows, |x, y| {
        let [top, bottom] = flanks[x];
        // Cross section of a round yarn: z = √(1 - u²) with u from -1 to 1 between the flanks.
        let across = (2.0 * float(y) - top - bottom) / (bottom - top).max(1.0);
        let round = (1.0 - across * across).max(0.0).sqrt();
        round * (1.0 - RELIEF + RELIEF * relief.at(x, y)) * alpha(unit, x, y)
    });
    // A yarn as wide as the picture would reach from black to white; this one has ground beside it.
    let share = narrow(width) / float(rows);
    let height = Grey::from_fn(unit.width(), unit.height(), |x, y| {
        Luma([word(shape.at(x as usize, y as usize) * share)])
    });
    let (length, across) = (float(columns), float(rows));
    SurfaceMaps {
        normal: normals(&height, length, across),
        height,
        roughness: grey(&relief, |relief| ROUGHNESS.0 + ROUGHNESS.1 * (1.0 - 2.0 * relief)),
        metallic: GrayImage::new(unit.width(), unit.height()),
        occlusion: grey(&occlusion(&shape, width), |light| 255.0 * light),
    }
}

/// The yarn's upper and lower flank in each column, without the fibres that stand off. They follow
/// the plies, which bulge: flanks at one distance from the axis would cut them off.
fn flanks(unit: &RgbaImage, middle: f64, width: f64) -> Vec<[f32; 2]> {
    let (columns, rows) = (unit.width() as usize, unit.height() as usize);
    let start = whole(narrow(middle)).min(rows - 1);
    // Walking outward from the middle stops at the first ground, so fibres off the body don't
    // count.
    let top = Plane::from_fn(columns, 1, |x, _| {
        let inside = (0..start).rev().take_while(|&y| alpha(unit, x, y) >= 0.5);
        float(inside.last().unwrap_or(start)) - 0.5
    });
    let bottom = Plane::from_fn(columns, 1, |x, _| {
        let inside = (start..rows).take_while(|&y| alpha(unit, x, y) >= 0.5);
        float(inside.last().unwrap_or(start)) + 0.5
    });
    smooth_flank(&top, width, f32::min)
        .zip(smooth_flank(&bottom, width, f32::max))
        .map(|(top, bottom)| [top, bottom])
        .collect()
}

/// A flank's rows, smoothed: the outer one of a narrow and a wide mean. The narrow mean keeps the
/// bulge of each ply, the wide one rounds the notches between plies.
fn smooth_flank(
    flank: &Plane,
    width: f64,
    outer: fn(f32, f32) -> f32,
) -> impl Iterator<Item = f32> {
    let [near, wide] =
        FLANK_RADII.map(|radius| flank.blurred(whole(narrow(radius * width)).max(1), true).values);
    near.into_iter().zip(wide).map(move |(near, wide)| outer(near, wide))
}

/// The relief, 0..1: the yarn's brightness between its dark and its light percentile.
fn relief(unit: &RgbaImage, width: f64) -> Plane {
    let (columns, rows) = (unit.width() as usize, unit.height() as usize);
    let light = Plane::from_fn(columns, rows, |x, y| {
        let [r, g, b, _] = unit.get_pixel(side(x), side(y)).0;
        crate::plane::luma(image::Rgb([r, g, b]))
    });
    let light = light.blurred(whole(narrow(SMOOTHING_RADIUS * width)), true);
    let mut yarn: Vec<f32> = (0..columns * rows)
        .filter(|at| alpha(unit, at % columns, at / columns) >= 1.0)
        .map(|at| light.values[at])
        .collect();
    let (low, high) =
        (percentile(&mut yarn, RELIEF_PERCENTILES.0), percentile(&mut yarn, RELIEF_PERCENTILES.1));
    let range = (high - low).max(1.0);
    light.map(|value| {
        let share = ((value - low) / range).clamp(0.0, 1.0);
        // Smoothstep has slope 0 at both ends. Clamping alone would leave creases in the heights.
        share * share * (3.0 - 2.0 * share)
    })
}

/// Ambient occlusion: the share of the sky's light that arrives at each place.
fn occlusion(shape: &Plane, width: f64) -> Plane {
    let mut light = shape.map(|_| 1.0);
    // Unsharp masking of the heights: where the blurred surroundings are higher, the place is a
    // hollow and gets darker in proportion to its depth. Ridges are not made lighter.
    for (scale, strength) in OCCLUSION_SCALES {
        let around = shape.blurred(whole(narrow(scale * width)).max(1), true);
        let values = light.values.iter().zip(&around.values).zip(&shape.values);
        light.values = values
            .map(|((light, around), own)| light * (1.0 - strength * (around - own).max(0.0)))
            .collect();
    }
    light.map(|light| light.clamp(LEAST_LIGHT, 1.0))
}

/// A plane as an 8-bit picture.
fn grey(plane: &Plane, of: impl Fn(f32) -> f32) -> GrayImage {
    GrayImage::from_fn(side(plane.width), side(plane.height), |x, y| {
        Luma([byte(of(plane.at(x as usize, y as usize)))])
    })
}

/// The alpha of a texel, 0..1.
fn alpha(unit: &RgbaImage, x: usize, y: usize) -> f32 {
    f32::from(unit.get_pixel(side(x), side(y)).0[3]) / 255.0
}

/// A share as 16 bits, rounded.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
fn word(share: f32) -> u16 {
    (share * f32::from(u16::MAX) + 0.5) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgba;

    #[test]
    fn a_yarn_is_round_and_its_grooves_are_low_dark_and_rough() {
        let unit = RgbaImage::from_fn(40, 60, |x, y| {
            let grey = if x % 20 < 5 { 60 } else { 200 };
            Rgba([grey, grey, grey, if (10..50).contains(&y) { 255 } else { 0 }])
        });
        let maps = surface(&unit, 29.5, 40.0);
        let height = |x, y| maps.height.get_pixel(x, y).0[0];
        assert!(
            height(12, 30) > height(12, 15) && height(12, 15) > height(12, 5) && height(12, 5) == 0
        );
        assert!(
            height(2, 30) < height(12, 30)
                && maps.roughness.get_pixel(2, 30).0[0] > maps.roughness.get_pixel(12, 30).0[0]
        );
        assert!(maps.occlusion.get_pixel(2, 30).0[0] + 10 < maps.occlusion.get_pixel(12, 30).0[0]);
        // The upper flank looks to the top, which is green over a half.
        assert!(
            maps.normal.get_pixel(12, 14).0[1] > 160 && maps.normal.get_pixel(12, 45).0[1] < 96
        );
        assert!(maps.metallic.pixels().all(|pixel| pixel.0[0] == 0));
    }
}
