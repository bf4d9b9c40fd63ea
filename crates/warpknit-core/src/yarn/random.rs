//! Pseudo-random numbers for yarns and their fibres.
//!
//! In: a seed and a number within it. Out: [`SplitMix64`], whose numbers depend on nothing else.

/// Pseudo-random numbers from a seed: the splitmix64 generator (Steele, Lea and Flood, Fast
/// splittable pseudorandom number generators, 2014).
pub(super) struct SplitMix64(u64);

impl SplitMix64 {
    /// A generator for each number within each seed, so that these don't depend on each other.
    pub(super) fn new(seed: u64, number: u64) -> Self {
        // Two odd constants spread neighbouring seeds and neighbouring numbers over all 64 bits.
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ number.wrapping_mul(0xD1B5_4A32_D192_ED03))
    }

    /// The next number, uniform in 0..=1.
    pub(super) fn next_unit(&mut self) -> f64 {
        // The increment is that of the published generator.
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        #[expect(clippy::cast_precision_loss, reason = "32 bits are enough to spread fibres")]
        let unit = (mixed(self.0) >> 32) as f64 / f64::from(u32::MAX);
        unit
    }
}

/// Spreads the bits of a number over all 64: the last step of splitmix64, with the two multipliers of
/// the published generator.
pub(crate) fn mixed(bits: u64) -> u64 {
    let bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    bits ^ (bits >> 31)
}
