//! Lappings that no catalogue holds: a search over the laps of two full bars.
//!
//! In: photos. Out: the lappings that explain them best, as fits of drafts.
//!
//! Method: the height of the repeat is known, the number of courses in it is not: all numbers up to
//! [`MOST_COURSES`] are tried for which the photo repeats. Lappings are put together from
//! [`Stitches`].
//!
//! - Two courses: all of them.
//! - More: from some lappings, both bars' laps of one course or two laps of one bar are changed,
//!   whatever is best. Where this soon explains far less than another number of courses, nothing
//!   more is tried. Otherwise three courses are searched wholly, and four from more lappings.
//!
//! All lappings are drawn roughly, and those that explain most finely.
//!
//! Cost: 60 microseconds a fine lapping of a photo of both faces, and a rough one has a quarter of its pixels;
//! some ten thousand lappings. Not promised: bars
//! that are not fully threaded, inlays, three bars, more courses.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use rayon::prelude::*;

use super::candidate::{Candidate, full_bars, proportioned};
use super::fit::{Fit, fit_in};
use super::same::ClothKey;
use super::sketch::{Detail, Raster};
use super::stitches::{Lap, Laps, NEEDLES, Stitches};
use super::view::{FaceView, MOST_COURSES};
use crate::plane::double;

/// Frames of each photo that are tried for a number of courses.
const FRAMES: usize = 2;
/// A number of courses and its frames are tried if their fold is worth this share of the best.
const AS_GOOD: f64 = 0.97;
/// Courses may differ by this share between the photos.
const SAME_PROPORTION: f64 = 0.1;
/// Lappings from which a first look at a number of courses starts, and rounds of changes.
const FIRST_STARTS: usize = 4;
const FIRST_ROUNDS: usize = 2;
/// A number of courses is looked at further if the first look found this share of the best.
const WORTH: f64 = 0.8;
/// Lappings from which the search over four courses starts.
const STARTS: usize = 24;
/// The best that it found are changed further, in so many rounds at most.
const BEAM: usize = 4;
const ROUNDS: usize = 8;
/// Lappings that are returned.
const FOUND: usize = 16;
/// Of these, at most so many have the same front bar, or the same back bar.
const SAME_BAR: usize = 4;
/// The same of those beside a lapping.
const NEAR: usize = 8;
/// Lappings that are kept while searching.
const KEPT: usize = 200;
/// One of so many lappings that were drawn roughly, the best of them, is drawn finely, and at least so many:
/// as many random lappings were found as with all drawn finely, in 0.72 of the time.
const FINE_SHARE: usize = 8;
const LEAST_FINE: usize = 40;
/// Blur of sketches, as for drafts.
const BLUR: f64 = 1.2;

/// A number of courses that the photos may show.
struct CourseHypothesis {
    courses: usize,
    /// Course spacing over wale spacing.
    proportion: f64,
    /// The frames of each photo.
    frames: Vec<Vec<usize>>,
}

/// The search over lappings of two full bars.
pub(super) struct Search {
    hypotheses: Vec<CourseHypothesis>,
    stitches: Vec<Stitches>,
    /// Lappings that were returned, each with its hypothesis.
    returned: BTreeMap<ClothKey, (Laps, usize)>,
}

impl Search {
    /// Looks for the repeats of the photos.
    pub(super) fn new(views: &mut [FaceView]) -> Self {
        let mut search =
            Self { hypotheses: Vec::new(), stitches: Vec::new(), returned: BTreeMap::new() };
        for hypothesis in hypotheses(views) {
            if let Some(stitches) = Stitches::new(hypothesis.courses, hypothesis.proportion) {
                search.hypotheses.push(hypothesis);
                search.stitches.push(stitches);
            }
        }
        search
    }

