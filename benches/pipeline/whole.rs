//! A run from garment to yarns, and to a picture, at the source paper's sizes on our own skirt.

use std::path::Path;

use criterion::{BenchmarkId, Criterion, Throughput};
use warpknit::drape::{self, Block, Cloth, Options};
use warpknit::fabric::Fabric;
use warpknit::garment::{Garment, Panel, ReadOptions, read};

use super::cpu::CpuTime;

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

pub(crate) fn benches(criterion: &mut Criterion<CpuTime>) {
    let garment = skirt();
    let mut group = criterion.benchmark_group("knit, locate and map");
    group.sample_size(10);
    for stitches in [576_u32, 3500, 8480, 26_180, 262_000] {
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
