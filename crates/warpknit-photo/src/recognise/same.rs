//! Which fabrics are the same cloth.
//!
//! In: a warp knit. Out: a [`ClothKey`], equal for two fabrics whose photos nobody can tell apart by
//! their structure. These are the same cloth:
//!
//! - chains of all bars that begin at another course, or that are written several times over;
//! - a bar whose gaps are all moved by as many guides as its threading repeats after;
//! - the mirror image, left for right: a photo may be mirrored, and drives may stand on either side.
//!
//! Bars that are exchanged are another cloth: the front bar's underlaps lie outermost on the back.
//! Cost: courses times guides of the repeat, squared. Not promised: yarns play no role, so a cloth
//! of finer yarn, of other colours or with drafted yarns is the same.

use warpknit_core::fabric::{Bar, Lay, WarpKnit};
use warpknit_core::ids::index32;

/// Equal for fabrics that are the same cloth.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ClothKey(Vec<i64>);

/// Repeats above this many laps are not turned around.
const MOST_LAPS: usize = 4096;

impl ClothKey {
    /// The key of a warp knit.
    #[must_use]
    pub fn new(knit: &WarpKnit, courses: usize, guides: usize) -> Self {
        Self::over([false, true].into_iter(), knit, courses, guides)
    }

    /// The key that a mirror image has only if it is the same cloth without a mirror too.
    pub(super) fn handed(knit: &WarpKnit, courses: usize, guides: usize, mirrored: bool) -> Self {
        Self::over(std::iter::once(mirrored), knit, courses, guides)
    }

    fn over(
        mirrors: impl Iterator<Item = bool>,
        knit: &WarpKnit,
        courses: usize,
        guides: usize,
    ) -> Self {
        let courses = period(knit, courses);
        let small = courses * guides <= MOST_LAPS;
        let [phases, places] = if small { [courses, guides] } else { [1, 1] };
        let [courses, guides] = [courses, guides].map(|count| i64::from(index32(count)));
        let keys = mirrors.flat_map(|mirrored| {
            (0_i64..).take(phases).flat_map(move |phase| {
                (0_i64..).take(places).map(move |place| {
                    let bars = knit.bars.iter();
                    bars.flat_map(|bar| turned(bar, [courses, guides], mirrored, phase, place))
                        .collect()
                })
            })
        });
        Self(keys.min().unwrap_or_default())
    }
}

/// Courses after which all bars repeat. Chains may be written several times over.
fn period(knit: &WarpKnit, courses: usize) -> usize {
    let mut divisors = (1..courses).filter(|period| courses.is_multiple_of(*period));
    let repeats = |period: &usize| {
        let [courses, period] = [courses, *period].map(|count| i64::from(index32(count)));
        knit.bars.iter().all(|bar| {
            (0..courses).all(|course| course_of(bar, course) == course_of(bar, course + period))
        })
    };
    divisors.find(repeats).unwrap_or(courses)
}

/// What a bar does in a course: the gaps of its lap, or whether a yarn is there.
fn course_of(bar: &Bar, course: i64) -> [i64; 2] {
    match &bar.lay {
        Lay::Lapping(chain) => {
            let lap = chain.lap(course);
            [lap.from, lap.to].map(i64::from)
        }
        Lay::Weft => [-1, i64::from(bar.threading.carries(course))],
    }
}

/// A bar over the whole repeat as numbers, from a phase and a place on.
fn turned(
    bar: &Bar,
    [courses, guides]: [i64; 2],
    mirrored: bool,
    phase: i64,
    place: i64,
) -> Vec<i64> {
    let Lay::Lapping(chain) = &bar.lay else {
        let marks = (0..courses).map(|course| i64::from(bar.threading.carries(course + phase)));
        return std::iter::once(-1).chain(marks).collect();
    };
    let sign = if mirrored { -1 } else { 1 };
    let laps: Vec<[i64; 2]> = (0..courses)
        .map(|course| {
            let lap = chain.lap(course + phase);
            [lap.from, lap.to].map(|gap| sign * i64::from(gap))
        })
        .collect();
    let low = laps.iter().flatten().copied().min().unwrap_or(0);
    let laps = laps.iter().flatten().map(|gap| gap - low);
    // Guides move as far as their gaps do.
    let marks =
        (0..guides).map(|guide| i64::from(bar.threading.carries(sign * (guide - low - place))));
    laps.chain(marks).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use warpknit_core::fabric::Fabric;

    fn key(chains: &[&str], threadings: &[&str]) -> ClothKey {
        let owned =
            |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>();
        let fabric = Fabric::named("tricot")
            .unwrap()
            .with_chains(&owned(chains), &owned(threadings))
            .unwrap();
        ClothKey::new(fabric.warp_knit().unwrap(), fabric.repeat(), fabric.threading_repeat())
    }

    #[test]
    fn phases_places_and_mirror_images_are_the_same_cloth() {
        let locknit = key(&["2-3/1-0", "1-0/1-2"], &[]);
        for same in [
            ["1-0/2-3", "1-2/1-0"],
            ["3-4/2-1", "1-0/1-2"],
            ["1-0/2-3", "2-1/1-0"].map(|chain| if chain == "2-1/1-0" { "1-2/1-0" } else { chain }),
            ["1-0/2-3/1-0/2-3", "1-2/1-0"],
            // Mirrored: gap g is gap 3 - g, and 2 - g.
            ["1-0/2-3", "1-2/1-0"],
        ] {
            assert_eq!(key(&same, &[]), locknit, "{same:?}");
        }
        for other in [["1-0/1-2", "2-3/1-0"], ["2-3/1-0", "1-2/1-0"], ["3-4/1-0", "1-0/1-2"]] {
            assert_ne!(key(&other, &[]), locknit, "{other:?}");
        }
    }

    #[test]
    fn half_set_bars_keep_their_place_to_each_other() {
        let net = key(&["1-0/1-2/2-3/2-1", "2-3/2-1/1-0/1-2"], &["I.", ".I"]);
        assert_eq!(key(&["1-0/1-2/2-3/2-1", "2-3/2-1/1-0/1-2"], &[".I", "I."]), net);
        assert_ne!(key(&["1-0/1-2/2-3/2-1", "2-3/2-1/1-0/1-2"], &["I.", "I."]), net);
    }
}
