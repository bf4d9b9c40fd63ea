//! Benchmarks of sweeps and of the clearance on the body, a stitch at a time.

use std::convert::Infallible;

use criterion::{BenchmarkId, Criterion, Throughput};
use warpknit::drape::{self, Block, Cloth, DrapeOptions, clearance};
use warpknit::garment::Garment;

use super::cpu::CpuTime;
use super::inputs::{area, fabric_for, skirt};

/// About so many stitches are measured, and so many swept.
const MEASURED: f64 = 50_000.0;
const SWEPT: f64 = 5000.0;

pub(crate) fn benches(criterion: &mut Criterion<CpuTime>) {
    let garment = skirt();
    measured(criterion, &garment);
    swept(criterion, &garment);
}

/// The clearance of yarns as they are mapped.
fn measured(criterion: &mut Criterion<CpuTime>, garment: &Garment) {
    let mut group = criterion.benchmark_group("clearance on the body");
    group.sample_size(10);
    for name in ["tricot", "locknit", "jersey"] {
        let fabric = fabric_for(name, area(garment), MEASURED);
        let cloth = Cloth::cover(garment, &fabric).expect("the skirt has room");
        let options = DrapeOptions { sweeps: Some(false), ..DrapeOptions::default() };
        group.throughput(Throughput::Elements(cloth.stitches()));
        group.bench_function(BenchmarkId::from_parameter(name), |bench| {
            bench.iter(|| clearance::measure(&cloth, &options, fabric.radius(), &mut |_done| ()));
        });
    }
    group.finish();
}

/// A run with sweeps and one without. A cable has no table, so sweeps alone keep its lengths.
fn swept(criterion: &mut Criterion<CpuTime>, garment: &Garment) {
    let mut group = criterion.benchmark_group("sweeps");
    group.sample_size(10);
    for name in ["tricot", "locknit", "jersey", "cable"] {
        let fabric = fabric_for(name, area(garment), SWEPT);
        let cloth = Cloth::cover(garment, &fabric).expect("the skirt has room");
        group.throughput(Throughput::Elements(cloth.stitches()));
        for (part, is_swept) in [("without", false), ("with", true)] {
            let options = DrapeOptions { sweeps: Some(is_swept), ..DrapeOptions::default() };
            group.bench_function(BenchmarkId::new(part, name), |bench| {
                bench.iter(|| {
                    let deliver = &mut |_: &[Block]| Ok::<_, Infallible>(());
                    drape::run(&cloth, &options, &mut |_, _| (), deliver)
                });
            });
        }
    }
    group.finish();
}
