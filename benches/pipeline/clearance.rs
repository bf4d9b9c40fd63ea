//! Benchmarks of sweeps and of the clearance on the body, a stitch at a time.

use std::convert::Infallible;

use criterion::{BenchmarkId, Criterion, Throughput};
use warpknit::drape::{self, Block, Cloth, DrapeOptions, clearance};
use warpknit::fabric::Fabric;
use warpknit::garment::Garment;

use super::cpu::CpuTime;
use super::inputs::{area, skirt};

/// About so many stitches are measured, and so many swept.
const MEASURED: f64 = 50_000.0;
const SWEPT: f64 = 5000.0;
/// Cloth without sweeps.
const AS_MAPPED: DrapeOptions = DrapeOptions {
    mapping: warpknit::map::Mapping::Relaxed,
    edge: warpknit::drape::strands::Edge::Clip,
    sweeps: Some(false),
    surface: None,
};

pub(crate) fn benches(criterion: &mut Criterion<CpuTime>) {
    let garment = skirt();
    let mut group = criterion.benchmark_group("clearance on the body");
    group.sample_size(10);
    for name in ["tricot", "locknit", "jersey"] {
        let fabric = fabric_for(&garment, name, MEASURED);
        let cloth = Cloth::cover(&garment, &fabric).expect("the skirt has room");
        group.throughput(Throughput::Elements(cloth.stitches()));
        group.bench_function(BenchmarkId::from_parameter(name), |bench| {
            bench.iter(|| clearance::measure(&cloth, &AS_MAPPED, fabric.radius(), &mut |_done| ()));
        });
    }
    group.finish();
    sweeps(criterion, &garment);
}

/// A run with sweeps and one without. A cable has no table, so sweeps alone keep its lengths.
fn sweeps(criterion: &mut Criterion<CpuTime>, garment: &Garment) {
    let mut group = criterion.benchmark_group("sweeps");
    group.sample_size(10);
    for name in ["tricot", "locknit", "jersey", "cable"] {
        let fabric = fabric_for(garment, name, SWEPT);
        let cloth = Cloth::cover(garment, &fabric).expect("the skirt has room");
        group.throughput(Throughput::Elements(cloth.stitches()));
        for (part, is_swept) in [("without", false), ("with", true)] {
            let options = DrapeOptions { sweeps: Some(is_swept), ..AS_MAPPED };
            group.bench_function(BenchmarkId::new(part, name), |bench| {
                bench.iter(|| {
                    let deliver = &mut |_: &[Block]| Ok::<_, Infallible>(());
                    let Ok(totals) = drape::run(&cloth, &options, &mut |_, _| (), deliver);
                    totals
                });
            });
        }
    }
    group.finish();
}

/// A fabric as dense as gives the garment its stitches.
fn fabric_for(garment: &Garment, name: &str, stitches: f64) -> Fabric {
    let fabric = Fabric::named(name).expect("built in");
    let cell = fabric.wale_spacing() * fabric.course_spacing();
    let bars = f64::from(u32::try_from(fabric.yarn_systems()).expect("a few"));
    let times = (bars * area(garment) / (cell * stitches)).sqrt();
    let [wales, courses] =
        [fabric.wales_per_cm, fabric.courses_per_cm].map(|density| density / times);
    fabric.at_densities(wales, courses).expect("positive")
}
