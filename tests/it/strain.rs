//! Strained cloth: repeats that are kept from one run to the next, what the report says of bars and
//! fabrics that can't keep their length, and swatches that are pulled.

use std::path::{Path, PathBuf};

use assert_cmd::Command;

use crate::cli::{fails, warpknit};
use crate::drape::mesh;
use crate::laid::GRID;

/// Drapes a coarse fabric, with a folder of caches of its own. Returns the bytes of the yarns.
fn drape(folder: &Path, flags: &[&str]) -> Vec<u8> {
    let mut command = Command::cargo_bin("warpknit").unwrap();
    command.current_dir(folder).env("XDG_CACHE_HOME", folder.join("cache"));
    command.arg("drape").args([mesh("pinch_flat.obj"), mesh("pinch_draped.obj")]);
    command.args(["--fabric", "jersey", "--wales-per-cm", "1", "-o", "yarns.csv", "--quiet"]);
    command.args(flags).assert().success();
    std::fs::read(folder.join("yarns.csv")).unwrap()
}

/// The only file of the cache.
fn kept(folder: &Path) -> PathBuf {
    let mut entries = std::fs::read_dir(folder.join("cache/warpknit")).unwrap();
    let file = entries.next().unwrap().unwrap().path();
    assert!(entries.next().is_none(), "a temporary file stays");
    file
}

#[test]
fn yarns_are_the_same_with_the_cache_without_it_and_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let without = drape(folder, &["--no-cache", "--threads", "1"]);
    assert!(!folder.join("cache").exists());
    let first = drape(folder, &["--threads", "2"]);
    let bytes = std::fs::read(kept(folder)).unwrap();
    let second = drape(folder, &["--threads", "2"]);
    assert!(without == first && first == second);
    assert_eq!(std::fs::read(kept(folder)).unwrap(), bytes);
    // A file that is cut short is solved anew and replaced.
    std::fs::write(kept(folder), &bytes[..bytes.len() / 2]).unwrap();
    assert!(drape(folder, &["--threads", "3"]) == first);
    assert_eq!(std::fs::read(kept(folder)).unwrap(), bytes);
}

#[test]
fn a_cache_that_cannot_be_written_is_no_error() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("cache"), "a file and not a folder").unwrap();
    assert!(!drape(folder.path(), &[]).is_empty());
}

/// A report of the fabric on a garment, and what was said on stderr.
fn report(folder: &Path, flags: &[&str]) -> (serde_json::Value, String) {
    let mut command = warpknit(folder);
    command.arg("drape").args([mesh("pinch_flat.obj"), mesh("pinch_draped.obj")]);
    command.args(["--wales-per-cm", "1", "-o", "r.json"]).args(flags);
    let said = command.assert().success().get_output().stderr.clone();
    let report = std::fs::read(folder.join("r.json")).unwrap();
    (serde_json::from_slice(&report).unwrap(), String::from_utf8(said).unwrap())
}

#[test]
fn fabrics_whose_yarns_stretch_with_the_garment_are_named() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("grid.toml"), GRID).unwrap();
    let (laid, said) = report(folder.path(), &["--fabric", "grid.toml"]);
    let note = "yarns stretch with the garment";
    assert!(said.contains("note: ") && said.contains(note), "{said}");
    assert!(laid["garment"]["notes"].to_string().contains(note));
    assert!(laid["strain"].is_null());
    let (_, said) = report(folder.path(), &["--fabric", "grid.toml", "--mapping", "smooth"]);
    assert!(!said.contains(note), "{said}");
    let (jersey, said) = report(folder.path(), &["--fabric", "jersey"]);
    assert!(!said.contains(note), "{said}");
    assert!(jersey["strain"].is_object() && jersey["strain"]["elastic_bars"].is_null());
}

