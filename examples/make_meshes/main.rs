//! Makes the garments in `meshes/`: cuts, sews, drapes, checks and writes them.
//!
//! In: nothing. Out: `skirt`, `tube` and `pinch` as pairs of flat and draped OBJ files, `tshirt` as
//! one OBJ file with its pattern in `vt`, the bodies in them, and a table of results on standard
//! output. The bytes are the same for any number of threads. The program fails if a garment is
//! stretched too much, faces inwards, or intersects the body.
//!
//! `cargo run --release --example make_meshes [FOLDER]`, with `meshes` as the default folder.

mod body;
mod cloth;
mod contact;
mod measure;
mod pattern;
mod pinch;
mod recipe;
mod skirt;
mod surface;
mod triangulate;
mod tshirt;
mod tube;
mod write;

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use anyhow::{Result, ensure};
use rayon::prelude::*;

use crate::recipe::Made;
use crate::surface::Surface;

fn main() -> Result<()> {
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("meshes"), PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    let recipes: [fn() -> Made; 4] = [tshirt::make, skirt::make, tube::make, pinch::make];
    let made: Vec<(Made, f64)> = recipes.par_iter().with_max_len(1).map(timed).collect();
    println!(
        "{:8} {:>8} {:>9} {:>7} {:>7} {:>7} {:>8} {:>8} {:>9} {:>6}",
        "", "vertices", "triangles", "5 %", "median", "95 %", "depth cm", "rms cm/s", "bytes", "s"
    );
    for (made, seconds) in &made {
        let bytes = write(&folder, made)?;
        report(made, bytes, *seconds);
    }
    made.iter().try_for_each(|(made, _)| check(made))
}

/// Makes a garment and returns it with the seconds it took.
fn timed(recipe: &fn() -> Made) -> (Made, f64) {
    let start = Instant::now();
    let made = recipe();
    (made, start.elapsed().as_secs_f64())
}

/// Writes a garment's files and returns their bytes.
fn write(folder: &Path, made: &Made) -> Result<usize> {
    let writer = if made.one_file { write::with_pattern } else { write::pair };
    let bytes = writer(folder, made.name, &made.garment, &made.draped)?;
    // A table needs no mesh.
    if made.body.shapes.is_empty() {
        return Ok(bytes);
    }
    Ok(bytes + write::body(folder, made.name, &Surface::of(&made.body))?)
}

/// Prints a garment's line of the table.
fn report(made: &Made, bytes: usize, seconds: f64) {
    let stretch = measure::stretch(&made.garment, &made.draped);
    println!(
        "{:8} {:8} {:9} {:7.4} {:7.4} {:7.4} {:8.3} {:8.3} {bytes:9} {seconds:6.1}",
        made.name,
        made.garment.flat.len(),
        made.garment.triangles.len(),
        stretch.low,
        stretch.median,
        stretch.high,
        measure::depth(&made.body, &made.draped),
        made.speed,
    );
}

/// Refuses a garment that is not fit for use.
fn check(made: &Made) -> Result<()> {
    let stretch = measure::stretch(&made.garment, &made.draped);
    ensure!(stretch.is_near_isometric(), "{} is stretched beyond the limits", made.name);
    ensure!(measure::depth(&made.body, &made.draped) <= 0.0, "{} cuts into the body", made.name);
    let inward = measure::inward_share(&made.garment, &made.draped, &made.body);
    ensure!(inward < 0.5, "{} faces inwards", made.name);
    Ok(())
}
