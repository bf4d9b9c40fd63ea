//! Yarns that lie flat: in pictures of all renderers, in files and in maps, and as flat as `--regular`
//! and `--flatten` say.

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use image::RgbaImage;
use warpknit::drape::{Cloth, swatch_panel};
use warpknit::fabric::Fabric;
use warpknit::knit::Pattern;
use warpknit::knit::spread::Spread;
use warpknit::render::fabric_maps::{FabricMaps, SideMaps};
use warpknit::render::scene::{Scene, YarnLook};
use warpknit::render::{Background, Camera, RenderOptions, RendererChoice, View, cloth, render};

use crate::cli::warpknit;
use crate::gpu::{can_draw, difference};

/// A swatch whose yarns lie as flat as their neighbours leave room.
fn spread_swatch(fabric: &Fabric, wales: u32, courses: u32) -> Scene {
    let panel = swatch_panel(fabric, wales, courses);
    let laid = Cloth::swatch(&panel, fabric, wales, courses);
    cloth::from_cloth(&laid.with_spread_yarns(fabric, fabric.radius()), fabric)
}

/// Mean width of a yarn along y that is flattened to a ratio of 4, in radii, seen from a side. Pixels
/// are so many radii wide.
fn width_seen(toward: DVec3, pixel: f64, renderer: RendererChoice) -> f64 {
    const PIXELS: u32 = 64;
    const AWAY: f64 = 1000.0;
    let mut scene = Scene::default();
    let plain = YarnLook::plain(Vec3::splat(0.5), 0.7, 1.0);
    scene.looks.push(YarnLook { flatten: 4.0, plies: 1, ..plain });
    let ends = f64::from(PIXELS) * pixel;
    let points = (-40_i8..=40).map(|at| Vec3::new(0.0, f32::from(at) / 40.0 * ends as f32, 0.0));
    scene.push_strand(points, 0);
    let fov = 2.0 * (ends / 2.0 / AWAY).atan();
    let camera = Camera::look_at(toward * AWAY, DVec3::ZERO, fov, 1.0);
    let options = RenderOptions {
        width: PIXELS,
        height: PIXELS,
        spp: 64,
        renderer,
        background: Background::Transparent,
        ..RenderOptions::default()
    };
    let picture = render(&scene, &camera, &options, &|_| ()).unwrap();
    let cover: f64 = picture.pixels().map(|pixel| f64::from(pixel.0[3]) / 255.0).sum();
    cover * pixel / f64::from(PIXELS)
}

#[test]
fn a_flat_yarn_is_wide_from_the_front_and_narrow_from_the_side_in_every_renderer() {
    let has_card = can_draw("a_flat_yarn_is_wide_from_the_front");
    // Traced where yarns are many pixels wide, and as masks where they are one or less.
    for (pixel, renderer, slack) in [
        (0.25, RendererChoice::Cpu, 0.02),
        (2.0, RendererChoice::Cpu, 0.04),
        (0.25, RendererChoice::Gpu, 0.04),
        (2.0, RendererChoice::Gpu, 0.15),
    ] {
        if renderer == RendererChoice::Gpu && !has_card {
            continue;
        }
        let slanted = DVec3::new(0.6, 0.0, 0.8);
        // Half-axes 2 and 1/2: half of the width seen is sqrt((2 cos)^2 + (sin / 2)^2).
        let oblique = 2.0 * (1.6_f64 * 1.6 + 0.3 * 0.3).sqrt();
        for (toward, expected) in [(DVec3::Z, 4.0), (DVec3::X, 1.0), (slanted, oblique)] {
            let width = width_seen(toward, pixel, renderer);
            println!("{renderer:?} {pixel} {toward}: {width:.3} of {expected:.3}");
            assert!((width / expected - 1.0).abs() < slack, "{width} of {expected}");
        }
    }
}

