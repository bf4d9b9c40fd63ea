//! Warnings about fabrics that can be knitted but hardly mean what they say, and the number of
//! threads on each needle.
//!
//! In: a [`Fabric`]. Out: [`Fabric::warnings`], a line each, and [`Fabric::needles`]. Everything
//! follows from the chains and threadings over one common repeat, and no yarn is laid out. Cost:
//! needles of the repeat times bars. Not promised: an inlay that moves counts as held, whatever
//! needles it passes; and yarns that share their place in only some courses are no fault.

use super::structure::least_common_multiple;
use super::{Bar, Fabric, Lay, Structure, WarpKnit};
use crate::counted::counted;

/// How many threads the needles of a repeat get.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Needles {
    /// Fewest threads that a needle gets in a course.
    pub fewest: usize,
    /// Most threads that a needle gets in a course.
    pub most: usize,
    /// How often a needle gets none and so drops its stitch.
    pub dropped: usize,
    /// The first of these: wale and course, both counted from 1 (wale 1 lies between gaps 0 and 1).
    pub first_dropped: Option<(usize, usize)>,
}

impl Fabric {
    /// The threads that each needle of the repeat gets in each of its courses.
    ///
    /// ```
    /// let needles = warpknit_core::fabric::Fabric::named("locknit").unwrap().needles();
    /// assert_eq!((needles.fewest, needles.most, needles.dropped), (2, 2, 0));
    /// ```
    #[must_use]
    pub fn needles(&self) -> Needles {
        let mut needles = Needles { fewest: usize::MAX, most: 0, dropped: 0, first_dropped: None };
        for (course, number) in (0_i64..).zip(1..=self.repeat()) {
            for (wale, wale_number) in (0_i64..).zip(1..=self.threading_repeat()) {
                let threads = self.structure.threads_on(wale, course);
                needles.fewest = needles.fewest.min(threads);
                needles.most = needles.most.max(threads);
                if threads == 0 {
                    needles.dropped += 1;
                    needles.first_dropped.get_or_insert((wale_number, number));
                }
            }
        }
        needles
    }

    /// Warnings about a fabric that can be knitted, a line each. Weft knits and laid cloth have
    /// none.
    ///
    /// ```
    /// use warpknit_core::fabric::Fabric;
    /// let half_set = Fabric::named("tricot")?.with_chains(&["1-0/1-2".into()], &["I.".into()])?;
    /// assert!(half_set.warnings()[0].contains("the stitch drops"));
    /// # Ok::<(), warpknit_core::fabric::FabricError>(())
    /// ```
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        match &self.structure {
            Structure::Warp(knit) => self.warnings_of_warp_knit(knit),
            Structure::Weft(_) | Structure::Laid(_) => Vec::new(),
        }
    }

    fn warnings_of_warp_knit(&self, knit: &WarpKnit) -> Vec<String> {
        let mut warnings = Vec::new();
        for (bar, number) in knit.bars.iter().zip(1..) {
            if bar.lacks_gap_0() {
                warnings.push(format!("bar {number}: the chain {} has no gap 0", bar.lapping()));
            }
        }
        for (bar, number) in knit.bars.iter().zip(1..) {
            if bar.looks_like_raschel() {
                warnings.push(format!(
                    "bar {number}: all gaps of {} are even and its overlaps pass two needles each; \
                     if this is a raschel chart, a fabric file with numbering = \"raschel\" \
                     halves them",
                    bar.lapping()
                ));
            }
        }
        if knit.bars.iter().all(Bar::is_inlay) {
            warnings.push(
                "no bar knits: without an overlap, such as 1-0, there is no loop that holds a yarn"
                    .to_owned(),
            );
            // Without loops every other warning would follow from this one.
            return warnings;
        }
        warnings.extend(self.dropped_stitches());
        warnings.extend(knit.loose_inlays());
        warnings.extend(knit.twin_bars());
        warnings
    }

    fn dropped_stitches(&self) -> Option<String> {
        let Needles { dropped, first_dropped, .. } = self.needles();
        let (wale, course) = first_dropped?;
        let others = match dropped - 1 {
            0 => "no other in the repeat".to_owned(),
            others => format!("and {others} more"),
        };
        let (wales, courses) = (self.threading_repeat(), self.repeat());
        let repeat =
            format!("{} by {}", counted(wales as u64, "wale"), counted(courses as u64, "course"));
        Some(format!(
            "no bar laps the needle of wale {wale} in course {course}: the stitch drops ({others}; \
             the repeat is {repeat})"
        ))
    }
}

impl WarpKnit {
    /// Inlays that no loop can hold, because nothing that knits lies in front of them or crosses
    /// their gap.
    fn loose_inlays(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        for (at, bar) in self.bars.iter().enumerate().filter(|(_, bar)| bar.is_inlay()) {
            let number = at + 1;
            let mut in_front = self.bars[..at].iter().filter(|bar| !bar.is_inlay()).peekable();
            // An inlay is held between the loops and the underlaps of a bar in front of it.
            if in_front.peek().is_none() {
                warnings.push(format!(
                    "bar {number} lays in yarns in front of all knitting bars: no underlap holds \
                     them"
                ));
            } else if bar.stays_in_its_gap() && !in_front.any(Bar::ever_shogs) {
                warnings.push(format!(
                    "bar {number} lays yarns straight between the wales, and no bar in front of it \
                     laps from wale to wale: nothing holds them"
                ));
            }
        }
        warnings
    }

