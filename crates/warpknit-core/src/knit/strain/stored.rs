//! The table of strained repeats as bytes, to be kept from one run to the next.
//!
//! In: a [`StrainTable`]. Out: bytes of its solved knots ([`StrainTable::to_bytes`]), which a table
//! of the same repeat takes back ([`StrainTable::load`]), and a number to name them by
//! ([`StrainTable::fingerprint`]).
//!
//! Bytes hold all that the solver depends on: the repeat, and a hash of the solver's own sources. A
//! table compares this with its own, so bytes of another fabric or of another version are refused. A
//! checksum (FNV-1a of Fowler, Noll and Vo) covers everything, so damaged bytes are refused as well.
//!
//! Cost: about a millisecond for a megabyte. Not promised: safety against bytes that were forged.

use super::grid::KNOTS;
use super::table::{Knot, StrainTable};
use crate::cursor::Cursor;
use crate::ids::index32;

/// First bytes of a table.
const MAGIC: [u8; 8] = *b"wk-knots";
/// The sources that decide what is found at a knot.
const SOURCES: [&str; 15] = [
    include_str!("contacts.rs"),
    include_str!("grid.rs"),
    include_str!("link_check.rs"),
    include_str!("mod.rs"),
    include_str!("profile.rs"),
    include_str!("pull.rs"),
    include_str!("rest.rs"),
    include_str!("solver.rs"),
    include_str!("spans.rs"),
    include_str!("stored.rs"),
    include_str!("table.rs"),
    include_str!("../cell_list.rs"),
    include_str!("../chain.rs"),
    include_str!("../links.rs"),
    include_str!("../../yarn/curve.rs"),
];
/// Their hash. So a change of the solver makes other tables, also between two versions.
const SOLVER: u64 = {
    let (mut hash, mut at) = (FNV_BASIS, 0);
    while at < SOURCES.len() {
        hash = fnv(hash, SOURCES[at].as_bytes());
        at += 1;
    }
    hash
};

const FNV_BASIS: u64 = 0xcbf2_9ce4_8422_2325;
const FNV_PRIME: u64 = 0x0100_0000_01b3;

/// Continues the hash FNV-1a over some bytes.
const fn fnv(mut hash: u64, bytes: &[u8]) -> u64 {
    let mut at = 0;
    while at < bytes.len() {
        hash = (hash ^ bytes[at] as u64).wrapping_mul(FNV_PRIME);
        at += 1;
    }
    hash
}

