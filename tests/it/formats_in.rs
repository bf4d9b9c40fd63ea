//! Garments in other formats than OBJ: files that Blender 5.0.1 wrote (`tests/garments`, made by
//! `tests/readers/garments.py`) hold what the same cloth holds as OBJ, and damaged ones are refused.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use proptest::prelude::*;
use warpknit::garment::{Frames, Garment, GarmentError, ReadOptions, Unit, moments, read};

/// Squares of the cloth across and along.
const SQUARES: [usize; 2] = [12, 8];
const FILES: [&str; 8] = [
    "blender.glb",
    "blender.ply",
    "blender.usda",
    "blender.usdc",
    "blender.usdz",
    "blender_y_up.usdc",
    "blender_shape_keys.usdc",
    "blender_moving.usdc",
];

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/garments").join(name)
}

/// The same, where the cloth stands as in the other files.
fn still(name: &str) -> PathBuf {
    let path = file(name).into_os_string();
    if name == "blender_moving.usdc" {
        [path, "@1".into()].into_iter().collect::<OsString>().into()
    } else {
        path.into()
    }
}

fn read_alone(path: &Path) -> Result<Garment, GarmentError> {
    read(path, None, &ReadOptions::default())
}

/// The cloth as OBJ, in metres. Its numbers are ones that 32 bits hold.
fn obj() -> String {
    let [across, along] = SQUARES.map(|squares| squares as f64);
    let fine = |place: f64| (place * 4096.0).round_ties_even() / 4096.0;
    let (mut places, mut pattern, mut faces) = (String::new(), String::new(), String::new());
    for row in 0..=SQUARES[1] {
        for column in 0..=SQUARES[0] {
            let (x, y) = (column as f64 / across * 0.5, row as f64 / along);
            let (right, back) = (0.25 * (2.0 * x - 0.5).sin(), 0.06 * (3.0 * x).cos());
            let (right, up, back) = (fine(right), 1.0 + fine(y * 0.375), -fine(back));
            places += &format!("v {right} {up} {back}\n");
            let [u, v] = [column as f64 / across * 1024.0, y * 768.0]
                .map(|place| place.round_ties_even() / 1024.0);
            pattern += &format!("vt {u} {v}\n");
            if row < SQUARES[1] && column < SQUARES[0] {
                let a = row * (SQUARES[0] + 1) + column + 1;
                let [b, c, d] = [a + 1, a + SQUARES[0] + 2, a + SQUARES[0] + 1];
                faces += &format!("f {a}/{a} {b}/{b} {c}/{c}\nf {a}/{a} {c}/{c} {d}/{d}\n");
            }
        }
    }
    places + &pattern + &faces
}

/// The points of a garment's yarns as the command writes them.
fn yarns(folder: &Path, garment: &Path) -> Vec<f64> {
    let mut command = assert_cmd::Command::cargo_bin("warpknit").unwrap();
    command
        .env("XDG_CACHE_HOME", crate::cache_home())
        .current_dir(folder)
        .arg("drape")
        .arg(garment);
    // Formats differ in meshes alone, which every mapping shows; this one is fast.
    command.args(["--wales-per-cm", "2", "--mapping", "smooth", "--quiet", "-o", "yarns.csv"]);
    command.assert().success();
    let text = std::fs::read_to_string(folder.join("yarns.csv")).unwrap();
    text.split(['\n', ',']).filter_map(|number| number.parse().ok()).collect()
}

#[test]
fn the_same_cloth_has_the_same_yarns_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloth.obj");
    std::fs::write(&path, obj()).unwrap();
    let expected = read_alone(&path).unwrap();
    let expected_yarns = yarns(folder.path(), &path);
    assert!(expected_yarns.len() > 10_000);
    for name in FILES {
        let garment = read_alone(&file(name)).unwrap();
        assert_eq!((garment.summary.unit, garment.panels.len()), ("m", 1), "{name}");
        let (own, other) = (&garment.panels[0], &expected.panels[0]);
        assert_eq!((&own.uv, &own.triangles), (&other.uv, &other.triangles), "{name}");
        let off = own.draped.iter().zip(&other.draped).map(|(a, b)| a.distance(*b));
        assert!(off.fold(0.0, f64::max) < 1e-9, "{name}");
        let yarns = yarns(folder.path(), &still(name));
        assert_eq!(yarns.len(), expected_yarns.len(), "{name}");
        let off = yarns.iter().zip(&expected_yarns).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) <= 1e-6, "{name}");
    }
}

