//! Table 3 of Liu, Kyosev and Jiang 2022: the total time from fabric to picture.
//!
//! In: a skirt, or the user's garment. Out: a table and a plot. The paper gives numbers of stitches
//! and seconds; it names neither the fabric, nor the garment, nor the size of the picture.

use anyhow::Result;
use warpknit::drape::Cloth;
use warpknit::fabric::Fabric;
use warpknit::garment::Garment;
use warpknit::ids::index32;
use warpknit::render::cloth;

use super::super::args::{Bench, DEFAULT_FABRIC};
use super::garments::{Garments, Shipped, fitted};
use super::measure::{Moment, Times, measured_parts};
use super::picture::PictureTimer;
use super::plot::{Plot, Series};
use super::table::{BESIDE, TIMES, Table, TableCell, beside, times};

/// Numbers of stitches, with the paper's seconds.
const LINES: [(u32, f64); 4] = [(5400, 4.42), (9996, 7.43), (10_400, 7.80), (21_600, 15.56)];

/// Measures the table, on the user's garment if there is one.
pub(super) fn total(
    arguments: &Bench,
    garments: &Garments,
    progress: &mut dyn FnMut(f64),
) -> Result<Table> {
    let (name, garment) = garments.get(Shipped::Skirt)?;
    let timer = PictureTimer::new(arguments);
    let mut table = Table::new(
        "total",
        &format!("Table 3: total with rendering, {DEFAULT_FABRIC} on {name}"),
        &["published: Liu, Kyosev, Jiang 2022, Table 3, which names neither fabric nor garment \
             nor picture; C# and WebGL on an i7-9750H."],
        [("stitches", "stitches"), ("cloth_ms", "cloth, ms"), ("picture_ms", "picture, ms")],
    );
    table.notes.insert(0, format!("From fabric to picture of {}.", timer.note()));
    table.add_columns(TIMES.into_iter().chain(BESIDE));
    let mut plot = Plot::new(
        "Table 3: total with rendering",
        "stitches",
        "time, ms",
        [Series::ours("here"), Series::published("published")],
    );
    for (at, (wanted, seconds)) in LINES.into_iter().enumerate() {
        progress(at as f64 / LINES.len() as f64);
        let (fabric, stitches) =
            fitted(&Fabric::named(DEFAULT_FABRIC)?, &garment, f64::from(wanted))?;
        // The fabric's densities are adapted until it has the paper's number of stitches.
        let [cloth, picture, all] = measure(&timer, &garment, &fabric)?;
        // Published times hold for the paper's garments only.
        let published = (!garments.are_own()).then_some(1e3 * seconds);
        let sizes = [
            TableCell::Count(stitches),
            TableCell::ms(cloth.wall.median),
            TableCell::ms(picture.wall.median),
        ];
        // A graphics card works while the processor waits.
        let ms = if timer.is_on_cpu() { all.for_ratio() } else { all.wall.median };
        table.push(sizes.into_iter().chain(times(&all)).chain(beside(published, ms)));
        plot.push_known(f64::from(index32(stitches)), [Some(all.wall.median), published]);
    }
    table.plots.push(plot);
    Ok(table)
}

/// The times of cloth, picture and both.
fn measure(timer: &PictureTimer, garment: &Garment, fabric: &Fabric) -> Result<[Times; 3]> {
    measured_parts(timer.runs, &mut || {
        let start = Moment::now();
        let scene = cloth::from_cloth(&Cloth::cover(garment, fabric)?, fabric);
        let cloth = start.elapsed();
        let picture = timer.draw(&scene)?;
        Ok([cloth, picture, cloth + picture])
    })
}
