//! The set of pictures, from outside: studio, body, lining and sun.

use std::path::Path;

use image::RgbaImage;

use crate::cli::{fails, warpknit};
use crate::drape::mesh;

/// A picture of the tube in marquisette, enlarged, with these flags.
fn tube(flags: &[&str]) -> RgbaImage {
    let folder = tempfile::tempdir().unwrap();
    let garment = [mesh("tube_flat.obj"), mesh("tube_draped.obj")];
    let drape = ["--fabric", "marquisette", "--wales-per-cm", "1.5", "--mapping", "smooth"];
    let picture = ["--size", "120x90", "--loupe", "off", "--quiet", "-o", "tube.png"];
    let mut command = warpknit(folder.path());
    command.arg("drape").args(&garment).args(drape).args(picture).args(flags).assert().success();
    image::open(folder.path().join("tube.png")).unwrap().into_rgba8()
}

/// How many pixels two pictures differ in by over 8 of 255.
fn differing(one: &RgbaImage, other: &RgbaImage) -> usize {
    let is_other = |(a, b): (&image::Rgba<u8>, &image::Rgba<u8>)| {
        a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 8)
    };
    one.pixels().zip(other.pixels()).map(is_other).filter(|differs| *differs).count()
}

#[test]
fn a_garment_stands_in_a_studio_unless_a_background_or_nothing_is_wanted() {
    let corner = |flags: &[&str]| tube(flags).get_pixel(0, 0).0;
    let studio = corner(&[]);
    assert!(studio[..3].iter().all(|code| (90..250).contains(code)), "{studio:?}");
    assert_eq!(corner(&["--studio"]), studio);
    assert_eq!(corner(&["--studio", "off"]), [255; 4]);
    assert_eq!(corner(&["--background", "#102030"]), [16, 32, 48, 255]);
    assert_eq!(corner(&["--background", "transparent"]), [0; 4]);
    assert_eq!(corner(&["--background", "#102030", "--studio", "on"]), studio);
}

#[test]
fn a_swatch_has_a_studio_if_it_is_wanted() {
    let folder = tempfile::tempdir().unwrap();
    let corner = |flags: &[&str]| {
        let swatch = ["swatch", "--wales", "6", "--courses", "6", "--size", "60x60", "-o", "s.png"];
        warpknit(folder.path()).args(swatch).args(flags).assert().success();
        image::open(folder.path().join("s.png")).unwrap().into_rgba8().get_pixel(0, 0).0
    };
    assert_eq!(corner(&[]), [255; 4]);
    assert_ne!(corner(&["--studio"]), [255; 4]);
}

#[test]
fn a_body_and_a_lining_are_seen_through_sheer_cloth() {
    let body = mesh("tube_body.obj").display().to_string();
    let plain = tube(&["--studio", "off"]);
    for flags in [["--body", body.as_str()].as_slice(), &["--body-cloth"]] {
        let all = [flags, &["--studio", "off"]].concat();
        let differs = differing(&tube(&all), &plain);
        assert!(differs > 300, "{flags:?}: {differs} pixels");
    }
}

#[test]
fn a_body_has_the_unit_of_its_garment() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(mesh("tube_body.obj")).unwrap();
    let scaled: String = text
        .lines()
        .map(|line| match line.strip_prefix("v ") {
            Some(place) => {
                let place: Vec<String> = place
                    .split(' ')
                    .map(|number| format!("{:.6}", number.parse::<f64>().unwrap() * 10.0))
                    .collect();
                format!("v {}\n", place.join(" "))
            }
            None => format!("{line}\n"),
        })
        .collect();
    std::fs::write(folder.path().join("large.obj"), scaled).unwrap();
    let large = folder.path().join("large.obj").display().to_string();
    let body = mesh("tube_body.obj").display().to_string();
    let [own, larger] = [body, large].map(|path| tube(&["--body", &path, "--studio", "off"]));
    assert!(differing(&own, &larger) > 300, "a body ten times as large hides the cloth");
}

#[test]
fn the_sun_moves() {
    let [left, right] = ["-60,20", "60,20"].map(|sun| tube(&["--sun", sun]));
    assert!(differing(&left, &right) > 500);
}

