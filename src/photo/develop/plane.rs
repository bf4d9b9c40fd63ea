//! Grey pictures as numbers, and masks: what the steps hand to each other.
//!
//! In: pixels. Out: [`Plane`]s of f32, row by row, four bytes a pixel, and [`Mask`]s. A photo is never held as f64 or as three planes, so that
//! 48 megapixels fit 2 GB. Rows are worked on in parallel and each sum stays within one row or one thread: results are the same for any number
//! of threads.

use std::ops::Range;

use image::{Rgb, RgbImage};
use rayon::prelude::*;

/// Numbers, a row after another.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plane {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) values: Vec<f32>,
}

/// Pixels that belong to something.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Mask {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) set: Vec<bool>,
}

impl Plane {
    pub(super) fn from_fn(width: usize, height: usize, of: impl Fn(usize, usize) -> f32 + Sync) -> Self {
        Self::from_rows(width, height, |y, row| row.iter_mut().enumerate().for_each(|(x, value)| *value = of(x, y)))
    }

    pub(super) fn from_rows(width: usize, height: usize, fill: impl Fn(usize, &mut [f32]) + Sync) -> Self {
        let mut values = vec![0.0; width * height];
        values.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| fill(y, row));
        Self { width, height, values }
    }

    /// Grey values of a picture, made smaller by a whole number: means of squares of `step` pixels.
    pub(super) fn grey(picture: &RgbImage, step: usize) -> Self {
        let (width, height) = (picture.width() as usize / step, picture.height() as usize / step);
        let bytes = picture.as_raw();
        let stride = 3 * picture.width() as usize;
        let pixels = float(step * step);
        Self::from_fn(width, height, |x, y| {
            let rows = (y * step..(y + 1) * step).map(|row| &bytes[row * stride + 3 * x * step..][..3 * step]);
            let sum: f32 = rows.flat_map(|row| row.chunks_exact(3)).map(|p| luma(Rgb([p[0], p[1], p[2]]))).sum();
            sum / pixels
        })
    }

    pub(super) fn row(&self, y: usize) -> &[f32] {
        &self.values[y * self.width..(y + 1) * self.width]
    }

    pub(super) fn at(&self, x: usize, y: usize) -> f32 {
        self.values[y * self.width + x]
    }

    /// Values all over the plane, a million or two at most: as many as any share of them needs.
    pub(super) fn asked(&self) -> impl Iterator<Item = f32> {
        self.values.iter().copied().step_by((self.values.len() >> 20).max(1))
    }

    pub(super) fn map(&self, of: impl Fn(f32) -> f32 + Sync) -> Self {
        let values = self.values.par_iter().map(|&value| of(value)).collect();
        Self { values, ..*self }
    }

    /// Means over boxes of `2 radius + 1` pixels each way, twice, which is nearly a bell; along x it goes around if `wraps`. Cost: a few operations a
    /// pixel whatever the radius.
    pub(super) fn blurred(&self, radius: usize, wraps: bool) -> Self {
        let once = |plane: &Self| plane.box_rows(radius, wraps).box_columns(radius);
        if radius == 0 { self.clone() } else { once(&once(self)) }
    }

    fn box_rows(&self, radius: usize, wraps: bool) -> Self {
        let width = self.width;
        let radius = radius.min(width.saturating_sub(1) / 2);
        Self::from_rows(width, self.height, |y, row| {
            let source = self.row(y);
            let at = |x: usize| {
                // x counts from `radius` before the row.
                if wraps { source[(x + width - radius) % width] } else { source[x.saturating_sub(radius).min(width - 1)] }
            };
            let mut sum: f64 = (0..2 * radius).map(|x| f64::from(at(x))).sum();
            for (x, value) in row.iter_mut().enumerate() {
                sum += f64::from(at(x + 2 * radius));
                *value = narrow(sum) / float(2 * radius + 1);
                sum -= f64::from(at(x));
            }
        })
    }

    /// The same down the columns, a band of rows at a time: rows lie in memory one after another.
    fn box_columns(&self, radius: usize) -> Self {
        let radius = radius.min(self.height.saturating_sub(1) / 2);
        // y counts from `radius` before the picture.
        let row = |y: usize| self.row(y.saturating_sub(radius).min(self.height - 1));
        let band = band(radius);
        let mut values = vec![0.0; self.values.len()];
        values.par_chunks_mut((band * self.width).max(1)).enumerate().for_each(|(at, rows)| {
            let mut sums = vec![0.0_f64; self.width];
            for y in band * at..band * at + 2 * radius {
                sums.iter_mut().zip(row(y)).for_each(|(sum, value)| *sum += f64::from(*value));
            }
            for (y, values) in (band * at..).zip(rows.chunks_exact_mut(self.width)) {
                let ends = row(y + 2 * radius).iter().zip(row(y));
                for ((sum, value), (next, last)) in sums.iter_mut().zip(values).zip(ends) {
                    *sum += f64::from(*next);
                    *value = narrow(*sum) / float(2 * radius + 1);
                    *sum -= f64::from(*last);
                }
            }
        });
        Self { values, ..*self }
    }
}