#[cfg(unix)]
#[test]
fn a_garment_may_come_through_a_pipe() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for name in ["blender.glb", "blender.usdc"] {
        let mut command = assert_cmd::Command::cargo_bin("warpknit").unwrap();
        command.env("XDG_CACHE_HOME", crate::cache_home()).current_dir(folder);
        command.args(["drape", "/dev/stdin", "--wales-per-cm", "2", "--mapping", "smooth"]);
        command.args(["--quiet", "-o", "yarns.csv"]);
        command.write_stdin(std::fs::read(file(name)).unwrap()).assert().success();
        let piped = std::fs::read(folder.join("yarns.csv")).unwrap();
        yarns(folder, &file(name));
        assert_eq!(piped, std::fs::read(folder.join("yarns.csv")).unwrap(), "{name}");
    }
}

#[test]
fn a_flat_and_a_draped_file_may_be_of_different_formats_and_frames_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloth.obj");
    std::fs::write(&path, obj()).unwrap();
    let options = ReadOptions { unit: Some(Unit::M), ..ReadOptions::default() };
    let pair = read(&path, Some(&file("blender.usdc")), &options).unwrap();
    let alone = read_alone(&path).unwrap();
    assert_eq!(pair.panels[0].triangles.len(), alone.panels[0].triangles.len());
    let (mut garment, frames) = Frames::read(&path, None, &options).unwrap();
    for name in FILES {
        frames.pose(&mut garment, &file(name)).unwrap();
        let off = garment.panels[0].draped.iter().zip(&alone.panels[0].draped);
        assert!(off.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max) < 1e-9, "{name}");
    }
}

#[test]
fn a_usd_file_that_moves_is_a_sequence() {
    let moving = file("blender_moving.usdc");
    let frames = moments(&moving);
    let names = ["@1", "@2", "@3"].map(|time| format!("{}{time}", moving.display()));
    assert_eq!(frames, names.map(PathBuf::from));
    for still in ["blender.usda", "blender.glb", "none.usdc"] {
        assert_eq!(moments(&file(still)), [file(still)]);
    }
    let first = read_alone(&moving).unwrap();
    // It moves by a quarter of a metre in the end, at 1.5 by a part of that between two frames.
    let moved = |time: &str| {
        let path = PathBuf::from(format!("{}@{time}", moving.display()));
        let garment = read_alone(&path).unwrap();
        let pairs = garment.panels[0].draped.iter().zip(&first.panels[0].draped);
        let steps: Vec<_> = pairs.map(|(now, then)| (*now - *then).length()).collect();
        assert!(steps.iter().all(|step| (step - steps[0]).abs() < 1e-3), "{time}");
        steps[0]
    };
    assert_eq!((moved("0"), moved("1")), (0.0, 0.0));
    let whole = moved("3");
    assert!((whole - 250.0).abs() < 1e-3 && moved("99") == whole);
    assert!((moved("1.5") - 0.5 * moved("2")).abs() < 1e-6);

    let folder = tempfile::tempdir().unwrap();
    let mut command = assert_cmd::Command::cargo_bin("warpknit").unwrap();
    command.env("XDG_CACHE_HOME", crate::cache_home()).current_dir(folder.path());
    let drape = ["--wales-per-cm", "2", "--mapping", "smooth", "--quiet", "-o", "yarns.csv"];
    command.arg("drape").arg(&moving).args(drape).assert().success();
    for number in 1..=3 {
        assert!(folder.path().join(format!("yarns-00{number}.csv")).exists());
    }
    std::fs::write(folder.path().join("cloth.obj"), obj()).unwrap();
    let message = read_alone(&folder.path().join("cloth.obj@1")).unwrap_err().to_string();
    assert!(message.contains("only USD files have times"), "{message}");
}