#[test]
fn bars_of_elastane_are_in_the_report() {
    let folder = tempfile::tempdir().unwrap();
    let (elastic, _) = report(folder.path(), &["--fabric", "elastic-locknit"]);
    assert_eq!(elastic["strain"]["elastic_bars"].to_string(), "[3]");
}

#[test]
fn a_pulled_swatch_is_as_wide_as_pulled_and_tells_its_free_width() {
    let folder = tempfile::tempdir().unwrap();
    let swatch = |flags: &[&str]| {
        let mut command = warpknit(folder.path());
        command.args(["swatch", "--fabric", "jersey", "--wales", "4", "--courses", "4"]);
        command.args(["-o", "s.csv", "-o", "s.json", "--quiet"]).args(flags);
        let stdout = command.assert().success().get_output().stdout.clone();
        let report = std::fs::read(folder.path().join("s.json")).unwrap();
        let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
        (report, String::from_utf8(stdout).unwrap())
    };
    let density = |report: &serde_json::Value, key: &str| report[key].as_f64().unwrap();
    let (flat, numbers) = swatch(&[]);
    let (pulled, told) = swatch(&["--stretch", "1.1,0.95"]);
    for (key, ratio) in [("wales_per_cm", 1.1), ("courses_per_cm", 0.95)] {
        assert!((density(&flat, key) / density(&pulled, key) - ratio).abs() < 1e-12, "{key}");
    }
    assert!(told.starts_with(&numbers), "the numbers are those of flat cloth: {told}");
    assert!(told.contains("pulled to 1.100 along the courses and 0.950 along the wales"), "{told}");
    assert_eq!(flat["surface"]["radius_mm"], pulled["surface"]["radius_mm"]);
    assert!(flat["stretched"].is_null());
    assert_eq!([&pulled["stretched"]["courses"], &pulled["stretched"]["wales"]], [1.1, 0.95]);
    assert_eq!(pulled["stretched"]["locked"], false);
    let (free, told) = swatch(&["--stretch", "1.1, Free"]);
    let rows: Vec<_> = told.lines().filter(|line| line.starts_with("1.")).collect();
    assert_eq!(rows.len(), 3, "{told}");
    assert_eq!(free["stretched"]["free"].as_array().unwrap().len(), 3);
    assert!(rows[0].starts_with("1.00     1.000") && told.contains("assumed bending"), "{told}");
}

#[test]
fn a_pull_asks_no_run_in_of_the_pulled_cloth() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = warpknit(folder.path());
    command.args(["swatch", "--fabric", "power-net", "--wales", "6", "--courses", "6"]);
    let output = command.args(["--stretch", "1,1.4", "-o", "s.csv"]).assert().success();
    let told = String::from_utf8(output.get_output().stderr.clone()).unwrap();
    assert!(
        told.contains("no loop can follow a pull to 1.00 along the courses and 1.40"),
        "{told}"
    );
}

#[test]
fn what_cannot_be_pulled_is_refused() {
    let grid = |folder: &Path| std::fs::write(folder.join("grid.toml"), GRID).unwrap();
    let laid = fails(1, &["swatch", "--fabric", "grid.toml", "--stretch", "1.1"], grid);
    assert!(laid.starts_with("error: grid: --stretch solves"), "{laid}");
    let cable = fails(1, &["swatch", "--fabric", "cable", "--stretch", "1.1"], |_| {});
    assert!(cable.starts_with("error: cable: --stretch solves"), "{cable}");
    for stretch in ["3", "1.1,wide", "0.1,1", "1,1,1", "1.5,free", "15%", ""] {
        assert!(fails(2, &["swatch", "--stretch", stretch], |_| {}).starts_with("error:"));
    }
}

/// A rectangle of 200 x 300 mm, pulled along both ways by a factor.
fn pulled_obj(folder: &Path, factor: f64) {
    let (x, y) = (200.0 * factor, 300.0 * factor);
    let text = format!(
        "v 0 0 0\nv {x} 0 0\nv {x} {y} 0\nv 0 {y} 0\nvt 0 0\nvt 200 0\nvt 200 300\nvt 0 300\n\
         f 1/1 2/2 3/3 4/4\n"
    );
    std::fs::write(folder.join("own.obj"), text).unwrap();
}

