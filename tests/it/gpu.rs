//! The graphics processor draws what the processor draws, and what it drew before.
//!
//! On the software driver pictures are the same to the byte from run to run. Without any adapter
//! these tests say that they are skipped; where `WARPKNIT_CI` is set they fail.

use crate::flip::flip;
use crate::golden;
use glam::{DVec3, Vec3};
use image::{DynamicImage, Rgba, RgbaImage};
use warpknit::drape;
use warpknit::fabric::Fabric;
use warpknit::garment::{ReadOptions, read};
use warpknit::render::cloth;
use warpknit::render::gpu::Gpu;
use warpknit::render::maps::Maps;
use warpknit::render::mips::{MapKind, Mips};
use warpknit::render::scene::{Scene, ScenePoint, Shape, YarnLook};
use warpknit::render::{Background, Camera, Painter, RenderOptions, RendererChoice, View, render};

/// Whether there is an adapter, be it software; CI must have one.
pub(crate) fn can_draw(test: &str) -> bool {
    match Gpu::find(true) {
        Ok(_) => true,
        Err(error) => {
            assert!(std::env::var_os("WARPKNIT_CI").is_none(), "{error}");
            eprintln!("{test}: skipped, {error}");
            false
        }
    }
}

fn on(
    renderer: RendererChoice,
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
) -> RgbaImage {
    render(scene, camera, &RenderOptions { renderer, ..options.clone() }, &|_| ()).unwrap()
}

/// Tubes so fine that their section doesn't show from near.
fn fine() -> RenderOptions {
    RenderOptions { st: 80, sr: 16, ..RenderOptions::default() }
}

/// Mean FLIP between both renderers' pictures, 384 pixels square, of sixteen samples.
pub(crate) fn difference(scene: &Scene, camera: &Camera, options: RenderOptions) -> f64 {
    let options = RenderOptions { width: 384, height: 384, spp: 16, lod: false, ..options };
    // The processor's noise is no difference between the two.
    let drawn = |renderer, spp| {
        DynamicImage::from(on(renderer, scene, camera, &RenderOptions { spp, ..options.clone() }))
            .into_rgb8()
    };
    let [cpu, gpu] = [drawn(RendererChoice::Cpu, 64), drawn(RendererChoice::Gpu, 16)];
    let difference = f64::from(flip(&cpu, &gpu).mean());
    println!("mean FLIP {difference:.4}");
    difference
}

/// A picture of a spun yarn along x: two plies, darker between them, fuzz that thins out to both
/// sides.
fn yarn_picture() -> RgbaImage {
    RgbaImage::from_fn(96, 48, |x, y| {
        let across = (f32::from(u16::try_from(y).unwrap()) + 0.5) / 24.0 - 1.0;
        let turn = std::f32::consts::TAU * f32::from(u16::try_from(x).unwrap()) / 96.0;
        let ply = (across * 3.0 - turn).sin().abs();
        let alpha = ((1.0 - across.abs()) * 4.0).clamp(0.0, 1.0);
        let shade = |value: f32| (value * (0.55 + 0.45 * ply)) as u8;
        Rgba([shade(214.0), shade(170.0), shade(120.0), (alpha * 255.0) as u8])
    })
}

