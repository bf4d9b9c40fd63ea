//! Drape sequences: every frame is what a run of its own would give, bad ones are named, and real
//! ones are read.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use glam::DVec3;
use serde_json::Value;

fn mesh(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes").join(name)
}

/// A file of the shipped garment draped otherwise: its positions moved.
fn moved(folder: &Path, name: &str, place: impl Fn(DVec3) -> DVec3) {
    let mut text = String::new();
    for line in std::fs::read_to_string(mesh("pinch_draped.obj")).unwrap().lines() {
        match line.strip_prefix("v ") {
            Some(numbers) => {
                let numbers: Vec<f64> =
                    numbers.split_whitespace().map(|word| word.parse().unwrap()).collect();
                let DVec3 { x, y, z } = place(DVec3::from_slice(&numbers));
                writeln!(text, "v {x} {y} {z}").unwrap();
            }
            None => writeln!(text, "{line}").unwrap(),
        }
    }
    std::fs::write(folder.join(name), text).unwrap();
}

/// Three frames: as shipped, stretched, and moved away and bent.
fn frames(folder: &Path) -> PathBuf {
    let frames = folder.join("frames");
    std::fs::create_dir(&frames).unwrap();
    moved(&frames, "f_8.obj", |p| p);
    moved(&frames, "f_9.obj", |p| p * DVec3::new(1.2, 0.9, 1.0));
    moved(&frames, "f_10.obj", |p| p + DVec3::new(0.05 * p.y * p.y / 100.0 + 3.0, 0.0, 0.0));
    frames
}

fn drape(folder: &Path, arguments: &[&str]) -> Assert {
    let mut command = Command::cargo_bin("warpknit").unwrap();
    command.env("XDG_CACHE_HOME", crate::cache_home());
    command
        .current_dir(folder)
        .arg("drape")
        .args(arguments)
        .args(["--wales-per-cm", "0.5", "--st", "3", "--sr", "4"])
        .assert()
}

fn read(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn report(folder: &Path, name: &str) -> Value {
    serde_json::from_slice(&read(folder, name)).unwrap()
}

#[test]
fn each_frame_is_what_a_run_of_its_own_gives() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, flat) = (folder.path(), mesh("pinch_flat.obj"));
    frames(folder);
    let flat = flat.to_str().unwrap();
    let outputs = |name: &str| {
        ["csv", "glb", "npz", "obj", "curves.txt"].map(|ending| format!("{name}.{ending}"))
    };
    let flags = |name: &str| {
        outputs(name).into_iter().flat_map(|path| ["-o".to_owned(), path]).collect::<Vec<_>>()
    };
    let together = flags("a");
    let together: Vec<_> = [flat, "frames", "--unit", "cm", "--uv-scale", "10", "-o", "a.json"]
        .into_iter()
        .chain(together.iter().map(String::as_str))
        .collect();
    drape(folder, &together).success();
    for (number, frame) in ["f_8", "f_9", "f_10"].into_iter().enumerate() {
        let (alone, path) = (flags("b"), format!("frames/{frame}.obj"));
        let alone: Vec<_> = [flat, &path, "--unit", "cm", "--uv-scale", "10", "-o", "b.json"]
            .into_iter()
            .chain(alone.iter().map(String::as_str))
            .collect();
        drape(folder, &alone).success();
        let numbered = format!("a-{:03}", number + 1);
        for (a, b) in outputs(&numbered).iter().zip(outputs("b")) {
            let (a_bytes, b_bytes) = (read(folder, a), read(folder, &b));
            // The text names its materials' file.
            let text = |bytes: &[u8]| {
                String::from_utf8_lossy(bytes).replace(&format!("{numbered}.mtl"), "b.mtl")
            };
            assert!(a_bytes == b_bytes || text(&a_bytes) == text(&b_bytes), "{a} is not {b}");
        }
        let (told, alone) = (&report(folder, "a.json")["frames"][number], report(folder, "b.json"));
        assert_eq!(told["stretch_weft"], alone["cloth"]["stretch_weft"]);
        assert!(
            told["skipped"].is_null()
                && told["file"].as_str().unwrap().ends_with(&format!("{frame}.obj"))
        );
    }
    assert!(!folder.join("a.csv").exists() && !folder.join("a-004.csv").exists());
}

/// The numbers of each time sample of a prim's points.
fn samples(usda: &str) -> Vec<(u32, Vec<f64>)> {
    let block =
        usda.split("points.timeSamples = {").nth(1).unwrap().split("        }\n").next().unwrap();
    let sample = |line: &str| {
        let (code, values) = line.trim().split_once(": ").unwrap();
        let numbers = values.split(|c: char| "[](), ".contains(c)).filter(|word| !word.is_empty());
        (code.parse().unwrap(), numbers.map(|word| word.parse().unwrap()).collect())
    };
    block.lines().filter(|line| line.contains(": [")).map(sample).collect()
}

