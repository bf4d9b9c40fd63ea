//! Benchmark of the clearance on the body, a stitch at a time.

use criterion::{BenchmarkId, Criterion, Throughput};
use warpknit::drape::{Cloth, DrapeOptions, clearance};
use warpknit::fabric::Fabric;

use super::cpu::CpuTime;
use super::inputs::{area, skirt};

/// About so many stitches.
const STITCHES: u32 = 50_000;

pub(crate) fn benches(criterion: &mut Criterion<CpuTime>) {
    let garment = skirt();
    let mut group = criterion.benchmark_group("clearance on the body");
    group.sample_size(10);
    group.throughput(Throughput::Elements(u64::from(STITCHES)));
    for (name, bars) in [("tricot", 2.0), ("locknit", 2.0), ("jersey", 1.0)] {
        let fabric = Fabric::named(name).expect("built in");
        let cells = area(&garment) / (fabric.wale_spacing() * fabric.course_spacing());
        let times = (bars * cells / f64::from(STITCHES)).sqrt();
        let densities = [fabric.wales_per_cm, fabric.courses_per_cm].map(|density| density / times);
        let fabric = fabric.at_densities(densities[0], densities[1]).expect("positive");
        let cloth = Cloth::cover(&garment, &fabric).expect("the skirt has room");
        let options = DrapeOptions::default();
        group.bench_function(BenchmarkId::from_parameter(name), |bench| {
            bench.iter(|| clearance::measure(&cloth, &options, fabric.radius(), &mut |_done| ()));
        });
    }
    group.finish();
}
