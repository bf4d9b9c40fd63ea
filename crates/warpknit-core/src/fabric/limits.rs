//! The largest fabrics that are taken, and the check of a fabric against these limits.
//!
//! They keep a mistyped chain from taking minutes or gigabytes. The work on a fabric grows with its
//! common repeat: the least common multiple of all chains' courses, by that of all threadings.

use super::Fabric;
use super::error::FabricFault;
use super::structure::{Structure, WeftKnit};

/// The longest common repeat of all bars, courses.
pub const MAX_REPEAT: usize = 10_000;
/// The longest common repeat of all threadings, guides.
pub const MAX_THREADING: usize = 1_000;
/// The most yarn systems. Machines have up to some 80 guide bars, most of them for a few patterning
/// threads.
pub const MAX_BARS: usize = 100;

/// The most needles of a warp knit's common repeat, over all of its courses and bars: the warnings
/// need a look at each.
pub const MAX_LAPS: usize = 10_000_000;
/// The most loops of a weft knit's common repeat: all are laid out, and take a kilobyte each.
pub const MAX_LOOPS: usize = 1_000_000;

/// The most points of a laid strand's path.
pub const MAX_PATH: usize = 1_000;

impl Fabric {
    /// Refuses more yarn systems and longer repeats than can be knitted.
    pub(super) fn check_repeats(&self) -> Result<(), FabricFault> {
        let (courses, wales) = (self.repeat(), self.threading_repeat());
        let systems = self.yarn_systems();
        if systems == 0 {
            return Err(match self.structure {
                Structure::Warp(_) => FabricFault::NoBars,
                Structure::Weft(_) => FabricFault::NoFeeders,
                Structure::Laid(_) => FabricFault::NoStrands,
            });
        }
        if systems > MAX_BARS {
            return Err(FabricFault::TooManyBars(systems));
        }
        if courses > MAX_REPEAT {
            return Err(FabricFault::RepeatTooLong(courses));
        }
        if wales > MAX_THREADING {
            return Err(FabricFault::ThreadingTooLong(wales));
        }
        let (bars, most) = match self.structure {
            Structure::Warp(_) | Structure::Laid(_) => (systems, MAX_LAPS),
            // A single feeder knits each course.
            Structure::Weft(_) => (1, MAX_LOOPS),
        };
        if wales * courses * bars > most {
            return Err(FabricFault::RepeatTooLarge { wales, courses, bars, most });
        }
        match &self.structure {
            Structure::Weft(knit) => check_feeders(knit, courses),
            Structure::Warp(_) | Structure::Laid(_) => Ok(()),
        }
    }
}

/// Refuses courses that no feeder knits, or several do.
fn check_feeders(knit: &WeftKnit, courses: usize) -> Result<(), FabricFault> {
    for (course, number) in (0_i64..).zip(1..=courses) {
        let count = knit.feeders_of(course);
        if count != 1 {
            return Err(FabricFault::Feeders { course: number, count });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fabric::FabricError;

    fn threading(marks: usize) -> String {
        format!("threading = \"{}\"", "I".repeat(marks))
    }

    #[test]
    fn too_much_of_anything_is_refused() {
        let good = Fabric::named("tricot").unwrap().to_string();
        let long = good.replacen("threading = \"I\"", &threading(997), 1).replacen(
            "threading = \"I\"",
            &threading(1009),
            1,
        );
        assert!(matches!(
            Fabric::parse(&long),
            Err(FabricError { fault: FabricFault::ThreadingTooLong(_), .. })
        ));
        let bars = good[good.find("[[bars]]").unwrap()..].repeat(60);
        assert!(matches!(
            Fabric::parse(&(good + "\n" + &bars)),
            Err(FabricError { fault: FabricFault::TooManyBars(122), .. })
        ));
    }

    #[test]
    fn a_repeat_that_takes_minutes_or_gigabytes_is_refused() {
        let good = Fabric::named("tricot").unwrap().to_string();
        let bars = good[good.find("[[bars]]").unwrap()..].repeat(10);
        let warp = good.replacen("1-2/1-0//", &"1-2/1-0/".repeat(3_000), 1).replacen(
            "threading = \"I\"",
            &threading(900),
            1,
        );
        let warp = warp + "\n" + &bars;
        assert!(matches!(
            Fabric::parse(&warp),
            Err(FabricError { fault: FabricFault::RepeatTooLarge { bars: 22, .. }, .. })
        ));
        let feeder = &good[good.find("[bars.yarn]").unwrap()..good.rfind("[[bars]]").unwrap()]
            .replace("bars", "feeders");
        let head = format!(
            "name = \"w\"\nkind = \"weft\"\nwales_per_cm = 7.0\ncourses_per_cm = 8.0\n\
             chart = \"{}\"\n",
            "k".repeat(500)
        );
        let weft = |courses: usize| {
            format!("{head}[[feeders]]\ncourses = \"{}\"\n{feeder}", "I".repeat(courses))
        };
        assert!(Fabric::parse(&weft(2_000)).is_ok());
        let refused = Fabric::parse(&weft(2_001));
        assert!(
            matches!(
                refused,
                Err(FabricError { fault: FabricFault::RepeatTooLarge { bars: 1, .. }, .. })
            ),
            "{refused:?}"
        );
    }
}