/// Rows that a thread works down at a time. It reads `2 radius` more to begin with, so these are to be few beside. Threads have no say in it: sums are
/// the same for any number of them.
fn band(radius: usize) -> usize {
    (4 * radius).max(64)
}

impl Mask {
    pub(super) fn of(plane: &Plane, is_set: impl Fn(f32) -> bool + Sync) -> Self {
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
    pub(super) fn linked_to(&self, seeds: &Self) -> Self {
        let pieces = Pieces::of(self);
        self.only(pieces.with(|run| seeds.set[run.clone()].contains(&true)))
    }

    /// The largest piece whose pixels are linked.
    pub(super) fn largest(&self) -> Self {
        self.only(Pieces::of(self).largest())
    }

    /// The mask without the holes that it closes in from all sides.
    pub(super) fn filled(&self) -> Self {
        let ground = self.inverted();
        let (width, last) = (self.width, self.set.len() - self.width);
        let is_rim = |run: &Range<usize>| {
            run.start < width || run.start >= last || run.start.is_multiple_of(width) || run.end.is_multiple_of(width)
        };
        ground.only(Pieces::of(&ground).with(is_rim)).inverted()
    }

    /// The largest piece without what is at most `2 radius` thick; all of the mask where nothing is thicker.
    pub(super) fn worn(&self, radius: usize) -> Self {
        let thick = self.eroded(radius).dilated(radius);
        if thick.set.contains(&true) { thick.largest() } else { self.clone() }
    }

    fn only(&self, runs: impl Iterator<Item = Range<usize>>) -> Self {
        let mut set = vec![false; self.set.len()];
        runs.for_each(|run| set[run].fill(true));
        Self { set, ..*self }
    }

    /// The mask less the pixels within `radius` each way of what isn't in it; the picture's rim does not count as outside. Cost: two passes
    /// whatever the radius.
    pub(super) fn eroded(&self, radius: usize) -> Self {
        self.worn_rows(radius).worn_columns(radius)
    }

    /// The mask and the pixels within `radius` of it each way.
    pub(super) fn dilated(&self, radius: usize) -> Self {
        self.inverted().eroded(radius).inverted()
    }

    /// Keeps what has set pixels alone up to `radius` to the left and to the right.
    fn worn_rows(&self, radius: usize) -> Self {
        let mut worn = vec![false; self.set.len()];
        worn.par_chunks_mut(self.width).zip(self.set.par_chunks(self.width)).for_each(|(worn, set)| {
            // How many pixels are set in a row up to here; beyond the rim all are.
            let mut run = 2 * radius + 1;
            for x in 0..set.len() + radius {
                run = if set.get(x).is_none_or(|&set| set) { run + 1 } else { 0 };
                if let Some(worn) = x.checked_sub(radius).and_then(|x| worn.get_mut(x)) {
                    *worn = run > 2 * radius;
                }
            }
        });
        Self { set: worn, ..*self }
    }

    /// The same up and down, a band of rows at a time: rows lie in memory one after another.
    fn worn_columns(&self, radius: usize) -> Self {
        let (width, band) = (self.width, band(radius));
        let whole_run = u32::try_from(2 * radius + 1).unwrap_or(u32::MAX);
        let mut worn = vec![false; self.set.len()];
        worn.par_chunks_mut(band * width).enumerate().for_each(|(at, worn)| {
            let mut runs = vec![whole_run; width];
            let take = |runs: &mut [u32], y: usize| {
                let set = self.set.get(y * width..(y + 1) * width);
                match set {
                    Some(set) => runs.iter_mut().zip(set).for_each(|(run, set)| *run = (*run + 1) * u32::from(*set)),
                    // Below the picture all is set.
                    None => runs.iter_mut().for_each(|run| *run += 1),
                }
            };
            let first = band * at;
            (first.saturating_sub(radius)..first + radius).for_each(|y| take(&mut runs, y));
            for (y, worn) in (first..).zip(worn.chunks_exact_mut(width)) {
                take(&mut runs, y + radius);
                worn.iter_mut().zip(&runs).for_each(|(worn, run)| *worn = *run >= whole_run);
            }
        });
        Self { set: worn, ..*self }
    }
}

/// A mask's stretches of set pixels in its rows, each with the piece it belongs to: far fewer than pixels, so that linking them costs little beside
/// finding them.
struct Pieces {
    /// Places in the mask's rows one after another, in order.
    runs: Vec<Range<usize>>,
    /// The first run of each run's piece.
    firsts: Vec<usize>,
}

impl Pieces {
    fn of(mask: &Mask) -> Self {
        let mut pieces = Self { runs: Vec::new(), firsts: Vec::new() };
        let mut above = 0..0;
        for y in 0..mask.height {
            let begin = pieces.runs.len();
            pieces.take_row(mask, y);
            pieces.link(above, begin, mask.width);
            above = begin..pieces.runs.len();
        }
        // A run's first comes before it, so that its own first is final already.
        for run in 0..pieces.firsts.len() {
            pieces.firsts[run] = pieces.firsts[pieces.firsts[run]];
        }
        pieces
    }

