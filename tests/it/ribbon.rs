//! Ribbons and textured yarns as the processor draws them: width, both sides, holes, repeats.

use glam::{DVec3, Vec3};
use image::{Rgba, RgbaImage};
use warpknit::render::maps::Maps;
use warpknit::render::mips::{MapKind, Mips};
use warpknit::render::scene::{Scene, Shape, YarnLook};
use warpknit::render::{Background, Camera, RenderOptions, render};

const SIZE: u32 = 120;

fn options() -> RenderOptions {
    RenderOptions {
        width: SIZE,
        height: SIZE,
        spp: 16,
        background: Background::Transparent,
        ..RenderOptions::default()
    }
}

/// Seen from `toward` mm 40 away, 4 mm high.
fn draw(scene: &Scene, toward: DVec3) -> RgbaImage {
    let camera = Camera::look_at(toward * 40.0, DVec3::ZERO, 2.0 * (2.0_f64 / 40.0).atan(), 1.0);
    render(scene, &camera, &options(), &|_| ()).unwrap()
}

/// One yarn of `shape` along x, 1 mm to either side.
fn yarn(shape: Shape, base: Option<RgbaImage>) -> Scene {
    let mut scene = Scene {
        shape,
        looks: vec![YarnLook::plain(Vec3::splat(0.6), 0.7, 1.0)],
        ..Scene::default()
    };
    if let Some(base) = base {
        scene.looks[0].maps = Some(0);
        scene.maps.push(maps(base));
    }
    scene.push_strand((0_u8..11).map(|i| Vec3::X * (f32::from(i) - 5.0)), 0);
    scene
}

/// Flat, dull, with a repeat of 1 mm.
fn maps(base: RgbaImage) -> Maps {
    let (width, height) = base.dimensions();
    let plain = |texel| RgbaImage::from_pixel(width, height, Rgba(texel));
    Maps {
        base: Mips::new(base, MapKind::Color),
        normal: Mips::new(plain([128, 128, 255, 255]), MapKind::Normal),
        surface: Mips::new(plain([255, 191, 0, 255]), MapKind::Plain),
        length: 1.0,
        width: 2.0,
    }
}

fn coverage(picture: &RgbaImage) -> f64 {
    picture.pixels().map(|pixel| f64::from(pixel.0[3]) / 255.0).sum::<f64>()
        / f64::from(SIZE * SIZE)
}

#[test]
fn a_ribbon_is_as_wide_as_its_projection_and_flat_from_the_side() {
    let scene = yarn(Shape::Ribbon, None);
    assert!((coverage(&draw(&scene, DVec3::Z)) - 0.5).abs() < 0.005);
    let tilted = coverage(&draw(&scene, DVec3::new(0.0, 0.75_f64.sqrt(), 0.5)));
    assert!((tilted - 0.25).abs() < 0.005, "half as wide, seen at 60 degrees: {tilted}");
    assert!(coverage(&draw(&scene, DVec3::Y)) < 1e-3);
}

#[test]
fn bends_leave_no_gap() {
    let mut scene = yarn(Shape::Ribbon, None);
    scene.strands.clear();
    let arc = |i: u8| {
        Vec3::new(
            f32::from(i) - 6.0,
            (f32::from(i) * 0.9).sin() * 0.3,
            (f32::from(i) * 1.3).cos() * 0.4,
        )
    };
    scene.push_strand((0_u8..13).map(arc), 0);
    let picture = draw(&scene, DVec3::Z);
    for x in 0..SIZE {
        assert!((48..72).all(|y| picture.get_pixel(x, y).0[3] == 255), "a gap in column {x}");
    }
}

#[test]
fn both_sides_are_lit_alike() {
    let scene = yarn(Shape::Ribbon, None);
    let middle = |toward| draw(&scene, toward).get_pixel(SIZE / 2, SIZE / 2).0;
    let (front, back) = (middle(DVec3::Z), middle(DVec3::NEG_Z));
    assert!(
        front[0] > 100 && front.iter().zip(back).all(|(a, b)| a.abs_diff(b) <= 3),
        "{front:?} {back:?}"
    );
}

/// White, its lower half (u over 1/2) with `alpha`.
fn half_open(alpha: u8) -> RgbaImage {
    RgbaImage::from_fn(16, 16, |_, y| Rgba([200, 200, 200, if y < 8 { 255 } else { alpha }]))
}

