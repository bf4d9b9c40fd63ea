//! Benchmarks of the CPU renderer: yarns wider than a pixel, which are ray-traced, and thinner
//! ones, which are drawn as segments.

use criterion::{BenchmarkId, Criterion};
use warpknit::drape::{Cloth, swatch_panel};
use warpknit::fabric::Fabric;
use warpknit::render::camera::{Camera, View};
use warpknit::render::cloth;
use warpknit::render::{RenderOptions, render};

use super::cpu::CpuTime;

pub(crate) fn benches(criterion: &mut Criterion<CpuTime>) {
    let fabric = Fabric::named("tricot").expect("built in");
    let options = RenderOptions { width: 400, height: 300, ..RenderOptions::default() };
    let mut group = criterion.benchmark_group("render 400x300");
    group.sample_size(10);
    for side in [10_u32, 50, 400] {
        let panel = swatch_panel(&fabric, side, side);
        let scene = cloth::from_cloth(&Cloth::swatch(&panel, &fabric, side, side), &fabric);
        let corners = scene.bounds().expect("yarns").corners();
        let camera =
            Camera::view(View::Front, &corners, Camera::DEFAULT_FOV, 1.0, options.aspect());
        group.bench_function(BenchmarkId::new("tricot", format!("{side} x {side}")), |bench| {
            bench.iter(|| {
                render(&scene, &camera, &options, &|_| {}).expect("the processor draws anything")
            });
        });
    }
    group.finish();
}
