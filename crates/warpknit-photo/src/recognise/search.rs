//! Lappings that no catalogue holds: a beam search over the laps of two full bars.
//!
//! In: photos, and the fits of a catalogue to start from. Out: the best lappings as fits
//! of drafts.
//!
//! Method: the number of courses is the smallest after which the photo repeats about as well as
//! after any. From the best cloths known, one lap of one bar is changed at a time, to each needle in
//! reach and to either direction; the best few are changed again, until nothing improves. Cost: a
//! few milliseconds a lapping, some hundred lappings.
//!
//! Not promised: bars that are not fully threaded, inlays, three bars, more than
//! [`MOST_COURSES`] courses.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use rayon::prelude::*;

use super::candidate::{Candidate, full_bars, proportioned};
use super::fit::{Fit, fit_in, sort};
use super::same::ClothKey;
use super::view::FaceView;

/// The most courses of a lapping.
pub(super) const MOST_COURSES: usize = 4;
/// Needles that a bar's laps may reach over.
const NEEDLES: i32 = 4;
/// Lappings that are changed further at a time.
const BEAM: usize = 4;
/// Rounds of changes, at most.
const ROUNDS: usize = 6;
/// Frames of each photo that are tried.
const FRAMES: usize = 10;
/// A number of courses is taken if its fold is worth this share of the best one's.
const AS_GOOD: f64 = 0.95;

/// A lap: its needle, and whether it goes to higher gaps.
type Lap = (i32, bool);
/// Both bars' laps, front first.
type Laps = [Vec<Lap>; 2];

/// The best lappings of two full bars, the best first.
pub(super) fn search(views: &mut [FaceView], known: &[Fit]) -> Vec<Fit> {
    let (courses, frames) = courses_and_frames(views);
    let Some(frame) = frames[0].first().map(|frame| views[0].frames[*frame]) else {
        return Vec::new();
    };
    let proportion = frame.course() / frame.wale();
    let mut beam: Vec<Laps> = starts(known, courses);
    let (mut seen, mut all): (BTreeSet<ClothKey>, Vec<Fit>) = (BTreeSet::new(), Vec::new());
    for round in 0..ROUNDS {
        let next: Vec<Laps> =
            if round == 0 { beam.clone() } else { beam.iter().flat_map(changes).collect() };
        let drafts: Vec<Candidate> = next
            .par_iter()
            .filter_map(|laps| {
                let fabric = full_bars(&laps.each_ref().map(|bar| text(bar))).ok()?;
                Some(Candidate::draft(proportioned(&fabric, proportion, 1.0)))
            })
            .collect();
        // Mirror images are lappings of their own here: starts and changes hold both.
        let fresh: Vec<Candidate> = drafts
            .into_iter()
            .filter(|draft| draft.handed().is_some_and(|key| seen.insert(key)))
            .collect();
        let before = all.first().map_or(0.0, |fit: &Fit| fit.explained);
        all.extend(fit_in(views, &fresh, &frames));
        sort(&mut all);
        all.truncate(4 * BEAM);
        beam = all.iter().take(BEAM).filter_map(|fit| laps_of(fit, courses)).collect();
        if round > 0 && all.first().is_none_or(|fit| fit.explained <= before) {
            break;
        }
    }
    all
}

/// The fewest courses after which the photos repeat about as well as after any number of them, and
/// the frames of each photo in which they do so best.
fn courses_and_frames(views: &mut [FaceView]) -> (usize, Vec<Vec<usize>>) {
    let counts = 1..=MOST_COURSES;
    for view in views.iter_mut() {
        counts.clone().for_each(|count| view.fold([1, count]));
    }
    let views = &*views;
    let shares = |view: &FaceView, count: usize| -> Vec<(f64, usize)> {
        let mut shares: Vec<_> =
            (0..view.frames.len()).map(|frame| (view.common([1, count], frame), frame)).collect();
        shares.sort_by(|a, b| b.0.total_cmp(&a.0));
        shares
    };
    let worth = |count: usize| -> f64 {
        views.iter().map(|view| shares(view, count).first().map_or(0.0, |best| best.0)).sum()
    };
    let worths: Vec<f64> = counts.clone().map(worth).collect();
    let best = worths.iter().copied().fold(0.0, f64::max);
    let fewest = counts.zip(&worths).find(|(_, worth)| **worth >= AS_GOOD * best);
    // Laps of one course are those of two as well.
    let courses = fewest.map_or(2, |(count, _)| count.max(2));
    let frames = views.iter().map(|view| {
        shares(view, courses).into_iter().take(FRAMES).map(|(_, frame)| frame).collect()
    });
    (courses, frames.collect())
}

