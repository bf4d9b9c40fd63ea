//! What each stage costs: `cargo bench`. Sizes are the source paper's Table 2 on our own skirt.

use std::path::Path;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use warpknit::drape::{self, Block, Cloth, Options};
use warpknit::fabric::Fabric;
use warpknit::garment::{Garment, Panel, ReadOptions, read};
use warpknit::knit::mesh::StructureMesh;
use warpknit::knit::{Knitted, Pattern};
use warpknit::locate::Locator;
use warpknit::map::{Mapping, map};

fn skirt() -> Garment {
    let meshes = Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes");
    let read = read(&meshes.join("skirt_flat.obj"), Some(&meshes.join("skirt_draped.obj")), &ReadOptions::default());
    read.expect("a shipped garment")
}

fn tricot_for(garment: &Garment, stitches: f64) -> Fabric {
    let fabric = Fabric::named("tricot").expect("built in");
    let area: f64 = garment.panels.iter().map(Panel::area).sum();
    let times = (2.0 * area / (fabric.wale_spacing() * fabric.course_spacing()) / stitches).sqrt();
    let (wales, courses) = (fabric.wales_per_cm / times, fabric.courses_per_cm / times);
    fabric.at_densities(wales, courses).expect("positive")
}

/// Data points of the skirt's first gore, yarn by yarn.
fn points(garment: &Garment, fabric: &Fabric) -> Vec<DVec3> {
    let mesh = StructureMesh::anchored_at(fabric, garment.panels[0].bounds()[0]);
    let (pattern, size) = (Pattern::new(fabric), garment.panels[0].size());
    let mut knitted = Knitted::default();
    for guide in pattern.yarns_over(0, 0.0..size.x) {
        pattern.lay(0, guide, pattern.steps_along(0, 0.0..size.y), &mesh, &mut knitted);
    }
    knitted.points
}

fn stages(criterion: &mut Criterion) {
    let garment = skirt();
    let panel = &garment.panels[0];
    let points = points(&garment, &tricot_for(&garment, 100_000.0));
    let mut group = criterion.benchmark_group("stages");
    group.bench_function("build", |bench| bench.iter(|| Locator::new(panel)));
    group.throughput(Throughput::Elements(points.len() as u64));
    let locator = Locator::new(panel);
    group.bench_function("locate", |bench| bench.iter(|| locator.locate(&points)));
    let (flat, located): (Vec<_>, Vec<_>) =
        points.iter().zip(locator.locate(&points)).filter_map(|(point, at)| Some((*point, at?))).unzip();
    group.throughput(Throughput::Elements(flat.len() as u64));
    for mapping in [Mapping::Smooth, Mapping::Frame] {
        let name = format!("map {mapping:?}").to_lowercase();
        group.bench_function(name, |bench| bench.iter(|| map(panel, &flat, &located, mapping)));
    }
    group.finish();
}

fn whole(criterion: &mut Criterion) {
    let garment = skirt();
    let mut group = criterion.benchmark_group("knit, locate and map");
    for stitches in [576_u32, 3500, 8480, 26180] {
        let cloth = Cloth::cover(&garment, &tricot_for(&garment, f64::from(stitches))).expect("the skirt has room");
        group.throughput(Throughput::Elements(u64::from(stitches)));
        group.bench_function(BenchmarkId::from_parameter(stitches), |bench| {
            bench.iter(|| {
                let deliver = &mut |blocks: &[Block]| {
                    std::hint::black_box(blocks);
                    Ok::<_, std::convert::Infallible>(())
                };
                drape::run(&cloth, &Options::default(), &mut |_, _| {}, deliver)
            });
        });
    }
    group.finish();
}

/// What each run pays before it lays a yarn: the repeat in balance, for small and large ones.
fn repeats(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("relax");
    for name in ["tricot", "locknit", "velour", "double-atlas", "hex-net-5", "power-net"] {
        let fabric = Fabric::named(name).expect("built in");
        group.bench_function(BenchmarkId::from_parameter(name), |bench| bench.iter(|| Pattern::new(&fabric)));
    }
    group.finish();
}

criterion_group!(benches, repeats, stages, whole);
criterion_main!(benches);
