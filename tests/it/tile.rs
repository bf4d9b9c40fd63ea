//! Parts put together are the whole: files yarn by yarn, pictures row by row, for any number of
//! parts and of threads.

use std::path::Path;

use assert_cmd::Command;
use image::RgbaImage;
use serde_json::Value;
use warpknit::drape::{Cloth, DrapeOptions, MAX_SWEPT_STITCHES};
use warpknit::tile::Tile;

use crate::clearance::{coarse, skirt};
use crate::readback::{self, Mesh};

/// Knits a small garment; the first argument names the endings of what is written.
fn drape(folder: &Path, name: &str, arguments: &[&str]) {
    let meshes = Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes");
    let mut command = Command::cargo_bin("warpknit").unwrap();
    command.env("XDG_CACHE_HOME", crate::cache_home());
    command
        .current_dir(folder)
        .arg("drape")
        .arg(meshes.join("pinch_flat.obj"))
        .arg(meshes.join("pinch_draped.obj"));
    for ending in arguments[0].split(' ') {
        command.args(["-o", &format!("{name}.{ending}")]);
    }
    command.args(&arguments[1..]).arg("--quiet").assert().success().stderr("");
}

/// What a run wrote.
#[derive(Debug, Default, PartialEq)]
struct Files {
    rows: Vec<String>,
    meshes: [Mesh; 3],
}

impl Files {
    const ENDINGS: &'static str = "csv obj ply glb json";

    fn read(folder: &Path, name: &str) -> (Self, Value) {
        let at = |ending: &str| folder.join(format!("{name}.{ending}"));
        let rows = std::fs::read_to_string(at("csv"))
            .unwrap()
            .lines()
            .skip(1)
            .map(str::to_owned)
            .collect();
        let meshes =
            [readback::obj(&at("obj")), readback::ply(&at("ply")), readback::glb(&at("glb"))];
        (
            Self { rows, meshes },
            serde_json::from_slice(&std::fs::read(at("json")).unwrap()).unwrap(),
        )
    }

    fn append(&mut self, other: Self) {
        self.rows.extend(other.rows);
        self.meshes.iter_mut().zip(other.meshes).for_each(|(mesh, other)| mesh.append(other));
    }
}

#[test]
fn parts_of_the_yarns_are_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    // Floats and a node a yarn: the grid of 16 bits and the meshes of bars are those of each file.
    let exact = ["--glb-precision", "f32", "--nodes", "yarn"];
    let coarse = ["--wales-per-cm", "0.2", "--st", "3", "--sr", "4", "--caps"];
    let coarse = [&coarse[..], &exact[..]].concat();
    drape(folder.path(), "whole", &[&[Files::ENDINGS, "--threads", "2"], &coarse[..]].concat());
    let (whole, report) = Files::read(folder.path(), "whole");
    assert!(report["tile"].is_null() && !whole.rows.is_empty());
    let yarns = report["yarns"].as_u64().unwrap();
    for of in [1, 3, 7, yarns + 5] {
        let mut together = Files::default();
        let mut counts = [0; 4];
        let keys = ["yarns", "stitches", "data_points", "stitches_clipped"];
        for number in 1..=of {
            let (tile, threads) = (format!("{number}/{of}"), (1 + number % 3).to_string());
            drape(
                folder.path(),
                "part",
                &[&[Files::ENDINGS, "--tile", &tile, "--threads", &threads], &coarse[..]].concat(),
            );
            let (part, report) = Files::read(folder.path(), "part");
            assert_eq!(report["tile"], serde_json::json!([number, of]));
            assert_eq!(report["data_points"], part.rows.len());
            assert_eq!(report["surface"]["vertices"], part.meshes[0].positions.len());
            counts
                .iter_mut()
                .zip(keys)
                .for_each(|(count, key)| *count += report[key].as_u64().unwrap());
            together.append(part);
        }
        assert_eq!(counts, keys.map(|key| report[key].as_u64().unwrap()), "{of} parts");
        assert!(together == whole, "{of} parts");
    }
}

