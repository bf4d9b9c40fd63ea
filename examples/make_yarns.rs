//! Draws the pictures of yarns in `meshes/yarns/`, for `--texture`.
//!
//!     cargo run --release --example make_yarns
//!
//! A picture shows one repeat of a plied yarn, x along it and y across: round plies wound around each other, fibres wound the other way in them, and
//! fuzz that thins out to both sides. Everything comes from a few numbers and a hash, so the bytes are the same each time.

use std::error::Error;
use std::f32::consts::{PI, TAU};
use std::path::Path;

use image::{GrayImage, Luma, Rgba, RgbaImage};
use warpknit::render::ply::hash;

/// Texels along one repeat and across the yarn with its fuzz.
const SIZE: (u32, u32) = (256, 128);
/// Share of the width that the yarn's core takes; the rest is fuzz.
const CORE: f32 = 0.72;
/// Fibres to be seen across a ply.
const FIBRES: f32 = 9.0;
/// Stray fibres of the fuzz in one repeat.
const STRAYS: u32 = 60;

/// A yarn to draw.
struct Yarn {
    name: &'static str,
    plies: u32,
    /// sRGB.
    color: [f32; 3],
    /// Width with the fuzz and length of one repeat, mm.
    width: f32,
    length: f32,
}

const YARNS: [Yarn; 2] = [
    Yarn { name: "two-ply", plies: 2, color: [214.0, 196.0, 164.0], width: 0.13, length: 0.26 },
    Yarn { name: "three-ply", plies: 3, color: [150.0, 66.0, 60.0], width: 0.13, length: 0.2 },
];

fn main() -> Result<(), Box<dyn Error>> {
    for yarn in &YARNS {
        let folder = Path::new("meshes/yarns").join(yarn.name);
        std::fs::create_dir_all(&folder)?;
        let (mut color, mut height) = (RgbaImage::new(SIZE.0, SIZE.1), GrayImage::new(SIZE.0, SIZE.1));
        for (x, y, texel) in color.enumerate_pixels_mut() {
            let point = yarn.at(x, y);
            let [r, g, b] = yarn.color.map(|c| byte(c * point.shade));
            *texel = Rgba([r, g, b, byte(255.0 * point.alpha)]);
            height.put_pixel(x, y, Luma([byte(255.0 * point.height)]));
        }
        stray_fibres(yarn, &mut color);
        color.save(folder.join("base_color.png"))?;
        height.save(folder.join("height.png"))?;
        let sizes = format!("width_mm = {}\nlength_mm = {}\n", yarn.width, yarn.length);
        std::fs::write(folder.join("yarn.toml"), sizes)?;
    }
    Ok(())
}

/// What is seen at a texel.
struct Point {
    shade: f32,
    alpha: f32,
    /// 0..1.
    height: f32,
}

impl Yarn {
    fn at(&self, x: u32, y: u32) -> Point {
        let turn = TAU * (to_float(x) + 0.5) / to_float(SIZE.0);
        // -1..1 over the core.
        let across = ((to_float(y) + 0.5) / to_float(SIZE.1) * 2.0 - 1.0) / CORE;
        let round = (1.0 - across * across).max(0.0).sqrt();
        // Seen from outside a ply runs as a sine; its place around the yarn goes with the angle whose sine `across` is.
        let around = across.clamp(-1.0, 1.0).asin();
        let plies = to_float(self.plies);
        let ply = ((around * plies - turn) / TAU).rem_euclid(1.0) * 2.0 - 1.0;
        let bulge = (1.0 - ply * ply).max(0.0).sqrt();
        let fibre = (FIBRES * (ply * 2.0 + turn / PI) + noise(x / 3, y / 2)).sin();
        let height = round * (0.7 + 0.3 * bulge) * (0.96 + 0.04 * fibre);
        let edge = ((1.0 - across.abs()) * 9.0).clamp(0.0, 1.0);
        let fuzz = (0.35 * (1.35 - across.abs()) * (0.5 + 0.5 * noise(x / 2, y / 2))).clamp(0.0, 1.0);
        Point { shade: (0.72 + 0.28 * bulge) * (0.92 + 0.08 * fibre), alpha: edge.max(fuzz), height }
    }
}

/// Fibres that stand off the yarn: thin arcs in the fuzz, the seam crossed without a break.
fn stray_fibres(yarn: &Yarn, color: &mut RgbaImage) {
    for stray in 0..STRAYS {
        let random = |salt: u32| to_float(hash(stray * 7 + salt) >> 16) / 65_536.0;
        let (start, length, side) = (random(1), 0.1 + 0.25 * random(2), if random(3) < 0.5 { -1.0 } else { 1.0 });
        let rise = CORE + (1.0 - CORE) * (0.3 + 0.7 * random(4));
        for step in 0..160 {
            let t = to_float(step) / 159.0;
            let x = (start + length * t).rem_euclid(1.0) * to_float(SIZE.0);
            let off = CORE * 0.9 + (rise - CORE * 0.9) * (PI * t).sin();
            let y = (0.5 + 0.5 * side * off) * to_float(SIZE.1);
            let (x, y) = (whole(x) % SIZE.0, whole(y).min(SIZE.1 - 1));
            let texel = color.get_pixel_mut(x, y);
            let [r, g, b] = yarn.color.map(byte);
            *texel = Rgba([r, g, b, texel.0[3].max(150)]);
        }
    }
}

/// -1..1.
fn noise(x: u32, y: u32) -> f32 {
    to_float(hash(x ^ hash(y)) >> 16) / 32_768.0 - 1.0
}

#[expect(clippy::cast_precision_loss, reason = "texels")]
fn to_float(number: u32) -> f32 {
    number as f32
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn whole(number: f32) -> u32 {
    number as u32
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn byte(value: f32) -> u8 {
    value.round() as u8
}