#[test]
fn a_usda_holds_all_frames_and_a_bad_one_is_left_out_by_choice() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, flat) = (folder.path(), mesh("pinch_flat.obj"));
    frames(folder);
    let flat = flat.to_str().unwrap();
    drape(folder, &[flat, "frames/f_*.obj", "-o", "whole.usda", "--fps", "30"]).success();
    let whole = String::from_utf8(read(folder, "whole.usda")).unwrap();
    assert!(
        whole.contains("startTimeCode = 1\n    endTimeCode = 3\n    timeCodesPerSecond = 30\n")
    );
    let all = samples(&whole);
    assert_eq!(all.iter().map(|(code, _)| *code).collect::<Vec<_>>(), [1, 2, 3]);
    // A run of one frame has the same points.
    drape(folder, &[flat, "frames/f_9.obj", "-o", "one.usda"]).success();
    let one = String::from_utf8(read(folder, "one.usda")).unwrap();
    let points = one.split("point3f[] points = [").nth(1).unwrap().split(']').next().unwrap();
    let points: Vec<f64> = points
        .split(|c: char| "(), ".contains(c))
        .filter(|word| !word.is_empty())
        .map(|word| word.parse().unwrap())
        .collect();
    assert_eq!(all[1].1, points);

    let text = std::fs::read_to_string(folder.join("frames/f_9.obj")).unwrap();
    std::fs::write(folder.join("frames/f_9.obj"), &text[..text.len() / 2]).unwrap();
    let failed = drape(folder, &[flat, "frames", "-o", "bad.usda", "-o", "bad.csv"]).code(1);
    let told = String::from_utf8_lossy(&failed.get_output().stderr).into_owned();
    assert!(told.contains("error: ") && told.contains("f_9.obj"), "{told}");
    assert!(
        !folder.join("bad.usda").exists() && folder.join("bad-001.csv").exists(),
        "what was whole stays"
    );

    let passed = drape(
        folder,
        &[flat, "frames", "--skip-bad-frames", "-o", "bad.usda", "-o", "bad.csv", "-o", "bad.json"],
    )
    .success();
    let told = String::from_utf8_lossy(&passed.get_output().stderr).into_owned();
    assert!(
        told.contains("left out: ") && told.contains("f_9.obj") && told.contains("2 of 3 frames"),
        "{told}"
    );
    let bad = String::from_utf8(read(folder, "bad.usda")).unwrap();
    assert_eq!(samples(&bad), [all[0].clone(), all[2].clone()]);
    assert!(folder.join("bad-003.csv").exists() && !folder.join("bad-002.csv").exists());
    let report = report(folder, "bad.json");
    assert!(
        report["frames"][1]["skipped"].as_str().unwrap().contains("f_9.obj")
            && report["frames"][2]["skipped"].is_null()
    );

    // A bad first frame too.
    std::fs::write(folder.join("frames/f_8.obj"), "").unwrap();
    drape(folder, &[flat, "frames", "-o", "none.csv"]).code(1);
    drape(folder, &[flat, "frames", "--skip-bad-frames", "-o", "last.usda"]).success();
    assert_eq!(samples(&String::from_utf8(read(folder, "last.usda")).unwrap()), [all[2].clone()]);
}

#[test]
fn the_camera_stays_while_the_cloth_moves() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, flat) = (folder.path(), mesh("pinch_flat.obj"));
    moved(folder, "1.obj", |p| p);
    moved(folder, "2.obj", |p| p + DVec3::new(40.0, 0.0, 0.0));
    let picture = ["-o", "p.png", "--size", "96x72", "--spp", "1", "--renderer", "cpu"];
    let picture = [&picture[..], &["--background", "white"]].concat();
    drape(
        folder,
        &[&[flat.to_str().unwrap(), "1.obj", "2.obj", "--unit", "cm"][..], &picture].concat(),
    )
    .success();
    let columns = |name: &str| {
        let picture = image::load_from_memory(&read(folder, name)).unwrap().into_rgb8();
        let drawn = |x: &u32| {
            (0..picture.height())
                .any(|y| picture.get_pixel(*x, y).0.iter().any(|&level| level < 200))
        };
        let mut drawn = (0..picture.width()).filter(drawn);
        (drawn.next().unwrap(), drawn.next_back().unwrap())
    };
    let (first, second) = (columns("p-001.png"), columns("p-002.png"));
    assert!(first.0 + 4 < second.0 && first.1 + 4 < second.1, "{first:?} {second:?}");
    assert!(second.1 < 95 && first.0 > 0, "both are seen whole: {first:?} {second:?}");
}