    fn take_row(&mut self, mask: &Mask, y: usize) {
        let row = &mask.set[y * mask.width..(y + 1) * mask.width];
        let mut x = 0;
        while let Some(start) = row[x..].iter().position(|&set| set).map(|skipped| x + skipped) {
            x = row[start..].iter().position(|&set| !set).map_or(row.len(), |length| start + length);
            self.firsts.push(self.runs.len());
            self.runs.push(y * mask.width + start..y * mask.width + x);
        }
    }

    /// Joins the runs from `begin` on with those of the row above that they touch.
    fn link(&mut self, mut above: Range<usize>, begin: usize, width: usize) {
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
                self.join(run, other);
                other += 1;
            }
        }
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.first(a), self.first(b));
        self.firsts[a.max(b)] = a.min(b);
    }

    fn first(&mut self, mut run: usize) -> usize {
        while self.firsts[run] != run {
            // Halving the way as it is gone keeps it short.
            self.firsts[run] = self.firsts[self.firsts[run]];
            run = self.firsts[run];
        }
        run
    }

    /// The runs of all pieces with a run of a kind.
    fn with(self, is_seed: impl Fn(&Range<usize>) -> bool) -> impl Iterator<Item = Range<usize>> {
        let mut is_chosen = vec![false; self.runs.len()];
        for (run, first) in self.runs.iter().zip(&self.firsts) {
            is_chosen[*first] = is_chosen[*first] || is_seed(run);
        }
        self.runs.into_iter().zip(self.firsts).filter(move |(_, first)| is_chosen[*first]).map(|(run, _)| run)
    }

    /// The runs of the piece with most pixels, the first of such.
    fn largest(self) -> impl Iterator<Item = Range<usize>> {
        let mut counts = vec![0; self.runs.len()];
        self.runs.iter().zip(&self.firsts).for_each(|(run, first)| counts[*first] += run.len());
        let most = counts.iter().copied().max().unwrap_or(0);
        let best = counts.iter().position(|&count| count == most);
        self.runs.into_iter().zip(self.firsts).filter(move |(_, first)| Some(*first) == best).map(|(run, _)| run)
    }
}

/// Columns that a thread sums at a time: they lie side by side in memory.
const COLUMNS: usize = 64;

/// Sums over some rows, column by column.
pub(super) fn column_sums(
    columns: usize,
    rows: impl Iterator<Item = usize> + Clone + Sync,
    of: impl Fn(usize, usize) -> f32 + Sync,
) -> Vec<f64> {
    let mut sums = vec![0.0; columns];
    sums.par_chunks_mut(COLUMNS).enumerate().for_each(|(at, sums)| {
        for y in rows.clone() {
            (COLUMNS * at..).zip(sums.iter_mut()).for_each(|(x, sum)| *sum += f64::from(of(x, y)));
        }
    });
    sums
}

/// How bright a pixel looks, 0..=255, by Rec. 709's weights of the codes.
pub(super) fn luma(Rgb([r, g, b]): Rgb<u8>) -> f32 {
    0.2126 * f32::from(r) + 0.7152 * f32::from(g) + 0.0722 * f32::from(b)
}

/// The value below which a share of the values lies; 0 of none.
pub(super) fn percentile(values: &mut [f32], share: f32) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let at = whole(share.clamp(0.0, 1.0) * float(values.len() - 1));
    *values.select_nth_unstable_by(at, f32::total_cmp).1
}

#[expect(clippy::cast_precision_loss, reason = "counts of pixels: rounding is far below what is seen")]
pub(super) fn float(count: usize) -> f32 {
    count as f32
}

#[expect(clippy::cast_precision_loss, reason = "sides of pictures are far under 2^52")]
pub(super) fn double(count: usize) -> f64 {
    count as f64
}

