//! Binary masks: morphology and connected components.
//!
//! In: a plane and a predicate on its values. Out: [`Mask`]s, dilated, eroded or filled, and their
//! 8-connected components.
//!
//! Erosion and dilation use a square of `2 radius + 1` pixels. The square is separable: one pass
//! over the rows and one over the columns, each with a running count, so the cost does not depend
//! on the radius. Components are found over runs of set pixels with union-find (Rosenfeld and
//! Pfaltz 1966, "Sequential operations in digital picture processing").

use std::ops::Range;

use rayon::prelude::*;

use crate::plane::{Plane, band, float};

/// The pixels that have some property.
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

    /// The share of pixels that are set.
    pub(super) fn share(&self) -> f32 {
        float(self.set.iter().filter(|&&set| set).count()) / float(self.set.len().max(1))
    }

    /// The indices of the set pixels, row by row.
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

    /// The components that contain a pixel of `seeds`. Pixels that touch diagonally are connected.
    pub(super) fn connected_to(&self, seeds: &Self) -> Self {
        let components = ConnectedComponents::from_mask(self);
        self.with_runs(components.containing(|run| seeds.set[run.clone()].contains(&true)))
    }

    /// The component with the most pixels.
    pub(super) fn largest(&self) -> Self {
        self.with_runs(ConnectedComponents::from_mask(self).largest())
    }

    /// The mask with its holes filled. A hole is unset and not connected to the picture's border.
    pub(super) fn filled(&self) -> Self {
        // All that is connected to the border is outside, and the rest is the mask and its holes.
        let ground = self.inverted();
        let outside =
            ConnectedComponents::from_mask(&ground).containing(|run| self.touches_border(run));
        ground.with_runs(outside).inverted()
    }

    /// Whether a run of pixels in a row touches the picture's border.
    fn touches_border(&self, run: &Range<usize>) -> bool {
        let (width, last) = (self.width, self.set.len() - self.width);
        run.start < width
            || run.start >= last
            || run.start.is_multiple_of(width)
            || run.end.is_multiple_of(width)
    }

    /// The largest component of the morphological opening, which removes all that is at most
    /// `2 radius` thick. Where nothing is thicker, the mask itself.
    pub(super) fn largest_opened(&self, radius: usize) -> Self {
        let thick = self.eroded(radius).dilated(radius);
        if thick.set.contains(&true) { thick.largest() } else { self.clone() }
    }

    fn with_runs(&self, runs: impl Iterator<Item = Range<usize>>) -> Self {
        let mut set = vec![false; self.set.len()];
        runs.for_each(|run| set[run].fill(true));
        Self { set, ..*self }
    }

    /// Erosion by a square: the pixels that have set pixels only within `radius` each way. Beyond
    /// the picture's border everything counts as set, so that a yarn that leaves the picture keeps
    /// its ends.
    pub(super) fn eroded(&self, radius: usize) -> Self {
        self.eroded_rows(radius).eroded_columns(radius)
    }

    /// Dilation by a square: the pixels that have a set pixel within `radius` each way.
    pub(super) fn dilated(&self, radius: usize) -> Self {
        // Dilating a set is eroding its complement.
        self.inverted().eroded(radius).inverted()
    }

    /// Erosion along the rows.
    fn eroded_rows(&self, radius: usize) -> Self {
        let mut eroded = vec![false; self.set.len()];
        eroded.par_chunks_mut(self.width).zip(self.set.par_chunks(self.width)).for_each(
            |(eroded, set)| {
                // The count of consecutive set pixels that end here. A pixel survives where the run
                // that ends `radius` after it has at least `2 radius + 1` pixels. The count starts
                // full, since everything beyond the border is set.
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

    /// Erosion along the columns. It works on bands of whole rows, and advances the counts of all
    /// columns together: walking down one column at a time would miss the cache at each pixel.
    fn eroded_columns(&self, radius: usize) -> Self {
        let (width, band) = (self.width, band(radius));
        let whole_run = u32::try_from(2 * radius + 1).unwrap_or(u32::MAX);
        let mut eroded = vec![false; self.set.len()];
        eroded.par_chunks_mut(band * width).enumerate().for_each(|(at, eroded)| {
            let mut runs = vec![whole_run; width];
            let first = band * at;
            // Each band first reads the rows above it that its counts depend on, so bands do not
            // depend on each other and can run in parallel.
            for y in first.saturating_sub(radius)..first + radius {
                self.advance_column_runs(&mut runs, y);
            }
            for (y, eroded) in (first..).zip(eroded.chunks_exact_mut(width)) {
                self.advance_column_runs(&mut runs, y + radius);
                eroded.iter_mut().zip(&runs).for_each(|(eroded, run)| *eroded = *run >= whole_run);
            }
        });
        Self { set: eroded, ..*self }
    }

    /// Extends each column's count of consecutive set pixels by row `y`, or starts it anew.
    fn advance_column_runs(&self, runs: &mut [u32], y: usize) {
        match self.set.get(y * self.width..(y + 1) * self.width) {
            // Multiplying by 0 or 1 is a reset without a branch, which the compiler vectorises.
            Some(set) => {
                runs.iter_mut().zip(set).for_each(|(run, set)| *run = (*run + 1) * u32::from(*set));
            }
            // Below the picture everything is set.
            None => runs.iter_mut().for_each(|run| *run += 1),
        }
    }
}

/// The 8-connected components of a mask, as a disjoint-set forest over its runs. A run is a stretch
/// of set pixels in a row; there are far fewer runs than pixels, so that connecting them costs
/// little beside finding them.
struct ConnectedComponents {
    /// Index ranges of the set pixels, in order.
    runs: Vec<Range<usize>>,
    /// For each run another run of its component that comes before it, or the run itself if it is
    /// the component's first one (the root of its tree).
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
        // A parent comes before its child, so its own parent is a root already: one pass makes
        // every parent a root.
        for run in 0..components.parents.len() {
            components.parents[run] = components.parents[components.parents[run]];
        }
        components
    }

    /// Adds the runs of a row, each as a component of its own.
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

    /// Joins the runs from `begin` on with the runs of the row above that they touch. Both rows are
    /// sorted, so two indices that only advance find all touching pairs.
    fn connect_rows(&mut self, mut above: Range<usize>, begin: usize, width: usize) {
        if above.is_empty() {
            return;
        }
        for run in begin..self.runs.len() {
            // The run moved up by a row. Comparing its ends inclusively accepts diagonal contact.
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

    /// Joins the components of two runs. The earlier root stays root.
    fn union(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b)] = a.min(b);
    }

    /// The first run of a run's component.
    fn root(&mut self, mut run: usize) -> usize {
        while self.parents[run] != run {
            // Path halving: each node on the way is hung one level higher, which keeps trees flat.
            self.parents[run] = self.parents[self.parents[run]];
            run = self.parents[run];
        }
        run
    }

    /// The runs of all components that have a run for which `is_seed` holds.
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

    /// The runs of the component with the most pixels, the first one of several.
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