    /// Bars with a yarn in exactly the same place as one of a bar in front of them, each with the
    /// first such bar.
    fn twin_bars(&self) -> Vec<String> {
        (1..self.bars.len()).filter_map(|behind| self.twin_of(behind)).collect()
    }

    /// The warning about the first bar in front of this one that has a yarn in its place.
    fn twin_of(&self, behind: usize) -> Option<String> {
        let rear = &self.bars[behind];
        let (at, (guide, other)) = self.bars[..behind]
            .iter()
            .enumerate()
            .find_map(|(at, front)| Some((at, front.shares_place_with(rear)?)))?;
        let how = if rear.is_inlay() {
            "lie in the same gaps"
        } else {
            "make the same laps on the same needles"
        };
        Some(format!(
            "bars {} and {} collide: from course 1 on, the yarns of guide {} of the one and guide \
             {} of the other {how}, so they run as one",
            at + 1,
            behind + 1,
            guide + 1,
            other + 1
        ))
    }
}

impl Bar {
    /// Whether it has guides, and none of their laps touches gap 0, from which charts count.
    fn lacks_gap_0(&self) -> bool {
        match &self.lay {
            Lay::Lapping(chain) => !chain.laps().iter().any(|lap| lap.from == 0 || lap.to == 0),
            Lay::Weft => false,
        }
    }

    /// Whether its guides never leave their gaps. Wefts have no guides, and cross all wales.
    fn stays_in_its_gap(&self) -> bool {
        let (low, high) = self.gaps();
        self.chain().is_some() && low == high
    }

    /// Whether it may have been taken from a raschel chart, whose gaps are numbered 0, 2, 4.
    fn looks_like_raschel(&self) -> bool {
        let Some(chain) = self.chain() else { return false };
        // A raschel chart's 2-0 is a tricot chart's 1-0. Read as the latter, its overlaps pass two
        // needles each, which hardly any cloth has in every course.
        let laps = chain.laps();
        laps.iter().all(|lap| lap.from % 2 == 0 && lap.to % 2 == 0)
            && laps.iter().any(|lap| lap.overlap() != 0)
    }

    /// Whether its loops follow each other on different needles, so that underlaps cross the gaps
    /// between wales.
    fn ever_shogs(&self) -> bool {
        let Some(chain) = self.chain() else { return false };
        let mut needles =
            chain.laps().iter().filter(|lap| lap.overlap() != 0).map(|lap| lap.needle());
        let first = needles.next();
        needles.any(|needle| Some(needle) != first)
    }

