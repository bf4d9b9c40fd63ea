//! The ribbon paper's table: plain weft knits, from their motif to the tubes of their yarns.
//!
//! In: a plain fabric. Out: a table and a plot of times beside the published ones.

use std::hint::black_box;

use anyhow::Result;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use warpknit::fabric::Fabric;
use warpknit::knit::mesh::StructureMesh;
use warpknit::knit::{Knitted, Pattern};
use warpknit::yarn::tube::{Section, Tubes};

use super::super::args::Bench;
use super::measure::measured;
use super::plot::{Plot, Series};
use super::table::{BESIDE, TIMES, Table, TableCell, beside, times};

/// The plain cloths of the ribbon paper's table: loops each way, and the published times in ms for
/// each of [`SEGMENTS`].
const PUBLISHED: [(u32, [f64; 3]); 3] =
    [(20, [163.0, 188.0, 382.0]), (50, [910.0, 1167.0, 3534.0]), (100, [4536.0, 7708.0, 23_544.0])];
/// Segments of a loop.
const SEGMENTS: [u32; 3] = [15, 20, 50];
/// The paper's plain cloth.
const PLAIN: &str = "jersey";

/// Measures the table.
pub(super) fn weft(arguments: &Bench, progress: &mut dyn FnMut(f64)) -> Result<Table> {
    let fabric = Fabric::named(PLAIN)?;
    let columns = [("loops", "loops"), ("segments", "segments"), ("vertices", "vertices")];
    let further = [("ns_a_vertex", "ns/vertex")].into_iter().chain(BESIDE);
    let mut table = Table::new(
        "weft",
        "Plain weft knits from motif to tubes (the ribbon paper's table)",
        &["ns/vertex: of CPU time."],
        columns.into_iter().chain(TIMES).chain(further),
    );
    let mut plot = Plot::new(
        "Plain weft knits",
        "segments",
        "time, ms",
        [Series::ours("here"), Series::published("published")],
    );
    let count = PUBLISHED.len() * SEGMENTS.len();
    let sizes = PUBLISHED.iter().flat_map(|(side, times)| {
        SEGMENTS.iter().zip(times).map(move |(st, ms)| (*side, *st, *ms))
    });
    for (number, (side, st, published)) in sizes.enumerate() {
        progress(number as f64 / count as f64);
        let section = Section {
            st,
            sr: arguments.sr,
            radius: fabric.radius(),
            flatten: 1.0,
            caps: false,
            texture_per_mm: 1.0,
        };
        // The number of vertices comes from the run itself.
        let mut vertices = 0;
        let taken = measured(arguments.runs, &mut || {
            vertices = model(&fabric, side, &section);
            Ok(())
        })?;
        let sizes = [
            TableCell::Text(format!("{side} x {side}")),
            TableCell::Count(st as usize),
            TableCell::Count(vertices),
        ];
        // CPU time, since the paper's cloths are knitted by several threads here.
        let each = taken.cpu.map(|cpu| 1e6 * cpu.median / vertices as f64);
        let further = std::iter::once(TableCell::known(each, 1))
            .chain(beside(Some(published), taken.for_ratio()));
        table.push(sizes.into_iter().chain(times(&taken)).chain(further));
        plot.push(f64::from(side * side * st), [taken.wall.median, published]);
    }
    table.plots.push(plot);
    Ok(table)
}

/// Knits a flat cloth of so many loops each way into tubes, and counts their vertices. Each thread
/// reuses its memory from course to course, as the writers of files do.
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
        let stitches =
            knitted.stitches.iter().zip(ends).map(|(&start, end)| start as usize..end + 1);
        tubes.add(&knitted.points, normals, stitches, section);
        black_box(tubes).positions.len()
    };
    (0..loops).into_par_iter().map_init(Default::default, course).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cloth_of_the_table_has_all_its_loops() {
        let fabric = Fabric::named(PLAIN).unwrap();
        let section = Section {
            st: 15,
            sr: 5,
            radius: fabric.radius(),
            flatten: 1.0,
            caps: false,
            texture_per_mm: 1.0,
        };
        assert_eq!(model(&fabric, 20, &section), 20 * (20 * 15 + 1) * 6);
    }
}