    /// The best lappings, the best first.
    pub(super) fn run(&mut self, photos: &mut [FaceView]) -> Vec<Fit> {
        let views = &*photos;
        let all = self.hypotheses.iter().zip(&mut self.stitches);
        let mut first: Vec<(Compared<'_>, Found)> = all
            .map(|(hypothesis, stitches)| {
                let mut search = Compared { views, hypothesis, stitches, seen: BTreeSet::new() };
                let found = search.first();
                (search, found)
            })
            .collect();
        let top = |found: &Found| found.first().map_or(0.0, |best| best.0);
        let best = first.iter().map(|(_, found)| top(found)).fold(0.0, f64::max);
        let mut all = Vec::new();
        for (number, (search, found)) in first.iter_mut().enumerate() {
            if top(found) >= WORTH * best {
                let found = search.more(std::mem::take(found));
                all.extend(found.into_iter().map(|(share, laps)| (share, laps, number)));
            }
        }
        self.drafts(photos, all, FOUND)
    }

    /// The best lappings that differ from some of those returned in one lap, or in two of one bar,
    /// the best first.
    pub(super) fn near(&mut self, views: &mut [FaceView], fits: &[Fit]) -> Vec<Fit> {
        let mut found = Vec::new();
        for fit in fits {
            let known = fit.candidate.key.as_ref().and_then(|key| self.returned.get(key));
            let Some((laps, number)) = known.cloned() else { continue };
            let hypothesis = &self.hypotheses[number];
            let stitches = &mut self.stitches[number];
            let mut search = Compared { views, hypothesis, stitches, seen: BTreeSet::new() };
            let one_bar = (0..laps.len()).flat_map(|bar| changes(&laps, bar));
            let both = (0..laps[0].len()).flat_map(|course| joint_changes(&laps, course));
            let near = search.compared(one_bar.chain(both).collect());
            found.extend(near.into_iter().map(|(share, laps)| (share, laps, number)));
        }
        self.drafts(views, found, NEAR)
    }

    /// The best of some lappings as drafts, those left out that were returned before.
    fn drafts(
        &mut self,
        views: &mut [FaceView],
        mut found: Vec<(f64, Laps, usize)>,
        most: usize,
    ) -> Vec<Fit> {
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
        let mut fits = Vec::new();
        let mut bars: BTreeMap<(usize, Vec<Lap>), usize> = BTreeMap::new();
        for (_, laps, number) in found {
            // Stitches are drafts, and lappings of one wrong bar crowd out the right one.
            let own = laps.iter().map(|bar| canonical(&vec![bar.clone()]).swap_remove(0));
            let own: Vec<(usize, Vec<Lap>)> = own.enumerate().collect();
            if own.iter().any(|bar| bars.get(bar).is_some_and(|count| *count >= SAME_BAR)) {
                continue;
            }
            let hypothesis = &self.hypotheses[number];
            let chains: Vec<String> = laps.iter().map(|bar| text(bar)).collect();
            let Ok(fabric) = full_bars(&chains) else { continue };
            let Some(knit) = fabric.warp_knit() else { continue };
            let key = ClothKey::new(knit, fabric.repeat(), fabric.threading_repeat());
            if self.returned.contains_key(&key) {
                continue;
            }
            self.returned.insert(key, (laps, number));
            own.into_iter().for_each(|bar| *bars.entry(bar).or_default() += 1);
            let draft = Candidate::draft(&proportioned(&fabric, hypothesis.proportion, 1.0));
            fits.extend(fit_in(views, &[draft], &hypothesis.frames));
            if fits.len() >= most {
                break;
            }
        }
        super::fit::sort(&mut fits);
        fits
    }
}

/// Numbers of courses after which all photos repeat, and the frames in which they do so best.
fn hypotheses(views: &mut [FaceView]) -> Vec<CourseHypothesis> {
    let counts = 1..=MOST_COURSES;
    views.iter_mut().for_each(FaceView::fold_few_courses_roughly);
    let views = &*views;
    let shares = |view: &FaceView, count: usize| -> Vec<(f64, usize)> {
        let mut shares: Vec<_> =
            (0..view.frames.len()).map(|frame| (view.common([1, count], frame), frame)).collect();
        shares.sort_by(|a, b| b.0.total_cmp(&a.0));
        shares
    };
    let best: Vec<f64> = views
        .iter()
        .map(|view| {
            let best = counts.clone().filter_map(|count| shares(view, count).first().copied());
            best.map(|(share, _)| share).fold(0.0, f64::max)
        })
        .collect();
    let mut found: Vec<CourseHypothesis> = Vec::new();
    // Laps of one course are those of two as well.
    for courses in 2..=MOST_COURSES {
        let good = |at: usize| -> Vec<usize> {
            let shares = shares(&views[at], courses).into_iter();
            shares.filter(|(share, _)| *share >= AS_GOOD * best[at]).map(|(_, at)| at).collect()
        };
        let proportion = |at: usize, frame: usize| {
            let frame = views[at].frames[frame];
            frame.course() / frame.wale()
        };
        let mut own: Vec<f64> = Vec::new();
        for frame in good(0) {
            let wanted = proportion(0, frame);
            let is_like = |other: f64| (other / wanted - 1.0).abs() < SAME_PROPORTION;
            if own.iter().any(|other| is_like(*other)) {
                continue;
            }
            own.push(wanted);
            let frames: Vec<Vec<usize>> = (0..views.len())
                .map(|at| {
                    let good = good(at).into_iter();
                    good.filter(|frame| is_like(proportion(at, *frame))).take(FRAMES).collect()
                })
                .collect();
            if frames.iter().all(|frames| !frames.is_empty()) {
                found.push(CourseHypothesis { courses, proportion: wanted, frames });
            }
        }
    }
    found
}

/// The search over lappings of a number of courses.
struct Compared<'a> {
    views: &'a [FaceView],
    hypothesis: &'a CourseHypothesis,
    stitches: &'a mut Stitches,
    /// Lappings that were compared, roughly at least.
    seen: BTreeSet<Laps>,
}