#[test]
fn holes_show_what_is_behind_and_fuzz_blends() {
    let covered = |alpha| coverage(&draw(&yarn(Shape::Ribbon, Some(half_open(alpha))), DVec3::Z));
    assert!((covered(255) - 0.5).abs() < 0.01);
    assert!((covered(0) - 0.25).abs() < 0.01);
    assert!((covered(128) - 0.375).abs() < 0.015, "{}", covered(128));
    let mut scene = yarn(Shape::Ribbon, Some(half_open(0)));
    scene.looks.push(YarnLook::plain(Vec3::X * 0.7, 0.7, 1.0));
    scene.push_strand([Vec3::new(-5.0, 0.0, -3.0), Vec3::new(5.0, 0.0, -3.0)], 1);
    let picture = draw(&scene, DVec3::Z);
    let red = |y| {
        let pixel = picture.get_pixel(SIZE / 2, y).0;
        pixel[0] / 2 > pixel[1] && pixel[3] == 255
    };
    assert!(!red(40) && red(80), "u counts from the top, so the lower half is open");
}

#[test]
fn holes_let_the_sun_through() {
    let floor = |alpha| {
        let base = RgbaImage::from_pixel(8, 8, Rgba([200, 200, 200, alpha]));
        let mut scene = yarn(Shape::Ribbon, Some(base));
        scene.strands.clear();
        // The canopy lies between the sun, upper left, and a plain floor.
        let canopy = |i: u8| Vec3::new(f32::from(i) - 8.0, 2.9, 3.2);
        scene.push_strand((0_u8..15).map(canopy), 0);
        scene.looks.push(YarnLook::plain(Vec3::splat(0.6), 0.7, 1.0));
        scene.push_strand([Vec3::NEG_X * 4.0, Vec3::X * 4.0], 1);
        u32::from(draw(&scene, DVec3::Z).get_pixel(SIZE / 2, SIZE / 2).0[1])
    };
    let (open, half, shut) = (floor(0), floor(128), floor(255));
    assert!(open > half + 15 && half > shut + 15, "{open} {half} {shut}");
}

#[test]
fn textures_repeat_with_their_length_on_ribbons_and_tubes() {
    // Black but for a quarter of the length, alike all around.
    let stripes = RgbaImage::from_fn(16, 16, |x, _| {
        if x < 4 { Rgba([230, 230, 230, 255]) } else { Rgba([0, 0, 0, 255]) }
    });
    for shape in [Shape::Ribbon, Shape::Tube] {
        let bright = |length: f32| {
            let mut scene = yarn(shape, Some(stripes.clone()));
            scene.maps[0].length = length;
            let picture = draw(&scene, DVec3::Z);
            let row: Vec<bool> =
                (0..SIZE).map(|x| picture.get_pixel(x, SIZE / 2).0[1] > 150).collect();
            let starts = row.windows(2).filter(|pair| !pair[0] && pair[1]).count();
            (starts, row.iter().filter(|&&bright| bright).count())
        };
        // 4 mm are seen.
        for (length, repeats) in [(1.0, 4), (0.5, 8), (2.0, 2)] {
            let (starts, wide) = bright(length);
            assert!(starts.abs_diff(repeats) <= 1, "{shape:?}: {starts} stripes for {repeats}");
            assert!((20..=40).contains(&wide), "{shape:?}: a quarter of 120 pixels, not {wide}");
        }
    }
}

#[test]
fn normal_maps_turn_the_light_and_occlusion_dims_the_sky() {
    let brightness = |normal: [u8; 4], occlusion: u8| {
        let mut scene = yarn(Shape::Ribbon, Some(half_open(255)));
        scene.maps[0].normal =
            Mips::new(RgbaImage::from_pixel(16, 16, Rgba(normal)), MapKind::Normal);
        scene.maps[0].surface = Mips::new(
            RgbaImage::from_pixel(16, 16, Rgba([occlusion, 191, 0, 255])),
            MapKind::Plain,
        );
        draw(&scene, DVec3::Z).get_pixel(SIZE / 2, SIZE / 2).0[1]
    };
    let flat = [128, 128, 255, 255];
    // The sun stands up and to the left; the yarn runs to the right.
    let (up, down) = (brightness([128, 200, 230, 255], 255), brightness([128, 56, 230, 255], 255));
    let (left, right) =
        (brightness([56, 128, 230, 255], 255), brightness([200, 128, 230, 255], 255));
    assert!(up > down + 30 && left > right + 30, "{up} {down} {left} {right}");
    assert!(brightness(flat, 0) + 15 < brightness(flat, 255));
}
