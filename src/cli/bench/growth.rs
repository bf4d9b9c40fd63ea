//! Growth of time and memory with the number of stitches and of triangles, stage by stage.
//!
//! In: a garment. Out: two tables with their plots. Rows are measured in order of size: the
//! allocator may keep the memory of a row for the next one, which needs more anyway.

use anyhow::Result;
use warpknit::drape::{Cloth, DrapeOptions, Stage};
use warpknit::fabric::Fabric;
use warpknit::garment::Garment;
use warpknit::ids::index32;
use warpknit::yarn::tube::Section;

use super::super::args::{Bench, DEFAULT_FABRIC};
use super::garments::{Garments, Shipped, at_stitches, folded_cone};
use super::measure::{FLAT_YARN, Moment, Sample, StageTimes, Times, time_stages};
use super::plot::{Plot, Series};
use super::table::{Column, Table, TableCell, times};
use warpknit::system::{forget_peak_memory, peak_memory_mb, resident_memory_mb};

/// Numbers of stitches in the first table. The last one is a skirt at its true gauge, E28.
const STITCHES: [f64; 5] = [1e3, 1e4, 1e5, 1e6, 4.4e6];
/// Numbers of triangles in the second table.
const TRIANGLES: [usize; 4] = [2_000, 20_000, 200_000, 2_000_000];
/// Number of stitches in the second table.
const ON_TRIANGLES: f64 = 26_180.0;
/// Above so many stitches or triangles a row is measured once and without a warm-up run. It is long
/// enough for caches and clock to settle within it.
const ONCE: usize = 100_000;
/// St and Sr of the tubes that are made and discarded.
const SECTION: (u32, u32) = (10, 5);

const COLUMNS: [Column; 17] = [
    ("stitches", "stitches"),
    ("triangles", "triangles"),
    ("lay_out_ms", "lay out,\nms"),
    ("index_ms", "index,\nms"),
    ("knit_ms", "knit,\nms"),
    ("locate_ms", "locate,\nms"),
    ("map_ms", "map,\nms"),
    ("surface_ms", "surface,\nms"),
    ("ms", "all,\nms"),
    ("from", "from"),
    ("to", "to"),
    ("cpu_ms", "all,\ncpu ms"),
    ("samples_ms", ""),
    ("cpu_samples_ms", ""),
    ("runs", "runs"),
    ("peak_mb", "peak,\nMB"),
    ("resident_mb", "held after,\nMB"),
];
/// The stages that have a column after that of laying out.
const STAGES: [Stage; 5] = [Stage::Index, Stage::Knit, Stage::Locate, Stage::Map, Stage::Surface];
const NAMES: [&str; 6] = ["lay out", "index", "knit", "locate", "map", "surface"];

/// The figures of a row that are plotted.
struct GrowthRow {
    stitches: usize,
    stages: [f64; 6],
    peak: f64,
}

