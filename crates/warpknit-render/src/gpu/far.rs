//! Tests: cloth whose yarns are thinner than pixels has no noise, no holes, and the light of the
//! processor's pictures.

use image::RgbaImage;
use warpknit_core::fabric::Fabric;

use wgpu::TextureUsages;

use super::parity::adapter;
use super::{PICTURE, Renderer};
use crate::scene::Scene;
use crate::{Background, Camera, RenderOptions, RendererChoice, View, cloth, render};

/// Pixels across and down.
const PIXELS: u32 = 96;

/// A fabric of so many wales and courses, and a camera that sees all of it.
fn swatch(fabric: &str, view: View, stitches: u32) -> (Scene, Camera) {
    let scene = cloth::swatch(&Fabric::named(fabric).unwrap(), stitches, stitches);
    let camera = Camera::view(view, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
    let distance = camera.eye().distance(scene.bounds().unwrap().centre().as_dvec3());
    let pixel = camera.pixel_size(distance, PIXELS);
    println!("{fabric} {view:?}: {:.2} pixels a yarn", 2.0 * f64::from(scene.radii().0) / pixel);
    (scene, camera)
}

fn options() -> RenderOptions {
    let background = Background::Transparent;
    RenderOptions { width: PIXELS, height: PIXELS, background, ..RenderOptions::default() }
}

/// A picture with so many samples a pixel.
fn drawn((scene, camera): &(Scene, Camera), renderer: RendererChoice, spp: u32) -> RgbaImage {
    render(scene, camera, &RenderOptions { renderer, spp, ..options() }, &|_| ()).unwrap()
}

/// Covered fraction of a picture, and the mean colour of what covers it, of 255.
fn means(picture: &RgbaImage) -> (f64, [f64; 3]) {
    let (mut cover, mut sums) = (0.0, [0.0; 3]);
    for pixel in picture.pixels() {
        let alpha = f64::from(pixel.0[3]) / 255.0;
        cover += alpha;
        sums.iter_mut().zip(pixel.0).for_each(|(sum, value)| *sum += alpha * f64::from(value));
    }
    (cover / f64::from(PIXELS * PIXELS), sums.map(|sum| sum / cover))
}

/// Root mean square difference of premultiplied colours where there is cloth, of 255.
fn rms(one: &RgbaImage, other: &RgbaImage) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    let pairs = one.pixels().zip(other.pixels());
    for (one, other) in pairs.filter(|(one, other)| one.0[3].max(other.0[3]) > 0) {
        count += 3.0;
        let premultiplied = |pixel: &image::Rgba<u8>, axis: usize| {
            f64::from(pixel.0[axis]) * f64::from(pixel.0[3]) / 255.0
        };
        squares += (0..3)
            .map(|axis| (premultiplied(one, axis) - premultiplied(other, axis)).powi(2))
            .sum::<f64>();
    }
    f64::sqrt(squares / count)
}

#[test]
fn pictures_from_afar_have_no_noise() {
    if adapter("pictures_from_afar_have_no_noise").is_none() {
        return;
    }
    // So wide that fewer than 8 x 8 texels a pixel will do, and 256 samples are more.
    for (fabric, stitches) in [("marquisette", 30), ("jersey", 120), ("locknit", 60)] {
        let swatch = swatch(fabric, View::Front, stitches);
        let [few, many] = [4, 256].map(|spp| drawn(&swatch, RendererChoice::Gpu, spp));
        let rms = rms(&few, &many);
        println!("  {rms:.2}");
        assert!(rms > 0.1 && rms < 4.0, "{fabric}: {rms}");
    }
}

#[test]
fn windows_show_what_pictures_show() {
    let Some(gpu) = adapter("windows_show_what_pictures_show") else { return };
    let (scene, camera) = swatch("marquisette", View::Front, 60);
    // Several tiles, also on cards.
    let options = RenderOptions { width: 300, height: 280, ..options() };
    let mut renderer = Renderer::new(gpu.clone(), options.samples).unwrap();
    let yarns = renderer.load(&scene, options.st).unwrap();
    let picture = renderer.draw(&yarns, &camera, &options).unwrap();
    let size = [options.width, options.height];
    let target = gpu.texture(PICTURE, size, TextureUsages::COPY_SRC, 1);
    let view = target.create_view(&wgpu::TextureViewDescriptor::default());
    renderer.draw_to(&yarns, &camera, &options, &view).unwrap();
    let mut shown = RgbaImage::new(options.width, options.height);
    gpu.read(&target, &mut shown, [0, 0]).unwrap();
    assert!(shown == picture && picture.pixels().any(|pixel| pixel.0[3] > 0));
}

#[test]
fn cloth_from_afar_has_the_cover_and_light_of_the_processors_pictures() {
    if adapter("cloth_from_afar_has_the_cover_and_light_of_the_processors_pictures").is_none() {
        return;
    }
    for (fabric, view, stitches) in [
        ("locknit", View::Front, 240),
        ("locknit", View::Iso, 240),
        ("locknit", View::Back, 60),
        ("jersey", View::Front, 120),
        ("marquisette", View::Iso, 120),
    ] {
        let swatch = swatch(fabric, view, stitches);
        let [card, processor] = [(RendererChoice::Gpu, 4), (RendererChoice::Cpu, 16)]
            .map(|(renderer, spp)| means(&drawn(&swatch, renderer, spp)));
        println!("  {card:.3?} {processor:.3?}");
        let cover = card.0 / processor.0;
        assert!((cover - 1.0).abs() < 0.08, "{fabric} {view:?}: cover {cover}");
        for (one, other) in card.1.iter().zip(processor.1) {
            assert!((one - other).abs() < 16.0, "{fabric} {view:?}: {card:?} {processor:?}");
        }
    }
}
