//! Measures wall time and CPU time of some work over several runs: median, fastest and slowest.
//!
//! In: a closure. Out: [`Times`]. CPU time is that of all threads of the process; it is missing
//! where the system does not give it.

use std::convert::Infallible;
use std::hint::black_box;
use std::ops::{Add, AddAssign};
use std::time::Instant;

use anyhow::Result;
use warpknit::drape::evenness::Evenness;
use warpknit::drape::strands::Edge;
use warpknit::drape::{self, Block, Cloth, DrapeOptions, Stage, Totals};
use warpknit::map::Mapping;

use super::super::cpu_time::cpu_ms;

/// A point in time: wall clock, and CPU time of the process so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    wall: Instant,
    cpu: Option<f64>,
}

/// The time of one run, ms.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sample {
    pub(super) wall: f64,
    /// CPU time of all threads together, where the system gives it.
    pub(super) cpu: Option<f64>,
}

/// Median and range of several measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spread {
    pub(super) median: f64,
    pub(super) least: f64,
    pub(super) most: f64,
}

/// The times of some work over several runs, ms.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Times {
    /// Each run, in turn.
    pub(super) samples: Vec<Sample>,
    pub(super) wall: Spread,
    /// CPU time of all threads together, where the system gives it.
    pub(super) cpu: Option<Spread>,
}

impl Moment {
    pub(super) fn now() -> Self {
        Self { cpu: cpu_ms(), wall: Instant::now() }
    }

    pub(super) fn elapsed(self) -> Sample {
        Self::now().since(self)
    }

    fn since(self, start: Self) -> Sample {
        Sample {
            wall: 1e3 * (self.wall - start.wall).as_secs_f64(),
            cpu: self.cpu.zip(start.cpu).map(|(after, before)| after - before),
        }
    }
}

impl Sample {
    /// A share of it.
    fn times(self, share: f64) -> Self {
        Self { wall: self.wall * share, cpu: self.cpu.map(|cpu| cpu * share) }
    }

    /// The time for ratios, as of [`Times::for_ratio`].
    pub(super) fn for_ratio(self) -> f64 {
        self.cpu.unwrap_or(self.wall)
    }
}

impl Add for Sample {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        // A default sample, as of a stage that did not run, has no CPU time. It must not erase the
        // other's.
        let cpu = match (self.cpu, other.cpu) {
            (Some(own), Some(other)) => Some(own + other),
            (own, other) => own.or(other),
        };
        Self { wall: self.wall + other.wall, cpu }
    }
}

impl AddAssign for Sample {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Spread {
    /// The spread of at least one number.
    fn from_numbers(mut numbers: Vec<f64>) -> Self {
        // Of an even count the median is the mean of the two middle numbers.
        numbers.sort_by(f64::total_cmp);
        let last = numbers.len() - 1;
        Self {
            median: numbers[last / 2].midpoint(numbers[numbers.len() / 2]),
            least: numbers[0],
            most: numbers[last],
        }
    }
}

impl Times {
    /// The times of at least one sample.
    pub(super) fn from_samples(samples: &[Sample]) -> Self {
        let cpu: Vec<_> = samples.iter().filter_map(|sample| sample.cpu).collect();
        let wall = Spread::from_numbers(samples.iter().map(|sample| sample.wall).collect());
        let cpu = (cpu.len() == samples.len()).then(|| Spread::from_numbers(cpu));
        Self { samples: samples.to_vec(), wall, cpu }
    }