#[test]
fn parts_have_about_as_many_stitches() {
    let folder = tempfile::tempdir().unwrap();
    let stitches = |tile: &str| {
        drape(folder.path(), "part", &["json", "--tile", tile]);
        let report = std::fs::read(folder.path().join("part.json")).unwrap();
        serde_json::from_slice::<Value>(&report).unwrap()["stitches"].as_u64().unwrap()
    };
    let counts = [1, 2, 3].map(|number| stitches(&format!("{number}/3")));
    let (fewest, most) = (counts.iter().min().unwrap(), counts.iter().max().unwrap());
    assert!(most * 10 <= fewest * 11, "{counts:?}");
}

#[test]
fn a_part_is_swept_if_the_whole_is() {
    let garment = skirt();
    for (wales_per_cm, is_swept) in [(2.0, true), (8.0, false)] {
        let whole = Cloth::cover(&garment, &coarse("tricot", wales_per_cm)).unwrap();
        let part = whole.part(Tile::new(1, 9).unwrap());
        let options = DrapeOptions::default();
        assert_eq!(whole.swept_together(&options) > 0, is_swept);
        assert_eq!(part.swept_together(&options) > 0, is_swept);
        assert!(part.stitches() < MAX_SWEPT_STITCHES, "a part alone is small enough for sweeps");
        assert_eq!(part.whole_stitches(), whole.stitches());
    }
}

#[test]
fn bands_of_a_picture_are_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let picture = |name: &str, arguments: &[&str]| {
        drape(
            folder.path(),
            name,
            &[&["png", "--size", "25x19", "--wales-per-cm", "0.5"], arguments].concat(),
        );
        image::open(folder.path().join(format!("{name}.png"))).unwrap().into_rgba8()
    };
    let mut seen: Vec<RgbaImage> = Vec::new();
    for lod in ["on", "off"] {
        let whole = picture("whole", &["--lod", lod, "--renderer", "cpu", "--threads", "1"]);
        for of in [1, 2, 5, 19] {
            let band = |number: u32| {
                let (tile, threads) = (format!("{number}/{of}"), (1 + number % 3).to_string());
                picture("band", &["--lod", lod, "--tile", &tile, "--threads", &threads]).into_raw()
            };
            // Of the many bands of one row a few will do, the first and the last among them.
            let numbers: Vec<u32> = if of == 19 { vec![1, 2, 9, 19] } else { (1..=of).collect() };
            let bands: Vec<_> = numbers.iter().map(|&number| band(number)).collect();
            if of == 19 {
                let rows: Vec<_> = whole.as_raw().chunks(4 * 25).collect();
                assert!(
                    numbers
                        .iter()
                        .zip(bands)
                        .all(|(&number, band)| rows[number as usize - 1] == band),
                    "--lod {lod}"
                );
            } else {
                assert!(bands.concat() == *whole.as_raw(), "--lod {lod}, {of} bands");
            }
        }
        seen.push(whole);
    }
    assert!(seen[0] != seen[1], "drawn as far, and traced as near");
}

#[test]
fn what_names_no_part_is_wrong_usage() {
    let refused = |arguments: &[&str], code: i32| {
        let mut command = Command::cargo_bin("warpknit").unwrap();
        command.env("XDG_CACHE_HOME", crate::cache_home());
        let assert = command.arg("swatch").args(arguments).assert().code(code).stdout("");
        String::from_utf8(assert.get_output().stderr.clone()).unwrap()
    };
    for tile in ["3", "a/b", "1/0", "-1/2"] {
        let message = refused(&[&format!("--tile={tile}")], 2);
        assert!(message.contains("write it as 2/3"), "{message}");
    }
    for tile in ["0/3", "4/3"] {
        let message = refused(&["--tile", tile], 2);
        assert!(message.contains("counted from 1 to 3"), "{message}");
    }
    let message = refused(&["--tile", "9/9", "--size", "8x8"], 1);
    assert!(message.contains("a picture of 8 rows can't be cut into 9 parts"), "{message}");
}
