//! The garment page of the specification, line by line, on small meshes; then every real garment there is.

use std::path::{Path, PathBuf};

use warpknit::garment::{Garment, GarmentError, ReadOptions, read};

/// The folder of real garments, which is no part of the repository.
fn garments() -> Option<PathBuf> {
    let folder = match std::env::var_os("WARPKNIT_GARMENTS") {
        Some(folder) => PathBuf::from(folder),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/garments"),
    };
    if !folder.is_dir() {
        println!("skipped: no real garments at {}", folder.display());
        return None;
    }
    Some(folder)
}

/// Every OBJ under a folder, in the order of their names.
fn all_objs(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(all_objs(&path));
        } else if path.extension().is_some_and(|ending| ending == "obj") {
            found.push(path);
        }
    }
    found.sort();
    found
}

#[test]
fn every_real_garment_reads_or_says_why_not() {
    let Some(folder) = garments() else { return };
    for path in all_objs(&folder) {
        let start = std::time::Instant::now();
        match read(&path, None, &ReadOptions::default()) {
            Ok(Garment { panels, facts }) => {
                println!(
                    "{} {:?} panels {} of {} tris, unit {} scale {:.4} flipped {} degenerate {} untex {} refused {} mirrored {} nonman {}",
                    path.strip_prefix(&folder).unwrap().display(),
                    start.elapsed(),
                    panels.len(),
                    facts.triangles,
                    facts.unit,
                    facts.uv_scale_mm,
                    facts.flipped,
                    facts.degenerate,
                    facts.untextured,
                    facts.refused,
                    panels.iter().filter(|p| p.mirrored).count(),
                    panels.iter().map(|p| p.non_manifold_edges()).sum::<usize>()
                );
                for w in &facts.warnings {
                    println!("    {w}");
                }
                for p in panels.iter().take(12) {
                    println!(
                        "    {} tris {:.0} mm2 {:.0} x {:.0} mirrored {}",
                        p.triangles.len(),
                        p.area(),
                        p.size().x,
                        p.size().y,
                        p.mirrored
                    );
                }
            }
            Err(error) => println!("{error}"),
        }
    }
    let _: Option<GarmentError> = None;
}
