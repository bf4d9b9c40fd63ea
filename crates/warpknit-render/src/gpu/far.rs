//! Tests: cloth whose yarns are thinner than pixels has no noise, no holes, and the light of the
//! processor's pictures.

use image::RgbaImage;
use warpknit_core::fabric::Fabric;

use super::parity::adapter;
use crate::{Background, Camera, RenderOptions, RendererChoice, View, cloth, render};

/// Pixels across and down.
const PIXELS: u32 = 96;

/// A fabric of so many wales and courses, on the adapter and on the processor, with so many samples
/// each.
fn drawn(fabric: &str, (view, stitches): (View, u32), samples: [u32; 2]) -> [RgbaImage; 2] {
    let scene = cloth::swatch(&Fabric::named(fabric).unwrap(), stitches, stitches);
    let camera = Camera::view(view, &scene.positions, Camera::DEFAULT_FOV, 1.0, 1.0);
    let distance = camera.eye().distance(scene.bounds().unwrap().centre().as_dvec3());
    let pixel = camera.pixel_size(distance, PIXELS);
    println!("{fabric} {view:?}: {:.2} pixels a yarn", 2.0 * f64::from(scene.radii().0) / pixel);
    let options = RenderOptions {
        width: PIXELS,
        height: PIXELS,
        background: Background::Transparent,
        ..RenderOptions::default()
    };
    [(RendererChoice::Gpu, samples[0]), (RendererChoice::Cpu, samples[1])].map(|(renderer, spp)| {
        render(&scene, &camera, &RenderOptions { renderer, spp, ..options.clone() }, &|_| ())
            .unwrap()
    })
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
    for (fabric, stitches) in [("marquisette", 60), ("jersey", 120), ("locknit", 60)] {
        let cloth = (View::Front, stitches);
        let [few, _] = drawn(fabric, cloth, [4, 1]);
        let [many, _] = drawn(fabric, cloth, [256, 1]);
        let rms = rms(&few, &many);
        println!("  {rms:.2}");
        assert!(rms < 4.0, "{fabric}: {rms}");
    }
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
        let [card, processor] =
            drawn(fabric, (view, stitches), [4, 16]).map(|picture| means(&picture));
        println!("  {card:.3?} {processor:.3?}");
        let cover = card.0 / processor.0;
        assert!((cover - 1.0).abs() < 0.08, "{fabric} {view:?}: cover {cover}");
        for (one, other) in card.1.iter().zip(processor.1) {
            assert!((one - other).abs() < 16.0, "{fabric} {view:?}: {card:?} {processor:?}");
        }
    }
}