    /// The time for ratios: CPU time, which other programs on the machine hardly change, or else
    /// wall time.
    pub(super) fn for_ratio(&self) -> f64 {
        self.cpu.map_or(self.wall.median, |cpu| cpu.median)
    }
}

/// Distance from the median, in median distances, from which on a run is an outlier. It is that of
/// the program hyperfine: ten standard deviations, where runs are normally distributed.
const OUTLYING: f64 = 14.826 / 0.6745;
/// Runs of fewer samples have no outliers: their median distance says nothing.
const FEWEST: usize = 5;

/// Whether a time is an outlier among all times of the same work (Iglewicz and Hoaglin, How to
/// detect and handle outliers, 1993: the modified z-score).
pub(super) fn has_outliers(times: &[f64]) -> bool {
    if times.len() < FEWEST {
        return false;
    }
    let median = Spread::from_numbers(times.to_vec()).median;
    let distances: Vec<_> = times.iter().map(|time| (time - median).abs()).collect();
    // Clocks are coarse: runs that all but agree must not make a hundredth an outlier.
    let usual = Spread::from_numbers(distances.clone()).median.max(0.01 * median);
    distances.iter().any(|distance| *distance > OUTLYING * usual)
}

/// Does the work once to warm up, and then measures it so many times.
pub(super) fn measured(runs: u32, work: &mut dyn FnMut() -> Result<()>) -> Result<Times> {
    let [times] = measured_parts(runs, &mut || {
        let start = Moment::now();
        work()?;
        Ok([start.elapsed()])
    })?;
    Ok(times)
}

/// The same for work that measures its parts itself.
pub(super) fn measured_parts<const N: usize>(
    runs: u32,
    work: &mut dyn FnMut() -> Result<[Sample; N]>,
) -> Result<[Times; N]> {
    work()?;
    let runs = (0..runs).map(|_| work()).collect::<Result<Vec<_>>>()?;
    Ok(std::array::from_fn(|part| {
        Times::from_samples(&runs.iter().map(|run| run[part]).collect::<Vec<_>>())
    }))
}

/// Options of the tables that compare with the papers, which know no strains of the repeat. Those
/// have a table of their own.
pub(super) const FLAT_YARN: DrapeOptions = DrapeOptions {
    mapping: Mapping::Smooth,
    sweeps: None,
    edge: Edge::Clip,
    evenness: Evenness::Regular,
    surface: None,
};

/// Number of variants of [`Stage`].
const STAGES: usize = Stage::Deliver as usize + 1;

/// The time of each stage of the pipeline.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StageTimes([Sample; STAGES]);

impl StageTimes {
    /// The time of a stage, 0 if it did not run.
    pub(super) fn of_stage(&self, stage: Stage) -> Sample {
        self.0[stage as usize]
    }
}

/// Runs the pipeline on a cloth, discards its blocks, and measures each stage. A stage lasts until
/// the next one is announced; [`Stage::Lay`] is divided among its parts.
pub(super) fn time_stages(cloth: &Cloth<'_>, options: &DrapeOptions) -> (StageTimes, Totals) {
    let (mut staged, mut begun) = (StageTimes::default(), None);
    let mut announce = |stage: Stage, _| {
        let now = Moment::now();
        if let Some((last, start)) = begun.replace((stage, now)) {
            staged.0[last as usize] += now.since(start);
        }
    };
    let mut deliver = |blocks: &[Block]| -> Result<(), Infallible> {
        black_box(blocks);
        Ok(())
    };
    let Ok(totals) = drape::run(cloth, options, &mut announce, &mut deliver);
    if let Some((last, start)) = begun {
        staged.0[last as usize] += start.elapsed();
    }
    let laid = staged.of_stage(Stage::Lay);
    for (part, share) in totals.laying.shares() {
        staged.0[part as usize] += laid.times(share);
    }
    (staged, totals)
}

#[cfg(test)]
mod tests {
    use super::*;
    use warpknit::fabric::Fabric;

    #[test]
    fn the_median_lies_between_the_least_and_the_most() {
        let Spread { median, least, most } = Spread::from_numbers(vec![4.0, 1.0, 9.0, 2.0]);
        assert_eq!((median, least, most), (3.0, 1.0, 9.0));
        assert_eq!(Spread::from_numbers(vec![4.0, 1.0, 9.0]).median, 4.0);
    }

    #[test]
    fn a_run_far_from_the_others_is_an_outlier() {
        assert!(!has_outliers(&[10.0, 10.1, 9.9, 10.2, 10.4]));
        assert!(has_outliers(&[10.0, 10.1, 9.9, 10.2, 31.0]));
        assert!(!has_outliers(&[10.0, 10.0, 10.0, 10.0, 10.5]));
        assert!(!has_outliers(&[10.0, 10.0, 10.0, 99.0]));
    }

    #[test]
    fn samples_add_up_and_an_untaken_one_takes_nothing_away() {
        let sample = Sample { wall: 2.0, cpu: Some(3.0) };
        assert_eq!(sample + Sample::default(), sample);
        assert_eq!((sample + sample).cpu, Some(6.0));
    }

    #[test]
    fn the_warm_up_does_not_count() {
        let mut runs = 0;
        let times = measured(3, &mut || {
            runs += 1;
            Ok(())
        });
        let wall = times.unwrap().wall;
        assert!(runs == 4 && wall.least <= wall.median && wall.median <= wall.most);
    }

    #[test]
    fn stages_that_run_take_time_and_the_surface_that_nobody_wants_takes_none() {
        let fabric = Fabric::named("tricot").unwrap();
        let panel = drape::swatch_panel(&fabric, 8, 8);
        let (staged, totals) =
            time_stages(&Cloth::swatch(&panel, &fabric, 8, 8), &DrapeOptions::default());
        assert_eq!(totals.losses.stitches, 2 * 8 * 8);
        assert!(
            staged.of_stage(Stage::Knit).wall > 0.0
                && staged.of_stage(Stage::Surface) == Sample::default()
        );
    }
}
