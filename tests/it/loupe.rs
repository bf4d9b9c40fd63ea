//! What is drawn unless something else is asked for: a garment at true gauge with a loupe, beside
//! files of enlarged cloth.

use std::path::Path;

use glam::{DVec2, DVec3};
use image::{Rgba, RgbaImage};
use serde_json::Value;

use crate::cli::{fails, warpknit};
use crate::far::sheet;

/// A bent sheet that fills the middle of its pictures, 120 mm wide: 109 000 stitches of tricot.
const PICTURE: [&str; 8] =
    ["drape", "sheet.obj", "--unit", "mm", "--renderer", "cpu", "--size", "600x300"];
/// Cloth of so few stitches would be swept if all of it goes into files.
const UNSWEPT: [&str; 2] = ["--sweeps", "off"];
/// A camera in front of it, whatever the picture's aspect.
const CAMERA: [&str; 4] = ["--eye", "60,60,400", "--look-at", "60,60,10"];
/// Side of the loupe's inset: 0.4 of the shorter side.
const INSET: u32 = 120;

/// Runs the command in a folder with the sheet. Returns what it said on stderr.
fn run(folder: &Path, arguments: &[&str]) -> String {
    std::fs::write(folder.join("sheet.obj"), sheet(DVec3::ZERO)).unwrap();
    let output = warpknit(folder).args(arguments).assert().success().get_output().clone();
    String::from_utf8(output.stderr).unwrap()
}

/// A picture of the sheet, and the report beside it.
fn drawn(folder: &Path, flags: &[&str]) -> (RgbaImage, Value) {
    let outputs = ["-o", "a.png", "-o", "a.json", "--quiet"];
    run(folder, &[&PICTURE[..], &UNSWEPT, &outputs, flags].concat());
    let picture = image::open(folder.join("a.png")).unwrap().into_rgba8();
    (picture, serde_json::from_slice(&std::fs::read(folder.join("a.json")).unwrap()).unwrap())
}

fn count(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn pictures_show_true_gauge_beside_files_that_other_programs_open() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // Hems of a sheet as small as this are half of its picture's stitches.
    let all = ["--edges", "raw", "-o", "a.png", "-o", "a.glb", "-o", "a.json"];
    let said = run(folder, &[&PICTURE[..], &all].concat());
    for words in [
        "note: a.png shows true gauge: about 110000 stitches and ",
        "; --enlarge auto draws about 12000 larger ones",
        "note: the loupe magnifies the place ",
        "note: a.glb and the report have about 12000 stitches in place of 110000, 3.0 times enlarged, so \
         that other programs can open them: about ",
        ", where true gauge would take ",
        "; --enlarge 1 keeps true gauge. For this the cloth is knitted a second time",
    ] {
        assert!(said.contains(words), "no `{words}` in: {said}");
    }
    let report: Value =
        serde_json::from_slice(&std::fs::read(folder.join("a.json")).unwrap()).unwrap();
    let (filed, pictured) = (&report, &report["picture"]);
    assert!((11_000.0..15_000.0).contains(&count(&filed["stitches"])), "{filed}");
    assert!((109_000.0..125_000.0).contains(&count(&pictured["stitches"])), "{pictured}");
    assert_eq!(
        (count(&pictured["wales_per_cm"]), count(&pictured["courses_per_cm"])),
        (15.0, 22.0)
    );
    assert!((count(&filed["wales_per_cm"]) - 15.0 / 3.01).abs() < 0.05);
    assert!(count(&pictured["loupe"]["times"]) > 4.0);
    assert!(report["garment"]["notes"].to_string().contains("shows true gauge"));
    let beside = std::fs::read(folder.join("a.glb")).unwrap();
    let picture = std::fs::read(folder.join("a.png")).unwrap();

    // The whole run enlarged has the same file, and another picture, and needs one cloth.
    let said = run(folder, &[&PICTURE[..], &all, &["--enlarge", "auto"]].concat());
    assert!(!said.contains("second time") && said.contains("3.0 times enlarged"), "{said}");
    assert!(std::fs::read(folder.join("a.glb")).unwrap() == beside);
    assert!(std::fs::read(folder.join("a.png")).unwrap() != picture);
}

