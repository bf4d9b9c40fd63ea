//! Sizes of files and memory are told before the work, and are true within a third.

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;

use crate::cli::warpknit;
use crate::far::sheet;

/// Formats whose size is told.
const ENDINGS: [&str; 9] = ["glb", "obj", "ply", "usda", "bcc", "curves.txt", "inp", "npz", "csv"];

/// What a run said on stderr.
fn said(folder: &Path, fabric: &str, arguments: &[&str]) -> String {
    std::fs::write(folder.join("sheet.obj"), sheet(DVec3::ZERO)).unwrap();
    let mut command = warpknit(folder);
    command.args(["drape", "sheet.obj", "--unit", "mm", "--fabric", fabric]).args(arguments);
    let output = command.assert().success().get_output().clone();
    String::from_utf8(output.stderr).unwrap()
}

/// The sizes of files in a note, bytes: "54 MB for a.glb, 1.2 GB for a.csv".
fn sizes(text: &str) -> BTreeMap<String, f64> {
    let size = |part: &str| {
        let (size, name) = part.trim().split_once(" for ").unwrap();
        let (number, unit) = size.rsplit_once(' ').unwrap();
        let scale = if unit == "GB" { 1e9 } else { 1e6 };
        (name.to_owned(), scale * number.parse::<f64>().unwrap())
    };
    text.split(", ").map(size).collect()
}

/// The parts of the note about files: their sizes as they are, and at true gauge.
fn told(said: &str) -> [BTreeMap<String, f64>; 2] {
    let (_, rest) = said.split_once(": about ").unwrap();
    let (now, rest) = rest.split_once(", where true gauge would take ").unwrap();
    let (full, _) = rest.split_once(';').unwrap();
    [sizes(now), sizes(full.trim_end_matches(", in parts by --tile"))]
}

/// Whether an estimate is true within a third.
fn is_near(told: f64, found: f64) -> bool {
    (told / found).ln().abs() < (4.0_f64 / 3.0).ln()
}

#[test]
fn sizes_of_files_are_told_and_true() {
    let folder = tempfile::tempdir().unwrap();
    let length = |name: &str| std::fs::metadata(folder.path().join(name)).unwrap().len() as f64;
    for fabric in ["tricot", "jersey", "marquisette"] {
        let names = ENDINGS.map(|ending| format!("a.{ending}"));
        let outputs: Vec<&str> = names.iter().flat_map(|name| ["-o", name]).collect();
        let [now, full] = told(&said(folder.path(), fabric, &outputs));
        for name in &names {
            assert!(
                is_near(now[name], length(name)),
                "{fabric} {name}: {} {}",
                now[name],
                length(name)
            );
        }
        // A smaller tube, so that the file of the whole cloth is soon written.
        let section = ["--st", "2", "--sr", "3", "-o", "b.ply", "-o", "b.csv"];
        let [_, coarse] = told(&said(folder.path(), fabric, &section));
        let all = ["--enlarge", "1", "--sweeps", "off"];
        said(folder.path(), fabric, &[&section[..], &all].concat());
        for name in ["b.ply", "b.csv"] {
            assert!(
                is_near(coarse[name], length(name)),
                "{fabric} {name}: {} {}",
                coarse[name],
                length(name)
            );
        }
        assert!(full["a.csv"] == coarse["b.csv"] && full["a.ply"] > 4.0 * coarse["b.ply"]);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn the_memory_of_a_picture_is_told_and_true() {
    use std::process::{Command, Stdio};

    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("sheet.obj"), sheet(DVec3::ZERO)).unwrap();
    for (fabric, flags) in [
        ("tricot", &["--size", "300x300"][..]),
        ("jersey", &["--size", "1200x900"]),
        ("locknit", &["--size", "1600x1200", "--zoom", "2"]),
    ] {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("warpknit"));
        command.current_dir(folder.path()).env("XDG_CACHE_HOME", crate::cache_home());
        command.args(["drape", "sheet.obj", "--unit", "mm", "--fabric", fabric, "-o", "a.png"]);
        command.args(["--renderer", "cpu"]).args(flags).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let (found, ends_well) = crate::memory::most_held(&mut child);
        let said = std::io::read_to_string(child.stderr.take().unwrap()).unwrap();
        assert!(ends_well, "{said}");
        let (before, _) = said.split_once(" MB of memory").unwrap();
        let (_, told) = before.rsplit_once(' ').unwrap();
        let (told, found) = (told.parse().unwrap(), found as f64 / 1e6);
        println!("{fabric}: {told} told, {found} found");
        assert!(is_near(told, found), "{fabric}: {told} told, {found} found");
    }
}