/// Measures both tables: over stitches on the skirt (or on the user's garment), and over triangles.
pub(super) fn growth(
    arguments: &Bench,
    garments: &Garments,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<Table>> {
    let (st, sr) = SECTION;
    let stages = format!(
        "lay out: the relaxed repeat and the plan of its yarns. index: what location searches in. \
         knit, locate, map: one after the other for each block of yarns; their common time is \
         shared out as each took of it. surface: tubes of St {st}, Sr {sr}, streamed."
    );
    let note = "A row of one run, beyond 100 000 stitches or triangles, has none before it that \
                warms up. Memory: the most that was held during the row, and what is held after \
                it; 0 where the system doesn't say.";
    let (name, garment) = garments.get(Shipped::Skirt)?;
    let fabric = Fabric::named(DEFAULT_FABRIC)?;

    let title = format!("Growth with the stitches: {DEFAULT_FABRIC} on {name}");
    let mut over_stitches = Table::new("growth-stitches", &title, &[&stages, note], COLUMNS);
    let mut plots = plots("stitches");
    for (at, wanted) in STITCHES.into_iter().enumerate() {
        // The first table takes about 60 % of the time.
        progress(0.6 * (at as f64 / STITCHES.len() as f64));
        let row = measure(
            arguments.runs,
            &mut over_stitches,
            &garment,
            &at_stitches(&fabric, &garment, wanted)?,
        )?;
        push(&mut plots, f64::from(index32(row.stitches)), &row);
    }
    over_stitches.plots.extend(plots);

    let title = format!("Growth with the triangles: {DEFAULT_FABRIC} on a folded cone");
    let cone = "A rectangle of 1200 x 700 mm, its triangles jittered, made in no order and put in \
                order as on reading.";
    let mut over_triangles =
        Table::new("growth-triangles", &title, &[cone, &stages, note], COLUMNS);
    let mut plots = self::plots("triangles");
    for (at, wanted) in TRIANGLES.into_iter().enumerate() {
        progress(0.6 + 0.4 * (at as f64 / TRIANGLES.len() as f64));
        let garment = folded_cone(wanted);
        let row = measure(
            arguments.runs,
            &mut over_triangles,
            &garment,
            &at_stitches(&fabric, &garment, ON_TRIANGLES)?,
        )?;
        push(&mut plots, f64::from(index32(garment.summary.triangles)), &row);
    }
    over_triangles.plots.extend(plots);
    Ok(vec![over_stitches, over_triangles])
}

/// The plots of a table: time over size, and memory over size.
fn plots(size: &'static str) -> [Plot; 2] {
    let time = Plot::new(
        &format!("Growth with the {size}: time"),
        size,
        "time, ms",
        NAMES.map(Series::ours),
    );
    [
        time,
        Plot::new(
            &format!("Growth with the {size}: memory"),
            size,
            "memory, MB",
            [Series::ours("peak")],
        ),
    ]
}

/// Adds a row to the plots.
fn push(plots: &mut [Plot; 2], size: f64, row: &GrowthRow) {
    plots[0].push(size, row.stages);
    plots[1].push(size, [row.peak]);
}

/// Measures a row and adds it to the table.
fn measure(runs: u32, table: &mut Table, garment: &Garment, fabric: &Fabric) -> Result<GrowthRow> {
    let triangles = garment.summary.triangles;
    let (st, sr) = SECTION;
    let section =
        Section { st, sr, radius: fabric.radius(), flatten: 1.0, caps: false, texture_per_mm: 1.0 };
    let options = DrapeOptions { surface: Some(section), ..FLAT_YARN };
    // The system's peak counts from the start of the process unless it is reset for each row.
    forget_peak_memory();
    // The first run counts the stitches. On a small row it is the warm-up run and is dropped.
    let mut taken = vec![timed_run(garment, fabric, &options)?];
    let stitches = taken[0].2;
    if stitches.max(triangles) <= ONCE {
        taken = (0..runs).map(|_| timed_run(garment, fabric, &options)).collect::<Result<_>>()?;
    }
    let (peak, held) = (peak_memory_mb(), resident_memory_mb());
    let median = |of: &dyn Fn(&(Sample, StageTimes, usize)) -> Sample| {
        Times::from_samples(&taken.iter().map(of).collect::<Vec<_>>())
    };
    let mut stages = [median(&|run| run.0).wall.median; 6];
    for (place, stage) in stages[1..].iter_mut().zip(STAGES) {
        *place = median(&|run| run.1.of_stage(stage)).wall.median;
    }
    // The median of the sums, not the sum of the medians: runs differ in which stage is slow.
    let all = median(&|run| {
        STAGES.iter().map(|stage| run.1.of_stage(*stage)).fold(run.0, |sum, stage| sum + stage)
    });
    let sizes = [TableCell::Count(stitches), TableCell::Count(triangles)];
    let further =
        [TableCell::Count(taken.len()), TableCell::Number(peak, 0), TableCell::Number(held, 0)];
    table
        .push(sizes.into_iter().chain(stages.map(TableCell::ms)).chain(times(&all)).chain(further));
    Ok(GrowthRow { stitches, stages, peak })
}

/// One run: the times of laying out and of the stages, and the number of stitches.
fn timed_run(
    garment: &Garment,
    fabric: &Fabric,
    options: &DrapeOptions,
) -> Result<(Sample, StageTimes, usize)> {
    let start = Moment::now();
    let cloth = Cloth::cover(garment, fabric)?;
    let laid_out = start.elapsed();
    let (staged, totals) = time_stages(&cloth, options);
    Ok((laid_out, staged, totals.losses.stitches))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_has_every_stage_and_what_it_held() {
        let garment = folded_cone(200);
        let fabric = at_stitches(&Fabric::named(DEFAULT_FABRIC).unwrap(), &garment, 500.0).unwrap();
        let mut table = Table::new("growth", "", &[], COLUMNS);
        let row = measure(1, &mut table, &garment, &fabric).unwrap();
        assert!(
            row.stitches.abs_diff(500) < 100 && row.stages.iter().all(|ms| *ms > 0.0),
            "{:?}",
            row.stages
        );
        #[cfg(target_os = "linux")]
        assert!(row.peak > 1.0);
    }
}