#[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
pub(super) fn narrow(number: f64) -> f32 {
    number as f32
}

/// The whole part; 0 of what is negative.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
pub(super) fn whole(number: f32) -> usize {
    number as usize
}

/// The nearest byte.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
pub(super) fn byte(value: f32) -> u8 {
    (value + 0.5) as u8
}

/// A side of a picture in the 32 bits that the image crate counts with.
pub(super) fn side(count: usize) -> u32 {
    u32::try_from(count).expect("sides of photos are limited")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(rows: &[&str]) -> Mask {
        let set = rows.iter().flat_map(|row| row.bytes().map(|byte| byte == b'#')).collect();
        Mask { width: rows[0].len(), height: rows.len(), set }
    }

    #[test]
    fn blurring_keeps_a_flat_plane_and_goes_around_if_asked() {
        let flat = Plane::from_fn(9, 5, |_, _| 3.0);
        assert!(flat.blurred(2, false).values.iter().all(|value| (value - 3.0).abs() < 1e-6));
        let spot = Plane::from_fn(9, 5, |x, _| if x == 0 { 1.0 } else { 0.0 });
        let (around, ends) = (spot.blurred(1, true), spot.blurred(1, false));
        assert!(around.at(8, 2) > 0.2 && ends.at(8, 2) == 0.0);
        let row: f32 = around.row(2).iter().sum();
        assert!((row - 1.0).abs() < 1e-5);
    }

    #[test]
    fn the_largest_piece_stays_and_its_holes_are_filled() {
        let found = mask(&["#......", "...###.", "...#.#.", "...###."]).largest().filled();
        assert_eq!(found, mask(&[".......", "...###.", "...###.", "...###."]));
        assert_eq!(found.eroded(1).share(), 2.0 / 28.0, "the lower rim is not outside");
        assert_eq!(found.eroded(1).dilated(1), mask(&[".......", "...###.", "...###.", "...###."]));
        assert_eq!(mask(&["..", ".."]).largest().share(), 0.0);
        let arms = mask(&["#...#..", ".#.#..#", "..#...#", "......."]);
        assert_eq!(arms.largest(), mask(&["#...#..", ".#.#...", "..#....", "......."]), "diagonals link");
        assert_eq!(arms.linked_to(&mask(&[".......", "......#", ".......", "#......"])).pixels().collect::<Vec<_>>(), [13, 20]);
    }

    #[test]
    fn wear_and_growth_by_some_pixels_are_that_many_times_by_one() {
        let plane = Plane::from_fn(90, 150, |x, y| float((x * 7919 + y * 104_729 + x * y * 31) % 97));
        let mask = Mask::of(&plane, |value| value > 1.0);
        let once = |mask: &Mask, value: bool| {
            let near = |at: usize, size: usize| at.saturating_sub(1)..=(at + 1).min(size - 1);
            let any = |x: usize, y: usize| near(y, 150).any(|y| near(x, 90).any(|x| mask.at(x, y) == value));
            let set = (0..90 * 150).map(|at| if any(at % 90, at / 90) { value } else { !value }).collect();
            Mask { set, ..*mask }
        };
        let (mut worn, mut grown) = (mask.clone(), mask.inverted());
        for radius in 1..4 {
            (worn, grown) = (once(&worn, false), once(&grown, true));
            assert_eq!((&mask.eroded(radius), &mask.inverted().dilated(radius)), (&worn, &grown), "{radius}");
        }
    }

    #[test]
    fn blurring_is_a_mean_over_boxes_whatever_the_band() {
        let plane = Plane::from_fn(7, 200, |x, y| float((x * 31 + y * 17) % 23));
        let blurred = plane.box_columns(2);
        for (x, y) in [(0, 0), (3, 63), (4, 64), (5, 66), (6, 199)] {
            let near = |off: usize| plane.at(x, (y + off).saturating_sub(2).min(199));
            let mean = (0..5).map(near).sum::<f32>() / 5.0;
            assert!((blurred.at(x, y) - mean).abs() < 1e-4, "{x} {y}");
        }
    }

    #[test]
    fn smaller_planes_are_means_and_percentiles_are_values() {
        let picture = RgbImage::from_fn(5, 4, |x, _| Rgb([if x < 2 { 0 } else { 100 }; 3]));
        let half = Plane::grey(&picture, 2);
        assert_eq!((half.width, half.height), (2, 2));
        assert!(half.at(0, 0) == 0.0 && (half.at(1, 1) - 100.0).abs() < 1e-4);
        assert_eq!(percentile(&mut [3.0, 1.0, 2.0], 0.5), 2.0);
        assert_eq!(percentile(&mut [], 0.5), 0.0);
    }
}
