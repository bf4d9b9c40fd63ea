//! Benchmarks of writing tubes to files, for each vertex.
//!
//! 26180 stitches of tricot on the shipped skirt. The tubes are made beforehand; the files go to a
//! temporary folder; the system's share of the CPU time counts too. `bytes` only copies as many
//! bytes as the `.glb` has from memory to a file, which is a lower bound for every writer.

use std::sync::Arc;

use criterion::{BatchSize, Criterion, Throughput};
use warpknit::drape::{self, Block, Cloth, DrapeOptions};
use warpknit::export::glb::GlbWriter;
use warpknit::export::obj::ObjWriter;
use warpknit::export::ply::PlyWriter;
use warpknit::export::{Output, Sink, Wardrobe};
use warpknit::yarn::tube::Section;

use super::cpu::CpuTime;
use super::inputs::{area, section, skirt, tricot_for};

/// Blocks that a writer gets at once, as from [`drape::run`] with two threads.
const WINDOW: usize = 8;
/// Bytes of a `.glb` for each vertex, its share of the triangles included.
const GLB_BYTES: usize = 52;

/// The tubes of a cloth, in blocks.
fn tubes(cloth: &Cloth<'_>, section: Section) -> Vec<Block> {
    let mut held = Vec::new();
    let mut hold = |blocks: &[Block]| -> Result<(), std::convert::Infallible> {
        held.extend_from_slice(blocks);
        Ok(())
    };
    let Ok(_totals) = drape::run(
        cloth,
        &DrapeOptions { surface: Some(section), ..DrapeOptions::default() },
        &mut |_, _| {},
        &mut hold,
    );
    held
}

/// Writes all blocks. The file is deleted when the result is dropped, outside the measured time.
fn write_all(mut sink: impl Sink, blocks: &[Block]) -> Vec<Output> {
    blocks.chunks(WINDOW).try_for_each(|window| sink.take(window)).expect("room on the disk");
    Box::new(sink).finish().expect("room on the disk")
}

pub(crate) fn benches(criterion: &mut Criterion<CpuTime>) {
    let garment = skirt();
    let fabric = tricot_for(area(&garment), 26_180.0);
    let cloth = Cloth::cover(&garment, &fabric).expect("the skirt has room");
    let section = section(&fabric);
    let blocks = tubes(&cloth, section);
    let vertices: usize = blocks.iter().map(|block| block.tubes.positions.len()).sum();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name);
    let bytes = vec![7; 1 << 20];
    let plain = || Arc::new(Wardrobe::default());

    let mut group = criterion.benchmark_group("write");
    group.sample_size(10).throughput(Throughput::Elements(vertices as u64));
    let writers: [(&str, &dyn Fn() -> Vec<Output>); 4] = [
        ("bytes", &|| {
            let mut output = Output::create(&at("bytes")).expect("a new file");
            let pieces = || (0..vertices * GLB_BYTES / bytes.len()).map(|_| &bytes);
            output
                .write_with(|file| {
                    pieces().try_for_each(|piece| std::io::Write::write_all(file, piece))
                })
                .expect("room on the disk");
            vec![output]
        }),
        ("glb", &|| {
            let writer =
                GlbWriter::create(&at("skirt.glb"), &fabric, plain(), blocks.len(), cloth.yarns());
            write_all(writer.expect("a new file"), &blocks)
        }),
        ("obj", &|| {
            write_all(
                ObjWriter::create(&at("skirt.obj"), &fabric, plain()).expect("a new file"),
                &blocks,
            )
        }),
        ("ply", &|| {
            write_all(
                PlyWriter::create(&at("skirt.ply"), &fabric, &section).expect("a new file"),
                &blocks,
            )
        }),
    ];
    for (name, write) in writers {
        group.bench_function(name, |bench| {
            bench.iter_batched(|| (), |()| write(), BatchSize::PerIteration);
        });
    }
    group.finish();
}
