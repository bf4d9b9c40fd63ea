//! Pictures of scenes whose look is known: sizes, shadows, order, coverage, determinism.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::flip::flip;
use crate::golden;
use glam::{DVec3, Vec3};
use image::{DynamicImage, Rgba, RgbaImage};
use warpknit::fabric::Fabric;
use warpknit::render::cloth;
use warpknit::render::maps::Maps;
use warpknit::render::mips::{MapKind, Mips};
use warpknit::render::scene::{Scene, YarnLook};
use warpknit::render::{Background, Camera, RenderOptions, View, render};

const SIZE: u32 = 120;

fn look(albedo: Vec3, radius: f32) -> YarnLook {
    YarnLook::plain(albedo, 0.7, radius)
}

fn options() -> RenderOptions {
    RenderOptions {
        width: SIZE,
        height: SIZE,
        background: Background::Transparent,
        ..RenderOptions::default()
    }
}

/// A yarn along x, thicker the larger the radius.
fn straight(radius: f32) -> Scene {
    let mut scene = Scene { looks: vec![look(Vec3::splat(0.6), radius)], ..Scene::default() };
    scene.push_strand([Vec3::NEG_X * 50.0, Vec3::ZERO, Vec3::X * 50.0], 0);
    scene
}

/// Seen from +z at `distance`, with a field of view that shows `height` mm there.
fn facing(distance: f64, height: f64) -> Camera {
    Camera::look_at(DVec3::Z * distance, DVec3::ZERO, 2.0 * (height / 2.0 / distance).atan(), 1.0)
}

fn draw(scene: &Scene, camera: &Camera, options: &RenderOptions) -> RgbaImage {
    render(scene, camera, options, &|_| ()).unwrap()
}

/// Two strands that cross like a small grid, and a wavy one.
fn tangle() -> Scene {
    let looks = vec![look(Vec3::new(0.6, 0.1, 0.1), 0.2), look(Vec3::splat(0.7), 0.15)];
    let mut scene = Scene { looks, ..Scene::default() };
    for line in 0_u8..8 {
        let at = f32::from(line) - 3.5;
        scene.push_strand(
            (0_u8..20).map(|i| Vec3::new(f32::from(i) * 0.4 - 4.0, at, f32::from(i % 4) * 0.3)),
            0,
        );
        scene.push_strand(
            [Vec3::new(at, -4.0, 0.2), Vec3::new(at + 0.3, 0.0, 0.5), Vec3::new(at, 4.0, 0.2)],
            1,
        );
    }
    scene
}

#[test]
fn an_empty_scene_is_all_background() {
    let camera = facing(10.0, 1.0);
    for scene in [Scene::default(), Scene { looks: vec![look(Vec3::ONE, 0.1)], ..Scene::default() }]
    {
        assert!(draw(&scene, &camera, &options()).pixels().all(|pixel| pixel.0 == [0; 4]));
        let blue = RenderOptions { background: "#1030f0".parse().unwrap(), ..options() };
        assert!(
            draw(&scene, &camera, &blue).pixels().all(|pixel| pixel.0 == [0x10, 0x30, 0xF0, 255])
        );
    }
    assert_eq!(
        draw(&tangle(), &camera, &RenderOptions { width: 0, height: 0, ..options() }).dimensions(),
        (0, 0)
    );
}

#[test]
fn a_straight_yarn_is_as_wide_as_its_projection() {
    // From 4 m as from 40 mm: thin yarns far away are where single precision would fail.
    for distance in [40.0, 4000.0] {
        let (radius, shown) = (0.06, 2.0);
        let scene = straight(radius);
        let picture =
            draw(&scene, &facing(distance, shown), &RenderOptions { spp: 16, ..options() });
        let covered: f64 = picture.pixels().map(|pixel| f64::from(pixel.0[3]) / 255.0).sum();
        let width = covered / f64::from(SIZE);
        // The outline is where rays touch: sin = radius / distance.
        let edge = (f64::from(radius) / distance).asin().tan() * distance;
        let expected = 2.0 * edge / shown * f64::from(SIZE);
        assert!((width - expected).abs() < 0.05, "{width} {expected} at {distance}");
    }
}

