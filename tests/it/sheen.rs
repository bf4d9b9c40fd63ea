//! The sheen of yarns: brighter where light and eye are mirrored across them, from near as from
//! afar, on both renderers.

use crate::flip::flip;
use crate::gpu::can_draw;
use glam::{DVec3, Vec3};
use image::{DynamicImage, RgbaImage};
use warpknit::fabric::Fabric;
use warpknit::render::cloth;
use warpknit::render::scene::{Scene, YarnLook};
use warpknit::render::{Background, Camera, Light, RenderOptions, RendererChoice, View, render};

/// Width of the cloth, mm.
const SIDE: f32 = 15.0;
/// Pixels a side from where the cloth is drawn thread by thread, and from where a pixel holds two
/// threads.
const NEAR: u32 = 240;
const FAR: u32 = 30;

/// A flat cloth of straight yarns of one ply, turned by so much from across the picture.
fn satin(turn: f32, sheen: f32, slope: f32) -> Scene {
    let look = YarnLook {
        plies: 1,
        twist_slope: Some(slope),
        sheen,
        ..YarnLook::plain(Vec3::new(0.5, 0.15, 0.15), 0.75, 0.1)
    };
    let mut scene = Scene { looks: vec![look], ..Scene::default() };
    let (sin, cos) = turn.sin_cos();
    for line in 0_u8..60 {
        let y = f32::from(line) / 60.0 * SIDE - SIDE / 2.0;
        let at = |x: f32| Vec3::new(x * cos - y * sin, x * sin + y * cos, 0.0);
        scene.push_strand((0_u8..=60).map(|i| at(f32::from(i) / 60.0 * SIDE - SIDE / 2.0)), 0);
    }
    scene
}

fn draw(scene: &Scene, size: u32, renderer: RendererChoice) -> RgbaImage {
    // From half way up behind the eye, so that yarns across the picture mirror it.
    let light = Light { sun_direction: Vec3::new(0.0, 1.0, 1.0), ..Light::default() };
    let camera = Camera::look_at(DVec3::Z * 100.0, DVec3::ZERO, 2.0 * 0.05_f64.atan(), 1.0);
    let background = Background::Transparent;
    // Dim enough that the tone curve is a straight line.
    let options = RenderOptions {
        width: size,
        height: size,
        spp: 16,
        renderer,
        background,
        light,
        exposure: 0.4,
        ..RenderOptions::default()
    };
    render(scene, &camera, &options, &|_| ()).unwrap()
}

/// Mean linear light where yarn is.
fn brightness(picture: &RgbaImage) -> f64 {
    let (light, cover) = picture.pixels().fold((0.0, 0.0), |(light, cover), pixel| {
        let [r, g, b, alpha] = pixel.0.map(|byte| f64::from(byte) / 255.0);
        (light + (r.powf(2.2) + g.powf(2.2) + b.powf(2.2)) / 3.0 * alpha, cover + alpha)
    });
    light / cover
}

#[test]
fn cloth_shines_across_its_yarns_and_not_along_them() {
    for size in [NEAR, FAR] {
        let bright = |turn: f32, sheen: f32| {
            brightness(&draw(&satin(turn, sheen, 0.0), size, RendererChoice::Cpu))
        };
        let quarter = std::f32::consts::FRAC_PI_2;
        let [dull, shining] = [0.0, 0.5].map(|sheen| bright(0.0, sheen) / bright(quarter, sheen));
        println!("{size} pixels: across over along {dull:.3}, with a sheen {shining:.3}");
        assert!((0.9..1.1).contains(&dull), "{dull}");
        assert!(shining > 1.5 * dull, "{shining} {dull}");
        // It fades as the cloth is turned.
        let turned: Vec<_> = [0.0, 0.3, 0.6, 0.9].map(|turn| bright(turn, 0.5)).into();
        assert!(turned.is_sorted_by(|one, other| one > other), "{turned:?}");
    }
}

