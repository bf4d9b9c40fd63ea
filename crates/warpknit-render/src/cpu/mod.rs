//! The CPU renderer, for machines without a graphics driver.
//!
//! In: a scene, a camera and options, as for every renderer. Out: the picture. Two methods find the
//! yarn that a sample of a pixel sees. Ray tracing against a bounding volume hierarchy (`raytrace`)
//! is the general one. Where no yarn but sewing thread is wider than two pixels, pieces are drawn
//! as coverage masks instead (`splat`), which leaves no noise. What stands around the cloth is drawn
//! behind them (`backdrop`), and so is cloth from so far away that it is a surface (`averaged`).
//!
//! The picture is computed in bands of rows. Within a band, tiles of rows run in parallel. No
//! sample depends on another one, and sums are taken in a fixed order. So the bytes do not depend
//! on the number of threads, and a few rows of a picture are the same whether they are drawn alone
//! or with the rest.

mod averaged;
pub(crate) mod backdrop;
mod film;
pub(crate) mod lit;
#[cfg(feature = "gpu")]
pub(crate) mod patches;
mod raytrace;
pub(crate) mod sample;
mod splat;

use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

use image::RgbaImage;
use rayon::prelude::*;

use crate::scene::Scene;
use crate::{Camera, RenderOptions, tone};
use backdrop::{Backdrop, Behind};
use film::Splats;
pub(crate) use raytrace::endless;
pub use raytrace::rays::YarnRays;
use raytrace::{Bounces, RayTracer};
use splat::Splatter;
use warpknit_core::ids::index32;

/// A traced yarn counts as thin where a pixel is wider than this many of its radii, that is, wider
/// than the yarn. Two samples then share a sky ray. Lower values make yarns grainy whose plies
/// still show. Higher ones cost rays where nothing of a yarn but its mean colour can be seen.
const THIN_RADII: f32 = 2.0;
/// Rows of tiles in a band, for each thread. With fewer, threads wait for each other at the end of
/// a band. With more, the samples of unwritten rows take more memory.
const TILE_ROWS_PER_THREAD: usize = 4;
/// Side of a tile, pixels. The pixels of a tile are sampled one after another, because they see the
/// same yarns while these are in the cache. Whole rows would evict them between one row and the
/// next.
const TILE: u32 = 8;