#[test]
fn coverage_is_whole_inside_and_none_outside() {
    let picture = draw(&straight(0.5), &facing(40.0, 2.0), &options());
    assert!((0..SIZE).all(|x| picture.get_pixel(x, SIZE / 2).0[3] == 255));
    assert!((0..SIZE).all(|x| picture.get_pixel(x, 5).0 == [0; 4]));
    let edge = (0..SIZE).filter(|&y| !matches!(picture.get_pixel(60, y).0[3], 0 | 255)).count();
    assert!((1..=6).contains(&edge), "{edge} pixels of soft edge");
}

#[test]
fn what_is_near_hides_what_is_far() {
    let looks = vec![look(Vec3::new(0.7, 0.0, 0.0), 0.3), look(Vec3::new(0.0, 0.0, 0.7), 0.3)];
    let mut scene = Scene { looks, ..Scene::default() };
    scene.push_strand([Vec3::new(-5.0, 0.0, 1.0), Vec3::new(5.0, 0.0, 1.0)], 0);
    scene.push_strand([Vec3::NEG_Y * 5.0, Vec3::Y * 5.0], 1);
    let seen = |eye: DVec3| {
        let camera = Camera::look_at(eye, DVec3::ZERO, 0.2, 1.0);
        draw(&scene, &camera, &options()).get_pixel(SIZE / 2, SIZE / 2).0
    };
    let (front, back) = (seen(DVec3::Z * 40.0), seen(DVec3::NEG_Z * 40.0));
    assert!(front[0] > front[2] && back[2] > back[0], "{front:?} {back:?}");
}

#[test]
fn an_upper_yarn_shadows_a_lower_one() {
    let brightness = |with_upper: bool| {
        let mut scene = straight(0.3);
        if with_upper {
            // Up and left of the middle, on the way to the sun, out of the picture's centre column.
            scene.push_strand([Vec3::new(-4.0, 0.5, 1.2), Vec3::new(3.0, 1.2, 1.2)], 0);
        }
        let picture = draw(&scene, &facing(60.0, 3.0), &options());
        (55..66).map(|x| u32::from(picture.get_pixel(x, 60).0[1])).sum::<u32>()
    };
    let (open, shadowed) = (brightness(false), brightness(true));
    assert!(shadowed * 10 < open * 8, "{shadowed} {open}");
}

#[test]
fn bends_leave_no_gap_at_their_joints() {
    // A circle cut at 8 data points: the ring's middle line must be covered all around.
    let mut scene = Scene { looks: vec![look(Vec3::ONE, 0.05)], ..Scene::default() };
    let at = |i: u8| f32::from(i) * std::f32::consts::FRAC_PI_4;
    scene.push_strand((0..=8).map(|i| Vec3::new(at(i).cos(), at(i).sin(), 0.0)), 0);
    let (camera, options) = (facing(30.0, 2.4), options());
    let picture = draw(&scene, &camera, &options);
    let strand: Vec<DVec3> = scene.positions.iter().map(|point| point.as_dvec3()).collect();
    for step in 0_u16..800 {
        let span = warpknit::yarn::curve::span(&strand, usize::from(step / 100));
        let seen = camera.project(span.at(f64::from(step % 100) / 100.0), 1.0).unwrap();
        let pixel = |c: f64| {
            (0..SIZE).find(|&i| f64::from(i) + 1.0 > (c + 1.0) / 2.0 * f64::from(SIZE)).unwrap()
        };
        assert!(picture.get_pixel(pixel(seen.x), pixel(-seen.y)).0[3] > 150, "gap at step {step}");
    }
}

#[test]
fn bytes_do_not_depend_on_threads() {
    let scene = tangle();
    let camera = Camera::view(View::Iso, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| draw(&scene, &camera, &options()))
    };
    assert!(with(1) == with(2));
    assert!(with(2) != draw(&scene, &camera, &RenderOptions { seed: 1, ..options() }));
}

#[test]
fn bytes_of_far_yarns_do_not_depend_on_threads() {
    let scene = mat(0.05);
    let camera = Camera::view(View::Iso, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| draw(&scene, &camera, &RenderOptions { spp: 3, ..options() }))
    };
    let one = with(1);
    (0..4).for_each(|_| assert!(with(3) == one));
    // Far yarns have no noise, and so no seed.
    assert!(one == draw(&scene, &camera, &RenderOptions { seed: 1, spp: 3, ..options() }));
}

