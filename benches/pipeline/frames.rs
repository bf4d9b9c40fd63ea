//! Benchmarks of a drape sequence on the shipped skirt in tricot: the first frame, which includes
//! all work that is done once, and each further frame.
//!
//! `first` reads two files, relaxes the fabric, lays and locates its yarns and maps them; `next`
//! reads the positions of another drape and maps.

use std::path::Path;

use criterion::{BenchmarkId, Criterion, Throughput};
use warpknit::drape::sequence::LocatedCloth;
use warpknit::drape::{Block, Cloth, DrapeOptions};
use warpknit::garment::{Frames, Garment, ReadOptions};

use super::cpu::CpuTime;
use super::inputs::{area, tricot_for};

pub(crate) fn benches(criterion: &mut Criterion<CpuTime>) {
    let meshes = Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes");
    let (flat, draped) = (meshes.join("skirt_flat.obj"), meshes.join("skirt_draped.obj"));
    let open =
        || Frames::read(&flat, Some(&draped), &ReadOptions::default()).expect("a shipped garment");
    let (mut garment, frames) = open();
    let mut group = criterion.benchmark_group("frames");
    group.sample_size(10);
    for stitches in [13_000_u32, 262_000] {
        let fabric = tricot_for(area(&garment), f64::from(stitches));
        group.throughput(Throughput::Elements(u64::from(stitches)));
        group.bench_function(BenchmarkId::new("first", stitches), |bench| {
            bench.iter(|| {
                let (garment, frames) = open();
                let cloth = Cloth::cover(&garment, &fabric).expect("the skirt has room");
                show(
                    &mut LocatedCloth::locate(&cloth, &DrapeOptions::default(), &mut |_, _| {}),
                    &garment,
                );
                frames
            });
        });
        // The first frame is done outside the measured time.
        let first = garment.clone();
        let cloth = Cloth::cover(&first, &fabric).expect("the skirt has room");
        let mut held = LocatedCloth::locate(&cloth, &DrapeOptions::default(), &mut |_, _| {});
        group.bench_function(BenchmarkId::new("next", stitches), |bench| {
            bench.iter(|| {
                frames.pose(&mut garment, &draped).expect("a shipped garment");
                show(&mut held, &garment);
            });
        });
    }
    group.finish();
}

/// Maps a frame and discards its blocks.
fn show(held: &mut LocatedCloth, garment: &Garment) {
    let deliver = &mut |blocks: &[Block]| {
        std::hint::black_box(blocks);
        Ok::<_, std::convert::Infallible>(())
    };
    let Ok(_strain) = held.run_frame(garment, &DrapeOptions::default(), &mut |_, _| {}, deliver);
}
