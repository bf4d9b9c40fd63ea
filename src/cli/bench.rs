//! `warpknit bench`: how long the work takes here, beside what the papers published.
//!
//! Each figure is the median of several runs, after one that warms up; `from` and `to` are the fastest and the slowest.

use std::fmt::Write as _;
use std::hint::black_box;
use std::time::Instant;

use anyhow::Result;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use warpknit::fabric::Fabric;
use warpknit::knit::mesh::StructureMesh;
use warpknit::knit::{Knitted, Pattern};
use warpknit::yarn::tube::{Section, Tubes};

use super::args::Bench;
use super::clock::{Clock, Task, cpu_ms};
use super::print;

/// The plain cloths of the ribbon paper's table: loops each way, and its times in ms at each of [`SEGMENTS`].
const PUBLISHED: [(u32, [f64; 3]); 3] =
    [(20, [163.0, 188.0, 382.0]), (50, [910.0, 1167.0, 3534.0]), (100, [4536.0, 7708.0, 23_544.0])];
/// Segments a loop.
const SEGMENTS: [u32; 3] = [15, 20, 50];
/// The paper's plain cloth.
const PLAIN: &str = "jersey";

/// Prints the table that was asked for.
pub(crate) fn bench(arguments: &Bench) -> Result<()> {
    let mut clock = Clock::with_threads(arguments.threads, arguments.quiet)?;
    let table = weft(arguments, &mut |done| clock.begin(Task::Measure, done))?;
    clock.clear();
    print(&table)
}

/// How long plain weft knits take from their motif to the tubes of their yarns.
fn weft(arguments: &Bench, progress: &mut dyn FnMut(f64)) -> Result<String> {
    let fabric = Fabric::named(PLAIN)?;
    let mut table = row(["loops", "segments", "vertices", "ms", "from", "to", "cpu ms", "ns/vertex", "published", "times"]);
    let count = PUBLISHED.len() * SEGMENTS.len();
    let sizes = PUBLISHED.iter().flat_map(|(side, times)| SEGMENTS.iter().zip(times).map(move |(st, ms)| (*side, *st, *ms)));
    for (number, (side, st, published)) in sizes.enumerate() {
        progress(number as f64 / count as f64);
        let section = Section { st, sr: arguments.sr, radius: fabric.radius(), flatten: 1.0, caps: false, texture_per_mm: 1.0 };
        let mut vertices = 0;
        let Times { wall, cpu } = measured(arguments.runs, &mut || vertices = model(&fabric, side, &section));
        let of_cpu = |of: &dyn Fn(f64) -> String| cpu.as_ref().map_or_else(|| "-".to_owned(), |cpu| of(cpu.median));
        table += &row([
            &format!("{side} x {side}"),
            &st.to_string(),
            &vertices.to_string(),
            &format!("{:.2}", wall.median),
            &format!("{:.2}", wall.least),
            &format!("{:.2}", wall.most),
            &of_cpu(&|ms| format!("{ms:.2}")),
            &of_cpu(&|ms| format!("{:.1}", 1e6 * ms / vertices as f64)),
            &format!("{published:.0}"),
            &format!("{:.0}", published / wall.median),
        ]);
    }
    Ok(table)
}

fn row(cells: [&str; 10]) -> String {
    let mut row = String::new();
    for (cell, width) in cells.into_iter().zip([9, 8, 9, 8, 8, 8, 8, 9, 9, 5]) {
        write!(row, "{cell:>width$} ").expect("a string takes any text");
    }
    row.truncate(row.trim_end().len());
    row + "\n"
}

/// Knits a flat cloth of so many loops each way into tubes, course by course as files are written, and counts their vertices.
fn model(fabric: &Fabric, side: u32, section: &Section) -> usize {
    let (pattern, mesh) = (Pattern::new(fabric), StructureMesh::anchored_at(fabric, DVec2::ZERO));
    let loops = i64::from(side);
    let course = |(knitted, normals, tubes): &mut (Knitted, Vec<DVec3>, Tubes), number: i64| {
        knitted.clear();
        tubes.clear();
        pattern.lay(0, number, 0..loops, &mesh, knitted);
        normals.resize(knitted.points.len(), DVec3::Z);
        let last = knitted.points.len() - 1;
        let ends = knitted.stitches.iter().skip(1).map(|&end| end as usize).chain([last]);
        let stitches = knitted.stitches.iter().zip(ends).map(|(&start, end)| start as usize..end + 1);
        tubes.add(&knitted.points, normals, stitches, section);
        black_box(tubes).positions.len()
    };
    (0..loops).into_par_iter().map_init(Default::default, course).sum()
}

/// Several measurements of one thing.
struct Spread {
    median: f64,
    least: f64,
    most: f64,
}

/// What some work takes, ms.
struct Times {
    wall: Spread,
    /// Of all threads, where the system says it.
    cpu: Option<Spread>,
}

/// Does the work once to warm up, and then so many times.
fn measured(runs: u32, work: &mut dyn FnMut()) -> Times {
    work();
    let (mut wall, mut cpu) = (Vec::new(), Vec::new());
    for _ in 0..runs {
        let (start, before) = (Instant::now(), cpu_ms());
        work();
        wall.push(1e3 * start.elapsed().as_secs_f64());
        cpu.extend(cpu_ms().zip(before).map(|(after, before)| after - before));
    }
    Times { wall: Spread::of(&wall), cpu: (!cpu.is_empty()).then(|| Spread::of(&cpu)) }
}

impl Spread {
    /// Of one number at least.
    fn of(numbers: &[f64]) -> Self {
        let mut sorted = numbers.to_vec();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len() - 1;
        Self { median: sorted[last / 2].midpoint(sorted[sorted.len() / 2]), least: sorted[0], most: sorted[last] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_lies_between_the_least_and_the_most() {
        let Spread { median, least, most } = Spread::of(&[4.0, 1.0, 9.0, 2.0]);
        assert_eq!((median, least, most), (3.0, 1.0, 9.0));
        assert_eq!(Spread::of(&[4.0, 1.0, 9.0]).median, 4.0);
    }

    #[test]
    fn a_cloth_of_the_table_has_all_its_loops() {
        let fabric = Fabric::named(PLAIN).unwrap();
        let section = Section { st: 15, sr: 5, radius: fabric.radius(), flatten: 1.0, caps: false, texture_per_mm: 1.0 };
        assert_eq!(model(&fabric, 20, &section), 20 * (20 * 15 + 1) * 6);
    }
}