#[test]
fn enlargements_and_densities_count_for_everything() {
    let folder = tempfile::tempdir().unwrap();
    for (flags, wales) in [
        (&["--enlarge", "6"][..], 2.5),
        (&["--enlarge", "1"], 15.0),
        (&["--wales-per-cm", "3"], 3.0),
    ] {
        let said = run(
            folder.path(),
            &[&of_sheet(&UNSWEPT)[..], &["-o", "a.png", "-o", "a.json", "--loupe", "off"], flags]
                .concat(),
        );
        assert!(!said.contains("note:"), "{said}");
        let report = std::fs::read(folder.path().join("a.json")).unwrap();
        let report: Value = serde_json::from_slice(&report).unwrap();
        assert!((count(&report["wales_per_cm"]) - wales).abs() < 1e-9);
        assert_eq!(report["wales_per_cm"], report["picture"]["wales_per_cm"]);
        assert!(report["picture"]["loupe"].is_null());
    }
}

/// Middle of the inset: that of the box around the pixels in which two pictures differ by much.
fn changed(one: &RgbaImage, other: &RgbaImage) -> Vec<DVec2> {
    let pixels = one.enumerate_pixels().zip(other.pixels());
    pixels
        .filter(|((.., a), b)| a != b)
        .map(|((x, y, _), _)| DVec2::new(f64::from(x), f64::from(y)) + 0.5)
        .collect()
}

#[test]
fn the_loupe_shows_the_loops_of_its_place_and_lies_on_the_background() {
    let folder = tempfile::tempdir().unwrap();
    let on_white = |loupe| [&CAMERA[..], &["--background", "white", "--loupe", loupe]].concat();
    let (with, report) = drawn(folder.path(), &on_white("0.5,0.5"));
    let (without, _) = drawn(folder.path(), &on_white("off"));
    let loupe = &report["picture"]["loupe"];
    assert_eq!(loupe["at"], serde_json::json!([0.5, 0.5]));

    // Beside the inset only the mark and the line to it are new.
    let changed = changed(&with, &without);
    let left = changed.iter().fold(f64::INFINITY, |least, at| least.min(at.x));
    let right = changed.iter().fold(0.0_f64, |most, at| most.max(at.x));
    let is_left = left < 140.0;
    assert!(is_left != (right > 460.0), "one side: {left} {right}");
    let radius = f64::from(INSET) / 2.0;
    let middle_x = if is_left { left + radius + 1.5 } else { right - radius - 1.5 };
    let column: Vec<f64> =
        changed.iter().filter(|at| (at.x - middle_x).abs() < 2.0).map(|at| at.y).collect();
    let low = column.iter().copied().fold(f64::INFINITY, f64::min);
    let high = column.iter().copied().fold(0.0, f64::max);
    let middle = DVec2::new(middle_x, low.midpoint(high)).round();
    let in_inset = |at: &DVec2| at.distance(middle) < radius + 4.0;
    let rest: Vec<_> = changed.iter().filter(|at| !in_inset(at)).collect();
    assert!(!rest.is_empty() && rest.len() < 1500, "{} pixels", rest.len());

    // It hides no cloth.
    let white = Rgba([255; 4]);
    let hidden = without.enumerate_pixels().filter(|(x, y, pixel)| {
        in_inset(&DVec2::new(f64::from(*x), f64::from(*y))) && **pixel != white
    });
    assert_eq!(hidden.count(), 0);

    // A picture of that place, so many times larger, is what the inset shows.
    let zoom = (300.0 * count(&loupe["times"]) / f64::from(INSET)).to_string();
    let size = format!("{INSET}x{INSET}");
    let near = [&on_white("off")[..], &["--size", &size, "--zoom", &zoom]].concat();
    let near = [&PICTURE[..6], &near, &["-o", "near.png", "--quiet"]].concat();
    run(folder.path(), &near);
    let near = image::open(folder.path().join("near.png")).unwrap().into_rgba8();
    let corner = middle - radius;
    let (mut sum, mut levels, mut pixels) = (0.0, 0.0, 0.0);
    for (x, y, expected) in near.enumerate_pixels() {
        let at = DVec2::new(f64::from(x), f64::from(y)) + 0.5;
        if at.distance(DVec2::splat(radius)) > radius - 4.0 {
            continue;
        }
        let there = (corner + at).as_uvec2();
        let found = with.get_pixel(there.x, there.y);
        sum += f64::from(found.0[0].abs_diff(expected.0[0]));
        levels += f64::from(expected.0[0].abs_diff(near.get_pixel(x, (y + 9) % INSET).0[0]));
        pixels += 1.0;
    }
    // The bar is that the same loops some pixels off would differ by much.
    assert!(sum / pixels < 1.0 && levels / pixels > 15.0, "{} {}", sum / pixels, levels / pixels);
}

