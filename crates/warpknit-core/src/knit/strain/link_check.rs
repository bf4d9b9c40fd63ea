//! The check that loops of a strained repeat interlock as those of the flat one do.
//!
//! In: a fabric, its flat [`Pattern`] and the data points of a strained state in the axes of the flat
//! cloth. Out: whether no loop has left its old loop. Links don't change when the cloth is stretched
//! evenly, so the points are checked as they lie in the flat repeat. Cost: some microseconds a pair
//! of loops. Not promised: anything of yarns that make no loops.

use glam::DVec3;

use crate::fabric::Fabric;
use crate::knit::{Pattern, links};

/// The links of a flat repeat.
#[derive(Debug)]
pub(super) struct LinkCheck {
    fabric: Fabric,
    flat: Pattern,
    /// Loops that the flat repeat does not hold either.
    wrong: usize,
}

impl LinkCheck {
    pub(super) fn new(fabric: &Fabric, flat: &Pattern) -> Self {
        let wrong = links::measure(fabric, flat).wrong;
        Self { fabric: fabric.clone(), flat: flat.clone(), wrong }
    }

    /// Whether as many loops interlock when the data points lie there.
    pub(super) fn hold(&self, points: &[DVec3]) -> bool {
        let mut strained = self.flat.clone();
        strained.repeat.points.copy_from_slice(points);
        links::measure(&self.fabric, &strained).wrong <= self.wrong
    }
}
