//! Maps of fabrics: `tile` writes what it says, the maps look like the yarns from afar, and readers
//! of U3M, MaterialX, glTF and USD find what they need.

use std::io::Read as _;
use std::path::Path;

use glam::{DVec3, Vec3};
use image::{DynamicImage, Rgba, RgbaImage};
use serde_json::Value;
use warpknit::fabric::Fabric;
use warpknit::pipeline::{Clock, MappedFabric, fabric_maps};
use warpknit::render::fabric_maps::{MappedPlane, Side, SideMaps};
use warpknit::render::{Background, Camera, Light, RenderOptions, cloth, render, tone};

use crate::cli::{fails, warpknit};
use crate::flip::flip;

fn mapped(name: &str, dpi: f64) -> MappedFabric {
    let fabric = Fabric::named(name).unwrap();
    fabric_maps(&fabric, name, dpi, &mut Clock::start(&())).unwrap()
}

/// A square of cloth seen from so far that rays are parallel: `pixels` pixels of `pixel` mm, from
/// the lower left corner of a repeat on, or of its mirror image at the back.
fn yarns(
    fabric: &Fabric,
    side: Side,
    pixels: u32,
    pixel: f64,
    background: Background,
) -> RgbaImage {
    const AWAY: f64 = 20_000.0;
    let width = f64::from(pixels) * pixel;
    let cell = [
        fabric.threading_repeat() as f64 * fabric.wale_spacing(),
        fabric.repeat() as f64 * fabric.course_spacing(),
    ];
    // A margin for the swatch's edges, in whole repeats.
    let margin = cell.map(|cell| (4.0_f64.max(4.0 * fabric.wale_spacing()) / cell).ceil() * cell);
    let counts = [
        (2.0 * margin[0] + width) / fabric.wale_spacing(),
        (2.0 * margin[1] + width) / fabric.course_spacing(),
    ];
    let [wales, courses] = counts.map(|count| count.ceil() as u32);
    let scene = cloth::swatch(fabric, wales, courses);
    // The swatch's gap 0 and course 0: one wale from the left, and half a course from below.
    let low = f64::from(fabric.structure.lowest_gap());
    let start = [
        (1.0 - low) * fabric.wale_spacing() + margin[0],
        0.5 * fabric.course_spacing() + margin[1],
    ];
    let facing = if side == Side::Front { 1.0 } else { -1.0 };
    // From behind, the first repeat's lower right corner is at the lower left.
    let left =
        if side == Side::Front { start[0] } else { start[0] + (width / cell[0]).ceil() * cell[0] };
    let middle = DVec3::new(left + facing * width / 2.0, start[1] + width / 2.0, 0.0);
    let fov = 2.0 * (width / 2.0 / AWAY).atan();
    let camera = Camera::look_at(middle + DVec3::Z * (facing * AWAY), middle, fov, 1.0);
    let (width, height) = (pixels, pixels);
    let options = RenderOptions { width, height, spp: 16, background, ..RenderOptions::default() };
    render(&scene, &camera, &options, &|_| ()).unwrap()
}

/// The same square as a plane with the maps.
fn plane(
    mapped: &MappedFabric,
    side: Side,
    pixels: u32,
    pixel: f64,
    background: Background,
) -> RgbaImage {
    MappedPlane::new(&mapped.maps, side, &Light::default()).picture([pixels; 2], pixel, background)
}

fn difference(a: RgbaImage, b: RgbaImage) -> f32 {
    let [a, b] = [a, b].map(|picture| DynamicImage::from(picture).into_rgb8());
    flip(&a, &b).mean()
}

/// Pixels of the pictures from afar, and how many times nearer the yarns are drawn.
const FAR: u32 = 16;
const NEARER: u32 = 12;

/// A picture of [`FAR`] pixels, each the mean light of [`NEARER`] by as many.
fn averaged(picture: &RgbaImage) -> RgbaImage {
    RgbaImage::from_fn(FAR, FAR, |x, y| {
        let places = (0..NEARER * NEARER).map(|at| (at % NEARER, at / NEARER));
        let light = places.map(|(right, down)| {
            let [r, g, b, _] = picture.get_pixel(NEARER * x + right, NEARER * y + down).0;
            Vec3::from([r, g, b].map(|code| tone::linear(f32::from(code) / 255.0)))
        });
        let [r, g, b] = tone::encode(light.sum::<Vec3>() / (NEARER * NEARER) as f32);
        Rgba([r, g, b, 255])
    })
}

