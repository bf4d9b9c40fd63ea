//! How different two pictures look when flipped between on a screen: a value in 0 to 1 for each
//! pixel.
//!
//! LDR-FLIP as in Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild, "FLIP: A
//! Difference Evaluator for Alternating Images", HPG 2020. In go two sRGB pictures of one size, out
//! comes the map. Not for high dynamic range.
//!
//! Measured against NVIDIA's `flip-evaluator` 1.7 on noise, gradients, text and cropped photographs
//! of cloth: within 3e-4 in each pixel and 5e-5 in the mean.

use glam::{Mat3, Vec2, Vec3, Vec4};
use image::{Rgb, RgbImage};
use std::f32::consts::{PI, SQRT_2};
use std::iter::repeat_n;

/// A screen 0.7 m wide of 3840 pixels, seen from 0.7 m.
const PIXELS_PER_DEGREE: f32 = 3840.0 * PI / 180.0;

/// Contrast sensitivity as sums of Gaussians `a √(π/b) exp(-π² d²/b)` in degrees: `a` and `b` of
/// luminance, red-green, and the two whose sum is blue-yellow.
const SENSITIVITY: [Vec4; 2] =
    [Vec4::new(1.0, 1.0, 34.1, 13.5), Vec4::new(0.0047, 0.0053, 0.04, 0.025)];
/// How far apart in degrees the flanks of a seen edge are.
const FEATURE_WIDTH: f32 = 0.082;

const COLOUR_EXPONENT: f32 = 0.7;
const FEATURE_EXPONENT: f32 = 0.5;
/// Colour differences under this share of the largest fill values up to [`SMALL_FILLS`].
const SMALL: f32 = 0.4;
const SMALL_FILLS: f32 = 0.95;

/// From linear sRGB.
const XYZ_FROM_RGB: Mat3 = Mat3::from_cols(
    Vec3::new(0.412_390_8, 0.212_639, 0.019_330_82),
    Vec3::new(0.357_584_3, 0.715_168_7, 0.119_194_8),
    Vec3::new(0.180_480_8, 0.072_192_32, 0.950_532_2),
);

/// The FLIP value of each pixel, row by row.
pub(crate) struct Difference {
    pub(crate) map: Vec<f32>,
}

impl Difference {
    pub(crate) fn mean(&self) -> f32 {
        (self.map.iter().map(|value| f64::from(*value)).sum::<f64>() / self.map.len() as f64) as f32
    }

    /// The value that `share` of the pixels, from 0 to 1, do not exceed.
    pub(crate) fn percentile(&self, share: f64) -> f32 {
        let rank = (share * (self.map.len() - 1) as f64).round() as usize;
        *self.map.clone().select_nth_unstable_by(rank, f32::total_cmp).1
    }
}

/// Compares two pictures of one size, not empty, as seen at [`PIXELS_PER_DEGREE`].
pub(crate) fn flip(reference: &RgbImage, test: &RgbImage) -> Difference {
    assert_eq!(reference.dimensions(), test.dimensions(), "FLIP compares pictures of one size");
    let width = reference.width() as usize;
    let [reference, test] = [reference, test].map(to_white);
    let colours = [&reference, &test].map(|picture| seen_colours(picture, width));
    let features = [&reference, &test].map(|picture| features(picture, width));
    let most = colour_distance(
        perceived(XYZ_FROM_RGB.y_axis / white()),
        perceived(XYZ_FROM_RGB.z_axis / white()),
    );
    let pixels = colours[0].iter().zip(&colours[1]).zip(features[0].iter().zip(&features[1]));
    let map = pixels.map(|((a, b), (p, q))| {
        let colour = spread(colour_distance(*a, *b), most);
        let feature = ((*p - *q).abs().max_element() / SQRT_2).powf(FEATURE_EXPONENT);
        colour.powf(1.0 - feature)
    });
    Difference { map: map.collect() }
}

/// XYZ of linear (1, 1, 1).
fn white() -> Vec3 {
    XYZ_FROM_RGB * Vec3::ONE
}

/// XYZ of each pixel as parts of white.
fn to_white(picture: &RgbImage) -> Vec<Vec3> {
    let linear: Vec<f32> = (0..=u8::MAX)
        .map(|byte| f32::from(byte) / 255.0)
        .map(|s| if s <= 0.04045 { s / 12.92 } else { ((s + 0.055) / 1.055).powf(2.4) })
        .collect();
    let from_rgb = Mat3::from_diagonal(white().recip()) * XYZ_FROM_RGB;
    picture
        .pixels()
        .map(|pixel| from_rgb * Vec3::from(pixel.0.map(|byte| linear[usize::from(byte)])))
        .collect()
}

