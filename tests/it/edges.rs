//! Finished edges in pictures, from outside.

use std::path::Path;

use crate::cli::{fails, warpknit};
use crate::drape::mesh;

/// Files of the tube in marquisette, with these flags.
fn tube(folder: &Path, flags: &[&str]) {
    let garment = [mesh("tube_flat.obj"), mesh("tube_draped.obj")];
    let drape = ["--fabric", "marquisette", "--mapping", "smooth", "--size", "160x120", "--quiet"];
    warpknit(folder).arg("drape").args(&garment).args(drape).args(flags).assert().success();
}

#[test]
fn pictures_at_true_gauge_have_finished_edges_unless_they_are_to_be_raw() {
    let folder = tempfile::tempdir().unwrap();
    let picture = |name: &str, flags: &[&str]| {
        tube(folder.path(), &[&["--loupe", "off", "-o", name], flags].concat());
        std::fs::read(folder.path().join(name)).unwrap()
    };
    let unasked = picture("a.png", &[]);
    assert_eq!(unasked, picture("b.png", &["--edges", "hemmed"]));
    assert_ne!(unasked, picture("c.png", &["--edges", "raw"]));
    // Enlarged cloth has raw edges unless someone asks.
    let large = picture("d.png", &["--enlarge", "4"]);
    assert_eq!(large, picture("e.png", &["--enlarge", "4", "--edges", "raw"]));
    assert_ne!(large, picture("f.png", &["--enlarge", "4", "--edges", "hemmed"]));
}

#[test]
fn the_loupe_shows_the_thread_of_a_hem() {
    let folder = tempfile::tempdir().unwrap();
    // At the lower hem, where its stitches are.
    let at = ["--loupe", "0.5,0.93", "--size", "320x240", "-o", "a.png"];
    let inset = |edges: &str| {
        let garment = [mesh("tube_flat.obj"), mesh("tube_draped.obj")];
        let mut command = warpknit(folder.path());
        command.arg("drape").args(&garment).args(["--quiet", "--edges", edges]).args(at);
        command.assert().success();
        image::open(folder.path().join("a.png")).unwrap().into_rgba8()
    };
    assert_ne!(inset("hemmed"), inset("raw"));
}

#[test]
fn files_beside_pictures_have_raw_edges() {
    let folder = tempfile::tempdir().unwrap();
    let files = |edges: &str| {
        let flags = ["--enlarge", "6", "-o", "a.csv", "-o", "a.png", "--edges", edges];
        tube(folder.path(), &flags);
        ["a.csv", "a.png"].map(|name| std::fs::read(folder.path().join(name)).unwrap())
    };
    let [[hemmed, hemmed_picture], [raw, raw_picture]] = [files("hemmed"), files("raw")];
    assert_eq!(hemmed, raw);
    assert_ne!(hemmed_picture, raw_picture);
}

#[test]
fn each_picture_of_a_sequence_has_the_hems_of_its_drape() {
    let folder = tempfile::tempdir().unwrap();
    let [flat, draped] = ["tube_flat.obj", "tube_draped.obj"].map(mesh);
    // The second frame is the first one, pulled long.
    let long = folder.path().join("tube_long.obj");
    let text = std::fs::read_to_string(&draped).unwrap();
    let stretched = text.lines().map(|line| match line.strip_prefix("v ") {
        Some(place) => {
            let mut place: Vec<f64> =
                place.split_whitespace().map(|number| number.parse().unwrap()).collect();
            place[1] *= 1.25;
            format!("v {} {} {}\n", place[0], place[1], place[2])
        }
        None => format!("{line}\n"),
    });
    std::fs::write(&long, stretched.collect::<String>()).unwrap();
    let made = |edges: &str| {
        let mut command = warpknit(folder.path());
        command.arg("drape").args([&flat, &draped, &long]).args(["--fabric", "marquisette"]);
        command.args(["--enlarge", "6", "--mapping", "smooth", "--size", "160x120", "--quiet"]);
        command.args(["-o", "a.png", "-o", "a.csv", "-o", "a.json", "--edges", edges]);
        command.assert().success();
        let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
        let report: serde_json::Value = serde_json::from_slice(&read("a.json")).unwrap();
        let frames = report["frames"].as_array().unwrap().clone();
        (["a-001.png", "a-002.png", "a-001.csv", "a-002.csv"].map(read), frames.len())
    };
    let (hemmed, frames) = made("hemmed");
    let (raw, _) = made("raw");
    assert_eq!(frames, 2);
    for picture in 0..2 {
        assert_ne!(hemmed[picture], raw[picture]);
    }
    assert_ne!(hemmed[0], hemmed[1]);
    assert_eq!(hemmed[2..], raw[2..], "files have raw edges");
}

#[test]
fn a_file_of_a_sequence_that_cannot_be_written_is_refused_before_its_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let [flat, draped] = ["tube_flat.obj", "tube_draped.obj"].map(mesh);
    for file in ["nowhere/a.csv", "nowhere/a.usda", "nowhere/a.json"] {
        let mut command = warpknit(folder.path());
        command.arg("drape").args([&flat, &draped, &draped]);
        command.args(["--enlarge", "8", "--edges", "hemmed", "-o", "a.png", "-o", file]);
        let told = command.assert().code(1).get_output().stderr.clone();
        assert!(String::from_utf8_lossy(&told).contains("nowhere"), "{file}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "{file}");
    }
}

#[test]
fn hems_without_a_picture_are_refused() {
    let path = |name: &str| mesh(name).display().to_string();
    let (flat, draped) = (path("tube_flat.obj"), path("tube_draped.obj"));
    let arguments = ["drape", &flat, &draped, "--edges", "hemmed", "-o", "a.glb"];
    let told = fails(1, &arguments, |_| {});
    assert!(told.contains("--edges hemmed is for pictures"), "{told}");
}