#[test]
fn from_afar_a_plane_with_the_maps_looks_like_the_yarns() {
    let mut unlike = Vec::new();
    for name in ["tricot", "locknit", "satin", "plush", "hex-net-5", "power-net", "jersey"] {
        let mapped = mapped(name, 600.0);
        let fabric = &mapped.real.fabric;
        // So far away that a pixel holds several wales. The yarns are drawn from near and averaged,
        // since pictures of far yarns are approximate too.
        let pixel = 3.0 * fabric.wale_spacing();
        for side in Side::BOTH {
            let background = Background::default();
            let near = yarns(fabric, side, FAR * NEARER, pixel / f64::from(NEARER), background);
            let flat = plane(&mapped, side, FAR, pixel, background);
            let flip = difference(averaged(&near), flat);
            if flip > 0.1 {
                unlike.push(format!("{name} {side:?}: {flip:.3}"));
            }
        }
    }
    assert!(unlike.is_empty(), "{unlike:?}");
}

/// The share of two covers' differences in their own variance.
fn unlike(a: &[f64], b: &[f64]) -> f64 {
    let mean = a.iter().sum::<f64>() / a.len() as f64;
    let apart: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    apart / a.iter().map(|a| (a - mean).powi(2)).sum::<f64>()
}

/// Each side lies where its picture has it: holes of the map are holes of the cloth, the right way
/// up and round.
#[test]
fn maps_lie_as_the_yarns_do() {
    for name in ["locknit", "hex-net-5", "power-net"] {
        let mapped = mapped(name, 600.0);
        let pixel = 0.08;
        for side in Side::BOTH {
            let covers = [
                yarns(&mapped.real.fabric, side, 60, pixel, Background::Transparent),
                plane(&mapped, side, 60, pixel, Background::Transparent),
            ]
            .map(|picture| {
                picture.pixels().map(|pixel| f64::from(pixel.0[3]) / 255.0).collect::<Vec<_>>()
            });
            let own = unlike(&covers[0], &covers[1]);
            assert!(own < 0.15, "{name} {side:?}: {own}");
        }
    }
}

/// Runs `tile` in a folder, with a fixed time.
fn tile(folder: &Path, arguments: &[&str]) -> String {
    let mut command = warpknit(folder);
    command.env("SOURCE_DATE_EPOCH", "1795000000").arg("tile").args(arguments).arg("--quiet");
    let output = command.assert().success().stderr("").get_output().stdout.clone();
    String::from_utf8(output).unwrap()
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// All files below a folder with their bytes, by name.
fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            all.extend(contents(&entry));
        } else {
            all.push((entry.display().to_string(), std::fs::read(&entry).unwrap()));
        }
    }
    all.sort();
    all
}

#[test]
fn a_folder_holds_maps_of_the_true_size_and_the_cloth_of_swatch() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let printed = tile(folder.path(), &["--fabric", "locknit", "-o", "maps"]);
    let report = json(&path("maps/report.json"));
    warpknit(folder.path())
        .args(["swatch", "--fabric", "locknit", "--quiet", "-o", "s.json"])
        .assert()
        .success();
    let cloth = &json(&path("s.json"))["cloth"];
    assert_eq!(report["mass_g_m2"], cloth["mass_g_m2"]);
    assert!(printed.contains("mass          94.1 g/m²"), "{printed}");
    let (cover, alpha) = (&report["cover"], &report["alpha_front"]);
    assert!((cover.as_f64().unwrap() - alpha.as_f64().unwrap()).abs() < 0.01);
    for file in report["files"].as_array().unwrap() {
        assert!(path("maps").join(file.as_str().unwrap()).is_file(), "{file}");
    }
    let u3m = json(&path("maps/locknit.u3m"));
    check_u3m(&u3m, &path("maps"));
    assert!((u3m["material"]["physics"]["weight"].as_f64().unwrap() - 94.1).abs() < 0.1);
    check_archive(&path("maps/locknit.u3ma"), &path("maps"));
}

/// The pictures of a U3M have the sizes that it states.
fn check_u3m(u3m: &Value, folder: &Path) {
    let material = &u3m["material"];
    assert_eq!((u3m["schema"].as_str(), material.as_object().unwrap().len()), (Some("1.1"), 10));
    for side in ["front", "back"] {
        let visual = material[side].as_object().unwrap();
        assert_eq!(visual.len(), 22);
        let images = visual.values().filter_map(|value| value.get("texture")?.get("image"));
        let mut count = 0;
        for image in images.chain([&visual["preview"]]) {
            let picture = image::open(folder.join(image["path"].as_str().unwrap())).unwrap();
            for (pixels, mm, axis) in
                [(picture.width(), "width", "x"), (picture.height(), "height", "y")]
            {
                let dpi = f64::from(pixels) / (image[mm].as_f64().unwrap() / 25.4);
                assert!((image["dpi"][axis].as_f64().unwrap() / dpi - 1.0).abs() < 1e-12);
            }
            assert!(!matches!(picture, DynamicImage::ImageLuma8(_) | DynamicImage::ImageLuma16(_)));
            count += 1;
        }
        // All maps but occlusion, and the preview.
        assert_eq!(count, 8);
    }
}