#[test]
fn what_makes_no_sense_with_a_sequence_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (folder, flat) = (folder.path(), mesh("pinch_flat.obj"));
    moved(folder, "1.obj", |p| p);
    moved(folder, "a-002.obj", |p| p);
    let told = |arguments: &[&str]| {
        let failed = drape(
            folder,
            &[&[flat.to_str().unwrap(), "1.obj", "a-002.obj"][..], arguments].concat(),
        )
        .code(1);
        String::from_utf8_lossy(&failed.get_output().stderr).into_owned()
    };
    assert!(told(&["--turntable", "3", "-o", "a.png"]).contains("--turntable"));
    assert!(told(&["--tile", "1/2", "-o", "a.csv"]).contains("--tile"));
    assert!(told(&["-o", "a.obj"]).contains("a-002.obj: this file is an input"));
    assert_eq!(std::fs::read_dir(folder).unwrap().count(), 2);
}

fn real(name: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/garments").join(name);
    if !folder.is_dir() {
        println!("skipped: {} is not there", folder.display());
        return None;
    }
    Some(folder)
}

#[test]
fn real_sequences_are_read() {
    // A knit sheet of 60 frames, every seventh of them here; and the same without vt but in the
    // first, in centimetres but for the first.
    if let Some(sheet) = real("madypg_seq/rib_stretchX") {
        let folder = tempfile::tempdir().unwrap();
        drape(folder.path(), &[sheet.to_str().unwrap(), "-o", "a.csv", "-o", "a.json"]).success();
        let frames = report(folder.path(), "a.json")["frames"].as_array().unwrap().clone();
        assert_eq!(frames.len(), 10);
        let median = |frame: &Value| frame["stretch_weft"][1].as_f64().unwrap();
        assert!(
            (median(&frames[0]) - 1.0).abs() < 1e-6 && median(&frames[9]) > 1.5,
            "it is pulled along x"
        );

        let stripped = folder.path().join("stripped");
        std::fs::create_dir(&stripped).unwrap();
        for (number, name) in
            ["frame_0000.obj", "frame_0007.obj", "frame_0059.obj"].into_iter().enumerate()
        {
            let text = std::fs::read_to_string(sheet.join(name)).unwrap();
            let line = |line: &str| match line.split_once(' ') {
                Some(("v", numbers)) if number > 0 => {
                    let scaled = numbers
                        .split_whitespace()
                        .map(|word| (100.0 * word.parse::<f64>().unwrap()).to_string());
                    format!("v {}\n", scaled.collect::<Vec<_>>().join(" "))
                }
                Some(("vt", _)) if number > 0 => String::new(),
                Some(("f", corners)) if number > 0 => {
                    let bare =
                        corners.split_whitespace().map(|corner| corner.split('/').next().unwrap());
                    format!("f {}\n", bare.collect::<Vec<_>>().join(" "))
                }
                _ => format!("{line}\n"),
            };
            std::fs::write(stripped.join(name), text.lines().map(line).collect::<String>())
                .unwrap();
        }
        let told = drape(folder.path(), &["stripped", "-o", "b.csv"]).success();
        assert!(
            String::from_utf8_lossy(&told.get_output().stderr)
                .contains("frame_0059.obj: taken to be in cm")
        );
        let positions = |name: &str| -> Vec<f64> {
            let rows = String::from_utf8(read(folder.path(), name)).unwrap();
            rows.lines()
                .skip(1)
                .flat_map(|row| {
                    row.split(',')
                        .skip(11)
                        .take(3)
                        .map(|number| number.parse().unwrap())
                        .collect::<Vec<f64>>()
                })
                .collect()
        };
        let (a, b) = (positions("a-010.csv"), positions("b-003.csv"));
        assert_eq!(a.len(), b.len());
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-6));
    }
    if let Some(square) = real("madypg_seq/sx_quad") {
        let folder = tempfile::tempdir().unwrap();
        drape(folder.path(), &[square.to_str().unwrap(), "-o", "q.usda"]).success();
        assert_eq!(samples(&String::from_utf8(read(folder.path(), "q.usda")).unwrap()).len(), 12);
    }
    // At rest on the body, with vt; its frames have none.
    if let Some(shirt) = real("diffcloth_nasty") {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["tshirt1000-tri.obj", "1.obj", "50.obj", "250.obj"]
            .map(|name| shirt.join(name).to_str().unwrap().to_owned());
        let told = drape(
            folder.path(),
            &[&paths.iter().map(String::as_str).collect::<Vec<_>>()[..], &["-o", "t.csv"]].concat(),
        )
        .success();
        assert!(
            String::from_utf8_lossy(&told.get_output().stderr)
                .contains("does not lie flat: its vt")
        );
        assert!(folder.path().join("t-003.csv").exists());
    }
}
