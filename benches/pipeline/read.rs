//! Benchmark of reading a garment: from two files to panels that are ready to be covered.

use criterion::{Criterion, Throughput};

use super::cpu::CpuTime;
use super::inputs::skirt;

pub(crate) fn benches(criterion: &mut Criterion<CpuTime>) {
    let mut group = criterion.benchmark_group("read");
    group.throughput(Throughput::Elements(skirt().summary.triangles as u64));
    group.bench_function("skirt", |bench| bench.iter(skirt));
    group.finish();
}