/// A swatch of ribbons with that picture, as wide as its yarns lie apart.
fn ribbons(wales: u32, courses: u32) -> Scene {
    let fabric = Fabric::named("tricot").unwrap();
    let tubes = cloth::swatch(&fabric, wales, courses);
    let base = yarn_picture();
    let plain = |texel| RgbaImage::from_pixel(base.width(), base.height(), Rgba(texel));
    let width = tubes.looks[0].radius * 2.5;
    let maps = Maps {
        normal: Mips::new(plain([128, 128, 255, 255]), MapKind::Normal),
        surface: Mips::new(plain([255, 191, 0, 255]), MapKind::Plain),
        base: Mips::new(base, MapKind::Color),
        length: width * 2.0,
        width,
    };
    let mut looks = tubes.looks.clone();
    looks.iter_mut().for_each(|look| (look.maps, look.radius) = (Some(0), width / 2.0));
    let mut scene = Scene { shape: Shape::Ribbon, looks, maps: vec![maps], ..Scene::default() };
    for strand in &tubes.strands {
        let points = &tubes.positions[strand.points.start as usize..strand.points.end as usize];
        let stitches =
            &tubes.stitches[strand.stitches.start as usize..strand.stitches.end as usize];
        let stitches = stitches.iter().map(|stitch| stitch - strand.points.start);
        let facing = |&position: &Vec3| ScenePoint { position, normal: Vec3::Z, flatten: 1.0 };
        scene.push_stitches(points.iter().map(facing), stitches, strand.look);
    }
    scene
}

/// The shipped skirt in the fabric's loops, `wales_per_cm`.
fn skirt(wales_per_cm: f64) -> Scene {
    let mesh =
        |name: &str| std::path::PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("meshes").join(name);
    let garment =
        read(&mesh("skirt_flat.obj"), Some(&mesh("skirt_draped.obj")), &ReadOptions::default())
            .unwrap();
    let fabric = Fabric::named("tricot").unwrap();
    let aspect = fabric.courses_per_cm / fabric.wales_per_cm;
    let fabric = fabric.at_densities(wales_per_cm, wales_per_cm * aspect).unwrap();
    let cloth = drape::Cloth::cover(&garment, &fabric).unwrap();
    cloth::from_cloth(&cloth, &fabric)
}

fn front(scene: &Scene) -> Camera {
    Camera::view(View::Front, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0)
}

#[test]
fn both_renderers_draw_the_same_swatch() {
    if can_draw("both_renderers_draw_the_same_swatch") {
        let scene = cloth::swatch(&Fabric::named("tricot").unwrap(), 14, 16);
        assert!(difference(&scene, &front(&scene), fine()) < 0.06);
    }
}