/// Lappings with what they explain, the best first.
type Found = Vec<(f64, Laps)>;

impl Compared<'_> {
    /// A first look: whether the number of courses may be right.
    fn first(&mut self) -> Found {
        let chains = chains(self.hypothesis.courses);
        if self.hypothesis.courses == 2 {
            return self.compared(pairs(&chains).collect());
        }
        let starts = self.starts(&chains, FIRST_STARTS);
        self.climb(starts, FIRST_ROUNDS)
    }

    /// All that is looked at if it may be right.
    fn more(&mut self, first: Found) -> Found {
        let chains = chains(self.hypothesis.courses);
        match self.hypothesis.courses {
            2 => first,
            3 => {
                let all = self.compared(pairs(&chains).collect());
                merged(first, all)
            }
            _ => {
                let starts = self.starts(&chains, STARTS);
                let found = self.climb(starts, FIRST_ROUNDS);
                let best = merged(first, found);
                let climbs = best.iter().take(BEAM).map(|(_, laps)| laps.clone()).collect();
                let found = self.climb(climbs, ROUNDS);
                merged(best, found)
            }
        }
    }

    /// Front bars of all kinds, the back bar a pillar.
    fn starts(&self, chains: &[Vec<Lap>], count: usize) -> Vec<Laps> {
        let courses = self.hypothesis.courses;
        let swing: Vec<Lap> = (0..courses).map(|course| (0, course % 2 == 0)).collect();
        let starts = chains.iter().step_by(chains.len() / count).take(count);
        starts.map(|front| vec![front.clone(), swing.clone()]).collect()
    }

    /// Changes each of some lappings for the better, in turn the laps of both bars in one course and
    /// two laps of one bar.
    fn climb(&mut self, starts: Vec<Laps>, rounds: usize) -> Found {
        let courses = self.hypothesis.courses;
        let mut climbs: Found = starts.into_iter().map(|laps| (0.0, laps)).collect();
        let mut best: Found = Vec::new();
        for round in 0..rounds {
            let mut has_improved = false;
            for climb in &mut climbs {
                let changed = if round % 2 == 0 {
                    (0..courses).flat_map(|course| joint_changes(&climb.1, course)).collect()
                } else {
                    [0, 1].iter().flat_map(|bar| changes(&climb.1, *bar)).collect()
                };
                let mut found = self.compared(changed);
                found.truncate(KEPT);
                if let Some(next) = found.first().filter(|next| next.0 > climb.0) {
                    *climb = next.clone();
                    has_improved = true;
                }
                best = merged(best, found);
                best.truncate(KEPT);
            }
            if !has_improved && round > 0 {
                break;
            }
        }
        best
    }

    /// What the likeliest of some lappings explain of the photos, those left out that were compared before.
    fn compared(&mut self, all: Vec<Laps>) -> Found {
        let fresh: Vec<Laps> =
            all.into_iter().filter(|laps| self.seen.insert(canonical(laps))).collect();
        self.stitches.prepare(&fresh);
        let most = (fresh.len() / FINE_SHARE).max(LEAST_FINE);
        if fresh.len() <= most {
            return self.in_detail(Detail::Fine, fresh);
        }
        let mut rough = self.in_detail(Detail::Rough, fresh);
        rough.truncate(most);
        let likely = rough.into_iter().map(|(_, laps)| laps).collect();
        self.in_detail(Detail::Fine, likely)
    }

    /// What lappings explain of the photos, drawn in some detail, the best first.
    fn in_detail(&self, detail: Detail, all: Vec<Laps>) -> Found {
        let mut found: Found =
            all.into_par_iter().map(|laps| (self.explained(detail, &laps), laps)).collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
        found
    }

    /// The share of the photos' variance that a lapping explains, the mean of the photos.
    fn explained(&self, detail: Detail, laps: &Laps) -> f64 {
        let raster = Raster { repeat: [1, self.hypothesis.courses], detail };
        let blur = match detail {
            Detail::Fine => BLUR,
            Detail::Rough => BLUR / 2.0,
        };
        let each = self.views.iter().zip(&self.hypothesis.frames).map(|(view, frames)| {
            let lights = self.stitches.lights(laps, view.face, view.ground, detail);
            let template = view.template_of(raster, &lights, blur);
            let best = template.and_then(|template| {
                view.scores(&template, raster, frames.iter().copied()).first().copied()
            });
            best.map_or(0.0, |best| best.explained)
        });
        each.sum::<f64>() / double(self.views.len())
    }
}

