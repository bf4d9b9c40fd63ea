//! The mappings side by side: what flat data points cost, and what each way to the body adds.
//!
//! In: the shipped garments, or the user's own. Out: a table. `frame` is the map of Liu, Kyosev and
//! Jiang 2022; `relaxed` needs the strains of the repeat, which are solved once a fabric and have a
//! row of their own. There are no published times.

use anyhow::Result;
use warpknit::drape::{Cloth, DrapeOptions, Stage};
use warpknit::fabric::Fabric;
use warpknit::garment::Garment;
use warpknit::map::Mapping;

use super::super::args::{Bench, DEFAULT_FABRIC};
use super::garments::{Garments, Shipped, fitted};
use super::measure::{FLAT_YARN, measured_parts, time_stages};
use super::table::{TIMES, Table, TableCell, times};

/// The shipped garments, with about their numbers of stitches in the paper's Table 2.
const LINES: [(Shipped, f64); 3] =
    [(Shipped::Pinch, 3500.0), (Shipped::Tube, 8480.0), (Shipped::Skirt, 26_180.0)];
/// The rows of a garment.
const PARTS: [&str; 5] = ["plane", "frame", "smooth", "relaxed", "solving strains"];

/// Measures the table, on the user's garment if there is one.
pub(super) fn mapping(
    arguments: &Bench,
    garments: &Garments,
    progress: &mut dyn FnMut(f64),
) -> Result<Table> {
    let mut table = Table::new(
        "mapping",
        "Mappings side by side: plane, frame, smooth and relaxed",
        &["plane: all data points on the flat fabric. frame, smooth, relaxed: the map of located \
             points, --mapping. solving strains: the repeat over the garment's strains, once a \
             fabric and without the cache."],
        [("cloth", "cloth"), ("fabric", "fabric"), ("points", "data\npoints"), ("part", "part")],
    );
    table.add_columns(TIMES.into_iter().chain([("ns_a_point", "ns a\npoint")]));
    for (at, (shipped, stitches)) in LINES.into_iter().enumerate() {
        progress(at as f64 / LINES.len() as f64);
        let (name, garment) = garments.get(shipped)?;
        let (fabric, _) = fitted(&Fabric::named(DEFAULT_FABRIC)?, &garment, stitches)?;
        push(&mut table, arguments.runs, &name, &garment, &fabric)?;
    }
    Ok(table)
}

/// Adds the rows of a garment.
fn push(
    table: &mut Table,
    runs: u32,
    name: &str,
    garment: &Garment,
    fabric: &Fabric,
) -> Result<()> {
    let mut points = 0;
    let parts = measured_parts(runs, &mut || {
        // A new cloth has nothing solved.
        let cloth = Cloth::cover(garment, fabric)?;
        let staged = [Mapping::Frame, Mapping::Smooth, Mapping::Relaxed]
            .map(|mapping| time_stages(&cloth, &DrapeOptions { mapping, ..FLAT_YARN }));
        points = staged[0].1.data_points;
        let [frame, smooth, relaxed] = staged.map(|(staged, _)| staged);
        Ok([
            frame.of_stage(Stage::Knit),
            frame.of_stage(Stage::Map),
            smooth.of_stage(Stage::Map),
            relaxed.of_stage(Stage::Map),
            relaxed.of_stage(Stage::Strain),
        ])
    })?;
    for (part, taken) in PARTS.into_iter().zip(&parts) {
        let labels = [
            TableCell::text(name),
            TableCell::text(&fabric.name),
            TableCell::Count(points),
            TableCell::text(part),
        ];
        let a_point = TableCell::Number(1e6 * taken.wall.median / points as f64, 1);
        table.push(labels.into_iter().chain(times(taken)).chain([a_point]));
    }
    Ok(())
}
