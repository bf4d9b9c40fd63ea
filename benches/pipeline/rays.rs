//! Benchmarks of rays against the yarns of the shipped skirt, for the table beside Embree in
//! docs/performance.md: building, one ray a pixel of 960 x 720, and one ray to the sun from each
//! hit.
//!
//! `WARPKNIT_CAPSULES=FILE` also writes the yarns for another program: six little-endian `f32` for
//! each straight piece, its ends relative to the middle of the skirt.

use std::hint::black_box;

use criterion::{Criterion, Throughput};
use glam::DVec3;
use warpknit::drape::Cloth;
use warpknit::render::camera::{Camera, View};
use warpknit::render::cpu::YarnRays;
use warpknit::render::{RenderOptions, cloth};

use super::cpu::CpuTime;
use super::inputs::{area, skirt, tricot_for};

/// Primary rays across and down.
const SIZE: [u32; 2] = [960, 720];

pub(crate) fn benches(criterion: &mut Criterion<CpuTime>) {
    let garment = skirt();
    let fabric = tricot_for(area(&garment), 26_180.0);
    let knitted = Cloth::cover(&garment, &fabric).expect("the skirt has room");
    let scene = cloth::from_cloth(&knitted, &fabric);
    let bounds = scene.bounds().expect("yarns");
    let options = RenderOptions { width: 1920, height: 1080, ..RenderOptions::default() };
    let camera =
        Camera::view(View::Front, &bounds.corners(), Camera::DEFAULT_FOV, 1.0, options.aspect());
    let build = || YarnRays::new(&scene, &camera, &options).expect("yarns");
    let yarns = build();
    if let Some(file) = std::env::var_os("WARPKNIT_CAPSULES") {
        let ends = yarns.pieces().flatten().flat_map(|end| end.truncate().to_array());
        let bytes: Vec<u8> = ends.flat_map(f32::to_le_bytes).collect();
        std::fs::write(file, bytes).expect("a file for the capsules");
    }
    let primary = primary_rays(&yarns, bounds.centre().as_dvec3());
    let toward_sun = DVec3::new(0.3, 0.6, 1.0).normalize();
    let hits: Vec<DVec3> = primary
        .iter()
        .filter_map(|&eye| {
            let distance = f64::from(yarns.nearest(eye, DVec3::NEG_Z)?);
            Some(eye + DVec3::NEG_Z * (distance - 0.05))
        })
        .collect();
    let mut group = criterion.benchmark_group("rays, skirt");
    group.sample_size(10);
    group.bench_function("subdivide and build", |bench| bench.iter(build));
    group.throughput(Throughput::Elements(primary.len() as u64));
    group.bench_function("primary", |bench| {
        let hits = || primary.iter().filter_map(|&eye| yarns.nearest(eye, DVec3::NEG_Z)).count();
        bench.iter(|| black_box(hits()));
    });
    group.throughput(Throughput::Elements(hits.len() as u64));
    group.bench_function("shadow", |bench| {
        let blocked = || hits.iter().filter(|&&hit| yarns.is_blocked(hit, toward_sun)).count();
        bench.iter(|| black_box(blocked()));
    });
    group.finish();
}

/// The origins of parallel rays toward -z that fill the height of the yarns.
fn primary_rays(yarns: &YarnRays, centre: DVec3) -> Vec<DVec3> {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for [start, end] in yarns.pieces() {
        let radius = f64::from(start.w);
        for end in [start, end].map(|end| end.truncate().as_dvec3()) {
            (min, max) = (min.min(end - radius), max.max(end + radius));
        }
    }
    let [width, height] = SIZE.map(f64::from);
    let pixel = (max.y - min.y) / height;
    let middle = f64::midpoint(min.x, max.x);
    (0..SIZE[1])
        .flat_map(|y| (0..SIZE[0]).map(move |x| (f64::from(x), f64::from(y))))
        .map(|(x, y)| {
            let across = middle + (x - width / 2.0) * pixel;
            centre + DVec3::new(across, min.y + (y + 0.5) * pixel, max.z + 10.0)
        })
        .collect()
}