/// See [`crate::render`].
#[must_use]
pub fn render(
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
    progress: &(dyn Fn(f32) + Sync),
) -> RgbaImage {
    let (width, height) = (options.width, options.height);
    let wanted = options.rows();
    let backdrop = Backdrop::new(camera, options);
    let mut picture = RgbaImage::new(width, wanted.end - wanted.start);
    // The film's filter reaches one pixel up and down. Hence the samples of the rows next to the
    // wanted ones count too, even where those rows themselves are not wanted.
    let sampled = rows_to_sample(options);
    let mut method =
        scene.bounds().map(|bounds| match Splatter::new(scene, &bounds, camera, options) {
            Some(splatter) => PictureMethod::Splatter(Box::new(splatter)),
            None => PictureMethod::RayTracer(Box::new(RayTracer::new(
                scene,
                &bounds,
                camera,
                options,
                Bounces::Traced,
            ))),
        });
    let done = AtomicU32::new(0);
    // The last two rows of a band wait for the next band, because a row needs the samples of the
    // row below. Above the first and below the last row of the picture there is an empty row.
    let mut rows = Vec::new();
    rows.extend((wanted.start == 0).then(|| Splats::new(width)));
    let row_bytes = (width as usize * 4).max(1);
    // The part of the picture below the rows that are written already.
    let mut unwritten = picture.as_mut();
    let band_rows = TILE * index32(TILE_ROWS_PER_THREAD * rayon::current_num_threads());
    for band in sampled.clone().step_by(band_rows as usize) {
        let end = sampled.end.min(band.saturating_add(band_rows));
        if let Some(method) = &mut method {
            method.prepare_rows(&(band..end));
        }
        let first_rows = (band..end).into_par_iter().step_by(TILE as usize);
        let tiles: Vec<_> = first_rows
            .map(|first| {
                let tile = first..end.min(first.saturating_add(TILE));
                let rows = sample_rows(method.as_ref(), backdrop.as_ref(), tile, options);
                for _ in &rows {
                    let rows_done = done.fetch_add(1, Ordering::Relaxed) + 1;
                    progress(share(rows_done, sampled.end - sampled.start));
                }
                rows
            })
            .collect();
        rows.extend(tiles.into_iter().flatten());
        if end == sampled.end && wanted.end == height {
            rows.push(Splats::new(width));
        }
        let (written, rest) = unwritten.split_at_mut((rows.len() - 2) * width as usize * 4);
        written.par_chunks_mut(row_bytes).zip(rows.par_windows(3)).for_each(|(pixels, rows)| {
            for (x, pixel) in pixels.chunks_exact_mut(4).enumerate() {
                pixel.copy_from_slice(&tone::pixel(
                    Splats::pixel(rows, x),
                    rows[1].behind(x),
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

/// The rows that are wanted and those next to them. Empty if none are wanted.
fn rows_to_sample(options: &RenderOptions) -> Range<u32> {
    let wanted = options.rows();
    if wanted.is_empty() {
        wanted
    } else {
        wanted.start.saturating_sub(1)..options.height.min(wanted.end + 1)
    }
}

/// Takes the samples of some rows of pixels, tile after tile.
fn sample_rows(
    method: Option<&PictureMethod<'_>>,
    backdrop: Option<&Backdrop<'_>>,
    rows: Range<u32>,
    options: &RenderOptions,
) -> Vec<Splats> {
    let width = options.width;
    let mut rows: Vec<_> = rows.map(|y| (y, Splats::new(width))).collect();
    for left in (0..width).step_by(TILE as usize) {
        if options.is_stopped() {
            break;
        }
        for (y, splats) in &mut rows {
            for x in left..width.min(left.saturating_add(TILE)) {
                let is_wanted = options.is_wanted([x, *y]);
                let behind = backdrop.map_or(Behind::NOTHING, |backdrop| {
                    let behind = if is_wanted { backdrop.pixel([x, *y]) } else { Behind::NOTHING };
                    splats.push_behind(behind.light);
                    behind
                });
                if !is_wanted {
                    continue;
                }
                match method {
                    Some(method) => method.pixel([x, *y], &behind, splats),
                    None => behind.add_body(x, splats),
                }
            }
        }
    }
    rows.into_iter().map(|(_, splats)| splats).collect()
}

/// A picture of yarns alone, with straight alpha, in front of its set.
pub(crate) fn before_set(
    mut yarns: RgbaImage,
    camera: &Camera,
    options: &RenderOptions,
) -> RgbaImage {
    let Some(backdrop) = Backdrop::new(camera, options) else { return yarns };
    let row_bytes = (options.width as usize * 4).max(1);
    yarns.as_mut().par_chunks_mut(row_bytes).enumerate().for_each(|(y, row)| {
        let y = options.rows().start + index32(y);
        for (pixel, x) in row.as_chunks_mut::<4>().0.iter_mut().zip(0..) {
            let behind = backdrop.pixel([x, y]).light;
            *pixel = tone::blend(*pixel, behind, options.exposure, options.background);
        }
    });
    yarns
}

/// The method that finds the yarn that a sample sees.
enum PictureMethod<'a> {
    RayTracer(Box<RayTracer<'a>>),
    Splatter(Box<Splatter<'a>>),
}

impl PictureMethod<'_> {
    /// Prepares the method for the samples of some rows.
    fn prepare_rows(&mut self, rows: &Range<u32>) {
        if let Self::Splatter(splatter) = self {
            splatter.prepare_rows(rows);
        }
    }

    /// Adds the samples of one pixel to the film row that it lies in, before what is behind it.
    fn pixel(&self, pixel: [u32; 2], behind: &Behind, splats: &mut Splats) {
        match self {
            Self::RayTracer(tracer) => tracer.pixel(pixel, behind, splats),
            Self::Splatter(splatter) => splatter.pixel(pixel, behind, splats),
        }
    }
}

/// Whether a yarn of this radius is thin where a pixel is `footprint` wide.
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
