//! Sample positions: where in a pixel, on the sun's disc and in the sky hemisphere the samples of a
//! pixel lie.
//!
//! In: a pixel, a sample's index and a seed. Out: pairs of numbers in 0..1. They come from the R2
//! sequence (Roberts 2018, 'The unreasonable effectiveness of quasirandom sequences'). It is a
//! low-discrepancy sequence: it covers the unit square evenly for any number of points, unlike a
//! grid or random points.
//!
//! The pixels of a 4 x 4 tile take consecutive parts of one sequence, in the order of Bayer's
//! dither matrix. So neighbouring pixels have complementary samples, and the remaining noise is
//! fine and even. A hash of the tile shifts the sequence (Cranley and Patterson 1976), so that
//! tiles do not repeat. The functions keep no state: a pixel's numbers depend on its place and the
//! seed only.

use crate::ply::hash;

/// Increments of the R2 sequence as fractions of 2^32: 1/g and 1/g^2, where g = 1.3247 is the real
/// root of x^3 = x + 1. Integer arithmetic wraps around exactly, where adding floats would drift.
const R2_STEP: [u32; 2] = [3_242_174_889, 2_447_445_414];

/// The order of a tile's pixels in the sequence: Bayer's matrix. Any part of a tile is spread over
/// the whole sequence.
const BAYER_ORDER: [u32; 16] = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5];

/// The use of a pair of numbers. Each use has a sequence of its own, so that, say, the sky
/// directions are not correlated with the places in the pixel.
#[derive(Clone, Copy, Debug)]
pub(super) enum SampleDimension {
    Pixel = 1,
    Sun = 2,
    Sky = 3,
}

/// The source of one pixel's numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sampler {
    tile: u32,
    place: u32,
}

impl Sampler {
    pub(super) fn new(x: u32, y: u32, seed: u32) -> Self {
        // Nested hashes: a sum of x and y would give equal shifts along diagonals.
        let tile = hash(hash(hash(seed).wrapping_add(x / 4)).wrapping_add(y / 4));
        Self { tile, place: BAYER_ORDER[(y % 4 * 4 + x % 4) as usize] }
    }

    /// 32 pseudo-random bits for sample `index`, independent of those of other samples.
    pub(super) fn random_bits(&self, index: u32) -> u32 {
        hash(self.tile ^ hash(index.wrapping_mul(16) + self.place))
    }

    /// Pair `index` of the `count` pairs that this pixel uses for `dimension`.
    #[inline]
    pub(super) fn pair(&self, dimension: SampleDimension, index: u32, count: u32) -> [f32; 2] {
        self.pairs(dimension, count).at(index)
    }

    /// All pairs that this pixel uses for `dimension`.
    #[inline]
    pub(super) fn pairs(&self, dimension: SampleDimension, count: u32) -> SampleSequence {
        // The golden ratio spreads the few dimensions over all 32 bits before hashing.
        let shift = hash(self.tile ^ (dimension as u32).wrapping_mul(0x9E37_79B9));
        SampleSequence { first: self.place.wrapping_mul(count), shift: [shift, hash(shift)] }
    }
}

/// A part of the R2 sequence, shifted.
#[derive(Clone, Copy, Debug)]
pub(super) struct SampleSequence {
    first: u32,
    shift: [u32; 2],
}

impl SampleSequence {
    /// Pair `index` of this part.
    #[inline]
    pub(super) fn at(&self, index: u32) -> [f32; 2] {
        // Wrapping arithmetic modulo 2^32 is the fractional part of the sequence, exactly.
        let number = self.first.wrapping_add(index);
        let [one, other] = self.shift;
        [
            unit(one.wrapping_add(number.wrapping_mul(R2_STEP[0]))),
            unit(other.wrapping_add(number.wrapping_mul(R2_STEP[1]))),
        ]
    }
}

/// The upper 24 bits as a number in 0..1, without 1.
#[inline]
pub(crate) fn unit(bits: u32) -> f32 {
    #[expect(clippy::cast_precision_loss, reason = "24 bits fit")]
    let number = (bits >> 8) as f32;
    number / 16_777_216.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tile_covers_the_square_evenly() {
        let mut cells = [0; 16];
        for pixel in 0..16 {
            for index in 0..4 {
                let [u, v] = Sampler::new(40 + pixel % 4, 80 + pixel / 4, 9).pair(
                    SampleDimension::Sky,
                    index,
                    4,
                );
                assert!((0.0..1.0).contains(&u) && (0.0..1.0).contains(&v));
                let cell = (0..16_u8).find(|c| {
                    (f32::from(c % 4) - u * 4.0 + 0.5).abs() <= 0.5
                        && (f32::from(c / 4) - v * 4.0 + 0.5).abs() <= 0.5
                });
                cells[usize::from(cell.unwrap())] += 1;
            }
        }
        assert!(cells.iter().all(|&n| (2..=6).contains(&n)), "{cells:?}");
    }

    #[test]
    fn pixels_seeds_and_purposes_differ() {
        let at = |x, seed, dimension| Sampler::new(x, 3, seed).pair(dimension, 0, 4);
        assert_eq!(at(5, 1, SampleDimension::Sun), at(5, 1, SampleDimension::Sun));
        assert_ne!(at(5, 1, SampleDimension::Sun), at(6, 1, SampleDimension::Sun));
        assert_ne!(at(5, 1, SampleDimension::Sun), at(5, 2, SampleDimension::Sun));
        assert_ne!(at(5, 1, SampleDimension::Sun), at(5, 1, SampleDimension::Pixel));
    }
}