#[test]
fn both_renderers_draw_the_same_weft_knits() {
    if can_draw("both_renderers_draw_the_same_weft_knits") {
        // These two differ most of the built-in fabrics.
        for fabric in ["jersey", "rib-2x2"] {
            let scene = cloth::swatch(&Fabric::named(fabric).unwrap(), 12, 14);
            assert!(difference(&scene, &front(&scene), fine()) < 0.06, "{fabric}");
            let iso = Camera::view(View::Iso, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
            assert!(difference(&scene, &iso, fine()) < 0.06, "{fabric}, obliquely");
        }
    }
}

#[test]
fn both_renderers_draw_the_same_textured_ribbons() {
    if can_draw("both_renderers_draw_the_same_textured_ribbons") {
        let scene = ribbons(9, 10);
        assert!(difference(&scene, &front(&scene), fine()) < 0.06);
    }
}

#[test]
fn both_renderers_draw_the_same_skirt() {
    if can_draw("both_renderers_draw_the_same_skirt") {
        let scene = skirt(0.72);
        assert!(difference(&scene, &front(&scene), RenderOptions::default()) < 0.06);
    }
}

/// Compares with what the software driver drew before, 256 pixels square. Graphics cards filter
/// textures in their own way; they may differ by as much as both renderers may.
fn golden(name: &str, scene: &Scene, camera: &Camera, options: &RenderOptions) {
    if can_draw(name) {
        let options = RenderOptions { width: 256, height: 256, ..options.clone() };
        let [mean, p99] = if Gpu::find(false).is_ok() { [0.06, 1.0] } else { [0.01, 0.1] };
        golden::check(name, &on(RendererChoice::Gpu, scene, camera, &options), mean, p99);
    }
}

#[test]
fn golden_tubes_from_the_front_and_the_back() {
    let scene = cloth::swatch(&Fabric::named("locknit").unwrap(), 6, 6);
    golden("gpu_tubes_front", &scene, &front(&scene), &RenderOptions::default());
    let back = Camera::view(View::Back, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
    golden("gpu_tubes_back", &scene, &back, &RenderOptions::default());
}

#[test]
fn golden_strips_of_a_far_skirt() {
    let scene = skirt(0.6);
    golden("gpu_strips", &scene, &front(&scene), &RenderOptions::default());
    golden(
        "gpu_strips_exact",
        &scene,
        &front(&scene),
        &RenderOptions { lod: false, samples: 1, ..RenderOptions::default() },
    );
}

#[test]
fn golden_net_on_nothing() {
    let scene = cloth::swatch(&Fabric::named("hex-net-5").unwrap(), 12, 20);
    golden(
        "gpu_net",
        &scene,
        &front(&scene),
        &RenderOptions { background: Background::Transparent, ..RenderOptions::default() },
    );
}

#[test]
fn golden_ribbons_with_fuzz() {
    let scene = ribbons(5, 5);
    golden("gpu_ribbons", &scene, &front(&scene), &RenderOptions::default());
}

#[test]
fn golden_textured_tubes() {
    let mut scene = ribbons(5, 5);
    scene.shape = Shape::Tube;
    scene.looks.iter_mut().for_each(|look| look.radius *= 0.5);
    golden("gpu_textured_tubes", &scene, &front(&scene), &RenderOptions::default());
}

#[test]
fn golden_shadow_of_one_yarn_on_another() {
    let looks = vec![YarnLook::plain(Vec3::splat(0.6), 0.7, 0.3)];
    let mut scene = Scene { looks, ..Scene::default() };
    for row in 0_u8..9 {
        let y = f32::from(row) * 0.6 - 2.4;
        scene.push_strand([Vec3::new(-3.0, y, 0.0), Vec3::new(3.0, y, 0.0)], 0);
    }
    scene.push_strand([Vec3::new(-0.5, -3.0, 1.6), Vec3::new(0.5, 3.0, 1.6)], 0);
    golden(
        "gpu_shadow",
        &scene,
        &Camera::look_at(DVec3::Z * 14.0, DVec3::ZERO, 0.4, 1.0),
        &RenderOptions { spp: 16, ..RenderOptions::default() },
    );
}

#[test]
fn the_same_bytes_every_time_and_for_any_number_of_threads() {
    if can_draw("the_same_bytes_every_time_and_for_any_number_of_threads") {
        let scene = cloth::swatch(&Fabric::named("tricot").unwrap(), 6, 6);
        let options = RenderOptions { width: 128, height: 128, ..RenderOptions::default() };
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| on(RendererChoice::Gpu, &scene, &front(&scene), &options))
        };
        assert!(with(1) == with(2));
    }
}

#[test]
fn tiles_of_a_large_picture_join() {
    if can_draw("tiles_of_a_large_picture_join") {
        // One yarn across the border between two tiles, at 1022 pixels: as bright on both sides.
        let mut scene =
            Scene { looks: vec![YarnLook::plain(Vec3::splat(0.6), 0.7, 0.5)], ..Scene::default() };
        scene.push_strand([Vec3::NEG_X * 50.0, Vec3::ZERO, Vec3::X * 50.0], 0);
        let options = RenderOptions {
            width: 1100,
            height: 60,
            samples: 1,
            spp: 1,
            ..RenderOptions::default()
        };
        let camera = Camera::look_at(DVec3::Z * 100.0, DVec3::ZERO, 0.02, 1.0);
        let picture = on(RendererChoice::Gpu, &scene, &camera, &options);
        for y in 10..50 {
            let [before, after] = [1021, 1022].map(|x| picture.get_pixel(x, y).0);
            assert!(
                before.iter().zip(after).all(|(a, b)| a.abs_diff(b) <= 24),
                "row {y}: {before:?} {after:?}"
            );
        }
    }
}

