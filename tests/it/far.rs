//! A garment far from the origin: its picture and its `.glb` are those of the same garment at home.

use std::fmt::Write as _;
use std::path::Path;

use glam::{DVec3, Vec3};
use serde_json::Value;

/// Where the garment is moved to, mm.
const FAR: DVec3 = DVec3::new(1e6, -1e6, 3e5);

/// A bent sheet of 120 mm, moved.
pub(crate) fn sheet(at: DVec3) -> String {
    let mut text = String::new();
    for (x, y) in (0..49).map(|i| (f64::from(i % 7), f64::from(i / 7))) {
        let p = at + DVec3::new(20.0 * x, 20.0 * y, 4.0 * (x - 3.0) * (x - 3.0));
        writeln!(text, "v {} {} {}\nvt {x} {y}", p.x, p.y, p.z).unwrap();
    }
    for a in (0..36).map(|i| i / 6 * 7 + i % 6 + 1) {
        writeln!(text, "f {a}/{a} {0}/{0} {1}/{1} {2}/{2}", a + 1, a + 8, a + 7).unwrap();
    }
    text
}

/// Knits the sheet into a picture, a `.glb` and a `.csv`.
fn knit(folder: &Path, name: &str, at: DVec3, camera: &[String]) {
    std::fs::write(folder.join(format!("{name}.obj")), sheet(at)).unwrap();
    let mut command = assert_cmd::Command::cargo_bin("warpknit").unwrap();
    command.current_dir(folder).env("XDG_CACHE_HOME", crate::cache_home());
    command.arg("drape").arg(format!("{name}.obj"));
    command.args(
        "--unit mm --wales-per-cm 2 --courses-per-cm 3 --renderer cpu --size 160x160 --glb-precision f32 --nodes yarn".split(' '),
    );
    for ending in ["png", "glb", "csv"] {
        command.args(["-o", &format!("{name}.{ending}")]);
    }
    command.args(camera).assert().success();
}

/// The first node's translation and the positions of all meshes, m.
fn glb(path: &Path) -> (DVec3, Vec<Vec3>) {
    let bytes = std::fs::read(path).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let json: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    let body = &bytes[28 + length..];
    let moved = json["nodes"].as_array().unwrap().iter().find_map(|node| node.get("translation"));
    let translation = moved.map_or(DVec3::ZERO, |moved| {
        DVec3::from_array(std::array::from_fn(|axis| moved[axis].as_f64().unwrap()))
    });
    let mut positions = Vec::new();
    for mesh in json["meshes"].as_array().unwrap() {
        let index = mesh["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap() as usize;
        let accessor = &json["accessors"][index];
        let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let offset = |value: &Value| value["byteOffset"].as_u64().unwrap_or(0) as usize;
        let start = offset(view) + offset(accessor);
        let count = accessor["count"].as_u64().unwrap() as usize;
        let floats = body[start..start + 12 * count].as_chunks::<4>().0;
        let floats: Vec<f32> = floats.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        positions.extend(floats.chunks_exact(3).map(Vec3::from_slice));
    }
    (translation, positions)
}

/// The largest difference of two pictures' bytes, and the share that differ by more than 8.
fn difference(a: &Path, b: &Path) -> (u8, f64) {
    let [a, b] = [a, b].map(|path| image::open(path).unwrap().to_rgb8().into_raw());
    let all: Vec<u8> = a.iter().zip(&b).map(|(a, b)| a.abs_diff(*b)).collect();
    let many = all.iter().filter(|&&difference| difference > 8).count();
    (all.iter().copied().max().unwrap(), many as f64 / all.len() as f64)
}

#[test]
fn pictures_and_glb_are_those_of_the_garment_at_home() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    knit(folder.path(), "home", DVec3::ZERO, &[]);
    knit(folder.path(), "far", FAR, &[]);
    let ((still, home), (moved, far)) = (glb(&path("home.glb")), glb(&path("far.glb")));
    assert_eq!((still, home.len()), (DVec3::ZERO, far.len()));
    assert!(home.len() > 1000);
    let worst = home
        .iter()
        .zip(&far)
        .map(|(home, far)| (far.as_dvec3() + moved - FAR / 1000.0).distance(home.as_dvec3()))
        .fold(0.0, f64::max);
    assert!(worst < 1e-6, "{} µm apart", 1e6 * worst);
    let (most, share) = difference(&path("home.png"), &path("far.png"));
    assert!(share < 1e-3, "{share} of the picture differs, by {most} at most");
}

#[test]
fn an_eye_and_a_csv_are_in_the_files_axes() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let camera = |at: DVec3| {
        let place = |p: DVec3| format!("{},{},{}", p.x, p.y, p.z);
        let eye = at + DVec3::new(100.0, 90.0, 300.0);
        vec![format!("--eye={}", place(eye)), format!("--look-at={}", place(at + 60.0))]
    };
    knit(folder.path(), "home", DVec3::ZERO, &camera(DVec3::ZERO));
    knit(folder.path(), "far", FAR, &camera(FAR));
    let (most, share) = difference(&path("home.png"), &path("far.png"));
    assert!(share < 1e-3, "{share} of the picture differs, by {most} at most");
    let draped = |name: &str| -> Vec<DVec3> {
        let text = std::fs::read_to_string(path(name)).unwrap();
        let place = |line: &str| {
            let numbers: Vec<f64> = line.split(',').skip(11).map(|n| n.parse().unwrap()).collect();
            DVec3::from_slice(&numbers)
        };
        text.lines().skip(1).map(place).collect()
    };
    let (home, far) = (draped("home.csv"), draped("far.csv"));
    assert_eq!(home.len(), far.len());
    assert!(home.iter().zip(&far).all(|(home, far)| (*far - FAR).distance(*home) < 1e-5));
}