    /// The first guides of this bar and of `other` (within a repeat of both threadings) whose yarns
    /// make the same movement in the same gaps in every course.
    fn shares_place_with(&self, other: &Self) -> Option<(i64, i64)> {
        // A weft crosses the yarns of guides, and the wefts of two bars lie in layers of their own.
        let (ours, theirs) = (self.chain()?.laps(), other.chain()?.laps());
        // Two guides run as one only if they are as far apart as their chains' first gaps, the
        // other way round.
        let shift = ours[0].from - theirs[0].from;
        let courses = least_common_multiple(ours.len(), theirs.len());
        let mut together = ours.iter().cycle().zip(theirs.iter().cycle()).take(courses);
        if !together.all(|(a, b)| a.from == b.from + shift && a.to == b.to + shift) {
            return None;
        }
        let guides = least_common_multiple(self.threading.repeat(), other.threading.repeat());
        let guides = i64::try_from(guides).expect("repeats are limited");
        let shift = i64::from(shift);
        (0..guides).map(|guide| (guide, guide + shift)).find(|&(guide, others)| {
            self.threading.carries(guide) && other.threading.carries(others)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A fabric of bars as (chain, threading).
    fn fabric(bars: &[(&str, &str)]) -> Fabric {
        let mut text = "name = \"t\"\nwales_per_cm = 14.6\ncourses_per_cm = 21.74\n".to_owned();
        for (chain, threading) in bars {
            text += &format!(
                "[[bars]]\nlapping = \"{chain}\"\nthreading = \"{threading}\"\nyarn = {{ count = \
                 \"44 dtex\", density = 1.38, packing = 0.65, color = \"#ffffff\" }}\n"
            );
        }
        Fabric::parse(&text).unwrap()
    }

    fn full(chains: &[&str]) -> Fabric {
        fabric(&chains.iter().map(|chain| (*chain, "I")).collect::<Vec<_>>())
    }

    #[test]
    fn sensible_fabrics_are_silent() {
        let atlas = "1-0/1-2/2-3/3-4/4-5/4-3/3-2/2-1";
        for chains in [
            &["1-0/0-1"][..],
            &["1-0/1-0"],
            &["1-2/1-0", "1-0/1-2"],
            &["2-3/1-0", "1-0/1-2"],
            &["1-2/1-0", "1-0/2-3"],
            &["1-2/1-0", "1-0/3-4"],
            &["1-0/0-1", "1-0/3-4"],
            &["2-3/1-0", "1-0/2-3"],
            &[atlas, "4-5/4-3/3-2/2-1/1-0/1-2/2-3/3-4"],
            &["1-0/0-1", "0-0/3-3"],
            &["1-0/0-1", "0-0/0-0/0-0/1-1/1-1/1-1", "0-0/2-2"],
            &["1-0/0-1", "0-0/0-0/0-0/2-2/2-2/2-2"],
            &["1-0/0-1/1-0/1-2/2-1/1-2", "0-0/1-1/0-0/2-2/1-1/2-2"],
            &["1-0/1-2", "0-0/3-3"],
            &["1-0/1-2", "0-0"],
            &["0-2/3-1"],
            &["1-0/1-2", "0-0", "weft"],
            &["1-0/0-1", "weft", "weft"],
        ] {
            assert_eq!(full(chains).warnings(), Vec::<String>::new(), "{chains:?}");
        }
        for bars in [
            &[("1-0/1-2/2-3/2-1", "I."), ("2-3/2-1/1-0/1-2", ".I")][..],
            &[("1-0/1-2/1-0/2-3/2-1/2-3", "I."), ("2-3/2-1/2-3/1-0/1-2/1-0", ".I")],
            &[
                ("2-1/2-3/2-1/1-2/1-0/1-2", "I."),
                ("1-2/1-0/1-2/2-1/2-3/2-1", ".I"),
                ("0-0/1-1", "I."),
                ("1-1/0-0", ".I"),
            ],
            // One lapping on two bars, for stripes of two yarns.
            &[("1-0/1-2", "I."), ("1-0/1-2", ".I")],
        ] {
            assert_eq!(fabric(bars).warnings(), Vec::<String>::new(), "{bars:?}");
        }
    }

    #[test]
    fn needles_without_a_loop_are_named_and_counted() {
        let half = fabric(&[("1-0/1-2", "..I")]);
        assert_eq!(
            half.needles(),
            Needles { fewest: 0, most: 1, dropped: 4, first_dropped: Some((1, 1)) }
        );
        let warnings = half.warnings();
        assert_eq!(
            warnings,
            ["no bar laps the needle of wale 1 in course 1: the stitch drops (and 3 more; the \
                 repeat is 3 wales by 2 courses)"]
        );
    }

    #[test]
    fn a_raschel_chart_is_pointed_out() {
        let chart = full(&["2-0/2-4"]).warnings();
        assert!(chart.len() == 1 && chart[0].contains("numbering = \"raschel\""), "{chart:?}");
    }

    #[test]
    fn a_chain_without_gap_0_and_a_cloth_without_loops() {
        assert_eq!(full(&["2-1/2-3"]).warnings(), ["bar 1: the chain 2-1/2-3// has no gap 0"]);
        let inlays = full(&["0-0/1-1", "0-0/2-2"]).warnings();
        assert!(inlays.len() == 1 && inlays[0].starts_with("no bar knits"), "{inlays:?}");
    }

    #[test]
    fn inlays_that_nothing_holds() {
        assert_eq!(
            full(&["0-0/3-3", "1-0/1-2"]).warnings(),
            ["bar 1 lays in yarns in front of all knitting bars: no underlap holds them"]
        );
        let between = full(&["1-0/0-1", "0-0"]).warnings();
        assert!(
            between.len() == 1
                && between[0].contains("bar 2 lays yarns straight between the wales"),
            "{between:?}"
        );
    }

    #[test]
    fn bars_in_one_place_collide() {
        let knitting = full(&["1-0/1-2", "1-0/1-2"]).warnings();
        assert_eq!(
            knitting,
            ["bars 1 and 2 collide: from course 1 on, the yarns of guide 1 of the one and guide \
              1 of the other make the same laps on the same needles, so they run as one"]
        );
        let inlays = full(&["1-0/0-1", "0-0/2-2", "0-0/2-2/0-0/2-2"]).warnings();
        assert!(
            inlays.len() == 1
                && inlays[0].starts_with("bars 2 and 3 collide")
                && inlays[0].contains("gaps"),
            "{inlays:?}"
        );
        // A guide further on with a chain a gap lower is the same place.
        let shifted = fabric(&[("1-0/0-1", "I"), ("1-1/3-3", "I."), ("0-0/2-2", ".I")]).warnings();
        assert!(
            shifted.iter().any(|warning| warning.starts_with("bars 2 and 3 collide")),
            "{shifted:?}"
        );
        let apart = fabric(&[("1-0/0-1", "I"), ("0-0/2-2", "I."), ("0-0/2-2", ".I")]).warnings();
        assert_eq!(apart, Vec::<String>::new());
        let turned = full(&["1-0/0-1", "0-0/2-2", "2-2/0-0"]).warnings();
        assert_eq!(turned, Vec::<String>::new());
    }
}