/// The lappings from which the search starts: known cloths, and each sense of the commonest laps.
fn starts(known: &[Fit], courses: usize) -> Vec<Laps> {
    let mut starts: Vec<Laps> =
        known.iter().filter_map(|fit| laps_of(fit, courses)).take(2 * BEAM).collect();
    let swing = |width: i32, first: bool| -> Vec<Lap> {
        (0..courses)
            .map(|course| {
                let up = (course % 2 == 0) == first;
                (if up { width } else { 0 }, up)
            })
            .collect()
    };
    for width in 0..NEEDLES {
        for sense in [false, true] {
            starts.push([swing(width, true), swing(1, sense)]);
        }
    }
    let mirrored: Vec<Laps> =
        starts.iter().map(|bars| bars.each_ref().map(|bar| mirror(bar))).collect();
    starts.extend(mirrored);
    starts
}

/// The mirror image of a bar's laps.
fn mirror(bar: &[Lap]) -> Vec<Lap> {
    bar.iter().map(|(needle, up)| (-needle, !up)).collect()
}

/// The laps of a fit of two full bars over so many courses, mirrored as it is.
fn laps_of(fit: &Fit, courses: usize) -> Option<Laps> {
    let knit = fit.candidate.fabric.warp_knit()?;
    let [front, back] = &knit.bars[..] else { return None };
    let laps = [front, back].map(|bar| -> Option<Vec<Lap>> {
        let chain = bar.chain().filter(|chain| courses.is_multiple_of(chain.laps().len()))?;
        if bar.threading.repeat() != 1 {
            return None;
        }
        let own: Vec<Lap> = chain
            .laps()
            .iter()
            .cycle()
            .take(courses)
            .filter(|lap| (lap.to - lap.from).abs() == 1)
            .map(|lap| (lap.needle(), lap.to > lap.from))
            .collect();
        (own.len() == courses).then(|| if fit.is_mirrored { mirror(&own) } else { own })
    });
    let [Some(front), Some(back)] = laps else { return None };
    Some([front, back])
}

/// All lappings that differ in one lap.
fn changes(laps: &Laps) -> Vec<Laps> {
    let mut all = Vec::new();
    for (bar, own) in laps.iter().enumerate() {
        let (low, high) = own.iter().fold((i32::MAX, i32::MIN), |(low, high), (needle, _)| {
            (low.min(*needle), high.max(*needle))
        });
        for course in 0..own.len() {
            for needle in high - NEEDLES + 1..low + NEEDLES {
                for up in [false, true] {
                    let mut changed = laps.clone();
                    changed[bar][course] = (needle, up);
                    all.push(changed);
                }
            }
        }
    }
    all
}

/// A bar's laps in chain notation, from gap 0 on.
fn text(bar: &[Lap]) -> String {
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
        assert_eq!(text(&mirror(&[(3, true), (1, false)])), "1-0/2-3");
    }

    #[test]
    fn changes_keep_within_reach() {
        let laps = [vec![(0, true), (3, false)], vec![(0, true), (0, false)]];
        let all = changes(&laps);
        assert_eq!(all.len(), 2 * 2 * 4 + 2 * 2 * 7);
        for [front, _] in all {
            assert!(front.iter().all(|(needle, _)| (0..4).contains(needle)));
        }
    }
}