#[test]
fn twist_spreads_the_shine_over_more_directions() {
    // Somewhere around a twisted yarn fibres lie across the half vector also where its axis
    // doesn't.
    for size in [NEAR, FAR] {
        let bright = |turn: f32, slope: f32| {
            brightness(&draw(&satin(turn, 0.5, slope), size, RendererChoice::Cpu))
        };
        for slope in [0.6_f32, -0.6] {
            let [square, turned] = [0.0, 0.7].map(|turn| bright(turn, slope) / bright(turn, 0.0));
            println!(
                "{size} pixels, slope {slope}: {square:.3} of the untwisted yarn's light, turned {turned:.3}"
            );
            assert!(square < 0.97 && turned > 1.03, "{square} {turned}");
        }
    }
}

/// What a sheen adds is the same for thin yarns that are drawn as for those that are traced near
/// by, within 5 % of all light, on both renderers. The rest differs by a tenth on cloth of one
/// layer of straight yarns: how much of the sky is open is fitted to knits.
#[test]
fn far_cloth_shines_as_near_cloth_does() {
    for renderer in [RendererChoice::Cpu, RendererChoice::Gpu] {
        if renderer == RendererChoice::Gpu && !can_draw("far_cloth_shines_as_near_cloth_does") {
            continue;
        }
        for (turn, slope) in [(0.0, 0.0), (0.4, 0.0), (1.2, 0.0), (0.0, 0.3), (0.3, -0.3)] {
            let gains = [NEAR, FAR].map(|size| {
                let [shining, dull] = [0.5, 0.0].map(|sheen| brightness(&draw(&satin(turn, sheen, slope), size, renderer)));
                println!("{renderer:?}, {size} pixels, turned {turn}, slope {slope}: {shining:.4}, {dull:.4} without");
                shining / dull
            });
            assert!((gains[1] / gains[0] - 1.0).abs() < 0.05, "{gains:?}");
        }
    }
}

/// On a knit all of its light agrees, within 5 %.
#[test]
fn a_far_knit_is_as_bright_as_a_near_one() {
    let mut scene = cloth::swatch(&Fabric::named("satin").unwrap(), 70, 70);
    scene.looks.iter_mut().for_each(|look| look.sheen = 0.6);
    let camera = Camera::view(View::Back, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
    let drawn = |size: u32, lod: bool| {
        let (background, exposure) = (Background::Transparent, 0.4);
        let options = RenderOptions {
            width: size,
            height: size,
            spp: 16,
            background,
            lod,
            exposure,
            ..RenderOptions::default()
        };
        brightness(&render(&scene, &camera, &options, &|_| ()).unwrap())
    };
    let (near, far) = (drawn(480, false), drawn(120, true));
    println!("near {near:.4}, far {far:.4}");
    assert!((far / near - 1.0).abs() < 0.05, "{near} {far}");
}

#[test]
fn both_renderers_draw_the_same_sheen() {
    if !can_draw("both_renderers_draw_the_same_sheen") {
        return;
    }
    let mut scene = cloth::swatch(&Fabric::named("satin").unwrap(), 12, 14);
    scene.looks.iter_mut().for_each(|look| look.sheen = 0.6);
    let camera = Camera::view(View::Back, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
    let options = RenderOptions {
        width: 512,
        height: 512,
        spp: 16,
        st: 80,
        sr: 16,
        lod: false,
        ..RenderOptions::default()
    };
    let [cpu, gpu] =
        [(RendererChoice::Cpu, 64), (RendererChoice::Gpu, 16)].map(|(renderer, spp)| {
            let picture = render(
                &scene,
                &camera,
                &RenderOptions { renderer, spp, ..options.clone() },
                &|_| (),
            )
            .unwrap();
            DynamicImage::from(picture).into_rgb8()
        });
    let difference = flip(&cpu, &gpu).mean();
    println!("mean FLIP {difference:.4}");
    assert!(difference < 0.06, "{difference}");
}