#[test]
fn bands_of_a_picture_have_their_part_of_the_loupe() {
    let folder = tempfile::tempdir().unwrap();
    let flags = ["--enlarge", "2", "--loupe", "0.5,0.3"];
    let (whole, _) = drawn(folder.path(), &flags);
    let mut bands = Vec::new();
    for tile in ["1/3", "2/3", "3/3"] {
        bands.extend(drawn(folder.path(), &[&flags[..], &["--tile", tile]].concat()).0.into_raw());
    }
    assert!(bands == whole.into_raw());
}

#[test]
fn many_pictures_are_enlarged_and_have_no_loupe() {
    let folder = tempfile::tempdir().unwrap();
    let turned =
        ["--turntable", "2", "--size", "300x240", "--spp", "1", "-o", "t.png", "-o", "t.json"];
    let said = run(folder.path(), &[&PICTURE[..6], &turned].concat());
    assert!(said.contains("have about 12000 stitches in place of 110000"), "{said}");
    assert!(!said.contains("loupe") && !said.contains("second time"), "{said}");
    let report = std::fs::read(folder.path().join("t.json")).unwrap();
    let report: Value = serde_json::from_slice(&report).unwrap();
    assert_eq!(report["picture"]["wales_per_cm"], report["wales_per_cm"]);

    std::fs::copy(folder.path().join("sheet.obj"), folder.path().join("two.obj")).unwrap();
    let frames = ["drape", "sheet.obj", "sheet.obj", "two.obj", "--unit", "mm", "-o", "f.json"];
    let said = run(folder.path(), &frames);
    assert!(said.contains("the report has about 12000 stitches in place of 110000"), "{said}");

    let files = ["-o", "a.csv", "-o", "b.npz", "-o", "c.ply"];
    let said = run(folder.path(), &[&frames[..2], &["--unit", "mm"], &files].concat());
    assert!(said.contains("note: the files have about 12000 stitches in place of"), "{said}");
}

/// A picture of the sheet with more flags.
fn of_sheet<'a>(flags: &[&'a str]) -> Vec<&'a str> {
    [&PICTURE[..], flags].concat()
}

#[test]
fn what_makes_no_sense_is_one_line() {
    let write = |folder: &Path| {
        for name in ["sheet.obj", "two.obj"] {
            std::fs::write(folder.join(name), sheet(DVec3::ZERO)).unwrap();
        }
    };
    for (flags, words) in [
        (
            of_sheet(&["--loupe", "0.01,0.02", "-o", "a.png"]),
            "--loupe 0.01,0.02: the picture shows no cloth",
        ),
        (of_sheet(&["--loupe", "0.5,0.5", "-o", "a.glb"]), "--loupe is a part of a picture"),
        (
            of_sheet(&["--loupe", "0.5,0.5", "--turntable", "3", "-o", "a.png"]),
            "--loupe X,Y is for one picture",
        ),
        (
            vec!["drape", "sheet.obj", "sheet.obj", "two.obj", "--loupe", "0.5,0.5", "-o", "a.png"],
            "--loupe X,Y is for one picture",
        ),
        (of_sheet(&["--enlarge", "1e9", "-o", "a.png"]), "--enlarge 1000000000: "),
    ] {
        let said = fails(1, &flags, write);
        let errors: Vec<_> = said.lines().filter(|line| !line.starts_with("note: ")).collect();
        assert!(errors.len() == 1 && errors[0].starts_with("error: "), "{said}");
        assert!(errors[0].contains(words), "no `{words}` in: {said}");
    }
    for flags in [
        &["--loupe", "on"][..],
        &["--loupe", "400,300"],
        &["--loupe", "-0.1,0.5"],
        &["--enlarge", "0.5"],
        &["--enlarge", "much"],
        &["--enlarge", "2", "--wales-per-cm", "3"],
    ] {
        let said = fails(2, &of_sheet(flags), write);
        assert!(said.starts_with("error: "), "{flags:?}: {said}");
    }
    assert!(fails(2, &["swatch", "--loupe", "off"], write).contains("--loupe"));
}