/// All lappings of two bars.
fn pairs(chains: &[Vec<Lap>]) -> impl Iterator<Item = Laps> {
    chains
        .iter()
        .flat_map(move |front| chains.iter().map(move |back| vec![front.clone(), back.clone()]))
}

/// Two lists of lappings, the best first.
fn merged(mut one: Found, other: Found) -> Found {
    one.extend(other);
    one.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
    one
}

/// The least of the forms of a lapping that begin at another course or needle.
fn canonical(laps: &Laps) -> Laps {
    let courses = laps[0].len();
    let begun = (0..courses).map(|first| -> Laps {
        laps.iter()
            .map(|bar| {
                let low = bar.iter().map(|(needle, _)| *needle).min().unwrap_or(0);
                let turned = bar[first..].iter().chain(&bar[..first]);
                turned.map(|(needle, up)| (needle - low, *up)).collect()
            })
            .collect()
    });
    begun.min().unwrap_or_default()
}

/// All chains of so many courses, from needle 0 on.
fn chains(courses: usize) -> Vec<Vec<Lap>> {
    let mut all: Vec<Vec<Lap>> = vec![Vec::new()];
    for _ in 0..courses {
        all = all
            .into_iter()
            .flat_map(|chain| laps(0, NEEDLES - 1).map(move |lap| [&chain[..], &[lap]].concat()))
            .collect();
    }
    all.retain(|chain| chain.iter().any(|(needle, _)| *needle == 0));
    all
}

