//! Masks: which pixels belong to something.
//!
//! In: a plane and what tells. Out: [`Mask`]s, grown, eroded, filled, and their components.

use std::ops::Range;

use rayon::prelude::*;

use crate::plane::{Plane, band, float};

/// Pixels that belong to something.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Mask {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) set: Vec<bool>,
}

impl Mask {
    pub(super) fn from_plane(plane: &Plane, is_set: impl Fn(f32) -> bool + Sync) -> Self {
        let set = plane.values.par_iter().map(|&value| is_set(value)).collect();
        Self { width: plane.width, height: plane.height, set }
    }

    pub(super) fn at(&self, x: usize, y: usize) -> bool {
        self.set[y * self.width + x]
    }

    pub(super) fn share(&self) -> f32 {
        float(self.set.iter().filter(|&&set| set).count()) / float(self.set.len().max(1))
    }

    /// Its pixels, as places in the rows one after another.
    pub(super) fn pixels(&self) -> impl Iterator<Item = usize> {
        (0..self.set.len()).filter(|&at| self.set[at])
    }

    pub(super) fn or(&self, other: &Self) -> Self {
        let set = self.set.par_iter().zip(&other.set).map(|(a, b)| *a || *b).collect();
        Self { set, ..*self }
    }

    fn inverted(&self) -> Self {
        let set = self.set.par_iter().map(|&set| !set).collect();
        Self { set, ..*self }
    }

    /// What is linked to the pixels of `seeds`, diagonally too.
    pub(super) fn connected_to(&self, seeds: &Self) -> Self {
        let components = ConnectedComponents::from_mask(self);
        self.from_runs(components.containing(|run| seeds.set[run.clone()].contains(&true)))
    }

    /// The largest piece whose pixels are linked.
    pub(super) fn largest(&self) -> Self {
        self.from_runs(ConnectedComponents::from_mask(self).largest())
    }

    /// The mask without the holes that it closes in from all sides.
    pub(super) fn filled(&self) -> Self {
        let ground = self.inverted();
        let (width, last) = (self.width, self.set.len() - self.width);
        let is_rim = |run: &Range<usize>| {
            run.start < width
                || run.start >= last
                || run.start.is_multiple_of(width)
                || run.end.is_multiple_of(width)
        };
        ground.from_runs(ConnectedComponents::from_mask(&ground).containing(is_rim)).inverted()
    }

    /// The largest piece without what is at most `2 radius` thick; all of the mask where nothing is
    /// thicker.
    pub(super) fn largest_opened(&self, radius: usize) -> Self {
        let thick = self.eroded(radius).dilated(radius);
        if thick.set.contains(&true) { thick.largest() } else { self.clone() }
    }

    fn from_runs(&self, runs: impl Iterator<Item = Range<usize>>) -> Self {
        let mut set = vec![false; self.set.len()];
        runs.for_each(|run| set[run].fill(true));
        Self { set, ..*self }
    }

    /// The mask less the pixels within `radius` each way of what isn't in it; the picture's rim
    /// does not count as outside. Cost: two passes whatever the radius.
    pub(super) fn eroded(&self, radius: usize) -> Self {
        self.eroded_rows(radius).eroded_columns(radius)
    }

    /// The mask and the pixels within `radius` of it each way.
    pub(super) fn dilated(&self, radius: usize) -> Self {
        self.inverted().eroded(radius).inverted()
    }

    /// Keeps what has set pixels alone up to `radius` to the left and to the right.
    fn eroded_rows(&self, radius: usize) -> Self {
        let mut eroded = vec![false; self.set.len()];
        eroded.par_chunks_mut(self.width).zip(self.set.par_chunks(self.width)).for_each(
            |(eroded, set)| {
                // How many pixels are set in a row up to here; beyond the rim all are.
                let mut run = 2 * radius + 1;
                for x in 0..set.len() + radius {
                    run = if set.get(x).is_none_or(|&set| set) { run + 1 } else { 0 };
                    if let Some(eroded) = x.checked_sub(radius).and_then(|x| eroded.get_mut(x)) {
                        *eroded = run > 2 * radius;
                    }
                }
            },
        );
        Self { set: eroded, ..*self }
    }

    /// The same up and down, a band of rows at a time: rows lie in memory one after another.
    fn eroded_columns(&self, radius: usize) -> Self {
        let (width, band) = (self.width, band(radius));
        let whole_run = u32::try_from(2 * radius + 1).unwrap_or(u32::MAX);
        let mut eroded = vec![false; self.set.len()];
        eroded.par_chunks_mut(band * width).enumerate().for_each(|(at, eroded)| {
            let mut runs = vec![whole_run; width];
            let take = |runs: &mut [u32], y: usize| {
                let set = self.set.get(y * width..(y + 1) * width);
                match set {
                    Some(set) => runs
                        .iter_mut()
                        .zip(set)
                        .for_each(|(run, set)| *run = (*run + 1) * u32::from(*set)),
                    // Below the picture all is set.
                    None => runs.iter_mut().for_each(|run| *run += 1),
                }
            };
            let first = band * at;
            (first.saturating_sub(radius)..first + radius).for_each(|y| take(&mut runs, y));
            for (y, eroded) in (first..).zip(eroded.chunks_exact_mut(width)) {
                take(&mut runs, y + radius);
                eroded.iter_mut().zip(&runs).for_each(|(eroded, run)| *eroded = *run >= whole_run);
            }
        });
        Self { set: eroded, ..*self }
    }
}