/// The warnings and notes in the report of a drape of that rectangle, or what the command says
/// when it fails.
fn said_of(factor: f64, flags: &[&str]) -> Result<Vec<String>, String> {
    let folder = tempfile::tempdir().unwrap();
    pulled_obj(folder.path(), factor);
    let mut command = Command::cargo_bin("warpknit").unwrap();
    command.current_dir(&folder).args(["drape", "own.obj", "--unit", "mm", "--uv-scale", "1"]);
    command.args(["--no-cache", "-o", "o.json"]).args(flags);
    let output = command.output().unwrap();
    if !output.status.success() {
        return Err(String::from_utf8(output.stderr).unwrap());
    }
    let text = std::fs::read_to_string(folder.path().join("o.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    let said = ["warnings", "notes"].map(|key| report["garment"][key].as_array().unwrap());
    Ok(said.into_iter().flatten().map(|text| text.as_str().unwrap().to_owned()).collect())
}

#[test]
fn locked_cloth_is_told_of_once_with_its_panel() {
    let locked = |factor: f64| {
        let said = said_of(factor, &["--wales-per-cm", "3", "--fabric", "tricot"]).unwrap();
        said.into_iter().filter(|text| text.contains("than its loops can follow")).collect()
    };
    let (free, pulled): (Vec<String>, Vec<String>) = (locked(1.05), locked(1.45));
    assert!(free.is_empty(), "{free:?}");
    assert!(pulled.len() == 1 && pulled[0].contains("panel 0, 100 % of it"), "{pulled:?}");
}

#[test]
fn sweeps_without_the_relaxed_mapping_are_refused() {
    for mapping in ["smooth", "frame"] {
        let why = said_of(1.0, &["--mapping", mapping, "--sweeps", "on"]).unwrap_err();
        assert!(why.contains("--sweeps on goes with --mapping relaxed"), "{why}");
        assert!(said_of(1.0, &["--mapping", mapping, "--sweeps", "off"]).is_ok());
    }
}

#[test]
fn a_cable_says_how_its_lengths_are_kept() {
    let flags = ["--wales-per-cm", "2", "--fabric", "cable"];
    let notes = |more: &[&str]| {
        let said = said_of(1.05, &[&flags[..], more].concat()).unwrap();
        said.into_iter().filter(|text| text.contains("repeat is too large")).collect::<Vec<_>>()
    };
    let (swept, unswept) = (notes(&[]), notes(&["--sweeps", "off"]));
    assert!(swept.len() == 1 && swept[0].contains("by being moved on the garment"), "{swept:?}");
    assert!(unswept.len() == 1 && unswept[0].contains("rubber"), "{unswept:?}");
}

#[test]
fn a_swatch_pulled_too_far_has_one_warning() {
    let folder = tempfile::tempdir().unwrap();
    let warnings = |stretch: &str| {
        let mut command = Command::cargo_bin("warpknit").unwrap();
        command.current_dir(&folder).args(["swatch", "--fabric", "jersey", "--stretch", stretch]);
        let output = command.args(["-o", "o.json"]).output().unwrap();
        let text = String::from_utf8(output.stderr).unwrap();
        std::fs::remove_file(folder.path().join("o.json")).unwrap();
        text.lines().filter(|line| line.starts_with("warning")).map(str::to_owned).collect()
    };
    let (free, locked): (Vec<String>, Vec<String>) = (warnings("1.1,1"), warnings("1.5,1.5"));
    assert!(free.is_empty(), "{free:?}");
    assert!(locked.len() == 1 && locked[0].contains("no loop can follow"), "{locked:?}");
}
