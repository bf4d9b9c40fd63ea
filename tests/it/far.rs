//! A garment far from the origin: its picture and its `.glb` are those of the same garment at home.

use std::fmt::Write as _;
use std::path::Path;

use glam::DVec3;
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
fn knit(folder: &Path, name: &str, at: DVec3, more: &[String]) {
    std::fs::write(folder.join(format!("{name}.obj")), sheet(at)).unwrap();
    let mut command = assert_cmd::Command::cargo_bin("warpknit").unwrap();
    command.current_dir(folder).env("XDG_CACHE_HOME", crate::cache_home());
    command.arg("drape").arg(format!("{name}.obj"));
    command.args(
        "--unit mm --wales-per-cm 2 --courses-per-cm 3 --renderer cpu --size 160x160 --nodes yarn"
            .split(' '),
    );
    for ending in ["png", "glb", "csv"] {
        command.args(["-o", &format!("{name}.{ending}")]);
    }
    command.args(more).assert().success();
}

/// The place of the garment's node and the positions of all meshes in its axes, m.
fn glb(path: &Path) -> (DVec3, Vec<DVec3>) {
    let bytes = std::fs::read(path).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let json: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    let body = &bytes[28 + length..];
    let nodes = json["nodes"].as_array().unwrap();
    let number = |value: &Value| value.as_u64().unwrap_or(0) as usize;
    let children = |node: &Value| -> Vec<usize> {
        node["children"].as_array().map_or(Vec::new(), |all| all.iter().map(number).collect())
    };
    let vector = |value: &Value| {
        value
            .as_array()
            .map(|all| DVec3::from_array(std::array::from_fn(|axis| all[axis].as_f64().unwrap())))
    };
    let place = |node: &Value| vector(&node["translation"]).unwrap_or(DVec3::ZERO);
    let tops: Vec<usize> =
        json["scenes"][0]["nodes"].as_array().unwrap().iter().map(number).collect();
    let garment = tops.iter().map(|top| &nodes[*top]).find(|node| node["name"] == "garment");
    let bars = garment.map_or(tops.clone(), children);
    let mut positions = Vec::new();
    for bar in bars.iter().map(|bar| &nodes[*bar]) {
        let (low, scale) = (place(bar), vector(&bar["scale"]).unwrap_or(DVec3::ONE));
        for yarn in children(bar) {
            let mesh = &json["meshes"][number(&nodes[yarn]["mesh"])];
            let accessor =
                &json["accessors"][number(&mesh["primitives"][0]["attributes"]["POSITION"])];
            let view = &json["bufferViews"][number(&accessor["bufferView"])];
            let start = number(&view["byteOffset"]) + number(&accessor["byteOffset"]);
            let is_float = accessor["componentType"] == 5126;
            let stride = view["byteStride"]
                .as_u64()
                .map_or(if is_float { 12 } else { 8 }, |stride| stride as usize);
            for at in (0..number(&accessor["count"])).map(|vertex| start + vertex * stride) {
                let coordinate = |axis: usize| {
                    if is_float {
                        f64::from(f32::from_le_bytes(
                            body[at + 4 * axis..][..4].try_into().unwrap(),
                        ))
                    } else {
                        f64::from(u16::from_le_bytes(
                            body[at + 2 * axis..][..2].try_into().unwrap(),
                        ))
                    }
                };
                positions.push(low + scale * DVec3::from_array(std::array::from_fn(coordinate)));
            }
        }
    }
    (garment.map_or(DVec3::ZERO, place), positions)
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
    for precision in ["f32", "u16"] {
        let options = ["--glb-precision", precision].map(str::to_owned);
        knit(folder.path(), "home", DVec3::ZERO, &options);
        knit(folder.path(), "far", FAR, &options);
        let ((still, home), (moved, far)) = (glb(&path("home.glb")), glb(&path("far.glb")));
        assert_eq!((still, home.len()), (DVec3::ZERO, far.len()));
        assert!(home.len() > 1000);
        let off = |home: &DVec3, far: &DVec3| (far + moved - FAR / 1000.0).distance(*home);
        let worst = home.iter().zip(&far).map(|(home, far)| off(home, far)).fold(0.0, f64::max);
        // A step of the grid may be rounded the other way.
        let most = if precision == "f32" { 1e-6 } else { 4e-6 };
        assert!(worst < most, "{precision}: {} µm apart", 1e6 * worst);
    }
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