/// A mask's stretches of set pixels in its rows, each with the piece it belongs to: far fewer than
/// pixels, so that linking them costs little beside finding them.
struct ConnectedComponents {
    /// Places in the mask's rows one after another, in order.
    runs: Vec<Range<usize>>,
    /// The first run of each run's piece.
    parents: Vec<usize>,
}

impl ConnectedComponents {
    fn from_mask(mask: &Mask) -> Self {
        let mut components = Self { runs: Vec::new(), parents: Vec::new() };
        let mut above = 0..0;
        for y in 0..mask.height {
            let begin = components.runs.len();
            components.add_row(mask, y);
            components.connect_rows(above, begin, mask.width);
            above = begin..components.runs.len();
        }
        // A run's first comes before it, so that its own first is final already.
        for run in 0..components.parents.len() {
            components.parents[run] = components.parents[components.parents[run]];
        }
        components
    }

    fn add_row(&mut self, mask: &Mask, y: usize) {
        let row = &mask.set[y * mask.width..(y + 1) * mask.width];
        let mut x = 0;
        while let Some(start) = row[x..].iter().position(|&set| set).map(|skipped| x + skipped) {
            x = row[start..]
                .iter()
                .position(|&set| !set)
                .map_or(row.len(), |length| start + length);
            self.parents.push(self.runs.len());
            self.runs.push(y * mask.width + start..y * mask.width + x);
        }
    }

    /// Joins the runs from `begin` on with those of the row above that they touch.
    fn connect_rows(&mut self, mut above: Range<usize>, begin: usize, width: usize) {
        if above.is_empty() {
            return;
        }
        for run in begin..self.runs.len() {
            let own = self.runs[run].start - width..self.runs[run].end - width;
            while above.start < above.end && self.runs[above.start].end < own.start {
                above.start += 1;
            }
            let mut other = above.start;
            while other < above.end && self.runs[other].start <= own.end {
                self.union(run, other);
                other += 1;
            }
        }
    }

    fn union(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b)] = a.min(b);
    }

    fn root(&mut self, mut run: usize) -> usize {
        while self.parents[run] != run {
            // Halving the way as it is gone keeps it short.
            self.parents[run] = self.parents[self.parents[run]];
            run = self.parents[run];
        }
        run
    }

    /// The runs of all components with a run of a kind.
    fn containing(
        self,
        is_seed: impl Fn(&Range<usize>) -> bool,
    ) -> impl Iterator<Item = Range<usize>> {
        let mut is_chosen = vec![false; self.runs.len()];
        for (run, first) in self.runs.iter().zip(&self.parents) {
            is_chosen[*first] = is_chosen[*first] || is_seed(run);
        }
        self.runs
            .into_iter()
            .zip(self.parents)
            .filter(move |(_, first)| is_chosen[*first])
            .map(|(run, _)| run)
    }

    /// The runs of the piece with most pixels, the first of such.
    fn largest(self) -> impl Iterator<Item = Range<usize>> {
        let mut counts = vec![0; self.runs.len()];
        self.runs.iter().zip(&self.parents).for_each(|(run, first)| counts[*first] += run.len());
        let most = counts.iter().copied().max().unwrap_or(0);
        let best = counts.iter().position(|&count| count == most);
        self.runs
            .into_iter()
            .zip(self.parents)
            .filter(move |(_, first)| Some(*first) == best)
            .map(|(run, _)| run)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(rows: &[&str]) -> Mask {
        let set = rows.iter().flat_map(|row| row.bytes().map(|byte| byte == b'#')).collect();
        Mask { width: rows[0].len(), height: rows.len(), set }
    }

    #[test]
    fn the_largest_piece_stays_and_its_holes_are_filled() {
        let found = mask(&["#......", "...###.", "...#.#.", "...###."]).largest().filled();
        assert_eq!(found, mask(&[".......", "...###.", "...###.", "...###."]));
        assert_eq!(found.eroded(1).share(), 2.0 / 28.0, "the lower rim is not outside");
        assert_eq!(found.eroded(1).dilated(1), mask(&[".......", "...###.", "...###.", "...###."]));
        assert_eq!(mask(&["..", ".."]).largest().share(), 0.0);
        let arms = mask(&["#...#..", ".#.#..#", "..#...#", "......."]);
        assert_eq!(
            arms.largest(),
            mask(&["#...#..", ".#.#...", "..#....", "......."]),
            "diagonals link"
        );
        assert_eq!(
            arms.connected_to(&mask(&[".......", "......#", ".......", "#......"]))
                .pixels()
                .collect::<Vec<_>>(),
            [13, 20]
        );
    }

    #[test]
    fn wear_and_growth_by_some_pixels_are_that_many_times_by_one() {
        let plane =
            Plane::from_fn(90, 150, |x, y| float((x * 7919 + y * 104_729 + x * y * 31) % 97));
        let mask = Mask::from_plane(&plane, |value| value > 1.0);
        let once = |mask: &Mask, value: bool| {
            let near = |at: usize, size: usize| at.saturating_sub(1)..=(at + 1).min(size - 1);
            let any = |x: usize, y: usize| {
                near(y, 150).any(|y| near(x, 90).any(|x| mask.at(x, y) == value))
            };
            let set = (0..90 * 150)
                .map(|at| if any(at % 90, at / 90) { value } else { !value })
                .collect();
            Mask { set, ..*mask }
        };
        let (mut eroded, mut grown) = (mask.clone(), mask.inverted());
        for radius in 1..4 {
            (eroded, grown) = (once(&eroded, false), once(&grown, true));
            assert_eq!(
                (&mask.eroded(radius), &mask.inverted().dilated(radius)),
                (&eroded, &grown),
                "{radius}"
            );
        }
    }
}
