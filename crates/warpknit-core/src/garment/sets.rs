//! Disjoint sets: union-find with path halving.
//!
//! In: unions of numbers below a count. Out: the root of each number's set, its smallest member,
//! whatever the order of the unions. Cost: nearly constant for each call.

use crate::ids::index32;

/// Disjoint sets of the numbers from 0.
pub(super) struct Sets(Vec<u32>);

impl Sets {
    /// A set for each number below `count`.
    pub(super) fn new(count: usize) -> Self {
        Self((0..index32(count)).collect())
    }

    /// Number of numbers.
    pub(super) fn count(&self) -> u32 {
        index32(self.0.len())
    }

    /// The root of the set of `x`.
    pub(super) fn root(&mut self, mut x: u32) -> u32 {
        while self.0[x as usize] != x {
            // Path halving (Tarjan and van Leeuwen, Worst-case analysis of set union algorithms,
            // 1984): each element on the way is attached to its grandparent.
            self.0[x as usize] = self.0[self.0[x as usize] as usize];
            x = self.0[x as usize];
        }
        x
    }

    /// Unites the sets of `a` and `b`.
    pub(super) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}
