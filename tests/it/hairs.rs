//! Hairs of spun yarns: pictures from near show them, those from afar don't, and a part of a yarn has
//! the hairs of the whole.

use glam::Vec3;
use image::{DynamicImage, imageops};
use warpknit::drape::fibres::bundles;
use warpknit::fabric::Fabric;
use warpknit::render::scene::Scene;
use warpknit::render::{Background, Camera, RenderOptions, View, cloth, hairs, render};
use warpknit::yarn::fibres::{Bundle, FIBRE_RADIUS};
use warpknit::yarn::hairs::Hairs;

use crate::cli::warpknit;
use crate::flip::flip;
use crate::gpu;

const SIZE: [u32; 2] = [384, 384];

/// A swatch, and its yarns' fibres and hairs.
fn swatch(fabric: &str) -> (Scene, Vec<Bundle>) {
    let fabric = Fabric::named(fabric).unwrap();
    (cloth::swatch(&fabric, 10, 12), bundles(&fabric, fabric.radius(), FIBRE_RADIUS))
}

fn camera(scene: &Scene, zoom: f64) -> Camera {
    Camera::view(View::Front, &scene.positions, Camera::DEFAULT_FOV, zoom, 1.0)
}

/// The hairs in a picture, each as its points. Without any, the scene of yarns is drawn.
fn hairs_of(scene: &Scene, bundles: &[Bundle], camera: &Camera) -> Vec<Vec<Vec3>> {
    let Some(drawn) = hairs::with_hairs(scene, None, bundles, camera, SIZE) else {
        return Vec::new();
    };
    drawn.strands[scene.strands.len()..]
        .iter()
        .map(|strand| {
            drawn.positions[strand.points.start as usize..strand.points.end as usize].to_vec()
        })
        .collect()
}

#[test]
fn hairs_fade_in_as_yarns_come_near() {
    let (scene, bundles) = swatch("jersey");
    // A yarn's width in pixels at zoom 1.
    let pixel = camera(&scene, 1.0).pixel_size(camera(&scene, 1.0).eye().z, SIZE[1]);
    let width = 2.0 * bundles[0].radius / pixel;
    let length = |zoom: f64| {
        // Yarn that the picture shows falls with the square of the zoom.
        hairs_of(&scene, &bundles, &camera(&scene, zoom)).len() as f64 * zoom.powi(2)
    };
    let counts = [7.0, 8.5, 10.0, 12.0, 14.0, 16.0].map(|pixels| length(pixels / width));
    assert_eq!(counts[0], 0.0);
    assert!(counts[1] > 0.0, "{counts:?}");
    assert!(counts.windows(2).all(|pair| pair[0] < pair[1]), "{counts:?}");
    assert!(counts[1] < 0.2 * counts[5], "{counts:?}");
    // Filaments have none.
    let (scene, bundles) = swatch("tricot");
    assert!(hairs_of(&scene, &bundles, &camera(&scene, 8.0)).is_empty());
}

#[test]
fn a_part_of_a_yarn_has_the_hairs_of_the_whole() {
    let (scene, bundles) = swatch("jersey");
    let camera = camera(&scene, 4.0);
    let whole = hairs_of(&scene, &bundles, &camera);
    let mut part = scene.clone();
    for strand in &mut part.strands {
        strand.points.start += 13;
        strand.first += 13;
    }
    let of_part = hairs_of(&part, &bundles, &camera);
    assert!(whole.len() > 300 && of_part.len() > whole.len() / 2, "{}", whole.len());
    // A span depends on its neighbours, so those at the new ends may differ.
    let differing = of_part.iter().filter(|hair| !whole.contains(hair)).count();
    assert!(differing * 50 < of_part.len(), "{differing} of {} of {}", of_part.len(), whole.len());
}

#[test]
fn both_renderers_draw_the_same_hairs() {
    if !gpu::can_draw("hairs") {
        return;
    }
    let (scene, bundles) = swatch("jersey");
    let camera = camera(&scene, 3.0);
    let hairy = hairs::with_hairs(&scene, None, &bundles, &camera, SIZE).unwrap();
    let fine = RenderOptions { st: 80, sr: 16, ..RenderOptions::default() };
    let [bare, hairy] = [&scene, &hairy].map(|scene| gpu::difference(scene, &camera, fine.clone()));
    assert!(hairy < bare + 0.05, "{hairy}, and {bare} without hairs");
}

#[test]
fn pictures_of_spun_yarns_have_hairs_unless_they_are_regular_or_have_no_fibres() {
    let folder = tempfile::tempdir().unwrap();
    let drawn = |fabric: &str, flags: &[&str]| {
        warpknit(folder.path())
            .args(["swatch", "--fabric", fabric, "--wales", "5", "--courses", "6"])
            .args(["--size", "400x400", "--renderer", "cpu", "--quiet", "-o", "x.png"])
            .args(flags)
            .assert()
            .success();
        image::open(folder.path().join("x.png")).unwrap().into_rgba8()
    };
    let bare = drawn("jersey", &["--fibres", "off"]);
    assert!(drawn("jersey", &[]) != bare);
    assert!(drawn("jersey", &["--regular"]) == drawn("jersey", &["--regular", "--fibres", "off"]));
    assert!(drawn("tricot", &[]) == drawn("tricot", &["--fibres", "off"]));
}