impl StrainTable {
    /// A number that tables of other repeats and of other versions don't share, by any likelihood.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        fnv(FNV_BASIS, &self.key())
    }

    /// The solved knots as bytes. The same knots give the same bytes.
    ///
    /// ```
    /// use warpknit_core::fabric::Fabric;
    /// use warpknit_core::knit::{Pattern, strain::{Strain, StrainTable}};
    /// let jersey = Fabric::named("jersey").unwrap();
    /// let table = || StrainTable::new(&jersey, &Pattern::new(&jersey)).unwrap();
    /// let (solved, later) = (table(), table());
    /// solved.prepare([Strain { courses: 1.1, ..Strain::NONE }], &mut |_| ());
    /// assert!(later.load(&solved.to_bytes()));
    /// assert_eq!(later.knots(), solved.knots());
    /// ```
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let key = self.key();
        let mut body = Vec::new();
        body.extend(index32(key.len()).to_le_bytes());
        body.extend(&key);
        body.extend(index32(self.knots()).to_le_bytes());
        for (number, knot) in self.solved.iter().enumerate() {
            let Some(Knot { offsets, lock }) = knot.get() else { continue };
            body.extend(index32(number).to_le_bytes());
            body.extend(lock.to_le_bytes());
            body.extend(offsets.as_flattened().iter().flat_map(|part| part.to_le_bytes()));
        }
        let checksum = fnv(FNV_BASIS, &body).to_le_bytes();
        [&MAGIC[..], &checksum, &body].concat()
    }

    /// Takes solved knots from bytes. False, and nothing is taken, if they are not those of this
    /// repeat or are damaged.
    pub fn load(&self, bytes: &[u8]) -> bool {
        let Some(knots) = self.read(bytes) else { return false };
        for (number, knot) in knots {
            // A knot that is solved already is the same.
            let _same = self.solved[number].set(knot);
        }
        true
    }

    /// Reads all knots, or nothing.
    fn read(&self, bytes: &[u8]) -> Option<Vec<(usize, Knot)>> {
        let mut bytes = Cursor::new(bytes);
        let is_ours = bytes.take()? == MAGIC;
        let checksum = bytes.u64()?;
        if !is_ours || fnv(FNV_BASIS, bytes.rest()) != checksum {
            return None;
        }
        let key_len = bytes.u32()?;
        if bytes.slice(key_len.into())? != self.key() {
            return None;
        }
        let count = bytes.count()?;
        if count > KNOTS {
            return None;
        }
        let knots = (0..count).map(|_| self.read_knot(&mut bytes)).collect::<Option<Vec<_>>>()?;
        (bytes.rest().is_empty() && knots.is_sorted_by_key(|(number, _)| *number)).then_some(knots)
    }

    fn read_knot(&self, bytes: &mut Cursor<'_>) -> Option<(usize, Knot)> {
        let number = bytes.count().filter(|number| *number < KNOTS)?;
        let lock = bytes.f32()?;
        let (parts, _) = bytes.slice(12 * self.rest.points.len() as u64)?.as_chunks::<4>();
        let parts: Vec<_> = parts.iter().map(|part| f32::from_le_bytes(*part)).collect();
        let (offsets, _) = parts.as_chunks::<3>();
        let is_sound = lock >= 0.0 && parts.iter().all(|part| part.is_finite());
        is_sound.then(|| (number, Knot { offsets: offsets.to_vec(), lock }))
    }

    /// All that the knots depend on.
    fn key(&self) -> Vec<u8> {
        let rest = &self.rest;
        let mut key = env!("CARGO_PKG_VERSION").as_bytes().to_vec();
        key.extend(SOLVER.to_le_bytes());
        let mut add = |numbers: &[f64]| key.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        add(&[rest.cell.x, rest.cell.y, rest.pull]);
        for yarn in &rest.yarns {
            let chain = &yarn.chain;
            let is_elastic = f64::from(u8::from(yarn.is_elastic));
            let points = [chain.points.start, chain.points.end].map(|at| f64::from(index32(at)));
            add(&points);
            add(&[chain.period.x, chain.period.y, chain.period.z, chain.radius, is_elastic]);
        }
        rest.points.iter().for_each(|point| add(&point.to_array()));
        key
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::fabric::Fabric;
    use crate::knit::Pattern;
    use crate::knit::strain::Strain;

    fn table(name: &str) -> StrainTable {
        let fabric = Fabric::named(name).unwrap();
        StrainTable::new(&fabric, &Pattern::new(&fabric)).unwrap()
    }

    fn solved() -> StrainTable {
        let table = table("jersey");
        table.prepare([Strain { courses: 1.17, wales: 0.94, shear: 0.1 }], &mut |_| ());
        table
    }

    /// A table with the right checksum over whatever it holds.
    fn sealed(body: &[u8]) -> Vec<u8> {
        [&MAGIC[..], &fnv(FNV_BASIS, body).to_le_bytes(), body].concat()
    }

    #[test]
    fn knots_come_back_as_they_were_and_the_rest_is_solved_alike() {
        let (solved, later) = (solved(), table("jersey"));
        let bytes = solved.to_bytes();
        assert!(later.load(&bytes));
        assert_eq!(later.to_bytes(), bytes);
        let strain = Strain { courses: 1.28, wales: 0.8, shear: -0.1 };
        let offsets = [&solved, &later].map(|table| table.at(strain).offset(5));
        assert_eq!(offsets[0], offsets[1]);
    }

    #[test]
    fn bytes_of_another_fabric_are_refused() {
        let tricot = table("tricot");
        assert!(!tricot.load(&solved().to_bytes()));
        assert!(!table("jersey").load(&tricot.to_bytes()));
        assert_eq!(tricot.knots(), 0);
        assert_ne!(tricot.fingerprint(), table("jersey").fingerprint());
    }

    #[test]
    fn cut_bytes_are_refused_wherever_they_end() {
        let (bytes, empty) = (solved().to_bytes(), table("jersey"));
        let body = &bytes[16..];
        for end in (0..body.len()).step_by(7).chain([body.len() - 1]) {
            assert!(!empty.load(&bytes[..16 + end]), "{end}");
            assert!(!empty.load(&sealed(&body[..end])), "{end} with its own checksum");
        }
        assert!(!empty.load(&sealed(&[body, &[0]].concat())), "a byte too many");
        assert_eq!(empty.knots(), 0);
    }

    #[test]
    fn numbers_that_are_none_are_refused_under_a_right_checksum() {
        let (mut bytes, empty) = (solved().to_bytes(), table("jersey"));
        let end = bytes.len();
        bytes[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(!empty.load(&sealed(&bytes[16..])));
    }

    #[test]
    fn every_source_of_the_solver_is_hashed() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/src/knit/strain");
        for entry in std::fs::read_dir(folder).unwrap() {
            let text = std::fs::read_to_string(entry.unwrap().path()).unwrap();
            assert!(SOURCES.contains(&text.as_str()), "a file of {folder} is not in SOURCES");
        }
    }

    proptest! {
        #[test]
        fn any_other_byte_is_noticed(at in any::<prop::sample::Index>(), flip in 1u8..) {
            use std::sync::LazyLock;
            static SOLVED: LazyLock<(Vec<u8>, StrainTable)> =
                LazyLock::new(|| (solved().to_bytes(), table("jersey")));
            let (mut bytes, empty) = (SOLVED.0.clone(), &SOLVED.1);
            *at.get_mut(&mut bytes) ^= flip;
            prop_assert!(!empty.load(&bytes));
        }

        #[test]
        fn any_bytes_are_refused_without_a_panic(body in proptest::collection::vec(any::<u8>(), 0..400)) {
            use std::sync::LazyLock;
            static EMPTY: LazyLock<StrainTable> = LazyLock::new(|| table("jersey"));
            prop_assert!(!EMPTY.load(&body));
            prop_assert!(!EMPTY.load(&sealed(&body)));
        }
    }
}