/// What is left of the colours at this distance, in a space where distances are as perceived.
///
/// The paper filters YCxCz. Its scales and offsets cancel on the way back, so here are the bare
/// opponents: Y, X - Y, Y - Z.
fn seen_colours(picture: &[Vec3], width: usize) -> Vec<Vec3> {
    let [heights, widths] = SENSITIVITY;
    let deviation = (widths.max_element() / (2.0 * PI * PI)).sqrt();
    let mut kernel = sample((3.0 * deviation * PIXELS_PER_DEGREE).ceil(), |pixels| {
        let degrees = pixels / PIXELS_PER_DEGREE;
        (-(PI * degrees).powi(2) / widths).exp()
    });
    let sum: Vec4 = kernel.iter().sum();
    kernel.iter_mut().for_each(|weight| *weight /= sum);
    // Both blue-yellow Gaussians were brought to 1; together they make 1 in the ratio of their
    // volumes.
    let volumes = heights * (PI / widths).powf(0.5) * sum * sum;
    let shares = Vec2::new(volumes.z, volumes.w) / (volumes.z + volumes.w);

    let opponents: Vec<Vec4> =
        picture.iter().map(|c| Vec4::new(c.y, c.x - c.y, c.y - c.z, c.y - c.z)).collect();
    let rgb_from_white = XYZ_FROM_RGB.inverse() * Mat3::from_diagonal(white());
    let white_from_rgb = rgb_from_white.inverse();
    let perceive = |seen: Vec4| {
        let xyz =
            Vec3::new(seen.y + seen.x, seen.x, seen.x - shares.dot(Vec2::new(seen.z, seen.w)));
        perceived(white_from_rgb * (rgb_from_white * xyz).clamp(Vec3::ZERO, Vec3::ONE))
    };
    filter(&opponents, width, &kernel, &kernel).into_iter().map(perceive).collect()
}

/// L*a*b* of XYZ as parts of white, less colourful the darker (Hunt).
fn perceived(xyz: Vec3) -> Vec3 {
    const CORNER: f32 = 6.0 / 29.0;
    let root = xyz.map(|t| {
        if t > CORNER.powi(3) { t.cbrt() } else { t / (3.0 * CORNER * CORNER) + 4.0 / 29.0 }
    });
    let lightness = 116.0 * root.y - 16.0;
    Vec3::new(lightness, 5.0 * lightness * (root.x - root.y), 2.0 * lightness * (root.y - root.z))
}

/// HyAB, compressed: lightness as city blocks and hue as the crow flies, which holds for large
/// differences too.
fn colour_distance(a: Vec3, b: Vec3) -> f32 {
    let apart = a - b;
    (apart.x.abs() + apart.y.hypot(apart.z)).powf(COLOUR_EXPONENT)
}

/// Maps 0 to `most`, the distance of green from blue, to 0 to 1, with most room for what is small.
fn spread(distance: f32, most: f32) -> f32 {
    let small = SMALL * most;
    if distance < small {
        distance / small * SMALL_FILLS
    } else {
        SMALL_FILLS + (distance - small) / (most - small) * (1.0 - SMALL_FILLS)
    }
}

/// How much of an edge and of a point (or line) each pixel is.
fn features(picture: &[Vec3], width: usize) -> Vec<Vec2> {
    let deviation = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
    let radius = (3.0 * deviation).ceil();
    // Lanes: edges across and down, points across and down. The derivatives are along one axis, and
    // the other is smoothed.
    let mut kernel = sample(radius, |pixels| {
        let at = pixels / deviation;
        let gauss = (-0.5 * at * at).exp();
        Vec4::new(-at, 1.0, at * at - 1.0, 1.0) * gauss
    });
    let rises: Vec4 = kernel.iter().map(|weight| weight.max(Vec4::ZERO)).sum();
    let falls: Vec4 = kernel.iter().map(|weight| (-weight).max(Vec4::ZERO)).sum();
    for weight in &mut kernel {
        *weight = weight.max(Vec4::ZERO) / rises
            + weight.min(Vec4::ZERO) / falls.max(Vec4::splat(f32::MIN_POSITIVE));
    }
    let turned: Vec<Vec4> =
        kernel.iter().map(|weight| Vec4::new(weight.y, weight.x, weight.w, weight.z)).collect();
    let luminance: Vec<Vec4> = picture.iter().map(|colour| Vec4::splat(colour.y)).collect();
    let slopes = filter(&luminance, width, &kernel, &turned);
    slopes
        .into_iter()
        .map(|slope| Vec2::new(slope.x.hypot(slope.y), slope.z.hypot(slope.w)))
        .collect()
}

/// A function of the distance in pixels, at -`radius` to `radius`.
fn sample(radius: f32, function: impl Fn(f32) -> Vec4) -> Vec<Vec4> {
    let radius = radius as i16;
    (-radius..=radius).map(|pixels| function(f32::from(pixels))).collect()
}

