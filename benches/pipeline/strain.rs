//! Benchmarks of strained repeats: the table of a fabric, solved and read back from bytes, and a
//! frame of the skirt by the smooth and by the relaxed map, a data point.

use std::convert::Infallible;

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput};
use warpknit::drape::sequence::LocatedCloth;
use warpknit::drape::{Block, Cloth, DrapeOptions};
use warpknit::fabric::Fabric;
use warpknit::knit::Pattern;
use warpknit::knit::strain::{Strain, StrainTable};
use warpknit::map::Mapping;

use super::cpu::CpuTime;
use super::inputs::{area, skirt, tricot_for};

/// Two bars with a repeat of two courses, short laps and longer ones, and with one of eight.
const FABRICS: [&str; 3] = ["tricot", "locknit", "double-atlas"];
/// Stitches of the skirt whose points are mapped.
const STITCHES: f64 = 262_000.0;

pub(crate) fn benches(criterion: &mut Criterion<CpuTime>) {
    let mut group = criterion.benchmark_group("strains");
    group.sample_size(10);
    for name in FABRICS {
        let fabric = Fabric::named(name).expect("built in");
        let pattern = Pattern::new(&fabric);
        let table = || StrainTable::new(&fabric, &pattern).expect("a knit of two bars");
        group.bench_function(BenchmarkId::new("solve", name), |bench| {
            let solve = |table: StrainTable| table.prepare(strains(), &mut |_| ());
            bench.iter_batched(table, solve, BatchSize::PerIteration);
        });
        group.bench_function(BenchmarkId::new("read", name), |bench| {
            let solved = table();
            solved.prepare(strains(), &mut |_| ());
            let bytes = solved.to_bytes();
            let read = |table: StrainTable| assert!(table.load(&bytes));
            bench.iter_batched(table, read, BatchSize::PerIteration);
        });
    }
    group.finish();
    mappings(criterion);
}

/// Strains such as clothes have, up to a quarter.
fn strains() -> Vec<Strain> {
    const STRETCHES: [f64; 4] = [0.85, 0.95, 1.05, 1.15];
    let strains = STRETCHES.into_iter().flat_map(|courses| {
        STRETCHES
            .into_iter()
            .flat_map(move |wales| [-0.1, 0.1].map(|shear| Strain { courses, wales, shear }))
    });
    strains.collect()
}

/// A frame by each map, without solving.
fn mappings(criterion: &mut Criterion<CpuTime>) {
    let garment = skirt();
    let fabric = tricot_for(area(&garment), STITCHES);
    let cloth = Cloth::cover(&garment, &fabric).expect("the skirt has room");
    let mut located = LocatedCloth::locate(&cloth, &DrapeOptions::default(), &mut |_, _| {});
    let mut group = criterion.benchmark_group("map a frame, by the point");
    group.sample_size(10);
    group.throughput(Throughput::Elements(located.totals().data_points as u64));
    for (name, mapping) in
        [("frame", Mapping::Frame), ("smooth", Mapping::Smooth), ("relaxed", Mapping::Relaxed)]
    {
        let options = DrapeOptions { mapping, ..DrapeOptions::default() };
        let deliver = &mut |blocks: &[Block]| {
            std::hint::black_box(blocks);
            Ok::<_, Infallible>(())
        };
        group.bench_function(name, |bench| {
            bench.iter(|| located.run_frame(&garment, &options, &mut |_, _| {}, deliver));
        });
    }
    group.finish();
}