/// One line of an error, after which nothing is left in the folder.
#[test]
fn bodies_that_cannot_be_read_are_one_line() {
    let [flat, draped] =
        ["tube_flat.obj", "tube_draped.obj"].map(|name| mesh(name).display().to_string());
    let run = |body: &str, prepare: &dyn Fn(&Path)| {
        fails(1, &["drape", &flat, &draped, "--body", body, "-o", "t.png"], prepare)
    };
    let said = run("nothere.obj", &|_| ());
    assert!(said.contains("nothere.obj: cannot be opened"), "{said}");
    for (text, words) in [
        ("", "is empty"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no face"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "b.obj:4"),
        ("v 0 0 0\nv 1e12 0 0\nv 0 1 0\nf 1 2 3\n", "km from the garment"),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "no area"),
    ] {
        let said =
            run("b.obj", &|folder: &Path| std::fs::write(folder.join("b.obj"), text).unwrap());
        assert!(said.lines().count() == 1 && said.contains(words), "{text:?}: {said}");
    }
}

#[test]
fn a_body_without_a_picture_is_noted() {
    let folder = tempfile::tempdir().unwrap();
    let garment = ["tube_flat.obj", "tube_draped.obj"].map(mesh);
    let mut command = warpknit(folder.path());
    command.arg("drape").args(&garment).arg("--body").arg(mesh("tube_body.obj"));
    let output = command.args(["--wales-per-cm", "1", "-o", "tube.npz"]).assert().success();
    let said = String::from_utf8(output.get_output().stderr.clone()).unwrap();
    assert!(said.contains("note: no .png is written: a body is for pictures"), "{said}");
}

/// A graphics card draws no bodies, and says so before it knits, whether there is one or not.
#[test]
fn a_body_by_a_graphics_card_is_refused() {
    let [flat, draped, body] = ["tube_flat.obj", "tube_draped.obj", "tube_body.obj"]
        .map(|name| mesh(name).display().to_string());
    let run = ["drape", &flat, &draped, "--body", &body, "--renderer", "gpu", "-o", "t.png"];
    let said = fails(1, &run, |_| ());
    assert!(said.contains("can't draw a body: take --renderer cpu"), "{said}");
}

#[test]
fn a_tile_of_a_studio_is_a_part_of_the_whole() {
    let whole = tube(&[]);
    let folder = tempfile::tempdir().unwrap();
    let garment = ["tube_flat.obj", "tube_draped.obj"].map(mesh);
    let drape = ["--fabric", "marquisette", "--wales-per-cm", "1.5", "--mapping", "smooth"];
    let picture = ["--size", "120x90", "--loupe", "off", "--quiet", "--tile", "2/3", "-o", "t.png"];
    warpknit(folder.path())
        .arg("drape")
        .args(&garment)
        .args(drape)
        .args(picture)
        .assert()
        .success();
    let tile = std::fs::read_dir(folder.path()).unwrap().find_map(|entry| {
        let path = entry.unwrap().path();
        path.extension().is_some_and(|ending| ending == "png").then_some(path)
    });
    let tile = image::open(tile.unwrap()).unwrap().into_rgba8();
    assert!(tile.as_raw()[..] == whole.as_raw()[120 * 30 * 4..120 * 60 * 4]);
}

#[test]
fn what_makes_no_set_is_wrong_usage() {
    for flags in [
        ["--sun", "40"].as_slice(),
        &["--sun", "0,100"],
        &["--sun", "a,b"],
        &["--studio", "maybe"],
        &["--body", "b.obj", "--body-cloth"],
    ] {
        let all = [&["drape", "a.obj"], flags].concat();
        fails(2, &all, |_| ());
    }
}

#[test]
fn bodies_of_a_sequence_are_one_or_as_many_as_its_frames() {
    let folder = tempfile::tempdir().unwrap();
    let frames = folder.path().join("frames");
    std::fs::create_dir_all(&frames).unwrap();
    for number in 1..=2 {
        std::fs::copy(mesh("tube_draped.obj"), frames.join(format!("{number}.obj"))).unwrap();
    }
    let flat = mesh("tube_flat.obj");
    let run = |body: &str| {
        let mut command = warpknit(folder.path());
        command.arg("drape").arg(&flat).arg("frames").args(["--size", "60x45", "--quiet"]);
        command.args(["--wales-per-cm", "1", "--mapping", "smooth", "--body", body, "-o", "f.png"]);
        command.assert()
    };
    let bodies = folder.path().join("bodies");
    std::fs::create_dir_all(&bodies).unwrap();
    for number in 1..=3 {
        std::fs::copy(mesh("tube_body.obj"), bodies.join(format!("{number}.obj"))).unwrap();
    }
    let output = run("bodies").code(1).get_output().clone();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("--body names 3 meshes and there are 2 drapes"), "{said}");
    std::fs::remove_file(bodies.join("3.obj")).unwrap();
    run("bodies").success();
    run(&mesh("tube_body.obj").display().to_string()).success();
}
