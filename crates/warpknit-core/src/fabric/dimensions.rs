//! The dimensions of the eight-point stitch, which a fabric file may change.
//!
//! In: numbers over the wale spacing W, the course spacing C or the yarn's radius r. Out:
//! [`Dimensions`], whose default is the specification's table. Each is held in a range in which a
//! loop stays a loop: feet below legs below head, and the head above the next course. That yarns
//! keep clear of each other is not promised for any but the default.

/// Dimensions of a stitch. S1, S8 are its feet, S2, S7 its lower legs, S3, S6 its upper legs and
/// S4, S5 its head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dimensions {
    /// Half the distance between the feet, over W.
    pub w1: f64,
    /// The same on a side where the underlap crosses, over W.
    pub w1x: f64,
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
    /// How far the upper legs lie in front of the head, over r.
    pub z1: f64,
    /// How far the feet lie behind it, over r.
    pub z2: f64,
    /// How much deeper the exit foot lies than the entry foot, over r.
    pub zo: f64,
    /// How far the lower legs lie in front of the head, over r.
    pub zs: f64,
}

impl Default for Dimensions {
    fn default() -> Self {
        Self {
            w1: 0.15,
            w1x: 0.13,
            w2: 0.14,
            w3: 0.33,
            w4: 0.27,
            h1: 0.08,
            h2: 0.85,
            h3: 1.355,
            z1: 2.9,
            z2: 1.9,
            zo: 3.0,
            zs: 2.4,
        }
    }
}

/// A dimension as the file knows it.
pub(super) struct Key {
    pub(super) name: &'static str,
    /// What it may be: from, to and the unit.
    pub(super) range: (f64, f64, &'static str),
    /// Its value.
    pub(super) of: fn(&mut Dimensions) -> &mut f64,
}

// Half a wale belongs to each loop.
const ACROSS: (f64, f64, &str) = (0.01, 0.5, "of the wale spacing");
// A yarn is 2 r thick, and a loop of ten yarns' depth is none any more.
const DEPTH: (f64, f64, &str) = (0.0, 20.0, "yarn radii");

/// All dimensions in the order of the specification's table.
pub(super) const KEYS: [Key; 12] = [
    Key { name: "w1", range: ACROSS, of: |d| &mut d.w1 },
    Key { name: "w1x", range: ACROSS, of: |d| &mut d.w1x },
    Key { name: "w2", range: ACROSS, of: |d| &mut d.w2 },
    Key { name: "w3", range: ACROSS, of: |d| &mut d.w3 },
    Key { name: "w4", range: ACROSS, of: |d| &mut d.w4 },
    Key { name: "h1", range: (0.0, 0.5, "of the course spacing"), of: |d| &mut d.h1 },
    Key { name: "h2", range: (0.5, 1.2, "of the course spacing"), of: |d| &mut d.h2 },
    Key { name: "h3", range: (1.0, 2.0, "of the course spacing"), of: |d| &mut d.h3 },
    Key { name: "z1", range: DEPTH, of: |d| &mut d.z1 },
    Key { name: "z2", range: DEPTH, of: |d| &mut d.z2 },
    Key { name: "zo", range: DEPTH, of: |d| &mut d.zo },
    Key { name: "zs", range: DEPTH, of: |d| &mut d.zs },
];

/// The names of all dimensions, for people.
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
            assert!((low..=high).contains((key.of)(&mut dimensions)), "{}", key.name);
            *(key.of)(&mut dimensions) = f64::from(value);
        }
        for (key, value) in KEYS.iter().zip(1_u8..) {
            assert_eq!(*(key.of)(&mut dimensions), f64::from(value), "{}", key.name);
        }
    }
}
