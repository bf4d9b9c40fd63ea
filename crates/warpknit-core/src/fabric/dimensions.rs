//! The dimensions of the eight-point stitch of warp knits, which a fabric file may change.
//!
//! In: numbers over the wale spacing W or the course spacing C. Out:
//! [`Dimensions`]. Source of the eight points: Liu, Kyosev and Jiang 2022, section 2.1 and Fig. 2;
//! `docs/method.md` has the table of their defaults. Each is limited to a range in which a loop
//! stays a loop: feet below legs below head, and the head above the next course. Not promised: that
//! yarns keep clear of each other with any but the defaults.

/// Dimensions of a stitch. Its eight points are the feet S1 and S8, the lower legs S2 and S7, the
/// upper legs S3 and S6, and the head S4 and S5.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dimensions {
    /// Half the distance between the feet, over W.
    pub w1: f64,
    /// Half the distance between the lower legs, over W.
    pub w2: f64,
    /// Half the distance between the upper legs, over W.
    pub w3: f64,
    /// Half the width of the head, over W.
    pub w4: f64,
    /// Height of the lower legs, over C.
    pub h1: f64,
    /// Height of the upper legs, over C.
    pub h2: f64,
    /// Height of the head, over C.
    pub h3: f64,
}

impl Default for Dimensions {
    fn default() -> Self {
        Self { w1: 0.24, w2: 0.20, w3: 0.33, w4: 0.27, h1: 0.07, h2: 0.85, h3: 1.355 }
    }
}

/// A dimension as a key of the fabric file.
pub(super) struct Key {
    pub(super) name: &'static str,
    /// Its range: from, to and the unit.
    pub(super) range: (f64, f64, &'static str),
    /// Its field.
    pub(super) field: fn(&mut Dimensions) -> &mut f64,
}

// To each side of a wale, half a wale spacing belongs to its loop.
const ACROSS: (f64, f64, &str) = (0.01, 0.5, "of the wale spacing");

/// All dimensions: widths and heights.
pub(super) const KEYS: [Key; 7] = [
    Key { name: "w1", range: ACROSS, field: |d| &mut d.w1 },
    Key { name: "w2", range: ACROSS, field: |d| &mut d.w2 },
    Key { name: "w3", range: ACROSS, field: |d| &mut d.w3 },
    Key { name: "w4", range: ACROSS, field: |d| &mut d.w4 },
    Key { name: "h1", range: (0.0, 0.5, "of the course spacing"), field: |d| &mut d.h1 },
    Key { name: "h2", range: (0.5, 1.2, "of the course spacing"), field: |d| &mut d.h2 },
    Key { name: "h3", range: (1.0, 2.0, "of the course spacing"), field: |d| &mut d.h3 },
];

/// The names of all dimensions, for an error message.
pub(super) fn names() -> String {
    KEYS.map(|key| key.name).join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_default_lies_in_its_range_and_every_key_has_its_own_field() {
        let mut dimensions = Dimensions::default();
        for (key, value) in KEYS.iter().zip(1_u8..) {
            let (low, high, _) = key.range;
            assert!((low..=high).contains((key.field)(&mut dimensions)), "{}", key.name);
            *(key.field)(&mut dimensions) = f64::from(value);
        }
        for (key, value) in KEYS.iter().zip(1_u8..) {
            assert_eq!(*(key.field)(&mut dimensions), f64::from(value), "{}", key.name);
        }
    }
}