/// Laps on some needles, to both sides.
fn laps(low: i32, high: i32) -> impl Iterator<Item = Lap> {
    (low..=high).flat_map(|needle| [false, true].map(|up| (needle, up)))
}

/// All lappings that differ in at most two laps of a bar.
fn changes(own: &Laps, bar: usize) -> Vec<Laps> {
    let mut all = Vec::new();
    let courses = own[bar].len();
    for first in 0..courses {
        for second in 0..first {
            let others = own[bar].iter().enumerate();
            let others = others.filter(|(at, _)| *at != first && *at != second);
            let (low, high) = others.fold((i32::MAX, i32::MIN), |(low, high), (_, (needle, _))| {
                (low.min(*needle), high.max(*needle))
            });
            for one in laps(high - NEEDLES + 1, low + NEEDLES - 1) {
                for other in laps(high - NEEDLES + 1, low + NEEDLES - 1) {
                    if (one.0 - other.0).abs() < NEEDLES {
                        let mut changed = own.clone();
                        changed[bar][first] = one;
                        changed[bar][second] = other;
                        all.push(changed);
                    }
                }
            }
        }
    }
    all
}

/// All lappings that differ in the laps of both bars in a course.
fn joint_changes(own: &Laps, course: usize) -> Vec<Laps> {
    let reach = |bar: &Vec<Lap>| {
        let others = bar.iter().enumerate().filter(|(at, _)| *at != course);
        let (low, high) = others.fold((i32::MAX, i32::MIN), |(low, high), (_, (needle, _))| {
            (low.min(*needle), high.max(*needle))
        });
        laps(high - NEEDLES + 1, low + NEEDLES - 1)
    };
    let mut all = Vec::new();
    for front in reach(&own[0]) {
        for back in reach(&own[1]) {
            let mut changed = own.clone();
            changed[0][course] = front;
            changed[1][course] = back;
            all.push(changed);
        }
    }
    all
}

/// A bar's laps in chain notation, from gap 0 on.
pub(super) fn text(bar: &[Lap]) -> String {
    let low = bar.iter().map(|(needle, _)| *needle).min().unwrap_or(0);
    let mut text = String::new();
    for (at, (needle, up)) in bar.iter().enumerate() {
        let gap = needle - low;
        let (from, to) = if *up { (gap, gap + 1) } else { (gap + 1, gap) };
        let separator = if at == 0 { "" } else { "/" };
        write!(text, "{separator}{from}-{to}").expect("a string takes all");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn laps_are_written_from_gap_0() {
        assert_eq!(text(&[(3, true), (1, false)]), "2-3/1-0");
    }

    #[test]
    fn chains_are_counted_once() {
        assert_eq!(chains(2).len(), (16 - 9) * 4);
        assert_eq!(chains(3).len(), (64 - 27) * 8);
        let all: BTreeSet<Laps> =
            chains(3).into_iter().map(|chain| canonical(&vec![chain])).collect();
        // The two that repeat after one course stand alone, all others in threes.
        assert_eq!(all.len(), (296 - 2) / 3 + 2);
    }

    #[test]
    fn changes_keep_within_reach() {
        let laps: Laps = vec![vec![(0, true), (3, false), (1, true)], vec![(0, true); 3]];
        let all = changes(&laps, 0);
        assert!(!all.is_empty());
        for changed in all {
            let needles = || changed[0].iter().map(|(needle, _)| *needle);
            assert!(needles().max().unwrap() - needles().min().unwrap() < NEEDLES);
            assert_eq!(changed[1], laps[1]);
        }
    }
}