#[test]
fn an_empty_scene_is_all_background() {
    if can_draw("an_empty_scene_is_all_background") {
        let options = RenderOptions {
            width: 33,
            height: 20,
            background: "#1030f0".parse().unwrap(),
            ..RenderOptions::default()
        };
        let camera = Camera::look_at(DVec3::Z, DVec3::ZERO, 0.5, 1.0);
        let picture = on(RendererChoice::Gpu, &Scene::default(), &camera, &options);
        assert!(picture.pixels().all(|pixel| pixel.0 == [0x10, 0x30, 0xF0, 255]));
    }
}

#[test]
fn odd_strands_are_drawn_or_passed_over() {
    if can_draw("odd_strands_are_drawn_or_passed_over") {
        let looks = [0.3, 0.0, f32::NAN]
            .map(|radius| YarnLook::plain(Vec3::splat(0.6), 0.7, radius))
            .to_vec();
        let mut scene = Scene { looks, ..Scene::default() };
        scene.push_strand([], 0);
        scene.push_strand([Vec3::NAN, Vec3::NEG_X, Vec3::X, Vec3::INFINITY], 0);
        scene.push_strand([Vec3::NEG_Y, Vec3::Y], 1);
        scene.push_strand([Vec3::NEG_Y, Vec3::Y], 2);
        let options = RenderOptions {
            width: 60,
            height: 60,
            background: Background::Transparent,
            ..RenderOptions::default()
        };
        let picture = on(
            RendererChoice::Gpu,
            &scene,
            &Camera::look_at(DVec3::Z * 20.0, DVec3::ZERO, 0.2, 1.0),
            &options,
        );
        assert_eq!(picture.get_pixel(30, 30).0[3], 255, "the good part of a strand is drawn");
        assert_eq!(picture.get_pixel(30, 48).0[3], 0, "yarns without a radius are not");
    }
}

/// Covered pixels of a picture without a background.
fn cover(picture: &RgbaImage) -> f64 {
    picture.pixels().map(|pixel| f64::from(pixel.0[3]) / 255.0).sum()
}

#[test]
fn a_long_strand_is_drawn_through_all_of_its_points() {
    if !can_draw("a_long_strand_is_drawn_through_all_of_its_points") {
        return;
    }
    let mut scene = Scene::default();
    scene.looks.push(YarnLook::plain(Vec3::splat(0.5), 0.7, 0.1));
    // A fibre's helix: fifty turns of eight points.
    let points = (0_u16..=400).map(|at| {
        let (sin, cos) = (f32::from(at) * std::f32::consts::FRAC_PI_4).sin_cos();
        Vec3::new(f32::from(at) * 0.1, cos, sin)
    });
    scene.push_strand(points, 0);
    let background = Background::Transparent;
    let options = RenderOptions { width: 256, height: 256, background, ..RenderOptions::default() };
    let [card, processor] = [RendererChoice::Gpu, RendererChoice::Cpu]
        .map(|renderer| cover(&on(renderer, &scene, &front(&scene), &options)));
    assert!((card / processor - 1.0).abs() < 0.05, "{card} {processor}");
}

#[test]
fn without_hardware_the_processor_draws_by_itself() {
    let scene = cloth::swatch(&Fabric::named("tricot").unwrap(), 3, 3);
    let options = RenderOptions {
        width: 16,
        height: 16,
        renderer: RendererChoice::Auto,
        ..RenderOptions::default()
    };
    let mut painter = Painter::new(&scene, &options).unwrap();
    let hardware = Gpu::find(false).is_ok();
    assert_eq!((painter.name() == "cpu", painter.notice()), (!hardware, None));
    let _picture = painter.draw(&front(&scene), &options, &|_| ()).unwrap();
}

#[test]
fn drivers_are_silent() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = crate::cli::warpknit(folder.path());
    command.env_remove("XDG_RUNTIME_DIR").args(["swatch", "--wales", "3", "--courses", "3"]);
    command.args(["--size", "40x30", "--quiet", "-o", "swatch.png"]);
    let said = command.output().unwrap();
    assert_eq!(String::from_utf8_lossy(&said.stderr), "");
    assert!(said.status.success());
}