#[test]
fn both_renderers_draw_spread_yarns_alike() {
    if !can_draw("both_renderers_draw_spread_yarns_alike") {
        return;
    }
    // As near as round yarns, which have less to differ in.
    let fabric = Fabric::named("locknit").unwrap();
    let scenes = [cloth::swatch(&fabric, 5, 6), spread_swatch(&fabric, 5, 6)];
    for view in [View::Front, View::Back] {
        let found = scenes.each_ref().map(|scene| {
            let camera = Camera::view(view, &scene.positions, Camera::DEFAULT_FOV, 2.0, 1.0);
            let options = RenderOptions { st: 80, sr: 16, ..RenderOptions::default() };
            difference(scene, &camera, options)
        });
        println!("{view:?}: round and spread {found:?}");
        assert!(found[1] < 1.4 * found[0], "{view:?}: {found:?}");
    }
}

#[test]
fn maps_of_spread_yarns_have_fewer_holes() {
    let fabric = Fabric::named("locknit").unwrap();
    let pattern = Pattern::new(&fabric);
    let cover = |spread: Option<Arc<Spread>>| {
        let looks = cloth::looks(&fabric, fabric.radius());
        let bars = Scene { looks, spread, ..Scene::default() };
        let maps = FabricMaps::draw(&fabric, &pattern, &bars, 300.0, &|_| ()).unwrap();
        let SideMaps { alpha, .. } = &maps.back;
        alpha.pixels().map(|pixel| f64::from(pixel.0[0]) / 255.0).sum::<f64>()
            / f64::from(alpha.width() * alpha.height())
    };
    let spread = Arc::new(Spread::of(&fabric, &pattern, fabric.radius()));
    let [round, flat] = [cover(None), cover(Some(spread))];
    println!("round {round:.3}, spread {flat:.3}");
    assert!(flat > round + 0.08, "{flat} {round}");
}

/// What `swatch` writes with some flags.
fn written(folder: &Path, output: &str, flags: &[&str]) -> Vec<u8> {
    warpknit(folder)
        .args(["swatch", "--fabric", "locknit", "--wales", "6", "--courses", "6", "--quiet"])
        .args(["--size", "160x120", "--view", "back", "--renderer", "cpu", "-o", output])
        .args(flags)
        .assert()
        .success();
    std::fs::read(folder.join(output)).unwrap()
}

#[test]
fn yarns_are_round_where_the_user_asks_for_it() {
    let folder = tempfile::tempdir().unwrap();
    for output in ["x.png", "x.obj"] {
        let made = |flags: &[&str]| written(folder.path(), output, flags);
        assert!(made(&["--regular"]) == made(&["--regular", "--flatten", "1"]), "{output}");
        assert!(made(&[]) != made(&["--flatten", "1"]), "{output}");
        assert!(made(&["--flatten", "3"]) != made(&["--flatten", "1"]), "{output}");
    }
    // Files are regular, so that round tubes are those of regular cloth.
    let made = |flags: &[&str]| written(folder.path(), "x.obj", flags);
    assert!(made(&["--regular"]) == made(&["--flatten", "1"]));
    let points = |flags: &[&str]| written(folder.path(), "x.csv", flags);
    assert!(points(&[]) == points(&["--regular"]), "centre lines know no sections");
}

/// Share of a picture in which yarn is seen.
fn cover(picture: &RgbaImage) -> f64 {
    let seen = picture.pixels().filter(|pixel| pixel.0[..3] != [255; 3]).count();
    seen as f64 / f64::from(picture.width() * picture.height())
}

#[test]
fn filaments_close_holes_and_neither_twisted_yarn_nor_elastane_does() {
    let folder = tempfile::tempdir().unwrap();
    let drawn = |flags: &[&str]| {
        let picture = written(folder.path(), "x.png", flags);
        cover(&image::load_from_memory(&picture).unwrap().into_rgba8())
    };
    let [spread, round] = [drawn(&[]), drawn(&["--flatten", "1"])];
    println!("locknit {spread:.3}, round {round:.3}");
    assert!(spread > 1.05 * round, "{spread} {round}");
    let widest = |name: &str| {
        let fabric = Fabric::named(name).unwrap();
        Spread::of(&fabric, &Pattern::new(&fabric), fabric.radius()).widest()
    };
    assert!(widest("jersey") < 1.5 && widest("cable") < 1.5);
    // Its inlay is of spun cotton whose twist is not told.
    let inlay = Fabric::named("tricot-inlay").unwrap();
    assert!(inlay.yarns().any(|yarn| yarn.twist.is_none() && yarn.most_flattening() < 1.5));
    assert!(widest("satin") > 2.0);
}