/// Filters each lane by its own kernels, `across` rows and then `down` columns. Edges go on
/// outwards.
fn filter(picture: &[Vec4], width: usize, across: &[Vec4], down: &[Vec4]) -> Vec<Vec4> {
    let radius = across.len() / 2;
    let mut rows = Vec::with_capacity(picture.len());
    for row in picture.chunks_exact(width) {
        let [before, after] = [row[0], row[width - 1]].map(|edge| repeat_n(edge, radius));
        let row: Vec<Vec4> = before.chain(row.iter().copied()).chain(after).collect();
        rows.extend(row.windows(across.len()).map(|near| {
            let mut sum = Vec4::ZERO;
            for (value, weight) in near.iter().zip(across) {
                sum += *value * *weight;
            }
            sum
        }));
    }
    let last = picture.len() / width - 1;
    let mut filtered = vec![Vec4::ZERO; picture.len()];
    for (y, sums) in filtered.chunks_exact_mut(width).enumerate() {
        for (tap, weight) in down.iter().enumerate() {
            let near = (y + tap).saturating_sub(radius).min(last);
            for (sum, value) in sums.iter_mut().zip(&rows[near * width..]) {
                *sum += *value * *weight;
            }
        }
    }
    filtered
}

/// A small picture that any language can make again: whole numbers only.
fn picture(shade: impl Fn(u32, u32) -> [u8; 3]) -> RgbImage {
    RgbImage::from_fn(64, 48, |x, y| Rgb(shade(x, y)))
}

/// Noise, another for each seed.
fn grain(x: u32, y: u32, seed: u32) -> u8 {
    let mixed = (x + 64 * y + 3072 * seed).wrapping_mul(2_654_435_761);
    ((mixed ^ (mixed >> 15)).wrapping_mul(2_246_822_519) >> 24) as u8
}

fn noise(seed: u32) -> RgbImage {
    picture(|x, y| [0, 1, 2].map(|channel| grain(x, y, seed + channel)))
}

/// Slanted stitches with hard edges.
fn stitches(shift: u32) -> RgbImage {
    picture(
        |x, y| {
            if (x + shift + (y % 12).abs_diff(6)) % 9 < 3 { [40, 30, 60] } else { [210, 180, 120] }
        },
    )
}

/// A soft change of all colours, `eighths` of it in red.
fn gradient(eighths: u32) -> RgbImage {
    picture(|x, y| [(x * 4 * eighths / 8) as u8, (y * 5) as u8, (255 - x * 4) as u8])
}

fn flat(colour: [u8; 3]) -> RgbImage {
    picture(|_, _| colour)
}

#[test]
fn identical_pictures_do_not_differ() {
    for same in [noise(0), stitches(0), flat([0; 3]), RgbImage::from_pixel(1, 1, Rgb([7, 8, 9]))] {
        assert!(flip(&same, &same).map.iter().all(|value| *value == 0.0));
    }
}

#[test]
fn flat_fields_differ_by_their_colours_alone() {
    // Black and white lie 100 apart in HyAB, and green and blue, farthest of all, 203: known in
    // closed form.
    for (a, b, expected) in [
        ([0; 3], [255; 3], 0.96739),
        ([0, 255, 0], [0, 0, 255], 1.0),
        ([255, 0, 0], [0, 255, 0], 0.98667),
    ] {
        let difference = flip(&flat(a), &flat(b));
        assert!(
            difference.map.iter().all(|value| (value - expected).abs() < 1e-4),
            "{} not {expected}",
            difference.mean()
        );
    }
}

#[test]
fn agrees_with_the_reference_implementation() {
    // Mean and 99th percentile by flip-evaluator 1.7 of the same pictures.
    for (name, reference, test, mean, p99) in [
        ("noise", noise(0), noise(3), 0.44655, 0.82003),
        ("stitches", stitches(0), stitches(1), 0.31635, 0.55424),
        ("gradient", gradient(8), gradient(7), 0.18873, 0.44536),
    ] {
        let difference = flip(&reference, &test);
        let found = [difference.mean(), difference.percentile(0.99)];
        assert!(
            Vec2::from(found).abs_diff_eq(Vec2::new(mean, p99), 2e-4),
            "{name}: {found:?} not {:?}",
            [mean, p99]
        );
    }
}

#[test]
fn neither_picture_comes_first() {
    let [there, back] = [flip(&noise(0), &stitches(0)), flip(&stitches(0), &noise(0))];
    assert!(there.map.iter().zip(&back.map).all(|(a, b)| (a - b).abs() < 1e-6));
}

#[test]
fn a_line_moved_by_a_pixel_is_seen_more_than_noise_of_its_energy() {
    let line = |at: u32| picture(|x, _| if x == at { [230; 3] } else { [128; 3] });
    // The moved line changes 2 of 64 columns by 102, and the noise all by 102 √(2/64).
    let noisy = picture(|x, y| {
        let grey: u8 = if x == 32 { 230 } else { 128 };
        [if grain(x, y, 0) < 128 { grey - 18 } else { grey + 18 }; 3]
    });
    let [moved, noisy] = [line(33), noisy].map(|test| flip(&line(32), &test).percentile(0.99));
    assert!(moved > 1.25 * noisy, "{moved} {noisy}");
}

#[test]
fn percentiles_are_ranks() {
    let difference = Difference { map: (0_u8..=100).rev().map(f32::from).collect() };
    assert_eq!(
        [0.0, 0.5, 0.99, 1.0].map(|share| difference.percentile(share)),
        [0.0, 50.0, 99.0, 100.0]
    );
    assert_eq!(difference.mean(), 50.0);
}
