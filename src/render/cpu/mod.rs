//! Pictures on the processor: what a machine without a graphics driver gets.
//!
//! In: the same as every renderer's. Out: the picture. What a sample of a pixel sees is found by
//! tracing rays (`near`), or where all yarns are thinner than pixels by drawing their pieces
//! (`far`). Rows are lit in parallel and no sample depends on another, so that any number of
//! threads gives the same bytes, and some rows of a picture are drawn alone as they are in the
//! whole.

mod far;
mod film;
mod lit;
mod near;
mod sample;

use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

use image::RgbaImage;
use rayon::prelude::*;

use crate::ids::index32;
use crate::render::{Camera, RenderOptions, tone};
use crate::scene::Scene;
use far::Splatter;
use film::Splats;
use near::RayTracer;

/// Yarns are thin where a pixel is wider than so many of their radii.
const THIN_RADII: f32 = 2.0;
/// Squares' rows that each thread has to light before their pixels are written: enough to share
/// evenly, few enough to take little memory.
const TILE_ROWS_PER_THREAD: usize = 4;
/// Pixels that are lit one after another lie in squares of so many, which see the same yarns while
/// these are in the cache.
const TILE: u32 = 8;

/// See [`crate::render::render`].
#[must_use]
pub fn render(
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
    progress: &(dyn Fn(f32) + Sync),
) -> RgbaImage {
    let (width, height) = (options.width, options.height);
    let wanted = options.rows();
    let mut picture = RgbaImage::new(width, wanted.end - wanted.start);
    // A pixel needs the samples of the rows next to its own, which count even where they are not
    // wanted.
    let lit = rows_to_sample(options);
    let mut method =
        scene.bounds().map(|bounds| match Splatter::new(scene, &bounds, camera, options) {
            Some(far) => Method::Splatter(far),
            None => Method::RayTracer(RayTracer::new(scene, &bounds, camera, options)),
        });
    let done = AtomicU32::new(0);
    // So the last two rows of a band wait for the next one. Beyond the picture's edges nothing is.
    let mut rows = Vec::new();
    rows.extend((wanted.start == 0).then(|| Splats::new(width)));
    let row_bytes = (width as usize * 4).max(1);
    let mut unwritten = picture.as_mut();
    let band_rows = TILE * index32(TILE_ROWS_PER_THREAD * rayon::current_num_threads());
    for band in lit.clone().step_by(band_rows as usize) {
        let end = lit.end.min(band.saturating_add(band_rows));
        if let Some(method) = &mut method {
            method.look_at(&(band..end));
        }
        let light = |first: u32| {
            let rows = light(method.as_ref(), first..end.min(first.saturating_add(TILE)), width);
            for _ in &rows {
                progress(share(done.fetch_add(1, Ordering::Relaxed) + 1, lit.end - lit.start));
            }
            rows
        };
        let tiles: Vec<_> = (band..end).into_par_iter().step_by(TILE as usize).map(light).collect();
        rows.extend(tiles.into_iter().flatten());
        if end == lit.end && wanted.end == height {
            rows.push(Splats::new(width));
        }
        let (written, rest) = unwritten.split_at_mut((rows.len() - 2) * width as usize * 4);
        written.par_chunks_mut(row_bytes).zip(rows.par_windows(3)).for_each(|(pixels, rows)| {
            for (x, pixel) in pixels.chunks_exact_mut(4).enumerate() {
                pixel.copy_from_slice(&tone::pixel(
                    Splats::pixel(rows, x),
                    options.exposure,
                    options.background,
                ));
            }
        });
        unwritten = rest;
        rows.drain(..rows.len() - 2);
    }
    picture
}

/// The rows that are wanted and those next to them, if any are.
fn rows_to_sample(options: &RenderOptions) -> Range<u32> {
    let wanted = options.rows();
    if wanted.is_empty() {
        wanted
    } else {
        wanted.start.saturating_sub(1)..options.height.min(wanted.end + 1)
    }
}

/// Lights the pixels of some rows, square after square.
fn light(method: Option<&Method<'_>>, rows: Range<u32>, width: u32) -> Vec<Splats> {
    let mut rows: Vec<_> = rows.map(|y| (y, Splats::new(width))).collect();
    if let Some(method) = method {
        for left in (0..width).step_by(TILE as usize) {
            for (y, splats) in &mut rows {
                (left..width.min(left.saturating_add(TILE)))
                    .for_each(|x| method.pixel([x, *y], splats));
            }
        }
    }
    rows.into_iter().map(|(_, splats)| splats).collect()
}

/// How it is found what a sample sees.
enum Method<'a> {
    RayTracer(RayTracer<'a>),
    Splatter(Splatter<'a>),
}

impl Method<'_> {
    /// Makes ready to light some rows.
    fn look_at(&mut self, rows: &Range<u32>) {
        if let Self::Splatter(far) = self {
            far.prepare_rows(rows);
        }
    }

    /// Adds the samples of a pixel to its row.
    fn pixel(&self, pixel: [u32; 2], splats: &mut Splats) {
        match self {
            Self::RayTracer(near) => near.pixel(pixel, splats),
            Self::Splatter(far) => far.pixel(pixel, splats),
        }
    }
}

/// Whether a yarn of some radius is thinner than a pixel of size `footprint`.
fn is_thin(footprint: f32, radius: f32) -> bool {
    footprint > THIN_RADII * radius
}

/// `part / whole`.
fn share(part: u32, whole: u32) -> f32 {
    to_f32(f64::from(part) / f64::from(whole))
}

#[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
fn to_f32(value: f64) -> f32 {
    value as f32
}