/// The archive holds the files of the folder that it stands for, stored.
fn check_archive(path: &Path, folder: &Path) {
    let mut archive = zip::ZipArchive::new(std::fs::File::open(path).unwrap()).unwrap();
    assert_eq!(archive.len(), 18);
    for at in 0..archive.len() {
        let mut entry = archive.by_index(at).unwrap();
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).unwrap();
        let name = entry.name().unwrap().into_owned();
        assert_eq!(bytes, std::fs::read(folder.join(&name)).unwrap(), "{name}");
    }
}

#[test]
fn the_glb_has_a_side_each_way_and_whole_repeats() {
    let folder = tempfile::tempdir().unwrap();
    tile(folder.path(), &["--fabric", "hex-net-5", "-o", "net"]);
    let bytes = std::fs::read(folder.path().join("net/hex-net-5.glb")).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let glb: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    assert_eq!(glb["meshes"].as_array().unwrap().len(), 2);
    assert_eq!(glb["materials"][0]["alphaMode"], "BLEND");
    let report = json(&folder.path().join("net/report.json"));
    let high = glb["accessors"][0]["max"].as_array().unwrap();
    for axis in 0..2 {
        let size = 2000.0 * high[axis].as_f64().unwrap();
        let repeats = size / report["repeat_mm"][axis].as_f64().unwrap();
        assert!((repeats - repeats.round()).abs() < 1e-4 && (90.0..110.0).contains(&size));
    }
}

#[test]
fn maps_are_the_same_for_any_number_of_threads_and_again_in_the_same_folder() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = |threads: &'static str| {
        ["--fabric", "tricot", "--dpi", "900", "-o", "maps", "--threads", threads]
    };
    tile(folder.path(), &arguments("1"));
    let first = contents(&folder.path().join("maps"));
    std::fs::write(folder.path().join("maps/textures/mine.png"), "").unwrap();
    tile(folder.path(), &arguments("4"));
    let mut again = contents(&folder.path().join("maps"));
    again.retain(|(name, _)| !name.ends_with("mine.png"));
    assert_eq!(first, again);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn wrong_input_is_one_clear_error() {
    let large = fails(1, &["tile", "--fabric", "locknit", "--dpi", "1e7", "-o", "a"], |_| {});
    assert!(large.starts_with("error: locknit: its repeat of 0.7 x 0.9 mm has"), "{large}");
    assert!(large.contains("lower --dpi") && large.lines().count() == 1, "{large}");
    let small = fails(1, &["tile", "--fabric", "locknit", "--dpi", "72", "-o", "a"], |_| {});
    assert!(small.contains("raise --dpi to 297"), "{small}");
    let unknown = fails(1, &["tile", "--fabric", "lokcnit", "-o", "a"], |_| {});
    assert!(unknown.contains("did you mean 'locknit'?"), "{unknown}");
    let file = fails(1, &["tile", "-o", "a"], |folder| {
        std::fs::write(folder.join("a"), "").unwrap();
    });
    assert!(file.contains("a: can't write: it is a file, and a folder is needed"), "{file}");
    for arguments in [&["tile"][..], &["tile", "-o", "a", "--dpi", "0"]] {
        assert!(fails(2, arguments, |_| {}).starts_with("error:"));
    }
}

/// Where a pixel has no yarn, its colour is that of yarn nearby.
#[test]
fn holes_have_no_colour_of_their_own() {
    let MappedFabric { maps, real } = mapped("hex-net-5", 600.0);
    let colors: Vec<[u8; 3]> = real.fabric.yarns().map(|yarn| yarn.color.0).collect();
    for side in Side::BOTH {
        let SideMaps { base_color, alpha, .. } = maps.side(side);
        assert!(alpha.pixels().any(|pixel| pixel.0 == [0]));
        for (color, _) in base_color.pixels().zip(alpha.pixels()).filter(|(_, a)| a.0 == [0]) {
            for channel in 0..3 {
                let of_yarns = colors.iter().map(|color| color[channel]);
                let (low, high) = (of_yarns.clone().min().unwrap(), of_yarns.max().unwrap());
                // Grooves between plies are darker by a third.
                assert!((low / 2..=high).contains(&color.0[channel]), "{color:?}");
            }
        }
    }
}