/// Near the end that the panel's edge has cut, all points of a fibre follow that end.
#[test]
fn fibres_of_cut_yarns_are_written_with_their_stitches() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("sheet.obj"), crate::far::sheet(glam::DVec3::ZERO)).unwrap();
    warpknit(folder)
        .args(
            "drape sheet.obj --fabric tricot --unit mm --wales-per-cm 0.6 --sweeps off".split(' '),
        )
        .args("--fibres on --fibre-radius 0.4 --quiet -o x.usda".split(' '))
        .assert()
        .success();
    let text = std::fs::read_to_string(folder.join("x.usda")).unwrap();
    assert!(text.matches("BasisCurves").count() > 1);
}

#[test]
fn files_of_fibres_have_hairs() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let printed = warpknit(folder).args(["fabrics", "jersey"]).output().unwrap().stdout;
    let spun = String::from_utf8(printed).unwrap();
    assert!(spun.contains("hairiness = 5.0"), "{spun}");
    let mut curves = Vec::new();
    for (name, hairiness) in [("spun.toml", "5.0"), ("bare.toml", "0.0")] {
        let text = spun.replace("hairiness = 5.0", &format!("hairiness = {hairiness}"));
        std::fs::write(folder.join(name), text).unwrap();
        warpknit(folder)
            .args(["swatch", "--fabric", name, "--wales", "3", "--courses", "3"])
            .args(["--fibres", "on", "--fibre-radius", "0.01", "--quiet", "-o", "x.curves.txt"])
            .assert()
            .success();
        let text = std::fs::read_to_string(folder.join("x.curves.txt")).unwrap();
        // An empty line parts curves.
        curves.push(text.trim().split("\n\n").count());
    }
    let hairs = curves[0] - curves[1];
    // Nine stitches of 3.15 mm. Fibres of 0.01 mm are thicker than hairs, so there are fewer.
    let expected = 9.0 * 3.15 * 17.1 * 0.0045 / 0.01;
    let share = hairs as f64 / expected;
    assert!((0.85..1.25).contains(&share), "{hairs} hairs, {expected} expected");
}

#[test]
fn a_picture_is_a_part_of_a_larger_one() {
    let (scene, bundles) = swatch("jersey");
    let wide = camera(&scene, 3.0);
    // A third of its width and height, at the same size of pixels.
    let near = camera(&scene, 9.0);
    let drawn = |camera: &Camera, size: u32| {
        let hairy = hairs::with_hairs(&scene, None, &bundles, camera, [size, size]).unwrap();
        let options =
            RenderOptions { width: size, height: size, spp: 16, ..RenderOptions::default() };
        let picture = render(&hairy, camera, &options, &|_| ()).unwrap();
        DynamicImage::from(picture).into_rgb8()
    };
    let [wide, near] = [drawn(&wide, 720), drawn(&near, 240)];
    let part = imageops::crop_imm(&wide, 240, 240, 240, 240).to_image();
    let difference = flip(&part, &near).mean();
    assert!(difference < 0.06, "{difference}");
}

#[test]
fn cloth_keeps_its_colour_as_hairs_fade_in() {
    let (scene, bundles) = swatch("jersey");
    let camera = camera(&scene, 6.0);
    let hairy = hairs::with_hairs(&scene, None, &bundles, &camera, [300, 300]).unwrap();
    let [bare, hairy] = [&scene, &hairy].map(|scene| {
        let background = Background::Transparent;
        let options =
            RenderOptions { width: 300, height: 300, background, ..RenderOptions::default() };
        render(scene, &camera, &options, &|_| ()).unwrap()
    });
    // Between yarns hairs hide what is behind the cloth.
    let pairs = bare.pixels().zip(hairy.pixels()).filter(|(bare, _)| bare.0[3] == 255);
    let changes: Vec<f64> =
        pairs.map(|(bare, hairy)| f64::from(hairy.0[1]) - f64::from(bare.0[1])).collect();
    let mean = changes.iter().sum::<f64>() / changes.len() as f64;
    assert!(changes.len() > 30_000 && mean.abs() < 3.0, "{mean} of 255");
}

#[test]
fn many_hairs_become_fewer_and_thicker_ones() {
    let (scene, mut bundles) = swatch("jersey");
    let fabric = Fabric::named("jersey").unwrap();
    let camera = camera(&scene, 1.0);
    let size = [1600, 1600];
    let area = |bundles: &[Bundle]| {
        let drawn = hairs::with_hairs(&scene, None, bundles, &camera, size).unwrap();
        let hairs = drawn.strands.len() - scene.strands.len();
        let radius = drawn.looks.last().unwrap().radius;
        (hairs as f64, hairs as f64 * f64::from(radius))
    };
    let (some, some_area) = area(&bundles);
    // A thousand times as many are over what a picture holds.
    bundles[0].hairs = Some(Hairs::of(5000.0, &bundles[0], fabric.enlargement));
    let (many, many_area) = area(&bundles);
    assert!(many > 5.0 * some && many < 170_000.0, "{some} and {many}");
    assert!((many_area / some_area / 1000.0 - 1.0).abs() < 0.15, "{some_area} {many_area}");
}
