//! The time of a frame on the graphics adapter: `cargo bench --bench card`.
//!
//! The shipped skirt in tricot at three densities, 1920 x 1080, four samples, with and without level of
//! detail. The yarns are on the adapter already; a frame includes reading its pixels back. The times are
//! wall times, since the adapter has no CPU time. Without a graphics card there is nothing to measure.

use std::path::Path;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use warpknit::drape::Cloth;
use warpknit::fabric::Fabric;
use warpknit::garment::{ReadOptions, read};
use warpknit::render::camera::{Camera, View};
use warpknit::render::gpu::{Gpu, Renderer};
use warpknit::render::scene::Scene;
use warpknit::render::{RenderOptions, cloth};

/// Wales a cm, with the pieces a stitch that are uploaded: no pixel shows more of the densest cloth.
const DENSITIES: [(f64, u32); 3] = [(1.03, 40), (6.6, 10), (13.8, 10)];

/// The skirt in tricot with so many wales a cm.
fn skirt(wales_per_cm: f64) -> Scene {
    let meshes = Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes");
    let [flat, draped] = ["skirt_flat.obj", "skirt_draped.obj"].map(|name| meshes.join(name));
    let garment =
        read(&flat, Some(&draped), &ReadOptions::default()).expect("a shipped garment is readable");
    let fabric = Fabric::named("tricot").expect("built in");
    let courses_per_cm = wales_per_cm * fabric.courses_per_cm / fabric.wales_per_cm;
    let fabric = fabric.at_densities(wales_per_cm, courses_per_cm).expect("usual densities");
    cloth::from_cloth(&Cloth::cover(&garment, &fabric).expect("the skirt has room"), &fabric)
}

fn benches(criterion: &mut Criterion) {
    let gpu = match Gpu::find(false) {
        Ok(gpu) => gpu,
        Err(error) => {
            println!("card: skipped, {error}");
            return;
        }
    };
    println!("on {}", gpu.name());
    let mut group = criterion.benchmark_group("card 1920x1080");
    group.sample_size(10).warm_up_time(Duration::from_millis(500));
    for (wales_per_cm, st) in DENSITIES {
        let scene = skirt(wales_per_cm);
        let mut renderer = Renderer::new(gpu.clone(), 4).expect("shaders compile");
        let yarns = renderer.load(&scene, st).expect("the skirt fits");
        for lod in [true, false] {
            let options =
                RenderOptions { width: 1920, height: 1080, lod, st, ..RenderOptions::default() };
            let camera = Camera::view(
                View::Front,
                &scene.positions,
                Camera::DEFAULT_FOV,
                1.0,
                options.aspect(),
            );
            let name = format!("{} stitches", scene.stitches.len());
            let id = BenchmarkId::new(name, if lod { "lod on" } else { "lod off" });
            group.bench_function(id, |bench| {
                bench
                    .iter(|| renderer.draw(&yarns, &camera, &options).expect("the skirt is drawn"));
            });
        }
    }
    group.finish();
}

criterion_group!(card, benches);
criterion_main!(card);
