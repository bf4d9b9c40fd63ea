//! Step 7, maps: what the surface of the unit is like, beside its colour.
//!
//! In: the unit, the yarn's width and middle row. Out: [`SurfaceMaps`], maps of the unit's size that
//! tile along the yarn.
//!
//! Heights are those of a round yarn, half as high as wide, round between the flanks of each
//! column, with plies and fibres from its brightness once the light is flattened: what is deep gets
//! less light. Normals come from them by Scharr's operator (the reader's own, so that both agree).
//! Occlusion is how far a place lies below its surroundings, at several scales (Luft, Colditz and
//! Deussen 2006). Fibres are dull, in the grooves more so, and no metal. Cost: some thirty passes,
//! 20 bytes a texel.
//!
//! Not promised: real heights; a photo has none. Coloured patterns are taken for relief.

use image::{GrayImage, Luma, RgbaImage};

use super::super::{Grey, normals};
use crate::plane::{Plane, byte, float, narrow, percentile, side, whole};

/// Share of a round yarn's height that plies and fibres make.
const RELIEF: f32 = 0.3;
/// Radius of the smoothing before brightness becomes height, in widths of the yarn: noise is no
/// relief.
const SMOOTHED: f64 = 0.015;
/// Greys between these shares of the pixels become relief.
const RANGE: (f32, f32) = (0.03, 0.97);
/// Columns to both sides over which a flank's place is a mean, in widths of the yarn.
const FLANK_MEANS: [f64; 2] = [0.02, 0.1];
/// Scales of occlusion, in widths of the yarn, each with its strength.
const SCALES: [(f64, f32); 3] = [(0.04, 1.5), (0.1, 1.2), (0.25, 0.8)];
/// The least light that is left.
const DARKEST: f32 = 0.25;
/// Roughness of fibres, and by how much grooves are rougher and ridges smoother.
const ROUGHNESS: (f32, f32) = (191.0, 20.0);

/// Maps beside the base colour.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceMaps {
    /// White half the picture's width above black.
    pub height: Grey,
    /// OpenGL's way.
    pub normal: RgbaImage,
    /// Perceived roughness.
    pub roughness: GrayImage,
    /// Share of metal.
    pub metallic: GrayImage,
    /// Share of the sky's light that arrives.
    pub occlusion: GrayImage,
}

/// The surface of a unit whose yarn is `width` wide around row `middle`.
pub(super) fn surface(unit: &RgbaImage, middle: f64, width: f64) -> SurfaceMaps {
    let relief = relief(unit, width);
    let columns = unit.width() as usize;
    let rows = unit.height() as usize;
    let flanks = flanks(unit, middle, width);
    let shape = Plane::from_fn(columns, rows, |x, y| {
        let [top, bottom] = flanks[x];
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

/// Where the yarn begins and ends in each column, without the fibres that stand off. Plies bulge: a
/// yarn that were as wide everywhere would cut them off.
fn flanks(unit: &RgbaImage, middle: f64, width: f64) -> Vec<[f32; 2]> {
    let (columns, rows) = (unit.width() as usize, unit.height() as usize);
    let start = whole(narrow(middle)).min(rows - 1);
    let is_yarn = |x: usize, y: &usize| alpha(unit, x, *y) >= 0.5;
    let top = |x: usize| {
        float((0..start).rev().take_while(|y| is_yarn(x, y)).last().unwrap_or(start)) - 0.5
    };
    let bottom =
        |x: usize| float((start..rows).take_while(|y| is_yarn(x, y)).last().unwrap_or(start)) + 0.5;
    // The wider mean takes no part where plies bulge, and rounds the notches between them.
    let smooth = |edge: &(dyn Fn(usize) -> f32 + Sync), outer: fn(f32, f32) -> f32| {
        let plane = Plane::from_fn(columns, 1, |x, _| edge(x));
        let [near, wide] =
            FLANK_MEANS.map(|mean| plane.blurred(whole(narrow(mean * width)).max(1), true).values);
        near.into_iter().zip(wide).map(move |(near, wide)| outer(near, wide))
    };
    smooth(&top, f32::min)
        .zip(smooth(&bottom, f32::max))
        .map(|(top, bottom)| [top, bottom])
        .collect()
}

/// How far the brightness of the yarn lies between dark and light, 0..1.
fn relief(unit: &RgbaImage, width: f64) -> Plane {
    let (columns, rows) = (unit.width() as usize, unit.height() as usize);
    let light = Plane::from_fn(columns, rows, |x, y| {
        let [r, g, b, _] = unit.get_pixel(side(x), side(y)).0;
        crate::plane::luma(image::Rgb([r, g, b]))
    });
    let light = light.blurred(whole(narrow(SMOOTHED * width)), true);
    let mut yarn: Vec<f32> = (0..columns * rows)
        .filter(|at| alpha(unit, at % columns, at / columns) >= 1.0)
        .map(|at| light.values[at])
        .collect();
    let (low, high) = (percentile(&mut yarn, RANGE.0), percentile(&mut yarn, RANGE.1));
    let range = (high - low).max(1.0);
    light.map(|value| {
        let share = ((value - low) / range).clamp(0.0, 1.0);
        // Level at both ends: clamping alone leaves creases.
        share * share * (3.0 - 2.0 * share)
    })
}

/// Light that arrives in hollows, of all that could.
fn occlusion(shape: &Plane, width: f64) -> Plane {
    let mut light = shape.map(|_| 1.0);
    for (scale, strength) in SCALES {
        let around = shape.blurred(whole(narrow(scale * width)).max(1), true);
        let values = light.values.iter().zip(&around.values).zip(&shape.values);
        light.values = values
            .map(|((light, around), own)| light * (1.0 - strength * (around - own).max(0.0)))
            .collect();
    }
    light.map(|light| light.clamp(DARKEST, 1.0))
}

fn grey(plane: &Plane, of: impl Fn(f32) -> f32) -> GrayImage {
    GrayImage::from_fn(side(plane.width), side(plane.height), |x, y| {
        Luma([byte(of(plane.at(x as usize, y as usize)))])
    })
}

fn alpha(unit: &RgbaImage, x: usize, y: usize) -> f32 {
    f32::from(unit.get_pixel(side(x), side(y)).0[3]) / 255.0
}

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