#[test]
fn a_round_picture_has_the_pixels_of_the_whole_one() {
    let scene = tangle();
    for (height, distance) in [(40.0, 90.0), (4000.0, 9000.0)] {
        let camera = facing(distance, height);
        let whole = draw(&scene, &camera, &options());
        let is_round = RenderOptions { is_round: true, ..options() };
        let round = draw(&scene, &camera, &is_round);
        let rows = draw(&scene, &camera, &RenderOptions { rows: Some(30..50), ..is_round });
        let row_bytes = SIZE as usize * 4;
        assert!(rows.as_raw()[..] == round.as_raw()[30 * row_bytes..50 * row_bytes]);
        let middle = f64::from(SIZE) / 2.0;
        for (x, y, pixel) in whole.enumerate_pixels() {
            let [across, down] = [x, y].map(|at| f64::from(at) + 0.5 - middle);
            let from_middle = across.hypot(down);
            let own = round.get_pixel(x, y);
            assert!(own == pixel || from_middle > middle, "{height} {x} {y}");
            assert!(own.0[3] == 0 || from_middle < middle + 4.0, "{height} {x} {y}");
        }
    }
}

#[test]
fn a_picture_that_nobody_wants_any_longer_ends_early() {
    let (scene, stop) = (tangle(), Arc::new(AtomicBool::new(true)));
    let stopped = RenderOptions { stop: Some(Arc::clone(&stop)), ..options() };
    let empty = draw(&scene, &facing(400.0, 110.0), &stopped);
    assert!(empty == draw(&Scene::default(), &facing(400.0, 110.0), &options()));
    stop.store(false, Ordering::Relaxed);
    let whole = draw(&scene, &facing(400.0, 110.0), &stopped);
    assert!(whole == draw(&scene, &facing(400.0, 110.0), &options()) && whole != empty);
}

#[test]
fn far_shadows_fall_where_the_sun_is_hidden_and_nowhere_else() {
    // A mat, and a small one 30 mm above its middle, on the side of the sun.
    let mut scene = Scene { looks: vec![look(Vec3::splat(0.6), 0.1)], ..Scene::default() };
    for line in 0_u16..400 {
        let y = f32::from(line) * 0.25 - 50.0;
        scene.push_strand((0_u8..=100).map(|i| Vec3::new(f32::from(i) - 50.0, y, 0.0)), 0);
    }
    let lit = draw(&scene, &facing(400.0, 110.0), &RenderOptions { spp: 16, ..options() });
    let toward_sun = RenderOptions::default().light.around(&facing(400.0, 110.0)).toward_sun;
    for line in 0_u16..80 {
        let y = f32::from(line) * 0.25 - 10.0;
        scene.push_strand(
            (0_u8..=20).map(|i| Vec3::new(f32::from(i) - 10.0, y, 0.0) + toward_sun * 30.0),
            0,
        );
    }
    let shadowed = draw(&scene, &facing(400.0, 110.0), &RenderOptions { spp: 16, ..options() });
    let at = |picture: &RgbaImage, x: f32, y: f32| {
        let pixel = |mm: f32| (f32::from(u16::try_from(SIZE).unwrap()) * (0.5 + mm / 110.0)) as u32;
        let cells =
            (0..25).map(|i| picture.get_pixel(pixel(x) + i % 5 - 2, pixel(-y) + i / 5 - 2).0);
        cells.map(|texel| f32::from(texel[1])).sum::<f32>() / 25.0
    };
    let share = |x, y| at(&shadowed, x, y) / at(&lit, x, y);
    assert!(share(3.0, -3.0) < 0.8, "in its shadow: {}", share(3.0, -3.0));
    for (x, y) in [(40.0, 40.0), (-40.0, -40.0), (40.0, -40.0)] {
        assert!((share(x, y) - 1.0).abs() < 0.02, "away from it: {}", share(x, y));
    }
}

