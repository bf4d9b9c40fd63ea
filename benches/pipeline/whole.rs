//! Benchmarks of whole runs, from the garment to its yarns, at the sizes of Liu, Kyosev and Jiang
//! 2022 on the shipped skirt.

use std::time::Instant;

use criterion::{BenchmarkId, Criterion, Throughput};
use rayon::ThreadPoolBuilder;
use warpknit::drape::{self, Block, Cloth, DrapeOptions};

use super::cpu::CpuTime;
use super::inputs::{area, section, skirt, tricot_for};

pub(crate) fn benches(criterion: &mut Criterion<CpuTime>) {
    let garment = skirt();
    let mut group = criterion.benchmark_group("knit, locate and map");
    group.sample_size(10);
    for stitches in [576_u32, 3500, 8480, 26_180, 262_000] {
        let cloth = Cloth::cover(&garment, &tricot_for(area(&garment), f64::from(stitches)))
            .expect("the skirt has room");
        group.throughput(Throughput::Elements(u64::from(stitches)));
        group.bench_function(BenchmarkId::from_parameter(stitches), |bench| {
            bench.iter(|| run(&cloth, &DrapeOptions::default()));
        });
    }
    group.finish();
    threads(criterion);
}

/// Wall time by the number of threads: how well the work is parallelised.
fn threads(criterion: &mut Criterion<CpuTime>) {
    let garment = skirt();
    let fabric = tricot_for(area(&garment), 262_000.0);
    let cloth = Cloth::cover(&garment, &fabric).expect("the skirt has room");
    let options = DrapeOptions { surface: Some(section(&fabric)), ..DrapeOptions::default() };
    let mut group = criterion.benchmark_group("wall, 262k with tubes");
    group.sample_size(10);
    for count in [1, 2] {
        let threads = ThreadPoolBuilder::new().num_threads(count).build().expect("some threads");
        group.bench_function(BenchmarkId::new("threads", count), |bench| {
            let timed = || {
                let start = Instant::now();
                run(&cloth, &options);
                start.elapsed()
            };
            bench.iter_custom(|runs| threads.install(|| (0..runs).map(|_| timed()).sum()));
        });
    }
    group.finish();
}

/// Runs the pipeline on a cloth and discards its blocks.
fn run(cloth: &Cloth<'_>, options: &DrapeOptions) {
    let deliver = &mut |blocks: &[Block]| {
        std::hint::black_box(blocks);
        Ok::<_, std::convert::Infallible>(())
    };
    let Ok(totals) = drape::run(cloth, options, &mut |_, _| {}, deliver);
    std::hint::black_box(totals);
}
