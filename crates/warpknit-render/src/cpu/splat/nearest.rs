//! Visibility buffer: the nearest piece of yarn for every sample of a picture.
//!
//! In: pieces, a screen and some of its rows. Out: [`VisibilityBuffer`], 64 bytes for every four
//! samples of a pixel: their places, and for each the depth and index of the nearest piece. Pieces
//! are rasterised in parallel. Each sample takes the minimum of its keys atomically, and a minimum
//! does not depend on the order.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::pieces::SplatPieces;
use super::screen::Screen;
use crate::RenderOptions;
use crate::cpu::sample::{SampleDimension, Sampler};
use warpknit_core::ids::index32;

/// Groups of four samples in memory at a time: 512 MB. Larger pictures are done in parts, and each
/// part rasterises all pieces again.
const MAX_QUADS: usize = 1 << 23;
/// Groups of four samples that a task initialises at a time.
const PART: usize = 4096;
/// The key of a sample that sees no yarn, larger than any other.
const NOTHING: u64 = u64::MAX;

/// Four samples of a pixel, tested together by SIMD.
struct SampleQuad {
    /// Columns and rows of the samples. Infinite for unused lanes, which no piece covers.
    places: [Vec4; 2],
    /// Depth in the upper 32 bits, index of the piece in the lower ones. Non-negative floats order
    /// like their bits, so the smaller key is the nearer piece. Among equal depths the first piece
    /// wins.
    keys: [AtomicU64; 4],
}

impl SampleQuad {
    /// Samples `first` to `first + 3` of pixel (x, y), as far as they are below `spp`.
    fn new([x, y]: [u32; 2], first: u32, spp: u32, seed: u32) -> Self {
        // The same places as in the ray tracer, so both methods sample alike.
        let places = Sampler::new(x, y, seed).pairs(SampleDimension::Pixel, spp);
        let [a, b, c, d] = [0, 1, 2, 3].map(|lane| match places.at(first + lane) {
            [across, down] if first + lane < spp => Vec2::new(x as f32 + across, y as f32 + down),
            _ => Vec2::INFINITY,
        });
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
    /// Groups of four samples in a pixel.
    quads: usize,
    samples: Vec<SampleQuad>,
}

impl VisibilityBuffer {
    /// Number of rows that [`MAX_QUADS`] allow; at least one.
    pub(super) fn max_rows(options: &RenderOptions) -> u32 {
        let row = options.width.max(1) as usize * options.spp.max(1).div_ceil(4) as usize;
        index32((MAX_QUADS / row).clamp(1, options.height.max(1) as usize))
    }

    /// Rasterises all pieces into the samples of some rows.
    pub(super) fn new(
        pieces: &SplatPieces,
        screen: &Screen,
        options: &RenderOptions,
        rows: Range<u32>,
    ) -> Self {
        let (width, spp) = (options.width, options.spp.max(1));
        let (row, quads) = (width as usize, spp.div_ceil(4) as usize);
        // An indexed parallel iterator collects in place, without a copy.
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

    /// Rasterises one piece.
    fn splat(&self, screen: &Screen, number: u32, ends: [Vec3; 2], radius: f32) {
        let outline = screen.outline(ends, radius);
        for y in outline.rows(&self.rows) {
            for quad in outline.columns(y, self.width).flat_map(|x| self.pixel_quads([x, y])) {
                let within = outline.within(quad.places);
                let depths = within.depths([ends[0].z, ends[1].z], radius);
                for lane in within.covered() {
                    let key = u64::from(depths[lane].to_bits()) << 32 | u64::from(number);
                    // A plain load first: most pieces lie behind others, and an atomic minimum
                    // costs far more than a load.
                    if key < quad.keys[lane].load(Ordering::Relaxed) {
                        quad.keys[lane].fetch_min(key, Ordering::Relaxed);
                    }
                }
            }
        }
    }

    /// Place of sample `index` of a pixel, and the index of the piece that it sees.
    pub(super) fn sample(&self, pixel: [u32; 2], index: u32) -> (Vec2, Option<u32>) {
        let (quad, lane) = (&self.pixel_quads(pixel)[index as usize / 4], index as usize % 4);
        let key = quad.keys[lane].load(Ordering::Relaxed);
        let place = Vec2::new(quad.places[0][lane], quad.places[1][lane]);
        (place, (key != NOTHING).then(|| index32((key & 0xFFFF_FFFF) as usize)))
    }

    /// Depths that the samples of a pixel see; `None` for those that see no yarn.
    pub(super) fn depths(&self, pixel: [u32; 2]) -> impl Iterator<Item = Option<f32>> + Clone {
        let samples = self.pixel_quads(pixel).iter().flat_map(|quad| {
            (0..4).filter(|lane| quad.places[0][*lane].is_finite()).map(|lane| &quad.keys[lane])
        });
        samples.map(|key| {
            let key = key.load(Ordering::Relaxed);
            (key != NOTHING).then(|| f32::from_bits(index32((key >> 32) as usize)))
        })
    }

    /// The groups of samples of one pixel.
    fn pixel_quads(&self, [x, y]: [u32; 2]) -> &[SampleQuad] {
        let first =
            ((y - self.rows.start) as usize * self.width as usize + x as usize) * self.quads;
        &self.samples[first..first + self.quads]
    }
}