#[test]
fn odd_strands_are_drawn_or_passed_over() {
    let looks = vec![look(Vec3::splat(0.6), 0.3), look(Vec3::ONE, 0.0), look(Vec3::ONE, f32::NAN)];
    let mut scene = Scene { looks, ..Scene::default() };
    scene.push_strand([], 0);
    scene.push_strand([Vec3::ZERO], 0);
    scene.push_strand([Vec3::X, Vec3::X, Vec3::X], 0);
    scene.push_strand([Vec3::NAN, Vec3::NEG_X, Vec3::INFINITY], 0);
    scene.push_strand([Vec3::NEG_Y, Vec3::Y], 1);
    scene.push_strand([Vec3::NEG_Y, Vec3::Y], 2);
    let picture = draw(&scene, &facing(40.0, 4.0), &options());
    for x in [30, 60, 90] {
        let pixel = picture.get_pixel(x, 60).0;
        assert!(pixel[3] == 255 && pixel[0] > 20, "a ball at {x}: {pixel:?}");
    }
    assert_eq!(picture.get_pixel(60, 85).0[3], 0, "yarns without a radius are not seen");
    let far = draw(&scene, &facing(4000.0, 400.0), &RenderOptions { spp: 16, ..options() });
    let seen = |x: u32| far.get_pixel(x, 60).0[3];
    assert!(
        (58..63).map(seen).any(|alpha| alpha > 0) && (0..50).map(seen).all(|alpha| alpha == 0),
        "specks from afar"
    );
}

#[test]
fn progress_reaches_the_end() {
    let reported = std::sync::Mutex::new(Vec::new());
    let _ = render(&tangle(), &facing(40.0, 10.0), &options(), &|share| {
        reported.lock().unwrap().push(share);
    });
    let reported = reported.into_inner().unwrap();
    assert!(reported.len() == SIZE as usize && reported.contains(&1.0));
    assert!(reported.iter().all(|share| (0.0..=1.0).contains(share)));
}

/// A mat of loops, some of them a pixel high.
fn mat(radius: f32) -> Scene {
    let looks = vec![look(Vec3::new(0.6, 0.3, 0.1), radius), look(Vec3::splat(0.7), radius)];
    let mut scene = Scene { looks, ..Scene::default() };
    for line in 0_u8..60 {
        let x = f32::from(line) * 0.25;
        let loops = (0_u16..600).map(|i| {
            let turn = f32::from(i) * 0.7;
            Vec3::new(
                x + turn.sin() * 0.2,
                f32::from(i) * 0.025,
                turn.cos() * 0.12 + f32::from(line % 2) * 0.1,
            )
        });
        scene.push_strand(loops, u16::from(line % 2));
    }
    scene
}

/// Linear light and coverage of some pixels.
fn sums<'a>(pixels: impl Iterator<Item = &'a Rgba<u8>>) -> [f64; 4] {
    let linear = |byte: u8| (f64::from(byte) / 255.0).powf(2.2);
    pixels.fold([0.0; 4], |sum, pixel| {
        let alpha = f64::from(pixel.0[3]) / 255.0;
        let [r, g, b, _] = pixel.0.map(|byte| linear(byte) * alpha);
        [sum[0] + r, sum[1] + g, sum[2] + b, sum[3] + alpha]
    })
}

/// A picture four times smaller.
fn shrunk(picture: &RgbaImage) -> RgbaImage {
    RgbaImage::from_fn(picture.width() / 4, picture.height() / 4, |x, y| {
        let [r, g, b, cover] =
            sums((0..16).map(|i| picture.get_pixel(4 * x + i % 4, 4 * y + i / 4)));
        let byte = |light: f64| (255.0 * (light / cover.max(1e-9)).powf(1.0 / 2.2)).round() as u8;
        Rgba([byte(r), byte(g), byte(b), (255.0 * cover / 16.0).round() as u8])
    })
}

/// What `lod` must not change: no colour by more than 5 % of the strongest, coverage by no more
/// than 2 %.
fn assert_alike(exact: &RgbaImage, coarse: &RgbaImage) {
    assert!(exact != coarse, "nothing was left out");
    let [[red, green, blue, cover], coarse] = [exact, coarse].map(|picture| sums(picture.pixels()));
    let light = red.max(green).max(blue);
    println!("of {light:.0}: {red:.0} {green:.0} {blue:.0} {cover:.0}, {coarse:.0?}");
    for (index, colour) in [red, green, blue].into_iter().enumerate() {
        assert!(
            (coarse[index] - colour).abs() < 0.05 * light,
            "colour {index}: {colour} {}",
            coarse[index]
        );
    }
    assert!((coarse[3] / cover - 1.0).abs() < 0.02, "coverage: {cover} {}", coarse[3]);
}

