//! The nearest piece of yarn for every sample of a picture.
//!
//! In: pieces, a screen and some of its rows. Out: [`Nearest`], 64 bytes for each four samples of a
//! pixel or what is left of them: where they lie, the nearest depths, and whose. Pieces are drawn
//! in parallel, and the nearest is the same in whatever order they come.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::pieces::Pieces;
use super::screen::Screen;
use crate::Options;
use crate::cpu::sample::{Purpose, Sampler};
use warpknit_core::ids::index32;

/// Most fours of samples that are kept at a time, 512 MB; larger pictures are looked at some rows
/// at a time.
const MOST_FOURS: usize = 1 << 23;
/// Fours of samples that a thread makes ready at a time.
const PART: usize = 4096;
/// No piece, farther than any.
const NOTHING: u64 = u64::MAX;

/// What samples see, four at a time.
struct Four {
    /// Columns and rows of the samples; infinite where there is none.
    places: [Vec4; 2],
    /// Bits of the depth, before the number of the piece.
    keys: [AtomicU64; 4],
}

impl Four {
    /// Those of pixel (x, y) from number `first` on that are under `spp`.
    fn new([x, y]: [u32; 2], first: u32, spp: u32, seed: u32) -> Self {
        let places = Sampler::new(x, y, seed).pairs(Purpose::Pixel, spp);
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
pub(super) struct Nearest {
    pub(super) width: u32,
    pub(super) rows: Range<u32>,
    /// Fours a pixel.
    fours: usize,
    samples: Vec<Four>,
}

impl Nearest {
    /// As many rows as [`MOST_FOURS`] hold, at least one.
    pub(super) fn most_rows(options: &Options) -> u32 {
        let row = options.width.max(1) as usize * options.spp.max(1).div_ceil(4) as usize;
        index32((MOST_FOURS / row).clamp(1, options.height.max(1) as usize))
    }

    pub(super) fn new(
        pieces: &Pieces,
        screen: &Screen,
        options: &Options,
        rows: Range<u32>,
    ) -> Self {
        let (width, spp) = (options.width, options.spp.max(1));
        let (row, fours) = (width as usize, spp.div_ceil(4) as usize);
        // Counted, so that they are written where they stay.
        let samples =
            (0..row * rows.len() * fours).into_par_iter().with_min_len(PART).map(|number| {
                let pixel = number / fours;
                let place = [index32(pixel % row), rows.start + index32(pixel / row)];
                Four::new(place, index32(number % fours) * 4, spp, options.seed)
            });
        let nearest = Self { width, fours, samples: samples.collect(), rows };
        pieces.for_each(
            |point| screen.place(point),
            |number, ends, radius| nearest.draw(screen, number, ends, radius),
        );
        nearest
    }

    fn draw(&self, screen: &Screen, number: u32, ends: [Vec3; 2], radius: f32) {
        let outline = screen.outline(ends, radius);
        for y in outline.rows(&self.rows) {
            for four in outline.columns(y, self.width).flat_map(|x| self.of_pixel([x, y])) {
                let within = outline.within(four.places);
                let depths = within.depths([ends[0].z, ends[1].z], radius);
                for lane in within.covered() {
                    let key = u64::from(depths[lane].to_bits()) << 32 | u64::from(number);
                    if key < four.keys[lane].load(Ordering::Relaxed) {
                        four.keys[lane].fetch_min(key, Ordering::Relaxed);
                    }
                }
            }
        }
    }

    /// Where sample `index` of a pixel lies, and the number of the piece that it sees.
    pub(super) fn seen(&self, pixel: [u32; 2], index: u32) -> (Vec2, Option<u32>) {
        let (four, lane) = (&self.of_pixel(pixel)[index as usize / 4], index as usize % 4);
        let key = four.keys[lane].load(Ordering::Relaxed);
        let place = Vec2::new(four.places[0][lane], four.places[1][lane]);
        (place, (key != NOTHING).then(|| index32((key & 0xFFFF_FFFF) as usize)))
    }

    /// The depths that the samples of a pixel see.
    pub(super) fn depths(&self, pixel: [u32; 2]) -> impl Iterator<Item = Option<f32>> {
        let samples = self.of_pixel(pixel).iter().flat_map(|four| {
            (0..4).filter(|lane| four.places[0][*lane].is_finite()).map(|lane| &four.keys[lane])
        });
        samples.map(|key| {
            let key = key.load(Ordering::Relaxed);
            (key != NOTHING).then(|| f32::from_bits(index32((key >> 32) as usize)))
        })
    }

    fn of_pixel(&self, [x, y]: [u32; 2]) -> &[Four] {
        let first =
            ((y - self.rows.start) as usize * self.width as usize + x as usize) * self.fours;
        &self.samples[first..first + self.fours]
    }
}
