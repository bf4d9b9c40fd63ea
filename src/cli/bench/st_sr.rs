//! Figure 14 of Liu, Kyosev and Jiang 2022: render time over St (segments of a stitch), Sr (edges
//! of a tube's section) and the size of the fabric.
//!
//! In: a flat fabric. Out: a table and two plots. The paper's figure is a plot without printed
//! values, so there are no published times. St and Sr are those of its Table 1; the sizes are ours.

use anyhow::Result;
use warpknit::drape::{Cloth, DrapeOptions, Stage, swatch_panel};
use warpknit::fabric::Fabric;
use warpknit::render::cloth;
use warpknit::yarn::tube::Section;

use super::super::args::{Bench, DEFAULT_FABRIC};
use super::measure::{FLAT_YARN, measured_parts, time_stages};
use super::picture::PictureTimer;
use super::plot::{Plot, Series};
use super::table::{BESIDE, TIMES, Table, TableCell, beside, times};

/// The paper's St and Sr.
const SECTIONS: [(u32, u32); 6] = [(10, 5), (25, 5), (40, 5), (10, 13), (25, 13), (40, 13)];
/// Wales and courses of the fabrics.
const SIDES: [u32; 3] = [10, 20, 40];

/// Measures tubes and picture for each of the paper's St, Sr and for each size.
pub(super) fn st_sr(arguments: &Bench, progress: &mut dyn FnMut(f64)) -> Result<Table> {
    let fabric = Fabric::named(DEFAULT_FABRIC)?;
    let timer = PictureTimer::new(arguments);
    let mut table = Table::new(
        "st-sr",
        "Figure 14: render time over St, Sr and the fabric's size",
        &[
            "The time is that of tubes and picture. The processor traces the yarns' curves \
             whatever St and Sr, so its picture is timed once a size; --renderer gpu draws tubes.",
            "published: the paper's figure is a plot, and its text prints neither its times nor \
             its sizes.",
        ],
        [
            ("fabric", "fabric"),
            ("st", "St"),
            ("sr", "Sr"),
            ("triangles", "triangles\na stitch"),
            ("tubes_ms", "tubes, ms"),
        ],
    );
    table.notes.insert(
        0,
        format!("Flat {DEFAULT_FABRIC} of so many wales and courses, {}.", timer.note()),
    );
    table.add_columns(TIMES.into_iter().chain(BESIDE));
    let series = SECTIONS.map(|(st, sr)| Series::ours(&format!("St {st}, Sr {sr}")));
    let mut rendered =
        Plot::new("Figure 14: tubes and picture", "stitches", "time, ms", series.clone());
    let mut tubed = Plot::new("Figure 14: tubes alone", "stitches", "time, ms", series);
    // One scene serves all St and Sr of a size: it holds the yarns' points, not their tubes.
    for (at, side) in SIDES.into_iter().enumerate() {
        let (panel, mut all) = (swatch_panel(&fabric, side, side), Vec::new());
        let cloth = Cloth::swatch(&panel, &fabric, side, side);
        let scene = cloth::from_cloth(&cloth, &fabric);
        let mut one_for_all =
            if timer.heeds_tubes() { None } else { Some(timer.timed(&scene)?.into_iter().cycle()) };
        for (number, (st, sr)) in SECTIONS.into_iter().enumerate() {
            progress((at as f64 + number as f64 / SECTIONS.len() as f64) / SIDES.len() as f64);
            let section = Section {
                st,
                sr,
                radius: fabric.radius(),
                flatten: 1.0,
                caps: false,
                texture_per_mm: 1.0,
            };
            let options = DrapeOptions { surface: Some(section), ..FLAT_YARN };
            let timer = timer.with_tubes(st, sr);
            // Tubes are made by the pipeline's surface stage, and the picture by the renderer; the
            // paper's render time is their sum.
            let [tubes, taken] = measured_parts(timer.runs, &mut || {
                let tubes = time_stages(&cloth, &options).0.of_stage(Stage::Surface);
                let picture = match one_for_all.as_mut().and_then(Iterator::next) {
                    Some(picture) => picture,
                    None => timer.draw(&scene)?,
                };
                Ok([tubes, tubes + picture])
            })?;
            let sizes = [
                TableCell::Text(format!("{side} x {side}")),
                TableCell::Count(st as usize),
                TableCell::Count(sr as usize),
            ];
            let further = [
                TableCell::Count(section.triangles_per_stitch() as usize),
                TableCell::ms(tubes.wall.median),
            ];
            table.push(
                sizes
                    .into_iter()
                    .chain(further)
                    .chain(times(&taken))
                    .chain(beside(None, taken.for_ratio())),
            );
            all.push((taken.wall.median, tubes.wall.median));
        }
        let stitches = scene.stitches.len() as f64;
        rendered.push_known(stitches, all.iter().map(|(taken, _)| Some(*taken)));
        tubed.push_known(stitches, all.iter().map(|(_, tubes)| Some(*tubes)));
    }
    table.plots.extend([rendered, tubed]);
    Ok(table)
}