/// Yarns that are drawn as masks, and merged pieces of traced ones, keep colour and coverage.
#[test]
fn far_yarns_keep_colour_and_coverage() {
    for radius in [0.05, 0.15] {
        let scene = mat(radius);
        let camera = Camera::view(View::Front, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
        let [exact, coarse] = [false, true]
            .map(|lod| draw(&scene, &camera, &RenderOptions { spp: 16, lod, ..options() }));
        assert_alike(&exact, &coarse);
    }
}

/// Drawing pieces and tracing rays agree on real cloth, shadows of folds and what is seen through
/// holes included.
#[test]
fn far_cloth_looks_as_traced() {
    for (fabric, view) in [("tricot", View::Front), ("locknit", View::Back)] {
        let scene = cloth::swatch(&Fabric::named(fabric).unwrap(), 70, 70);
        let camera = Camera::view(view, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
        // Four times as fine, for pixels so large that traced pieces are coarse too.
        let fine = draw(
            &scene,
            &camera,
            &RenderOptions { width: 4 * SIZE, height: 4 * SIZE, lod: false, ..options() },
        );
        let traced = shrunk(&fine);
        let drawn = draw(&scene, &camera, &RenderOptions { spp: 16, ..options() });
        assert_alike(&traced, &drawn);
        let [traced, drawn] =
            [traced, drawn].map(|picture| DynamicImage::from(picture).into_rgb8());
        let difference = flip(&traced, &drawn).mean();
        println!("{fabric}: mean FLIP {difference:.4}");
        assert!(difference < 0.08, "{fabric}: {difference}");
    }
}

/// A picture of a yarn, red at its edges and blue in its middle: from afar both colours are to be
/// seen.
#[test]
fn far_textures_are_seen_from_edge_to_edge() {
    let base = RgbaImage::from_fn(8, 32, |_, y| {
        if (8..24).contains(&y) { Rgba([20, 40, 200, 255]) } else { Rgba([200, 40, 20, 255]) }
    });
    let plain = |texel| Mips::new(RgbaImage::from_pixel(8, 32, Rgba(texel)), MapKind::Plain);
    let mut scene = mat(0.05);
    scene.maps.push(Maps {
        base: Mips::new(base, MapKind::Color),
        normal: plain([128, 128, 255, 255]),
        surface: plain([255, 180, 0, 255]),
        length: 1.0,
        width: 0.1,
    });
    scene.looks.iter_mut().for_each(|look| look.maps = Some(0));
    let camera = Camera::view(View::Front, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
    let [exact, coarse] = [false, true]
        .map(|lod| draw(&scene, &camera, &RenderOptions { spp: 16, lod, ..options() }));
    assert_alike(&exact, &coarse);
}

#[test]
fn the_processor_draws_what_it_drew() {
    let options = RenderOptions { width: 256, height: 256, ..RenderOptions::default() };
    let golden = |name: &str, scene: &Scene, view| {
        let camera = Camera::view(view, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
        golden::check(name, &draw(scene, &camera, &options), 0.02, 0.3);
    };
    let locknit = Fabric::named("locknit").unwrap();
    golden("cpu_front", &cloth::swatch(&locknit, 7, 8), View::Front);
    golden("cpu_back", &cloth::swatch(&locknit, 7, 8), View::Back);
    golden("cpu_far", &cloth::swatch(&locknit, 160, 160), View::Iso);
    golden("cpu_net", &cloth::swatch(&Fabric::named("hex-net-3").unwrap(), 12, 18), View::Front);
}

#[test]
fn near_yarns_are_drawn_alike_with_and_without_leaving_out() {
    let scene = tangle();
    let camera = Camera::view(View::Iso, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
    let [exact, coarse] =
        [false, true].map(|lod| draw(&scene, &camera, &RenderOptions { lod, ..options() }));
    assert!(exact == coarse);
}
