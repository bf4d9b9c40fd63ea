//! How long garments take to read, over their number of triangles.
//!
//! In: nothing but the number of runs. Out: a table and its plot. The garments are made here: the
//! folded cone of [`panel`](super::panel), as a flat and a draped file and as one file with `vt`.
//! Its triangles come row by row, as meshers write them, and once in random order, which is the
//! worst for the caches. Times cover the whole of reading: text, pairing, panels, normals and the
//! order of triangles. Files lie in memory by then, as after their export.
//!
//! Cost: a minute and 500 MB on the disk.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use glam::DVec3;
use warpknit::export::TemporaryFolder;
use warpknit::garment::{ReadOptions, read};
use warpknit::ids::index32;

use super::super::args::Bench;
use super::measure::measured;
use super::panel::shuffled_cone;
use super::plot::{Plot, Series};
use super::table::{TIMES, Table, TableCell, times};

/// Numbers of triangles.
const TRIANGLES: [usize; 4] = [2_000, 20_000, 200_000, 2_000_000];
/// The most runs of a garment of so many triangles or more.
const LARGE: usize = 2_000_000;
const LARGE_RUNS: u32 = 3;
/// How a garment is given, with its number of files.
const WAYS: [(&str, u32); 3] = [("pair", 2), ("one file with vt", 1), ("pair in random order", 2)];

const TITLE: &str = "Reading garments: a folded cone of 1200 x 700 mm";

/// Measures the table.
pub(super) fn reading(arguments: &Bench, progress: &mut dyn FnMut(f64)) -> Result<Table> {
    let mut table = empty_table();
    let ways = WAYS.map(|(way, _)| Series::ours(way));
    let mut plot = Plot::new(TITLE, "triangles", "time, ms", ways);
    for (at, triangles) in TRIANGLES.into_iter().enumerate() {
        progress(at as f64 / TRIANGLES.len() as f64);
        let runs = if triangles < LARGE { arguments.runs } else { LARGE_RUNS.min(arguments.runs) };
        let (count, medians) = push(&mut table, triangles, runs)?;
        plot.push(f64::from(index32(count)), medians);
    }
    table.plots.push(plot);
    Ok(table)
}

fn empty_table() -> Table {
    let mut table = Table::new(
        "reading",
        TITLE,
        &[
            "Reading, from files to panels; both files of a pair are read at once. To look for cloth under \
           other cloth, as drape does, takes 60 ns a triangle more.",
        ],
        [("triangles", "triangles"), ("files", "files"), ("mb", "MB")],
    );
    table.add_columns(TIMES.into_iter().chain([("ns", "ns a triangle\nand file")]));
    table
}

/// Adds the rows of a garment of about so many triangles. Returns their number and the medians, ms.
fn push(table: &mut Table, triangles: usize, runs: u32) -> Result<(usize, [f64; WAYS.len()])> {
    let folder =
        TemporaryFolder::create_in(&std::env::temp_dir()).context("no room for temporary files")?;
    let [flat, draped, joined, shuffled_flat, shuffled_draped] =
        ["flat", "draped", "joined", "shuffled_flat", "shuffled_draped"]
            .map(|name| folder.path().join(name).with_extension("obj"));
    let shuffled = shuffled_cone(triangles);
    let mut panel = shuffled.clone();
    panel.triangles.sort_unstable();
    let flat_places: Vec<_> = panel.uv.iter().map(|place| place.extend(0.0)).collect();
    write_obj(&flat, &flat_places, None, &panel.triangles)?;
    write_obj(&draped, &panel.draped, None, &panel.triangles)?;
    write_obj(&joined, &panel.draped, Some(&flat_places), &panel.triangles)?;
    write_obj(&shuffled_flat, &flat_places, None, &shuffled.triangles)?;
    write_obj(&shuffled_draped, &panel.draped, None, &shuffled.triangles)?;
    let ways = [(&flat, Some(&draped)), (&joined, None), (&shuffled_flat, Some(&shuffled_draped))];
    let options = ReadOptions { unit: Some("mm".parse()?), ..ReadOptions::default() };
    let mut medians = [0.0; WAYS.len()];
    for (((name, files), (first, second)), median) in WAYS.into_iter().zip(ways).zip(&mut medians) {
        let taken = measured(runs, &mut || {
            std::hint::black_box(read(first, second.map(PathBuf::as_path), &options)?);
            Ok(())
        })?;
        let sizes = [Some(first), second].into_iter().flatten().map(|path| path.metadata());
        let bytes = sizes.map(|about| Ok(about?.len())).sum::<Result<u64>>()?;
        *median = taken.wall.median;
        let count = panel.triangles.len();
        let labels = [
            TableCell::Count(count),
            TableCell::text(name),
            TableCell::Number(bytes as f64 / 1e6, 1),
        ];
        let a_triangle = 1e6 * *median / (count as f64 * f64::from(files));
        let a_triangle = TableCell::Number(a_triangle, 0);
        table.push(labels.into_iter().chain(times(&taken)).chain([a_triangle]));
    }
    Ok((panel.triangles.len(), medians))
}

/// Writes places and triangles as OBJ, with the places of `vt` if there are some.
fn write_obj(
    path: &Path,
    places: &[DVec3],
    vt: Option<&[DVec3]>,
    triangles: &[[u32; 3]],
) -> Result<()> {
    let about = || format!("{}: can't write", path.display());
    let mut file = BufWriter::new(File::create(path).with_context(about)?);
    for place in places {
        writeln!(file, "v {:.6} {:.6} {:.6}", place.x, place.y, place.z).with_context(about)?;
    }
    for place in vt.unwrap_or_default() {
        writeln!(file, "vt {:.6} {:.6}", place.x, place.y).with_context(about)?;
    }
    for corners in triangles {
        let [a, b, c] = corners.map(|corner| corner + 1);
        match vt {
            Some(_) => writeln!(file, "f {a}/{a} {b}/{b} {c}/{c}"),
            None => writeln!(file, "f {a} {b} {c}"),
        }
        .with_context(about)?;
    }
    file.flush().with_context(about)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_ways_of_giving_a_garment_are_read_and_timed() {
        let mut table = empty_table();
        let (count, medians) = push(&mut table, 200, 1).unwrap();
        assert!(count.abs_diff(200) < 20 && medians.iter().all(|ms| *ms > 0.0), "{medians:?}");
    }
}