/// What GarmentCode writes: panels one after the other, whose `vt` are shrunk into the unit square by a
/// factor of its own along each axis, and a JSON with the panels' outlines in cm.
#[test]
fn a_pattern_of_garmentcode_gives_its_obj_names_and_sizes() {
    let folder = tempfile::tempdir().unwrap();
    let sizes = [("sleeve", [20.0, 30.0]), ("front", [50.0, 60.0])];
    let (mut mesh, mut faces, mut panels) = (String::new(), String::new(), Vec::new());
    for (number, (name, [wide, high])) in sizes.into_iter().enumerate() {
        for [x, y] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
            let [x, y] = [x * wide, y * high];
            // 2 m by 1 m are the unit square.
            mesh += &format!("v {x} {y} {}\n", 40 * number);
            mesh += &format!("vt {} {}\n", (x + 100.0 * number as f64) / 200.0, y / 100.0);
        }
        let a = 4 * number + 1;
        let [b, c, d] = [a + 1, a + 2, a + 3];
        faces += &format!("f {a}/{a} {b}/{b} {c}/{c}\nf {a}/{a} {c}/{c} {d}/{d}\n");
        let edges = (0..4).map(|edge| format!("{{\"endpoints\":[{edge},{}]}}", (edge + 1) % 4));
        panels.push(format!(
            "\"{name}\":{{\"vertices\":[[0,0],[{wide},0],[{wide},{high}],[0,{high}]],\
             \"edges\":[{}]}}",
            edges.collect::<Vec<_>>().join(",")
        ));
    }
    let json = format!("{{\"pattern\":{{\"panels\":{{{}}}}}}}", panels.join(","));
    let [pattern, mesh_file] =
        ["a_specification.json", "a_sim.obj"].map(|name| folder.path().join(name));
    std::fs::write(&pattern, json).unwrap();
    std::fs::write(&mesh_file, mesh + &faces).unwrap();
    let garment = read(&pattern, Some(&mesh_file), &ReadOptions::default()).unwrap();
    let own: Vec<_> = garment.summary.panels.iter().map(|own| own.name.as_deref()).collect();
    assert_eq!(own, [Some("sleeve"), Some("front")]);
    for (panel, (_, [wide, high])) in garment.panels.iter().zip(sizes) {
        assert!((panel.size() - glam::DVec2::new(10.0 * wide, 10.0 * high)).length() < 1e-6);
    }
    // Without the pattern it is wider than high.
    let alone = read_alone(&mesh_file).unwrap();
    assert!(alone.panels[1].size().x < 0.5 * alone.panels[1].size().y);
    let refused = read_alone(&pattern).unwrap_err().to_string();
    assert!(refused.contains("give its OBJ behind it"), "{refused}");
    let other = read(&pattern, Some(&file("blender.glb")), &ReadOptions::default());
    assert!(
        other.unwrap_err().to_string().contains("1 pieces in its vt, and the pattern 2 panels")
    );

    let mut command = assert_cmd::Command::cargo_bin("warpknit").unwrap();
    command.env("XDG_CACHE_HOME", crate::cache_home()).current_dir(folder.path());
    command.args(["drape", "a_specification.json", "a_sim.obj", "--wales-per-cm", "2", "--quiet"]);
    command.args(["-o", "report.json"]).assert().success();
    let report = std::fs::read_to_string(folder.path().join("report.json")).unwrap();
    assert!(report.contains("\"name\": \"front\""), "{report}");
}

/// One line that names the file, or a garment.
fn is_read_or_refused(path: &Path) {
    if let Err(error) = read_alone(path) {
        let text = error.to_string();
        assert!(text.contains("damaged") && !text.contains(['\n', '\r']), "{text}");
    }
}

#[test]
fn a_file_cut_anywhere_reads_or_says_why_not() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged");
    for name in FILES {
        let bytes = std::fs::read(file(name)).unwrap();
        for end in (0..bytes.len()).step_by(37) {
            std::fs::write(&path, &bytes[..end]).unwrap();
            is_read_or_refused(&path);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn a_file_with_wrong_bytes_reads_or_says_why_not(
        name in prop::sample::select(&FILES[..]),
        wrong in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        near_end in any::<bool>(),
    ) {
        let mut bytes = std::fs::read(file(name)).unwrap();
        // The sections of a crate file are at its end, and the text of glTF at its start.
        let range = if near_end { bytes.len() * 3 / 4..bytes.len() } else { 0..bytes.len() };
        for (place, byte) in wrong {
            bytes[range.start + place.index(range.len())] = byte;
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("damaged");
        std::fs::write(&path, bytes).unwrap();
        is_read_or_refused(&path);
    }
}
