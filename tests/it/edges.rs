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
fn hems_without_a_picture_and_of_many_drapes_are_refused() {
    let path = |name: &str| mesh(name).display().to_string();
    let (flat, draped) = (path("tube_flat.obj"), path("tube_draped.obj"));
    let hemmed = ["--edges", "hemmed", "-o"];
    for (meshes, output, error) in [
        (vec![&*flat, &*draped], "a.glb", "--edges hemmed is for pictures"),
        (vec![&*flat, &*draped, &*draped], "a.png", "--edges hemmed is for one drape"),
    ] {
        let arguments = [&["drape"], &*meshes, &hemmed, &[output]].concat();
        let told = fails(1, &arguments, |_| {});
        assert!(told.contains(error), "{told}");
    }
}
