//! Benchmarks of knitting: the relaxation of one repeat, which each run does once before it lays
//! yarns, and the data points of yarns.

use criterion::{BenchmarkId, Criterion, Throughput};
use glam::DVec2;
use warpknit::fabric::Fabric;
use warpknit::knit::mesh::StructureMesh;
use warpknit::knit::{Knitted, Pattern};

use super::cpu::CpuTime;

pub(crate) fn benches(criterion: &mut Criterion<CpuTime>) {
    let mut group = criterion.benchmark_group("relax");
    group.sample_size(10);
    for name in
        ["tricot", "locknit", "velour", "double-atlas", "hex-net-5", "power-net", "jersey", "cable"]
    {
        let fabric = Fabric::named(name).expect("built in");
        group.bench_function(name, |bench| bench.iter(|| Pattern::new(&fabric)));
    }
    group.finish();

    let fabric = Fabric::named("tricot").expect("built in");
    let (pattern, mesh) = (Pattern::new(&fabric), StructureMesh::anchored_at(&fabric, DVec2::ZERO));
    let mut group = criterion.benchmark_group("lay");
    for courses in [64_u32, 1024] {
        let points = u64::from(courses) * 32 * 10;
        group.throughput(Throughput::Elements(points));
        let mut knitted = Knitted::default();
        group.bench_function(BenchmarkId::new("tricot", courses), |bench| {
            bench.iter(|| {
                knitted.clear();
                (0..32).for_each(|guide| {
                    pattern.lay(0, guide, 0..i64::from(courses), &mesh, &mut knitted);
                });
                std::hint::black_box(&knitted).points.len()
            });
        });
    }
    group.finish();
}
