//! The nearest piece of yarn for every sample of a picture.
//!
//! In: pieces, a screen and some of its rows. Out: [`VisibilityBuffer`], 64 bytes for each quad samples of a
//! pixel or what is left of them: where they lie, the nearest depths, and whose. SplatPieces are drawn
//! in parallel, and the nearest is the same in whatever order they come.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::pieces::SplatPieces;
use super::screen::Screen;
use crate::ids::index32;
use crate::render::RenderOptions;
use crate::render::cpu::sample::{SampleDimension, Sampler};

/// Most quads of samples that are kept at a time, 512 MB; larger pictures are looked at some rows
/// at a time.
const MAX_QUADS: usize = 1 << 23;
/// Fours of samples that a thread makes ready at a time.
const PART: usize = 4096;
/// No piece, farther than any.
const NOTHING: u64 = u64::MAX;

/// What samples see, quad at a time.
struct SampleQuad {
    /// Columns and rows of the samples; infinite where there is none.
    places: [Vec4; 2],
    /// Bits of the depth, before the number of the piece.
    keys: [AtomicU64; 4],
}

impl SampleQuad {
    /// Those of pixel (x, y) from number `first` on that are under `spp`.
    fn new([x, y]: [u32; 2], first: u32, spp: u32, seed: u32) -> Self {
        let places = Sampler::new(x, y, seed).pairs(SampleDimension::Pixel, spp);
        let at = |lane: u32| match places.at(first + lane) {
            [across, down] if first + lane < spp => Vec2::new(x as f32 + across, y as f32 + down),
            _ => Vec2::INFINITY,
        };
        let [a, b, c, d] = [at(0), at(1), at(2), at(3)];
        Self {
            places: [Vec4::new(a.x, b.x, c.x, d.x), Vec4::new(a.y, b.y, c.y, d.y)],
            keys: [NOTHING; 4].map(AtomicU64::new),
        }
    }
}

/// The nearest pieces of all samples of some rows.
pub(super) struct VisibilityBuffer {
    pub(super) width: u32,
    pub(super) rows: Range<u32>,
    /// Fours a pixel.
    quads: usize,
    samples: Vec<SampleQuad>,
}

impl VisibilityBuffer {
    /// As many rows as [`MAX_QUADS`] hold, at least one.
    pub(super) fn max_rows(options: &RenderOptions) -> u32 {
        let row = options.width.max(1) as usize * options.spp.max(1).div_ceil(4) as usize;
        index32((MAX_QUADS / row).clamp(1, options.height.max(1) as usize))
    }

    pub(super) fn new(
        pieces: &SplatPieces,
        screen: &Screen,
        options: &RenderOptions,
        rows: Range<u32>,
    ) -> Self {
        let (width, spp) = (options.width, options.spp.max(1));
        let (row, quads) = (width as usize, spp.div_ceil(4) as usize);
        // Counted, so that they are written where they stay.
        let samples =
            (0..row * rows.len() * quads).into_par_iter().with_min_len(PART).map(|number| {
                let pixel = number / quads;
                let place = [index32(pixel % row), rows.start + index32(pixel / row)];
                SampleQuad::new(place, index32(number % quads) * 4, spp, options.seed)
            });
        let buffer = Self { width, quads, samples: samples.collect(), rows };
        pieces.for_each(
            |point| screen.project(point),
            |number, ends, radius| buffer.splat(screen, number, ends, radius),
        );
        buffer
    }

    fn splat(&self, screen: &Screen, number: u32, ends: [Vec3; 2], radius: f32) {
        let outline = screen.outline(ends, radius);
        for y in outline.rows(&self.rows) {
            for quad in outline.columns(y, self.width).flat_map(|x| self.pixel_quads([x, y])) {
                let within = outline.within(quad.places);
                let depths = within.depths([ends[0].z, ends[1].z], radius);
                for lane in within.covered() {
                    let key = u64::from(depths[lane].to_bits()) << 32 | u64::from(number);
                    if key < quad.keys[lane].load(Ordering::Relaxed) {
                        quad.keys[lane].fetch_min(key, Ordering::Relaxed);
                    }
                }
            }
        }
    }

    /// Where sample `index` of a pixel lies, and the number of the piece that it sees.
    pub(super) fn sample(&self, pixel: [u32; 2], index: u32) -> (Vec2, Option<u32>) {
        let (quad, lane) = (&self.pixel_quads(pixel)[index as usize / 4], index as usize % 4);
        let key = quad.keys[lane].load(Ordering::Relaxed);
        let place = Vec2::new(quad.places[0][lane], quad.places[1][lane]);
        (place, (key != NOTHING).then(|| index32((key & 0xFFFF_FFFF) as usize)))
    }

    /// The depths that the samples of a pixel see.
    pub(super) fn depths(&self, pixel: [u32; 2]) -> impl Iterator<Item = Option<f32>> {
        let samples = self.pixel_quads(pixel).iter().flat_map(|quad| {
            (0..4).filter(|lane| quad.places[0][*lane].is_finite()).map(|lane| &quad.keys[lane])
        });
        samples.map(|key| {
            let key = key.load(Ordering::Relaxed);
            (key != NOTHING).then(|| f32::from_bits(index32((key >> 32) as usize)))
        })
    }

    fn pixel_quads(&self, [x, y]: [u32; 2]) -> &[SampleQuad] {
        let first =
            ((y - self.rows.start) as usize * self.width as usize + x as usize) * self.quads;
        &self.samples[first..first + self.quads]
    }
}
